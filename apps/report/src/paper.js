// Of figures that a reader can move, which views become files: one sample of a run; of a sweep the first map, and the
// maps that differ from it in one of the main choices (path, what is blocked; of speeds the least and the largest).
import {choiceText, mainChoices, mapAt} from "./figures/sweep.js";
import {stem} from "./text.js";

const everySetting = ["surfaces", "surfaces-relative", "curves"];

/// [{name, state}] of a figure.
export function variantsForPaper(document, figure, state) {
  if (document.kind !== "sweep" || everySetting.indexOf(figure.name) < 0) return [{name: figure.name, state}];
  return settingsForPaper(document).map((setting, i) => ({name: i === 0 ? figure.name : `${figure.name}-${difference(document, setting)}`, state: {...state, setting}}));
}

function settingsForPaper(document) {
  const usual = document.maps[0].setting, settings = [usual];
  for (const choice of mainChoices(document))
    ends(document.choices[choice].values).forEach((value) => {
      const setting = usual.slice();
      setting[choice] = value;
      if (value !== usual[choice] && mapAt(document, setting)) settings.push(setting);
    });
  return settings;
}

/// Indices of all values, or of the least and the largest where they are numbers.
function ends(values) {
  const order = values.map((_, i) => i);
  if (!values.every((value) => typeof value === "number")) return order;
  order.sort((a, b) => values[a] - values[b]);
  return [order[0], order[order.length - 1]];
}

const difference = (document, setting) => document.choices
  .map((choice, i) => (setting[i] === document.maps[0].setting[i] ? null : `${choice.label}-${choiceText(choice, setting[i])}`)).filter(Boolean).map(stem).join("-");
