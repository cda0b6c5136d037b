"""Λ(p) on an interval from few solves: L(p) among the eigenfunctions at some p and their derivatives (a reduced basis).

Λ(p) has branch points beside the real axis in strong noise, so that no polynomial over p converges. The eigenfunctions
vary smoothly. With V of T and T′, and W of T* and T*′, at some p, all on one space, the small pencil

    W L(p) Vᵀ x = Λ W M Vᵀ x

has Λ(p) and Λ′(p) at these p exactly, and elsewhere an error of the fourth order in the distance from them, as it is
the product of the errors of T and of T*. L(p) is an analytic function of p, also where a tilt moves the functions of ξ:
the small matrices are interpolated by polynomials.

With the residuals r = (L − Λ)T and s = (L − Λ)ᵀT* of what the small pencil has at p, and a node q next to it, what is
left is to first order −sᵀ(L − Λ)⁻¹r/⟨T*, T⟩, the inverse by that at q. A node is added where that is largest beside
what is allowed.

The space is that of the outermost p, refined until it serves Λ′(0), too, as Λ is small next to p = 0. A node that is
resolved is carried to a finer space as it is: with errors of T and of T*, that of Λ is their product. At p = 0 it is
solved anew, as Λ′ has the error of T* there.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import eigvals

from fpsolve.arrays import FloatArray
from fpsolve.budget import counted
from fpsolve.errors import NotConverged
from fpsolve.exponent.adapt import UNSOLVED
from fpsolve.exponent.eigen import MOSTLY, PairDerivatives, PrincipalPair, principal_pair
from fpsolve.exponent.error import Solution, effects_on
from fpsolve.exponent.starts import Start, other_centers
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.effects import ModeEffects
from fpsolve.fem.factors import one_thread
from fpsolve.fem.generator import SMALL_P, Generator
from fpsolve.fem.space import Space
from fpsolve.messages import Code, Message

if TYPE_CHECKING:
    from fpsolve.exponent.solver import ExponentSolver

DEGREES = (4, 6, 9, 13, 19, 31)
"""Degrees of the polynomials tried for the small matrices."""
INTERPOLATED = 1e-2
"""Share of the tolerance for the polynomials."""
FAR = 0.2
"""Distance from the points of the polynomials that is far enough to see their error."""
WITHIN = 0.47
"""Share of a gap between two nodes where its error is looked at, and the next node is put: even p tell too little."""
BOTH_SIDES = (0.2, 0.8)
"""Shares of a gap where its error is looked at, too, if the middle has little: it may be 50 times that there, as
where another eigenvalue of the small pencil passes."""
LEAST = 0.25
"""What is left there over the most, as it falls to the nodes."""
HOPELESS = 100.0
"""What is left over what is allowed from which on nodes elsewhere are not expected to suffice."""
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
FORESEEN = 1.5
"""Factor of the unknowns of a space up to which the highest modes tell what it lacks."""
GOAL = 0.01
"""Share of what is allowed that a finer space is made for, in each direction."""
NEARLY = 1e-6
"""Share of T′ in the last step of its refinement: T′ need not be more accurate."""
CORNER = 0.1
"""Distance of another eigenvalue, over that of both tangents at the nodes around, where they cross."""
MOST_NODES = 40
"""Number of nodes of a basis."""
MOST_SPACES = 8
"""Number of times that the space of a basis is refined."""
MOST_STEPS = 8
"""Number of steps of the iteration for the eigenvalues of small pencils."""
CONVERGED = 1e-13
"""Change of a value, over the small matrix, with which it ends."""
AT_ONCE = 256
"""Number of p whose small pencils are solved together."""
OUTSIDE = 1e-3
"""Share of the distance of chord and tangents by which a value between two nodes may lie outside of both."""
MUCH_MORE = 1.3
"""Factor of the unknowns beyond which p of both signs have spaces of their own, where one does not serve them all."""
NOTHING = np.zeros(0)
_EPS = sys.float_info.epsilon
Vectors = Sequence[FloatArray] | FloatArray
Demand = tuple[ModeEffects | None, ...]
"""The effects of the highest modes along each axis, over what is allowed."""


class Unsuited(Exception):
    """No space serves all p of an interval, or slow noise carries a moment at several places."""


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

    def distance(self, p: FloatArray) -> FloatArray:
        """The product of the distances from the points, about 2 at most: an interpolation errs in proportion to it."""
        return np.abs(np.prod((p[:, None] - self.points) / self._unit, axis=1))

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
        rate: that over |p|; at p = 0 that of Λ′.
        demand: of the space; nothing where it was solved on a space before.
        around: what solves with L − Λ, while nodes are added.
        right, left: T and T′, T* and T*′.
        remains: what is left at p itself, where these come from another space.
        x, y: T and T* by the vectors of the basis that there were.
    """

    pair: PrincipalPair
    error: float
    rate: float
    demand: Demand
    around: PairDerivatives | None
    right: Vectors
    left: Vectors
    remains: float = 0.0
    x: FloatArray = NOTHING
    y: FloatArray = NOTHING


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
        nodes: how many there were.
    """

    p: float
    error: float
    allowed: float
    nodes: int


class Curve(NamedTuple):
    """Λ(p), Λ′(p), the estimate of |error of Λ(p)|, and its part by the basis at most, each of shape (n,)."""

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
        self._rates: dict[float, float] = {}
        self._right = self._dual = np.zeros((0, 0))
        self._degree = 0
        outer, other = (low, high) if abs(low) > abs(high) else (high, low)
        inner = 0.0 if self._has_zero else other
        self._middle: float | None = inner + WITHIN * (outer - inner)
        self._near, self._spaces_left, self._most = solver.solution(outer).pair, MOST_SPACES, solver.budget.unknowns
        self._generator = self._near.generator
        self._generator.keeps_factors = solver.mesh is None
        if low < 0 < high and solver.mesh is None:
            self._most = min(self._most, round(MUCH_MORE * self._generator.size))
            if not solver.whole.tilt_fits(self._generator.chosen, other):
                raise Unsuited
        with one_thread():
            for p in dict.fromkeys([*[0.0] * self._has_zero, outer, other]):  # the first vector is 1
                self._solve(p)
            self.is_converged = self._fill(most)
            self._refuse_corners()
            self._rounding = self._bound()
            carried = [p for p, node in self.nodes.items() if not node.demand and solver.mesh is None]
            remains = {p: self._left_by(self._lifted(p)[0]) for p in carried}
        rate = max((node.rate for p, node in self.nodes.items() if not _is_even(p)), default=0.0)
        for p, node in self.nodes.items():
            error = node.error
            if p and _is_even(p) and solver.mesh is None:
                is_sure = 0 < rate * abs(p) <= SURELY * solver.tolerance(p, node.pair.value)
                error = max(error, rate * abs(p)) if is_sure else self._error_beside(p)
            rate_of = error / abs(p) if p else node.rate
            left = remains.get(p, 0.0)
            self.nodes[p] = node._replace(error=error, rate=rate_of, remains=left, around=None, right=(), left=())

    # nodes

    def _fill(self, most: int) -> bool:
        """Add nodes where most is left, until that is allowed everywhere with all of them."""
        while True:
            gaps = [*pairwise(sorted(self.nodes))]
            lefts = [self._lefts.get(gap) for gap in gaps]
            shares = [left.error / left.allowed if left else math.inf for left in lefts]
            low, high = gap = gaps[i := int(np.argmax(shares))]
            left = lefts[i]
            if left is not None and shares[i] <= 1:  # with more nodes elsewhere more may be left
                stale = [gap for gap in gaps if self._lefts[gap].nodes < len(self.nodes)]
                if not stale:
                    return True
                for each in stale:
                    del self._lefts[each]
                continue
            if left is None or left.nodes < (len(self.nodes) if shares[i] <= HOPELESS else 1):
                near, far = sorted(gap, key=abs)
                found = self._left_at(near + WITHIN * (far - near), gap)
                if found.error <= found.allowed:
                    others = (self._left_at(low + share * (high - low), gap) for share in BOTH_SIDES)
                    found = max([found, *others], key=lambda each: each.error / each.allowed)
                self._lefts[gap] = found
            elif len(self.nodes) >= most:
                return False
            else:
                self._solve(left.p)
                self._lefts |= dict.fromkeys([(low, left.p), (left.p, high)], left._replace(nodes=0))

    def _solve(self, p: float) -> None:
        """Make a p a node: take T, T′, T* and T*′ there into the basis, on a finer space where this one does not serve.

        Raises:
            Unsuited: see there.
        """
        solution = self._solution(p)
        pair, error, around, demand = solution.pair, solution.error, PairDerivatives(solution.pair), Demand()
        if other_centers(pair):
            raise Unsuited
        if self._solver.mesh is None:
            effects = solution.effects
            if p == 0:  # those on Λ′, as T is 1
                effects = effects_on(pair, [(around.by_p, pair.left, self._generator.at(p).matrix)])
                error = sum(each.error for each in effects if each)
            demand = _demand(effects, allowed := self._allowed(p, pair.value))
            if not error <= allowed:
                if p and pair.rounding > allowed:
                    raise Unsuited
                self._refine(demand)
                return self._solve(p)
        if not self.nodes:
            self._sample(pair)
        right, left = [pair.right if p else pair.space.constant], [pair.left]
        row = (self._polynomials.at(np.array([p])) @ self._polynomials.slopes)[0]
        for vectors, adjoint in ((right, False), (left, True)):
            of_l, of_m = self._images(vectors, adjoint)
            change = np.tensordot(row, of_l[:, 0] - pair.eigenvalue * of_m[:, 0], 1)
            source = pair.derivative * pair.space.weighed(vectors[0]) - change
            vectors.append(around.solve(source, adjoint=adjoint, enough=NEARLY))
        rate = error / abs(p) if p else error if demand else 0.0
        return self._take(Node(pair, error if p else 0.0, rate, demand, around, right, left))

    def _take(self, node: Node) -> None:
        """Take the vectors of a node into the basis."""
        self._extend(node.right, node.left)
        x, y = self._right @ node.right[0], self._dual @ node.left[0]
        self.nodes[node.pair.p] = node._replace(x=x, y=y)

    def _allowed(self, p: float, value: float = 0.0) -> float:
        """The error that the space may have at a p; at p = 0 of Λ′."""
        return (1 - SHARE) * (self._solver.tolerance(p, value) if p else self._solver.tolerance(SMALL_P, 0.0) / SMALL_P)

    def _solution(self, p: float) -> Solution:
        """The solution on the space."""
        solver, known = self._solver, self._solver.whole.known
        if solver.mesh is not None:
            return solver.solution(p)
        if p not in known or known[p].pair.generator is not self._generator:
            start = known[p].pair if p in known else self._lifted(p)[0] if self.nodes else self._near
            if p == 0:
                start = replace(start, right=start.space.constant)
            with counted(solver.budget.countdown(f"Λ({p:g})")):
                try:
                    known[p] = Solution(principal_pair(self._generator, p, start=start))
                except UNSOLVED as failure:
                    place = Start(solver.problem, self._generator.chosen).doubled(failure)
                    self._go_to(place.generator)
                    return self._solution(p)
        return known[p]

    def _refine(self, demand: Demand) -> None:
        """Go to a space on which every cell should lack no more than its share of what a p and the nodes allow.

        Where the first space is far too small for that to be foreseen, that of a p in the middle may serve.
        """
        chosen = self._generator.chosen
        of_axes = zip(demand, *(node.demand for node in self.nodes.values() if node.demand), strict=True)
        most = [each[0] and replace(each[0], highest=np.max([of.highest for of in each], axis=0)) for each in of_axes]
        new = chosen.refined(most, GOAL, False)
        middle, self._middle = self._middle, None
        if middle is not None and not self.nodes and new.size > FORESEEN * chosen.size:
            pair = self._solver.solution(middle).pair
            if pair.generator.size > chosen.size:
                self._near = pair
                return self._go_to(pair.generator)
        return self._go_to(Generator(self._solver.problem, new if new.size > chosen.size else new.raised()))

    def _go_to(self, generator: Generator) -> None:
        """Carry the nodes to another space, but for p = 0, where T is known and T* must be exact.

        Raises:
            Unsuited: it has too many unknowns.
        """
        self._spaces_left -= 1
        if generator.size > self._most or not self._spaces_left:
            raise Unsuited
        nodes, old, self._generator = self.nodes, self._generator, generator
        generator.keeps_factors, self.nodes = True, {}
        self._rates.clear()
        for p, node in nodes.items():
            if p == 0:
                self._solve(p)
                continue
            carried = self._generator.space(p).carry(np.array([*node.right, *node.left]), old.space(p))
            right, left = np.split(carried, 2)
            pair = replace(node.pair, right=right[0], left=left[0], generator=self._generator)
            if not self.nodes:
                self._sample(pair)
            self._take(Node(pair, node.error, node.rate, (), PairDerivatives(pair), right, left))

    def _lifted(self, p: float) -> tuple[PrincipalPair, bool]:
        """What the basis makes of the pair at p, and whether it surely goes on from those of the nodes."""
        found, nearest = self._reduced(np.array([p])), min(self.nodes, key=lambda q: abs(q - p))
        norm = float(found.y[0] @ found.g[0] @ found.x[0])
        right, left = found.x[0] @ self._right, found.y[0] @ self._dual / (norm or 1.0)
        pair = replace(self.nodes[nearest].pair, p=p, eigenvalue=float(found.value[0]), right=right, left=left)
        return replace(pair, rounding=0.0, generator=self._generator), bool(found.share[0] > MOSTLY)

    # the small pencils

    def _extend(self, right: Vectors, left: Vectors) -> None:
        """Add vectors to the basis, and what they make of L and M to the small matrices."""
        old = len(self._a[0])
        self._right, self._dual = orthonormal(self._right[:old], right), orthonormal(self._dual[:old], left)
        forward, backward = self._images(self._right[old:]), self._images(self._dual[old:], adjoint=True)
        for name, after, before in zip(("_a", "_g"), forward, backward, strict=True):
            rows = np.concatenate([getattr(self, name), before @ self._right[:old].T], axis=1)
            setattr(self, name, np.concatenate([rows, (after @ self._dual.T).swapaxes(1, 2)], axis=2))
        if self._has_zero:
            self._a[self._polynomials.points == 0, :, 0] = 0.0  # L(0) 1 = 0

    def _images(self, vectors: Vectors, adjoint: bool = False) -> list[FloatArray]:
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
        for degree in DEGREES[self._degree :]:
            self._polynomials = Polynomials(self.low, self.high, degree)
            points = self._polynomials.points.tolist()
            self._matrices, self._spaces = [generator.matrix(p) for p in points], [generator.space(p) for p in points]
            known = np.array([images(*each) for each in zip(self._matrices, self._spaces, strict=True)])
            off = float(np.linalg.norm(self._polynomials.at(np.array([test]))[0] @ known - exact))
            rounding = degree * _EPS * np.max(np.linalg.norm(known, axis=1))
            self._degree = DEGREES.index(degree)
            if off <= max(INTERPOLATED * self._solver.tolerance(test, 0.0) / size, rounding):
                break
        else:
            raise Unsuited
        weighed = np.array([space.weighed(pair.right) for space in self._spaces])
        if np.ptp(weighed, axis=0).max() <= _EPS * np.abs(weighed).max():  # M does not depend on p
            self._spaces = self._spaces[:1]
        self._off, self._adjoints = 0.0, [each.T for each in self._matrices]
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
            for side in zip(*[node[-2:] for node in nodes], strict=True)
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

    def _refuse_corners(self) -> None:
        """Raise `Unsuited` where eigenvalues of other T cross between two nodes: the basis may lack one of both."""
        for one, other in pairwise(self.nodes[p] for p in sorted(self.nodes)):
            (low, high), jump = (one.pair, other.pair), other.pair.derivative - one.pair.derivative
            p = (low.value - low.derivative * low.p - high.value + high.derivative * high.p) / (jump or math.inf)
            if not low.p < p < high.p:
                continue
            found = self._reduced(np.array([p]))
            a, g = found.a[0], found.g[0]
            (x, y), (x_other, y_other) = (
                [np.pad(each, (0, len(g) - each.size)) for each in node[-2:]] for node in (one, other)
            )
            share = (y @ g @ x_other) * (y_other @ g @ x) / ((y @ g @ x) * (y_other @ g @ x_other))
            if share <= MOSTLY:
                gaps = np.sort(np.abs(eigvals(a, g) - found.value[0]))
                if gaps[1] <= CORNER * jump * min(p - low.p, high.p - p):
                    raise Unsuited

    # errors

    def _left_at(self, p: float, gap: tuple[float, float]) -> Left:
        """What is left at a p between two nodes: all where its value is not between the chord and both tangents."""
        pair, goes_on = self._lifted(p)
        (low, one), (high, other) = ((q, self.nodes[q].pair) for q in gap)
        value, chord = pair.eigenvalue, one.value + (other.value - one.value) * (p - low) / (high - low)
        tangents = max(each.value + each.derivative * (p - each.p) for each in (one, other))
        slack = OUTSIDE * abs(chord - tangents)
        allowed = self._solver.tolerance(p, value)
        if self._solver.mesh is not None:
            allowed = max(allowed, *(self.nodes[q].error for q in gap))
        if not (tangents - slack <= value <= chord + slack and goes_on):
            return Left(p, math.inf, SHARE * allowed, len(self.nodes))
        error = self._left_by(pair)
        is_sure = abs(p) * max(node.rate for node in self.nodes.values()) <= SURELY * allowed
        is_known = is_sure or self._solver.mesh is not None or any(low < q < high for q in self._rates)
        if error <= SHARE * allowed and not is_known:
            found, most = Solution(pair), self._allowed(p, value)
            if 0.0 in gap:  # where Λ(p)/p is wanted
                most = min(most, abs(p) * self._allowed(0.0))
            if not found.error <= most:
                self._refine(_demand(found.effects, most))
                return self._left_at(p, gap)
            if not _is_even(p):
                self._rates[p] = found.error / abs(p)
        return Left(p, error, SHARE * allowed, len(self.nodes))

    def _left_by(self, pair: PrincipalPair) -> float:
        """What is left by what the basis makes of a pair."""
        matrix = self._generator.matrix(pair.p).shifted(pair.eigenvalue)
        image = matrix @ pair.right
        off = abs(float(pair.left @ image)) / max(self._polynomials.distance(np.array([pair.p]))[0], FAR)
        self._off = max(self._off, SAFE * off)
        nearest = self.nodes[min(self.nodes, key=lambda q: abs(q - pair.p))].around
        assert nearest is not None
        return SAFE * left_over(nearest, image, matrix.T @ pair.left, lambda change: matrix @ change)

    def _bound(self) -> FloatArray:
        """What rounding may change in an entry of the small matrix of L and by it at the largest |p|, (size, size)."""
        matrix = abs(self._generator.matrix(max(self.low, self.high, key=abs)))
        return 2 * _EPS * (np.abs(self._dual) @ np.array([matrix @ np.abs(each) for each in self._right]).T)

    def at(self, p: FloatArray) -> Curve:
        """Λ at p in the interval, shape (n,)."""
        value, x, y, share, _, g = found = self._reduced(p)
        if not np.all(share > MOSTLY):
            raise NotConverged(Message(Code.NO_FUNCTION, low=self.low, high=self.high))
        norm = form(y, g, x)
        a1, g1 = self._pencils(p, 1)
        derivative = (form(y, a1, x) - value * form(y, g1, x)) / norm
        rounded = np.abs(y)[:, None, :] @ self._rounding * np.abs(self._polynomials.at(p)).sum(axis=1)[:, None, None]
        if self._has_zero:
            rounded[:, 0, 0] *= np.abs(p / max(self.low, self.high, key=abs))
        rounding = (rounded @ np.abs(x)[:, :, None])[:, 0, 0] / np.abs(norm)
        most, left = self._left_of(p, nearness(found))
        error = left + rounding + self._off * self._polynomials.distance(p) + self._error_of_space(p)
        return Curve(value, derivative, error, most)

    def second_derivative(self, p: FloatArray) -> FloatArray:
        """Λ″ at p in the interval, shape (n,)."""
        value, x, y, _, _, g = found = self._reduced(p)
        (a1, g1), (a2, g2) = (self._pencils(p, k) for k in (1, 2))
        norm, rate = form(y, g, x), value[:, None, None]
        slope = (form(y, a1 - rate * g1, x) / norm)[:, None, None]
        change = a1 - rate * g1 - slope * g
        source = np.pad(-(change @ x[:, :, None])[:, :, 0], ((0, 0), (0, 1)))
        by_p = np.asarray(np.linalg.solve(_bordered(found), source[:, :, None])[:, :-1, 0])
        return np.asarray((form(y, a2 - rate * g2 - 2 * slope * g1, x) + 2 * form(y, change, by_p)) / norm)

    def _left_of(self, p: FloatArray, near: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The most that is left between the nodes on both sides, and what is left at p.

        That falls as the fourth power of the distance from each node. One power less is counted, as it may be the most
        elsewhere than where it was looked at. Where another eigenvalue of the small pencil passes, it is as much larger
        as that is nearer. What is left at nodes of another space comes to it.
        """
        gaps, places = [*pairwise(sorted(self.nodes))], np.array(sorted(self.nodes))
        low, high = np.array(gaps).T
        lefts = [self._lefts.get(gap, Left(math.nan, 0.0, 0.0, 0)) for gap in gaps]
        error, at = (np.array([getattr(left, name) for left in lefts]) for name in ("error", "p"))
        at = np.where(np.isnan(at), 0.5 * (low + high), at)
        most = error / np.maximum((4 * (at - low) * (high - at) / (high - low) ** 2) ** 3, LEAST)
        i = np.clip(np.searchsorted(low, p, side="right") - 1, 0, low.size - 1)
        known, of_nodes = np.split(nearness(self._reduced(np.concatenate([at, places]))), [at.size])
        most = most[i] * np.maximum(1.0, near / known[i])
        remains = np.interp(p, places, [self.nodes[q].remains for q in places.tolist()])
        remains *= np.maximum(1.0, near / np.interp(p, places, of_nodes))
        return most + remains, most * (4 * (p - low[i]) * (high[i] - p) / (high[i] - low[i]) ** 2) ** 3 + remains

    def _error_beside(self, p: float) -> float:
        """The error of the space at a node of an even p, where T is too simple, by that at a p next to it."""
        return max(self.nodes[p].error, Solution(self._lifted(BESIDE * p)[0]).error / BESIDE)

    def _error_of_space(self, p: FloatArray) -> FloatArray:
        """By that over |p| of the places on both sides, which grows or falls exponentially."""
        rates = self._rates | {q: node.rate for q, node in self.nodes.items() if node.rate}
        places = np.array(sorted(rates))
        return np.asarray(np.abs(p) * np.exp(np.interp(p, places, np.log([rates[q] for q in places.tolist()]))))


def bases(solver: ExponentSolver, low: float, high: float, most: int = MOST_NODES) -> tuple[Basis, ...]:
    """Λ(p) on an interval: one basis, or one for p < 0 and one for p > 0. Raises `NotConverged` where there is none."""
    if solver.problem.dimension == 2 and len(solver.classes) < 2:
        with suppress(Unsuited):
            return (Basis(solver, low, high, most),)
        with suppress(Unsuited):
            if low < 0 < high:
                return Basis(solver, low, 0.0, most), Basis(solver, 0.0, high, most)
    raise NotConverged(Message(Code.NO_FUNCTION, low=low, high=high))


def _demand(effects: Sequence[ModeEffects | None], allowed: float) -> Demand:
    """The effects of the highest modes over what is allowed."""
    return tuple(each and replace(each, highest=each.highest / allowed) for each in effects)


def _is_even(p: float) -> bool:
    """Whether p is an even number, or next to one, also 0."""
    return abs(p - 2 * round(p / 2)) < EVEN


def left_over(node: PairDerivatives, r: FloatArray, s: FloatArray, image: Callable[[FloatArray], FloatArray]) -> float:
    """|sᵀ(L − Λ)⁻¹r| by the inverse at a node, or by one step more with L itself, whose images are given: the more.

    The first alone may be 20 times too small, where parts of it cancel that the inverse elsewhere has otherwise.
    """
    change = node.solve(r, refinements=1)
    better = change + node.solve(r - image(change), refinements=1)
    return max(abs(float(s @ change)), abs(float(s @ better)))


def orthonormal(known: FloatArray, new: Vectors) -> FloatArray:
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
    a: FloatArray, g: FloatArray, value: FloatArray, x: FloatArray, y: FloatArray, enough: float = CONVERGED
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Eigenvalues of pencils A − ΛG next to what is given, both vectors, and the shares that these have in the given.

    The iteration is two-sided, and on all pencils at once: its error becomes its third power. It ends with a change of
    this size, over A. The share is that of a_i b_i ⟨y_i, x_i⟩ in ⟨y, x⟩, y and x being the sums of b_i y_i and of
    a_i x_i: 1 where a pair is what is given, and ½ where another one may be meant.
    """
    size, first, last_of, tiny = np.max(np.abs(a), initial=0.0), x, y, 0.0
    value, x, y, own_a, own_g, go_on = value.copy(), x.copy(), y.copy(), a, g, np.arange(len(a))
    for _ in range(MOST_STEPS):
        last = value[go_on]
        shifted = own_a - (last + (4 * _EPS + tiny) * size)[:, None, None] * own_g
        try:
            new_x = np.linalg.solve(shifted, own_g @ x[go_on, :, None])[:, :, 0]
            new_y = np.linalg.solve(shifted.swapaxes(1, 2), own_g.swapaxes(1, 2) @ y[go_on, :, None])[:, :, 0]
        except np.linalg.LinAlgError:  # an eigenvalue to the last digit
            tiny = 100 * (4 * _EPS + tiny)
            continue
        new_x, new_y = (each / np.linalg.norm(each, axis=1)[:, None] for each in (new_x, new_y))
        x[go_on], y[go_on], value[go_on] = new_x, new_y, form(new_y, own_a, new_x) / form(new_y, own_g, new_x)
        moves = ~(np.abs(value[go_on] - last) <= enough * size)
        if not moves.any():
            break
        if not moves.all():
            go_on, own_a, own_g = go_on[moves], own_a[moves], own_g[moves]
    share = form(last_of, g, x) * form(y, g, first) / (form(last_of, g, first) * form(y, g, x))
    return value, x, y, share


def _bordered(of: Reduced) -> FloatArray:
    """A − ΛG with Gx below its columns and yᵀG beside its rows, which is regular where Λ is simple, for each p."""
    n, size = of.x.shape
    whole = np.zeros((n, size + 1, size + 1))
    whole[:, :size, :size] = of.a - of.value[:, None, None] * of.g
    whole[:, :size, size] = (of.g @ of.x[:, :, None])[:, :, 0]
    whole[:, size, :size] = (of.y[:, None, :] @ of.g)[:, 0]
    return whole


def nearness(of: Reduced) -> FloatArray:
    """How near another eigenvalue of the small pencil is, which may be no eigenvalue of L: ‖(A − ΛG)⁻¹‖ beside x."""
    return np.asarray(np.linalg.norm(np.linalg.inv(_bordered(of)), axis=(1, 2)))
