"""What Blender has after a run's open_in_blender.py, and what its own importers make of the same frame: JSON, and three small pictures.

    blender -b --factory-startup --python-exit-code 1 --python RUN/open_in_blender.py --python blender_accept.py
with ACCEPT_RUN, ACCEPT_OUT (folder) and ACCEPT_FRAMES ("8,16,24") in the environment.
"""
import json
import os

import numpy as np

np.bool = bool  # Blender 3.4's glTF importer is older than Debian's numpy
import bpy
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

run, out = os.environ["ACCEPT_RUN"], os.environ["ACCEPT_OUT"]
frames = [int(word) for word in os.environ["ACCEPT_FRAMES"].split(",")]
scene = bpy.context.scene


def bounds(thing):
    corners = [thing.matrix_world @ Vector(c) for c in thing.bound_box]
    return [min(c[i] for c in corners) for i in range(3)], [max(c[i] for c in corners) for i in range(3)]


def values(attribute):
    width, name = {"FLOAT": (1, "value"), "INT": (1, "value"), "FLOAT_VECTOR": (3, "vector"), "FLOAT_COLOR": (4, "color"), "BYTE_COLOR": (4, "color")}[attribute.data_type]
    array = np.empty(width * len(attribute.data), np.float32)
    attribute.data.foreach_get(name, array)
    return array.reshape(-1, width)


def describe(thing):
    low, high = bounds(thing)
    mesh = thing.data
    about = {"vertices": len(mesh.vertices), "faces": len(mesh.polygons), "min": low, "max": high, "attributes": {}}
    for attribute in mesh.attributes:
        if attribute.data_type in ("FLOAT", "FLOAT_VECTOR", "FLOAT_COLOR", "BYTE_COLOR") and attribute.name != "position" and len(attribute.data):
            v = values(attribute)
            about["attributes"][attribute.name] = {"min": v.min(0).tolist(), "max": v.max(0).tolist(), "length": float(np.linalg.norm(v[:, :3], axis=1).max())}
    return about


report = {"frames": {}, "imports": {}, "fps": scene.render.fps / scene.render.fps_base, "end": scene.frame_end, "objects": sorted(o.name for o in bpy.data.objects),
          "motion_blur": scene.render.use_motion_blur, "view": scene.view_settings.view_transform}
scene.cycles.samples, scene.cycles.use_denoising = 16, False
scene.render.resolution_x, scene.render.resolution_y = 320, 180
scene.render.image_settings.file_format = "PNG"
for frame in frames:
    scene.frame_set(frame)
    about = describe(bpy.data.objects["skin"])
    picture = os.path.join(out, "blender.%04d.png" % frame)
    scene.render.filepath = picture
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(picture)
    pixels = np.array(image.pixels[:], np.float32).reshape(image.size[1], image.size[0], 4)
    glowing = (pixels[..., 0] > 0.8) & (pixels[..., 0] > 1.5 * pixels[..., 2])
    rows, columns = np.nonzero(glowing)
    about["glowing"] = int(glowing.sum())
    if len(rows):
        about["glow_at"] = [float(columns.mean() / image.size[0]), float(rows.mean() / image.size[1])]
    mesh = bpy.data.objects["skin"].data
    if len(mesh.vertices):
        seen = np.array([world_to_camera_view(scene, scene.camera, v.co)[:2] for v in mesh.vertices])
        about["seen_from"], about["seen_to"] = seen.min(0).tolist(), seen.max(0).tolist()
    report["frames"][frame] = about

last = frames[-1]
camera = scene.camera.matrix_world
report["camera"] = {"eye": list(camera.translation), "forward": list(camera.to_quaternion() @ Vector((0, 0, -1))), "fov": scene.camera.data.angle}
for ending, load in (("ply", lambda f: (bpy.ops.wm.ply_import if bpy.app.version >= (4, 0, 0) else bpy.ops.import_mesh.ply)(filepath=f)),
                     ("obj", lambda f: bpy.ops.wm.obj_import(filepath=f, forward_axis="Y", up_axis="Z")),
                     ("glb", lambda f: bpy.ops.import_scene.gltf(filepath=f))):
    before = set(bpy.data.objects)
    load(os.path.join(run, "frames", "skin.%04d.%s" % (last, ending)))
    report["imports"][ending] = describe(next(o for o in bpy.data.objects if o not in before and o.type == "MESH"))
volume = bpy.data.objects["lava volume"]
grids = volume.data.grids
assert grids.load(), grids.error_message
low, high = bounds(volume)
report["imports"]["vdb"] = {"grids": {g.name: g.data_type for g in grids}, "min": low, "max": high, "file": grids.frame_filepath if hasattr(grids, "frame_filepath") else ""}

# The whole film in one file.
before = set(bpy.data.objects)
bpy.ops.import_scene.gltf(filepath=os.path.join(run, "film.glb"))
pages = [o for o in bpy.data.objects if o not in before and o.name.startswith("skin.")]
report["flipbook"] = {}
for frame in frames:
    scene.frame_set(frame - 1)  # glTF's time begins at 0, with frame 1
    report["flipbook"][frame] = [[o.name, len(o.data.vertices)] for o in pages if max(o.scale) > 0.5]

with open(os.path.join(out, "blender.json"), "w") as file:
    json.dump(report, file, indent=1)
