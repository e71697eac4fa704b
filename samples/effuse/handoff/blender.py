"""Opens this effuse run in Blender (tried in 3.4, written for 4.x, too): terrain, lava, particles, smoke, camera and sun as the run's pictures have them.

    blender --python open_in_blender.py          or: Scripting, Open, this file, Run

Nothing is installed. Each frame's mesh is read from frames/ as the time line moves; a .blend saved with it carries this script and goes on doing so
where scripts may run. Without a window, pictures come of

    blender -b --python open_in_blender.py -- --render picture.#### --frames 1-48 --samples 64 --size 1920x1080

Attributes of the lava: temperature [K], velocity [m/s of film, which motion blur takes], glow (linear, unbounded), albedo, crust, rest, ...
The value "from kelvin" in its material goes from glow as effuse has it (0) to Blender's own black body of the temperature (1).
"""
import json
import math
import os
import re
import sys

import bpy
try:
    import numpy as np
except ImportError:  # Debian's Blender comes without; blender.org's has it
    raise ImportError("this Blender has no numpy: on Debian, apt-get install python3-numpy") from None
from bpy.app.handlers import persistent
from mathutils import Matrix, Vector

#include frames.py

# ---- meshes ----

def add_attribute(mesh, name, values):
    n = len(mesh.vertices)
    if values.ndim == 2 and values.shape[1] != 3:
        return
    if name == "id":
        attribute = mesh.attributes.new("id", "INT", "POINT")
        attribute.data.foreach_set("value", values.astype(np.int32))
    elif name in ("color", "albedo"):
        attribute = mesh.attributes.new("Col" if name == "color" else name, "FLOAT_COLOR", "POINT")
        attribute.data.foreach_set("color", np.concatenate([values, np.ones((n, 1), np.float32)], 1).ravel())
    elif values.ndim == 2:
        attribute = mesh.attributes.new(name, "FLOAT_VECTOR", "POINT")
        attribute.data.foreach_set("vector", values.ravel())
    else:
        attribute = mesh.attributes.new(name, "FLOAT", "POINT")
        attribute.data.foreach_set("value", values)


def fill(mesh, data, time_scale):
    """The mesh becomes what a frame's file holds."""
    mesh.clear_geometry()
    points, triangles = data["points"], data["triangles"]
    if not len(points):
        return
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.ravel())
    if len(triangles):
        mesh.loops.add(triangles.size)
        mesh.loops.foreach_set("vertex_index", triangles.ravel())
        mesh.polygons.add(len(triangles))
        mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
        if not bpy.types.MeshPolygon.bl_rna.properties["loop_total"].is_readonly:  # before 4.1
            mesh.polygons.foreach_set("loop_total", np.full(len(triangles), 3, np.int32))
        mesh.polygons.foreach_set("use_smooth", np.ones(len(triangles), bool))
    mesh.update(calc_edges=True)
    for name, values in data.items():
        if name in ("points", "triangles"):
            continue
        # A second of film is time_scale seconds of lava.
        add_attribute(mesh, name, values * np.float32(time_scale) if name == "velocity" else values)
    if "color" in data:
        add_attribute(mesh, "albedo", albedo(data))
    mesh.update()


@persistent
def show_frame(scene, depsgraph=None):
    """Puts the frame's files into the objects that show them; does nothing for parts of a frame, which motion blur asks for."""
    frame = math.floor(scene.frame_current + scene.frame_subframe + 0.5)
    for thing in list(bpy.data.objects):
        if "effuse_run" not in thing:
            continue
        frames = sequences(bpy.path.abspath(thing["effuse_run"])).get(thing["effuse_name"], {})
        path = file_of(frames, frame)
        if thing.data.get("effuse_shows") == (path or ""):
            continue
        fill(thing.data, read_frame(path) if path else {"points": (), "triangles": ()}, thing["effuse_time_scale"])
        thing.data["effuse_shows"] = path or ""


def follow_frames():
    handlers = bpy.app.handlers.frame_change_pre
    for old in [h for h in handlers if h.__name__ == "show_frame"]:
        handlers.remove(old)
    handlers.append(show_frame)


# ---- materials ----

class Nodes:
    """A material's nodes, wired as they are made."""

    def __init__(self, name):
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.column = 0

    def add(self, kind, label="", **inputs):
        node = self.tree.nodes.new(kind)
        node.label = label
        node.location = (220 * (self.column % 6), -260 * (self.column // 6))
        self.column += 1
        for name, value in inputs.items():
            socket = node.inputs[int(name[1:]) if name[0] == "_" else name.replace("_", " ")]
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node

    def attribute(self, name):
        node = self.add("ShaderNodeAttribute", name)
        node.attribute_name = name
        return node

    def math(self, operation, a, b):
        node = self.add("ShaderNodeMath", operation.lower(), _0=a, _1=b)
        node.operation = operation
        return node.outputs[0]

    def surface(self, shader):
        self.add("ShaderNodeOutputMaterial", Surface=shader)
        return self.material


def black_body(nodes, temperature):
    """Emission of a temperature [K]: Blender's hue, and effuse's brightness, 6 (T / 1473)^9 from 800 K on."""
    hue = nodes.add("ShaderNodeBlackbody", "hue", Temperature=temperature)
    strength = nodes.math("MULTIPLY", nodes.math("POWER", nodes.math("DIVIDE", temperature, 1473.15), 9.0), 6.0)
    strength = nodes.math("MULTIPLY", strength, nodes.math("GREATER_THAN", temperature, 800.0))
    return nodes.add("ShaderNodeEmission", "of kelvin", Color=hue.outputs[0], Strength=strength).outputs[0]


def lava_material(has_glow):
    nodes = Nodes("lava")
    crust, temperature = nodes.attribute("crust").outputs["Fac"], nodes.attribute("temperature").outputs["Fac"]
    rough = nodes.math("ADD", nodes.math("MULTIPLY", crust, 0.45), 0.45)
    rock = nodes.add("ShaderNodeBsdfPrincipled", "rock", Base_Color=nodes.attribute("albedo").outputs["Color"], Roughness=rough)
    glow = nodes.add("ShaderNodeEmission", "glow", Color=nodes.attribute("glow").outputs["Vector"], Strength=1.0)
    choice = nodes.add("ShaderNodeValue", "from kelvin")
    choice.outputs[0].default_value = 0.0 if has_glow else 1.0
    light = nodes.add("ShaderNodeMixShader", "", _0=choice.outputs[0], _1=glow.outputs[0], _2=black_body(nodes, temperature))
    return nodes.surface(nodes.add("ShaderNodeAddShader", "", _0=rock.outputs[0], _1=light.outputs[0]).outputs[0])


def ground_material():
    """Grass where it is flat, rock where it is steep, dry patches between, small bumps."""
    nodes = Nodes("ground")
    place = nodes.add("ShaderNodeTexCoord").outputs["Object"]
    up = nodes.add("ShaderNodeSeparateXYZ", "", _0=nodes.add("ShaderNodeNewGeometry").outputs["Normal"]).outputs["Z"]
    patches = nodes.add("ShaderNodeTexNoise", "patches", Vector=place, Scale=0.05, Detail=10.0, Roughness=0.62).outputs["Fac"]
    flat = nodes.math("MULTIPLY", nodes.math("SUBTRACT", nodes.math("ADD", up, nodes.math("MULTIPLY", patches, 0.6)), 1.05), 3.3)
    ramp = nodes.add("ShaderNodeValToRGB", "steep to flat", Fac=flat)
    steps = ramp.color_ramp.elements
    steps[0].position, steps[0].color = 0.05, (0.060, 0.050, 0.040, 1)
    steps[1].position, steps[1].color = 1.0, (0.120, 0.110, 0.045, 1)
    steps.new(0.35).color = (0.115, 0.085, 0.042, 1)
    steps.new(0.65).color = (0.045, 0.058, 0.016, 1)
    bumps = nodes.add("ShaderNodeTexNoise", "bumps", Vector=place, Scale=0.5, Detail=8.0)
    normal = nodes.add("ShaderNodeBump", "", Strength=0.6, Distance=0.8, Height=bumps.outputs["Fac"])
    return nodes.surface(nodes.add("ShaderNodeBsdfPrincipled", "ground", Base_Color=ramp.outputs["Color"], Roughness=0.95, Normal=normal.outputs["Normal"]).outputs[0])


def thing_material(name):
    nodes = Nodes(name)
    body = nodes.add("ShaderNodeBsdfPrincipled", name, Base_Color=nodes.attribute("Col").outputs["Color"], Roughness=0.8)
    return nodes.surface(body.outputs[0])


def particle_material(name):
    nodes = Nodes(name)
    body = nodes.add("ShaderNodeBsdfPrincipled", name, Base_Color=(0.8, 0.8, 0.8, 1), Roughness=0.9)
    light = black_body(nodes, nodes.attribute("temperature").outputs["Fac"])
    return nodes.surface(nodes.add("ShaderNodeAddShader", "", _0=body.outputs[0], _1=light).outputs[0])


def smoke_material(name):
    nodes = Nodes(name)
    volume = nodes.add("ShaderNodeVolumePrincipled", name, Color=(0.7, 0.7, 0.7, 1))
    volume.inputs["Density Attribute"].default_value = "density"
    volume.inputs["Density"].default_value = 1.0  # the grid is extinction, 1/m
    nodes.add("ShaderNodeOutputMaterial", Volume=volume.outputs[0])
    return nodes.material


# ---- objects ----

def add_object(collection, name, data):
    thing = bpy.data.objects.new(name, data)
    collection.objects.link(thing)
    return thing


def draw_as_balls(thing, material):
    """Geometry nodes that make a ball of each vertex, of its attribute radius."""
    group = bpy.data.node_groups.new(thing.name + " balls", "GeometryNodeTree")
    if hasattr(group, "interface"):
        group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    else:
        group.inputs.new("NodeSocketGeometry", "Geometry")
        group.outputs.new("NodeSocketGeometry", "Geometry")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    points, radius, paint = (group.nodes.new("GeometryNode" + kind) for kind in ("MeshToPoints", "InputNamedAttribute", "SetMaterial"))
    radius.data_type = "FLOAT"
    radius.inputs["Name"].default_value = "radius"
    paint.inputs["Material"].default_value = material
    value = next(socket for socket in radius.outputs if socket.enabled and socket.name == "Attribute")
    for a, b in ((start.outputs[0], points.inputs["Mesh"]), (value, points.inputs["Radius"]), (points.outputs[0], paint.inputs["Geometry"]), (paint.outputs[0], end.inputs[0])):
        group.links.new(a, b)
    thing.modifiers.new("balls", "NODES").node_group = group


def add_volumes(collection, run):
    for name, frames in sequences(run, ("vdb",)).items():
        first = min(frames)
        volume = bpy.data.volumes.new(name)
        volume.filepath = frames[first]
        volume.is_sequence = True
        volume.frame_start, volume.frame_offset, volume.frame_duration = first, first - 1, max(frames) - first + 1
        thing = add_object(collection, name + " volume", volume)
        volume.materials.append(smoke_material(name))
        # The lava's own is there for effects; its skin is what one sees.
        thing.hide_render = name == "lava"
        thing.hide_set(name == "lava")


def add_camera_and_light(collection, scene, manifest):
    shot = manifest.get("camera")
    if not shot:
        return
    camera = add_object(collection, "camera", bpy.data.cameras.new("camera"))
    lamp = add_object(collection, "sun", bpy.data.lights.new("sun", "SUN"))
    scene.camera = camera
    camera.data.sensor_fit = "VERTICAL"
    camera.data.clip_start, camera.data.clip_end = 0.1, 1e5
    lamp.data.angle = math.radians(0.53)
    scene.render.resolution_x, scene.render.resolution_y = shot["width"], shot["height"]
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    scene.world = world
    sky = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")

    turns = [None, None]
    keys = shot["keys"]

    def put(key, frame):
        eye, target = Vector(key["eye"]), Vector(key["target"])
        camera.location = eye
        camera.data.angle = key["fov"]
        light = max(key["sun"])
        lamp.data.energy = light
        if light > 0:
            lamp.data.color = [c / light for c in key["sun"]]
        sky.inputs["Color"].default_value = (*key["sky"], 1)
        scene.view_settings.exposure = math.log2(max(key["exposure"], 1e-6))
        for k, (thing, look) in enumerate(((camera, (target - eye)), (lamp, -Vector(key["sun_direction"])))):
            thing.rotation_mode = "QUATERNION"
            turn = look.to_track_quat("-Z", "Y")
            if turns[k] is not None and turn.dot(turns[k]) < 0:
                turn.negate()
            thing.rotation_quaternion = turns[k] = turn
        if len(keys) > 1:
            for owner, path in ((camera, "location"), (camera, "rotation_quaternion"), (camera.data, "lens"), (lamp, "rotation_quaternion"), (lamp.data, "energy"), (lamp.data, "color"),
                                (sky.inputs["Color"], "default_value"), (scene, "view_settings.exposure")):
                owner.keyframe_insert(path, frame=frame)

    edit = bpy.context.preferences.edit
    usual, edit.keyframe_new_interpolation_type = edit.keyframe_new_interpolation_type, "LINEAR"
    for key, after in zip(keys, keys[1:] + [None]):
        put(key, key["frame"])
        if after and after["frame"] > key["frame"] + 1:
            put(key, after["frame"] - 1)
    edit.keyframe_new_interpolation_type = usual


def show_in_windows():
    """Through the camera, with materials, and as far as a mountain reaches."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            for space in area.spaces:
                if space.type == "VIEW_3D":
                    space.clip_end = 1e5
                    space.shading.type = "MATERIAL"
                    space.shading.use_scene_lights = space.shading.use_scene_world = True
                    if space.region_3d:
                        space.region_3d.view_perspective = "CAMERA"


def build(run):
    manifest = read_manifest(run)
    scene = bpy.context.scene
    fps, time_scale = manifest["fps"], manifest["time_scale"]
    scene.render.fps = max(1, round(fps))
    scene.render.fps_base = scene.render.fps / fps
    scene.unit_settings.system = "METRIC"
    collection = bpy.data.collections.new(manifest["name"])
    scene.collection.children.link(collection)

    for name in ("terrain.ply", "terrain.glb"):
        if os.path.exists(os.path.join(run, name)):
            ground = add_object(collection, "terrain", bpy.data.meshes.new("terrain"))
            fill(ground.data, read_frame(os.path.join(run, name)), 1)
            ground.data.materials.append(ground_material())
            break

    found = sequences(run)
    still = os.path.join(run, "obstacles.ply")
    if "obstacles" not in found and os.path.exists(still):
        things = add_object(collection, "obstacles", bpy.data.meshes.new("obstacles"))
        fill(things.data, read_frame(still), 1)
        things.data.materials.append(thing_material("obstacles"))
    for name, frames in found.items():
        thing = add_object(collection, name, bpy.data.meshes.new(name))
        thing["effuse_run"], thing["effuse_name"], thing["effuse_time_scale"] = run, name, time_scale
        sample = next((data for data in (read_frame(frames[k]) for k in sorted(frames, reverse=True)) if len(data["points"])), None)
        if sample is None:
            continue
        if len(sample["triangles"]):
            thing.data.materials.append(lava_material("glow" in sample) if name == "skin" else thing_material(name))
        else:
            draw_as_balls(thing, particle_material(name))
    add_volumes(collection, run)
    add_camera_and_light(collection, scene, manifest)

    frames = [number for each in (*found.values(), *sequences(run, ("vdb",)).values()) for number in each]
    scene.frame_start, scene.frame_end = 1, max(frames, default=1)
    scene.render.engine = "CYCLES"
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 0.5
    scene.render.use_lock_interface = True  # the handler changes meshes while pictures are made
    for view in ("Filmic", "AgX", "Standard"):
        try:
            scene.view_settings.view_transform = view
            break
        except TypeError:
            continue

    follow_frames()
    if "__file__" in globals() and os.path.exists(__file__):
        text = bpy.data.texts.load(__file__)
        text.use_module = True  # a .blend that is opened again runs it, and the handler is back
    show_in_windows()
    scene.frame_set(1)
    print("effuse: %s, %d frames of %s" % (manifest["name"], scene.frame_end, ", ".join(sorted({*found, *sequences(run, ("vdb",))})) or "nothing"))
    return scene


def render(scene, arguments):
    """Pictures of what stands after --; without --render nothing."""
    options = dict(zip(arguments[::2], arguments[1::2]))
    known = ("--render", "--frames", "--samples", "--size")
    unknown = [word for word in arguments[::2] if word not in known]
    if unknown or len(arguments) % 2:
        raise SystemExit("effuse: %s: wanted %s, each with its value" % (" ".join(unknown) or arguments[-1], " ".join(known)))
    if "--render" not in options:
        return
    first, _, last = options.get("--frames", "%d-%d" % (scene.frame_start, scene.frame_end)).partition("-")
    scene.cycles.samples = int(options.get("--samples", 64))
    scene.cycles.use_denoising = False
    if "--size" in options:
        scene.render.resolution_x, scene.render.resolution_y = (int(side) for side in options["--size"].split("x"))
    scene.render.image_settings.file_format = "PNG"
    pattern = os.path.abspath(options["--render"])
    for frame in range(int(first), int(last or first) + 1):
        scene.frame_set(frame)
        scene.render.filepath = pattern.replace("####", "%04d" % frame)
        bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    for unwanted in ("Cube", "Light", "Camera"):  # what an empty scene starts with
        if bpy.data.filepath == "" and unwanted in bpy.data.objects:
            bpy.data.objects.remove(bpy.data.objects[unwanted], do_unlink=True)
    RUN_SCENE = build(find_run())
    if bpy.app.background and "--" in sys.argv:
        render(RUN_SCENE, sys.argv[sys.argv.index("--") + 1:])
else:
    follow_frames()
