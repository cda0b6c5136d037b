"""Plants defects in a copy of fpsolve, one at a time, and tells which quick test catches each.

    python -m tests.mutants --folder FOLDER [name ...]

FOLDER keeps the copy, which quick test runs which line (measured with pytest-cov, one folder of tests after the other),
and what was found, so that a run goes on where it was stopped. Use another folder when tests or fpsolve have changed.
For each defect the tests that run its line, or have its word in their names, run until one fails: first those that do
both, the quickest first. Where no test runs the line, as on import or in another process, all quick tests are tried.
"""

from __future__ import annotations

import argparse
import ast
import faulthandler
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import fpsolve

CHECKOUT, TESTS = Path(__file__).parents[1], Path(__file__).parent
ASIDE = ("benchmarks", "first")
"""Folders of tests that pytest passes over."""
MEASURED = (0, 1, 5)
"""Exit codes of a run that measures: all pass, some fail, which are passed over, or all are slow."""
HANGS = 300.0
"""Seconds after which one test hangs."""
ORDER = "FPSOLVE_MUTANTS"
"""Names a file with tests in their order; where it is not there, the seconds of those that pass are written to it."""
QUIET = ("-q", "--tb=no", "-rfE", "--import-mode=append", "-p", "no:cacheprovider", "-p", "tests.mutants")


class Defect(NamedTuple):
    """A text that a file of fpsolve has once, what is planted in its place, and a word in names of tests."""

    name: str
    file: str
    text: str
    instead: str
    word: str

    @property
    def key(self) -> str:
        """The first word of its name."""
        return self.name.partition(" ")[0]


DEFECTS: tuple[Defect, ...] = (
    Defect(
        "T1 effects of the next functions are subtracted",
        "exponent/moments.py",
        "return self.eigenvalue + sum(self.effects)",
        "return self.eigenvalue - sum(self.effects)",
        "moment",
    ),
    Defect(
        "T2 white noise adds 0.45 K²",
        "exponent/powers.py",
        "steady = steady + 0.5 * k @ k",
        "steady = steady + 0.45 * k @ k",
        "white",
    ),
    Defect(
        "T3 waves of an angle relax as k, not k²",
        "fem/circle.py",
        "np.diag(-0.5 * self.noise.sigma**2 * self._waves**2)",
        "np.diag(-0.5 * self.noise.sigma**2 * self._waves)",
        "bounded",
    ),
    Defect(
        "T4 a filter is damped half as much",
        "model/noises/filter.py",
        "self.omega * (2 * self.zeta * np.outer",
        "self.omega * (self.zeta * np.outer",
        "filter",
    ),
    Defect(
        "T5 two lags of white noise count once",
        "exponent/delays.py",
        "terms.append((1 if k == j else 2) * relaxed",
        "terms.append(1 * relaxed",
        "delay",
    ),
    Defect(
        "T6 noise does not relax between two delays",
        "exponent/delays.py",
        "relaxed = np.kron(expm(self.generator * self.unit * k), np.kron",
        "relaxed = np.kron(np.eye(len(self.generator)), np.kron",
        "delay",
    ),
    Defect(
        "T7 stationary moments are given where Λ(2) > 0",
        "exponent/forced.py",
        "if not growth.value < -growth.error:",
        "if not growth.value < math.inf:",
        "stationary",
    ),
    Defect(
        "T8 the covariance is the mean square",
        "exponent/forced.py",
        "self.square - np.outer(self.mean, self.mean)",
        "self.square",
        "stationary",
    ),
    Defect(
        "T9 S(2ω) counts twice in p² of Eq. (37)",
        "theory/perturbation.py",
        "at_rest / 2 * q.mean**2 + at_twice / 4 * q.amplitude**2",
        "at_rest / 2 * q.mean**2 + at_twice / 2 * q.amplitude**2",
        "perturbation",
    ),
    Defect(
        "T10 the mean of a noise is not in the drift of order 0",
        "theory/perturbation.py",
        "for term in system.terms if has_mean(problem) else ():",
        "for term in ():",
        "perturbation",
    ),
    Defect(
        "T11 T₁ turns back",
        "theory/perturbation.py",
        "/ (alpha - 2j * omega)",
        "/ (alpha + 2j * omega)",
        "perturbation",
    ),
    Defect(
        "T12 vectors of a moment need not settle",
        "exponent/rightmost.py",
        "and turned <= STILL",
        "and turned <= 1.0",
        "rightmost",
    ),
    Defect(
        "T14 a slope at the end of a range is of first order",
        "exponent/moments.py",
        "(polyfit(offsets[:k], values[:k], k - 1)[1] for k in (3, len(offsets)))",
        "(polyfit(offsets[:k], values[:k], k - 1)[1] for k in (2, 2))",
        "slope",
    ),
    Defect(
        "T15 moments close at a wall",
        "exponent/moments.py",
        "if any(wall.changes_state for wall in problem.linear.barriers):",
        "if problem.linear.stop:",
        "moment",
    ),
    Defect(
        "T16 effects of the next functions are left out",
        "exponent/moments.py",
        "effects.append(told[1])",
        "effects.append(0.0)",
        "moment",
    ),
    Defect(
        "T17 a harmonic load passes as weak noise",
        "theory/perturbation.py",
        "if loads := harmonic_loads(problem):",
        "if loads := ():",
        "harmonic",
    ),
    Defect(
        "T18 the note on Eq. (37) names the best p",
        "theory/perturbation.py",
        "int(np.argmax(shares)), np.min",
        "int(np.argmin(shares)), np.min",
        "perturbation",
    ),
    Defect(
        "N1 S(ω) of bounded noise has both peaks at ν",
        "model/noises/bounded.py",
        "for side in (1, -1)]",
        "for side in (1, 1)]",
        "bounded",
    ),
    Defect(
        "N3 the slope by the rate of a telegraph is twice as large",
        "model/noises/telegraph.py",
        "else NoiseDerivative(rates=FLIP)",
        "else NoiseDerivative(rates=((-2.0, 2.0), (2.0, -2.0)))",
        "telegraph",
    ),
    Defect(
        "N6 the size of ξ is not in its derivative by the amplitude",
        "model/noises/bounded.py",
        "return NoiseDerivative(1 / self.amplitude, log_scale=1 / self.amplitude)",
        "return NoiseDerivative(1 / self.amplitude)",
        "sensitivit",
    ),
    Defect(
        "L1 what moves a state is not balanced",
        "exponent/powers.py",
        "return np.sqrt(np.append(units, units[list(same)]))",
        "return np.ones(len(squares))",
        "delay",
    ),
    Defect(
        "L2 noise (7) without a kind is the reduced one",
        "case/kinds.py",
        '"noise": "non-gaussian"}',
        '"noise": "ou-reduction"}',
        "treatment",
    ),
    Defect(
        "L3 errors of the effects of several noises cancel",
        "exponent/moments.py",
        "return sum(map(abs, self.effects)) + self.rounding",
        "return abs(sum(self.effects)) + self.rounding",
        "moment",
    ),
    Defect(
        "L4 rounding by the condition of Λ is left out",
        "exponent/moments.py",
        "return ROUNDING * self.scale + sys.float_info.epsilon * self.equations.largest * condition",
        "return ROUNDING * self.scale",
        "moment",
    ),
    Defect(
        "L5 what lies beyond the interval of ξ is not in the error of λ",
        "exponent/elements.py",
        "return pair.derivative, change / (WIDER - 1) + lacked",
        "return pair.derivative, lacked",
        "tails",
    ),
    Defect(
        "L6 R^p is left out where the speed at a wall changes",
        "fem/phase.py",
        "of_p = OfMoment(0, ray.log_factor)\n",
        "of_p = OfMoment(0)\n",
        "sensitivit",
    ),
    Defect(
        "L7 the whole variance in place of half in a population",
        "simulation/estimators.py",
        "np.maximum(0.5 * variance + covariance, 0)",
        "np.maximum(variance + covariance, 0)",
        "simul",
    ),
    Defect(
        "L8 critical damping by the fit, not by the measured density",
        "solve/noise.py",
        "fitted[0] * (1 + fit.misfit[i].relative)",
        "fitted[0]",
        "noise",
    ),
    Defect("L9 g is 9.81 m/s²", "measured/signals.py", "gravity = 9.80665", "gravity = 9.81", "noise"),
    Defect(
        "L10 a verdict within its error is given",
        "measured/stability.py",
        "abs(self.value) > SURE * self.deviation",
        "self.value != 0",
        "noise",
    ),
    Defect("L11 a file of any size is read", "files.py", "if about.st_size > most:", "if about.st_size < 0:", "large"),
    Defect(
        "R1 point data are in another order than the points of a VTK file",
        "results/vtk.py",
        'values.ravel(order="F") for name',
        "values.ravel() for name",
        "vtk",
    ),
    Defect(
        "R2 a region tells λ as a moment",
        "analysis/regions.py",
        'elif target.kind == "lyapunov_exponent":',
        'elif target.kind != "lyapunov_exponent":',
        "region",
    ),
    Defect(
        "R3 an unreached δ_p is told as another quantity",
        "analysis/inverse.py",
        'if target.kind == "stability_index":',
        'if target.kind != "stability_index":',
        "design",
    ),
    Defect(
        "R4 the lower edges of a frame are outside of it",
        "analysis/continuation.py",
        "(at >= -BESIDE)",
        "(at >= +BESIDE)",
        "boundary",
    ),
    Defect(
        "R5 a value of a sweep is taken for a section",
        "case/keys.py",
        "if inner and section + name not in is_value and",
        "if inner or section + name not in is_value and",
        "vary",
    ),
    Defect(
        "R6 the unit of a named density is taken where --scale is stated",
        "commands/noise.py",
        "if stated.scale == 1.0 else stated.scale",
        "if stated.scale != 1.0 else stated.scale",
        "noise",
    ),
    Defect(
        "R7 a curve of few degrees is not taken",
        "exponent/solver.py",
        "if not parts:",
        "if parts:",
        "curve",
    ),
    Defect(
        "R8 derivatives of a curve by p lack the sign of a term",
        "exponent/curve.py",
        "p * slope + value, p * second",
        "p * slope - value, p * second",
        "curve",
    ),
    Defect(
        "R9 directions of four variables are those of three",
        "exponent/density.py",
        "return GRIDS[problem.dimension](",
        "return GRIDS[7 - problem.dimension](",
        "direction",
    ),
    Defect(
        "R10 a tilted rule of ξ lies on the other side",
        "fem/noise_axes.py",
        "Table(x + 2 * tilt,",
        "Table(x - 2 * tilt,",
        "slow",
    ),
    Defect(
        "R11 a slope by the size of bounded ξ has the wrong sign on elements",
        "fem/noise_axes.py",
        "own = 2 * (change.log_diffusion - change.log_scale) * self.matrix(None)",
        "own = 2 * (change.log_diffusion + change.log_scale) * self.matrix(None)",
        "sensitivit",
    ),
    Defect(
        "R12 a Kanai-Tajimi density has 4ζ²/r",
        "measured/named.py",
        "return 2 * S0 * (1 + damped) /",
        "return 2 * S0 * (1 + damped / r**2) /",
        "named",
    ),
    Defect(
        "R13 r₀ by the kurtosis has 10 for 5",
        "measured/fit.py",
        "a = (5 * kurtosis - 9) / (2 * (3 - kurtosis))",
        "a = (10 * kurtosis - 9) / (2 * (3 - kurtosis))",
        "record",
    ),
    Defect(
        "R14 the variance of noise (7) has 2/D₀",
        "model/noises/non_gaussian.py",
        "return 2 * self.D0 / (self.tau0 * bracket)",
        "return 2 / self.D0 / (self.tau0 * bracket)",
        "non_gaussian",
    ),
    Defect(
        "R15 the correlation time of a filter goes with ω",
        "model/noises/filter.py",
        "return max(self._overdamped, 1 / self.zeta) / self.omega",
        "return max(self._overdamped, 1 / self.zeta) * self.omega",
        "filter",
    ),
    Defect(
        "R16 the slope by the intensity of white noise divides",
        "model/noises/white.py",
        "by_s * driven + self.s * change,",
        "by_s / driven + self.s * change,",
        "white",
    ),
    Defect(
        "R17 cubic growth has e^(−2γ)",
        "nonlinear/operator.py",
        "lambda phi: terms.q(phi) * size(phi), one)",
        "lambda phi: terms.q(phi) / size(phi), one)",
        "cubic",
    ),
    Defect(
        "R19 a table in a terminal has no room between columns",
        "tell/terminal.py",
        "if sum(needed(i) + 3 for i in kept) + 1 <= self.width:",
        "if sum(needed(i) - 3 for i in kept) + 1 <= self.width:",
        "terminal",
    ),
    Defect(
        "R21 nodes see a line of the mesh from the wrong side",
        "exponent/density.py",
        "axis.at(psi - turned, cells - turned)",
        "axis.at(psi - turned, cells + turned)",
        "vtk",
    ),
    Defect(
        "R22 the trial function of a proof has the wrong mismatch",
        "proofs/search.py",
        "self.over_nu(delta - self.mismatch[j])",
        "self.over_nu(delta + self.mismatch[j])",
        "prove",
    ),
    Defect(
        "R23 L*H lacks the sign of the drift",
        "proofs/forms.py",
        "rest = rest + drift + drift.T +",
        "rest = rest - drift + drift.T +",
        "form",
    ),
    Defect(
        "R24 a number without an error has decimals of one",
        "tell/text.py",
        '    if error <= 0:\n        return f"{value:g}"',
        '    if error > 0:\n        return f"{value:g}"',
        "noise",
    ),
    Defect(
        "R25 a sign that an error leaves open counts as growth",
        "tell/numbers.py",
        "np.sign(value), 0.0)",
        "np.sign(value), 1.0)",
        "verdict",
    ),
    Defect(
        "R26 of two places the one with less growth counts",
        "simulation/estimators.py",
        "used = slice(int(gap > 0), None, 2)",
        "used = slice(int(gap <= 0), None, 2)",
        "simul",
    ),
    Defect(
        "R27 noise in the damping divides on cubic paths",
        "simulation/bounces.py",
        "(a[3] + xi * b[3] + c[7]",
        "(a[3] + xi / b[3] + c[7]",
        "cubic",
    ),
    Defect(
        "R28 a summary number that needs one ray is reported as missing",
        "solve/sets.py",
        "if job.numerics.is_stated or not message.tells_of",
        "if job.numerics.is_stated or message.tells_of",
        "study",
    ),
    Defect(
        "R29 a bound that was not tried is a failure",
        "solve/prove.py",
        "return all(each is None or each.is_met for each in (*(found",
        "return all(each is None and each.is_met for each in (*(found",
        "prove",
    ),
)
"""T and N of a trial, L that were found late, R drawn by a seed from lines that quick tests run."""


def lines_of(defect: Defect, source: str) -> tuple[int, int]:
    """The first and the last line of the innermost statement in which it is, of one with a body those of its head.

    Both are 0 where it runs on import alone, as then no test is known to run it.
    """
    before, found, _ = source.partition(defect.text)
    if source.count(defect.text) != 1:
        raise SystemExit(
            f"{defect.key}: fpsolve/{defect.file} has its text {source.count(defect.text)} times, not once"
        )
    first = before.count("\n") + 1
    last, spans, nodes = first + found.rstrip().count("\n"), [(0, 0)], [*ast.walk(ast.parse(source))]
    functions = [each for each in nodes if isinstance(each, ast.FunctionDef)]
    if not any(each.lineno <= first <= (each.end_lineno or 0) for each in functions):
        return 0, 0
    for node in nodes:
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            end = max(body[0].lineno - 1, node.lineno) if body else node.end_lineno or 0
            if node.lineno <= first <= end:
                spans.append((node.lineno, max(end, last)))
    return max(spans)


class Trial:
    """A copy of fpsolve, its quick tests, and what each of them runs.

    Args:
        folder: keeps them.
        processes: of the run that measures.
    """

    def __init__(self, folder: Path, processes: str) -> None:
        self.folder, self.original = folder.resolve(), Path(fpsolve.__file__).parent
        self.copy = self.folder / "copy" / "fpsolve"
        if not self.copy.exists():
            shutil.copytree(self.original, self.copy)
            for beside in ("cases", "meshes"):  # which fpsolve takes from there
                (self.copy.parent / beside).symlink_to(CHECKOUT / beside)
        for each in DEFECTS:  # of a run that was killed
            self.restore(each)
        self.seconds = dict[str, float]()
        for path in sorted({each.parent for each in TESTS.rglob("test_*.py")} - {*map(TESTS.joinpath, ASIDE)}):
            self.seconds |= self.measured(path, processes)
        from coverage import CoverageData

        self._data = [CoverageData(str(each)) for each in self.folder.glob("coverage-*")]
        for data in self._data:
            data.read()

    def measured(self, path: Path, processes: str) -> dict[str, float]:
        """The seconds of the tests of a folder that pass; which lines they run is written beside these, once."""
        name = ".".join(["tests", *path.relative_to(TESTS).parts])
        seconds, files = self.folder / f"seconds-{name}.json", [str(each) for each in sorted(path.glob("test_*.py"))]
        if not seconds.exists():
            alone = ("--dist", "no") if processes == "0" else ()  # else pytest-cov names no test
            coverage = (f"--cov={self.copy}", "--cov-context=test", "--cov-report=", "-n", processes, *alone)
            unfinished, data = self.folder / "unfinished", self.folder / "unfinished.coverage"
            unfinished.unlink(missing_ok=True)
            output = self.folder / f"{name}.txt"
            if self.pytest(unfinished, output, *coverage, *files, COVERAGE_FILE=str(data)) not in MEASURED:
                raise SystemExit(f"{name}: the quick tests were not measured, see {output}")
            data.replace(self.folder / f"coverage-{name}")
            unfinished.replace(seconds)
        return json.loads(seconds.read_text(encoding="utf-8"))

    def restore(self, defect: Defect) -> str:
        """The text of a file as it was, with its time, by which compiled files are known; it is written, too."""
        shutil.copy2(self.original / defect.file, self.copy / defect.file)
        return (self.copy / defect.file).read_text(encoding="utf-8")

    def pytest(self, order: Path, output: Path, *arguments: str, **more: str) -> int:
        """The exit code of a run in a process of its own, which imports the copy."""
        path = os.pathsep.join([str(self.copy.parent), str(CHECKOUT), os.environ.get("PYTHONPATH", "")])
        own = {"PYTHONPATH": path, "PYTHONSAFEPATH": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        own |= {ORDER: str(order), **more}
        command = [sys.executable, "-m", "pytest", *QUIET, *arguments]
        with output.open("w", encoding="utf-8") as file:
            run = subprocess.Popen(
                command, cwd=CHECKOUT, env=os.environ | own, stdout=file, stderr=file, start_new_session=True
            )
            try:
                return run.wait()
            finally:
                if run.poll() is None:
                    os.killpg(run.pid, signal.SIGKILL)

    def tests_of(self, defect: Defect, source: str) -> list[str]:
        """Those to run, in their order."""
        first, last = lines_of(defect, source)
        found = [data.contexts_by_lineno(str(self.copy / defect.file)) for data in self._data]
        beside, own = set[str](), set[str]()
        for line, contexts in (item for each in found for item in each.items()):
            names = {each.rpartition("|")[0] for each in contexts} & self.seconds.keys()
            beside |= names
            own |= names if first <= line <= last else set()

        def place(name: str) -> tuple[bool, bool, bool, float]:
            has_word = defect.word in name.lower()
            return not (has_word and name in own), name not in own, name not in beside, self.seconds[name]

        return sorted(
            (name for name in self.seconds if not own or name in own or defect.word in name.lower()), key=place
        )

    def planted(self, defect: Defect) -> dict[str, Any]:
        """What became of a defect: whether it was caught, by what, and in how many seconds."""
        source, path = self.restore(defect), self.copy / defect.file
        order, output = self.folder / "order.txt", self.folder / f"{defect.key}.txt"
        tests = self.tests_of(defect, source)
        order.write_text("\n".join(tests), encoding="utf-8")
        about, start = path.stat(), time.monotonic()
        try:
            path.write_text(source.replace(defect.text, defect.instead), encoding="utf-8")
            later = about.st_mtime_ns + (1 + DEFECTS.index(defect)) * 1_000_000_000
            os.utime(path, ns=(later, later))
            files = sorted({name.partition("::")[0] for name in tests})
            code = self.pytest(order, output, "-x", *files, PYTHONDONTWRITEBYTECODE="1")
        finally:
            self.restore(defect)
        told = output.read_text(encoding="utf-8", errors="replace")
        failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", told, re.MULTILINE)
        if failed:
            by = failed[1]
        elif code == 1:
            by = f"hangs: {order.with_suffix('.now').read_text(encoding='utf-8')}"
        elif code == 0:
            by = ""
        elif "ImportError while loading" in told or "during collection" in told:
            by = "import"
        else:
            raise SystemExit(f"{defect.key}: pytest ended with {code}, see {output}")
        return {"caught": bool(by), "by": by, "seconds": round(time.monotonic() - start), "tests": len(tests)}


def table(found: Mapping[str, Mapping[str, Any]], defects: Sequence[Defect]) -> Iterator[str]:
    """The lines of a table in Markdown."""
    yield "| defect | file | caught | by | seconds | tests |"
    yield "|---|---|---|---|---:|---:|"
    for each in defects:
        if told := found.get(each.key):
            words = "caught" if told["caught"] else "**survived**"
            yield f"| {each.name} | {each.file} | {words} | {told['by']} | {told['seconds']} | {told['tests']} |"


def main() -> int:
    """The exit code: 1 where a defect survived."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__.partition("\n")[0])
    parser.add_argument("--folder", type=Path, required=True, help="where the copy, coverage and results are kept")
    parser.add_argument("-n", default="2", help="processes of the run that measures coverage")
    parser.add_argument(
        "names", nargs="*", help="first words of the names of defects, tried anew; all that are not known"
    )
    given = parser.parse_args()
    unknown = {*given.names} - {each.key for each in DEFECTS}
    if unknown:
        parser.error(f"no such defect: {', '.join(sorted(unknown))}")
    trial, results = Trial(given.folder, given.n), given.folder / "found.json"
    for each in DEFECTS:
        lines_of(each, trial.restore(each))
    found = json.loads(results.read_text(encoding="utf-8")) if results.exists() else {}
    chosen = [each for each in DEFECTS if not given.names or each.key in given.names]
    for each in chosen:
        if each.key not in found or given.names:
            found[each.key] = trial.planted(each)
            results.write_text(json.dumps(found, indent=1), encoding="utf-8")
            print(
                f"{each.name}: {'caught by ' + found[each.key]['by'] if found[each.key]['caught'] else 'SURVIVED'}",
                flush=True,
            )
    print("\n".join(table(found, chosen)))
    return int(not all(found[each.key]["caught"] for each in chosen))


# What follows is a plugin of the runs.
PASSED: dict[str, float] = {}


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The tests of a defect in their order."""
    order = Path(os.environ[ORDER])
    assert order.parent in Path(fpsolve.__file__).parents  # it is the copy
    if order.exists():
        place = {name: k for k, name in enumerate(order.read_text(encoding="utf-8").splitlines())}
        items[:] = sorted((each for each in items if each.nodeid in place), key=lambda each: place[each.nodeid])
        if len(items) < len(place):
            raise pytest.UsageError(f"{len(place) - len(items)} tests are gone; use another folder")


def pytest_runtest_logstart(nodeid: str) -> None:
    """End the run where a test hangs."""
    order = Path(os.environ[ORDER])
    if order.exists():
        order.with_suffix(".now").write_text(nodeid, encoding="utf-8")
        faulthandler.dump_traceback_later(HANGS, exit=True)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note how long each test takes that passes."""
    if report.when == "call" and report.passed:
        PASSED[report.nodeid] = report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write it, where a run notes it."""
    faulthandler.cancel_dump_traceback_later()
    order = Path(os.environ[ORDER])
    if not order.exists() and not hasattr(session.config, "workerinput"):
        order.write_text(json.dumps(PASSED), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
