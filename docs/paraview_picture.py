"""Draw the eigenfunctions of a collection that fpsolve has written, in ParaView; the picture goes beside it.

    pvpython docs/paraview_picture.py --collection results/fig1/eigenfunctions.pvd

    --collection FILE.pvd                    T(phi, xi) at p = 2 as a surface, saved to eigenfunctions.png
      --p 1 --field tilted_density           another p and field, saved to eigenfunctions-tilted_density.png
    --collection FOLDER/sets.pvd --p 3     the third parameter set of several, all at one p

Where there is no display: xvfb-run -a -s -noreset pvpython docs/paraview_picture.py --collection FILE.pvd
The time of eigenfunctions.pvd is p, that of sets.pvd the number of the set, or the value of what is varied. Fields
are divided by their maximum, and shown where a density exceeds 1e-3 of its own. Red lines are impacts, where T jumps.
"""

import argparse
from pathlib import Path

from paraview import servermanager, simple

SYMBOLS = {"T": "T", "T_adjoint": "T*", "tilted_density": "T T*", "stationary_density": "T* at p = 0"}

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--field", default="T", choices=SYMBOLS, help="what to draw (default: T)")
parser.add_argument("--p", type=float, help="p, or the time of another collection (default: the one nearest to 2)")
parser.add_argument("--collection", type=Path, required=True, help="the file, .pvd")
chosen = parser.parse_args()
if not chosen.collection.is_file():
    parser.error(f"there is no {chosen.collection}; name the collection with --collection FILE.pvd")
reader = simple.PVDReader(FileName=str(chosen.collection))
time = min(reader.TimestepValues, key=lambda each: abs(each - (2.0 if chosen.p is None else chosen.p)))
if chosen.p is not None and not abs(time - chosen.p) <= 1e-9 * max(1, abs(time)):
    there = ", ".join(f"{each:.10g}" for each in reader.TimestepValues)
    parser.error(f"--p {chosen.p:g}: {chosen.collection} has no such time; choose one of {there}")
simple.GetAnimationScene().AnimationTime = time
reader.UpdatePipeline(time)
known = servermanager.Fetch(reader).GetFieldData()
arrays = known.GetArray("impacts"), known.GetArray("along_y")
impacts, along_y = ([array.GetValue(i) for i in range(array.GetNumberOfTuples())] for array in arrays)

ends = []  # of the noise where the stationary or the tilted density lives
for density in ("stationary_density", "tilted_density"):
    top = reader.PointData[density].GetRange()[1]
    lives = simple.Threshold(Input=reader, Scalars=["POINTS", density], LowerThreshold=1e-3 * top, UpperThreshold=top)
    lives.AllScalars = 0
    lives.UpdatePipeline(time)
    ends += lives.PointData["z"].GetRange()
strip = simple.Threshold(Input=reader, Scalars=["POINTS", "z"], LowerThreshold=min(ends), UpperThreshold=max(ends))
scaled = simple.PythonCalculator(Input=strip, Expression=f"{chosen.field}/max({chosen.field})", ArrayName="scaled")
facets = simple.ExtractSurface(Input=scaled, NonlinearSubdivisionLevel=3)
surface = simple.WarpByScalar(Input=facets, Scalars=["POINTS", "scaled"])
surface.UpdatePipeline(time)
bounds = surface.GetDataInformation().GetBounds()
beside = [phi + side for phi in impacts if phi == phi for side in (-1e-3, 1e-3)]
walls = simple.Slice(Input=surface, SliceOffsetValues=beside or [-1.0])
walls.SliceType.Origin, walls.SliceType.Normal = [0, 0, 0], [1, 0, 0]
view = simple.CreateView("RenderView")
view.ViewSize, view.OrientationAxesVisibility = [1600, 1000], 0
scale = [edge / max(bounds[2 * k + 1] - bounds[2 * k], 1e-9) for k, edge in enumerate((1.0, 0.75, 0.4))]
for source in (walls, surface):
    display = simple.Show(source, view)
    display.Scale, display.LineWidth, display.RenderLinesAsTubes = scale, 5, source is walls
    display.Ambient, display.Diffuse, display.AmbientColor = 0.45, 0.55, [0.85, 0.1, 0.1]
    simple.ColorBy(display, ("POINTS", "scaled") if source is surface else None)
colours = simple.GetColorTransferFunction("scaled")
colours.ApplyPreset("Viridis (matplotlib)", True)
colours.RescaleTransferFunction(*bounds[4:])
bar, axes = simple.GetScalarBar(colours, view), view.AxesGrid
bar.Visibility, bar.Title, bar.ComponentTitle, bar.HorizontalTitle = 1, f"{SYMBOLS[chosen.field]} / max", "", 1
bar.AutomaticLabelFormat, bar.LabelFormat, bar.RangeLabelFormat = 0, "%-#.2g", "%-#.2g"
axes.Visibility, axes.AxesToLabel, axes.DataScale, axes.ZTitle = 1, 7, scale, ""
axes.XTitle, axes.YTitle = "phase phi (rad)", bytes(map(int, along_y)).decode()
axes.YAxisUseCustomLabels = "noise xi" not in axes.YTitle
axes.YAxisLabels = list(range(1, 1 + axes.YTitle.count(";")))
axes.XTitleFontSize = axes.YTitleFontSize = axes.XLabelFontSize = axes.YLabelFontSize = axes.ZLabelFontSize = 24
head = "varied.tobytes().decode() + '\\n' + " if known.GetArray("varied") else ""
head += '"p = %g     Lambda(p) = %.6g (1/time)" % (p[0], Lambda[0])'
title = simple.Show(simple.PythonAnnotation(Input=reader, ArrayAssociation="Field Data", Expression=head), view)
title.WindowLocation, title.FontSize, bar.TitleFontSize, bar.LabelFontSize = "Upper Center", 30, 26, 22
simple.Render(view)  # the first time it turns the camera
view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [-1.2, -2, 1.6], [0, 0, 0], [0, 0, 1]
view.ResetCamera(True)
name = chosen.collection.stem + (f"-{chosen.field}" if chosen.field != "T" else "")
simple.SaveScreenshot(str(chosen.collection.with_name(f"{name}.png")), view, OverrideColorPalette="WhiteBackground")
