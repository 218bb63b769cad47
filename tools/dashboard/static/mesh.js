// The mesh in 3D, drawn by plotly. Loaded only when people look at it: the library is large.

import { along, rgb } from "./palette.js";

export const MEASURED = 0;
export const FILLED = 1;
export const ASSUMED = 2;
const STONE = "#b2aa9e"; // the colours of mesh.ply
const FLOOR = "#78909c";
const CERTAINTY = ["#fad6aa", "#d55e00"];
const SEAM = "#7a3600";
const NAMES = ["wall, measured", "wall, filled in", "floor, assumed"];
const MOST_SEAMS = 20000;
const MIN_PAUSE_MS = 2500;
const AXIS = { color: "#92a0ac", gridcolor: "#2b343d", zerolinecolor: "#3b4753", backgroundcolor: "#12171c", showbackground: true, title: { font: { size: 12 } } };

// Only buttons that turn the view: none that would send the mesh to somebody else's machine.
const CONFIG = {
  responsive: true, displaylogo: false, plotlyServerURL: "",
  modeBarButtons: [["orbitRotation", "tableRotation", "resetCameraDefault3d"]],
};

export class MeshView {
  constructor(box, note) {
    this.box = box;
    this.note = note;
    this.measuredOnly = false;
    this.shown = false;
    this.clear();
  }

  clear() {
    this.message = null;
    this.note.hidden = false;
    if (this.plotly) this.plotly.purge(this.box);
  }

  push(message) {
    this.message = message;
    this.schedule();
  }

  async show(shown) {
    this.shown = shown;
    if (shown) this.schedule(0);
  }

  setMeasuredOnly(measuredOnly) {
    this.measuredOnly = measuredOnly;
    this.schedule(0);
  }

  /** Draw soon; not more often than every few seconds, as a new mesh takes an old laptop a while. */
  schedule(pause = MIN_PAUSE_MS) {
    if (!this.shown || !this.message) return;
    clearTimeout(this.timer);
    const wait = Math.max(0, pause - (performance.now() - (this.drawn ?? -pause)));
    this.timer = setTimeout(() => this.draw(), wait);
  }

  async draw() {
    if (!this.shown || !this.message) return;
    try {
      this.plotly ??= await loadPlotly();
      this.note.hidden = true;
      await this.plotly.react(this.box, this.traces(), layout(), CONFIG);
    } catch (error) {
      this.note.hidden = false;
      this.note.textContent = `The mesh cannot be drawn here: ${error.message}`;
    }
    this.drawn = performance.now();
    this.box.dataset.triangles = this.message ? String(this.message.arrays.triangles.length / 3) : "0";
  }

  traces() {
    const { vertices, triangles, kind, certainty } = this.message.arrays;
    const places = columns(vertices, 3);
    const colours = Array.from(kind, (k, i) => colourOf(k, certainty[i] / 255));
    const texts = Array.from(kind, (k, i) => (k === FILLED ? `certainty ${((certainty[i] * 100) / 255).toFixed(0)} %` : NAMES[k]));
    const kinds = this.measuredOnly ? [MEASURED] : [MEASURED, FILLED, ASSUMED];
    const surfaces = kinds.map((wanted) => trace(wanted, places, pick(triangles, kind, wanted), colours, texts));
    return this.measuredOnly ? surfaces : [...surfaces, seams(places, pick(triangles, kind, FILLED))];
  }
}

/** The triangles of one kind: a triangle is as doubtful as its most doubtful corner. */
function pick(triangles, kind, wanted) {
  const out = [[], [], []];
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    if (Math.max(kind[a], kind[b], kind[c]) !== wanted) continue;
    out[0].push(a); out[1].push(b); out[2].push(c);
  }
  return out;
}

function trace(kind, [x, y, z], [i, j, k], vertexcolor, text) {
  return {
    type: "mesh3d", name: NAMES[kind], x, y, z, i, j, k, vertexcolor, text,
    opacity: kind === MEASURED ? 1 : kind === FILLED ? 0.9 : 0.45,
    flatshading: true,
    lighting: { ambient: 0.62, diffuse: 0.6, specular: 0.05, roughness: 0.9 },
    hovertemplate: "%{x:.2f} m east, %{y:.2f} m north, %{z:.2f} m deep<br>%{text}<extra></extra>",
  };
}

/** Edges of the filled triangles: what was filled in is told apart by more than its colour. */
function seams([x, y, z], [i, j, k]) {
  const line = { x: [], y: [], z: [] };
  if (i.length > MOST_SEAMS) return { type: "scatter3d", mode: "lines", ...line };
  for (let t = 0; t < i.length; t++) {
    for (const v of [i[t], j[t], k[t], i[t]]) { line.x.push(x[v]); line.y.push(y[v]); line.z.push(z[v]); }
    for (const axis of Object.values(line)) axis.push(null);
  }
  return { type: "scatter3d", mode: "lines", ...line, line: { color: SEAM, width: 1.5 }, hoverinfo: "skip" };
}

function colourOf(kind, certainty) {
  const [r, g, b] = kind === FILLED ? along(CERTAINTY, certainty) : rgb(kind === ASSUMED ? FLOOR : STONE);
  return `rgb(${r},${g},${b})`;
}

function columns(flat, width) {
  const n = flat.length / width;
  return Array.from({ length: width }, (_, c) => Float32Array.from({ length: n }, (_, r) => flat[r * width + c]));
}

/** Depth is positive down in the data: the axis is turned so that up is up. */
function layout() {
  const axis = (text) => ({ ...AXIS, title: { ...AXIS.title, text } });
  return {
    margin: { l: 0, r: 0, t: 0, b: 0 },
    paper_bgcolor: "#12171c",
    font: { color: "#dbe3e9", size: 11 },
    uirevision: "keep", // people keep their point of view when the mesh grows
    showlegend: false,
    scene: {
      aspectmode: "data",
      xaxis: axis("east, m"),
      yaxis: axis("north, m"),
      zaxis: { ...axis("depth, m"), autorange: "reversed" },
      camera: { eye: { x: -1.35, y: -2.05, z: 1.65 }, center: { x: -0.1, y: 0.065, z: -0.15 } },
    },
  };
}

function loadPlotly() {
  return new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "plotly.min.js";
    script.onload = () => resolve(window.Plotly);
    script.onerror = () => reject(new Error("plotly.js is missing on the server; install it with: pip install 'lacuna[laptop]'"));
    document.head.append(script);
  });
}
