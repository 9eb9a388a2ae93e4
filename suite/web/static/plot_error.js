// Plot 3: the smoothed model error d with its band against a variable, and the candidate's curve over it.

import { Chart } from "./chart.js";
import { at, digits, make, withUnit } from "./dom.js";
import { link, zoom } from "./link.js";
import { current, on, state, tell } from "./store.js";
import { colours, faint, layout, onTheme } from "./theme.js";

const BAND95 = 1.96;
const TIME = "\u0000time";
const chart = new Chart("panel-error", "What the equation lacks");

const lack = () => current()?.step?.discrepancy ?? null;
const equation = () => {
  const d = lack();
  return d.equations.includes(state.equation) ? state.equation : d.equation;
};
const variable = () => {
  const d = lack();
  return state.variable === TIME || d.variables.some((one) => one.name === state.variable) ? state.variable : d.variable;
};
const overTime = () => !lack() || variable() === TIME || (variable() === "t" && !lack().values.t);
const along = (d) => (overTime() ? d.t : (d.values[variable()] ?? d.t));

link(
  chart,
  () => {
    const d = lack();
    return d ? { t: d.t, x: along(d), y: d.d[equation()] } : { t: [], x: [], y: [] };
  },
  overTime,
);

/** The band as one path: an area over ordered time, a short upright line for each sample elsewhere. */
function band(d, x, y, sd, c) {
  const style = { mode: "lines", name: "95 % band", hoverinfo: "skip" };
  if (!overTime()) {
    const [bx, by] = [[], []];
    y.forEach((value, k) => {
      if (value === null || sd[k] === null) return;
      bx.push(x[k], x[k], null);
      by.push(value - BAND95 * sd[k], value + BAND95 * sd[k], null);
    });
    return [{ ...style, x: bx, y: by, line: { color: faint(c.blue, 0.22), width: 1.5 } }];
  }
  const traces = [];
  for (const run of new Set(d.run)) {
    const inside = d.t.map((_, k) => k).filter((k) => d.run[k] === run && y[k] !== null && sd[k] !== null);
    const there = inside.map((k) => x[k]);
    const up = inside.map((k) => y[k] + BAND95 * sd[k]);
    const down = inside.map((k) => y[k] - BAND95 * sd[k]);
    traces.push({ ...style, x: [...there, ...there.toReversed()], y: [...up, ...down.toReversed()], fill: "toself", fillcolor: faint(c.blue, 0.22), line: { width: 0 }, showlegend: traces.length === 0 });
  }
  return traces;
}

/** The candidate whose curve belongs into this plot: the one in preview, else the first. */
function candidate(d) {
  const list = current().analysis?.verdict.candidates ?? [];
  const one = list[state.preview?.index ?? 0];
  const here = one?.effects.some((effect) => effect.equation === equation()) && variable() === d.variable;
  return here && one.curve ? one : null;
}

/** Limits by the values, and of the band no more than as much again: an uncertain end does not flatten the rest. */
function framed(y, sd) {
  const known = y.filter((value) => value !== null);
  if (!known.length) return {};
  const low = known.reduce((a, b) => Math.min(a, b));
  const high = known.reduce((a, b) => Math.max(a, b));
  const span = high - low || Math.abs(high) || 1;
  const spread = sd.filter((value) => value !== null).sort((a, b) => a - b);
  const margin = Math.min(0.6 * span, 0.08 * span + BAND95 * (spread[Math.floor(spread.length / 2)] ?? 0));
  return { range: [low - margin, high + margin] };
}

function draw() {
  const entry = current();
  const d = lack();
  at("panel-error").classList.toggle("waiting", Boolean(entry) && !d);
  if (!d) return;
  const c = colours();
  const name = equation();
  const x = along(d);
  const [y, sd] = [d.d[name], d.sd[name]];
  const marked = state.interval && !overTime() ? d.t.map((t, k) => k).filter((k) => d.t[k] >= state.interval[0] && d.t[k] <= state.interval[1]) : [];
  const traces = [
    ...band(d, x, y, sd, c),
    { x, y, mode: overTime() && d.t.length > 60 ? "lines" : "markers", name: `d in ${name}′`, marker: { color: c.blue, size: d.t.length > 500 ? 3 : 4.5 }, line: { color: c.blue, width: 1.6 }, connectgaps: false },
  ];
  if (marked.length) traces.push({ x: marked.map((k) => x[k]), y: marked.map((k) => y[k]), mode: "markers", name: "marked", marker: { color: c.orange, size: 6, line: { color: c.ink, width: 0.6 } } });
  const one = candidate(d);
  if (one) traces.push({ x: one.curve.x, y: one.curve.y, mode: "lines", name: "candidate", line: { color: c.candidate, width: 2.4, dash: "dash" } });
  const shown = overTime() ? entry.step.time.label : withUnit(variable(), d.units[variable()]);
  const share = d.variables.find((each) => each.name === variable())?.ratio;
  const said = Number.isFinite(share) ? `${variable()} orders ${Math.round(100 * share)} percent of it.` : "";
  chart.draw(
    traces,
    layout(shown, withUnit(`d in ${name}′`, d.units[`${name}'`]), {
      xaxis: overTime() && zoom ? { range: zoom, autorange: false } : {},
      yaxis: framed(y, sd),
      shapes: [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: 0, y1: 0, line: { color: c.quiet, width: 1 }, layer: "below" }],
    }),
    `The smoothed model error d in the rate of ${name} against ${shown}. ${said}`,
    () => ({ head: [shown, "d", "sd", "time"], rows: x.map((value, k) => [value, y[k], sd[k], d.t[k]]) }),
  );
}

function choices() {
  const d = lack();
  for (const id of ["equation", "variable"]) at(id).closest("label").hidden = !d;
  if (!d) return;
  const option = (name, text, chosen) => make("option", { value: name, selected: chosen }, text);
  at("equation").replaceChildren(...d.equations.map((name) => option(name, `${name}′`, name === equation())));
  const ratio = (one) => (Number.isFinite(one.ratio) ? `${one.name} (${Math.round(100 * one.ratio)} %)` : one.name);
  const timed = d.variables.some((one) => one.name === "t");
  at("variable").replaceChildren(
    ...d.variables.map((one) => option(one.name, one.name === "t" ? ratio({ ...one, name: "time" }) : ratio(one), one.name === variable())),
    ...(timed ? [] : [option(TIME, "time", variable() === TIME)]),
  );
}

at("equation").addEventListener("change", ({ target }) => {
  state.equation = target.value;
  tell("choice");
});
at("variable").addEventListener("change", ({ target }) => {
  state.variable = target.value;
  tell("choice");
});
on("step", choices);
on("step choice preview interval", draw);
onTheme(draw);
