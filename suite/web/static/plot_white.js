// The tab "Is the rest noise?": autocorrelation of the residual, and its correlation with each input.

import { Chart } from "./chart.js";
import { at, digits, make } from "./dom.js";
import { current, on, output } from "./store.js";
import { colours, faint, layout, onTheme } from "./theme.js";

const pane = at("pane-white");
const head = (text) => make("div", { class: "panel-head" }, make("h3", {}, text));
const own = make("section", { class: "panel" }, head("Residual with itself"));
const cross = make("section", { class: "panel" }, head("Residual with an input"));
const select = make("select", { id: "input", onchange: () => draw() });
cross.querySelector(".panel-head").append(make("label", { class: "choose" }, "input ", select));
const none = make("p", { class: "quiet pad" });
pane.append(own, cross, none);
const white = new Chart(own, "Autocorrelation of the residual");
const inputs = new Chart(cross, "Correlation of the residual with an input");

function bars(chart, lags, r, limit, said) {
  const c = colours();
  const outside = r.filter((value) => Math.abs(value) > limit).length;
  const colour = r.map((value) => (Math.abs(value) > limit ? c.model : c.blue));
  const shapes = [{ type: "rect", xref: "paper", x0: 0, x1: 1, y0: -limit, y1: limit, fillcolor: faint(c.green, 0.25), line: { width: 0 }, layer: "below" }];
  chart.draw(
    [{ type: "bar", x: lags, y: r, marker: { color: colour }, hovertemplate: "lag %{x}: %{y:.3f}<extra></extra>", showlegend: false }],
    layout("lag (samples)", "correlation", { shapes, more: { bargap: 0.4, showlegend: false, margin: { l: 46, r: 10, t: 6, b: 32 } } }),
    `${said}: ${outside} of ${r.length} lags lie outside the 95 percent band of ±${digits(limit, 2)}.`,
    () => ({ head: ["lag", "correlation"], rows: lags.map((lag, k) => [lag, r[k]]) }),
  );
  return outside;
}

function draw() {
  const step = current()?.step;
  const name = output(step)?.name;
  const one = step?.whiteness.find((each) => each.output === name);
  const others = step?.cross.filter((each) => each.output === name) ?? [];
  own.hidden = !one;
  cross.hidden = others.length === 0;
  none.textContent = one ? "" : "Nothing to show yet.";
  if (one) {
    const outside = bars(white, one.r.map((_, k) => k + 1), one.r, one.band, name);
    const expected = Math.round(0.05 * one.r.length + 1.5);
    own.querySelector("h3").textContent = `Residual of ${name} with itself: ${outside > expected ? "not white, something is left" : "white within the band"}`;
  }
  if (!others.length) return;
  const chosen = others.find((each) => each.input === select.value) ?? others[0];
  select.replaceChildren(...others.map((each) => make("option", { value: each.input, selected: each === chosen }, each.input)));
  select.closest("label").hidden = others.length < 2;
  cross.querySelector("h3").textContent = `Residual of ${name} with ${others.length < 2 ? chosen.input : "an input"}`;
  bars(inputs, chosen.lags, chosen.r, chosen.band, `${name} with ${chosen.input}`);
}

on("step choice", draw);
onTheme(draw);
