// The camera of the page: around a target, or in flight. Axes of a camera: right, down, forward.

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit = (a) => a.map((c) => c / (Math.hypot(...a) || 1));
const plus = (a, b, s = 1) => a.map((c, i) => c + s * b[i]);

export class Camera {
  constructor(canvas, up, changed) {
    Object.assign(this, { canvas, up: unit(up), changed, flies: false, shot: null, held: new Set() });
    this.turn = [[1, 0, 0], [0, 0, -1], [0, 1, 0]];
    this.eye = [0, 0, 0];
    this.target = [0, 0, 0];
    this.radius = 1;
    this.listen();
  }

  /** Shows a ball from the side. */
  fit(centre, radius) {
    const any = Math.abs(this.up[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0];
    const ahead = unit(plus(cross(cross(this.up, any), this.up), this.up, -0.75));
    this.radius = radius;
    this.target = centre;
    this.shot = null;
    this.look(ahead);
    this.eye = plus(centre, ahead, -2.2 * radius);
    this.changed();
  }

  /** Turns to a direction, upright. */
  look(ahead) {
    const forward = unit(ahead);
    const right = unit(cross(forward, this.up));
    this.turn = [right, cross(forward, right), forward];
  }

  /** Takes the place of a camera of the scene; the whole of its picture is shown. */
  take(shot) {
    this.shot = shot;
    this.turn = shot.rotation;
    this.eye = [...shot.centre];
    this.target = plus(this.eye, this.turn[2], Math.max(0.3 * this.radius, 1e-3));
    this.changed();
  }

  /** Returns the view for a canvas of some pixels. */
  view([width, height]) {
    const far = 20 * this.radius + Math.hypot(...plus(this.eye, this.target, -1)) * 4;
    const range = [Math.max(far * 2e-6, 1e-3 * this.radius), far];
    const base = { turn: this.turn, eye: this.eye, range };
    if (!this.shot) {
      const focal = 0.9 * Math.max(width, height);
      return { ...base, focal: [focal, focal], principal: [width / 2 - 0.5, height / 2 - 0.5] };
    }
    const { focal, principal, size } = this.shot;
    const scale = Math.min(width / size[0], height / size[1]);
    // Cameras draw nothing nearer than 0.1, as in `train`.
    const margin = [(width - scale * size[0]) / 2, (height - scale * size[1]) / 2];
    return {
      ...base, range: [0.1, far], frame: [...margin, scale * size[0], scale * size[1]],
      focal: focal.map((f) => f * scale), principal: principal.map((p, i) => (p + 0.5) * scale - 0.5 + margin[i]),
    };
  }

  rotate(dx, dy) {
    const around = (v, axis, angle) => {
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      return plus(plus(v.map((x) => x * c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
    };
    const away = Math.hypot(...plus(this.target, this.eye, -1));
    // Not over the zenith.
    const tilt = Math.asin(Math.min(1, Math.max(-1, dot(this.turn[2], this.up))));
    const pitch = Math.min(1.55, Math.max(-1.55, tilt + (this.flies ? 0.005 : -0.005) * dy)) - tilt;
    const right = unit(cross(this.turn[2], this.up));
    const forward = around(around(this.turn[2], right, pitch), this.up, (this.flies ? 0.005 : -0.005) * dx);
    this.look(forward);
    if (this.flies) this.target = plus(this.eye, this.turn[2], away);
    else this.eye = plus(this.target, this.turn[2], -away);
    this.leave();
  }

  move(right, down, ahead) {
    for (const name of ["eye", "target"]) {
      this[name] = plus(plus(plus(this[name], this.turn[0], right), this.turn[1], down), this.turn[2], ahead);
    }
    this.leave();
  }

  zoom(factor) {
    const to = plus(this.target, this.eye, -1);
    if (this.flies) return this.move(0, 0, 0.2 * this.radius * Math.log(factor));
    this.eye = plus(this.target, to, -1 / factor);
    this.leave();
  }

  leave() {
    this.shot = null;
    this.changed();
  }

  listen() {
    const { canvas } = this;
    let [moved, last] = [0, null];
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      [moved, last] = [0, [event.clientX, event.clientY]];
      canvas.classList.add("drags");
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
      moved += Math.abs(dx) + Math.abs(dy);
      // A hand that clicks trembles.
      if (moved < 4) return;
      last = [event.clientX, event.clientY];
      const away = Math.hypot(...plus(this.target, this.eye, -1));
      const step = away / (0.9 * Math.max(canvas.clientWidth, canvas.clientHeight));
      if (event.buttons & 2 || event.shiftKey) this.move(-dx * step, -dy * step, 0);
      else this.rotate(dx, dy);
    });
    canvas.addEventListener("pointerup", (event) => {
      last = null;
      canvas.classList.remove("drags");
      if (moved < 4 && event.button === 0) this.clicked?.(event.offsetX, event.offsetY);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(2 ** (-Math.max(-200, Math.min(200, event.deltaY)) / 300));
    }, { passive: false });
    addEventListener("keyup", (event) => this.held.delete(event.key.toLowerCase()));
    addEventListener("blur", () => this.held.clear());
  }

  /** Takes a key; returns whether it was one of the camera. */
  key(event) {
    const turns = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, -20], ArrowDown: [0, 20] };
    if (turns[event.key]) this.rotate(...turns[event.key]);
    else if (event.key === "+" || event.key === "=") this.zoom(1.25);
    else if (event.key === "-") this.zoom(0.8);
    else if ("wasdqe".includes(event.key.toLowerCase()) && event.key.length === 1) this.go(event.key.toLowerCase(), event.shiftKey);
    else return false;
    return true;
  }

  /** Moves as long as keys are held. */
  go(key, fast) {
    const first = !this.held.size;
    this.held.add(key);
    if (!first) return;
    let before = performance.now();
    const step = (now) => {
      const length = (fast ? 2 : 0.5) * this.radius * Math.min(0.1, Math.max(0.005, (now - before) / 1000));
      before = now;
      const has = (k) => (this.held.has(k) ? length : 0);
      if (this.held.size) {
        this.move(has("d") - has("a"), has("q") - has("e"), has("w") - has("s"));
        requestAnimationFrame(step);
      }
    };
    requestAnimationFrame(step);
  }
}
