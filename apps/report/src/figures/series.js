// Columns over time: states and parameters with their bands, errors, inputs within their bounds, statuses.
import {capital, percent, withUnit} from "../text.js";
import {addBand, addDots, addFrame, addLegend, addLine, addShapes, addStripes, axisRange, base, extentOf, isKnown, pairs, tooltip} from "./parts.js";

const TOP = 30, GAP = 26, BOTTOM = 46;

/// The part of columns that lies in `view` ([from, to] in s, or null for all), with one sample more on either side.
function inView(time, view, columns) {
  if (!view) return {time, ...columns};
  let first = 0, last = time.length;
  while (first < last && time[first] < view[0]) ++first;
  while (last > first && time[last - 1] > view[1]) --last;
  first = Math.max(0, first - 1);
  last = Math.min(time.length, last + 1);
  const cut = {time: time.slice(first, last)};
  for (const name of Object.keys(columns)) cut[name] = Array.isArray(columns[name]) ? columns[name].slice(first, last) : columns[name];
  return cut;
}

const timeAxis = (time, view, name = "time [s]") => {
  const [low, high] = view || extentOf(time);
  return {name, min: low, max: high > low ? high : low + 1, axisLabel: {showMinLabel: low === 0, showMaxLabel: false}};
};
const plus = (a, b, factor) => a.map((value, i) => (isKnown(value) && isKnown(b[i]) ? value + factor * b[i] : null));

/// The value that a share of a column lies below.
function mostOf(column, share) {
  const known = (column || []).filter(isKnown).sort((a, b) => a - b);
  return known.length ? known[Math.min(known.length - 1, Math.floor(share * known.length))] : share < 0.5 ? Infinity : -Infinity;
}

/// The extent of lines, and of a band as far as it does not dwarf them.
function extentWithBand(lines, low, high) {
  const [least, most] = extentOf(...lines);
  const span = most - least || Math.abs(most) || 1;
  const [bandLow, bandHigh] = [mostOf(low, 0.03), mostOf(high, 0.97)];
  return [Math.max(Math.min(bandLow, least), least - 0.6 * span), Math.min(Math.max(bandHigh, most), most + 0.6 * span)];
}

/// Spans of time that figures shade: where a log has no fix; where a simulation had a fault, and where the estimator found
/// something wrong.
export function stripesOf(document) {
  return [["no fix", document.gaps, "gap"], ["fault", document.faults, "gap"], ["finding", document.findings, "finding"]]
    .filter(([, spans]) => spans && spans.length > 0).map(([name, spans, colour]) => ({name, spans, colour}));
}

/// A figure of one state or parameter: above its values, below what it is wrong by where the truth is known.
function estimateFigure(document, column, variable, kind, prefix) {
  const unit = variable ? variable.unit : "";
  const meaning = variable && variable.meaning ? variable.meaning : "";
  const times = document.times;
  const hasError = Boolean(column.error), hasSigma = Boolean(column.sigma), bounds = boundsTouched(column.estimate, variable);
  const what = meaning ? `${column.name}, ${meaning}` : column.name;
  return {
    name: `${prefix}${kind}-${column.name}`,
    title: `${what}: estimate${column.true ? " and truth" : ""}`,
    caption: (hasSigma ? "Band: ± 2 standard deviations, cut off where it would dwarf the lines." : "The estimator gives no standard deviation.") +
             (hasError ? " Below: estimate less truth." : "") + boundsWords(column.estimate, bounds),
    about: ["samples", "truth", "times"],
    time: () => times[column.time],
    frames: hasError ? 2 : 1,
    height: (width) => (hasError ? (width < 500 ? 330 : 380) : 240),
    option: (look, {width, height, view}) =>
      estimateOption(look, width, height, view, column, times[column.time], unit, stripesOf(document), bounds),
    table: () => estimateTable(column, times[column.time], unit),
  };
}

/// The bounds of a variable that its estimate touches: [{name, value, type}].
function boundsTouched(values, variable) {
  if (!variable) return [];
  return [["lower bound", variable.lower, "dotted"], ["upper bound", variable.upper, "dashed"]]
    .filter(([, bound]) => isKnown(bound) && values.some((value) => isAt(value, bound)))
    .map(([name, value, type]) => ({name, value, type}));
}

const isAt = (value, bound) => isKnown(value) && isKnown(bound) && Math.abs(value - bound) <= 1e-6 * Math.max(1, Math.abs(bound));

function boundsWords(values, bounds) {
  const known = values.filter(isKnown).length;
  return bounds.map(({name, value}) => ` At its ${name} in ${percent(values.filter((one) => isAt(one, value)).length / known)} of the samples shown.`).join("");
}

function estimateOption(look, width, height, view, column, wholeTime, unit, stripes, bounds) {
  const option = base(look);
  const {time, estimate, sigma, error, truth} =
    inView(wholeTime, view, {estimate: column.estimate, sigma: column.sigma, error: column.error, truth: column.true});
  const names = [], inner = height - TOP - BOTTOM;
  const axis = timeAxis(wholeTime, view);
  const upper = error ? Math.round((inner - GAP) * 0.6) : inner;
  const low = sigma && plus(estimate, sigma, -2), high = sigma && plus(estimate, sigma, 2);
  const range = axisRange(extentWithBand([estimate, truth, bounds.map(({value}) => value)], low, high));
  const frame = addFrame(option, look, {top: TOP, height: upper, width, y: {name: withUnit(column.name, unit), ...range},
    x: error ? {...axis, name: "", axisLabel: {show: false}} : axis});
  for (const {name, spans, colour} of stripes) addStripes(option, frame, name, spans, look[colour], [range.min, range.max]);
  if (sigma) {
    addBand(option, frame, "± 2σ", time, low, high, look.band);
    names.push("± 2σ");
  }
  if (truth) {
    addLine(option, frame, "truth", pairs(time, truth), {color: look.truth, width: 1.6});
    names.push("truth");
  }
  addLine(option, frame, "estimate", pairs(time, estimate), {color: look.estimate});
  names.push("estimate");
  for (const {name, value, type} of bounds) {
    addLine(option, frame, name, time.map((at) => [at, value]), {color: look.bound, type});
    names.push(name);
  }
  for (const {name} of stripes) names.push(name);
  if (error) {
    const below = sigma && sigma.map((value) => (isKnown(value) ? -2 * value : null));
    const above = sigma && sigma.map((value) => (isKnown(value) ? 2 * value : null));
    const errors = axisRange(extentWithBand([error, [0]], below, above));
    const lower = addFrame(option, look, {top: TOP + upper + GAP, height: inner - upper - GAP, width, x: axis,
      y: {name: withUnit("error", unit), ...errors}});
    if (sigma) addBand(option, lower, "± 2σ", time, below, above, look.band);
    addLine(option, lower, "error", pairs(time, error), {color: look.reference});
    names.push("error");
  }
  addLegend(option, look, names);
  option.tooltip = tooltip(look);
  if (error) option.axisPointer = {link: [{xAxisIndex: "all"}]};
  return option;
}

function estimateTable(column, time, unit) {
  const columns = ["time [s]"].concat(column.true ? ["true"] : [], ["estimate"], column.sigma ? ["σ"] : [], column.error ? ["error"] : []);
  const parts = [time, column.true, column.estimate, column.sigma, column.error].filter(Boolean);
  return {columns: columns.map((name, i) => (i === 0 ? name : withUnit(name, unit))), parts};
}

export function estimateFigures(document, source = document, prefix = "") {
  const model = document.model;
  const find = (list, name) => model && list.find((variable) => variable.name === name);
  return {
    states: source.states.map((column) => estimateFigure(document, column, find(model.states, column.name), "state", prefix)),
    parameters: source.parameters.map((column) => estimateFigure(document, column, find(model.parameters, column.name), "parameter", prefix)),
  };
}

/// One column in one frame: an error of the run, or how far fixes are from the estimate.
export function columnFigure(document, {name, title, caption, about, label, unit, time, values, colour = "reference", zero = false, dots = false, log = false, expected = null, marked = null}) {
  return {
    name, title, caption, about, time: () => time, frames: 1, height: () => 220,
    option: (look, {width, height, view}) => {
      const option = base(look), part = inView(time, view, {values, marks: marked ? marked.is : null});
      const range = log ? powersOf(part.values, isKnown(expected) ? expected / 100 : null) : axisRange(extentOf(part.values, [expected]), {zero}), top = isKnown(expected) || marked ? TOP : 12;
      const frame = addFrame(option, look, {top, height: height - top - BOTTOM, width, x: timeAxis(time, view),
        y: {name: withUnit(label, unit), ...range}});
      for (const {name: kind, spans, colour: shade} of stripesOf(document))
        addStripes(option, frame, kind, spans, look[shade], [range.min, range.max]);
      const isMarked = (i) => Boolean(part.marks && part.marks[i]), points = pairs(part.time, part.values), names = [label];
      if (dots) addDots(option, frame, label, points.filter((_, i) => !isMarked(i)), look[colour], {symbolSize: 3});
      else addLine(option, frame, label, pairs(part.time, part.values), {color: look[colour]});
      if (marked && marked.is.some(Boolean)) {
        addDots(option, frame, marked.name, points.filter((_, i) => isMarked(i)), look.alarm, {symbol: "diamond", symbolSize: 6});
        names.push(marked.name);
      }
      if (isKnown(expected)) {
        addLine(option, frame, "expected", part.time.map((at) => [at, expected]), {color: look.truth, type: "dashed"});
        names.push("expected");
      }
      if (names.length > 1) addLegend(option, look, names);
      option.tooltip = tooltip(look);
      return option;
    },
    table: () => ({columns: ["time [s]", withUnit(label, unit)].concat(marked ? [marked.name] : []), parts: [time, values].concat(marked ? [marked.is] : [])}),
  };
}

export function errorFigures(document) {
  const titles = {position: "Error of the estimated position", heading: "Error of the estimated heading",
                  tracking: "Distance of the true position from the path", nees: "Normalised estimation error squared (NEES)"};
  const expected = document.summary ? document.summary.nees_expected : null;
  return (document.errors || []).map((column) => columnFigure(document, {
    name: `error-${column.name}`, title: titles[column.name] || capital(column.name), caption: (column.meaning ? `${capital(column.meaning)}.` : "") + (column.name === "nees" && isKnown(expected) ? ` Dashed: ${expected}, the mean of an estimator that is as certain as it should be.` : ""),
    about: ["samples", "truth"], label: column.name === "nees" ? "NEES" : column.name, unit: column.unit,
    time: document.times[column.time], values: column.values, zero: true, colour: column.name === "tracking" ? "plan" : "reference",
    expected: column.name === "nees" ? expected : null,
  }));
}

/// A logarithmic axis over all positive values, six powers of ten at most; or from a value of interest on.
function powersOf(values, least = null) {
  const [low, high] = extentOf(values.filter((value) => value > 0)).map((value) => Math.log(value) / Math.LN10);
  return {type: "log", min: Math.pow(10, Math.floor(least === null ? Math.max(low, high - 6) : Math.log(least) / Math.LN10)), max: Math.pow(10, Math.ceil(high + 1e-9))};
}

const asColumn = (bound, length) => (Array.isArray(bound) ? bound : isKnown(bound) ? new Array(length).fill(bound) : null);

export function inputFigures(document) {
  return (document.inputs || []).map((column) => {
    const variable = document.model && document.model.inputs.find((input) => input.name === column.name);
    const unit = variable ? variable.unit : "", time = document.times[column.time];
    const lower = asColumn(column.lower, time.length), upper = asColumn(column.upper, time.length);
    const bounded = [lower && "lower bound", upper && "upper bound"].filter(Boolean);
    return {
      name: `input-${column.name}`,
      title: `${variable && variable.meaning ? `${column.name}, ${variable.meaning}` : column.name}${document.kind === "log" ? ": input as measured" : bounded.length ? ": input and its bounds" : ": input"}`,
      caption: document.kind === "log" ? "What was measured of it on each interval between two nodes."
        : `What the controller chose; it holds until the next sample.${bounded.length ? "" : " It has no bounds."} ${atBounds(column.values, lower, upper)}`,
      about: ["inputs", "samples"], time: () => time, frames: 1, height: () => 230,
      option: (look, {width, height, view}) => {
        const option = base(look), part = inView(time, view, {values: column.values, lower, upper});
        const range = axisRange(extentOf(part.values, part.lower, part.upper));
        const frame = addFrame(option, look, {top: TOP, height: height - TOP - BOTTOM, width, x: timeAxis(time, view),
          y: {name: withUnit(column.name, unit), ...range}});
        if (part.upper) addLine(option, frame, "upper bound", pairs(part.time, part.upper), {color: look.bound, type: "dashed"}, {step: "end"});
        addLine(option, frame, column.name, pairs(part.time, part.values), {color: look.estimate}, {step: "end"});
        if (part.lower) addLine(option, frame, "lower bound", pairs(part.time, part.lower), {color: look.bound, type: "dotted"}, {step: "end"});
        addLegend(option, look, [upper && "upper bound", column.name, lower && "lower bound"].filter(Boolean));
        option.tooltip = tooltip(look);
        return option;
      },
      table: () => ({columns: ["time [s]", withUnit(column.name, unit)].concat(bounded), parts: [time, column.values, lower, upper].filter(Boolean)}),
    };
  });
}

function atBounds(values, lower, upper) {
  if (!lower && !upper) return "";
  let hits = 0;
  values.forEach((value, i) => {
    const scale = 1e-6 * Math.max(1, Math.abs(value));
    if (isKnown(value) && ((lower && isKnown(lower[i]) && value <= lower[i] + scale) || (upper && isKnown(upper[i]) && value >= upper[i] - scale))) ++hits;
  });
  return `At a bound in ${percent(hits / values.length)} of the samples shown.`;
}

const problems = {rhe: "estimator", rhc: "controller"};

/// Which statuses solvers reported, when; fallbacks and relaxed bounds as marks, all of them.
export function statusFigure(document, source = document, prefix = "") {
  const statuses = source.statuses || {}, fallbacks = source.fallbacks || {}, relaxed = source.relaxed || [];
  const lanes = Object.keys(problems).filter((problem) => statuses[problem]);
  if (lanes.length === 0) return null;
  const names = [];
  for (const problem of lanes)
    for (const name of Object.keys(statuses[problem].counts)) if (names.indexOf(name) < 0) names.push(name);
  const end = lastTime(source);
  const fallen = lanes.reduce((sum, problem) => sum + (fallbacks[problem] || []).length, 0);
  return {
    name: `${prefix}statuses`, title: "Statuses of the solves, fallbacks",
    caption: `${fallen === 0 ? "No solve fell back" : `${fallen} solves fell back (crosses)`}` +
             `${relaxed.length ? `; a bound of a state was relaxed in ${relaxed.length} samples (triangles)` : ""}.`,
    about: ["statuses"], time: () => [0, end], frames: 1, height: () => 96 + 44 * lanes.length,
    option: (look, {width, height, view}) => statusOption(look, width, height, view, {lanes, names, statuses, fallbacks, relaxed, end}),
    table: () => ({columns: ["solves of", "status", "how many", "share"],
      rows: lanes.reduce((rows, problem) => rows.concat(Object.keys(statuses[problem].counts).map((name) => {
        const all = Object.keys(statuses[problem].counts).reduce((sum, key) => sum + statuses[problem].counts[key], 0);
        return [problems[problem], name, statuses[problem].counts[name], percent(statuses[problem].counts[name] / all)];
      })).concat([[problems[problem], "fallback", (fallbacks[problem] || []).length, ""]]), [])
        .concat(source.relaxed ? [["controller", "bound relaxed", relaxed.length, ""]] : [])}),
  };
}

function lastTime(source) {
  const times = source.times ? source.times.all : null;
  if (times && times.length) return times[times.length - 1];
  const changes = ["rhe", "rhc"].map((problem) => source.statuses[problem]).filter(Boolean).map((status) => status.changes);
  return Math.max(1, ...changes.map((list) => (list.length ? list[list.length - 1][1] : 0)));
}

/// What is well is blue or green, all else has a colour of its own.
function statusColour(look, names, index) {
  const fine = {solved: look.estimate, step_taken: look.measured};
  const others = [look.kinds[1], look.kinds[3], look.kinds[4], look.kinds[5]], rank = names.filter((name) => !fine[name]).indexOf(names[index]);
  return fine[names[index]] || others[rank % others.length];
}

function statusOption(look, width, height, view, {lanes, names, statuses, fallbacks, relaxed, end}) {
  const option = base(look), top = 40;
  const frame = addFrame(option, look, {
    top, height: height - top - BOTTOM, width, left: 84, x: {...timeAxis([0, end], view), splitLine: {show: false}},
    y: {type: "category", data: lanes.map((problem) => problems[problem]), splitLine: {show: false}, axisTick: {show: false}, axisLabel: {formatter: null, color: look.text}},
  });
  names.forEach((name, index) => {
    const colour = statusColour(look, names, index);
    addShapes(option, frame, name, [0, 0], (at) => {
      const shapes = [];
      lanes.forEach((problem, lane) => {
        const changes = statuses[problem].changes;
        const [, middle] = at([0, lane]);
        changes.forEach(([, from, status], i) => {
          if (status !== name) return;
          const to = i + 1 < changes.length ? changes[i + 1][1] : end;
          const [left] = at([from, lane]), [right] = at([to, lane]);
          shapes.push({type: "rect", shape: {x: left, y: middle - 9, width: Math.max(right - left, 1), height: 18}, style: {fill: colour}});
        });
      });
      return shapes;
    }, {itemStyle: {color: colour}});
  });
  const marks = lanes.reduce((all, problem, lane) => all.concat((fallbacks[problem] || []).map(([, time]) => [time, lane])), []);
  if (marks.length) addDots(option, frame, "fallback", marks, look.alarm, {symbol: "path://M0,2L2,0L5,3L8,0L10,2L7,5L10,8L8,10L5,7L2,10L0,8L3,5Z", symbolSize: 9, symbolOffset: [0, -16], clip: false});
  if (relaxed.length) addDots(option, frame, "relaxed", relaxed.map(([, time]) => [time, lanes.length - 1]), look.reference, {symbol: "triangle", symbolSize: 7, symbolOffset: [0, 15], clip: false});
  addLegend(option, look, names.concat(marks.length ? ["fallback"] : [], relaxed.length ? ["relaxed"] : []));
  option.tooltip = {show: false};
  return option;
}
