"""Λ(p) of a problem that falls into parts: blocks of variables of which each drives later ones, or invariant rays.

Over a unit of time a block has x_i⁺ = Φ_i x_i + Σ R_ij x_j, with finite moments of all of these. So x_i is a sum of
what others drove at each time and Φ_i has carried on since, E‖Φ_i R_ij x_j‖^p ~ exp(Λ_i(p)(t − s) + Λ_j(p) s) at most,
and by Minkowski's inequality for p ≥ 1, or |a + b|^p ≤ |a|^p + |b|^p for p < 1, E‖x_i‖^p grows as the largest of these,
but for powers of t. It grows no slower: two starts that differ in x_i alone differ by Φ_i of that for ever, so that
E‖x‖^p of one of them grows as Λ_i(p). For p < 0 it depends on how the x_i grow together, and is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.eigen import PairDerivatives, PrincipalPair
from fpsolve.exponent.error import Absent, Estimate, InvariantClass, Moment
from fpsolve.exponent.method import (
    DIRECTIONS,
    PHASE_AND_NOISE,
    RTOL_BEYOND_PLANE,
    TINIEST_P,
    Along,
    Method,
    Pictures,
    Tolerance,
)
from fpsolve.exponent.subsystem import blocks_of, couples
from fpsolve.messages import Code, Message
from fpsolve.model.coordinates import framed
from fpsolve.model.problem import Problem


class Blocks(Method):
    """Λ(p), p ≥ 0, is the largest of the parts."""

    goes_on = False

    @cached_property
    def parts(self) -> tuple[Method, ...]:
        """The methods of the parts."""
        own = [Problem(block, self.problem.noise.driving(block)) for block in blocks_of(self.problem)]
        return tuple(self.choose(each, self.settings) for each in own)

    @property
    def usual_rtol(self) -> float:  # type: ignore[override]
        return max(0.0 if self._rays else RTOL_BEYOND_PLANE, *(part.usual_rtol for part in self.parts))

    @property
    def no_picture(self) -> str:  # type: ignore[override]
        return self.parts[0].no_picture

    @property
    def pictures(self) -> Pictures:  # type: ignore[override]
        return PHASE_AND_NOISE if self._rays else DIRECTIONS

    @property
    def is_quick(self) -> bool:  # type: ignore[override]
        return all(part.is_quick for part in self.parts)

    @property
    def by_moments(self) -> bool:  # type: ignore[override]
        return all(part.by_moments for part in self.parts)

    @property
    def is_function(self) -> bool:  # type: ignore[override]
        return len(self.parts) == 1 and self.parts[0].is_function

    def is_dear(self, p: float) -> bool:
        return any(part.is_dear(p) for part in self.parts)

    def line_rtol(self, p: float) -> float:
        return max(part.line_rtol(p) for part in self.parts)

    @property
    def _rays(self) -> tuple[float, ...]:
        return framed(self.problem).invariant_rays

    @property
    def ray(self) -> float | None:  # type: ignore[override]
        return self._rays[0] if self._rays else None

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parts as sentences have them: "(x, v)", "along the ray at phi = 1.5708"."""
        if not (rays := self._rays):
            return tuple(f"({', '.join(block.names)})" for block in blocks_of(self.problem))
        sides = [("along", phase) for phase in rays] + [("across", rays[0])]
        return tuple(f"{side} the ray at phi = {phase:.6g}" for side, phase in sides[: len(blocks_of(self.problem))])

    @property
    def interval(self) -> tuple[float, float]:
        low, high = super().interval
        return (0.0 if len(self.parts) > 1 and self.problem.is_driven else low), high

    @property
    def adapts(self) -> bool:  # type: ignore[override]
        return all(part.adapts for part in self.parts)

    @property
    def refused(self) -> Message:
        """Why Λ(p) for p < 0 is not computed."""
        return Message(Code.NEGATIVE_OF_SEVERAL, parts=self.names)

    def _parts_at(self, p: float) -> tuple[Method, ...]:
        """The parts of which Λ(p) is the largest. Raises `NotConverged` for p < 0."""
        if p < self.interval[0] - TINIEST_P:
            raise NotConverged(self.refused)
        return self.parts

    def leading(self, p: float, tolerance: Tolerance | None = None) -> tuple[Method, bool]:
        """The part whose Λ(p)/p is the largest, at p = 0 whose λ is, and whether it is so beyond the errors.

        Raises:
            NotConverged: that of a part is not resolved, or p < 0.
        """
        rates = [part.ratio_alone(p, tolerance) for part in self._parts_at(p)]
        first, *others = sorted(range(len(rates)), key=lambda k: -rates[k][0])
        value, error = rates[first]
        return self.parts[first], all(value - rates[k][0] > error + rates[k][1] for k in others)

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Any:
        return self.leading(p, tolerance)[0].solution(p, tolerance)

    def row(self, p: float) -> Moment:
        rows = [part.row(p) for part in self._parts_at(p)]
        if abs(p) < TINIEST_P:
            return max(rows, key=lambda row: row.derivative)
        best, beyond = max(row.value / p for row in rows), max(row.value / p + row.error / abs(p) for row in rows)
        return next(row for row in rows if row.value / p == best)._replace(error=abs(p) * (beyond - best))

    def pair(self, p: float) -> PrincipalPair:
        if self._rays:
            raise NotConverged(Message(Code.NO_EIGENFUNCTION, p=p, phase=self._rays[0]))
        raise NotConverged(Message(Code.NO_EIGENFUNCTION_OF_BLOCKS, p=p, blocks=self.names))

    def ratio_alone(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float]:
        rates = [part.ratio_alone(p, tolerance) for part in self._parts_at(p)]
        best, _ = max(rates)
        return best, max(value + error for value, error in rates) - best

    def ratio(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float, float]:
        value, slope, _ = self.leading(p, tolerance)[0].ratio(p, tolerance)
        return value, slope, self.ratio_alone(p, tolerance)[1]

    def slope_error(self, p: float) -> float:
        part, is_alone = self.leading(p)
        return float(np.max([each.slope_error(p) for each in ([part] if is_alone else self.parts)]))

    def held(self, p: float, along: Along) -> tuple[Method, Along]:
        for key, by in along.items():
            if self.closes(key):
                raise NotConverged(Message(Code.CLOSES_BLOCKS, key=key, value=by.theta))
        part, is_alone = self.leading(p)
        if not is_alone:
            raise NoSuchExponent(Message(Code.KINK, p=p or None))
        own = part.problem
        return part.held(p, {key: own.derivative(key) for key in along if key in own.differentiable})

    def closes(self, key: str) -> bool:
        section, _, name = key.rpartition(".")
        return section == self.problem.system.section and couples(blocks_of(self.problem), name)

    def variance_rate(self) -> Estimate:
        part, is_alone = self.leading(0.0)
        if not is_alone:
            raise NoSuchExponent(Message(Code.NO_COMMON_RATE, value=part.ratio_alone(0.0)[0]))
        return part.variance_rate()

    @cached_property
    def around_zero(self) -> PairDerivatives:
        return self.leading(0.0)[0].around_zero

    @cached_property
    def finer_around_zero(self) -> PairDerivatives:
        return self.leading(0.0)[0].finer_around_zero

    def by_part(self, p: FloatArray) -> tuple[InvariantClass, ...]:
        """λ and Λ(p) of each, for p < 0 too. Raises `NotConverged`."""
        found = list[InvariantClass]()
        for name, block, part in zip(self.names, blocks_of(self.problem), self.parts, strict=True):
            rows = np.array([part.row(point) for point in p.tolist()]).reshape(-1, len(Moment._fields))
            phase = (self._rays * 2)[len(found)] if self._rays else None
            variables = () if self._rays else block.names
            told = ", ".join(variables) or name
            found.append(InvariantClass(told, phase, variables, part.lyapunov_exponent(), p, rows[:, 0], rows[:, 3]))
        return tuple(found)

    def unseen(self) -> Message | None:
        return Message(Code.EXCURSION_RAY, phase=self._rays[0]) if self._rays else super().unseen()

    def index_of_parts(self, index: Callable[[Method], Estimate | Absent], nowhere: Absent) -> Estimate | Absent | None:
        """The least of theirs, as for p > 0 Λ(p) is the largest of them."""
        if len(self.parts) > 1 and self.lyapunov_exponent().value > 0:
            return Absent(self.refused)
        found = [index(part) for part in self.parts if part.problem.linear.driven_by]
        least = min((each for each in found if each), key=lambda each: each.value, default=nowhere)
        unknown = [each for each in found if not each and each.reason.code is Code.NO_ROOT_REACHED]
        beyond = {each.reason.data["high"]: each for each in unknown}  # where these may have one
        first = min(beyond, default=math.inf)
        return beyond[first] if first < (least.value if least else math.inf) else least
