// Runs in a worker: where each Gaussian in view is in the picture, the farthest first. Once for each of them: a graphics card
// would do it for each corner, which takes most of the time where there is none.

/** Bytes of a corner: two floats for its place on the canvas, from -1 to 1, and the codes of colour and opacity, two bytes each. */
const CORNER = 16;

/** The source of the worker; it gets the Gaussians once, then a view at a time, and answers with the corners of its splats. */
const projector = () => {
  /** Bits of a depth that do not count: 2^13 steps are left from one power of two to the next, 0.2 mm at 2 m. */
  const COARSE = 10;
  let held = null;
  let keys = null;
  let depths = null;
  let drawn = null;
  let sorted = null;
  let starts = new Uint32Array(1);
  const weights = gaussianWeights();

  onmessage = ({ data }) => {
    if (data.places) {
      held = data;
      const count = held.radii.length;
      [keys, drawn, sorted] = [new Uint32Array(count), new Uint32Array(count), new Uint32Array(count)];
      depths = new Float32Array(keys.buffer);
      return;
    }
    const count = select(data);
    sort(count);
    if (data.isPainted) {
      const pixels = paint(data, count);
      postMessage({ pixels }, [pixels.buffer]);
      return;
    }
    const corners = data.spare ?? new ArrayBuffer(4 * CORNER * held.radii.length);
    project(data, count, new Float32Array(corners), new Uint32Array(corners));
    postMessage({ corners, count }, [corners]);
  };

  // Keeps what may be in view, with the bits of its depth: for positive numbers they are in the same order.
  const select = ({ axes: [[rx, ry, rz], [dx, dy, dz], [fx, fy, fz]], place: [px, py, pz], beyond: [wide, high], near }) => {
    const { places, radii } = held;
    let count = 0;
    for (let k = 0; k < radii.length; k++) {
      const x = places[3 * k] - px;
      const y = places[3 * k + 1] - py;
      const z = places[3 * k + 2] - pz;
      const depth = fx * x + fy * y + fz * z;
      const most = radii[k];
      if (depth <= near || most <= 0) continue;
      if (Math.abs(rx * x + ry * y + rz * z) - most > wide * (depth + most)) continue;
      if (Math.abs(dx * x + dy * y + dz * z) - most > high * (depth + most)) continue;
      depths[count] = depth;
      drawn[count++] = k;
    }
    return count;
  };

  // By counting, the farthest first; equal depths stay in the order of their indices, the last of them first.
  const sort = (count) => {
    let [least, most] = [0xffffffff, 0];
    for (let k = 0; k < count; k++) {
      if (keys[k] < least) least = keys[k];
      if (keys[k] > most) most = keys[k];
    }
    const last = count > 0 ? (most - least) >>> COARSE : 0;
    if (starts.length < last + 2) starts = new Uint32Array(last + 2);
    else starts.fill(0, 0, last + 2);
    for (let k = 0; k < count; k++) starts[last - ((keys[k] - least) >>> COARSE) + 1]++;
    for (let key = 0; key <= last; key++) starts[key + 1] += starts[key];
    for (let k = count - 1; k >= 0; k--) sorted[starts[last - ((keys[k] - least) >>> COARSE)]++] = drawn[k];
  };

  // Where a Gaussian is in the picture: its place and its covariance, both in pixels.
  const splat = { x: 0, y: 0, xx: 0, xy: 0, yy: 0 };
  const locate = ({ axes, place: [px, py, pz], camera: [focalX, focalY, centreX, centreY], limits, lowPass }, index) => {
    const [[rx, ry, rz], [dx, dy, dz], [fx, fy, fz]] = axes;
    const { places, shapes } = held;
    const x = places[3 * index] - px;
    const y = places[3 * index + 1] - py;
    const z = places[3 * index + 2] - pz;
    const ahead = 1 / (fx * x + fy * y + fz * z);
    const slopeX = (rx * x + ry * y + rz * z) * ahead;
    const slopeY = (dx * x + dy * y + dz * z) * ahead;
    // The projection is linearised at the centre, but not far beyond the border of the image.
    const nearX = Math.min(Math.max(slopeX, limits[0]), limits[2]);
    const nearY = Math.min(Math.max(slopeY, limits[1]), limits[3]);
    const [scaleX, scaleY] = [focalX * ahead, focalY * ahead];
    const [ux, uy, uz] = [scaleX * (rx - nearX * fx), scaleX * (ry - nearX * fy), scaleX * (rz - nearX * fz)];
    const [vx, vy, vz] = [scaleY * (dx - nearY * fx), scaleY * (dy - nearY * fy), scaleY * (dz - nearY * fz)];
    const s = 6 * index;
    const [a, b, c, d, e, f] = [shapes[s], shapes[s + 1], shapes[s + 2], shapes[s + 3], shapes[s + 4], shapes[s + 5]];
    const [sx, sy, sz] = [a * ux + b * uy + c * uz, b * ux + d * uy + e * uz, c * ux + e * uy + f * uz];
    splat.x = focalX * slopeX + centreX;
    splat.y = focalY * slopeY + centreY;
    // A splat is never thinner than about a pixel of the recording: there is no more detail in the map.
    splat.xx = sx * ux + sy * uy + sz * uz + lowPass;
    splat.xy = sx * vx + sy * vy + sz * vz;
    splat.yy = (a * vx + b * vy + c * vz) * vx + (b * vx + d * vy + e * vz) * vy + (c * vx + e * vy + f * vz) * vz + lowPass;
  };

  // The corners of the splats for WebGL, with their colours.
  const project = (view, count, out, codes) => {
    const { reaches, colours } = held;
    const [toX, toY] = [2 / view.size[0], -2 / view.size[1]];
    for (let at = 0, k = 0; k < count; k++, at += 16) {
      const index = sorted[k];
      locate(view, index);
      const { x, y, xx, xy, yy } = splat;
      const middle = 0.5 * (xx + yy);
      const half = 0.5 * (xx - yy);
      const apart = Math.sqrt(half * half + xy * xy);
      const longest = middle + apart;
      const shortest = Math.max((xx * yy - xy * xy) / longest, 1e-6);
      // The direction of the longer axis.
      let [alongX, alongY] = [1, 0];
      if (apart >= 1e-6 * middle) {
        [alongX, alongY] = half > 0 ? [longest - yy, xy] : [xy, longest - xx];
        const length = Math.sqrt(alongX * alongX + alongY * alongY);
        [alongX, alongY] = [alongX / length, alongY / length];
      }
      // Up to where it is fainter than a step of eight bits.
      const [long, short] = [reaches[index] * Math.sqrt(longest), reaches[index] * Math.sqrt(shortest)];
      const [ax, ay] = [toX * long * alongX, toY * long * alongY];
      const [bx, by] = [-toX * short * alongY, toY * short * alongX];
      const [left, top] = [toX * (x + 0.5) - 1, toY * (y + 0.5) + 1];
      out[at] = left - ax - bx;
      out[at + 1] = top - ay - by;
      out[at + 4] = left + ax - bx;
      out[at + 5] = top + ay - by;
      out[at + 8] = left - ax + bx;
      out[at + 9] = top - ay + by;
      out[at + 12] = left + ax + bx;
      out[at + 13] = top + ay + by;
      const [low, high] = [colours[2 * index], colours[2 * index + 1]];
      for (let corner = at + 2; corner < at + 16; corner += 4) [codes[corner], codes[corner + 1]] = [low, high];
    }
  };

  // The picture itself, as floats of light.
  const paint = (view, count) => {
    const { reaches, colours, range: [least, most] } = held;
    const light = (code) => least + code * (most - least) / 65535;
    const { pixels, put } = sheet(view.size, { ...weights, floats: new ArrayBuffer(16 * view.size[0] * view.size[1]) });
    for (let k = count - 1; k >= 0; k--) {
      const index = sorted[k];
      locate(view, index);
      const [low, high] = [colours[2 * index], colours[2 * index + 1]];
      const [red, green, blue] = [light(low & 65535), light(low >>> 16), light(high & 65535)];
      put(splat.x, splat.y, splat.xx, splat.xy, splat.yy, reaches[index], (high >>> 16) / 65535, red, green, blue);
    }
    return pixels;
  };
};

const startProjector = () => {
  const parts = [`const CORNER = ${CORNER};`, `const sheet = ${sheet};`, `const gaussianWeights = ${gaussianWeights};`, `(${projector})();`];
  return new Worker(URL.createObjectURL(new Blob([parts.join('\n')], { type: 'text/javascript' })));
};

/** What the projector needs to know for a picture of `camera`, in pixels of a canvas, at `share` of the resolution. */
const projection = ({ axes, place, focal: [fx, fy], centre: [cx, cy], scale }, { width, height }, share) => {
  const size = [width, height].map((side) => Math.max(1, Math.round(side * share)));
  const [sx, sy] = [size[0] / width, size[1] / height];
  const camera = [fx * sx, fy * sy, (cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5];
  // Slopes of rays to the border that is farther away, and a little beyond.
  const beyond = [0, 1].map((k) => 1.05 * Math.max(camera[2 + k] + 1, size[k] - camera[2 + k]) / camera[k]);
  const lowPass = 0.3 * Math.max(1, scale * sx) ** 2;
  return { axes, place, camera, size, beyond, limits: slopeLimits(size, camera), lowPass, near: 0.01 };
};

/** Slopes of rays, 0.3 of half the image beyond its borders: least x and y, greatest x and y. */
const slopeLimits = ([width, height], [fx, fy, cx, cy]) => {
  const [beyondX, beyondY] = [0.15 * width / fx, 0.15 * height / fy];
  return [
    (-0.5 - cx) / fx - beyondX, (-0.5 - cy) / fy - beyondY,
    (width - 0.5 - cx) / fx + beyondX, (height - 0.5 - cy) / fy + beyondY,
  ];
};
