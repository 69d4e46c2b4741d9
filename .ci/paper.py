"""Measures what the paper says, draws its figures, and fills the page reports/paper/report.md.

paper.py AOGAUGE WORK OUT: runs what WORK does not hold yet (the suites `paper` and reports/paper/sweep.toml, pictures) with the program
AOGAUGE; WORK holds `rays.json` of examples/paper_rays.rs. OUT gets report.md and its pictures. `.ci/peers paper` runs all of it.
"""

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import markdown
import matplotlib
import numpy as np

matplotlib.use("svg")
import matplotlib.pyplot as plt
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

aogauge = sys.argv[1]
work, out = map(Path, sys.argv[2:4])
pictures = out / "pictures"
pictures.mkdir(parents=True, exist_ok=True)
CLIPPED = ["--estimator", "extended", "--set", "receiver_plane=clipped"]
METHODS = {"classic": [], "extended": CLIPPED}


def run(*args, allowed=(0,)):
    ended = subprocess.run([aogauge, *map(str, args)], stdout=subprocess.PIPE, text=True)
    if ended.returncode not in allowed:
        raise SystemExit(f"aogauge {' '.join(map(str, args))} ended with {ended.returncode}")
    return ended.stdout


def records():
    """Both suites; a claim that is not decided is for the page to say."""
    if not (work / "paper/record.json").exists():
        run("run", "paper", "--out", work / "paper", allowed=(0, 1, 6))
    if not (work / "sweep/record.json").exists():
        run("run", "reports/paper/sweep.toml", "--renderer", "cpu", "--out", work / "sweep")
    return [json.loads((work / name / "record.json").read_text()) for name in ("paper", "sweep")]


def looks():
    """The look view of two scenes at three times its size, 32 rays a pixel."""
    for scene in INSETS:
        text = Path(f"scenes/library/{scene}.toml").read_text()
        (work / f"{scene}.toml").write_text(text.replace("resolution = [288, 192]", "resolution = [864, 576]"))
        for method, options in METHODS.items():
            path = work / f"look-{scene}-{method}.png"
            if not path.exists():
                run("render", work / f"{scene}.toml", "--view", "look", "--rays", 32, "--out", path, *options)


# The composite of Fig. 8b: the arcade in the sun, one sample a pixel so that AO alone is noisy.
SUN = "--ambient 0.85,0.95,1.1 --sun-irradiance 7,6.2,5 --sun 268,80 --eye 1.5,0.62,0.6 --target 0,0.1,0 --exposure -0.9 --scale 2 --samples 1"


def noises():
    """FLIP of composites of few rays against one of 1024: the mean over all pixels, over those that differ at 1 ray, and the 99th
    percentile."""
    found = {}
    for method, options in METHODS.items():
        reference = work / f"composite-{method}.png"
        if not reference.exists():
            run("composite", "curtain-arcade", *SUN.split(), *options, "--rays", 1024, "--out", reference)
        for rays in (1, 2, 4, 8, 16, 32):
            test = work / f"composite-{method}-{rays}.png"
            if not test.exists():
                run("composite", "curtain-arcade", *SUN.split(), *options, "--rays", rays, "--out", test)
            pair = json.loads(run("compare", reference, test, "--format", "json"))["pairs"][0]
            flip = pair["scores"]["maps"]["flip"]
            # Where classic AO of one ray differs is where AO acts, for both methods.
            if rays == 1 and method == "classic":
                share = pair["exact"]["share"]
            found.setdefault(method, {})[str(rays)] = {"mean": flip["mean"], "shade": flip["mean"] / share, "p99": flip["p99"]}
    return found


# Okabe and Ito's colours, told apart by everybody.
BLUE, ORANGE, GREEN, RED, BLACK, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#000000", "#8a8a8a"
plt.rcParams.update({
    "font.family": "DejaVu Sans", "font.size": 11, "svg.fonttype": "path", "svg.hashsalt": "aogauge",
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": "#e4e4e4",
    "axes.axisbelow": True, "legend.frameon": False, "figure.constrained_layout.use": True,
})


def save(figure, name):
    kind = Path(name).suffix[1:]
    more = {"dpi": 110, "metadata": {"Software": None}} if kind == "png" else {"metadata": {"Date": None}}
    figure.savefig(pictures / name, facecolor="white", **more)
    plt.close(figure)


def t95(df):
    """The two-sided 95 % quantile of Student's t (Hill 1970, to 0.5 %)."""
    if df is None or not math.isfinite(df):
        return 1.96
    z = 1.959964
    return z + (z**3 + z) / (4 * df) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * df**2)


class Value:
    def __init__(self, metric):
        self.value = metric["value"]
        self.se = metric.get("se") or 0.0
        self.half = self.se * t95(metric.get("df"))

    def __str__(self):
        return written(self.value, self.half)


def written(value, half):
    digits = 4 if half < 0.002 else 3 if half < 0.02 else 2
    text = f"{value:.{digits}f}"
    return f"{text.removeprefix('-') if not float(text) else text} ± {max(half, 10.0**-digits):.{digits}f}".replace("-", "−")


def between(interval):
    return "–" if interval is None else written(sum(interval) / 2, (interval[1] - interval[0]) / 2)


def case(record, scene, estimator, name, region=None, renderer="cpu"):
    """A metric of a case, or None."""
    for c in record["cases"]:
        k = c["case"]
        if (k["scene"], k["estimator"], k["renderer"]) == (scene, estimator, renderer):
            for m in c["metrics"]:
                if m["name"] == name and m.get("region") == region and m.get("value") is not None:
                    return Value(m)
    return None


def scene_of(record, name):
    return next(s for s in record["scenes"] if s["name"] == name)


def judge(record, scene):
    return Value(scene_of(record, scene)["judge"]["contrast"])


def curve(record, scene, label):
    s = scene_of(record, scene)
    found = next(p for p in s["profiles"] if p["label"] == label)
    value = np.array([np.nan if v is None else v for v in found["value"]], float)
    return np.array(s["transect"], float), value


# Fig. 2 and 3


def fig3():
    titles = {(0.02, 0.05): "thin, low", (0.02, 0.1): "thin", (0.1, 0.1): "as wide as its gap", (0.2, 0.05): "wide"}
    figure, axes = plt.subplots(1, 4, figsize=(11.5, 3.3), sharey=True)
    for axis, p in zip(axes, traced["profiles"]):
        w, m = round(p["width"], 3), round(p["gap"], 3)
        edge = w / 2 / traced["radius"]
        axis.axvspan(-edge, edge, color="#eeeeee", lw=0)
        for c, colour in zip(p["curves"], (RED, BLUE)):
            t, o = np.array(c["closed"]).T
            axis.plot(t, o, color=colour, lw=1.6)
            t, o, se = np.array(c["points"]).T
            axis.errorbar(t, o, yerr=2.13 * se, fmt="o", ms=3.2, color=colour, lw=1, mfc="white")
        axis.set_title(f"{titles[w, m]}\nw = {100 * w:.0f} cm, m = {100 * m:.0f} cm", fontsize=11)
        axis.set_xlabel("t / R")
        axis.set_xlim(-1.1, 1.1)
    axes[0].set_ylabel("openness O")
    axes[0].set_ylim(0, 1.05)
    handles = [
        Line2D([], [], color=RED, label="classic"), Line2D([], [], color=BLUE, label="extended, clipped"),
        Line2D([], [], color=GREY, marker="o", mfc="white", ls="", label="CPU reference, 95 %"),
        Rectangle((0, 0), 1, 1, color="#eeeeee", label="under the box"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    save(figure, "fig-3-profiles.svg")


def agreement():
    """The worst standardised difference of the points from their closed forms, and how many points there are."""
    z = []
    for p in traced["profiles"]:
        for c in p["curves"]:
            closed = np.array(c["closed"])
            t, o, se = np.array(c["points"]).T
            z.extend(np.abs(o - np.interp(t, *closed.T)) / np.maximum(se, 1e-4))
    return max(z), len(z)


# Fig. 4 and 7


def fig4():
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 7.2), sharex=True, height_ratios=[2.6, 1])
    top.axhspan(-0.02, 0, color="#cfcfcf", lw=0)
    top.add_patch(Rectangle((-0.01, 0.10), 0.02, 0.3, color="#7a6a5a", lw=0))
    for p in traced["points"]:
        top.add_patch(plt.Circle((p["x"], 0), traced["radius"], fill=False, color="#bbbbbb", lw=0.8, ls=":"))
        for r in p["rays"]:
            (x0, y0), (x1, y1) = r["from"], r["to"]
            colour, dash = (GREY, "--") if r["hit"] else (BLACK, "-")
            top.plot([x0, x1], [y0, y1], color=colour, ls=dash, lw=0.9)
            for s in r["secondary"]:
                (a, b), (c, d) = s["from"], s["to"]
                top.plot([a, c], [b, d], color=ORANGE if s["closed"] else GREEN, lw=2.2, alpha=0.85, solid_capstyle="butt")
        top.plot([p["x"]], [0], "o", color=BLACK, ms=5, zorder=5)
    top.set_aspect("equal")
    top.set_ylim(-0.02, 0.3)
    top.set_ylabel("height, m")
    handles = [
        Line2D([], [], color=BLACK, lw=1, label="open primary ray, length R"), Line2D([], [], color=GREY, ls="--", lw=1, label="closed primary ray"),
        Line2D([], [], color=GREEN, lw=2.2, label="open secondary ray, ±R'"), Line2D([], [], color=ORANGE, lw=2.2, label="closed secondary ray"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=2)
    p = next(p for p in traced["profiles"] if (round(p["width"], 3), round(p["gap"], 3)) == (0.02, 0.1))
    for c, colour in zip(p["curves"], (RED, BLUE)):
        t, o = np.array(c["closed"]).T
        bottom.plot(t * traced["radius"], o, color=colour, lw=1.6, label="classic" if c["name"] == "classic" else "extended")
    for q in traced["points"]:
        bottom.axvline(q["x"], color="#bbbbbb", lw=0.8, ls=":")
    bottom.set_ylabel("openness O")
    bottom.set_ylim(0, 1.05)
    bottom.set_xlabel("distance from the curtain's middle along the transect, m")
    bottom.legend(loc="lower right", ncols=2)
    bottom.set_xlim(-0.28, 0.48)
    save(figure, "fig-4-rays.svg")


# Fig. 1, 5, 6


def fig5():
    shown = ["classic", "unity-medium", "unreal-default", "microsoft-sample", "paper-32", "path-traced"]
    titles = ["classic, R = 0.25 m", "Unity, medium", "Unreal, default", "Microsoft's sample", "the paper, 32 rays", "path traced"]
    scenes = ["curtain-arcade", "curtain-room"]
    figure, axes = plt.subplots(4, 3, figsize=(10, 9.6))
    for rows, scene in zip((axes[:2], axes[2:]), scenes):
        for axis, method, title in zip(rows.flat, shown, titles):
            folder = work / "paper/pictures" / scene
            path = folder / "path-traced.png" if method == "path-traced" else folder / "look" / f"{method}.png"
            axis.imshow(plt.imread(path), interpolation="nearest", cmap="gray", vmin=0, vmax=1)
            plain(axis, "#cccccc", 1)
            axis.set_title(title, fontsize=13)
        for row in rows:
            row[0].set_ylabel(scene.removeprefix("curtain-"), fontsize=13)
    save(figure, "fig-5-engines.png")


def fig6():
    scenes = [s for s in ("curtain-arcade", "curtain-room", "pillar", "curtain-open", "atrium") if has(paper, s)]
    figure, axes = plt.subplots(2, 3, figsize=(10, 6.6), sharey=True)
    axes = axes.flat
    axes[5].set_visible(False)
    for axis, scene in zip(axes, scenes):
        for label, colour, width in (("Q", BLACK, 2.0), ("classic", RED, 1.4), ("paper-32", BLUE, 1.4)):
            t, value = curve(paper, scene, label)
            axis.plot(t, value, color=colour, lw=width)
        axis.set_title(f"{scene.removeprefix('curtain-')}\nK(Q) = {judge(paper, scene)}", fontsize=10.5)
        axis.set_xlabel("t / R")
        axis.set_xlim(-1, 1)
        axis.set_ylim(0, 1.3)
    for axis in (axes[0], axes[3]):
        axis.set_ylabel("openness O, occlusion ratio Q")
    handles = [Line2D([], [], color=c, lw=2, label=n) for c, n in ((BLACK, "Q, path traced"), (RED, "classic"), (BLUE, "the paper, 32 rays"))]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    save(figure, "fig-6-path-traced.svg")


def has(record, scene):
    found = [s for s in record["scenes"] if s["name"] == scene]
    return bool(found and found[0]["judge"] and found[0]["judge"]["contrast"]["value"] is not None)


# Fig. 8a

# What is magnified of both, in parts of the picture's width and height: left, top, width, height.
INSETS = {"curtain-arcade": (0.36, 0.46, 0.20, 0.24), "pillar": (0.36, 0.40, 0.20, 0.24)}


def fig8a():
    figure, axes = plt.subplots(1, 2, figsize=(14.5, 5.2))
    for axis, (scene, (left, top, w, h)) in zip(axes, INSETS.items()):
        images = [plt.imread(work / f"look-{scene}-{m}.png") for m in METHODS]
        classic, extended = (i if i.ndim == 2 else i[..., 0] for i in images)
        height, width = classic.shape
        both = np.hstack([classic[:, : width // 2], extended[:, width // 2 :]])
        axis.imshow(both, cmap="gray", vmin=0, vmax=1, interpolation="antialiased")
        axis.axvline(width / 2, color=GREY, lw=1)
        x, y, w, h = (round(v) for v in (left * width, top * height, w * width, h * height))
        axis.add_patch(Rectangle((x, y), w, h, fill=False, color=BLACK, lw=1))
        for image, colour, name, at in ((classic, RED, "classic", 0.015), (extended, BLUE, "extended", 0.685)):
            inset = axis.inset_axes([at, 0.58, 0.3, 0.36])
            inset.imshow(image[y : y + h, x : x + w], cmap="gray", vmin=0.5, vmax=1, interpolation="nearest", aspect="auto")
            plain(inset, colour, 2)
            inset.text(0.03, 0.05, name, transform=inset.transAxes, color=colour, fontsize=12, weight="bold")
        axis.set_title(f"{scene}: left classic, right extended (clipped, R' = R/4)", fontsize=12)
        plain(axis, "#cccccc", 1)
    save(figure, "fig-8a-openness.png")


def plain(axis, colour, width):
    """No ticks, and a frame of this colour."""
    axis.set_xticks([])
    axis.set_yticks([])
    axis.grid(False)
    for side in axis.spines.values():
        side.set(visible=True, color=colour, linewidth=width)


# Noise


def noise_plot():
    figure, axis = plt.subplots(figsize=(6.4, 3.4))
    for method, colour in (("classic", RED), ("extended", BLUE)):
        rays = sorted(map(int, noise[method]))
        shade = [noise[method][str(n)]["shade"] for n in rays]
        axis.plot(rays, shade, "o-", color=colour, label=method)
    axis.set_xscale("log", base=2)
    axis.set_yscale("log")
    axis.set_xticks(rays, [str(n) for n in rays])
    axis.set_yticks([0.02, 0.05, 0.1], ["0.02", "0.05", "0.1"])
    axis.minorticks_off()
    axis.set_xlabel("primary rays a pixel")
    axis.set_ylabel("mean FLIP where AO acts")
    axis.legend()
    save(figure, "noise.svg")


# The sweep

# R' by its name in the suite.
LENGTHS = {"1-8": "R/8", "1-4": "R/4", "3-8": "3R/8", "1-2": "R/2", "3-4": "3R/4", "1": "R"}
PLACES = [
    ("curtain-arcade", "arcade, albedo 0.6", BLUE, "o"), ("arcade-albedo-20", "arcade, albedo 0.2", "#56B4E9", "v"),
    ("arcade-albedo-80", "arcade, albedo 0.8", GREEN, "^"), ("curtain-room", "room, albedo 0.6", ORANGE, "s"),
    ("curtain-open", "open ground", RED, "D"),
]


def pareto():
    figure, axes = plt.subplots(1, 2, figsize=(11.5, 4.2), sharey=True)
    for axis, receiver in zip(axes, ("clipped", "counts")):
        axis.axhline(0, color=BLACK, lw=1)
        for scene, label, colour, marker in PLACES:
            found = [(case(sweep, scene, f"{receiver}-{n}", "over-darkening"), case(sweep, scene, f"{receiver}-{n}", "contrast-error")) for n in LENGTHS]
            first = (0.0, case(sweep, scene, "classic", "contrast-error").value)
            x, y = zip(first, *((a.value, b.value) for a, b in found))
            axis.plot(x, y, marker=marker, color=colour, lw=1.2, ms=5, label=label)
            if scene == "curtain-arcade":
                for length, a, b in zip(LENGTHS.values(), x[1:], y[1:]):
                    axis.annotate(length, (a, b), xytext=(3, -13), textcoords="offset points", fontsize=9, color=colour)
        axis.set_title({"clipped": "secondary rays end at the receiver's plane", "counts": "the receiver closes secondary rays (the paper, literally)"}[receiver], fontsize=11)
        axis.set_xlabel("darkening: mean of O(classic) − O over the view")
    axes[0].set_ylabel("contrast error dK")
    axes[0].annotate("classic", (0.0, case(sweep, "curtain-arcade", "classic", "contrast-error").value), xytext=(6, 6), textcoords="offset points", fontsize=9)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    save(figure, "sweep.svg")


def front():
    """The table of R' over scenes: dK, and what is taken away."""
    lines = ["| R' | " + " | ".join(label for _, label, _, _ in PLACES) + " | darkening, arcade |", "|--|" + "--:|" * (len(PLACES) + 1)]
    rows = [("classic", "classic")] + [(f"clipped-{n}", length) for n, length in LENGTHS.items()]
    for estimator, label in rows:
        values = [str(case(sweep, s, estimator, "contrast-error")) for s, _, _, _ in PLACES]
        dark = case(sweep, "curtain-arcade", estimator, "over-darkening")
        lines.append(f"| {label} | " + " | ".join(values) + f" | {dark or '–'} |")
    return "\n".join(lines)


def height():
    gaps = [("arcade-gap-05", 0.05), ("curtain-arcade", 0.10), ("arcade-gap-13", 0.13), ("arcade-gap-15", 0.15), ("arcade-gap-16", 0.16), ("arcade-gap-18", 0.18)]
    figure, axis = plt.subplots(figsize=(6.8, 3.6))
    for name, ratio, colour in (("1-4", 0.25, BLUE), ("3-8", 0.375, GREEN), ("1-2", 0.5, ORANGE)):
        reach = math.sqrt(0.25 + ratio**2)
        values = [case(sweep, s, f"clipped-{name}", "removed") for s, _ in gaps]
        axis.errorbar([m / 0.25 for _, m in gaps], [v.value for v in values], yerr=[v.half for v in values], fmt="o", color=colour, ms=5, lw=1.3, label=f"R' = {LENGTHS[name]}: reach {reach:.2f} R")
        axis.axvline(reach, color=colour, lw=1, ls="--")
    axis.axhline(0, color=BLACK, lw=1)
    axis.set_xlabel("height of the hem over the ground, m / R")
    axis.set_ylabel("removed of classic's error, 0 to 1")
    axis.set_ylim(-0.1, 1.05)
    axis.legend(loc="lower left", bbox_to_anchor=(0.02, 0.08))
    save(figure, "height.svg")


def counts():
    lines = ["| secondary rays | removed, arcade | removed, room | time, over classic (one run) |", "|--:|--:|--:|--:|"]
    for n, estimator in ((1, "clipped-1-rays"), (2, "clipped-1-4"), (4, "clipped-4-rays"), (8, "clipped-8-rays")):
        values = [str(case(sweep, s, estimator, "removed")) for s in ("curtain-arcade", "curtain-room")]
        lines.append(f"| {n} | {' | '.join(values)} | {ratio(sweep, 'curtain-arcade', estimator):.1f} |")
    return "\n".join(lines)


def seconds(record, scene, estimator):
    """CPU seconds of a ray of a case, up to a factor that all cases of the scene share."""
    found = [(k, v) for k, v in record["timing"]["cases"].items() if k.startswith(f"{scene}/{estimator}/cpu/")]
    [(name, value)] = found
    return value / int(name.rsplit("/", 1)[1])


def ratio(record, scene, estimator):
    return seconds(record, scene, estimator) / seconds(record, scene, "classic")


# The claims

WORDS = {"pass": "holds", "known-failure": "**fails**", "fail": "**fails**", "inconclusive": "open", "warn": "holds"}


def number(v):
    return f"{v:g}".replace("-", "−")


def limit(l):
    if "at-least" in l:
        return f"at least {number(l['at-least'])}"
    if "at-most" in l:
        return f"at most {number(l['at-most'])}"
    e = l["equals"]
    return f"{number(e['target'])} within {number(e['within'])}"


def worst(verdicts):
    """The verdict of a gate: its worst, by the margin."""
    order = ["fail", "inconclusive", "known-failure", "warn", "pass"]
    return min(verdicts, key=lambda v: (order.index(v["outcome"]), v["margin"] if v["margin"] is not None else 9e9))


def claims(short=False):
    lines = ["| claim | measured | |", "|---|--:|---|"] if short else ["| claim | nearest to its limit | measured | limit | |", "|---|---|--:|---|---|"]
    for gate in paper["suite"]["gates"]:
        found = [v for v in paper["verdicts"] if v["gate"] == gate["name"]]
        if not found or gate["name"].startswith("GPU"):
            continue
        v = worst(found)
        where = v["scene"] + (f", {v['case']['estimator']}" if v.get("case") else ", judge")
        against = f" of {v['against']['name']}" if v.get("against") else ""
        if short:
            lines.append(f"| {gate['name']} | {between(v['interval'])} | {WORDS[v['outcome']]} |")
            continue
        lines.append(f"| {gate['name']} | {where} | {between(v['interval'])} | {limit(v['limit'])}{against} | {WORDS[v['outcome']]} |")
    flip = noise["extended"]["4"]
    four = f"FLIP {flip['shade']:.3f} where AO acts"
    cost = f"{ratio(paper, 'curtain-arcade', 'paper-32'):.1f} times classic AO's time, on the CPU"
    more = [
        ("Section 6: the noise of 4 rays is unnoticeable in the composed picture", "curtain-arcade in the sun, clipped", four, "a matter of who looks"),
        ("Section 6: an additional 15 ms of 32 rays at 1080p", "curtain-arcade, paper-32", cost, "needs the paper's GPU"),
    ]
    for claim, where, measured, why in more:
        lines.append(f"| {claim} | {measured} | open |" if short else f"| {claim} | {where} | {measured} | {why} | open |")
    return "\n".join(lines)


def renderers_agree():
    """Gates whose verdicts differ between the CPU and the GPU in one scene."""
    by = {}
    for v in paper["verdicts"]:
        k = v.get("case")
        if k and not v["gate"].startswith("GPU"):
            by.setdefault((v["gate"], k["scene"], k["estimator"]), {})[k["renderer"]] = v["outcome"]
    both = {k: o for k, o in by.items() if len(o) == 2}
    return len(both), [k for k, o in both.items() if o["cpu"] != o["gpu"]]


STYLE = """body { font: 17px/1.55 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #1b1b1b; background: #fff }
h1, h2 { line-height: 1.2; margin-top: 2.2rem } img { max-width: 100%; height: auto } table { border-collapse: collapse; font-size: 15px; display: block; overflow-x: auto }
th, td { border: 1px solid #d0d0d0; padding: .3rem .6rem; vertical-align: top; text-align: left } th { background: #f3f3f3 }
a { color: #005a9c } pre { background: #f5f5f5; padding: .8rem; overflow-x: auto }"""


def html(text):
    """The page for browsers; pictures and links stay beside it."""
    body = markdown.markdown(text, extensions=["tables", "fenced_code"])
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>The paper, measured</title><style>{STYLE}</style>'
    return f'<!doctype html><html lang="en"><head>{head}</head><body>\n{body}\n</body></html>\n'


def fill():
    z, points = agreement()
    both, differ = renderers_agree()
    assert not differ, differ
    values = {
        "claims": claims(), "front": front(), "counts": counts(),
        "points": points, "z": f"{z:.1f}", "rays": traced["rays"] * traced["replicates"],
        "both": both, "cpu": paper["machine"]["cpu"], "gpu": paper["machine"]["gpu"],
        "replicates": paper["suite"]["replicates"],
        "cost_32": f"{ratio(paper, 'curtain-arcade', 'paper-32'):.1f}",
    }
    for method in ("classic", "extended"):
        for n, found in noise[method].items():
            values |= {f"flip_{method}_{n}": f"{found['mean']:.4f}", f"shade_{method}_{n}": f"{found['shade']:.3f}", f"p99_{method}_{n}": f"{found['p99']:.3f}"}
    for scene in ("curtain-arcade", "curtain-room", "pillar", "curtain-open", "atrium"):
        if has(paper, scene):
            values[f"kq {scene}"] = judge(paper, scene)
    page = (Path(__file__).parent / "paper-report.md").read_text()

    def put(match):
        key = match[1].strip()
        if key in values:
            return str(values[key])
        # SCENE ESTIMATOR METRIC [REGION] [of sweep]
        record = sweep if key.endswith(" of sweep") else paper
        parts = key.removesuffix(" of sweep").split()
        found = case(record, *parts)
        if found is None:
            raise SystemExit(f"the page asks for '{key}', which no record has")
        return str(found)

    (out / "report.md").write_text(re.sub(r"\{\{(.*?)\}\}", put, page))
    (out / "report.html").write_text(html((out / "report.md").read_text()))
    readme = Path("README.md")
    first, rest = readme.read_text().split("<!-- claims, by .ci/peers paper -->\n")
    last = rest.split("<!-- end of claims -->\n")[1]
    readme.write_text(f"{first}<!-- claims, by .ci/peers paper -->\n{claims(short=True)}\n<!-- end of claims -->\n{last}")


paper, sweep = records()
traced = json.loads((work / "rays.json").read_text())
looks()
noise = noises()
for draw in (fig3, fig4, fig5, fig6, fig8a, noise_plot, pareto, height):
    draw()
fill()
