// Vectors are arrays of three, matrices of sixteen numbers, column after column, as OpenGL has them. z is up.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (s, a) => [s * a[0], s * a[1], s * a[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => times(1 / Math.max(norm(a), 1e-30), a);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const mix = (a, b, t) => a + (b - a) * t;

function product(a, b) {
  const m = new Array(16);
  for (let column = 0; column < 4; ++column)
    for (let row = 0; row < 4; ++row) {
      let sum = 0;
      for (let k = 0; k < 4; ++k) sum += a[4 * k + row] * b[4 * column + k];
      m[4 * column + row] = sum;
    }
  return m;
}

/// From the world to a camera at eye that looks along -z of its own.
function lookAt(eye, target, up = [0, 0, 1]) {
  const back = unit(sub(eye, target));
  let right = cross(up, back);
  right = norm(right) > 1e-9 ? unit(right) : [1, 0, 0];
  const over = cross(back, right);
  return [right[0], over[0], back[0], 0, right[1], over[1], back[1], 0, right[2], over[2], back[2], 0, -dot(right, eye), -dot(over, eye), -dot(back, eye), 1];
}

function perspective(fov, aspect, near, far) {
  const f = 1 / Math.tan(fov / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
}

/// A box of the camera's coordinates, low and high corner, to OpenGL's cube.
function orthographic(low, high) {
  const s = [2 / (high[0] - low[0]), 2 / (high[1] - low[1]), -2 / (high[2] - low[2])];
  return [s[0], 0, 0, 0, 0, s[1], 0, 0, 0, 0, s[2], 0, -(high[0] + low[0]) / (high[0] - low[0]), -(high[1] + low[1]) / (high[1] - low[1]), (high[2] + low[2]) / (high[2] - low[2]), 1];
}

function transformed(m, p) {
  const w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
  return [0, 1, 2].map((k) => (m[k] * p[0] + m[4 + k] * p[1] + m[8 + k] * p[2] + m[12 + k]) / w);
}

const cornersOf = (box) => [0, 1, 2, 3, 4, 5, 6, 7].map((c) => [0, 1, 2].map((k) => box[(c >> k) & 1][k]));
const middleOf = (box) => times(0.5, add(box[0], box[1]));
const sizeOf = (box) => norm(sub(box[1], box[0]));

/// The box seen from a direction (camera_from_world turns without moving), in the camera's coordinates.
function boxSeen(view, box) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const corner of cornersOf(box)) {
    const p = transformed(view, corner);
    for (let k = 0; k < 3; ++k) {
      low[k] = Math.min(low[k], p[k]);
      high[k] = Math.max(high[k], p[k]);
    }
  }
  return [low, high];
}
