// What this tab holds: the history of models, and where in it we stand. Parts of the page listen for changes.

/**
 * A step: {label, model, data: [DATA], step: STEP|null, analysis: ANALYSIS|null, origin}.
 * `start` is the text that its analysis begins from, where that is not the model. origin is "opened", "edited", "refitted" or "added"; an added model comes fitted, and its analysis fills the same step.
 */
export const state = {
  history: [],
  at: -1,
  output: null,
  equation: null,
  variable: null,
  preview: null, // {candidate index, step: STEP}
  busy: null, // {stop, entry, said, since, done} of the running analysis
  interval: null, // [t0, t1] marked in all plots
};

const listeners = new Map();

/** Calls `hear` at each of the named changes: "step", "preview", "busy", "interval", "choice". */
export function on(names, hear) {
  for (const name of names.split(" ")) listeners.set(name, [...(listeners.get(name) ?? []), hear]);
}

export function tell(name) {
  for (const hear of listeners.get(name) ?? []) hear();
}

export const current = () => state.history[state.at] ?? null;

/** A new step after the current one; what had been undone is gone, as in every editor. */
export function push(entry) {
  state.history = [...state.history.slice(0, state.at + 1), { step: null, analysis: null, ...entry }];
  go(state.history.length - 1);
  return current();
}

/** Moves to a step of the history. */
export function go(index) {
  state.at = Math.min(Math.max(index, 0), state.history.length - 1);
  state.preview = null;
  state.interval = null;
  tell("step");
}

/** New facts about a step; heard if it is the one in view, or anywhere in the history. */
export function update(entry, facts) {
  Object.assign(entry, facts);
  if (state.history.includes(entry)) tell("step");
}

/** The output in view of a STEP. */
export function output(step) {
  return step?.outputs.find((one) => one.name === state.output) ?? step?.outputs[0] ?? null;
}

/** Are both steps about the same records? */
export const sameData = (a, b) => a.data.length === b.data.length && a.data.every((entry, k) => entry.id === b.data[k].id);
