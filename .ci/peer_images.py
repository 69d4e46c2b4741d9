"""Replicates of a kit's measure view by aogauge, Blender's Cycles and Mitsuba 3, for the checks that hold them together.

Run by Blender (blender -b --python .ci/peer_images.py -- KIT TWIN ESTIMATOR RAYS RADIUS FIRST COUNT FOLDER), it renders
with the shipped adapter, one process for all seeds.
"""

import argparse
import importlib.util
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
REGIONS = ("all", "footprint", "left", "right", "far")
BLENDER = ["blender", "-b", "--factory-startup", "-noaudio", "--python-exit-code", "1", "--python"]


def adapter(name):
    """A shipped adapter as a module; not by its plain name, which is that of the module it imports."""
    spec = importlib.util.spec_from_file_location(f"adapter_{name}", ROOT / "adapters" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def by_blender(kit, twin, estimator, rays, radius, first, count, folder):
    scene = adapter("blender").Scene(Kit(kit).glb(twin == "True"), Kit(kit).path / "views.json")
    scene.prepare(estimator, int(rays), float(radius))
    images = [scene.render(seed) for seed in range(int(first), int(first) + int(count))]
    np.save(Path(folder) / "images.npy", np.stack(images))


class Kit:
    """A folder that `aogauge scene export` wrote."""

    def __init__(self, path):
        self.path = Path(path)
        self.views = json.loads((self.path / "views.json").read_text())
        self.name = self.views["scene"]
        self.radius = self.views["ao"]["radius"]

    def glb(self, twin):
        return self.path / f"{self.name}{'.twin' * twin}.glb"

    def has_twin(self):
        return self.glb(True).is_file()

    def place(self, column):
        """Where along the transect a column lies, in R."""
        measure = self.views["measure"]
        return (column * measure["pixel"] - measure["half_size"][0]) / self.radius

    def regions(self):
        """Masks by name, of those that are not empty."""
        masks = {label.removesuffix(".Y"): mask > 0 for label, mask in read_exr(self.path / "regions.exr").items()}
        return {name: masks[name] for name in REGIONS if masks[name].any()}


def arguments(description):
    """Those of a check that holds aogauge against its peers."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("kits", nargs="+", type=Kit)
    parser.add_argument("--aogauge", required=True, type=Aogauge)
    parser.add_argument("--out", required=True, type=Path)
    parser.add_argument("--images", type=Path, help="where rendered images are kept, and taken from")
    return parser.parse_args()


def read_exr(path):
    """Channels by name."""
    import mitsuba as mi

    bitmap = mi.Bitmap(str(path))
    values = np.array(bitmap)
    values = values.reshape(*values.shape[:2], -1)
    return {field.name: values[..., i] for i, field in enumerate(bitmap.struct_())}


class Aogauge:
    def __init__(self, program):
        self.program = program
        self.version = subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout.strip()

    def images(self, kit, twin, estimator, rays, first, count):
        with tempfile.TemporaryDirectory() as folder:
            image = Path(folder) / "image.exr"
            subprocess.run(
                [self.program, "render", kit.name, "--estimator", estimator, "--rays", str(rays), "--replicates",
                 str(count), "--seed", str(first), "--out", image] + ["--twin"] * twin,
                check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            layers = read_exr(image)
        # A single replicate is the mean, without a layer of its own.
        return np.stack([layers[f"replicate-{i:04}.Y" if count > 1 else "mean.Y"] for i in range(count)])


class Cycles:
    def __init__(self):
        said = subprocess.run(["blender", "--version"], check=True, capture_output=True, text=True).stdout
        self.version = f"{said.splitlines()[0]} (Cycles)"

    def images(self, kit, twin, estimator, rays, first, count):
        with tempfile.TemporaryDirectory() as folder:
            asked = [kit.path, twin, estimator, rays, kit.radius, first, count, folder]
            done = subprocess.run([*BLENDER, __file__, "--", *map(str, asked)], capture_output=True, text=True)
            if done.returncode:
                sys.exit(f"{kit.name}: Blender ends with {done.returncode}\n{done.stdout}{done.stderr}")
            return np.load(Path(folder) / "images.npy")


class Mitsuba:
    def __init__(self):
        self.adapter = adapter("mitsuba")
        self.adapter.start()
        mi = self.adapter.mi
        self.version = f"Mitsuba {mi.__version__} ({mi.variant()})"
        self.checked = set()

    def images(self, kit, twin, estimator, rays, first, count):
        scene = self.adapter.Scene(kit.glb(twin), kit.path / "views.json", estimator)
        if kit.name not in self.checked and not twin:
            self.check_camera(kit, scene)
        seeds = range(first, first + count)
        if estimator == "classic":
            return np.stack([scene.openness(rays, seed, kit.radius) for seed in seeds])
        return np.stack([scene.irradiance(rays, seed) for seed in seeds])

    def check_camera(self, kit, scene):
        """The positions behind the pixels' centres are those of the kit's G-buffer."""
        gbuffer = read_exr(kit.path / "gbuffer.exr")
        told = np.dstack([gbuffer[f"position.{axis}"] for axis in "xyz"])
        off = np.abs(scene.positions() - told).max()
        if not off < 1e-3 * kit.views["measure"]["pixel"]:
            sys.exit(f"{kit.name}: the camera is {off} m off")
        self.checked.add(kit.name)


def kept(peer, folder, kit, twin, estimator, rays, first, count):
    """Images of a peer; those in `folder` are not rendered again."""
    if folder is None:
        return peer.images(kit, twin, estimator, rays, first, count)
    name = f"{type(peer).__name__}.{kit.name}{'.twin' * twin}.{estimator}.{rays}.{first}.{count}.npy"
    if not (folder / name).is_file():
        folder.mkdir(parents=True, exist_ok=True)
        np.save(folder / name, peer.images(kit, twin, estimator, rays, first, count))
    return np.load(folder / name)


if __name__ == "__main__":
    by_blender(*sys.argv[sys.argv.index("--") + 1 :])
