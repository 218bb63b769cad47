// Ports, lag, disk and events. Fields that this page does not know are shown as they come.

import { doubt, lines, surfaces } from "./feeds.js";

const GOOD = new Set(["open", "ok", "live", "running", "receiving", "scanning", "up"]);
const BAD = new Set(["lost", "closed", "error", "absent", "failed", "dead", "down"]);
const SILENT_S = 3;
const EVENTS_KEPT = 200;
const LAG_SLOW_S = 5;
const DISK_LOW_MIB = 500;

const element = (tag, className, text) => {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (text !== undefined) node.textContent = text;
  return node;
};

/** Lamp and word of a port: the word says what the colour says. */
export function judge(port) {
  const state = String(port.state ?? "unknown");
  if (BAD.has(state)) return { lamp: "red", word: state };
  if (Number.isFinite(port.last_s) && port.last_s > SILENT_S) return { lamp: "yellow", word: `silent for ${duration(port.last_s)}` };
  const word = doubt(port);
  if (word) return { lamp: "yellow", word };
  return { lamp: GOOD.has(state) ? "green" : "yellow", word: state };
}

export function duration(seconds) {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(0)} h`;
}

function number(value) {
  if (typeof value !== "number" || Number.isInteger(value)) return String(value);
  return Math.abs(value) >= 100 ? value.toFixed(0) : String(+value.toPrecision(3));
}

/** `rx_bytes_s: 3120` as "3120 rx bytes/s": units stand at the end of the names. */
export function phrase(name, value) {
  const shown = number(value);
  const unit = /_(s|m|deg|mib|pct)$/.exec(name)?.[1];
  if (name === "skipped") return `${shown} bytes skipped`;
  if (name === "lost") return `lost ${value === 1 ? "once" : `${shown} times`}`;
  if (/(bytes|pings|readings|frames|messages)_s$/.test(name)) return `${shown} ${name.slice(0, -2).replaceAll("_", " ")}/s`;
  if (!unit) return `${name.replaceAll("_", " ")} ${shown}`;
  return `${name.slice(0, -unit.length - 1).replaceAll("_", " ")} ${shown} ${{ deg: "°", mib: "MiB", pct: "%" }[unit] ?? unit}`;
}

export class Health {
  constructor(find, onSurfaces = () => {}, onSonar = () => {}) {
    this.find = find;
    this.onSurfaces = onSurfaces;
    this.onSonar = onSonar;
    this.clear();
  }

  clear() {
    this.find("ports").replaceChildren(element("li", "empty", "Nothing heard of the ports yet."));
    this.find("facts").replaceChildren();
    this.find("events").replaceChildren();
    for (const name of ["lag", "disk", "head-state"]) this.find(name).textContent = "";
  }

  push(header) {
    const ports = Object.entries(header.ports ?? {});
    this.find("ports").replaceChildren(...ports.map(([name, port]) => portItem(name, port)));
    this.onSurfaces(surfaces(header.ports ?? {}));
    this.onSonar(header.sonar ?? {});
    this.headline(header);
    const facts = flatten(rest(header));
    this.find("facts").replaceChildren(...facts.flatMap(([name, value]) => [element("dt", "", name), element("dd", "", number(value))]));
  }

  headline(header) {
    const head = header.sonar?.state;
    this.find("head-state").textContent = head ? String(head).replaceAll("_", " ") : "";
    const lag = header.map?.lag_s;
    const free = header.disk_free_mib;
    this.find("lag").textContent = Number.isFinite(lag) ? `map ${lag < LAG_SLOW_S ? "" : "late, "}${duration(lag)} behind` : "";
    if (!Number.isFinite(free)) return;
    const size = free >= 1024 ? `${(free / 1024).toFixed(1)} GiB` : `${free.toFixed(0)} MiB`;
    this.find("disk").dataset.level = free < DISK_LOW_MIB ? "low" : "";
    this.find("disk").textContent = `${free < DISK_LOW_MIB ? "disk low, " : ""}${size} free`;
  }

  event(header) {
    const list = this.find("events");
    const item = element("li");
    const time = element("time", "", clock(header.utc_ns));
    item.append(time, element("span", "", eventText(header)));
    list.prepend(item);
    while (list.children.length > EVENTS_KEPT) list.lastChild.remove();
  }
}

const SHOWN = new Set(["v", "seq", "session", "t_ns", "utc_ns", "topic", "arrays", "site", "newest"]);

function rest(header) {
  return Object.fromEntries(Object.entries(header).filter(([name]) => !SHOWN.has(name)));
}

/** What stands beside a port at all times: rates, and losses where there are any. The rest is in its title and under Health. */
const isBrief = ([key, value]) => value !== null && ((key.endsWith("_s") && key !== "last_s" && key !== "age_s") || (["lost", "skipped", "error"].includes(key) && value !== 0));

function portItem(name, port) {
  const { lamp, word } = judge(port);
  const item = element("li");
  item.dataset.lamp = lamp;
  item.dataset.port = name;
  const details = Object.entries(port).filter(isBrief);
  item.title = flatten(port).map(([key, value]) => `${key} ${number(value)}`).join("\n");
  item.append(element("i", "lamp"), element("span", "name", name), element("span", "word", word));
  item.append(element("span", "detail", details.map(([key, value]) => phrase(key, value).replaceAll(" ", "\u00a0")).join(" · ")));
  for (const [line, isDoubt] of lines(port)) item.append(element("span", isDoubt ? "detail doubt" : "detail", line));
  return item;
}

function flatten(value, prefix = "") {
  return Object.entries(value).flatMap(([key, each]) => {
    const name = prefix ? `${prefix} ${key}` : key;
    if (each !== null && typeof each === "object") return flatten(each, name);
    return [[name.replaceAll("_", " "), each ?? "–"]];
  });
}

function clock(utcNs) {
  return Number.isFinite(utcNs) ? new Date(utcNs / 1e6).toLocaleTimeString([], { hour12: false }) : "";
}

function eventText(header) {
  const fields = Object.entries(header.fields ?? {}).map(([key, value]) => (key === "text" ? value : `${key.replaceAll("_", " ")} ${typeof value === "object" ? JSON.stringify(value) : number(value)}`));
  return [String(header.kind ?? "event").replaceAll("_", " "), ...fields].join(", ");
}
