"""What is said of results where they cannot be relied on, and of a report that fails."""

import numpy as np
import pytest

from fpsolve import NotConverged, tilted_density
from fpsolve.exponent.density import UNRESOLVED
from fpsolve.model.quantity import MOMENT, P
from fpsolve.tell.figures import Series, draw_series
from fpsolve.theory.perturbation import second_order
from tests.inner.test_output import drawn, many  # noqa: F401
from tests.inner.test_workflow import raising
from tests.kit import LEAN, TEXT, case_in, files, run, solve_sets


@pytest.mark.parametrize("place", ["fpsolve.tell.reports.noise_sentences", "fpsolve.tell.reports.page_of"])
def test_a_fault_in_the_report_costs_nothing_else(tmp_path, monkeypatch, place):
    monkeypatch.setattr(place, raising(RuntimeError("a fault")))
    done = run(tmp_path, "run", "case.toml", "--report", "--set", LEAN, case=TEXT)
    assert (done.code, "warning: case: no report.html: RuntimeError: a fault" in done.err) == (0, True)
    names = files(tmp_path / "results/case")
    assert {"summary.json", "results.nc"} <= names
    assert not [name for name in names if name.startswith((".fpsolve", "report"))]


def test_tilted_densities_that_python_refuses_and_unresolved_functions_are_warned_of(tmp_path):
    sets = [
        "oscillator={ epsilon=1.0, omega=1.0, restitution=1.0, c1=0.0 }",
        "noise.r0=1.0",
        "noise.tau0=1.0",
        "vary={}",
    ]
    [solved] = solve_sets(
        case_in(tmp_path, TEXT, [*sets, "moments={ p=[1.0, 4.0], rtol=1e-5 }", "output.eigenfunctions=[1.0, 4.0]"])
    )
    refused, unresolved, told = [], 0, solved.result.warnings
    for pair in solved.pictures["eigenfunctions"].pairs:
        unresolved += sum(defect > UNRESOLVED for defect in pair.sign_defects)
        try:
            tilted_density(pair)
        except NotConverged:
            refused.append(pair.p)
    assert refused == [4.0] == [float(text.split()[4]) for text in told if text.startswith("tilted_density at p = ")]
    assert sum(text.startswith("T") and "do not rely on a picture of it" in text for text in told) == unresolved > 0


def test_figure_marks_each_index_on_the_zero_line_and_each_exponent_as_a_tangent(drawn, tmp_path):  # noqa: F811
    """Of those p that the figure shows; the dots of a simulation are where it found them."""
    sets = [many(3), "figure.mark=['stability_index', 'lyapunov_exponent']", "oscillator.omega=0.5"]
    [axes] = drawn(*sets).axes
    case = case_in(tmp_path, TEXT, sets)
    theories = [second_order(parameter_set.problem) for parameter_set in case.sets()]
    paths = [each.get_xydata() for each in axes.lines if each.get_gid() is None and len(each.get_xdata()) == 2]
    slopes = [np.subtract(*path[:, 1]) / np.subtract(*path[:, 0]) for path in paths]
    np.testing.assert_allclose(slopes, [each.lyapunov_exponent for each in theories])
    [roots] = [each.get_offsets() for each in axes.collections if len(each.get_offsets()) == 3]
    np.testing.assert_allclose(roots, [(each.stability_index, 0.0) for each in theories])
    p = np.linspace(-2, 2, 100)
    draw_series(axes, case, [Series({}, p, p, p, p)], P, MOMENT, np.array([p, p**2, p**2]))
    np.testing.assert_array_equal(axes.containers[-1].lines[0].get_xydata(), np.stack([p, p**2], axis=1))
    assert "finite elements (not all marked)" in axes.get_legend_handles_labels()[1]
