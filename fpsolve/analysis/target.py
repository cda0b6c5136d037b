"""What is wanted of a system, as "stability_index = 1": how far a problem is from it, with the exact derivatives."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import ValidationError

from fpsolve.analysis.scan import Sample
from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Method, refuse
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.messages import Code, Message
from fpsolve.model.faults import shown
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, STABILITY_INDEX, Quantity, moment_at

EXAMPLES = '"lyapunov_exponent = 0", "moment(2) = 0" or "stability_index = -1"'
_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_TARGET = re.compile(rf"\s*(?:(lyapunov_exponent|stability_index)|moment\s*\(\s*{_NUMBER}\s*\))\s*=\s*{_NUMBER}\s*")


@dataclass(frozen=True)
class Target:
    """A quantity and the value that is wanted of it; F is by how much it is larger, of δ_p Λ(p)/p at the value.

    Attributes:
        kind: of the quantity.
        value: wanted.
        p: the order of the moment; 0 for the others.
    """

    kind: Literal["lyapunov_exponent", "moment", "stability_index"]
    value: float = 0.0
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

    @property
    def symbol(self) -> str:
        """What F is of, as a sentence has it."""
        return f"Λ({self.value:g})/({self.value:g})" if self.kind == "stability_index" else self.quantity.symbol

    def side(self, value: float) -> str:
        """What F of this sign means: Λ(2) < 0, δ_p > -1, as Λ(p)/p increases from −∞ through 0 at δ_p."""
        is_more = (value > 0) != (self.kind == "stability_index")
        return f"{self.quantity.symbol} {'>' if is_more else '<'} {self.value:g}"

    def __str__(self) -> str:
        """As it is written: "moment(2) = 0"."""
        return f"{self.kind}{f'({self.p:g})' * (self.kind == 'moment')} = {self.value:.10g}"

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
        order, value = float(found[2] or math.nan), float(found[3]) + 0.0
        if math.isfinite(value) and (found[1] or (order and math.isfinite(order))):
            return Target(found[1] or "moment", value, 0.0 if found[1] else order)  # type: ignore[arg-type]
    raise ValueError(f"got {shown(text)}; must be {EXAMPLES}, all numbers finite and the order of a moment not 0")


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
        p, method = self.target.order, self.method(theta)
        refuse(method.reason(p))
        (value, error), slopes = method.ratio_alone(p), method.gradient(p, self.keys)
        scale, factor = method.scale(p) / abs(p) if p else method.scales.linear, self.target.p or 1.0
        size = abs(factor)
        return Sample(theta, factor * value - self.target.level, factor * slopes, size * error, size * scale)

    def found(self, sample: Sample) -> Estimate:
        """The quantity at θ. Raises `NotConverged`."""
        value, error, scale = self.target.level + sample.value, sample.error, sample.scale
        if self.target.kind == "stability_index":
            ratio, slope, error = self.method(sample.at).ratio(self.target.value)
            value, error, scale = self.target.value - ratio / slope, error / slope, 1.0
        return Estimate(value, error, scale, quantity=self.target.quantity)
