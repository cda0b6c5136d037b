"""What a design wants, as "stability_index = 1", and how far a problem is from it, with the exact derivatives."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

from fpsolve.analysis.scan import Sample
from fpsolve.analysis.zero import Axis, Ratio, line_rtol, zero_of
from fpsolve.arrays import FloatArray, shown
from fpsolve.errors import FpsolveError
from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.error import Estimate
from fpsolve.messages import Message
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, STABILITY_INDEX, Quantity, moment_at

EXAMPLES = '"lyapunov_exponent = -0.01", "moment(2) = 0" or "stability_index = 1"'
_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_TARGET = re.compile(rf"\s*(?:(lyapunov_exponent|stability_index)|moment\s*\(\s*{_NUMBER}\s*\))\s*=\s*{_NUMBER}\s*")


@dataclass(frozen=True)
class Target:
    """A quantity and the value that is wanted of it.

    Attributes:
        kind: of the quantity.
        value: wanted.
        p: the order of the moment; 0 for the others.
    """

    kind: Literal["lyapunov_exponent", "moment", "stability_index"]
    value: float
    p: float = 0.0

    @property
    def quantity(self) -> Quantity:
        """What has the value."""
        if self.kind == "moment":
            return moment_at(self.p)
        return LYAPUNOV_EXPONENT if self.kind == "lyapunov_exponent" else STABILITY_INDEX

    @property
    def order(self) -> float:
        """The p at which Λ is solved: that of the moment, 0 for λ, and δ_p where Λ(p)/p must be 0."""
        return self.value if self.kind == "stability_index" else self.p

    @property
    def level(self) -> float:
        """What Λ(p), λ or, for a stability index, Λ(p)/p must be."""
        return 0.0 if self.kind == "stability_index" else self.value

    def __str__(self) -> str:
        return f"{self.quantity.symbol} = {self.value:.10g}"


def target_of(text: str) -> Target:
    """What "stability_index = 1", "lyapunov_exponent = -0.01" or "moment(2) = 0" says. Raises `ValueError`."""
    found = _TARGET.fullmatch(text) if isinstance(text, str) else None
    if found is not None:
        name, order, value = found[1], found[2], float(found[3]) + 0.0
        with suppress(ValueError):
            p = zero_of({"moment": float(order)}).p if order else 0.0
            if math.isfinite(value):
                return Target(name or "moment", value, p)  # type: ignore[arg-type]
    raise ValueError(f"got {shown(text)}; must be {EXAMPLES}, all numbers finite and the order of a moment not 0")


class Distance:
    """F(θ): Λ(p) or λ less the value that is wanted, or Λ(p)/p at the wanted δ_p; with ∂F/∂θ.

    Λ(p)/p increases with p and is 0 at δ_p. So F < 0 where δ_p is larger than wanted, and one p is solved for each θ.

    Args:
        problem: with the values of all other parameters.
        target: what is wanted.
        keys: of the parameters θ.
        budget: for a solve.
        progress: called after each solve.

    Attributes:
        ratio: Λ(p)/p, or λ.
        solves: how many there were.
        reasons: why F has no value where it was `tried`.
    """

    def __init__(
        self,
        problem: Problem,
        target: Target,
        keys: Sequence[str],
        budget: Budget,
        progress: Callable[[], None] = lambda: None,
    ) -> None:
        self.target, self._progress, self.solves = target, progress, 0
        zero = zero_of({"moment": target.order}) if target.order else zero_of("lyapunov_exponent")
        self.ratio = Ratio(problem, target.order, keys, budget, line_rtol(problem, zero))
        self._known, self.reasons = dict[tuple[float, ...], Sample | None](), list[Message]()

    @property
    def samples(self) -> list[Sample]:
        """F wherever it was `tried` and has a value."""
        return [each for each in self._known.values() if each is not None]

    def tried(self, theta: FloatArray) -> Sample | None:
        """F at θ, once; None where there is none."""
        key = tuple(theta.tolist())
        if key not in self._known:
            self._known[key] = None
            try:
                self._known[key] = self(theta)
            except FpsolveError as failure:
                self.reasons.append(failure.message)
        return self._known[key]

    def __call__(self, theta: FloatArray) -> Sample:
        """F at θ, shape (n,). Raises `FpsolveError` where there is none."""
        self.solves += 1
        try:
            found = self.ratio(theta)
        finally:
            self._progress()
        factor = self.target.order if self.target.kind == "moment" else 1.0
        value, scale = factor * found.value - self.target.level, max(abs(factor) * found.scale, 1e-300)
        return Sample(theta, value, factor * found.gradient, abs(factor) * found.error, scale)

    def found(self, sample: Sample) -> Estimate:
        """The quantity at θ. Raises `NotConverged`."""
        value, error, scale = self.target.level + sample.value, sample.error, sample.scale
        if self.target.kind == "stability_index":
            ratio, slope, error = self.ratio.solver(sample.at).ratio(self.target.value)
            value, error, scale = self.target.value - ratio / slope, error / slope, 1.0
        return Estimate(value, error, scale, quantity=self.target.quantity)


def start_and_stop(problem: Problem, key: str) -> Axis | None:
    """The range from half to twice the value of a parameter, within its range; None where the value is 0."""
    value, field = float(problem.values[key]), problem.parameters[key].field
    if value == 0:
        return None
    start, stop = sorted((0.5 * value, 2.0 * value))
    for limit in () if field is None else field.metadata:
        start = max(start, getattr(limit, "ge", start))
        stop = min(stop, getattr(limit, "le", stop), math.nextafter(getattr(limit, "lt", math.inf), -math.inf))
    return Axis(key, start, stop)
