// Wires the page: messages to pictures, keys to actions, silence to a banner.

import { Commands } from "./commands.js";
import { compassLine } from "./feeds.js";
import { Health } from "./health.js";
import { MeshView } from "./mesh.js";
import { Plan } from "./plan.js";
import { Polar, degreesText } from "./polar.js";
import { Link } from "./socket.js";

const STALE_MS = 3000;
const find = (id) => document.getElementById(id);

const polar = new Polar(find("polar"), find("polar-readout"));
const plan = new Plan(find("plan"), find("plan-readout"), find("outside"));
const mesh = new MeshView(find("mesh"), find("mesh-note"));
const commands = new Commands(find);
const health = new Health(find, (surfaces) => commands.setSurfaces(surfaces), (sonar) => commands.setSonar(sonar));
const page = { session: null, heard: null, open: false, bridge: {}, pings: [] };

const TOPICS = {
  ping: showPing,
  station: (message) => { plan.push(message); commands.setStations(message.header.stations); showCompass(message.header.compass); },
  "grid/key": (message) => plan.push(message),
  "grid/delta": (message) => plan.push(message),
  fill: (message) => plan.push(message),
  mesh: (message) => mesh.push(message),
  guide: (message) => { plan.push(message); showGoals(message.header.goals ?? []); },
  health: ({ header }) => { health.push(header); showSite(header); },
  event: ({ header }) => health.event(header),
};

function receive(message) {
  if (message.topic === "bridge") { hearBridge(message.header); return; }
  const { session } = message.header;
  if (page.session !== null && session !== page.session) clear();
  page.session = session;
  find("session").textContent = session ? `session ${session}` : "";
  TOPICS[message.topic]?.(message);
}

/** The bridge tells every second how long the daemon has been silent: what it kept for a late page is not news. */
function hearBridge(header) {
  page.bridge = header;
  page.heard = header.silent_s === null ? null : performance.now() - header.silent_s * 1000;
  showLink();
}

/** A new start of the daemon: nothing of the old one may stay on the page. */
function clear() {
  for (const part of [polar, plan, mesh, health]) part.clear();
  page.pings = [];
  commands.setStations([]);
  showGoals([]);
  showCompass(null);
  for (const name of ["heading", "depth", "bearing", "range", "gain", "turn"]) setNumber(name, null);
}

function setNumber(name, text, unit = "") {
  const cell = find(name);
  cell.replaceChildren(text ?? "–");
  if (text === null || !unit) return;
  const small = document.createElement("small");
  small.textContent = unit;
  cell.append(small);
}

function showPing(message) {
  const { header } = message;
  polar.push(message);
  setNumber("heading", header.heading_deg == null ? "none" : degreesText(header.heading_deg));
  setNumber("depth", header.depth_m == null ? "none" : header.depth_m.toFixed(2), header.depth_m == null ? "" : "m");
  setNumber("bearing", degreesText(header.bearing_deg));
  setNumber("range", header.range_m.toFixed(1), "m");
  if (header.gain_pct != null) setNumber("gain", header.gain_pct.toFixed(0), "%");
  showTurn(header);
}

/** Seconds a full circle takes at the rate of the last pings. */
function showTurn({ t_ns, step_deg }) {
  page.pings.push(t_ns / 1e9);
  if (page.pings.length > 40) page.pings.shift();
  const span = page.pings.at(-1) - page.pings[0];
  if (page.pings.length < 10 || span <= 0 || !step_deg) return;
  setNumber("turn", ((span / (page.pings.length - 1)) * (360 / step_deg)).toFixed(0), "s");
}

function showGoals(goals) {
  find("goals").replaceChildren(...goals.map((goal, i) => {
    const item = document.createElement("li");
    const name = document.createElement("b");
    name.textContent = String.fromCharCode(65 + (i % 26));
    item.append(name, goal.why ?? `${goal.x_m.toFixed(1)} m east, ${goal.y_m.toFixed(1)} m north`);
    return item;
  }));
  if (!goals.length) find("goals").innerHTML = '<li class="empty">Nothing to suggest yet.</li>';
}

function showCompass(facts) {
  const [line, doubt] = compassLine(facts);
  const bold = document.createElement("b");
  bold.textContent = doubt;
  find("compass").replaceChildren(line, doubt ? ", " : "", bold);
  find("compass").hidden = !line;
}

function showSite(header) {
  const site = header.site ?? "";
  find("site").textContent = site;
  document.title = site ? `${site} · lacuna` : "lacuna";
}

/** Lamp, word and banner of the connection: never a stale picture without saying so. */
function showLink() {
  const silent = page.heard === null ? Infinity : performance.now() - page.heard;
  const { lamp, word, banner } = judgeLink(silent);
  find("link").dataset.lamp = lamp;
  find("link-word").textContent = word;
  find("banner").hidden = !banner;
  find("banner").dataset.level = lamp;
  if (banner && find("banner").textContent !== banner) find("banner").textContent = banner;
}

function judgeLink(silent) {
  if (!page.open) return { lamp: "red", word: "connection lost", banner: "The connection to the dashboard's server is lost; trying again. What you see is old." };
  if (page.bridge.refused) return { lamp: "red", word: "version", banner: page.bridge.refused };
  if (page.heard === null) return { lamp: "yellow", word: "waiting", banner: `Waiting for the daemon at ${page.bridge.source ?? "…"}. Is \`lacuna run\` or \`lacuna demo\` running?` };
  if (silent > STALE_MS) return { lamp: "yellow", word: "stale", banner: `No data for ${(silent / 1000).toFixed(0)} s. What you see is old.` };
  if (page.bridge.grid === "waiting") return { lamp: "yellow", word: "live", banner: "A part of the plan was missed; waiting for the next whole grid." };
  return { lamp: "green", word: "live", banner: "" };
}

function orient(northUp) {
  polar.setNorthUp(northUp);
  find("north-up").setAttribute("aria-pressed", String(northUp));
  find("heading-up").setAttribute("aria-pressed", String(!northUp));
}

function select(name) {
  for (const each of ["plan", "mesh"]) {
    const chosen = each === name;
    find(`tab-${each}`).setAttribute("aria-selected", String(chosen));
    find(`tab-${each}`).tabIndex = chosen ? 0 : -1;
    find(`${each}-box`).hidden = !chosen;
    find(`${each}-tools`).hidden = !chosen;
  }
  for (const each of ["free", "unknown", "station", "end", "goal"]) find(`legend-${each}`).hidden = name === "mesh";
  find("legend-floor").hidden = name === "plan";
  document.querySelector(".map").toggleAttribute("data-mesh", name === "mesh");
  mesh.show(name === "mesh");
}

function setPicture() {
  const [floor, ceiling] = [Number(find("floor").value), Number(find("ceiling").value)];
  find("floor-db").value = `${floor} dB`;
  find("ceiling-db").value = `${ceiling} dB`;
  polar.setColours(find("palette").value, floor, ceiling);
}

const KEYS = {
  h: () => orient(!polar.northUp),
  f: () => plan.fit(),
  m: () => find("form-mark").requestSubmit(find("form-mark").querySelector("[data-do=mark]")),
  1: () => select("plan"),
  2: () => select("mesh"),
  "+": () => plan.view.zoom(1.25),
  "-": () => plan.view.zoom(0.8),
};

function key(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input:not([type=checkbox], [type=range]), select, textarea")) return;
  KEYS[event.key.toLowerCase()]?.();
}

function start() {
  find("heading-up").onclick = () => orient(false);
  find("north-up").onclick = () => orient(true);
  for (const name of ["plan", "mesh"]) find(`tab-${name}`).onclick = () => select(name);
  document.querySelector("[role=tablist]").addEventListener("keydown", (event) => {
    if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
    const other = find("mesh-box").hidden ? "mesh" : "plan";
    select(other);
    find(`tab-${other}`).focus();
  });
  find("zoom-in").onclick = KEYS["+"];
  find("zoom-out").onclick = KEYS["-"];
  find("fit").onclick = KEYS.f;
  find("measured-only").onchange = (event) => mesh.setMeasuredOnly(event.target.checked);
  for (const name of ["palette", "floor", "ceiling"]) find(name).oninput = setPicture;
  document.addEventListener("keydown", key);
  clear();
  setPicture();
  setInterval(showLink, 500);
  const address = new URL("ws", location.href);
  address.protocol = address.protocol.replace("http", "ws");
  new Link(address, receive, (open) => { page.open = open; showLink(); });
}

start();
