// The live sonar picture. Beams are kept by compass direction, so a turning vehicle does not smear old echoes.

import { echoColours } from "./palette.js";

const SLOTS = 1600; // 0.225 degrees, the finest step of a head
const FRESH_S = 20;
const OLD_S = 90;
const OLD_LIGHT = 0.38;
const RING_STEPS = [0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
const PAUSE_MS = 45; // an old laptop need not draw every beam
const EMPTY = "#0b0f13";

const radians = (degrees) => (degrees * Math.PI) / 180;
const turn = (degrees) => ((degrees % 360) + 360) % 360;

export class Polar {
  constructor(canvas, readout) {
    this.canvas = canvas;
    this.readout = readout;
    this.northUp = false;
    this.setColours("inferno", 8, 70);
    this.clear();
    canvas.addEventListener("pointermove", (event) => this.hover(event));
    canvas.addEventListener("pointerleave", () => { this.pointer = null; this.readout.value = ""; });
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    setInterval(() => this.request(), 500); // ageing
  }

  clear() {
    this.beams = new Array(SLOTS).fill(null);
    this.newest = null;
    this.rangeM = 10;
    this.request();
  }

  setColours(name, floorDb, ceilingDb) {
    this.colours = echoColours(name, floorDb, ceilingDb);
    this.request();
  }

  setNorthUp(northUp) {
    this.northUp = northUp;
    this.request();
  }

  push({ header, arrays }) {
    const known = header.heading_deg != null;
    if (this.newest && (this.newest.heading_deg != null) !== known) this.clear(); // directions changed their meaning
    this.newest = header;
    this.rangeM = header.bin_m * arrays.echoes.length;
    const beam = { echoes: arrays.echoes, binM: header.bin_m, tNs: header.t_ns };
    this.newestAt = performance.now();
    const centre = this.slot((header.heading_deg ?? 0) + header.bearing_deg);
    const half = Math.max(0, Math.round(((header.step_deg ?? 1.8) * SLOTS) / 720));
    for (let k = -half; k <= half; k++) this.beams[(centre + k + SLOTS) % SLOTS] = beam;
    this.request();
  }

  slot(degrees) {
    return Math.round((turn(degrees) * SLOTS) / 360) % SLOTS;
  }

  /** Direction at the top of the picture, degrees from north (from the bow where no heading is known). */
  top() {
    return this.northUp ? 0 : this.newest?.heading_deg ?? 0;
  }

  resize() {
    const box = this.canvas.parentElement.getBoundingClientRect();
    const side = Math.max(120, Math.floor(Math.min(box.width, box.height)));
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    this.canvas.style.width = this.canvas.style.height = `${side}px`;
    this.canvas.width = this.canvas.height = Math.round(side * scale);
    this.scale = scale;
    this.layOut();
    this.draw();
  }

  /** Which direction slot and how far each pixel is: fixed until the size changes. */
  layOut() {
    const n = this.canvas.width;
    this.centre = n / 2;
    this.radius = n / 2 - 22 * this.scale;
    this.image = new ImageData(n, n);
    this.slotOf = new Int16Array(n * n).fill(-1);
    this.farOf = new Float32Array(n * n);
    for (let i = 0; i < n * n; i++) {
      const x = (i % n) + 0.5 - this.centre;
      const y = this.centre - Math.floor(i / n) - 0.5;
      const far = Math.hypot(x, y) / this.radius;
      if (far >= 1) continue;
      this.slotOf[i] = this.slot((Math.atan2(x, y) * 180) / Math.PI);
      this.farOf[i] = far;
    }
  }

  request() {
    if (this.waiting || !this.image) return;
    this.waiting = true;
    const wait = Math.max(0, PAUSE_MS - (performance.now() - (this.drawnAt ?? 0)));
    setTimeout(() => requestAnimationFrame(() => { this.waiting = false; this.draw(); }), wait);
  }

  draw() {
    this.drawnAt = performance.now();
    this.paintEchoes();
    const g = this.canvas.getContext("2d");
    g.putImageData(this.image, 0, 0);
    this.drawRings(g);
    this.drawCompass(g);
    if (this.newest) this.drawSweep(g);
    this.drawVehicle(g);
    if (this.pointer) this.tell();
  }

  paintEchoes() {
    const data = new Uint32Array(this.image.data.buffer);
    const light = this.lights();
    const shift = this.slot(this.top());
    const { colours, beams, slotOf, farOf, rangeM } = this;
    const empty = 0xff130f0b; // EMPTY as little-endian ABGR
    for (let i = 0; i < data.length; i++) {
      let colour = 0;
      if (slotOf[i] >= 0) {
        const slot = (slotOf[i] + shift) % SLOTS;
        const beam = beams[slot];
        colour = empty;
        const bin = beam ? Math.floor((farOf[i] * rangeM) / beam.binM) : -1;
        if (bin >= 0 && bin < beam.echoes.length) {
          const c = beam.echoes[bin] * 3;
          const l = light[slot];
          colour = 0xff000000 | ((colours[c + 2] * l) << 16) | ((colours[c + 1] * l) << 8) | (colours[c] * l);
        }
      }
      data[i] = colour;
    }
  }

  /** Brightness of each slot: full while fresh, dim when old, so that a stale beam shows. */
  lights() {
    const light = new Float32Array(SLOTS);
    for (let i = 0; i < SLOTS; i++) {
      if (!this.beams[i]) continue;
      const worn = (this.age(this.beams[i]) - FRESH_S) / (OLD_S - FRESH_S);
      light[i] = 1 - (1 - OLD_LIGHT) * Math.min(Math.max(worn, 0), 1);
    }
    return light;
  }

  /** Seconds since a beam was made, in the time of the data: right for a late joiner and for a replay too. */
  age(beam) {
    return (this.newest.t_ns - beam.tNs) / 1e9 + (performance.now() - this.newestAt) / 1000;
  }

  drawRings(g) {
    const step = RING_STEPS.find((each) => this.rangeM / each <= 6) ?? 100;
    g.strokeStyle = "rgb(200 215 225 / 26%)";
    g.fillStyle = "rgb(225 235 242 / 88%)";
    g.lineWidth = this.scale;
    this.font(g, 11);
    for (let r = step; r < this.rangeM * 1.001; r += step) {
      const radius = (r / this.rangeM) * this.radius;
      g.beginPath();
      g.arc(this.centre, this.centre, radius, 0, 2 * Math.PI);
      g.stroke();
      if (r < this.rangeM * 0.97) this.label(g, `${+r.toFixed(2)} m`, this.centre + radius * 0.7071, this.centre + radius * 0.7071);
    }
    g.beginPath();
    g.arc(this.centre, this.centre, this.radius, 0, 2 * Math.PI);
    g.stroke();
  }

  drawCompass(g) {
    const known = this.newest?.heading_deg != null;
    const names = known ? { 0: "N", 90: "E", 180: "S", 270: "W" } : { 0: "bow" };
    this.font(g, 11);
    g.textAlign = "center";
    for (let a = 0; a < 360; a += 30) {
      const [x, y] = this.at(a, this.radius + 11 * this.scale);
      g.fillStyle = names[a] ? "#e8eef2" : "#7d8b97";
      g.fillText(names[a] ?? String(a), x, y);
    }
  }

  drawSweep(g) {
    const direction = (this.newest.heading_deg ?? 0) + this.newest.bearing_deg;
    const [x, y] = this.at(direction, this.radius);
    g.strokeStyle = "rgb(240 248 255 / 85%)";
    g.lineWidth = 1.4 * this.scale;
    g.beginPath();
    g.moveTo(this.centre, this.centre);
    g.lineTo(x, y);
    g.stroke();
  }

  /** The vehicle as an arrow to its bow. */
  drawVehicle(g) {
    const a = radians((this.newest?.heading_deg ?? 0) - this.top());
    g.save();
    g.translate(this.centre, this.centre);
    g.rotate(a);
    g.scale(this.scale, this.scale);
    g.fillStyle = "#6cb6ff";
    g.strokeStyle = EMPTY;
    g.beginPath();
    g.moveTo(0, -9); g.lineTo(5.5, 7); g.lineTo(0, 4); g.lineTo(-5.5, 7); g.closePath();
    g.fill();
    g.stroke();
    g.restore();
  }

  /** Pixel of a direction (degrees from north) at a radius in pixels. */
  at(degrees, radius) {
    const a = radians(degrees - this.top());
    return [this.centre + radius * Math.sin(a), this.centre - radius * Math.cos(a)];
  }

  font(g, size) {
    g.font = `${size * this.scale}px ${getComputedStyle(document.body).fontFamily}`;
    g.textAlign = "left";
    g.textBaseline = "middle";
  }

  label(g, text, x, y) {
    g.save();
    g.strokeStyle = "rgb(9 12 15 / 80%)";
    g.lineWidth = 3 * this.scale;
    g.strokeText(text, x, y);
    g.restore();
    g.fillText(text, x, y);
  }

  hover(event) {
    const box = this.canvas.getBoundingClientRect();
    this.pointer = [event.clientX - box.left, event.clientY - box.top];
    this.tell();
  }

  /** Range, bearing and echo under the pointer. */
  tell() {
    const x = this.pointer[0] * this.scale - this.centre;
    const y = this.centre - this.pointer[1] * this.scale;
    const rangeM = (Math.hypot(x, y) / this.radius) * this.rangeM;
    if (rangeM > this.rangeM) { this.readout.value = ""; return; }
    const direction = turn((Math.atan2(x, y) * 180) / Math.PI + this.top());
    const known = this.newest?.heading_deg != null;
    const bearing = turn(direction - (this.newest?.heading_deg ?? 0));
    const beam = this.beams[this.slot(direction)];
    const echo = beam?.echoes[Math.floor(rangeM / beam.binM)];
    const parts = [`${rangeM.toFixed(2)} m`, `bearing ${degreesText(bearing)}`];
    if (known) parts.push(`direction ${degreesText(direction)}`);
    if (echo !== undefined) parts.push(`${((echo * 80) / 255).toFixed(0)} dB`, `${this.age(beam).toFixed(0)} s old`);
    this.readout.value = parts.join("  ·  ");
  }
}

/** Three digits as on a compass: 007°. */
export function degreesText(degrees) {
  return `${String(Math.round(turn(degrees)) % 360).padStart(3, "0")}°`;
}
