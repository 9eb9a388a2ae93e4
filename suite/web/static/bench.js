// The benchmark: a table that sorts and filters, colours by column, and opens the trajectories of a row.

import { get, Refused } from "./api.js";
import { at, digits, make } from "./dom.js";
import { faint } from "./theme.js";
import { showCell } from "./trajectories.js";

const PAGE = 200;
const CHOSEN = ["case", "estimator"];
let table = null; // {columns, rows, source}
let sorting = { key: null, down: false };
let most = PAGE;
let parts = null;

/** Loads the matrix once and shows it. */
export async function showBench() {
  if (table) return;
  const view = at("bench");
  view.replaceChildren(make("p", { class: "quiet pad", role: "status" }, "Reading the stored results …"));
  try {
    table = await get("api/bench");
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return view.replaceChildren(make("p", { class: "trouble pad", role: "alert" }, error.message));
  }
  build(view);
  draw();
}

function build(view) {
  const text = make("input", { type: "search", "aria-label": "Filter by text", placeholder: "filter", oninput: changed });
  const choosers = CHOSEN.filter((key) => table.columns.some((column) => column.key === key)).map((key) => {
    const names = [...new Set(table.rows.map((row) => String(row[key])))].sort();
    const label = table.columns.find((column) => column.key === key).label;
    const select = make("select", { onchange: changed }, make("option", { value: "" }, "all"), ...names.map((name) => make("option", { value: name }, name)));
    return { key, select, label: make("label", { class: "choose" }, `${label} `, select) };
  });
  const count = make("span", { class: "quiet", role: "status" });
  const head = make("tr", {}, ...table.columns.map(heading));
  const body = make("tbody");
  const more = make("button", { type: "button", hidden: true, onclick: () => ((most += PAGE), draw()) }, "Show more");
  const cell = make("section", { class: "cell", "aria-label": "Trajectories", hidden: true, tabindex: "-1" });
  parts = { text, choosers, count, head, body, more, cell };
  view.replaceChildren(
    make("div", { class: "bench-head" }, make("h2", {}, "Benchmark"), text, ...choosers.map((one) => one.label), count, make("span", { class: "quiet source" }, table.source)),
    make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Results" }, make("table", { class: "matrix" }, make("caption", { class: "hidden" }, "Results of the benchmark; a row opens its trajectories"), make("thead", {}, head), body), more),
    cell,
  );
}

function heading(column) {
  const name = column.unit ? `${column.label} (${column.unit})` : column.label;
  const number = table.rows.some((row) => typeof row[column.key] === "number");
  return make("th", { scope: "col", class: number ? "number" : "", "data-key": column.key, title: column.meaning }, make("button", { type: "button", onclick: () => sort(column.key) }, name));
}

function sort(key) {
  sorting = { key, down: sorting.key === key && !sorting.down };
  draw();
}

function changed() {
  most = PAGE;
  draw();
}

function chosen() {
  const words = parts.text.value.toLowerCase().split(/\s+/).filter(Boolean);
  const rows = table.rows.filter(
    (row) =>
      parts.choosers.every(({ key, select }) => !select.value || String(row[key]) === select.value) &&
      words.every((word) => table.columns.some(({ key }) => String(row[key] ?? "").toLowerCase().includes(word))),
  );
  const { key, down } = sorting;
  if (!key) return rows;
  // What is missing stands last, whichever way is up.
  const known = (value) => value !== null && value !== undefined && value !== "";
  const order = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), undefined, { numeric: true }));
  return rows.toSorted((a, b) => {
    if (!known(a[key]) || !known(b[key])) return known(b[key]) - known(a[key]);
    return (down ? -1 : 1) * order(a[key], b[key]);
  });
}

/** For each judged column, the share 0..1 of a value among those shown: 0 is the best. */
function scales(rows) {
  const judged = table.columns.filter((column) => column.better === "low" || column.better === "high");
  return new Map(
    judged.map(({ key, better }) => {
      const values = rows.map((row) => row[key]).filter(Number.isFinite).sort((a, b) => (better === "low" ? a - b : b - a));
      return [key, (value) => {
        if (!Number.isFinite(value) || values.length < 2 || values[0] === values.at(-1)) return null;
        return values.indexOf(value) / (values.length - 1);
      }];
    }),
  );
}

/** Blue where it is good, orange where it is bad; plain in the middle. */
function shade(share) {
  return share < 0.5 ? faint("#0072B2", 0.45 * (1 - 2 * share)) : faint("#E69F00", 0.45 * (2 * share - 1));
}

function draw() {
  const rows = chosen();
  const scale = scales(rows);
  for (const th of parts.head.children) {
    const here = th.dataset.key === sorting.key;
    if (here) th.setAttribute("aria-sort", sorting.down ? "descending" : "ascending");
    else th.removeAttribute("aria-sort");
  }
  parts.body.replaceChildren(...rows.slice(0, most).map((row) => line(row, scale)));
  parts.more.hidden = rows.length <= most;
  parts.count.textContent = `${rows.length} of ${table.rows.length} rows`;
}

function line(row, scale) {
  const cells = table.columns.map(({ key }, k) => {
    const value = row[key];
    const number = typeof value === "number";
    const shown = number ? digits(value) : String(value ?? "–");
    if (k === 0) return make("th", { scope: "row" }, make("button", { type: "button", class: "open" }, shown));
    const cell = make("td", { class: number || shown === "–" ? "number" : "", title: shown.length > 44 ? shown : null }, shown);
    const share = scale.get(key)?.(value) ?? null;
    if (share !== null) cell.style.backgroundColor = shade(share);
    return cell;
  });
  const element = make("tr", {}, ...cells);
  element.addEventListener("click", () => {
    for (const other of parts.body.children) other.classList.toggle("chosen", other === element);
    showCell(row.key, parts.cell);
  });
  return element;
}
