"""Bad inputs are refused at once and in short: hostile files in this process, and samples of `tests.faults.fuzz`."""

import random
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from fpsolve import CaseError, FpsolveError, load_case, make_mesh
from fpsolve.fem import read_mesh, write_mesh
from tests import kit
from tests.faults import fuzz

SHIPPED = sorted((Path(__file__).parents[2] / "cases").rglob("*.toml"))
SAID = {
    "25000.mtx": "which has the shape (25000, 25000); must be a square matrix of finite numbers, of at most 200 rows",
    "entries.mtx": "which cannot be read",
    "lies more.npy": "which cannot be read: ",
    "wide.csv": "which has the shape (1, 3000000)",
    "64 MB.csv": "which has 67108866 bytes, and a matrix has at most 67108864",
    "zeros.csv": "which is a pipe or a device, not a file",
    "empty lines": "has 20000005 bytes, and a case file has at most 4194304",
    "keys": "and 950 more",
    "digits of Hz": "111 ... 111",
    "rate 1e160*x + xi*x": " in the motion; must be from 0 to 1e+32",
    "rate 1*x + 1*xi*x(t - 1e-300)": "got a delay of 1e-300 in the motion; must be from 1e-32 to 1e+32",
    f"rate {fuzz.DELAYS[:40]}": "has another call inside x(...); write x(t - tau)",
}


@pytest.mark.parametrize("name", [each for each in {**fuzz.MATRICES, **fuzz.CASES, **SAID} if "4 MB" not in each])
def test_a_hostile_case_is_refused_at_once_and_in_short(name, tmp_path):
    fuzz.write(name, tmp_path)
    begun = time.process_time()
    with pytest.raises(CaseError) as told:
        load_case(tmp_path / "case.toml")
    assert time.process_time() - begun < 5
    assert SAID.get(name, "") in str(told.value)
    assert max(map(len, str(told.value).splitlines())) < 1300


@pytest.mark.slow
@pytest.mark.parametrize("name", ["zeros.npy", "1e6.mtx", "cell 1", "no JIT", "no home"])
def test_a_hostile_process_ends_with_a_short_refusal(name):
    assert fuzz.hostile(name) == ""


@pytest.mark.parametrize("seed", range(6))
def test_calls_with_odd_arguments_return_or_raise_one_sentence(seed):
    assert fuzz.calls(seed, [*fuzz.CALLS][: -fuzz.HEAVY]) == ""


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 8])
def test_all_calls_with_odd_arguments_return_or_raise_one_sentence(seed):
    assert fuzz.calls(seed) == ""


@pytest.mark.parametrize("seed", range(2))
def test_runs_of_mutated_cases_end_or_are_refused(seed):
    assert fuzz.cases(seed) == ""


def refused(path: Path, overrides: Sequence[str] = ()) -> Sequence[Any]:
    """The faults with which a case is refused; none where it is read."""
    try:
        load_case(path, overrides)
    except CaseError as error:
        return error.faults
    return ()


def bytes_of(text: str, rng: random.Random) -> bytes:
    """With some bytes exchanged or cut out."""
    data = bytearray(text.encode())
    for _ in range(rng.randint(1, 5)):
        at = rng.randrange(len(data))
        data[at : at + rng.randint(1, 40)] = [] if rng.random() < 0.3 else [rng.randrange(256)]
    return bytes(data)


@pytest.mark.parametrize("seed", range(4))
def test_mutated_cases_are_read_or_refused_with_sentences(seed, tmp_path):
    rng, path, count = random.Random(seed), tmp_path / "case.toml", 0
    for turn in range(27):
        text = rng.choice([kit.DRAWN, rng.choice(SHIPPED).read_text(encoding="utf-8")])
        cut = rng.choice([0, 0, rng.randrange(len(text))])
        mixed = text[cut:] + text[:cut]
        path.write_bytes(bytes_of(mixed, rng) if turn % 9 == 0 else fuzz.mutated(mixed, rng).encode())
        faults = refused(path, rng.sample(kit.DRAWN.splitlines(), rng.randint(0, 1)))
        lines = range(1, path.read_bytes().count(b"\n") + 2)
        assert all(fault.sentence and "pydantic" not in fault.sentence for fault in faults)
        assert all(fault.line is None or fault.line in lines for fault in faults)
        count += bool(faults)
        assert list(tmp_path.iterdir()) == [path]
    assert count > 4


@pytest.mark.parametrize("seed", range(3))
def test_mutated_files_of_sets_are_read_or_refused_by_name(seed, tmp_path):
    rng, count, path = random.Random(seed), 0, tmp_path / "case.toml"
    sets = "noise.D0,noise.r0,noise.treatment\n" + "".join(f"{0.1 + i},0.9,exact\n" for i in range(8))
    path.write_text(kit.case_text('[moments]\np = [2.0]\n[vary]\nfile = "sets.csv"\n'), encoding="utf-8")
    for _ in range(48):
        text = fuzz.mutated(sets, rng)
        (tmp_path / "sets.csv").write_bytes(bytes_of(text, rng) if rng.random() < 0.5 else text.encode())
        faults = refused(path)
        count += bool(faults)
        assert all("sets.csv" in fault.sentence for fault in faults)
    assert 4 < count < 48


@pytest.mark.parametrize("ending", [".vtu", ".msh"])
def test_mutated_meshes_are_read_or_refused(ending, tmp_path):
    original, path = tmp_path / f"good{ending}", tmp_path / f"bad{ending}"
    write_mesh(make_mesh(**fuzz.MESH), original)
    rng, count = random.Random(7), 0
    for _ in range(16):
        path.write_bytes(bytes_of(original.read_bytes().decode("latin-1"), rng))
        try:
            read_mesh(path)
        except FpsolveError:
            count += 1
    assert count > 4
