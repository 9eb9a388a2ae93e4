// The tab of the parameters: sliders with number fields, simulated as they move.

import { post, Refused } from "./api.js";
import { at, digits, make } from "./dom.js";
import { current, on } from "./store.js";
import { overlay } from "./plot_fit.js";
import { opened, problem } from "./work.js";

const pane = at("pane-parameters");
const list = make("div", { class: "sliders" });
const keep = make("button", { type: "button", class: "main", id: "keep", disabled: true }, "Keep");
const reset = make("button", { type: "button", id: "reset", disabled: true }, "Reset");
const trouble = make("p", { class: "trouble", role: "alert" });
const figure = make("p", { class: "figure", role: "status" });
pane.append(list, make("div", { class: "beside" }, make("p", { class: "buttons" }, keep, reset), figure, trouble,
  make("p", { class: "quiet" }, "The simulation follows the sliders. Keep writes the values into the model as a new step.")));

let known = null; // the model text whose parameters are shown
let values = {};
let flying = false;
let waiting = false;

/** At most one simulation is under way; the values it missed are sent when it is back, the latest alone. */
async function simulate() {
  const touched = Object.keys(values).length > 0;
  keep.disabled = reset.disabled = !touched;
  if (!touched) return overlay(null);
  if (flying) return (waiting = true);
  flying = true;
  const entry = current();
  try {
    const { outputs } = await post("api/simulate", { model: entry.model, data: entry.data.map((one) => one.id), values });
    if (current() === entry && Object.keys(values).length) {
      overlay(outputs);
      trouble.textContent = "";
      figure.textContent = outputs.map((one) => `${one.name}: fit ${digits(one.fit)} %, error ${digits(one.error)}`).join("; ");
    }
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    trouble.textContent = error.message;
  }
  flying = false;
  if (waiting) {
    waiting = false;
    simulate();
  }
}

/** Where a slider begins and ends: the server's bounds, or around the value where there are none. */
function reach(one) {
  const size = Math.abs(one.value) || 1;
  const spread = one.sd > 0 && one.sd < 2 * size ? 4 * one.sd : size;
  const low = Number.isFinite(one.low) ? one.low : one.value - spread;
  const high = Number.isFinite(one.high) ? one.high : one.value + spread;
  return low < high ? [low, high] : [one.value - size, one.value + size];
}

function row(one) {
  const [low, high] = reach(one);
  const shown = digits(one.value, 5).replaceAll("−", "-");
  const label = `${one.name}${one.unit ? ` (${one.unit})` : ""}`;
  const slide = make("input", { type: "range", min: low, max: high, step: "any", value: one.value, "aria-label": `${label}, slider` });
  const field = make("input", { type: "number", step: "any", value: shown, "aria-label": `${label}, value` });
  const moved = (from, to) => () => {
    if (from.value === "" || !Number.isFinite(from.valueAsNumber)) return;
    values[one.name] = from.valueAsNumber;
    to.value = to === field ? digits(from.valueAsNumber, 5).replaceAll("−", "-") : from.value;
    simulate();
  };
  slide.addEventListener("input", moved(slide, field));
  field.addEventListener("input", moved(field, slide));
  const note = one.fixed ? "fixed" : one.sd > 0 ? `± ${digits(one.sd, 2)}` : "";
  return make("div", { class: "slider", role: "group", "aria-label": label }, make("span", { class: "name" }, label), slide, field, make("span", { class: "quiet" }, note));
}

async function read() {
  const entry = current();
  if (!entry || entry.model === known) return;
  known = entry.model;
  values = {};
  keep.disabled = reset.disabled = true;
  trouble.textContent = figure.textContent = "";
  try {
    const { parameters } = await post("api/model", { model: entry.model });
    if (current() === entry) list.replaceChildren(...parameters.map(row));
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    known = null;
    trouble.textContent = error.message;
  }
}

/** Reads the parameters anew: after Reset, or when the step changed under moved sliders. */
function renew() {
  known = null;
  return read();
}

keep.addEventListener("click", async () => {
  const entry = current();
  try {
    const { model } = await post("api/values", { model: entry.model, values });
    const names = Object.entries(values).map(([name, value]) => `${name} = ${digits(value)}`);
    await opened(names.join(", "), model, entry.data, "edited");
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    problem(error.message);
  }
});
reset.addEventListener("click", () => {
  values = {};
  overlay(null);
  renew();
});
on("step", () => (Object.keys(values).length ? renew() : read()));
