// A place seen from above: the ground's slip as a picture, and what was driven over it. Both axes have the same scale.
import {colourAt, css, scales} from "../look.js";
import {pngUrl} from "../png.js";
import {number, withUnit} from "../text.js";
import {addFrame, addLegend, addLine, addShapes, base, equalAxes, extentOf, pairs} from "./parts.js";

const SHADES = 128;
const pictures = [];  // {raster, url}: drawn once and placed often

function groundPicture(raster) {
  const kept = pictures.find((picture) => picture.raster === raster);
  if (kept) return kept.url;
  const palette = [], rows = [], span = raster.upper - raster.lower || 1;
  for (let i = 0; i < SHADES; ++i) palette.push(colourAt(scales.ground, i / (SHADES - 1)));
  palette.push([160, 160, 160]);  // not known
  for (let y = raster.ny - 1; y >= 0; --y) {
    const row = [];
    for (let x = 0; x < raster.nx; ++x) {
      const value = raster.values[y * raster.nx + x];
      row.push(value === null ? SHADES : Math.round(Math.min(Math.max((value - raster.lower) / span, 0), 1) * (SHADES - 1)));
    }
    rows.push(row);
  }
  const url = pngUrl(rows, palette);
  pictures.push({raster, url});
  return url;
}

/// The picture of the ground in a frame whose axes are `axes` (of equalAxes).
export function addGround(option, frame, raster) {
  addShapes(option, frame, "ground", [raster.x0, raster.y0], (at) => {
    const [left, top] = at([raster.x0 - raster.dx / 2, raster.y0 + (raster.ny - 0.5) * raster.dy]);
    const [right, bottom] = at([raster.x0 + (raster.nx - 0.5) * raster.dx, raster.y0 - raster.dy / 2]);
    return [{type: "image", style: {image: groundPicture(raster), x: left, y: top, width: right - left, height: bottom - top}}];
  }, {z: 0});
}

/// A bar with the colours of the ground and what they mean, in pixels above a frame.
export function addGroundScale(option, look, raster, label, {left, top, width}) {
  const shades = 32, bar = Math.min(150, width / 3), steps = [];
  for (let i = 0; i < shades; ++i)
    steps.push({type: "rect", left: left + i * bar / shades, top, shape: {width: bar / shades + 0.5, height: 10},
                style: {fill: css(colourAt(scales.ground, i / (shades - 1)))}, silent: true});
  const text = (words, x, align) => ({type: "text", left: x, top: top - 1, silent: true,
                                      style: {text: words, fill: look.text, font: `${look.fontSize}px ${look.font}`, textAlign: align}});
  option.graphic = (option.graphic || []).concat(steps, [text(`${label}: ${number(raster.lower)} to ${number(raster.upper)}`, left + bar + 8, "left")]);
}

/// Two lines of a map: what is below is drawn wider and in the colour of the ground, so that the line is seen on any slip.
export function addTrack(option, look, frame, name, x, y, style) {
  const data = pairs(x, y);
  addLine(option, frame, name, data, {...style, color: look.halo, width: (style.width || 1.5) + 2.5, type: "solid"},
          {silent: true, legendHoverLink: false, tooltip: {show: false}, name: `${name} (edge)`, z: 2});
  addLine(option, frame, name, data, style, {z: 3});
}

/// The extent of all that a map shows.
function extent(map) {
  const xs = [map.path, map.true, map.estimated].filter(Boolean);
  return [extentOf(...xs.map((line) => line.x)), extentOf(...xs.map((line) => line.y))];
}

export function mapFigures(document) {
  const map = document.map;
  if (!map) return [];
  const rasters = map.slip && map.slip.length ? map.slip : [null];
  return rasters.map((raster) => ({
    name: raster ? `map-${raster.parameter}` : "map",
    title: raster ? `Path driven over ${raster.parameter} of the ground` : "Path driven",
    caption: raster ? `The colour is the true ${raster.parameter}; lower slips more. Both axes have the same scale.` : "Both axes have the same scale.",
    about: ["map"],
    height: (width) => mapHeight(map, width),
    option: (look, size) => mapOption(look, size, map, raster, document),
    marksPosition: true,
    table: () => mapTable(map),
  }));
}

const margins = {left: 62, right: 16, top: 58, bottom: 46};

function mapHeight(map, width) {
  const [x, y] = extent(map);
  const inner = width - margins.left - margins.right;
  const share = Math.min(Math.max((y[1] - y[0]) / Math.max(x[1] - x[0], 1e-9), 0.25), 1.1);
  return Math.round(Math.min(inner * Math.min(share * 1.06, 1.15), 640) + margins.top + margins.bottom);
}

function mapOption(look, {width, height}, map, raster) {
  const option = base(look);
  const [x, y] = extent(map);
  const grow = (range) => [range[0] - 0.04 * (range[1] - range[0]), range[1] + 0.04 * (range[1] - range[0])];
  const inner = {width: width - margins.left - margins.right, height: height - margins.top - margins.bottom};
  const axes = equalAxes(grow(x), grow(y), inner.width, inner.height);
  const frame = addFrame(option, look, {
    top: margins.top, height: inner.height, width, left: margins.left, right: margins.right,
    x: {name: "x [m]", ...axes.x, splitLine: {show: false}, axisLabel: {showMinLabel: false, showMaxLabel: false}},
    y: {name: "y [m]", ...axes.y, splitLine: {show: false}, axisLabel: {showMinLabel: false, showMaxLabel: false}},
  });
  const names = [];
  if (raster) {
    addGround(option, frame, raster);
    addGroundScale(option, look, raster, withUnit(raster.parameter, raster.unit), {left: margins.left, top: 28, width});
  }
  if (map.path) {
    addTrack(option, look, frame, "path", map.path.x, map.path.y, {color: look.reference, width: 2, type: "dashed"});
    names.push("path");
  }
  if (map.true) {
    addTrack(option, look, frame, "true track", map.true.x, map.true.y, {color: look.truth, width: 2});
    names.push("true track");
  }
  addTrack(option, look, frame, "estimated track", map.estimated.x, map.estimated.y, {color: look.estimate, width: 1.6});
  names.push("estimated track");
  addLegend(option, look, names);
  option.tooltip = {show: false};
  return option;
}

function mapTable(map) {
  const rows = [["path", map.path], ["true track", map.true], ["estimated track", map.estimated]].filter(([, line]) => line);
  return {columns: ["line", "points", "least x [m]", "largest x [m]", "least y [m]", "largest y [m]"],
          rows: rows.map(([name, line]) => [name, line.x.length, ...extentOf(line.x), ...extentOf(line.y)])};
}
