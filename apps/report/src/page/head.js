// The head of the page: what was reported, the numbers that matter most, the contents.
import {count, exact, number} from "../text.js";
import {element} from "./elements.js";
import {tableElement} from "./tables.js";

const errorUnits = {position: "m", tracking: "m", heading: "rad"};

/// [[name, value], ...] for the tiles.
function highlights(document) {
  const {summary} = document;
  if (document.kind === "run") {
    const errors = Object.keys(summary.mae || {}).map((key) => [`mean error, ${key}`, summary.mae[key] === null ? "–" : `${number(summary.mae[key])}${errorUnits[key] ? ` ${errorUnits[key]}` : ""}`]);
    const certainty = summary.certainty ? [["NEES", `${number(summary.nees)}, ${count(summary.nees_expected)} expected`], ["the estimator is", summary.certainty === "right" ? "as certain as it should be" : summary.certainty]] : [];
    return [["samples", count(summary.steps)], ["end of the path", summary.completed ? "reached" : "not reached"], ...errors, ...certainty,
            ["fallbacks", `${count(summary.fallbacks)} of ${count(summary.solves)} solves`]];
  }
  if (document.kind === "sweep") {
    const {runs, seeds} = document;
    return [["runs", count(runs.total)], ["completed", count(runs.completed)], ["not completed", count(runs.not_completed)], ["refused or failed", count(runs.refused + runs.failed)],
            ["seeds", `${seeds.count}`], ["settings", count(document.maps.length)]];
  }
  if (document.kind === "comparison") {
    const {comparison} = document, same = comparison.same_problems || {};
    return [["scenario", comparison.scenario], ["solvers", count(comparison.solvers.length)], ["seeds", count(comparison.seeds.length)],
            ...["rhe", "rhc"].filter((kind) => same[kind]).map((kind) => [`problems, ${kind.toUpperCase()}`, count(same[kind].problems)]),
            ["all answers usable", comparison.all_usable ? "yes" : "no"]];
  }
  if (document.kind === "place")
    return [["cells", count(document.cells)], ["visits a cell", number(document.visits)], ["observations a cell", number(document.observations)], ["first to last visit", `${number(document.seconds)} s`]];
  if (document.kind === "faults") {
    const {campaign} = document;
    return [["estimates", count(campaign.steps)], ["drives", count(campaign.drives)], ["kinds of faults", count(campaign.kinds.length)], ["estimators", campaign.estimators.join(", ")],
            ["vehicles", campaign.vehicles.join(", ")], ["not reached", `${count(campaign.missed.length)} of ${count(campaign.figures)} figures`]];
  }
  const variants = document.variants.map((variant) => variant.name);
  return [["fixes", document.fixes ? count(document.fixes.total) : "–"], ["gaps without a fix", document.gaps ? count(document.gaps.length) : "–"], ["estimators", variants.join(", ")]];
}

/// All of an object as rows [key, value], keys joined by dots.
export function flat(value, prefix = "") {
  if (value === null || typeof value !== "object") return [[prefix, value]];
  if (Array.isArray(value) && value.every((each) => each === null || typeof each !== "object")) return [[prefix, value.map(exact).join(", ")]];
  return Object.keys(value).reduce((rows, key) => rows.concat(flat(value[key], prefix ? `${prefix}.${key}` : key)), []);
}

const folded = (words, object) => object && element("details", {class: "numbers"}, element("summary", {}, words),
  element("div", {class: "scroll", tabindex: "0", role: "region", "aria-label": words}, tableElement({columns: ["key", "value"], rows: flat(object)}, 0, 1e6)));

export function headOf(document, sections, lookButton) {
  const others = document.notes;
  return [
    element("div", {class: "top"}, element("div", {}, element("h1", {}, document.title), element("p", {}, document.subtitle || ""),
      element("p", {class: "faint"}, `${document.source} · ${document.program}`)), lookButton),
    element("dl", {class: "tiles"}, ...highlights(document).map(([name, value]) => element("div", {}, element("dt", {}, name), element("dd", {}, value)))),
    folded("All numbers of the summary", document.summary), folded("Settings", document.settings && flatSettings(document.settings)),
    others.length ? element("details", {open: others.length < 5}, element("summary", {}, `What was left out or thinned (${others.length})`),
                            element("ul", {class: "notes"}, ...others.map((note) => element("li", {}, `${note.about}: ${note.text}`)))) : null,
    element("nav", {"aria-label": "Contents"}, ...sections.map((section) => element("a", {href: `#${section.id}`}, section.title))),
  ];
}

function flatSettings(settings) {
  const {blocking, ...rest} = settings;
  return {...rest, ...(blocking ? {blocking: blocking.reduce((all, each) => (each ? {...all, [each.parameter]: each.text} : all), {})} : {})};
}
