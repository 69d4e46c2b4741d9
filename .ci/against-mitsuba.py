"""Holds aogauge's path tracer against Mitsuba 3, profile by profile.

against-mitsuba.py KIT... --aogauge PROGRAM --out FOLDER: reads the kits that `aogauge scene export` wrote with
nothing of aogauge's own, renders the measure view with and without the occluder, and compares irradiance
over pi along the transect. Writes mitsuba.md and mitsuba.svg; ends with 1 where a bin differs too much.
"""

import argparse
import itertools
import json
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import matplotlib
import mitsuba as mi
import numpy as np

try:
    mi.set_variant("llvm_ad_rgb")
    mi.Float(1) + 1
except Exception:  # without libllvm19
    mi.set_variant("scalar_rgb")

matplotlib.use("svg")
import matplotlib.pyplot as plt

LIMIT = 0.01  # relative difference of a bin
NOISE = 0.007  # relative standard error of a bin's difference
BIN = 8  # columns
# Centimetres: Mitsuba starts rays some 1e-4 units off a surface. Were that 0.1 mm, it would lift the floor
# under the curtain, and take up to 0.5 % of the light that grazes in.
SCALE = 100
REPLICATES = 8
REGIONS = ("left", "footprint", "right")
COMPONENTS = {5121: "u1", 5123: "u2", 5125: "u4", 5126: "f4"}


def read_glb(path):
    """Triangles and base colour of each primitive of a GLB of untransformed nodes."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    doc, body = json.loads(data[20 : 20 + length]), data[28 + length :]

    def accessor(index):
        a = doc["accessors"][index]
        view = doc["bufferViews"][a["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3}[a["type"]]
        at = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        return np.frombuffer(body, COMPONENTS[a["componentType"]], a["count"] * width, at).reshape(-1, width)

    for node in (n for n in doc["nodes"] if "mesh" in n):
        assert not {"matrix", "translation", "rotation", "scale"} & node.keys(), f"{path}: {node['name']} is moved"
        for primitive in doc["meshes"][node["mesh"]]["primitives"]:
            material = doc["materials"][primitive["material"]]
            assert "emissiveFactor" not in material, f"{path}: {node['name']} glows, which is not read"
            colour = material["pbrMetallicRoughness"]["baseColorFactor"][:3]
            yield accessor(primitive["attributes"]["POSITION"]), accessor(primitive["indices"]).reshape(-1, 3), colour


def read_exr(path):
    """Channels by name."""
    image = mi.Bitmap(str(path))
    return {field.name: np.array(image)[..., i] for i, field in enumerate(image.struct_())}


def mesh(points, triangles, bsdf):
    m = mi.Mesh("", len(points), len(triangles), props=bsdf)
    parameters = mi.traverse(m)
    parameters["vertex_positions"] = np.ravel(points).astype("f4")
    parameters["faces"] = np.ravel(triangles).astype("u4")
    parameters.update()
    return m


def sky(environment, inside):
    """The uniform sky, and a sheet of its radiance in each opening: what is beyond is the sky alone, so
    the light is the same, but Mitsuba can aim at it. Only where there is no opening is the sky aimed at."""
    radiance, openings = environment["radiance"], environment["portals"]
    emitted = {"type": "rgb", "value": radiance}
    lights = {"sky": {"type": "constant", "radiance": emitted, "sampling_weight": 0.0 if openings else 1.0}}
    for i, opening in enumerate(openings):
        corner, u, v = (SCALE * np.array(opening[k]) for k in ("corner", "u", "v"))
        centre = corner + (u + v) / 2
        if np.dot(np.cross(u, v), inside - centre) < 0:
            u, v = v, u
        columns = np.column_stack([u / 2, v / 2, np.cross(u, v), centre])
        lights[f"opening {i}"] = {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f(np.vstack([columns, [0, 0, 0, 1]])),
            "bsdf": {"type": "diffuse", "reflectance": 0.0},
            "light": {"type": "area", "radiance": emitted},
        }
    return lights


def scene(glb, views):
    """The scene, and the albedo of what the measure view sees."""
    m = views["measure"]
    centre, normal = SCALE * np.array(m["center"]), SCALE * np.array(m["normal"])
    wide, high = m["resolution"]
    half = SCALE * m["half_size"][0]
    frame = mi.ScalarTransform4f().look_at(
        origin=(centre + m["clearance"] * normal).tolist(), target=centre.tolist(), up=m["up"]
    )
    parts = {
        "type": "scene",
        "sensor": {
            "type": "orthographic",
            # Mitsuba's image x runs to the left of its frame's x.
            "to_world": frame @ mi.ScalarTransform4f().scale([half, half, 1]),
            "near_clip": 1e-4,
            "far_clip": 1e4,
            "film": {"type": "hdrfilm", "width": wide, "height": high, "rfilter": {"type": "box"},
                     "pixel_format": "rgb", "component_format": "float32"},
        },
    } | sky(views["environment"], centre)
    colours = []
    for i, (points, triangles, colour) in enumerate(read_glb(glb)):
        bsdf = mi.Properties()
        bsdf["bsdf"] = mi.load_dict(
            {"type": "twosided", "material": {"type": "diffuse", "reflectance": {"type": "rgb", "value": colour}}}
        )
        parts[f"mesh {i}"] = mesh(SCALE * points, triangles, bsdf)
        colours.append(colour)
    assert all(c == colours[0] for c in colours), f"{glb}: the receiver's albedo is not known among several"
    return mi.load_dict(parts), colours[0][1]


def check_camera(loaded, kit):
    """The positions Mitsuba sees, against the kit's G-buffer."""
    aov = mi.load_dict({"type": "aov", "aovs": "p:position"})
    seen = np.array(mi.render(loaded, integrator=aov, spp=256))[..., -3:] / SCALE
    gbuffer = read_exr(kit / "gbuffer.exr")
    told = np.dstack([gbuffer[f"position.{axis}"] for axis in "xyz"])
    pixel = json.loads((kit / "views.json").read_text())["measure"]["pixel"]
    off = np.abs(seen - told).max()
    assert off < 0.2 * pixel, f"{kit}: the camera is {off} m off"


def mitsuba(kit, glb, views, spp):
    """Irradiance over pi, an image a replicate; more replicates rather than more than 1024 samples each."""
    loaded, albedo = scene(glb, views)
    if "twin" not in glb.name:
        check_camera(loaded, kit)
    each = min(spp // REPLICATES, 1024)
    path = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 5})
    return np.stack([
        np.array(mi.render(loaded, integrator=path, spp=each, seed=seed))[..., 1] / albedo
        for seed in range(spp // each)
    ])


def aogauge(program, name, rays, twin):
    """Irradiance over pi, an image a replicate."""
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "image.exr"
        subprocess.run(
            [program, "render", name, "--estimator", "path-traced", "--rays", str(rays), "--replicates",
             str(REPLICATES), "--seed", "7", "--out", image] + ["--twin"] * twin,
            check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        layers = read_exr(image)
        return np.stack([layers[f"replicate-{i:04}.Y"] for i in range(REPLICATES)])


def mean_se(replicates):
    return replicates.mean(0), replicates.std(0, ddof=1) / np.sqrt(len(replicates))


def difference(theirs, ours):
    """Means of both, relative difference and its standard error, of lists of numbers a replicate."""
    (m, m_se), (a, a_se) = mean_se(theirs), mean_se(ours)
    return m, a, a / m - 1, np.hypot(m_se / m, a_se / a)


def profile(images):
    return images.mean(1).reshape(len(images), -1, BIN).mean(2)


def contrast(regions, which):
    """K(Q), as the README defines it, and its standard error, of one program's irradiance of each region."""
    cell = {key: mean_se(images[which]) for key, images in regions.items()}
    q = {r: cell["with", r][0] / cell["without", r][0] for r in REGIONS}
    flank = max(("left", "right"), key=q.get)
    ratio = q["footprint"] / q[flank]
    parts = [cell[what, r] for what in ("with", "without") for r in ("footprint", flank)]
    return ratio - 1, ratio * np.sqrt(sum((se / mean) ** 2 for mean, se in parts))


def compare(kit, program, samples):
    """A scene's figures, and what is wrong with them."""
    views = json.loads((kit / "views.json").read_text())
    name = views["scene"]
    theirs, ours, spent = [], [], []
    for twin, (spp, rays) in zip((False, True), samples):
        started = time.time()
        theirs.append(mitsuba(kit, kit / f"{name}{'.twin' * twin}.glb", views, spp))
        spent.append(time.time() - started)
        started = time.time()
        ours.append(aogauge(program, name, rays, twin))
        spent.append(time.time() - started)
    masks = {label.removesuffix(".Y"): mask > 0 for label, mask in read_exr(kit / "regions.exr").items()}
    profiles = [difference(profile(t), profile(o)) for t, o in zip(theirs, ours)]
    means = {
        (what, r): [images[:, masks[r]].mean(1) for images in both]
        for what, both in zip(("with", "without"), zip(theirs, ours))
        for r in REGIONS
    }
    regions = {key: difference(*both) for key, both in means.items()}
    k = [contrast(means, which) for which in (0, 1)]
    columns = np.arange(views["measure"]["resolution"][0]).reshape(-1, BIN).mean(1) + 0.5
    t = (columns * views["measure"]["pixel"] - views["measure"]["half_size"][0]) / views["ao"]["radius"]
    wrong = []
    for what, (_, _, d, se) in zip(("with", "without"), profiles):
        for at, d, se in zip(t, d, se):
            if se > NOISE:
                wrong.append(f"{name}, {what}, t/R {at:.2f}: standard error {se:.2%}, more than {NOISE:.1%}")
            if not abs(d) <= LIMIT + 3 * se:
                wrong.append(f"{name}, {what}, t/R {at:.2f}: {d:+.2%} (standard error {se:.2%}) is more than {LIMIT:.0%}")
    for (what, region), (_, _, d, se) in regions.items():
        if not abs(d) <= LIMIT:
            wrong.append(f"{name}, {what}, {region}: {d:+.2%} (standard error {se:.2%}) is more than {LIMIT:.0%}")
    ((km, km_se), (ka, ka_se)) = k
    if not abs(ka - km) <= LIMIT * (1 + km) + 3 * np.hypot(km_se, ka_se):
        wrong.append(f"{name}: K(Q) is {ka:.4f}, Mitsuba's {km:.4f}")
    return {"name": name, "t": t, "profiles": profiles, "regions": regions, "k": k, "spent": spent,
            "samples": samples, "wrong": wrong}  # fmt: skip


def table(result):
    (m, a, d, se), (tm, ta, td, tse) = result["profiles"]
    (km, km_se), (ka, ka_se) = result["k"]
    spp, rays = zip(*result["samples"])
    worst = [np.abs(x).max() for x in (d, td)]
    yield f"## {result['name']}\n"
    yield (
        f"Samples a pixel, with and without the occluder: Mitsuba {spp[0]} and {spp[1]}, aogauge "
        f"{rays[0] * REPLICATES} and {rays[1] * REPLICATES}. Largest difference: **{worst[0]:.2%}** with, "
        f"**{worst[1]:.2%}** without. K(Q): Mitsuba {km:.4f} ± {km_se:.4f}, aogauge {ka:.4f} ± {ka_se:.4f}.\n"
    )
    yield "| t/R | Mitsuba, with | aogauge, with | difference, % | Mitsuba, without | aogauge, without | difference, % |"
    yield "|--:|--:|--:|--:|--:|--:|--:|"
    for row in zip(result["t"], m, a, d * 100, se * 100, tm, ta, td * 100, tse * 100):
        yield "| {:.2f} | {:.5f} | {:.5f} | {:+.2f} ± {:.2f} | {:.5f} | {:.5f} | {:+.2f} ± {:.2f} |".format(*row)
    yield "\n| region | Mitsuba, with | aogauge, with | difference, % | Mitsuba, without | aogauge, without | difference, % |"
    yield "|---|--:|--:|--:|--:|--:|--:|"
    for region in REGIONS:
        cells = [result["regions"][what, region] for what in ("with", "without")]
        yield f"| {region} | " + " | ".join(f"{m:.5f} | {a:.5f} | {d:+.2%} ± {se:.2%}" for m, a, d, se in cells) + " |"
    yield ""


def plot(results, path):
    plt.rcParams.update({"svg.hashsalt": "aogauge", "font.size": 9})
    figure, axes = plt.subplots(2, len(results), figsize=(11, 6), height_ratios=[2, 1], sharex=True, squeeze=False)
    for (upper, lower), r in zip(axes.T, results):
        for (m, a, d, se), colour, what in zip(r["profiles"], ("C0", "C1"), ("with", "without")):
            upper.semilogy(r["t"], a, colour, label=f"aogauge, {what}")
            upper.semilogy(r["t"], m, "o", mfc="none", ms=4, color=colour, label=f"Mitsuba, {what}")
            lower.errorbar(r["t"], d * 100, 3 * se * 100, fmt=".", ms=4, lw=0.8, color=colour)
        lower.axhspan(-100 * LIMIT, 100 * LIMIT, color="0.9")
        lower.set(ylim=(-2, 2), xlabel="t/R")
        upper.set(title=r["name"])
    axes[0, 0].set(ylabel="irradiance / π")
    axes[0, -1].legend(loc="lower right", fontsize=8)
    axes[1, 0].set(ylabel="aogauge / Mitsuba − 1, %\n(bars: 3 standard errors)")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("kits", nargs="+", type=Path)
    arguments.add_argument("--aogauge", required=True)
    arguments.add_argument("--out", required=True, type=Path)
    arguments.add_argument("--samples", type=json.loads, required=True,
                           help='by scene: [[spp, rays a replicate] with, the same without the occluder]')  # fmt: skip
    args = arguments.parse_args()
    results = [compare(kit, args.aogauge, args.samples[kit.name]) for kit in args.kits]
    for r in results:
        print(r["name"], "largest differences", [f"{np.abs(p[2]).max():.2%}" for p in r["profiles"]],
              "largest standard errors", [f"{p[3].max():.2%}" for p in r["profiles"]],
              "K(Q)", [f"{m:.4f}" for m, _ in r["k"]], "seconds", [round(s) for s in r["spent"]])  # fmt: skip
    version = subprocess.run([args.aogauge, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    lines = [
        "# Mitsuba 3 and aogauge\n",
        f"Written by `.ci/against-mitsuba.py`: Mitsuba {mi.__version__} ({mi.variant()}, path), {version}. Irradiance over pi "
        f"of the measure view, means over all rows and {BIN} columns, ± one standard error of the difference over "
        f"at least {REPLICATES} replicates. Each bin must agree within {LIMIT:.0%} and 3 standard errors, which may be "
        f"{NOISE:.1%} each; each region of K within {LIMIT:.0%} outright.\n",
        "![profiles](mitsuba.svg)\n",
        *itertools.chain.from_iterable(table(r) for r in results),
    ]
    (args.out / "mitsuba.md").write_text("\n".join(lines))
    plot(results, args.out / "mitsuba.svg")
    wrong = [message for r in results for message in r["wrong"]]
    print("\n".join(wrong))
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
