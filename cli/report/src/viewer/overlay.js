// The path of the camera over the picture: a thin line, an arc for every exposure, a pyramid for every keyframe.

/** Nearest depth of what is drawn, metres. */
const NEAREST = 0.03;
/** Length of a keyframe's pyramid, as a share of how large things are. */
const PYRAMID = 0.025;
/** Keyframes that are nearer than so many of these lengths are left out: the view is inside. */
const INSIDE = 3;

class Overlay {
  constructor(canvas) {
    this.context = canvas.getContext('2d');
  }

  /** Draws for a camera in pixels of the canvas; returns where the keyframes are on it. */
  draw(camera, { exposures, keyframes, camera: { width, height, focal } }, { distance, ratio, chosen }) {
    const { context } = this;
    context.clearRect(0, 0, context.canvas.width, context.canvas.height);
    context.lineCap = 'round';
    const length = PYRAMID * distance;
    const [wide, high] = [0.5 * width / focal[0], 0.5 * height / focal[1]];
    this.lines(camera, exposures.map((exposure) => exposure[1]), '#ffffff66', ratio);
    for (const exposure of exposures) this.lines(camera, arc(exposure), '#ffb02e', 2.5 * ratio);
    return keyframes.map((keyframe, k) => {
      const tip = keyframe.place;
      if (Math.hypot(...difference(tip, camera.place)) < INSIDE * length) return null;
      const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) =>
        add(tip, rotate(keyframe.rotation, scaled([x * wide, y * high, 1], length))));
      const colour = k === chosen ? '#5cb8ff' : '#5cb8ff99';
      this.lines(camera, [...corners, corners[0]], colour, 1.5 * ratio);
      for (const corner of corners) this.lines(camera, [tip, corner], colour, ratio);
      return pixelOf(camera, add(tip, rotate(keyframe.rotation, [0, 0, length])));
    });
  }

  /** A line through points of the world; what is behind the camera is left out. */
  lines(camera, points, colour, width) {
    const { context } = this;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.beginPath();
    let before = null;
    for (const point of points.map((point) => seenBy(camera, point))) {
      if (before && (before[2] > NEAREST || point[2] > NEAREST)) {
        context.moveTo(...onImage(camera, cut(before, point)));
        context.lineTo(...onImage(camera, cut(point, before)));
      }
      before = point;
    }
    context.stroke();
  }
}

/** Points of the parabola through the places at opening, middle and closing of the shutter. */
const arc = ([start, middle, end]) => Array.from({ length: 9 }, (_, k) => {
  const t = k / 4 - 1;
  return add(add(scaled(start, t * (t - 1) / 2), scaled(middle, 1 - t * t)), scaled(end, t * (t + 1) / 2));
});

const seenBy = ({ axes, place }, point) => axes.map((axis) => dot(axis, difference(point, place)));

const onImage = ({ focal, centre }, [x, y, z]) => [
  focal[0] * x / z + centre[0] + 0.5, focal[1] * y / z + centre[1] + 0.5,
];

/** The point, or where the line from it to another one comes in front of the camera. */
const cut = (point, other) => {
  if (point[2] > NEAREST) return point;
  const share = (NEAREST - point[2]) / (other[2] - point[2]);
  return add(point, scaled(difference(other, point), share));
};

/** Where a point is on the canvas; nothing for one behind the camera. */
const pixelOf = (camera, point) => {
  const seen = seenBy(camera, point);
  return seen[2] > NEAREST ? onImage(camera, seen) : null;
};
