// Puts the page together, and the keys.

const stage = new Stage(byId("stage"));

const TABS = [
  ["cases", "Cases"],
  ["gates", "Gates"],
  ["plots", "Plots"],
  ["about", "About"],
].filter(([id]) => id === "cases" || id === "about" || data[id].length);

function showTab(id) {
  for (const [other] of TABS) {
    byId(`tab-${other}`).hidden = other !== id;
    byId(`to-${other}`).setAttribute("aria-selected", String(other === id));
  }
  if (id === "cases") stage.panes.forEach((p) => p.fit());
}

function fillHeader() {
  byId("title").textContent = data.title;
  byId("verdict").replaceChildren(badge(data.outcome), ...(data.label ? [origin(data.label)] : []));
  byId("summary").textContent = data.summary;
  byId("notes").replaceChildren(...data.notes.map((n) => el("li", {}, n)));
  byId("tabs").replaceChildren(...TABS.map(([id, label]) => el("button", { type: "button", role: "tab", id: `to-${id}`, "aria-controls": `tab-${id}`, click: () => showTab(id) }, label)));
}

function fillGates() {
  const nearest = (id) => {
    const item = data.items.find((i) => i.id === id);
    return item ? el("button", { type: "button", class: "link", click: () => { showTab("cases"); choose(item, true); } }, id) : id;
  };
  const rows = data.gates.map((g) => [badge(g.outcome), el("span", {}, g.gate, el("div", { class: "reason" }, g.reason)), String(g.cases), nearest(g.nearest), g.value, g.limit]);
  byId("tab-gates").replaceChildren(table("Gates", ["outcome", "gate", "verdicts", "nearest to its limit", "value", "limit"], rows));
}

function fillAbout() {
  const list = (pairs) => el("dl", { class: "facts wide" }, pairs.map(([name, text]) => el("div", {}, el("dt", {}, name), el("dd", {}, text))));
  byId("tab-about").replaceChildren(
    ...(data.words.length ? [el("h2", {}, "How to read this"), list(data.words)] : []),
    el("h2", {}, "Where it comes from"), list(data.facts));
}

const KEYS = [
  ["j, k", "next and previous case"],
  ["1 to 6", "side by side, slider, flicker, difference, FLIP, p-values"],
  ["hold f", "the reference in place of the test image (flicker)"],
  ["← →", "on the slider: move it; on an image: move the cursor that reads values (all four arrows, with Shift the view)"],
  ["+ − 0", "zoom in, out, fit"],
  ["[ ]", "darker, brighter by half a stop"],
  ["o", "outline the regions"],
  ["c", "the next pair of images"],
  ["/", "search"],
  ["t", "light or dark"],
  ...(data.review ? [["a, r", "approve, reject"]] : []),
  ["?", "this list"],
];

function fillHelp() {
  const close = el("button", { type: "button", click: () => byId("help").close() }, "Close");
  byId("help").replaceChildren(el("h2", {}, "Keys"), el("dl", { class: "keys" }, KEYS.map(([key, what]) => el("div", {}, el("dt", {}, key), el("dd", {}, what)))), close);
}

function theme() {
  const dark = document.documentElement.dataset.theme
    ? document.documentElement.dataset.theme === "dark"
    : window.matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "light" : "dark";
}

function nextPair() {
  const pairs = stage.item.pairs;
  if (!pairs.length) return;
  stage.pairLabel = pairs[(pairs.indexOf(stage.pair) + 1) % pairs.length].label;
  stage.refresh(true);
}

const ACTIONS = {
  j: () => step(1),
  k: () => step(-1),
  f: () => (stage.mode === "flicker" ? stage.flicker(true) : stage.setMode("flicker")),
  "+": () => stage.zoom(1.25),
  "=": () => stage.zoom(1.25),
  "-": () => stage.zoom(0.8),
  0: () => stage.look({ zoom: 1, x: 0.5, y: 0.5 }),
  "[": () => stage.expose(-0.5),
  "]": () => stage.expose(0.5),
  o: () => stage.outline(),
  c: nextPair,
  t: theme,
  "?": () => byId("help").showModal(),
  "/": () => byId("filters").querySelector("[type=search]").focus(),
  a: () => decideByKey("approve"),
  r: () => decideByKey("reject"),
};
MODES.forEach((mode, i) => {
  ACTIONS[i + 1] = () => stage.item.pairs.length && mode.of(stage.pair) && stage.setMode(mode.id);
});

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || byId("help").open) return;
  const typing = event.target.closest("input:not([type=range]):not([type=checkbox]), select, textarea");
  if (event.key === "Escape" && typing) typing.blur();
  if (typing || !(event.key in ACTIONS) || byId("tab-cases").hidden) return;
  event.preventDefault();
  if (stage.item || event.key === "?") ACTIONS[event.key]();
});
document.addEventListener("keyup", (event) => {
  if (event.key === "f") stage.flicker(false);
});
window.addEventListener("blur", () => stage.flicker(false));

if (data.review) byId("help-button").before(finishButton());
byId("help-button").addEventListener("click", () => byId("help").showModal());
byId("theme").addEventListener("click", theme);
fillHeader();
fillFilters();
fillGates();
fillAbout();
fillHelp();
byId("tab-plots").replaceChildren(...data.plots.map(plotFigure));
showTab("cases");
fillList();
const wanted = decodeURIComponent(location.hash.slice(1));
const first = data.items.find((i) => i.id === wanted) ?? data.items[0];
if (first) choose(first, false);
else byId("stage").append(el("p", { class: "note" }, "There is no case."));
