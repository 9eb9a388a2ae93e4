// Plot 4: the error after each step of the history, on the fitted and on held-out data, with the noise as a line.

import { Chart } from "./chart.js";
import { at, digits, withUnit } from "./dom.js";
import { current, go, on, output, sameData, state } from "./store.js";
import { colours, faint, layout, onTheme } from "./theme.js";

const chart = new Chart("panel-steps", "Error of each step");

/** The steps that can be compared: of the same data, with the output in view. */
function rows(name) {
  return state.history
    .map((entry, index) => ({ entry, index, one: entry.step?.outputs.find((each) => each.name === name) }))
    .filter(({ entry, one }) => one && sameData(entry, current()));
}

/** A label in lines that fit under a bar. */
function wrapped(text, width) {
  const lines = [""];
  for (const word of text.split(" ")) {
    if ((lines.at(-1) + word).length > width && lines.at(-1)) lines.push("");
    lines[lines.length - 1] += `${lines.at(-1) ? " " : ""}${word}`;
  }
  return lines.slice(0, 3).join("<br>");
}

function draw() {
  const shown = output(current()?.step);
  if (!shown) return;
  const c = colours();
  const list = rows(shown.name);
  const at_ = list.map((_, k) => k);
  const later = (index) => index > state.at;
  const noise = shown.sigma;
  const fitted = list.map(({ one }) => one.error);
  const held = list.map(({ entry }) => entry.step.held_out?.[shown.name] ?? null);
  const all = [...fitted, ...held].filter(Number.isFinite);
  const top = Math.max(...all, noise > 0 ? noise : 0);
  const logarithmic = noise > 0 && top / noise > 20;
  const outline = { color: c.ink, width: list.map(({ index }) => (index === state.at && list.length > 1 ? 2 : 0)) };
  const bars = (y, name, colour) => ({
    type: "bar",
    x: at_,
    y,
    name,
    text: y.map((value) => (Number.isFinite(value) ? digits(value) : value === null ? "" : "diverged")),
    textposition: "outside",
    cliponaxis: false,
    textfont: { size: 11.5, color: c.ink },
    marker: { color: list.map(({ index }) => (later(index) ? faint(colour, 0.35) : colour)), line: outline },
    hovertemplate: "%{y}<extra></extra>",
  });
  const traces = [bars(fitted, "fitted data", c.blue)];
  if (held.some(Number.isFinite)) traces.push(bars(held, "held-out data", c.orange));
  if (noise > 0) traces.push({ x: [-0.6, list.length - 0.4], y: [noise, noise], mode: "lines", name: `noise ${digits(noise)}`, line: { color: c.ink, width: 1.5, dash: "dash" }, hoverinfo: "skip" });
  const low = Math.min(noise, ...all);
  const range = logarithmic ? [Math.log10(low / 2), Math.log10(top * 2.5)] : [0, 1.2 * top || 1];
  const words = Math.max(10, Math.floor(58 / Math.max(list.length, 1)));
  const text = list.map(({ entry }) => wrapped(entry.label.replaceAll("<", "‹"), words));
  chart.draw(
    traces,
    layout("", `RMSE of ${withUnit(shown.name, shown.unit)}`, {
      xaxis: { range: [-0.6, Math.max(list.length - 0.4, 1.6)], tickvals: at_, ticktext: text },
      yaxis: { range, type: logarithmic ? "log" : "linear", ...(logarithmic ? { dtick: 1, tickformat: "~g" } : {}) },
      more: { bargap: 0.35, barmode: "group" },
    }),
    `${list.map(({ entry, one }) => `${entry.label}: ${digits(one.error)}`).join("; ")}. Noise: ${digits(noise)}.`,
    () => ({
      head: ["step", "error, fitted data", "error, held-out data", "noise"],
      rows: list.map(({ entry, one }, k) => [entry.label, one.error, held[k], noise]),
    }),
  );
  const first = list[0]?.one.error;
  const here = shown.error;
  const fell = list.length > 1 && first > here;
  at("steps-said").textContent = fell ? `${digits(first)} → ${digits(here)}${logarithmic ? ", log scale" : ""}` : logarithmic ? "log scale" : "";
  if (!chart.heard && chart.canvas.on) {
    chart.canvas.on("plotly_click", ({ points }) => {
      const wanted = rows(output(current().step).name)[points[0].x];
      if (wanted) go(wanted.index);
    });
    chart.heard = true;
  }
}

on("step choice", draw);
onTheme(draw);
