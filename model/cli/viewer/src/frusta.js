// The input cameras as small pyramids, drawn over the scene.
import {poseOf, projected} from './pose.js';
import {add, sub, length} from './vectors.js';

const REACH = 14;  // pixels from a camera within which a click counts

export class Frusta {
  // `cameras`: of the page. `size`: how far a pyramid's base is from its tip, in world units.
  constructor(canvas, cameras, size) {
    this.canvas = canvas;
    this.cameras = cameras.map((camera) => {
      const pose = poseOf(camera.w2c);
      const corner = (u, v) => add(add(add(pose.eye, pose.forward, size), pose.right, size * (u - camera.cx) / camera.fx), pose.down,
                                   size * (v - camera.cy) / camera.fy);
      return {tip: pose.eye, corners: [corner(0, 0), corner(camera.w, 0), corner(camera.w, camera.h), corner(0, camera.h)]};
    });
  }

  // Where camera i is in the window: the middle of its pyramid; null if out of sight.
  place(i, pose, lens) {
    const {tip, corners} = this.cameras[i];
    const points = [tip, ...corners].map((p) => projected(p, pose, lens));
    if (points.some((p) => !p)) return null;
    return [0, 1].map((c) => points.reduce((sum, p) => sum + p[c], 0) / points.length);
  }

  draw(pose, lens, chosen, shown) {
    const ratio = window.devicePixelRatio || 1, W = this.canvas.clientWidth, H = this.canvas.clientHeight;
    this.canvas.width = Math.round(W * ratio), this.canvas.height = Math.round(H * ratio);
    if (!shown) return;
    const pen = this.canvas.getContext('2d');
    pen.scale(ratio, ratio);
    pen.lineJoin = 'round';
    this.cameras.forEach(({tip, corners}, i) => {
      if (i === chosen) return;
      const [t, ...c] = [tip, ...corners].map((p) => projected(p, pose, lens));
      if (!t || c.some((p) => !p)) return;
      pen.beginPath();
      for (const p of c) pen.moveTo(...t), pen.lineTo(...p);
      pen.moveTo(...c[3]);
      for (const p of c) pen.lineTo(...p);
      for (const [width, colour] of [[3, 'rgba(255,255,255,.7)'], [1.4, '#2563c9']]) {
        pen.lineWidth = width, pen.strokeStyle = colour;
        pen.stroke();
      }
    });
  }

  // The camera at a place of the window, the nearest to the eye if several are; -1 if none.
  at(x, y, pose, lens) {
    let best = -1, nearest = Infinity;
    this.cameras.forEach(({tip, corners}, i) => {
      const points = [tip, ...corners].map((p) => projected(p, pose, lens));
      if (points.some((p) => !p)) return;
      const low = [0, 1].map((c) => Math.min(...points.map((p) => p[c]))), high = [0, 1].map((c) => Math.max(...points.map((p) => p[c])));
      const reach = (v, c) => Math.max(0, low[c] - v, v - high[c]);
      const away = length(sub(tip, pose.eye));
      if (Math.hypot(reach(x, 0), reach(y, 1)) < REACH && away < nearest) best = i, nearest = away;
    });
    return best;
  }
}
