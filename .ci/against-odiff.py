"""Time of `aogauge compare --exact` against odiff, on PNG images of 7680 x 4320 pixels.

against-odiff.py FOLDER ODIFF AOGAUGE RESAVE

Makes slopes with noise in a quarter of the tiles, in FOLDER, saved by Pillow (zlib, level 6) and by RESAVE
(examples/resave.rs: the crate `image`). Prints the best of 5 runs each, taken in turn, as a table; output of both
programs goes to a file. No program writes a difference image.
"""

import json
import os
import pathlib
import subprocess
import sys
import time

import numpy as np
from PIL import Image

RUNS = 5
WIDTH, HEIGHT = 7680, 4320


def make(folder, resave):
    rng = np.random.default_rng(7)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    values = np.stack([127 + 100 * np.sin(x / 1500 + c) * np.cos(y / 900) for c in range(3)], -1)
    noisy = ((x // 320).astype(int) + (y // 270).astype(int)) % 4 == 0
    values[noisy] += rng.normal(0, 6, (int(noisy.sum()), 3))
    picture = np.clip(values, 0, 255).astype(np.uint8)
    few = picture.copy()
    few[2000:2010, 3000:3010] ^= 64
    many = picture.copy()
    many[:, ::2] ^= 32
    for name, pixels in [("pillow", picture), ("few", few), ("many-pillow", many)]:
        Image.fromarray(pixels).save(folder / f"{name}.png", compress_level=6)
    for source, target in [("pillow", "image"), ("many-pillow", "many")]:
        subprocess.run([resave, folder / f"{source}.png", folder / f"{target}.png"], check=True)


def seconds(command, log):
    """Wall clock and CPU seconds of a command, and its exit code."""
    with open(log, "wb") as out:
        start = time.perf_counter()
        process = subprocess.Popen(command, stdout=out, stderr=out)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
    return wall, usage.ru_utime + usage.ru_stime, process.returncode


def main():
    folder, odiff, aogauge, resave = map(pathlib.Path, sys.argv[1:])
    make(folder, resave)
    # The program itself: `odiff` of npm is a script that starts it, and costs 40 ms more.
    print(f"7680 x 4320 pixels, {os.cpu_count()} CPUs, best of {RUNS}: wall clock and CPU seconds\n")
    print("| | differing | odiff | aogauge --exact | odiff / aogauge | odiff, CPU | aogauge, CPU |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    slower = []
    for what, reference, test in [
        ("equal pixels, other bytes", "image", "pillow"),
        ("100 pixels differ, other bytes", "image", "few"),
        ("half of the pixels differ", "image", "many"),
        ("half of the pixels differ, both by Pillow", "pillow", "many-pillow"),
        ("the same file twice", "pillow", "pillow"),
    ]:
        paths = [str(folder / f"{name}.png") for name in (reference, test)]
        log = folder / "log"
        # A threshold of 0 is the exact comparison.
        theirs = [str(odiff), *paths, "--threshold", "0", "--parsable-stdout"]
        ours = [str(aogauge), "compare", *paths, "--exact", "--format", "json"]
        best = {}
        for _ in range(RUNS):
            for who, command in [("theirs", theirs), ("ours", ours)]:
                wall, cpu, code = seconds(command, log)
                assert code in (0, 22), (command, log.read_text())
                best[who] = min(best.get(who, (9e9, 9e9)), (wall, cpu))
        exact = json.loads(log.read_text())["pairs"][0]["exact"]
        (a, a_cpu), (b, b_cpu) = best["theirs"], best["ours"]
        print(f"| {what} | {exact['differing']} | {a:.3f} | {b:.3f} | {a / b:.1f} | {a_cpu:.3f} | {b_cpu:.3f} |")
        if b > a:
            slower.append(what)
    if slower:
        sys.exit(f"slower than odiff: {slower}")


main()
