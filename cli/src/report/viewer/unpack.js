// What the page holds of the map: `pack.rs` has the layout.

/** Bytes of a packed Gaussian. */
const PACKED = 26;

const bytesOf = (base64) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));

const within = ([least, greatest], share) => least + share * (greatest - least);

/** Numbers for `Splats`, and centres and radii in metres. `scales` and `colours` are what the least and greatest number mean. */
const unpack = (base64, { scales, colours }) => {
  const bytes = bytesOf(base64);
  const view = new DataView(bytes.buffer);
  const count = Math.floor(bytes.length / PACKED);
  const [texels, places, radii] = [count * FLOATS, count * 3, count].map((length) => new Float32Array(length));
  for (let k = 0; k < count; k++) {
    const at = k * PACKED;
    const place = [0, 4, 8].map((byte) => view.getFloat32(at + byte, true));
    const deviations = [12, 13, 14].map((byte) => Math.exp(within(scales, view.getUint8(at + byte) / 255)));
    const rotation = unit([16, 17, 18, 15].map((byte) => view.getInt8(at + byte)));
    const opacity = view.getUint8(at + 19) / 255;
    const colour = [20, 22, 24].map((byte) => within(colours, view.getUint16(at + byte, true) / 65535));
    // Own axes as long as the deviations; the covariance is the sum of their squares.
    const own = cameraAxes(rotation).map((axis, i) => scaled(axis, deviations[i]));
    const moment = (i, j) => own.reduce((sum, axis) => sum + axis[i] * axis[j], 0);
    texels.set([
      ...place, opacity, moment(0, 0), moment(0, 1), moment(0, 2), moment(1, 1), moment(1, 2), moment(2, 2), ...colour,
    ], k * FLOATS);
    places.set(place, 3 * k);
    // A splat ends where it is fainter than a step of eight bits: below 3.4 deviations.
    radii[k] = 3.4 * Math.max(...deviations);
  }
  return { texels, places, radii };
};
