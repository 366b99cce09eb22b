// Arithmetic of three-vectors as arrays.

export const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const sub = (a, b) => add(a, b, -1);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(...a);
export const unit = (a) => {
  const l = length(a) || 1;
  return [a[0] / l, a[1] / l, a[2] / l];
};
// A turn of `a` about the unit vector `axis`, counter-clockwise, in radians.
export const turned = (a, axis, angle) => {
  const c = Math.cos(angle);
  return add(add([a[0] * c, a[1] * c, a[2] * c], cross(axis, a), Math.sin(angle)), axis, dot(axis, a) * (1 - c));
};
// A unit vector at a right angle to `a`.
export const perpendicular = (a) => unit(cross(a, Math.abs(a[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
