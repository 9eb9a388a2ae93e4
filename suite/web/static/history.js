// The tab of the history: each step with its sentence; a click goes back to it.

import { at, digits, make } from "./dom.js";
import { go, on, output, state } from "./store.js";

function row(entry, index) {
  const here = index === state.at;
  const one = output(entry.step);
  const error = one ? `error ${digits(one.error)}, fit ${digits(one.fit)} %` : "";
  const said = entry.analysis?.headline ?? entry.step?.sentence ?? (entry.data.length ? "" : "no data yet");
  return make(
    "li",
    {},
    make(
      "button",
      { type: "button", class: "step", "aria-current": here ? "step" : null, onclick: () => go(index) },
      make("strong", {}, entry.label),
      make("span", { class: "figure" }, error),
      make("span", { class: "quiet" }, said),
    ),
  );
}

function draw() {
  const pane = at("pane-history");
  const held = pane.contains(document.activeElement);
  pane.replaceChildren(make("ol", { class: "history" }, ...state.history.map(row)));
  if (held) pane.querySelector("[aria-current]")?.focus();
  shown();
}

/** The step in view stands within the part of the list that is seen. */
const shown = () => at("pane-history").querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" });

at("tab-history").addEventListener("click", shown);

on("step choice", draw);
