// Which part of the plan is on the screen: pan, zoom, fit, by pointer, wheel, touch and keys.

const MIN_SCALE = 2; // pixels a metre
const MAX_SCALE = 2000;
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class View {
  constructor(canvas, onChange) {
    this.canvas = canvas;
    this.onChange = onChange;
    this.x = 0;
    this.y = 0;
    this.scale = 40;
    this.touched = false; // once people have moved it, it no longer follows the map
    this.pointers = new Map();
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  get width() { return this.canvas.clientWidth; }
  get height() { return this.canvas.clientHeight; }

  /** Pixel (CSS) of a place in m, and back. */
  toScreen(x, y) { return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale]; }
  toMap(px, py) { return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale]; }

  fit([west, south, east, north]) {
    const margin = 56;
    const wide = Math.max(east - west, 1);
    const high = Math.max(north - south, 1);
    this.x = (west + east) / 2;
    this.y = (south + north) / 2;
    this.scale = clamp(Math.min((this.width - margin * 2) / wide, (this.height - margin * 2) / high));
    this.onChange();
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toMap(px, py);
    this.scale = clamp(this.scale * factor);
    this.x = x - (px - this.width / 2) / this.scale;
    this.y = y + (py - this.height / 2) / this.scale;
    this.changed();
  }

  pan(px, py) {
    this.x -= px / this.scale;
    this.y += py / this.scale;
    this.changed();
  }

  changed() {
    this.touched = true;
    this.onChange();
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), event.offsetX, event.offsetY);
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.offsetX, event.offsetY];
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.pointers.set(event.pointerId, now);
    if (other) this.zoom(distance(now, other) / Math.max(distance(before, other), 1), other[0], other[1]);
    else this.pan(now[0] - before[0], now[1] - before[1]);
  }

  key(event) {
    const step = KEYS[event.key];
    if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    this.pan(-step[0] * 40, step[1] * 40);
  }
}

const clamp = (scale) => Math.min(Math.max(scale, MIN_SCALE), MAX_SCALE);
const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
