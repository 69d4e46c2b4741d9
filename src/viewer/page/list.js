// The list of cases and its filters.

/** The items that pass the filters, in order. */
let shownItems = data.items;

const filters = { outcomes: new Set(), scene: "", estimator: "", renderer: "", text: "" };

const valuesOf = (key) => [...new Set(data.items.map((i) => i[key]))];

function passes(item) {
  if (filters.outcomes.size && !filters.outcomes.has(item.outcome)) return false;
  for (const key of ["scene", "estimator", "renderer"]) {
    if (filters[key] && item[key] !== filters[key]) return false;
  }
  return item.id.toLowerCase().includes(filters.text.toLowerCase());
}

/** Thumbnails are drawn when they come into sight. */
const inSight = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    if (!isIntersecting) continue;
    inSight.unobserve(target);
    const pair = data.items[target.dataset.item].pairs[0];
    Promise.all([plane(pair.test.plane), plane(pair.reference.plane)]).then(([test, reference]) => {
      const pictures = [[test, openness(0)], [difference(test, reference), signedScale(pair.limit)]];
      pictures.forEach(([image, scale], i) => {
        const canvas = target.children[i];
        canvas.width = image.width;
        canvas.height = image.height;
        canvas.getContext("2d").putImageData(paint(image, scale), 0, 0);
      });
    });
  }
});

function row(item, chosen) {
  const thumbnails = el("span", { class: "thumbnails", "aria-hidden": "true", "data-item": data.items.indexOf(item) });
  if (item.pairs.length) {
    thumbnails.append(el("canvas"), el("canvas"));
    inSight.observe(thumbnails);
  }
  return el(
    "li",
    {},
    el(
      "button",
      { type: "button", class: "row", "aria-current": chosen ? "true" : null, click: () => choose(item, true) },
      el("span", { class: "row-head" }, badge(item.outcome), ...(item.origin ? [origin(item.origin)] : []), el("span", { class: "small" }, item.rays ? `${item.renderer}, ${item.rays} ${item.rays === 1 ? "ray" : "rays"}` : item.renderer)),
      el("span", { class: "row-name" }, el("b", {}, item.scene), ` ${item.estimator}`),
      thumbnails,
    ),
  );
}

function fillList() {
  shownItems = data.items.filter(passes);
  const list = byId("list");
  list.replaceChildren(...shownItems.map((item) => row(item, item === stage.item)));
  const cases = `${data.items.length} ${data.items.length === 1 ? "case" : "cases"}`;
  byId("count").textContent = shownItems.length === data.items.length
    ? cases
    : `${shownItems.length} of ${cases}`;
  if (!shownItems.length) list.append(el("li", { class: "note" }, "No case passes the filters."));
}

function filtered() {
  fillList();
  if (shownItems.length && !shownItems.includes(stage.item)) choose(shownItems[0], false);
  else if (stage.item) stage.show(stage.item, decisionOf(stage.item));
}

/** A box an outcome that cases have, anew where those change. A filter on one that is gone goes with its box. */
function fillChips() {
  const counts = {};
  for (const item of data.items) counts[item.outcome] = (counts[item.outcome] ?? 0) + 1;
  for (const outcome of filters.outcomes) if (!counts[outcome]) filters.outcomes.delete(outcome);
  const chips = Object.keys(OUTCOMES).filter((o) => counts[o]).map((outcome) => {
    const box = el("input", {
      type: "checkbox", name: "outcome", value: outcome, checked: filters.outcomes.has(outcome),
      change: () => { filters.outcomes[box.checked ? "add" : "delete"](outcome); filtered(); },
    });
    return el("label", { class: `chip ${outcome}` }, box, ` ${OUTCOMES[outcome]} ${counts[outcome]}`);
  });
  byId("filters").querySelector(".chips").replaceChildren(...chips);
}

function fillFilters() {
  const choice = (key) => {
    const select = el("select", { name: key, "aria-label": key, change: () => { filters[key] = select.value; filtered(); } },
      el("option", { value: "" }, `every ${key}`), valuesOf(key).map((v) => el("option", { value: v }, v)));
    return select;
  };
  const text = el("input", { type: "search", name: "text", placeholder: "name contains … (/)", "aria-label": "Name contains", input: () => { filters.text = text.value; filtered(); } });
  const form = byId("filters");
  form.replaceChildren(el("div", { class: "chips" }), el("div", { class: "choices" }, ["scene", "estimator", "renderer"].map(choice)), text);
  form.addEventListener("submit", (event) => event.preventDefault());
  fillChips();
}

/** Scrolls the list, and not the page, to where a row is seen. */
function reveal(button) {
  const list = byId("list");
  const [outer, own] = [list.getBoundingClientRect(), button.getBoundingClientRect()];
  if (own.top < outer.top) list.scrollTop -= outer.top - own.top;
  else if (own.bottom > outer.bottom) list.scrollTop += own.bottom - outer.bottom;
}

/** Shows an item; `focus` where somebody asked for it. */
function choose(item, focus) {
  stage.show(item, decisionOf(item));
  history.replaceState(null, "", `#${encodeURIComponent(item.id)}`);
  for (const button of document.querySelectorAll("#list .row")) button.removeAttribute("aria-current");
  const button = document.querySelectorAll("#list .row")[shownItems.indexOf(item)];
  button?.setAttribute("aria-current", "true");
  if (button) reveal(button);
  if (focus && window.matchMedia("(max-width: 900px)").matches) byId("stage").scrollIntoView();
}

/** The next item, or the one before. */
function step(by) {
  const next = shownItems[shownItems.indexOf(stage.item) + by];
  if (next) choose(next, false);
}
