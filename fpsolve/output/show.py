"""Draw the eigenfunctions that lie beside this file, in ParaView.

    pvpython show.py                          T(phi, xi) at p = 2 as a surface, saved to eigenfunctions.png
    pvpython show.py --cylinder --p 1         wrapped on a cylinder: phi around it, xi along it
    pvpython show.py --field tilted_density   another field, saved to eigenfunctions-tilted_density.png
    pvpython show.py --collection curves.pvd --time 3     the third curve of several, all at one p

Where there is no display: xvfb-run -a -s -noreset pvpython show.py
In ParaView itself: Run Script of the Python Shell, or Macros > Import new macro. The time of eigenfunctions.pvd is p,
that of curves.pvd the number of the curve, or the varied value where one number is varied; the title follows it.
The red lines are the impacts, where T jumps.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any

try:
    from paraview import servermanager, simple  # type: ignore[import-not-found, unused-ignore]
except ImportError:
    raise SystemExit("this script runs in ParaView's Python: pvpython show.py") from None

FOLDER = ""  # where the results were written
SYMBOLS = {"T": "T", "T_adjoint": "T*", "tilted_density": "T T*", "stationary_density": "T* at p = 0"}
COLOURS = "Viridis (matplotlib)"
NEGLIGIBLE = 1e-3
"""xi is shown where the stationary or the tilted density exceeds this share of its maximum."""
NEXT_TO_ZERO = 0.05
"""A least value below this share of the maximum is drawn as 0, which rounding and small errors miss."""
BOX = (1.0, 0.75, 0.4)
"""Edges of the picture's box along phi, xi and the height."""
LENGTH = 2.0
"""Length of the cylinder, whose radius is 1."""
CAMERA = {False: (-1.2, -2, 1.6), True: (-1.5, -1.5, 1.3)}
ANGLE = 26
"""From where the plane (False) and the cylinder (True) are seen, and the viewing angle of both in degrees."""
USUAL = 2.0
"""The p that is drawn when none is asked for."""
SAME = 1e-9
"""p that differ by no more, relative to their size, are one p."""
SUBDIVISION = 3
"""How often each Lagrange cell is halved to look smooth."""
GAP = 0.15
"""Between the rim of the cylinder and what is written beside it."""
FRONT = 1.6
"""The radius from which on words before the cylinder do not cover it."""
BLACK = (0.0, 0.0, 0.0)
RED = (0.85, 0.1, 0.1)
QUARTER = math.pi / 2


def main(arguments: list[str]) -> None:
    chosen = options(arguments)
    view = simple.GetActiveViewOrCreate("RenderView")
    simple.HideAll(view)
    view.ViewSize, view.OrientationAxesVisibility = [1600, 1000], 0
    reader, time = load(chosen)
    draw(reader, view, time, chosen)
    simple.Render(view)  # the first time it turns the camera
    view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = CAMERA[chosen.cylinder], [0, 0, 0], [0, 0, 1]
    view.ResetCamera(True)
    view.CameraViewAngle = ANGLE
    simple.SaveScreenshot(str(chosen.output), view, OverrideColorPalette="WhiteBackground")
    known = servermanager.Fetch(reader).GetFieldData()
    words = [f"p = {known.GetArray('p').GetValue(0):g}"]
    if known.GetArray("varied"):
        words.insert(0, text_of(known, "varied"))
    print(f"{', '.join(words)}: {chosen.output}")


def options(arguments: list[str]) -> argparse.Namespace:
    """The command line, with the collection and the picture found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cylinder", action="store_true", help="wrap (phi, xi) on a cylinder")
    parser.add_argument("--field", default="T", choices=SYMBOLS, help="what to draw (default: T)")
    parser.add_argument("--p", type=float, help=f"the moment (default: {USUAL:g}, or the nearest one there is)")
    parser.add_argument("--time", type=float, help="the time of the collection, for curves.pvd the curve")
    named = "the picture, .png or .jpg (default: named after the collection, the field and the shape)"
    parser.add_argument("--output", type=Path, help=named)
    parser.add_argument("--collection", type=Path, help="default: eigenfunctions.pvd beside this file")
    chosen = parser.parse_args(arguments)
    chosen.collection = chosen.collection or beside_this_file("eigenfunctions.pvd")
    field, shape = "" if chosen.field == "T" else f"-{chosen.field}", "-cylinder" if chosen.cylinder else ""
    chosen.output = chosen.output or chosen.collection.with_name(f"{chosen.collection.stem}{field}{shape}.png")
    if chosen.p is not None and chosen.time is not None:
        raise SystemExit("--p and --time say the same of the eigenfunctions of a curve; leave one out")
    if not chosen.collection.is_file():
        raise SystemExit(f"there is no {chosen.collection}; name the collection with --collection FILE.pvd")
    if chosen.output.suffix not in (".png", ".jpg"):
        raise SystemExit(f"--output {chosen.output} is no picture; give it the ending .png or .jpg")
    if not chosen.output.resolve().parent.is_dir():
        raise SystemExit(f"--output {chosen.output}: there is no such folder; make it, or choose another")
    return chosen


def beside_this_file(name: str) -> Path:
    """A file of the results; a script that ParaView's menus run does not know where it lies."""
    script = globals().get("__file__")
    folders = [Path(script).resolve().parent] if script else [Path.cwd(), Path(FOLDER)]
    return next((folder / name for folder in folders if (folder / name).is_file()), folders[-1] / name)


def load(chosen: argparse.Namespace) -> tuple[Any, float]:
    """The collection and the time asked for, or else the usual p, or of several curves the first."""
    reader = simple.PVDReader(FileName=str(chosen.collection))
    known, is_over_curves = list(reader.TimestepValues), ' name="' in chosen.collection.read_text(encoding="utf-8")
    if chosen.p is not None and is_over_curves:
        raise SystemExit(f"--p {chosen.p:g}: {chosen.collection} is a series over curves; choose one with --time")
    asked = chosen.time if chosen.p is None else chosen.p
    usual = known[0] if is_over_curves else USUAL
    time = min(known, key=lambda each: abs(each - (usual if asked is None else asked)))
    if asked is not None and not abs(time - asked) <= SAME * max(1, abs(time)):
        there, option = ", ".join(f"{each:.10g}" for each in known), "time" if chosen.p is None else "p"
        raise SystemExit(f"--{option} {asked:g}: {chosen.collection} has no such {option}; choose one of {there}")
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.AnimationTime = time
    reader.UpdatePipeline(time)
    return reader, time


def draw(reader: Any, view: Any, p: float, chosen: argparse.Namespace) -> None:
    """The surface with its impact lines, labels and colours, and the words above and below it."""
    source, limits = scaled(strip(reader, p), chosen.field, p)
    bounds = source.GetDataInformation().GetBounds()
    facts = servermanager.Fetch(reader).GetFieldData()
    impacts = impacts_of(facts)
    nearest = "*".join(f"abs(coordsX - {phi!r})" for phi in impacts) or "1"
    marked = simple.Calculator(Input=source, ResultArrayName="wall", Function=nearest)
    if chosen.cylinder:
        shape = cylinder(marked, limits, bounds)
    else:
        shape = simple.WarpByScalar(Input=marked, Scalars=["POINTS", "scaled"])
    display = simple.Show(shape, view)
    if chosen.cylinder:
        label_cylinder(view, shape, bounds, impacts, along_y(facts))
    else:
        label_box(view, display, limits, bounds, impacts, along_y(facts))

    # both edges of the surface at the impact lines
    facets = simple.ExtractSurface(Input=shape, NonlinearSubdivisionLevel=SUBDIVISION)
    edges = simple.FeatureEdges(Input=facets, BoundaryEdges=1, FeatureEdges=0, NonManifoldEdges=0, ManifoldEdges=0)
    if impacts:
        paint_line(between(edges, "wall", 0, 1e-6, p), view, display.Scale, RED)
    paint(display, view, limits, SYMBOLS[chosen.field])

    # the varied parameters, p and Lambda(p), or the name of what has no p; below, the other parameters
    of_p = '"p = %g     Lambda(p) = %.6g (1/time)" % (p[0], round(float(Lambda[0]), 14) + 0.0)'
    head = repr("stationary density (p = 0)") if chosen.field == "stationary_density" else of_p
    if facts.GetArray("varied"):
        head = f"varied.tobytes().decode() + {chr(10)!r} + {head}"
    annotate(reader, view, head, "Upper Center", 36)
    if facts.GetArray("held"):
        annotate(reader, view, "held.tobytes().decode()", "Lower Center", 26)


def numbers_of(facts: Any, name: str) -> list[float]:
    """Those of an array of the field data."""
    array = facts.GetArray(name)
    return [array.GetValue(i) for i in range(array.GetNumberOfTuples())]


def text_of(facts: Any, name: str) -> str:
    """The text of which an array has the codes."""
    return bytes(map(int, numbers_of(facts, name))).decode()


def impacts_of(facts: Any) -> list[float]:
    """The phases at which T jumps, as the files say; those of a wall at x = 0 where they do not."""
    if not facts.GetArray("impacts"):
        return [QUARTER, 3 * QUARTER]
    return [each for each in numbers_of(facts, "impacts") if not math.isnan(each)]


def along_y(facts: Any) -> str:
    """What stands along y: the noise with its unit, or its states."""
    return text_of(facts, "along_y") if facts.GetArray("along_y") else "noise xi (1/time)"


def annotate(reader: Any, view: Any, expression: str, place: str, size: int) -> None:
    """A text from the field data, which follows the time."""
    source = simple.PythonAnnotation(Input=reader, ArrayAssociation="Field Data", Expression=expression)
    text = simple.Show(source, view)
    text.FontSize, text.LineSpacing, text.WindowLocation, text.Justification = size, 1.3, place, "Center"


def between(source: Any, name: str, low: float, high: float, p: float, every: bool = True) -> Any:
    """The cells of which every point, or at least one, has low <= name <= high."""
    cells = simple.Threshold(Input=source, Scalars=["POINTS", name], LowerThreshold=low, UpperThreshold=high)
    cells.AllScalars = int(every)
    cells.UpdatePipeline(p)
    return cells


def strip(reader: Any, p: float) -> Any:
    """The cells of the noise interval where the stationary or the tilted density lives."""
    ends: list[float] = []
    for density in ("stationary_density", "tilted_density"):
        top = reader.PointData[density].GetRange()[1]
        living = between(reader, density, NEGLIGIBLE * top, top, p, every=False)
        ends.extend(living.PointData["z"].GetRange())
        simple.Delete(living)
    return between(reader, "z", min(ends), max(ends), p)


def scaled(source: Any, field: str, p: float) -> tuple[Any, tuple[float, float]]:
    """The field divided by its maximum, at every p by its own, and its range at this p."""
    result = simple.PythonCalculator(Input=source, Expression=f"{field}/max({field})", ArrayName="scaled")
    result.UpdatePipeline(p)
    low, high = result.PointData["scaled"].GetRange()
    return result, (0.0 if abs(low) < NEXT_TO_ZERO or high - low < 1e-6 else low, high)


def cylinder(source: Any, limits: tuple[float, float], bounds: tuple[float, ...]) -> Any:
    """phi around the axis, xi along it, and the field as radius from 1 to 1.5."""
    (low, high), (bottom, top) = limits, bounds[2:4]
    wrapped = simple.Calculator(Input=source, CoordinateResults=1)
    wrapped.Function = (
        f"(1 + 0.5*(scaled - {low!r})/{high - low!r})*(cos(coordsX)*iHat + sin(coordsX)*jHat)"
        f" + {LENGTH / (top - bottom)!r}*(coordsY - {bottom!r})*kHat"
    )
    return wrapped


def paint_line(lines: Any, view: Any, scale: list[float], colour: tuple[float, float, float]) -> None:
    """Lines as tubes of one colour, which no surface hides that they lie in."""
    display = simple.Show(lines, view)
    display.ColorArrayName = ["POINTS", ""]
    display.Scale, display.LineWidth, display.RenderLinesAsTubes = scale, 5 if colour == RED else 2, 1
    display.Ambient, display.Diffuse, display.AmbientColor = 1, 0, colour


def label_box(
    view: Any, display: Any, limits: tuple[float, float], bounds: tuple[float, ...], impacts: list[float], noise: str
) -> None:
    """A box of pleasing shape, with ticks and titles along its edges, and a red line at each impact up its back."""
    low, high = (*bounds[:4:2], limits[0]), (*bounds[1:4:2], limits[1])
    axes = view.AxesGrid
    scale = [BOX[i] / (high[i] - low[i]) for i in range(3)]
    display.Scale = axes.DataScale = scale
    axes.Visibility, axes.AxesToLabel = 1, 5  # the height on the left, and xi
    axes.UseCustomBounds, axes.CustomBounds = 1, [end[i] * scale[i] for i in range(3) for end in (low, high)]
    along, *states = noise.split("; ")
    axes.XTitle, axes.YTitle, axes.ZTitle = "", f"{along}          ", ""
    if not noise.startswith("noise xi"):
        axes.YTitle, axes.YAxisUseCustomLabels, axes.YAxisLabels = "" if states else axes.YTitle, 1, []
    for number, words in enumerate(states, start=1):
        caption(view, words, [low[0] - 0.05 * BOX[0], number * scale[1], low[2] * scale[2]], "Right")
    for axis in "XYZ":
        setattr(axes, f"{axis}TitleFontSize", 30)
        setattr(axes, f"{axis}LabelFontSize", 24)
    edge, floor, tick = low[1], low[2], 0.02 / scale[1]
    for k, words in enumerate(("0", "pi/2", "pi", "3 pi/2", "2 pi")):
        ends = [[k * QUARTER, edge - depth * tick, floor] for depth in (0, 1, 3)]
        paint_line(simple.Line(Point1=ends[0], Point2=ends[1]), view, scale, BLACK)
        caption(view, words, [ends[2][i] * scale[i] for i in range(3)], "Left")
    name = [2.2 * QUARTER, edge - 9 * tick, floor]
    caption(view, "phase phi (rad)", [name[i] * scale[i] for i in range(3)], "Left")
    for phi in impacts:
        ends = [[phi, high[1], limit] for limit in limits]
        paint_line(simple.Line(Point1=ends[0], Point2=ends[1]), view, scale, RED)
        caption(view, "impact", [*(ends[1][i] * scale[i] for i in (0, 1)), ends[1][2] * scale[2] + 0.04], "Left", RED)


def label_cylinder(view: Any, shape: Any, bounds: tuple[float, ...], impacts: list[float], noise: str) -> None:
    """phi around the upper rim, xi at both ends, on the side that has no colour bar."""
    view.AxesGrid.Visibility = 0
    points = servermanager.Fetch(shape).GetPoints()
    nodes = [points.GetPoint(i) for i in range(points.GetNumberOfPoints())]
    for k, words in enumerate(("phase phi = 0", "pi/2", "pi", "3 pi/2")):
        is_impact = any(abs(phi - k * QUARTER) < 1e-6 for phi in impacts)
        colour, words = (RED, f"impact: {words}") if is_impact else (BLACK, words)
        place = beside(nodes, k * QUARTER, LENGTH, FRONT if k > 1 else 0)
        caption(view, words, place, "Right" if k in (1, 2) else "Left", colour)
    (name, _, unit), (_, *states), (bottom, top) = noise.partition(" ("), noise.split("; "), bounds[2:4]
    marks = [(words, LENGTH * (k - 0.4 - bottom) / (top - bottom)) for k, words in enumerate(states, start=1)]
    if name.startswith("noise xi"):
        unit = f" ({unit}" if unit else ""
        marks = [(f"{name} = {bottom:.3g}{unit}", 0.0), (f"{name} = {top:.3g}{unit}", LENGTH)]
    for words, at in marks:
        caption(view, words, beside(nodes, 1.5 * QUARTER, at, FRONT), "Right")


def beside(nodes: list[tuple[float, ...]], angle: float, at: float, least: float) -> list[float]:
    """A point a little outside the rim of the cylinder's surface, at a height, and at least so far from the axis."""
    c, s = math.cos(angle), math.sin(angle)
    rim = [math.hypot(x, y) for x, y, z in nodes if abs(z - at) < 1e-6 and x * c + y * s > 0.96 * math.hypot(x, y)]
    radius = max(*rim, least - GAP) + GAP
    return [radius * c, radius * s, at]


def caption(
    view: Any, words: str, position: list[float], side: str, colour: tuple[float, float, float] = BLACK
) -> None:
    """Words at a point of space, facing the observer."""
    display = simple.Show(simple.Text(Text=words), view, "TextSourceRepresentation")
    display.TextPropMode, display.BillboardPosition, display.FontSize = "Billboard 3D Text", position, 28
    display.Justification, display.Color = side, colour


def paint(display: Any, view: Any, limits: tuple[float, float], symbol: str) -> None:
    """Colours, smooth Lagrange cells and the colour bar."""
    display.NonlinearSubdivisionLevel = SUBDIVISION
    display.Ambient, display.Diffuse = 0.45, 0.55
    simple.ColorBy(display, ("POINTS", "scaled"))
    colours = simple.GetColorTransferFunction("scaled")
    colours.ApplyPreset(COLOURS, True)
    colours.RescaleTransferFunction(*limits)
    bar = simple.GetScalarBar(colours, view)
    bar.Title, bar.ComponentTitle, bar.HorizontalTitle = f"{symbol} / max", "", 1
    bar.TitleFontSize, bar.LabelFontSize = 28, 24
    bar.AutomaticLabelFormat, bar.LabelFormat, bar.RangeLabelFormat = 0, "%-#.2g", "%-#.2g"
    bar.WindowLocation, bar.Position, bar.ScalarBarLength = "Any Location", [0.89, 0.25], 0.45
    display.SetScalarBarVisibility(view, True)


if not __name__.endswith("show"):  # ParaView's shells do not always run a script as __main__
    words = getattr(sys, "argv", None) or [""]
    is_command = Path(words[0]).name == Path(globals().get("__file__", "unknown")).name
    try:
        main(words[1:] if is_command else [])
    except SystemExit as refusal:
        if is_command:
            raise
        print(refusal)  # to leave would close ParaView
