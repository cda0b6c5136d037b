"""What is wanted of a system, as "stability_index = 1": how far a problem is from it, with the derivatives of that."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from fpsolve.analysis.scan import Sample
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.forced import stationary_moments
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Method, refuse
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.messages import Code, Message
from fpsolve.model.faults import shown
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, STABILITY_INDEX, Quantity, moment_at

EXAMPLES = '"lyapunov_exponent = 0", "moment(2) = 0", "stability_index = -1" or "square(x) = 0.01"'
STEP = 1e-4
"""Relative change of a parameter by which a mean square is differentiated."""
_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_TARGET = re.compile(
    rf"\s*(?:(lyapunov_exponent|stability_index)|moment\s*\(\s*{_NUMBER}\s*\)|square\s*\(\s*(\w+)\s*\))\s*=\s*{_NUMBER}\s*"
)


@dataclass(frozen=True)
class Target:
    """A quantity and the value that is wanted of it; F is by how much it is larger, of δ_p Λ(p)/p at the value.

    Of a mean square F = 1 − 2v/(⟨x²⟩ + v), from −1 to 1, which it is where Λ(2) ≥ 0 and ⟨x²⟩ is infinite.

    Attributes:
        kind: of the quantity.
        value: wanted.
        p: the order of the moment; 0 for the others, NaN for a mean square, which perturbation theory has not.
        variable: of which the mean square is.
    """

    kind: Literal["lyapunov_exponent", "moment", "stability_index", "square"]
    value: float = 0.0
    p: float = 0.0
    variable: str = ""

    @property
    def name(self) -> str:
        """The quantity as [[expect]] has it."""
        return f"response.{self.variable}_squared" if self.variable else self.kind

    @property
    def quantity(self) -> Quantity:
        """What has the value."""
        if self.kind == "moment":
            return moment_at(self.p)
        if self.variable:
            x = self.variable
            return Quantity(f"{x}_squared", f"⟨{x}²⟩", f"mean of {x}²", rf"$\langle {x}^2\rangle$", f"[{x}]²")
        return LYAPUNOV_EXPONENT if self.kind == "lyapunov_exponent" else STABILITY_INDEX

    @property
    def order(self) -> float:
        """The p at which Λ is solved: that of the moment, 0 for λ, 2 for a mean square, δ_p where Λ(p)/p must be 0."""
        return {"stability_index": self.value, "square": 2.0}.get(self.kind, self.p)

    @property
    def level(self) -> float:
        """What Λ(p), λ or, for a stability index, Λ(p)/p must be."""
        return 0.0 if self.kind == "stability_index" else self.value

    @property
    def symbol(self) -> str:
        """What F is of, as a sentence has it."""
        return f"Λ({self.value:g})/({self.value:g})" if self.kind == "stability_index" else self.quantity.symbol

    def at(self, value: float) -> float:
        """The quantity where F has a value; of δ_p Λ(p)/p."""
        if self.variable:
            return self.value * (2 / (1 - value) - 1) if value < 1 else math.inf
        return self.level + value

    def side(self, value: float) -> str:
        """What F of this sign means: Λ(2) < 0, δ_p > -1, as Λ(p)/p increases from −∞ through 0 at δ_p."""
        is_more = (value > 0) != (self.kind == "stability_index")
        return f"{self.quantity.symbol} {'>' if is_more else '<'} {self.value:g}"

    def __str__(self) -> str:
        """As it is written: "moment(2) = 0"."""
        of = self.variable or f"{self.p:g}"
        return f"{self.kind}{f'({of})' * (self.kind in ('moment', 'square'))} = {self.value:.10g}"

    @property
    def equation(self) -> str:
        """What holds: λ = 0, Λ(2) = 0, δ_p = -1."""
        return f"{self.quantity.symbol} = {self.value:.10g}"

    @property
    def latex(self) -> str:
        """`equation` in LaTeX, with dollars."""
        return f"${self.quantity.latex.strip('$')} = {self.value:g}$"


def target_of(text: str) -> Target:
    """What "stability_index = 1", "lyapunov_exponent = -0.01" or "moment(2) = 0" says. Raises `ValueError`."""
    found = _TARGET.fullmatch(text) if isinstance(text, str) else None
    if found is not None:
        kind, order, variable, value = found[1], float(found[2] or math.nan), found[3] or "", float(found[4]) + 0.0
        if math.isfinite(value) and (kind or (value > 0 if variable else order and math.isfinite(order))):
            return Target(kind or ("square" if variable else "moment"), value, 0.0 if kind else order, variable)  # type: ignore[arg-type]
    raise ValueError(
        f"got {shown(text)}; must be {EXAMPLES}, all numbers finite, the order of a moment not 0 and a mean square > 0"
    )


def is_none(reason: Message) -> bool:
    """Whether there is no F for a reason, and it is not only not resolved."""
    return reason.tells_of(Code.NO_PROBLEM) or reason.code in (Code.TAILS, Code.INFINITE_VARIANCE)


def said(failure: Exception) -> str:
    """What is wrong with the parameters of a problem, in one line."""
    if not isinstance(failure, ValidationError):
        return str(failure)
    texts = []
    for fault in failure.errors():
        text = str(fault.get("ctx", {}).get("error", fault["msg"]))
        texts.append(": ".join(filter(None, (".".join(map(str, fault["loc"])), text))))
    return "; ".join(texts)


class Distance:
    """F over some parameters θ, with ∂F/∂θ.

    Args:
        problem: with the values of all other parameters.
        target: what is wanted.
        keys: of the parameters.
        settings: of the solves, see `ExponentSolver`.

    Raises:
        NoSuchExponent: such problems have no such quantity.
    """

    def __init__(self, problem: Problem, target: Target, keys: Sequence[str], **settings: Any) -> None:
        self.problem, self.target, self.keys, self._settings = problem, target, tuple(keys), settings
        method = choose(problem)
        for p in {target.order, 0.0} if target.kind == "stability_index" else {target.order}:  # for its error
            if not method.has(p):
                refuse(method.reason(p))
        if target.variable not in ("", *problem.linear.states):
            raise FpsolveError(f"got {target}; must be of {', '.join(problem.linear.states)}")

    def at(self, theta: FloatArray) -> Problem:
        """The problem at θ. Raises `FpsolveError` where there is none."""
        try:
            return self.problem.at(dict(zip(self.keys, theta.tolist(), strict=True)))
        except ValueError as failure:
            raise FpsolveError(Message(Code.NO_PROBLEM, reason=said(failure))) from failure

    def method(self, theta: FloatArray) -> Method:
        """What solves F at θ."""
        return ExponentSolver(self.at(theta), **self._settings).method

    def __call__(self, theta: FloatArray) -> Sample:
        """F at θ, shape (n,). Raises `FpsolveError` where there is none."""
        if self.target.variable:
            steps = STEP * np.where(theta, np.abs(theta), 1.0)
            rises = [self._square(theta + each)[0] - self._square(theta - each)[0] for each in np.diag(steps)]
            value, error = self._square(theta)
            return Sample(theta, value, np.array(rises) / (2 * steps), error, 1.0)
        p, method = self.target.order, self.method(theta)
        refuse(method.reason(p))
        (value, error), slopes = method.ratio_alone(p), method.gradient(p, self.keys)
        scale, factor = method.scale(p) / abs(p) if p else method.scales.linear, self.target.p or 1.0
        size = abs(factor)
        return Sample(theta, factor * value - self.target.level, factor * slopes, size * error, size * scale)

    def _square(self, theta: FloatArray) -> tuple[float, float]:
        """F of a mean square, and its error."""
        try:
            moments = stationary_moments(self.at(theta), self._settings["rtol"])
        except FpsolveError as failure:
            if failure.message.code is Code.RESPONSE_UNSTABLE:
                return 1.0, 0.0
            raise
        row = self.problem.linear.states.index(self.target.variable)
        twice = 2 * self.target.value
        share = twice / (moments.square[row, row] + self.target.value)
        return 1 - share, share**2 * moments.errors[row, row] / twice

    def found(self, sample: Sample) -> Estimate:
        """The quantity at θ. Raises `NotConverged`."""
        value, error, scale = self.target.at(sample.value), sample.error, sample.scale
        if self.target.variable:
            error, scale = self.target.at(sample.value + error) - value, value
        if self.target.kind == "stability_index":
            ratio, slope, error = self.method(sample.at).ratio(self.target.value)
            value, error, scale = self.target.value - ratio / slope, error / slope, 1.0
        return Estimate(value, error, scale, quantity=self.target.quantity)
