// What stands on the plan: stations, goals, open ends, scale bar, north arrow. Lengths in CSS pixels.

const CHI2_95 = 5.991; // two degrees of freedom
const INK = { placed: "#1f6feb", doubtful: "#b58100", unplaced: "#d6409f", dropped: "#59636d" };
const HALO = "rgb(240 244 247 / 92%)";
const GOAL = "#12876d";
const BAR_STEPS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200];

/** Half axes (m) and angle (radians from east, anticlockwise) of the 95 % ellipse of a covariance. */
export function ellipse(cov) {
  const [a, b, d] = [cov[0][0], cov[0][1], cov[1][1]];
  const mean = (a + d) / 2;
  const spread = Math.hypot((a - d) / 2, b);
  const half = (variance) => Math.sqrt(CHI2_95 * Math.max(variance, 0));
  return { long: half(mean + spread), short: half(mean - spread), angle: 0.5 * Math.atan2(2 * b, a - d) };
}

export function hasPlace(station) {
  return Number.isFinite(station.x_m) && Number.isFinite(station.y_m);
}

function inMap(station) {
  return station.status === "placed" || station.status === "doubtful";
}

export function drawEllipses(g, view, stations) {
  for (const station of stations) {
    if (!hasPlace(station) || !inMap(station) || !station.cov) continue;
    const { long, short, angle } = ellipse(station.cov);
    if (!Number.isFinite(long)) continue;
    const [x, y] = view.toScreen(station.x_m, station.y_m);
    g.beginPath();
    g.ellipse(x, y, Math.max(long * view.scale, 1), Math.max(short * view.scale, 1), -angle, 0, 2 * Math.PI);
    g.fillStyle = "rgb(31 111 235 / 10%)";
    g.fill();
    g.setLineDash(station.status === "doubtful" ? [5, 4] : []);
    g.strokeStyle = INK[station.status];
    g.lineWidth = 1.2;
    g.stroke();
    g.setLineDash([]);
  }
}

export function drawTrack(g, view, stations) {
  const placed = stations.filter((station) => hasPlace(station) && inMap(station));
  g.beginPath();
  placed.forEach((station, i) => {
    const [x, y] = view.toScreen(station.x_m, station.y_m);
    if (i && placed[i - 1].piece === station.piece) g.lineTo(x, y); else g.moveTo(x, y);
  });
  g.strokeStyle = "rgb(31 111 235 / 35%)";
  g.lineWidth = 1;
  g.setLineDash([2, 3]);
  g.stroke();
  g.setLineDash([]);
}

export function drawStations(g, view, stations, newest) {
  for (const station of stations) {
    if (!hasPlace(station)) continue;
    const [x, y] = view.toScreen(station.x_m, station.y_m);
    const ink = INK[station.status] ?? INK.unplaced;
    if (station.status === "dropped") drawCross(g, x, y, ink);
    else drawStation(g, x, y, station, ink, station.station === newest);
    const name = station.status === "unplaced" ? `${station.station} ?` : String(station.station);
    caption(g, name, x + 9, y - 9, ink, "600 12px");
  }
}

export function drawStation(g, x, y, station, ink, newest) {
  const a = ((station.heading_deg ?? 0) * Math.PI) / 180;
  g.lineWidth = 2;
  g.strokeStyle = ink;
  g.beginPath();
  g.moveTo(x + 5 * Math.sin(a), y - 5 * Math.cos(a));
  g.lineTo(x + 13 * Math.sin(a), y - 13 * Math.cos(a));
  g.stroke();
  g.beginPath();
  g.arc(x, y, 5, 0, 2 * Math.PI);
  g.fillStyle = station.status === "placed" ? ink : HALO;
  g.fill();
  if (station.status === "unplaced") g.setLineDash([2.5, 2]);
  g.stroke();
  g.setLineDash([]);
  if (!newest) return;
  g.beginPath();
  g.arc(x, y, 9, 0, 2 * Math.PI);
  g.lineWidth = 1.2;
  g.stroke();
}

function drawCross(g, x, y, ink) {
  g.strokeStyle = ink;
  g.lineWidth = 2;
  g.beginPath();
  g.moveTo(x - 4, y - 4); g.lineTo(x + 4, y + 4);
  g.moveTo(x - 4, y + 4); g.lineTo(x + 4, y - 4);
  g.stroke();
}

export function drawGoals(g, view, goals) {
  goals.forEach((goal, i) => {
    const [x, y] = view.toScreen(goal.x_m, goal.y_m);
    g.save();
    g.translate(x, y);
    g.rotate(Math.PI / 4);
    g.fillStyle = HALO;
    g.fillRect(-6, -6, 12, 12);
    g.strokeStyle = GOAL;
    g.lineWidth = 2.2;
    g.strokeRect(-6, -6, 12, 12);
    g.restore();
    caption(g, String.fromCharCode(65 + (i % 26)), x + 11, y, GOAL, "700 12px");
  });
}

export function drawOpenEnds(g, view, ends) {
  g.strokeStyle = "#b3261e";
  g.lineWidth = 1.6;
  for (const [ex, ey] of ends) {
    const [x, y] = view.toScreen(ex, ey);
    g.beginPath();
    g.arc(x, y, 4, 0, 2 * Math.PI);
    g.stroke();
  }
}

export function drawScaleBar(g, view) {
  const length = BAR_STEPS.findLast((step) => step * view.scale <= 150) ?? BAR_STEPS[0];
  const pixels = length * view.scale;
  const [x, y] = [view.width - 20 - pixels, view.height - 20];
  plate(g, x - 10, y - 24, pixels + 20, 36);
  g.fillStyle = "#f4f8fa";
  g.strokeStyle = "#f4f8fa";
  g.lineWidth = 1;
  g.strokeRect(x, y - 2, pixels, 5);
  g.fillRect(x, y - 2, pixels / 2, 5);
  write(g, `${length} m`, x + pixels / 2, y - 11, "12px", "center");
}

export function drawNorth(g, view) {
  const [x, y] = [view.width - 30, 34];
  plate(g, x - 16, y - 24, 32, 52);
  g.fillStyle = "#f4f8fa";
  g.beginPath();
  g.moveTo(x, y - 4); g.lineTo(x + 7, y + 20); g.lineTo(x, y + 15); g.lineTo(x - 7, y + 20); g.closePath();
  g.fill();
  write(g, "N", x, y - 13, "600 12px", "center");
}

function plate(g, x, y, width, height) {
  g.fillStyle = "rgb(10 14 18 / 78%)";
  g.beginPath();
  g.roundRect(x, y, width, height, 4);
  g.fill();
}

export function caption(g, text, x, y, ink, font, align = "left") {
  g.lineJoin = "round";
  g.lineWidth = 3.5;
  g.strokeStyle = HALO;
  setFont(g, font, align);
  g.strokeText(text, x, y);
  g.fillStyle = ink;
  g.fillText(text, x, y);
}

function write(g, text, x, y, font, align) {
  setFont(g, font, align);
  g.fillText(text, x, y);
}

function setFont(g, font, align) {
  g.font = `${font} ${getComputedStyle(document.body).fontFamily}`;
  g.textAlign = align;
  g.textBaseline = "middle";
}
