"""Functions of φ and z in which eigenfunctions are tried, u = Σ u_km e^{2ikφ} B_m(z), and what L makes of them.

Coefficients are arrays (modes, m) of complex balls, modes k = −K … K. Multiplied by a factor D(z) > 0 that clears the
denominator of b, the mismatch Lu − μu is again a sum of e^{2ikφ} times polynomials of z, by exact formulas.

For noise z = cos θ on a circle B_m = cos mθ, and for a chain B_m is 1 in state m and 0 in the others. There T = u: the
mismatch falls so fast with more functions that its maximum serves.

On cells of z these polynomials are bounded by Taylor's formula about the middles of the cells: for |t| ≤ h,
|f − f(middle)| ≤ |f′(middle)| h + |f″(middle)| h²/2 + … up to a remainder of order `ORDER`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import factorial, sqrt
from typing import ClassVar

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.proofs.balls import Balls, ball, balls, complex_ball, each, magnitudes, matrix_product, raised, roots
from fpsolve.proofs.statement import BasisKind, Cylinder

ORDER = 8
"""Of Taylor's formula, at most."""
FINE = 8
"""Cells of a circle for each function."""


def padded(u: Balls, waves: int = 0, degrees: int = 0) -> Balls:
    """With zeros for more modes on both sides and for higher degrees."""
    found = np.full((u.shape[0] + 2 * waves, u.shape[1] + degrees), ball(0), dtype=object)
    found[waves : waves + u.shape[0], : u.shape[1]] = u
    return found


def added(*parts: Balls) -> Balls:
    """The sum of coefficients of several degrees and numbers of modes."""
    waves, degrees = (max(part.shape[axis] for part in parts) for axis in (0, 1))
    first, *others = (padded(part, (waves - part.shape[0]) // 2, degrees - part.shape[1]) for part in parts)
    return sum(others, first)


def turned(bands: Balls, u: Balls) -> Balls:
    """F u, with one mode more on either side; `bands` as `Cylinder.bands` has them for the modes of u."""
    found = padded(0 * u, waves=1)
    for d in range(3):
        found[d : d + u.shape[0]] += bands[d][:, None] * u
    return found


class Basis(ABC):
    """Functions B_m of the noise.

    Attributes:
        gauge: β in T = e^{βz} u.
    """

    kind: ClassVar[BasisKind]
    is_core: ClassVar[bool] = False
    centre: float = 0.0
    scale: float = 1.0
    gauge: float = 0.0

    def cover(self, columns: int) -> tuple[FloatArray, FloatArray] | None:
        """The ends of cells that cover the noise, for so many functions, where T = u; None where cells are chosen."""
        return None

    def products(self, noise: Cylinder, degrees: int) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """⟨B_n, B_m⟩, ⟨z B_n, B_m⟩ and the noise's part of L in floats, where T = u; None where these are integrals."""
        return None

    def one(self, columns: int) -> Balls:
        """The coefficients of 1, so many at most."""
        return balls([1.0])

    def values(self, u: Balls) -> Balls:
        """u, by coefficients of the polynomials that `taylor` takes."""
        return u

    def slope(self, u: Balls) -> Balls:
        """u_z, which is not needed where T = u."""
        raise NotImplementedError

    @abstractmethod
    def diffused(self, u: Balls, noise: Cylinder) -> Balls:
        """What D ν (½ ∂zz − b ∂z) makes of u e^{βz}, without the factor e^{βz}."""

    def cleared(self, u: Balls, noise: Cylinder) -> Balls:
        """D u."""
        return u

    @abstractmethod
    def times_z(self, u: Balls, noise: Cylinder) -> Balls:
        """z u."""

    @abstractmethod
    def places(self, low: FloatArray, high: FloatArray) -> tuple[Balls, Balls]:
        """The ends of cells in the variable of `taylor`."""

    @abstractmethod
    def taylor(
        self, parts: Balls, middle: Balls, half: FloatArray, rest: float = 0.0
    ) -> tuple[Iterator[Balls], FloatArray]:
        """Derivatives of sums at the middles of cells from the zeroth on, up to signs, and a bound of what remains."""


@dataclass(frozen=True)
class Core(Basis):
    """Polynomials He_m(y)/√m! of y = (z − centre)/scale, used in the part of the line where the noise mostly is.

    Attributes:
        gauge: what levels u.
    """

    kind: ClassVar[BasisKind] = "core"
    is_core: ClassVar[bool] = True
    centre: float
    scale: float
    gauge: float

    def slope(self, u: Balls) -> Balls:
        """u_z, from d/dy He_m = m He_{m−1}."""
        found = padded(0 * u)
        found[:, :-1] = u[:, 1:] * roots(u.shape[1])[1:] / ball(self.scale)
        return found

    def diffused(self, u: Balls, noise: Cylinder) -> Balls:
        """What D ν (½ ∂zz − b ∂z) makes of u e^{βz}, without the factor e^{βz}; D b = b′(0) z.

        This is D ν (½ u_zz + (β − b) u_z + (½ β² − bβ) u).
        """
        beta = ball(self.gauge)
        first = added(self.slope(u), beta * u)
        second = added(self.slope(first), beta * first)
        return added(
            self.cleared(second * (noise.nu / 2), noise), self.times_z(first, noise) * (-noise.nu * noise.slope)
        )

    def cleared(self, u: Balls, noise: Cylinder) -> Balls:
        """D u, D = 1 − z² for bounded noise, else 1."""
        return added(u, -self.times_z(self.times_z(u, noise), noise)) if noise.is_bounded else u

    def times_z(self, u: Balls, noise: Cylinder) -> Balls:
        """z u, one degree more, from y He_m = He_{m+1} + m He_{m−1}."""
        found = padded(ball(self.centre) * u, degrees=1)
        root, scale = roots(u.shape[1] + 1), ball(self.scale)
        found[:, 1:] += u * (root[1:] * scale)
        found[:, : u.shape[1] - 1] += u[:, 1:] * (root[1:-1] * scale)
        return found

    def places(self, low: FloatArray, high: FloatArray) -> tuple[Balls, Balls]:
        """The ends of cells in the variable of `taylor`, y."""
        left, right = ((balls(end) - ball(self.centre)) / ball(self.scale) for end in (low, high))
        return left, right

    def taylor(
        self, parts: Balls, middle: Balls, half: FloatArray, rest: float = 0.0
    ) -> tuple[Iterator[Balls], FloatArray]:
        """Derivatives of sums of He_m(y)/√m! at the middles of cells from the zeroth on, and a bound of what remains.

        By the mean value theorem sup|He_m| ≤ |He_m(middle)| + h m sup|He_{m−1}| on a cell.
        """
        degrees = parts.shape[1]
        root = roots(degrees + 1)
        table = hermite_table(middle, root[:-1])
        bound = magnitudes(table)
        for m in range(1, degrees):
            bound[m] = raised(bound[m] + half * np.sqrt(m) * bound[m - 1], 8)
        derived, order = [parts], _order(sqrt(degrees) * float(half.max()), rest)
        for _ in range(min(order, degrees - 1)):
            derived.append(derived[-1][:, 1:] * root[1 : derived[-1].shape[1]])
        last = derived[-1] if len(derived) > order else derived[-1][:, :0]
        left = magnitudes(last) @ bound[: last.shape[1]] * half**order / factorial(order)
        return (matrix_product(part, table[: part.shape[1]]) for part in derived[:order]), raised(left, 2 * degrees)


class Cosines(Basis):
    """Functions of z = cos θ by sums of cos mθ, up to signs."""

    def times_z(self, u: Balls, noise: Cylinder) -> Balls:
        """z u."""
        return times_cosine(u)

    def taylor(
        self, parts: Balls, middle: Balls, half: FloatArray, rest: float = 0.0
    ) -> tuple[Iterator[Balls], FloatArray]:
        """The same of sums of cos mθ, up to signs."""
        return cosine_taylor(parts, middle, half, rest)


@dataclass(frozen=True)
class Whole(Cosines):
    """B_0 = 1 and ∫(1 − z²) T_{m−1} dz on the whole support [−1, 1] of bounded noise.

    Both ends have u_z = 0, and b u_z is a polynomial, −b B_m′ = −a z T_{m−1}. Nothing needs to be cleared, D = 1.
    """

    kind: ClassVar[BasisKind] = "whole"

    def values(self, u: Balls) -> Balls:
        """u in Chebyshev polynomials, of two degrees more; ∫T_n = ½ (T_{n+1}/(n + 1) − T_{n−1}/(n − 1))."""
        slope = self.slope(u)
        found = padded(0 * slope, degrees=1)
        found[:, 0] = u[:, 0]
        found[:, 1] += slope[:, 0]
        for n in range(1, slope.shape[1]):
            found[:, n + 1] += slope[:, n] / (2 * (n + 1))
            if n > 1:
                found[:, n - 1] -= slope[:, n] / (2 * (n - 1))
        return found

    def slope(self, u: Balls) -> Balls:
        """u_z = (1 − z²) Σ u_m T_{m−1}, (1 − z²) T_n = ½ T_n − ¼ (T_{n+2} + T_{|n−2|})."""
        inner = u[:, 1:]
        found = padded(inner / 2, degrees=2)
        for n in range(inner.shape[1]):
            for other in (n + 2, abs(n - 2)):
                found[:, other] -= inner[:, n] / 4
        return found

    def diffused(self, u: Balls, noise: Cylinder) -> Balls:
        """ν (½ u_zz − a z Σ u_m T_{m−1}), with d/dz (1 − z²) T_n = (n/2 − 1) T_{|n−1|} − (n/2 + 1) T_{n+1}."""
        inner = u[:, 1:]
        second = padded(0 * inner, degrees=1)
        for n in range(inner.shape[1]):
            second[:, abs(n - 1)] += inner[:, n] * (n - 2) / 2
            second[:, n + 1] -= inner[:, n] * (n + 2) / 2
        return added(second * (noise.nu / 2), self.times_z(inner, noise) * (-noise.nu * noise.slope))

    def places(self, low: FloatArray, high: FloatArray) -> tuple[Balls, Balls]:
        """The ends of cells in θ, T_m(cos θ) = cos mθ."""
        right, left = (each(lambda z: z.acos(), balls(end)) for end in (low, high))
        return left, right


@dataclass(frozen=True)
class Circle(Cosines):
    """cos mθ of z = cos θ."""

    kind: ClassVar[BasisKind] = "circle"

    def cover(self, columns: int) -> tuple[FloatArray, FloatArray]:
        """Cells of θ/π."""
        count = FINE * (columns + 2)
        ends = np.arange(count + 1) / count
        return ends[:-1], ends[1:]

    def products(self, noise: Cylinder, degrees: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Means over θ."""
        mass = np.diag(np.where(np.arange(degrees) > 0, 0.5, 1.0))
        position = self.times_z(balls(np.eye(degrees)), noise)[:, :degrees].astype(float) @ mass
        return mass, position, -float(noise.nu) / 2 * np.arange(degrees) ** 2 * mass

    def diffused(self, u: Balls, noise: Cylinder) -> Balls:
        """½ ν ∂θθ u."""
        return u * (each(ball, np.arange(u.shape[1])) ** 2 * (-noise.nu / 2))

    def places(self, low: FloatArray, high: FloatArray) -> tuple[Balls, Balls]:
        """θ at the ends of cells."""
        left, right = (balls(end) * ball(0).pi() for end in (low, high))
        return left, right


@dataclass(frozen=True)
class States(Basis):
    """1 in state m of a chain, 0 in the others; a cell is a state."""

    kind: ClassVar[BasisKind] = "states"

    def one(self, columns: int) -> Balls:
        """1 in all states."""
        return balls(np.ones(columns))

    def cover(self, columns: int) -> tuple[FloatArray, FloatArray]:
        """The states."""
        return np.arange(float(columns)), np.arange(float(columns))

    def products(self, noise: Cylinder, degrees: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Sums over the states."""
        assert noise.states is not None
        assert noise.rates is not None
        return np.eye(degrees), np.diag(noise.states.astype(float)), noise.rates.astype(float)

    def diffused(self, u: Balls, noise: Cylinder) -> Balls:
        """Σ_n rates_mn u_n."""
        assert noise.rates is not None
        parts = np.concatenate([each(lambda c: c.real, u), each(lambda c: c.imag, u)])
        real, imag = np.split(matrix_product(parts, noise.rates.T), 2)
        return real + complex_ball(0, 1) * imag

    def times_z(self, u: Balls, noise: Cylinder) -> Balls:
        """u times the value of the state."""
        return u * noise.states

    def places(self, low: FloatArray, high: FloatArray) -> tuple[Balls, Balls]:
        """The states."""
        return balls(low), balls(high)

    def taylor(
        self, parts: Balls, middle: Balls, half: FloatArray, rest: float = 0.0
    ) -> tuple[Iterator[Balls], FloatArray]:
        """The values themselves."""
        return iter([parts]), np.zeros(parts.shape)


OTHERS: Mapping[BasisKind, Basis] = {"whole": Whole(), "circle": Circle(), "states": States()}
"""Those that need no numbers."""


def times_cosine(u: Balls) -> Balls:
    """u cos θ of sums of T_m(cos θ) = cos mθ, from z T_n = ½ (T_{n+1} + T_{|n−1|})."""
    found = padded(0 * u, degrees=1)
    for n in range(u.shape[1]):
        found[:, n + 1] += u[:, n] / 2
        found[:, abs(n - 1)] += u[:, n] / 2
    return found


def cosine_taylor(parts: Balls, middle: Balls, half: FloatArray, rest: float) -> tuple[Iterator[Balls], FloatArray]:
    """Derivatives of sums of cos mθ at the middles of cells, up to signs, and a bound of what remains."""
    order = _order(parts.shape[1] * float(half.max()), rest)
    degrees = np.arange(parts.shape[1])
    angles = np.outer(degrees, middle)
    waves = [np.cos(angles), np.sin(angles)]
    powers = [each(ball, degrees) ** i for i in range(order)]
    left = magnitudes(parts) @ (degrees.astype(float)[:, None] * half) ** order / factorial(order)
    derivatives = (matrix_product(parts * powers[i], waves[i % 2]) for i in range(order))
    return derivatives, raised(left, 16 + 2 * len(degrees))


def _order(step: float, rest: float) -> int:
    """Of the remainder: the least with which that is small, where the argument of the highest function takes a step."""
    return next((n for n in range(1, ORDER) if step < 1 and step**n / factorial(n) <= rest), ORDER)


def hermite_table(y: Balls, root: Balls) -> Balls:
    """He_m(y)/√m!, shape (degrees, *y.shape), from y He_m = He_{m+1} + m He_{m−1}; `root` has √m of each degree."""
    table = [0 * y + 1, y]
    for m in range(1, len(root) - 1):
        table.append((y * table[m] - root[m] * table[m - 1]) / root[m + 1])
    return np.array(table[: len(root)])
