"""Parts of results: those of one's own, records of simulations to the last bit, and parts that fail."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from fpsolve import ExponentSolver, load_case
from fpsolve.commands import run_case
from fpsolve.errors import NotConverged
from fpsolve.exponent import SUMMARY_NUMBERS
from fpsolve.messages import message_of
from fpsolve.results import Table, table
from fpsolve.simulation.estimators import MomentEstimate, MonteCarlo
from fpsolve.simulation.response import Response
from fpsolve.solve import QUESTIONS, simulate, summary_numbers
from fpsolve.solve import sets as solve
from fpsolve.solve.records import made, packed, plain, unpacked
from tests.contract.test_cases import CASES, ROOT
from tests.contract.test_docs import typed
from tests.kit import case_in, case_text, from_record, solve_sets

MINIMAL = CASES / "minimal.toml"


@pytest.mark.slow
def test_quantity_and_question_of_the_pages_are_solved_and_tabulated(monkeypatch):
    """The chance that Gaussian noise is above a level, as the complementary error function has it."""
    summary_number = typed(ROOT / "docs/contributing.md")[0]["summary_number"]
    chance = typed(ROOT / "docs/extending.md")[0]["question"]
    question = summary_numbers.question_of(summary_number)
    monkeypatch.setitem(SUMMARY_NUMBERS, summary_number.name, summary_number)
    for module in (solve, table):
        monkeypatch.setattr(module, "QUESTIONS", (*QUESTIONS, question, chance))
    for each in (question, chance):
        monkeypatch.setitem(solve.BY_NAME, each.name, each)
    case = load_case(MINIMAL)
    output = case.output.model_copy(update={"quantities": (summary_number.name, chance.name)})
    case = case.model_copy(update={"output": output})
    [solved] = solve_sets(case)
    expected = 0.5 * math.erfc(1.0 / (math.sqrt(2) * case.problem.noise.standard_deviation))
    for result in (solved.result, from_record(case, solved.result.parameter_set, read_again(solved.record))):
        assert result.parts[chance.name].value == pytest.approx(expected, rel=1e-8)
        row, solver = Table(case, [result]).row(1), ExponentSolver(case.problem)
        assert row.keys() >= {summary_number.name, f"{summary_number.name}_error", chance.name}
        assert row[summary_number.name] == pytest.approx(summary_number.solve(solver).value, rel=1e-6)


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
    warnings=(message_of('Λ(p), a "quoted" one\nof two lines'),),
    interrupted=True,
    parameters={"noise.treatment": "exact"},
)


def bits(thing):
    """All that something is made of, to the last bit."""
    if isinstance(thing, np.ndarray):
        return thing.dtype, thing.shape, thing.tobytes()
    if isinstance(thing, tuple | list):
        return [bits(each) for each in thing]
    return bits([*vars(thing).items()]) if hasattr(thing, "__dataclass_fields__") else repr(thing)


def read_again(record):
    """A record after it was written and read."""
    return json.loads(json.dumps(record, default=packed), object_hook=unpacked)


def test_a_simulation_comes_back_from_its_record_to_the_last_bit(rng):
    density = rng.normal(size=(3, 6)) * 10.0 ** rng.integers(-300, 300, size=(3, 6))
    density[0, :4] = math.nan, math.inf, -math.inf, -0.0
    edges = np.arange(4.0), np.linspace(-1, 1, 7), density, np.zeros(0), rng.normal(size=3), np.full(3, 5e-324)
    more = {"outside": 1e-17, "impact_rate": math.inf, "time": 2.5, "interrupted": True}
    response = Response({"x": (1.0, math.nan), "energy": (0.1, 0.2)}, *edges, **more)
    form = simulate.form_of_record()
    for found in (response, None):
        simulated = RESULT, found, RESULT.warnings, False
        assert bits(made(form, read_again(plain(form, simulated)))) == bits(simulated)
    numpy = replace(RESULT, time=np.float64(0.3), paths=np.int64(64))
    record = read_again(plain(form, (numpy, None, (), False)))
    assert bits(made(form, record)) == bits((replace(RESULT, time=0.3), None, (), False))


def test_a_simulation_that_fails_keeps_the_sets_before_it(tmp_path, monkeypatch):
    original = simulate.simulation_of

    def failing(parameter_set, **asked):
        if parameter_set.number == 2:
            raise NotConverged("the simulation overflowed")
        return original(parameter_set, **asked)

    monkeypatch.setattr("fpsolve.commands.simulate.simulation_of", failing)
    text = "[moments]\np = [1.0]\n[output]\nquantities = ['moment']\n[monte_carlo]\npaths = 32\ntime = 40.0\n"
    case = case_in(tmp_path, case_text(f'{text}[vary]\n"noise.D0" = [0.1, 0.2]', epsilon=0.5))
    with pytest.raises(NotConverged, match="the simulation overflowed"):
        run_case(case, tmp_path / "out", monte_carlo=True)
    assert [path.name for path in (tmp_path / "out/test").glob("monte_carlo*")] == ["monte_carlo.json"]
