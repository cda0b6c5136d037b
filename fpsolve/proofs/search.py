"""From problems to certificates: trial functions are enlarged until the bounds that follow from them are close enough.

For each trial function, W of `verify` is sought with the least δ. Nothing here needs to be right, nor exact: what is
found is verified. Trial functions are those of Galerkin's method with the weight P_s e^{2g}. With T = e^g u, g′ = β,
the noise part of L is −½ ν ∫ P_s T_z S_z in its weak form, so that u solves

    −½ ν ⟨u_z + βu, w_z + βw⟩ + ⟨(F₀ + z F₁) u, w⟩ = Λ ⟨u, w⟩,      ⟨u, w⟩ = ∫∫ P_s e^{2g} u w dφ dz.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from scipy.special import roots_jacobi

from fpsolve.arrays import FloatArray
from fpsolve.fem.factors import sparse_lu
from fpsolve.proofs.balls import above, ball, balls, below, precision
from fpsolve.proofs.basis import OTHERS, Basis, Core, Whole, hermite_table
from fpsolve.proofs.bounds import LOWER, UPPER, Bounder, Bounds, FrozenBounds, Trial
from fpsolve.proofs.certificate import NOTHING, BasisRecord, Certificate, Enclosure, SideRecord, enclosure_of
from fpsolve.proofs.statement import Cylinder, Statement, cylinder
from fpsolve.proofs.verify import objection

SMALLEST, GROWTH, MOST, MOST_UNKNOWNS = (5, 9), 1.35, 399, 25_000
"""Modes on either side and polynomials of the first trial, by what one of both grows, how far each and both."""
ABSENT = 1e9
"""What a missing bound counts for."""
PATIENCE, PATIENCE_FAR, PROGRESS, FAR = 2, 6, 0.7, 1e-2
"""Enlargements that do not bring the bounds closer by a factor, after which no more are tried, of bounds near to each
other and far apart; that factor; and the share of the number from which on they are far apart."""
ROUGH, EARLY = 30.0, 0.1
"""Sizes of a trial's highest functions, in widths, above which it is too small, and the share of the time up to which
such trials are passed over."""
WHOLE_BELOW = 6.0
"""End exponents a below which the ends of the support carry too much weight to be cut off."""
CELLS, REACH, FROZEN_FROM, CANDIDATES = 480, 10.0, 3.5, 24
REST = 1e-8
"""What Taylor's formula may leave over; verification leaves less, so that it finds all that is found here."""
SLACK = 1e-6
"""Of the mismatch, relative, so that another machine's rounding does not matter."""
STEEPEST = 1e6
"""More than W needs to be anywhere; for q = −1 it would grow beyond all bounds."""
NUDGE = 1e-10
"""Of a shift off an eigenvalue, relative."""
RULE_REACH = 11.0
"""Standard deviations of the weight that the quadrature covers on either side."""


@dataclass(frozen=True)
class Timer:
    """Seconds of the processor that run from when this is made: of proofs, whose operations are not counted.

    Attributes:
        seconds: how many there are.
        started: by `time.process_time`.
    """

    seconds: float
    started: float = field(default_factory=lambda: time.process_time())

    @property
    def elapsed(self) -> float:
        """How many are gone."""
        return time.process_time() - self.started


@dataclass(frozen=True)
class Pair:
    """Λ(p) and u, or λ and f.

    Attributes:
        value: Λ(p) or λ.
        table: u_km, complex, modes −K … K.
        centre: the mean of z in the moment.
    """

    value: float
    table: FloatArray
    centre: float

    @property
    def edges(self) -> tuple[float, float]:
        """Sizes of the coefficients of the highest mode and of the highest degree."""
        return float(np.abs(self.table[-1]).sum()), float(np.abs(self.table[:, -1]).sum())

    @property
    def cosine(self) -> FloatArray:
        """Coefficients of cos 2kφ, k = 0 … K."""
        half = self.table[len(self.table) // 2 :].real * 2
        half[0] /= 2
        return half

    @property
    def sine(self) -> FloatArray:
        """Coefficients of sin 2kφ."""
        return -2 * self.table[len(self.table) // 2 :].imag


class Galerkin:
    """The eigenproblem with modes up to `waves` and polynomials below `degrees`."""

    def __init__(self, noise: Cylinder, basis: Basis, p: float | None, waves: int, degrees: int) -> None:
        self.noise, self.waves, self.degrees = noise, waves, degrees
        mass, position, wandering = _axis(noise, basis, degrees)
        modes = sp.identity(2 * waves + 1)
        still, driven = (self._turning(i, 0.0 if p is None else p) for i in (0, 1))
        self.mass = sp.kron(modes, mass, format="csc")
        self.position = sp.kron(driven / 2, mass) if noise.is_white else sp.kron(modes, position)  # in front of F₁
        push = self.position @ sp.kron(driven, sp.identity(degrees))
        self.matrix = (sp.kron(modes, wandering) + sp.kron(still, mass) + push).tocsc()
        one = basis.one(degrees).astype(float)
        self.one = np.zeros((2 * waves + 1, degrees))
        self.one[waves, : len(one)] = one

    def _turning(self, i: int, p: float) -> sp.csr_matrix:
        """F_i on the modes −K … K."""
        bands = self.noise.bands(i, ball(p), self.waves).astype(complex)
        size = bands.shape[1]
        rows = [sp.diags(bands[d][max(0, 1 - d) : size - max(0, d - 1)], 1 - d, shape=(size, size)) for d in range(3)]
        return sum(rows[1:], rows[0]).tocsr()

    @np.errstate(all="ignore")
    def pair(self, guess: float) -> Pair:
        """The eigenvalue nearest to a guess of Λ(p), by inverse iteration from a constant; NaN on overflow."""
        u = self.one.ravel().astype(complex)
        adjoint, value = u, guess
        for _ in range(2):
            factors = sparse_lu((self.matrix - (value + NUDGE * (1 + abs(value))) * self.mass).tocsc())
            for _ in range(4):
                u, adjoint = factors.solve(self.mass @ u), factors.solve(self.mass @ adjoint, "H")
                u, adjoint = (vector / vector[np.argmax(np.abs(vector))] for vector in (u, adjoint))
            value = float(np.real(np.vdot(adjoint, self.matrix @ u) / np.vdot(adjoint, self.mass @ u)))
        centre = np.real(np.vdot(adjoint, self.position @ u) / np.vdot(adjoint, self.mass @ u))
        mean = (self.mass @ u)[self.waves * self.degrees]
        return Pair(value, self._table(u / mean), float(centre))

    def drift(self) -> Pair:
        """λ, and f of mean 0 with L(0) f = λ − q − κh."""
        still, driven = np.zeros((2, *self.one.shape), complex)
        for i, part in enumerate((still, driven)):
            part[self.waves - 1 : self.waves + 2] = np.outer(self.noise.growth(i), self.one[self.waves]).astype(complex)
        load = self.mass @ still.ravel() + self.position @ driven.ravel()
        column = sp.csc_matrix(self.mass @ self.one.ravel()).T
        bordered = sp.bmat([[self.matrix, -column], [column.T, None]], format="csc")
        found = sparse_lu(bordered).solve(np.append(-load, 0.0))
        return Pair(float(found[-1].real), self._table(found[:-1]), 0.0)

    def _table(self, u: FloatArray) -> FloatArray:
        """Modes −K … K of a real function, shape (modes, degrees)."""
        table = u.reshape(2 * self.waves + 1, self.degrees)
        return (table + table[::-1].conj()) / 2


def _axis(noise: Cylinder, basis: Basis, degrees: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """⟨B_n, B_m⟩, ⟨z B_n, B_m⟩ and the noise's part of L, shape (degrees, degrees) each."""
    if (known := basis.products(noise, degrees)) is not None:
        return known
    z, weight = _quadrature(basis, noise, degrees)
    values, slopes = _tabulated(basis, z, degrees)
    full = slopes + basis.gauge * values
    diffusion = float(noise.nu) / 2 * (full * weight) @ full.T
    return (values * weight) @ values.T, (values * weight * z) @ values.T, -diffusion


def _quadrature(basis: Basis, noise: Cylinder, degrees: int) -> tuple[FloatArray, FloatArray]:
    """Gauss's z and weights that sum to 1."""
    a = float(noise.slope)
    if not basis.is_core:
        z, weight = roots_jacobi(2 * degrees + 40, a, a)
        return z, weight / weight.sum()
    reach = basis.centre + RULE_REACH * basis.scale * np.array([-1.0, 1.0])
    low, high = np.clip(reach, -1, 1) if noise.is_bounded else reach
    x, weight = np.polynomial.legendre.leggauss(4 * degrees + 100)
    z = (low + high) / 2 + (high - low) / 2 * x
    log = a * np.log1p(-z * z) if noise.is_bounded else -z * z / 2
    log += 2 * basis.gauge * z
    weight *= np.exp(log - log.max())
    return z, weight / weight.sum()


def _tabulated(basis: Basis, z: FloatArray, degrees: int) -> tuple[FloatArray, FloatArray]:
    """B_m(z) and B_m′(z), (degrees, points) each."""
    if basis.is_core:
        root = np.sqrt(np.arange(degrees))
        values = hermite_table((z - basis.centre) / basis.scale, root)
        return values, root[:, None] * np.concatenate([0 * values[:1], values[:-1]]) / basis.scale
    unit = balls(np.eye(degrees))
    values, slopes = (
        np.polynomial.chebyshev.chebval(z, part.astype(float).T) for part in (basis.values(unit), basis.slope(unit))
    )
    return values, slopes


@precision()
def enclose(
    stated: Statement,
    p: float | None,
    width: float,
    guess: float,
    timer: Timer,
    progress: Callable[[], None],
) -> Enclosure:
    """Bounds on Λ(p), or on λ where p is None, that are at most `width` apart, if that can be done.

    Args:
        stated: of what.
        p: the moment.
        guess: Λ(p), about.
        timer: of the time for it; the next trial is foreseen from the last one, so that it may take a third more.
        progress: called after each trial function.

    Returns:
        The closest bounds that were found.
    """
    noise, size = cylinder(stated), SMALLEST
    if noise.states is not None:
        size = size[0], len(noise.states)
    found, closest = list[Certificate](), math.inf
    for basis in bases(noise, p):
        for certificate, waves, degrees in _enlarged(stated, noise, basis, p, guess, width, size, timer, progress):
            if _apart(certificate) <= width and not objection(certificate):
                return enclosure_of(certificate)
            found.append(certificate)
            if _apart(certificate) < closest:
                closest, size = _apart(certificate), (waves, degrees)
    proven = (each for each in sorted(found, key=_apart) if not objection(each))
    return next(map(enclosure_of, proven), NOTHING)


def _enlarged(
    stated: Statement,
    noise: Cylinder,
    basis: Basis,
    p: float | None,
    guess: float,
    width: float,
    size: tuple[int, int],
    timer: Timer,
    progress: Callable[[], None],
) -> Iterator[tuple[Certificate, int, int]]:
    """Certificates by larger and larger trials, as long as the bounds come closer, and the sizes of the trials.

    They are to be verified. While it costs little, trials whose highest functions tell that they are too small are
    passed over; the last one serves where no larger one does.
    """
    delta, idle, value, (waves, degrees) = math.inf, 0, math.inf, size
    cost, unknowns, edge = 0.0, (2 * waves + 1) * degrees, math.inf
    passed: tuple[Basis, Pair, int, int] | None = None
    while (
        idle < (PATIENCE_FAR if delta > FAR * abs(value) else PATIENCE) and (2 * waves + 1) * degrees <= MOST_UNKNOWNS
    ):
        start = timer.elapsed
        cost, unknowns = cost * ((2 * waves + 1) * degrees / unknowns) ** 1.5, (2 * waves + 1) * degrees
        if start + cost > timer.seconds:
            break
        try:
            pair, basis = _solved(noise, basis, p, guess, waves, degrees)
        except ArithmeticError:
            break
        value = pair.value
        if not math.isfinite(value):
            break
        edges = pair.edges if noise.states is None else (pair.edges[0], 0.0)
        before, edge = edge, max(edges)
        if ROUGH * width < edge < PROGRESS * before and start < EARLY * timer.seconds:
            passed = basis, pair, waves, degrees
        else:
            passed = None
            certificate = certificate_of(stated, noise, basis, p, pair)
            progress()
            if certificate is not None:
                idle = 0 if _apart(certificate) < PROGRESS * delta else idle + 1
                delta = min(delta, _apart(certificate))
                yield certificate, waves, degrees
            elif delta < math.inf:
                idle += 1
        cost = timer.elapsed - start
        waves, degrees = (
            min(math.ceil(GROWTH * n) + 1, MOST) if of_it > 0.1 * edge else n
            for n, of_it in zip((waves, degrees), edges, strict=True)
        )
    if passed is not None:
        basis, pair, waves, degrees = passed
        certificate = certificate_of(stated, noise, basis, p, pair)
        progress()
        if certificate is not None:
            yield certificate, waves, degrees


def _apart(certificate: Certificate) -> float:
    """How far the bounds of a certificate are apart; one that is missing counts as far away."""
    return sum(ABSENT if side is None else side.delta for side in (certificate.upper, certificate.lower))


def bases(noise: Cylinder, p: float | None) -> Iterator[Basis]:
    """What is worth trying, in this order: the whole support, or a core about where the noise is in the moment."""
    slope = float(noise.slope)
    if (kind := noise.law.bases[0]) in OTHERS:
        yield OTHERS[kind]
        return
    if noise.is_bounded and slope < WHOLE_BELOW:
        yield Whole()
        return
    driven = float(noise.growth(1)[1].real)
    gauge = 0.0 if p is None else p * driven / (float(noise.nu) * slope)  # by perturbation theory
    # z with b(z) = β
    yield _core(noise, 2 * gauge / (slope + math.hypot(slope, 2 * gauge)) if noise.is_bounded else gauge / slope)
    if noise.is_bounded and slope < 2 * WHOLE_BELOW:
        yield Whole()


def _core(noise: Cylinder, centre: float) -> Core:
    """Polynomials about a centre, with the gauge that puts their weight there; none for λ, at 0."""
    slope = float(noise.slope)
    if not noise.is_bounded:
        return Core(centre, 1.0, slope * centre)
    return Core(centre, 1 / math.sqrt(2 * slope + 3), slope * centre / (1 - centre**2))


def _solved(
    noise: Cylinder, basis: Basis, p: float | None, guess: float, waves: int, degrees: int
) -> tuple[Pair, Basis]:
    """A trial, about the place where the noise is in the moment."""
    if p is None:
        return Galerkin(noise, basis, None, waves, degrees).drift(), basis
    pair = Galerkin(noise, basis, p, waves, degrees).pair(guess)
    if basis.is_core and 0.3 * basis.scale < abs(pair.centre - basis.centre) < 3 * basis.scale:
        basis = _core(noise, pair.centre)
        pair = Galerkin(noise, basis, p, waves, degrees).pair(guess)
    return pair, basis


def certificate_of(stated: Statement, noise: Cylinder, basis: Basis, p: float | None, pair: Pair) -> Certificate | None:
    """The closest bounds that a trial gives, before they are verified; None where there are none."""
    trial = Trial(noise, None if p is None else ball(p), pair.value, basis, pair.cosine, pair.sine)
    phases = max(128, 16 * len(pair.cosine))
    upper, lower = _sides(trial, phases)
    if upper is None and lower is None:
        return None
    return Certificate(
        p=p,
        stated=stated,
        mu=pair.value,
        basis=BasisRecord(kind=basis.kind, centre=basis.centre, scale=basis.scale, gauge=basis.gauge),
        cosine=pair.cosine.tolist(),
        sine=pair.sine.tolist(),
        upper=upper,
        lower=lower,
        phases=phases,
    )


@dataclass(frozen=True)
class Half:
    """Cells from the middle outward, on the right; the left is mirrored onto it.

    Attributes:
        nodes: z at the ends of cells, increasing from the middle on; one more than cells.
        mismatch: above e on each cell.
        inward: below B on each cell.
        beta: β.
        frozen: what is known at the nodes beyond which T may be frozen; None where u serves to the end of the support.
        nu: floats below and above ν.
        sense: q.
        square: q in front of W²; 0 for the drift of ln‖x‖.
    """

    nodes: FloatArray
    mismatch: FloatArray
    inward: FloatArray
    beta: float
    frozen: Mapping[int, FrozenBounds] | None
    nu: tuple[float, float]
    sense: int
    square: int

    def over_nu(self, amount: float) -> float:
        """Below amount/ν."""
        return amount / self.nu[int(amount > 0)]

    def march(self, delta: float) -> tuple[FloatArray, float] | None:
        """The largest W ≥ 0 from 0 on that (*) allows for this δ, at nodes to where the tail is safe, and κ beyond.

        Outward W may grow like e^{z²/2}, so that δ need hardly exceed the mean of e under the law of the noise in the
        moment, and is far below its maximum. None where there is no W; κ is 0 at the end of the support.
        """
        values = [0.0]
        for j, inward in enumerate(self.inward):
            width = self.nodes[j + 1] - self.nodes[j]
            value = _step(values[-1], width, self.over_nu(delta - self.mismatch[j]), inward, self.square)
            if value is None:
                return None
            values.append(value)
            frozen = None if self.frozen is None else self.frozen.get(j + 1)
            kappa = None if frozen is None else self._tail(delta, j + 1, value, frozen)
            if kappa is not None:
                return np.array(values), kappa
        return (np.array(values), 0.0) if self.frozen is None else None

    def _tail(self, delta: float, j: int, value: float, frozen: FrozenBounds) -> float | None:
        """κ beyond a node, if there is one."""
        drop, mismatch, growth = frozen.above(self.sense)
        pull, most = frozen.drift - self.beta, (value - drop) * (1 - 1e-12)
        least = max(-self.sense * self.beta, max(growth, 0.0) / (self.nu[0] * frozen.slope)) * (1 + 1e-12)
        kappa = min(most, max(pull, least)) if self.square > 0 else most
        if kappa < least or pull <= 0 or self.nodes[j] < 0:
            return None
        room = self.over_nu(delta - mismatch) * (1 - 1e-12 if delta > mismatch else 1 + 1e-12)
        return kappa if room + (1 - 1e-12) * _pull(kappa, pull, self.square) > 0 else None


def _step(value: float, width: float, room: float, inward: float, q: int) -> float | None:
    """W at the end of a cell from W at its beginning, so that (*) holds at both and between.

    For q = −1 its right side is convex; where that matters, −½ q W² ≥ 0 is left out.
    """
    if not math.isfinite(room):
        return None
    found = value + 2 * width * (room + _pull(value, inward, q))
    if q < 0 and (inward < 0 or found < value):
        q = 0
        found = value + 2 * width * (room + value * inward)
    if _pull(found, inward, q) < _pull(value, inward, q):
        linear, rest = 1 - 2 * width * inward, value + 2 * width * room
        square = linear**2 + 4 * width * q * rest
        if rest < 0 or square < 0 or (linear <= 0 and not q):
            return None
        found = min(found, 2 * rest / (linear + math.sqrt(square)))
    if found < 0 or not math.isfinite(found):
        return None
    growth = found - value
    return min(value + growth * (1 - 1e-12 if growth > 0 else 1 + 1e-12), STEEPEST)


def _pull(value: float, inward: float, q: int) -> float:
    """W B − ½ q W²."""
    return value * inward - q * value**2 / 2


def _sides(trial: Trial, phases: int) -> tuple[SideRecord | None, SideRecord | None]:
    """The least δ of the upper and of the lower bound, to 1 %, each None where there is none."""
    bounder = Bounder(trial, phases, REST)
    if (covered := trial.basis.cover(trial.cosine.shape[1])) is not None:
        bounds = bounder.bounds(*covered)
        if not np.all(bounds.is_positive):
            return None, None
        most = (max(float(np.max(bounds.above(q))), 1e-18) * (1 + SLACK) for q in (UPPER, LOWER))
        upper, lower = (SideRecord(delta=delta, nodes=[], values=[], tails=None) for delta in most)
        return upper, lower
    nodes = _nodes(trial)
    bounds = bounder.bounds(nodes[:-1], nodes[1:])
    if not np.any(bounds.is_positive):
        return None, None
    inward = np.maximum(np.abs(bounds.inward[0]), np.abs(bounds.inward[1]))
    middle = int(np.argmin(np.where(bounds.is_positive, inward, np.inf)))
    frozen = _frozen(bounder, nodes, bounds, middle) if trial.basis.is_core else (None, None)
    nu, caution = (below(trial.noise.nu), above(trial.noise.nu)), SLACK * 1e-3
    low, high = (end - sign * caution * (1 + np.abs(end)) for sign, end in zip((1, -1), bounds.inward, strict=True))
    found = []
    for q in (UPPER, LOWER):
        beta, square = (trial.basis.gauge, q) if trial.p is not None else (0.0, 0)
        excess = bounds.above(q)
        least = max(float(np.min(excess)), 1e-18)
        excess = excess + SLACK * np.abs(excess)
        left = Half(-nodes[middle::-1], excess[:middle][::-1], -high[:middle][::-1], -beta, frozen[0], nu, q, square)
        right = Half(nodes[middle:], excess[middle:], low[middle:], beta, frozen[1], nu, q, square)
        found.append(_least(left, right, least))
    return found[0], found[1]


def _nodes(trial: Trial) -> FloatArray:
    """Ends of cells: equal ones on the core, or in the angle on the whole support."""
    basis = trial.basis
    if not basis.is_core:
        nodes = np.sin(np.linspace(-math.pi / 2, math.pi / 2, CELLS + 1))
        nodes[0], nodes[-1] = -1.0, 1.0
        return nodes
    low, high = basis.centre + REACH * basis.scale * np.array([-1.0, 1.0])
    if trial.noise.is_bounded:
        low, high = max(low, -0.999), min(high, 0.999)
    return np.linspace(low, high, CELLS + 1)


def _frozen(
    bounder: Bounder, nodes: FloatArray, bounds: Bounds, middle: int
) -> tuple[Mapping[int, FrozenBounds], Mapping[int, FrozenBounds]]:
    """Some nodes on either side, by their distance from the middle, far enough out and with u > 0 up to there."""
    basis, bad = bounder.trial.basis, np.flatnonzero(~bounds.is_positive)
    first = bad[bad < middle].max(initial=-1) + 1
    last = bad[bad >= middle].min(initial=len(nodes) - 1)
    far = np.abs(nodes - basis.centre) > FROZEN_FROM * basis.scale
    inside = np.flatnonzero(far & (np.arange(len(nodes)) >= first) & (np.arange(len(nodes)) <= last))
    found: list[dict[int, FrozenBounds]] = []
    for sign, chosen in ((-1, inside[inside < middle]), (1, inside[inside > middle])):
        picked = np.unique(chosen[np.linspace(0, len(chosen) - 1, CANDIDATES).astype(int)]) if len(chosen) else chosen
        frozen = bounder.frozen(nodes[picked], sign) if len(picked) else []
        found.append(dict(zip((sign * (picked - middle)).tolist(), frozen, strict=True)))
    return found[0], found[1]


def _least(left: Half, right: Half, least: float) -> SideRecord | None:
    """The bound with the least δ, from a guess, by bisection."""

    def both(delta: float) -> tuple[tuple[FloatArray, float], tuple[FloatArray, float]] | None:
        halves = left.march(delta)
        others = right.march(delta) if halves is not None else None
        return (halves, others) if halves is not None and others is not None else None

    high = least
    while (found := both(high)) is None:
        high *= 10
        if not high < 1e6:
            return None
    low = high / 10
    while high > 1.01 * low:
        between = math.sqrt(low * high)
        closer = both(between)
        if closer is None:
            low = between
        else:
            high, found = between, closer
    (before, left_tail), (after, right_tail) = found
    return SideRecord(
        delta=high * (1 + 1e-9),
        nodes=np.concatenate([-left.nodes[: len(before)][:0:-1], right.nodes[: len(after)]]).tolist(),
        values=np.concatenate([-before[:0:-1], after]).tolist(),
        tails=None if right.frozen is None else [-left_tail, right_tail],
    )
