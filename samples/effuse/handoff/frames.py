# ---- the run's files ----

def find_run():
    """The folder this script lies in, with the run's manifest.json or frames."""
    places = []
    if "__file__" in globals():
        places.append(os.path.dirname(os.path.abspath(__file__)))
    if "bpy" in globals():
        places += [os.path.dirname(bpy.path.abspath(text.filepath)) for text in bpy.data.texts if text.filepath]
    for place in places:
        if os.path.exists(os.path.join(place, "manifest.json")) or os.path.isdir(os.path.join(place, "frames")):
            return place
    raise SystemExit("effuse: neither manifest.json nor frames/ beside this script; it belongs into the run's folder (looked in: %s)" % ", ".join(places))


def read_manifest(run):
    """manifest.json, or what stands for it where it is missing or damaged."""
    try:
        with open(os.path.join(run, "manifest.json"), encoding="utf-8") as file:
            return json.load(file)
    except (OSError, ValueError) as error:
        print("effuse: manifest.json: %s; 24 frames a second, 1 s of lava each, no camera" % error)
        return {"name": os.path.basename(run), "fps": 24.0, "time_scale": 1.0}


def sequences(run, extensions=("ply", "glb")):
    """{name: {frame: file}} of frames/NAME.####.EXT, of the first extension that a frame has."""
    found = {}
    folder = os.path.join(run, "frames")
    for entry in sorted(os.listdir(folder)) if os.path.isdir(folder) else []:
        match = re.fullmatch(r"(.+)\.(\d{4,})\.(\w+)", entry)
        if not match or match[3] not in extensions or match[1].endswith(".part"):
            continue
        frames = found.setdefault(match[1], {})
        number, old = int(match[2]), frames.get(int(match[2]))
        if old is None or extensions.index(match[3]) < extensions.index(old.rsplit(".", 1)[1]):
            frames[number] = os.path.join(folder, entry)
    return found


def file_of(frames, frame):
    """The file that a frame shows: its own, or else the last one before it; None before the first."""
    earlier = [number for number in frames if number <= frame]
    return frames[max(earlier)] if earlier else None


def linear(srgb):
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).astype(np.float32)


def read_ply(path):
    """{"points": n x 3, "triangles": m x 3, attributes by name: n or n x 3}, colour linear; of the binary PLY that effuse writes."""
    kinds = {"float": "<f4", "double": "<f8", "uchar": "u1", "uint": "<u4", "int": "<i4"}
    with open(path, "rb") as file:
        data = file.read()
    end = data.index(b"end_header\n") + 11
    counts, vertex, face, element = {"vertex": 0, "face": 0}, [], [], ""
    for line in data[:end].decode("utf-8", "replace").split("\n"):
        words = line.split()
        if words[:1] == ["element"]:
            element = words[1]
            counts[element] = int(words[2])
        elif words[:2] == ["property", "list"]:
            face += [("count", "u1"), ("corners", "<u4", 3)]
        elif words[:1] == ["property"]:
            (vertex if element == "vertex" else face).append((words[2], kinds[words[1]]))
    rows = np.frombuffer(data, np.dtype(vertex), counts["vertex"], end)
    out = {"points": np.stack([rows[c] for c in "xyz"], 1).astype(np.float32), "triangles": np.empty((0, 3), np.int32)}
    if counts["face"]:
        out["triangles"] = np.frombuffer(data, np.dtype(face), counts["face"], end + rows.nbytes)["corners"].astype(np.int32)
    names = [name for name, _ in vertex if name not in ("x", "y", "z", "nx", "ny", "nz", "region", "region_high")]
    if "red" in names:
        out["color"] = linear(np.stack([rows[c] for c in ("red", "green", "blue")], 1) / np.float32(255))
    for name in names:
        if name in ("red", "green", "blue") or name[-2:] in ("_y", "_z"):
            continue
        if name[-2:] == "_x" and name[:-2] + "_z" in names:
            out[name[:-2]] = np.stack([rows[name[:-1] + c] for c in "xyz"], 1).astype(np.float32)
        else:
            out[name] = rows[name].astype(np.float32)
    return out


def read_glb(path):
    """The same of the GLB that effuse writes, turned back to z up. Without glow, which is a texture there."""
    with open(path, "rb") as file:
        data = file.read()
    length = int.from_bytes(data[12:16], "little")
    scene, binary = json.loads(data[20:20 + length]), 20 + length + 8
    if "meshes" not in scene:
        return {"points": np.empty((0, 3), np.float32), "triangles": np.empty((0, 3), np.int32)}

    def array(number):
        accessor = scene["accessors"][number]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        kind = {5123: "<u2", 5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        at = binary + scene["bufferViews"][accessor["bufferView"]]["byteOffset"]
        values = np.frombuffer(data, kind, width * accessor["count"], at)
        return values if width == 1 else values.reshape(-1, width)

    def z_up(v):
        return np.stack([v[:, 0], -v[:, 2], v[:, 1]], 1)

    primitive = scene["meshes"][0]["primitives"][0]
    out = {"triangles": array(primitive["indices"]).reshape(-1, 3).astype(np.int32)}
    for key, number in primitive["attributes"].items():
        if key == "POSITION":
            out["points"] = z_up(array(number))
        elif key == "COLOR_0":
            out["color"] = array(number)[:, :3].astype(np.float32) / 65535
        elif key.startswith("_"):
            values = array(number)
            out[key[1:].lower()] = z_up(values) if values.ndim == 2 and values.shape[1] == 3 else values
    return out


def read_frame(path):
    return read_ply(path) if path.endswith(".ply") else read_glb(path)


def albedo(data):
    """What the surface reflects: its colour for display less the glow that is in it."""
    if "glow" not in data:
        return data["color"]
    return np.clip(data["color"] - (1 - np.exp(-np.maximum(data["glow"], 0))), 0.02, 1).astype(np.float32)
