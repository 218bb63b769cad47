// The plan: evidence, fills, stations and goals on one canvas; what lies under the pointer in words.

import { Evidence, Fills } from "./grid.js";
import { drawEllipses, drawGoals, drawNorth, drawOpenEnds, drawScaleBar, drawStations, drawTrack, hasPlace } from "./marks.js";
import { drawPieces, drawPieceWalls, pieceWords, piecesOf } from "./pieces.js";
import { View } from "./view.js";

const UNKNOWN = "#59636d";
const STATES = ["not seen", "open water", "wall"];
const REACH_PX = 11;

export class Plan {
  constructor(canvas, readout, outside) {
    Object.assign(this, { canvas, readout, outside });
    this.evidence = new Evidence();
    this.fills = new Fills();
    this.view = new View(canvas, () => this.request());
    this.clear();
    canvas.addEventListener("pointermove", (event) => { this.pointer = [event.offsetX, event.offsetY]; this.request(); });
    canvas.addEventListener("pointerleave", () => { this.pointer = null; this.readout.value = ""; });
    new ResizeObserver(() => this.resize()).observe(canvas);
  }

  clear() {
    this.evidence.clear();
    this.fills.clear();
    this.goals = [];
    this.view.touched = false;
    this.setStations({ header: { stations: [], newest: null }, arrays: {} });
    this.request();
  }

  push(message) {
    const { topic, header } = message;
    if (topic === "grid/key") this.evidence.key(message);
    else if (topic === "grid/delta") { if (!this.evidence.delta(message)) return false; }
    else if (topic === "fill") this.fills.set(message);
    else if (topic === "guide") this.goals = header.goals ?? [];
    else if (topic === "station") this.setStations(message);
    if (!this.view.touched) this.fit();
    this.request();
    return true;
  }

  setStations({ header, arrays }) {
    this.stations = header.stations;
    this.pieceWalls = arrays.wall_m ?? [];
    this.newest = header.newest;
    this.pieces = piecesOf(this.stations);
    const inPieces = new Set(this.pieces.flatMap((piece) => piece.members));
    this.alone = this.stations.filter((station) => !inPieces.has(station));
    this.canvas.closest(".map").toggleAttribute("data-pieces", this.pieces.length > 0);
    this.listOutside();
  }

  /** Stations that are kept out of the map, and why, newest first: in words, whether or not they have a place. */
  listOutside() {
    const out = this.alone.filter((station) => station.status === "unplaced" || station.status === "doubtful").reverse();
    const said = out.map((station) => [station.status, `Station ${station.station} ${station.status}`, station.why ? `: ${station.why}` : ""]);
    const items = [...this.pieces.map((piece) => ["piece", ...pieceWords(piece)]), ...said].map(([kind, name, why]) => {
      const item = document.createElement("li");
      const bold = document.createElement("b");
      item.className = kind;
      bold.textContent = name;
      item.append(bold, why);
      return item;
    });
    this.outside.hidden = items.length === 0;
    this.outside.replaceChildren(...items);
  }

  fit() {
    if (!this.canvas.clientWidth) return;
    const box = this.evidence.bounds() ?? [-5, -5, 5, 5];
    for (const mark of [...this.stations.filter(hasPlace), ...this.goals]) {
      box[0] = Math.min(box[0], mark.x_m); box[1] = Math.min(box[1], mark.y_m);
      box[2] = Math.max(box[2], mark.x_m); box[3] = Math.max(box[3], mark.y_m);
    }
    this.pieceWalls.forEach((m, i) => {
      box[i % 2] = Math.min(box[i % 2], m);
      box[2 + (i % 2)] = Math.max(box[2 + (i % 2)], m);
    });
    this.view.fit(box);
    this.view.touched = false;
  }

  resize() {
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    if (!this.canvas.clientWidth) return;
    this.canvas.width = Math.round(this.canvas.clientWidth * scale);
    this.canvas.height = Math.round(this.canvas.clientHeight * scale);
    this.pixels = scale;
    if (!this.view.touched) this.fit();
    this.draw();
  }

  request() {
    if (this.waiting || !this.pixels) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); });
  }

  draw() {
    const g = this.canvas.getContext("2d");
    const { view } = this;
    g.setTransform(this.pixels, 0, 0, this.pixels, 0, 0);
    g.fillStyle = UNKNOWN;
    g.fillRect(0, 0, view.width, view.height);
    this.drawEvidence(g);
    this.drawFills(g);
    drawOpenEnds(g, view, this.fills.openEnds);
    drawEllipses(g, view, this.alone);
    drawTrack(g, view, this.alone);
    drawPieceWalls(g, view, this.pieceWalls);
    drawPieces(g, view, this.pieces, this.alone, this.newest);
    drawStations(g, view, this.alone, this.newest);
    drawGoals(g, view, this.goals);
    drawScaleBar(g, view);
    drawNorth(g, view);
    if (this.pointer) this.readout.value = this.describe(...this.pointer);
  }

  drawEvidence(g) {
    const { frame, canvas } = this.evidence;
    if (!frame) return;
    const [x, y] = this.view.toScreen(frame.x0, frame.y0 + frame.rows * frame.cellM);
    const size = frame.cellM * this.view.scale;
    g.imageSmoothingEnabled = size < 1;
    g.drawImage(canvas, x, y, frame.cols * size, frame.rows * size);
  }

  /** Filled wall: pale ground with hatching whose opacity is the certainty, never mistaken for measured wall. */
  drawFills(g) {
    const { frame, levels } = this.fills;
    if (!frame) return;
    const size = frame.cellM * this.view.scale;
    const hatch = g.createPattern(hatching(this.pixels), "repeat");
    hatch.setTransform(new DOMMatrix().scale(1 / this.pixels));
    levels.forEach((cells, level) => {
      if (!cells.length) return;
      const path = new Path2D();
      for (const { row, col } of cells) {
        const [x, y] = this.view.toScreen(frame.x0 + col * frame.cellM, frame.y0 + (row + 1) * frame.cellM);
        path.rect(x - 0.25, y - 0.25, size + 0.5, size + 0.5);
      }
      g.globalAlpha = 1;
      g.fillStyle = "#f3e3d6";
      g.fill(path);
      g.globalAlpha = 0.22 + (0.78 * (level + 0.5)) / levels.length;
      g.fillStyle = hatch;
      g.fill(path);
    });
    g.globalAlpha = 1;
  }

  /** The line of words for a pixel. */
  describe(px, py) {
    const [x, y] = this.view.toMap(px, py);
    const parts = [`${x.toFixed(2)} m east`, `${y.toFixed(2)} m north`];
    const near = (mark) => {
      const [mx, my] = this.view.toScreen(mark.x_m, mark.y_m);
      return Math.hypot(mx - px, my - py) < REACH_PX;
    };
    const station = this.stations.filter(hasPlace).findLast(near);
    const goal = this.goals.find(near);
    const filled = this.fills.at(x, y);
    const cell = this.evidence.at(x, y);
    const piece = this.pieces.find(({ members }) => members.includes(station));
    if (piece) parts.push(`station ${station.station} of piece ${piece.number}, not tied yet: its place is a guess`);
    else if (station) parts.push(describeStation(station));
    else if (goal) parts.push(`go here next: ${goal.why}`);
    else if (filled) parts.push(describeFill(filled));
    else if (cell) parts.push(cell.state ? `${STATES[cell.state]}, measured, occupied ${(cell.occupancy * 100).toFixed(0)} %` : STATES[0]);
    return parts.join("  ·  ");
  }
}

function describeFill({ certainty, hole }) {
  const words = `filled in, certainty ${(certainty * 100).toFixed(0)} %`;
  return hole ? `${words}  ·  gap of ${hole.gap_m.toFixed(2)} m${hole.curve ? `, ${hole.curve}` : ""}: ${hole.why}` : words;
}

function describeStation(station) {
  const parts = [`station ${station.station} ${station.status}`];
  if (Number.isFinite(station.sd_x_m)) parts.push(`sd ${station.sd_x_m.toFixed(2)} / ${station.sd_y_m.toFixed(2)} m`);
  if (Number.isFinite(station.heading_deg)) parts.push(`heading ${station.heading_deg.toFixed(0)}°`);
  if (Number.isFinite(station.depth_m)) parts.push(`depth ${station.depth_m.toFixed(2)} m`);
  if (station.why) parts.push(station.why);
  return parts.join(", ");
}

/** A tile of diagonal lines, 6 by 6 CSS pixels. */
function hatching(scale) {
  const n = Math.round(6 * scale);
  const tile = new OffscreenCanvas(n, n);
  const g = tile.getContext("2d");
  g.strokeStyle = "#d55e00";
  g.lineWidth = 2.4 * scale;
  g.beginPath();
  for (const shift of [-n, 0, n]) { g.moveTo(shift - n, n * 2); g.lineTo(shift + n * 2, -n); }
  g.stroke();
  return tile;
}
