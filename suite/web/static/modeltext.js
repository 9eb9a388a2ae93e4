// The tab of the model's text: edit it, see errors at their line, apply it as a new step.

import { post, Refused } from "./api.js";
import { at, make } from "./dom.js";
import { current, on } from "./store.js";
import { opened } from "./work.js";

const gutter = make("pre", { class: "gutter", "aria-hidden": "true" });
const text = make("textarea", { id: "model-text", spellcheck: "false", autocomplete: "off", wrap: "off", "aria-label": "Model text (TOML)", "aria-describedby": "model-error" });
const trouble = make("p", { id: "model-error", class: "trouble", role: "alert" });
const apply = make("button", { type: "button", class: "main", id: "apply", title: "Ctrl+Enter" }, "Apply");
const revert = make("button", { type: "button", id: "revert" }, "Revert");
const hint = make("p", { class: "quiet" }, "Equations, parameters and outputs. Apply makes a new step; Undo goes back.");
at("pane-text").append(make("div", { class: "editor" }, gutter, text), make("div", { class: "beside" }, make("p", { class: "buttons" }, apply, revert), trouble, hint));

let wrong = null;
let asked = 0;

function numbered() {
  const count = text.value.split("\n").length;
  gutter.replaceChildren(...Array.from({ length: count }, (_, k) => make("span", { class: k + 1 === wrong ? "wrong" : "" }, `${k + 1}\n`)));
  gutter.scrollTop = text.scrollTop;
}

function show(error) {
  wrong = error?.line ?? null;
  trouble.textContent = error ? `${wrong ? `Line ${wrong}: ` : ""}${error.message}` : "";
  text.setAttribute("aria-invalid", String(Boolean(error)));
  numbered();
  const edited = text.value !== current()?.model;
  apply.disabled = !edited;
  revert.disabled = !edited;
}

/** Shows the line of the error in the middle of the text. */
function reveal() {
  if (!wrong) return;
  const height = text.scrollHeight / text.value.split("\n").length;
  text.scrollTop = Math.max(0, (wrong - 0.5) * height - text.clientHeight / 2);
}

/** Asks the server to read the text; the answer to an older text is dropped. */
async function read() {
  const question = (asked += 1);
  try {
    await post("api/model", { model: text.value });
    if (question === asked) show(null);
    return true;
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    if (question === asked) show(error);
    return false;
  }
}

let pause = 0;
text.addEventListener("input", () => {
  show(null);
  clearTimeout(pause);
  pause = setTimeout(read, 500);
});
text.addEventListener("scroll", () => (gutter.scrollTop = text.scrollTop));
text.addEventListener("keydown", (event) => {
  if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) applied();
});

async function applied() {
  clearTimeout(pause);
  if (!current() || text.value === current().model) return;
  const wanted = text.value;
  if (await read()) await opened("edited", wanted, current().data, "edited");
  else reveal();
}

/** Shows a text that the server refused, with its error at the line. */
export function refused(model, error) {
  text.value = model;
  show(error);
  reveal();
}

apply.addEventListener("click", applied);
revert.addEventListener("click", () => {
  text.value = current().model;
  show(null);
});
let seen = null;
on("step", () => {
  // What is being typed is not overwritten by news about another step.
  if (!current() || current().model === seen) return show(null);
  seen = current().model;
  text.value = seen;
  show(null);
});
