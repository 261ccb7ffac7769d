// What a reader chooses in a sweep: the setting, the measure, absolute or relative, the cell, and where from to look.
import {cellAt, cellText, choiceText, mainChoices, mapAt, measureOf, measuresOf, nearestSetting} from "../figures/sweep.js";
import {startView} from "../figures/surface.js";
import {count} from "../text.js";
import {element, menu} from "./elements.js";

/// Indices of a choice's values, numbers by size.
const inOrder = ({values}) => values.map((_, i) => i).sort((a, b) => (typeof values[a] === "number" && typeof values[b] === "number" ? values[a] - values[b] : a - b));

export class SweepChoices {
  constructor(document, charts) {
    this.document = document;
    this.charts = charts;
    this.tellCell = [];
  }

  change(change) {
    this.charts.setState(change, () => true);
    this.fill();
    this.tellCell.forEach((tell) => tell());
  }

  /// Menus of the settings, and what they leave.
  settings() {
    this.box = element("div", {class: "choices bar", role: "group", "aria-label": "Setting of the sweep"});
    this.fill();
    return this.box;
  }

  fill() {
    if (!this.box) return;
    const {document} = this, {setting} = this.charts.state, map = mapAt(document, setting);
    const focused = this.box.contains(window.document.activeElement) ? [...this.box.querySelectorAll("select")].indexOf(window.document.activeElement) : -1;
    const main = mainChoices(document);
    const menuOf = (choice, c) => choice.values.length > 1 && menu(choice.label,
      inOrder(choice).map((value) => ({value, text: `${choiceText(choice, value)}${this.fits(c, value) ? "" : " *"}`})), setting[c], (value) => this.choose(c, Number(value)));
    const shown = document.choices.map((choice, c) => main.includes(c) && menuOf(choice, c)).filter(Boolean);
    const others = document.choices.map((choice, c) => !main.includes(c) && menuOf(choice, c)).filter(Boolean);
    const wasOpen = this.others && this.others.open;
    this.others = others.length ? element("details", {open: wasOpen}, element("summary", {}, "Other settings"), element("div", {class: "controls"}, ...others)) : null;
    const runs = map.runs.reduce((sum, row) => sum + row.reduce((a, b) => a + b, 0), 0);
    const starred = [...shown, ...others].some((each) => each.textContent.includes(" *"));
    this.box.replaceChildren(element("div", {class: "controls"}, ...shown), ...(this.others ? [this.others] : []),
      element("p", {class: "caption", role: "status"}, `${count(runs)} completed runs over ${map.axes.filter(Boolean).map((axis) => `${axis.values.length} values of ${axis.label}`).join(" and ")}.${starred ? " * changes other settings too, as the sweep has not all combinations." : ""}`));
    if (focused >= 0) this.box.querySelectorAll("select")[focused].focus();
  }

  /// Whether there is a map for a value of one choice with all others left as they are.
  fits(choice, value) {
    const wanted = this.charts.state.setting.slice();
    wanted[choice] = value;
    return Boolean(mapAt(this.document, wanted));
  }

  choose(choice, value) {
    const wanted = this.charts.state.setting.slice();
    wanted[choice] = value;
    const setting = nearestSetting(this.document, wanted, choice), before = mapAt(this.document, this.charts.state.setting), after = mapAt(this.document, setting);
    const {cell} = this.charts.state;
    const kept = after.axes.map((axis, a) => (axis && before.axes[a] ? Math.max(0, axis.values.indexOf(before.axes[a].values[cell[a]])) : 0));
    this.change({setting, cell: kept});
  }

  measures() {
    const entries = (groups) => measuresOf(this.document, groups).map((measure) => ({value: measure.name, text: measure.label}));
    const toggle = element("button", {type: "button", "aria-pressed": String(this.charts.state.relative), onclick: () => {
      this.change({relative: !this.charts.state.relative});
      toggle.setAttribute("aria-pressed", String(this.charts.state.relative));
    }}, "Relative to full-horizon blocking");
    return element("div", {class: "controls only-screen"},
      menu("Measure", entries(["mae", "mae_after_start", "rmse", "other"]), this.charts.state.measure, (measure) => this.change({measure})),
      this.document.maps.some((map) => map.reference) && toggle);
  }

  times() {
    const entries = measuresOf(this.document, ["time"]).map((measure) => ({value: measure.name, text: measure.label}));
    return element("div", {class: "controls only-screen"}, menu("Time", entries, this.charts.state.time, (time) => this.change({time})));
  }

  /// Keys and pointer for a figure that can be turned, or whose cells can be chosen.
  attach(chart) {
    const {box, figure} = chart, state = this.charts.state;
    if (figure.turns) {
      const turn = (dx, dy) => {
        Object.assign(state, {turn: ((state.turn + dx + 540) % 360) - 180, tilt: Math.min(Math.max(state.tilt + dy, 4), 86)});
        this.turned(chart);
      };
      this.focusable(chart, "Arrow keys turn it, Home puts it back");
      box.addEventListener("keydown", (event) => {
        const by = {ArrowLeft: [6, 0], ArrowRight: [-6, 0], ArrowUp: [0, 4], ArrowDown: [0, -4]}[event.key];
        if (by) turn(...by);
        else if (event.key === "Home") turn(startView.turn - state.turn, startView.tilt - state.tilt);
        else return;
        event.preventDefault();
      });
      let from = null;
      box.style.touchAction = "pan-y";
      box.style.cursor = "grab";
      box.addEventListener("pointerdown", (event) => {
        from = [event.clientX, event.clientY];
        box.setPointerCapture(event.pointerId);
      });
      box.addEventListener("pointermove", (event) => {
        if (!from) return;
        turn((from[0] - event.clientX) * 0.4, (event.clientY - from[1]) * 0.3);
        from = [event.clientX, event.clientY];
      });
      for (const end of ["pointerup", "pointercancel"]) box.addEventListener(end, () => (from = null));
    }
    if (figure.picksCell) {
      this.focusable(chart, "Arrow keys move the chosen cell");
      const map = () => mapAt(this.document, state.setting);
      const words = element("p", {class: "caption", role: "status"}), pickMeasure = () => (figure.name === "time-heat" ? state.time : state.measure);
      this.tellCell.push(() => (words.textContent = this.wordsOf(map(), pickMeasure())));
      const pick = (cell) => {
        this.charts.setState({cell}, (other) => !other.figure.turns);
        this.tellCell.forEach((tell) => tell());
      };
      box.addEventListener("click", (event) => {
        const {left, top} = box.getBoundingClientRect();
        const cell = cellAt(map(), {width: chart.drawnWidth, height: chart.drawnHeight}, event.clientX - left, event.clientY - top);
        if (cell) pick(cell);
      });
      box.addEventListener("keydown", (event) => {
        const by = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key];
        if (!by) return;
        const lengths = map().axes.map((axis) => (axis ? axis.values.length : 1));
        pick(state.cell.map((at, a) => Math.min(Math.max(at + by[a], 0), lengths[a] - 1)));
        event.preventDefault();
      });
      chart.box.after(words);
      this.tellCell.forEach((tell) => tell());
    }
  }

  /// Draws the surface under the reader's hand once a frame, the others when the hand rests.
  turned(chart) {
    cancelAnimationFrame(this.frame);
    clearTimeout(this.rest);
    this.frame = requestAnimationFrame(() => this.charts.draw(chart));
    this.rest = setTimeout(() => this.charts.refresh((other) => other.figure.turns && other !== chart), 200);
  }

  wordsOf(map, measure) {
    const {cell} = this.charts.state, [i, j] = cell, described = measureOf(this.document, measure);
    const value = map.means[measure] && map.means[measure][i][j];
    return `Chosen: ${cellText(map, cell)}: ${described.label} ${value === null || value === undefined ? "not known" : `${value.toPrecision(5)}${described.unit === "1" ? "" : ` ${described.unit}`}`}, ${map.runs[i][j]} runs.`;
  }

  focusable({box, element: whole}, words) {
    box.tabIndex = 0;
    box.setAttribute("role", "application");
    box.setAttribute("aria-description", words);
    whole.querySelector(".caption").before(element("p", {class: "caption only-screen"}, `${words}${words.includes("turn") ? "; so does dragging" : "; so does a click"}.`));
  }
}
