"""What a run does where something fails or is interrupted between its steps."""

import errno
import json
import pickle
from concurrent.futures import Executor, Future
from contextlib import nullcontext

import pytest

from fpsolve import FpsolveError, open_results
from fpsolve.case.sections import MonteCarloSection
from fpsolve.commands import run_case
from fpsolve.exponent.method import Budget
from fpsolve.files import alone, atomic
from fpsolve.pool import SERIAL, Pool
from fpsolve.results.known import ROW, names_of
from fpsolve.solve.question import Numerics
from fpsolve.solve.simulate import simulation_key
from tests.kit import COSTLY, LEAN, TEXT, case_in, read_csv, read_json, run

ASKED = {
    "moment": {"p": [1.0, 2.0]},
    "excursions": {"phi": 0.0},
    "response": {"rtol": 1e-6},
    "eigenfunctions": {"p": [1.0]},
}


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ({"rtol": 1e-9}, {*ASKED}),
        ({"budget": Budget(unknowns=500)}, set()),
        ({"is_stated": False}, set()),
    ],
)
def test_key_of_a_part_follows_from_what_its_numbers_follow_from(change, parts):
    """A budget is none of this, nor is p for the key of Λ(p) at a p."""
    numerics = {"rtol": 1e-8, "budget": Budget(), "mesh": None}

    def keys(asked=ASKED, **more):
        return names_of(asked, Numerics(**numerics | more))

    assert {name for name in keys() if keys()[name] != keys(**change)[name]} == parts | {ROW for _ in parts}
    for name in ASKED:
        other = keys({**ASKED, name: {**ASKED[name], "p": [7.0]}})
        assert {each for each in other if keys()[each] != other[each]} == {name}


def test_keys_of_sets_and_simulations_differ(tmp_path):
    parameter_set, other = case_in(tmp_path, TEXT).sets()
    setting = MonteCarloSection()
    settings = [setting, *(setting.model_copy(update=each) for each in ({"seed": 7}, {"paths": 5000}))]
    found = [simulation_key(parameter_set, (1.0, 2.0), each) for each in settings]
    found += [
        simulation_key(parameter_set, (1.0,), setting),
        simulation_key(other, (1.0, 2.0), setting),
        parameter_set.digest,
        other.digest,
    ]
    assert len(set(found)) == len(found)


def raising(failure):
    def fail(*_, **__):
        raise failure

    return fail


@pytest.mark.parametrize(
    ("place", "command", "message"),
    [
        ("fpsolve.commands.cases.Sweep", "run", "interrupted"),
        ("fpsolve.solve.sets.solve_set", "run", "interrupted after 0 of 2 parameter sets; run it again to go on"),
        (
            "fpsolve.solve.sets.solve_set",
            "check",
            "interrupted after 0 of 2 parameter sets; run it again to start over",
        ),
        (
            "fpsolve.commands.cases.write_sets",
            "run",
            "interrupted after 2 of 2 parameter sets; what was done is kept in results/case; run it again to go on",
        ),
        (
            "fpsolve.commands.options.print_blocks",
            "run",
            "interrupted; what was solved is kept in results/case; run it again to go on",
        ),
        (
            "fpsolve.tell.solved.write_figures",
            "run",
            "interrupted; what was solved is kept in results/case; run it again to go on",
        ),
    ],
)
def test_an_interrupt_says_what_is_kept_in_every_phase(tmp_path, monkeypatch, place, command, message):
    monkeypatch.setattr(place, raising(KeyboardInterrupt))
    done = run(tmp_path, command, "case.toml", "--jobs", "1", "--set", LEAN, case=TEXT)
    assert (done.code, done.err.splitlines()[-1]) == (130, message)


def test_an_interrupt_keeps_what_is_found_of_a_set_under_way(tmp_path, monkeypatch):
    monkeypatch.setattr("fpsolve.exponent.solver.ExponentSolver.variance_rate", raising(KeyboardInterrupt))
    asked = "--jobs", "1", "--set", "output={ quantities=['moment', 'variance_rate', 'lyapunov_exponent'] }"
    done = run(tmp_path, "run", "case.toml", *asked, case=TEXT)
    assert (done.code, done.err.splitlines()[-1]) == (
        130,
        "interrupted after 0 of 2 parameter sets; what was done is kept in results/case; run it again to go on",
    )
    [parameter_set] = read_json(tmp_path / "results/case/summary.json")["sets"]
    assert (len(parameter_set["moments"]), parameter_set["variance_rate"]) == (3, None)
    assert parameter_set["lyapunov_exponent"] is not None


class Elsewhere(Executor):
    """A machine that has no folder of results: all that goes there and back is pickled."""

    def __init__(self, folder):
        self.folder = folder

    def submit(self, task, /, item):
        sent = pickle.dumps((task, item))
        assert str(self.folder).encode() not in sent
        task, item = pickle.loads(sent)
        future = Future()
        future.set_result(pickle.loads(pickle.dumps(task(item))))
        return future


def test_pictures_come_back_from_machines_that_share_no_folder(tmp_path):
    case = case_in(tmp_path, TEXT)
    for out, pool in (("here", SERIAL), ("there", Pool(lambda: Elsewhere(tmp_path), is_elsewhere=True))):
        run_case(case, tmp_path / out, pool=pool)
    here, there = (
        {path.relative_to(tmp_path / out): path for path in (tmp_path / out).rglob("*") if path.is_file()}
        for out in ("here", "there")
    )
    assert here.keys() == there.keys()
    drawn = [path for path in here if path.suffix in (".vtu", ".pvd")]
    assert len(drawn) == 6
    assert all(here[path].read_bytes() == there[path].read_bytes() for path in drawn)


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (
            OSError(errno.ENOSPC, "No space left on device", "cache/a.nbi"),
            "cache/a.nbi cannot be written: No space left",
        ),
        (OSError("encoder error"), "the output cannot be written: encoder error; send it to another place\n"),
    ],
)
def test_a_failure_to_write_is_one_sentence(tmp_path, monkeypatch, failure, said):
    monkeypatch.setattr("fpsolve.solve.sets.solve_set", raising(failure))
    done = run(tmp_path, "check", "case.toml", case=TEXT)
    assert (done.code, done.err.count("\n"), done.err.startswith(said)) == (2, 1, True)


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (ZeroDivisionError("x"), "ZeroDivisionError: x (a fault of fpsolve"),
        (MemoryError(), "not enough memory"),
        (FpsolveError("no"), "no"),
    ],
)
def test_a_quantity_that_fails_takes_no_other_with_it(tmp_path, monkeypatch, failure, said):
    for place in (*COSTLY, "fpsolve.exponent.solver.ExponentSolver.variance_rate"):
        monkeypatch.setattr(place, raising(failure))
    sets = "vary={}", "moments.p=[2.0]", "oscillator.c2=0.5"
    done = run(tmp_path, "run", "case.toml", "--all", *(f"--set={each}" for each in sets), case=TEXT)
    [parameter_set] = read_json(tmp_path / "results/case/summary.json")["sets"]
    assert (done.code, parameter_set["status"], parameter_set["variance_rate"]) == (3, "partly", None)
    assert any(each.startswith(f"fpsolve found no response: {said}") for each in parameter_set["warnings"])
    assert all(parameter_set[name] for name in ("lyapunov_exponent", "stability_index", "moments"))


def test_many_sets_have_no_summary(tmp_path, monkeypatch):
    """All is in sets.csv and results.nc."""
    asked = ["run", "case.toml", "--quiet", "--jobs", "1", "--set", "output={ figure=false, quantities=['moment'] }"]
    place = tmp_path / "results/case/summary.json"
    assert run(tmp_path, *asked, case=TEXT).code == 0
    few = read_json(place)["sets"]
    monkeypatch.setattr("fpsolve.results.csv_json.MOST_SUMMARISED", 1)
    assert json.loads(run(tmp_path, *asked, "--json").out)["sets"] == few
    assert not place.exists()
    told = ["; ".join([*each["warnings"], *each["notes"]]) for each in few]
    assert told == [row["messages"] for row in read_csv(place.with_name("sets.csv"))]
    assert told == open_results(place.parent).messages.values[::3].tolist()


@pytest.mark.parametrize("failure", [OSError(errno.ENOSPC, "No space left on device"), OSError("encoder error")])
def test_a_failure_to_write_a_file_names_it_and_leaves_nothing(tmp_path, failure):
    path = tmp_path / "table.csv"
    with pytest.raises(OSError, match=r"table\.csv") as raised, atomic(path):
        raise failure
    assert (raised.value.filename, list(tmp_path.iterdir())) == (str(path), [])


@pytest.mark.parametrize("name", ["ENOSYS", "ENOLCK", "EIO", ""])
def test_a_lock_keeps_out_all_but_where_the_file_system_has_none(tmp_path, monkeypatch, name):
    if name:
        monkeypatch.setattr("fcntl.flock", raising(OSError(getattr(errno, name), "no locks")))
    told = {"": "another run", "EIO": "no locks"}.get(name, "")
    with pytest.raises(FpsolveError, match=told) if told else nullcontext(), alone(tmp_path), alone(tmp_path):
        assert not told
    assert name == "EIO" or list(tmp_path.iterdir()) == []
