// Opening: files by picker or dropped on the page, and the built-in examples.

import { get, post, Refused, upload } from "./api.js";
import { at, make } from "./dom.js";
import { refused } from "./modeltext.js";
import { current, push, state } from "./store.js";
import { opened, problem } from "./work.js";
import { choose } from "./tabs.js";

const MOST_MODEL = 1e6;

const isModel = (file) => /\.(toml|txt)$/i.test(file.name);

/** The errors of opening are said where the buttons are, in the server's words. */
async function tried(deed) {
  try {
    await deed();
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    problem(error.message);
  }
}

async function openModel(file, data) {
  if (file.size > MOST_MODEL) throw new Refused(`${file.name} has ${Math.round(file.size / 1e6)} MB; a model file has less than 1 MB. Open measured data with "Open data".`);
  const model = await file.text();
  try {
    await post("api/model", { model });
  } catch (error) {
    if (!(error instanceof Refused) || error.status === 0) throw error;
    // The text is shown with the error at its line, so that it can be mended here.
    if (!current()) push({ label: file.name, model, data, origin: "opened" });
    choose("text");
    refused(model, error);
    problem(`${file.name}: ${error.message}`);
    return;
  }
  replaceUnfinished();
  await opened(file.name, model, data, "opened");
}

/** A step that was never compared (a model still without data) gives way to what is opened now. */
function replaceUnfinished() {
  if (current() && !current().step && state.at === state.history.length - 1) {
    state.history.pop();
    state.at -= 1;
  }
}

async function openData(files) {
  const data = [];
  for (const file of files) data.push(await upload(file));
  const entry = current();
  if (!entry) {
    waiting = data;
    at("sources").textContent = `Data: ${data.map((one) => one.name).join(", ")}. Now open the model that belongs to them.`;
    return;
  }
  const label = entry.step ? data.map((one) => one.name).join(", ") : entry.label;
  replaceUnfinished();
  await opened(label, entry.model, data, "opened");
}

let waiting = []; // data that came before any model

async function open(files) {
  const models = files.filter(isModel);
  const records = files.filter((file) => !isModel(file));
  problem("");
  if (models.length > 1) throw new Refused(`One model at a time: ${models.map((file) => file.name).join(", ")} were given.`);
  if (!models.length) return openData(records);
  const data = [];
  for (const file of records) data.push(await upload(file));
  await openModel(models[0], data.length ? data : (current()?.data ?? waiting));
}

export function openExample(name) {
  return tried(async () => {
    problem("");
    at("example").setAttribute("aria-busy", "true");
    try {
      const { model, data } = await post("api/example", { name });
      replaceUnfinished();
      await opened(`${name}, as given`, model, data, "opened");
    } finally {
      at("example").removeAttribute("aria-busy");
    }
  });
}

function menu(examples) {
  const list = at("examples-menu");
  const button = at("examples");
  button.disabled = false;
  const shown = (open) => {
    list.hidden = !open;
    button.setAttribute("aria-expanded", String(open));
  };
  const pick = (name) => () => {
    shown(false);
    button.focus();
    openExample(name);
  };
  list.replaceChildren(...examples.map(({ name, sentence }) => make("button", { type: "button", role: "menuitem", onclick: pick(name) }, make("strong", {}, name), make("span", { class: "quiet" }, sentence))));
  button.addEventListener("click", () => {
    shown(list.hidden);
    if (!list.hidden) list.querySelector("button")?.focus();
  });
  list.addEventListener("keydown", (event) => {
    const items = [...list.querySelectorAll("button")];
    const next = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (next) {
      event.preventDefault();
      items[(items.indexOf(document.activeElement) + next + items.length) % items.length].focus();
    } else if (event.key === "Escape") {
      shown(false);
      button.focus();
    }
  });
  document.addEventListener("pointerdown", (event) => button.parentElement.contains(event.target) || shown(false));
}

function picker(button, input) {
  at(button).addEventListener("click", () => at(input).click());
  at(input).addEventListener("change", () => {
    const files = [...at(input).files];
    at(input).value = "";
    if (files.length) tried(() => (input === "model-file" ? openModel(files[0], current()?.data ?? waiting) : openData(files)));
  });
}

function dropping() {
  let depth = 0;
  const over = (inside) => (at("drop").hidden = !inside);
  const files = (event) => event.dataTransfer?.types.includes("Files");
  window.addEventListener("dragenter", (event) => files(event) && over((depth += 1) > 0));
  window.addEventListener("dragleave", (event) => files(event) && over((depth -= 1) > 0));
  window.addEventListener("dragover", (event) => files(event) && event.preventDefault());
  window.addEventListener("drop", (event) => {
    if (!files(event)) return;
    event.preventDefault();
    depth = 0;
    over(false);
    tried(() => open([...event.dataTransfer.files]));
  });
}

/** Asks what there is to begin with, and begins with what the command line was given. */
export async function start() {
  picker("open-model", "model-file");
  picker("open-data", "data-files");
  dropping();
  at("example").addEventListener("click", () => openExample("mug"));
  at("try").addEventListener("click", () => openExample("mug"));
  await tried(async () => {
    const { loaded } = await get("api/start");
    // All cases are loaded for the list, which takes seconds; nothing else waits for it.
    void tried(async () => menu((await get("api/examples")).examples));
    if (loaded) await opened("as given", loaded.model, loaded.data, "opened");
  });
}
