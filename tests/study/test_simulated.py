"""Simulated curves as plain data: they come back to the last bit, also through JSON, and are small."""

import json
import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from fpsolve.output.records import record_of
from fpsolve.results.curve import SimulatedCurve
from fpsolve.simulation.estimators import MomentEstimate, MonteCarlo
from fpsolve.simulation.response import BINS, Response
from fpsolve.workflow.simulate import simulate_curve, simulated_of
from tests.kit import case_in, case_text, simulate_curves

SECTIONS = "[moments]\np = [-1.0, 2.0]\n[monte_carlo]\npaths = 4096\ntime = 40.0\n"
CASE = case_text(SECTIONS, noise={"D0": 0.1}, epsilon=0.5, c1=0.8, c2=0.5)
RESULT = MonteCarlo(
    estimates=(
        MomentEstimate(1.0, 0.1, 1 / 3, "direct", 5e-324),
        MomentEstimate(-0.5, None, None, "population", 0.0),
        MomentEstimate(2.0, math.nan, math.inf, "population", -0.0),
    ),
    lyapunov_exponent=-math.inf,
    lyapunov_exponent_error=math.nan,
    variance_rate=1.7976931348623157e308,
    variance_rate_error=math.pi,
    paths=64,
    time=0.1 + 0.2,
    step=1e-300,
    seed=2**63,
    impacts=0,
    warnings=("Λ(p) at p = 2", 'a "quoted" one\nof two lines'),
    interrupted=True,
    parameters={"noise.D0": 0.1, "noise.treatment": "exact"},
)


MEANS = "x", "x_squared", "v_squared", "amplitude", "energy"


def response(rng):
    """All kinds of numbers in arrays, among them those that JSON has not."""
    density = rng.normal(size=(3, 6)) * 10.0 ** rng.integers(-300, 300, size=(3, 6))
    density[0, :4] = math.nan, math.inf, -math.inf, -0.0
    means = {name: (float(rng.normal()), math.nan) for name in MEANS}
    return Response(
        means, np.arange(4.0), np.linspace(-1, 1, 7), density, np.zeros(0), rng.normal(size=3), np.full(3, 5e-324),
        outside=1e-17, impact_rate=math.inf, time=2.5, interrupted=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return case_in(tmp_path_factory.mktemp("records"), CASE)


@pytest.fixture(scope="module")
def curve(case):
    [curve] = case.curves()
    return curve


def through_json(simulated):
    """Made again from strict JSON, in which nan is no number."""
    text = json.dumps(record_of(simulated), allow_nan=False)
    return simulated_of(json.loads(text), simulated.curve)


def check_same(one, other):
    """All attributes, each with its type and its bits."""
    assert type(one) is type(other)
    for name, value in vars(one).items():
        again = vars(other)[name]
        assert type(again) is type(value), name
        if isinstance(value, np.ndarray):
            assert (again.dtype, again.shape, again.tobytes()) == (value.dtype, value.shape, value.tobytes()), name
            assert again.flags.writeable
        else:
            assert repr(again) == repr(value), name  # nan is nan, and -0.0 is not 0.0


@pytest.mark.parametrize("has_response", [True, False])
@pytest.mark.parametrize("interrupted", [True, False])
def test_a_record_comes_back_to_the_last_bit(curve, has_response, interrupted, rng):
    found = response(rng) if has_response else None
    simulated = SimulatedCurve(curve, RESULT, found, ("a warning", *RESULT.warnings), interrupted)
    again = through_json(simulated)
    assert again.curve is curve
    check_same(RESULT, again.result)
    for one, other in zip(RESULT.estimates, again.result.estimates, strict=True):
        check_same(one, other)
    if has_response:
        check_same(found, again.response)
        assert list(again.response.means) == list(MEANS)
    else:
        assert again.response is None
    assert again.warnings == simulated.warnings
    assert again.interrupted is interrupted


def test_numbers_of_numpy_are_stored_as_those_of_python(curve):
    numbers = {"time": np.float64(0.1), "paths": np.int64(64), "variance_rate": np.float64(math.nan)}
    again = through_json(SimulatedCurve(curve, replace(RESULT, **numbers), None, ()))
    check_same(replace(RESULT, time=0.1, paths=64, variance_rate=math.nan), again.result)


def test_a_simulation_comes_back_and_is_small(case):
    [simulated] = simulate_curves(case)
    assert simulated.response.density.shape == (BINS, 2 * BINS)
    again = through_json(simulated)
    check_same(simulated.result, again.result)
    check_same(simulated.response, again.response)
    assert len(json.dumps(record_of(simulated))) < 50_000


@pytest.mark.slow
def test_a_curve_is_a_small_task(case, curve):
    orders = tuple(float(p) for p in case.simulated)
    task = pickle.dumps((simulate_curve, curve, orders, case.monte_carlo))
    assert len(task) < 4000
    function, *arguments = pickle.loads(task)
    [expected], found = simulate_curves(case), function(*arguments)
    check_same(expected.result, found.result)
    check_same(expected.response, found.response)


@pytest.mark.parametrize(
    "change",
    [
        {"result": lambda row: {}},
        {"result": lambda row: None},
        {"result": lambda row: row[:-1]},
        {"result": lambda row: [*row, 0]},
        {"result": lambda row: ["soon" if value == RESULT.time else value for value in row]},
        {"result": lambda row: [[{}], *row[1:]]},
        {"result": lambda row: [[[9.0, 0.0, 0.0, "guessed", 1.0]], *row[1:]]},
        {"response": lambda none: {}},
        {"response": lambda none: [{"shape": [2], "data": "AAAA"}] * 12},
        {"warnings": lambda texts: None},
        {"warnings": lambda texts: "a text"},
        {"warnings": lambda texts: [1]},
    ],
)
def test_what_is_no_record_is_refused(curve, change):
    record = json.loads(json.dumps(record_of(SimulatedCurve(curve, RESULT, None, ()))))
    assert simulated_of(record, curve).result.time == RESULT.time
    [(name, other)] = change.items()
    with pytest.raises(ValueError, match="this is no record of a SimulatedCurve: "):
        simulated_of(record | {name: other(record[name])}, curve)
    with pytest.raises(ValueError, match="this is no record of a SimulatedCurve: "):
        simulated_of({}, curve)
