"""Λ(p) on an interval from few solves: L(p) among the eigenfunctions at some p and their derivatives (a reduced basis).

Λ(p) has branch points beside the real axis in strong noise, so that no polynomial over p converges. The eigenfunctions
vary smoothly. With V of T and T′, and W of T* and T*′, at some p, all on one space, the small pencil

    W L(p) Vᵀ x = Λ W M Vᵀ x

has Λ(p) and Λ′(p) at these p exactly, and elsewhere an error of the fourth order in the distance from them, as it is
the product of the errors of T and of T*. L(p) is an analytic function of p, also where a tilt moves the functions of ξ:
the small matrices are interpolated by polynomials.

With the residuals r = (L − Λ)T and s = (L − Λ)ᵀT* of what the small pencil has at p, and a node q next to it, what is
left is to first order −sᵀ(L_q − Λ_q)⁻¹r/⟨T*, T⟩. A node is added where that is largest beside what is allowed.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.budget import counted
from fpsolve.errors import NotConverged
from fpsolve.exponent.adapt import SMALL_P, UNSOLVED
from fpsolve.exponent.eigen import MOSTLY, PairDerivatives, PrincipalPair, principal_pair
from fpsolve.exponent.error import Solution
from fpsolve.exponent.starts import FREE_STAGES, Start, other_centers
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.factors import one_thread
from fpsolve.fem.generator import Generator
from fpsolve.fem.space import Space
from fpsolve.messages import Code, Message

if TYPE_CHECKING:
    from fpsolve.exponent.solver import ExponentSolver

DEGREES = (4, 6, 9, 13, 19, 31)
"""Degrees of the polynomials tried for the small matrices."""
INTERPOLATED = 1e-2
"""Share of the tolerance for the polynomials."""
WITHIN = 0.47
"""Share of a gap between two nodes where its error is looked at, and the next node is put: even p tell too little."""
BOTH_SIDES = (0.2, 0.8)
"""Shares of a gap where its error is looked at, too, unless it is hardly anything in the middle."""
HARDLY = 1e-2
"""Share of what is allowed up to which it is that."""
ELSEWHERE = 20.0
"""What may be left elsewhere in a gap, over that in the middle, where it is looked at there only."""
SAFE = 4.0
"""What is left, over its estimate to first order."""
SHARE = 0.4
"""Of the tolerance, or of the errors of the nodes of a given mesh, for what is left between the nodes."""
EVEN = 1e-2
"""Distance from an even p in which effects of the highest modes tell too little of the space."""
BESIDE = 0.97
"""A p next to it, over the even p."""
SURELY = 0.05
"""Share of the tolerance for the errors of two nodes up to which that of the space between them is not looked at."""
MOST_NODES = 40
"""Number of nodes of a basis."""
MOST_STEPS = 8
"""Number of steps of the iteration for the eigenvalues of small pencils."""
MOST_SPACES = 8
"""Number of times that the space of a basis is refined."""
MOST_STEPS = 8
"""Number of steps of the iteration for the eigenvalues of small pencils."""
AT_ONCE = 256
"""Number of p whose small pencils are solved together."""
OUTSIDE = 1e-3
"""Share of the distance of chord and tangents by which a value between two nodes may lie outside of both."""
_EPS = sys.float_info.epsilon


SPARE = 0.2
"""Share of the tolerance that a finer space is made for, so that it serves other p too."""
MUCH_MORE = 1.3
"""Factor of the unknowns beyond which p of both signs have spaces of their own, where one does not serve them all."""


class Unsuited(Exception):
    """No space serves all p of an interval, or slow noise carries a moment at several places."""


class _Finer(Exception):
    """A space does not serve a p; `space` should."""

    def __init__(self, space: Space) -> None:
        super().__init__()
        self.space = space


class Polynomials:
    """Polynomials on an interval by their values at points, those of Chebyshev, the one next to 0 moved there.

    Attributes:
        points: shape (n,).
        slopes: takes values at the points to those of the derivative there, shape (n, n).
    """

    def __init__(self, low: float, high: float, degree: int) -> None:
        n, self._unit = degree + 1, 0.25 * (high - low)
        self.points = 0.5 * (low + high) - 2 * self._unit * np.cos(np.pi * (np.arange(n) + 0.5) / n)
        if low <= 0 <= high:
            self.points[np.argmin(np.abs(self.points))] = 0.0
        gaps = (self.points[:, None] - self.points) / self._unit
        np.fill_diagonal(gaps, 1.0)
        self._weights = 1 / np.prod(gaps, axis=1)
        self.slopes = self._weights / self._weights[:, None] / (gaps * self._unit)
        np.fill_diagonal(self.slopes, 0.0)
        np.fill_diagonal(self.slopes, -self.slopes.sum(axis=1))

    def at(self, p: FloatArray) -> FloatArray:
        """The values at p of the polynomials that are 1 at one point and 0 at the others, shape (len(p), n)."""
        gaps = (p[:, None] - self.points) / self._unit
        is_point = gaps == 0
        gaps[is_point] = 1.0
        found = self._weights / gaps * np.prod(gaps, axis=1)[:, None]
        on_one = is_point.any(axis=1)
        found[on_one] = is_point[on_one]
        return np.asarray(found)


class Node(NamedTuple):
    """What was solved at one p.

    Attributes:
        pair, error: Λ(p), T and T*, and the estimate of its error.
        around: what solves with L − Λ, while nodes are added.
        x, y: T and T* by the vectors of the basis that there were.
    """

    pair: PrincipalPair
    error: float
    around: PairDerivatives | None
    x: FloatArray
    y: FloatArray


class Reduced(NamedTuple):
    """Eigenvalues of small pencils A − ΛG at some p, shape (n,), vectors, (n, size), shares, (n,), A and G."""

    value: FloatArray
    x: FloatArray
    y: FloatArray
    share: FloatArray
    a: FloatArray
    g: FloatArray


class Left(NamedTuple):
    """What is left between two nodes.

    Attributes:
        p: where it was looked at.
        error: its estimate.
        allowed: what may be left.
        of_space: the error of the space there; 0 where it is not known.
        nodes: how many there were.
    """

    p: float
    error: float
    allowed: float
    of_space: float
    nodes: int


class Curve(NamedTuple):
    """Λ(p), Λ′(p), the estimate of |error of Λ(p)|, and the part of it by the basis, each of shape (n,)."""

    value: FloatArray
    derivative: FloatArray
    error: FloatArray
    left: FloatArray


class Basis:
    """Λ(p) on an interval of p, for two variables, by the eigenfunctions at its nodes on one space.

    Args:
        solver: of the problem; its `whole` takes the pairs of the nodes.
        low, high: the interval.
        most: how many nodes there may be.

    Attributes:
        nodes: by their p.
        is_converged: whether what is left between them is within its share of the tolerance.

    Raises:
        Unsuited: see there.
        NotConverged: a node is not resolved, or not within the budget.
    """

    def __init__(self, solver: ExponentSolver, low: float, high: float, most: int) -> None:
        self.low, self.high, self._solver, self._has_zero = low, high, solver, low <= 0 <= high
        self.nodes: dict[float, Node] = {}
        self._lefts: dict[tuple[float, float], Left] = {}
        self._refinements = 0
        self._right: FloatArray = np.zeros((0, 0))
        self._dual: FloatArray = np.zeros((0, 0))
        outer, other = (low, high) if abs(low) > abs(high) else (high, low)
        inner = 0.0 if self._has_zero else other
        self._generator = solver.solution(outer).pair.generator
        with one_thread():
            self._begin(dict.fromkeys([inner, outer, inner + WITHIN * (outer - inner), other]))  # the first vector is 1
            self.is_converged = self._fill(most)
            self._rounding = self._bound()
        rate = max((node.error / abs(p) for p, node in self.nodes.items() if not _is_even(p)), default=0.0)
        for p, node in self.nodes.items():
            error = node.error
            if p and _is_even(p) and solver.mesh is None:
                is_sure = 0 < rate * abs(p) <= SURELY * solver.tolerance(p, node.pair.value)
                error = max(error, rate * abs(p)) if is_sure else self._error_beside(p)
            self.nodes[p] = node._replace(around=None, error=error)  # without factors

    # nodes

    def _fill(self, most: int) -> bool:
        """Add nodes where most is left, until that is allowed everywhere; what was left with fewer nodes is a bound."""
        while True:
            gaps = [*pairwise(sorted(self.nodes))]
            lefts = [self._lefts.get(gap) for gap in gaps]
            shares = [left.error / left.allowed if left else math.inf for left in lefts]
            low, high = gap = gaps[i := int(np.argmax(shares))]
            left = lefts[i]
            if left is not None and shares[i] <= 1:
                return True
            p = low + WITHIN * (high - low)
            try:
                if left is None or left.nodes < len(self.nodes):
                    found = self._left_at(p, gap)
                    if found.error <= HARDLY * found.allowed:
                        self._lefts[gap] = found._replace(error=ELSEWHERE * found.error)
                    elif found.error > found.allowed:
                        self._lefts[gap] = found
                    else:
                        others = (self._left_at(low + share * (high - low), gap) for share in BOTH_SIDES)
                        self._lefts[gap] = max([found, *others], key=lambda each: each.error / each.allowed)
                elif len(self.nodes) >= most:
                    return False
                else:
                    self._add(*self._solved(p := left.p))
                    self._lefts |= dict.fromkeys([(low, p), (p, high)], left._replace(of_space=0.0, nodes=0))
            except _Finer as finer:
                self._begin([*self.nodes, p], finer.space)

    def _begin(self, places: Iterable[float], space: Space | None = None) -> None:
        """Solve at some p, on a finer space if one is given, or on one that is finer still."""
        if space is not None:
            self._generator = Generator(self._solver.problem, space)
        self._generator.keeps_factors = self._solver.mesh is None
        try:
            solved = [self._solved(p) for p in places]
        except _Finer as finer:
            self._begin(places, finer.space)
        else:
            self.nodes.clear()
            for each in solved:
                self._add(*each)

    def _add(self, solution: Solution, around: PairDerivatives) -> None:
        """Take T, T′, T* and T*′ of a solution into the basis."""
        pair = solution.pair
        right, left = [pair.right if pair.p else pair.space.constant], [pair.left]
        if not self.nodes:
            self._sample(pair)
        row = (self._polynomials.at(np.array([pair.p])) @ self._polynomials.slopes)[0]
        for vectors, adjoint in ((right, False), (left, True)):
            of_l, of_m = self._images(vectors, adjoint)
            change = np.tensordot(row, of_l[:, 0] - pair.eigenvalue * of_m[:, 0], 1)
            source = pair.derivative * pair.space.weighed(vectors[0]) - change
            vectors.append(around.solve(source, adjoint=adjoint))
        self._extend(right, left)
        error = solution.error if pair.p else 0.0
        self.nodes[pair.p] = Node(pair, error, around, self._right @ pair.right, self._dual @ pair.left)

    def _solved(self, p: float) -> tuple[Solution, PairDerivatives]:
        """The solution on the space, and what solves with its factors.

        Raises:
            _Finer: the space does not serve.
        """
        solver, known = self._solver, self._solver.whole.known
        if solver.mesh is not None:
            return (found := solver.solution(p)), PairDerivatives(found.pair)
        starts: PrincipalPair | list[PrincipalPair] = [each.pair for each in known.values()]
        if p in known:
            starts = known[p].pair
        elif self.nodes:
            starts = self._lifted(p)
        if p not in known or known[p].pair.generator is not self._generator:
            with counted(solver.budget.countdown(f"Λ({p:g})")):
                try:
                    known[p] = Solution(principal_pair(self._generator, p, start=starts))
                except UNSOLVED as failure:
                    place = Start(solver.problem, self._generator.chosen).doubled(failure)
                    raise self._finer(place.space) from None
        found, around = known[p], PairDerivatives(known[p].pair)
        allowed = solver.tolerance(p, found.pair.value) if p else math.inf
        if self._has_zero and 0 < abs(p) < 1:
            allowed = min(allowed, abs(p) * solver.tolerance(SMALL_P, 0.0) / SMALL_P)
        if other_centers(found.pair):
            raise Unsuited
        return self._checked(found, allowed), around

    def _checked(self, found: Solution, allowed: float) -> Solution:
        """A solution on the space. Raises `_Finer` where its error is beyond what is allowed."""
        if math.isinf(allowed) or found.error <= allowed:
            return found
        place, most = Start(self._solver.problem, self._generator.chosen), self._solver.budget.unknowns
        raise self._finer(place.refined(found, SPARE * allowed, FREE_STAGES, most).space)

    def _finer(self, space: Space) -> _Finer:
        """What tells the next space. Raises `Unsuited` where that has too many unknowns."""
        most = self._solver.budget.unknowns
        if self.low < 0 < self.high:
            most = min(most, round(MUCH_MORE * self._generator.size))
        self._refinements += 1
        if space.size > most or self._refinements > MOST_SPACES:
            raise Unsuited
        return _Finer(space)

    def _lifted(self, p: float) -> PrincipalPair:
        """What the basis makes of the pair at p, to start from."""
        found, nearest = self._reduced(np.array([p])), min(self.nodes, key=lambda q: abs(q - p))
        norm = float(found.y[0] @ found.g[0] @ found.x[0])
        right, left = found.x[0] @ self._right, found.y[0] @ self._dual / (norm or 1.0)
        return replace(self.nodes[nearest].pair, p=p, right=right, left=left, generator=self._generator)

    # the small pencils

    def _extend(self, right: Sequence[FloatArray], left: Sequence[FloatArray]) -> None:
        """Add vectors to the basis, and what they make of L and M to the small matrices."""
        old = len(self._a[0])
        self._right, self._dual = orthonormal(self._right[:old], right), orthonormal(self._dual[:old], left)
        forward, backward = self._images(self._right[old:]), self._images(self._dual[old:], adjoint=True)
        for name, after, before in zip(("_a", "_g"), forward, backward, strict=True):
            rows = np.concatenate([getattr(self, name), before @ self._right[:old].T], axis=1)
            setattr(self, name, np.concatenate([rows, (after @ self._dual.T).swapaxes(1, 2)], axis=2))
        if self._has_zero:
            self._a[self._polynomials.points == 0, :, 0] = 0.0  # L(0) 1 = 0

    def _images(self, vectors: Sequence[FloatArray] | FloatArray, adjoint: bool = False) -> list[FloatArray]:
        """L and M, or their transposes, times some vectors, at each point of the polynomials."""
        tables = np.array(vectors).reshape(-1, *self._generator.chosen.shape)
        of_l = np.array([each.images(tables) for each in (self._adjoints if adjoint else self._matrices)])
        of_m = np.array([[space.weighed(each) for each in vectors] for space in self._spaces])
        count = len(self._matrices), len(vectors), -1
        return [of_l.reshape(count), np.broadcast_to(of_m, (*count[:2], of_m.shape[-1]))]

    def _sample(self, pair: PrincipalPair) -> None:
        """Polynomials of the least degree that L(p) and M(p) are, as far as Λ(p) depends on them, and both there."""
        generator, test = self._generator, self.low + 0.37 * (self.high - self.low)

        def images(matrix: KroneckerSum, space: Space) -> FloatArray:
            return np.concatenate([matrix @ pair.right, space.weighed(pair.right)])

        size = np.linalg.norm(pair.left) / abs(pair.left @ pair.space.weighed(pair.right))
        exact = images(generator.matrix(test), generator.space(test))
        for degree in DEGREES:
            self._polynomials = Polynomials(self.low, self.high, degree)
            points = self._polynomials.points.tolist()
            self._matrices, self._spaces = [generator.matrix(p) for p in points], [generator.space(p) for p in points]
            known = np.array([images(*each) for each in zip(self._matrices, self._spaces, strict=True)])
            off = float(np.linalg.norm(self._polynomials.at(np.array([test]))[0] @ known - exact))
            self._off = off * float(size) / abs(test)
            rounding = degree * _EPS * np.max(np.linalg.norm(known, axis=1))
            if off <= max(INTERPOLATED * self._solver.tolerance(test, 0.0) / size, rounding):
                break
        else:
            raise Unsuited
        weighed = np.array([space.weighed(pair.right) for space in self._spaces])
        if np.ptp(weighed, axis=0).max() <= _EPS * np.abs(weighed).max():  # M does not depend on p
            self._spaces = self._spaces[:1]
        self._adjoints = [each.T for each in self._matrices]
        self._a, self._g = np.zeros((2, len(self._matrices), 0, 0))
        self._right, self._dual = np.zeros((2, 0, generator.size))

    def _pencils(self, p: FloatArray, derivative: int = 0) -> tuple[FloatArray, FloatArray]:
        """The small matrices of the k-th derivatives of L and of M at each p, shape (n, size, size)."""
        rows = self._polynomials.at(p) @ np.linalg.matrix_power(self._polynomials.slopes, derivative)
        shape = p.size, len(self._right), len(self._right)
        a, g = ((rows @ each.reshape(len(each), -1)).reshape(shape) for each in (self._a, self._g))
        return a, g

    def _reduced(self, p: FloatArray) -> Reduced:
        """The pairs of the small pencils that continue those of the nodes on both sides, by a batched iteration."""
        places, size = sorted(self.nodes), len(self._right)
        nodes = [self.nodes[q] for q in places]
        at, values = np.array(places), np.array([node.pair.value for node in nodes])
        slopes = np.array([node.pair.derivative for node in nodes])
        of_nodes = [
            np.array([np.pad(each, (0, size - each.size)) for each in side])
            for side in zip(*[node[3:] for node in nodes], strict=True)
        ]
        i = np.clip(np.searchsorted(at, p) - 1, 0, max(at.size - 2, 0))
        j = np.minimum(i + 1, at.size - 1)
        gap = np.where(i == j, 1.0, at[j] - at[i])
        u = (p - at[i]) / gap
        value = values[i] * (1 + 2 * u) * (1 - u) ** 2 + values[j] * u * u * (3 - 2 * u)
        value += gap * u * (1 - u) * (slopes[i] * (1 - u) - slopes[j] * u)
        value = np.where(i == j, values[i] + slopes[i] * (p - at[i]), value)
        u = np.clip(u, 0, 1)[:, None]
        x, y = (each[i] * (1 - u) + each[j] * u for each in of_nodes)
        a, g = self._pencils(p)
        return Reduced(*eigenpairs(a, g, value, x, y), a, g)

    # errors

    def _left_at(self, p: float, gap: tuple[float, float]) -> Left:
        """What is left at a p between two nodes: all where its value is not between the chord and both tangents."""
        found = self._reduced(np.array([p]))
        (low, one), (high, other) = ((q, self.nodes[q].pair) for q in gap)
        value, chord = float(found.value[0]), one.value + (other.value - one.value) * (p - low) / (high - low)
        tangents = max(each.value + each.derivative * (p - each.p) for each in (one, other))
        slack = OUTSIDE * abs(chord - tangents)
        allowed = self._solver.tolerance(p, value)
        if self._solver.mesh is not None:
            allowed = max(allowed, *(self.nodes[q].error for q in gap))
        if not (tangents - slack <= value <= chord + slack and found.share[0] > MOSTLY):
            return Left(p, math.inf, SHARE * allowed, 0.0, len(self.nodes))
        right, left = found.x[0] @ self._right, found.y[0] @ self._dual
        matrix, space = self._generator.matrix(p).shifted(value), self._generator.space(p)
        nearest = self.nodes[min(self.nodes, key=lambda q: abs(q - p))].around
        assert nearest is not None
        change = nearest.solve(matrix @ right, refinements=2)
        norm, of_space = float(left @ space.weighed(right)), 0.0
        error = SAFE * abs(float((matrix.T @ left) @ change / norm))
        rate = max(node.error / abs(q) for q, node in self.nodes.items() if q)
        is_sure = rate * abs(p) <= SURELY * allowed or self._solver.mesh is not None
        if error <= SHARE * allowed and not is_sure:
            pair = replace(
                one, p=p, eigenvalue=value, right=right, left=left / norm, rounding=0.0, generator=self._generator
            )
            of_space = Solution(pair).error
            if 0.0 in gap:  # where Λ(p)/p is wanted
                allowed = min(allowed, abs(p) * self._solver.tolerance(SMALL_P, 0.0) / SMALL_P)
            error = math.inf if of_space > allowed else error  # what a node there shall tell
        return Left(p, error, SHARE * allowed, of_space, len(self.nodes))

    def _bound(self) -> FloatArray:
        """What rounding may change in an entry of the small matrix of L, at the largest |p|: shape (size, size)."""
        matrix = abs(self._generator.matrix(max(self.low, self.high, key=abs)))
        return _EPS * (np.abs(self._dual) @ np.array([matrix @ np.abs(each) for each in self._right]).T)

    def at(self, p: FloatArray) -> Curve:
        """Λ at p in the interval, shape (n,)."""
        value, x, y, share, _, g = self._reduced(p)
        if not np.all(share > MOSTLY):
            raise NotConverged(Message(Code.NO_FUNCTION, low=self.low, high=self.high))
        norm = form(y, g, x)
        a1, g1 = self._pencils(p, 1)
        derivative = (form(y, a1, x) - value * form(y, g1, x)) / norm
        rounded = np.abs(y)[:, None, :] @ self._rounding
        if self._has_zero:
            rounded[:, 0, 0] *= np.abs(p / max(self.low, self.high, key=abs))
        rounding = (rounded @ np.abs(x)[:, :, None])[:, 0, 0] / np.abs(norm)
        left, of_space = self._left_of(p), self._error_of_space(p)
        return Curve(value, derivative, left + rounding + np.abs(p) * self._off + of_space, left)

    def second_derivative(self, p: FloatArray) -> FloatArray:
        """Λ″ at p in the interval, shape (n,)."""
        value, x, y, _, _, g = found = self._reduced(p)
        (a1, g1), (a2, g2) = (self._pencils(p, k) for k in (1, 2))
        norm, rate = form(y, g, x), value[:, None, None]
        slope = (form(y, a1 - rate * g1, x) / norm)[:, None, None]
        change = a1 - rate * g1 - slope * g
        by_p = _bordered(found, -(change @ x[:, :, None])[:, :, 0])
        return np.asarray((form(y, a2 - rate * g2 - 2 * slope * g1, x) + 2 * form(y, change, by_p)) / norm)

    def _left_of(self, p: FloatArray) -> FloatArray:
        """What is left at p, by what is left between the same nodes; near 0 it falls faster than p."""
        gaps = [*pairwise(sorted(self.nodes))]
        lefts = [self._lefts.get(gap, Left(1.0, 0.0, 0.0, 0.0, 0)) for gap in gaps]
        i = np.clip(np.searchsorted([low for low, _ in gaps], p, side="right") - 1, 0, len(gaps) - 1)
        error, at = (np.array([getattr(left, name) for left in lefts])[i] for name in ("error", "p"))
        return np.asarray(
            error * np.where(np.array([0.0 in gap for gap in gaps])[i], np.minimum(1.0, np.abs(p / at)), 1.0)
        )

    def _error_beside(self, p: float) -> float:
        """The error of the space at a node of an even p, where T is too simple, by that at a p next to it."""
        near = BESIDE * p
        value, error = self._lifted(near), self.nodes[p].error
        found = self._reduced(np.array([near]))
        pair = replace(value, eigenvalue=float(found.value[0]), rounding=0.0)
        return max(error, Solution(pair).error / BESIDE)

    def _error_of_space(self, p: FloatArray) -> FloatArray:
        """By the larger error over |p| of the places on both sides."""
        lefts = [self._lefts[gap] for gap in pairwise(sorted(self.nodes)) if gap in self._lefts]
        errors = {left.p: left.of_space for left in lefts if left.of_space}
        errors |= {q: node.error for q, node in self.nodes.items()}
        places = np.array(sorted(q for q in errors if q))
        ratios = np.array([errors[q] / abs(q) for q in places.tolist()])
        i = np.searchsorted(places, p)[:, None] + np.array([-1, 0])
        return np.asarray(np.abs(p) * np.max(ratios[np.clip(i, 0, places.size - 1)], axis=1))


def bases(solver: ExponentSolver, low: float, high: float, most: int = MOST_NODES) -> tuple[Basis, ...]:
    """Λ(p) on an interval: one basis, or one for p < 0 and one for p > 0. Raises `NotConverged` where there is none."""
    if solver.problem.dimension == 2 and len(solver.classes) < 2:
        with suppress(Unsuited):
            return (Basis(solver, low, high, most),)
        with suppress(Unsuited):
            if low < 0 < high:
                return Basis(solver, low, 0.0, most), Basis(solver, 0.0, high, most)
    raise NotConverged(Message(Code.NO_FUNCTION, low=low, high=high))


def _is_even(p: float) -> bool:
    """Whether p is an even number, or next to one, also 0."""
    return abs(p - 2 * round(p / 2)) < EVEN


def orthonormal(known: FloatArray, new: Sequence[FloatArray]) -> FloatArray:
    """Orthonormal rows and further ones, made orthonormal to those before."""
    rows = known
    for each in new:
        for _ in range(2):
            each = each - (rows @ each) @ rows
            each = each / np.linalg.norm(each)
        rows = np.vstack([rows, each])
    return rows


def form(y: FloatArray, matrices: FloatArray, x: FloatArray) -> FloatArray:
    """yᵀAx for each of some matrices, shape (n,)."""
    return np.asarray((y[:, None, :] @ matrices @ x[:, :, None])[:, 0, 0])


def eigenpairs(
    a: FloatArray, g: FloatArray, value: FloatArray, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Eigenvalues of pencils A − ΛG next to what is given, both vectors, and the shares that these have in the given.

    The iteration is two-sided, and on all pencils at once. The share is that of a_i b_i ⟨y_i, x_i⟩ in ⟨y, x⟩, y and x
    being the sums of b_i y_i and of a_i x_i: 1 where a pair is what is given, and ½ where another one may be meant.
    """
    tiny, first, last_of = 4 * _EPS * np.max(np.abs(a), initial=0.0), x, y
    for _ in range(MOST_STEPS):
        shifted, last = a - (value + tiny)[:, None, None] * g, value
        try:
            x = np.linalg.solve(shifted, g @ x[:, :, None])[:, :, 0]
            y = np.linalg.solve(shifted.swapaxes(1, 2), g.swapaxes(1, 2) @ y[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:  # an eigenvalue to the last digit
            tiny *= 100
            continue
        x, y = (each / np.linalg.norm(each, axis=1)[:, None] for each in (x, y))
        value = form(y, a, x) / form(y, g, x)
        if np.all(np.abs(value - last) <= 1e-13 * np.max(np.abs(a), initial=0.0)):
            break
    share = form(last_of, g, x) * form(y, g, first) / (form(last_of, g, first) * form(y, g, x))
    return value, x, y, share


def _bordered(of: Reduced, sources: FloatArray) -> FloatArray:
    """x′ with (A − ΛG)x′ = f and yᵀGx′ = 0, where yᵀf = 0, for each p."""
    n, size = of.x.shape
    whole = np.zeros((n, size + 1, size + 1))
    whole[:, :size, :size] = of.a - of.value[:, None, None] * of.g
    whole[:, :size, size] = (of.g @ of.x[:, :, None])[:, :, 0]
    whole[:, size, :size] = (of.y[:, None, :] @ of.g)[:, 0]
    return np.asarray(np.linalg.solve(whole, np.pad(sources, ((0, 0), (0, 1)))[:, :, None])[:, :size, 0])
