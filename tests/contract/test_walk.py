"""What runs for Λ(2) of Fig. 1: functions that the page on it names, and the libraries that do the work."""

import re
import subprocess
import sys

from tests.contract.test_cases import CASES, ROOT

PROGRAM = """
import sys, fpsolve
from fpsolve.fem import write_mesh
case, called = fpsolve.load_case(sys.argv[1]), set()
problem = next(case.sets()).problem
sys.setprofile(lambda frame, event, argument: called.add(frame.f_code.co_qualname))
fpsolve.moment_lyapunov(problem, 2.0)
print(*called)
write_mesh(fpsolve.make_mesh(), "mesh.msh")
fpsolve.run(fpsolve.load_case(sys.argv[1], ['output.quantities=["eigenfunctions"]']))
print(*called)
"""
OF_LIBRARIES = {"Dofs.__init__", "get_quadrature", "ElementLinePp.lbasis", "Mesh.write", "UnstructuredGrid.__init__"}
"""What numbers functions, gives Gauss points and polynomials, writes meshes, and makes VTK."""


def test_walk_names_functions_that_run_and_libraries_do_the_work(tmp_path):
    walk = (ROOT / "docs/inside.md").read_text(encoding="utf-8").partition("\n## ")[0]
    names = set(re.findall(r"`(\w+(?:\.\w+)?)`", walk))
    program = [sys.executable, "-c", PROGRAM, str(CASES / "minimal.toml")]
    found = subprocess.run(program, cwd=tmp_path, check=True, capture_output=True, text=True, env={"PYTHONPATH": ROOT})
    of_number, of_all = (set(line.split()) for line in found.stdout.splitlines())
    assert len(names) > 40
    assert names <= of_number
    assert of_all >= OF_LIBRARIES
