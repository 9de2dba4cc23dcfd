// Puts the parts together. `#frame=12` in the address starts at that keyframe, `#plain` shows the picture alone, `#painted`
// draws every picture in the worker.

/** Milliseconds without motion after which the picture is drawn at its full resolution. */
const REST = 140;
/** While it moves: least share of the resolution, and milliseconds between pictures that are too many and few enough. */
const [LEAST_SHARE, SLOW, FAST] = [0.2, 60, 40];
/** Milliseconds for a picture of the full resolution above which pictures that move are painted by the worker. */
const SLOW_CARD = 60;
/** Pixels around a keyframe that are its own. */
const GRIP = 18;

const startViewer = (root) => {
  const part = (name) => root.querySelector(`.${name}`);
  const data = JSON.parse(part('scene').textContent);
  const map = unpack(part('gaussians').textContent, data);
  const [canvas, lines, picture] = ['map', 'lines', 'picture'].map(part);
  const splats = new Splats(canvas, map.radii.length, Float32Array.from(data.curve, (value) => value / 65535), data.colours);
  const overlay = new Overlay(lines);
  const worker = startProjector();
  worker.postMessage(map);

  // `view` counts poses and sizes; a picture of one is asked for, comes from the projector, and is drawn.
  const state = { share: 1, view: 0, asked: null, come: null, spare: null, pending: false, last: 0, moved: 0, chosen: -1, marks: [] };
  const settled = [];
  const isAlwaysPainted = /painted/.test(location.hash) && splats.isHalf;
  // Whether the graphics card is, or whether there is none; unknown before the first picture.
  let isSlow = null;
  let rest = 0;

  const eye = new Eye(map.places, data.up, (byPerson) => {
    state.view += 1;
    state.moved = performance.now();
    if (byPerson && state.chosen >= 0) {
      setLayer('map');
      choose(-1);
    }
    request();
    clearTimeout(rest);
    rest = setTimeout(request, REST);
  });

  // The camera of the recording, as large as fits on the canvas.
  const camera = () => {
    const { width, height, focal, centre } = data.camera;
    const scale = Math.min(canvas.width / width, canvas.height / height);
    const border = [(canvas.width - width * scale) / 2, (canvas.height - height * scale) / 2];
    return {
      axes: cameraAxes(eye.rotation),
      place: eye.place,
      focal: focal.map((value) => value * scale),
      centre: centre.map((value, k) => (value + 0.5) * scale + border[k] - 0.5),
      scale,
      border,
    };
  };

  // While nothing moves the picture has the full resolution.
  const share = () => performance.now() - state.moved >= REST ? 1 : state.share;

  // The next picture is projected while the last one is drawn.
  const ask = () => {
    const asked = { number: state.view, share: share() };
    const isKnown = (picture) => picture && picture.number === asked.number && picture.share === asked.share;
    if (state.asked || isKnown(state.come)) return;
    const view = camera();
    const how = projection(view, canvas, asked.share);
    state.asked = { ...asked, view, size: how.size };
    const isPainted = isAlwaysPainted || isSlow && asked.share < 1;
    const spare = isPainted ? null : state.spare;
    worker.postMessage({ ...how, isPainted, spare }, spare ? [spare] : []);
    if (spare) state.spare = null;
  };
  worker.onmessage = ({ data }) => {
    state.come = { ...state.asked, ...data, isNew: true };
    state.asked = null;
    request();
  };

  const put = (picture) => {
    if (picture.pixels) {
      splats.drawPainted(picture);
      return;
    }
    splats.draw(picture);
    if (isSlow === null) {
      // The first time takes longer: what draws is compiled then.
      splats.finish();
      const start = performance.now();
      splats.draw(picture);
      splats.finish();
      isSlow = splats.isHalf && performance.now() - start > SLOW_CARD;
    }
    state.spare = picture.corners;
  };

  const request = () => {
    if (state.pending) return;
    state.pending = true;
    requestAnimationFrame(draw);
  };

  const draw = (now) => {
    state.pending = false;
    const picture = state.come;
    if (picture?.isNew) {
      put(picture);
      picture.isNew = false;
      if (picture.number !== state.view) adapt(now - state.last);
      state.last = now;
    }
    ask();
    if (picture) drawLines(picture.view);
    const isStill = picture?.number === state.view && picture.share === 1 && !state.asked;
    if (isStill) settled.splice(0).forEach((done) => done());
  };

  const adapt = (interval) => {
    if (interval > SLOW) state.share = Math.max(LEAST_SHARE, state.share * 0.8);
    else if (interval < FAST) state.share = Math.min(1, state.share * 1.05);
  };

  const drawLines = (view) => {
    const ratio = lines.width / Math.max(1, lines.clientWidth);
    lines.hidden = !part('show-lines').checked || !picture.hidden;
    if (lines.hidden) {
      state.marks = [];
      return;
    }
    const marks = overlay.draw(view, data, { distance: data.size, ratio, chosen: state.chosen });
    state.marks = marks.map((mark) => mark && mark.map((value) => value / ratio));
  };

  const buttons = data.keyframes.map((keyframe, k) => {
    const button = document.createElement('button');
    const image = keyframe.deblurred || keyframe.captured;
    button.type = 'button';
    button.title = `frame ${keyframe.frame}`;
    button.innerHTML = image ? `<img alt="frame ${keyframe.frame}" src="data:image/jpeg;base64,${image}">` : keyframe.frame;
    button.addEventListener('click', () => visit(k));
    part('strip').append(button);
    return button;
  });

  const layer = () => root.querySelector('.layers input:checked').value;
  const setLayer = (name) => { root.querySelector(`.layers input[value=${name}]`).checked = true; };

  // A picture of the keyframe lies over the map exactly: both are seen by the same camera from the same place.
  const choose = (k) => {
    state.chosen = k;
    buttons.forEach((button, index) => button.setAttribute('aria-pressed', String(index === k)));
    const image = data.keyframes[k]?.[layer()];
    picture.hidden = !image;
    if (image) picture.src = `data:image/jpeg;base64,${image}`;
    request();
  };

  const changeLayer = () => {
    if (state.chosen >= 0 || layer() === 'map') choose(state.chosen);
    else visit(nearestKeyframe());
  };

  const nearestKeyframe = () => {
    const far = data.keyframes.map((keyframe) => Math.hypot(...difference(keyframe.place, eye.place)));
    return far.indexOf(Math.min(...far));
  };

  const visit = (k, atOnce = false) => {
    const keyframe = data.keyframes[k];
    if (!keyframe) return;
    choose(-1);
    if (atOnce) {
      eye.jump(keyframe.place, keyframe.rotation);
      choose(k);
    } else eye.fly(keyframe.place, keyframe.rotation, () => choose(k));
    buttons[k].scrollIntoView({ block: 'nearest', inline: 'nearest' });
    state.visited = k;
  };

  const step = (by) => {
    const count = data.keyframes.length;
    if (count > 0) visit(((state.visited ?? (by > 0 ? -1 : 0)) + by + count) % count);
  };

  const home = () => {
    choose(-1);
    eye.fly(data.start.place, data.start.rotation, () => choose(-1));
  };

  const click = ([x, y]) => {
    canvas.focus({ preventScroll: true });
    const near = state.marks.map((mark) => mark ? Math.hypot(mark[0] - x, mark[1] - y) : Infinity);
    const nearest = near.indexOf(Math.min(...near));
    if (near[nearest] < GRIP) visit(nearest);
  };

  const resize = () => {
    const ratio = Math.min(2, devicePixelRatio);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
    if (state.view > 0 && canvas.width === width && canvas.height === height) return;
    for (const sheet of [canvas, lines]) Object.assign(sheet, { width, height });
    // A canvas of another size is empty: the last picture is stretched until the next one comes.
    if (splats.size[0] > 0) splats.show();
    const { scale, border } = camera();
    const lengths = [border[0], border[1], data.camera.width * scale, data.camera.height * scale];
    const [left, top, wide, high] = lengths.map((pixels) => `${pixels / ratio}px`);
    Object.assign(picture.style, { left, top, width: wide, height: high });
    state.view += 1;
    state.moved = 0;
    request();
  };

  listen(canvas, eye, { click, home, step });
  part('show-lines').addEventListener('change', request);
  part('home').addEventListener('click', home);
  root.querySelectorAll('.layers input').forEach((input) => input.addEventListener('change', changeLayer));
  new ResizeObserver(resize).observe(canvas);
  canvas.addEventListener('webglcontextlost', () => fail(root, 'The graphics context is lost; load the page again.'));

  if (/plain/.test(location.hash)) root.classList.add('plain');
  const frame = /frame=(\d+)/.exec(location.hash);
  const asked = frame ? data.keyframes.findIndex((keyframe) => keyframe.frame === Number(frame[1])) : -1;
  resize();
  eye.jump(data.start.place, data.start.rotation);
  choose(-1);
  if (asked >= 0) visit(asked, true);
  // For scripts: goes to a pose, and waits until its picture is there.
  root.show = (place, rotation) => new Promise((done) => {
    settled.push(done);
    eye.jump(place, rotation);
  });
};

const fail = (root, message) => {
  root.classList.add('failed');
  root.querySelector('.message').textContent = message;
};

for (const root of document.querySelectorAll('.viewer')) {
  try {
    startViewer(root);
  } catch (error) {
    fail(root, `The map cannot be shown: ${error.message}.`);
  }
}
