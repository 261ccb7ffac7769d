// The track of a recorded drive, beside the fixes that it was estimated from.
import {count, number, percent, stem} from "../text.js";
import {columnFigure} from "./series.js";
import {addDots, addFrame, addLegend, addLine, base, equalAxes, extentOf, pairs} from "./parts.js";

const margins = {left: 62, right: 16, top: 50, bottom: 46};
const inside = (share, low, high) => Math.min(Math.max(share, low), high);

/// What the extents of fixes and of a track have in common, with some room for noise; that of the fixes if that is nothing.
function shared([low, high], [trackLow, trackHigh]) {
  const room = 0.1 * (trackHigh - trackLow), common = [Math.max(low, trackLow - room), Math.min(high, trackHigh + room)];
  return common[1] > common[0] ? common : [low, high];
}

export function trackFigure(document) {
  const tracks = document.variants.filter((variant) => variant.track);
  if (tracks.length === 0) return null;
  const {fixes} = document;
  const bounds = () => {
    // Neither an estimator that is lost for a while nor a fix far off must shrink all the others.
    const [x, y] = ["x", "y"].map((axis) => (fixes && fixes.x.length ? shared(extentOf(fixes[axis]), extentOf(tracks[0].track[axis])) : extentOf(tracks[0].track[axis])));
    const grow = ([low, high]) => [low - 0.08 * (high - low), high + 0.08 * (high - low)];
    return [grow(x), grow(y)];
  };
  return {
    name: "track", title: "Estimated track and position fixes",
    caption: "Both axes have the same scale; what lies far outside of fixes or track is cut off.", about: ["map", "fixes", "samples"], marksPosition: true,
    height: (width) => {
      const [x, y] = bounds(), inner = width - margins.left - margins.right;
      return Math.round(inner * inside((y[1] - y[0]) / Math.max(x[1] - x[0], 1e-9), 0.3, width < 500 ? 1.2 : 0.8) + margins.top + margins.bottom);
    },
    option: (look, {width, height}) => {
      const option = base(look), [x, y] = bounds();
      const inner = {width: width - margins.left - margins.right, height: height - margins.top - margins.bottom};
      const axes = equalAxes(x, y, inner.width, inner.height);
      const frame = addFrame(option, look, {top: margins.top, height: inner.height, width, left: margins.left, right: margins.right,
        x: {name: "x [m]", ...axes.x, axisLabel: {showMinLabel: false, showMaxLabel: false}}, y: {name: "y [m]", ...axes.y, axisLabel: {showMinLabel: false, showMaxLabel: false}}});
      const names = [];
      if (fixes) {
        const of = (held) => pairs(fixes.x, fixes.y).filter((_, i) => Boolean(fixes.held_out[i]) === held);
        const [given, held] = [of(false), of(true)];
        addDots(option, frame, "fix", given, look.measured, {symbolSize: 4, silent: true, itemStyle: {color: look.measured, opacity: 0.6}});
        names.push("fix");
        if (held.length) {
          addDots(option, frame, "withheld fix", held, look.plan, {symbol: "diamond", symbolSize: 5, silent: true, itemStyle: {color: look.plan, opacity: 0.8}});
          names.push("withheld fix");
        }
      }
      const colours = [look.estimate, look.reference, look.truth, look.plan, look.kinds[4]], types = ["solid", "dashed", "dotted", "solid", "dashed"];
      tracks.slice().reverse().forEach((variant) => {
        const index = tracks.indexOf(variant);
        addLine(option, frame, variant.name, pairs(variant.track.x, variant.track.y), {color: colours[index % 5], type: types[index % 5], width: index === 0 ? 1.8 : 1.2}, {z: 5 - Math.min(index, 3)});
      });
      addLegend(option, look, names.concat(tracks.map((variant) => variant.name)));
      option.tooltip = {show: false};
      return option;
    },
    table: () => ({columns: ["line", "points", "least x [m]", "largest x [m]", "least y [m]", "largest y [m]"],
      rows: (fixes ? [["fixes", fixes]] : []).concat(tracks.map((variant) => [variant.name, variant.track]))
        .map(([name, line]) => [name, line.x.length, ...extentOf(line.x), ...extentOf(line.y)])}),
  };
}

/// What a sensor measured less what was expected of it, relative to what that should be.
export function innovationFigure(document, sensor, prefix) {
  const all = sensor.used + sensor.rejected;
  const outputs = Object.keys(sensor.outputs).map((name) => [name, sensor.outputs[name]]).filter(([, output]) => output.rms !== null)
    .map(([name, {rms, expected, correlation}]) => `${name}: ${number(rms)} RMS, ${number(expected)} stated, correlation with the next ${number(correlation, 2)}`);
  return columnFigure(document, {
    name: `${prefix}innovations-${stem(sensor.sensor)}`, title: `Innovations of ${sensor.sensor}`,
    caption: `Normalised innovation squared: ${number(sensor.mean)} on average, ${number(sensor.expected)} (dashed) to be expected. ` +
             `${count(sensor.rejected)} of ${count(all)} rejected${all ? ` (${percent(sensor.rejected / all)})` : ""}. ${outputs.join("; ")}.`,
    about: ["innovations", "samples"], label: "NIS", unit: "", time: document.times[sensor.time], values: sensor.values, log: true, dots: true,
    colour: "measured", expected: sensor.expected, marked: {name: "rejected", is: sensor.is_rejected}});
}
