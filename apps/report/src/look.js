// How figures look: on a light page, on a dark one, on paper. The colours of lines are those of Okabe and Ito, which
// readers with any kind of colour vision tell apart; on dark ground they are a shade lighter.
const shared = {font: "system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif", fontSize: 12};

export const light = {
  ...shared, name: "light",
  ground: "#ffffff", text: "#1b1f24", faint: "#57606a", line: "#8c959f", grid: "#e4e8ec", panel: "#f6f8fa",
  estimate: "#0072b2", truth: "#1b1f24", reference: "#b35900", measured: "#007a55", plan: "#a3417c", bound: "#57606a",
  band: "rgba(0, 114, 178, 0.20)", alarm: "#b00020", gap: "rgba(87, 96, 106, 0.16)", finding: "rgba(213, 94, 0, 0.16)", halo: "rgba(255, 255, 255, 0.85)",
  blocks: ["#0072b2", "#c44e00", "#007a55", "#a3417c", "#7a6000", "#2b8cbe"],
  kinds: ["#0072b2", "#c44e00", "#007a55", "#a3417c", "#7a6000", "#1b1f24"],
};

export const dark = {
  ...shared, name: "dark",
  ground: "#14181d", text: "#e8ebee", faint: "#a5aeb8", line: "#6b7580", grid: "#2a3138", panel: "#1c2127",
  estimate: "#56b4e9", truth: "#f0f2f4", reference: "#f0a040", measured: "#35c798", plan: "#e191c0", bound: "#a5aeb8",
  band: "rgba(86, 180, 233, 0.25)", alarm: "#ff7b88", gap: "rgba(165, 174, 184, 0.18)", finding: "rgba(240, 160, 64, 0.20)", halo: "rgba(20, 24, 29, 0.85)",
  blocks: ["#56b4e9", "#f28e4b", "#35c798", "#e191c0", "#d9c24a", "#9ad0f0"],
  kinds: ["#56b4e9", "#f28e4b", "#35c798", "#e191c0", "#d9c24a", "#f0f2f4"],
};

export const paper = {...light, name: "paper", panel: "#ffffff", grid: "#dddddd", text: "#000000", faint: "#333333", line: "#666666"};

// Two scales of colour that are even in lightness: `ground` from strong slip (dark) to none (light), `error` from small
// (light) to large (dark); `change` has its middle at zero.
export const scales = {
  ground: [[38, 70, 110], [72, 118, 152], [134, 170, 184], [201, 212, 200], [250, 240, 205]],
  error: [[252, 243, 212], [245, 200, 140], [224, 140, 98], [176, 82, 92], [104, 40, 84]],
  change: [[33, 102, 172], [146, 197, 222], [247, 247, 247], [244, 165, 130], [178, 24, 43]],
};

/// The colour at `share` (0 to 1) of a scale, as [red, green, blue].
export function colourAt(scale, share) {
  const at = Math.min(Math.max(share, 0), 1) * (scale.length - 1);
  const below = Math.min(Math.floor(at), scale.length - 2);
  return scale[below].map((low, i) => Math.round(low + (at - below) * (scale[below + 1][i] - low)));
}

export const css = ([red, green, blue]) => `rgb(${red}, ${green}, ${blue})`;

/// Black or white, whichever is read better on a colour.
export function readableOn([red, green, blue]) {
  const linear = [red, green, blue].map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : Math.pow((c / 255 + 0.055) / 1.055, 2.4)));
  return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] > 0.18 ? "#000000" : "#ffffff";
}
