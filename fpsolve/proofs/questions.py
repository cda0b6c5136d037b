"""What is asked of a problem: bounds on Λ(p), λ and δ_p that hold with certainty."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from fpsolve.arrays import real_number
from fpsolve.errors import NoHierarchy, NotConverged
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Budget
from fpsolve.exponent.root import nonzero_root
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model.problem import Problem
from fpsolve.proofs.certificate import NOTHING, Enclosure, enclosure_of, trivial
from fpsolve.proofs.forms import form_certificate
from fpsolve.proofs.search import Timer, enclose
from fpsolve.proofs.statement import LinearRecord, Statement, statement_of
from fpsolve.theory.perturbation import scale_of

SHARE = 1e-7
"""The width that is sought if none is given, as a share of the scale of what is bounded."""
BOUND = 0.5
"""Share of the seconds of a budget for one bound."""
GUESS_SHARE = 0.25
"""Of the time of a bound, for one of the two guesses of the number."""
INDEX_WIDTH, WIDENINGS = 1e-6, 4
"""The width sought for δ_p, and how often it is tried again with one ten times as large."""


@dataclass(frozen=True)
class StabilityIndexEnclosure:
    """Two p of one sign between which Λ changes its own, so that δ_p lies between them.

    Λ is convex and Λ(0) = 0, so that there is one such place at most.

    Attributes:
        lower, upper: around δ_p; infinite where nothing is proven.
        moments: the two p, and Λ of each.
    """

    lower: float
    upper: float
    moments: tuple[tuple[float, Enclosure], ...] = ()

    @property
    def is_proven(self) -> bool:
        """Whether there are bounds."""
        return bool(self.moments)


NO_INDEX = StabilityIndexEnclosure(-math.inf, math.inf)


def prove(
    problem: Problem,
    p: float,
    *,
    width: float | None = None,
    budget: Budget | None = None,
    progress: Callable[[], None] = lambda: None,
) -> Enclosure:
    """Bounds on Λ(p) that hold with certainty, for any system with coefficients a + bξ, and noise with r₀ ≤ 1.

    Of more than two variables they are of Λ(2) under white noise, from a quadratic form, see `fpsolve.proofs.forms`.

    They follow from a function T > 0 with λ₋ T ≤ L(p) T ≤ λ₊ T, Eq. (19), which is verified in ball arithmetic; neither
    the finite elements nor the eigenvalue iteration are trusted. See `fpsolve.proofs.verify` for the theorem.

    >>> oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.1, epsilon=0.1)
    >>> noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95)
    >>> found = prove(Problem(oscillator, noise), 2.0)
    >>> found.lower < 0.0142930811487 < found.upper  # the exact value, from the moment hierarchy
    True

    Args:
        problem: a motion and its noise. Bounds hold for the exact floats of the certificate: the matrices, ln R and the
            law of the noise. A phase of a jump within 1e-12 of a multiple of π/4 counts as that multiple. A coefficient
            that is a function counts as the a + bξ that its values show.
        p: order of the moment, as it stands.
        width: wanted upper − lower, in 1/time; 1e-7 of the scale of Λ(p) if None.
        budget: half of its `seconds` of the processor are for a bound, which may take a third more.
        progress: called after each trial function.

    Returns:
        The closest bounds that were found, maybe farther apart than wanted; infinite where nothing could be proven.

    Raises:
        NoSuchExponent: r₀ > 1 for Eq. (7) as it stands.
        TypeError: another noise, a chain of too many states, or a coefficient that is not a + bξ.
        ValueError: p is not finite, the width not positive, or the speed at a jump has no one sign.
        MissingFlint: python-flint is not installed.
    """
    return prove_bounds(problem, statement_of(problem), real_number(p, "p"), width, budget or Budget(), progress)


def prove_lyapunov_exponent(
    problem: Problem,
    *,
    width: float | None = None,
    budget: Budget | None = None,
    progress: Callable[[], None] = lambda: None,
) -> Enclosure:
    """Bounds on the largest Lyapunov exponent λ that hold for almost every path; as `prove`."""
    return prove_bounds(problem, statement_of(problem), None, width, budget or Budget(), progress)


def prove_stability_index(
    problem: Problem, *, budget: Budget | None = None, progress: Callable[[], None] = lambda: None
) -> StabilityIndexEnclosure:
    """Bounds on the stability index δ_p, from the signs of Λ beside it; as `prove`, but they may take twice as long."""
    return prove_index(problem, statement_of(problem), budget or Budget(), progress)


def check_width(width: float | None) -> None:
    """Refuse a width that is not a positive number."""
    if width is not None and not (math.isfinite(width) and width > 0):
        raise ValueError(f"got width = {width}; must be a positive number, such as 1e-9")


def prove_bounds(
    problem: Problem,
    stated: Statement | LinearRecord,
    p: float | None,
    width: float | None,
    budget: Budget,
    progress: Callable[[], None] = lambda: None,
) -> Enclosure:
    """Bounds on Λ(p), or on λ where p is None, within a share of the seconds of a budget."""
    timer, guess = Timer(BOUND * budget.seconds), None
    if p is not None and not math.isfinite(p):
        raise ValueError(f"got p = {p}; must be finite")
    check_width(width)
    if isinstance(stated, LinearRecord):
        return _of_second_moments(problem, stated, p, width)
    if p == 0:
        return trivial(stated)
    for rtol in (1e-8, 1e-3):  # what finite elements find, at a smaller accuracy if need be
        solver = ExponentSolver(problem, rtol=rtol, budget=replace(budget, seconds=GUESS_SHARE * timer.seconds))
        with suppress(NotConverged):
            guess = solver.lyapunov_exponent().value if p is None else solver.solution(p).pair.value
            break
    theory = scale_of(problem)
    scale = max(abs(guess or 0.0), float(theory.linear if p is None else theory.moment(p)))
    wanted = SHARE * scale if width is None else width
    is_hopeless = p is not None and guess is None
    found = NOTHING if is_hopeless else enclose(stated, p, wanted, guess or 0.0, timer, progress)
    return replace(found, wanted=wanted)


def _of_second_moments(problem: Problem, stated: LinearRecord, p: float | None, width: float | None) -> Enclosure:
    """Bounds on Λ(2) of more than two variables; nothing for other p, or where the form is not positive."""
    wanted = choose(problem).scale(2.0) * SHARE if width is None else width
    certificate = None
    if p == 2:
        with suppress(NoHierarchy):
            certificate = form_certificate(stated)
    return replace(NOTHING if certificate is None else enclosure_of(certificate), wanted=wanted)


def prove_index(
    problem: Problem, stated: Statement | LinearRecord, budget: Budget, progress: Callable[[], None] = lambda: None
) -> StabilityIndexEnclosure:
    """Bounds on δ_p; none where there is none, or where it is not found.

    They may take twice as long, as they need bounds at two p.
    """
    if isinstance(stated, LinearRecord):
        return NO_INDEX
    timer = Timer(2 * BOUND * budget.seconds)
    solver = ExponentSolver(problem, budget=replace(budget, seconds=GUESS_SHARE * timer.seconds))
    try:
        found = nonzero_root(solver)
        if not found:
            return NO_INDEX
        slope = abs(solver.solution(found.value).pair.derivative)
    except NotConverged:
        return NO_INDEX
    half = max(INDEX_WIDTH * max(1.0, abs(found.value)) / 2, 2 * found.error_estimate)
    for _ in range(WIDENINGS):
        if half < abs(found.value):
            low, high = (float(f"{found.value + sign * half:.12g}") for sign in (-1, 1))
            moments = []
            for left, p in ((2, low), (1, high)):  # for the first half of what is left
                seconds = (timer.seconds - timer.elapsed) / left
                if seconds <= 0:
                    return NO_INDEX
                most = replace(budget, seconds=seconds / BOUND)
                moments.append((p, prove_bounds(problem, stated, p, slope * half / 2, most, progress)))
                if not moments[-1][1].sign:  # the time is for wider ones
                    break
            if len(moments) == 2 and moments[0][1].sign * moments[1][1].sign < 0:
                return StabilityIndexEnclosure(low, high, tuple(moments))
        half *= 10
    return NO_INDEX
