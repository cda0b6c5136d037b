"""What Python has at the top: examples that run, values that travel and cannot be changed, notebooks, and warnings."""

import doctest
import inspect
import json
import pickle
import shutil
import subprocess
import sys
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
import xarray as xr

import fpsolve
from fpsolve import CaseError, FpsolveError, NotConverged, load_case, moment_lyapunov
from fpsolve.exponent import Budget
from fpsolve.measured import read_spectrum
from fpsolve.model import ModalSystem
from fpsolve.solve import compare, simulation_of
from tests.contract.test_cases import CASES
from tests.kit import ALL, case_in, case_text, run, simulate_sets, solve_case, solve_sets

SECTIONS = """[moments]
p = [1.0]
[monte_carlo]
paths = 640
time = 40.0
[response]
off = true
[[expect]]
quantity = "lyapunov_exponent"
value = 0.0
atol = 1.0
source = "a guess"
"""


def copied(thing):
    return pickle.loads(pickle.dumps(thing))


def examples(name):
    """The examples of a name at the top."""
    text = inspect.getdoc(getattr(fpsolve, name))
    return doctest.DocTestParser().get_doctest(text, {}, name, None, 0)


@pytest.mark.parametrize("name", fpsolve.__all__)
def test_every_name_at_the_top_has_an_example(name):
    assert examples(name).examples


@pytest.mark.slow
def test_examples_of_all_names_at_the_top_run(tmp_path, monkeypatch):
    """One after another, as the problem of the first one is that of the others."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(CASES / "minimal.toml", tmp_path)
    known = {name: getattr(fpsolve, name) for name in fpsolve.__all__} | {"Budget": Budget}
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL)
    for name in sorted(fpsolve.__all__, key=lambda name: (name != "Problem", name == "open_results", name)):
        test = examples(name)
        test.globs = known
        assert runner.run(test, clear_globs=False).failed == 0, name


@pytest.mark.slow
def test_results_of_a_case_travel_to_other_processes(tmp_path):
    """Solved parameter sets with their eigenpairs, comparisons, and simulated parameter sets, whose task is small."""
    case = case_in(tmp_path, case_text(SECTIONS, noise={"D0": 0.1}, epsilon=0.5, c1=0.8, c2=0.5), [ALL])
    [solved], [simulated] = solve_sets(case), simulate_sets(case)
    [comparison] = compare(case, [solved.result])
    whole, sample, other = copied((solved, simulated, comparison))
    np.testing.assert_array_equal(whole.result.moments.value, solved.result.moments.value)
    assert whole.result.estimates == solved.result.estimates
    assert whole.result.parameter_set == solved.result.parameter_set
    assert compare(case, [whole.result]) == [comparison] == [other]
    drawn, first = (each.pictures["eigenfunctions"] for each in (whole, solved))
    np.testing.assert_array_equal(drawn.pairs[0].left, first.pairs[0].left)
    assert (sample.result, sample.estimates) == (simulated.result, simulated.estimates)
    np.testing.assert_array_equal(sample.response.density, simulated.response.density)
    task = simulation_of, next(case.sets()), tuple(case.simulated.tolist()), case.monte_carlo
    assert len(pickle.dumps(task)) < 4000
    function, *arguments = copied(task)
    assert function(*arguments)[0] == simulated.result


def test_results_cannot_be_changed(tmp_path):
    [result] = solve_case(load_case(CASES / "minimal.toml", ["output.quantities=['moment']"]))
    with pytest.raises(FrozenInstanceError):
        result.failures = ()


def test_errors_travel_with_what_they_say_and_speak_of_arguments_or_of_keys(tmp_path):
    problem = load_case(CASES / "minimal.toml").problem
    with pytest.raises(NotConverged, match=r"try --set budget\.unknowns=") as first:
        moment_lyapunov(problem, 60.0, budget=Budget(unknowns=100))
    with pytest.raises(CaseError, match=r"omega: got -1\.0") as second:
        load_case(CASES / "minimal.toml", ["oscillator.omega=-1.0"])
    for error in (first.value, second.value):
        again = copied(error)
        assert isinstance(again, FpsolveError)
        assert (type(again), str(again), again.message) == (type(error), str(error), error.message)
        assert again.message.data == error.message.data
    few = [f"--set={each}" for each in ("budget.unknowns=100", "moments.p=[60.0]", "expect=[]", "figure={}")]
    done = run(tmp_path, "run", str(CASES / "minimal.toml"), *few)
    assert (done.code, "try --set budget.unknowns=170" in " ".join(done.err.split())) == (3, True)


def test_matrices_of_modes_may_be_arrays():
    lists = ModalSystem.of([[2.0, 0.0], [0.0, 1.0]], [[1.0, 0.5], [0.5, 3.0]], stiffness_noise=[[1.0, 0.0], [0.0, 1.0]])
    arrays = ModalSystem.of(np.diag([2, 1]), [np.array([1.0, 0.5]), (0.5, np.int64(3))], stiffness_noise=np.eye(2))
    assert arrays.terms == lists.terms


def test_a_spectrum_with_fill_values_is_read_without_a_warning(tmp_path, recwarn):
    f = np.linspace(0.1, 5, 50)
    values = xr.Dataset({"S": ("f", 1 / (1 + f * f))}, {"f": ("f", f, {"units": "Hz"})})
    values.to_netcdf(tmp_path / "s.nc", engine="scipy", encoding={"S": {"_FillValue": -1.0}})
    assert read_spectrum(tmp_path / "s.nc", sided="one", unit="1/Hz").density.size == 50
    assert not [str(each.message) for each in recwarn]


LOUD = "import warnings; warnings.warn('loud', RuntimeWarning)"
COMMAND = f"""
import subprocess, sys
from fpsolve.cli import main
sys.argv = ["fpsolve", "--version"]
main()
{LOUD}
subprocess.run([sys.executable, "-c", {LOUD!r}])
"""


@pytest.mark.parametrize(("options", "count"), [((), 0), (("-W", "always"), 2)])
def test_warnings_of_libraries_are_shown_where_they_are_asked_for(options, count):
    """Neither of the command itself nor of its workers; the errors of the numbers tell."""
    done = subprocess.run([sys.executable, *options, "-c", COMMAND], capture_output=True, text=True, check=True)
    assert done.stderr.count("RuntimeWarning: loud") == count


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code", "words"), [(["run", "minimal.toml", "--quiet"], 0, ""), (["new", "fig"], 2, "did you mean")]
)
def test_the_package_is_the_command_and_is_silent_where_all_is_well(tmp_path, arguments, code, words):
    shutil.copy(CASES / "minimal.toml", tmp_path)
    command = [sys.executable, "-W", "always", "-m", "fpsolve", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, words in done.stderr, bool(done.stderr)) == (code, True, bool(words))


START = """
from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, moment_lyapunov, sensitivities, stability_index
from fpsolve import tilted_density
from fpsolve.tell import draw_eigenfunction
oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
problem = Problem(oscillator, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction())
result = moment_lyapunov(problem, [0.0, 1.0, 2.0])
"""
SHOWN = {
    "result": "moment_error",
    "stability_index(problem)": "stability_index_error",
    "tilted_density(result.pairs[2])": "density",
    "sensitivities(problem, 2.0)": "moment_by_theta",
}
"""Cells, and what is in their HTML."""
DRAWN = "result.plot()", "draw_eigenfunction(result.pairs[2])", "tilted_density(result.pairs[2]).plot()"


@pytest.mark.slow
def test_a_notebook_shows_results_as_html_and_all_pictures():
    nbformat = pytest.importorskip("nbformat", reason="notebooks need nbconvert: pip install -e '.[test]'")
    preprocessors = pytest.importorskip("nbconvert.preprocessors", reason="no nbconvert: pip install -e '.[test]'")
    pytest.importorskip("ipykernel", reason="notebooks need ipykernel: pip install -e '.[test]'")
    cells = [nbformat.v4.new_code_cell(cell) for cell in (START, *SHOWN, *DRAWN)]
    notebook = nbformat.v4.new_notebook(cells=cells)
    preprocessors.ExecutePreprocessor(timeout=60, kernel_name="python3").preprocess(notebook, {})
    outputs = [each for cell in notebook.cells for each in cell.outputs]
    assert not [each for each in outputs if each.output_type in ("error", "stream")], json.dumps(outputs)
    for cell in notebook.cells[1:]:
        found = {kind: text for each in cell.outputs for kind, text in each.data.items()}
        assert SHOWN[cell.source] in found["text/html"] if cell.source in SHOWN else found["image/png"]
