"""Bad inputs from three sources: files and options, calls of the public functions, and case files with random faults.

`python -m tests.faults.fuzz [hostile|calls|cases] [first last]` prints what else happens than an end, a short refusal,
or one sentence of fpsolve's own; a number is that of an input, or the seed of a round. It ends with 1 if there is any.
"""

from __future__ import annotations

import os
import random
import re
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager, suppress
from decimal import Decimal
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import fpsolve
from fpsolve import FpsolveError, Problem
from fpsolve.analysis import Axis
from fpsolve.exponent import Budget
from fpsolve.fem import read_mesh, write_mesh
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, SineWiener, Telegraph
from tests import kit
from tests.conftest import heed_signals

BAD_INPUT, NOT_CONVERGED = 2, 3
LIMIT = 120
"""Seconds after which a call or a run hangs."""


class Hang(BaseException):
    """It took too long."""


@contextmanager
def limited() -> Iterator[None]:
    """What takes longer than `LIMIT` raises `Hang`."""

    def hang(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, hang)
    signal.alarm(LIMIT)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


# Hostile files and options, each in a process of its own with limits of memory and time

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


def npy(*shape: int) -> str:
    """The beginning of a file of NumPy that has no numbers."""
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    return f"\x93NUMPY\x01\x00{chr(len(head))}\x00{head}"


MTX = "%%MatrixMarket matrix coordinate integer general\n"
MATRICES: dict[str, Any] = {
    "25000.mtx": f"{MTX}25000 25000 1\n1 1 1\n",
    "1e6.mtx": f"{MTX}1000000 1000000 1\n1 1 1\n",
    "entries.mtx": f"{MTX}2 2 4000000000\n1 1 1\n",
    "array.mtx": "%%MatrixMarket matrix array real general\n100000 100000\n1.0\n",
    "digits.mtx": f"{MTX}1 1 1\n1 1 {'9' * 20}\n",
    "rows.mtx": f"{MTX}{'9' * 20} 1 1\n1 1 1\n",
    "index.mtx": f"{MTX}1 1 1\n3 3 1\n",
    "lies.npy": npy(2500, 2500),
    "lies more.npy": npy(10**9, 10**9),
    "wide.csv": ",".join("1" * 3_000_000),
    "64 MB.csv": "1\n" * (2**25 + 1),
    "empty.csv": "\n\n",
    **{f"{each.__name__}.{kind}": each for each, kind in product((os.mkfifo, zeros), ("mtx", "npy", "csv"))},
}
"""Files that a case names, and their texts, or what makes them."""
END = '[noise]\nkind = "white"\ns = 0.1\n[moments]\np = [2.0]\n'
MODES = f'title = "modes"\n[system]\nkind = "modes"\nmass = [[1.0]]\nstiffness = "FILE"\n{END}'
EQUATIONS = f'title = "an equation"\n[system]\nvariables = ["x"]\ndrift = ["FILE"]\n{END}'
DELAYS = "x(t - " * 90 + "+".join(["x(t - 1)"] * 100) + ")" * 90
SIZES = "1", "1e-30", "1e-300", "1e-150", "1e160", "1e300"
RATES = *(f"{k}*x + {k}*xi*x(t - {delay})" for k, delay in product(SIZES, SIZES)), "1e160*x + xi*x", DELAYS
ONE = '[moments]\np = [1.0, 2.0]\nrtol = 1e-3\n[output]\nquantities = ["moment"]\n'
LIGHT = kit.case_text(f"{ONE}[monte_carlo]\npaths = 64\ntime = 50.0\n")
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
RUN, NOISE = "fpsolve run case.toml", "fpsolve noise --per Hz --sided one a.csv"
HOSTILE = {
    **{name: (RUN, MODES.replace("FILE", name)) for name in MATRICES},
    **{name: (RUN, each) for name, each in CASES.items()},
    **{f"rate {each[:40]}": (RUN, EQUATIONS.replace("FILE", each)) for each in RATES},
    **{f"cell {k}": (NOISE, f"{EVEN}8,{each}\n") for k, each in enumerate(CELLS)},
    "names": (NOISE, EVEN.replace("G", CELLS[-1])),
    "PEER": ("fpsolve noise --record a.at2", f"NPTS={'1' * 40_000} DT= 1.2.3\n1\n"),
    "long value": (f"fpsolve run --set {'a' * 10**5} case.toml", LIGHT),
    "long option": (f"fpsolve run --{'a' * 10**5} case.toml", LIGHT),
    "no JIT": ("NUMBA_DISABLE_JIT=1 fpsolve simulate case.toml", LIGHT),
    "no home": ("MPLCONFIGDIR=/proc/none NUMBA_CACHE_DIR=/proc/none HOME=/proc/none fpsolve simulate case.toml", LIGHT),
    "Chinese": (RUN, LIGHT.replace("A test", "\\u632f\\u52a8")),
}
"""By their names the words of the command, and what its file holds, which is the last of them."""


def write(name: str, folder: Path) -> None:
    """Make the files of an input."""
    words, content = HOSTILE[name]
    for file, each in (words.split()[-1], content), (name, MATRICES.get(name, "")):
        path = folder / file.replace("/", "")
        each(path) if callable(each) else path.write_text(each, encoding="latin-1")


def hostile(name: str) -> str:
    """What is wrong with how a command ends, what it costs, and what it says; nothing where it is right."""
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
    told = f"{wrong} (exit {run.returncode}, {seconds:.1f} s): {said[:300]} ... {said[300:][-300:]}"
    return f"{name}: {told}" if wrong else ""


# Calls of the public functions with odd arguments

ROTATION, SHEAR = ((0.0, 1.0), (-1.0, 0.0)), ((0.0, 0.0), (-1.0, 0.0))
PACKAGE = str(Path(fpsolve.__file__).parent)
FUNCTIONS = [
    *(lambda x: x, np.sin, lambda x: np.zeros(3), lambda x: np.zeros((2, *np.shape(x))), lambda x: None, lambda: 1.0),
    *(lambda x: "x", lambda x: np.full(np.shape(x), np.nan), lambda x: x + 1j, lambda x: [[1.0], [2.0]]),
]
NO_PATHS = [
    *("", "x", "1", "1.0", b"1", "a\x1b", None, object(), int, ...),
    *(
        [],
        [[]],
        [1, 2],
        [1.0, 2.0],
        [2.0, 1.0],
        [[1, 2], [3]],
        [True, 1.0],
        ["1", "2"],
        (),
        {},
        {"a": 1.0},
        {1},
        range(3),
    ),
    *([1.0] * 3, [1e300, -1e300], [[0.0, 1.0], [1.0, 0.0]], np.datetime64("2020-01-01"), Path("/nowhere/x")),
]
VALUES = [
    *(True, False, 0, 1, -1, 2, 0.5, -0.5, -0.0, 1e300, -1e300, 1e-300, 5e-324, 1e15, 1e16, 10**400, 1j),
    *(float("nan"), float("inf"), -float("inf"), np.float32(0.5), np.int64(2), Decimal("0.5"), Fraction(1, 2)),
    *(np.array(1.0), np.array([1.0, np.nan]), np.zeros((2, 2)), np.ma.masked, np.bool_(True)),
    *(*NO_PATHS, *FUNCTIONS),
]
OSCILLATOR = fpsolve.VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
OU = fpsolve.OrnsteinUhlenbeck(alpha=2.0, sigma=2.0)
NUMERICS = {"rtol": 1e-3, "mesh": None, "budget": Budget(unknowns=2000, seconds=2.0)}
FRAME = {"x": Axis("oscillator.omega", 0.8, 1.2), "y": Axis("oscillator.c1", -0.1, 0.1)}
PROBLEM = {"problem": Problem(OSCILLATOR, OU)}


def solved_plane(**options: Any) -> Any:
    """Λ(2) of a system of the plane, one term of which is made of the options."""
    system = fpsolve.PlaneSystem([CoefficientMatrix(0, ROTATION), CoefficientMatrix(**options)])
    return fpsolve.moment_lyapunov(Problem(system, OU), 2.0, **NUMERICS)


def solved_chain(**options: Any) -> Any:
    """λ with telegraph noise."""
    return fpsolve.lyapunov_exponent(Problem(OSCILLATOR, Telegraph(**options)), **NUMERICS)


def written_mesh(path: Any) -> None:
    """A mesh file at a path."""
    write_mesh(fpsolve.make_mesh(phi_cells=1, phi_degree=2, xi_cells=1, xi_degree=2), path)


def opened(places: Any) -> Any:
    """Results at places."""
    return fpsolve.open_results(places)


MESH = {"phi_cells": 2, "phi_degree": 3, "xi_cells": 2, "xi_degree": 3}
CALLS: dict[Callable[..., Any], Mapping[str, Any]] = {
    fpsolve.VibroImpactOscillator: {**kit.OSCILLATOR, "c2": 0.0, "c3": 0.0, "impact": "delta"},
    fpsolve.NonGaussianNoise: {"D0": 1.0, "tau0": 0.5, "r0": 0.95},
    fpsolve.OrnsteinUhlenbeck: {"alpha": 1.0, "sigma": 1.0},
    SineWiener: {"amplitude": 1.0, "sigma": 1.0},
    MarkovChain: {"states": [-1.0, 1.0], "rates": [[-1.0, 1.0], [1.0, -1.0]]},
    solved_chain: {"a": 0.5, "k": 1.0},
    CoefficientMatrix: {"order": 1, "matrix": SHEAR, "g": np.sin},
    solved_plane: {"order": 1, "matrix": SHEAR, "g": np.sin},
    Jump: {"phase": 1.5, "log_factor": -0.1, "leading": None},
    fpsolve.PlaneSystem: {"terms": [CoefficientMatrix(0, ROTATION)], "jumps": [Jump(1.5, -0.1)], "epsilon": 0.1},
    fpsolve.PlaneSystem.of_equations: {
        "variables": ("x", "v"),
        "drift": ("v", "-k*x - xi*x"),
        "parameters": {"k": 1.0},
        "noises": {"xi": "noise"},
        "walls": [{"at": "x = 0", "restitution": 0.8}],
    },
    Problem: {"system": OSCILLATOR, "noise": OU},
    PROBLEM["problem"].at: {"values": {"noise.sigma": 1.0}},
    Budget: {"unknowns": 2000, "seconds": 2.0},
    Axis: {"key": "oscillator.omega", "start": 0.5, "stop": 2.0, "scale": "linear", "at": (1.0,)},
    fpsolve.moment_lyapunov: {**PROBLEM, "p": [1.0, 2.0], **NUMERICS},
    fpsolve.lyapunov_exponent: {**PROBLEM, **NUMERICS},
    fpsolve.stability_index: {**PROBLEM, **NUMERICS},
    fpsolve.MomentLyapunovFunction: {**PROBLEM, "interval": (-1.0, 2.0), **NUMERICS},
    fpsolve.ExponentSolver: {**PROBLEM, **NUMERICS},
    fpsolve.make_mesh: {**MESH, "xi_min": -8.0, "xi_max": 8.0, "grading": 1.0},
    fpsolve.load_case: {"path": "case.toml", "overrides": ["oscillator.omega=2.0"]},
    opened: {"places": "out"},
    read_mesh: {"path": "mesh.vtu"},
    written_mesh: {"path": "mesh.vtu"},
    fpsolve.sensitivities: {**PROBLEM, "p": [1.0], **NUMERICS},
    fpsolve.boundary: {**PROBLEM, "target": "lyapunov_exponent = 0", **FRAME, "nodes": 2, "step": 0.05},
    fpsolve.prove: {**PROBLEM, "p": 2.0, "width": 1e-3},
    fpsolve.simulate: {
        **PROBLEM,
        "p": [1.0],
        "estimator": "direct",
        "paths": 64,
        "time": 20.0,
        "step": 0.05,
        "seed": 1,
    },
    fpsolve.run: {"case": "case.toml", "out": "out", "jobs": 1, "scheduler": "", "fresh": False},
}
"""Good arguments of each."""
HEAVY = 5
"""Of the last ones, which take seconds."""
CASE = kit.case_text('[moments]\np = [1.0]\n[output]\nquantities = ["moment"]\nfigure = false\n', "odd", {"D0": 0.1})


def called(function: Callable[..., Any], arguments: Mapping[str, Any]) -> str:
    """What is wrong with how a call ends; nothing where it returns, or raises a sentence of fpsolve."""
    try:
        with limited(), warnings.catch_warnings():
            warnings.simplefilter("error")
            function(**arguments)
    except (FpsolveError, ValueError, TypeError) as error:
        last, text = traceback.extract_tb(error.__traceback__)[-1], str(error)
        if not last.filename.startswith(PACKAGE) and "pathlib" not in last.filename:  # which names the kinds it takes
            return f"{type(error).__name__} of {last.filename}:{last.lineno}: {text}"
        has_lines = isinstance(error, FpsolveError) or type(error).__name__ == "ParameterError"  # one of each fault
        lines = text.split("\n") if has_lines else [text]
        if (
            not text
            or any(len(line) > 600 or "\n" in line for line in lines)
            or any(each in text for each in WRONG[:2])
        ):
            return f"{type(error).__name__} is no sentence ({last.filename}:{last.lineno}): {text[:300]}"
    except Hang:
        return "hangs"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def printed_by(call: Callable[[], str]) -> tuple[str, str]:
    """What a call returns, and what it prints, libraries in C included."""
    sys.stdout.flush()
    with tempfile.TemporaryFile() as file:
        kept = [os.dup(each) for each in (1, 2)]
        for each in (1, 2):
            os.dup2(file.fileno(), each)
        try:
            found = call()
        finally:
            sys.stdout.flush()
            for each, old in zip((1, 2), kept, strict=True):
                os.dup2(old, each)
                os.close(old)
        file.seek(0)
        return found, file.read().decode(errors="replace")


def calls(seed: int, functions: Sequence[Callable[..., Any]] = (*CALLS,)) -> str:
    """What goes wrong in a call of each with one or two odd arguments, in a folder of their own."""
    rng, found = random.Random(seed), []
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for function in functions:
            Path("case.toml").write_text(CASE, encoding="utf-8")
            odd, good = {}, CALLS[function]
            for key in rng.sample([*good], min(len(good), rng.choice([1, 1, 1, 2]))):
                is_file = function in (fpsolve.run, written_mesh) and key in ("out", "path")
                odd[key] = rng.choice(NO_PATHS if is_file else VALUES)
            said, text = printed_by(lambda function=function, odd=odd: called(function, {**CALLS[function], **odd}))
            if said or text:
                found.append(f"{function}({odd}): {said or 'prints'} {text[:300]}")
    return "\n".join(found)


# Texts with random faults

ODD = [
    *("0", "-1", "1e308", "5e-324", "nan", "inf", "-0.0", "true", '"x"', "[]", "{}", "1e400", "9" * 400, "0x10"),
    *("", "[[]]", "[1, 2]", "{ a = 1 }", "1979-05-27", "07:32:00", '"\\u0000"', "'''\n'''", "[\n1,\n]", "[{}]"),
    *("{ start = 0, stop = 1, num = 2 }", '{ start = 1, stop = 2, num = 3, scale = "log" }', "{ noise.D0 = [2] }"),
    *('["exact"]', '["moment", "moment"]', '"noise.D0"', '"lyapunov_exponent"', "[1e308, -1e308]"),
]
PIECES = [*"=[]\"'\n#,.", "[[expect]]", "[vary]", *"\x00\ufeffép", "where", "{"]
OTHER = ["0.05", "0.3", "0.7", "1.0", "1.2", "3.0", "-0.5", "20.0", "1e3", "1e-3", "1e-8", "1e8", "1e15", "0", "-1.0"]
RUNNING = 0.1
"""The share of the cases that have another number only."""
ROUND = 12
"""Runs of a seed."""
MUTATED = kit.case_text(
    '[moments]\np = [2.0]\nrtol = 1e-3\n[vary]\n"noise.D0" = [0.1, 0.5]\n[figure]\nx = "p"\ny = "moment"\n[output]\n'
    'quantities = ["moment", "lyapunov_exponent"]\neigenfunctions = []\nfigure = false\n'
    "[budget]\nunknowns = 3000\nseconds = 1.0\n",
    impact="delta",
)


def mutated(text: str, rng: random.Random) -> str:
    """A text with one to four faults."""
    for _ in range(rng.randint(1, 4)):
        lines = text.splitlines() or [""]
        i = rng.randrange(len(lines))
        line, at = lines[i], rng.randrange(len(lines[i]) + 1)
        lines[i : i + 1] = (
            lambda: [],
            lambda line=line, lines=lines: [rng.choice(lines), line],
            lambda line=line: [f"{line.partition('=')[0]}= {rng.choice(ODD)}"],
            lambda line=line, at=at: [line[:at] + rng.choice(PIECES) + line[at:]],
            lambda line=line, at=at: [line[:at] + line[at + rng.randint(1, 3) :]],
            lambda line=line: [line.replace("=", "= [") + " ]" * rng.randint(0, 1)],
            lambda line=line: ["".join(rng.sample(line, len(line)))],
        )[rng.randrange(7)]()
        text = "\n".join(lines) + "\n"
    return text


def with_another_number(text: str, rng: random.Random) -> str:
    """The text with one of its numbers exchanged, so that most cases run."""
    at = rng.choice([*re.finditer(r"(?<![\w.-])[\d.]+(?:e-?\d+)?(?!\w)", text)])
    return text[: at.start()] + rng.choice(OTHER) + text[at.end() :]


def ran(text: str) -> str:
    """What is wrong with a run of a case; nothing where it is refused, not converged, or solved."""
    with tempfile.TemporaryDirectory() as place:
        try:
            with limited():
                code, out, err, folder = kit.run(
                    Path(place), "run", "case.toml", "--out", "out", "--jobs", "1", "--fresh", case=text
                )
        except Hang:
            return "hangs"
        except Exception as error:
            return f"{type(error).__name__}: {error}"
        names = {path.name for path in folder.iterdir()}
    said = out + err
    faults = {
        f"exit code {code}": code not in (0, BAD_INPUT, NOT_CONVERGED),
        "says nothing": code and not err.strip(),
        "says what it must not": any(each in said for each in WRONG[:2]) or not said.replace("\n", "").isprintable(),
        f"writes {names}": not names <= {"case.toml", "out"} or (code == BAD_INPUT and "out" in names),
    }
    wrong = ", ".join(fault for fault, is_there in faults.items() if is_there)
    return f"{wrong}: {said[:600]}\n---- of:\n{text}" if wrong else ""


def cases(seed: int) -> str:
    """What goes wrong in some runs."""
    rng = random.Random(seed)
    drawn = [with_another_number if rng.random() < RUNNING else mutated for _ in range(ROUND)]
    return "\n".join(filter(None, [ran(make(MUTATED, rng)) for make in drawn]))


SOURCES: dict[str, tuple[Callable[[int], str], int]] = {
    "hostile": (lambda number: hostile([*HOSTILE][number]), len(HOSTILE)),
    "calls": (calls, 10),
    "cases": (cases, 250),
}


def main(words: Sequence[str]) -> int:
    """Print what goes wrong; 1 if anything does."""
    names, found = [*words[:1]] or [*SOURCES], 0
    for name in names:
        source, count = SOURCES[name]
        first, last = (int(each) for each in words[1:3] or (0, count - 1))
        for number in range(first, last + 1):
            if told := source(number):
                found += 1
                print(f"{name} {number}: {told}", flush=True)
        print(f"{name}: {last - first + 1} done")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
