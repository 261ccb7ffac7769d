// Of figures that a reader can move, which views become files: all settings of a sweep, one sample of a run.

/// [{name, state}] of a figure.
export function variantsForPaper(document, figure, state) {
  if (document.kind !== "sweep") return [{name: figure.name, state}];
  const many = figure.name === "surfaces" || figure.name === "surfaces-relative" || figure.name === "curves";
  const settings = many ? document.maps.map((map) => map.setting) : [state.setting];
  return settings.map((setting) => ({name: many && settings.length > 1 ? `${figure.name}-${settingStem(document, setting)}` : figure.name,
                                     state: {...state, setting}}));
}

const settingStem = (document, setting) => document.choices
  .map((choice, i) => (choice.values.length > 1 ? `${choice.label}-${choice.values[setting[i]]}` : null)).filter(Boolean)
  .join("-").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "");
