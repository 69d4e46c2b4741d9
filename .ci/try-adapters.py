"""Runs the shipped adapters as a suite does: try-adapters.py KIT FOLDER, a kit and a folder with an awkward name."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from peer_images import BLENDER, ROOT, Kit, adapter, read_exr

ADAPTERS = {
    "blender.py": [*BLENDER, str(ROOT / "adapters/blender.py"), "--"],
    "mitsuba.py": [sys.executable, str(ROOT / "adapters/mitsuba.py")],
}
# What is given, and what the error must say.
WRONG = [
    (["no.glb", "views.json", "o.exr", "4", "1", "0.25"], "no.glb: there is no such file"),
    (["kit.glb", "views.json", "o.png", "4", "1", "0.25"], "its name must end in .exr"),
    (["kit.glb", "views.json", "no/o.exr", "4", "1", "0.25"], "there is no such folder"),
    (["kit.glb", "views.json", "o.exr", "0", "1", "0.25"], "argument rays: 0 is not above 0"),
    (["kit.glb", "views.json", "o.exr", "4", "-1", "0.25"], "argument seed: -1 is below 0"),
    (["kit.glb", "views.json", "o.exr", "4", "1", "nan"], "argument radius: nan is not above 0"),
    (["kit.glb", "views.json", "o.exr", "4", "1", "0.25", "--estimator", "extended"], "invalid choice: 'extended'"),
    (["views.json", "views.json", "o.exr", "4", "1", "0.25"], "this is not a GLB file"),
    (["kit.glb", "other.json", "o.exr", "4", "1", "0.25"], "this is not the views.json of a kit"),
    (["kit.glb"], "required"),
]


def run(command, folder, words):
    done = subprocess.run([*command, *map(str, words)], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def image(name, command, folder, output, seed, *more):
    code, said = run(command, folder, ["kit.glb", "views.json", output, 16, seed, 0.25, *more])
    if code:
        sys.exit(f"{name}: ends with {code}\n{said}")
    return (folder / output).read_bytes()


def main():
    kit, folder = Kit(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir()
    shutil.copy(kit.glb(False), folder / "kit.glb")
    shutil.copy(kit.path / "views.json", folder)
    (folder / "other.json").write_text("{}")
    adapter("mitsuba").start()
    for name, command in ADAPTERS.items():
        for words, message in WRONG:
            code, said = run(command, folder, words)
            if code == 0 or message not in said or "Traceback" in said:
                sys.exit(f"{name} {' '.join(words)}: ends with {code}, without '{message}'\n{said}")
        for estimator in ("classic", "path-traced"):
            output = f"it's a \"{estimator}\" #1.exr"
            first = image(name, command, folder, output, 2**31 + 5, "--estimator", estimator)
            again = image(name, command, folder, output, 5, "--estimator", estimator)
            other = image(name, command, folder, output, 6, "--estimator", estimator)
            if first != again or again == other:
                sys.exit(f"{name}, {estimator}: seeds do not decide the image")
            seen = read_exr(folder / output)
            wide, high = kit.views["measure"]["resolution"]
            if list(seen) != ["Y"] or seen["Y"].shape != (high, wide) or seen["Y"].dtype != np.float32:
                sys.exit(f"{name}, {estimator}: {[(key, v.shape, v.dtype) for key, v in seen.items()]}")
            if not (np.isfinite(seen["Y"]).all() and 0.5 < seen["Y"].mean() < 1):
                sys.exit(f"{name}, {estimator}: the mean is {seen['Y'].mean()}")
        left = sorted(path.name for path in folder.iterdir() if "exr" in path.name)
        if len(left) != 2:
            sys.exit(f"{name} leaves {left}")
        print(f"{name}: {len(WRONG)} wrong command lines are refused, 6 images are as asked for")
        for path in folder.glob("*.exr"):
            path.unlink()


if __name__ == "__main__":
    main()
