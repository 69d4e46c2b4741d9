"""Holds aogauge's `path-traced`, the judge, against Blender's Cycles and Mitsuba 3, on every scene.

against-peers-light.py KIT... --aogauge PROGRAM --out FOLDER: renders the measure view of each kit with and without the occluder
with the shipped adapters, and compares irradiance over pi along the transect. Writes light.md, light.svg and
profiles.svg; ends with 1 where a bin differs too much.
"""

import itertools
import math
import sys
import time

import matplotlib
import numpy as np

from peer_images import Cycles, Mitsuba, arguments, kept

matplotlib.use("svg")
import matplotlib.pyplot as plt

LIMIT = 0.01  # relative difference of a bin
NOISE = 0.005  # relative standard error of a bin's difference
BIN = 8  # columns of the narrowest bin
FIRST = 8  # images that tell how many more are needed
# Samples a pixel of an image, and the most samples of all images, all pixels together.
EACH = {"aogauge": 32, "Cycles": 16, "Mitsuba": 64}
MOST = {"aogauge": 12e6, "Cycles": 3e6, "Mitsuba": 24e6}
WHAT = ("with", "without")


def mean_se(replicates):
    return replicates.mean(0), replicates.std(0, ddof=1) / np.sqrt(len(replicates))


def columns(images):
    """Means over the rows of bins of BIN columns, an image a row."""
    return images.astype("f8").mean(1).reshape(len(images), -1, BIN).mean(2)


def enough(render, program, pixels):
    """Images until the mean bin is known well enough, and the seconds they took."""
    started = time.time()
    images = render(EACH[program], 1, FIRST)
    mean, se = mean_se(columns(images))
    # Half of the variance is the other program's, and the darkest bins are merged.
    wanted = FIRST * (np.quantile(se / mean, 0.75) / (NOISE / math.sqrt(2))) ** 2
    most = MOST[program] / (EACH[program] * pixels)
    more = math.ceil(min(wanted, most)) - FIRST
    if more > 0:
        images = np.concatenate([images, render(EACH[program], 1 + FIRST, more)])
    return images, time.time() - started


def difference(theirs, ours):
    """Means of both, relative difference and its standard error, of lists of numbers an image."""
    (m, m_se), (a, a_se) = mean_se(theirs), mean_se(ours)
    return m, a, a / m - 1, a / m * np.hypot(m_se / m, a_se / a)


class Bins:
    """Neighbours are put together, from the left, until the difference is known well enough; what is left over at the
    right joins the last. The difference itself decides nothing."""

    def __init__(self, theirs, ours, wide):
        t, o = columns(theirs), columns(ours)
        edges, first = [0], 0
        for last in range(1, t.shape[1] + 1):
            if difference(t[:, first:last].mean(1), o[:, first:last].mean(1))[3] <= NOISE:
                edges.append(last)
                first = last
        if edges[-1] != t.shape[1]:
            edges[-1 if len(edges) > 1 else len(edges) :] = [t.shape[1]]
        spans = list(itertools.pairwise(edges))
        merged = [difference(t[:, a:b].mean(1), o[:, a:b].mean(1)) for a, b in spans]
        self.theirs, self.ours, self.difference, self.se = map(np.array, zip(*merged))
        self.narrow = sum(b - a == 1 for a, b in spans)
        self.at = np.array([(a + b) * BIN / 2 for a, b in spans])
        self.widest = max(b - a for a, b in spans)
        self.of = t.shape[1]
        self.line = o.mean(0)  # aogauge's, at the narrowest bins

    def wrong(self):
        """Bins that differ by more than the limit beyond their noise, or are too noisy to tell."""
        far = np.abs(self.difference) > LIMIT + 3 * self.se
        return [i for i in range(len(self.at)) if far[i] or self.se[i] > NOISE]


def compare(kit, peers, us, images):
    """Bins and region means of a scene, by program and by whether the occluder stands there."""
    wide, high = kit.views["measure"]["resolution"]
    masks = kit.regions()
    result = {}
    for twin in (False, True)[: 1 + kit.has_twin()]:
        render = lambda peer: lambda *of: kept(peer, images, kit, twin, "path-traced", *of)
        ours, spent = enough(render(us), "aogauge", wide * high)
        for program, peer in peers.items():
            theirs, seconds = enough(render(peer), program, wide * high)
            bins = Bins(theirs, ours, wide)
            means = [{name: i[:, mask].mean(1, dtype="f8") for name, mask in masks.items()} for i in (theirs, ours)]
            regions = {name: difference(*(m[name] for m in means)) for name in masks}
            result[program, WHAT[twin]] = {
                "bins": bins, "regions": regions, "images": means, "samples": (len(theirs) * EACH[program], len(ours) * EACH["aogauge"]),
                "seconds": (seconds, spent),
            }  # fmt: skip
            print(
                f"{kit.name}, {WHAT[twin]}, {program}: {len(bins.at)} bins of {bins.of}, largest difference "
                f"{np.abs(bins.difference).max():.2%}, largest standard error {bins.se.max():.2%}, seconds {seconds:.0f} and {spent:.0f}",
                file=sys.stderr, flush=True,
            )  # fmt: skip
    return result


def contrast(kit, result, program, which):
    """K(Q) of theirs (0) or ours (1), and its standard error: the highlight contrast of the ratio of irradiances with and
    without the occluder, against the brighter flank."""
    cells = {what: result[program, what]["images"][which] for what in WHAT}
    means = {(what, r): mean_se(images[r]) for what, images in cells.items() for r in ("footprint", "left", "right")}
    q = {r: means["with", r][0] / means["without", r][0] for r in ("footprint", "left", "right")}
    flank = max(("left", "right"), key=q.get)
    ratio = q["footprint"] / q[flank]
    noise = sum((means[what, r][1] / means[what, r][0]) ** 2 for what in WHAT for r in ("footprint", flank))
    return ratio - 1, ratio * math.sqrt(noise)


def contrasts(kits, results, peers):
    yield "## Highlight contrast\n"
    yield "K(Q), what gates hold estimators against, from each program's own irradiance with and without the occluder.\n"
    yield "| scene | aogauge | " + " | ".join(peers) + " |"
    yield "|---|--:|" + "--:|" * len(peers)
    for kit in (k for k in kits if k.has_twin()):
        # aogauge's images are the same beside every program.
        both = [contrast(kit, results[kit.name], next(iter(peers)), 1)]
        both += [contrast(kit, results[kit.name], program, 0) for program in peers]
        yield f"| {kit.name} | " + " | ".join(f"{k:+.4f} ± {se:.4f}" for k, se in both) + " |"
    yield ""


def wrong(kit, result, peers):
    for program in peers if kit.has_twin() else ():
        (theirs, their_se), (ours, our_se) = (contrast(kit, result, program, which) for which in (0, 1))
        if not abs(ours - theirs) <= LIMIT * (1 + theirs) + 3 * math.hypot(their_se, our_se):
            yield f"{program}, {kit.name}: K(Q) is {ours:.4f}, theirs {theirs:.4f}"
    for (program, what), r in result.items():
        b = r["bins"]
        for i in b.wrong():
            yield f"{program}, {kit.name}, {what}, column {b.at[i]:.0f}: {b.difference[i]:+.2%} (standard error {b.se[i]:.2%})"


def summary(kits, results, peers):
    for program, peer in peers.items():
        yield f"## {program}\n"
        yield f"{peer.version}.\n"
        yield (
            "| scene | occluder | samples: theirs, aogauge's | bins, widest | largest difference, ± | mean difference | "
            "left | footprint | right | far |"
        )
        yield "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|"
        for kit in kits:
            for what in WHAT:
                if (r := results[kit.name].get((program, what))) is None:
                    continue
                b = r["bins"]
                i = np.abs(b.difference).argmax()
                cell = lambda region: "" if region not in r["regions"] else "{2:+.2%} ± {3:.2%}".format(*r["regions"][region])
                yield (
                    f"| {kit.name if what == 'with' else ''} | {what if kit.has_twin() else 'none'} | "
                    f"{r['samples'][0]:,}, {r['samples'][1]:,} | {len(b.at)}, {b.widest * BIN} | "
                    f"**{b.difference[i]:+.2%}** ± {b.se[i]:.2%} | {cell('all')} | "
                    + " | ".join(map(cell, ("left", "footprint", "right", "far"))) + " |"
                )  # fmt: skip
        yield ""


def profiles(kit, result, peers):
    yield f"### {kit.name}\n"
    for program in peers:
        for what in WHAT:
            if (r := result.get((program, what))) is None:
                continue
            b = r["bins"]
            yield f"{program}, {what if kit.has_twin() else 'no'} occluder:\n"
            yield "| t/R | theirs | aogauge | difference, % |"
            yield "|--:|--:|--:|--:|"
            for at, *row in zip(b.at, b.theirs, b.ours, b.difference * 100, b.se * 100):
                yield "| {:.2f} | {:.5f} | {:.5f} | {:+.2f} ± {:.2f} |".format(kit.place(at), *row)
            yield ""


def plot(kits, results, peers, path, panel, label):
    plt.rcParams.update({"svg.hashsalt": "aogauge", "font.size": 7})
    across = 5
    down = math.ceil(len(kits) / across)
    figure, axes = plt.subplots(down, across, figsize=(12, 2.1 * down), squeeze=False)
    for axis in axes.flat[len(kits) :]:
        axis.axis("off")
    for axis, kit in zip(axes.flat, kits):
        for (colour, program), (mark, what) in itertools.product(zip(("C0", "C3"), peers), zip(("o", "x"), WHAT)):
            if (r := results[kit.name].get((program, what))) is not None:
                panel(axis, kit.place, r["bins"], colour, mark, f"{program}, {what} occluder")
        axis.set_title(kit.name, fontsize=8)
    handles, labels = axes.flat[0].get_legend_handles_labels()
    for axis in axes.flat[: len(kits)]:
        more = axis.get_legend_handles_labels()
        if len(more[1]) > len(labels):
            handles, labels = more
    figure.legend(handles, labels, loc="lower center", ncols=4)
    figure.supylabel(label)
    figure.supxlabel("t/R", y=0.25 / down / 2.1)
    figure.tight_layout(rect=(0, 0.25 / down / 2.1, 1, 1))
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def differences(axis, place, bins, colour, mark, label):
    axis.errorbar(place(bins.at), 100 * bins.difference, 300 * bins.se, fmt=mark, ms=2.5, lw=0.6, color=colour, label=label)
    axis.set(ylim=(-3, 3))
    axis.axhspan(-100 * LIMIT, 100 * LIMIT, color="0.92", zorder=0)


def levels(axis, place, bins, colour, mark, label):
    axis.plot(place((np.arange(bins.of) + 0.5) * BIN), bins.line, color="0.6", lw=0.8, zorder=0)
    axis.plot(place(bins.at), bins.theirs, mark, ms=3, mfc="none", mew=0.7, color=colour, label=label)
    if bins.line.max() > 3 * bins.line.min():
        axis.set_yscale("log")
    elif axis.get_yscale() == "linear":
        axis.set_ylim(0, 1.2 * max(bins.line.max(), axis.get_ylim()[1] / 1.2))


def main():
    args = arguments(__doc__)
    peers = {"Cycles": Cycles(), "Mitsuba": Mitsuba()}
    results = {kit.name: compare(kit, peers, args.aogauge, args.images) for kit in args.kits}
    lines = [
        "# Irradiance: Cycles, Mitsuba 3 and aogauge\n",
        f"Written by `.ci/against-peers-light.py` (`.ci/peers light`) with the shipped adapters: {args.aogauge.version}, "
        f"`path-traced`, from camera `measure`, at the pixels' centres. Irradiance over pi, means over all rows and {BIN} columns. "
        f"Where that leaves a standard error of the difference above {NOISE:.1%}, neighbouring bins are put together, from the "
        f"left, until it does not: *widest* tells how many columns that took. Each bin must agree within {LIMIT:.0%} beyond 3 "
        f"standard errors, and K(Q) within {LIMIT:.0%} of 1 + K(Q) beyond 3.\n",
        f"Differences are aogauge's irradiance over theirs, less 1, ± one standard error over images of "
        f"{EACH['Cycles']} (Cycles), {EACH['Mitsuba']} (Mitsuba) and {EACH['aogauge']} (aogauge) paths a pixel, with seeds from 1 up: "
        f"{FIRST} images, which tell how many more are needed, up to {MOST['Cycles']:.0e}, {MOST['Mitsuba']:.0e} and "
        f"{MOST['aogauge']:.0e} paths in all.\n",
        "![differences along the transect](light.svg)\n",
        "![irradiance along the transect: aogauge as a line, the others as marks](profiles.svg)\n",
        *summary(args.kits, results, peers),
        *contrasts(args.kits, results, peers),
        "## Along the transect\n",
        *itertools.chain.from_iterable(profiles(kit, results[kit.name], peers) for kit in args.kits),
    ]
    (args.out / "light.md").write_text("\n".join(lines))
    plot(args.kits, results, peers, args.out / "light.svg", differences, "aogauge / theirs − 1, %  (bars: 3 standard errors)")
    plot(args.kits, results, peers, args.out / "profiles.svg", levels, "irradiance / π")
    for program in peers:
        of = [r for scene in results.values() for (p, _), r in scene.items() if p == program]
        every = np.concatenate([r["bins"].difference for r in of])
        noisy = [r["bins"] for r in of if r["bins"].se.all()]
        z = np.concatenate([b.difference / b.se for b in noisy]) if noisy else np.zeros(1)
        means = [r["regions"]["all"] for r in of]
        print(f"{program}: {len(results)} scenes, {len(every)} bins, largest difference {np.abs(every).max():.2%}, largest standard "
              f"error {max(r['bins'].se.max() for r in of):.2%}; of whole images at most {max(abs(m[2]) for m in means):.2%}; "
              f"differences over their standard errors have a deviation of {z.std():.2f} (t of {FIRST - 1} degrees of freedom: {math.sqrt((FIRST - 1) / (FIRST - 3)):.2f})")  # fmt: skip
    messages = [message for kit in args.kits for message in wrong(kit, results[kit.name], peers)]
    print("\n".join(messages))
    sys.exit(bool(messages))


if __name__ == "__main__":
    main()
