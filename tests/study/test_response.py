"""The stationary response of a case: when it is computed, what is written of it, and why there is none."""

import math
import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista
from scipy.integrate import simpson

import fpsolve
from fpsolve.errors import CaseError, NotConverged
from fpsolve.messages import Code, Message
from fpsolve.model.quantity import OSCILLATOR_RESPONSE
from fpsolve.parts.response import PART, shape
from fpsolve.results.curve import Status
from fpsolve.show.verdict import verdict
from fpsolve.study.solve import Numerics, everything, solve_curve
from fpsolve.workflow import compare, expected
from fpsolve.workflow.simulate import number_grid
from tests.kit import case_in, case_text, read_json

SECTIONS = """[moments]
p = [1.0]
[output]
quantities = ["moment", "lyapunov_exponent", "response"]
figure = false
[response]
rtol = 0.1
grid = { amplitude = 60, phi = 97, xi = 24 }
"""
NOISE = {"D0": 0.1, "tau0": 0.5, "r0": 1.0}
NONLINEAR = {"epsilon": 0.5, "c1": 0.4, "c2": 0.5, "c3": 0.2, "restitution": 1.0}
CASE = case_text(SECTIONS, noise=NOISE, **NONLINEAR)
MEANS = ("amplitude", "amplitude_squared", "amplitude_fourth", "x_squared", "v_squared", "energy")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return case_in(tmp_path_factory.mktemp("case"), CASE)


@pytest.fixture(scope="module")
def folder(case, tmp_path_factory):
    """Of the results of a run."""
    out = tmp_path_factory.mktemp("results")
    fpsolve.run(case, out)
    return out / "test"


@pytest.fixture(scope="module")
def result(case, folder):
    """As it is read from its record."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fpsolve.parts.response.solve_response", never)
        [found] = fpsolve.run(case, folder.parent)
    return found


def never(*arguments):
    raise AssertionError("a response is solved again")


def response_of(folder):
    [curve] = read_json(folder / "summary.json")["curves"]
    return curve["response"]


def test_the_summary_has_the_means(folder):
    """With what they have in common, a² = x² + ẋ²/ω² and E = ω²a²/2."""
    found = response_of(folder)
    means = found["means"]
    assert set(means) == {f"{name}{end}" for name in MEANS for end in ("", "_error")}
    x, v = means["x_squared"], means["v_squared"]
    assert means["amplitude_squared"] == pytest.approx(x + v, rel=1e-12)
    assert means["energy"] == pytest.approx(0.5 * (x + v), rel=1e-12)
    assert abs(means["amplitude_squared"] - 1.54568) <= means["amplitude_squared_error"]  # another code
    assert found["impact_rate"] == pytest.approx(1 / math.pi, rel=0.02)  # one in each half-turn, nearly
    assert abs(found["balance"]) <= found["balance_error"]
    assert (found["has_hump"], found["has_crater"]) == (True, True)


def test_the_densities_of_all_files_are_one(folder, case):
    a, density = np.loadtxt(folder / "response.csv", delimiter=",", skiprows=1).T
    step = a[1] - a[0]
    means = response_of(folder)["means"]
    assert a[0] == pytest.approx(0.5 * step)
    assert density.sum() * step == pytest.approx(1, abs=2e-3)  # 5e-4 of it is beyond the last amplitude
    assert (density * a**2).sum() * step == pytest.approx(means["amplitude_squared"], rel=5e-3)
    plane, whole = (pyvista.read(folder / f"response{name}.vtu") for name in ("", "_3d"))
    polar = plane["density"].reshape(60, 97) * case.oscillator.omega * a[:, None]  # per amplitude and phase
    assert simpson(polar, dx=math.pi / 96, axis=1) == pytest.approx(density, rel=1e-4)
    table, xi = whole["density"].reshape(60, 97, 24), whole.points[:24, 2]
    assert table.sum(axis=2) * (xi[1] - xi[0]) == pytest.approx(polar, abs=2e-3 * polar.max())
    x, v, phi = plane.points[:, 0], plane.points[:, 1], plane["phi"]
    assert (x >= 0).all()
    assert np.hypot(x, v / case.oscillator.omega) == pytest.approx(plane["amplitude"])
    assert np.arctan2(-v / case.oscillator.omega, x) == pytest.approx(phi)
    assert plane.compute_cell_sizes().get_array("Area").sum() == pytest.approx(0.5 * math.pi * a[-1] ** 2, rel=5e-3)
    assert (whole.compute_cell_sizes().get_array("Volume") > 0).all()
    assert plane.field_data["response_amplitude"][0] == means["amplitude"]


@pytest.mark.slow
def test_a_response_is_read_from_its_record(result, folder):
    """And all files are there again."""
    assert {f"response{name}" for name in (".csv", ".vtu", "_3d.vtu")} <= {path.name for path in folder.iterdir()}
    again = pickle.loads(pickle.dumps(result))
    assert {name: each.value for name, each in again.response.numbers.items()} == {
        name: each.value for name, each in result.response.numbers.items()
    }


def test_expectations_of_a_response(result, tmp_path):
    text = '[[expect]]\nquantity = "response.{}"\nvalue = {}\natol = 0.01\nsource = "another code"\n'
    expectations = text.format("amplitude_squared", 1.54568) + text.format("impact_rate", 1.0)
    case = case_in(tmp_path, CASE + expectations)
    assert expected(case, result.curve)["response"] == {"rtol": 0.1, "grid": None}
    assert [each.met for each in compare(case, [result])] == [True, False]


def solved(case):
    [curve] = case.curves()
    return solve_curve(curve, everything(case), Numerics.of(case)).result


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"c1": -0.4}, Code.RESPONSE_DIES),
        ({"c2": 0.0, "c3": 0.0}, Code.RESPONSE_LINEAR),
        ({"noise": {**NOISE, "r0": 1.1, "treatment": "exact"}}, Code.RESPONSE_TAILS),
    ],
)
def test_why_there_is_none_is_told(tmp_path, change, code):
    text = case_text(SECTIONS.replace("[1.0]", "[0.0]"), **{"noise": NOISE, **NONLINEAR, **change})
    found = solved(case_in(tmp_path, text))
    assert found.response is None
    assert [each for each in found.notes if each.code is code]
    assert found.status is not Status.PARTLY


@pytest.mark.parametrize(
    ("raised", "code"),
    [
        (NotConverged(Message(Code.RESPONSE_OPEN, size=0.1)), Code.RESPONSE_OPEN),
        (MemoryError(), Code.NO_MEMORY),
        (ZeroDivisionError("a fault"), Code.FAULT),
    ],
)
def test_where_it_fails_nothing_else_is_lost(case, monkeypatch, raised, code):
    def failing(*arguments):
        raise raised

    monkeypatch.setattr("fpsolve.parts.response.solve_response", failing)
    found = solved(case)
    assert found.status is Status.PARTLY
    [failure] = found.failures
    assert failure.reason.tells_of(code)
    assert str(failure.reason).startswith("no response: ")
    assert found.moments.p.tolist() == [1.0]
    assert found.lyapunov_exponent is not None


def wanted(tmp_path, more, **changes):
    return case_in(tmp_path, case_text(f"[moments]\np = [1.0]\n{more}", noise=NOISE, **{**NONLINEAR, **changes}))


def asked_of(case):
    return everything(case).get("response")


def test_when_it_is_computed(tmp_path):
    """Of up to ten curves unasked, of more without densities if it is named; of linear ones if it is named."""
    many = '[vary]\n"noise.D0" = { start = 0.1, stop = 0.2, num = 11 }\n'
    named = '[output]\nquantities = ["response"]\n'
    few = wanted(tmp_path, many.replace("11", "10"))
    alone = {"rtol": 1e-6, "grid": None}
    written = {"rtol": 1e-6, "grid": [80, 49, 25]}
    assert (asked_of(few), few.leaves_out_response) == (written, False)
    case = wanted(tmp_path, many)
    assert (asked_of(case), case.leaves_out_response) == (None, True)
    case = wanted(tmp_path, many + named)
    assert (asked_of(case), case.leaves_out_response) == (alone, False)
    assert asked_of(wanted(tmp_path, named, c2=0.0, c3=0.0)) == written
    for more, changes in (
        ("", {"c2": 0.0, "c3": 0.0}),
        ("[response]\noff = true\n", {}),
        (many, {"c2": 0.0, "c3": 0.0}),
    ):
        case = wanted(tmp_path, more, **changes)
        assert (asked_of(case), case.leaves_out_response) == (None, False)
    case = wanted(tmp_path, '[vary]\n"oscillator.c3" = [0.0, 0.2]\n', c2=0.0, c3=0.0)
    assert asked_of(case) == written
    assert asked_of(wanted(tmp_path, '[uncertain]\n"noise.D0" = 0.05\n')) == written


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ('[output]\nquantities = ["response"]\n[response]\noff = true\n', 'output.quantities names "response"; remove'),
        ('[output]\nquantities = ["moment"]\n[response]\nrtol = 1e-3\n', 'has no "response"; add it there, or remove'),
        ("[response]\nrtol = 1e-12\n", "must be a finite number >= 1e-10"),
        ("[response]\ngrid = { amplitude = 1000, phi = 1000 }\n", "makes 25000000 places; must be at most 4000000"),
    ],
)
def test_what_contradicts_itself_is_refused(tmp_path, more, text):
    with pytest.raises(CaseError, match=text):
        wanted(tmp_path, more)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("index", "words", "titles"),
    [
        (-2.5, "a crater", ["a crater around rest", "a hump away from rest"]),
        (-1.5, "infinite there", ["infinite at rest", "a hump away from rest"]),
        (-0.5, "are infinite at rest", ["infinite at rest", "infinite at rest"]),
    ],
)
@pytest.mark.usefixtures("pictures")
def test_p_bifurcations_are_told(result, case, index, words, titles, tmp_path, monkeypatch):
    import matplotlib.figure

    figures = []
    monkeypatch.setattr(matplotlib.figure.Figure, "savefig", lambda figure, *_, **__: figures.append(figure))
    monkeypatch.setattr(case.output, "__dict__", {**vars(case.output), "figure": True})
    other = SimpleNamespace(**{**vars(result), "response": with_index(result.response, index)})
    assert words in shape(other.response, OSCILLATOR_RESPONSE)
    edges = np.linspace(0, 3, 31)
    sample = SimpleNamespace(amplitude_edges=edges, amplitude_density=edges[1:], amplitude_error=0.1 * edges[1:])
    simulated = SimpleNamespace(curve=result.curve, response=sample)
    [figure] = PART.figures(case, other, tmp_path, simulated)
    figure.draw([tmp_path / "a.svg"], "")
    plane, radial, _ = figures[0].axes
    assert [axes.get_title().partition(":")[0] for axes in (plane, radial)] == titles
    np.testing.assert_array_equal(radial.lines[0].get_ydata(), result.response.density.of_amplitude)
    assert [text.get_text() for text in figures[0].legends[0].get_texts()] == [
        "finite elements", "Monte Carlo ± 2 standard errors",
    ]  # fmt: skip


def with_index(response, index):
    return replace(response, stability_index=index)


def test_a_simulated_mean_stands_beside_that_of_finite_elements(case, result):
    mean = replace(result.response.means["energy"], value=0.7)
    solved = SimpleNamespace(estimates={}, response=SimpleNamespace(means={"energy": mean}))
    sample = SimpleNamespace(means={"energy": (0.75, 0.02), "x": (0.75, 0.02)}, about=OSCILLATOR_RESPONSE)
    simulated = SimpleNamespace(estimates={}, response=sample)
    energy, x = number_grid(case, simulated, solved).rows
    assert energy[1:] == ["⟨E⟩", "0.750", "2.0e-02", "0.7", "+2.5"]
    assert x[1:] == ["⟨x⟩", "0.750", "2.0e-02", "", ""]
    assert [row[1:] for row in number_grid(case, simulated, None).rows] == [energy[1:4], x[1:4]]


def test_the_sentence_tells_where_paths_end(result, case):
    assert "and settles into the stationary response" in verdict(case, result)
