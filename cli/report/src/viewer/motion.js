// Rotations and poses. A rotation is a unit quaternion [x, y, z, w], camera-to-world; a camera looks along z, x is right and
// y down.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const difference = (a, b) => add(a, scaled(b, -1));

const product = ([ax, ay, az, aw], [bx, by, bz, bw]) => [
  aw * bx + ax * bw + ay * bz - az * by,
  aw * by - ax * bz + ay * bw + az * bx,
  aw * bz + ax * by - ay * bx + az * bw,
  aw * bw - ax * bx - ay * by - az * bz,
];

const unit = (q) => {
  const length = Math.hypot(...q);
  return q.map((value) => value / length);
};

/** The rotation by `angle` radians about `axis`, which has length 1. */
const turn = (axis, angle) => [...scaled(axis, Math.sin(angle / 2)), Math.cos(angle / 2)];

const rotate = (q, v) => {
  const t = scaled(cross(q, v), 2);
  return add(add(v, scaled(t, q[3])), cross(q, t));
};

/** Rows of the matrix that turns directions of the world into those of the camera. */
const cameraAxes = (q) => [rotate(q, [1, 0, 0]), rotate(q, [0, 1, 0]), rotate(q, [0, 0, 1])];

/** The rotation that is `share` of the way from one to another. */
const between = (from, to, share) => {
  const near = from.reduce((sum, value, k) => sum + value * to[k], 0) < 0 ? to.map((value) => -value) : to;
  return unit(from.map((value, k) => value + share * (near[k] - value)));
};
