// Colours of echoes. All ramps rise evenly in lightness, so they read without hue too.

const RAMPS = {
  // Anchors of matplotlib's inferno and cividis (CC0), perceptually uniform and safe for colour-blind eyes.
  inferno: ["#000004", "#1b0c41", "#4a0c6b", "#781c6d", "#a52c60", "#cf4446", "#ed6925", "#fb9b06", "#f7d13d", "#fcffa4"],
  cividis: ["#00101f", "#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"],
  grey: ["#000000", "#ffffff"],
};

/** Red, green and blue of `#rrggbb`. */
export function rgb(hex) {
  const value = parseInt(hex.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}

/** Colour at `t` in 0 to 1 along a ramp of hex colours. */
export function along(ramp, t) {
  const place = Math.min(Math.max(t, 0), 1) * (ramp.length - 1);
  const i = Math.min(Math.floor(place), ramp.length - 2);
  const [a, b] = [rgb(ramp[i]), rgb(ramp[i + 1])];
  return a.map((value, k) => Math.round(value + (b[k] - value) * (place - i)));
}

/** 256 colours (r, g, b after one another) for echoes 0..255, that is 0..80 dB, between floor and ceiling. */
export function echoColours(name, floorDb, ceilingDb) {
  const table = new Uint8Array(256 * 3);
  const span = Math.max(ceilingDb - floorDb, 1);
  for (let echo = 0; echo < 256; echo++) {
    table.set(along(RAMPS[name] ?? RAMPS.inferno, ((echo * 80) / 255 - floorDb) / span), echo * 3);
  }
  return table;
}
