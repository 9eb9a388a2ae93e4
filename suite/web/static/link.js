// Plots linked over time: one cursor, one marked interval and one zoom for all of them, by pointer and by keys.

import { at, digits } from "./dom.js";
import { on, state, tell } from "./store.js";

/* global Plotly */

const charts = []; // {chart, over: "time"|"points", samples: () => {t, x, y}, zooms}
let time = null; // where the cursor stands
let zooming = false;
let drag = null;
export let zoom = null; // [t0, t1] or null: all

/**
 * Links a chart. `samples()` gives aligned {t, x, y} of what is drawn; on a time axis x is t itself.
 * `overTime()` says whether the x axis is time.
 */
export function link(chart, samples, overTime = () => true) {
  const entry = { chart, samples, overTime };
  charts.push(entry);
  const plot = chart.plot;
  chart.resized = () => place(entry);
  plot.addEventListener("pointermove", (event) => moved(entry, event));
  plot.addEventListener("pointerleave", () => drag || cursorTo(null));
  plot.addEventListener("pointerdown", (event) => pressed(entry, event));
  plot.addEventListener("pointerup", (event) => released(entry, event));
  plot.addEventListener("pointercancel", () => (drag = null));
  plot.addEventListener("dblclick", showAll);
  plot.addEventListener("keydown", (event) => key(entry, event));
  plot.addEventListener("blur", () => cursorTo(null));
}

function nearest(values, wanted) {
  let best = -1;
  let distance = Infinity;
  for (let k = 0; k < values.length; k += 1) {
    const d = Math.abs(values[k] - wanted);
    if (values[k] !== null && d < distance) [best, distance] = [k, d];
  }
  return best;
}

/** The time under the pointer: read off a time axis, else of the sample drawn nearest to it. */
function under(entry, event) {
  const box = entry.chart.plot.getBoundingClientRect();
  const [px, py] = [event.clientX - box.left, event.clientY - box.top];
  const { left, right, top, bottom } = entry.chart.frame();
  if (px < left - 8 || px > right + 8 || py < top - 8 || py > bottom + 8) return null;
  if (entry.overTime()) return entry.chart.value(Math.min(Math.max(px, left), right));
  const { t, x, y } = entry.samples();
  let best = -1;
  let distance = 30 ** 2;
  for (let k = 0; k < t.length; k += 1) {
    if (x[k] === null || y[k] === null) continue;
    const d = (entry.chart.pixel("xaxis", x[k]) - px) ** 2 + (entry.chart.pixel("yaxis", y[k]) - py) ** 2;
    if (d < distance) [best, distance] = [k, d];
  }
  return best < 0 ? null : t[best];
}

function moved(entry, event) {
  if (!entry.chart.drawn) return;
  const t = under(entry, event);
  if (drag && t !== null) {
    drag.t1 = t;
    preview(entry);
  }
  cursorTo(t);
}

function pressed(entry, event) {
  if (!entry.chart.drawn || event.button !== 0 || !entry.overTime()) return;
  const t = under(entry, event);
  if (t === null) return;
  drag = { t0: t, t1: t, x: event.clientX };
  entry.chart.plot.setPointerCapture(event.pointerId);
}

function released(entry, event) {
  if (!drag) return;
  const { t0, t1, x } = drag;
  drag = null;
  if (Math.abs(event.clientX - x) < 4) return mark(null);
  const range = t0 < t1 ? [t0, t1] : [t1, t0];
  if (zooming) {
    mark(state.interval);
    zoomTo(range);
  } else mark(range);
}

function preview(entry) {
  const range = [Math.min(drag.t0, drag.t1), Math.max(drag.t0, drag.t1)];
  if (zooming) strip(entry, range);
  else for (const other of charts) strip(other, range);
}

/** Marks an interval in all plots; null takes the mark away. */
export function mark(range) {
  state.interval = range;
  for (const entry of charts) strip(entry, range);
  tell("interval");
}

export function zoomTo(range) {
  zoom = range;
  for (const { chart, overTime } of charts) {
    if (!chart.drawn || !overTime()) continue;
    Plotly.relayout(chart.canvas, range ? { "xaxis.range": range } : { "xaxis.autorange": true }).then(chart.resized);
    chart.wanted.layout.xaxis.range = range ?? undefined;
    chart.wanted.layout.xaxis.autorange = !range;
  }
}

export function showAll() {
  mark(null);
  zoomTo(null);
}

function strip(entry, range) {
  const { chart, overTime } = entry;
  chart.mark.hidden = !range || !chart.drawn || !overTime();
  if (chart.mark.hidden) return;
  const { left, right, top, bottom } = chart.frame();
  const [a, b] = range.map((t) => Math.min(Math.max(chart.pixel("xaxis", t), left), right));
  Object.assign(chart.mark.style, { left: `${a}px`, width: `${b - a}px`, top: `${top}px`, height: `${bottom - top}px` });
}

function place(entry) {
  const { chart, overTime, samples } = entry;
  strip(entry, state.interval);
  chart.cursor.hidden = time === null || !chart.drawn || !overTime();
  chart.point.hidden = time === null || !chart.drawn || overTime();
  if (time === null || !chart.drawn) return;
  const { left, right, top, bottom } = chart.frame();
  if (overTime()) {
    const x = chart.pixel("xaxis", time);
    chart.cursor.hidden = x < left - 1 || x > right + 1;
    Object.assign(chart.cursor.style, { left: `${x}px`, top: `${top}px`, height: `${bottom - top}px` });
    return;
  }
  const { t, x, y } = samples();
  const k = nearest(t, time);
  chart.point.hidden = k < 0 || x[k] === null || y[k] === null;
  if (!chart.point.hidden)
    Object.assign(chart.point.style, { left: `${chart.pixel("xaxis", x[k])}px`, top: `${chart.pixel("yaxis", y[k])}px` });
}

function cursorTo(t) {
  time = t;
  for (const entry of charts) place(entry);
  document.dispatchEvent(new CustomEvent("cursor", { detail: t }));
}

/** Arrow keys move the cursor (with Shift they mark), + and - zoom, 0 or Escape shows all. */
function key(entry, event) {
  const { t } = entry.samples();
  if (!t.length || event.ctrlKey || event.metaKey || event.altKey) return;
  const known = ["ArrowLeft", "ArrowRight", "Home", "End", "+", "-", "0", "Escape"];
  if (!known.includes(event.key)) return;
  event.preventDefault();
  const last = t.length - 1;
  if (event.key === "0" || event.key === "Escape") return showAll();
  if (event.key === "+" || event.key === "-") return zoomBy(event.key === "+" ? 0.5 : 2, t);
  const here = time === null ? -1 : nearest(t, time);
  const stride = Math.max(1, Math.round(t.length / 100));
  const step = { ArrowLeft: -stride, ArrowRight: stride }[event.key];
  const next = event.key === "Home" ? 0 : event.key === "End" ? last : Math.min(Math.max(here + step, 0), last);
  if (event.shiftKey) {
    const from = state.interval ? (state.interval[0] === time ? state.interval[1] : state.interval[0]) : (time ?? t[next]);
    mark([Math.min(from, t[next]), Math.max(from, t[next])]);
  }
  cursorTo(t[next]);
}

function zoomBy(factor, t) {
  const [first, last] = [t[0], t[t.length - 1]];
  const [a, b] = zoom ?? [first, last];
  const middle = time ?? (a + b) / 2;
  const range = [Math.max(middle - factor * (middle - a), first), Math.min(middle + factor * (b - middle), last)];
  zoomTo(range[0] <= first && range[1] >= last ? null : range);
}

function dragging(zooms) {
  zooming = zooms;
  at("drag-zoom").setAttribute("aria-pressed", String(zooms));
  at("drag-mark").setAttribute("aria-pressed", String(!zooms));
}

at("drag-mark").addEventListener("click", () => dragging(false));
at("drag-zoom").addEventListener("click", () => dragging(true));
at("show-all").addEventListener("click", showAll);
on("step", () => {
  time = null;
  mark(state.interval);
});

/** The value at a time in a trace {t, y}, as text. */
export function valueAt(trace, t) {
  const k = nearest(trace.t, t);
  return k < 0 ? "–" : digits(trace.y[k]);
}
