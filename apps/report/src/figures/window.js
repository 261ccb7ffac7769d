// One sample of the scrubber: the estimation horizon with its blocks, the measurements in it, and what the controller
// plans from there. Seen from above, and along the steps.
import {listed, seconds, withUnit} from "../text.js";
import {addDots, addFrame, addLegend, addLine, addShapes, axisRange, base, equalAxes, extentOf, hatch, isKnown, legendHeight, pairs, tick} from "./parts.js";
import {addGround, addGroundScale} from "./map.js";

/// The blocks of a parameter in a window as a list with all that figures and tables want to know of them.
export function blocksOf(horizon, index) {
  const rhe = horizon.rhe;
  if (!rhe || !rhe.blocks || !rhe.blocks[index] || rhe.time.length < 2) return [];
  const {starts, values, sigmas, first_start, next_start} = rhe.blocks[index];
  const end = rhe.first + rhe.time.length - 1;  // the newest node
  return starts.map((start, b) => {
    const last = b === starts.length - 1;
    return {
      start, end: last ? end : starts[b + 1], value: values[b], sigma: sigmas ? sigmas[b] : null,
      cut: b === 0 && isKnown(next_start) && isKnown(first_start) && first_start < start,
      growing: last && isKnown(next_start) && next_start > end,
      began: b === 0 && isKnown(first_start) ? first_start : start,
    };
  });
}

/// Colours of blocks: a block keeps its own while it slides through the window, so neighbours never swap.
export function blockColours(horizons, parameterCount) {
  const ordinals = [];
  for (let p = 0; p < parameterCount; ++p) {
    const starts = {};
    for (const horizon of horizons.list)
      for (const block of blocksOf(horizon, p)) starts[block.began] = true;
    const order = Object.keys(starts).map(Number).sort((a, b) => a - b);
    const ordinal = {};
    order.forEach((start, i) => (ordinal[start] = i));
    ordinals.push(ordinal);
  }
  return (look, p, block) => look.blocks[(ordinals[p][block.began] || 0) % look.blocks.length];
}

const isRamp = (document, p) => {
  const blocking = document.settings && document.settings.blocking;
  return Boolean(blocking && blocking[p] && blocking[p].transition === "ramp");
};

/// The parameter whose blocks colour the window: the first that has more than one block anywhere.
export function parameterToColour(document) {
  const settings = (document.settings && document.settings.blocking) || [];
  const blocked = settings.findIndex((blocking) => blocking && !blocking.is_one_block);
  return blocked >= 0 ? blocked : 0;
}

// ---- seen from above

const mapMargins = {left: 56, right: 12, bottom: 46};

export function windowMapOption(look, {width, height}, document, horizon, chosen, colourOf) {
  const option = base(look), shown = mapLegend(document, horizon);
  const raster = rasterOf(document, chosen), top = legendHeight(look, shown, width) + (raster ? 24 : 6);
  const {x, y} = extentOfWindow(document, horizon);
  const inner = {width: width - mapMargins.left - mapMargins.right, height: height - top - mapMargins.bottom};
  const axes = equalAxes(x, y, inner.width, inner.height);
  const frame = addFrame(option, look, {
    top, height: inner.height, width, left: mapMargins.left, right: mapMargins.right,
    x: {name: "x [m]", ...axes.x, splitLine: {show: false}, axisLabel: {showMinLabel: false, showMaxLabel: false}},
    y: {name: "y [m]", ...axes.y, splitLine: {show: false}, axisLabel: {showMinLabel: false, showMaxLabel: false}},
  });
  const map = document.map || {};
  if (raster) {
    addGround(option, frame, raster);
    addGroundScale(option, look, raster, withUnit(`true ${raster.parameter}`, raster.unit), {left: mapMargins.left, top: top - 18, width});
  }
  const line = (name, data, style, more) => {
    addLine(option, frame, `${name} (edge)`, data, {...style, color: look.halo, width: (style.width || 1.5) + 2.5, type: "solid"}, {silent: true, z: 2});
    addLine(option, frame, name, data, style, {z: 3, ...more});
  };
  if (map.path) line("path", pairs(map.path.x, map.path.y), {color: look.reference, width: 1.6, type: "dashed"});
  if (map.true) line("true track", near(pairs(map.true.x, map.true.y), axes), {color: look.truth, width: 1.4});

  const track = trackOf(document);
  if (track) line("estimated track", near(pairs(track.x, track.y), axes), {color: look.faint, width: 1.2});
  const {rhe, rhc} = horizon, {position_x, position_y, heading} = document.model.roles;
  if (rhe) {
    const nodes = pairs(rhe.state[position_x], rhe.state[position_y]);
    addBlocksOnTrack(option, frame, look, nodes, blocksOf(horizon, chosen), horizon, chosen, colourOf);
    const outputs = document.model.position_outputs;
    if (outputs) {
      const dots = pairs(rhe.measured[outputs[0]], rhe.measured[outputs[1]]).filter(([a, b]) => isKnown(a) && isKnown(b));
      addDots(option, frame, "measured position", dots, look.measured, {symbolSize: 7, z: 6, itemStyle: {color: look.measured, borderColor: look.ground, borderWidth: 1}});
    }
  }
  if (rhc) {
    addDots(option, frame, "local reference", pairs(rhc.reference.x, rhc.reference.y), "transparent",
            {symbol: "rect", symbolSize: 8, z: 5, itemStyle: {color: look.halo, borderColor: look.reference, borderWidth: 1.6}});
    line("plan", pairs(rhc.state[position_x], rhc.state[position_y]), {color: look.plan, width: 2.4},
         {showSymbol: true, symbol: "circle", symbolSize: 5, z: 6});
  }
  addVehicle(option, frame, look, pose(horizon, position_x, position_y, heading));
  addLegend(option, look, shown);
  option.tooltip = {show: false};
  return option;
}

/// Of a log, where the estimate was before and after: there is no true track to show.
const trackOf = (document) => (document.kind === "log" ? document.variants[0].track : null);

const rasterOf = ({model, map}, chosen) => (map && map.slip && model.parameters[chosen] ? map.slip.find((slip) => slip.parameter === model.parameters[chosen].name) : undefined);

function mapLegend(document, {rhe, rhc}) {
  const {map, model} = document;
  return [trackOf(document) && "estimated track", map && map.path && "path", map && map.true && "true track", rhe && model.position_outputs && "measured position", rhc && "plan", rhc && "local reference"].filter(Boolean);
}

function pose({rhe, rhc}, x, y, heading) {
  const state = rhe ? rhe.state.map((column) => column[column.length - 1]) : rhc ? rhc.state.map((column) => column[0]) : null;
  return state && {x: state[x], y: state[y], heading: heading >= 0 ? state[heading] : 0};
}

function extentOfWindow(document, {rhe, rhc}) {
  const {position_x, position_y} = document.model.roles;
  const xs = [], ys = [];
  if (rhe) {
    xs.push(rhe.state[position_x]);
    ys.push(rhe.state[position_y]);
  }
  if (rhc) {
    xs.push(rhc.state[position_x], rhc.reference.x);
    ys.push(rhc.state[position_y], rhc.reference.y);
  }
  const grow = ([low, high]) => {
    const margin = Math.max(0.08 * (high - low), 1);
    return [low - margin, high + margin];
  };
  return {x: grow(extentOf(...xs)), y: grow(extentOf(...ys))};
}

/// Of a line, what is in sight with one point more on either side, so that a long track is not drawn for a few metres of it.
function near(points, axes) {
  const [wide, high] = [axes.x.max - axes.x.min, axes.y.max - axes.y.min];
  const seen = points.map(([x, y]) => Math.abs(x - (axes.x.min + axes.x.max) / 2) < wide && Math.abs(y - (axes.y.min + axes.y.max) / 2) < high);
  return points.map((point, i) => (seen[i] || seen[i - 1] || seen[i + 1] ? point : [null, null]));
}

function addBlocksOnTrack(option, frame, look, nodes, blocks, horizon, chosen, colourOf) {
  const first = horizon.rhe.first, suppressed = (horizon.rhe.blocks && horizon.rhe.blocks[chosen] && horizon.rhe.blocks[chosen].suppressed) || [];
  if (nodes.length === 0) return;
  addShapes(option, frame, "blocks", nodes[nodes.length - 1], (at) => {
    const pixels = nodes.map(at), shapes = [];
    if (blocks.length === 0 && pixels.length > 1)
      shapes.push({type: "polyline", shape: {points: pixels}, style: {stroke: look.estimate, lineWidth: 4, fill: "none"}});
    for (const block of blocks) {
      const points = pixels.slice(block.start - first, block.end - first + 1);
      const colour = colourOf(look, chosen, block);
      shapes.push({type: "polyline", shape: {points}, style: {stroke: look.halo, lineWidth: 10, fill: "none", lineCap: "round"}});
      shapes.push({type: "polyline", shape: {points}, style: {stroke: colour, lineWidth: 7, fill: "none", opacity: block.cut || block.growing ? 0.75 : 1}});
      if (block.cut || block.growing)  // partial: a light core, dashed
        shapes.push({type: "polyline", shape: {points}, style: {stroke: look.ground, lineWidth: 3, lineDash: [4, 4], fill: "none"}});
      for (const [x, y] of points)
        shapes.push({type: "circle", shape: {cx: x, cy: y, r: 2.6}, style: {fill: look.ground, stroke: colour, lineWidth: 1.2}});
    }
    for (const start of suppressed) {
      const place = pixels[start - first];
      if (place) shapes.push(...cross(place, 6, look.alarm, look.ground));
    }
    return shapes;
  }, {z: 4, tooltip: {show: false}});
}

function cross([x, y], r, colour, halo) {
  const lines = [[x - r, y - r, x + r, y + r], [x - r, y + r, x + r, y - r]];
  const stroke = (style) => lines.map(([x1, y1, x2, y2]) => ({type: "line", shape: {x1, y1, x2, y2}, style}));
  return stroke({stroke: halo, lineWidth: 5}).concat(stroke({stroke: colour, lineWidth: 2}));
}

function addVehicle(option, frame, look, place) {
  if (!place) return;
  addShapes(option, frame, "vehicle", [place.x, place.y], (at) => {
    const [x, y] = at([place.x, place.y]), [c, s] = [Math.cos(place.heading), -Math.sin(place.heading)];
    const corner = (along, across) => [x + along * c - across * s, y + along * s + across * c];
    return [{type: "polygon", shape: {points: [corner(13, 0), corner(-8, 7), corner(-4, 0), corner(-8, -7)]},
             style: {fill: look.text, stroke: look.ground, lineWidth: 1.5}}];
  }, {z: 8});
}

// ---- along the steps

const stripMargins = {left: 62, right: 26, bottom: 52, gap: 16};
const stripTop = (look, names, width) => legendHeight(look, names, width) + 24;

export function stripRows(document, horizon) {
  const parameters = document.model.parameters.map((variable, index) => ({kind: "parameter", variable, index}));
  const inputs = document.model.inputs.map((variable, index) => ({kind: "input", variable, index}));
  return parameters.concat(inputs).filter((row) => horizon.rhe || (row.kind === "input" && horizon.rhc));
}

export const stripHeight = (rows) => 76 + stripMargins.bottom + rows.length * 112;

function stripLegend(document, {rhe, rhc}) {
  const blocks = Boolean(rhe && rhe.blocks);
  return [blocks && "block", blocks && rhe.blocks.some((each) => each.sigmas && each.sigmas.some(isKnown)) && "± 2σ", rhe && rhe.true && "truth",
          rhe && rhe.measured_input && "measured", rhe && "estimated input", rhc && "planned", rhc && rhc.input_reference && "reference", rhc && (rhc.lower || rhc.upper) && "bound"].filter(Boolean);
}

export function stripOption(look, {width, height}, document, horizon, colourOf) {
  const option = base(look);
  const {rhe, rhc} = horizon, rows = stripRows(document, horizon);
  const now = rhe ? rhe.first + rhe.time.length - 1 : horizon.sample;
  const planned = rhc ? rhc.input[0].length : 0;
  const from = rhe ? Math.min(rhe.first, now - 1) : now, to = now + planned;
  const names = stripLegend(document, horizon), topmost = stripTop(look, names, width);
  const inner = (height - topmost - stripMargins.bottom - (rows.length - 1) * stripMargins.gap) / rows.length;
  const secondsAt = stepTimes(document, horizon);
  rows.forEach((row, r) => {
    const isLast = r === rows.length - 1;
    const range = rowRange(document, horizon, row);
    const frame = addFrame(option, look, {
      top: topmost + r * (inner + stripMargins.gap), height: inner, width, left: stripMargins.left, right: stripMargins.right,
      x: {min: from, max: Math.max(to, from + 1), minInterval: 1, name: isLast ? "step k, time [s]" : "", nameGap: 40, splitLine: {show: false},
          axisLabel: isLast ? {formatter: (k) => `${tick(k)}\n${secondsAt(k)}`, lineHeight: 14} : {show: false}},
      y: {name: withUnit(row.variable.name, row.variable.unit), ...range, splitNumber: 3},
    });
    if (row.kind === "parameter") addBlockSteps(option, frame, look, document, horizon, row.index, range, colourOf, to);
    else addInputs(option, frame, look, horizon, row.index, now);
    addShapes(option, frame, "now", [now, range.min], (at) => {
      const [x, top] = at([now, range.max]), [, bottom] = at([now, range.min]);
      const shapes = [{type: "line", shape: {x1: x, y1: top, x2: x, y2: bottom}, style: {stroke: look.text, lineWidth: 1.2}}];
      return shapes;
    }, {z: 7});
    if (r === 0) option.graphic = nowLabels(look, topmost - 17, width, from, now, to, Boolean(rhe), Boolean(rhc));
  });
  addLegend(option, look, names);
  option.tooltip = {show: false};
  return option;
}

function nowLabels(look, y, width, from, now, to, hasPast, hasFuture) {
  const inner = width - stripMargins.left - stripMargins.right;
  const x = stripMargins.left + inner * (now - from) / Math.max(to - from, 1);
  const text = (words, left, align) => ({type: "text", silent: true, x: left, y,
    style: {text: words, fill: look.faint, font: `${look.fontSize}px ${look.font}`, textAlign: align}});
  return [hasPast && text("← estimation horizon", x - 6, "right"), hasFuture && text("control horizon →", x + 6, "left")].filter(Boolean);
}

/// Step number to seconds, by the window's nodes and, ahead of them, by the control's step.
function stepTimes(document, {rhe, time, sample}) {
  const step = document.settings && document.settings.step;
  return (k) => {
    const at = rhe ? k - rhe.first : -1;
    if (rhe && at >= 0 && at < rhe.time.length && Math.round(at) === at) return seconds(rhe.time[at]);
    const now = rhe ? rhe.first + rhe.time.length - 1 : sample;
    return isKnown(step) && k > now ? seconds(time + (k - now) * step) : "";
  };
}

function rowRange(document, horizon, {kind, index}) {
  const {rhe, rhc} = horizon;
  if (kind === "parameter") {
    const {lower, upper} = document.model.parameters[index];
    const values = blocksOf(horizon, index).map((block) => block.value);
    const seen = extentOf(values, rhe.true && rhe.true[index], rangeOverRun(document, index));
    const range = axisRange(seen, {margin: 0.15});
    return {min: isKnown(lower) ? Math.max(range.min, Math.min(lower, seen[0])) : range.min,
            max: isKnown(upper) ? Math.min(range.max, Math.max(upper, seen[1])) : range.max};
  }
  const columns = [];
  if (rhe) columns.push(rhe.input[index], rhe.measured_input && rhe.measured_input[index]);
  if (rhc) columns.push(rhc.input[index], rhc.input_reference && rhc.input_reference[index], [rhc.lower && rhc.lower[index], rhc.upper && rhc.upper[index]]);
  return axisRange(extentOf(...columns.filter(Boolean)), {margin: 0.1});
}

const ranges = [];  // [document, index, extent]: an axis that stays still while the scrubber moves
function rangeOverRun(document, index) {
  const kept = ranges.find(([of, at]) => of === document && at === index);
  if (kept) return kept[2];
  const all = [];
  const source = document.horizons || (document.variants && document.variants[0].horizons);
  for (const horizon of source.list) {
    for (const block of blocksOf(horizon, index)) all.push(block.value);
    if (horizon.rhe && horizon.rhe.true) all.push(...horizon.rhe.true[index]);
  }
  const extent = extentOf(all);
  ranges.push([document, index, extent]);
  return extent;
}

function addBlockSteps(option, frame, look, document, horizon, p, range, colourOf, to) {
  const {rhe} = horizon, blocks = blocksOf(horizon, p), ramp = isRamp(document, p);
  const clamp = (value) => Math.min(Math.max(value, range.min), range.max);
  const nodes = rhe.time.map((_, i) => rhe.first + i);
  if (blocks.some((block) => isKnown(block.sigma)))
    addShapes(option, frame, "± 2σ", [rhe.first, range.min], (at) => blocks.reduce((shapes, block) => {
      if (!isKnown(block.sigma)) return shapes;
      const [left, top] = at([block.start, clamp(block.value + 2 * block.sigma)]), [right, bottom] = at([block.end, clamp(block.value - 2 * block.sigma)]);
      const colour = colourOf(look, p, block);
      shapes.push({type: "rect", shape: {x: left, y: top, width: right - left, height: bottom - top}, style: {fill: colour, opacity: 0.22}});
      if (block.cut || block.growing) shapes.push(...hatch(left, top, right, bottom, 9, {stroke: colour, lineWidth: 1, opacity: 0.8}));
      return shapes;
    }, []), {z: 1, itemStyle: {color: look.band}});
  if (rhe.true) addLine(option, frame, "truth", pairs(nodes, rhe.true[p]), {color: look.truth, width: 1.6}, {z: 3});
  addShapes(option, frame, "block", [rhe.first, range.min], (at) => {
    const shapes = [];
    blocks.forEach((block, b) => {
      const colour = colourOf(look, p, block), last = b === blocks.length - 1;
      const from = ramp && b > 0 ? blocks[b - 1].value : block.value;
      const points = (ramp ? [[block.start, from], [Math.min(block.start + 1, block.end), block.value], [block.end, block.value]]
                           : [[block.start, block.value], [block.end, block.value]]).map(at);
      shapes.push({type: "polyline", shape: {points}, style: {stroke: colour, lineWidth: 3.2, fill: "none", lineDash: block.cut || block.growing ? [7, 3] : null}});
      if (b > 0) {
        const [x, top] = at([block.start, range.max]), [, bottom] = at([block.start, range.min]);
        shapes.push({type: "line", shape: {x1: x, y1: top, x2: x, y2: bottom}, style: {stroke: look.line, lineWidth: 1, opacity: 0.7}});
      }
      if (last && to > block.end)  // what the controller goes by
        shapes.push({type: "polyline", shape: {points: [at([block.end, block.value]), at([to, block.value])]},
                     style: {stroke: look.plan, lineWidth: 1.6, lineDash: [2, 3], fill: "none"}});
    });
    for (const start of (rhe.blocks && rhe.blocks[p] && rhe.blocks[p].suppressed) || []) {
      const [x, top] = at([start, range.max]), [, bottom] = at([start, range.min]);
      shapes.push({type: "line", shape: {x1: x, y1: top, x2: x, y2: bottom}, style: {stroke: look.alarm, lineWidth: 1.4, lineDash: [3, 3]}});
      shapes.push(...cross([x, top + 7], 4, look.alarm, look.ground));
    }
    return shapes;
  }, {z: 5, itemStyle: {color: look.blocks[0]}});
}

function addInputs(option, frame, look, {rhe, rhc}, index, now) {
  const steps = (values, from) => values.map((value, i) => [from + i, value]).concat(values.length ? [[from + values.length, values[values.length - 1]]] : []);
  if (rhe) {
    addLine(option, frame, "estimated input", steps(rhe.input[index], rhe.first), {color: look.estimate, width: 1.6}, {step: "end", z: 3});
    if (rhe.measured_input && rhe.measured_input[index])
      addDots(option, frame, "measured", rhe.measured_input[index].map((value, i) => [rhe.first + i + 0.5, value]).filter(([, value]) => isKnown(value)),
              look.measured, {symbolSize: 5, z: 4});
  }
  if (rhc) {
    for (const bound of [rhc.lower, rhc.upper])
      if (bound && isKnown(bound[index])) addLine(option, frame, "bound", [[now, bound[index]], [now + rhc.input[index].length, bound[index]]], {color: look.bound, type: "dashed", width: 1.1});
    if (rhc.input_reference) addLine(option, frame, "reference", steps(rhc.input_reference[index], now), {color: look.reference, width: 1.4, type: "dashed"}, {step: "end", z: 3});
    addLine(option, frame, "planned", steps(rhc.input[index], now), {color: look.plan, width: 2}, {step: "end", z: 4});
  }
}

// ---- in words and numbers

/// One sentence for each thing that a reader sees, and that a screen reader says.
export function windowWords(document, horizon) {
  const {rhe, rhc} = horizon, sentences = [`Sample ${horizon.sample}, ${seconds(horizon.time)} s.`];
  if (rhe) {
    const count = rhe.time.length - 1, end = rhe.first + count;
    sentences.push(count === 0 ? "The estimation horizon holds one node, and no interval yet." : `The estimation horizon has ${count} interval${count === 1 ? "" : "s"}, from step ${rhe.first} to ${end}.`);
    document.model.parameters.forEach((variable, p) => {
      const blocks = blocksOf(horizon, p);
      if (blocks.length === 0) return;
      const partial = [blocks[0].cut && "the first", blocks[blocks.length - 1].growing && (blocks.length === 1 && blocks[0].cut ? false : "the last")].filter(Boolean);
      const suppressed = rhe.blocks[p].suppressed || [];
      if (rhe.estimate) return void sentences.push(`${variable.name}: a value at each node, by the most probable prior; what is given out is the mixture of all.`);
      sentences.push(`${variable.name}: ${blocks.length === 1 ? "one block" : `${blocks.length} blocks`}` +
        (blocks.length > 1 && partial.length ? `, ${listed(partial)} partial` : partial.length ? ", partial" : "") +
        (suppressed.length ? `; ${suppressed.length === 1 ? "a start" : "starts"} at step ${listed(suppressed.map(String))} suppressed by the overlap` : "") + ".");
    });
    const counted = rhe.measured && rhe.measured.length ? rhe.time.filter((_, i) => rhe.measured.some((column) => isKnown(column[i]))).length : 0;
    sentences.push(`${counted} of ${rhe.time.length} nodes have measurements.`);
    if (rhe.fallback) sentences.push("The solve fell back: the estimate is a prediction.");
  } else {
    sentences.push("This estimator has no horizon.");
  }
  if (rhc) sentences.push(`The control horizon has ${rhc.input[0].length} intervals.${rhc.fallback ? " The solve fell back: the last plan goes on." : ""}${rhc.relaxed ? " A bound of a state was relaxed." : ""}`);
  return sentences.join(" ");
}

/// Tables with all numbers of the sample.
export function windowTables(document, horizon) {
  const {model} = document, {rhe, rhc} = horizon, tables = [];
  const heads = (list) => list.map((variable) => withUnit(variable.name, variable.unit));
  if (rhe) {
    const rows = [];
    model.parameters.forEach((variable, p) => blocksOf(horizon, p).forEach((block) => {
      const state = [block.cut && "partial: began at " + block.began, block.growing && "partial: still growing"].filter(Boolean);
      rows.push([variable.name, block.start, block.end - 1, block.value, block.sigma, state.join("; ") || "whole"]);
    }));
    model.parameters.forEach((variable, p) => ((rhe.blocks && rhe.blocks[p] && rhe.blocks[p].suppressed) || []).forEach((start) =>
      rows.push([variable.name, start, "", null, null, "start suppressed by the overlap"])));
    if (rows.length) tables.push({title: "Blocks", columns: ["parameter", "first interval", "last interval", "value", "σ", ""], rows});
    const measured = model.outputs.map((variable) => `measured ${withUnit(variable.name, variable.unit)}`);
    tables.push({title: "Estimation horizon, node by node", columns: ["step", "time [s]"].concat(heads(model.states), measured),
      rows: rhe.time.map((time, i) => [rhe.first + i, time].concat(rhe.state.map((column) => column[i]), (rhe.measured || []).map((column) => column[i])))});
    if (rhe.arrival) {
      const variables = model.states.concat(model.parameters);
      tables.push({title: "Arrival cost: what was known of the first node", columns: ["variable", "mean", "σ"],
        rows: variables.map((variable, i) => [withUnit(variable.name, variable.unit), rhe.arrival.mean[i], rhe.arrival.sigma ? rhe.arrival.sigma[i] : null])});
    }
  }
  if (rhc) {
    tables.push({title: "Control horizon", columns: ["node"].concat(heads(model.states), heads(model.inputs), ["reference x [m]", "reference y [m]"]),
      rows: rhc.state[0].map((_, i) => [i].concat(rhc.state.map((column) => column[i]), rhc.input.map((column) => (i < column.length ? column[i] : null)),
                                                  [rhc.reference.x[i], rhc.reference.y[i]]))});
  }
  return tables;
}
