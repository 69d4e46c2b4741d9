"""Holds aogauge's `classic` against the ambient occlusion of Blender's Cycles and of Mitsuba 3, on every scene.

against-peers-ao.py KIT... --aogauge PROGRAM --out FOLDER: renders replicates of the measure view of each kit with the shipped
adapters, and compares means over regions and over tiles of 16 x 16 pixels by Welch's test, with Holm's
correction over all tests of a program. Writes ao.md and ao.svg; ends with 1 where a test rejects.
"""

import sys

import matplotlib
import numpy as np
from scipy import stats

from peer_images import Cycles, Mitsuba, arguments, kept

matplotlib.use("svg")
import matplotlib.pyplot as plt

ALPHA = 0.01  # false alarms of a program, of all its tests together
POWER = 0.8
TILE = 16
REPLICATES = 16
RAYS = 64


class Test:
    """Welch's test of one place: means a replicate of both programs."""

    def __init__(self, kind, place, pixels, theirs, ours):
        self.kind, self.place = kind, place
        self.theirs, self.ours = theirs.mean(), ours.mean()
        parts = np.array([x.var(ddof=1) / len(x) for x in (theirs, ours)])
        # No place is known better than one ray changes it: where no replicate differs, one ray alone would reject.
        self.floor = 1 / (pixels * RAYS * len(ours))
        self.noisy = np.sqrt(parts.sum()) > self.floor
        self.se = max(np.sqrt(parts.sum()), self.floor)
        self.df = parts.sum() ** 2 / (parts**2 / (REPLICATES - 1)).sum() if self.noisy else REPLICATES - 1
        self.difference = self.ours - self.theirs
        self.p = 2 * stats.t.sf(abs(self.difference) / self.se, self.df)

    def detectable(self, level):
        """The difference that the test at `level` sees with the stated power."""
        return self.se * (stats.t.isf(level / 2, self.df) + stats.t.ppf(POWER, self.df))


def holm(tests):
    """Gives each test its adjusted p."""
    worst = 0.0
    for k, test in enumerate(sorted(tests, key=lambda t: t.p)):
        worst = max(worst, min(1.0, test.p * (len(tests) - k)))
        test.adjusted = worst


def tests_of(kit, theirs, ours):
    for name, mask in kit.regions().items():
        yield Test("region", name, mask.sum(), theirs[:, mask].mean(1), ours[:, mask].mean(1))
    wide, high = kit.views["measure"]["resolution"]
    for y in range(0, high, TILE):
        for x in range(0, wide, TILE):
            cut = [images[:, y : y + TILE, x : x + TILE] for images in (theirs, ours)]
            pixels = cut[0][0].size
            yield Test("tile", f"{x}, {y}", pixels, *(c.reshape(len(c), -1).mean(1) for c in cut))


def table(kits, results, level):
    yield (
        "| scene | region | theirs | aogauge | difference | p | detectable | tiles | least p of a tile, adjusted | "
        "detectable, median and worst tile |"
    )
    yield "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|"
    for kit in kits:
        tests = results[kit.name]
        tiles = [t for t in tests if t.kind == "tile"]
        least = min(tiles, key=lambda t: t.p)
        seen = [t.detectable(level) for t in tiles]
        of_tiles = f"{len(tiles)} | {least.adjusted:.2f} at {least.place} | {np.median(seen):.4f}, {max(seen):.4f}"
        for i, t in enumerate(t for t in tests if t.kind == "region"):
            yield (
                f"| {kit.name if i == 0 else ''} | {t.place} | {t.theirs:.5f} | {t.ours:.5f} | {t.difference:+.5f} ± {t.se:.5f} | "
                f"{t.p:.3f} | {t.detectable(level):.5f} | {of_tiles if i == 0 else ' | | '} |"
            )


def page(program, version, kits, results):
    tests = [t for r in results.values() for t in r]
    level = ALPHA / len(tests)
    rejected = [t for t in tests if t.adjusted <= ALPHA]
    tiles = [t for t in tests if t.kind == "tile" and t.noisy]
    early = sum(t.p < 0.05 for t in tiles)
    z = np.array([t.difference / t.se for t in tiles])
    yield f"## {program}\n"
    yield (
        f"{version}. {len(tests)} tests, {len(tests) - len(tiles) - sum(t.kind == 'region' for t in tests)} of them of tiles "
        f"where no ray of either is decided otherwise: **{len(rejected)} reject**. Of the {len(tiles)} tiles with noise "
        f"{early} have p < .05 before the correction ({early / len(tiles):.1%}; 5 % are expected of equal renderers), "
        f"{(z > 0).mean():.0%} are brighter in aogauge, differences over their standard errors have a mean of {z.mean():+.2f} "
        f"± {1 / np.sqrt(len(z)):.2f} and a deviation of {z.std():.2f}.\n"
    )
    yield from table(kits, results, level)
    yield ""


def plot(peers, kits, results, path):
    plt.rcParams.update({"svg.hashsalt": "aogauge", "font.size": 9})
    figure, axes = plt.subplots(1, len(peers), figsize=(11, 6), sharey=True, sharex=True, squeeze=False)
    colours = {"all": "k", "footprint": "C3", "left": "C0", "right": "C2", "far": "C7"}
    for axis, program in zip(axes[0], peers):
        for row, kit in enumerate(kits):
            for t in (t for t in results[program][kit.name] if t.kind == "region"):
                at = row + 0.14 * (list(colours).index(t.place) - 2)
                axis.errorbar(t.difference, at, xerr=3 * t.se, fmt="o", ms=3, lw=0.8, color=colours[t.place])
        axis.axvline(0, color="0.7", lw=0.8, zorder=0)
        axis.set(title=f"aogauge − {program}", xlabel="difference in openness (bars: 3 standard errors)")
        axis.grid(axis="x", color="0.9")
    axes[0, 0].set_yticks(range(len(kits)), [kit.name for kit in kits])
    axes[0, 0].invert_yaxis()
    figure.legend(handles=[plt.Line2D([], [], marker="o", ls="", ms=4, color=c, label=r) for r, c in colours.items()],
                  loc="outside lower center", ncols=5)  # fmt: skip
    figure.tight_layout(rect=(0, 0.04, 1, 1))
    figure.savefig(path, metadata={"Date": None})


def main():
    args = arguments(__doc__)
    peers = {"Cycles": Cycles(), "Mitsuba": Mitsuba()}
    results = {program: {} for program in peers}
    for kit in args.kits:
        ours = kept(args.aogauge, args.images, kit, False, "classic", RAYS, 1, REPLICATES).astype("f8")
        for program, peer in peers.items():
            theirs = kept(peer, args.images, kit, False, "classic", RAYS, 1, REPLICATES).astype("f8")
            results[program][kit.name] = list(tests_of(kit, theirs, ours))
    for program in peers:
        holm([t for r in results[program].values() for t in r])
    lines = [
        "# Ambient occlusion: Cycles, Mitsuba 3 and aogauge\n",
        f"Written by `.ci/against-peers-ao.py` (`.ci/peers ao`) with the shipped adapters: {args.aogauge.version}, `classic`, "
        f"from camera `measure`, at the pixels' centres. {REPLICATES} images of {RAYS} rays a pixel each, seeds 1 to "
        f"{REPLICATES}, of each program; aogauge's are the replicates of seed 1. Differences are aogauge's openness less "
        f"theirs, ± one standard error. Scenes with the same curtain over the same floor share their random numbers, and so "
        f"their differences.\n",
        f"Every region and every tile of {TILE} x {TILE} pixels is a two-sided Welch test over images; `all` is the whole "
        f"image. Holm's correction over all tests of a program keeps the chance of any false alarm at {ALPHA:.0%}. "
        f"*Detectable* is the difference that a test would see with probability {POWER} at the strictest of Holm's levels.\n",
        "![differences](ao.svg)\n",
    ]
    for program, peer in peers.items():
        lines += page(program, peer.version, args.kits, results[program])
    (args.out / "ao.md").write_text("\n".join(lines))
    plot(peers, args.kits, results, args.out / "ao.svg")
    wrong = False
    for program, of_scenes in results.items():
        tests = [t for r in of_scenes.values() for t in r]
        regions = [t for t in tests if t.kind == "region"]
        tiles = [t for t in tests if t.kind == "tile"]
        print(f"{program}: {len(of_scenes)} scenes, {len(regions)} regions and {len(tiles)} tiles; largest difference of a region "
              f"{max(abs(t.difference) for t in regions):.5f}, of a tile {max(abs(t.difference) for t in tiles):.5f}; least "
              f"adjusted p {min(t.adjusted for t in tests):.3f}")  # fmt: skip
        for name, r in of_scenes.items():
            for t in (t for t in r if t.adjusted <= ALPHA):
                print(f"{program}, {name}, {t.kind} {t.place}: {t.difference:+.5f} ± {t.se:.5f}, adjusted p {t.adjusted:.2g}")
                wrong = True
    sys.exit(wrong)


if __name__ == "__main__":
    main()
