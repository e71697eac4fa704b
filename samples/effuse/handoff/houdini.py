"""Opens this effuse run in Houdini, 18.5 and later: terrain, lava, particles, volumes, camera and sun, turned to Houdini's y up.

    hython open_in_houdini.py run.hip            makes that file
    In Houdini: Windows, Python Source Editor: exec(open("/path/to/open_in_houdini.py").read(), {"__name__": "__main__", "__file__": "/path/to/open_in_houdini.py"})

A Python node reads each frame's mesh from frames/ as the time line moves: Cd (linear), v [m/s of film, for motion blur], temperature [K], glow (linear,
unbounded), crust, rest, pscale, id, ... effuse's film.usda (`effuse export --to usda`) opens in Solaris as it is.
Without Houdini, `python3 open_in_houdini.py` says what it would open.
"""
import json
import math
import os
import re
import sys

import numpy as np

#include frames.py

NAMES = {"color": "Cd", "velocity": "v", "radius": "pscale"}

COOK = """
import importlib.util
spec = importlib.util.spec_from_file_location("open_in_houdini", %r)
own = importlib.util.module_from_spec(spec)
spec.loader.exec_module(own)
own.cook(hou, hou.pwd().geometry(), own.file_of(%r, round(hou.frame())), %r)
"""


def attributes_of(data, time_scale):
    """{Houdini's name: float32 values}"""
    out = {}
    for name, values in data.items():
        if name not in ("points", "triangles"):
            out[NAMES.get(name, name)] = np.ascontiguousarray(values * time_scale if name == "velocity" else values, np.float32)
    if "glow" in data:
        out["basecolor"], out["emitcolor"] = albedo(data), out["glow"]
    return out


def cook(hou, geometry, path, time_scale):
    geometry.clear()
    data = read_frame(path) if path else {"points": np.empty((0, 3), np.float32), "triangles": ()}
    if not len(data["points"]):
        return
    geometry.createPoints(data["points"].tolist())
    if len(data["triangles"]):
        # Houdini winds its faces clockwise.
        geometry.createPolygons(np.ascontiguousarray(data["triangles"][:, ::-1]).tolist())
    for name, values in attributes_of(data, time_scale).items():
        geometry.addAttrib(hou.attribType.Point, name, 0.0 if values.ndim == 1 else (0.0,) * values.shape[1])
        geometry.setPointFloatAttribValuesFromString(name, values.tobytes())


def add_geometry(hou, parent, name, files, time_scale):
    thing = parent.createNode("geo", re.sub(r"\W", "_", name))
    for child in thing.children():
        child.destroy()
    thing.createNode("python", "frames").parm("python").set(COOK % (os.path.abspath(SCRIPT), files, time_scale))
    return thing


def add_lava_material(hou):
    shader = hou.node("/mat").createNode("principledshader::2.0", "effuse_lava")
    # The points' basecolor and emitcolor stand in for the shader's own.
    for parm, value in (("basecolor_usePointColor", 0), ("rough", 0.8), ("emitint", 1)):
        if shader.parm(parm):
            shader.parm(parm).set(value)
    return shader


def key_vector(hou, node, parms, frame, values):
    for parm, value in zip(parms, values):
        key = hou.Keyframe()
        key.setFrame(frame)
        key.setValue(value)
        key.setExpression("linear()", hou.exprLanguage.Hscript)
        node.parm(parm).setKeyframe(key)


def looking(hou, eye, target):
    """Rotations [degrees] of a camera at eye that looks at target, z up."""
    back = hou.Vector3(*(e - t for e, t in zip(eye, target))).normalized()
    right = hou.Vector3(0, 0, 1).cross(back).normalized()
    up = back.cross(right)
    return hou.Matrix4((right[0], right[1], right[2], 0, up[0], up[1], up[2], 0, back[0], back[1], back[2], 0, 0, 0, 0, 1)).extractRotates()


def add_camera_and_light(hou, parent, manifest):
    shot = manifest.get("camera")
    if not shot:
        return
    camera, sun = parent.createNode("cam", "camera"), parent.createNode("hlight", "sun")
    camera.parmTuple("res").set((shot["width"], shot["height"]))
    sun.parm("light_type").set("distant")
    aspect = shot["width"] / shot["height"]
    for key in shot["keys"]:
        frame = key["frame"]
        key_vector(hou, camera, ("tx", "ty", "tz"), frame, key["eye"])
        key_vector(hou, camera, ("rx", "ry", "rz"), frame, looking(hou, key["eye"], key["target"]))
        # Of a width of 41.4214 mm, which is Houdini's.
        key_vector(hou, camera, ("focal",), frame, [41.4214 / aspect / (2 * math.tan(key["fov"] / 2))])
        light = max(max(key["sun"]), 1e-9)
        key_vector(hou, sun, ("rx", "ry", "rz"), frame, looking(hou, key["sun_direction"], (0, 0, 0)))
        key_vector(hou, sun, ("light_intensity",), frame, [light])
        key_vector(hou, sun, ("light_colorr", "light_colorg", "light_colorb"), frame, [c / light for c in key["sun"]])


def build(hou, run):
    manifest = read_manifest(run)
    found = sequences(run)
    frames = [number for each in (*found.values(), *sequences(run, ("vdb",)).values()) for number in each]
    hou.setFps(manifest["fps"])
    hou.playbar.setFrameRange(1, max(frames, default=1))
    hou.playbar.setPlaybackRange(1, max(frames, default=1))
    world = hou.node("/obj").createNode("subnet", re.sub(r"\W", "_", manifest["name"]))
    world.parm("rx").set(-90)  # z up to y up
    for name in ("terrain", "obstacles"):
        still = [os.path.join(run, name + ending) for ending in (".ply", ".glb") if os.path.exists(os.path.join(run, name + ending))]
        if still and name not in found:
            add_geometry(hou, world, name, {1: still[0]}, 1)
    for name, files in found.items():
        thing = add_geometry(hou, world, name, files, manifest["time_scale"])
        if name == "skin":
            thing.parm("shop_materialpath").set(add_lava_material(hou).path())
    for name, files in sequences(run, ("vdb",)).items():
        thing = world.createNode("geo", re.sub(r"\W", "_", name) + "_volume")
        thing.createNode("file").parm("file").set(re.sub(r"\.\d{4,}\.vdb$", ".$F4.vdb", files[min(files)]))
        thing.setDisplayFlag(name != "lava")  # its skin is what one sees
    add_camera_and_light(hou, world, manifest)
    world.layoutChildren()
    hou.setFrame(max(frames, default=1))


SCRIPT = globals().get("__file__", "open_in_houdini.py")
if __name__ == "__main__":
    try:
        import hou
    except ImportError:
        hou = None
    RUN = find_run()
    if hou:
        build(hou, RUN)
        if len(sys.argv) > 1 and sys.argv[1].endswith((".hip", ".hipnc", ".hiplc")):
            hou.hipFile.save(os.path.abspath(sys.argv[1]))
    else:
        for NAME, FILES in sequences(RUN).items():
            DATA = read_frame(FILES[max(FILES)])
            print("%s: %d frames; frame %d: %d points, %d triangles, %s" % (NAME, len(FILES), max(FILES), len(DATA["points"]), len(DATA["triangles"]), " ".join(sorted(attributes_of(DATA, 1)))))
        print("Houdini's module hou is not here: hython %s run.hip" % os.path.basename(SCRIPT))
