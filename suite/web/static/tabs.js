// Tabs as screen readers know them: one stop for Tab, arrows between them.

import { at } from "./dom.js";

const tabs = [...at("tabs").querySelectorAll('[role="tab"]')];

/** Shows a pane: "text", "parameters", "history" or "white". */
export function choose(name, focus = false) {
  for (const tab of tabs) {
    const chosen = tab.id === `tab-${name}`;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
    at(tab.getAttribute("aria-controls")).hidden = !chosen;
    if (chosen && focus) tab.focus();
  }
}

tabs.forEach((tab, k) => {
  const named = (one) => one.id.replace("tab-", "");
  tab.addEventListener("click", () => choose(named(tab)));
  tab.addEventListener("keydown", (event) => {
    const next = { ArrowRight: k + 1, ArrowLeft: k - 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    choose(named(tabs[(next + tabs.length) % tabs.length]), true);
  });
});
choose("text");
