// What a reviewer does with the HTML report and with `golden review`, in a real browser:
//   node browser.mjs AOGAUGE REPORT.html OTHER-RECORD GOLDENS
// The record of another seed differs from the goldens, so that there is something to review.
import { spawn } from "node:child_process";
import { readFileSync, readdirSync, statSync } from "node:fs";
import { inflateSync } from "node:zlib";
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import path from "node:path";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [aogauge, report, record, goldens] = process.argv.slice(2);
const require = createRequire(path.join(process.env.BROWSER_MODULES, "x.js"));
const { chromium } = require("playwright-core");
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
const done = [];
const did = (what) => (done.push(what), console.log(what));

/** A page that may say nothing on its console and ask for nothing. */
async function open(url, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 1000 }, ...options });
  const page = await context.newPage();
  const faults = [];
  page.on("console", (m) => faults.push(`console: ${m.text()}`));
  page.on("pageerror", (e) => faults.push(`error: ${e.message}`));
  page.on("request", (r) => {
    if (!/^(data|blob|file):/.test(r.url()) && !r.url().startsWith(new URL(url).origin)) faults.push(`request: ${r.url()}`);
  });
  const began = Date.now();
  await page.goto(url);
  await page.locator(".pane canvas").first().waitFor();
  return { context, page, faults, took: Date.now() - began };
}

/** What a canvas shows. */
const shown = (page, selector) => page.locator(selector).first().evaluate((c) => c.toDataURL());

/** An image of the report, decoded without its script. */
function plane(html, id) {
  const text = html.match(new RegExp(`<script type="text/plain" id="plane-${id}">([^<]*)</script>`))[1];
  const bytes = inflateSync(Buffer.from(text, "base64"));
  const n = bytes.length / 4;
  const view = new DataView(new ArrayBuffer(4));
  return Array.from({ length: n }, (_, i) => {
    for (let b = 0; b < 4; b++) view.setUint8(b, bytes[b * n + i]);
    return view.getFloat32(0, true);
  });
}

async function reading(html, data) {
  const size = statSync(report).size;
  assert(size < 15e6, `${size} bytes`);
  const { context, page, faults, took } = await open(pathToFileURL(path.resolve(report)).href);
  assert(took < 2000, `opened in ${took} ms`);
  did(`the report has ${(size / 1e6).toFixed(1)} MB and opens with its first images in less than 2 s`);

  const all = await page.locator("#list .row").count();
  assert.equal(all, data.items.length);
  const estimator = data.items.find((i) => i.renderer !== "judge").estimator;
  await page.locator("select[name=estimator]").selectOption(estimator);
  assert.equal(await page.locator("#list .row").count(), data.items.filter((i) => i.estimator === estimator).length);
  await page.locator("select[name=estimator]").selectOption("");
  const outcome = data.items[0].outcome;
  await page.locator(`#filters input[value=${outcome}]`).check();
  assert.equal(await page.locator("#list .row").count(), data.items.filter((i) => i.outcome === outcome).length);
  await page.locator(`#filters input[value=${outcome}]`).uncheck();
  await page.locator("#filters [type=search]").fill(data.items.at(-1).id);
  assert((await page.locator("#list .row").count()) >= 1);
  await page.locator("#filters [type=search]").fill("");
  await page.locator("#list .row").first().click();
  did("filters by estimator, by verdict and by name show what they should");

  await page.getByRole("button", { name: "Slider", exact: true }).click();
  await page.locator(".pane.slider canvas").first().waitFor();
  const middle = await shown(page, ".pane.slider canvas");
  await page.locator("input.split").fill("900");
  assert.notEqual(await shown(page, ".pane.slider canvas"), middle);
  did("the slider moves");

  await page.keyboard.press("Escape");
  await page.locator("#stage").focus();
  await page.keyboard.press("3");
  await page.locator(".pane.flicker canvas").first().waitFor();
  const test = await shown(page, ".pane.flicker canvas");
  await page.keyboard.down("f");
  const reference = await shown(page, ".pane.flicker canvas");
  await page.keyboard.up("f");
  assert.notEqual(test, reference);
  assert.equal(await shown(page, ".pane.flicker canvas"), test);
  did("holding f shows the reference, letting go the test image");

  await page.keyboard.press("1");
  await page.locator(".pane.one .canvas canvas").first().waitFor();
  const pair = data.items[0].pairs[0];
  const { width, height } = data.planes[pair.test.plane];
  const canvas = page.locator(".pane.one .canvas canvas").nth(1);
  const box = await canvas.boundingBox();
  // The image fills its pane's width or height, in the middle.
  const scale = Math.min(box.width / width, box.height / height);
  const [x, y] = [Math.floor(width * 0.4), Math.floor(height * 0.6)];
  await page.mouse.move(box.x + box.width / 2 + (x + 0.5 - width / 2) * scale, box.y + box.height / 2 + (y + 0.5 - height / 2) * scale);
  const text = await page.locator(".readout").innerText();
  const value = (id) => plane(html, id)[y * width + x];
  const number = (name) => Number(text.match(new RegExp(`${name} ([−+]?[0-9.e−-]+)`))[1].replaceAll("−", "-"));
  assert(text.includes(`pixel ${x}, ${y}`), text);
  assert(Math.abs(number("test") - value(pair.test.plane)) <= 5e-5, text);
  assert(Math.abs(number("reference") - value(pair.reference.plane)) <= 5e-5, text);
  assert(Math.abs(number("difference") - (value(pair.test.plane) - value(pair.reference.plane))) <= 6e-5, text);
  did("the value under the cursor is that of the image's floats");

  const before = await shown(page, ".pane.one .canvas canvas");
  await page.keyboard.press("]");
  assert.notEqual(await shown(page, ".pane.one .canvas canvas"), before);
  await page.keyboard.press("[");
  assert.equal(await shown(page, ".pane.one .canvas canvas"), before);
  await page.keyboard.press("+");
  assert.notEqual(await shown(page, ".pane.one .canvas canvas"), before);
  await page.keyboard.press("0");
  assert.equal(await shown(page, ".pane.one .canvas canvas"), before);
  did("exposure and zoom change all panes, and go back");

  for (const [key, mode] of [["4", "signed"], ["5", "flip"], ["6", "p"]]) {
    await page.keyboard.press(key);
    await page.locator(`#stage .panes.${mode} canvas`).first().waitFor();
    assert((await page.locator(".bar .ticks span").count()) >= 3);
  }
  did("difference, FLIP and p-values have pictures with their scales");

  const title = () => page.locator("#stage h2").innerText();
  const first = await title();
  await page.keyboard.press("j");
  assert.notEqual(await title(), first);
  await page.keyboard.press("k");
  assert.equal(await title(), first);
  await page.keyboard.press("1");
  await page.locator(".pane.one .canvas canvas").nth(1).focus();
  await page.keyboard.press("ArrowRight");
  const read = await page.locator(".readout").innerText();
  await page.keyboard.press("ArrowDown");
  assert(/pixel \d+, \d+/.test(read) && read !== (await page.locator(".readout").innerText()));
  await page.keyboard.press("?");
  assert(await page.locator("#help").evaluate((d) => d.open));
  await page.keyboard.press("Escape");
  did("keys alone step through cases, read pixels and show the list of keys");

  // From the top, Tab alone reaches the list, a way of looking and an image.
  await page.evaluate(() => { document.activeElement.blur(); window.getSelection().removeAllRanges(); });
  const reached = new Set();
  for (let i = 0; i < 400 && reached.size < 3; i++) {
    await page.keyboard.press("Tab");
    reached.add(await page.evaluate(() => {
      const a = document.activeElement;
      return a.closest("#list") ? "list" : a.matches(".mode") ? "mode" : a.matches(".pane canvas") ? "image" : "other";
    }));
    reached.delete("other");
  }
  assert.deepEqual([...reached].sort(), ["image", "list", "mode"]);
  did("Tab reaches the list, the ways of looking and the images");

  for (const tab of ["gates", "plots", "about"]) {
    const button = page.locator(`#to-${tab}`);
    if (await button.count()) await button.click();
  }
  const unnamed = await page.evaluate(() => [...document.querySelectorAll("img, canvas, svg")].filter((e) =>
    !(e.getAttribute("alt") || e.getAttribute("aria-label") || e.closest("[aria-hidden=true]"))).length);
  assert.equal(unnamed, 0);
  did("every picture has words");
  assert.deepEqual(faults, []);
  did("nothing on the console, no request");
  await context.close();
}

async function accessible() {
  for (const [colorScheme, viewport] of [["light", { width: 1400, height: 1000 }], ["dark", { width: 420, height: 900 }]]) {
    const { context, page } = await open(pathToFileURL(path.resolve(report)).href, { bypassCSP: true, colorScheme, viewport });
    await page.addScriptTag({ path: require.resolve("axe-core/axe.min.js") });
    const { violations } = await page.evaluate(() => window.axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21aa"] }));
    assert.deepEqual(violations.map((v) => `${v.id}: ${v.nodes.length}, ${v.nodes[0].html.slice(0, 200)}`), []);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
    assert(wide <= 0, `${wide} pixels too wide`);
    await context.close();
  }
  did("axe finds no fault (WCAG 2.1 AA), light on a desk and dark on a phone; nothing is wider than the phone");
}

/** Hashes of a store's goldens by file. */
function store() {
  const files = readdirSync(goldens, { recursive: true }).map(String).filter((f) => f.endsWith(".exr")).sort();
  return Object.fromEntries(files.map((f) => [f, createHash("sha256").update(readFileSync(path.join(goldens, f))).digest("hex")]));
}

async function review() {
  const child = spawn(aogauge, ["golden", "review", record, "--goldens", goldens, "--all"], { stdio: ["ignore", "pipe", "inherit"] });
  // Where a check fails nobody else ends it.
  process.on("exit", () => child.kill());
  const ended = new Promise((resolve) => child.on("exit", resolve));
  const address = await new Promise((resolve) => child.stdout.on("data", (d) => resolve(String(d).trim())));
  assert(/^http:\/\/127\.0\.0\.1:\d+\/\?token=[0-9a-f]{64}$/.test(address), address);
  const { context, page, faults } = await open(address);
  const before = store();
  const id = await page.locator("#stage h2").innerText();
  await page.keyboard.press("a");
  assert.equal(await page.locator("#decided").innerText(), "Say why first.");
  assert.deepEqual(store(), before, "nothing is approved without a reason");
  await page.keyboard.type("looks right, | <b>really</b>");
  await page.keyboard.press("Escape");
  await page.keyboard.press("a");
  await page.getByText("Approved:").waitFor();
  const after = store();
  const changed = Object.keys(after).filter((f) => after[f] !== before[f]);
  assert.equal(changed.length, 1, `${changed} changed for ${id}`);
  did("a approves the case that is shown, with its reason, and one golden changes");

  await page.keyboard.press("j");
  await page.locator("#reason").fill("too dark at the hem");
  await page.locator("#reject").click();
  await page.getByText("Rejected:").waitFor();
  assert.deepEqual(store(), after, "a golden changed");
  const { rejected } = JSON.parse(readFileSync(path.join(goldens, "rejected.json"), "utf8"));
  assert.equal(rejected.length, 1);
  assert.equal(rejected[0].reason, "too dark at the hem");
  did("reject leaves the golden and keeps the reason");
  const rows = page.locator("#list .row");
  const [scene, one, all] = [(await page.locator("#stage h2").innerText()).match(/(\S+)\/.*\/.*\//)[1], page.locator("#filters input[value=fail]"), await rows.count()];
  await one.check();
  await page.locator("select[name=scene]").selectOption(scene);
  await page.locator("#filters [type=search]").fill(scene);
  assert.equal(await rows.count(), 1);
  await page.locator("#reason").fill("right after all");
  await page.locator("#approve").click();
  await page.locator("#decided", { hasText: "Approved:" }).waitFor();
  assert.equal(await one.count(), 0, "nothing fails, and there is a box for it");
  assert.equal(await page.locator("#filters input:checked").count(), 0);
  assert.equal(await rows.count(), 1, "what was approved has left the list");
  assert.equal(await page.locator("select[name=scene]").inputValue(), scene);
  assert.equal(await page.locator("#filters [type=search]").inputValue(), scene);
  await page.locator("#filters [type=search]").fill("");
  await page.locator("select[name=scene]").selectOption("");
  assert.equal(await rows.count(), all);
  did("a decision leaves the filters as they are shown, and takes away one that nothing passes any more");

  let release;
  const held = new Promise((resolve) => { release = resolve; });
  await page.route("**/decide", async (route) => { await held; await route.continue(); });
  const badge = page.locator("#stage h2 .badge");
  await page.locator("#reason").fill("wrong after all");
  await page.locator("#reject").click();
  const rejectedCase = await page.locator("#stage h2").innerText();
  await page.keyboard.press("k");
  assert.notEqual(await page.locator("#stage h2").innerText(), rejectedCase);
  assert.equal(await badge.innerText(), "PASS");
  release();
  await page.locator("#list .badge.fail").waitFor();
  assert.equal(await badge.innerText(), "PASS", "the badge of another case");
  await page.locator("#stage").focus();
  await page.keyboard.press("j");
  assert.equal(await badge.innerText(), "FAIL");
  assert((await page.locator("#decided").innerText()).startsWith("Rejected:"));
  did("an answer that comes late is shown with its own case");

  await page.locator("#finish").click();
  assert.deepEqual(faults, []);
  await ended;
  did("the button ends the review");
  await context.close();
}

try {
  const html = readFileSync(report, "utf8");
  const data = JSON.parse(html.match(/<script type="application\/json" id="data">(.*)<\/script>/)[1]);
  await reading(html, data);
  await accessible();
  await review();
} finally {
  await browser.close();
}
