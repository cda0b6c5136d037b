"""The principal eigenvalue of L(p), Eq. (19), with both eigenfunctions; and the rightmost part of the spectrum.

For a real shift σ > Λ the resolvent (σ − L)⁻¹ is a positive operator whose largest eigenvalue is 1/(σ − Λ):
seen from the right, Λ is the nearest eigenvalue. From there, or quicker from the pair at a neighbouring p,
two-sided Rayleigh quotient iteration converges cubically. That it found the principal pair is checked by the one
property that no other pair has: T > 0 and T* > 0 (Perron-Frobenius; one of the two is enough), as far as a mesh can
tell. It cannot where slow noise has two places between which it hardly ever passes; `adapt.resolve` looks at both, and
for noise with states every search begins on the right.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg
from scipy.sparse import bmat
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs, splu

from fpsolve.arrays import FloatArray
from fpsolve.errors import NotConverged
from fpsolve.fem.generator import Generator
from fpsolve.fem.space import CylinderSpace
from fpsolve.model.markov_chain import MarkovChain

BACKWARD_ERROR_GOAL = 1e-14
BACKWARD_ERROR_LIMIT = 1e-11
POSITIVE = 1e-2
"""T, or T*, is taken for positive where no more than this share of it has the wrong sign, the least of all found."""
SURELY_POSITIVE = 1e-4
"""The same for a pair with which the search ends at once."""
_EPS = float(np.finfo(float).eps)
MAX_ITERATIONS = 12
STEPS_PER_FACTOR = 3
MAX_DENSE_UNKNOWNS = 4000
SURVEYED_UNKNOWNS = 600
"""Up to so many, a chain is checked by all eigenvalues."""


@dataclass(frozen=True, eq=False)
class PrincipalPair:
    """Λ(p) with its eigenfunctions on a mesh.

    Attributes:
        p: the moment.
        value: Λ(p), per unit time.
        right: coefficients of T, shape (size,); its mean over the weight of the space, P_s without a tilt, is 1.
        left: coefficients of T*/P_s, shape (size,); ∫T T* dφ dξ over the full circle is 1.
        derivative: Λ′(p) = ⟨T*, L′(p) T⟩ (Hellmann-Feynman).
        residual: the larger of the two backward errors ‖(L − Λ)T‖/(‖L‖‖T‖), also for T*.
        rounding: bound on the effect of rounding on `value`.
        sign_defects: shares of T and of T* that are not positive, by their own size or by |T T*|.
        generator: what was solved.
    """

    p: float
    value: float
    right: FloatArray = field(repr=False)
    left: FloatArray = field(repr=False)
    derivative: float
    residual: float
    rounding: float
    sign_defects: tuple[float, float]
    generator: Generator = field(repr=False)


def principal_pair(
    generator: Generator,
    p: float,
    *,
    start: PrincipalPair | Sequence[PrincipalPair] | None = None,
    guess: float | None = None,
) -> PrincipalPair:
    """The principal eigenvalue Λ(p) of Eq. (19) with T and T*.

    Args:
        generator: the discrete tilted generator.
        p: the moment.
        start: the pair of a neighbouring p or of another mesh, or several pairs of one mesh, between which the
            eigenfunctions are interpolated in p; it saves time.
        guess: a number near Λ(p), where a positive T is sought if a mesh with unresolved layers has spurious
            eigenvalues on the right.

    Raises:
        NotConverged: the iteration stalls, or both T and T* change sign: the mesh does not resolve the problem.
            `partial` is the pair that was reached.
    """
    one = generator.space.constant()  # T₀ and T₀*/P_s of weak noise, Eqs. (26) and (28)
    pairs = [start] if isinstance(start, PrincipalPair) else start
    searches: list[Callable[[], tuple[FloatArray, FloatArray]]] = [
        lambda: _carried(pairs, p, generator.space) if pairs else (one, one),
        lambda: _from_the_right(generator, p),
    ]
    if isinstance(generator.problem.noise, MarkovChain):  # states that hardly mix have a positive pair each
        searches.reverse()
    if guess is not None:
        searches.append(lambda: _most_positive(generator, p, guess))
    found: list[PrincipalPair] = []
    for search in searches:
        try:
            vectors = search()
        except NotConverged:  # the other searches may still find it
            continue
        found.append(_rayleigh_iteration(generator, p, *vectors))
        if found[-1].residual <= BACKWARD_ERROR_LIMIT and min(found[-1].sign_defects) <= SURELY_POSITIVE:
            return _rightmost(found[-1])
    pair = min(found, key=lambda pair: (pair.residual > BACKWARD_ERROR_LIMIT, min(pair.sign_defects)))
    if not (pair.residual <= BACKWARD_ERROR_LIMIT and min(pair.sign_defects) <= POSITIVE):
        raise NotConverged(
            f"the principal eigenvalue at p = {p:g} was not found on this mesh: backward error {pair.residual:.1e} "
            f"(at most {BACKWARD_ERROR_LIMIT:g}), and {min(pair.sign_defects):.1e} of the more positive of T and "
            f"T* has the wrong sign (at most {POSITIVE:g}); use more cells, in the phase and in the noise",
            pair,
        )
    return _rightmost(pair)


def _rightmost(pair: PrincipalPair) -> PrincipalPair:
    """The pair; for a chain and few unknowns only after a look at the whole spectrum.

    States may hardly mix, or the phase not leave a ray: then other pairs have a positive T, or T*, too.
    """
    generator = pair.generator
    if isinstance(generator.problem.noise, MarkovChain) and generator.space.size <= SURVEYED_UNKNOWNS:
        rightmost = spectrum(generator, pair.p, 1)[0]
        if abs(rightmost - pair.value) > 1e-6 * max(abs(rightmost), generator.unit_rate):
            raise NotConverged(
                f"at p = {pair.p:g} the eigenvalue {rightmost:.6g} lies right of {pair.value:.6g}, though that has "
                "eigenfunctions of one sign; use more cells in the phase",
                pair,
            )
    return pair


def second_derivative(pair: PrincipalPair) -> float:
    """Λ″(p) = ⟨T*, L″T⟩ + 2⟨T*, (L′ − Λ′)T′⟩, T′ from the bordered system (L − Λ)T′ = −(L′ − Λ′)T, ⟨T*, T′⟩ = 0."""
    generator, x, y = pair.generator, pair.right, pair.left
    mass, slope = generator.mass, generator.matrix(pair.p, derivative=1)
    norm = y @ (mass @ x)
    source = slope @ x - pair.derivative * (mass @ x)
    singular = generator.matrix(pair.p, shift=pair.value)
    system = bmat([[singular, (mass @ x)[:, None]], [(y @ mass)[None], None]], format="csc")
    change = _factor(system).solve(np.append(-source, 0.0))[:-1]
    mixed = y @ (slope @ change) - pair.derivative * (y @ (mass @ change))
    return float((y @ (generator.matrix(pair.p, derivative=2) @ x) + 2 * mixed) / norm)


def spectrum(generator: Generator, p: float, k: int = 10) -> Any:
    """The k rightmost eigenvalues of L(p), by decreasing real part: complex, shape (k,).

    All eigenvalues of the dense matrix are computed (QR algorithm), so that none can be missed; use a
    full-circle mesh for the whole spectrum, a half-circle one has the π-periodic part of it only.

    Raises:
        ValueError: k is not from 1 to the number of unknowns, or these exceed `MAX_DENSE_UNKNOWNS`.
    """
    size = generator.space.size
    if size > MAX_DENSE_UNKNOWNS:
        raise ValueError(f"{size} unknowns; the whole spectrum takes at most {MAX_DENSE_UNKNOWNS}: use a coarser mesh")
    if not 1 <= k <= size:
        raise ValueError(f"k is {k}; it must be from 1 to the number of unknowns, {size}")
    root = scipy.linalg.cholesky(generator.mass.toarray(), lower=True)
    half = scipy.linalg.solve_triangular(root, generator.matrix(p).toarray(), lower=True)
    matrix = scipy.linalg.solve_triangular(root, half.T, lower=True).T
    values = scipy.linalg.eigvals(matrix, overwrite_a=True)
    return values[np.lexsort((values.imag, -values.real))][:k]


def _carried(pairs: Sequence[PrincipalPair], p: float, space: CylinderSpace) -> tuple[FloatArray, FloatArray]:
    """Both eigenfunctions at p, by Lagrange interpolation between pairs of one mesh, on a space."""
    old, nodes = pairs[0].generator.space, [pair.p for pair in pairs]
    weights = [math.prod((p - q) / (pair.p - q) for q in nodes if q != pair.p) for pair in pairs]
    right = np.sum([weight * pair.right for weight, pair in zip(weights, pairs, strict=True)], axis=0)
    left = np.sum([weight * pair.left for weight, pair in zip(weights, pairs, strict=True)], axis=0)
    return (right, left) if old is space else (space.carry(right, old), space.carry(left, old))


def _factor(matrix: Any) -> Any:
    """LU factors, ordered for a symmetric pattern and pivoting only where it must: half the time and the fill-in."""
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01)


def _from_the_right(generator: Generator, p: float) -> tuple[FloatArray, FloatArray]:
    """Right and left vectors near the principal ones, from shifts that start at an upper bound of Λ(p)."""
    mass = generator.mass
    shift = generator.upper_bound(p) + 0.25 * generator.unit_rate
    right = left = generator.space.constant()
    for _ in range(2):
        factor = _factor(generator.matrix(p, shift=shift))
        right, inverse_distance = _dominant(lambda v, lu=factor: -lu.solve(mass @ v), right, p)
        left, _unused = _dominant(lambda v, lu=factor: -lu.solve(mass @ v, trans="T"), left, p)
        shift -= 0.95 / inverse_distance
    return right, left


def _most_positive(generator: Generator, p: float, guess: float) -> tuple[FloatArray, FloatArray]:
    """Right and left vectors of that real eigenvalue among the nearest to a guess whose T is the most positive."""
    factor, mass, one = _factor(generator.matrix(p, shift=guess)), generator.mass, generator.space.constant()
    operator = LinearOperator(mass.shape, matvec=lambda v: factor.solve(mass @ v), dtype=float)
    try:
        inverse, vectors = eigs(operator, k=min(16, one.size - 2), v0=one, tol=1e-6, maxiter=200)
    except ArpackNoConvergence:
        return one, one
    reals = [
        (value.real, vector.real * np.sign(one @ (mass @ vector.real)))
        for value, vector in zip(inverse, vectors.T, strict=True)
        if abs(value.imag) <= 1e-6 * abs(value)
    ]
    if not reals:
        return one, one
    value, right = min(reals, key=lambda item: _sign_defects(generator, item[1], one)[0])
    nearby = _factor(generator.matrix(p, shift=guess + 1 / value + 1e-8 * generator.unit_rate))
    left = nearby.solve(mass @ nearby.solve(mass @ one, trans="T"), trans="T")
    return right, left


def _dominant(apply: Any, start: FloatArray, p: float) -> tuple[FloatArray, float]:
    """The dominant eigenvector of a positive operator, and its eigenvalue, by Arnoldi iteration."""
    operator = LinearOperator((start.size, start.size), matvec=apply, dtype=float)
    try:
        values, vectors = eigs(operator, k=1, v0=start, tol=1e-4, maxiter=200)
    except ArpackNoConvergence as failure:
        raise NotConverged(
            f"the Arnoldi iteration for p = {p:g} did not settle; use more or higher-degree cells"
        ) from failure
    return vectors[:, 0].real, float(values[0].real)


def _rayleigh_iteration(generator: Generator, p: float, x: FloatArray, y: FloatArray) -> PrincipalPair:
    """Two-sided Rayleigh quotient iteration (Ostrowski) until the backward error stops falling."""
    operator, mass = generator.matrix(p), generator.mass
    size = np.max(abs(operator).sum(axis=0))
    best = (*_quotient(operator, mass, size, x, y), x, y)
    for step in range(MAX_ITERATIONS):
        value, residual, x, y = best
        if residual <= BACKWARD_ERROR_GOAL and step:  # the pair of a p very near by passes at once
            break
        try:
            factor = _factor(generator.matrix(p, shift=value))
        except RuntimeError:  # singular: the shift is the eigenvalue to the last bit
            factor = _factor(generator.matrix(p, shift=value + 1e-10 * generator.unit_rate))
        for _ in range(STEPS_PER_FACTOR):
            x, y = factor.solve(mass @ x), factor.solve(mass @ y, trans="T")
            x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
            break
        new = (*_quotient(operator, mass, size, x, y), x, y)
        if new[1] > 0.5 * residual and residual <= BACKWARD_ERROR_LIMIT and step:
            break
        best = new
    return _pair(generator, p, operator, *best)


def _quotient(operator: Any, mass: Any, size: float, x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Two-sided Rayleigh quotient and the larger of the two backward errors."""
    image, weighed = operator @ x, mass @ x
    value = (y @ image) / (y @ weighed)
    right = np.linalg.norm(image - value * weighed) / np.linalg.norm(x)
    left = np.linalg.norm(operator.T @ y - value * (mass @ y)) / np.linalg.norm(y)
    return float(value), float(max(right, left) / size)


def _pair(
    generator: Generator, p: float, operator: Any, value: float, residual: float, x: FloatArray, y: FloatArray
) -> PrincipalPair:
    """Normalise both vectors, judge their signs, and take Λ from the formula that rounding harms less."""
    mass, one = generator.mass, generator.space.constant()
    x = x * (one @ (mass @ one)) / (one @ (mass @ x))
    y = y / (y @ (mass @ x) * 2 * np.pi / generator.space.mesh.span)
    norm = y @ (mass @ x)
    rounding = _EPS * (abs(y) @ (abs(operator) @ abs(x))) / norm
    if generator.space.xi.tilt == 0 and generator.keeps_constants:
        forcing, total = generator.matrix(p, orders=slice(1, None)), one @ (mass @ x)
        bound = _EPS * (one @ (abs(forcing) @ abs(x))) / total
        if bound < rounding:
            value, rounding = one @ (forcing @ x) / total, bound
    return PrincipalPair(
        p=p,
        value=float(value),
        right=x,
        left=y,
        derivative=float(y @ (generator.matrix(p, derivative=1) @ x) / norm),
        residual=residual,
        rounding=float(rounding),
        sign_defects=_sign_defects(generator, x, y),
        generator=generator,
    )


def _sign_defects(generator: Generator, x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Shares of T and of T* that are not positive, by their own size or by |T T*|, whichever is larger.

    On seven points each way of a cell. T T* looks where the tilted density lives: a strong tilt hides the sign change
    of another pair from P_s.
    """
    space = generator.space
    local = np.linspace(0.05, 0.95, 7)
    at_phi, samples = space.phi.evaluation(local)[1], space.xi.samples(local)
    right, left = (space.evaluate(v, at_phi, samples.values) for v in (x, y))
    weight = samples.weight
    tilted = np.abs(right * left) * weight

    def share(values: FloatArray) -> float:
        sizes = np.abs(values) * weight, tilted
        return max(float(np.sum(size[values <= 0]) / np.sum(size)) for size in sizes)

    return share(right), share(left)
