# Of two folders with records: all but `timing`, and all images, are equal.
import hashlib, json, pathlib, sys

one, other = map(pathlib.Path, sys.argv[1:])


def record(folder):
    found = json.loads((folder / "record.json").read_text())
    del found["timing"]
    return found


def images(folder):
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*.exr")}


assert record(one) == record(other), "the records differ"
assert images(one) and images(one) == images(other), "the images differ"
print(f"the merged record is that of the run in one piece, all but its times; so are its {len(images(one))} images, byte by byte")
