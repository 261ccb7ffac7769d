// Which figures a document has, in sections, in the order of the page; --svg draws the same.
import {comparisonFigures} from "./comparison.js";
import {faultFigures} from "./faults.js";
import {mapFigures} from "./map.js";
import {placeFigures} from "./place.js";
import {columnFigure, errorFigures, estimateFigures, inputFigures, statusFigure} from "./series.js";
import {hasCells, startState, sweepFigures} from "./sweep.js";
import {solveTimeFigure} from "./times.js";
import {innovationFigure, trackFigure} from "./log.js";
import {blockColours, parameterToColour, stripHeight, stripOption, stripRows, windowMapOption, windowWords} from "./window.js";
import {stem} from "../text.js";

/// [{id, title, figures}], without sections that have nothing to show.
export function sectionsOf(document) {
  const sections = {run: runSections, log: logSections, sweep: sweepSections, comparison: comparisonSections, place: placeSections, faults: faultSections}[document.kind](document);
  return sections.map((section) => ({...section, figures: section.figures.filter(Boolean)})).filter((section) => section.figures.length);
}

/// What the reader has chosen, before the reader has chosen anything.
export function firstState(document) {
  if (document.kind === "sweep" && document.maps.length) return startState(document);
  const horizons = horizonsOf(document);
  return {sample: horizons ? Math.floor(horizons.list.length / 2) : 0, view: null};
}

export const horizonsOf = (document) => {
  const horizons = document.kind === "log" ? document.variants[0] && document.variants[0].horizons : document.horizons;
  return horizons && horizons.list.length && document.model ? horizons : null;
};

function runSections(document) {
  const {states, parameters} = estimateFigures(document);
  return [
    {id: "window", title: "The horizons, sample by sample", figures: windowFigures(document), isScrubber: true},
    {id: "map", title: "Path and ground", figures: mapFigures(document), inPairs: true},
    {id: "parameters", title: "Slip: estimate and truth", figures: parameters},
    {id: "states", title: "States: estimate and truth", figures: states},
    {id: "errors", title: "Errors", figures: errorFigures(document)},
    {id: "inputs", title: "Inputs", figures: inputFigures(document)},
    {id: "solves", title: "Solves", figures: [solveTimeFigure(document), statusFigure(document)]},
  ];
}

function logSections(document) {
  const sections = [{id: "window", title: "The horizon, sample by sample", figures: windowFigures(document), isScrubber: true},
                    {id: "map", title: "Track and fixes", figures: [trackFigure(document)]},
                    {id: "inputs", title: "Inputs", figures: inputFigures(document)}];
  document.variants.forEach((variant, v) => {
    const prefix = document.variants.length > 1 ? `${stem(variant.name)}-` : "", of = document.variants.length > 1 ? ` (${variant.name})` : "";
    const source = {...variant, times: document.times};
    const {states, parameters} = estimateFigures(variant.findings ? {...document, findings: variant.findings} : document, source, prefix);
    const innovations = (variant.innovations || []).map((sensor) => innovationFigure(document, sensor, prefix));
    const residuals = variant.residuals && variant.residuals.values.some((value) => value !== null) && columnFigure(document, {
      name: `${prefix}residuals`, title: `${variant.residuals.title}${of}`, caption: variant.residuals.caption,
      about: ["fixes"], label: "distance", unit: "m", time: columnOf(document, variant.residuals.time), values: variant.residuals.values, log: true, dots: true, colour: "measured"});
    const named = (figure) => figure && {...figure, title: `${figure.title}${of}`};
    sections.push({id: `variant-${v}`, title: document.variants.length > 1 ? `Estimator ${variant.name}` : "Estimates", isFolded: v > 0, ofVariant: variant.name,
      figures: [...parameters.map(named), ...states.map(named), ...innovations.map(named), residuals, named(solveTimeFigure(document, source, prefix)), named(statusFigure(document, source, prefix))]});
  });
  return sections;
}

const columnOf = (document, time) => (Array.isArray(time) ? time : document.times[time]);

const horizonWord = ({kind}) => (kind === "log" ? "Estimation horizon" : "Horizons");

function windowFigures(document) {
  const horizons = horizonsOf(document);
  if (!horizons) return [];
  const chosen = parameterToColour(document), colourOf = blockColours(horizons, document.model.parameters.length);
  const horizon = (state) => horizons.list[state.sample];
  const hasBlocks = horizons.list.some(({rhe}) => rhe && rhe.blocks && rhe.blocks.some((blocks) => blocks.next_start !== null));
  const common = {about: ["horizons"], table: null, follows: true};
  return [
    {...common, name: "window-map", title: (state) => `${horizonWord(document)} from above, at ${horizon(state).time.toFixed(1)} s`,
     caption: () => `Thick line: the estimation horizon, ${hasBlocks ? `coloured by the blocks of ${document.model.parameters[chosen].name}; dashed inside: a partial block; crosses: starts that the overlap suppresses` : "all of it one block"}. The arrow is the vehicle; GPS is measured where its antenna is.`,
     height: (width) => Math.round(Math.min(width < 560 ? width * 1.05 : width * 0.8, 560)),
     option: (look, size) => windowMapOption(look, size, document, horizon(size.state), chosen, colourOf)},
    {...common, name: "window-strip", title: (state) => `${horizonWord(document)} along the steps, at ${horizon(state).time.toFixed(1)} s`,
     caption: () => ["Each step is a block with its value; its box is ± 2σ.", hasBlocks && "Dashed and hatched: partial. Red: a start that the overlap suppresses.", document.kind === "run" && "Dotted: the slip that the controller goes by."].filter(Boolean).join(" "),
     height: (width, state) => stripHeight(stripRows(document, horizon(state))),
     option: (look, size) => stripOption(look, size, document, horizon(size.state), colourOf),
     words: (state) => windowWords(document, horizon(state))},
  ];
}

function sweepSections(document) {
  const {surfaces, explore, pairs, speed, times} = sweepFigures(document);
  return [
    {id: "surfaces", title: document.maps.some((map) => map.is_blocking) ? "Errors over block length and overlap" : "Errors over the grid", figures: surfaces},
    {id: "explore", title: "One measure, closely", figures: explore, hasMeasure: hasCells(document)},
    {id: "pairs", title: "Pairs of the same seed", figures: pairs},
    {id: "speed", title: "By speed", figures: speed},
    {id: "times", title: "Solve times", figures: times, hasTime: true},
  ];
}

function placeSections(document) {
  return [{id: "place", title: "Slip of the ground", figures: placeFigures(document), inPairs: true}];
}

function faultSections(document) {
  const {curves, shares} = faultFigures(document);
  return [
    {id: "curves", title: "Curves of recovery", figures: curves},
    {id: "kinds", title: "How each kind ends", figures: shares},
  ];
}

function comparisonSections(document) {
  const {answers, statuses, loops} = comparisonFigures(document);
  return [
    {id: "answers", title: "The same problems, solved by each", figures: answers},
    {id: "statuses", title: "Statuses", figures: statuses},
    {id: "loops", title: "Closed loop", figures: loops},
  ];
}

/// A text that may depend on what the reader has chosen.
export const told = (text, state) => (typeof text === "function" ? text(state) : text);
