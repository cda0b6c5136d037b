"""The moment Lyapunov exponent Λ(p) over many p, and what follows from it: λ = Λ′(0), Λ″(0) and δ_p."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from fpsolve import perturbation
from fpsolve.eigen import PrincipalPair, principal_pair, second_derivative
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.generator import TiltedGenerator
from fpsolve.mesh import CylinderMesh, make_mesh
from fpsolve.noise import AnyNoise, FloatArray, check_existence, finite_moments
from fpsolve.oscillator import VibroImpactOscillator

MEANINGLESS = 1e-2
"""An estimated error above this share of the scale of Λ(p) is no result."""
SEARCH_INTERVAL = (-20.0, 20.0)
REMEDY = "use more cells ([mesh] phi_cells, xi_cells) or a wider noise interval (xi_min, xi_max)"


@dataclass(frozen=True)
class Estimate:
    """A number, the estimate of its error, and what both are measured by.

    Attributes:
        scale: size of the terms that the number is the sum of, where they may cancel.
    """

    value: float
    error_estimate: float
    scale: float

    @property
    def relative_error(self) -> float:
        """The error over the larger of |value| and the scale."""
        return self.error_estimate / max(abs(self.value), self.scale, sys.float_info.min)


@dataclass(frozen=True, eq=False)
class MomentLyapunov:
    """Λ(p) at several p.

    Attributes:
        p: the moments, shape (n,), in the order asked for.
        value: Λ(p), per unit time, shape (n,).
        derivative: Λ′(p), shape (n,).
        error_estimate: estimate of |error of `value`|, from a finer mesh and a wider noise interval, with the
            bound of rounding added, shape (n,).
        residual: backward error of the eigenpairs, shape (n,).
        pairs: the eigenpairs, one for each p.
        warnings: sentences on p where `error_estimate` exceeds rtol.
    """

    p: FloatArray
    value: FloatArray
    derivative: FloatArray
    error_estimate: FloatArray
    residual: FloatArray
    pairs: tuple[PrincipalPair, ...] = field(repr=False)
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ExponentSolver:
    """Λ(p) of one oscillator and one noise on a mesh, each solve starting from the nearest p solved before.

    Args:
        oscillator: the vibro-impact oscillator.
        noise: `OrnsteinUhlenbeck`, or `NonGaussianNoise` for Eq. (7) as it stands.
        mesh: the mesh; None for the default one of `make_mesh`.

    Raises:
        NoSuchExponent: the variance of the noise is infinite.
    """

    oscillator: VibroImpactOscillator
    noise: AnyNoise
    mesh: CylinderMesh | None = None
    generator: TiltedGenerator = field(init=False)
    _finer: TiltedGenerator = field(init=False)
    _known: dict[int, dict[float, PrincipalPair]] = field(init=False, default_factory=lambda: {0: {}, 1: {}})

    def __post_init__(self) -> None:
        if not math.isfinite(self.noise.standard_deviation):
            raise NoSuchExponent(
                "the noise has infinite variance, so that it has no unit of length to mesh; choose r0 < 5/3"
            )
        mesh = make_mesh() if self.mesh is None else self.mesh
        object.__setattr__(self, "generator", TiltedGenerator(self.oscillator, self.noise, mesh))
        finer = mesh.enriched(1.15 if math.isinf(finite_moments(self.noise)[1]) else 2.0)  # 2 sees algebraic tails
        object.__setattr__(self, "_finer", TiltedGenerator(self.oscillator, self.noise, finer))

    def pair(self, p: float) -> PrincipalPair:
        """The principal eigenpair at p. Raises `NotConverged`, `NoSuchExponent`."""
        return self._solve(0, p)

    def moments(
        self, p: ArrayLike, *, rtol: float = 1e-8, advance: Callable[[], None] = lambda: None
    ) -> MomentLyapunov:
        """Λ(p) at several p; `advance` is called after each.

        Raises:
            NoSuchExponent: Λ(p) is infinite for one of the p.
            NotConverged: some p failed; `partial` is the `MomentLyapunov` of the others.
        """
        points = np.atleast_1d(np.asarray(p, dtype=float))
        if points.ndim != 1 or points.size == 0 or not np.all(np.isfinite(points)):
            raise ValueError(f"p must be a finite number or a non-empty list of finite numbers, got {p!r}")
        for point in points:
            check_existence(self.noise, float(point))
        pairs, errors, failures = {}, {}, []
        for i in np.argsort(np.abs(points), kind="stable"):
            try:
                pairs[i], errors[i] = self._solve_with_error(float(points[i]))
            except NotConverged as failure:
                failures.append(str(failure))
            advance()
        done = sorted(pairs)
        result = self._result([pairs[i] for i in done], np.array([errors[i] for i in done]), rtol)
        if failures:
            raise NotConverged("\n".join(failures), result)
        return result

    def lyapunov_exponent(self) -> Estimate:
        """λ = Λ′(0), Eq. (2). Raises `NotConverged`."""
        scale = perturbation.lyapunov_scale(self.oscillator, self.noise)
        return self._difference("λ", lambda pair: pair.derivative, scale)

    def variance_rate(self) -> Estimate:
        """Λ″(0), the asymptotic growth rate of the variance of ln ‖x‖. Raises `NotConverged`."""
        scale = perturbation.variance_rate(self.oscillator, self.noise)
        return self._difference("Λ″(0)", second_derivative, scale)

    def stability_index(self, interval: tuple[float, float] = SEARCH_INTERVAL) -> Estimate | None:
        """δ_p, the non-zero root of Λ(p); None where Λ has no such root in the interval.

        Λ is convex, so Λ(p)/p increases and has one root at most: a safeguarded Newton iteration on it.

        Raises:
            NotConverged: the mesh does not resolve some p on the way.
        """
        low, high = (float(end) for end in np.clip(interval, *finite_moments(self.noise)))
        ratio, slope, _ = self._ratio(0.0)
        p = min(max(-ratio / slope, low), high)
        tried: set[float] = set()
        for _ in range(60):
            tried.add(p)
            ratio, slope, rounding = self._ratio(p)
            low, high = (p, high) if ratio < 0 else (low, p)
            new = p - ratio / slope
            if abs(new - p) <= max(1e-13 * max(1.0, abs(p)), 4 * rounding / slope):
                break
            if not low < new < high:
                new = next((end for end in (low, high) if end not in tried), 0.5 * (low + high))
            if low == high:
                return None
            p = new
        else:
            raise NotConverged(f"the stability index did not settle, last near p = {p:g}; {REMEDY}")
        (_, slope, rounding), (finer_ratio, finer_slope, _) = self._ratio(p), self._ratio(p, level=1)
        error = (abs(finer_ratio) + 2 * rounding) / min(slope, finer_slope)  # a Newton step on the finer mesh
        return _checked("the stability index", Estimate(p, error, scale=1.0))

    def _ratio(self, p: float, level: int = 0) -> tuple[float, float, float]:
        """Λ(p)/p, its derivative and its rounding; near p = 0 by Λ′(p/2), whose error is p²Λ‴/24.

        Λ′ carries the rounding of the eigenvectors in first order, Λ in second.
        """
        if abs(p) < 1e-3:
            pair, middle = self._solve(level, 0.0), self._solve(level, p / 2)
            ratio, slope, rounding = middle.derivative, 0.5 * second_derivative(pair), 1e3 * pair.rounding
        else:
            pair = self._solve(level, p)
            ratio, rounding = pair.value / p, pair.rounding / abs(p)
            slope = (pair.derivative - ratio) / p
        if not slope > 0:
            raise NotConverged(f"Λ(p)/p does not increase at p = {p:g}, as convexity demands; {REMEDY}")
        return ratio, slope, rounding

    def _difference(self, name: str, quantity: Callable[[PrincipalPair], float], scale: float) -> Estimate:
        coarse, fine = (quantity(self._solve(level, 0.0)) for level in (0, 1))
        return _checked(name, Estimate(coarse, abs(fine - coarse) + self.pair(0.0).rounding, scale))

    def _solve(self, level: int, p: float) -> PrincipalPair:
        """The pair on the mesh (level 0) or the finer one (level 1), from the nearest p known there."""
        check_existence(self.noise, p)
        known = self._known[level]
        if p not in known:
            nearest = min(known, key=lambda other: abs(other - p), default=None)
            start = None if nearest is None else known[nearest]
            try:
                known[p] = principal_pair((self.generator, self._finer)[level], p, start=start)
            except (ArithmeticError, RuntimeError, ValueError) as failure:
                raise NotConverged(f"Λ({p:g}) is beyond floating-point numbers ({failure}); {REMEDY}") from failure
        return known[p]

    def _solve_with_error(self, p: float) -> tuple[PrincipalPair, float]:
        pair = self._solve(0, p)
        error = abs(self._solve(1, p).value - pair.value) + pair.rounding
        if p != 0:  # where Λ = 0 has no scale
            _checked(f"Λ({p:g})", self._estimate(pair, error))
        return pair, error

    def _estimate(self, pair: PrincipalPair, error: float) -> Estimate:
        """Λ(p) on the scale of the terms of Eq. (37) before they cancel."""
        scale = float(perturbation.moment_scale(self.oscillator, self.noise, pair.p))
        return Estimate(pair.value, error, scale)

    def _result(self, pairs: Sequence[PrincipalPair], errors: FloatArray, rtol: float) -> MomentLyapunov:
        estimates = [(k.p, self._estimate(k, e)) for k, e in zip(pairs, errors, strict=True) if k.p != 0]
        shares = [(p, estimate.relative_error) for p, estimate in estimates]
        short = [(p, share) for p, share in shares if share > rtol]
        warnings: tuple[str, ...] = ()
        if short:
            p, share = max(short, key=lambda item: item[1])
            warnings = (
                f"rtol = {rtol:g} is not met at {len(short)} of {len(pairs)} moments, worst at p = {p:g} with an "
                f"estimated relative error of {share:.1e}; {REMEDY}, or use a larger rtol",
            )
        return MomentLyapunov(
            p=np.array([k.p for k in pairs]),
            value=np.array([k.value for k in pairs]),
            derivative=np.array([k.derivative for k in pairs]),
            error_estimate=errors,
            residual=np.array([k.residual for k in pairs]),
            pairs=tuple(pairs),
            warnings=warnings,
        )


def _checked(name: str, estimate: Estimate) -> Estimate:
    """An estimate whose error leaves it a meaning."""
    if not estimate.relative_error <= MEANINGLESS:
        raise NotConverged(
            f"{name} = {estimate.value:.6g} has an estimated error of {estimate.error_estimate:.1g}, too much to "
            f"mean anything; {REMEDY}",
            estimate,
        )
    return estimate


def moment_lyapunov(
    oscillator: VibroImpactOscillator,
    noise: AnyNoise,
    p: ArrayLike,
    *,
    rtol: float = 1e-8,
    mesh: CylinderMesh | None = None,
) -> MomentLyapunov:
    """The moment Lyapunov exponent Λ(p) = lim (1/t) ln E‖x(t)‖^p, Eq. (1), as the principal eigenvalue of Eq. (19).

    Args:
        oscillator: the vibro-impact oscillator.
        noise: `OrnsteinUhlenbeck`, or `NonGaussianNoise` for Eq. (7) as it stands.
        p: one moment, or an array of shape (n,).
        rtol: an `error_estimate` above rtol·max(|Λ|, the terms of Eq. (37) before they cancel) gives a warning.
        mesh: the mesh; None for the default one, made for weak noise.

    Raises:
        ValueError: p is not finite, or empty.
        NoSuchExponent: Λ(p) is infinite.
        NotConverged: the mesh does not resolve the problem at some p; `partial` is the result for the others.
    """
    return ExponentSolver(oscillator, noise, mesh).moments(p, rtol=rtol)
