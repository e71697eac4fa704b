// A camera that goes round a point: drag turns, right or shift drag (two fingers) pushes, wheel (pinch) nears.

class Camera {
  constructor(canvas, onChange) {
    this.canvas = canvas;
    this.onChange = onChange;
    this.fov = 0.62;
    this.pointers = new Map();
    this.limits = { size: 1 };
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => this.up(e));
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("dblclick", () => this.home());
  }

  /// Holds the box in view from azimuth (counter-clockwise from +x, where the camera is) and elevation.
  /// inset: share of the width and height that panels cover, from right and below.
  frame(box, azimuth, elevation, inset) {
    this.first = { box, azimuth, elevation, inset };
    this.home();
  }

  home() {
    const { box, azimuth, elevation, inset } = this.first;
    Object.assign(this, { azimuth, elevation, target: middleOf(box), distance: 1 });
    // Seen from one unit: how far the corners are out, as tangents; the distance that brings the farthest in.
    const wide = Math.tan(this.fov / 2), { x, y } = inset();
    const aspect = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1);
    const view = lookAt([0, 0, 0], times(-1, this.direction()));
    let distance = 0;
    for (const corner of cornersOf(box)) {
      const p = transformed(view, sub(corner, this.target));
      distance = Math.max(distance, Math.abs(p[0]) / (wide * aspect * (1 - x)) + p[2], Math.abs(p[1]) / (wide * (1 - y)) + p[2]);
    }
    this.distance = Math.max(0.96 * distance, 1e-3 * this.limits.size);
    // The free part's middle is where the box should be.
    this.push(-x / 2, y / 2);
    this.onChange();
  }

  direction() {
    const c = Math.cos(this.elevation);
    return [c * Math.cos(this.azimuth), c * Math.sin(this.azimuth), Math.sin(this.elevation)];
  }
  eye() {
    return add(this.target, times(this.distance, this.direction()));
  }
  view() {
    return lookAt(this.eye(), this.target);
  }
  projection(aspect) {
    const near = Math.max(0.02 * this.distance, 2e-4 * this.limits.size);
    return perspective(this.fov, aspect, near, this.distance + 4 * this.limits.size);
  }

  /// Moves what is seen by shares of the picture's width and height.
  push(dx, dy) {
    const view = this.view(), height = 2 * this.distance * Math.tan(this.fov / 2);
    const aspect = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1);
    const right = [view[0], view[4], view[8]], over = [view[1], view[5], view[9]];
    this.target = add(this.target, add(times(-dx * height * aspect, right), times(dy * height, over)));
  }
  turn(dx, dy) {
    this.azimuth -= 3.2 * dx;
    this.elevation = clamp(this.elevation + 2.4 * dy, -0.25, 1.55);
  }
  /// factor < 1: nearer, towards the point under (x, y), shares of the picture from its middle.
  near(factor, x = 0, y = 0) {
    const distance = clamp(this.distance * factor, 2e-3 * this.limits.size, 6 * this.limits.size);
    const share = 1 - distance / this.distance;
    this.push(-x * share, -y * share);
    this.distance = distance;
  }

  share(e) {
    return [e.clientX / this.canvas.clientWidth, e.clientY / this.canvas.clientHeight];
  }
  down(e) {
    this.canvas.setPointerCapture(e.pointerId);
    this.canvas.focus({ preventScroll: true });
    this.pointers.set(e.pointerId, this.share(e));
    this.canvas.classList.add("held");
  }
  up(e) {
    this.pointers.delete(e.pointerId);
    if (this.pointers.size === 0) this.canvas.classList.remove("held");
  }
  move(e) {
    const before = this.pointers.get(e.pointerId);
    if (!before) return;
    const now = this.share(e), d = [now[0] - before[0], now[1] - before[1]];
    if (this.pointers.size === 1) {
      const aspect = this.canvas.clientWidth / this.canvas.clientHeight;
      if (e.buttons & 6 || e.shiftKey) this.push(d[0], d[1]);
      else this.turn(d[0] * Math.max(aspect, 1), d[1]);
    } else if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== e.pointerId)[1];
      const apart = (p) => Math.hypot((p[0] - other[0]) * this.canvas.clientWidth, (p[1] - other[1]) * this.canvas.clientHeight);
      this.push(d[0] / 2, d[1] / 2);
      this.near(clamp(apart(before) / Math.max(apart(now), 1), 0.5, 2), (now[0] + other[0]) / 2 - 0.5, (now[1] + other[1]) / 2 - 0.5);
    }
    this.pointers.set(e.pointerId, now);
    this.onChange();
  }
  wheel(e) {
    e.preventDefault();
    const lines = e.deltaMode === 1 ? 30 : 1, [x, y] = this.share(e);
    this.near(Math.exp(clamp(e.deltaY * lines, -200, 200) * 0.0015), x - 0.5, y - 0.5);
    this.onChange();
  }
}
