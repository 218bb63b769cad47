// Buttons and forms: each asks the daemon and shows its answer in words.

import { ask } from "./socket.js";

export class Commands {
  constructor(find) {
    this.find = find;
    this.counter = 0;
    for (const name of ["mark", "sonar", "hint", "drop"]) find(`form-${name}`).addEventListener("submit", (event) => this.submit(event, name));
    find("save").addEventListener("click", () => this.send({ do: "save" }, "Save"));
  }

  submit(event, name) {
    event.preventDefault();
    const form = event.currentTarget;
    if (name === "mark") this.text(form, event.submitter?.dataset.do ?? "mark");
    else if (name === "sonar") this.sonar(form);
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
    for (const name of ["range_m", "gain_pct"]) if (form[name].value !== "") request[name] = form[name].valueAsNumber;
    if (Object.keys(request).length === 1) return this.show("Give a range or a gain first.", true);
    return this.send(request, "Sonar");
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
  setSonar(rangeM, gainPct) {
    const form = this.find("form-sonar");
    form.range_m.placeholder = Number.isFinite(rangeM) ? rangeM.toFixed(1) : "";
    form.gain_pct.placeholder = Number.isFinite(gainPct) ? gainPct.toFixed(0) : "";
  }
}
