"""How the processor time grows with accuracy, with ε, with τ₀ and with the number of parameter sets.

`python docs/cost.py FOLDER [NAME …]` draws the figures `cost_accuracy`, `cost_epsilon` and `cost_tau`, which compare
fpsolve with Fourier-Hermite codes on one thread, and `cost_sets`, of fpsolve alone. The tuned code has a small size,
found with the answer known, at which its error is small enough; finding it is not timed. The certifying code follows
curves over p, so that it takes no part where there is one moment.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from fpsolve import NonGaussianNoise, Problem
from fpsolve.errors import NotConverged
from tests.benchmarks.certified import CertifiedFourierHermite
from tests.benchmarks.cpu import cpu_seconds, fpsolve_curve
from tests.benchmarks.fourier_hermite import FourierHermite
from tests.benchmarks.pages import shortest
from tests.benchmarks.problem import CASES, Case, FloatArray
from tests.benchmarks.references import REFERENCES
from tests.kit import case_text
from tests.oracles.perturbation import moment_scale

CODES = {"fpsolve": "o", "tuned": "s", "certified": "^"}
"""The contenders with their markers."""
ROUNDS = 2
SIZES = sorted(
    {(round(shape * n), n) for shape in (0.5, 1, 2) for n in (round(4 * 1.2**k) for k in range(20))},
    key=lambda size: (2 * size[0] + 1) * size[1],
)
"""Harmonics and Hermite functions that are tried, up to `MOST_UNKNOWNS`."""
MOST_UNKNOWNS, SHRINKING = 12_000, 0.87
FINER = 1e-3
"""Tolerance of a reference over that of what it judges."""
P, RTOL = 1.0, 1e-8
EPSILONS = np.geomspace(0.01, 2, 12)
TAUS = np.geomspace(0.01, 100, 13)
SETS = 2, 5, 20, 100, 400, 1200
SWEEP = """[moments]
p = [-1.0, 1.0, 2.0, 4.0]
rtol = {rtol}
[vary]
"noise.D0" = {{ start = 0.1, stop = 1.0, num = {count} }}
[output]
figure = false
eigenfunctions = []
"""


@dataclass(frozen=True)
class Curve:
    """What one line of a figure is about.

    Attributes:
        label: in the legend.
        x: the abscissae.
        cases: for each of them the problem, with its p and accuracy.
    """

    label: str
    x: Sequence[float]
    cases: Sequence[Case]


def over_accuracy() -> Iterator[Curve]:
    """33 moments, in weak and in strong noise."""
    for name, last in (("weak", 11), ("strong", 10)):
        rtols = [10.0**-digits for digits in range(4, last + 1)]
        yield Curve(f"{name} noise", rtols, [replace(CASES[name], rtol=rtol) for rtol in rtols])


def over_epsilon() -> Iterator[Curve]:
    """One moment, from weak to strong noise."""
    oscillator = CASES["weak"].oscillator
    cases = [_one(replace(oscillator, epsilon=float(epsilon)), CASES["weak"].noise) for epsilon in EPSILONS]
    yield Curve("", list(EPSILONS), cases)


def over_tau() -> Iterator[Curve]:
    """One moment, from fast to slow noise."""
    for name in ("weak", "strong"):
        noises = [NonGaussianNoise(D0=1.0, tau0=float(tau), r0=0.95).ou_reduction() for tau in TAUS]
        yield Curve(f"{name} noise", list(TAUS), [_one(CASES[name].oscillator, noise) for noise in noises])


def _one(oscillator: Any, noise: Any) -> Case:
    return Case("one", oscillator, noise, np.array([P]), RTOL)


def tuned_values(case: Case, size: tuple[int, int]) -> FloatArray:
    """Λ by the tuned code, that of one p from the right."""
    code = FourierHermite(case.problem, size)
    return np.array([code.moment(P)]) if case.p.size == 1 else code.moments(case.p)


def times(case: Case) -> dict[str, float]:
    """Seconds of each code; not a number for one that does not reach the accuracy within `MOST_UNKNOWNS`."""
    own = partial(fpsolve_curve, _problem(case), case.p, case.rtol)
    contenders: dict[str, Callable[[], FloatArray]] = {}
    with suppress(NotConverged):  # beyond the memory of a process
        own()
        contenders["fpsolve"] = own
    if (reference := _reference(case)) is not None and (size := tuned_size(case, reference)) is not None:
        contenders["tuned"] = lambda: tuned_values(case, size)
        if case.p.size > 1:
            allowed = partial(_allowed, case)
            contenders["certified"] = lambda: CertifiedFourierHermite(case.problem, allowed).moments(case.p)
    found = cpu_seconds(contenders, ROUNDS)
    return {code: found.get(code, math.nan) for code in CODES}


def _problem(case: Case) -> Problem:
    return Problem(case.oscillator, case.noise)


def _allowed(case: Case, p: float, value: float) -> float:
    return case.rtol * max(abs(value), float(moment_scale(case.oscillator, case.noise, p)))


def _reference(case: Case) -> FloatArray | None:
    """Known values, or those of fpsolve at a smaller tolerance; None where it does not reach it."""
    if case.name in REFERENCES:
        return REFERENCES[case.name]
    try:
        found = fpsolve_curve(_problem(case), case.p, max(FINER * case.rtol, 1e-11))
    except NotConverged:
        return None
    return found if found.size == case.p.size else None


def tuned_size(case: Case, reference: FloatArray) -> tuple[int, int] | None:
    """Harmonics and Hermite functions: the first that suffice, of which each then falls as far as it may."""

    def suffices(size: tuple[int, int]) -> bool:
        try:
            value = tuned_values(case, size)
        except (ArithmeticError, ValueError, RuntimeError):
            return False
        return case.relative_error(value, reference) <= case.rtol

    possible = (size for size in SIZES if (2 * size[0] + 1) * size[1] <= MOST_UNKNOWNS)
    size = next(filter(suffices, possible), None)
    if size is None:
        return None
    for axis in (0, 1):
        while (fewer := math.floor(SHRINKING * size[axis])) >= 2:
            smaller = (fewer, size[1]) if axis == 0 else (size[0], fewer)
            if not suffices(smaller):
                break
            size = smaller
    return size


FIGURES: Mapping[str, tuple[Callable[[], Iterator[Curve]], str, str]] = {
    "cost_accuracy": (over_accuracy, "relative accuracy", "33 moments"),
    "cost_epsilon": (over_epsilon, r"strength of the noise $\varepsilon$", r"$\Lambda(1)$ to $10^{-8}$"),
    "cost_tau": (over_tau, r"correlation time $\tau_0$ of the noise", r"$\Lambda(1)$ to $10^{-8}$"),
}


def draw(name: str, folder: Path) -> None:
    """Measure a figure, print its numbers, and write it."""
    curves, label, title = FIGURES[name]
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    for line, curve in zip(("-", "--"), curves(), strict=False):
        found = []
        for x, case in zip(curve.x, curve.cases, strict=True):
            found.append(times(case))
            numbers = ", ".join(f"{code} {1e3 * each:.3g} ms" for code, each in found[-1].items())
            print(f"{name} {curve.label} {x:.3g}: {numbers}", flush=True)
        for number, (code, marker) in enumerate(CODES.items()):
            own = [1e3 * each[code] for each in found]
            if np.all(np.isnan(own)):
                continue
            words = f"{code}, {curve.label}" if curve.label else code
            axes.plot(curve.x, own, line, color=f"C{number}", marker=marker, label=words)
    axes.set(xscale="log", yscale="log", xlabel=label, ylabel="processor time / ms", title=title)
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_locator(NullLocator())
    if name == "cost_accuracy":
        axes.invert_xaxis()
    axes.grid(visible=True, which="major", alpha=0.3)
    figure.legend(fontsize=8, loc="outside lower center", ncols=2)
    figure.savefig(folder / f"{name}.png", dpi=110)


def draw_sets(folder: Path) -> None:
    """The same for a command that solves many sets of four p, λ and δ_p, by one process."""
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    for number, (name, rtol) in enumerate((("weak", 1e-8), ("strong", 1e-6))):
        found = []
        for count in SETS:
            with tempfile.TemporaryDirectory() as place:
                (case := Path(place) / "sets.toml").write_text(
                    case_text(SWEEP.format(rtol=rtol, count=count), epsilon=CASES[name].oscillator.epsilon)
                )
                command = ["-m", "fpsolve", "run", str(case), "--out", place, "--jobs", "1"]
                found.append(shortest({"run": command}, 1)["run"])
            print(f"cost_sets {name} noise {count}: {found[-1]:.3g} s", flush=True)
        axes.plot(SETS, found, color=f"C{number}", marker="os"[number], label=f"{name} noise, rtol {rtol:g}")
    axes.set(xscale="log", yscale="log", xlabel="number of parameter sets", ylabel="processor time / s")
    axes.set_title(r"four $\Lambda(p)$, $\lambda$, $\delta_p$ of each set")
    axes.grid(visible=True, which="major", alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(folder / "cost_sets.png", dpi=110)


def main(folder: str, *names: str) -> None:
    """Draw the figures of these names, or all."""
    for name in names or (*FIGURES, "cost_sets"):
        draw_sets(Path(folder)) if name == "cost_sets" else draw(name, Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])
