"""Records: exact, in files that only grow; what is torn or damaged is none."""

import base64
import copy
import json
import math
import multiprocessing
import os
import zlib
from dataclasses import replace

import numpy as np
import pytest

from fpsolve.case.sections import MonteCarloSection
from fpsolve.cli import main
from fpsolve.errors import OutputError
from fpsolve.exponent.adapt import Budget
from fpsolve.fem.mesh import make_mesh
from fpsolve.output import records as plain
from fpsolve.output.records import (
    Records,
    Results,
    _packed,
    append,
    growing_key,
    key_of,
    record_of,
    result_of,
    simulation_key,
)
from fpsolve.study.solve import Numerics, Wanted, everything, solve_curve
from tests.kit import ALL, case_in, solve_case
from tests.output.test_datasets import HOPELESS, PRODUCT, TEXT

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
    for result in solve_case(case_in(tmp_path, text, [ALL])):
        record = record_of(result)
        again = result_of(json.loads(json.dumps(record)), result.curve)
        assert same(record_of(again), record)
        for name in ("p", "value", "derivative", "error_estimate", "residual", "perturbation"):
            np.testing.assert_array_equal(getattr(again.moments, name), getattr(result.moments, name))
        assert again.estimates == result.estimates
        assert (again.warnings, again.notes, again.failures) == (result.warnings, result.notes, result.failures)
        for one, other in zip((*again.warnings, *again.notes), (*result.warnings, *result.notes), strict=True):
            assert (one.code, one.data) == (other.code, other.data)
        assert [each.reason.code for each in again.failures] == [each.reason.code for each in result.failures]
        assert again.status == result.status
        assert again.sensitivities.moments == result.sensitivities.moments
        assert again.sensitivities.indices == result.sensitivities.indices


def test_a_key_follows_from_all_that_changes_a_result(tmp_path, monkeypatch):
    curve, other, *_ = case_in(tmp_path, TEXT + PRODUCT).curves()
    wanted, numerics = Wanted(np.array([1.0, 2.0]), ("lyapunov_exponent",)), Numerics(1e-8, Budget(), None)
    asked = [{"p": np.array([1.0, 3.0])}, {"indices": ()}, {"shown": (1.0,)}, {"density": True}]
    asked += [{"is_stated": not wanted.is_stated}, {"start": (0.3, 0.4)}]
    meshes = [make_mesh(phi_cells=2, xi_cells=4), make_mesh(phi_cells=2, xi_cells=4, xi_max=8.5)]
    solved = [{"rtol": 1e-9}, {"budget": Budget(unknowns=500)}, {"budget": Budget(seconds=5.0)}]
    solved.append({"budget": Budget(memory=1.0)})
    keys = [
        key_of(curve, wanted, numerics),
        key_of(other, wanted, numerics),
        *(key_of(curve, replace(wanted, **each), numerics) for each in (*asked, {"differentiated": (1.0,)})),
        *(key_of(curve, wanted, replace(numerics, **each)) for each in (*solved, *({"mesh": mesh} for mesh in meshes))),
    ]
    assert len(set(keys)) == len(keys)
    assert keys[0] == key_of(curve, wanted, numerics)
    monkeypatch.setattr(plain, "RESULT_VERSION", 0)
    assert key_of(curve, wanted, numerics) not in keys


def test_other_keys_follow_from_what_they_are_of(tmp_path):
    """The moments of a curve that is not finished do not depend on the budget; a simulation has no tolerance."""
    curve, other, *_ = case_in(tmp_path, TEXT + PRODUCT).curves()
    numerics, mesh = Numerics(1e-8, Budget(), None), make_mesh(phi_cells=2, xi_cells=4)
    known = growing_key(curve, numerics)
    changed = [growing_key(curve, replace(numerics, **each)) for each in ({"rtol": 1e-9}, {"mesh": mesh})]
    assert len({known, growing_key(other, numerics), *changed}) == 4
    assert growing_key(curve, replace(numerics, budget=Budget(seconds=5.0, memory=1.0))) == known
    setting = MonteCarloSection()
    settings = [setting, *(setting.model_copy(update=each) for each in ({"seed": 7}, {"paths": 5000}))]
    simulated = [simulation_key(curve, (1.0, 2.0), each) for each in settings]
    simulated += [simulation_key(curve, (1.0,), setting), simulation_key(other, (1.0, 2.0), setting)]
    assert len(set(simulated)) == len(simulated)


def rewritten(folder, change):
    """All records of a folder, each with its key and its content changed; checksums are right."""
    [path] = (folder / "records/solved").glob("*.jsonl")
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    path.unlink()
    for line in lines:
        append(path.parent, *change(line["key"], line["record"]))


def test_a_record_of_another_form_is_solved_anew(tmp_path, capsys):
    """All other forms below are none either."""
    (tmp_path / "test.toml").write_text(TEXT, encoding="utf-8")
    command = ["run", str(tmp_path / "test.toml"), "--out", str(tmp_path)]
    assert main([*command, "--quiet"]) == 0
    moments = (tmp_path / "test/moments.csv").read_bytes()
    rewritten(tmp_path / "test", lambda key, record: (key, record | {"seconds": "soon"}))
    capsys.readouterr()
    assert main([*command, "--quiet"]) == 0
    assert "known" not in capsys.readouterr().out
    assert (tmp_path / "test/moments.csv").read_bytes() == moments
    assert main([*command, "--quiet"]) == 0
    assert "1 of 1 known from an earlier run" in capsys.readouterr().out


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A case, its first curve, and the record of that."""
    case = case_in(tmp_path_factory.mktemp("solved"), TEXT + PRODUCT, [ALL])
    [curve] = case.curves(0, 1)
    return case, curve, record_of(solve_curve(curve, everything(case), Numerics.of(case)).result)


def is_taken(folder, solved, change):
    """Whether a record is taken as it is, or changed, with a right checksum."""
    case, curve, record = solved
    content = json.dumps(change(copy.deepcopy(record))).encode()
    (folder / "x.jsonl").write_bytes(b'{"key": "key", "crc32": %d, "record": %s}\n' % (zlib.crc32(content), content))
    return Results(case, Records(folder).look()).find(curve, "key")


def column(i, values):
    """Another column of the moments."""
    return lambda record: record["moments"].__setitem__(i, _packed(np.array(values))) or record


def compressed(**change):
    """The p in the form of long arrays, with something changed."""
    data = base64.b64encode(zlib.compress(np.array([2.0, 0.0, -1.0]).tobytes())).decode()
    return lambda record: record["moments"].__setitem__(0, {"shape": [3], "data": data} | change) or record


def estimate(value, i):
    return lambda record: record["estimates"]["lyapunov_exponent"].__setitem__(i, value) or record


def slope(key, i=3):
    """Another attribute of the sensitivities."""
    return lambda record: record["sensitivities"].__setitem__(i, key) or record


WRONG = {
    "nothing": lambda record: {},
    "a column too few": lambda record: record | {"moments": record["moments"][:-1]},
    "one estimate alone": lambda record: record | {"estimates": {"lyapunov_exponent": [0.0, 0.0]}},
    "seconds are a word": lambda record: record | {"seconds": "soon"},
    "warnings are a text": lambda record: record | {"warnings": "none"},
    "one p of another": lambda record: record | {"moments": [_packed(np.array([7.0])), *record["moments"][1:]]},
    "p of others": column(0, [7.0, 0.0, -1.0]),
    "p twice": column(0, [2.0, 2.0, -1.0]),
    "p is nan": column(0, [2.0, 0.0, math.nan]),
    "p missing": lambda record: record | {"moments": [_packed(np.zeros(0))] * 7},
    "one value too many": column(1, [1.0, 2.0, 3.0, 4.0]),
    "values in a table": column(1, [[1.0, 2.0, 3.0]]),
    "no value": column(1, [math.nan, 0.0, 0.0]),
    "infinite error": column(3, [math.inf, 0.0, 0.0]),
    "a value in words": lambda record: record["moments"][1].__setitem__(0, "1.0") or record,
    "a value that is true": lambda record: record["moments"][1].__setitem__(0, True) or record,
    "no shape": compressed(shape=[-1]),
    "a large shape": compressed(shape=[3 * 10**9]),
    "much in little": compressed(data=base64.b64encode(zlib.compress(bytes(10**8))).decode()),
    "seconds are infinite": lambda record: record | {"seconds": "inf"},
    "seconds are true": lambda record: record | {"seconds": True},
    "seconds are a text": lambda record: record | {"seconds": "1.0"},
    "seconds are too large": lambda record: record | {"seconds": 10**400},
    "λ is infinite": estimate("inf", 0),
    "error is negative": estimate(-1.0, 1),
    "no λ": lambda record: record["estimates"].pop("lyapunov_exponent") and record,
    "another index": lambda record: record["estimates"].update(x=None) or record,
    "discretisation": lambda record: record | {"discretisation": {"xi": math.nan}},
    "half a letter": lambda record: record | {"discretisation": {"xi": "\ud800"}},
    "a message with half a letter": lambda record: record | {
        "warnings": [{"code": "TEXT", "data": {"text": "\ud800"}}]
    },
    "a message that cannot be said": lambda record: record | {"notes": [{"code": "INFINITE", "data": {"p": "x"}}]},
    "a message of no size": lambda record: record | {"notes": [{"code": "TEXT", "data": {"text": "x", "size": "x"}}]},
    "fewer derivatives": slope([]),
    "derivatives by another key": slope({"oscillator.x": 1.0}, 0),
    "nested": lambda record: record | {"notes": json.loads("[" * 900 + "]" * 900)},
}  # fmt: skip


@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_a_record_whose_numbers_do_not_fit_is_none(tmp_path, solved, change):
    assert is_taken(tmp_path, solved, lambda record: record)
    assert is_taken(tmp_path, solved, compressed())
    assert not is_taken(tmp_path, solved, change)


def test_a_line_that_is_nested_or_endless_is_no_record(tmp_path, solved, monkeypatch):
    assert is_taken(tmp_path, solved, lambda record: record)
    whole = (tmp_path / "x.jsonl").read_bytes()
    (tmp_path / "x.jsonl").write_bytes(b"[" * 100_000 + b"\n" + whole)
    assert Records(tmp_path).look().are_there
    monkeypatch.setattr(plain, "LONGEST", 1000)
    assert not Records(tmp_path).look().are_there


def test_records_of_another_version_are_named(tmp_path, capsys):
    (tmp_path / "test.toml").write_text(TEXT, encoding="utf-8")
    command = ["run", str(tmp_path / "test.toml"), "--out", str(tmp_path), "--quiet"]
    assert main(command) == 0
    rewritten(tmp_path / "test", lambda key, record: (key.partition("-")[2], record))
    capsys.readouterr()
    assert main(command) == 0
    assert "; 1 record of another version not used)" in " ".join(capsys.readouterr().out.split())
