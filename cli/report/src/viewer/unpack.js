// What the page holds of the map: `pack.rs` has the layout.

/** Bytes of a packed Gaussian. */
const PACKED = 26;

const bytesOf = (base64) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));

const within = ([least, greatest], share) => least + share * (greatest - least);

/**
 * What the projector wants of every Gaussian: centre, radius, six elements of the covariance (metres), where it ends in standard
 * deviations, and the codes of red, green, blue and opacity, two bytes each. `scales` and `range` (of colours) are
 * what the least and greatest code mean.
 */
const unpack = (base64, { scales, colours: range }) => {
  const bytes = bytesOf(base64);
  const view = new DataView(bytes.buffer);
  const count = Math.floor(bytes.length / PACKED);
  const [places, radii, shapes, reaches] = [3, 1, 6, 1].map((values) => new Float32Array(values * count));
  const colours = new Uint32Array(2 * count);
  for (let k = 0; k < count; k++) {
    const at = k * PACKED;
    const place = [0, 4, 8].map((byte) => view.getFloat32(at + byte, true));
    const deviations = [12, 13, 14].map((byte) => Math.exp(within(scales, view.getUint8(at + byte) / 255)));
    const rotation = unit([16, 17, 18, 15].map((byte) => view.getInt8(at + byte)));
    const opacity = view.getUint8(at + 19);
    const [red, green, blue] = [20, 22, 24].map((byte) => view.getUint16(at + byte, true));
    // Own axes as long as the deviations; the covariance is the sum of their squares.
    const own = cameraAxes(rotation).map((axis, i) => scaled(axis, deviations[i]));
    const moment = (i, j) => own.reduce((sum, axis) => sum + axis[i] * axis[j], 0);
    places.set(place, 3 * k);
    shapes.set([moment(0, 0), moment(0, 1), moment(0, 2), moment(1, 1), moment(1, 2), moment(2, 2)], 6 * k);
    // A splat ends where it is fainter than a step of eight bits, and nothing is seen of one that is fainter everywhere.
    reaches[k] = Math.sqrt(2 * Math.log(Math.max(1, opacity)));
    radii[k] = reaches[k] * Math.max(...deviations);
    // The first of two values lies in the lower bytes, as in all of today's machines. A byte times 257 is the same share.
    colours.set([red | green << 16, blue | 257 * opacity << 16], 2 * k);
  }
  return { places, radii, shapes, reaches, colours, range };
};
