// What a fault campaign measured: curves of recovery, and for each kind of fault how it ended. `campaign` is faults.json.
import {count, number, percent, stem} from "../text.js";
import {addFrame, addLegend, addLine, addShapes, base, extentOf, isKnown, legendHeight, tooltip} from "./parts.js";

const groups = {
  transient: "Faults of up to ten samples", long: "Faults of more samples", moved: "Positions that move for good", angle: "Angles that are off for good",
  clock: "Clocks that are set",
};
const PANEL = 190, ROOM = 60, ROW = 20;  // heights of a panel and a row; room for the numbers of an axis [px]
const INDENT = 12, BOLD = 0.62;          // of a panel's title [px]; width of its letters by their height

export function faultFigures({campaign}) {
  const names = Object.keys(groups).filter((group) => campaign.kinds.some((kind) => kind.group === group));
  return {
    curves: names.map((group) => curveFigure(campaign, group)),
    shares: [
      rangeFigure(campaign, {
        name: "recovered", title: "Samples until the position's error stays as small as without the fault", label: "samples", most: longest(campaign),
        caption: "Circle: median; line: up to the 99th percentile. At the right edge: not within the ride.", range: ({recovered}) => [recovered.median, recovered.p99]}),
      rangeFigure(campaign, {
        name: "ok-again", title: "Samples until health is ok ten times in a row", label: "samples", most: longest(campaign),
        caption: "As above; counted from the end of the fault, of one for good from its beginning.", range: ({ok_again}) => [ok_again.median, ok_again.p99]}),
      rangeFigure(campaign, {
        name: "honest", title: "Samples that are honest", label: "share [%]", most: 100, least: leastHonest(campaign), mark: 100 * campaign.wanted.honest,
        caption: "Circle: the true position is within three standard deviations, or health is not ok; bar: the same of the heading.",
        range: ({honest, honest_heading}) => [100 * honest, 100 * honest_heading]}),
    ],
  };
}

const longest = ({samples}) => Math.max(...samples);
const leastHonest = ({kinds, estimators}) =>
  10 * Math.floor(Math.min(...kinds.map((kind) => Math.min(...estimators.map((name) => 100 * Math.min(kind.estimators[name].honest, kind.estimators[name].honest_heading))))) / 10);

/// A panel for each kind: the error against the samples since the fault's end.
function curveFigure(campaign, group) {
  const kinds = campaign.kinds.filter((kind) => kind.group === group), {estimators, window, samples} = campaign;
  const all = kinds.reduce((values, kind) => values.concat(...estimators.map((name) => kind.estimators[name].curve.reduce((some, [, median, p99]) => some.concat(median, p99), []))), []);
  const [low, high] = extentOf(all.filter((error) => error > 0));
  const ends = {min: Math.pow(10, Math.floor(Math.log(low) / Math.LN10)), max: Math.pow(10, Math.ceil(Math.log(high) / Math.LN10))};
  const across = (width) => Math.max(1, Math.min(4, Math.floor(width / 240)));
  const legend = (look, width) => legendHeight(look, estimators.concat("99th percentile"), width) + 8;
  return {
    name: `recovery-${stem(group)}`, title: groups[group], about: [],
    caption: `Error of the position against samples since the fault's end${group === "moved" || group === "angle" || group === "clock" ? ", here since its beginning" : ""}. Lines: median of ${count(kinds[0].estimators[estimators[0]].rides)} rides and more for each estimator; dashed: 99th percentile. The vertical line is one window of the estimator.`,
    height: (width) => Math.ceil(kinds.length / across(width)) * PANEL + 44,
    option: (look, {width}) => {
      const option = base(look), columns = across(width), wide = width / columns, top = legend(look, width);
      kinds.forEach((kind, k) => {
        const column = k % columns, y = top + Math.floor(k / columns) * PANEL;
        const frame = addFrame(option, look, {top: y + 20, height: PANEL - 66, width, left: column * wide + ROOM, right: width - (column + 1) * wide + 12,
          x: {min: 0, max: longest({samples})}, y: {type: "log", name: column === 0 ? "error [m]" : "", ...ends}});
        const size = Math.min(look.fontSize, (wide - 2 * INDENT) / (BOLD * kind.name.length));
        option.graphic = (option.graphic || []).concat({type: "text", silent: true, x: column * wide + INDENT, y, style: {text: kind.name, fill: look.text, font: `600 ${size.toFixed(1)}px ${look.font}`}});
        addShapes(option, frame, "window", [window, ends.min], (at) => {
          const [x, bottom] = at([window, ends.min]), [, above] = at([window, ends.max]);
          return [{type: "line", shape: {x1: x, y1: bottom, x2: x, y2: above}, style: {stroke: look.line}}];
        }, {z: 0});
        estimators.forEach((name, i) => {
          const colour = look.kinds[i % look.kinds.length], {curve} = kind.estimators[name];
          const line = (of) => curve.map((point) => [point[0], Math.max(point[of], ends.min)]);
          addLine(option, frame, name, line(1), {color: colour, width: 1.6});
          addLine(option, frame, "99th percentile", line(2), {color: colour, type: "dashed", width: 1.2});
        });
      });
      addLegend(option, look, estimators.concat("99th percentile"));
      option.tooltip = tooltip(look);
      return option;
    },
    table: () => ({columns: ["fault", "estimator", "samples since", "median [m]", "99th percentile [m]"],
      rows: kinds.reduce((rows, kind) => estimators.reduce((some, name) => some.concat(kind.estimators[name].curve.map((point) => [kind.name, name, ...point])), rows), [])}),
  };
}

/// Two numbers of each kind and estimator, on a common axis; null lies at the right edge.
function rangeFigure(campaign, {name, title, caption, label, range, most, least = 0, mark}) {
  const {kinds, estimators} = campaign, labels = kinds.map((kind) => kind.name);
  const room = (width) => Math.min(Math.round(width * 0.4), 24 + 7 * Math.max(...labels.map((text) => text.length)));
  return {
    name, title, caption: mark === undefined ? caption : `${caption} The vertical line is what is wanted.`, about: [],
    height: () => kinds.length * ROW + 84,
    option: (look, {width, height}) => {
      const option = base(look), left = room(width), top = 32;
      const frame = addFrame(option, look, {top, height: height - top - 52, width, left, right: 24, x: {name: label, min: least, max: most},
        y: {type: "category", data: labels.slice().reverse(), splitLine: {show: true, lineStyle: {color: look.grid}}, axisTick: {show: false}, axisLabel: {formatter: null, color: look.text, interval: 0, width: left - 12, overflow: "truncate"}}});
      if (mark !== undefined)
        addShapes(option, frame, "wanted", [mark, 0], (at) => {
          const [x, y] = at([mark, 0]);
          return [{type: "line", shape: {x1: x, y1: top, x2: x, y2: Math.max(y, height - 52)}, style: {stroke: look.line, lineWidth: 1.4}}];
        }, {z: 0});
      estimators.forEach((estimator, e) => {
        const colour = look.kinds[e % look.kinds.length], shift = (e - (estimators.length - 1) / 2) * 5;
        addShapes(option, frame, estimator, [least, 0], (at) => kinds.reduce((shapes, kind, k) => {
          const [from, to] = range(kind.estimators[estimator]).map((value) => (isKnown(value) ? Math.min(value, most) : most));
          const [x1, y] = at([from, kinds.length - 1 - k]), [x2] = at([to, kinds.length - 1 - k]);
          return shapes.concat([
            {type: "line", shape: {x1, y1: y + shift, x2, y2: y + shift}, style: {stroke: colour, lineWidth: 1.6}},
            {type: "line", shape: {x1: x2, y1: y + shift - 3, x2, y2: y + shift + 3}, style: {stroke: colour, lineWidth: 1.6}},
            {type: "circle", shape: {cx: x1, cy: y + shift, r: 2.8}, style: {fill: look.ground, stroke: colour, lineWidth: 1.8}},
          ]);
        }, []), {clip: false, z: 3, itemStyle: {color: colour}});
      });
      addLegend(option, look, estimators);
      option.tooltip = {show: false};
      return option;
    },
    table: () => ({
      columns: ["fault", "group", "estimator", "rides", "recovered: median", "99th percentile", "never", "never, and not lost", "followed", "honest", "honest, heading", "longest not", "ok: median", "ok: 99th percentile", "volume while ok", "more than twice"],
      rows: kinds.reduce((rows, kind) => rows.concat(estimators.map((estimator) => {
        const each = kind.estimators[estimator], orNever = (value) => (isKnown(value) ? value : "never");
        return [kind.name, kind.group, estimator, each.rides, orNever(each.recovered.median), orNever(each.recovered.p99), each.never, each.unsaid, each.followed, percent(each.honest), percent(each.honest_heading), each.longest_dishonest,
          orNever(each.ok_again.median), orNever(each.ok_again.p99), number(each.volume), percent(each.wide)];
      })), []),
    }),
  };
}
