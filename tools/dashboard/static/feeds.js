// What the lines of compass and depth sensor are worth, in words: ages, doubts, checksums, field, surface.

const DOUBTS = ["bad", "suspect"];

/** Whether a line of health is that of a feed, and not the sonar's. */
export const isFeed = (port) => Array.isArray(port.stale);

/** Why a feed is not to be trusted just now, as one or two words; empty where nothing speaks against it. */
export function doubt(port) {
  if (!isFeed(port)) return "";
  if (port.stale.length) return `${port.stale.join(", ")} stale`;
  const now = Object.entries(port.now ?? {});
  for (const quality of DOUBTS) {
    const found = now.find(([, told]) => told.quality === quality);
    if (found) return `${found[0]} ${quality}`;
  }
  return "";
}

/** Lines that stand below a feed's port at all times: a text, and whether it is a doubt. */
export function lines(port) {
  if (!isFeed(port)) return [];
  const now = Object.entries(port.now ?? {}).filter(([, told]) => told.reason);
  const refused = Object.entries(port.bad ?? {}).map(([reason, count]) => `${reason.replaceAll("_", " ")} ${count}`);
  const doubts = DOUBTS.filter((quality) => port.quality?.[quality]).map((quality) => `${port.quality[quality]} ${quality}`);
  const found = now.map(([what, told]) => [`${what}: ${told.reason}`, true]);
  if (doubts.length) found.push([`so far ${doubts.join(", ")}${now.length || !port.last_reason ? "" : `; last: ${port.last_reason}`}`, true]);
  if (refused.length) found.push([`refused: ${refused.join(", ")}`, true]);
  if (port.field != null) found.push([`field ${+port.field.toPrecision(4)}${port.undisturbed_field == null ? "" : `, undisturbed ${port.undisturbed_field}`}`, false]);
  return found;
}

/** Feeds whose depths hang on the pressure at the surface: name and what is taken for it. */
export function surfaces(ports) {
  return Object.entries(ports).filter(([, port]) => port.surface).map(([name, port]) => ({ name, text: `${port.surface.mbar.toFixed(1)} mbar, ${port.surface.origin}` }));
}

/** What the walls say of the compass (`compass` of the stations' snapshot) in a line, and where it was disturbed. */
export function compassLine(facts) {
  if (!facts) return ["", ""];
  const figure = (name, value, sd) => `${name} ${value.toFixed(1)} ± ${sd.toFixed(1)}°`.replaceAll(" ", "\u00a0").replace("-", "\u2212");
  const bias = figure("bias", facts.bias_deg, facts.bias_sd_deg);
  const deviation = figure("deviation", facts.deviation_deg, facts.deviation_sd_deg);
  const { disturbed, stations } = facts;
  const line = `Compass, by the walls at ${stations} station${stations === 1 ? "" : "s"}: ${bias}, ${deviation}`;
  return [line, disturbed.length ? `disturbed at ${disturbed.join(", ")}` : ""];
}
