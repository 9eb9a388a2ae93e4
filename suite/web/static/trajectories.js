// A cell of the benchmark opened: its true and estimated states and model errors over time.

import { Refused, stream } from "./api.js";
import { Chart } from "./chart.js";
import { digits, make, withUnit } from "./dom.js";
import { colours, faint, layout } from "./theme.js";

const BAND95 = 1.96;
let running = null;

/** Runs the cell again and draws it into `place`; another click ends the first. */
export async function showCell(key, place) {
  running?.abort();
  const mine = (running = new AbortController());
  place.hidden = false;
  const said = make("p", { class: "quiet pad", role: "status" }, "Running this cell again …");
  place.replaceChildren(said);
  place.scrollIntoView({ block: "nearest" });
  try {
    const result = await stream(`api/bench/cell?key=${encodeURIComponent(key)}`, { signal: mine.signal }, ({ progress }) => (said.textContent = progress));
    if (running === mine) draw(result, place);
  } catch (error) {
    if (error.name === "AbortError") return;
    if (!(error instanceof Refused)) throw error;
    place.replaceChildren(make("p", { class: "trouble pad", role: "alert" }, error.message));
  }
}

function draw(result, place) {
  const outputs = new Map(result.outputs.map((one) => [one.name, one.measured]));
  const panels = [
    ...result.states.map((one) => ({ ...one, title: withUnit(one.name, one.unit), measured: outputs.get(one.name) })),
    ...result.d.map((one) => ({ ...one, title: `model error d in ${one.name}` })),
  ].map((one) => ({ one, panel: make("section", { class: "panel" }, make("div", { class: "panel-head" }, make("h3", {}, one.title))) }));
  place.replaceChildren(make("h3", { class: "cell-title" }, result.title), make("div", { class: "cells" }, ...panels.map(({ panel }) => panel)));
  for (const { one, panel } of panels) trajectory(new Chart(panel, one.title), one, result.t);
  place.scrollIntoView({ block: "nearest" });
}

function trajectory(chart, one, t) {
  const c = colours();
  const traces = [];
  if (one.sd) {
    const known = t.map((_, k) => k).filter((k) => one.estimate[k] !== null && one.sd[k] !== null);
    const edge = (sign) => known.map((k) => one.estimate[k] + sign * BAND95 * one.sd[k]);
    const x = known.map((k) => t[k]);
    traces.push({ x: [...x, ...x.toReversed()], y: [...edge(1), ...edge(-1).toReversed()], fill: "toself", mode: "lines", line: { width: 0 }, fillcolor: faint(c.model, 0.2), name: "95 % band", hoverinfo: "skip" });
  }
  if (one.measured) traces.push({ x: one.measured.t, y: one.measured.y, mode: "markers", name: "measured", marker: { color: c.dots, size: 3 } });
  traces.push({ x: t, y: one.truth, mode: "lines", name: "true", line: { color: c.ink, width: 1.6 } });
  if (one.estimate) traces.push({ x: t, y: one.estimate, mode: "lines", name: "estimated", line: { color: c.model, width: 1.6, dash: "dash" } });
  const gaps = (one.estimate ?? []).map((value, k) => value - one.truth[k]).filter(Number.isFinite);
  const rmse = Math.sqrt(gaps.reduce((sum, gap) => sum + gap * gap, 0) / gaps.length);
  // Only what is drawn decides the limits that the truth and the estimate need; a wide band is cut.
  const values = [...one.truth, ...(one.estimate ?? [])].filter((value) => value !== null);
  const low = values.reduce((a, b) => Math.min(a, b), Infinity);
  const high = values.reduce((a, b) => Math.max(a, b), -Infinity);
  const margin = 0.15 * (high - low || Math.abs(high) || 1);
  chart.draw(
    traces,
    layout("t", "", { yaxis: { range: [low - margin, high + margin] } }),
    `True and estimated; root mean square difference ${digits(rmse)}.`,
    () => ({ head: ["t", "true", "estimated", "sd"], rows: t.map((time, k) => [time, one.truth[k], one.estimate?.[k] ?? null, one.sd?.[k] ?? null]) }),
  );
}
