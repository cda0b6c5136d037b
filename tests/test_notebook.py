"""In a notebook results show themselves as HTML, and their pictures."""

import json

import pytest

nbformat = pytest.importorskip("nbformat", reason="notebooks need nbconvert: pip install -e '.[test]'")
preprocessors = pytest.importorskip("nbconvert.preprocessors", reason="no nbconvert: pip install -e '.[test]'")
pytest.importorskip("ipykernel", reason="notebooks need ipykernel: pip install -e '.[test]'")

START = """
from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, moment_lyapunov, sensitivities, stability_index
from fpsolve import tilted_density
from fpsolve.exponent import ExponentSolver
from fpsolve.output import draw_eigenfunction
oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction()
problem = Problem(oscillator, noise)
result = moment_lyapunov(problem, [0.0, 1.0, 2.0])
"""
SHOWN = {
    "result": "moment_error",
    "stability_index(problem)": "stability_index_error",
    "tilted_density(result.pairs[2])": "density",
    "sensitivities(problem, 2.0)": "moment_by_theta",
}
"""Cells, and what is in their HTML."""
DRAWN = ("result.plot()", "draw_eigenfunction(result.pairs[2])", "tilted_density(result.pairs[2]).plot()")


@pytest.fixture(scope="module")
def outputs():
    """The outputs of each cell of a notebook that was run."""
    cells = [START, *SHOWN, *DRAWN]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    preprocessors.ExecutePreprocessor(timeout=60, kernel_name="python3").preprocess(notebook, {})
    return {cell.source: cell.outputs for cell in notebook.cells}


def kinds(outputs):
    """What the outputs of a cell are, by their MIME types."""
    assert not [each for each in outputs if each.output_type in ("error", "stream")], json.dumps(outputs)
    return {kind: text for each in outputs for kind, text in each.data.items()}


@pytest.mark.slow
@pytest.mark.parametrize("cell", SHOWN)
def test_results_show_as_html(outputs, cell):
    assert SHOWN[cell] in kinds(outputs[cell])["text/html"]


@pytest.mark.slow
@pytest.mark.parametrize("cell", DRAWN)
def test_pictures_show(outputs, cell):
    """All of them, not just the first, in a notebook that has not set up matplotlib."""
    assert kinds(outputs[cell])["image/png"]
