// Solvers side by side: on the same problems, and each driving by itself. `comparison` is compare.json.
import {capital, count, listed, number, withUnit} from "../text.js";
import {addFrame, addLegend, addShapes, axisRange, base, extentOf, isKnown} from "./parts.js";

const problemNames = {rhe: "estimation (RHE)", rhc: "control (RHC)"};
const ROW = 34;

/// Measures of answers to the same problems; all but iterations on a logarithmic axis.
const answers = [
  {key: "time_us", name: "solve-time", title: "Time of a solve", label: "time [µs]", log: true, about: ["times"]},
  {key: "kkt_residual", name: "kkt", title: "Residual of the optimality conditions", label: "KKT residual", log: true},
  {key: "gap", name: "gap", title: "Objective above the best answer's", label: "gap, relative", log: true},
  {key: "distance", name: "distance", title: "Distance from the best answer", label: "distance [scales of the model]", log: true},
  {key: "iterations", name: "iterations", title: "Iterations", label: "iterations", log: false},
];

export function comparisonFigures(document) {
  const {comparison} = document, same = comparison.same_problems || {};
  const problems = Object.keys(problemNames).filter((problem) => same[problem] && same[problem].solvers.some((solver) => solver.solved !== 0));
  return {
    answers: answers.map((measure) => spreadFigure(comparison, problems, measure)),
    statuses: [statusFigure(comparison, problems)],
    loops: loopFigures(comparison),
  };
}

function spreadFigure(comparison, problems, measure) {
  const labels = comparison.solvers.map((solver) => solver.label);
  return {
    name: `answers-${measure.name}`, title: `${measure.title}, on the same problems`,
    caption: `Circle: median; line: up to the 99th percentile; bar: the largest. ${problems.map((problem) => `${capital(problemNames[problem])}: ${count(comparison.same_problems[problem].problems)} problems`).join("; ")}.${measure.log ? " Zeros lie at the left edge." : ""}`,
    about: measure.about || [], height: () => 30 + problems.length * (labels.length * ROW + 70),
    option: (look, size) => spreads(look, size, comparison, problems, measure, labels),
    table: () => ({columns: ["problems", "solver", "median", "99th percentile", "largest", ...(measure.key === "time_us" ? ["median to the first solver's"] : [])],
      rows: problems.reduce((rows, problem) => rows.concat(comparison.same_problems[problem].solvers.map((solver, i, all) => {
        const spread = solver[measure.key] || {};
        return [problemNames[problem], solver.label, spread.median, spread.p99, spread.max].concat(measure.key === "time_us" ? [ratio(spread, all[0].time_us)] : []);
      })), [])}),
  };
}

const ratio = (spread, first) => (first && isKnown(spread.median) && first.median ? spread.median / first.median : null);

function spreads(look, {width, height}, comparison, problems, measure, labels) {
  const option = base(look), left = labelRoom(labels, width), each = (height - 30) / problems.length;
  const all = problems.reduce((values, problem) => values.concat(...comparison.same_problems[problem].solvers.map((solver) => solver[measure.key] || {}).map(({median, p99, max}) => [median, p99, max])), []).filter(isKnown);
  const positive = all.filter((value) => value > 0);
  const ends = measure.log ? logEnds(positive) : axisRange(extentOf(all), {zero: true});
  problems.forEach((problem, p) => {
    const {solvers} = comparison.same_problems[problem], top = 24 + p * each;
    const frame = addFrame(option, look, {
      top: top + 18, height: each - 18 - 50, width, left, right: 28, x: {name: measure.label, ...(measure.log ? {type: "log", axisLabel: {formatter: power}} : {}), ...ends},
      y: {type: "category", data: labels.slice().reverse(), splitLine: {show: false}, axisTick: {show: false}, axisLabel: {formatter: null, color: look.text, interval: 0, width: left - 12, overflow: "truncate"}},
    });
    option.graphic = (option.graphic || []).concat({type: "text", silent: true, x: left, y: top, style: {text: capital(problemNames[problem]), fill: look.text, font: `600 ${look.fontSize}px ${look.font}`}});
    addShapes(option, frame, "spread", [ends.min, 0], (at) => solvers.reduce((shapes, solver) => {
      const spread = solver[measure.key], index = labels.indexOf(solver.label);
      if (!spread || !isKnown(spread.median)) return shapes;
      const row = labels.length - 1 - index, colour = look.kinds[index % look.kinds.length];
      const place = (value) => at([measure.log ? Math.max(value, ends.min) : value, row]);
      const [x, y] = place(spread.median), [x99] = place(spread.p99), [xMax] = place(spread.max);
      return shapes.concat([
        {type: "line", shape: {x1: x, y1: y, x2: x99, y2: y}, style: {stroke: colour, lineWidth: 5}},
        {type: "line", shape: {x1: x99, y1: y, x2: xMax, y2: y}, style: {stroke: colour, lineWidth: 1.6}},
        {type: "line", shape: {x1: xMax, y1: y - 7, x2: xMax, y2: y + 7}, style: {stroke: colour, lineWidth: 2.4}},
        {type: "circle", shape: {cx: x, cy: y, r: 5.5}, style: {fill: look.ground, stroke: colour, lineWidth: 2.6}},
      ]);
    }, []), {clip: false, z: 3});
  });
  option.tooltip = {show: false};
  return option;
}

const labelRoom = (labels, width) => Math.min(Math.round(width * 0.36), 24 + 7 * Math.max(...labels.map((label) => label.length)));
const power = (value) => (value >= 0.01 && value < 1e5 ? number(value) : `1e${Math.round(Math.log(value) / Math.LN10)}`.replace("-", "−"));

function logEnds(values) {
  if (values.length === 0) return {min: 1e-16, max: 1};
  const [low, high] = extentOf(values);
  return {min: Math.pow(10, Math.floor(Math.log(low) / Math.LN10 - 0.05)), max: Math.pow(10, Math.ceil(Math.log(high) / Math.LN10 + 0.05))};
}

function statusFigure(comparison, problems) {
  const labels = comparison.solvers.map((solver) => solver.label), names = [];
  const countsOf = (solver) => ({...solver.statuses, ...(solver.refused ? {refused: solver.refused} : {})});
  for (const problem of problems)
    for (const solver of comparison.same_problems[problem].solvers)
      for (const name of Object.keys(countsOf(solver))) if (names.indexOf(name) < 0) names.push(name);
  return {
    name: "answers-statuses", title: "Statuses of the answers, on the same problems", caption: "Share of the problems; the numbers are in the table.", about: [],
    height: () => 40 + problems.length * (labels.length * ROW + 62),
    option: (look, {width, height}) => {
      const option = base(look), left = labelRoom(labels, width), each = (height - 40) / problems.length;
      problems.forEach((problem, p) => {
        const {solvers, problems: total} = comparison.same_problems[problem], top = 40 + p * each;
        const frame = addFrame(option, look, {top: top + 18, height: each - 18 - 44, width, left, right: 28, x: {min: 0, max: 100, name: "share [%]"},
          y: {type: "category", data: labels.slice().reverse(), splitLine: {show: false}, axisTick: {show: false}, axisLabel: {formatter: null, color: look.text, interval: 0, width: left - 12, overflow: "truncate"}}});
        option.graphic = (option.graphic || []).concat({type: "text", silent: true, x: left, y: top, style: {text: capital(problemNames[problem]), fill: look.text, font: `600 ${look.fontSize}px ${look.font}`}});
        names.forEach((name, n) => addShapes(option, frame, name, [0, 0], (at) => solvers.map((solver) => {
          const counts = countsOf(solver), row = labels.length - 1 - labels.indexOf(solver.label);
          const before = names.slice(0, n).reduce((sum, other) => sum + (counts[other] || 0), 0), own = counts[name] || 0;
          const [x1, y] = at([100 * before / total, row]), [x2] = at([100 * (before + own) / total, row]);
          return {type: "rect", shape: {x: x1, y: y - 9, width: own ? Math.max(x2 - x1, 1) : 0, height: 18}, style: {fill: look.kinds[n % look.kinds.length]}};
        }), {itemStyle: {color: look.kinds[n % look.kinds.length]}}));
      });
      addLegend(option, look, names);
      option.tooltip = {show: false};
      return option;
    },
    table: () => ({columns: ["problems", "solver"].concat(names, ["worst: seed", "step", "gap"]),
      rows: problems.reduce((rows, problem) => rows.concat(comparison.same_problems[problem].solvers.map((solver) =>
        [problemNames[problem], solver.label].concat(names.map((name) => countsOf(solver)[name] || 0), solver.worst ? [solver.worst.seed, solver.worst.step, solver.worst.gap] : ["", "", ""]))), [])}),
  };
}

// ---- each drives by itself

const units = {position: "m", tracking: "m", heading: "rad"};

function loopFigures(comparison) {
  const loops = comparison.closed_loop || [];
  const driven = loops.filter((loop) => loop.runs && loop.runs.length);
  if (driven.length === 0) return [];
  const keys = Object.keys(driven[0].runs[0].mae);
  const across = (width) => (width < 640 ? 1 : 2), labels = driven.map((loop) => loop.label), tall = labels.length * ROW + 84;
  return [{
    name: "closed-loop", title: "Mean absolute errors, each driving by itself",
    caption: `Dots: single seeds; line: their mean. ${listed(driven.map((loop) => `${loop.label} completed ${loop.runs.filter((run) => run.completed).length} of ${loop.runs.length}`))}.`,
    about: [], height: (width) => Math.ceil(keys.length / across(width)) * tall,
    option: (look, {width}) => {
      const option = base(look), columns = across(width), wide = width / columns, left = labelRoom(labels, wide);
      keys.forEach((key, k) => {
        const column = k % columns, top = Math.floor(k / columns) * tall;
        const values = driven.map((loop) => loop.runs.map((run) => run.mae[key]));
        const frame = addFrame(option, look, {top: top + 24, height: tall - 24 - 50, width, left: column * wide + left, right: width - (column + 1) * wide + 16,
          x: {name: withUnit(key, units[key]), ...axisRange(extentOf(...values), {zero: true})},
          y: {type: "category", data: labels.slice().reverse(), splitLine: {show: false}, axisTick: {show: false}, axisLabel: {formatter: null, color: look.text, interval: 0, width: left - 12, overflow: "truncate"}}});
        addShapes(option, frame, key, [0, 0], (at) => driven.reduce((shapes, loop, index) => {
          const row = labels.length - 1 - index, colour = look.kinds[index % look.kinds.length];
          const known = values[index].filter(isKnown);
          if (known.length === 0) return shapes;
          const [mean, y] = at([known.reduce((a, b) => a + b, 0) / known.length, row]);
          return shapes.concat({type: "line", shape: {x1: mean, y1: y - 10, x2: mean, y2: y + 10}, style: {stroke: colour, lineWidth: 3}},
                               known.map((value) => ({type: "circle", shape: {cx: at([value, row])[0], cy: y, r: 4}, style: {fill: colour, opacity: 0.55}})));
        }, []), {clip: false, z: 3});
      });
      option.tooltip = {show: false};
      return option;
    },
    table: () => ({columns: ["solver", "seed", "completed", "steps", "fallbacks"].concat(keys.map((key) => withUnit(key, units[key]))),
      rows: driven.reduce((rows, loop) => rows.concat(loop.runs.map((run) => [loop.label, run.seed, run.completed ? "yes" : run.ended, run.steps, run.fallbacks].concat(keys.map((key) => run.mae[key])))), [])}),
  }];
}
