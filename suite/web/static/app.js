// The page: the sentence on top, the buttons, and what is shown when.

import { post, Refused } from "./api.js";
import { showBench } from "./bench.js";
import "./candidates.js";
import { at, download } from "./dom.js";
import { start } from "./files.js";
import "./history.js";
import "./plot_error.js";
import "./plot_fit.js";
import "./plot_steps.js";
import "./plot_white.js";
import "./sliders.js";
import { current, go, on, state } from "./store.js";
import { analysed, cancel, onProblem, problem } from "./work.js";

const benching = () => at("benchmark").getAttribute("aria-pressed") === "true";

onProblem((sentence) => {
  at("problem").textContent = sentence;
  at("problem").hidden = !sentence;
});

function headline(entry) {
  if (!entry) return "Which physical effect does your model lack?";
  if (entry.analysis) return entry.analysis.headline;
  if (entry.step) return entry.step.sentence;
  return entry.data.length ? "Simulating the model …" : "The model is read. Open the data that belong to it.";
}

function views() {
  const entry = current();
  at("empty").hidden = Boolean(entry) || benching();
  at("work").hidden = !entry || benching();
  at("bench").hidden = !benching();
  // The sentence is about the model of the workbench.
  at("said").hidden = benching();
}

function buttons() {
  const entry = current();
  const busy = Boolean(state.busy);
  at("analyse").hidden = busy;
  at("cancel").hidden = !busy;
  at("analyse").disabled = !entry?.data.length;
  at("analyse").classList.toggle("main", Boolean(entry) && !entry.analysis);
  at("undo").disabled = state.at <= 0;
  at("redo").disabled = state.at >= state.history.length - 1;
  at("save-model").disabled = !entry;
  at("save-report").disabled = !reported().length;
}

/** The analyses up to the step in view, for the report. */
const reported = () => state.history.slice(0, state.at + 1).filter((entry) => entry.analysis).map((entry) => entry.analysis.id);

function drawn() {
  const entry = current();
  views();
  buttons();
  const said = headline(entry);
  if (at("headline").textContent !== said) at("headline").textContent = said;
  if (entry) at("sources").textContent = [entry.label, ...entry.data.map((one) => one.name)].join(" · ");
  document.title = entry ? `${entry.label} – unmodelled` : "unmodelled";
}

let ticking = 0;
function working() {
  const held = [at("analyse"), at("cancel")].includes(document.activeElement);
  buttons();
  if (held) at(state.busy ? "cancel" : "analyse").focus();
  at("working").hidden = !state.busy;
  clearInterval(ticking);
  if (!state.busy) return;
  const { said, since } = state.busy;
  if (at("progress").textContent !== said) at("progress").textContent = said;
  const tick = () => (at("seconds").textContent = `${Math.round((performance.now() - since) / 1000)} s`);
  tick();
  ticking = setInterval(tick, 500);
}

function saveModel() {
  const name = (/^\s*name\s*=\s*"([^"]*)"/m.exec(current().model)?.[1] ?? "model").replace(/[^\w-]+/g, "-").toLowerCase();
  download(`${name}.toml`, current().model, "application/toml");
}

async function saveReport() {
  problem("");
  at("save-report").disabled = true;
  try {
    download("report.html", await post("api/report", { analyses: reported() }), "text/html");
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    problem(error.message);
  }
  buttons();
}

function toggleBench() {
  at("benchmark").setAttribute("aria-pressed", String(!benching()));
  views();
  if (benching()) showBench();
}

at("analyse").addEventListener("click", analysed);
at("cancel").addEventListener("click", cancel);
at("undo").addEventListener("click", () => go(state.at - 1));
at("redo").addEventListener("click", () => go(state.at + 1));
at("save-model").addEventListener("click", saveModel);
at("save-report").addEventListener("click", saveReport);
at("benchmark").addEventListener("click", toggleBench);
window.addEventListener("keydown", (event) => {
  const typing = /^(INPUT|TEXTAREA|SELECT)$/.test(event.target.tagName);
  if (typing || !(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
  event.preventDefault();
  const next = state.at + (event.shiftKey ? 1 : -1);
  if (next >= 0 && next < state.history.length) go(next);
});
on("step", drawn);
on("busy", working);
start();
