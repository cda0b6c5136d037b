"""λ, or Λ(p), over one or two parameters from few solves: a reduced basis of eigenfunctions and their derivatives.

On one space, whose functions move with the parameters θ as the noise does, V holds T and ∂T/∂θ, and W holds T* and
∂T*/∂θ, at some θ, the nodes. Then W L(p; θ) Vᵀ x = Λ W M(θ) Vᵀ x has Λ(p) and its gradient at the nodes, and elsewhere
with an error of the fourth order in the distance from them. For p = 0, where T = 1, V holds 1, T′ and ∂T′/∂θ: with
yᵀW L(0; θ) Vᵀ = 0 and yᵀW M 1 = 1 there is λ = yᵀW L′(0; θ) 1, whose error is the product of those of T* and of T′.

L(p; θ), in the coordinates of one θ, is a sum of products of functions of θ and fixed operators: those at few θ make
all others. Where it is none, as where a speed changes its sign at a line between cells, there is no such surface.
What is left is estimated by both residuals and the inverse at a node, as over p, see `exponent.basis`. The small pencil
has other real eigenvalues, also with T > 0, mostly of larger residuals. On a grid all are looked at, and it is solved
where it is not clear which one is meant, or where it does not go on beside. Elsewhere pairs are followed from there.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lstsq, qr

from fpsolve.analysis.zero import Axis, said
from fpsolve.arrays import FloatArray, real_array, real_number, shown
from fpsolve.budget import counted
from fpsolve.data import Result, dataset
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.adapt import UNSOLVED, Budget
from fpsolve.exponent.basis import SAFE, SHARE, Polynomials, eigenpairs, form, left_over, orthonormal
from fpsolve.exponent.eigen import MOSTLY, PairDerivatives, PrincipalPair, principal_pair
from fpsolve.exponent.error import Solution
from fpsolve.exponent.solver import solver_of
from fpsolve.exponent.starts import FREE_STAGES, Start, other_centers
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.factors import one_thread
from fpsolve.fem.generator import SMALL_P, Generator
from fpsolve.fem.space import Space
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem, checked_problem, refuse_infinite
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, Quantity, moment_at
from fpsolve.theory.perturbation import scale_of

if TYPE_CHECKING:
    import xarray

DEGREES = (2, 4, 6, 9, 13, 19, 28, 40)
"""Degrees of the polynomials tried for the small matrices, along each parameter."""
INTERPOLATED = 1e-2
"""Share of the tolerance for these."""
PROBE = 0.37
"""Share of an axis at which it is looked at what they leave."""
PROBES = 4
"""Number of places at which it is looked at what products leave."""
ASIDE = 2, 6, 0
"""Numbers of lines along an axis that tell which points on it make all others, one after the other; by 0 all do."""
SEVERAL = 10.0
"""What is left aside, over what is left along an axis, at most."""
ROUNDED = 1e-13
"""Size of a further product, over that of the largest, up to which it is rounding."""
FOLLOWED = 13
"""Number of points along each parameter, ends included, at which all eigenvalues of the small pencil are judged. At
the ends and at every other one between it is looked at what is left."""
MOST_NODES = 60
"""Number of nodes of a surface."""
MIXED = 48
"""Number of random sums of the entries of a residual."""
LAGRANGE = -6.0, 2.0, -2.0, 6.0
"""Products of the distances of each of 0, 1, 2, 3 from the others."""
LEAST = 100.0
"""What a residual is at most, over those around."""
ALIKE = 3.0
"""Residual of a larger real eigenvalue, over the least, up to which either may be the principal one."""
SEEN = 128
"""Number of points, as likely as the noise is there, at which it is looked whether T > 0."""
NEGATIVE = 0.05
"""Share of T there that has the other sign, at most."""
NEXT_TO_NOTHING = 1e-6
"""A residual, over the distance of the eigenvalue from another one, with which it surely is one of L."""
SLIGHTLY = 1e-3
"""By how much that may be more than at the points of the grid around."""
FOLLOWING = 1e-8
"""Change of a value, over the small matrix, with which the iteration from these ends: the next is its third power."""
FEW = 10
"""Number of roundings in an entry of a product with L."""
BETWEEN = 2.0
"""What is left of F between the places that are looked at, over the most that is left there."""
SPARE = 0.2
"""Share of what is allowed that a finer space is made for, so that it serves other places, too."""
MOST_SPACES = 6
"""Number of spaces tried."""
NOTHING = 1e-11
"""Size of a derivative, over that of an eigenfunction, up to which it is rounding."""
SAME = 1e-9
"""Share of a function that others do not make, up to which it is rounding."""
SCALES = 5
"""Number of points along each parameter between which the size of the terms of F is interpolated."""
AT_ONCE = 512
"""Number of points that are evaluated together."""
_EPS = sys.float_info.epsilon


class Node(NamedTuple):
    """What was solved at a place of the unit square: T, T*, the error of F by the space, and this over the allowed."""

    at: FloatArray
    pair: PrincipalPair
    error: float
    share: float
    around: PairDerivatives | None


class Values(NamedTuple):
    """F and its gradient by shares of the axes if that is wanted, shape (n,) and (n, d); and the pairs that tell it.

    F is NaN where the pair does not go on from those that it was followed from.

    Attributes:
        x, y: both vectors, shape (n, size), with T > 0, |x| = 1 and ⟨y, x⟩ = 1.
        place: where the operators are, shape (n, axes of these).
        eigenvalue: there, shape (n,).
        unit: error of the eigenvalue over that of F, shape (n,).
    """

    value: FloatArray
    gradient: FloatArray
    x: FloatArray
    y: FloatArray
    place: FloatArray
    eigenvalue: FloatArray
    unit: FloatArray


class Products:
    """Functions on [0, 1] of few products, known at as few points.

    Args:
        polynomials: that follow them.
        known: the functions at the points of these, shape (points, functions); by the identity all points are kept.

    Attributes:
        points: that make all others.
    """

    def __init__(self, polynomials: Polynomials, known: FloatArray) -> None:
        _, r, order = qr(known.T, mode="economic", pivoting=True)
        sizes = np.abs(np.diag(r))
        chosen = order[: np.count_nonzero(sizes > ROUNDED * sizes[0])]
        self.points, self._polynomials = polynomials.points[chosen], polynomials
        self._shares = lstsq(known[chosen].T, known.T)[0].T

    def at(self, u: FloatArray, derivative: int = 0) -> FloatArray:
        """What the functions at u, or their derivatives, are of those at the points, shape (n, points)."""
        rows = self._polynomials.at(u)
        return np.asarray((rows @ self._polynomials.slopes if derivative else rows) @ self._shares)


class Surface(Result):
    """λ, or Λ(p), of two variables over one or two parameters, callable on arrays.

    Args:
        problem: with the values of all other parameters.
        ranges: of one or two parameters by their keys: (smallest, largest), or (smallest, largest, "log").
        p: the order of the moment; 0 for λ.
        rtol: |error| ≤ rtol·max(|F|, the terms of Eq. (37) before they cancel), F being λ or Λ(p); None is 1e-6.
        budget: for a solve.
        most: how many solves there may be.
        unknowns: of the space that serves all points, at most, or four times those of the middle; None is the budget's.

    Attributes:
        nodes: where it was solved, as shares of the ranges, shape (n, d).
        error: estimate of the largest |error|.
        is_converged: whether what is left between the nodes is within rtol.

    Raises:
        ValueError: a key is no parameter, or a range is none.
        NoSuchExponent: Λ(p) does not exist everywhere.
        NotConverged: there is no such surface: the functions do not move smoothly, no space serves all points, or slow
            noise carries the moment at several places.
    """

    def __init__(
        self,
        problem: Problem,
        ranges: Mapping[str, Any],
        p: float = 0.0,
        *,
        rtol: float | None = None,
        budget: Budget | None = None,
        most: int = MOST_NODES,
        unknowns: int | None = None,
    ) -> None:
        self.problem, self.p, self.rtol = checked_problem(problem), real_number(p, "p"), rtol or 1e-6
        self.axes = tuple(Axis(key, *each) for key, each in ranges.items())
        if not 1 <= len(self.axes) <= 2:
            raise ValueError(f"got ranges of {len(self.axes)} parameters; must be one or two")
        for axis in self.axes:
            if axis.key not in problem.differentiable:
                known = ", ".join(problem.differentiable) or "none"
                raise ValueError(f"got {shown(axis.key)}; the parameters are {known}")
        self._budget, self._nodes, self._refinements = budget or Budget(), list[Node](), 0
        self._scales = dict[bytes, float]()
        self._frame: Problem | None = None
        self._operands = len(self.axes)  # of the operators
        steps = np.linspace(0, 1, FOLLOWED)
        self._grid = np.array([*product(steps, repeat=len(self.axes))])
        ways = 1.01 / (FOLLOWED - 1) * np.vstack([np.eye(len(self.axes)), -np.eye(len(self.axes))])
        around = (self._grid[:, None] + ways)[:, :, None]
        self._beside = np.argmin(np.linalg.norm(self._grid - around, axis=-1), axis=-1)
        self._judged: Values | None = None
        if problem.dimension != 2 or problem.classes:
            raise self._none()
        corners = [np.array(each, dtype=float) for each in product((0.0, 1.0), repeat=len(self.axes))]
        places = [np.full(len(self.axes), 0.5), *corners]
        first = self._first(places)
        self._chosen, self._starts = first.generator.chosen, [first]
        self._largest = self._budget.unknowns if unknowns is None else max(unknowns, 4 * first.space.size)
        with one_thread():
            self._choose(first)
            self._begin(places)
            self.is_converged = self._fill(most)
        self.nodes = np.array([node.at for node in self._nodes])
        self.error = BETWEEN * self._left + self._off + max(node.error for node in self._nodes)
        self._share = BETWEEN * SHARE * self._left_share + max(node.share for node in self._nodes)
        self._nodes = [node._replace(around=None) for node in self._nodes]  # which keep factors

    @property
    def quantity(self) -> Quantity:
        """What F is."""
        return moment_at(self.p) if self.p else LYAPUNOV_EXPONENT

    def _none(self) -> NotConverged:
        return NotConverged(Message(Code.NO_SURFACE, keys=[axis.key for axis in self.axes]))

    def _problem(self, at: FloatArray) -> Problem:
        """The problem at shares of the ranges. Raises `FpsolveError` where there is none."""
        try:
            found = self.problem.at({axis.key: float(axis.value(u)) for axis, u in zip(self.axes, at, strict=False)})
            return found.in_frame_of(self._frame) if self._frame else found
        except ValueError as failure:
            raise FpsolveError(Message(Code.NO_PROBLEM, reason=said(failure))) from failure

    def _generator(self, at: FloatArray) -> Generator:
        return Generator(self._problem(at), self._chosen)

    # what F is: the eigenvalue for p, or for p = 0 its derivative

    def _first(self, places: Sequence[FloatArray]) -> PrincipalPair:
        """The pair at the first place, by a solver of its own. Raises `NoSuchExponent` where there is none at one."""
        for at in places:
            refuse_infinite(self._problem(at), self.p)
        self._frame = self._problem(places[0])
        return solver_of(self._frame, None, self.rtol, self._budget).whole.solution(self.p).pair

    def _order(self, place: FloatArray) -> float:
        """p of some operators."""
        return self.p

    def _place(self, at: FloatArray, pair: PrincipalPair) -> FloatArray:
        """Where the operators of a pair are."""
        return at

    def _value(self, pair: PrincipalPair) -> float:
        return pair.value

    def _unit(self, pair: PrincipalPair) -> float:
        """What the eigenvalue changes with F."""
        return 1.0

    def _pair(self, generator: Generator, start: Any) -> PrincipalPair | None:
        """The pair that tells F at a place; None to begin anew."""
        return principal_pair(generator, self.p, start=start)

    def _directions(self, place: FloatArray, pair: PrincipalPair) -> list[FloatArray]:
        """What the derivatives of the operators by the shares of the ranges are of all samples."""
        return [self._rows(place[None], k)[0] for k in range(len(self.axes))]

    def _allowed(self, at: FloatArray, value: float) -> float:
        """The largest error allowed of F."""
        return self.rtol * max(abs(value), self._scale(at))

    def _scale(self, at: FloatArray) -> float:
        if (key := at.tobytes()) not in self._scales:
            refuse_infinite(problem := self._problem(at), self.p)
            scales = scale_of(problem)
            self._scales[key] = float(scales.moment(self.p)) if self.p else scales.linear
        return self._scales[key]

    # nodes

    def _begin(self, places: Sequence[FloatArray]) -> None:
        """Make the basis of some places, on the first space that serves all of them."""
        while True:
            self._sample()
            self._nodes.clear()
            lacking = next((at for at in places if not self._add(at)), None)
            if lacking is None:
                return
            first, *others = places  # a place that lacks most comes early, so that few are solved in vain
            places = [first, *sorted(others, key=lambda at: at is not lacking)]

    def _fill(self, most: int) -> bool:
        """Add nodes where most is left, until that is allowed; in the end everywhere with all of them."""
        numbers = np.round(self._grid * (FOLLOWED - 1))
        is_end = (numbers == 0) | (numbers == FOLLOWED - 1)
        looked_at = np.flatnonzero(np.all((numbers % 2 == 1) | is_end, axis=1) & ~np.all(is_end, axis=1)).tolist()
        left, count = self._lefts_at(looked_at), dict.fromkeys(looked_at, len(self._nodes))
        while True:
            worst = max(left, key=lambda k: left[k][0])
            self._left_share, self._left = (max(each) for each in zip(*left.values(), strict=True))
            if count[worst] < len(self._nodes) and left[worst][0] > 1:
                left |= self._lefts_at([worst])
                count[worst] = len(self._nodes)
                continue
            if left[worst][0] <= 1:
                if before := [k for k, nodes in count.items() if nodes < len(self._nodes)]:  # nodes elsewhere may harm
                    left |= self._lefts_at(before)
                    count |= dict.fromkeys(before, len(self._nodes))
                    continue
                if (lost := self._lost()) is None:
                    return True
                worst = lost
            if len(self._nodes) >= most:
                return False
            if not self._add(self._grid[worst]):
                self._begin([*(node.at for node in self._nodes), self._grid[worst]])
            left[worst], count[worst] = (0.0, 0.0), most

    def _judge(self) -> Values:
        """The principal pairs on the grid, those of nodes as they were solved; NaN where they are not clear."""
        if self._judged is None:
            found = self._clear(self._grid)
            for node in self._nodes:
                k = self._number(node.at)
                own = self._follow(node.at[None], *self._of(node), math.inf, has_gradient=True)
                for each, of in zip(found, own, strict=True):
                    each[k] = of[0]
            x = found.x[:, :, None]
            rest = self._rest(self._rows(found.place), found.eigenvalue[:, None], x)[:, 0]
            self._judged, self._limits = found, (self._negative(x)[:, 0], rest)
        return self._judged

    def _clear(self, at: FloatArray) -> Values:
        """F at some places where it is clear which pair of the small pencil is the principal one; NaN elsewhere."""
        start = np.array([self._value(self._nearest(each).pair) for each in at])
        return self._follow(at, start, None, None, has_gradient=True)

    def _number(self, at: FloatArray) -> int:
        """The number of the point of the grid next to a place."""
        return int(np.argmin(np.linalg.norm(self._grid - at, axis=1)))

    def _of(self, node: Node) -> tuple[FloatArray, FloatArray, FloatArray]:
        """F and the pair of a node by the vectors of the basis, of shapes (1,) and (1, size)."""
        pair = node.pair
        return np.array([self._value(pair)]), (self._right @ pair.right)[None], (self._dual @ pair.left)[None]

    def _lost(self) -> int | None:
        """The point of the grid farthest from all nodes of those that are not clear, or do not go on beside; or None.

        A pair goes on that has most of the one beside, or whose value lies between their tangents.
        """
        if not self.p:
            return None
        found, nodes = self._judge(), [node.at for node in self._nodes]
        away = np.min(np.linalg.norm(self._grid[:, None] - nodes, axis=2), axis=1)
        is_lost, g = np.isnan(found.value), self._pencils(self._rows(found.place))[1]
        for k in self._beside.T:
            x, y = found.x[k], found.y[k]
            share = form(found.y, g, x) * form(y, g, found.x) / form(y, g, x)
            slopes, step = found.gradient, self._grid[k] - self._grid
            rise = found.value[k] - found.value - 0.5 * np.sum((slopes + slopes[k]) * step, axis=1)
            between = np.abs(rise) <= 0.5 * np.abs(np.sum((slopes - slopes[k]) * step, axis=1))
            is_lost |= ~((share > MOSTLY) | between)
        away = np.where(is_lost, away, 0.0)
        return int(np.argmax(away)) if away.any() else None

    def _add(self, at: FloatArray) -> bool:
        """Solve at a place, and take the eigenfunctions with their derivatives; False for a finer space."""
        generator = self._generator(at)
        generator.keeps_factors = True
        start = self._lifted(at, generator) if self._nodes else self._starts
        place = Start(generator.problem, self._chosen)
        with counted(self._budget.countdown("a node of a surface")):
            try:
                if (pair := self._pair(generator, start)) is None:
                    return False
                around = PairDerivatives(pair)
                near = pair if self.p else principal_pair(generator, SMALL_P, start=pair)
            except UNSOLVED as failure:
                return self._take(place.doubled(failure).space)
        found, unit = Solution(near), abs(self._unit(near)) if self.p else SMALL_P  # of λ, the ratio counts
        error, allowed = found.error / unit, self._allowed(at, self._value(near) / (1.0 if self.p else unit))
        if other_centers(near):
            raise self._none()
        if error > allowed:
            return self._take(place.refined(found, SPARE * allowed * unit, FREE_STAGES, self._budget.unknowns).space)
        right, left = self._vectors(self._place(at, pair), pair, around)
        # where one of two derivatives vanishes, as that of T* by R for p = 0, F needs neither
        kept, spans = [], (self._right, self._dual)
        for k in range(len(right)):
            new = right[k], left[k]
            if all(_counts(each, side[0], span) for each, side, span in zip(new, (right, left), spans, strict=True)):
                kept.append(k)
                spans = orthonormal(spans[0], new[:1]), orthonormal(spans[1], new[1:])
        if kept:
            self._extend([right[k] for k in kept], [left[k] for k in kept])
        error += pair.rounding / (unit if self.p else 1.0)
        self._nodes.append(Node(at, pair, error, error / allowed, around))
        self._judged = None
        return True

    def _take(self, space: Space) -> bool:
        """Go on with a finer space. Raises `NotConverged` where it has too many unknowns."""
        self._chosen, self._refinements = space, self._refinements + 1
        if self._refinements > MOST_SPACES or space.size > self._largest:
            raise self._none()
        return False

    def _vectors(
        self, place: FloatArray, pair: PrincipalPair, around: PairDerivatives
    ) -> tuple[list[FloatArray], list[FloatArray]]:
        """T, for p = 0 T′, and T*, each with its derivatives by the shares of the ranges."""
        weighed, value = pair.space.weighed, pair.eigenvalue
        one = pair.space.constant
        right, left = [pair.right if self.p else around.by_p], [pair.left]
        norm = pair.left @ weighed(pair.right)
        for row in self._directions(place, pair):
            by_theta = self._changes(row, right[0], value), self._changes(row, left[0], value, adjoint=True)
            if self.p:
                slope = float(left[0] @ by_theta[0] / norm)
                right.append(around.solve(slope * weighed(right[0]) - by_theta[0]))
            else:  # A T′ = −(L′ − λM) 1
                more = by_theta[0] + self._changes(row, one, pair.derivative, kind=1)
                slope = float(left[0] @ more / (left[0] @ weighed(one)))
                right.append(around.solve(slope * weighed(one) - more))
            slope = float(by_theta[1] @ pair.right / norm)
            left.append(around.solve(slope * weighed(left[0]) - by_theta[1], adjoint=True))
        return right, left

    def _lifted(self, at: FloatArray, generator: Generator) -> PrincipalPair:
        """What the basis makes of the pair at a place, to start from."""
        nearest = self._nearest(at)
        found = self._follow(at[None], *self._of(nearest)) if self.p else self._values(at[None])
        if np.isnan(found.value[0]):
            return replace(nearest.pair, generator=generator)
        right = found.x[0] @ self._right if self.p else nearest.pair.right
        left, p = found.y[0] @ self._dual, self._order(found.place[0])
        return replace(nearest.pair, p=p, right=right, left=left, generator=generator)

    def _nearest(self, at: FloatArray) -> Node:
        return min(self._nodes, key=lambda node: float(np.linalg.norm(node.at - at)))

    # the small matrices

    def _choose(self, pair: PrincipalPair) -> None:
        """Choose the places whose L, for p = 0 also L′, and M make those everywhere.

        The operators are sums of few products of functions of one parameter each, which polynomials follow; those at
        few of the points of these, that a pivoted QR chooses, make all others. What is left is looked at aside.
        """
        size = float(np.linalg.norm(pair.right) / abs(pair.left @ pair.space.weighed(pair.right) * self._unit(pair)))
        mixed, count = np.random.default_rng(0).standard_normal(pair.left.size), self._operands
        allowed = INTERPOLATED * self._allowed(np.full(count, 0.5), 0.0) / size
        probes = np.random.default_rng(1).random((PROBES, count))
        exact = np.array([self._images_at(at, pair.left) for at in probes])
        rounding = FEW * _EPS * max(each.norm for at in probes for each in self._operators(at))
        allowed = max(allowed, rounding * float(np.linalg.norm(pair.left)))
        followed = [self._polynomials_along(k, pair.left, allowed) for k in range(count)]
        for lines in ASIDE:
            aside = [np.full(count, (line + 0.29) / lines) for line in range(lines)]
            self._products = [self._products_along(k, each, aside, mixed) for k, each in enumerate(followed)]
            self._places = [np.array(each) for each in product(*(each.points for each in self._products))]
            made = np.array([self._images_at(at, pair.left) for at in self._places])
            off = float(np.max(np.linalg.norm(self._rows(probes) @ made - exact, axis=1)))
            self._off = off * size
            if off <= SEVERAL * allowed:
                return
        raise self._none()

    def _polynomials_along(self, k: int, vector: FloatArray, allowed: float) -> Polynomials:
        """Those that the operators follow along an axis. Raises `NotConverged` where none do."""
        middle = np.full(self._operands, 0.5)
        exact = self._images_at(_on_axis(middle, k, PROBE), vector)
        for degree in DEGREES:
            polynomials = Polynomials(0.0, 1.0, degree)
            points = polynomials.points.tolist()
            known = np.array([self._images_at(_on_axis(middle, k, u), vector) for u in points])
            off = np.linalg.norm(polynomials.at(np.array([PROBE]))[0] @ known - exact)
            if off <= allowed:
                return polynomials
        raise self._none()

    def _products_along(
        self, k: int, polynomials: Polynomials, aside: Sequence[FloatArray], mixed: FloatArray
    ) -> Products:
        """What the operators are made of along an axis, by lines through some places; over p all points are kept."""
        points, aside = polynomials.points.tolist(), aside if k < len(self.axes) else ()
        lines = [[self._images_at(_on_axis(at, k, u), mixed) for at in aside] for u in points]
        return Products(polynomials, np.array(lines).reshape(len(points), -1) if aside else np.eye(len(points)))

    def _sample(self) -> None:
        """L, for p = 0 also L′, and M of this space at the places, and a basis without nodes."""
        made = [self._operators(at) for at in self._places]
        self._kinds = [[each[kind] for each in made] for kind in range(len(made[0]))]
        self._spaces = [self._space_at(at) for at in self._places]
        one = self._spaces[0].constant
        self._right = orthonormal(np.zeros((0, one.size)), [] if self.p else [one])
        self._dual = orthonormal(np.zeros((0, one.size)), [] if self.p else [one])
        self._small = [np.zeros((len(made), 0, 0)) for _ in range(len(self._kinds) + 1)]
        self._mixing = np.random.default_rng(2).standard_normal((MIXED, one.size)) / math.sqrt(MIXED)
        self._mixed, self._seen = np.zeros((2, len(made), MIXED, 0)), np.zeros((SEEN, 0))
        all_of = np.broadcast_to(self._spaces[0].grid_measure, self._spaces[0].on_grid(one).shape).ravel()
        self._at = np.random.default_rng(4).choice(all_of.size, SEEN, p=all_of / all_of.sum())
        if not self.p:
            self._extend([], [])

    def _operators(self, at: FloatArray) -> tuple[KroneckerSum, ...]:
        """L, for p = 0 also L′."""
        generator, p = self._generator(at), self._order(at)
        return (generator.matrix(p),) if self.p else (generator.matrix(0.0), generator.matrix(0.0, derivative=1))

    def _images_at(self, at: FloatArray, vector: FloatArray) -> FloatArray:
        """The transposes of these, and M, times a vector, one after the other."""
        return np.concatenate([*(each.T @ vector for each in self._operators(at)), self._space_at(at).weighed(vector)])

    def _space_at(self, at: FloatArray) -> Space:
        return self._chosen.at(self._order(at), self._problem(at).coloured.parts.values())

    def _rows(self, at: FloatArray, derivative: int | None = None) -> FloatArray:
        """What small matrices at each place, or their derivatives, are of those of all samples, shape (n, samples)."""
        rows = np.ones((len(at), 1))
        for k, products in enumerate(self._products):
            own = products.at(at[:, k], int(k == derivative))
            rows = (rows[:, :, None] * own[:, None, :]).reshape(len(at), -1)
        return rows

    def _changes(
        self, rows: FloatArray, vectors: FloatArray, value: Any, adjoint: bool = False, kind: int = 0
    ) -> FloatArray:
        """What L − vM, or L′ − vM, or derivatives of these, make of vectors, shape (…, size), by their rows."""
        rows, tables = np.atleast_2d(rows), vectors.reshape(-1, *self._chosen.shape)
        values, total = np.reshape(value, (-1, 1)), np.zeros((len(tables), self._chosen.size))
        for k, (matrix, space) in enumerate(zip(self._kinds[kind], self._spaces, strict=True)):
            image = (matrix.T if adjoint else matrix).images(tables).reshape(total.shape)
            if values.any():
                image -= values * np.array([space.weighed(each) for each in tables])
            total += rows[:, k, None] * image
        return total.reshape(vectors.shape)

    def _extend(self, right: Sequence[FloatArray], left: Sequence[FloatArray]) -> None:
        """Add vectors to the basis, and what they make of all samples to the small matrices."""
        old, shape = self._small[0].shape[1], self._chosen.shape
        self._right, self._dual = orthonormal(self._right, right), orthonormal(self._dual, left)
        after, before = self._right[old:], self._dual[old:]
        mixed = np.zeros((2, len(self._places), MIXED, len(after)))
        for number, small in enumerate(self._small):
            if number < len(self._kinds):
                tables, duals = (each.reshape(-1, *shape) for each in (after, before))
                images = np.array([each.images(tables).reshape(after.shape) for each in self._kinds[number]])
                adjoint = np.array([each.T.images(duals).reshape(before.shape) for each in self._kinds[number]])
            else:
                images, adjoint = (
                    np.array([[space.weighed(each) for each in side] for space in self._spaces])
                    for side in (after, before)
                )
            if self.p:
                mixed[number] = (images @ self._mixing.T).swapaxes(1, 2)
            rows = np.concatenate([small, adjoint @ self._right[:old].T], axis=1)
            self._small[number] = np.concatenate([rows, (images @ self._dual.T).swapaxes(1, 2)], axis=2)
        if self.p:
            seen = np.array([self._spaces[0].on_grid(each).ravel()[self._at] for each in after])
            self._mixed = np.concatenate([self._mixed, mixed], axis=3)
            self._seen = np.concatenate([self._seen, seen.T], axis=1)
        else:
            self._small[0][:, :, 0] = 0.0  # L(0) 1 = 0

    def _pencils(self, rows: FloatArray) -> list[FloatArray]:
        size = len(self._right)
        return [(rows @ each.reshape(len(each), -1)).reshape(-1, size, size) for each in self._small]

    def _values(self, at: FloatArray, has_gradient: bool = False) -> Values:
        """F at some places, shape (n, d), from the small matrices alone."""
        if self.p:
            return self._follow(at, *self._around(at), has_gradient=has_gradient)
        rows = self._rows(at)
        small = self._pencils(rows)
        slopes = [self._pencils(self._rows(at, k)) for k in range(len(self.axes))] if has_gradient else []
        return self._growth(at, small, slopes)

    def _follow(
        self,
        at: FloatArray,
        value: FloatArray,
        x: FloatArray | None,
        y: FloatArray | None,
        negative: Any = NEGATIVE,
        rest: Any = math.inf,
        has_gradient: bool = False,
    ) -> Values:
        """F where pairs go on from those given: in most of them, as positive, of as small a residual; or NaN."""
        found, share = self._continued(at, value, x, y)
        rows, of = self._rows(found.place), found.x[:, :, None]
        goes_on = (share > MOSTLY) & (self._negative(of)[:, 0] <= negative + SLIGHTLY)
        if np.any(np.isfinite(rest)):
            goes_on &= self._rest(rows, found.eigenvalue[:, None], of)[:, 0] <= LEAST * rest
        found.value[~goes_on] = math.nan
        by_axes = [self._pencils(self._rows(found.place, k)) for k in range(has_gradient * len(self.axes))]
        changes = [form(found.y, a, found.x) - found.eigenvalue * form(found.y, g, found.x) for a, g in by_axes]
        return found._replace(gradient=np.reshape(changes, (-1, len(at))).T / found.unit[:, None])

    def _continued(
        self, at: FloatArray, value: FloatArray, x: FloatArray | None, y: FloatArray | None
    ) -> tuple[Values, FloatArray]:
        """Pairs that those given lead to and their shares in these, see `eigenpairs`; of none the principal ones."""
        rows = self._rows(at)
        a, g = self._pencils(rows)
        if x is None or y is None:
            value, x, y, share = self._principal(rows, a, g)
        else:
            value, x, y, share = eigenpairs(a, g, form(y, a, x) / form(y, g, x), x, y, FOLLOWING)
        x = x * np.sign(np.sum(x @ self._seen.T, axis=1))[:, None]
        y = y / form(y, g, x)[:, None]
        return Values(value.copy(), np.zeros((len(at), 0)), x, y, at, value, np.ones(len(at))), share

    def _growth(self, at: FloatArray, small: Sequence[FloatArray], slopes: Sequence[Sequence[FloatArray]]) -> Values:
        """λ: Bᵀy = (1, 0, …) with B = (G 1, A V′) gives T*, and Bz = A′1 gives λ = z₁ and −T′."""
        a, b, g = small
        source, first = b[:, :, 0], np.zeros(a.shape[:2])
        first[:, 0] = 1.0
        whole = np.concatenate([g[:, :, :1], a[:, :, 1:]], axis=2)
        y = np.linalg.solve(whole.swapaxes(1, 2), first[:, :, None])[:, :, 0]
        value = np.sum(y * source, axis=1)
        z = np.linalg.solve(whole, source[:, :, None])[:, :, 0] if slopes else 0.0 * y
        gradient = []
        for by_a, by_b, by_g in slopes:
            by_whole = np.concatenate([by_g[:, :, :1], by_a[:, :, 1:]], axis=2)
            gradient.append(np.sum(y * by_b[:, :, 0], axis=1) - form(y, by_whole, z))
        x = np.concatenate([np.zeros((len(z), 1)), -z[:, 1:]], axis=1)
        return Values(value, np.array(gradient).reshape(-1, len(value)).T, x, y, at, value, np.ones(len(value)))

    def _around(self, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """F and both vectors by cubics through the points of the grid around, and the most of their limits."""
        judged, shares = self._judge(), at * (FOLLOWED - 1)
        low = np.clip(shares.astype(int) - 1, 0, FOLLOWED - 4)
        away = (shares - low)[:, :, None] - np.arange(4)
        of_axes = np.stack([np.prod(np.delete(away, k, axis=2), axis=2) / LAGRANGE[k] for k in range(4)], axis=2)
        between, most = [np.zeros(1)] * 3, [np.zeros(1)] * 2
        for corner in product(range(4), repeat=at.shape[1]):
            weight = np.prod([of_axes[:, axis, k] for axis, k in enumerate(corner)], axis=0)
            index = np.ravel_multi_index(tuple((low + corner).T), (FOLLOWED,) * at.shape[1])
            of_pairs = judged.value, judged.x, judged.y
            between = [each + (weight * of[index].T).T for each, of in zip(between, of_pairs, strict=True)]
            most = [np.maximum(each, of[index]) for each, of in zip(most, self._limits, strict=True)]
        (value, x, y), (negative, rest) = between, most
        return value, x, y, negative, rest

    def _negative(self, vectors: Any) -> FloatArray:
        """The lesser share of T of some pairs at each place, shape (n, size, pairs), that has one of both signs."""
        seen = (self._seen @ vectors).real
        negative = np.sum(np.maximum(-seen, 0), axis=1) / np.sum(np.abs(seen), axis=1)
        return np.asarray(np.minimum(negative, 1 - negative))

    def _principal(self, rows: FloatArray, a: FloatArray, g: FloatArray) -> tuple[FloatArray, ...]:
        """The real eigenvalue of each small pencil with T > 0 and the least residual, both vectors, and 1; or 0 where
        a larger one has a residual that is hardly larger. If it is next to nothing, that one is the principal one.
        """
        values, vectors = np.linalg.eig(np.linalg.solve(g, a))
        may_be = (values.imag == 0) & (self._negative(vectors) <= NEGATIVE)
        rest, own = np.where(may_be, self._rest(rows, values, vectors), math.inf), np.arange(len(rows))
        best = np.argmin(rest, axis=1)
        above = values.real - values.real[own, best][:, None]
        sure = np.where(rest <= NEXT_TO_NOTHING * above, above, 0.0)
        best = np.where(sure.any(axis=1), np.argmax(sure, axis=1), best)
        above = values.real - values.real[own, best][:, None]
        is_clear = ~np.any((above > 0) & (rest <= ALIKE * rest[own, best][:, None]), axis=1) & may_be[own, best]
        x = vectors[own, :, best].real
        value, x, y, _ = eigenpairs(a, g, values[own, best].real, x, (g @ x[:, :, None])[:, :, 0])
        return value, x, y, np.where(is_clear, 1.0, 0.0)

    def _rest(self, rows: FloatArray, values: Any, vectors: Any) -> FloatArray:
        """About ‖(L − ΛM)T‖/‖T‖ of some pairs at each place, by random sums of its entries: shape (n, pairs)."""
        of_l, of_m = ((rows @ each.reshape(len(each), -1)).reshape(len(rows), MIXED, -1) for each in self._mixed)
        rest = np.linalg.norm(of_l @ vectors - (of_m @ vectors) * values[:, None, :], axis=1)
        return np.asarray(rest / np.linalg.norm(vectors, axis=1))

    # errors

    def _lefts_at(self, places: Sequence[int]) -> dict[int, tuple[float, float]]:
        """What is left of F at points of the grid, over its share of what is allowed, and itself."""
        at, lefts = self._grid[places], dict.fromkeys(places, (math.inf, math.inf))
        found = self._clear(at) if self.p else self._values(at, has_gradient=True)
        rows, x, y, value = self._rows(found.place), found.x @ self._right, found.y @ self._dual, found.eigenvalue
        if self.p:
            r, s = self._changes(rows, x, value), self._changes(rows, y, value, adjoint=True)
        else:
            ones = np.broadcast_to(self._spaces[0].constant, x.shape)
            r = self._changes(rows, x, 0.0) + self._changes(rows, ones, value, kind=1)
            s = self._changes(rows, y, 0.0, adjoint=True)
        for i in np.flatnonzero(np.isfinite(found.value)).tolist():
            around = self._nearest(at[i]).around
            assert around is not None
            image = partial(self._changes, rows[i], value=value[i] if self.p else 0.0)
            left = SAFE * left_over(around, r[i], s[i], image) / abs(float(found.unit[i]))
            lefts[places[i]] = left / (SHARE * self._allowed(at[i], float(found.value[i]))), left
        return lefts

    # values

    def __call__(self, *values: ArrayLike) -> FloatArray:
        """F at values of the parameters, broadcast together. Raises `ValueError` outside the ranges."""
        shares = self.shares(*values)
        return self.at_shares(shares.reshape(-1, len(self.axes)), has_gradient=False)[0].reshape(shares.shape[:-1])

    def gradient(self, *values: ArrayLike) -> FloatArray:
        """∂F/∂θ, of the shape of the values, one entry for each parameter last."""
        shares = self.shares(*values)
        found = self.at_shares(shares.reshape(-1, len(self.axes)))[1].reshape(shares.shape)
        slopes = [np.vectorize(axis.slope)(shares[..., k]) for k, axis in enumerate(self.axes)]
        return np.asarray(found / np.stack(slopes, axis=-1))

    def at_shares(
        self, shares: FloatArray, has_gradient: bool = True, *, solves: bool = True
    ) -> tuple[FloatArray, FloatArray]:
        """F, shape (n,), and its gradient by them, shape (n, d), at shares of the ranges, shape (n, d).

        Where the small pencil does not tell F it is solved, or NaN.
        """
        values, gradients = np.empty(len(shares)), np.empty(shares.shape if has_gradient else (len(shares), 0))
        for part in np.array_split(np.arange(len(shares)), math.ceil(len(shares) / AT_ONCE) or 1):
            found = self._values(shares[part], has_gradient)
            values[part], gradients[part] = found.value, found.gradient
            for k in part[np.isnan(found.value)] if solves else ():
                values[k], gradients[k] = self._solved(shares[k], has_gradient)
        return values, gradients

    def errors(self, shares: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Estimates of |error of F|, and what rtol is of, shape (n,), by F at shares of the ranges, shape (n, d).

        The errors over those allowed are the largest of all places that were looked at.
        """
        from scipy.interpolate import RegularGridInterpolator  # which takes long to import

        grid = [np.linspace(0, 1, SCALES)] * len(self.axes)
        scales = np.log([max(self._scale(np.array(at)), sys.float_info.min) for at in product(*grid)])
        scale = RegularGridInterpolator(grid, scales.reshape([SCALES] * len(self.axes)))(shares)
        of = np.maximum(np.abs(values), np.exp(scale))
        return self._share * self.rtol * of + self._off, of

    def _solved(self, at: FloatArray, has_gradient: bool) -> tuple[float, list[float]]:
        """F and its gradient where the small pencil does not tell it, by the whole one."""
        if (pair := self._pair(self._generator(at), self._nearest(at).pair)) is None:
            raise self._none()
        rows = self._directions(self._place(at, pair), pair) if has_gradient else []
        changes = [float(pair.left @ self._changes(row, pair.right, pair.eigenvalue)) for row in rows]
        norm = pair.left @ pair.space.weighed(pair.right) * self._unit(pair)
        return self._value(pair), [float(each / norm) for each in changes]

    def shares(self, *values: ArrayLike) -> FloatArray:
        """Values of the parameters as shares of the ranges, one for each last. Raises `ValueError` outside of these."""
        if len(values) != len(self.axes):
            raise ValueError(
                f"got {len(values)} arrays; must be {len(self.axes)}: {', '.join(a.key for a in self.axes)}"
            )
        shares = []
        for axis, each in zip(self.axes, values, strict=True):
            points = real_array(each, axis.key)
            if not np.all((points >= axis.start) & (points <= axis.stop)):
                raise ValueError(f"{axis.key} must lie in [{axis.start:g}, {axis.stop:g}]; make a wider surface")
            shares.append(np.clip(np.vectorize(axis.share, otypes=[float])(points), 0, 1))
        return np.stack(np.broadcast_arrays(*shares), axis=-1)

    def to_xarray(self, points: int = 101) -> xarray.Dataset:
        """F on a grid of so many points each way."""
        sides = [np.asarray(axis.value(np.linspace(0, 1, points))) for axis in self.axes]
        names = [replace(self.problem.parameters[axis.key].quantity, dims=(axis.key,)) for axis in self.axes]
        keys = tuple(axis.key for axis in self.axes)
        found = replace(self.quantity, dims=keys)
        values = self(*np.meshgrid(*sides, indexing="ij"))
        numbers = {found: values, found.error(): np.full(values.shape, self.error)}
        held = {key: value for key, value in self.problem.values.items() if key not in keys}
        places = dict(zip(names, sides, strict=True))
        method, more = "finite elements and a reduced basis", {"error": self.error, "rtol": self.rtol}
        return dataset(found.words, method, numbers, places, held, **more)

    def _said(self) -> str:
        keys = " and ".join(axis.key for axis in self.axes)
        return f"{self.quantity.symbol} over {keys}, {len(self._nodes)} solved, ± {self.error:.0e}"


def _on_axis(at: FloatArray, k: int, share: float) -> FloatArray:
    """A place with another share of the axis k."""
    place = at.copy()
    place[k] = share
    return place


def _counts(derivative: FloatArray, of: FloatArray, known: FloatArray) -> bool:
    """Whether a derivative of an eigenfunction is more than rounding, and more than others make."""
    beyond = np.linalg.norm(derivative - (known @ derivative) @ known)
    return bool(beyond > max(NOTHING * np.linalg.norm(of), SAME * np.linalg.norm(derivative)))
