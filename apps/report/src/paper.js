// Of figures that a reader can move, which views become files: one sample of a run; of a sweep the richest map, and the
// maps that differ from it in one of the main choices (path, speed, what is blocked).
import {mainChoices, mapAt, richestMap} from "./figures/sweep.js";
import {stem} from "./text.js";

const everySetting = ["surfaces", "surfaces-relative", "curves"];

/// [{name, state}] of a figure.
export function variantsForPaper(document, figure, state) {
  if (document.kind !== "sweep" || everySetting.indexOf(figure.name) < 0) return [{name: figure.name, state}];
  return settingsForPaper(document).map((setting, i) => ({name: i === 0 ? figure.name : `${figure.name}-${difference(document, setting)}`, state: {...state, setting}}));
}

function settingsForPaper(document) {
  const usual = richestMap(document).setting, settings = [usual];
  for (const choice of mainChoices(document))
    document.choices[choice].values.forEach((_, value) => {
      const setting = usual.slice();
      setting[choice] = value;
      if (value !== usual[choice] && mapAt(document, setting)) settings.push(setting);
    });
  return settings;
}

const difference = (document, setting) => document.choices
  .map((choice, i) => (setting[i] === richestMap(document).setting[i] ? null : `${choice.label}-${choice.values[setting[i]]}`)).filter(Boolean).map(stem).join("-");
