// Floating pieces: stations that hold together but that nothing ties to the map. Where one is drawn is a guess as a whole.

import { caption, drawStation, hasPlace } from "./marks.js";

export const PIECE = "#7a2fd0";
const PALE = "rgb(240 232 252 / 45%)";
const ROOM_PX = 24;

/** Floating pieces of two stations or more; one alone is a doubtful station. */
export function piecesOf(stations) {
  const found = new Map();
  for (const station of stations) {
    if (!station.piece || station.status === "dropped" || !hasPlace(station)) continue;
    if (!found.has(station.piece)) found.set(station.piece, []);
    found.get(station.piece).push(station);
  }
  return [...found].filter(([, members]) => members.length > 1).map(([number, members]) => ({ number, members }));
}

export function drawPieces(g, view, pieces, alone, newest) {
  const others = alone.filter(hasPlace).map((station) => view.toScreen(station.x_m, station.y_m));
  for (const { number, members } of pieces) {
    const places = members.map((station) => view.toScreen(station.x_m, station.y_m));
    const edge = outline(places);
    trace(g, edge);
    g.fillStyle = "rgb(122 47 208 / 9%)";
    g.fill();
    dashed(g, [8, 5], 2.2);
    g.beginPath();
    places.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
    dashed(g, [2, 4], 1.4);
    members.forEach((station, i) => {
      drawStation(g, ...places[i], { ...station, status: "doubtful" }, PIECE, station.station === newest);
      caption(g, String(station.station), places[i][0] + 9, places[i][1] - 9, PIECE, "600 12px");
    });
    label(g, view, edge, others, `piece ${number}: not tied yet`);
  }
}

/** What the scans of pieces saw of walls: dots, not cells, for it is no evidence. `walls` is x, y, x, y... in m. */
export function drawPieceWalls(g, view, walls) {
  const size = Math.min(Math.max(0.05 * view.scale, 1.6), 4);
  g.fillStyle = PIECE;
  for (let i = 0; i < walls.length; i += 2) {
    const [x, y] = view.toScreen(walls[i], walls[i + 1]);
    g.fillRect(x - size / 2, y - size / 2, size, size);
  }
}

/** Write above the outline, or below where another station stands in the way. */
function label(g, view, edge, others, words) {
  const half = words.length * 3.4;
  const inside = (x) => Math.min(Math.max(x, half + 6), Math.max(view.width - half - 6, half + 6));
  const top = edge.reduce((a, b) => (b[1] < a[1] ? b : a));
  const bottom = edge.reduce((a, b) => (b[1] > a[1] ? b : a));
  const spots = [[inside(top[0]), Math.max(top[1] - 10, 12)], [inside(bottom[0]), bottom[1] + 12]];
  const isFree = ([x, y]) => others.every(([ox, oy]) => Math.abs(ox + 8 - x) > half + 14 || Math.abs(oy - 5 - y) > 18);
  caption(g, words, ...(spots.find(isFree) ?? spots[0]), PIECE, "600 12px", "center");
}

/** The line under the plan that tells of a piece. */
export function pieceWords({ number, members }) {
  const names = members.map((station) => station.station).join(", ");
  return [`Piece ${number} not tied yet`, `: stations ${names} hold together, but where they lie in the map is a guess; go back to where the map is known and scan there`];
}

/** The convex line around all places at a distance of `ROOM_PX`. */
function outline(places) {
  const points = places.flatMap(([x, y]) => Array.from({ length: 24 }, (_, k) => {
    const a = (k * Math.PI) / 12;
    return [x + ROOM_PX * Math.cos(a), y + ROOM_PX * Math.sin(a)];
  })).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  return [...chain(points), ...chain(points.reverse())];
}

/** One side of the convex hull of sorted points, without its last. */
function chain(points) {
  const kept = [];
  for (const p of points) {
    while (kept.length > 1 && turns(kept.at(-2), kept.at(-1), p) <= 0) kept.pop();
    kept.push(p);
  }
  return kept.slice(0, -1);
}

const turns = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);

function trace(g, points) {
  g.beginPath();
  points.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
  g.closePath();
}

/** Dashes on a pale ground, to be seen on water, on what was not seen and on walls alike. */
function dashed(g, dash, width) {
  g.lineWidth = width + 1.6;
  g.strokeStyle = PALE;
  g.stroke();
  g.setLineDash(dash);
  g.lineWidth = width;
  g.strokeStyle = PIECE;
  g.stroke();
  g.setLineDash([]);
}
