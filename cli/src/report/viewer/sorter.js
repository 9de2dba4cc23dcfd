// Runs in a worker: which Gaussians are in view, the farthest first.

/** The source of the worker; it gets the centres once, then a view at a time, and answers with indices. */
const sorter = () => {
  let places = null;
  let radii = null;
  let keys = null;
  let order = [];
  onmessage = ({ data }) => {
    if (data.places) {
      ({ places, radii } = data);
      const count = radii.length;
      keys = new Uint32Array(count);
      order = [new Uint32Array(count), new Uint32Array(count)];
      return;
    }
    const drawn = project(data);
    // Two passes over 16 bits each; a stable sort leaves ties in the order of their indices.
    pass(drawn, order[0], order[1], 0);
    pass(drawn, order[1], order[0], 16);
    const sorted = order[0].slice(0, drawn).reverse();
    postMessage({ sorted, view: data.view }, [sorted.buffer]);
  };

  // Keeps what may be in view, with the bits of its depth: for positive numbers they are in the same order.
  const project = ({ axes: [[rx, ry, rz], [dx, dy, dz], [fx, fy, fz]], place: [px, py, pz], reach: [wide, high], near }) => {
    const depths = new Float32Array(keys.buffer);
    let drawn = 0;
    for (let k = 0; k < radii.length; k++) {
      const x = places[3 * k] - px;
      const y = places[3 * k + 1] - py;
      const z = places[3 * k + 2] - pz;
      const depth = fx * x + fy * y + fz * z;
      if (depth <= near) continue;
      const most = radii[k];
      if (Math.abs(rx * x + ry * y + rz * z) - most > wide * (depth + most)) continue;
      if (Math.abs(dx * x + dy * y + dz * z) - most > high * (depth + most)) continue;
      depths[k] = depth;
      order[0][drawn++] = k;
    }
    return drawn;
  };

  const pass = (count, from, to, shift) => {
    const starts = new Uint32Array(65537);
    for (let k = 0; k < count; k++) starts[(keys[from[k]] >>> shift & 65535) + 1]++;
    for (let digit = 0; digit < 65536; digit++) starts[digit + 1] += starts[digit];
    for (let k = 0; k < count; k++) to[starts[keys[from[k]] >>> shift & 65535]++] = from[k];
  };
};

const startSorter = () => new Worker(URL.createObjectURL(new Blob([`(${sorter})()`], { type: 'text/javascript' })));
