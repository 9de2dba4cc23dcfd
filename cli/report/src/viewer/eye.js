// From where the map is looked at, and how that moves.

/** Nearest and farthest that what is looked at may be, metres. */
const [CLOSEST, FARTHEST] = [0.05, 200];
/** Milliseconds of the flight to another view. */
const FLIGHT = 450;

class Eye {
  /** `up` is a direction of the world; `moved` is called after every change, with whether a person made it. */
  constructor(places, up, moved) {
    Object.assign(this, { places, up, moved, place: [0, 0, 0], rotation: [0, 0, 0, 1], distance: 1, flight: 0 });
  }

  /** Measures how far away what is in the middle of the view is: the median depth of the Gaussians around its axis. */
  aim() {
    const [right, down, forward] = cameraAxes(this.rotation);
    const depths = [];
    for (let k = 0; k < this.places.length; k += 3) {
      const offset = difference([this.places[k], this.places[k + 1], this.places[k + 2]], this.place);
      const depth = dot(forward, offset);
      const aside = Math.max(Math.abs(dot(right, offset)), Math.abs(dot(down, offset)));
      if (depth > CLOSEST && aside < 0.1 * depth) depths.push(depth);
    }
    if (depths.length > 0) this.distance = Float32Array.from(depths).sort()[depths.length >> 1];
  }

  target() {
    return add(this.place, rotate(this.rotation, [0, 0, this.distance]));
  }

  /** Turns around what is looked at: about the vertical, and over it. */
  turn(yaw, pitch) {
    const target = this.target();
    const forward = rotate(this.rotation, [0, 0, 1]);
    // Not over the top: the picture would turn round.
    const height = Math.asin(Math.max(-1, Math.min(1, -dot(forward, this.up))));
    const tilt = Math.max(-1.5 - height, Math.min(1.5 - height, pitch));
    const about = product(turn(this.up, -yaw), turn(rotate(this.rotation, [1, 0, 0]), -tilt));
    this.rotation = unit(product(about, this.rotation));
    this.place = difference(target, rotate(this.rotation, [0, 0, this.distance]));
    this.change();
  }

  /** Moves sideways and down, in shares of the distance. */
  pan(right, down) {
    this.place = add(this.place, rotate(this.rotation, [right * this.distance, down * this.distance, 0]));
    this.change();
  }

  /** Moves ahead together with what is looked at. */
  forward(share) {
    this.place = add(this.place, rotate(this.rotation, [0, 0, share * this.distance]));
    this.change();
  }

  /** Changes the distance from what is looked at. */
  dolly(factor) {
    const target = this.target();
    this.distance = Math.max(CLOSEST, Math.min(FARTHEST, this.distance * factor));
    this.place = difference(target, rotate(this.rotation, [0, 0, this.distance]));
    this.change();
  }

  change() {
    this.flight += 1;
    this.moved(true);
  }

  /** Is somewhere else at once. */
  jump(place, rotation) {
    this.flight += 1;
    [this.place, this.rotation] = [place, rotation];
    this.aim();
    this.moved(false);
  }

  /** Flies there, and calls `arrived` unless a person moves the view meanwhile. */
  fly(place, rotation, arrived) {
    if (matchMedia('(prefers-reduced-motion: reduce)').matches) {
      this.jump(place, rotation);
      arrived();
      return;
    }
    const [flight, from, start] = [this.flight += 1, [this.place, this.rotation], performance.now()];
    const step = (now) => {
      if (flight !== this.flight) return;
      const time = Math.max(0, Math.min(1, (now - start) / FLIGHT));
      const share = time * time * (3 - 2 * time);
      this.place = add(from[0], scaled(difference(place, from[0]), share));
      this.rotation = between(from[1], rotation, share);
      this.moved(false);
      if (time < 1) requestAnimationFrame(step);
      else {
        this.jump(place, rotation);
        arrived();
      }
    };
    requestAnimationFrame(step);
  }
}
