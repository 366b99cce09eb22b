// Poses and lenses. A pose is {eye, right, down, forward}: the camera's centre and its axes in the world. A lens is {fx, fy, cx, cy}, in pixels of
// a picture of w x h.
import {add, cross, dot, length, perpendicular, sub, unit} from './vectors.js';

// From a row-major 4x4 matrix, world to camera, with x right, y down, z forward.
export function poseOf(w2c) {
  const row = (i) => [w2c[4 * i], w2c[4 * i + 1], w2c[4 * i + 2]];
  const right = row(0), down = row(1), forward = row(2);
  let eye = [0, 0, 0];
  [right, down, forward].forEach((axis, i) => (eye = add(eye, axis, -w2c[4 * i + 3])));
  return {eye, right, down, forward};
}

export function matrixOf({eye, right, down, forward}) {
  return [right, down, forward].flatMap((axis) => [...axis, -dot(axis, eye)]).concat([0, 0, 0, 1]);
}

export function lookAt(eye, target, up) {
  const forward = unit(sub(target, eye));
  const side = cross(forward, up);
  const right = length(side) > 1e-6 ? unit(side) : perpendicular(forward);
  return {eye, right, down: cross(forward, right), forward};
}

// The lens of a picture that is fitted into a window of W x H, whole.
export function fitted(lens, W, H) {
  const s = Math.min(W / lens.w, H / lens.h);
  const left = (W - lens.w * s) / 2, top = (H - lens.h * s) / 2;
  return {fx: lens.fx * s, fy: lens.fy * s, cx: left + lens.cx * s, cy: top + lens.cy * s, left, top, width: lens.w * s, height: lens.h * s};
}

// A point of the world in the window, or null behind the camera.
export function projected(point, pose, lens) {
  const p = sub(point, pose.eye);
  const z = dot(p, pose.forward);
  if (z <= 1e-6) return null;
  return [lens.fx * dot(p, pose.right) / z + lens.cx, lens.fy * dot(p, pose.down) / z + lens.cy];
}

// The point that is nearest to all optical axes; null if they are parallel or meet behind a camera.
export function meetingPoint(poses) {
  if (poses.length < 2) return null;
  const m = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]];
  for (const {eye, forward} of poses)
    for (let i = 0; i < 3; ++i)
      for (let j = 0; j < 3; ++j) {
        const p = (i === j ? 1 : 0) - forward[i] * forward[j];
        m[i][j] += p / poses.length;
        m[i][3] += p * eye[j] / poses.length;
      }
  const det = (a, b, c) => dot(a, cross(b, c));
  const column = (j) => m.map((row) => row[j]);
  const [a, b, c, d] = [0, 1, 2, 3].map(column);
  const whole = det(a, b, c);
  if (Math.abs(whole) < 1e-4) return null;
  const point = [det(d, b, c) / whole, det(a, d, c) / whole, det(a, b, d) / whole];
  return poses.every(({eye, forward}) => dot(sub(point, eye), forward) > 0) ? point : null;
}
