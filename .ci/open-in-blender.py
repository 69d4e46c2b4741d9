"""Opens each glb in Blender and checks what arrives: run by .ci/peers."""
import sys

import bpy
import numpy

# Blender 3.4's importer uses an alias that numpy 1.24 dropped.
if "bool" not in numpy.__dict__:
    numpy.bool = bool

failed = False
for path in sys.argv[sys.argv.index("--") + 1:]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)
    meshes = [o for o in bpy.data.objects if o.type == "MESH"]
    cameras = sorted(o.name for o in bpy.data.objects if o.type == "CAMERA")
    triangles = sum(len(o.data.loop_triangles) or (o.data.calc_loop_triangles() or len(o.data.loop_triangles)) for o in meshes)
    print(f"opened {path}: {len(meshes)} meshes, {triangles} triangles, cameras {', '.join(cameras)}")
    failed = failed or not meshes or not {"look", "measure"} <= {c.split(".")[0] for c in cameras}
sys.exit(1 if failed else 0)
