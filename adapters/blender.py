"""Renders a kit's camera `measure` with Blender's Cycles, as aogauge asks an external renderer to.

blender -b --factory-startup -noaudio --python-exit-code 1 --python adapters/blender.py -- \
    SCENE.glb views.json OUTPUT.exr RAYS SEED RADIUS [--estimator classic|path-traced]

Blender 3.4 or newer, on the CPU. Writes one 32-bit channel, Y, linear, rows from the top, sampled at the pixels' centres
to 0.004 pixels, through Cycles' smallest filter, a hundredth of a pixel.

classic: Cycles' ambient occlusion node: share of cosine-weighted rays about the geometric normal, both sides of every
triangle, with no hit within RADIUS. path-traced: irradiance over pi (luminance, Rec. 709), with all bounces.
"""

import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

sys.path.append(str(Path(__file__).resolve().parent))
from aogauge_kit import LUMINANCE, Kit, arguments, read_glb, write_exr

MOST_OF_NODE = 128  # rays that the ambient occlusion node casts for one sample, at most
# How far beside the pixels' centres rays start, in pixels. Cycles skips the triangle that a ray leaves, but not its neighbour:
# from a centre that lies on the edge of two, as on a square's diagonal, all of a hemisphere is closed.
BESIDE = (0.003, 0.002)
BOUNCES = 1024  # Cycles' largest; Russian roulette ends paths long before


def material(name):
    """An empty material, its nodes and a function that links (node, socket) to (node, socket)."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    return made, tree.nodes, tree.links.new, output


def open_share(radius, rays):
    """Sends out the share of open rays, of `rays` for each sample."""
    made, nodes, link, output = material("openness")
    occlusion = nodes.new("ShaderNodeAmbientOcclusion")
    occlusion.samples = rays
    occlusion.inside = False
    occlusion.only_local = False
    occlusion.inputs["Distance"].default_value = radius
    emission = nodes.new("ShaderNodeEmission")
    link(occlusion.outputs["AO"], emission.inputs["Color"])
    link(emission.outputs[0], output.inputs["Surface"])
    return made


def matte(surface):
    """Diffuse, and shining where the surface does; to the camera it is white and dark, so that the picture is irradiance
    over pi."""
    made, nodes, link, output = material("matte")
    camera = nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]
    colour = nodes.new("ShaderNodeMixRGB")
    link(camera, colour.inputs["Fac"])
    colour.inputs["Color1"].default_value = (*surface.albedo, 1)
    colour.inputs["Color2"].default_value = (1, 1, 1, 1)
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Roughness"].default_value = 0
    link(colour.outputs[0], diffuse.inputs["Color"])
    if not surface.emission.any():
        link(diffuse.outputs[0], output.inputs["Surface"])
        return made
    strength = nodes.new("ShaderNodeMath")
    strength.operation = "SUBTRACT"
    strength.inputs[0].default_value = 1
    link(camera, strength.inputs[1])
    emission = nodes.new("ShaderNodeEmission")
    most = surface.emission.max()
    emission.inputs["Color"].default_value = (*(surface.emission / most), 1)
    scaled = nodes.new("ShaderNodeMath")
    scaled.operation = "MULTIPLY"
    scaled.inputs[1].default_value = most
    link(strength.outputs[0], scaled.inputs[0])
    link(scaled.outputs[0], emission.inputs["Strength"])
    both = nodes.new("ShaderNodeAddShader")
    link(diffuse.outputs[0], both.inputs[0])
    link(emission.outputs[0], both.inputs[1])
    link(both.outputs[0], output.inputs["Surface"])
    return made


def add(name, data):
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def geometry(surfaces, material_of):
    """As they are: flat triangles, in the kit's own axes."""
    for surface in surfaces:
        mesh = bpy.data.meshes.new("surface")
        mesh.from_pydata(surface.points.tolist(), [], surface.triangles.tolist())
        mesh.materials.append(material_of(surface))
        add("surface", mesh)


def camera(measure):
    data = bpy.data.cameras.new("measure")
    data.type = "ORTHO"
    data.sensor_fit = "HORIZONTAL"
    data.ortho_scale = 2 * measure["half_size"][0]
    data.clip_start, data.clip_end = 1e-6, 1e4
    up, back = Vector(measure["up"]), Vector(measure["normal"])
    across = up.cross(back)
    place = Vector(measure["center"]) + measure["clearance"] * back
    place += measure["pixel"] * (BESIDE[0] * across + BESIDE[1] * up)
    made = add("measure", data)
    made.matrix_world = frame(across, up, back, place)
    bpy.context.scene.camera = made
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = measure["resolution"]
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1


def frame(x, y, z, place):
    return Matrix([(x[i], y[i], z[i], place[i]) for i in range(3)] + [(0, 0, 0, 1)])


def world(kit):
    """The sky, and portals in its openings, which Cycles aims at."""
    made = bpy.data.worlds.new("sky")
    bpy.context.scene.world = made
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    background = tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    zenith, horizon, ground = kit.sky()
    background.inputs["Strength"].default_value = zenith
    if not zenith == horizon == ground:
        tree.links.new(gradient(tree, zenith, horizon, ground), background.inputs["Strength"])
    for corner, u, v in kit.openings():
        portal(corner, u, v, kit.measure["center"])


def gradient(tree, zenith, horizon, ground):
    """The socket of the radiance by elevation; +Y is up."""

    def math(operation, *values):
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        for value, socket in zip(values, node.inputs):
            if isinstance(value, float):
                socket.default_value = value
            else:
                tree.links.new(value, socket)
        return node.outputs[0]

    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], split.inputs[0])
    height = split.outputs["Y"]
    above = math("MULTIPLY_ADD", height, zenith - horizon, horizon)
    return math("ADD", math("MULTIPLY", math("LESS_THAN", height, 0.0), ground),
                math("MULTIPLY", math("SUBTRACT", 1.0, math("LESS_THAN", height, 0.0)), above))  # fmt: skip


def portal(corner, u, v, inside):
    """A rectangle that looks inside. What has no right angles is left out: it would change the noise alone."""
    u, v, corner = Vector(u), Vector(v), Vector(corner)
    if abs(u.dot(v)) > 1e-6 * u.length * v.length:
        return
    data = bpy.data.lights.new("opening", "AREA")
    data.shape = "RECTANGLE"
    data.size, data.size_y = u.length, v.length
    data.cycles.is_portal = True
    x, y = u.normalized(), v.normalized()
    place = corner + (u + v) / 2
    if x.cross(y).dot(Vector(inside) - place) > 0:  # it looks along -z
        y = -y
    add("opening", data).matrix_world = frame(x, y, x.cross(y), place)


def settings():
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_denoising = False
    cycles.use_adaptive_sampling = False
    cycles.time_limit = 0
    cycles.pixel_filter_type = "GAUSSIAN"  # Cycles' box is a pixel wide, whatever its width is set to
    cycles.filter_width = 0.01
    cycles.use_animated_seed = False
    # Nothing is cut off, blurred or approximated.
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.light_sampling_threshold = 0
    cycles.blur_glossy = 0
    cycles.use_fast_gi = False
    for kind in ("max_bounces", "diffuse_bounces"):
        setattr(cycles, kind, BOUNCES)
    scene.render.film_transparent = False
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.dither_intensity = 0
    picture = scene.render.image_settings
    picture.file_format, picture.color_mode, picture.color_depth = "OPEN_EXR", "RGB", "32"


class Scene:
    """A kit's scene in Blender."""

    def __init__(self, glb, views):
        self.glb, self.kit = glb, Kit(views)

    def prepare(self, estimator, rays, radius):
        """Empties Blender and builds the scene for an estimator."""
        surfaces = read_glb(self.glb, estimator)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        settings()
        camera(self.kit.measure)
        scene = bpy.context.scene
        scene.cycles.samples = rays
        if estimator == "classic":
            node = max(n for n in range(1, MOST_OF_NODE + 1) if rays % n == 0)
            scene.cycles.samples = rays // node
            shared = open_share(radius, node)
            geometry(surfaces, lambda surface: shared)
            # What sees nothing is open.
            scene.world = bpy.data.worlds.new("open")
            scene.world.use_nodes = True
            scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
        else:
            geometry(surfaces, matte)
            world(self.kit)

    def render(self, seed):
        """The image, rows from the top."""
        scene = bpy.context.scene
        scene.cycles.seed = seed
        wide, high = self.kit.measure["resolution"]
        with tempfile.TemporaryDirectory() as folder:
            scene.render.filepath = str(Path(folder) / "image.exr")
            bpy.ops.render.render(write_still=True)
            picture = bpy.data.images.load(scene.render.filepath)
            picture.colorspace_settings.name = "Non-Color"
            values = np.empty(4 * wide * high, "f4")
            picture.pixels.foreach_get(values)
            bpy.data.images.remove(picture)
        return (values.reshape(high, wide, 4)[::-1, :, :3] @ LUMINANCE).astype("f4")


def main():
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    args = arguments(words, __doc__.split("\n")[0], "blender.py")
    scene = Scene(args.scene, args.view)
    scene.prepare(args.estimator, args.rays, args.radius)
    write_exr(scene.render(args.seed), args.output)


if __name__ == "__main__":
    main()
