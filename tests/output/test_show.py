"""What ParaView itself reads from its files, and the script that draws them."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from fpsolve.case.case import load_case
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model.problem import Problem
from fpsolve.output.vtk import copy_show_script
from fpsolve.workflow import run
from tests.conftest import UNIT_NOISE, sampled
from tests.output.eigenfunctions import COARSE, HARD, MESHES, MOMENTS, written
from tests.solving import ALL

ROOT = Path(__file__).parents[2]
INSTALL = "apt-get install --no-install-recommends paraview python3-paraview xvfb xauth"


def test_script_needs_only_the_standard_library_and_paraview(tmp_path):
    script = copy_show_script(tmp_path)
    imports = [
        node for node in ast.walk(ast.parse(script.read_text())) if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    names = {getattr(node, "module", None) or node.names[0].name for node in imports}
    assert names - {"paraview"} <= sys.stdlib_module_names
    assert f"FOLDER = {str(tmp_path)!r}" in script.read_text()


@pytest.fixture(scope="module")
def display():
    """The environment of a virtual display that says when it is ready."""
    server = shutil.which("Xvfb")
    if not (server and shutil.which("pvpython")):
        message = f"ParaView is missing: {INSTALL}"
        if os.environ.get("FPSOLVE_REQUIRE_PARAVIEW"):
            pytest.fail(message)
        pytest.skip(message)
    ready, tell = os.pipe()
    options = ["-displayfd", str(tell), "-noreset", "-screen", "0", "1280x1024x24"]
    with subprocess.Popen([server, *options], pass_fds=[tell]) as process:
        os.close(tell)
        with os.fdopen(ready) as stream:
            number = stream.readline().strip()
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
        yield environment | {"DISPLAY": f":{number}"}
        process.terminate()


SCRIPTS = """
import contextlib, io, json, os, sys, traceback
from paraview import simple
save = simple.SaveScreenshot  # which a script may have put another function in place of
for line in open(0):
    simple.SaveScreenshot = save
    folder, *sys.argv = json.loads(line)
    os.chdir(folder)
    code, out, err = 0, io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            with open(sys.argv[0]) as script:
                exec(script.read(), {"__name__": "__main__", "__file__": sys.argv[0]})
        except SystemExit as end:
            code = end.code or 0
            if not isinstance(code, int):
                print(code, file=sys.stderr)
                code = 1
        except BaseException:
            traceback.print_exc()
            code = 1
    os.write(1, ("ANSWER" + json.dumps([code, out.getvalue(), err.getvalue()]) + "\\n").encode())
    if simple.GetViews():
        simple.ResetSession()  # which takes a second
    for source in simple.GetSources().values():
        simple.Delete(source)
"""


@pytest.fixture(scope="module")
def paraview(display, tmp_path_factory):
    """Runs scripts one after the other in one process of ParaView's Python, each in a session of its own."""
    file = tmp_path_factory.mktemp("paraview") / "scripts.py"
    file.write_text(SCRIPTS)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(["pvpython", str(file)], **pipes, text=True, env=display) as process:

        def run(folder, *arguments):
            print(json.dumps([str(folder), *map(str, arguments)]), file=process.stdin, flush=True)
            for line in process.stdout:
                if line.startswith("ANSWER"):
                    return subprocess.CompletedProcess(arguments, *json.loads(line.removeprefix("ANSWER")))
            raise AssertionError("ParaView has ended")

        yield run
        process.stdin.close()


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    written(folder, ExponentSolver(Problem(HARD, UNIT_NOISE), COARSE))
    copy_show_script(folder)
    return folder


READ = """
import json, math, sys
from paraview import servermanager, simple
reader = simple.PVDReader(FileName=sys.argv[1])
jumps, fields = {}, {}
for p in reader.TimestepValues:
    reader.UpdatePipeline(p)
    grid = servermanager.Fetch(reader)
    values = grid.GetPointData().GetArray("T")
    density = grid.GetPointData().GetArray("tilted_density")
    fields[p] = [grid.GetFieldData().GetArray(name).GetValue(0) for name in ("p", "Lambda")]
    sides = {}
    for k in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(k)
        low, high = cell.GetBounds()[:2]
        for m in range(cell.GetNumberOfPoints()):
            phi, xi = cell.GetPoints().GetPoint(m)[:2]
            i = cell.GetPointId(m)
            if abs(math.cos(phi)) < 1e-12 and density.GetValue(i) > 1e-5:
                sides.setdefault((round(phi), xi), {})["left" if phi == high else "right"] = values.GetValue(i)
    jumps[p] = [(phi, pair["left"] / pair["right"]) for (phi, xi), pair in sides.items()]
kinds = {grid.GetCellType(k) for k in range(grid.GetNumberOfCells())}
print(json.dumps({"jumps": jumps, "fields": fields, "kinds": sorted(kinds)}))
"""


def test_paraview_reads_the_collection(paraview, tmp_path):
    solver = ExponentSolver(Problem(HARD, UNIT_NOISE), MESHES["half circle"])
    written(tmp_path, solver)
    script = tmp_path / "read.py"
    script.write_text(READ)
    done = paraview(tmp_path, script, tmp_path / "eigenfunctions.pvd")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [float(p) for p in found["jumps"]] == list(MOMENTS)
    assert found["kinds"] == [70]  # VTK_LAGRANGE_QUADRILATERAL
    for p, jumps in found["jumps"].items():
        assert found["fields"][p] == pytest.approx([float(p), solver.pair(float(p)).value], abs=1e-14)
        lines, ratios = np.transpose(jumps)
        assert {int(k) for k in lines} == {2, 5}  # π/2 and 3π/2, rounded
        assert ratios.size > 120
        np.testing.assert_allclose(ratios, HARD.impact_factor(float(p)), rtol=1e-8)


def assert_picture(file):
    """Not blank, and neither noise: white around, and many colours inside."""
    picture = matplotlib.image.imread(file)[:, :, :3]
    assert picture.shape == (1000, 1600, 3)
    assert 0.3 < np.mean(np.all(picture == 1, axis=2)) < 0.95
    assert np.unique((picture * 255).astype(int) @ [65536, 256, 1]).size > 300


@pytest.fixture
def alone(display):
    """Runs a script in a process of its own."""

    def run(folder, *arguments):
        command = ["pvpython", *map(str, arguments)]
        return subprocess.run(
            command, cwd=folder, env=display, capture_output=True, text=True, check=False, timeout=300
        )

    return run


@pytest.mark.slow
def test_show_script_as_a_command(alone, results):
    """The picture is named after the field, and what is read stays as it is."""
    before = {file: file.read_bytes() for file in results.rglob("*.[pv][vt][du]")}
    done = alone(results, "show.py", "--field", "T_adjoint", "--p", "2")
    assert (done.returncode, "p = 2: " in done.stdout) == (0, True), done.stderr
    assert_picture(results / "eigenfunctions-T_adjoint.png")
    assert {file: file.read_bytes() for file in before} == before


@pytest.mark.parametrize("p", sampled("17", "1.9", "nan"))
def test_show_script_refuses_a_p_that_is_not_there(paraview, results, p):
    done = paraview(results, "show.py", "--p", p, "--output", "refused.png")
    assert done.returncode != 0
    assert f"--p {p}: " in done.stderr
    assert "choose one of -1, 0, 2" in done.stderr
    assert not (results / "refused.png").exists()


WORDS = """
import json, sys
sys.argv = [{script!r}, *{arguments!r}]
from paraview import servermanager, simple
text = open({script!r}).read()
if not {is_looked_at!r}:  # neither at the file nor at the picture on screen
    simple.SaveScreenshot = lambda *_, **__: None
    text = text.replace("[1600, 1000]", "[160, 100]").replace("SUBDIVISION = 3", "SUBDIVISION = 1")
exec(text, {{"__name__": "__main__", "__file__": {script!r}}})
view, scene, found = simple.GetActiveView(), simple.GetAnimationScene(), []
for time in {times!r}:
    captions, titles = [], []
    scene.AnimationTime = time or scene.AnimationTime
    simple.Render(view)
    for source in simple.GetSources().values():
        display, kind = simple.GetDisplayProperties(source, view), source.GetXMLName()
        if kind == "TextSource":
            captions.append([source.Text, list(display.BillboardPosition)])
        elif kind == "PythonCalculator":
            lowest = simple.GetColorTransferFunction("scaled").RGBPoints[0]
        elif kind == "PythonAnnotation":
            assert display.LineSpacing > 1.2  # or lines touch
            titles.append(servermanager.Fetch(source).GetRowData().GetAbstractArray(0).GetVariantValue(0).ToString())
    found.append([titles, captions, [view.AxesGrid.XTitle, view.AxesGrid.YTitle], lowest])
print(json.dumps(found))
"""


def words(paraview, folder, *arguments, times=(0,), picture=None):
    """What show.py writes into a picture, at its own time and if need be at others: above and below it, its captions
    with their places, the titles of the axes grid, and the lowest value of the colours. A picture by the name that
    show.py gives it is looked at, too."""
    script = folder / "words.py"
    arguments = [*arguments, *([] if picture else ["--output", "words.png"])]
    options = {"script": str(folder / "show.py"), "arguments": arguments, "times": times}
    script.write_text(WORDS.format(**options, is_looked_at=bool(picture)))
    done = paraview(folder, script)
    assert done.returncode == 0, done.stderr
    if picture:
        assert_picture(folder / picture)
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def named_results(tmp_path_factory):
    """One p only, with parameters."""
    folder, solver = tmp_path_factory.mktemp("named"), ExponentSolver(Problem(HARD, UNIT_NOISE), COARSE)
    parameters = {"oscillator.omega": 1.0, "oscillator.impact": "delta", "noise.alpha": 1.0}
    written(folder, solver, [1.0], parameters=parameters, varied=["noise.alpha"])
    copy_show_script(folder)
    return folder


@pytest.mark.slow
def test_words_of_the_picture(paraview, named_results):
    [((title, parameters), captions, grid, lowest)] = words(paraview, named_results, picture="eigenfunctions.png")
    assert title.startswith("noise.alpha = 1 (1/time)\np = 1 ")
    assert title.endswith(" (1/time)")
    assert 0 < lowest < 1
    assert parameters.splitlines() == ["oscillator: omega = 1 (rad/time), impact = delta"]
    assert [text for text, _ in captions].count("impact") == 2
    at = {text: place[0] for text, place in captions}
    ticks = [at[text] for text in ("0", "pi/2", "pi", "3 pi/2", "2 pi")]
    assert np.diff(ticks) == pytest.approx([ticks[4] / 4] * 4)
    assert "phase phi (rad)" in at
    assert [word.strip() for word in grid] == ["", "noise xi (1/time)"]


@pytest.mark.slow
def test_the_stationary_density_is_that_at_p_0(paraview, named_results):
    [((title, _), *_, lowest)] = words(paraview, named_results, "--field", "stationary_density")
    assert title.splitlines() == ["noise.alpha = 1 (1/time)", "stationary density (p = 0)"]
    assert lowest == 0


@pytest.fixture(scope="module")
def several_curves(tmp_path_factory):
    folder = tmp_path_factory.mktemp("several")
    run(
        load_case(
            ROOT / "cases/minimal.toml", ["expect=[]", "output.figure=false", ALL, 'vary."noise.D0"=[0.5, 0.75]']
        ),
        folder,
    )
    return folder / "minimal"


@pytest.mark.slow
def test_the_title_follows_the_curves(alone, several_curves):
    titles = [
        title
        for options, times in (([], (0, 0.75)), (["--time", "0.75"], (0,)))
        for title, *_ in words(alone, several_curves, "--collection", "curves.pvd", *options, times=times)
    ]
    assert [title.splitlines()[0] for title, _ in titles] == [f"noise.D0 = {D0} (1/time)" for D0 in (0.5, 0.75, 0.75)]
    assert titles[1] == titles[2]
    assert titles[0][0] != titles[1][0]


@pytest.mark.parametrize(
    ("option", "remedy"),
    [
        (["--p", "2"], "choose one with --time"),
        (["--time", "0.6"], "choose one of 0.5, 0.75"),
        (["--time", "0.5", "--p", "2"], "leave one out"),
    ],
)
def test_show_script_refuses_a_curve_that_is_not_there(paraview, several_curves, option, remedy):
    done = paraview(several_curves, "show.py", "--collection", "curves.pvd", *option, "--output", "refused.png")
    assert done.returncode != 0
    assert remedy in done.stderr
    assert not (several_curves / "refused.png").exists()


@pytest.mark.slow
def test_words_around_the_cylinder(paraview, named_results):
    """Near the rim, whose radius is between 1 and 1.5."""
    options, picture = ["--cylinder", "--field", "tilted_density"], "eigenfunctions-tilted_density-cylinder.png"
    [(_, captions, *_)] = words(paraview, named_results, *options, picture=picture)
    texts = [text for text, _ in captions]
    assert texts[:4] == ["phase phi = 0", "impact: pi/2", "pi", "impact: 3 pi/2"]
    assert len(texts) == 6
    assert all(re.fullmatch(r"noise xi = \S+ \(1/time\)", text) for text in texts[4:])
    for _, (x, y, _) in captions:
        assert 1 < np.hypot(x, y) < 1.7


def test_the_command_without_a_display_is_the_same_everywhere():
    """Without -noreset the virtual display restarts under ParaView now and then."""
    for file in ("docs/reference/files.md", "fpsolve/output/show.py"):
        commands = re.findall("xvfb-run[^`\n]*", (ROOT / file).read_text(encoding="utf-8"))
        assert commands == ["xvfb-run -a -s -noreset pvpython show.py"], file


MENU = """
import sys
sys.argv = [""]
text = open({script!r}).read().replace("[1600, 1000]", "[160, 100]").replace("SUBDIVISION = 3", "SUBDIVISION = 1")
exec(text, {{"__name__": "__vtkconsole__"}})
print("and ParaView goes on")
"""


@pytest.mark.slow
def test_show_script_from_the_menu(paraview, results, tmp_path):
    """There neither the script's file nor its folder is known, and an error must not end ParaView."""
    menu = tmp_path / "menu.py"
    menu.write_text(MENU.format(script=str(results / "show.py")))
    (results / "eigenfunctions.png").unlink(missing_ok=True)
    done = paraview(tmp_path, menu)
    assert "and ParaView goes on" in done.stdout, done.stderr
    assert (results / "eigenfunctions.png").is_file()
    lost = tmp_path / "lost" / "show.py"
    lost.parent.mkdir()
    menu.write_text(MENU.format(script=str(copy_show_script(lost.parent))))
    done = paraview(tmp_path, menu)
    assert "there is no" in done.stdout
    assert "and ParaView goes on" in done.stdout, done.stderr


def test_show_script_refuses(paraview, tmp_path):
    done = paraview(tmp_path, copy_show_script(tmp_path))
    assert done.returncode != 0
    assert f"there is no {tmp_path / 'eigenfunctions.pvd'}; name the collection with --collection" in done.stderr
