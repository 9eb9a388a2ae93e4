// Plots 1 and 2: what was measured beside what the model gives, and their difference in units of the noise.

import { Chart } from "./chart.js";
import { at, digits, make, withUnit } from "./dom.js";
import { link, valueAt, zoom } from "./link.js";
import { current, on, output, state, tell } from "./store.js";
import { colours, faint, layout, onTheme } from "./theme.js";

const BAND95 = 1.96;
const fit = new Chart("panel-fit", "Measured and model");
const rest = new Chart("panel-residual", "Residual, in standard deviations of the noise");
let live = null; // what the sliders simulate: {name: {fit, error, t, y}}

const shown = () => output(current()?.step);
const previewed = () => state.preview && state.preview.step.outputs.find((one) => one.name === shown()?.name);
const samples = (trace) => (trace ? { t: trace.t, x: trace.t, y: trace.y } : { t: [], x: [], y: [] });

link(fit, () => samples(shown()?.measured));
link(rest, () => samples(shown()?.residual));

/** Limits that show all that was measured, and of a simulation that runs away only the beginning. */
function framed(measured, ...simulated) {
  const known = measured.filter((y) => y !== null);
  if (!known.length) return undefined;
  const low = known.reduce((a, b) => Math.min(a, b));
  const high = known.reduce((a, b) => Math.max(a, b));
  const span = high - low || Math.abs(high) || 1;
  let [bottom, top] = [low, high];
  for (const y of simulated.flat()) {
    if (y === null) continue;
    bottom = Math.min(bottom, Math.max(y, low - 1.5 * span));
    top = Math.max(top, Math.min(y, high + 1.5 * span));
  }
  const margin = 0.05 * (top - bottom);
  return [bottom - margin, top + margin];
}

/** Neighbouring worst intervals as one. */
function merged(worst) {
  const joined = [];
  for (const [a, b] of [...worst].sort((one, other) => one[0] - other[0])) {
    const last = joined.at(-1);
    if (last && a <= last[1] + 0.3 * (b - a)) last[1] = Math.max(last[1], b);
    else joined.push([a, b]);
  }
  return joined;
}

function shades(worst) {
  const fillcolor = faint(colours().orange, 0.22);
  return merged(worst).map(([x0, x1]) => ({ type: "rect", xref: "x", yref: "paper", x0, x1, y0: 0, y1: 1, fillcolor, line: { width: 0 }, layer: "below" }));
}

const swatch = (name, color) => ({ x: [null], y: [null], mode: "markers", marker: { symbol: "square", size: 10, color }, name, hoverinfo: "skip" });

function draw() {
  const entry = current();
  const one = shown();
  if (!one) return;
  const c = colours();
  const time = withUnit(entry.step.time.label, entry.step.time.label.includes("(") ? "" : entry.step.time.unit);
  const other = previewed();
  const slid = live?.[one.name];
  const size = one.measured.t.length > 400 ? 3 : 4.5;
  const traces = [
    { x: one.measured.t, y: one.measured.y, mode: "markers", name: "measured", marker: { color: c.dots, size } },
    { x: one.model.t, y: one.model.y, mode: "lines", name: "model", line: { color: c.model, width: 1.8 } },
  ];
  if (other) traces.push({ x: other.model.t, y: other.model.y, mode: "lines", name: "with the candidate", line: { color: c.candidate, width: 2.2, dash: "dash" } });
  if (slid) traces.push({ x: slid.t, y: slid.y, mode: "lines", name: "with the sliders", line: { color: c.blue, width: 2 } });
  const range = framed(one.measured.y, one.model.y, other?.model.y ?? [], slid?.y ?? []);
  const xaxis = zoom ? { range: zoom, autorange: false } : {};
  const better = other ? `, with the candidate ${digits(other.fit)} %` : "";
  const sliding = slid ? `, with the sliders ${digits(slid.fit)} %` : "";
  const now = other ?? slid;
  at("fit").textContent = now ? `fit ${digits(one.fit)} → ${digits(now.fit)} %` : `fit ${digits(one.fit)} %`;
  const noise = Number.isFinite(one.sigma) ? `, noise ${digits(one.sigma)}` : "";
  fit.draw(
    traces,
    layout(time, withUnit(one.name, one.unit), { xaxis, yaxis: range ? { range } : {}, shapes: shades(one.worst) }),
    `${one.name}: fit ${digits(one.fit)} percent${better}${sliding}, error ${digits(one.error)}${noise}.`,
    () => ({
      head: [entry.step.time.label, "measured", "model", ...(other ? ["with the candidate"] : [])],
      rows: one.measured.t.map((t, k) => [t, one.measured.y[k], near(one.model, t), ...(other ? [near(other.model, t)] : [])]),
    }),
  );
  drawRest(one, other, time, xaxis, size, c);
}

/** The trace's value at the last of its times that is not after t; traces are thinned each on its own. */
function near(trace, t) {
  let [low, high] = [0, trace.t.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (trace.t[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return trace.y[low];
}

function drawRest(one, other, time, xaxis, size, c) {
  const many = one.residual.t.length > 1500;
  const band = { type: "rect", xref: "paper", yref: "y", x0: 0, x1: 1, y0: -BAND95, y1: BAND95, fillcolor: faint(c.green, 0.25), line: { width: 0 }, layer: "below" };
  const traces = [
    { x: one.residual.t, y: one.residual.y, mode: many ? "lines" : "markers", name: "measured − model", marker: { color: c.blue, size: size - 0.5 }, line: { color: c.blue, width: 1 } },
  ];
  if (other) traces.push({ x: other.residual.t, y: other.residual.y, mode: many ? "lines" : "markers", name: "with the candidate", marker: { color: c.candidate, size: size - 0.5, symbol: "diamond" }, line: { color: c.candidate, width: 1 } });
  traces.push(swatch("noise, 95 %", faint(c.green, 0.4)), swatch("worst", faint(c.orange, 0.5)));
  const times = one.sigma > 0 ? one.error / one.sigma : NaN;
  const said = Number.isFinite(times) ? `${digits(times, 2)} × the noise` : "noise not known";
  const less = other && one.sigma > 0 ? `, with the candidate ${digits(other.error / one.sigma, 2)} ×` : "";
  at("residual-said").textContent = less ? `${digits(times, 2)} → ${digits(other.error / one.sigma, 2)} × the noise` : said;
  const worst = merged(one.worst).map(([a, b]) => `${digits(a)} to ${digits(b)}`).join(", ");
  rest.draw(
    traces,
    layout(time, "residual / noise sd", { xaxis, shapes: [band, ...shades(one.worst)] }),
    `The error is ${said}${less}. ${worst ? `Worst from ${worst}.` : ""}`,
    () => ({ head: ["time", "residual in noise sds"], rows: one.residual.t.map((t, k) => [t, one.residual.y[k]]) }),
  );
}

function choices() {
  const names = current()?.step?.outputs.map((one) => one.name) ?? [];
  const select = at("output");
  select.replaceChildren(...names.map((name) => make("option", { value: name, selected: name === shown()?.name }, name)));
  at("output-choice").hidden = names.length < 2;
}

/** Draws what the sliders simulate over plot 1; null takes it away. */
export function overlay(outputs) {
  live = outputs && Object.fromEntries(outputs.map((one) => [one.name, one]));
  draw();
}

at("output").addEventListener("change", (event) => {
  state.output = event.target.value;
  tell("choice");
});
document.addEventListener("cursor", ({ detail: t }) => {
  const one = shown();
  at("readout").textContent =
    t === null || !one ? "" : `t ${digits(t, 4)}: measured ${valueAt(one.measured, t)}, model ${valueAt(one.model, t)}, residual ${valueAt(one.residual, t)} sd`;
});
on("step", () => {
  live = null;
  choices();
});
on("step choice preview", draw);
onTheme(draw);
