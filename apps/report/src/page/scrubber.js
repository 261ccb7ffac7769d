// The bar that goes through the samples of a run, by pointer, by keys, by itself.
import {horizonsOf} from "../figures/index.js";
import {windowTables} from "../figures/window.js";
import {seconds} from "../text.js";
import {element, menu} from "./elements.js";
import {tableElement} from "./tables.js";

const views = [["whole", "whole run"], ["10", "± 10 s"], ["30", "± 30 s"], ["120", "± 120 s"]];
const still = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

export class Scrubber {
  constructor(document, charts) {
    this.document = document;
    this.charts = charts;
    this.horizons = horizonsOf(document);
    this.last = this.horizons.list.length - 1;
    this.halfView = null;
    charts.onDrawn = (chart) => this.mark(chart);
  }

  /// The bar with its controls.
  bar() {
    this.slider = element("input", {type: "range", id: "scrubber", min: 0, max: this.last, step: 1, value: this.charts.state.sample,
      "aria-label": "Sample of the run", oninput: () => this.go(Number(this.slider.value)), onkeydown: (event) => this.key(event)});
    this.output = element("output", {for: "scrubber"});
    this.player = element("button", {type: "button", "aria-pressed": "false", onclick: () => this.play(!this.timer)}, "Play");
    const step = (by, sign, words) => element("button", {type: "button", "aria-label": words, title: words, onclick: () => this.go(this.charts.state.sample + by)}, sign);
    return element("div", {class: "bar", role: "group", "aria-label": "Scrubber", onkeydown: (event) => this.key(event)},
      element("div", {class: "row"}, step(-1, "‹", "One sample back"), this.slider, step(1, "›", "One sample on"), this.output),
      element("div", {class: "controls only-screen"}, this.player,
        menu("Time axes", views.map(([value, text]) => ({value, text})), "whole", (value) => {
          this.halfView = value === "whole" ? null : Number(value);
          this.go(this.charts.state.sample, true);
        }),
        element("span", {class: "faint keys"}, "Keys: ← → one sample, with Shift ten, Home, End, space plays")));
  }

  /// What is shown, in words and in tables.
  words() {
    this.sentence = element("p", {class: "words", id: "sample-words"});
    this.live = element("p", {class: "unseen", role: "status", "aria-live": "polite"});
    this.tables = element("div");
    this.folded = element("details", {class: "numbers", id: "sample-numbers"}, element("summary", {}, "Numbers of this sample"), this.tables);
    this.folded.addEventListener("toggle", () => this.fillTables());
    return [this.sentence, this.live, this.folded];
  }

  key(event) {
    const by = event.shiftKey ? 10 : 1, at = this.charts.state.sample;
    const target = {ArrowRight: at + by, ArrowUp: at + by, ArrowLeft: at - by, ArrowDown: at - by, PageUp: at + 10, PageDown: at - 10, Home: 0, End: this.last}[event.key];
    if (event.target.tagName === "SELECT" || event.altKey || event.ctrlKey || event.metaKey) return;
    if (target !== undefined) this.go(target);
    else if (event.key === " " && event.target === this.slider) this.play(!this.timer);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  go(sample, force = false) {
    const to = Math.min(Math.max(Math.round(sample), 0), this.last);
    const horizon = this.horizons.list[to], moved = to !== this.charts.state.sample;
    if (!moved && !force) return;
    const view = this.halfView === null ? null : [horizon.time - this.halfView, horizon.time + this.halfView];
    const viewChanged = force || this.halfView !== null;
    this.charts.setState({sample: to, view}, (chart) => chart.figure.follows || (viewChanged && chart.figure.time));
    this.show();
  }

  /// The sample at a time of the run, for whoever clicks into a figure over time.
  goToTime(time) {
    let best = 0;
    this.horizons.list.forEach((horizon, i) => {
      if (Math.abs(horizon.time - time) < Math.abs(this.horizons.list[best].time - time)) best = i;
    });
    this.go(best);
  }

  show() {
    const at = this.charts.state.sample, horizon = this.horizons.list[at];
    this.slider.value = at;
    this.slider.setAttribute("aria-valuetext", `sample ${horizon.sample}, ${seconds(horizon.time)} seconds`);
    this.output.textContent = `k = ${horizon.sample}, ${horizon.time.toFixed(1)} s`;
    const strip = this.charts.all.find((chart) => chart.figure.words);
    this.sentence.textContent = strip.figure.words(this.charts.state);
    if (!this.timer) this.live.textContent = this.sentence.textContent;
    this.fillTables();
    for (const chart of this.charts.all) this.mark(chart);
  }

  fillTables() {
    if (!this.folded.open) return this.tables.replaceChildren();
    const horizon = this.horizons.list[this.charts.state.sample];
    this.tables.replaceChildren(...windowTables(this.document, horizon).map((table) =>
      element("div", {class: "scroll", tabindex: "0", role: "region", "aria-label": table.title}, tableElement(table))));
    return undefined;
  }

  play(on) {
    clearInterval(this.timer);
    this.timer = null;
    if (on) {
      if (this.charts.state.sample >= this.last) this.go(0);
      this.timer = setInterval(() => {
        if (this.charts.state.sample >= this.last) this.play(false);
        else this.go(this.charts.state.sample + 1);
      }, still() ? 1000 : 120);
    }
    this.player.setAttribute("aria-pressed", String(on));
    this.player.textContent = on ? "Pause" : "Play";
    if (!on && this.sentence) this.live.textContent = this.sentence.textContent;
  }

  /// A line in figures over time, a ring in maps, where the sample is. Moved, not drawn anew: that is what keeps it quick.
  mark(chart) {
    if (chart.drawnWidth < 0 || !this.slider) return;
    const {figure} = chart, horizon = this.horizons.list[this.charts.state.sample];
    if (figure.time) {
      if (!chart.cursor) {
        chart.cursor = element("div", {class: "cursor only-screen"});
        chart.box.append(chart.cursor);
        chart.box.addEventListener("click", (event) => {
          const {left} = chart.box.getBoundingClientRect();
          const [time] = chart.instance.convertFromPixel({gridIndex: 0}, [event.clientX - left, chart.frames[0].top + 5]);
          if (Number.isFinite(time)) this.goToTime(time);
        });
      }
      const {left, width, top} = chart.frames[0], bottom = chart.frames[chart.frames.length - 1];
      const share = (horizon.time - chart.axis.min) / (chart.axis.max - chart.axis.min);
      chart.cursor.hidden = !(share >= 0 && share <= 1);
      Object.assign(chart.cursor.style, {left: `${left + share * width - 0.75}px`, top: `${top}px`, height: `${bottom.top + bottom.height - top}px`});
    } else if (figure.marksPosition) {
      if (!chart.place) {
        chart.place = element("div", {class: "place only-screen"});
        chart.box.append(chart.place);
      }
      const {rhe, rhc} = horizon, {position_x, position_y} = this.document.model.roles;
      const state = rhe ? rhe.state.map((column) => column[column.length - 1]) : rhc.state.map((column) => column[0]);
      const [x, y] = chart.instance.convertToPixel({gridIndex: 0}, [state[position_x], state[position_y]]);
      Object.assign(chart.place.style, {left: `${x}px`, top: `${y}px`});
    }
  }
}
