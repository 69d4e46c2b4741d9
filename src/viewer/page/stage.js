// The stage: one case with its images, numbers and verdicts.

const MODES = [
  { id: "side", label: "Side by side", of: () => true },
  { id: "slider", label: "Slider", of: () => true },
  { id: "flicker", label: "Flicker", of: () => true },
  { id: "signed", label: "Difference", of: () => true },
  { id: "flip", label: "FLIP", of: (pair) => pair.flip !== null },
  { id: "p", label: "p-values", of: (pair) => pair.p !== null },
];

const LIMITS = [1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005];

class Stage {
  constructor(root) {
    this.root = root;
    this.mode = "side";
    this.item = null;
    this.pairLabel = null;
    this.panes = [];
    /** Counts what is shown, so that what was decoded too late is not shown. */
    this.turn = 0;
    window.addEventListener("resize", () => this.panes.forEach((p) => p.fit()));
  }

  get pair() {
    return this.item.pairs.find((p) => p.label === this.pairLabel) ?? this.item.pairs[0];
  }

  /** Shows an item. */
  show(item, decide) {
    this.item = item;
    view.zoom = 1;
    view.x = view.y = 0.5;
    view.cursor = null;
    const scene = data.scenes.find((s) => s.name === item.scene);
    const place = `case ${shownItems.indexOf(item) + 1} of ${shownItems.length}`;
    this.readout = el("output", { class: "readout" });
    this.figures = el("div", { class: "panes" });
    this.toolbar = el("div", { class: "toolbar", role: "toolbar", "aria-label": "How the images are shown" });
    this.note = el("p", { class: "note" });
    this.regions = el("div", { class: "legend", hidden: !view.outlined }, REGIONS.map((r) => el("span", { class: `swatch ${r.name}` }, r.name)));
    this.charts = el("div", {});
    this.root.replaceChildren(
      el("div", { class: "head" },
        el("h2", {}, badge(item.outcome), " ", item.id),
        el("div", { class: "step" },
          el("button", { type: "button", click: () => step(-1), title: "Previous (k)" }, "‹ previous"),
          el("span", {}, place),
          el("button", { type: "button", click: () => step(1), title: "Next (j)" }, "next ›"))),
      ...(item.words ? [el("p", { class: "words" }, item.words)] : []),
      ...(decide ? [decide] : []),
      ...(item.pairs.length ? [this.toolbar, this.note, this.figures, this.regions, this.readout, this.charts] : [el("p", { class: "note" }, "There is no image of this case.")]),
      ...this.details(item, scene),
    );
    if (item.pairs.length) this.refresh(true);
  }

  details(item, scene) {
    const parts = [];
    if (item.verdicts.length) {
      const rows = item.verdicts.map((v) => [badge(v.outcome), [v.gate, el("div", { class: "reason" }, v.reason)], v.metric, v.value, v.limit, v.detectable]);
      parts.push(el("h3", {}, "Verdicts"), table("Verdicts", ["outcome", "gate", "metric", "value", "limit", "detectable"], rows.map((r) => r.map((c) => (Array.isArray(c) ? el("span", {}, c) : c)))));
    }
    if (item.facts.length) {
      parts.push(el("h3", {}, "Numbers"), el("dl", { class: "facts" }, item.facts.map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value)))));
    }
    if (scene) {
      parts.push(el("h3", {}, `Scene ${scene.name}`), ...scene.lines.map((line) => el("p", {}, line)), ...scene.plots.map(plotFigure));
    }
    return parts;
  }

  /** Builds toolbar and panes anew; `fresh` where another pair is shown. */
  async refresh(fresh) {
    const pair = this.pair;
    if (fresh) view.limit = pair.limit;
    if (!MODES.find((m) => m.id === this.mode).of(pair)) this.mode = "side";
    const turn = ++this.turn;
    this.fill(pair);
    this.note.textContent = pair.note;
    const ids = [pair.test.plane, pair.reference.plane, pair.flip, pair.p, pair.regions];
    const [test, reference, flip, p, regions] = await Promise.all(ids.map((id) => (id === null ? null : plane(id))));
    if (turn !== this.turn) return;
    this.images = { test, reference, flip, p, regions, signed: difference(test, reference) };
    const layer = {
      test: { image: test, scale: () => openness(view.exposure), name: `test: ${pair.test.name}` },
      reference: { image: reference, scale: () => openness(view.exposure), name: `reference: ${pair.reference.name}` },
      signed: { image: this.images.signed, scale: () => signedScale(view.limit), name: "test − reference" },
      flip: { image: flip, scale: () => flipScale, name: "FLIP" },
      p: { image: p, scale: () => pScale, name: "p-value of a difference, a pixel" },
    };
    const one = (name) => new Pane(this, [layer[name]], "one", regions);
    this.panes = {
      side: () => [one("reference"), one("test"), one("signed")],
      slider: () => [new Pane(this, [layer.reference, layer.test], "slider", regions)],
      flicker: () => [new Pane(this, [layer.reference, layer.test], "flicker", regions)],
      signed: () => [one("signed")],
      flip: () => [one("flip")],
      p: () => [one("p")],
    }[this.mode]();
    // Wide images stand one under the other, so that one place along them is in one line.
    const wide = test.width > 2.2 * test.height;
    this.figures.className = `panes ${this.mode}${wide && this.mode === "side" ? " stack" : ""}`;
    this.figures.replaceChildren(...this.panes.map((p) => p.element));
    this.panes.forEach((pane) => pane.fit());
    this.read(view.cursor);
    this.chart(pair);
  }

  chart(pair) {
    const { test, reference, signed } = this.images;
    const two = [
      { name: pair.reference.name, values: reference.values, style: "reference" },
      { name: pair.test.name, values: test.values, style: "test" },
    ];
    const series = this.mode === "signed" ? [{ name: "test − reference", values: signed.values, style: "test" }] : two;
    this.charts.replaceChildren(histogram(series, this.mode === "signed" ? "difference of openness" : "openness"));
  }

  fill(pair) {
    const press = (attributes, label) => el("button", { type: "button", ...attributes }, label);
    const modes = MODES.filter((m) => m.of(pair)).map((m) => press({
      class: "mode", "data-mode": m.id, "aria-pressed": String(m.id === this.mode), title: `key ${MODES.indexOf(m) + 1}`,
      click: () => this.setMode(m.id),
    }, m.label));
    const choice = el("select", { "aria-label": "What is compared", change: () => { this.pairLabel = choice.value; this.refresh(true); } },
      this.item.pairs.map((p) => el("option", { value: p.label, selected: p === pair }, p.label)));
    const limits = [...new Set([...LIMITS, view.limit])].sort((a, b) => b - a);
    const limit = el("select", { "aria-label": "How far the scale of differences reaches", change: () => { view.limit = +limit.value; this.draw(); } },
      limits.map((l) => el("option", { value: l, selected: l === view.limit }, `± ${l}`)));
    this.exposure = el("output", { class: "exposure" }, this.stops());
    const hold = press({ id: "hold", title: "Hold to see the reference (f)", "aria-pressed": "false" }, "Hold: reference");
    for (const name of ["pointerdown"]) hold.addEventListener(name, () => this.flicker(true));
    for (const name of ["pointerup", "pointerleave", "pointercancel"]) hold.addEventListener(name, () => this.flicker(false));
    this.toolbar.replaceChildren(
      el("div", { class: "group" }, choice),
      el("div", { class: "group", role: "group", "aria-label": "Way of looking" }, modes),
      el("div", { class: "group" },
        press({ title: "Zoom out (−)", "aria-label": "Zoom out", click: () => this.zoom(0.8) }, "−"),
        press({ title: "The whole image (0)", click: () => this.look({ zoom: 1, x: 0.5, y: 0.5 }) }, "Fit"),
        press({ title: "Zoom in (+)", "aria-label": "Zoom in", click: () => this.zoom(1.25) }, "+")),
      el("div", { class: "group" },
        press({ title: "Darker ([)", "aria-label": "Darker", click: () => this.expose(-0.5) }, "darker"),
        this.exposure,
        press({ title: "Brighter (])", "aria-label": "Brighter", click: () => this.expose(0.5) }, "brighter")),
      el("label", { class: "group" }, "scale ", limit),
      ...(pair.regions === null ? [] : [press({ title: "Outline the regions (o)", id: "outline", "aria-pressed": String(view.outlined), click: () => this.outline() }, "Regions")]),
      ...(this.mode === "flicker" ? [hold] : []),
    );
  }

  stops() {
    return `${signed(view.exposure).replace(/\.?0+$/, "") || "0"} EV`;
  }

  setMode(mode) {
    this.mode = mode;
    this.refresh(false);
  }

  expose(by) {
    view.exposure = Math.min(6, Math.max(-6, view.exposure + by));
    this.exposure.textContent = this.stops();
    this.draw();
  }

  outline() {
    view.outlined = !view.outlined;
    this.regions.hidden = !view.outlined;
    byId("outline")?.setAttribute("aria-pressed", String(view.outlined));
    this.draw();
  }

  flicker(on) {
    if (this.mode !== "flicker" || view.flickered === on) return;
    view.flickered = on;
    byId("hold")?.setAttribute("aria-pressed", String(on));
    this.draw();
  }

  /** Moves the view; the middle stays in the image. */
  look(change) {
    Object.assign(view, change);
    view.zoom = Math.min(64, Math.max(1, view.zoom));
    const margin = 0.5 / view.zoom;
    for (const axis of ["x", "y"]) view[axis] = Math.min(1 - margin, Math.max(margin, view[axis]));
    this.draw();
  }

  /** Zooms about a pixel, or the middle. */
  zoom(factor, pixel) {
    const to = Math.min(64, Math.max(1, view.zoom * factor));
    const change = { zoom: to };
    if (pixel) {
      const { width, height } = this.images.test;
      const [px, py] = [(pixel.x + 0.5) / width, (pixel.y + 0.5) / height];
      change.x = px + ((view.x - px) * view.zoom) / to;
      change.y = py + ((view.y - py) * view.zoom) / to;
    }
    this.look(change);
  }

  draw() {
    this.panes.forEach((p) => p.draw());
  }

  /** Reads the images at a pixel. */
  read(pixel) {
    view.cursor = pixel;
    this.draw();
    if (!pixel) {
      this.readout.textContent = "Point at a pixel, or use arrow keys on an image, to read its values.";
      return;
    }
    const { test, reference, signed: less, flip, p, regions } = this.images;
    const i = pixel.y * test.width + pixel.x;
    const parts = [`pixel ${pixel.x}, ${pixel.y}`];
    const along = this.pair.transect[pixel.x];
    if (along !== undefined) parts.push(`t ${number(along)} R`);
    if (regions) parts.push(regionsOf(regions.values[i]).join(", ") || "no region");
    parts.push(`test ${number(test.values[i])}`, `reference ${number(reference.values[i])}`, `difference ${signed(less.values[i])}`);
    if (flip) parts.push(`FLIP ${number(flip.values[i])}`);
    if (p) parts.push(`p ${p.values[i] < data.least_p ? "< 1e-6" : number(p.values[i])}`);
    this.readout.replaceChildren(...parts.map((text) => el("span", {}, text)));
  }
}
