// Mouse, fingers and keys.

/** Radians per pixel of a drag, and per press of a key. */
const [DRAG, KEY_TURN] = [0.005, 0.06];
/** Share of the distance to what is looked at per pixel of a drag, per press of a key, and per pixel of the wheel. */
const [PAN, KEY_STEP, WHEEL] = [0.0013, 0.05, 0.0012];
/** Pixels that a finger may move and still click. */
const STILL = 5;

/** Calls `eye.turn`, `eye.pan`, `eye.dolly`, and `click` with a place on the element. */
const listen = (element, eye, { click, home, step }) => {
  const fingers = new Map();
  let moved = 0;
  const place = (event) => [event.clientX, event.clientY];
  const middle = () => {
    const all = [...fingers.values()];
    const [x, y] = [0, 1].map((axis) => all.reduce((sum, point) => sum + point[axis], 0) / all.length);
    const spread = all.length > 1 ? Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]) : 0;
    return { x, y, spread };
  };
  element.addEventListener('pointerdown', (event) => {
    element.setPointerCapture(event.pointerId);
    if (fingers.size === 0) moved = 0;
    fingers.set(event.pointerId, place(event));
    eye.aim();
  });
  element.addEventListener('pointermove', (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = middle();
    fingers.set(event.pointerId, place(event));
    const after = middle();
    const [x, y] = [after.x - before.x, after.y - before.y];
    moved += Math.hypot(x, y) + Math.abs(after.spread - before.spread);
    if (moved < STILL) return;
    if (fingers.size > 1) {
      eye.pan(-PAN * x, -PAN * y);
      if (before.spread > 0 && after.spread > 0) eye.dolly(before.spread / after.spread);
    } else if (event.buttons & 6 || event.shiftKey) eye.pan(-PAN * x, -PAN * y);
    else eye.turn(DRAG * x, DRAG * y);
  });
  const lift = (event) => {
    const isClick = event.type === 'pointerup' && fingers.size === 1 && moved < STILL;
    fingers.delete(event.pointerId);
    if (!isClick) return;
    const box = element.getBoundingClientRect();
    click([event.clientX - box.left, event.clientY - box.top]);
  };
  element.addEventListener('pointerup', lift);
  element.addEventListener('pointercancel', lift);
  element.addEventListener('contextmenu', (event) => event.preventDefault());
  element.addEventListener('wheel', (event) => {
    event.preventDefault();
    eye.aim();
    const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
    eye.dolly(Math.exp(WHEEL * Math.max(-400, Math.min(400, pixels))));
  }, { passive: false });
  element.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const keys = {
      ArrowLeft: () => eye.turn(KEY_TURN, 0), ArrowRight: () => eye.turn(-KEY_TURN, 0),
      ArrowUp: () => eye.turn(0, KEY_TURN), ArrowDown: () => eye.turn(0, -KEY_TURN),
      w: () => eye.forward(KEY_STEP), s: () => eye.forward(-KEY_STEP),
      a: () => eye.pan(-KEY_STEP, 0), d: () => eye.pan(KEY_STEP, 0),
      q: () => eye.pan(0, KEY_STEP), e: () => eye.pan(0, -KEY_STEP),
      '+': () => eye.dolly(1 - KEY_STEP), '-': () => eye.dolly(1 + KEY_STEP),
      Home: home, n: () => step(1), p: () => step(-1),
    };
    const action = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    eye.aim();
    action();
  });
};
