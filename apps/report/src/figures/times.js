// Solve times as a distribution: every solve is in a bin, bins are even on a logarithmic scale.
import {capital, count, number} from "../text.js";
import {addFrame, addLegend, addLine, addShapes, axisRange, base, tooltip} from "./parts.js";

const names = {rhe: "estimator (RHE)", rhc: "controller (RHC)"};

export function solveTimeFigure(document, source = document, prefix = "") {
  const times = source.solve_times;
  const shown = times ? Object.keys(names).filter((problem) => times[problem]) : [];
  if (shown.length === 0) return null;
  return {
    name: `${prefix}solve-times`, title: "Solve times",
    caption: `${shown.map((problem) => `${capital(names[problem])}: median ${number(times[problem].median)} µs, 99 % within ${number(times[problem].p99)} µs, longest ${number(times[problem].max)} µs, of ${count(times[problem].count)} solves`).join("; ")}. Preparation and feedback together. Lines: median (dashed), 99th percentile (dotted).`,
    about: ["times"], height: () => 280,
    option: (look, size) => histogram(look, size, times, shown),
    table: () => ({columns: ["from [µs]", "to [µs]"].concat(shown.map((problem) => `solves, ${names[problem]}`)), rows: rowsOf(times, shown)}),
  };
}

function rowsOf(times, shown) {
  const rows = {};
  shown.forEach((problem, column) => times[problem].counts.forEach((solves, bin) => {
    const [from, to] = [times[problem].edges[bin], times[problem].edges[bin + 1]];
    const key = from.toPrecision(6);
    if (!rows[key]) rows[key] = [number(from, 4), number(to, 4)].concat(shown.map(() => 0));
    rows[key][2 + column] = solves;
  }));
  return Object.keys(rows).sort((a, b) => Number(a) - Number(b)).map((key) => rows[key]);
}

function histogram(look, {width, height}, times, shown) {
  const option = base(look), top = 30;
  const edges = shown.reduce((all, problem) => all.concat(times[problem].edges), []);
  const most = Math.max(...shown.map((problem) => Math.max(...times[problem].counts)));
  const ends = axisRange([0, most], {zero: true});
  const frame = addFrame(option, look, {top, height: height - top - 46, width,
    x: {type: "log", name: "solve time [µs]", min: Math.min(...edges), max: Math.max(...edges), minorTick: {show: true}, axisLabel: {showMinLabel: false, showMaxLabel: false}},
    y: {name: "solves", min: 0, max: ends.max}});
  const colours = {rhe: look.estimate, rhc: look.reference};
  for (const problem of shown) {
    const {edges: bins, counts, median, p99} = times[problem];
    addShapes(option, frame, names[problem], [bins[0], 0], (at) => counts.map((solves, bin) => {
      const [left, bottom] = at([bins[bin], 0]), [right, up] = at([bins[bin + 1], solves]);
      return {type: "rect", shape: {x: left + 0.5, y: up, width: Math.max(right - left - 1, 0.5), height: bottom - up},
              style: {fill: colours[problem], opacity: 0.65}};
    }), {itemStyle: {color: colours[problem]}});
    addLine(option, frame, `${problem} median`, [[median, 0], [median, ends.max]], {color: colours[problem], type: "dashed"}, {silent: true});
    addLine(option, frame, `${problem} p99`, [[p99, 0], [p99, ends.max]], {color: colours[problem], type: "dotted"}, {silent: true});
  }
  addLegend(option, look, shown.map((problem) => names[problem]));
  option.tooltip = {...tooltip(look), show: false};
  return option;
}
