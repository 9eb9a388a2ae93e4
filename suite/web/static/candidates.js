// At the right: what may be missing, how sure that is, what cannot be told apart, and what would help.

import { at, digits, make, percent, plain } from "./dom.js";
import { current, on, state } from "./store.js";
import { added, previewed } from "./work.js";

const KINDS = {
  missing_effect: "An effect is missing, and the data say which.",
  ambiguous: "An effect is missing; these data do not settle which.",
  adequate: "Nothing is missing that these data could show.",
  unexplained: "The model fails, and nothing in the library mends it.",
};

/** Evidence in words, from a share of the weight. */
function evidence(share) {
  const weight = Math.round(100 * share) / 100;
  if (weight >= 0.9) return "strong evidence";
  if (weight >= 0.6) return "good evidence";
  if (weight >= 0.25) return "some evidence";
  return weight >= 0.05 ? "weak evidence" : "little evidence";
}

function bar(weight, none = false) {
  const track = make("span", { class: "track", "aria-hidden": "true" }, make("span", { class: none ? "fill none" : "fill" }));
  track.firstChild.style.width = `${Math.round(100 * Math.min(Math.max(weight, 0), 1))}%`;
  return track;
}

function coefficients(effect) {
  return Object.entries(effect.coefficients).map(([name, one]) => `${name} = ${digits(one.value)}${one.sd > 0 ? ` ± ${digits(one.sd, 2)}` : ""}${one.unit ? ` ${one.unit}` : ""}`);
}

function card(one, index) {
  const seen = state.preview?.index === index;
  return make(
    "li",
    { class: index === 0 ? "candidate best" : "candidate" },
    make("h3", {}, one.label),
    ...one.effects.map((effect) =>
      make("p", { class: "term" }, make("code", {}, effect.term), make("span", { class: "quiet" }, ` ${coefficients(effect).join(", ")}`)),
    ),
    one.sentence ? make("p", { class: "physics" }, one.sentence) : null,
    make("p", { class: "weight" }, bar(one.weight), make("span", {}, `${percent(one.weight)}, ${evidence(one.weight)}`)),
    make(
      "p",
      { class: "deed" },
      make("span", {}, Number.isFinite(one.removes) ? `removes ${percent(one.removes)} of the error` : ""),
      make("span", { class: "buttons" },
        make("button", { type: "button", "aria-pressed": String(seen), "aria-label": `Preview ${one.label}`, onclick: () => previewed(index) }, "Preview"),
        make("button", { type: "button", class: index === 0 ? "main" : "", "aria-label": `Add ${one.label}`, onclick: () => added(index) }, "Add")),
    ),
    one.apart ? make("p", { class: "apart" }, one.apart) : null,
  );
}

function none(weight) {
  return make("li", { class: "candidate" }, make("h3", {}, "None of these"), make("p", { class: "weight" }, bar(weight, true), make("span", {}, percent(weight))));
}

function smallest(sizes) {
  const entries = Object.entries(sizes ?? {}).filter(([, size]) => Number.isFinite(size));
  if (!entries.length) return null;
  return make(
    "details",
    {},
    make("summary", {}, "Smallest effects these data would have shown"),
    make("table", {}, make("tbody", {}, ...entries.map(([name, size]) => make("tr", {}, make("th", { scope: "row" }, plain(name)), make("td", {}, digits(size)))))),
  );
}

/** The verdict as the command line says it. */
const full = (verdict) => make("details", {}, make("summary", {}, "The verdict in full"), make("p", {}, verdict.sentence));

function said() {
  const entry = current();
  if (state.busy && state.busy.entry === entry) return "The analysis is under way; candidates appear here.";
  if (!entry.data.length) return "Open the data that belong to this model.";
  return "Press Analyse: the parameters are fitted, and every effect of the library is tried in every equation.";
}

function draw() {
  const entry = current();
  if (!entry) return;
  const verdict = entry.analysis?.verdict;
  if (!verdict) {
    at("candidates").replaceChildren(make("p", { class: "quiet" }, said()));
    return;
  }
  const list = verdict.candidates;
  const focused = document.activeElement?.getAttribute("aria-label");
  const advice = verdict.advice?.length ? [make("h3", {}, "What would help"), make("ul", { class: "advice" }, ...verdict.advice.map((line) => make("li", {}, line)))] : [];
  at("candidates").replaceChildren(
    make("p", { class: "verdict" }, KINDS[verdict.verdict]),
    make("ol", { class: "list" }, ...list.map(card), list.length ? none(verdict.none) : null),
    make("div", { class: "further" }, ...advice, smallest(verdict.smallest_detectable), full(verdict)),
  );
  // The list was made anew; whoever stood on one of its buttons stands there still.
  if (focused) [...at("candidates").querySelectorAll("button")].find((button) => button.getAttribute("aria-label") === focused)?.focus();
}

on("step preview busy", draw);
