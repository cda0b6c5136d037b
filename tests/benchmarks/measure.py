"""Time, memory and error of one method in one case, in an interpreter of its own.

`python -m tests.benchmarks.measure METHOD CASE [SIZE]` prints a `Measurement` as JSON. The time of a peer is that of
the assembly and of all p; the time of fpsolve is that of everything it does, error estimates and the choice of meshes
too. Imports are not timed.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve import ExponentSolver, Problem
from fpsolve.exponent import solve_moments
from tests.benchmarks import ngsolve_code
from tests.benchmarks.finite_volume import FiniteVolume
from tests.benchmarks.fourier_hermite import FourierHermite
from tests.benchmarks.ngsolve_code import NGSolveCode
from tests.benchmarks.problem import CASES, Case, FloatArray, Peer
from tests.benchmarks.references import REFERENCES
from tests.benchmarks.triangles import Triangles

PEERS: dict[str, type[Peer]] = {
    "fourier_hermite": FourierHermite,
    "triangles": Triangles,
    "ngsolve": NGSolveCode,
    "finite_volume": FiniteVolume,
}
METHODS = ("fpsolve", *PEERS)
SHORT, REPEATS = 5.0, 3
"""Runs shorter than this many seconds are repeated, and the shortest counts."""
_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Measurement:
    """What one run of one method gave.

    Attributes:
        error: largest |error|/max(|Λ|, scale) over the p of the case.
        seconds: of the curve, the best of the repeats.
        unknowns: of the largest eigenproblem.
        peak_mb: largest resident memory of the interpreter, 10⁶ bytes.
    """

    error: float
    seconds: float
    unknowns: int
    peak_mb: float


class MethodFailed(RuntimeError):
    """A method gave no curve: it raised, or ran out of time."""


def unavailable(method: str) -> str | None:
    """Why a method cannot be run here; None if it can."""
    return ngsolve_code.UNAVAILABLE if method == "ngsolve" else None


def measure(method: str, case: str, size: Any = None, timeout: float | None = None) -> Measurement:
    """Run a method in a fresh interpreter, at its tuned size or another one.

    Raises:
        MethodFailed: with the last line of what it printed.
    """
    command = [sys.executable, "-m", "tests.benchmarks.measure", method, case]
    if size is not None:
        command.append(json.dumps(size))
    try:
        done = subprocess.run(command, cwd=_ROOT, capture_output=True, text=True, timeout=timeout)
    except subprocess.TimeoutExpired as failure:
        raise MethodFailed(f"more than {timeout:g} s") from failure
    if done.returncode:
        raise MethodFailed((done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1])
    return Measurement(**json.loads(done.stdout.splitlines()[-1]))


def fpsolve_curve(case: Case) -> tuple[FloatArray, int]:
    """Λ at the p of the case by fpsolve, and the unknowns at the p of the largest size."""
    solver = ExponentSolver(Problem(case.oscillator, case.noise), rtol=case.rtol)
    result = solve_moments(solver, case.p)
    return result.value, max(solver.whole.known.items(), key=lambda each: abs(each[0]))[1].pair.generator.size


def peer_curve(method: str, case: Case, size: Any = None) -> tuple[FloatArray, int]:
    """Λ at the p of the case by a peer, and its unknowns."""
    solver = PEERS[method](case.problem, PEERS[method].tuned[case.name] if size is None else size)
    return solver.moments(case.p), solver.unknowns


def peak_memory() -> float:
    """Largest resident memory of this process, 10⁶ bytes.

    ru_maxrss of Linux also counts the process that started this one, so /proc is asked first.
    """
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def baseline() -> float:
    """Peak memory of an interpreter that has imported NumPy and the parts of SciPy that all methods use."""
    code = "import numpy, scipy.linalg, scipy.sparse.linalg; from pathlib import Path; "
    code += "print(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return int(done.stdout) * 1024 / 1e6


def _timed(curve: Callable[[], tuple[FloatArray, int]]) -> tuple[FloatArray, int, float]:
    times: list[float] = []
    while not times or (times[0] < SHORT and len(times) < REPEATS):
        start = time.perf_counter()
        value, unknowns = curve()
        times.append(time.perf_counter() - start)
    return value, unknowns, min(times)


def main(arguments: list[str]) -> None:
    """Measure in this process and print the result."""
    method, case = arguments[0], CASES[arguments[1]]
    size = json.loads(arguments[2]) if len(arguments) > 2 else None
    if method == "ngsolve":
        import ngsolve.meshes  # noqa: F401 — not timed
    if method == "fpsolve":
        value, unknowns, seconds = _timed(lambda: fpsolve_curve(case))
    else:
        value, unknowns, seconds = _timed(lambda: peer_curve(method, case, size))
    error = case.relative_error(np.asarray(value), REFERENCES[case.name])
    print(json.dumps(asdict(Measurement(error, seconds, unknowns, peak_memory()))))


if __name__ == "__main__":
    main(sys.argv[1:])
