"""Triangles of a Wavefront OBJ (v and f lines alone) as one mesh of a glb: obj-to-glb.py IN.obj OUT.glb"""
import json
import struct
import sys

positions, indices = [], []
with open(sys.argv[1], encoding="utf-8") as lines:
    for line in lines:
        words = line.split()
        if words[:1] == ["v"]:
            positions.append(tuple(float(w) for w in words[1:4]))
        elif words[:1] == ["f"]:
            corners = [int(w.split("/")[0]) - 1 for w in words[1:]]
            assert len(corners) == 3, f"not a triangle: {line}"
            indices += corners
data = b"".join(struct.pack("<3f", *p) for p in positions) + struct.pack(f"<{len(indices)}I", *indices)
size = 12 * len(positions)
extremes = [[f(p[axis] for p in positions) for axis in range(3)] for f in (min, max)]
extremes = [struct.unpack("<3f", struct.pack("<3f", *e)) for e in extremes]
document = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0, "name": "all"}],
    "meshes": [{"name": "all", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": len(positions), "type": "VEC3", "min": extremes[0], "max": extremes[1]},
        {"bufferView": 1, "componentType": 5125, "count": len(indices), "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": size},
        {"buffer": 0, "byteOffset": size, "byteLength": len(data) - size},
    ],
    "buffers": [{"byteLength": len(data)}],
}
text = json.dumps(document).encode()
text += b" " * (-len(text) % 4)
with open(sys.argv[2], "wb") as out:
    out.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
    out.write(struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data)
