"""Λ(p) of random systems beside that of an oracle: a line for each, with a count at the end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from fpsolve import ExponentSolver, Problem
from fpsolve.errors import FpsolveError


@dataclass(frozen=True)
class Comparison:
    """Λ(p) by the finite elements and by an oracle.

    Attributes:
        kind: what the noise is.
        p: order of the moment.
        value, stated: by the finite elements, and its error estimate.
        expected, doubt: by the oracle, and its change from fewer functions.
        shape: how many functions each axis has.
        seconds: of the processor, for the finite elements.
    """

    kind: str
    p: float
    value: float
    stated: float
    expected: float
    doubt: float
    shape: tuple[int, ...]
    seconds: float

    @property
    def off(self) -> float:
        return abs(self.value - self.expected)

    @property
    def is_within(self) -> bool:
        """Whether both agree within what they state."""
        return self.off <= self.stated + self.doubt

    def __str__(self) -> str:
        told = f"{self.value:14.10f} off {self.off:.1e} stated {self.stated:.1e} doubt {self.doubt:.1e}"
        return f"{self.kind:41} p = {self.p:g} {told} {self.shape} {self.seconds:.2f} s{' !' * (not self.is_within)}"


def comparison(
    kind: str, problem: Problem, oracle: Callable[[float], tuple[float, float]], p: float = 2.0, rtol: float = 1e-8
) -> Comparison:
    """Of a problem with an oracle, which gives two values near one, by fewer functions and by more.

    Raises:
        FpsolveError: the finite elements give none.
    """
    started = time.process_time()
    found = ExponentSolver(problem, rtol=rtol).solution(p)
    seconds, value = time.process_time() - started, found.pair.value
    coarse, fine = oracle(value)
    doubt = abs(fine - coarse) + 1e-12 * max(1.0, abs(fine))
    return Comparison(kind, p, value, found.error, fine, doubt, found.pair.space.shape, seconds)


def report(cases: Iterable[tuple[float, ...]], compare: Callable[..., Comparison]) -> None:
    """Print what each of the cases, a seed and other numbers, gives, and how many are beyond what is stated."""
    found, refused = list[Comparison](), 0
    for case in cases:
        try:
            each = compare(*case)
        except FpsolveError as failure:
            refused += 1
            print(f"{case[0]:4} refused: {failure}", flush=True)
            continue
        found.append(each)
        print(f"{case[0]:4} {each}", flush=True)
    beyond, longest = sum(not each.is_within for each in found), max((each.seconds for each in found), default=0.0)
    print(f"{beyond} of {len(found)} beyond what is stated, {refused} refused; the longest took {longest:.2f} s")
