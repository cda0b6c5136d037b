"""Hostile files are refused at once, in short and without memory, in this process; some in one of their own."""

import time

import pytest

from fpsolve import load_case
from fpsolve.errors import CaseError
from tests.hostile import CASES, DELAYS, MATRICES, outcome, write

SAID = {
    "25000.mtx": "which has the shape (25000, 25000); must be a square matrix of finite numbers, of at most 100 rows",
    "entries.mtx": "which states 4000000000 entries, more than the file holds",
    "lies more.npy": "which has 1000000000000000000 numbers, and at most",
    "wide.csv": "which has 3000000 columns",
    "64 MB.csv": "which has 67108866 bytes, and a matrix has at most 67108864",
    "zeros.csv": "which is a pipe or a device, not a file",
    "empty lines": "has 20000005 bytes, and a case file has at most 4194304",
    "keys": "faults; start from a copy of a case",
    "digits of Hz": "111 ... 111",
    "rate 1e160*x + xi*x": " in the motion; must be from 0 to 1e+32",
    "rate 1*x + 1*xi*x(t - 1e-300)": "got a delay of 1e-300 in the motion; must be from 1e-32 to 1e+32",
    f"rate {DELAYS[:40]}": "has another call inside x(...); write x(t - tau)",
}


@pytest.mark.parametrize("name", [each for each in {**MATRICES, **CASES, **SAID} if "4 MB" not in each])
def test_bad_input_is_refused_at_once_and_in_short(name, tmp_path):
    write(name, tmp_path)
    begun = time.process_time()
    with pytest.raises(CaseError) as told:
        load_case(tmp_path / "case.toml")
    assert time.process_time() - begun < 5
    assert SAID.get(name, "") in str(told.value)
    assert max(map(len, str(told.value).splitlines())) < 1300


@pytest.mark.slow
@pytest.mark.parametrize("name", ["zeros.npy", "1e6.mtx", "4 MB of tables", "cell 1", "cell 2", "no JIT", "no home"])
def test_hostile_processes(name):
    assert outcome(name).startswith("right")
