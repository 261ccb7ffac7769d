// Figures on the page: each in its <figure>, drawn when it comes near the window, drawn anew when its size, the look or
// the reader's choice changes.
import {init} from "../echarts.js";
import {told} from "../figures/index.js";
import {dark, light, paper} from "../look.js";
import {element} from "./elements.js";
import {foldedTable} from "./tables.js";

export class Charts {
  constructor(document, state) {
    this.document = document;
    this.state = state;
    this.look = light;
    this.all = [];
    this.watcher = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const chart = this.all.find((each) => each.box === entry.target);
        chart.near = entry.isIntersecting;
        if (chart.near && chart.stale) this.draw(chart);
      }
    }, {rootMargin: "300px"});
    let pending = 0;
    this.sizes = new ResizeObserver(() => {
      cancelAnimationFrame(pending);
      pending = requestAnimationFrame(() => this.refresh((chart) => chart.drawnWidth !== chart.box.clientWidth));
    });
    addEventListener("beforeprint", () => this.print(true));
    addEventListener("afterprint", () => this.print(false));
    matchMedia("print").addEventListener("change", (event) => this.print(event.matches));
  }

  /// The <figure> of a figure.
  add(figure) {
    const title = element("h3", {}), caption = element("p", {class: "caption"});
    const canvas = element("div"), box = element("div", {class: "chart", role: "img"}, canvas);
    const table = figure.table ? foldedTable(figure.name, () => figure.table(this.state)) : null;
    const chart = {figure, title, caption, canvas, box, table, stale: true, near: false, drawnWidth: -1, instance: null, frames: []};
    this.all.push(chart);
    const whole = element("figure", {id: `figure-${figure.name}`, "data-figure": figure.name}, title, box, caption, table);
    this.tell(chart);
    this.watcher.observe(box);
    this.sizes.observe(box);
    chart.element = whole;
    return whole;
  }

  /// Words and height of a figure as things stand.
  tell(chart) {
    const {figure} = chart, title = told(figure.title, this.state), caption = told(figure.caption, this.state);
    chart.title.textContent = title;
    chart.caption.textContent = caption;
    chart.caption.hidden = !caption;
    chart.box.setAttribute("aria-label", `Figure: ${title}. The numbers are in the table below it.`);
    if (chart.table) chart.table.refresh();
  }

  draw(chart) {
    const width = chart.box.clientWidth;
    if (width < 50) return;
    const height = Math.round(chart.figure.height(width, this.state));
    chart.box.style.height = `${height}px`;
    const size = {width, height, state: this.state, view: chart.figure.time ? this.state.view : null};
    const option = chart.figure.option(this.look, size);
    // Thousands of polygons that are being turned are quicker as pixels; all else, and all on paper, is sharper as SVG.
    const renderer = chart.figure.turns && !this.printing ? "canvas" : "svg";
    if (chart.instance && chart.renderer !== renderer) {
      chart.instance.dispose();
      chart.instance = null;
    }
    chart.renderer = renderer;
    if (!chart.instance) chart.instance = init(chart.canvas, null, {renderer, width, height});
    else if (chart.drawnWidth !== width || chart.drawnHeight !== height) chart.instance.resize({width, height});
    chart.instance.setOption(option, {notMerge: true});
    chart.frames = option.grid || [];
    chart.axis = option.xAxis && option.xAxis[0];
    chart.drawnWidth = width;
    chart.drawnHeight = height;
    chart.stale = false;
    chart.box.dataset.drawn = String(Number(chart.box.dataset.drawn || 0) + 1);
    if (this.onDrawn) this.onDrawn(chart);
  }

  /// Draws again what `which` names: at once where it is in sight, later where it is not.
  refresh(which = () => true) {
    for (const chart of this.all) {
      if (!which(chart)) continue;
      chart.stale = true;
      if (chart.near || this.printing) this.draw(chart);
    }
  }

  setState(change, which) {
    Object.assign(this.state, change);
    for (const chart of this.all) if (which(chart)) this.tell(chart);
    this.refresh(which);
  }

  setLook(name) {
    this.screenLook = name === "dark" ? dark : light;
    if (this.printing) return;
    this.look = this.screenLook;
    this.refresh();
  }

  print(on) {
    if (Boolean(this.printing) === on) return;
    this.printing = on;
    this.look = on ? paper : this.screenLook;
    this.refresh();
  }

  /// What has not been drawn yet, one at a time, when nothing else is to be done.
  drawRest() {
    const next = () => {
      const chart = this.all.find((each) => each.drawnWidth < 0 && each.box.clientWidth > 50);
      if (!chart) return;
      this.draw(chart);
      later(next);
    };
    later(next);
  }
}

const later = (what) => (window.requestIdleCallback ? requestIdleCallback(what, {timeout: 1000}) : setTimeout(what, 30));
