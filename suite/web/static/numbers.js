// The numbers behind a plot, as a table in a dialog: for screen readers, and to read values exactly.

import { at, digits, make } from "./dom.js";

const MOST = 2500;

export function showNumbers(title, said, table) {
  at("numbers-title").textContent = title;
  const cut = table.rows.length > MOST ? ` The first ${MOST} of ${table.rows.length} rows.` : "";
  at("numbers-said").textContent = said + cut;
  const cell = (value, k) => make(k === 0 ? "th" : "td", k === 0 ? { scope: "row" } : {}, typeof value === "string" ? value : digits(value, 5));
  at("numbers-table").replaceChildren(
    make("thead", {}, make("tr", {}, ...table.head.map((name) => make("th", { scope: "col" }, name)))),
    make("tbody", {}, ...table.rows.slice(0, MOST).map((row) => make("tr", {}, ...row.map(cell)))),
  );
  at("numbers").showModal();
}

at("numbers-close").addEventListener("click", () => at("numbers").close());
