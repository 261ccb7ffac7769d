// What most figures are put together from: frames with axes, lines, bands, marks, all as options of ECharts.
import {number} from "../text.js";

/// Bare option: no movement, no surprises in size; figures add grids, axes and series.
export function base(look) {
  return {
    animation: false,
    textStyle: {fontFamily: look.font, fontSize: look.fontSize, color: look.text},
    grid: [], xAxis: [], yAxis: [], series: [],
  };
}

/// Where a frame (grid with its two axes) is; `left` has room for the numbers and the name of the axis.
export function addFrame(option, look, {top, height, width, left = 62, right = 16, x, y, bare = false}) {
  const index = option.grid.length;
  const text = {color: look.faint, fontSize: look.fontSize - 1, fontFamily: look.font, hideOverlap: true};
  const common = {
    gridIndex: index, type: "value", nameLocation: "middle", nameMoveOverlap: false,
    nameTextStyle: {color: look.text, fontSize: look.fontSize, fontFamily: look.font},
    axisLine: {show: true, onZero: false, lineStyle: {color: look.line}},
    axisTick: {show: !bare, lineStyle: {color: look.line}}, splitLine: {lineStyle: {color: look.grid}},
  };
  option.grid.push({left, top, height, width: width - left - right, containLabel: false, outerBoundsMode: "none"});
  option.xAxis.push({...common, nameGap: 26, ...x, axisLabel: {...text, formatter: tick, ...(x && x.axisLabel)}});
  const steps = evenSteps(y, Math.max(2, Math.round(height / 40)));
  option.yAxis.push({...common, nameGap: 42, ...steps, ...y, axisLabel: {...text, ...steps.axisLabel, formatter: tick, ...(y && y.axisLabel)}});
  return index;
}

/// Steps of an axis whose ends are given; an end that is no multiple of them has no number.
function evenSteps({type, min, max} = {}, about) {
  if (type || !isKnown(min) || !isKnown(max)) return {splitNumber: about};
  const interval = niceStep((max - min) / about), fits = (value) => Math.abs(value / interval - Math.round(value / interval)) < 1e-6;
  if (!fits(min)) return {splitNumber: about, axisLabel: {showMinLabel: false, showMaxLabel: false}};  // ECharts counts from the least
  return {interval, axisLabel: {showMaxLabel: fits(max)}};
}

/// A number at an axis: no noise of binary fractions, a proper minus.
export const tick = (value) => {
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential().replace("e+", "e").replace(/-/g, "−");
  return String(Number(value.toPrecision(10))).replace("-", "−");
};

export const pairs = (x, y) => x.map((value, i) => [value, y[i]]);

export function addLine(option, frame, name, data, style, more = {}) {
  option.series.push({
    type: "line", name, data, xAxisIndex: frame, yAxisIndex: frame, showSymbol: false, symbol: more.showSymbol ? "circle" : "none", connectNulls: false,
    emphasis: {disabled: true}, lineStyle: {width: 1.4, ...style}, itemStyle: {color: style.color}, clip: true, ...more,
  });
}

export function addDots(option, frame, name, data, colour, more = {}) {
  option.series.push({
    type: "scatter", name, data, xAxisIndex: frame, yAxisIndex: frame, symbolSize: 5, itemStyle: {color: colour},
    emphasis: {disabled: true}, clip: true, ...more,
  });
}

/// A custom series whose `draw(at, size)` returns shapes in pixels: `at([x, y])` places a point, `size([dx, dy])` a length.
export function addShapes(option, frame, name, extent, draw, more = {}) {
  option.series.push({
    type: "custom", name, xAxisIndex: frame, yAxisIndex: frame, data: [extent], silent: true, clip: true, z: 1,
    tooltip: {show: false}, encode: {x: [], y: []}, ...more,
    renderItem: (_, api) => ({type: "group", children: draw(api.coord, api.size)}),
  });
}

/// Shapes that are in pixels already, in a figure without axes. (ECharts' `graphic` takes far longer for thousands.)
export function addDrawing(option, shapes) {
  option.series.push({type: "custom", coordinateSystem: "none", data: [0], silent: true, tooltip: {show: false},
                      renderItem: () => ({type: "group", children: shapes})});
}

/// The area between two columns, in as many pieces as gaps leave.
export function addBand(option, frame, name, x, low, high, colour) {
  addShapes(option, frame, name, [x[0], low[0]], (at) => {
    const shapes = [];
    let piece = [];
    const close = () => {
      if (piece.length > 1) {
        const points = piece.map((i) => at([x[i], high[i]])).concat(piece.slice().reverse().map((i) => at([x[i], low[i]])));
        shapes.push({type: "polygon", shape: {points}, style: {fill: colour, stroke: "none"}});
      }
      piece = [];
    };
    for (let i = 0; i < x.length; ++i) {
      if (isKnown(low[i]) && isKnown(high[i])) piece.push(i);
      else close();
    }
    close();
    return shapes;
  }, {itemStyle: {color: colour}});
}

/// Stripes over whole frames, for spans [{from, to}] of x.
export function addStripes(option, frame, name, spans, colour, [low, high]) {
  if (spans.length === 0) return;
  addShapes(option, frame, name, [spans[0].from, low], (at) => spans.map(({from, to}) => {
    const [left, top] = at([from, high]), [right, bottom] = at([to, low]);
    return {type: "rect", shape: {x: left, y: top, width: Math.max(right - left, 1), height: bottom - top},
            style: {fill: colour}};
  }), {z: 0, itemStyle: {color: colour}});
}

export const isKnown = (value) => value !== null && value !== undefined;

/// Least and largest of columns, [0, 1] if nothing is known.
export function extentOf(...columns) {
  let low = Infinity, high = -Infinity;
  for (const column of columns) {
    if (!column) continue;
    for (let i = 0; i < column.length; ++i) {
      const value = column[i];
      if (!isKnown(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low > high ? [0, 1] : [low, high];
}

/// An axis that holds an extent, with ends that read well.
export function axisRange([low, high], {zero = false, margin = 0.05} = {}) {
  if (zero) {
    low = Math.min(low, 0);
    high = Math.max(high, 0);
  }
  let span = high - low;
  if (!(span > 0)) span = Math.abs(high) || 1;
  const step = niceStep(span / 5);
  const below = zero && low === 0 ? 0 : margin * span, above = zero && high === 0 ? 0 : margin * span;
  return {min: clean(Math.floor((low - below) / step) * step), max: clean(Math.ceil((high + above) / step) * step)};
}

export function niceStep(about) {
  const power = Math.pow(10, Math.floor(Math.log(about) / Math.LN10 + 1e-9));
  const lead = about / power;
  return power * (lead <= 1.01 ? 1 : lead <= 2.01 ? 2 : lead <= 5.01 ? 5 : 10);
}
const clean = (value) => Number(value.toPrecision(12));

/// How high a legend is: it has more lines where the figure is narrow.
export function legendHeight(look, names, width) {
  const lengths = names.map((name) => 38 + name.length * look.fontSize * 0.62);
  let lines = names.length ? 1 : 0, used = 0;
  for (const length of lengths) {
    if (used > 0 && used + length > width - 64) {
      ++lines;
      used = 0;
    }
    used += length;
  }
  return lines * (look.fontSize + 12);
}

const strokes = {solid: "path://M0,4h30v3h-30z", dashed: "path://M0,4h8v3h-8zM11,4h8v3h-8zM22,4h8v3h-8z", dotted: "path://M0,4h3v3h-3zM7,4h3v3h-3zM14,4h3v3h-3zM21,4h3v3h-3zM27,4h3v3h-3z"};

/// A legend of the series with these names; lines look there as they do in the figure.
export function addLegend(option, look, names) {
  const data = names.map((name) => {
    const series = option.series.find((each) => each.name === name);
    return series && series.type === "line" && !series.showSymbol ? {name, icon: strokes[series.lineStyle.type || "solid"], itemStyle: {borderWidth: 0}} : {name};
  });
  option.legend = {data, top: 0, left: 56, right: 8, itemWidth: 22, itemHeight: 9, itemGap: 14, selectedMode: false,
                   textStyle: {color: look.text, fontSize: look.fontSize, fontFamily: look.font}};
}

/// The box with numbers beside the pointer.
export function tooltip(look, more = {}) {
  return {
    trigger: "axis", confine: true, backgroundColor: look.panel, borderColor: look.line, transitionDuration: 0,
    textStyle: {color: look.text, fontSize: look.fontSize, fontFamily: look.font},
    axisPointer: {type: "line", animation: false, lineStyle: {color: look.line}},
    valueFormatter: (value) => number(Array.isArray(value) ? value[1] : value, 5), ...more,
  };
}

/// Lines at 45 degrees that hatch the rectangle (pixels), so that a filling is told apart without its colour.
export function hatch(left, top, right, bottom, gap, style) {
  const lines = [];
  for (let c = Math.ceil((left + top) / gap) * gap; c < right + bottom; c += gap) {
    const x1 = Math.max(left, c - bottom), x2 = Math.min(right, c - top);
    if (x2 > x1) lines.push({type: "line", shape: {x1, y1: c - x1, x2, y2: c - x2}, style});
  }
  return lines;
}

/// How many pixels a unit is where both axes of a map have the same, and what each axis then spans.
export function equalAxes([left, right], [bottom, top], width, height) {
  const wide = Math.max(right - left, 1e-9), high = Math.max(top - bottom, 1e-9);
  const unit = Math.max(wide / width, high / height);
  const [midX, midY] = [(left + right) / 2, (bottom + top) / 2];
  return {x: {min: midX - unit * width / 2, max: midX + unit * width / 2},
          y: {min: midY - unit * height / 2, max: midY + unit * height / 2}, unit};
}
