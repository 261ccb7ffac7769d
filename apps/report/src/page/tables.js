// Numbers beside a picture, folded away: made when opened, a page of rows at a time, and all of them as CSV.
import {exact, count} from "../text.js";
import {element} from "./elements.js";

const PAGE = 200;

/// {columns, rows} or {columns, parts}, the latter column by column.
export function rowCount(table) {
  return table.rows ? table.rows.length : table.parts[0].length;
}
const rowAt = (table, i) => (table.rows ? table.rows[i] : table.parts.map((part) => part[i]));

const cell = (value) => (typeof value === "number" ? element("td", {}, exact(value)) : element("td", {class: "word"}, value === null || value === undefined ? "–" : String(value)));

export function tableElement(table, first = 0, size = PAGE) {
  const last = Math.min(first + size, rowCount(table)), body = element("tbody");
  for (let i = first; i < last; ++i) body.append(element("tr", {}, ...rowAt(table, i).map(cell)));
  return element("table", {}, table.title && element("caption", {}, table.title),
                 element("thead", {}, element("tr", {}, ...table.columns.map((name) => element("th", {scope: "col"}, name)))), body);
}

const quoted = (value) => (value === null || value === undefined ? "" : /[",\n]/.test(String(value)) ? `"${String(value).replace(/"/g, '""')}"` : String(value));

function save(table, name) {
  const lines = [table.columns.map(quoted).join(",")];
  for (let i = 0; i < rowCount(table); ++i) lines.push(rowAt(table, i).map(quoted).join(","));
  const url = URL.createObjectURL(new Blob([lines.join("\n") + "\n"], {type: "text/csv"}));
  element("a", {href: url, download: `${name}.csv`}).click();
  setTimeout(() => URL.revokeObjectURL(url), 60000);  // a busy browser may not have begun to read it for a while
}

/// The folded table of a figure; `tableOf()` is asked each time it is opened or `refresh` is called.
export function foldedTable(name, tableOf) {
  const content = element("div");
  let first = 0;
  const fill = () => {
    const table = tableOf(), rows = rowCount(table);
    first = Math.min(first, Math.max(0, rows - 1));
    const turn = (by) => () => {
      first = Math.max(0, Math.min(first + by, Math.floor((rows - 1) / PAGE) * PAGE));
      fill();
    };
    const pages = rows > PAGE && element("span", {class: "controls"},
      element("button", {type: "button", onclick: turn(-PAGE)}, "Earlier rows"), element("button", {type: "button", onclick: turn(PAGE)}, "Later rows"),
      element("span", {class: "faint"}, `rows ${count(first + 1)} to ${count(Math.min(first + PAGE, rows))} of ${count(rows)}`));
    content.replaceChildren(
      element("div", {class: "scroll", tabindex: "0", role: "region", "aria-label": "Numbers of the figure"}, tableElement(table, first)),
      element("div", {class: "controls"}, element("button", {type: "button", onclick: () => save(table, name)}, "Save as CSV"), pages));
  };
  const folded = element("details", {class: "numbers"}, element("summary", {}, "Numbers"), content);
  folded.addEventListener("toggle", () => (folded.open ? fill() : content.replaceChildren()));
  folded.refresh = () => folded.open && fill();
  return folded;
}
