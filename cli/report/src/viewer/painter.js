// Draws Gaussians without a graphics card, in the worker: a few pixels of many splats take less time than the triangles of WebGL
// that is computed by the processor.

/** A sheet of `size` pixels on which splats are put, the nearest first; its rows go up, as those of WebGL do. */
const sheet = ([width, height], { floats, weights, LAST }) => {
  // Red, green and blue light of every pixel, and what is let through from behind.
  const pixels = new Float32Array(floats, 0, 4 * width * height).fill(0);
  for (let k = 3; k < pixels.length; k += 4) pixels[k] = 1;
  // At `x`, `y`, with the covariance `xx`, `xy`, `yy` in pixels, and `reach` standard deviations large.
  const put = (x, y, xx, xy, yy, reach, opacity, red, green, blue) => {
    const inverse = 1 / (xx * yy - xy * xy);
    const [a, b, c] = [yy * inverse, -xy * inverse, xx * inverse];
    const most = reach * reach;
    const high = reach * Math.sqrt(yy);
    const [top, bottom] = [Math.max(0, Math.ceil(y - high)), Math.min(height - 1, Math.floor(y + high))];
    for (let row = top; row <= bottom; row++) {
      const down = row - y;
      // The row within the ellipse.
      const middle = -b * down / a;
      const wide = Math.sqrt(Math.max(0, most - (c - b * b / a) * down * down) / a);
      const [first, last] = [Math.max(0, Math.ceil(x + middle - wide)), Math.min(width - 1, Math.floor(x + middle + wide))];
      for (let column = first, at = 4 * ((height - 1 - row) * width + first); column <= last; column++, at += 4) {
        const through = pixels[at + 3];
        if (through < 1 / 255) continue;
        const aside = column - x - middle;
        const square = a * aside * aside + (c - b * b / a) * down * down;
        const alpha = Math.min(opacity * weights[square * LAST / 12 | 0], 0.999);
        const share = alpha * through;
        pixels[at] += share * red;
        pixels[at + 1] += share * green;
        pixels[at + 2] += share * blue;
        pixels[at + 3] = through - share;
      }
    }
  };
  return { pixels, put };
};

/** Weights of a Gaussian by the square of the distance in standard deviations, from 0 to 12: more than the reach of any. */
const gaussianWeights = () => {
  const LAST = 4095;
  return { LAST, weights: Float32Array.from({ length: LAST + 2 }, (_, k) => Math.exp(-0.5 * (k + 0.5) * 12 / LAST)) };
};
