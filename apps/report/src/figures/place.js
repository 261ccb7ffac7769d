// A map of slip that an estimator has left: what it found at each place, and how sure it was.
import {addFrame, base, equalAxes} from "./parts.js";
import {addGround, addGroundScale} from "./map.js";
import {number, withUnit} from "../text.js";

const margins = {left: 62, right: 16, top: 58, bottom: 46};
const words = {mean: "mean", sigma: "standard deviation"};

const extent = (raster) => [[raster.x0 - raster.dx, raster.x0 + raster.nx * raster.dx], [raster.y0 - raster.dy, raster.y0 + raster.ny * raster.dy]];

function height(raster, width) {
  const [x, y] = extent(raster), inner = width - margins.left - margins.right;
  const share = Math.min(Math.max((y[1] - y[0]) / Math.max(x[1] - x[0], 1e-9), 0.25), 1.3);
  return Math.round(Math.min(inner * share, 640) + margins.top + margins.bottom);
}

function option(look, size, raster) {
  const all = base(look), [x, y] = extent(raster);
  const inner = {width: size.width - margins.left - margins.right, height: size.height - margins.top - margins.bottom};
  const axes = equalAxes(x, y, inner.width, inner.height);
  const frame = addFrame(all, look, {
    top: margins.top, height: inner.height, width: size.width, left: margins.left, right: margins.right,
    x: {name: "x [m]", ...axes.x, splitLine: {show: false}, axisLabel: {showMinLabel: false, showMaxLabel: false}},
    y: {name: "y [m]", ...axes.y, splitLine: {show: false}, axisLabel: {showMinLabel: false, showMaxLabel: false}},
  });
  addGround(all, frame, raster);
  addGroundScale(all, look, raster, `${withUnit(raster.parameter, raster.unit)}, ${words[raster.quantity]}`, {left: margins.left, top: 28, width: size.width});
  all.tooltip = {show: false};
  return all;
}

export function placeFigures(document) {
  return document.rasters.map((raster) => ({
    name: `${raster.parameter}-${raster.quantity}`,
    title: raster.quantity === "mean" ? `${raster.parameter} of the ground` : `How sure that is: standard deviation of ${raster.parameter}`,
    caption: raster.quantity === "mean" ? "What was found at each place; grey: not visited. Both axes have the same scale." : "Dark: well known; light: little known.",
    about: ["place"],
    height: (width) => height(raster, width),
    option: (look, size) => option(look, size, raster),
    table: () => ({columns: ["quantity", "least", "largest", "cells known"],
                   rows: [[`${raster.parameter}, ${words[raster.quantity]}`, number(raster.lower), number(raster.upper), raster.values.filter((value) => value !== null).length]]}),
  }));
}
