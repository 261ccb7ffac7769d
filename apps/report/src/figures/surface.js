// A surface over a grid, seen from where the reader likes, with a plane beside it: what "full-horizon blocking" has.
// ECharts draws it as polygons, the far ones first; a height over a grid seen from above is right that way.
import {colourAt, css, scales} from "../look.js";
import {isKnown, niceStep, tick} from "./parts.js";

export const startView = {turn: -50, tilt: 28};

/// Shapes for ECharts' `graphic` in a box of pixels. `axes`: two of {label, values}; `heights[i][j]`, null where unknown;
/// `plane`: a height or null; `range`: {min, max} of the heights shown; `shade(height)`: a colour.
export function surfaceShapes(look, box, {axes, heights, plane, range, shade, label, view = startView}) {
  const places = axes.map((axis) => placesOf(axis.values));
  const project = projection(box, view);
  const lift = (height) => (Math.min(Math.max(height, range.min), range.max) - range.min) / (range.max - range.min) - 0.5;
  const shapes = [], text = textMaker(look);
  shapes.push(...room(look, project, places, axes, range, lift, text, label, view, box));
  const quads = [];
  const [us, vs] = places;
  for (let i = 0; i + 1 < us.length; ++i) {
    for (let j = 0; j + 1 < vs.length; ++j) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
      const depth = project.depth((us[i] + us[i + 1]) / 2, (vs[j] + vs[j + 1]) / 2);
      const add = (values, style) => quads.push({depth, height: values.reduce((a, b) => a + b) / 4, style,
        points: corners.map(([a, b], c) => project(us[a], vs[b], lift(values[c])))});
      const values = corners.map(([a, b]) => heights[a][b]);
      if (values.every(isKnown)) {
        const mean = values.reduce((a, b) => a + b) / 4;
        add(values, {fill: css(shade(mean)), stroke: look.name === "dark" ? "rgba(20,24,29,0.55)" : "rgba(27,31,36,0.45)", lineWidth: 0.6});
      }
      if (isKnown(plane)) add([plane, plane, plane, plane], {fill: look.truth, opacity: look.name === "dark" ? 0.22 : 0.16, stroke: "none"});
    }
  }
  quads.sort((a, b) => b.depth - a.depth || a.height - b.height);
  for (const {points, style} of quads) shapes.push({type: "polygon", silent: true, shape: {points}, style});
  if (isKnown(plane)) {
    const rim = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(([u, v]) => project(u, v, lift(plane)));
    shapes.push({type: "polygon", silent: true, shape: {points: rim}, style: {fill: "none", stroke: look.truth, lineWidth: 1.2, lineDash: [5, 3]}});
  }
  return shapes;
}

/// Values on -0.5 .. 0.5: numbers where they are, others evenly.
function placesOf(values) {
  const numeric = values.length > 1 && values.every((value) => typeof value === "number");
  const [low, high] = numeric ? [Math.min(...values), Math.max(...values)] : [0, Math.max(values.length - 1, 1)];
  return values.map((value, i) => ((numeric ? value : i) - low) / (high - low || 1) - 0.5);
}

function projection(box, {turn, tilt}) {
  const [a, b] = [turn * Math.PI / 180, tilt * Math.PI / 180];
  const [ca, sa, cb, sb] = [Math.cos(a), Math.sin(a), Math.cos(b), Math.sin(b)];
  const tall = 0.62;  // height of the box in units of its width
  const scale = Math.min(box.width / 1.62, box.height / (1.42 * sb + tall * cb + 0.2));
  const project = (u, v, h) => {
    const x = u * ca - v * sa, y = u * sa + v * ca;
    return [box.left + box.width / 2 + scale * x + box.shift, box.top + box.height / 2 - scale * (y * sb + h * tall * cb) + box.drop];
  };
  project.depth = (u, v) => u * sa + v * ca;
  return project;
}

function textMaker(look) {
  return (words, [x, y], align = "center", size = look.fontSize - 1, fill = look.faint) => ({
    type: "text", silent: true, x, y, style: {text: words, fill, textAlign: align, textVerticalAlign: "middle", font: `${size}px ${look.font}`}});
}

/// Floor, back walls, ticks and names of the axes, at the edges that face the reader.
function room(look, project, places, axes, range, lift, text, label, {turn}, box) {
  const shapes = [];
  const line = (points, colour = look.grid, width = 1) => shapes.push({type: "polyline", silent: true, shape: {points}, style: {stroke: colour, lineWidth: width, fill: "none"}});
  const corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
  const nearest = corners.reduce((best, corner) => (project.depth(...corner) < project.depth(...best) ? corner : best));
  const [nearU, nearV] = nearest;
  const heights = ticksOf(range);
  line(corners.concat([corners[0]]).map(([u, v]) => project(u, v, -0.5)), look.line);
  for (const height of heights)
    line([project(nearU, -nearV, lift(height)), project(-nearU, -nearV, lift(height)), project(-nearU, nearV, lift(height))]);
  line([project(-nearU, -nearV, -0.5), project(-nearU, -nearV, 0.5)], look.grid);
  const ends = [project(nearU, -nearV, -0.5), project(-nearU, nearV, -0.5)];
  const left = ends[0][0] < ends[1][0] ? [nearU, -nearV] : [-nearU, nearV];
  line([project(...left, -0.5), project(...left, 0.5)], look.line);
  let widest = 0;
  for (const height of heights) {
    const [x, y] = project(...left, lift(height)), isLowest = lift(height) < -0.47;  // clear of the numbers of the floor
    shapes.push(text(tick(height), [x - 6, isLowest ? y - 7 : y], "right"));
    widest = Math.max(widest, tick(height).length);
  }
  const [topX, topY] = project(...left, 0.5);
  shapes.push({...text(label, [Math.max(box.left + 2, topX - 8 - widest * 6), topY - 16], "left", look.fontSize, look.text)});
  const along = [(u, outward) => project(u, nearV * (1 + outward), -0.5), (v, outward) => project(nearU * (1 + outward), v, -0.5)];
  axes.forEach((axis, a) => {
    const [x0, y0] = along[a](0, 0), [x1, y1] = along[a](0, 0.3), length = Math.hypot(x1 - x0, y1 - y0) || 1;
    const outward = ([x, y], pixels) => [x + pixels * (x1 - x0) / length, y + pixels * (y1 - y0) / length];
    for (const index of tickIndices(axis.values, a === 0 ? 7 : 6)) {
      const place = along[a](places[a][index], 0);
      line([place, outward(place, 5)], look.line);
      shapes.push(text(String(axis.values[index]), outward(place, 15)));
    }
    const side = (x1 - x0) / length, wide = axis.label.length * look.fontSize * 0.6, [x, y] = outward([x0, y0], 30);
    const left = Math.min(Math.max(side < -0.25 ? x - wide : side > 0.25 ? x : x - wide / 2, box.left + 2), box.left + box.width - wide - 2);
    shapes.push(text(axis.label, [left, y], "left", look.fontSize, look.text));
  });
  return shapes;
}

function ticksOf({min, max}) {
  const step = niceStep((max - min) / 4), ticks = [];
  for (let value = Math.ceil(min / step - 1e-9) * step; value <= max + 1e-9 * step; value += step) ticks.push(Number(value.toPrecision(10)));
  return ticks;
}

function tickIndices(values, most) {
  if (values.length <= most) return values.map((_, i) => i);
  const every = Math.ceil(values.length / most), indices = [];
  for (let i = 0; i < values.length; ++i)
    if (i === 0 || (typeof values[i] === "number" ? values[i] % (every <= 5 ? 5 : 10) === 0 : i % every === 0)) indices.push(i);
  return indices.length > 1 ? indices : [0, values.length - 1];
}

/// What of a map of heights is shown: all, or without a few that would flatten the rest.
export function shownRange(heights, plane, {zero = false} = {}) {
  const values = heights.reduce((all, row) => all.concat(row), []).filter(isKnown).sort((a, b) => a - b);
  if (values.length === 0) return {min: 0, max: 1, cut: 0};
  const q = (share) => values[Math.min(values.length - 1, Math.floor(share * values.length))];
  let low = values[0], high = values[values.length - 1];
  const limit = Math.max(q(0.93) + 1.0 * (q(0.93) - low), isKnown(plane) ? plane + 0.3 * Math.abs(plane - low) : -Infinity);
  let cut = 0;
  if (high > limit) {
    high = limit;
    cut = values.filter((value) => value > limit).length;
  }
  if (isKnown(plane)) {
    low = Math.min(low, plane);
    high = Math.max(high, plane);
  }
  if (zero) low = Math.min(low, 0);
  const step = niceStep((high - low || Math.abs(high) || 1) / 5);
  return {min: Math.floor(low / step - 1e-9) * step, max: cut ? high : Math.ceil(high / step - 1e-9) * step || step, cut};
}

/// Colours of heights: better than the reference blue, worse red; without a reference from small to large.
export function shading(range, plane) {
  if (!isKnown(plane)) return (value) => colourAt(scales.error, (value - range.min) / (range.max - range.min));
  const span = Math.max(plane - range.min, Math.min(range.max - plane, plane - range.min || Infinity), 1e-12);
  return (value) => colourAt(scales.change, 0.5 + 0.5 * (value - plane) / span);
}
