"""The principal eigenvalue of L(p), Eq. (19), with both eigenfunctions and their derivatives by p; and the spectrum.

For a real shift σ > Λ the resolvent (σ − L)⁻¹ is a positive operator whose largest eigenvalue is 1/(σ − Λ):
seen from the right, Λ is the nearest eigenvalue. From there, or quicker from the pair at a neighbouring p,
two-sided Rayleigh quotient iteration converges cubically. That it found the principal pair is checked by the one
property that no other pair has: T > 0 and T* > 0 (Perron-Frobenius; one of the two is enough), as far as a mesh can
tell. It cannot where slow noise has two places between which it hardly ever passes: both are looked at, see `starts`.
Nor can it for noise with states, or where the phase rests, so that every search begins on the right there, or at the
pair of a neighbouring p and must reach its tangent: Λ is convex. Under chains and white noise (σ − L)⁻¹1 > 0 decides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import ArpackError, ArpackNoConvergence, LinearOperator, eigs

from fpsolve.arrays import FloatArray, finite, one
from fpsolve.data import brief
from fpsolve.errors import NotConverged, NumericalFailure, SingularMatrix
from fpsolve.exponent.rightmost import NEAR_ENOUGH, NEARER
from fpsolve.fem.axis import FEW_UNKNOWNS, KroneckerSum
from fpsolve.fem.factors import Factors, one_thread
from fpsolve.fem.generator import Generator, Pencil
from fpsolve.fem.space import Space
from fpsolve.messages import Code, Message, Remedy
from fpsolve.theory.frozen import frozen_noise

BACKWARD_ERROR_GOAL = 1e-14
"""Backward error, over the norm of L, at which the iteration ends."""
BACKWARD_ERROR_OF_RATE = 1e-7
"""Backward error, over ω, at which the iteration ends, where that is less."""
BACKWARD_ERROR_LIMIT = 1e-11
"""Backward error, over the norm of L, up to which a pair is one."""
POSITIVE = 1e-2
"""T, or T*, is taken for positive where no more than this share of it has the wrong sign, the least of all found."""
SURELY_POSITIVE = 1e-4
"""The same for a pair with which the search ends at once."""
BESIDE_IT = 1e-6, 1e-2
"""Distances from an eigenvalue, over a rate of the system, at which it is looked whether others are to its right."""
LEAST_OF_MOST = 1e-2
"""Least value of T, over its largest, from which on it is positive beyond what it may be off."""
MOSTLY = 0.5
"""Share of the principal pair of another p or discretisation beyond which a pair goes on from it."""
DOUBT = 1e-3
"""Share of its terms by which a tangent of Λ may lie too high: the errors of its p."""
_EPS = float(np.finfo(float).eps)
THROUGH = 3
"""Number of p through which T and T* are extrapolated."""
REFINEMENTS = 16
"""Number of times that T′ is improved by its residual, at most."""
REFINED = 1e-14
"""Share of T′ of a step that is the last one."""
MAX_ITERATIONS = 12
"""Number of LU factors in an iteration."""
MAX_SHIFTS = 12
"""Number of shifts of a search from the right."""
NEIGHBOURS = 6
"""Eigenvalues nearest to a shift among which the real one is looked for."""
SUBSPACES = 24, 48, 96
"""Dimensions of the Krylov space of the Arnoldi iteration, each tried where a smaller one finds no eigenvalue."""
RESTARTS = 20
"""Number of restarts of an Arnoldi iteration: far from eigenvalues that are close to each other more do not help."""
STEPS_PER_FACTOR = 5
"""Number of steps of an iteration with the same LU factors."""
SLOW = 1e-2
"""A step that lowers the backward error by less than this factor calls for new LU factors."""
MAX_SPECTRUM_UNKNOWNS = 4000
"""Largest number of unknowns of which all eigenvalues are computed."""
LARGEST_NORM = 1e150
"""Of L(p): vectors of this size have lengths."""


@dataclass(frozen=True, eq=False, repr=False)
class PrincipalPair:
    """Λ(p) with its eigenfunctions on a mesh.

    Attributes:
        p: the moment.
        eigenvalue: of the matrix of L(p), per unit time.
        right: coefficients of T, shape (size,); its mean over the weight of the space, P_s without a tilt, is 1.
        left: coefficients of T*/P_s, shape (size,); ∫T T* dφ dξ over the full circle is 1.
        derivative: Λ′(p) = ⟨T*, L′(p) T⟩ (Hellmann-Feynman).
        residual: the larger of the two backward errors ‖(L − Λ)T‖/(‖L‖‖T‖), also for T*.
        rounding: bound on the effect of rounding on `eigenvalue`.
        sign_defects: shares of T and of T* that are not positive, by their own size or by |T T*|.
        generator: what was solved.
        correction: what functions beyond those of the mesh change in Λ(p), to first order.
    """

    p: float
    eigenvalue: float
    right: FloatArray
    left: FloatArray
    derivative: float
    residual: float
    rounding: float
    sign_defects: tuple[float, float]
    generator: Generator
    correction: float = 0.0

    @property
    def value(self) -> float:
        """Λ(p), per unit time."""
        return self.eigenvalue + self.correction

    def __repr__(self) -> str:
        of_p = f"({self.p:g}) = "
        return brief(self, f"Λ{of_p}{self.value:.10g}, Λ′{of_p}{self.derivative:.10g}, {self.right.size} unknowns")

    @property
    def space(self) -> Space:
        """The functions that the coefficients are of."""
        return self.generator.space(self.p)


def principal_pair(
    generator: Generator,
    p: float,
    *,
    start: PrincipalPair | Sequence[PrincipalPair] | None = None,
) -> PrincipalPair:
    """The principal eigenvalue Λ(p) of Eq. (19) with T and T*.

    Args:
        generator: the discrete tilted generator.
        p: the moment.
        start: the pair of a neighbouring p or of another generator, or several pairs, the nearest p first, whose
            tangents bound Λ(p); it saves time.

    Raises:
        NumericalFailure: the numbers of L(p) are too large to be squared.
        NotConverged: the iteration stalls, or both T and T* change sign: the mesh does not resolve the problem.
            `partial` is the pair that was reached.
    """
    pairs, pencil = [start] if isinstance(start, PrincipalPair) else start or [], generator.at(p)
    if not pencil.matrix.norm < LARGEST_NORM:
        raise NumericalFailure(f"L(p) has the size {pencil.matrix.norm:.0e}")
    pair = None
    if pairs or p == 0 or not _has_other_positive(generator, p):
        x = y = pencil.space.constant  # of weak noise, Eqs. (26) and (28)
        if pairs:
            x, y = _predicted(pencil, generator, pairs)
        pair = _reached(generator, pencil, x, y)
        if _is_principal(pair, pairs, continues=bool(pairs) and _share(pencil.space, pair, x, y) > MOSTLY):
            return pair
    return _rightmost_pair(pencil, generator, pair)


def _predicted(pencil: Pencil, generator: Generator, pairs: Sequence[PrincipalPair]) -> FloatArray:
    """T and T* by the polynomial in p through those of the nearest p in one space, shape (2, size)."""
    p, last = pencil.p, pairs[0].generator
    near = [each for each in pairs if each.generator is last][:THROUGH]
    both = np.zeros((2, last.size))
    for each in near:
        share = math.prod((p - other.p) / (each.p - other.p) for other in near if other is not each)
        both += share * np.array([each.right, each.left])
    return both if last is generator else pencil.space.carry(both, last.space(p))


def _is_principal(pair: PrincipalPair, pairs: Sequence[PrincipalPair], continues: bool) -> bool:
    """Whether a pair that was reached from others, or from T = 1, is the principal one.

    It must reach the tangent of Λ at their p and, where other pairs may seem positive, too, go on from them. At p = 0
    it has Λ = 0 and T = 1.
    """
    generator, tangent = pair.generator, _tangent(pair, pairs)
    most = POSITIVE if continues else SURELY_POSITIVE
    if pair.residual > BACKWARD_ERROR_LIMIT or pair.value < tangent or min(pair.sign_defects) > most:
        return False
    if pair.p == 0:
        return abs(pair.value) <= BESIDE_IT[0] * generator.framed.unit_rate
    if not continues and _has_other_positive(generator, pair.p):
        return False
    return not generator.left_in_phase or _is_rightmost(pair)


def _rightmost_pair(pencil: Pencil, generator: Generator, reached: PrincipalPair | None) -> PrincipalPair:
    """The pair that is found from the right, of which no eigenvalue lies further to the right, nor that of a pair that
    was reached before. Raises `NotConverged`."""
    p, unit = pencil.p, generator.framed.unit_rate
    right, left, value, distance = _from_the_right(pencil, generator)
    pair = _reached(generator, pencil, right, left)
    defect = min(pair.sign_defects)
    if not (pair.residual <= BACKWARD_ERROR_LIMIT and defect <= POSITIVE and abs(pair.value - value) < distance):
        limit, most = BACKWARD_ERROR_LIMIT, POSITIVE
        told = Message(Code.NO_EIGENVALUE, p=p, residual=pair.residual, size=defect, limit=limit, most=most)
        raise NotConverged(told, pair, Remedy.BOTH_AXES)
    if not _has_other_positive(generator, p):
        return pair
    others = [reached.value] if reached and reached.residual <= BACKWARD_ERROR_LIMIT else []
    if generator.left_in_phase and generator.size <= FEW_UNKNOWNS:  # of a chain
        others.append(float(spectrum(generator, p, 1)[0].real))
    rightmost = max(others, default=-math.inf)
    if rightmost - pair.value > 1e-6 * max(abs(rightmost), unit):
        told = Message(Code.LARGER_EIGENVALUE, p=p, rightmost=rightmost, value=pair.value)
        raise NotConverged(told, pair, Remedy.PHASE)
    return pair


def _is_rightmost(pair: PrincipalPair) -> bool:
    """Whether (σ − L)⁻¹1 > 0, as it is for a σ beside Λ if Λ is the rightmost eigenvalue, and also for the adjoint.

    Of another one, by which all else is larger than rounding, it is −1/(Λ′ − σ) of its share. Where pairs are followed
    from p = 0, only what is resolved is looked at: under waves T* is not. One of both must do where the adjoint is no
    function.

    Where T lies between positive bounds, none is: E‖x(t)‖^p ≤ (max T/min T) exp(Λt) from every start.
    """
    problem, space = pair.generator.problem, pair.space
    if problem.valued.is_bounded and not space.is_tilted:
        _, values = space.on_grid(pair.right)
        if np.min(values) > LEAST_OF_MOST * np.max(values):
            return True
    pencil, source = pair.generator.at(pair.p), space.weighed(space.constant)
    seen = [side for side in (0, 1) if not space.phi.is_followed or pair.sign_defects[side] <= POSITIVE]
    positive = dict.fromkeys(seen, True)
    for distance in BESIDE_IT:
        factor: Any = None  # there is room for the next ones
        factor = pencil.factorised(pair.eigenvalue + distance * pair.generator.framed.unit_rate)
        for side in seen:
            both = [pair.right, pair.left]
            both[side] = -factor.solve(source, transposed=bool(side))
            positive[side] &= _sign_defects(space, *both)[side] <= SURELY_POSITIVE
    return not seen or (all if space.phi.has_adjoint else any)(positive.values())


def _has_other_positive(generator: Generator, p: float) -> bool:
    """Whether other pairs may seem to have T > 0, too.

    States that hardly mix have a pair each. Where the phase rests, between weak noise, T is about |x|^(p−k) |v|^k for
    the k-th pair, x along the faster mode and v along the other: for even k its sign does not change.
    """
    problem = generator.problem
    if generator.chosen.phi.is_followed:  # each search begins at a neighbouring p
        return False
    if generator.left_in_phase:
        return True
    if (frozen := frozen_noise(problem)) is None:
        values = [each.reached for each in problem.valued.parts.values()]
        every = [each[:: max(each.size // 100, 1)] for each in values]  # a state of a chain, and any other tenth value
        speed = generator.framed.motion.phase_speed(problem.valued.combined(every))
        return bool(np.any(np.abs(speed.mean) <= speed.amplitude))
    lines = generator.chosen.xi.lines
    return frozen.rests(p, lines[0], lines[-1]) if lines.size else frozen.rests(p)


def _share(space: Space, pair: PrincipalPair, x: FloatArray, y: FloatArray) -> float:
    """That of a pair in the Rayleigh quotient of x = Σ aᵢTᵢ and y = Σ bᵢTᵢ*: of the aᵢbᵢ⟨Tᵢ*, Tᵢ⟩ in ⟨y, x⟩."""
    of_right, of_x = space.weighed(pair.right), space.weighed(x)
    return float((y @ of_right) * (pair.left @ of_x) / ((y @ of_x) * (pair.left @ of_right)))


def _tangent(pair: PrincipalPair, others: Sequence[PrincipalPair]) -> float:
    """What Λ is at least at the p of a pair, as it is convex, by those of this problem at other p; −∞ without any."""
    least = -math.inf
    for each in others:
        if each.generator.problem is pair.generator.problem and each.p != pair.p:
            rise = each.derivative * (pair.p - each.p)
            least = max(least, each.value + rise - DOUBT * (abs(each.value) + abs(rise)))
    return least


def spectrum(generator: Generator, p: float, k: int = 10) -> Any:
    """The k rightmost eigenvalues of L(p), by decreasing real part: complex, shape (k,).

    The QR algorithm gives all eigenvalues of the dense matrix. Use a full-circle mesh for the whole spectrum; a
    half-circle mesh has its π-periodic part only.

    Raises:
        ValueError: k is not from 1 to the number of unknowns, or these exceed `MAX_SPECTRUM_UNKNOWNS`.
    """
    size = generator.size
    if size > MAX_SPECTRUM_UNKNOWNS:
        raise ValueError(
            f"{size} unknowns; the whole spectrum takes at most {MAX_SPECTRUM_UNKNOWNS}: use a coarser mesh"
        )
    if not 1 <= k <= size:
        raise ValueError(f"k is {k}; it must be from 1 to the number of unknowns, {size}")
    root = scipy.linalg.cholesky(finite(generator.space(p).mass.toarray()), lower=True)
    half = scipy.linalg.solve_triangular(root, finite(generator.matrix(p).toarray()), lower=True)
    values = scipy.linalg.eigvals(scipy.linalg.solve_triangular(root, half.T, lower=True).T, overwrite_a=True)
    return values[np.lexsort((values.imag, -values.real))][:k]


def _from_the_right(pencil: Pencil, generator: Generator) -> tuple[FloatArray, FloatArray, float, float]:
    """Vectors T and T*, and the value, of the rightmost real eigenvalue, seen from the right; and half its distance.

    For a real shift σ > Λ no eigenvalue of L is nearer to σ than Λ. The first shift is an estimate of Λ from above;
    each next one keeps `NEARER` of the distance. Complex pairs of the truncation may be nearer; they are passed over.
    """
    space, value = pencil.space, math.inf
    right = left = space.constant
    shift = generator.growth_bound(pencil.p) + 0.1 * generator.framed.unit_rate
    for step in range(MAX_SHIFTS):
        if step:
            shift = value + NEARER * (shift - value)
        factor: Any = None  # there is room for the next ones
        factor, last = pencil.factorised(shift), value
        right, value = _nearest(lambda v, lu=factor: -lu.solve(space.weighed(v)), right, shift, pencil.p)
        if abs(value - last) <= NEAR_ENOUGH * (shift - value) and shift - value <= generator.framed.unit_rate:
            break
    left, _ = _nearest(lambda v: -factor.solve(space.weighed(v), transposed=True), left, shift, pencil.p, value)
    return right, left, value, 0.5 * (shift - value)


def _nearest(
    resolvent: Any, start: FloatArray, shift: float, p: float, value: float | None = None
) -> tuple[FloatArray, float]:
    """The real eigenvalue nearest to a shift, or to a value, and before it its eigenvector, by Arnoldi iteration."""
    operator = LinearOperator((start.size, start.size), matvec=resolvent, dtype=float)
    count = min(NEIGHBOURS, start.size - 2)
    mixed = start + 1e-8 * np.linalg.norm(start) * np.sin(np.arange(start.size))  # beyond spaces that L keeps to itself
    for dimension in SUBSPACES:
        try:
            inverses, vectors = eigs(
                operator, k=count, v0=mixed, ncv=min(dimension, start.size), tol=1e-3, maxiter=RESTARTS
            )
        except ArpackNoConvergence as failure:
            inverses, vectors = failure.eigenvalues, failure.eigenvectors
        except ArpackError as failure:
            raise SingularMatrix(*failure.args) from failure
        if inverses.size:
            break
    else:
        raise NotConverged(Message(Code.NO_ARNOLDI, p=p), remedy=Remedy.DEGREES)
    found = shift - 1 / inverses
    is_real = np.abs(inverses.imag) <= 1e-6 * np.abs(inverses)
    is_real |= not np.any(is_real)  # the mesh does not resolve the problem, as what is found will tell
    distance = np.where(is_real, np.abs(found.real - (shift if value is None else value)), math.inf)
    best = int(np.argmin(distance))
    return vectors[:, best].real, float(found[best].real)


class Iterate(NamedTuple):
    """A two-sided Rayleigh quotient, the larger of both backward errors, both unit vectors, and M times them."""

    value: float
    residual: float
    x: FloatArray
    y: FloatArray
    mx: FloatArray
    my: FloatArray


@np.errstate(divide="ignore", over="ignore", invalid="ignore")  # a start may be useless, as its residual tells then
def rayleigh_iteration(pencil: Pencil, x: FloatArray, y: FloatArray, rate: float) -> Iterate:
    """Two-sided Rayleigh quotient iteration (Ostrowski) until the backward error stops falling.

    It is small where it is so beside the norm of L, which fast noise makes large, and beside a rate of the system.
    """
    space, operator = pencil.space, pencil.matrix
    mx = space.weighed(x)
    best = Iterate(float(y @ (operator @ x) / (y @ mx)), math.inf, x, y, mx, space.weighed(y))
    size, stalls = operator.norm, 0
    goal = min(BACKWARD_ERROR_GOAL, BACKWARD_ERROR_OF_RATE * rate / size)
    for _ in range(MAX_ITERATIONS):
        shift, last = best.value, best.residual
        factor: Any = None  # there is room for the next ones
        factor = pencil.factorised(shift)
        for _ in range(STEPS_PER_FACTOR):
            new = _improved(factor, space, shift, size, best)
            if not new.residual < 0.5 * best.residual:
                break
            is_slow, best = new.residual > SLOW * best.residual, new
            if is_slow or best.residual <= goal:
                break
        stalls = stalls + 1 if best.residual > 0.5 * last else 0
        may_stall = int(best.residual > BACKWARD_ERROR_LIMIT)
        if best.residual <= goal or stalls > may_stall or not math.isfinite(best.value):
            break
    # the value from the forcing is linear in the error of T, which residuals show beside the largest rates only
    return _improved(factor, space, shift, size, best)


def _improved(factor: Factors, space: Space, shift: float, size: float, old: Iterate) -> Iterate:
    """One step of inverse iteration; of (L − σM) x₁ = M x₀ the images L x₁ need no product with L."""
    x, y = factor.solve(old.mx), factor.solve(old.my, transposed=True)
    lengths = length(x), length(y)
    x, y = x / lengths[0], y / lengths[1]
    images, mx, my = (old.mx / lengths[0], old.my / lengths[1]), space.weighed(x), space.weighed(y)
    distance = float(y @ images[0] / (y @ mx))
    error = max(length(images[0] - distance * mx), length(images[1] - distance * my))
    return Iterate(shift + distance, error / size, x, y, mx, my)


def _reached(generator: Generator, pencil: Pencil, x: FloatArray, y: FloatArray) -> PrincipalPair:
    """The pair that the iteration reaches from vectors T and T*: both are normalised, and their signs judged.

    Λ is taken from the formula that rounding harms less.
    """
    found = rayleigh_iteration(pencil, x, y, generator.framed.unit_rate)
    p, space, operator = pencil.p, pencil.space, pencil.matrix
    images = operator @ found.x, operator.T @ found.y
    value = float(found.y @ images[0] / (found.y @ found.mx))  # without what elimination rounds off
    error = max(length(images[0] - value * found.mx), length(images[1] - value * found.my))
    constant = space.constant
    weight, norm = space.weighed(constant), 1 / space.turns
    x = found.x * ((constant @ weight) / (weight @ found.x))
    y = found.y * (norm / (found.y @ space.weighed(x)))
    rounding = _EPS * abs(y) @ (abs(operator) @ abs(x)) / norm
    if generator.keeps_constants:
        forcing, total = generator.matrix(p, is_forcing=True), weight @ x
        of_noise = _of_noises(space)
        doubtful = abs(x) + generator.rounding_growth * abs(x - constant)
        bound = _EPS * (constant @ (abs(forcing) @ doubtful) + abs(of_noise) @ doubtful) / total
        if bound < rounding:
            value, rounding = float((constant @ (forcing @ x) + of_noise @ x) / total), bound
    if p == 0:  # where Λ = 0
        rounding = max(rounding, abs(value))
    for each in generator.framed.motion.diffusions:  # of growth ½p²q² − ½pq², which cancels beside p = 1
        rounding += _EPS * (abs(p) + p * p) * (generator.problem.linear.epsilon**each.order * each.fastest[1]) ** 2
    return PrincipalPair(
        p=p,
        eigenvalue=value,
        right=x,
        left=y,
        derivative=float(y @ (generator.matrix(p, derivative=1) @ x) / norm),
        residual=error / operator.norm,
        rounding=float(rounding),
        sign_defects=_sign_defects(space, x, y),
        generator=generator,
    )


def _of_noises(space: Space) -> FloatArray:
    """⟨L_ξ T, 1⟩ for every function T, L_ξ the generator of all noises, shape (size,): 0 but for factors."""
    total = np.zeros(space.size)
    for own in space.axes:
        if own.slope:  # the first of its functions is 1
            loads = [axis.matrix(None)[0] if axis is own else axis.matrix(one) @ axis.constant for axis in space.axes]
            total += space.product(loads)
    return total


def length(vector: FloatArray) -> float:
    """Its Euclidean norm."""
    return math.sqrt(vector @ vector)


def _sign_defects(space: Space, x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Shares of T and of T* that are not positive, by their own size or by |T T*|, whichever is larger.

    T T* looks where the tilted density lives: a strong tilt hides the sign change of another pair from P_s.
    """
    measure, right, left = space.on_grid(x, y)
    tilted = np.abs(right * left) * measure

    def share(values: FloatArray) -> float:
        negative = values <= 0
        if not negative.any():
            return 0.0
        sizes = np.abs(values) * measure, tilted
        return max(float(np.sum(size[negative]) / np.sum(size)) for size in sizes)

    return share(right), share(left)


class PairDerivatives:
    """(L − Λ)v = f with ⟨T*, v⟩ = 0, where ⟨T*, f⟩ = 0, and the same with the adjoint of L.

    A system is solved with a shift a little off Λ, what that leaves of T in v is removed, and v is improved by its
    residual.

    Args:
        pair: Λ(p), T and T*.

    Attributes:
        norm: ⟨T*, T⟩ on the domain.
        size: a bound on ‖L − Λ‖.
    """

    def __init__(self, pair: PrincipalPair) -> None:
        self.pair, self._weighed = pair, (pair.space.weighed(pair.right), pair.space.weighed(pair.left))
        self.norm = float(pair.left @ self._weighed[0])
        self._pencil = pair.generator.at(pair.p)
        self._operator = self._pencil.shifted(pair.eigenvalue)
        self.size = self._operator.norm

    @cached_property
    def _factor(self) -> Factors:
        return self._pencil.factorised(self.pair.eigenvalue + BESIDE_IT[0] * self.pair.generator.framed.unit_rate)

    def solve(self, source: FloatArray, *, adjoint: bool = False) -> FloatArray:
        """v from the load f; each refinement leaves 1e-6 of a rate over the gap of the spectrum."""
        own, other = self.pair.right, self.pair.left
        weighed, operator, change = self._weighed[0], self._operator, 0.0 * own
        if adjoint:
            own, other, weighed, operator = other, own, self._weighed[1], operator.T
        with one_thread():
            for _ in range(REFINEMENTS):
                rest = source - operator @ change
                rest -= (other @ rest) / self.norm * weighed
                step = self._factor.solve(rest, transposed=adjoint)
                step -= (other @ self.pair.space.weighed(step)) / self.norm * own
                change += step
                if length(step) <= REFINED * length(change):
                    break
        return change

    @cached_property
    def _slope(self) -> KroneckerSum:
        """L′."""
        return self.pair.generator.matrix(self.pair.p, derivative=1)

    @cached_property
    def _curved(self) -> FloatArray:
        """L″T."""
        return self.pair.generator.matrix(self.pair.p, derivative=2) @ self.pair.right

    @cached_property
    def _mixed(self) -> FloatArray:
        """2(L′ − Λ′)T′."""
        return 2 * (self._slope @ self.by_p - self.pair.derivative * self.pair.space.weighed(self.by_p))

    @cached_property
    def by_p(self) -> FloatArray:
        """T′: (L − Λ)T′ = −(L′ − Λ′)T."""
        return self.solve(self.pair.derivative * self._weighed[0] - self._slope @ self.pair.right)

    @cached_property
    def adjoint_by_p(self) -> FloatArray:
        """T*′/P_s."""
        return self.solve(self.pair.derivative * self._weighed[1] - self._slope.T @ self.pair.left, adjoint=True)

    @cached_property
    def second_by_p(self) -> FloatArray:
        """T″: (L − Λ)T″ = −(L″ − Λ″)T − 2(L′ − Λ′)T′."""
        return self.solve(self.second_derivative * self._weighed[0] - self._curved - self._mixed)

    @cached_property
    def second_derivative(self) -> float:
        """Λ″(p) = ⟨T*, L″T⟩ + 2⟨T*, (L′ − Λ′)T′⟩."""
        return float(self.pair.left @ (self._curved + self._mixed) / self.norm)


def second_derivative(pair: PrincipalPair) -> float:
    """Λ″(p), see `PairDerivatives`."""
    return PairDerivatives(pair).second_derivative


def slope_rounding(pair: PrincipalPair) -> float:
    """Bound on the effect of rounding on Λ′."""
    slope = pair.generator.matrix(pair.p, derivative=1)
    bound = abs(pair.left) @ (abs(slope) @ abs(pair.right))
    return float(_EPS * bound * pair.space.turns)
