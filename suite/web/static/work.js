// What the page does to models: compare, analyse, cancel, add, preview.

import { analyse as askAnalysis, compare, Refused } from "./api.js";
import { current, go, push, state, tell, update } from "./store.js";

let problems = () => {};
/** Where sentences of trouble go that belong to no other place. */
export const onProblem = (show) => (problems = show);
export const problem = (sentence) => problems(sentence);

/** Runs the model of a step freely, so that the plots show it at once. */
export async function compared(entry) {
  if (!entry.data.length || entry.step) return;
  try {
    const step = await compare(entry.model, entry.data);
    if (!entry.step) update(entry, { step });
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    problem(error.message);
  }
}

/** A new step of the history, compared with its data. */
export function opened(label, model, data, origin) {
  problem("");
  const entry = push({ label, model, data, origin });
  return compared(entry);
}

/** The analysis of the step in view. What was not fitted yet becomes a step "refitted"; an added model keeps its own. */
export async function analysed() {
  const entry = current();
  if (!entry || !entry.data.length || state.busy) return;
  problem("");
  const stop = new AbortController();
  state.busy = { stop, entry, said: "Starting", since: performance.now() };
  state.busy.done = run(entry, stop);
  tell("busy");
  await state.busy.done;
}

async function run(entry, stop) {
  try {
    const analysis = await askAnalysis(entry.start ?? entry.model, entry.data, stop.signal, ({ progress }) => {
      state.busy.said = progress;
      tell("busy");
    });
    finished(entry, analysis);
  } catch (error) {
    if (error instanceof Refused) problem(error.message);
    else if (error.name !== "AbortError") throw error;
  } finally {
    state.busy = null;
    tell("busy");
  }
}

function finished(entry, analysis) {
  // Another analysis begins again where this one began, so that nothing is learned twice from the same data.
  const facts = { analysis, step: analysis.step, model: analysis.model, start: entry.start ?? entry.model };
  if (!state.history.includes(entry)) return;
  if (entry.origin === "added" || entry.origin === "refitted") {
    const seen = current() === entry;
    update(entry, facts);
    if (seen) go(state.at);
    return;
  }
  if (current() === entry) push({ label: "refitted", data: entry.data, origin: "refitted", ...facts });
  else {
    // The reader went elsewhere meanwhile: the result waits behind its step.
    state.history.splice(state.history.indexOf(entry) + 1, 0, { label: "refitted", data: entry.data, origin: "refitted", ...facts });
    if (state.history.indexOf(entry) < state.at) state.at += 1;
    tell("step");
  }
}

export const cancel = () => state.busy?.stop.abort();

/** Draws the model with a candidate over the plots; the same again takes it away. */
export async function previewed(index) {
  const entry = current();
  if (state.preview?.index === index) {
    state.preview = null;
    return tell("preview");
  }
  const candidate = entry.analysis.verdict.candidates[index];
  try {
    candidate.seen ??= await compare(candidate.model, entry.data);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return problem(error.message);
  }
  if (current() !== entry) return;
  state.preview = { index, step: candidate.seen };
  tell("preview");
}

/** Takes a candidate's model as a new step, shows it, and analyses it. */
export async function added(index) {
  const { analysis, data } = current();
  const candidate = analysis.verdict.candidates[index];
  cancel();
  const entry = push({ label: `+ ${candidate.label}`, model: candidate.model, start: candidate.start, data, origin: "added", step: candidate.seen ?? null });
  await compared(entry);
  await state.busy?.done;
  if (current() === entry) await analysed();
}
