"""Λ at several p from Python and by cases: failures and the root are values, each p is reported once."""

import gc
import re
import traceback
import weakref
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import fpsolve
from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    NotConverged,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    make_mesh,
    moment_lyapunov,
    open_results,
)
from fpsolve.exponent import QUANTITIES, SUMMARY_NUMBERS, Budget, solve_moments
from fpsolve.model import Telegraph, White
from tests.kit import read_csv, read_json, run
from tests.numbers.rows.heavy_tails import tailed
from tests.numbers.rows.many_variables import masses
from tests.numbers.rows.rays import matrices
from tests.numbers.rows.saddles import SADDLE, TURN, UNDER_FILTER
from tests.numbers.values import moment
from tests.oracles import perturbation

NOISE = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction()
HOPELESS = make_mesh(phi_cells=1, phi_degree=2, xi_cells=2, xi_degree=3)
SPENT = Budget(unknowns=100)


def paper(epsilon: float = 0.1, **more):
    given = {"omega": 1.0, "restitution": 0.8, "c1": 0.1} | more
    return Problem(VibroImpactOscillator(epsilon=epsilon, **given), NOISE)


FIG1, STRONG = paper(), paper(1.0)
SOLVER = ExponentSolver(FIG1)


@pytest.mark.parametrize(
    ("p", "kept"), [([6.0, 0.0, 5.0], [0.0]), ([0.0], [0.0]), ([0.0, 6.0, 0.0], [0.0, 0.0]), ([6.0, -5.0], [])]
)
@pytest.mark.parametrize("options", [{"budget": SPENT}, {"mesh": HOPELESS}], ids=["budget", "mesh"])
def test_failed_moments_are_values_and_moment_zero_needs_no_solve(p, kept, options):
    """Its slope λ does, and is not known within this budget."""
    found = solve_moments(ExponentSolver(paper(2.0), **options), p)
    assert found.p.tolist() == kept
    assert not np.any(found.value)
    assert not np.any(found.error_estimate)
    assert np.signbit(found.value).sum() == 0
    if "budget" in options:
        assert np.all(np.isnan(found.derivative))
    assert [failure.p for failure in found.failures] == [each for each in p if each]
    if found.failures:
        with pytest.raises(NotConverged) as caught:
            moment_lyapunov(paper(2.0), p, **options)
        assert caught.value.partial.p.tolist() == kept
        assert str(caught.value) == "\n".join(dict.fromkeys(failure.reason for failure in found.failures))
        assert "use more cells" in str(caught.value) or "budget" in options


def test_even_moments_are_given_where_elements_fail():
    with pytest.raises(NotConverged) as failure:
        moment_lyapunov(UNDER_FILTER, [3.0, 4.0], budget=SPENT)
    found = failure.value.partial
    assert found.p.tolist() == [4.0]
    assert abs(found.value[0] - moment(4.0).solved(UNDER_FILTER)[0]) <= 1e-7
    assert np.isnan(found.derivative[0])
    assert [each.p for each in found.failures] == [3.0]


def test_failure_keeps_no_solution_alive_and_is_told_in_the_same_words_again():
    slow = NonGaussianNoise(D0=0.09531017, tau0=49.143166, r0=0.61455889)
    own = {"omega": 0.07252887, "restitution": 0.57982, "c1": -0.338098, "epsilon": 1.0930367}
    solver = ExponentSolver(
        Problem(VibroImpactOscillator(impact="restitution", **own), slow), budget=Budget(unknowns=510)
    )

    def failed():
        with pytest.raises(NotConverged) as caught:
            solver.solution(2.0)
        return caught.value

    first = failed()
    best, text = weakref.ref(first.partial), str(first)
    del first
    gc.collect()
    assert best() is None
    again = [failed() for _ in range(3)]
    assert {str(each) for each in again} == {text}
    assert len({len(traceback.extract_tb(each.__traceback__)) for each in again}) == 1


@pytest.mark.parametrize("count", [2, 16, 17, 40])
def test_progress_of_moments_is_reported_once_for_each(count):
    calls = []
    found = solve_moments(ExponentSolver(FIG1, rtol=1e-4), np.linspace(-1, 2, count), progress=lambda: calls.append(1))
    assert len(calls) == found.p.size == count
    assert not found.failures


def test_many_moments_are_interpolated():
    many = solve_moments(SOLVER, np.linspace(-2, 6, 33))
    for pair, value in zip(many.pairs[::8], many.value[::8], strict=True):
        assert pair.value == pytest.approx(value, rel=1e-8)


@pytest.mark.parametrize(
    "p", [[2.0, -1.0, 2.0, 0.5, -0.0], np.resize([3.0, -2.0, 0.5, 1.5, -0.5, 2.5, 1.0], 40), [2.0] * 10, []]
)
def test_moments_stand_at_their_p_in_any_order_and_however_often(p):
    """The second array is interpolated."""
    found = solve_moments(SOLVER, p)
    np.testing.assert_array_equal(found.p, p)
    for i, each in enumerate(p):
        if each:
            pair = SOLVER.pair(float(each))
            assert found.value[i] == pytest.approx(pair.value, rel=1e-8)
            assert found.derivative[i] == pytest.approx(pair.derivative, rel=1e-8)


@pytest.mark.parametrize("p", [1, (1.0,), np.float32(1), np.array(1), range(1, 2), [Fraction(1)], Decimal(1)], ids=repr)
def test_all_real_numbers_are_orders_of_moments(p):
    assert moment_lyapunov(FIG1, p).value == moment_lyapunov(FIG1, 1.0).value


def test_lyapunov_exponent_among_tails_is_that_of_almost_every_path():
    falling = tailed(0.5, 1.0, 1.1, 0.2, c1=-0.5)
    assert "almost every path" in lyapunov_exponent(falling).meaning
    found = moment_lyapunov(falling, [0.0])
    assert (found.value[0], np.isnan(found.derivative[0])) == (0.0, True)


def test_moments_below_minus_one_of_a_saddle_say_that_the_start_matters():
    own = ExponentSolver(matrices(SADDLE, TURN, Telegraph(a=0.3, k=1.0)))
    found = own.moments([-3.0, -1.5, -0.5])
    assert found.value[0] == pytest.approx(own.pair(1.0).value, abs=1e-7)  # even about −1, as the trace is constant
    assert found.value[1] == pytest.approx(found.value[2], abs=1e-7)
    assert [note.code.name for note in found.notes] == ["START_MATTERS"]
    assert own.moments([-0.5]).notes == ()
    for turned in (Telegraph(a=1.1, k=1.0), OrnsteinUhlenbeck(alpha=1.0, sigma=0.1)):  # past the cones
        assert ExponentSolver(matrices(SADDLE, TURN, turned), rtol=1e-2).moments([-1.5]).notes == ()


GROWTH = """
title = "Juveniles and adults, both > 0"
system.variables = ["J", "A"]
system.drift = ["b*(1 + xi)*A - 0.5*J", "0.2*J - 0.25*A"]
system.parameters.b = 0.6
noise = { kind = "telegraph", a = 0.5, k = 0.4 }
output = { quantities = ["stability_index"], figure = false }
vary."system.b" = [0.6, 0.8]
"""


def test_stability_index_below_minus_one_says_that_the_start_matters(tmp_path):
    """It is 1.35 at b = 0.6, and -1.03 at b = 0.8."""
    ended = run(tmp_path, "run", "case.toml", "--jobs", "1", case=GROWTH)
    assert re.search(r"note: case, system.b = 0.8: Λ\(p\) for p < -1, and δ_p < -1, hold for starts", ended.err)
    assert ended.err.count("hold for starts") == 1


def test_even_moments_of_many_variables_bound_the_others():
    found = moment_lyapunov(masses(3, White(s=0.2)), 2.0)
    [note] = found.notes
    assert note.code.name == "CONVEX_BOUNDS"
    assert note.data["bound"] == pytest.approx(found.value[0] / 2, abs=1e-8)
    assert note.data["root"] == "> 2"
    assert found.to_xarray().attrs["method"] == "closed equations of moments"
    assert np.isnan(found.derivative_error).all()


@pytest.mark.parametrize("name", QUANTITIES)
def test_quantity_has_a_record_and_is_near_its_approximation(name):
    quantity = QUANTITIES[name]
    assert quantity.name == name
    assert all((quantity.symbol, quantity.title, quantity.equation, quantity.closed_form, quantity.error_source))
    if name in SUMMARY_NUMBERS:
        theory = SUMMARY_NUMBERS[name].theory(FIG1)
        assert theory == pytest.approx(getattr(perturbation, name)(FIG1.system, NOISE), rel=1e-12)
        assert SUMMARY_NUMBERS[name].solve(SOLVER).value == pytest.approx(theory, rel=5e-3)


CASE = """
title = "A case"
[system]
{system}
[noise]
kind = "{kind}"
{noise}
[moments]
p = [2.0, -1.0, 0.0]
[output]
quantities = ["moment"]
"""
OU = {"kind": "ornstein-uhlenbeck", "noise": "alpha = 1.0\nsigma = 0.3"}
SPRING = 'variables = ["x", "v"]\ndrift = ["v", "-x - 0.2*v - {}"]'
THREE = 'variables = ["a", "u", "b", "v", "c", "w"]\n'
THREE += (
    'drift = ["u", "-2*a + b - d*u - xi*a", "v", "a - 2*b + c - d*v", "w", "b - c - d*w"]\nparameters = { d = 0.1 }'
)
ONE = 'variables = ["x"]\ndrift = ["-a*x + xi*x"]\nparameters = { a = 0.2 }'
EVERY = (
    'output.quantities=["moment","lyapunov_exponent","stability_index","variance_rate","rate_function","excursions"]'
)


@pytest.mark.parametrize(
    ("system", "law", "options", "words"),
    [
        (
            ONE,
            {"kind": "white", "noise": "s = 0.6"},
            (),
            "The mean square grows, doubling in a time of 2.17",
        ),  # ln 2/0.32
        (THREE, OU, ("moments.p=[2.0,4.0]",), "mean square decays.* λ <= Λ\\(2\\)/2 <= -0.0486798"),
        (THREE, OU, ("moments.p=[1.0]",), None),
        (THREE, OU, ("moments.p=[2.0]", 'output.quantities=["lyapunov_exponent"]'), None),
        (SPRING.format("0*xi*x"), OU, (EVERY,), "Λ\\(p\\) is λ p and has no other root"),
        pytest.param(
            SPRING.format("g*xi*x") + "\nparameters = { g = 0.0 }",
            *(OU, (EVERY, 'vary={"system.g"=[0.0,0.1]}'), "Λ\\(p\\) is λ p and has no other root"),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["one variable", "even moments", "odd moment of many", "index of many", "no noise", "from no noise"],
)
def test_case_is_run_or_refused_before_anything_is_written(tmp_path, system, law, options, words):
    given = [part for each in options for part in ("--set", each)]
    done = run(tmp_path, "run", "case.toml", "--jobs", "1", *given, case=CASE.format(system=system, **law))
    said = " ".join(f"{done.out} {done.err}".split())
    assert "Warning" not in said
    if words is None:
        assert done.code == 2
        assert "of 6 variables" in said
        assert {path.name for path in tmp_path.iterdir()} == {"case.toml"}
    else:
        assert done.code == 0, said
        assert re.search(words, said), said


def test_case_with_a_rate_function_writes_it_to_all_tables(tmp_path):
    text = CASE.format(system=SPRING.format("xi*x"), **OU)
    path = tmp_path / "rates.toml"
    path.write_text(text.replace('["moment"]', '["moment", "rate_function"]'), encoding="utf-8")
    [result] = fpsolve.run(path, tmp_path)
    folder, done = tmp_path / "rates", result.moments
    np.testing.assert_allclose(done.rate_function, done.p * done.derivative - done.value, atol=1e-12)
    assert (done.rate_function > 0).tolist() == (done.p != 0).tolist()
    rows = read_json(folder / "summary.json")["sets"][0]["moments"], read_csv(folder / "moments.csv")
    for each in rows:
        assert [float(row["rate_function"]) for row in each] == done.rate_function.tolist()
    assert open_results(folder).rate_function.sel(p=2.0).item() == done.rate_function[0]
    assert {path.name for path in folder.glob("rate_function.*")} == {"rate_function.png", "rate_function.pdf"}
    refused = run(tmp_path, "run", "case.toml", "--set", 'output.quantities=["rate_function"]', case=text)
    assert refused.code == 2
    assert 'output.quantities[0]: got "rate_function", which follows' in " ".join(refused.err.split())
