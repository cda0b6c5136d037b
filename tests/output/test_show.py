"""What ParaView itself reads from its files, and the script that draws them."""

import ast
import json
import os
import shutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.mesh import write_mesh
from fpsolve.model.problem import Problem
from fpsolve.parts.eigenfunctions import copy_show_script, write_density
from tests.conftest import UNIT_NOISE
from tests.output.eigenfunctions import COARSE, HARD, MESHES, MOMENTS, written

INSTALL = "apt-get install --no-install-recommends paraview python3-paraview xvfb xauth"
PARAMETERS = {"oscillator.omega": 1.0, "noise.alpha": 1.0}


def test_script_needs_only_the_standard_library_and_paraview(tmp_path):
    """It is the same in every folder."""
    text = copy_show_script(tmp_path).read_text()
    assert text == files("fpsolve.output").joinpath("show.py").read_text()
    imports = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
    names = {getattr(node, "module", None) or node.names[0].name for node in imports}
    assert names - {"paraview"} <= sys.stdlib_module_names


@pytest.fixture(scope="module")
def paraview():
    """Runs a script of ParaView's Python in a folder, on a virtual display that says when it is ready."""
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
            display = f":{stream.readline().strip()}"
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}

        def run(folder, *arguments):
            command = ["pvpython", *map(str, arguments)]
            environment["DISPLAY"] = display
            return subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=300
            )

        yield run
        process.terminate()


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    written(folder, ExponentSolver(Problem(HARD, UNIT_NOISE), COARSE), parameters=PARAMETERS, varied=["noise.alpha"])
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
single = {}
for path in sys.argv[2:]:
    data = servermanager.Fetch(simple.XMLUnstructuredGridReader(FileName=[path]))
    of_points, of_cells = data.GetPointData(), data.GetCellData()
    parts = [(part, k) for part in (of_points, of_cells) for k in range(part.GetNumberOfArrays())]
    single[path] = {part.GetArrayName(k): part.GetArray(k).GetRange() for part, k in parts}
print(json.dumps({"single": single, "jumps": jumps, "fields": fields, "kinds": sorted(kinds)}))
"""

REFUSED = """
import json, runpy, sys
codes = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = arguments
    try:
        runpy.run_path(arguments[0], run_name="__main__")
    except SystemExit as ended:
        codes.append(ended.code)
print(json.dumps(codes))
"""


@pytest.mark.slow
def test_paraview_reads_a_series_a_density_and_a_mesh(paraview, tmp_path):
    solver = ExponentSolver(Problem(HARD, UNIT_NOISE), MESHES["half circle"])
    written(tmp_path, solver)
    script = tmp_path / "read.py"
    script.write_text(READ)
    write_density(tmp_path / "density.vtu", solver.pair(0.0))
    write_mesh(COARSE, tmp_path / "mesh.vtu")
    done = paraview(tmp_path, script, "eigenfunctions.pvd", "density.vtu", "mesh.vtu")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    density = found["single"]["density.vtu"]
    low, high = density["stationary_density"]
    assert -1e-6 * high < low < high
    assert density["phi_marginal"][1] > 1 / (2 * np.pi) > density["phi_marginal"][0] > 0
    assert found["single"]["mesh.vtu"] == {"phi_degree": [6, 6], "xi_degree": [9, 9], "marker": [0, 3]}
    assert [float(p) for p in found["jumps"]] == list(MOMENTS)
    assert found["kinds"] == [70]  # VTK_LAGRANGE_QUADRILATERAL
    for p, jumps in found["jumps"].items():
        assert found["fields"][p] == pytest.approx([float(p), solver.pair(float(p)).value], abs=1e-14)
        lines, ratios = np.transpose(jumps)
        assert {int(k) for k in lines} == {2, 5}  # π/2 and 3π/2, rounded
        assert ratios.size > 120
        np.testing.assert_allclose(ratios, HARD.impact_factor(float(p)), rtol=1e-8)


@pytest.mark.slow
def test_show_script_draws_a_field(paraview, results):
    """The picture is named after the field, white around, and of many colours inside; what is read stays as it is."""
    before = {file: file.read_bytes() for file in results.rglob("*.[pv][vt][du]")}
    done = paraview(results, "show.py", "--field", "T_adjoint", "--p", "2")
    assert done.returncode == 0, done.stderr
    picture = matplotlib.image.imread(results / "eigenfunctions-T_adjoint.png")[:, :, :3]
    assert picture.shape == (1000, 1600, 3)
    assert 0.3 < np.mean(np.all(picture == 1, axis=2)) < 0.95
    assert np.unique((picture * 255).astype(int) @ [65536, 256, 1]).size > 300
    red = (picture[..., 0] > 0.6) & (picture[..., 1] < 0.5) & (picture[..., 2] < 0.5)
    assert 1e-3 < np.mean(red) < 0.02  # the impacts
    assert {file: file.read_bytes() for file in before} == before


@pytest.mark.slow
def test_show_script_refuses_what_is_not_there(paraview, results, tmp_path):
    """A p, and a folder without a series; one ParaView runs the script three times."""
    alone, script = copy_show_script(tmp_path), tmp_path / "three.py"
    script.write_text(REFUSED)
    asked = ["show.py", "--p", "1.9"], ["show.py", "--p", "nan"], [str(alone)]
    done = paraview(results, script, json.dumps(asked))
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [2, 2, 2]
    for p in ("1.9", "nan"):
        assert f"--p {p}: " in done.stderr
    assert done.stderr.count("choose one of -1, 0, 2") == 2
    assert f"there is no {tmp_path / 'eigenfunctions.pvd'}; name the collection with --collection" in done.stderr
    assert not (results / "eigenfunctions.png").exists()


def test_the_command_without_a_display_is_the_same_everywhere():
    """Without -noreset the virtual display restarts under ParaView now and then."""
    for file in ("docs/reference/files.md", "fpsolve/output/show.py"):
        text = (Path(__file__).parents[2] / file).read_text(encoding="utf-8")
        assert text.count("xvfb-run") == text.count("xvfb-run -a -s -noreset pvpython show.py") == 1, file
