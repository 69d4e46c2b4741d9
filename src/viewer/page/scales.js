// Numbers to colours. The colours come with the data, so that they are those of the
// report's other pictures.

/** 256 colours of six hexadecimal digits each, as bytes. */
function lookup(colors) {
  const bytes = new Uint8Array(256 * 3);
  for (let i = 0; i < bytes.length; i++) bytes[i] = parseInt(colors.slice(2 * i, 2 * i + 2), 16);
  return bytes;
}

const signedColors = lookup(data.signed.colors);
const flipColors = lookup(data.flip.colors);
const pColors = lookup(data.p.colors);
const greys = new Uint8Array(256 * 3).map((_, i) => Math.floor(i / 3));

/** A scale: `at` is 0 to 1 for a number, `ticks` are numbers on its bar. */
function openness(exposure) {
  const gain = 2 ** exposure;
  const white = 1 / gain;
  return {
    colors: greys,
    at: (v) => v * gain,
    ticks: [0, white / 2, white],
    label: exposure === 0 ? "openness: black closed, white open" : `openness, times ${number(gain)}`,
  };
}

function signedScale(limit) {
  return {
    colors: signedColors,
    at: (v) => (v / limit + 1) / 2,
    ticks: [-limit, -limit / 2, 0, limit / 2, limit],
    label: "test − reference, openness: blue too dark, red too bright",
  };
}

const flipScale = { colors: flipColors, at: (v) => v, ticks: [0, 0.25, 0.5, 0.75, 1], label: data.flip.label };

const pScale = {
  colors: pColors,
  at: (v) => Math.log10(Math.min(1, Math.max(data.least_p, v))) / Math.log10(data.least_p),
  ticks: [1, 0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6],
  label: data.p.label,
};

/** The colours of an image. A pixel without a number is a checker of greys. */
function paint(image, scale) {
  const { width, height, values } = image;
  const pixels = new ImageData(width, height);
  const out = pixels.data;
  for (let i = 0; i < values.length; i++) {
    const v = values[i];
    if (Number.isNaN(v)) {
      const dark = ((i % width) + Math.floor(i / width)) % 2;
      out[4 * i] = out[4 * i + 1] = out[4 * i + 2] = dark ? 150 : 190;
    } else {
      const at = Math.round(Math.min(1, Math.max(0, scale.at(v))) * 255) * 3;
      out[4 * i] = scale.colors[at];
      out[4 * i + 1] = scale.colors[at + 1];
      out[4 * i + 2] = scale.colors[at + 2];
    }
    out[4 * i + 3] = 255;
  }
  return pixels;
}

/** A colour bar with its numbers. */
function bar(scale) {
  const canvas = el("canvas", { width: 256, height: 1, "aria-hidden": "true" });
  const pixels = new ImageData(256, 1);
  for (let i = 0; i < 256; i++) {
    pixels.data.set([scale.colors[3 * i], scale.colors[3 * i + 1], scale.colors[3 * i + 2], 255], 4 * i);
  }
  canvas.getContext("2d").putImageData(pixels, 0, 0);
  const ticks = el(
    "div",
    { class: "ticks" },
    scale.ticks.map((v) => {
      const tick = el("span", {}, v !== 0 && Math.abs(v) < 1e-2 ? v.toExponential(0) : String(+v.toFixed(3)));
      tick.style.left = `${scale.at(v) * 100}%`;
      return tick;
    }),
  );
  return el("div", { class: "bar" }, canvas, ticks, el("span", { class: "bar-label" }, scale.label));
}
