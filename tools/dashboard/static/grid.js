// The evidence grid and the filled cells, kept as pictures of one pixel per cell (row 0 of the data is south).

const COLOURS = { unknown: [89, 99, 109], free: [207, 216, 222], occupied: [11, 15, 19] };
const FREE = 1;
const OCCUPIED = 2;
const LEVELS = 12;

export class Evidence {
  constructor() { this.clear(); }

  clear() {
    this.frame = null;
    this.asOf = null;
  }

  /** A whole grid: header {cell_m, x0_m, y0_m}, layer `occupancy` and `state` (rows, cols). */
  key({ header, arrays }) {
    const { rows, cols, layers } = split(arrays.grid ?? Object.values(arrays)[0], header);
    this.frame = { cellM: header.cell_m, x0: header.x0_m, y0: header.y0_m, rows, cols };
    [this.occupancy, this.state] = layers;
    this.canvas = new OffscreenCanvas(cols, rows);
    this.paint(0, 0, rows, cols);
    this.asOf = header.as_of ?? { topic: header.topic, seq: header.seq };
  }

  /** A window to overwrite; false where it does not follow what is here. */
  delta({ header, arrays }) {
    const { asOf, frame } = this;
    if (!frame || header.base.topic !== asOf.topic || header.base.seq !== asOf.seq) return false;
    const { rows, cols, layers } = split(arrays.grid ?? Object.values(arrays)[0], header);
    for (let r = 0; r < rows; r++) {
      const from = r * cols;
      const to = (header.row0 + r) * frame.cols + header.col0;
      this.occupancy.set(layers[0].subarray(from, from + cols), to);
      this.state.set(layers[1].subarray(from, from + cols), to);
    }
    this.paint(header.row0, header.col0, rows, cols);
    this.asOf = { topic: header.topic, seq: header.seq };
    return true;
  }

  paint(row0, col0, rows, cols) {
    const image = new ImageData(cols, rows);
    for (let r = 0; r < rows; r++) {
      for (let c = 0; c < cols; c++) {
        const state = this.state[(row0 + r) * this.frame.cols + col0 + c];
        const colour = state === OCCUPIED ? COLOURS.occupied : state === FREE ? COLOURS.free : COLOURS.unknown;
        image.data.set([...colour, 255], ((rows - 1 - r) * cols + c) * 4);
      }
    }
    this.canvas.getContext("2d").putImageData(image, col0, this.frame.rows - row0 - rows);
  }

  /** State and occupancy (0 to 1) at a place in m, or null outside. */
  at(x, y) {
    const { frame } = this;
    if (!frame) return null;
    const row = Math.floor((y - frame.y0) / frame.cellM);
    const col = Math.floor((x - frame.x0) / frame.cellM);
    if (row < 0 || col < 0 || row >= frame.rows || col >= frame.cols) return null;
    const i = row * frame.cols + col;
    return { state: this.state[i], occupancy: this.occupancy[i] / 255 };
  }

  /** West, south, east and north of what was seen, m; null where nothing was. */
  bounds() {
    const { frame, state } = this;
    if (!frame) return null;
    let [west, south, east, north] = [Infinity, Infinity, -1, -1];
    for (let i = 0; i < state.length; i++) {
      if (state[i] === 0) continue;
      const [row, col] = [Math.floor(i / frame.cols), i % frame.cols];
      west = Math.min(west, col); east = Math.max(east, col + 1);
      south = Math.min(south, row); north = Math.max(north, row + 1);
    }
    if (east < 0) return null;
    const { cellM, x0, y0 } = frame;
    return [x0 + west * cellM, y0 + south * cellM, x0 + east * cellM, y0 + north * cellM];
  }
}

function split(array, header) {
  const shape = header.arrays[0].shape;
  const [rows, cols] = [shape[1], shape[2]];
  return { rows, cols, layers: [array.subarray(0, rows * cols), array.subarray(rows * cols, 2 * rows * cols)] };
}

/** Filled cells: header {cell_m, x0_m, y0_m, holes}, arrays row, col, certainty (0..255), hole. */
export class Fills {
  constructor() { this.clear(); }

  clear() {
    this.cells = new Map();
    this.levels = [];
    this.frame = null;
    this.openEnds = [];
  }

  set({ header, arrays }) {
    this.clear();
    this.frame = { cellM: header.cell_m, x0: header.x0_m, y0: header.y0_m };
    this.openEnds = header.open_ends_m ?? [];
    const holes = new Map((header.holes ?? []).map((hole) => [hole.hole, hole]));
    this.levels = Array.from({ length: LEVELS }, () => []);
    for (let i = 0; i < arrays.row.length; i++) {
      const certainty = arrays.certainty[i] / 255;
      const cell = { row: arrays.row[i], col: arrays.col[i], certainty, hole: holes.get(arrays.hole[i]) };
      this.cells.set(`${cell.row},${cell.col}`, cell);
      this.levels[Math.min(Math.floor(certainty * LEVELS), LEVELS - 1)].push(cell);
    }
  }

  at(x, y) {
    if (!this.frame) return null;
    const { cellM, x0, y0 } = this.frame;
    return this.cells.get(`${Math.floor((y - y0) / cellM)},${Math.floor((x - x0) / cellM)}`) ?? null;
  }
}
