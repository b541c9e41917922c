"use strict";
// Elements, numbers and shapes that all parts of a page use.

const SVG_NS = "http://www.w3.org/2000/svg";

function built(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

/** An HTML element with attributes, listeners (on...) and children; null children are left out. */
const h = (tag, attributes = {}, ...children) => built(document.createElement(tag), attributes, children);

/** The same for SVG. */
const s = (tag, attributes = {}, ...children) => built(document.createElementNS(SVG_NS, tag), attributes, children);

/** A number with so many decimals, thousands apart, with a true minus; a dash for none. */
function num(value, decimals = 0) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const text = Math.abs(value).toLocaleString("en-US", {
    minimumFractionDigits: decimals,
    maximumFractionDigits: decimals,
  });
  return value < 0 && Number(text.replaceAll(",", "")) !== 0 ? `−${text}` : text;
}

/** A number with about four digits that count. */
function short(value) {
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value)) return num(value, 0);
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) return value.toExponential(2).replace("-", "−");
  return num(value, Math.max(0, 3 - Math.floor(Math.log10(Math.max(size, 1e-9)))));
}

const GLYPHS = {
  green: ["M8 1a7 7 0 1 0 0 14A7 7 0 0 0 8 1z", "M4.6 8.3l2.3 2.3 4.6-4.9"],
  amber: ["M8 1.2L15.4 14.4H.6z", "M8 6v4.2M8 12.1v.4"],
  red: ["M5 .9h6L15.1 5v6L11 15.1H5L.9 11V5z", "M5.3 5.3l5.4 5.4M10.7 5.3l-5.4 5.4"],
  info: ["M8 4.2a3.8 3.8 0 1 0 0 7.6 3.8 3.8 0 0 0 0-7.6z", ""],
};

/** A sign whose shape tells what its colour does: a round tick, a triangle, an octagon with a cross, a dot. */
function glyph(state) {
  const [shape, mark] = GLYPHS[state];
  return s("svg", { class: "glyph", viewBox: "0 0 16 16", "aria-hidden": "true" },
    s("path", { d: shape, fill: "currentColor" }),
    s("path", { d: mark, fill: "none", stroke: "var(--panel)", "stroke-width": 1.9, "stroke-linecap": "round" }));
}

const WORDS = { green: "holds", amber: "look", red: "fails" };

/** The index of the last entry not after `value` in an ascending list; 0 before its first. */
function indexAt(list, value) {
  let low = 0;
  let high = list.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (list[middle] <= value) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** A curve's value between two of its moments; null outside. */
function valueAt(t, y, at, stepped) {
  if (!t.length || at < t[0] - 1e-9 || at > t[t.length - 1] + 1e-9) return null;
  const i = indexAt(t, at);
  if (stepped || i + 1 >= t.length) return y[i];
  const span = t[i + 1] - t[i];
  return span > 0 ? y[i] + ((y[i + 1] - y[i]) * (at - t[i])) / span : y[i];
}

/** A button that switches between light and dark paper. */
function themeButton() {
  const root = document.documentElement;
  const isDark = () => getComputedStyle(root).colorScheme === "dark"
    || (root.style.colorScheme === "" && matchMedia("(prefers-color-scheme: dark)").matches);
  const words = () => (isDark() ? "Light" : "Dark");
  const button = h("button", { type: "button", class: "theme", onclick: () => {
    root.style.colorScheme = isDark() ? "light" : "dark";
    button.textContent = words();
  } });
  button.textContent = words();
  return button;
}
