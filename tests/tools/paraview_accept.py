"""What ParaView reads of a run's skin.pvd, of the series beside it and of the frames themselves: JSON.   pvbatch paraview_accept.py RUN OUT.json"""
import importlib.util
import json
import os
import sys

from paraview import simple

run, out = sys.argv[1:3]


def describe(source):
    source.UpdatePipelineInformation()
    times = list(source.TimestepValues)
    about = {"times": times, "frames": []}
    for time in times:
        source.UpdatePipeline(time)
        information = source.GetDataInformation()
        array = source.PointData.GetArray("temperature")
        about["frames"].append({"points": information.GetNumberOfPoints(), "cells": information.GetNumberOfCells(), "bounds": list(information.GetBounds()),
                                "temperature": list(array.GetRange()) if array else None, "arrays": sorted(source.PointData.keys())})
    return about


spec = importlib.util.spec_from_file_location("open_in_paraview", os.path.join(run, "open_in_paraview.py"))
own = importlib.util.module_from_spec(spec)
spec.loader.exec_module(own)
frames, manifest = own.sequences(run)["skin"], own.read_manifest(run)
with open(out, "w") as file:
    json.dump({"pvd": describe(simple.PVDReader(FileName=os.path.join(run, "skin.pvd"))),
               "series": describe(simple.OpenDataFile(os.path.join(run, "frames", "skin.vtp.series"))),
               "ply": describe(own.open_sequence(os.path.join(run, "nowhere"), "skin", frames, manifest))}, file, indent=1)
