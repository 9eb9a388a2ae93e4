// Small things every part of the page needs: elements, numbers as text.

export const at = (id) => document.getElementById(id);

/** An element with attributes and children; text goes in as text, never as markup. */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** Three significant digits, in a form that reads. */
export function digits(value, count = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(count - 1).replace("e+", "e").replace("-", "−").replace("e-", "e−");
  const shown = Number(value.toPrecision(count));
  return String(shown).replace("-", "−");
}

export const percent = (share) => (Number.isFinite(share) ? `${share > 0.005 || share <= 0 ? Math.round(100 * share) : "<1"} %` : "–");

/** "v (m/s)", or the name alone. */
export const withUnit = (name, unit) => (unit ? `${name} (${unit})` : name);

/** An effect's id as words. */
export const plain = (effect) => effect.replaceAll("_", " ");

/** Gives a file to the user to keep. */
export function download(name, text, kind) {
  const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: kind })), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
