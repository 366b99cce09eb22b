// Orbit controls: mouse, touch and keys move a point that the camera looks at, and the camera about it.
import {lookAt} from './pose.js';
import {add, cross, dot, length, perpendicular, sub, turned, unit} from './vectors.js';

const MOST_TILT = 1.553;  // radians from the horizon

export class Orbit {
  // `up`: a direction of the world. `changed` is called after each move; `picked(x, y)` after a click.
  constructor(element, up, changed, picked) {
    this.up = unit(up);
    this.side = perpendicular(this.up);
    this.changed = changed;
    this.picked = picked;
    this.pointers = new Map();
    this.listen(element);
  }

  // Looks at `target` from `eye`.
  set(target, eye) {
    const from = sub(eye, target);
    this.target = target;
    this.distance = Math.max(length(from), 1e-6);
    const ahead = cross(this.up, this.side);
    this.yaw = Math.atan2(dot(from, ahead), dot(from, this.side));
    this.pitch = Math.asin(Math.max(-1, Math.min(1, dot(from, this.up) / this.distance)));
    this.pitch = Math.max(-MOST_TILT, Math.min(MOST_TILT, this.pitch));
  }

  direction() {
    const flat = turned(this.side, this.up, this.yaw);
    return add(flat.map((v) => v * Math.cos(this.pitch)), this.up, Math.sin(this.pitch));
  }

  pose() {
    return lookAt(add(this.target, this.direction(), this.distance), this.target, this.up);
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.max(-MOST_TILT, Math.min(MOST_TILT, this.pitch + pitch));
    this.changed();
  }

  zoom(factor) {
    this.distance *= factor;
    this.changed();
  }

  // By shares of the distance, right, down and forward.
  pan(right, down, forward = 0) {
    const pose = this.pose();
    const by = add(add(pose.right.map((v) => v * right), pose.down, down), pose.forward, forward);
    this.target = add(this.target, by, this.distance);
    this.changed();
  }

  listen(element) {
    element.addEventListener('contextmenu', (event) => event.preventDefault());
    element.addEventListener('pointerdown', (event) => {
      element.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
      this.moved = this.pointers.size > 1 ? Infinity : 0;
    });
    element.addEventListener('pointermove', (event) => this.drag(event, element));
    const end = (event) => {
      if (!this.pointers.delete(event.pointerId)) return;
      if (event.type === 'pointerup' && this.moved < 4 && event.button === 0) this.picked(event.clientX, event.clientY);
    };
    element.addEventListener('pointerup', end);
    element.addEventListener('pointercancel', end);
    element.addEventListener('wheel', (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 16 : 1;
      this.zoom(Math.exp(Math.max(-120, Math.min(120, event.deltaY * lines)) * 0.0015));
    }, {passive: false});
  }

  drag(event, element) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const dx = now[0] - before[0], dy = now[1] - before[1];
    const size = Math.min(element.clientWidth, element.clientHeight);
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const apart = (p) => Math.max(8, Math.hypot(p[0] - other[0], p[1] - other[1]));
      this.distance *= apart(before) / apart(now);
      this.pan(-dx / size / 2, -dy / size / 2);
    } else if (event.buttons & 6 || event.shiftKey) {
      this.moved += Math.abs(dx) + Math.abs(dy);
      this.pan(-dx / size, -dy / size);
    } else {
      this.moved += Math.abs(dx) + Math.abs(dy);
      if (this.moved >= 4) this.turn(-dx / size * Math.PI, dy / size * Math.PI);
    }
    this.pointers.set(event.pointerId, now);
  }

  // Returns whether the key moves the camera.
  key(key) {
    const step = 0.08, moves = {
      ArrowLeft: () => this.turn(-step, 0), ArrowRight: () => this.turn(step, 0), ArrowUp: () => this.turn(0, step),
      ArrowDown: () => this.turn(0, -step), '+': () => this.zoom(0.9), '=': () => this.zoom(0.9), '-': () => this.zoom(1 / 0.9),
      w: () => this.pan(0, 0, step), s: () => this.pan(0, 0, -step), a: () => this.pan(-step, 0), d: () => this.pan(step, 0),
      q: () => this.pan(0, step), e: () => this.pan(0, -step)
    };
    const move = moves[key];
    if (move) move();
    return Boolean(move);
  }
}
