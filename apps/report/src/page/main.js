// Puts the page together from the document that lies in it.
import {firstState, horizonsOf, sectionsOf} from "../figures/index.js";
import {Charts} from "./charts.js";
import {element} from "./elements.js";
import {headOf} from "./head.js";
import {Scrubber} from "./scrubber.js";
import {SweepChoices} from "./sweep.js";
import {tableElement} from "./tables.js";

const report = JSON.parse(document.getElementById("document").textContent);
const looks = ["as the system", "light", "dark"];
const prefersDark = matchMedia("(prefers-color-scheme: dark)");

/// The button that goes from the system's look to light to dark, and the page's look itself.
function lookButton(charts) {
  let chosen = 0;
  const button = element("button", {type: "button", class: "only-screen", id: "look"});
  const apply = () => {
    const name = chosen === 0 ? (prefersDark.matches ? "dark" : "light") : looks[chosen];
    document.documentElement.dataset.look = name;
    button.textContent = `Look: ${looks[chosen]}`;
    charts.setLook(name);
  };
  button.addEventListener("click", () => {
    chosen = (chosen + 1) % looks.length;
    apply();
  });
  prefersDark.addEventListener("change", apply);
  apply();
  return button;
}

/// What the document says of the figures of a section: what they leave out, how they were thinned.
function notesOf(section) {
  const about = section.figures.flatMap((figure) => figure.about || []);
  const notes = report.notes.filter((note) => about.includes(note.about) && !(section.ofVariant && /^Variant /.test(note.text) && !note.text.startsWith(`Variant ${section.ofVariant}`)));
  return notes.length ? element("ul", {class: "notes"}, ...notes.map((note) => element("li", {}, note.text))) : "";
}

function sectionElement(section, charts, scrubber, choices) {
  const heading = element("h2", {}, section.title);
  const figures = element("div", {class: section.isScrubber || section.inPairs ? "figures pairs" : "figures"}, ...section.figures.map((figure) => charts.add(figure)));
  const before = [notesOf(section)];
  if (section.isScrubber) before.push(...scrubber.words());
  if (section.hasMeasure) before.push(choices.measures());
  if (section.hasTime) before.push(choices.times());
  const whole = element("section", {id: section.id, class: section.isScrubber ? "window" : null, "aria-label": section.title}, heading);
  if (!section.isFolded) {
    whole.append(...before, figures);
    return whole;
  }
  whole.append(element("details", {ontoggle: () => charts.refresh((chart) => chart.stale)}, element("summary", {}, "Show its figures"), ...before, figures));
  return whole;
}

function build() {
  document.title = `${report.title} – rhec report`;
  const state = firstState(report), charts = new Charts(report, state), sections = sectionsOf(report);
  const scrubber = horizonsOf(report) ? new Scrubber(report, charts) : null;
  const choices = report.kind === "sweep" && report.maps.length ? new SweepChoices(report, charts) : null;
  document.getElementById("head").append(...headOf(report, sections, lookButton(charts)).filter(Boolean));
  const content = document.getElementById("content");
  if (scrubber) content.append(scrubber.bar());
  else if (choices) content.append(choices.settings());
  else document.documentElement.classList.add("plain");
  content.append(...sections.map((section) => sectionElement(section, charts, scrubber, choices)));
  if (report.others && report.others.rows.length) content.append(othersElement(report.others));
  if (choices) for (const chart of charts.all) choices.attach(chart);
  if (scrubber) scrubber.show();
  charts.drawRest();
}

function othersElement(others) {
  const measures = Object.keys(others.rows[0].means);
  return element("section", {id: "others", "aria-label": "Other settings"}, element("h2", {}, "Other settings"),
    element("p", {class: "caption"}, `${others.rows.length} of ${others.total} settings that are no cell of a map; means over their completed runs.`),
    element("div", {class: "scroll", tabindex: "0", role: "region", "aria-label": "Other settings"}, tableElement({
      columns: others.keys.concat("runs", measures), rows: others.rows.map((row) => row.values.concat(row.runs, measures.map((name) => row.means[name])))})));
}

try {
  if (report.form !== "rhec report" || report.version !== 1) throw new Error(`the document is ${report.form} ${report.version}, expected rhec report 1`);
  build();
} catch (problem) {
  document.getElementById("content").append(element("p", {class: "problem"}, `This report cannot be shown: ${problem.message}`));
  throw problem;
}
