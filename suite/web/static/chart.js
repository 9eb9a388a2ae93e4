// One plot: its place in a panel, its numbers as text, and where a value lies on it.

import { at, make } from "./dom.js";
import { showNumbers } from "./numbers.js";

/* global Plotly */

const OPTIONS = { displayModeBar: false, responsive: false, scrollZoom: false, doubleClick: false };

export class Chart {
  /** A plot in the panel of this id; `title` names it for ears and for its numbers. */
  constructor(panel, title) {
    this.panel = typeof panel === "string" ? at(panel) : panel;
    this.title = title;
    this.canvas = make("div", { class: "canvas" });
    this.cursor = make("div", { class: "cursor", hidden: true });
    this.point = make("div", { class: "point", hidden: true });
    this.mark = make("div", { class: "mark", hidden: true });
    this.over = make("div", { class: "over", "aria-hidden": "true" }, this.mark, this.cursor, this.point);
    this.plot = make("div", { class: "plot", role: "img", tabindex: "0" }, this.canvas, this.over);
    this.button = make("button", { type: "button", class: "numbers", onclick: () => this.numbers() }, "Numbers");
    this.button.setAttribute("aria-label", `Numbers of the plot: ${title}`);
    this.panel.querySelector(".panel-head").append(this.button);
    this.panel.append(this.plot);
    this.drawn = false;
    this.resized = () => {};
    new ResizeObserver(() => this.fit()).observe(this.plot);
  }

  /** Draws; `said` is the plot in a sentence, `table` a function that gives {head: [], rows: [[]]}. */
  async draw(traces, layout, said, table) {
    this.said = said;
    this.table = table;
    this.plot.setAttribute("aria-label", `${this.title}. ${said}`);
    this.wanted = { traces, layout };
    if (this.plot.clientWidth < 40 || this.plot.clientHeight < 40) return;
    layout.width = this.plot.clientWidth;
    layout.height = this.plot.clientHeight;
    await Plotly.react(this.canvas, traces, layout, OPTIONS);
    this.drawn = true;
    this.resized();
  }

  /** Draws again where the panel has another size, or was hidden when it was drawn first. */
  fit() {
    if (!this.wanted) return;
    const { traces, layout } = this.wanted;
    const same = layout.width === this.plot.clientWidth && layout.height === this.plot.clientHeight;
    if (!same || !this.drawn) this.draw(traces, layout, this.said, this.table);
  }

  numbers() {
    if (this.table) showNumbers(this.title, this.said, this.table());
  }

  axis(name) {
    return this.canvas._fullLayout?.[name];
  }

  /** The pixel of a value along the axis "xaxis" or "yaxis", within the plot. */
  pixel(name, value) {
    const axis = this.axis(name);
    const [low, high] = axis.range;
    const share = (value - low) / (high - low);
    return axis._offset + axis._length * (name === "yaxis" ? 1 - share : share);
  }

  /** The value under a pixel along the x axis. */
  value(x) {
    const axis = this.axis("xaxis");
    const [low, high] = axis.range;
    return low + ((x - axis._offset) / axis._length) * (high - low);
  }

  /** The frame of the axes in pixels. */
  frame() {
    const x = this.axis("xaxis");
    const y = this.axis("yaxis");
    return { left: x._offset, right: x._offset + x._length, top: y._offset, bottom: y._offset + y._length };
  }
}
