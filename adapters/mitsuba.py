#!/usr/bin/env python3
"""Renders a kit's camera `measure` with Mitsuba 3, as aogauge asks an external renderer to.

python adapters/mitsuba.py SCENE.glb views.json OUTPUT.exr RAYS SEED RADIUS [--estimator classic|path-traced]

Writes one 32-bit channel, Y, linear, rows from the top, sampled at the pixels' centres. Needs `pip install mitsuba numpy`
and LLVM (Debian: libllvm19) or an NVIDIA GPU.

classic: share of cosine-weighted rays about the geometric normal, both sides of every triangle, with no hit within RADIUS.
path-traced: irradiance over pi (luminance, Rec. 709), by Mitsuba's integrator `path` and all its bounces.
"""

import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
# This file has the name of the module that it imports, and its folder is searched first.
sys.path[:] = [folder for folder in sys.path if Path(folder or ".").resolve() != HERE]
import drjit as dr
import mitsuba as mi
import numpy as np

sys.path.append(str(HERE))
from aogauge_kit import LUMINANCE, Kit, arguments, read_glb, write_exr

# Centimetres: Mitsuba starts rays some 1e-4 (1 unit + distance from the origin) off a surface. In metres that would be
# 0.1 mm and more, would lift the floor under a curtain, and take up to 0.5 % of the light that grazes in.
SCALE = 100
# Rays of AO start this share off the surface, likewise: 0.01 mm at the origin. Mitsuba's own is 9 times that.
OFFSET = 1e-5
# The back of what shines, metres behind its front: Mitsuba's triangles shine to one side.
BEHIND = 1e-4
# Mitsuba takes no notice of what blocks a light within 0.09 % of the way to it. So what stands for an opening is moved out by
# more than that; in place, the eaves round a courtyard let 0.4 % of the light through.
OUTWARD = 0.003  # of the distance from the view
AT_ONCE = 1 << 23  # samples in memory


def start():
    """Chooses a variant that renders many rays at once."""
    for variant in ("llvm_ad_rgb", "cuda_ad_rgb"):
        try:
            mi.set_variant(variant)
            mi.Float(1) + 1
            return
        except Exception:
            continue
    raise SystemExit("Mitsuba finds neither LLVM nor CUDA; on Debian: apt-get install libllvm19")


def mesh(points, triangles, properties):
    m = mi.Mesh("", len(points), len(triangles), props=properties)
    parameters = mi.traverse(m)
    parameters["vertex_positions"] = np.ravel(points).astype("f4")
    parameters["faces"] = np.ravel(triangles).astype("u4")
    parameters.update()
    return m


def surface_meshes(surface):
    """Diffuse on both sides; where it shines, a front and a back."""

    def properties():
        p = mi.Properties()
        albedo = {"type": "rgb", "value": surface.albedo.tolist()}
        p["bsdf"] = mi.load_dict({"type": "twosided", "material": {"type": "diffuse", "reflectance": albedo}})
        if surface.emission.any():
            p["emitter"] = mi.load_dict(
                {"type": "area", "radiance": {"type": "rgb", "value": surface.emission.tolist()}}
            )
        return p

    yield mesh(SCALE * surface.points, surface.triangles, properties())
    if surface.emission.any():
        corners = surface.points[surface.triangles].astype("f8")
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        back = (corners - BEHIND * normals[:, None])[:, ::-1].reshape(-1, 3)
        yield mesh(SCALE * back, np.arange(len(back)).reshape(-1, 3), properties())


def lights(kit):
    """The sky, and a sheet of its radiance in each opening: what is beyond is the sky alone, so the light is the same, but
    Mitsuba can aim at it. Only where there is no opening is the sky aimed at."""
    zenith, horizon, ground = kit.sky()
    openings = kit.openings()
    if zenith == horizon == ground == 0:
        return {}
    if not zenith == horizon == ground:
        return {"sky": gradient(zenith, horizon, ground)}
    emitted = {"type": "rgb", "value": zenith}
    parts = {"sky": {"type": "constant", "radiance": emitted, "sampling_weight": 0.0 if openings else 1.0}}
    inside = SCALE * np.array(kit.measure["center"])
    for i, opening in enumerate(openings):
        corner, u, v = (SCALE * part for part in opening)
        centre = corner + (u + v) / 2
        if np.dot(np.cross(u, v), inside - centre) < 0:
            u, v = v, u
        farthest = np.linalg.norm(inside - centre) + np.linalg.norm(u) + np.linalg.norm(v)
        centre = centre - OUTWARD * farthest * np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        columns = np.column_stack([u / 2, v / 2, np.cross(u, v), centre])
        parts[f"opening {i}"] = {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f(np.vstack([columns, [0, 0, 0, 1]])),
            "bsdf": {"type": "diffuse", "reflectance": 0.0},
            "light": {"type": "area", "radiance": emitted},
        }
    return parts


def gradient(zenith, horizon, ground):
    """As a picture of 4096 rows, whose first is the zenith."""
    height = np.cos(np.pi * (np.arange(4096) + 0.5) / 4096)
    row = np.where(height < 0, ground, horizon + (zenith - horizon) * height)
    picture = np.repeat(row[:, None, None], 3, 2).repeat(8, 1).astype("f4")
    return {"type": "envmap", "bitmap": mi.Bitmap(picture)}


class Scene:
    """A kit's scene in Mitsuba, and what the pixels' centres see of it."""

    def __init__(self, glb, views, estimator):
        kit = Kit(views)
        parts = {"type": "scene"} | lights(kit)
        for i, surface in enumerate(read_glb(glb, estimator)):
            for j, m in enumerate(surface_meshes(surface)):
                parts[f"surface {i}-{j}"] = m
        self.scene = mi.load_dict(parts)
        self.wide, self.high, origin, direction = kit.pixels()
        self.origin, self.direction = (SCALE * origin).astype("f4"), direction.astype("f4")

    def rays(self, each):
        """`each` rays through every pixel's centre, pixel by pixel."""
        of = lambda array: mi.Point3f(*(mi.Float(np.repeat(array[:, k], each)) for k in range(3)))
        return mi.RayDifferential3f(mi.Ray3f(of(self.origin), mi.Vector3f(of(self.direction))))

    def positions(self):
        """Of each pixel, metres, rows from the top: to hold against gbuffer.exr."""
        hit = self.scene.ray_intersect(self.rays(1))
        return np.array(hit.p).T.reshape(self.high, self.wide, 3) / SCALE

    def passes(self, samples, seed):
        """(samples a pixel, a sampler) of each pass that fits into memory."""
        most = max(1, AT_ONCE // len(self.origin))
        for i in range(math.ceil(samples / most)):
            each = min(most, samples - i * most)
            sampler = mi.load_dict({"type": "independent"})
            # Mitsuba hashes the seed with the place of the sample; a pass takes a seed far from any that is asked for.
            sampler.seed((seed + i * 0x9E3779B1) % 2**32, each * len(self.origin))
            yield each, sampler

    def image(self, sums, samples):
        return (sums / samples).reshape(self.high, self.wide).astype("f4")

    def openness(self, rays, seed, radius):
        sums = np.zeros(len(self.origin))
        for each, sampler in self.passes(rays, seed):
            ray = self.rays(each)
            hit = self.scene.ray_intersect(ray)
            n = mi.Normal3f(dr.select(dr.dot(hit.n, ray.d) > 0, -hit.n, hit.n))
            d = mi.Frame3f(n).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
            lift = OFFSET * (1 + dr.max(dr.abs(hit.p)))
            closed = self.scene.ray_test(mi.Ray3f(hit.p + lift * n, d, SCALE * radius, 0.0, []))
            # What sees nothing is open.
            is_open = dr.select(hit.is_valid() & closed, 0.0, 1.0)
            sums += np.array(is_open, dtype="f8").reshape(-1, each).sum(1)
        return self.image(sums, rays)

    def irradiance(self, paths, seed):
        """Over pi: what the surface sends back, over its albedo."""
        path = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 5})
        sums = np.zeros((len(self.origin), 3))
        for each, sampler in self.passes(paths, seed):
            radiance = path.sample(self.scene, sampler, self.rays(each))[0]
            sums += np.array(radiance, dtype="f8").T.reshape(-1, each, 3).sum(1)
        hit = self.scene.ray_intersect(self.rays(1))
        albedo = np.array(hit.bsdf().eval_diffuse_reflectance(hit), dtype="f8").T
        if not (albedo > 0).all():
            raise SystemExit("a pixel sees a surface that sends no light back, so its irradiance is not known from it")
        return self.image((sums / albedo) @ LUMINANCE, paths)


def main():
    args = arguments(sys.argv[1:], __doc__.split("\n")[0], "mitsuba.py")
    start()
    scene = Scene(args.scene, args.view, args.estimator)
    if args.estimator == "classic":
        image = scene.openness(args.rays, args.seed, args.radius)
    else:
        image = scene.irradiance(args.rays, args.seed)
    write_exr(image, args.output)


if __name__ == "__main__":
    main()
