"""Opens this effuse run in ParaView, 5.9 and later: terrain, lava coloured by temperature, other things, camera, times in seconds of lava.

    paraview --script=open_in_paraview.py        or: Tools, Python Shell, Run Script
    pvbatch open_in_paraview.py picture.png 12   one picture, of frame 12; without a number of the last

It takes NAME.pvd where `effuse export --to vtp` or output.formats made them, else it reads the frames' PLY or GLB itself, with all their attributes.
"""
import bisect
import json
import os
import re
import sys

import numpy as np
from paraview import simple
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkDataObject
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

#include frames.py

# What the sources of ParaView run: once for the times there are, once for each that is asked for.
LOAD = """
import importlib.util
spec = importlib.util.spec_from_file_location("open_in_paraview", %r)
own = importlib.util.module_from_spec(spec)
spec.loader.exec_module(own)
own.%s(self, *%r)
"""


def tell_times(source, files, times):
    information, pipeline = source.GetOutputInformation(0), vtkStreamingDemandDrivenPipeline
    information.Set(pipeline.TIME_STEPS(), times, len(times))
    information.Set(pipeline.TIME_RANGE(), [times[0], times[-1]], 2)


def cook(source, files, times):
    """The file of the time that is asked for, as the source's output."""
    information, asked = source.GetOutputInformation(0), vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
    time = information.Get(asked) if information.Has(asked) else times[0]
    k = max(0, bisect.bisect_right(times, time * (1 + 1e-9)) - 1)
    data, output = read_frame(files[k]), source.GetPolyDataOutput()
    points, cells = vtkPoints(), vtkCellArray()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(data["points"]), deep=True))
    output.SetPoints(points)
    mesh = len(data["triangles"]) > 0
    corners = data["triangles"] if mesh else np.arange(len(data["points"])).reshape(-1, 1)
    rows = np.concatenate([np.full((len(corners), 1), corners.shape[1]), corners], 1)
    cells.SetCells(len(corners), numpy_to_vtkIdTypeArray(rows.astype(np.int64).ravel(), deep=True))
    (output.SetPolys if mesh else output.SetVerts)(cells)
    for name, values in data.items():
        if name in ("points", "triangles"):
            continue
        if name == "color":  # for display
            values = (255 * np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055) + 0.5).astype(np.uint8)
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        output.GetPointData().AddArray(array)
    information.Set(vtkDataObject.DATA_TIME_STEP(), times[k])


def open_sequence(run, name, frames, manifest):
    """A source of one thing's frames, with its times."""
    pvd = os.path.join(run, name + ".pvd")
    if os.path.exists(pvd):
        return simple.PVDReader(registrationName=name, FileName=pvd)
    numbers = sorted(frames)
    files = [frames[k] for k in numbers]
    times = [k * manifest["time_scale"] / manifest["fps"] for k in numbers]
    source = simple.ProgrammableSource(registrationName=name)
    source.OutputDataSetType = "vtkPolyData"
    source.ScriptRequestInformation = LOAD % (os.path.abspath(SCRIPT), "tell_times", (files, times))
    source.Script = LOAD % (os.path.abspath(SCRIPT), "cook", (files, times))
    return source


def open_still(run, name):
    for ending, reader in (("vtp", simple.XMLPolyDataReader), ("ply", simple.PLYReader)):
        path = os.path.join(run, name + "." + ending)
        if os.path.exists(path):
            return reader(registrationName=name, **{"FileName" if ending == "vtp" else "FileNames": [path]})
    return None


def largest_of(source, last_time, name):
    """The array's range at a time, or nothing."""
    source.UpdatePipeline(last_time)
    array = source.PointData.GetArray(name)
    return array.GetRange() if array else None


def look(view, manifest, frame):
    keys = manifest.get("camera", {}).get("keys", [])
    key = next((k for k in reversed(keys) if k["frame"] <= frame), keys[0] if keys else None)
    if not key:
        return simple.ResetCamera(view)
    view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = key["eye"], key["target"], [0, 0, 1]
    view.CameraViewAngle = float(np.degrees(key["fov"]))


def build(run):
    manifest = read_manifest(run)
    view = simple.GetActiveViewOrCreate("RenderView")
    found = sequences(run)
    for entry in sorted(os.listdir(run)):
        if entry.endswith(".pvd"):
            found.setdefault(entry[:-4], {})
    for name, color in (("terrain", [0.42, 0.42, 0.36]), ("obstacles", [0.6, 0.58, 0.55])):
        still = None if name in found else open_still(run, name)
        if still:
            shown = simple.Show(still, view)
            shown.ColorArrayName = ["POINTS", ""]
            shown.DiffuseColor = shown.AmbientColor = color
    seconds = manifest["time_scale"] / manifest["fps"]
    last = max([k for frames in found.values() for k in frames] + [manifest.get("frames", 1)])
    for name in sorted(found):
        source = open_sequence(run, name, found[name], manifest)
        shown = simple.Show(source, view)
        span = largest_of(source, last * seconds, "temperature")
        if span:
            simple.ColorBy(shown, ("POINTS", "temperature"))
            table = simple.GetColorTransferFunction("temperature")
            # Black below where rock begins to glow.
            table.RGBPoints = [300, 0.12, 0.11, 0.1, 800, 0.25, 0.02, 0.0, 1100, 0.85, 0.12, 0.0, 1300, 1.0, 0.5, 0.05, 1500, 1.0, 0.95, 0.6]
            table.ColorSpace = "RGB"
            bar = simple.GetScalarBar(table, view)
            bar.Title, bar.ComponentTitle, bar.LabelFormat, bar.RangeLabelFormat = "temperature, K", "", "%.0f", "%.0f"
            shown.SetScalarBarVisibility(view, True)
    simple.AnnotateTimeFilter(registrationName="time", Input=next(iter(simple.GetSources().values())), Format="{time:.1f} s")
    simple.Show(simple.FindSource("time"), view)
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.AnimationTime = last * seconds
    view.ViewTime = last * seconds
    view.UseColorPaletteForBackground = 0
    view.Background = [0.1, 0.11, 0.13]
    shot = manifest.get("camera")
    if shot:
        view.ViewSize = [shot["width"], shot["height"]]
    look(view, manifest, last)
    simple.Render(view)
    return view, manifest, last


SCRIPT = globals().get("__file__", os.path.join(os.getcwd(), "open_in_paraview.py"))
if __name__ == "__main__":
    VIEW, MANIFEST, LAST = build(find_run())
    if len(sys.argv) > 1 and sys.argv[1].endswith(".png"):
        FRAME = int(sys.argv[2]) if len(sys.argv) > 2 else LAST
        VIEW.ViewTime = simple.GetAnimationScene().AnimationTime = FRAME * MANIFEST["time_scale"] / MANIFEST["fps"]
        look(VIEW, MANIFEST, FRAME)
        simple.SaveScreenshot(os.path.abspath(sys.argv[1]), VIEW)
