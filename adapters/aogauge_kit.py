"""What both adapters share: reading the scene and the views that `aogauge scene export` writes, and writing the image.
Needs numpy alone."""

import argparse
import json
import os
import struct
from pathlib import Path

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709, as aogauge takes it
COMPONENTS = {5121: "u1", 5123: "u2", 5125: "u4", 5126: "f4"}


def positive(kind):
    """A parser of arguments that takes numbers above 0 only."""

    def parse(text):
        value = kind(text)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"{text} is not above 0")
        return value

    parse.__name__ = kind.__name__
    return parse


def seed(text):
    """Any whole number from 0 up; programs take 31 bits."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is below 0")
    return value % 2**31


def arguments(words, description, program):
    """The command line of an adapter, {scene} {view} {output} {rays} {seed} {radius} of a suite."""
    parser = argparse.ArgumentParser(prog=program, description=description)
    parser.add_argument("scene", type=Path, help="NAME.glb, or NAME.twin.glb, of `aogauge scene export`")
    parser.add_argument("view", type=Path, help="the kit's views.json")
    parser.add_argument("output", type=Path, help="the EXR to write")
    parser.add_argument("rays", type=positive(int), help="rays, or paths, a pixel")
    parser.add_argument("seed", type=seed, help="seed of all randomness")
    parser.add_argument("radius", type=positive(float), help="R of the AO, metres; path-traced does not use it")
    parser.add_argument("--estimator", choices=["classic", "path-traced"], default="classic",
                        help="classic: share of cosine-weighted rays with no hit within R; path-traced: irradiance over pi")  # fmt: skip
    args = parser.parse_args(words)
    for path in (args.scene, args.view):
        if not path.is_file():
            parser.error(f"{path}: there is no such file")
    if args.output.suffix.lower() != ".exr":
        parser.error(f"{args.output}: what is written is an EXR, so its name must end in .exr")
    if not args.output.absolute().parent.is_dir():
        parser.error(f"{args.output}: there is no such folder")
    return args


class Surface:
    """A primitive: points in metres, triangles, albedo and radiance sent out (both sides), by red, green and blue."""

    def __init__(self, points, triangles, albedo, emission):
        self.points, self.triangles, self.albedo, self.emission = points, triangles, albedo, emission


def read_glb(path, estimator):
    """The surfaces of a kit's GLB. Where the estimator needs light, what is not read of it is refused."""
    data = Path(path).read_bytes()
    if data[:4] != b"glTF":
        raise SystemExit(f"{path}: this is not a GLB file")
    length = struct.unpack_from("<I", data, 12)[0]
    doc, body = json.loads(data[20 : 20 + length]), data[28 + length :]
    lit = estimator != "classic"
    if lit and doc.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights"):
        raise SystemExit(f"{path}: it has punctual lights, which are not read; classic needs none")

    def accessor(index):
        a = doc["accessors"][index]
        view = doc["bufferViews"][a["bufferView"]]
        if "sparse" in a or "byteStride" in view:
            raise SystemExit(f"{path}: sparse and interleaved data is not read")
        width = {"SCALAR": 1, "VEC3": 3}[a["type"]]
        at = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        return np.frombuffer(body, COMPONENTS[a["componentType"]], a["count"] * width, at).reshape(-1, width)

    surfaces = []
    for node in (n for n in doc["nodes"] if "mesh" in n):
        name = node.get("name")
        if {"matrix", "translation", "rotation", "scale"} & node.keys():
            raise SystemExit(f"{path}: node {name} is moved; a kit's geometry stands in place")
        for primitive in doc["meshes"][node["mesh"]]["primitives"]:
            material = doc["materials"][primitive["material"]]
            if lit and any(key.endswith("Texture") for key in material | material["pbrMetallicRoughness"]):
                raise SystemExit(f"{path}: {name} has a texture, which is not read; classic needs none")
            points = accessor(primitive["attributes"]["POSITION"])
            triangles = accessor(primitive["indices"]).reshape(-1, 3).astype("u4")
            surfaces.append(Surface(points, triangles, *colours(material)))
    return surfaces


def colours(material):
    """Albedo and emission of a material, as aogauge takes them: metal sends nothing back diffusely, and nothing sends back
    more than 0.98."""
    surface, extensions = material["pbrMetallicRoughness"], material.get("extensions", {})
    albedo = np.array(surface.get("baseColorFactor", [1, 1, 1])[:3]) * (1 - surface.get("metallicFactor", 1.0))
    albedo = np.clip(albedo, 0, 0.98)
    strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    return albedo, np.array(material.get("emissiveFactor", [0, 0, 0])) * strength


class Kit:
    """views.json: the measure view and the light."""

    def __init__(self, path):
        views = json.loads(Path(path).read_text(encoding="utf-8"))
        if views.get("unit") != "metre" or "measure" not in views:
            raise SystemExit(f"{path}: this is not the views.json of a kit")
        self.measure, self.environment = views["measure"], views["environment"]

    def pixels(self):
        """Columns, rows, and (origin, direction) of the ray through each pixel's centre, rows from the top."""
        rays, (wide, high) = self.measure["rays"], self.measure["resolution"]
        y, x = np.mgrid[0:high, 0:wide] + 0.5
        at = lambda key: (np.array(rays[key]) + x[..., None] * rays[f"{key}_dx"] + y[..., None] * rays[f"{key}_dy"])
        return wide, high, at("origin").reshape(-1, 3), at("direction").reshape(-1, 3)

    def sky(self):
        """(zenith, horizon, ground): the radiance from straight above and from just above the horizon, between them
        linear in the sine of the elevation, and from below; glTF's +Y is up."""
        if "gradient" in self.environment:
            return tuple(self.environment["gradient"][part] for part in ("zenith", "horizon", "ground"))
        return (self.environment.get("radiance", 0.0),) * 3

    def openings(self):
        """(corner, u, v): parallelograms that the sky is seen through. A sky of one radiance only: none aims at others."""
        zenith, horizon, ground = self.sky()
        if not zenith == horizon == ground > 0:
            return []
        return [tuple(np.array(o[key]) for key in ("corner", "u", "v")) for o in self.environment["portals"]]


def write_exr(image, output):
    """One channel, Y, of 32-bit floats, uncompressed, the first row on top. Under another name until it is whole."""
    high, wide = image.shape
    window = struct.pack("<4i", 0, 0, wide - 1, high - 1)
    attributes = [
        ("channels", "chlist", b"Y\0" + struct.pack("<iB3xii", 2, 1, 1, 1) + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    ]
    head = struct.pack("<2i", 20000630, 2)
    for name, kind, value in attributes:
        head += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    head += b"\0"
    row = 8 + 4 * wide
    first = len(head) + 8 * high
    table = (first + row * np.arange(high, dtype="<u8")).tobytes()
    lines = b"".join(
        struct.pack("<2i", y, 4 * wide) + line.tobytes() for y, line in enumerate(image.astype("<f4"))
    )
    partial = output.with_name(f".{output.name}.{os.getpid()}")
    partial.write_bytes(head + table + lines)
    os.replace(partial, output)
