// A pane: one image, or two that share a place. All panes show the same part at the
// same size, so what is seen in one can be found in the others.

/** What all panes share. */
const view = {
  /** 1 shows the whole image. */
  zoom: 1,
  /** The middle, as parts of the image's sides. */
  x: 0.5,
  y: 0.5,
  /** Stops that openness is brightened by. */
  exposure: 0,
  /** How far the scale of differences reaches. */
  limit: 0.1,
  /** Whether regions are outlined. */
  outlined: false,
  /** The slider's place, 0 to 1. */
  split: 0.5,
  /** Whether the reference is shown in turns. */
  flickered: false,
  /** The pixel that is read. */
  cursor: null,
};

const REGIONS = [
  { bit: 1, name: "footprint", color: "#e69f00" },
  { bit: 2, name: "left", color: "#56b4e9" },
  { bit: 4, name: "right", color: "#009e73" },
  { bit: 8, name: "far", color: "#cc79a7" },
];

/** Names of the regions that a pixel lies in. */
const regionsOf = (bits) => REGIONS.filter((r) => bits & r.bit).map((r) => r.name);

const outlines = new WeakMap();

/** The border of each region as lines between pixels. */
function outline(regions) {
  if (outlines.has(regions)) return outlines.get(regions);
  const { width, height, values } = regions;
  const has = (x, y, bit) => x >= 0 && y >= 0 && x < width && y < height && (values[y * width + x] & bit) !== 0;
  const paths = REGIONS.map(({ bit, color }) => {
    const path = new Path2D();
    for (let y = 0; y <= height; y++) {
      for (let x = 0; x <= width; x++) {
        const own = has(x, y, bit);
        if (own !== has(x - 1, y, bit)) path.moveTo(x, y), path.lineTo(x, y + 1);
        if (own !== has(x, y - 1, bit)) path.moveTo(x, y), path.lineTo(x + 1, y);
      }
    }
    return { path, color };
  });
  outlines.set(regions, paths);
  return paths;
}

class Pane {
  /**
   * `layers` are one or two of { image, scale(): scale, name }; `how` is "one", "slider"
   * or "flicker"; `stage` is told of cursors and views.
   */
  constructor(stage, layers, how, regions) {
    this.stage = stage;
    this.layers = layers;
    this.how = how;
    this.regions = regions;
    this.painted = new Map();
    const names = layers.map((l) => l.name).join(how === "slider" ? " | " : " / ");
    this.canvas = el("canvas", {
      tabindex: 0,
      role: "img",
      "aria-label": `${names}. Arrow keys move the cursor, with Shift the view; plus and minus zoom.`,
    });
    this.caption = el("figcaption", {}, names);
    this.bars = el("div", { class: "bars" });
    this.element = el("figure", { class: `pane ${how}` }, this.caption, el("div", { class: "canvas" }, this.canvas), this.bars);
    if (how === "slider") {
      this.range = el("input", {
        type: "range", min: 0, max: 1000, value: view.split * 1000, class: "split",
        "aria-label": `Slider: left of it ${layers[0].name}, right of it ${layers[1].name}`,
        input: () => { view.split = this.range.value / 1000; this.draw(); },
      });
      this.element.insertBefore(this.range, this.bars);
    }
    this.listen();
  }

  get size() {
    return [this.layers[0].image.width, this.layers[0].image.height];
  }

  /** Fits the canvas to its room. */
  fit() {
    const [width, height] = this.size;
    const room = Math.max(1, this.canvas.parentElement.clientWidth);
    const tall = Math.min((room * height) / width, window.innerHeight * 0.6);
    const ratio = window.devicePixelRatio || 1;
    this.canvas.style.height = `${Math.round(tall)}px`;
    this.canvas.width = Math.round(room * ratio);
    this.canvas.height = Math.max(1, Math.round(tall * ratio));
    this.draw();
  }

  /** Canvas pixels an image pixel, and where the image's corner lies. */
  place() {
    const [width, height] = this.size;
    const scale = Math.min(this.canvas.width / width, this.canvas.height / height) * view.zoom;
    return {
      scale,
      left: this.canvas.width / 2 - view.x * width * scale,
      top: this.canvas.height / 2 - view.y * height * scale,
    };
  }

  picture(layer) {
    const scale = layer.scale();
    const key = `${layer.name} ${scale.label} ${scale.ticks}`;
    if (!this.painted.has(key)) {
      this.painted.clear();
      for (const each of this.layers) {
        const canvas = el("canvas", { width: each.image.width, height: each.image.height });
        canvas.getContext("2d").putImageData(paint(each.image, each.scale()), 0, 0);
        this.painted.set(`${each.name} ${each.scale().label} ${each.scale().ticks}`, canvas);
      }
      const scales = new Map(this.layers.map((each) => [each.scale().label, each.scale()]));
      this.bars.replaceChildren(...[...scales.values()].map(bar));
    }
    return this.painted.get(key);
  }

  draw() {
    const { scale, left, top } = this.place();
    const [width, height] = this.size;
    const context = this.canvas.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.imageSmoothingEnabled = false;
    const show = (layer) => context.drawImage(this.picture(layer), left, top, width * scale, height * scale);
    if (this.how === "slider") {
      const at = view.split * this.canvas.width;
      this.clipped(context, 0, at, () => show(this.layers[0]));
      this.clipped(context, at, this.canvas.width - at, () => show(this.layers[1]));
      context.fillStyle = "#e69f00";
      context.fillRect(at - 1.5, 0, 3, this.canvas.height);
    } else if (this.how === "flicker") {
      const layer = this.layers[view.flickered ? 0 : 1];
      this.caption.textContent = `${layer.name} (${view.flickered ? "reference" : "test; hold f for the reference"})`;
      show(layer);
    } else {
      show(this.layers[0]);
    }
    context.setTransform(scale, 0, 0, scale, left, top);
    if (view.outlined && this.regions) {
      context.lineWidth = 2 / scale;
      for (const { path, color } of outline(this.regions)) {
        context.strokeStyle = color;
        context.stroke(path);
      }
    }
    if (view.cursor) {
      for (const [color, wide] of [["#000", 3], ["#fff", 1]]) {
        context.strokeStyle = color;
        context.lineWidth = wide / scale;
        context.strokeRect(view.cursor.x, view.cursor.y, 1, 1);
      }
    }
  }

  clipped(context, left, width, draw) {
    context.save();
    context.beginPath();
    context.rect(left, 0, width, this.canvas.height);
    context.clip();
    draw();
    context.restore();
  }

  /** The image's pixel at a place of the window; null beside the image. */
  pixel(event) {
    const box = this.canvas.getBoundingClientRect();
    const ratio = this.canvas.width / box.width;
    const { scale, left, top } = this.place();
    const x = Math.floor(((event.clientX - box.left) * ratio - left) / scale);
    const y = Math.floor(((event.clientY - box.top) * ratio - top) / scale);
    const [width, height] = this.size;
    return x >= 0 && y >= 0 && x < width && y < height ? { x, y } : null;
  }

  listen() {
    const canvas = this.canvas;
    let grip = null;
    canvas.addEventListener("pointerdown", (event) => {
      grip = { x: event.clientX, y: event.clientY, view: { x: view.x, y: view.y } };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointerup", (event) => {
      grip = null;
      this.stage.read(this.pixel(event));
    });
    canvas.addEventListener("pointercancel", () => (grip = null));
    canvas.addEventListener("pointermove", (event) => {
      if (grip && view.zoom > 1) {
        const ratio = this.canvas.width / canvas.getBoundingClientRect().width;
        const { scale } = this.place();
        const [width, height] = this.size;
        this.stage.look({
          x: grip.view.x - ((event.clientX - grip.x) * ratio) / (scale * width),
          y: grip.view.y - ((event.clientY - grip.y) * ratio) / (scale * height),
        });
      } else if (event.pointerType === "mouse") {
        this.stage.read(this.pixel(event));
      }
    });
    // Without Ctrl the wheel scrolls the page, as everywhere else.
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return;
      event.preventDefault();
      this.stage.zoom(event.deltaY < 0 ? 1.25 : 0.8, this.pixel(event));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    const [width, height] = this.size;
    if (event.shiftKey) {
      this.stage.look({ x: view.x + (step[0] * 0.1) / view.zoom, y: view.y + (step[1] * 0.1) / view.zoom });
      return;
    }
    const from = view.cursor ?? { x: Math.floor(width * view.x), y: Math.floor(height * view.y) };
    const inside = (v, n) => Math.min(n - 1, Math.max(0, v));
    this.stage.read({ x: inside(from.x + step[0], width), y: inside(from.y + step[1], height) });
  }
}
