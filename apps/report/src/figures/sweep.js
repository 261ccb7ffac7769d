// What a sweep found: errors and times over a grid, beside full-horizon blocking, absolute and relative, by speed, in
// pairs of the same seed. `state` is what the reader has chosen (startState).
import {css, readableOn} from "../look.js";
import {capital, count, number, stem, withUnit} from "../text.js";
import {addDrawing, addFrame, addLegend, addLine, addShapes, axisRange, base, extentOf, isKnown, tooltip} from "./parts.js";
import {shading, shownRange, startView, surfaceShapes} from "./surface.js";

// ---- what is looked at

export function startState(document) {
  const map = document.maps[0], measures = measuresOf(document, ["mae"]);
  return {setting: map.setting.slice(), measure: (measures[0] || document.measures[0]).name, relative: false,
          time: (measuresOf(document, ["time"])[0] || {}).name, cell: startCell(map), ...startView};
}

function startCell(map) {
  const index = (axis, value) => (axis ? Math.max(0, axis.values.indexOf(value)) : 0);
  return map.is_blocking ? [index(map.axes[0], 2), index(map.axes[1], 4)] : [0, 0];
}

export const measuresOf = (document, groups) => document.measures.filter((measure) => groups.indexOf(measure.group) >= 0);
export const measureOf = (document, name) => document.measures.find((measure) => measure.name === name);
export const mapAt = (document, setting) => document.maps.find((map) => map.setting.every((value, i) => value === setting[i]));

/// The map for a setting of which `fixed` must hold: the one that differs in the fewest other choices.
export function nearestSetting(document, setting, fixed) {
  const distance = (map) => map.setting.reduce((sum, value, i) => sum + (value === setting[i] ? 0 : 1), 0);
  const fitting = document.maps.filter((map) => map.setting[fixed] === setting[fixed]);
  return fitting.length ? fitting.reduce((best, map) => (distance(map) < distance(best) ? map : best)).setting.slice() : null;
}

/// The choices that a reader makes first: the place, the speed, what is blocked; of other sweeps, the first three.
export function mainChoices(document) {
  const wanted = document.choices.map((choice, i) => (/^(path|path\.name|scenario|speed|blocked)$/.test(choice.key) ? i : -1)).filter((i) => i >= 0);
  return wanted.length ? wanted : document.choices.map((_, i) => i).slice(0, 3);
}

export const choiceText = (choice, value) => (choice.values[value] === null ? "not given" : String(choice.values[value]));

/// A setting in words: the main choices, and of the others those that are not as in the first map.
export function settingText(document, setting, without = -1) {
  const main = mainChoices(document), usual = document.maps[0].setting;
  return document.choices.map((choice, i) => {
    if (choice.values.length < 2 || i === without || (main.indexOf(i) < 0 && setting[i] === usual[i])) return null;
    return `${choice.label} ${choiceText(choice, setting[i])}${choice.key === "speed" ? " m/s" : ""}`;
  }).filter(Boolean).join(", ");
}

/// "Error: path zigzag, speed 8 m/s", or without the colon where nothing else is to choose.
const titled = (head, setting) => (setting ? `${head}: ${setting}` : head);

const labelOf = (measure) => withUnit(measure.label, measure.unit);
const shortLabel = (measure) => withUnit(measure.label.replace(/^mean absolute error of /, "").replace(/^mean absolute /, ""), measure.unit);

/// Heights of a map in a measure: as they are, or in per cent of the reference's.
export function heightsOf(map, name, relative) {
  const means = map.means[name] || map.runs.map((row) => row.map(() => null));
  const reference = map.reference && map.reference.means ? map.reference.means[name] : null;
  if (!relative || !isKnown(reference) || reference === 0) return {heights: means, plane: isKnown(reference) ? reference : null, relative: false};
  return {heights: means.map((row) => row.map((value) => (isKnown(value) ? 100 * (value / reference - 1) : null))), plane: 0, relative: true};
}

const hasTwoAxes = (map) => Boolean(map.axes[1]) && map.axes[0].values.length > 1 && map.axes[1].values.length > 1;
const isNumeric = (axis) => axis.values.every((value) => typeof value === "number");
/// Between numbers there are others, and a surface; between names there is nothing.
const isSurface = (map) => hasTwoAxes(map) && map.axes.every(isNumeric);
/// Whether a map of the sweep is looked at cell by cell.
export const hasCells = (document) => document.maps.some(hasTwoAxes);

// ---- figures

export function sweepFigures(document) {
  const first = document.maps[0];
  if (!first) return {surfaces: [], explore: [], pairs: [], speed: [], times: []};
  const anyTwo = hasCells(document), anySurface = document.maps.some(isSurface), anyReference = document.maps.some((map) => map.reference), times = measuresOf(document, ["time"]);
  return {
    surfaces: anySurface ? [fourSurfaces(document, false)].concat(anyReference ? [fourSurfaces(document, true)] : []) : [],
    explore: anyTwo ? [anySurface && oneSurface(document, "surface", (state) => state.measure), heatMap(document, "heat", (state) => state.measure)]
                    : [curves(document)],
    pairs: document.maps.some((map) => map.pairs) ? [pairFigure(document)] : [],
    speed: numericChoice(document) >= 0 ? [overChoice(document)] : [],
    times: times.length && anyTwo ? [anySurface && oneSurface(document, "time-surface", (state) => state.time), heatMap(document, "time-heat", (state) => state.time)] : [],
  };
}

const mapOf = (document, state) => mapAt(document, state.setting);

const paperOrder = ["mae.tracking", "mae.kappa", "mae.position", "mae.mu"];

/// Four measures as the paper shows them; of another model the first four.
function fourMeasures(document) {
  const all = measuresOf(document, ["mae"]);
  const asInPaper = paperOrder.map((name) => measureOf(document, name)).filter(Boolean);
  return (asInPaper.length === 4 ? asInPaper : all.slice(0, 4));
}

function fourSurfaces(document, relative) {
  const measures = fourMeasures(document);
  const columns = (width) => (width < 560 ? 1 : 2);
  const panel = (width) => Math.min(330, Math.round(0.78 * width / columns(width)));
  return {
    name: relative ? "surfaces-relative" : "surfaces",
    title: (state) => titled(`Mean absolute errors${relative ? " relative to full-horizon blocking" : ""}`, settingText(document, state.setting)),
    caption: (state) => surfaceCaption(mapOf(document, state), measures, relative),
    about: ["runs", "settings"], turns: true,
    height: (width) => Math.ceil(measures.length / columns(width)) * panel(width),
    option: (look, {width, state}) => {
      const option = base(look), map = mapOf(document, state), across = columns(width);
      addDrawing(option, measures.reduce((shapes, measure, m) => {
        const box = {left: (m % across) * width / across, top: Math.floor(m / across) * panel(width), width: width / across, height: panel(width)};
        return shapes.concat(panelTitle(look, box, `(${"abcd"[m]}) ${shortLabel(measure)}${relative ? ", change" : ""}`),
                             surface(look, {...box, top: box.top + 26, height: box.height - 26}, map, measure, relative, state));
      }, []));
      return option;
    },
    table: (state) => gridTable(mapOf(document, state), measures, relative),
  };
}

function panelTitle(look, box, words) {
  return [{type: "text", silent: true, x: box.left + box.width / 2, y: box.top + 12, style: {text: words, fill: look.text, textAlign: "center", textVerticalAlign: "middle", font: `600 ${look.fontSize + 1}px ${look.font}`}}];
}

function surface(look, box, map, measure, relative, {turn, tilt}) {
  const {heights, plane, relative: inPercent} = heightsOf(map, measure.name, relative);
  if (!isSurface(map)) return panelTitle(look, {...box, top: box.top + box.height / 2}, hasTwoAxes(map) ? "names vary here: see it cell by cell" : "one axis alone varies here");
  const range = shownRange(heights, plane);
  return surfaceShapes(look, {...box, shift: 6, drop: 0}, {
    axes: map.axes.map((axis) => ({label: axis.label, values: axis.values})), heights, plane, range, shade: shading(range, plane),
    label: inPercent ? "%" : withUnit("", measure.unit).trim(), view: {turn, tilt},
  });
}

function surfaceCaption(map, measures, relative) {
  const reference = map.reference;
  const parts = [reference ? `Grey plane: ${reference.label}, ${relative ? "at 0 %" : `mean over ${count(reference.runs)} runs`}. Blue is better than that, red worse.` : "From light (small) to dark (large)."];
  const cut = measures.map((measure) => [measure, shownRange(heightsOf(map, measure.name, relative).heights, heightsOf(map, measure.name, relative).plane).cut]).filter(([, cells]) => cells > 0);
  if (cut.length) parts.push(`Cut off at the top, as they would flatten the rest: ${cut.map(([measure, cells]) => `${cells} cell${cells === 1 ? "" : "s"} of ${measure.name}`).join(", ")}.`);
  const runs = map.runs.reduce((all, row) => all.concat(row), []).filter((n) => n > 0);
  if (runs.length) {
    const [least, most] = extentOf(runs);
    parts.push(`Each cell is the mean of ${least === most ? count(most) : `${count(least)} to ${count(most)}`} completed run${most === 1 ? "" : "s"}.`);
  }
  const lost = map.lost ? map.lost.reduce((all, row) => all.concat(row), []).reduce((a, b) => a + b, 0) : 0;
  if (lost) parts.push(`${count(lost)} runs of this map were not completed and are left out.`);
  return parts.join(" ");
}

function oneSurface(document, name, pick) {
  return {
    name, title: (state) => titled(`${capital(labelOf(measureOf(document, pick(state))))}${relativeWords(document, state, pick)}`, settingText(document, state.setting)),
    caption: (state) => surfaceCaption(mapOf(document, state), [measureOf(document, pick(state))], state.relative),
    about: ["runs"], turns: true, height: (width) => Math.min(520, Math.round(0.8 * width)),
    option: (look, {width, height, state}) => {
      const option = base(look);
      addDrawing(option, surface(look, {left: 0, top: 0, width, height}, mapOf(document, state), measureOf(document, pick(state)), state.relative, state));
      return option;
    },
    table: (state) => gridTable(mapOf(document, state), [measureOf(document, pick(state))], state.relative),
  };
}

function relativeWords(document, state, pick) {
  return heightsOf(mapOf(document, state), pick(state), state.relative).relative ? ", relative to full-horizon blocking [%]" : "";
}

function gridTable(map, measures, relative) {
  const [a, b] = map.axes;
  const columns = [a.label].concat(b ? [b.label] : [], ["runs", "not completed"], measures.map((measure) => (relative && map.reference ? `${measure.name} [%]` : withUnit(measure.name, measure.unit))));
  const heights = measures.map((measure) => heightsOf(map, measure.name, relative).heights);
  const rows = [];
  if (map.reference) rows.push([map.reference.label].concat(b ? [""] : [], [map.reference.runs, ""], measures.map((measure) => (relative ? 0 : map.reference.means[measure.name]))));
  if (map.unblocked) rows.push(["unblocked"].concat(b ? [""] : [], [map.unblocked.runs, ""], measures.map((measure) => (relative && map.reference ? 100 * (map.unblocked.means[measure.name] / map.reference.means[measure.name] - 1) : map.unblocked.means[measure.name]))));
  map.runs.forEach((row, i) => row.forEach((runs, j) => {
    if (runs || (map.lost && map.lost[i][j])) rows.push([a.values[i]].concat(b ? [b.values[j]] : [], [runs, map.lost ? map.lost[i][j] : ""], heights.map((grid) => grid[i][j])));
  }));
  return {columns, rows};
}

function heatMap(document, name, pick) {
  return {
    name, title: (state) => titled(`${capital(labelOf(measureOf(document, pick(state))))}${relativeWords(document, state, pick)}, cell by cell`, settingText(document, state.setting)),
    caption: (state) => {
      const map = mapOf(document, state), {heights, plane} = heightsOf(map, pick(state), state.relative);
      const best = bestCell(heights);
      return `${map.reference ? `Blue is better than ${map.reference.label} (${number(plane)}${state.relative ? " %" : ""}), red worse. ` : ""}` +
        (best ? `Least: ${number(heights[best[0]][best[1]])}${state.relative && map.reference ? " %" : ""} at ${cellText(map, best)}.` : "");
    },
    about: ["runs"], picksCell: true,
    height: (width, state) => heatHeight(mapOf(document, state), width),
    option: (look, {width, height, state}) => heatOption(look, width, height, document, state, pick(state)),
    table: (state) => gridTable(mapOf(document, state), [measureOf(document, pick(state))], state.relative),
  };
}

export const cellText = (map, [i, j]) => map.axes.map((axis, a) => axis && `${axis.label} = ${axis.values[[i, j][a]]}`).filter(Boolean).join(", ");

function bestCell(heights) {
  let best = null;
  heights.forEach((row, i) => row.forEach((value, j) => {
    if (isKnown(value) && (!best || value < heights[best[0]][best[1]])) best = [i, j];
  }));
  return best;
}

const heatMargins = {right: 14, top: 10, bottom: 46};
/// Room for the names of the rows and of their axis.
const heatLeft = (map, width) => Math.round(Math.min(0.4 * width, 44 + 7 * Math.max(2, ...(map.axes[1] ? map.axes[1].values.map((value) => String(value).length) : []))));
const heatHeight = (map, width) => Math.max(150, heatMargins.top + heatMargins.bottom + (map.axes[1] ? map.axes[1].values.length : 1) * Math.max(17, Math.min(26, Math.round(width / 30)), map.axes[1] && map.axes[1].values.length < 6 ? 30 : 0));

/// Pixels to a cell of the map, for the pointer.
export function cellAt(map, {width, height}, x, y) {
  const columns = map.axes[0].values.length, rows = map.axes[1] ? map.axes[1].values.length : 1;
  const left = heatLeft(map, width), i = Math.floor((x - left) / (width - left - heatMargins.right) * columns);
  const j = rows - 1 - Math.floor((y - heatMargins.top) / (height - heatMargins.top - heatMargins.bottom) * rows);
  return i >= 0 && i < columns && j >= 0 && j < rows ? [i, j] : null;
}

function heatOption(look, width, height, document, state, name) {
  const option = base(look), map = mapOf(document, state);
  const {heights, plane} = heightsOf(map, name, state.relative);
  const range = shownRange(heights, plane), shade = shading(range, plane);
  const [a, b] = map.axes;
  const category = (axis) => ({type: "category", data: axis ? axis.values.map(String) : [""], splitLine: {show: false}, axisTick: {show: false}});
  const left = heatLeft(map, width);
  const frame = addFrame(option, look, {top: heatMargins.top, height: height - heatMargins.top - heatMargins.bottom, width, left, right: heatMargins.right,
    x: {...category(a), name: a.label, axisLabel: {formatter: null}},
    y: {...category(b), name: b ? b.label : "", nameGap: left - 20, axisLabel: {formatter: null, interval: 0, width: left - 34, overflow: "truncate"}}});
  addShapes(option, frame, "cells", [0, 0], (at, size) => {
    const [wide, high] = size([1, 1]), shapes = [];
    const fontSize = Math.min(11, high - 5, wide / 3.1);
    heights.forEach((row, i) => row.forEach((value, j) => {
      const [x, y] = at([i, j]);
      const box = {x: x - wide / 2, y: y - high / 2, width: wide, height: high};
      if (!isKnown(value)) {
        if (map.lost && map.lost[i][j]) shapes.push({type: "text", style: {text: "×", x, y, fill: look.faint, textAlign: "center", textVerticalAlign: "middle"}});
        return;
      }
      const colour = shade(value);
      shapes.push({type: "rect", shape: box, style: {fill: css(colour), stroke: wide > 14 ? look.ground : "none", lineWidth: 0.5}});
      if (fontSize >= 8.5) shapes.push({type: "text", style: {text: cellNumber(value, state.relative), x, y, fill: readableOn(colour), font: `${fontSize}px ${look.font}`, textAlign: "center", textVerticalAlign: "middle"}});
    }));
    const [x, y] = at(state.cell);
    shapes.push({type: "rect", shape: {x: x - wide / 2, y: y - high / 2, width: wide, height: high}, style: {fill: "none", stroke: look.ground, lineWidth: 5}});
    shapes.push({type: "rect", shape: {x: x - wide / 2, y: y - high / 2, width: wide, height: high}, style: {fill: "none", stroke: look.text, lineWidth: 2.4}});
    return shapes;
  }, {clip: false});
  option.tooltip = {show: false};
  return option;
}

function cellNumber(value, relative) {
  if (relative) return `${value > 0 ? "+" : ""}${Math.round(value)}`.replace("-", "−");
  const size = Math.abs(value);
  const text = size >= 100 ? value.toFixed(0) : size >= 10 ? value.toFixed(1) : size >= 1 ? value.toFixed(2) : value.toFixed(3);
  return text.replace(/^(-?)0\./, "$1.").replace("-", "−");
}

// ---- pairs of seeds

function pairFigure(document) {
  return {
    name: "pairs", title: (state) => titled(`Difference to full-horizon blocking, seed by seed, in ${measureOf(document, state.measure).label}`, settingText(document, state.setting)),
    caption: (state) => pairCaption(document, state), about: ["pairs"],
    height: (width) => (width < 700 ? 500 : 300),
    option: (look, size) => pairOption(look, size, document, size.state),
    table: (state) => pairTable(mapOf(document, state), measureOf(document, state.measure)),
  };
}

function pairCaption(document, state) {
  const map = mapOf(document, state), pairs = map.pairs;
  if (!pairs || !pairs.difference[state.measure]) return "This measure has no pairs here.";
  const most = Math.max(...pairs.count.map((row) => Math.max(...row)));
  return `Each run is held against full-horizon blocking's of the same ground and noise; dots are mean differences, below zero is better, bars their 95 % intervals (Student's t, up to ${most} pairs)${most < 2 ? "; with one pair there is no interval" : ""}. Left along ${cellText(map, state.cell).split(", ").pop()}, right along ${cellText(map, state.cell).split(", ")[0]}: choose the cell in the map above.`;
}

function pairOption(look, {width, height}, document, state) {
  const option = base(look), map = mapOf(document, state), measure = measureOf(document, state.measure);
  const difference = map.pairs && map.pairs.difference[measure.name];
  if (!difference) return option;
  const half = map.pairs.half_width[measure.name], [i, j] = state.cell;
  const stacked = width < 700, frameWidth = stacked ? width : width / 2;
  const slices = [{axis: map.axes[0], at: (k) => [k, j]}].concat(map.axes[1] ? [{axis: map.axes[1], at: (k) => [i, k]}] : []);
  const ends = [0];
  for (const slice of slices) slice.axis.values.forEach((_, k) => {
    const [a, b] = slice.at(k), d = difference[a][b], h = half && half[a][b];
    if (isKnown(d)) ends.push(d - (h || 0), d + (h || 0));
  });
  const sorted = ends.slice().sort((x, y) => x - y), range = axisRange([sorted[0], sorted[sorted.length - 1]]);
  slices.forEach((slice, s) => {
    const left = stacked || s === 0 ? 66 : frameWidth + 66;
    const frame = addFrame(option, look, {
      top: 14 + (stacked ? s * (height / 2) : 0), height: (stacked ? height / 2 : height) - 14 - 46, width, left, right: stacked || s === 1 ? 16 : frameWidth + 8,
      x: {type: "category", data: slice.axis.values.map(String), name: slice.axis.label, splitLine: {show: false}, axisLabel: {formatter: null}},
      y: {name: withUnit("difference", measure.unit), ...range, nameGap: 48},
    });
    addShapes(option, frame, "interval", [0, 0], (at, size) => {
      const shapes = [], wide = Math.min(5, size([1, 0])[0] / 3);
      const zero = at([0, 0])[1], leftEnd = at([0, 0])[0] - size([1, 0])[0] / 2, rightEnd = at([slice.axis.values.length - 1, 0])[0] + size([1, 0])[0] / 2;
      shapes.push({type: "line", shape: {x1: leftEnd, y1: zero, x2: rightEnd, y2: zero}, style: {stroke: look.text, lineWidth: 1.2}});
      slice.axis.values.forEach((_, k) => {
        const [a, b] = slice.at(k), d = difference[a][b], h = half && half[a][b];
        if (!isKnown(d)) return;
        const sure = isKnown(h) && Math.abs(d) > h, colour = !sure ? look.faint : d < 0 ? look.estimate : look.reference;
        const [x, y] = at([k, d]);
        if (isKnown(h)) {
          const top = at([k, d + h])[1], bottom = at([k, d - h])[1];
          for (const [x1, y1, x2, y2] of [[x, top, x, bottom], [x - wide, top, x + wide, top], [x - wide, bottom, x + wide, bottom]])
            shapes.push({type: "line", shape: {x1, y1, x2, y2}, style: {stroke: colour, lineWidth: 1.6}});
        }
        const own = k === (s === 0 ? i : j);
        shapes.push({type: "circle", shape: {cx: x, cy: y, r: own ? 5.5 : 3.6}, style: {fill: isKnown(h) ? colour : look.ground, stroke: own ? look.text : colour, lineWidth: own ? 2 : 1.4}});
      });
      return shapes;
    }, {z: 3});
  });
  option.tooltip = {show: false};
  return option;
}

function pairTable(map, measure) {
  const difference = map.pairs && map.pairs.difference[measure.name];
  if (!difference) return {columns: ["pairs"], rows: []};
  const rows = [];
  difference.forEach((row, i) => row.forEach((value, j) => {
    if (isKnown(value)) rows.push([map.axes[0].values[i]].concat(map.axes[1] ? [map.axes[1].values[j]] : [], [map.pairs.count[i][j], value, map.pairs.half_width[measure.name][i][j]]));
  }));
  return {columns: map.axes.filter(Boolean).map((axis) => axis.label).concat(["pairs", withUnit("mean difference", measure.unit), "half width of the 95 % interval"]), rows};
}

// ---- over a choice that is a number: the speed

export function numericChoice(document) {
  const fits = (choice) => choice.values.length > 2 && choice.values.every((value) => typeof value === "number");
  const speed = document.choices.findIndex((choice) => choice.key === "speed" && fits(choice));
  return speed >= 0 ? speed : document.choices.findIndex(fits);
}

function linesOver(document, state, name) {
  const along = numericChoice(document), choice = document.choices[along], here = mapOf(document, state);
  const wanted = here.axes.map((axis, a) => axis && axis.values[state.cell[a]]);
  const maps = document.maps.filter((map) => map.setting.every((value, i) => i === along || value === here.setting[i]))
    .sort((a, b) => choice.values[a.setting[along]] - choice.values[b.setting[along]]);
  const at = (map) => choice.values[map.setting[along]];
  const cell = (map) => {
    const [i, j] = map.axes.map((axis, a) => (axis ? axis.values.indexOf(wanted[a]) : 0));
    return i >= 0 && j >= 0 && map.means[name] ? map.means[name][i][j] : null;
  };
  const lines = [{name: cellText(here, state.cell), colour: "estimate", points: maps.map((map) => [at(map), cell(map)])}];
  if (hasTwoAxes(here)) lines.push({name: "best cell", colour: "measured", type: "dotted", points: maps.map((map) => {
    const best = map.means[name] && bestCell(map.means[name]);
    return [at(map), best ? map.means[name][best[0]][best[1]] : null];
  })});
  for (const [key, colour, label] of [["reference", "truth", here.reference && here.reference.label], ["unblocked", "reference", "unblocked"]])
    if (maps.some((map) => map[key])) lines.push({name: label || key, colour, type: key === "reference" ? "dashed" : "solid", points: maps.map((map) => [at(map), map[key] ? map[key].means[name] : null])});
  return {choice, lines: lines.map((line) => ({...line, points: line.points.filter(([, value]) => isKnown(value))})).filter((line) => line.points.length)};
}

function overChoice(document) {
  const choice = document.choices[numericChoice(document)];
  const others = (state) => settingText(document, state.setting, document.choices.indexOf(choice));
  return {
    name: `by-${stem(choice.label)}`, title: (state) => titled(`${capital(measureOf(document, state.measure).label)} by ${choice.label}`, others(state)),
    caption: () => "The cell is the one chosen in the map above; the best cell is another at each place, and chosen after the fact.", about: ["runs"],
    height: () => 300,
    option: (look, {width, height, state}) => {
      const option = base(look), measure = measureOf(document, state.measure), {lines} = linesOver(document, state, state.measure);
      const range = axisRange(extentOf(...lines.map((line) => line.points.map(([, value]) => value))), {zero: true});
      const frame = addFrame(option, look, {top: 40, height: height - 40 - 46, width, x: {name: choice.label, minInterval: 1, ...pad(extentOf(choice.values))}, y: {name: shortLabel(measure), ...range}});
      for (const line of lines) addLine(option, frame, line.name, line.points, {color: look[line.colour], width: 2, type: line.type || "solid"}, {showSymbol: true, symbolSize: 6});
      addLegend(option, look, lines.map((line) => line.name));
      option.tooltip = tooltip(look);
      return option;
    },
    table: (state) => {
      const {lines} = linesOver(document, state, state.measure);
      const value = (line, at) => (line.points.find(([x]) => x === at) || [])[1];
      return {columns: [choice.label].concat(lines.map((line) => line.name)), rows: choice.values.slice().sort((a, b) => a - b).map((at) => [at].concat(lines.map((line) => value(line, at))))};
    },
  };
}

const pad = ([low, high]) => ({min: low - 0.04 * (high - low || 1), max: high + 0.04 * (high - low || 1), axisLabel: {showMinLabel: false, showMaxLabel: false}});

// ---- sweeps over other keys, one of them: curves

function curves(document) {
  const measures = measuresOf(document, ["mae"]).slice(0, 6);
  const across = (width) => (width < 640 ? 1 : 2), tall = 230;
  return {
    name: "curves", title: (state) => titled(`Mean absolute errors over ${mapOf(document, state).axes[0].label}`, settingText(document, state.setting)),
    caption: (state) => surfaceCaption(mapOf(document, state), measures, false).replace("From light (small) to dark (large). ", "").replace("Each cell", "Each point"),
    about: ["runs"], height: (width) => Math.ceil(measures.length / across(width)) * tall,
    option: (look, {width, state}) => {
      const option = base(look), map = mapOf(document, state), columns = across(width), [axis] = map.axes;
      const numeric = isNumeric(axis);
      measures.forEach((measure, m) => {
        const values = (map.means[measure.name] || []).map((row) => row[0]), column = m % columns, wide = width / columns;
        const frame = addFrame(option, look, {
          top: Math.floor(m / columns) * tall + 14, height: tall - 14 - 50, width, left: column * wide + 66, right: width - (column + 1) * wide + 12,
          x: numeric ? {name: axis.label, ...pad(extentOf(axis.values))} : {type: "category", data: axis.values.map(String), name: axis.label, axisLabel: {formatter: null}},
          y: {name: shortLabel(measure), ...axisRange(extentOf(values, map.reference ? [map.reference.means[measure.name]] : null), {zero: true})},
        });
        addLine(option, frame, measure.name, values.map((value, i) => [numeric ? axis.values[i] : i, value]), {color: look.estimate, width: numeric ? 2 : 0}, {showSymbol: true, symbolSize: numeric ? 6 : 9});
        if (map.reference) addLine(option, frame, map.reference.label, [0, axis.values.length - 1].map((i) => [numeric ? axis.values[i] : i, map.reference.means[measure.name]]), {color: look.truth, type: "dashed"});
      });
      option.tooltip = tooltip(look);
      return option;
    },
    table: (state) => gridTable(mapOf(document, state), measuresOf(document, ["mae", "time"]), false),
  };
}
