// Buttons and forms: each asks the daemon and shows its answer in words.

import { ask } from "./socket.js";

export class Commands {
  constructor(find) {
    this.find = find;
    this.counter = 0;
    for (const name of ["mark", "sonar", "hint", "drop", "tare"]) find(`form-${name}`).addEventListener("submit", (event) => this.submit(event, name));
    find("save").addEventListener("click", () => this.send({ do: "save" }, "Save"));
    find("full-circle").addEventListener("click", () => this.send({ do: "sonar", sector_deg: null }, "Full circle"));
    find("pause").addEventListener("click", () => this.send({ do: "sonar", [this.isStopped ? "start" : "stop"]: true }, this.isStopped ? "Scan" : "Pause"));
    this.isStopped = false;
    this.setSurfaces([]);
  }

  submit(event, name) {
    event.preventDefault();
    const form = event.currentTarget;
    if (name === "mark") this.text(form, event.submitter?.dataset.do ?? "mark");
    else if (name === "sonar") this.sonar(form);
    else if (name === "tare") this.tare(form);
    else if (name === "hint") this.send({ do: "hint", dx_m: form.dx_m.valueAsNumber, dy_m: form.dy_m.valueAsNumber }, "Hint");
    else this.send({ do: "drop", station: Number(form.station.value) }, `Drop station ${form.station.value}`);
  }

  async text(form, verb) {
    const text = form.text.value.trim();
    if (verb === "note" && !text) return this.show("A note needs a text: write it into the field first.", true);
    if (await this.send({ do: verb, text }, verb === "note" ? "Note" : "Mark")) form.text.value = "";
  }

  sonar(form) {
    const request = { do: "sonar" };
    for (const name of ["range_m", "gain_pct", "step_deg"]) if (form[name].value !== "") request[name] = form[name].valueAsNumber;
    const sector = ["left_deg", "right_deg"].map((name) => form[name].valueAsNumber);
    if (sector.every(Number.isFinite)) request.sector_deg = sector;
    else if (sector.some(Number.isFinite)) return this.show("A sector has a left and a right limit, clockwise from the bow.", true);
    if (Object.keys(request).length === 1) return this.show("Give a range, a gain, a step or a sector first.", true);
    return this.send(request, "Sonar").then((done) => { if (done) form.reset(); return done; });
  }

  /** Depths hang on it from then on, so it is asked for twice. */
  async tare(form) {
    const port = form.port.value;
    if (!confirm(`Take what ${port} tells now for the pressure at the surface? The vehicle must be there.`)) return;
    await this.send({ do: "tare", port }, "Tare");
  }

  async send(request, name) {
    this.show(`${name}: asking…`);
    const answer = await ask({ id: `page-${++this.counter}`, ...request });
    const error = answer.error;
    if (error) this.show(`${name}: ${[error.message, error.hint].filter(Boolean).join(" ")}`, true);
    else this.show(`${name}: done${answer.message ? `, ${answer.message}` : ""}.`);
    return !error;
  }

  show(text, bad = false) {
    this.find("answer").textContent = text;
    this.find("answer").classList.toggle("bad", bad);
  }

  /** Offer the stations that can still be dropped; the choice stays where it can. */
  setStations(stations) {
    const select = this.find("form-drop").station;
    const chosen = select.value;
    const numbers = stations.filter((station) => station.status !== "dropped").map((station) => String(station.station));
    select.replaceChildren(...numbers.map((number) => new Option(number, number)));
    if (numbers.includes(chosen)) select.value = chosen;
  }

  /** What the head is set to, where nobody is typing. */
  setSonar(sonar) {
    const form = this.find("form-sonar");
    const [left, right] = sonar.sector_deg ?? ["full", "full"];
    const shown = { range_m: sonar.range_m, gain_pct: sonar.gain_pct, step_deg: sonar.step_deg, left_deg: left, right_deg: right };
    for (const [name, value] of Object.entries(shown)) form[name].placeholder = value == null ? "" : String(typeof value === "number" ? +value.toFixed(2) : value);
    this.isStopped = sonar.state === "stopped";
    const word = this.isStopped ? "Scan" : "Pause";
    if (this.find("pause").textContent !== word) this.find("pause").textContent = word;
  }

  /** Feeds that can be tared, and what each takes for the pressure at the surface. */
  setSurfaces(surfaces) {
    const form = this.find("form-tare");
    const names = surfaces.map((surface) => surface.name);
    form.hidden = !names.length;
    if ([...form.port.options].map((option) => option.value).join() !== names.join()) form.port.replaceChildren(...names.map((name) => new Option(name, name)));
    this.find("surface").textContent = surfaces.find((surface) => surface.name === form.port.value)?.text ?? "";
  }
}
