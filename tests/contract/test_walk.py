"""What runs for Λ(2) of Fig. 1: functions that the page on contributing names, and the libraries that do the work."""

import json
import re
import subprocess
import sys

import pytest

from tests.contract.test_cases import ROOT

PROGRAM = """
import json, sys
import fpsolve
from fpsolve.fem import write_mesh

called = set()

def note(frame, event, argument):
    if event == "call":
        called.add((frame.f_globals.get("__name__", ""), frame.f_code.co_qualname))

problem = next(fpsolve.load_case(sys.argv[1]).curves()).problem
sys.setprofile(note)
{work}
sys.setprofile(None)
json.dump(sorted(called), open("called.json", "w"))
"""


def called(folder, work):
    """What a statement calls in a process of its own, as pairs of a module and a function."""
    program = [sys.executable, "-c", PROGRAM.format(work=work), str(ROOT / "cases/minimal.toml")]
    subprocess.run(program, cwd=folder, check=True, capture_output=True, env={"PYTHONPATH": str(ROOT)})
    return [tuple(each) for each in json.loads((folder / "called.json").read_text(encoding="utf-8"))]


def test_the_walk_names_functions_that_run(tmp_path):
    text = (ROOT / "docs/contributing.md").read_text(encoding="utf-8")
    [walk] = re.findall(r"^## A walk.*?\n(.*?)^## ", text, re.DOTALL | re.MULTILINE)
    names = set(re.findall(r"`(\w+(?:\.\w+)?)`", walk)) - {"ExponentSolver", "PhaseAxis", "Generator", "Solution"}
    run = {name for module, name in called(tmp_path, "fpsolve.moment_lyapunov(problem, 2.0)") if "fpsolve" in module}
    assert len(names) > 40
    assert len(walk.splitlines()) <= 50
    assert names <= run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "functions"),
    [
        (
            "fpsolve.moment_lyapunov(problem, 2.0)",
            {("skfem.assembly.dofs", "Dofs.__init__"), ("skfem.quadrature", "get_quadrature")}
            | {("skfem.element.element_line.element_line_pp", "ElementLinePp.lbasis")},
        ),
        ('write_mesh(fpsolve.make_mesh(), "mesh.msh")', {("meshio._mesh", "Mesh.write")}),
        (
            "fpsolve.run(fpsolve.load_case(sys.argv[1], ['output.quantities=[\"eigenfunctions\"]']))",
            {("pyvista.core.pointset", "UnstructuredGrid.__init__")},
        ),
    ],
    ids=["elements", "mesh", "VTK"],
)
def test_libraries_build_elements_meshes_and_vtk(tmp_path, work, functions):
    assert functions <= {*called(tmp_path, work)}
