// Short ways to make elements of the page.

/// element("p", {class: "faint", onclick: f}, "text", other elements ...)
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return made;
}

/// A menu with a label. `entries` are [{value, text, disabled}].
export function menu(label, entries, chosen, onChange) {
  const select = element("select", {onchange: () => onChange(select.value)},
    ...entries.map(({value, text}) => element("option", {value, selected: String(value) === String(chosen)}, text)));
  return element("label", {}, element("span", {}, label), select);
}
