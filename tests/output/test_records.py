"""Records: exact, in files that only grow; what is torn or damaged is none."""

import contextlib
import json
import math
import multiprocessing
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fpsolve
from fpsolve.case.case import load_case
from fpsolve.case.sections import MonteCarloSection
from fpsolve.cli import main
from fpsolve.errors import NotConverged, OutputError
from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.error import Moment
from fpsolve.fem.mesh import make_mesh
from fpsolve.messages import Code
from fpsolve.output import records as plain
from fpsolve.output.records import (
    Records,
    append,
    begun_record,
    entries_of,
    part_key,
    record_of_set,
    set_key,
)
from fpsolve.parts import PARTS
from fpsolve.parts.every import BY_NAME
from fpsolve.parts.part import Entry, Job, Numerics
from fpsolve.study import solve
from fpsolve.study.solve import everything
from fpsolve.workflow.simulate import simulation_key
from tests.kit import ALL, case_in, from_record, solve_sets
from tests.output.test_datasets import HOPELESS, PRODUCT, TEXT

CASES = Path(__file__).parents[2] / "cases"
VALUES = {"numbers": [0.1, 1 / 3, 1e-300, math.inf, -0.0], "text": 'Λ(2) "quoted" , "record": {}\n', "nothing": None}


def same(one, two):
    """Equal to the last bit, NaN included."""
    return json.dumps(one) == json.dumps(two)


def test_what_is_appended_is_read(tmp_path):
    places = [append(tmp_path / "here", f"key{i}", {**VALUES, "i": i}) for i in range(5)]
    records = Records(tmp_path / "here").look()
    for i, place in enumerate(places):
        assert records.address(f"key{i}") == place
        assert records.read(place) == {**VALUES, "i": i}
    assert records.address("another") is None
    [path] = (tmp_path / "here").glob("*")
    assert [json.loads(line)["key"] for line in path.read_text(encoding="utf-8").splitlines()] == [
        f"key{i}" for i in range(5)
    ]
    append(tmp_path / "here", "key1", {"i": "new"})
    assert records.look().read(records.address("key1")) == {"i": "new"}
    records.remove()
    assert not Records(tmp_path / "here").look().are_there


def test_there_are_none_without_a_folder(tmp_path):
    assert not Records(tmp_path / "none").look().are_there


@pytest.mark.slow
def test_each_process_has_a_file(tmp_path):
    context = multiprocessing.get_context("spawn")
    worker = context.Process(target=append, args=(tmp_path, "key0", VALUES))
    worker.start()
    worker.join()
    append(tmp_path, "key1", VALUES)
    assert len(list(tmp_path.glob("*.jsonl"))) == 2
    records = Records(tmp_path).look()
    assert all(records.read(records.address(f"key{i}")) == VALUES for i in range(2))


@pytest.mark.parametrize("damage", [lambda line: line[: len(line) // 2], lambda line: b"\0" * len(line)])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_a_torn_line_is_no_record(tmp_path, damage, which):
    for i in range(3):
        append(tmp_path, f"key{i}", {"i": i})
    [path] = tmp_path.glob("*")
    lines = path.read_bytes().splitlines(keepends=True)
    lines[which] = damage(lines[which])
    path.write_bytes(b"".join(lines))
    records = Records(tmp_path).look()
    swallowed = {which, which + 1}  # a torn line has no end, so that it takes the next one with it
    for i in range(3):
        place = records.address(f"key{i}")
        assert (place is None) == (i in swallowed)
        assert place is None or records.read(place) == {"i": i}
    new = append(tmp_path, "key3", {"i": 3})
    assert len(list(tmp_path.glob("*"))) == 1
    for seen in (records, Records(tmp_path)):
        assert seen.look().address("key3") == new
        assert seen.read(new) == {"i": 3}


def test_every_changed_byte_of_the_numbers_is_seen(tmp_path):
    place = append(tmp_path, "key", {"numbers": [0.125, 17.0]})
    path = tmp_path / place.file
    content = path.read_bytes()
    for i in range(content.index(b'"record"') + 10, len(content)):
        path.write_bytes(content[:i] + bytes([content[i] ^ 1]) + content[i + 1 :])
        assert not Records(tmp_path).look().are_there, i
    records = Records(tmp_path)
    with pytest.raises(ValueError, match="has changed"):
        records.read(place)


@pytest.mark.slow
def test_a_file_that_workers_do_not_share(tmp_path, monkeypatch):
    place = append(tmp_path, "key", VALUES)
    Records(tmp_path).expect(place)
    monkeypatch.setattr("fpsolve.output.records.SHARED_SECONDS", 0.1)
    with pytest.raises(OutputError, match="is not where the workers write: they must share it; choose another folder"):
        Records(tmp_path / "elsewhere").expect(place)


def test_what_cannot_be_written_leaves_nothing(tmp_path, monkeypatch):
    append(tmp_path, "key0", {"i": 0})
    [path] = tmp_path.glob("*")
    whole, write = path.read_bytes(), os.write
    monkeypatch.setattr("fpsolve.output.records.os.write", lambda handle, line: write(handle, line[:10]))
    with pytest.raises(OSError, match="space"):
        append(tmp_path, "key1", {"i": 1})
    assert path.read_bytes() == whole
    monkeypatch.undo()
    append(tmp_path, "key2", {"i": 2})
    records = Records(tmp_path).look()
    assert [records.address(f"key{i}") is not None for i in range(3)] == [True, False, True]


@pytest.mark.parametrize("text", [TEXT + PRODUCT, TEXT + HOPELESS])
def test_results_are_the_same_from_their_records(tmp_path, text):
    case = case_in(tmp_path, text, [ALL])
    for solved in solve_sets(case):
        result, again = solved.result, from_record(case, solved)
        for name in ("p", "value", "derivative", "error_estimate", "residual", "perturbation"):
            np.testing.assert_array_equal(getattr(again.moments, name), getattr(result.moments, name))
        assert again.estimates == result.estimates
        assert (again.warnings, again.notes, again.failures) == (result.warnings, result.notes, result.failures)
        for one, other in zip((*again.warnings, *again.notes), (*result.warnings, *result.notes), strict=True):
            assert (one.code, one.data) == (other.code, other.data)
        assert [each.reason.code for each in again.failures] == [each.reason.code for each in result.failures]
        assert again.status == result.status
        assert again.seconds == result.seconds
        assert again.parts.keys() == result.parts.keys()
        assert again.sensitivities.moments == result.sensitivities.moments
        assert again.sensitivities.indices == result.sensitivities.indices


ASKED = {
    "moment": {"p": [1.0, 2.0], "slopes": True},
    "lyapunov_exponent": {},
    "excursions": {"phi": 0.0, "xi": "stationary"},
    "response": {"rtol": 1e-6, "grid": None},
    "sensitivities": {"p": [1.0], "indices": ["lyapunov_exponent"]},
    "eigenfunctions": {"p": [1.0], "density": True},
}
ALL_PARTS = {*ASKED}
OF_SOLVER = ALL_PARTS - {"response"}
"""Parts whose numbers follow from rtol and the mesh of Λ(p)."""


@pytest.mark.parametrize(
    ("part", "change"),
    [
        ("moment", {"p": [1.0, 3.0]}),
        ("moment", {"slopes": False}),
        ("excursions", {"phi": 0.3}),
        ("excursions", {"xi": 0.4}),
        ("response", {"rtol": 1e-5}),
        ("response", {"grid": [80, 49, 25]}),
        ("sensitivities", {"p": [2.0]}),
        ("sensitivities", {"indices": []}),
        ("eigenfunctions", {"p": [2.0]}),
        ("eigenfunctions", {"density": False}),
    ],
)
def test_a_setting_of_a_part_changes_its_key_and_no_other(part, change):
    numerics = Numerics(1e-8, Budget(), None)
    assert changed(ASKED, {**ASKED, part: ASKED[part] | change}, numerics, numerics) == {part}


@pytest.mark.parametrize(
    ("change", "parts", "limited"),
    [
        ({"rtol": 1e-9}, OF_SOLVER, OF_SOLVER),
        ({"mesh": make_mesh(phi_cells=2, xi_cells=4)}, OF_SOLVER, OF_SOLVER),
        ({"budget": Budget(unknowns=500)}, set(), ALL_PARTS),
        ({"budget": Budget(seconds=5.0)}, set(), ALL_PARTS),
        ({"is_stated": False}, set(), set()),
    ],
    ids=lambda each: "".join(each) if isinstance(each, dict) else "",
)
def test_numerics_change_the_keys_of_the_parts_that_they_decide(change, parts, limited):
    """A budget decides what it has limited alone; what a case states decides what is told of the numbers."""
    numerics = Numerics(1e-8, Budget(), None)
    other = replace(numerics, **change)
    assert changed(ASKED, ASKED, numerics, other) == parts
    assert changed(ASKED, ASKED, numerics, other, is_limited=True) == limited


def changed(asked, others, numerics, other, **more):
    """The parts whose keys differ."""
    keys, again = (
        {name: part_key(BY_NAME[name], settings, how, **more) for name, settings in what.items()}
        for what, how in ((asked, numerics), (others, other))
    )
    assert len(set(keys.values())) == len(keys)
    return {name for name in keys if keys[name] != again[name]}


def test_meshes_have_keys_of_their_own():
    meshes = [None, make_mesh(phi_cells=2, xi_cells=4), make_mesh(phi_cells=2, xi_cells=4, xi_max=8.5)]
    keys = {part_key(BY_NAME["moment"], {}, Numerics(1e-8, Budget(), mesh)) for mesh in meshes}
    assert len(keys) == len(meshes)


def test_every_setting_of_a_case_is_in_what_is_asked_of_a_part(tmp_path):
    """Each key of a file that changes numbers changes the settings of the parts that it is about, and of no other."""
    base = everything(case_in(tmp_path, TEXT, [ALL, "oscillator.c3=0.1"]))
    for sets, parts in {
        "moments.p=[2.0, 1.0]": {"moment", "classes", "sensitivities"},
        "moments.p=[2.0, 3.0]": {"moment", "classes", "sensitivities", "discretisation"},
        "excursions.phi=0.3": {"excursions"},
        "excursions.xi=0.4": {"excursions"},
        "excursions.levels=[5.0]": set(),
        "response.rtol=1e-5": {"response"},
        "response.grid={phi=25}": {"response"},
        "oscillator.c1=0.2": set(),
        "output.eigenfunctions=[-1.0]": {"eigenfunctions"},
        "moments.rtol=1e-6": set(),
        "budget.unknowns=90000": set(),
        "title='other'": set(),
    }.items():
        other = everything(case_in(tmp_path, TEXT, [ALL, "oscillator.c3=0.1", sets]))
        assert {name for name in base | other if base.get(name) != other.get(name)} == parts, sets


def test_keys_of_sets_and_simulations_follow_from_what_they_are_of(tmp_path, monkeypatch):
    curve, other, *_ = case_in(tmp_path, TEXT + PRODUCT).curves()
    assert set_key(curve) == set_key(curve) != set_key(other)
    setting = MonteCarloSection()
    settings = [setting, *(setting.model_copy(update=each) for each in ({"seed": 7}, {"paths": 5000}))]
    simulated = [simulation_key(curve, (1.0, 2.0), each) for each in settings]
    simulated += [simulation_key(curve, (1.0,), setting), simulation_key(other, (1.0, 2.0), setting)]
    assert len(set(simulated)) == len(simulated)
    known = set_key(curve)
    monkeypatch.setattr(plain, "RESULT_VERSION", 0)
    assert set_key(curve) != known


def solved_in(monkeypatch):
    """Takes the names of the parts that are solved."""
    found = list[str]()

    def noting(part):
        return replace(part, solve=lambda *arguments: found.append(part.name) or part.solve(*arguments))

    monkeypatch.setattr(solve, "PARTS", tuple(noting(part) if part.solve else part for part in PARTS))
    return found


def asking(*names, more=()):
    return [f"output.quantities={json.dumps(names)}", "output.eigenfunctions=[]", "vary={}", *more]


@pytest.mark.slow
def test_more_quantities_are_solved_alone_and_fewer_not_at_all(tmp_path, monkeypatch):
    found = solved_in(monkeypatch)

    def run(*names, more=()):
        found.clear()
        [result] = fpsolve.run(case_in(tmp_path, TEXT, asking(*names, more=more)), tmp_path / "out")
        return result, set(found)

    first, parts = run("moment", "lyapunov_exponent")
    assert parts == {"moment", "lyapunov_exponent", "theory", "classes", "discretisation"}
    both, parts = run("moment", "lyapunov_exponent", "excursions", "variance_rate")
    assert parts == {"excursions", "variance_rate"}
    np.testing.assert_array_equal(both.moments.value, first.moments.value)
    assert both.estimates["lyapunov_exponent"] == first.estimates["lyapunov_exponent"]
    assert both.excursion is not None
    fewer, parts = run("moment", "variance_rate")
    assert parts == set()
    assert fewer.excursion is None
    assert fewer.estimates["lyapunov_exponent"] is None
    assert fewer.estimates["variance_rate"] == both.estimates["variance_rate"]
    again, parts = run("moment", "lyapunov_exponent", "excursions", more=["excursions.phi=0.5"])
    assert parts == {"excursions"}
    assert again.excursion.phi == 0.5
    _, parts = run("moment", "lyapunov_exponent", more=["budget.unknowns=90000"])
    assert parts == set()
    _, parts = run("moment", "lyapunov_exponent", more=["moments.rtol=1e-7"])
    assert parts == {"moment", "lyapunov_exponent", "classes", "discretisation"}


@pytest.mark.slow
def test_what_a_budget_has_limited_is_solved_again_with_another(tmp_path, monkeypatch):
    found, names = solved_in(monkeypatch), ("moment", "lyapunov_exponent")

    def run(*more):
        found.clear()
        with contextlib.suppress(NotConverged):
            fpsolve.run(case_in(tmp_path, TEXT, asking(*names, more=[*more, "oscillator.epsilon=2.0"])), tmp_path)
        return set(found)

    small = "budget.unknowns=100"
    assert {"moment", "lyapunov_exponent"} <= run(small)
    assert run(small) == set()
    assert {"moment", "lyapunov_exponent"} <= run("budget.unknowns=120")
    assert {"moment", "lyapunov_exponent"} <= run()
    assert run(small) == set()
    [result] = fpsolve.run(case_in(tmp_path, TEXT, asking(*names, more=[small, "oscillator.epsilon=2.0"])), tmp_path)
    assert result.lyapunov_exponent is not None  # which the larger budget has found


def test_what_lacks_something_for_a_small_budget_is_solved_again_with_another(tmp_path):
    """Sensitivities of p that failed; what lacks nothing stays."""
    case = case_in(tmp_path, TEXT, [ALL, "vary={}"])
    [solved], [curve], asked, numerics = solve_sets(case), case.curves(), everything(case), Numerics.of(case)
    more = replace(numerics, budget=Budget(seconds=500.0))
    found = solved.entries["sensitivities"].found
    lacking = replace(found, p=found.p[1:], moments=found.moments[1:])
    for entries, is_kept in ((solved.entries, True), ({"sensitivities": Entry(lacking)}, False)):
        record = record_of_set(curve, asked, numerics, entries)
        assert "sensitivities" in entries_of(record, asked, numerics)[0]
        assert ("sensitivities" in entries_of(record, asked, more)[0]) == is_kept


def test_moments_of_an_unfinished_run_are_taken_with_its_budget_alone(tmp_path):
    case = case_in(tmp_path, TEXT, ["vary={}", "output.quantities=['moment']"])
    [curve], asked, numerics = case.curves(), everything(case), Numerics.of(case)
    job = Job(curve, numerics, begun={2.0: Moment(0.1, 0.2, 0.0, 0.05, 0.0)})
    record = json.loads(json.dumps(begun_record(job)))
    assert entries_of(record, asked, numerics)[1] == job.begun
    assert not entries_of(record, asked, replace(numerics, budget=Budget(unknowns=500)))[1]


def test_the_discretisation_is_that_of_the_moments_asked_for(tmp_path):
    """Also after a run of other moments, and where Λ(p) is known already."""
    sets = ["vary={}", "output.quantities=['moment', 'lyapunov_exponent']", "output.eigenfunctions=[]"]
    found = {}
    for p, folder in (("0.5", "one"), ("40.0", "one"), ("40.0", "other"), ("0.5", "one")):
        [result] = fpsolve.run(case_in(tmp_path, TEXT, [*sets, f"moments.p=[{p}]"]), tmp_path / folder)
        found[p, folder] = result.discretisation
    assert found["40.0", "one"] == found["40.0", "other"]
    assert found["40.0", "one"]["unknowns"] > found["0.5", "one"]["unknowns"]


@pytest.mark.slow
def test_what_there_is_not_is_told_where_a_case_lists_it_without_solving_it_again(tmp_path, monkeypatch):
    found, told = solved_in(monkeypatch), []
    path, sets = CASES / "systems/stochastic_mathieu.toml", ["expect=[]", "figure={}", "vary={}", "moments.p=[2.0]"]
    for quantities in ('"all"', '["moment", "impact_rate"]'):
        found.clear()
        case = load_case(path, [*sets, f"output.quantities={quantities}"])
        [result] = fpsolve.run(case, tmp_path / "out")
        told.append(any(note.tells_of(Code.NOT_ONE_RAY) for note in result.notes))
    assert told == [False, True]
    assert found == []


def rewritten(folder, change):
    """All records of a folder, each with its key and its content changed; checksums are right."""
    [path] = (folder / "records/solved").glob("*.jsonl")
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    path.unlink()
    for line in lines:
        append(path.parent, *change(line["key"], line["record"]))


def test_a_record_of_another_form_is_solved_anew(tmp_path, capsys):
    (tmp_path / "test.toml").write_text(TEXT, encoding="utf-8")
    command = ["run", str(tmp_path / "test.toml"), "--out", str(tmp_path)]
    assert main([*command, "--quiet"]) == 0
    moments = (tmp_path / "test/moments.csv").read_bytes()
    rewritten(
        tmp_path / "test", lambda key, record: (key, {name: [*entry[:2], "soon"] for name, entry in record.items()})
    )
    capsys.readouterr()
    assert main([*command, "--quiet"]) == 0
    assert "known" not in capsys.readouterr().out
    assert (tmp_path / "test/moments.csv").read_bytes() == moments
    assert main([*command, "--quiet"]) == 0
    assert "1 of 1 known from an earlier run" in capsys.readouterr().out


def test_records_of_another_version_are_not_used(tmp_path, capsys):
    (tmp_path / "test.toml").write_text(TEXT, encoding="utf-8")
    command = ["run", str(tmp_path / "test.toml"), "--out", str(tmp_path), "--quiet"]
    assert main(command) == 0
    rewritten(tmp_path / "test", lambda key, record: (key.partition("-")[2], record))
    capsys.readouterr()
    assert main(command) == 0
    assert "known from an earlier run" not in " ".join(capsys.readouterr().out.split())
