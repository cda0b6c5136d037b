"""Hostile files and options, each in a process of its own with limits of memory and time.

`python -m tests.hostile` runs them all, which takes some ten minutes, and prints what else happens than an end, or a
short refusal; words behind it choose among them by their names: `python -m tests.hostile mtx pipe`.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

from fpsolve.commands.options import BAD_INPUT, NOT_CONVERGED
from tests.conftest import heed_signals
from tests.kit import case_text
from tests.measured.test_reading import npy_header

ADDRESSES, RESIDENT = 6 * 2**20, 2**20
"""Memory that a run gets, and that it may take, in kB."""
SECONDS, WAITED, OBEYS = 30.0, 90.0, 3.0
"""Seconds of a processor that a run may take; after which it is ended by SIGTERM; in which it must obey."""
LONGEST = 4000
"""Letters of all that is said."""
WRONG = "Traceback", "a fault of fpsolve", "Warning", "site-packages"
"""What is said of no bad input."""


def zeros(path: Path) -> None:
    """A file without an end."""
    path.symlink_to("/dev/zero")


MTX = "%%MatrixMarket matrix coordinate integer general\n"
MATRICES: dict[str, Any] = {
    "25000.mtx": f"{MTX}25000 25000 1\n1 1 1\n",
    "1e6.mtx": f"{MTX}1000000 1000000 1\n1 1 1\n",
    "entries.mtx": f"{MTX}2 2 4000000000\n1 1 1\n",
    "array.mtx": "%%MatrixMarket matrix array real general\n100000 100000\n1.0\n",
    "digits.mtx": f"{MTX}1 1 1\n1 1 {'9' * 20}\n",
    "rows.mtx": f"{MTX}{'9' * 20} 1 1\n1 1 1\n",
    "index.mtx": f"{MTX}1 1 1\n3 3 1\n",
    "lies.npy": npy_header((2500, 2500)).decode("latin-1"),
    "lies more.npy": npy_header((10**9, 10**9)).decode("latin-1"),
    "wide.csv": ",".join("1" * 3_000_000),
    "64 MB.csv": "1\n" * (2**25 + 1),
    "empty.csv": "\n\n",
    **{f"{each.__name__}.{kind}": each for each, kind in product((os.mkfifo, zeros), ("mtx", "npy", "csv"))},
}
"""Files that a case names, and their texts, or what makes them."""
MODES = """title = "modes"
[system]
kind = "modes"
mass = [[1.0]]
stiffness = "FILE"
[noise]
kind = "white"
s = 0.1
[moments]
p = [2.0]
"""
EQUATIONS = """title = "an equation"
[system]
variables = ["x"]
drift = ["FILE"]
[noise]
kind = "white"
s = 0.1
[moments]
p = [2.0]
"""
DELAYS = "x(t - " * 90 + "+".join(["x(t - 1)"] * 100) + ")" * 90
SIZES = "1", "1e-30", "1e-300", "1e-150", "1e160", "1e300"
RATES = *(f"{k}*x + {k}*xi*x(t - {delay})" for k, delay in product(SIZES, SIZES)), "1e160*x + xi*x", DELAYS
LIGHT = case_text("""[moments]
p = [1.0, 2.0]
rtol = 1e-3
[output]
quantities = ["moment"]
[monte_carlo]
paths = 64
time = 50.0
""")
CASES: dict[str, Any] = {
    "mkfifo": os.mkfifo,
    "zeros": zeros,
    "digits": LIGHT.replace("0.8", f'"{"1" * 10**6}x"'),
    "digits of Hz": LIGHT.replace("0.8", f'"{"1" * 10**6} Hz"'),
    "a text of 1 MB": LIGHT.replace("0.8", f'"{"a" * 10**6}"'),
    "a sum": EQUATIONS.replace("FILE", f"exp({'+'.join('1' * 5000)})"),
    "empty lines": "\n" * 20_000_000 + "a = 1",
    "keys": "".join(f"a{k}=1\n" for k in range(2000)),
    "4 MB of keys": "[noise]\n" + "".join(f"a{k}=1\n" for k in range(400_000)),
    "4 MB of tables": "[[expect]]\n" * 360_000,
    "4 MB of numbers": "p = [" + "1," * 1_900_000 + "]",
    "4 MB of a key": "a" * 4_000_000 + " = 1",
    "4 MB of a line": "a = 1 " + "b" * 4_000_000,
}
EVEN = "f,G\n" + "".join(f"{0.1 * k:g},{0.02 / (1 + (0.1 * k) ** 2):.8f}\n" for k in range(1, 80))
CELLS = "1" * 40_000 + "x", "1" * 40_000, "1e400", "1e-400", "1e" + "9" * 5000, "z" * 10**6, "G" + "( " * 200_000
RUN = "fpsolve run case.toml"
HOSTILE = {
    **{name: (RUN, MODES.replace("FILE", name)) for name in MATRICES},
    **{name: (RUN, each) for name, each in CASES.items()},
    **{f"rate {each[:40]}": (RUN, EQUATIONS.replace("FILE", each)) for each in RATES},
    **{f"cell {k}": ("fpsolve noise --per Hz --sided one a.csv", f"{EVEN}8,{each}\n") for k, each in enumerate(CELLS)},
    "names": ("fpsolve noise --per Hz --sided one a.csv", EVEN.replace("G", CELLS[-1])),
    "PEER": ("fpsolve noise --record a.at2", f"NPTS={'1' * 40_000} DT= 1.2.3\n1\n"),
    "long value": (f"fpsolve run --set {'a' * 10**5} case.toml", LIGHT),
    "long option": (f"fpsolve run --{'a' * 10**5} case.toml", LIGHT),
    "no JIT": ("NUMBA_DISABLE_JIT=1 fpsolve simulate case.toml", LIGHT),
    "no home": (f"MPLCONFIGDIR=/proc/none HOME=/proc/none {RUN}", LIGHT),
    "Chinese": (RUN, LIGHT.replace("A test", "\\u632f\\u52a8")),
}
"""By their names the words of the command, and what its file holds, which is the last of them."""


def write(name: str, folder: Path) -> None:
    """Make the files of an input."""
    words, content = HOSTILE[name]
    for file, each in (words.split()[-1], content), (name, MATRICES.get(name, "")):
        path = folder / file.replace("/", "")
        each(path) if callable(each) else path.write_text(each, encoding="latin-1")


def outcome(name: str) -> str:
    """What is wrong with how a command ends, or "right"; what it costs, and what it says."""
    before, late, pipe = resource.getrusage(resource.RUSAGE_CHILDREN), 0, subprocess.PIPE
    script = HOSTILE[name][0].replace("fpsolve", f"{sys.executable} -m fpsolve")
    with tempfile.TemporaryDirectory() as folder:
        write(name, Path(folder))
        script = f"ulimit -v {ADDRESSES}; exec env {script} < /dev/null"
        run = subprocess.Popen(
            script, shell=True, cwd=folder, stdout=pipe, stderr=pipe, text=True, preexec_fn=heed_signals
        )
        while True:
            with suppress(subprocess.TimeoutExpired):
                _, said = run.communicate(timeout=(WAITED, OBEYS, None)[late])
                break
            (run.terminate, run.kill)[late]()
            late += 1
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime - before.ru_utime
    faults = {
        "ignores SIGTERM": late > 1,
        "takes too long": late or seconds > SECONDS,
        "takes too much memory": after.ru_maxrss > max(RESIDENT, before.ru_maxrss),
        f"exit code {run.returncode}": run.returncode not in (0, BAD_INPUT, NOT_CONVERGED),
        f"says {len(said)} letters": len(said) > LONGEST or (run.returncode and not said.strip()),
        **{word: word in said for word in WRONG},
    }
    wrong = ", ".join(fault for fault, is_there in faults.items() if is_there)
    told = f": {said[:300]} ... {said[300:][-300:]}" if wrong else ""
    return f"{wrong or 'right'} (exit {run.returncode}, {seconds:.1f} s, {after.ru_maxrss // 1024} MB so far){told}"


def main() -> int:
    found = list[str]()
    for name in [each for each in HOSTILE if any(word in each for word in sys.argv[1:] or [""])]:
        found.append(outcome(name))
        print(f"{name}: {found[-1]}", flush=True)
    wrong = sum(not told.startswith("right") for told in found)
    print(f"{len(found)} inputs, {wrong} with faults")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
