"""Hostile files and options, each in a process of its own with limits of memory and time.

`python -m tests.hostile` runs them all and prints what else happens than one short refusal; it takes some minutes.
Names after it choose inputs: `python -m tests.hostile mtx cell`.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fpsolve.commands.options import BAD_INPUT, NOT_CONVERGED
from tests.kit import case_text
from tests.measured.test_reading import npy_header

ADDRESSES, RESIDENT = 6 * 2**30, 2**30
"""Bytes of addresses that a process gets, and of memory that it may take."""
SECONDS, OBEYS = 20.0, 3.0
"""Seconds after which a run is ended by SIGTERM, and in which it must obey."""
LONGEST = 4000
"""Letters of all that is said."""
Content = bytes | str | Callable[[Path], object]

MODES = """title = "modes"
[system]
kind = "modes"
mass = [[1.0]]
damping = [[0.1]]
stiffness = "FILE"
stiffness_noise = [[1.0]]
[noise]
kind = "white"
s = 0.1
[moments]
p = [2.0]
"""
LIGHT = """[moments]
p = [1.0, 2.0]
rtol = 1e-3
[output]
quantities = ["moment"]
eigenfunctions = []
[monte_carlo]
paths = 64
time = 50.0
"""
EQUATIONS = """title = "delays"
[system]
variables = ["x", "v"]
drift = ["v", "RATE"]
[noise]
kind = "white"
s = 0.1
[moments]
p = [2.0]
"""


def linked(target: str) -> Callable[[Path], object]:
    return lambda path: path.symlink_to(target)


def nested(levels: int) -> str:
    """Delays inside delays."""
    return "x(t - " * levels + "1" + ")" * levels


class Hostile(NamedTuple):
    """Words of the command, the files that it reads, and what may come of it.

    Attributes:
        codes: the exit codes that are right.
        said: words of the message.
    """

    words: Sequence[str]
    files: Mapping[str, Content]
    codes: Sequence[int] = (BAD_INPUT,)
    said: str = ""
    environment: Mapping[str, str] = {}


def of_case(text: str, said: str = "", codes: Sequence[int] = (BAD_INPUT,), **files: Content) -> Hostile:
    return Hostile(["run", "case.toml"], {"case.toml": text} | files, codes, said)


def of_matrix(name: str, content: Content, said: str) -> Hostile:
    return of_case(MODES.replace("FILE", name), said, **{name: content})


def of_spectrum(rows: str, said: str = "", codes: Sequence[int] = (BAD_INPUT,)) -> Hostile:
    words = ["noise", "a.csv", "--per", "Hz", "--sided", "one", "--frequency", "1", "--damping-ratio", "0.01"]
    return Hostile(words, {"a.csv": rows}, codes, said)


MTX = "%%MatrixMarket matrix coordinate real general\n"
EVEN = "".join(f"{0.1 * k:g},{0.02 / (1 + (0.1 * k) ** 2):.8f}\n" for k in range(1, 80))
HOSTILE: dict[str, Hostile] = {
    "mtx 25,000": of_matrix("k.mtx", f"{MTX}25000 25000 1\n1 1 1.0\n", "(25000, 25000)"),
    "mtx 1e6": of_matrix("k.mtx", f"{MTX}1000000 1000000 1\n1 1 1.0\n", "(1000000, 1000000)"),
    "mtx nnz": of_matrix("k.mtx", f"{MTX}2 2 4000000000\n1 1 1.0\n", "k.mtx"),
    "mtx array": of_matrix("k.mtx", "%%MatrixMarket matrix array real general\n100000 100000\n1.0\n", "(100000, 1000"),
    "mtx entry": of_matrix("k.mtx", f"{MTX.replace('real', 'integer')}1 1 1\n1 1 {'9' * 20}\n", "k.mtx"),
    "mtx rows": of_matrix("k.mtx", f"{MTX}{'9' * 20} 1 1\n1 1 1\n", "k.mtx"),
    "mtx negative": of_matrix("k.mtx", f"{MTX}-1 -1 1\n1 1 1\n", "k.mtx"),
    "mtx index": of_matrix("k.mtx", f"{MTX}1 1 1\n3 3 1\n", "k.mtx"),
    "mtx empty": of_matrix("k.mtx", "", "k.mtx"),
    "mtx cut": of_matrix("k.mtx", f"{MTX}2 2 2\n1 1 1.0\n", "k.mtx"),
    "mtx complex": of_matrix("k.mtx", f"{MTX.replace('real', 'complex')}1 1 1\n1 1 1 1\n", "k.mtx"),
    "npy lies": of_matrix("k.npy", npy_header((2500, 2500)) + b"12345678", "more than the file holds"),
    "npy lies more": of_matrix("k.npy", npy_header((10**9, 10**9)) + b"12345678", "1000000000000000000 numbers"),
    "npy cut": of_matrix("k.npy", npy_header((2, 2)) + b"12345678", "k.npy"),
    "npy text": of_matrix("k.npy", "no array", "k.npy"),
    "csv wide": of_matrix("k.csv", ",".join("1" * 3_000_000), "k.csv"),
    "csv 64 MB": of_matrix("k.csv", "1\n" * (2**25 + 1), "67108866 bytes"),
    "csv empty": of_matrix("k.csv", "\n\n", "k.csv"),
    "csv digits": of_matrix("k.csv", "9" * 2_000_000, "k.csv"),
    **{f"pipe.{kind}": of_matrix(f"k.{kind}", os.mkfifo, "is a pipe") for kind in ("mtx", "npy", "csv")},
    **{f"zero.{kind}": of_matrix(f"k.{kind}", linked("/dev/zero"), "is a pipe") for kind in ("mtx", "npy", "csv")},
    "mesh pipe": of_case(case_text('[mesh]\nfile = "m.vtu"\n'), "", **{"m.vtu": os.mkfifo}),
    "mesh zero": of_case(case_text('[mesh]\nfile = "m.msh"\n'), "", **{"m.msh": linked("/dev/zero")}),
    "sets pipe": of_case(case_text('[vary]\nfile = "s.csv"\n'), "is a pipe", **{"s.csv": os.mkfifo}),
    "case pipe": Hostile(["run", "case.toml"], {"case.toml": os.mkfifo}, said="is a pipe"),
    "case zero": Hostile(["run", "case.toml"], {"case.toml": linked("/dev/zero")}, said="is a pipe"),
    "key of digits": of_case(case_text(omega="1" * 1_000_000 + "x"), "omega"),
    "key of digits and a unit": of_case(case_text(omega="1" * 1_000_000 + " Hz"), "omega"),
    "key of points": of_case(case_text(omega="1." * 500_000), "omega"),
    "option of digits": Hostile(
        ["run", "case.toml", "--set", f'oscillator.omega="{"1" * 100_000}x"'], {"case.toml": case_text()}
    ),
    "rate of digits": of_case(EQUATIONS.replace("RATE", "-" + "1" * 19_000 + "x")),
    "cell of digits": of_spectrum(f"f,G\n{EVEN}8,{'1' * 40_000}x\n", "line 81"),
    "cell of digits alone": of_spectrum(f"f,G\n{EVEN}8,{'1' * 40_000}\n"),
    "record of digits": Hostile(["noise", "a.at2", "--record"], {"a.at2": f"NPTS= 1, DT= {'1' * 40_000}x\n1\n"}),
    "name of digits": of_spectrum(f"f,{'1' * 40_000}x\n{EVEN}", codes=(0, BAD_INPUT, NOT_CONVERGED)),
    "cell 1e400": of_spectrum(f"f,G\n{EVEN}8,1e400\n"),
    "cell 1e-400": of_spectrum(f"f,G\n{EVEN}8,1e-400\n"),
    "cell 1e9…": of_spectrum(f"f,G\n{EVEN}8,1e{'9' * 5000}\n"),
    "cells 1e400": of_spectrum("f,G\n" + "1e400,1e400\n" * 9),
    "cells 1e-400": of_spectrum("f,G\n" + "".join(f"{k},1e-400\n" for k in range(9))),
    "delays 20 deep": of_case(EQUATIONS.replace("RATE", f"-x - 0.1*v - xi*x + {nested(20)}")),
    "delays 60 deep": of_case(EQUATIONS.replace("RATE", f"-x - 0.1*v - xi*x + {nested(60)}")),
    "delays 180 deep": of_case(EQUATIONS.replace("RATE", f"-x - 0.1*v - xi*x + {nested(180)}")),
    "delays in a delay": of_case(
        EQUATIONS.replace("RATE", f"-x - 0.1*v - xi*x + x(t - ({'+'.join(['x(t-1)'] * 2700)}))")
    ),
    "many delays": of_case(
        EQUATIONS.replace("RATE", "-x - 0.1*v - xi*x " + "".join(f"+x(t-{k})" for k in range(1, 1800)))
    ),
    "empty lines": of_case("\n" * 20_000_000 + "a = 1", "20000005 bytes"),
    "4 MB of empty lines": of_case("\n" * 4_000_000 + "a = 1", "title"),
    "4 MB of keys": of_case("".join(f"a{k}=1\n" for k in range(400_000)), "faults"),
    "4 MB of keys of a table": of_case("[noise]\n" + "".join(f"a{k}=1\n" for k in range(400_000)), "faults"),
    "4 MB of lines of numbers": of_case("p = [\n" + "1,\n" * 1_300_000 + "]", ""),
    "4 MB of tables": of_case("[[expect]]\n" * 360_000, "faults"),
    "4 MB of numbers": of_case("p = [" + "1," * 1_900_000 + "]", ""),
    "4 MB of a key": of_case("a" * 3_900_000 + " = 1", ""),
    "4 MB of a line": of_case("a = 1 " + "b" * 3_900_000, ""),
    "a text of 1 MB": of_case(case_text(impact="a" * 1_000_000), "impact"),
    "a key of 1 MB": of_case(case_text(**{"a" * 1_000_000: 1.0}), "unknown key"),
    "a key of dots": of_case(case_text(f"{'a.' * 2000}b = 1"), ""),
    "a cell of 1 MB": of_spectrum(f"f,G\n{EVEN}8,{'z' * 1_000_000}\n"),
    "a name of 1 MB": of_spectrum(f"f,{'z' * 1_000_000}\n{EVEN}8,x\n"),
    "an option of 1 MB": Hostile(["run", "case.toml", "--set", "a" * 100_000], {"case.toml": case_text()}),
    "an unknown option": Hostile(["run", "case.toml", "--" + "a" * 100_000], {"case.toml": case_text()}),
    "a file of 4 kB": Hostile(["run", "a/" * 2000 + "b.toml"], {}),
    **{
        f"delay {delay}, coefficient {k}": of_case(
            EQUATIONS.replace("RATE", f"-x - 0.1*v - xi*x + {k}*x(t - {delay})"), codes=(0, BAD_INPUT, NOT_CONVERGED)
        )
        for delay in ("1", "1e-300", "1e-150", "1e300")
        for k in ("0.1", "1e160", "1e300", "1e-300")
        if (delay, k) != ("1", "0.1")
    },
    "no delay, coefficient 1e160": of_case(
        EQUATIONS.replace("RATE", "-1e160*x - 0.1*v - xi*x"), codes=(0, BAD_INPUT, NOT_CONVERGED)
    ),
    "modes of 1e160": of_case(
        MODES.replace('"FILE"', "[[1e160]]"), codes=(0, BAD_INPUT, NOT_CONVERGED)
    ),
    "no JIT": Hostile(
        ["simulate", "case.toml", "--seed", "1"],
        {"case.toml": case_text(LIGHT)},
        (0, BAD_INPUT, NOT_CONVERGED),
        environment={"NUMBA_DISABLE_JIT": "1"},
    ),
    "no JIT, run": Hostile(
        ["run", "case.toml"], {"case.toml": case_text(LIGHT)}, (0,),
        environment={"NUMBA_DISABLE_JIT": "1"},
    ),
    "a title in Chinese": of_case(case_text(LIGHT, "振动"), codes=(0,)),
    "a title of no letters": of_case(f'title = "\U0001f600"\n{case_text(LIGHT).partition(chr(10))[2]}', codes=(0,)),
    "no place for fonts": Hostile(
        ["run", "case.toml"], {"case.toml": case_text(LIGHT)}, (0,),
        environment={"MPLCONFIGDIR": "/proc/none", "HOME": "/proc/none"},
    ),
}  # fmt: skip


class Ended(NamedTuple):
    """How a process ended: its exit code, what it said, its memory in bytes, and whether it obeyed in time."""

    code: int
    out: str
    said: str
    memory: int
    seconds: float
    obeyed: bool


def limited() -> None:
    """For a process that is being started: what it may take, and signals as they are without a shell."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    for name in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
        signal.signal(name, signal.SIG_DFL)


def run(hostile: Hostile, folder: Path) -> Ended:
    """Run the command in a folder."""
    for name, content in hostile.files.items():
        path = folder / name
        if callable(content):
            content(path)
        else:
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **hostile.environment}
    command: Any = [sys.executable, "-m", "fpsolve", *hostile.words]
    with (folder / ".out").open("w+b") as out, (folder / ".err").open("w+b") as err:
        process = subprocess.Popen(
            command, stdout=out, stderr=err, cwd=folder, env=environment, preexec_fn=limited, stdin=subprocess.DEVNULL
        )
        started, asked, obeyed = time.monotonic(), False, True
        while True:
            found, status, used = os.wait4(process.pid, os.WNOHANG)
            seconds = time.monotonic() - started
            if found:
                break
            if seconds > SECONDS and not asked:
                process.terminate()
                asked = True
            if seconds > SECONDS + OBEYS:
                process.kill()
                obeyed = False
            time.sleep(0.02)
        process.returncode = os.waitstatus_to_exitcode(status)
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read().decode(errors="replace"))
    return Ended(process.returncode, *texts, used.ru_maxrss * 1024, seconds, obeyed)


def fault(hostile: Hostile, ended: Ended) -> str:
    """What is wrong with how a process ended, or nothing."""
    text = ended.out + ended.said
    faults = {
        "ignores SIGTERM": not ended.obeyed,
        f"takes {ended.seconds:.0f} s": ended.seconds > SECONDS,
        f"takes {ended.memory / 2**20:.0f} MB": ended.memory > RESIDENT,
        "traceback": "Traceback" in text,
        "a fault of fpsolve": "a fault of fpsolve" in text,
        "a warning of a library": "Warning" in ended.said or "site-packages" in ended.said,
        f"exit code {ended.code}": ended.code not in hostile.codes,
        "says nothing": ended.code != 0 and not ended.said.strip(),
        f"says {len(ended.said)} letters": len(ended.said) > LONGEST,
        f'does not say "{hostile.said}"': hostile.said not in ended.said,
    }
    return ", ".join(name for name, is_wrong in faults.items() if is_wrong)


def faults(names: Sequence[str], *, is_told: bool = False) -> list[str]:
    """What goes wrong, each in a folder of its own."""
    found = list[str]()
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            ended = run(HOSTILE[name], Path(folder))
        wrong = fault(HOSTILE[name], ended)
        told = f"{name}: {wrong or 'right'} ({ended.seconds:.1f} s, {ended.memory / 2**20:.0f} MB)"
        if is_told:
            print(told, flush=True)
        if wrong:
            found.append(f"{told}: {ended.said[:300]} ... {ended.said[300:][-500:]}")
    return found


def main() -> int:
    words = sys.argv[1:]
    names = [name for name in HOSTILE if not words or any(word in name for word in words)]
    found = faults(names, is_told=True)
    print("", *found, f"{len(names)} inputs, {len(found)} with faults", sep="\n")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
