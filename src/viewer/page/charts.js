// Charts of what is on the stage.

const CHART = { width: 640, height: 220, left: 52, right: 12, top: 10, bottom: 40 };

/** Counts of the finite values between the ends. */
function counts(values, from, to, bins) {
  const found = new Array(bins).fill(0);
  for (const v of values) {
    if (!Number.isFinite(v)) continue;
    const bin = Math.floor(((v - from) / (to - from)) * bins);
    found[Math.min(bins - 1, Math.max(0, bin))]++;
  }
  return found;
}

/** The ends of all finite values together, a little apart where they are one. */
function ends(all) {
  let [from, to] = [Infinity, -Infinity];
  for (const values of all) {
    for (const v of values) {
      if (!Number.isFinite(v)) continue;
      from = Math.min(from, v);
      to = Math.max(to, v);
    }
  }
  if (!(to >= from)) return [0, 1];
  return to - from < 1e-6 ? [from - 0.5e-3, to + 0.5e-3] : [from, to];
}

/** A histogram of one or two images: { name, values, style }, pixels over `unit`. */
function histogram(series, unit) {
  const bins = 64;
  const [from, to] = ends(series.map((s) => s.values));
  const found = series.map((s) => counts(s.values, from, to, bins));
  const most = Math.max(1, ...found.flat());
  const { width, height, left, right, top, bottom } = CHART;
  const x = (v) => left + ((v - from) / (to - from)) * (width - left - right);
  const y = (n) => height - bottom - (n / most) * (height - top - bottom);
  const names = series.map((s) => s.name).join(" and ");
  const chart = svg("svg", {
    viewBox: `0 0 ${width} ${height}`, role: "img", class: "chart",
    "aria-label": `Histogram of ${names}: pixels over ${unit}, from ${number(from)} to ${number(to)}`,
  });
  const text = (x, y, anchor, words) => svg("text", { x, y, "text-anchor": anchor }, words);
  chart.append(svg("line", { x1: left, x2: width - right, y1: height - bottom, y2: height - bottom, class: "axis" }));
  for (let i = 0; i <= 4; i++) {
    const v = from + ((to - from) * i) / 4;
    chart.append(text(x(v), height - bottom + 16, i === 0 ? "start" : i === 4 ? "end" : "middle", number(v)));
  }
  chart.append(text((left + width - right) / 2, height - 6, "middle", unit));
  chart.append(text(left - 6, top + 10, "end", String(most)), text(left - 6, height - bottom, "end", "0"));
  chart.append(svg("text", { x: 14, y: (height - bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(height - bottom) / 2})` }, "pixels"));
  series.forEach((s, i) => {
    const step = (to - from) / bins;
    let d = `M${x(from)},${y(0)}`;
    found[i].forEach((n, bin) => (d += `V${y(n)}H${x(from + (bin + 1) * step)}`));
    chart.append(svg("path", { d: `${d}V${y(0)}`, class: `line ${s.style}` }));
  });
  const legend = el("div", { class: "legend" }, series.map((s) => el("span", { class: `key ${s.style}` }, s.name)));
  return el("figure", { class: "histogram" }, el("figcaption", {}, "Histogram"), chart, legend);
}

/** A plot that came as a picture. An image runs nothing, whatever it holds. */
function plotFigure(plot) {
  const bytes = new TextEncoder().encode(plot.svg);
  let text = "";
  for (const b of bytes) text += String.fromCharCode(b);
  const image = el("img", { src: `data:image/svg+xml;base64,${btoa(text)}`, alt: plot.alt, loading: "lazy" });
  return el("figure", { class: "plot" }, el("figcaption", {}, plot.title), image);
}
