// Numbers and names as text.

/// A number with so many digits that count, without noise: 0.00123, 12.3, 1,234, 1.2e-7; "–" where it is not known.
export function number(value, digits = 3) {
  if (value === null || value === undefined || !isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-3 || size >= 1e7) return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e").replace("-", "−");
  const rounded = Number(value.toPrecision(digits));
  const places = Math.max(0, digits - 1 - Math.floor(Math.log(Math.abs(rounded)) / Math.LN10 + 1e-12));
  return grouped(size >= 1000 ? Math.round(value).toString() : rounded.toFixed(Math.min(places, 10))).replace("-", "−");
}

/// All digits, as the files have them.
export function exact(value) {
  if (value === null || value === undefined) return "–";
  return typeof value === "number" ? String(value).replace("-", "−") : String(value);
}

/// A time to the hundredth, without zeros that say nothing.
export const seconds = (time) => String(Math.round(time * 100) / 100).replace("-", "−");

export const count = (value) => (value === null || value === undefined ? "–" : grouped(String(Math.round(value))));

function grouped(text) {
  const [whole, part] = text.split(".");
  const spaced = whole.length > 4 || /^-?\d{4}$/.test(whole) ? whole.replace(/\B(?=(\d{3})+(?!\d))/g, ",") : whole;
  return part === undefined ? spaced : `${spaced}.${part}`;
}

export const percent = (share, digits = 3) => (share === null || share === undefined ? "–" : `${number(100 * share, digits)} %`);

/// "speed [m/s]", or the name alone for what has no unit.
export const withUnit = (name, unit) => (unit && unit !== "1" ? `${name} [${unit === "us" ? "µs" : unit}]` : name);

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/// "a", "a and b", "a, b and c"
export function listed(words) {
  if (words.length < 2) return words.join("");
  return `${words.slice(0, -1).join(", ")} and ${words[words.length - 1]}`;
}

/// A name that is safe in files and in addresses.
export const stem = (text) => text.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "");
