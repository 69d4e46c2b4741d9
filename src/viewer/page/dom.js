// Elements. Text from outside is only ever set as text.

const data = JSON.parse(document.getElementById("data").textContent);

/** The element of an id. */
const byId = (id) => document.getElementById(id);

/** A new element: attributes (a function is a listener, null is left out), then children, texts among them. */
function el(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(key, value);
    else if (key === "class") element.className = value;
    else if (value === true) element.setAttribute(key, "");
    else element.setAttribute(key, value);
  }
  element.append(...children.flat().filter((c) => c !== null && c !== undefined));
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

/** The same of SVG. */
function svg(name, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** Outcomes, worst first, and how people read them. */
const OUTCOMES = {
  fail: "FAIL",
  error: "ERROR",
  inconclusive: "INCONCLUSIVE",
  warn: "WARN",
  known: "KNOWN FAILURE",
  pass: "PASS",
  none: "NOT JUDGED",
};

/** A verdict: a word with a colour and a sign of its own. */
function badge(outcome) {
  return el("span", { class: `badge ${outcome}` }, OUTCOMES[outcome] ?? outcome);
}

/** Says that images are not our own. */
function origin(text) {
  return el("span", { class: "origin" }, text);
}

/** A number with as many digits as are worth reading. */
function number(value) {
  if (value === undefined || Number.isNaN(value)) return "none";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  const text = size !== 0 && size < 5e-4 ? value.toExponential(1) : value.toFixed(size < 10 ? 4 : 2);
  return text.replace("-", "−");
}

/** The same with its sign. */
const signed = (value) => (value > 0 ? "+" : "") + number(value);

/** A table of a name: column heads, then rows of cells (text or elements). */
function table(name, heads, rows) {
  return el(
    "div",
    { class: "scroll", tabindex: 0, role: "region", "aria-label": name },
    el(
      "table",
      {},
      el("thead", {}, el("tr", {}, heads.map((h) => el("th", { scope: "col" }, h)))),
      el("tbody", {}, rows.map((cells) => el("tr", {}, cells.map((c) => el("td", {}, c))))),
    ),
  );
}
