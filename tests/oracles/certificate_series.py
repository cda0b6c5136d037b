"""Series Σ (a_km cos 2kφ + b_km sin 2kφ) B_m(z): algebra with intervals, and enclosures over boxes of (φ, z).

**Algebra.**  Coefficients are arrays of intervals of mpmath with 192 bits, of the shape (2, harmonics,
degrees): cosines, then sines.  The noise is z = centre + scale·x.  B_m(z) is He_m(x)/√m! ("core") or
Chebyshev's T_m(x) ("whole", where z = x).  Every array has room for the harmonics and degrees that products
add.

**Enclosures.**  Over a cell |x − x_c| ≤ η of the noise, a series is Σ tʲ A_j(φ) with |t| ≤ 1: Taylor's polynomial
A_j = ηʲ ∂ₓʲP(φ, x_c)/j! ends at the degree of P.  The first `ORDERS` of them are kept; the others add up to less
than the sum of their |A_jk|, the lengths of the cosine and sine of 2kφ.  Polynomials in t that are waves of the phase
are brought to Bernstein's form Σ c_i(φ) B_i(t), a mean of the c_i that has c at both ends of the cell.  And over
|φ − φ_i| ≤ h, with |s| ≤ 1,

    c(φ) = c(φ_i) + h c′(φ_i) s + R,   |R| ≤ ½h² Σ (2k)²|c_k|.

**Rounding.**  With unit roundoff u = 2⁻⁵³, K harmonics and n degrees:
- x_c is a multiple of 2⁻⁶⁴, so the integers 2^{64m}He_m(x_c) and 2^{64m}T_m(x_c) are exact; their quotients by
  2^{64m} are rounded once, √m! and the division by it thrice: a relative error of 4u in each V_m = B_m(x_c).
- A coefficient in floats is off by 2u of itself and the width of its interval; `sizes` holds its magnitude and
  2⁶⁰ widths.
- A product of matrices with n terms is off by at most 1.01 n u of the product of the magnitudes, in any order
  of summation. One derivative (a product with a matrix of at most n rows, its entries off by 2u, and a division
  by j) thus adds (n + 5)u of the same expression in magnitudes, the product with V adds (n + 6)u, the powers of
  η add 2u each. So A_j is off by less than (j + 1)(2n + 16)u of S_j, its expression in magnitudes.
- cos and sin of 2kφ_i are off by u at most; the sum over them adds 2K u, factors h and k add 4u.
Hence A_jk is off by ORDERS·γS_jk with γ = (4n + 4K + 64)u, and by nγS_jk in what is not kept; a value or slope at φ_i
by γ of its expression in magnitudes besides.  The bounds on R are sums of fewer than 2nK numbers ≥ 0, each of them off
by less than 2n²u; with n ≤ 160 the factor 1 + 64Kγ covers both.  As |V_m| < e^{x²/4 + 1} < 1e99 for |x| ≤ 30, all that
underflows adds up to less than 1e-200; ηʲ is at least that.
"""

import math
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import libmp
from mpmath.ctx_iv import MPIntervalContext

IV = MPIntervalContext()
IV.prec = 192
ROUNDOFF = 2.0**-53
ORDERS = 5  # of Taylor's polynomials that are kept
BITS = 64  # of the middles of cells after the point


def exact(value):
    """The interval of a fraction, an integer or a float."""
    value = Fraction(value)
    return IV.mpf(value.numerator) / IV.mpf(value.denominator)


def intervals(floats, harmonics, degrees):
    """Coefficients given as floats, (2, K, M), with zeros up to the stated room."""
    room = np.full((2, harmonics, degrees), IV.mpf(0), dtype=object)
    for index, value in np.ndenumerate(floats):
        room[index] = exact(value)
    room[1, 0] = IV.mpf(0)  # sin 0
    return room


def shifted(array, steps, axis):
    """array[i − steps] at i, zeros where nothing comes from."""
    array = np.moveaxis(array, axis, 0)
    out = np.full(array.shape, IV.mpf(0), dtype=object)
    if steps > 0:
        out[steps:] = array[:-steps]
    else:
        out[:steps] = array[-steps:]
    return np.moveaxis(out, 0, axis)


def phase_slope(a):
    """∂φ of a series."""
    double = 2 * np.arange(a.shape[1]).reshape(-1, *[1] * (a.ndim - 2))
    return np.stack([a[1] * double, -a[0] * double])


def _neighbours(a):
    """Coefficients of the harmonics k − 1 and k + 1 at k, the constant doubled as both of its neighbours meet there."""
    doubled = a.copy()
    doubled[0, 0] = doubled[0, 0] * 2
    doubled[1, 0] = doubled[1, 0] * 0
    return shifted(doubled, 1, 1), shifted(doubled, -1, 1)


def times_wave(a, wave):
    """(mean + cosine cos 2φ + sine sin 2φ) times a series."""
    below, above = _neighbours(a)
    cosine, sine = below + above, np.stack([above[1] - below[1], below[0] - above[0]])
    cosine[1, 0], sine[1, 0] = cosine[1, 0] * 0, sine[1, 0] * 0
    return a * wave[0] + (cosine * wave[1] + sine * wave[2]) * exact(0.5)


class Hermite:
    """He_m(x)/√m!, z = centre + scale·x."""

    def __init__(self, centre, scale):
        self.centre, self.scale = Fraction(centre), Fraction(scale)

    def times_z(self, a):
        """z times a series: x He_m = He_{m+1} + m He_{m−1}."""
        root = np.array([IV.sqrt(IV.mpf(m)) for m in range(a.shape[-1] + 1)], dtype=object)
        x = shifted(a, 1, -1) * root[:-1] + shifted(a, -1, -1) * root[1:]
        return a * exact(self.centre) + x * exact(self.scale)

    def slope(self, a):
        """∂z of a series: He_m′ = m He_{m−1}."""
        root = np.array([IV.sqrt(IV.mpf(m + 1)) for m in range(a.shape[-1])], dtype=object)
        return shifted(a, -1, -1) * root / exact(self.scale)

    def at(self, a, z):
        """The coefficients of a series at one z, in the phase only."""
        x = (exact(z) - exact(self.centre)) / exact(self.scale)
        row = [IV.mpf(1), x]
        for m in range(1, a.shape[-1]):
            row.append((x * row[m] - IV.sqrt(IV.mpf(m)) * row[m - 1]) / IV.sqrt(IV.mpf(m + 1)))
        return a @ np.array(row[: a.shape[-1]], dtype=object)

    def table(self, middles, degrees):
        """Values at the middles, given as integers in units of 2⁻⁶⁴."""
        rows = [middles * 0 + 1, middles]
        for m in range(1, degrees):
            rows.append(middles * rows[m] - (m << 2 * BITS) * rows[m - 1])
        scales = np.array([math.sqrt(math.factorial(m)) for m in range(degrees)])
        return _quotients(rows[:degrees]) / scales

    def derivative(self, degrees):
        """Its matrix in floats, from the right, with respect to x."""
        return np.diag(np.sqrt(np.arange(1.0, degrees)), -1)


class Chebyshev:
    """T_m(z) on [−1, 1]."""

    centre, scale = Fraction(0), Fraction(1)

    def times_z(self, a):
        """z times a series: z T_m = ½ (T_{m+1} + T_{|m−1|})."""
        doubled = a.copy()
        doubled[..., 0] = doubled[..., 0] * 2
        return (shifted(doubled, 1, -1) + shifted(a, -1, -1)) * exact(0.5)

    def integral(self, a):
        """The antiderivative without a term in T_0."""
        doubled = a.copy()
        doubled[..., 0] = doubled[..., 0] * 2
        out = shifted(doubled, 1, -1) - shifted(a, -1, -1)
        out[..., 0] = out[..., 0] * 0
        return out / np.array([exact(2 * max(m, 1)) for m in range(a.shape[-1])], dtype=object)

    def slope(self, a):
        """∂z of a series: c′_{m−1} = c′_{m+1} + 2m c_m, the first one halved."""
        out = a * 0
        for m in range(a.shape[-1] - 1, 0, -1):
            out[..., m - 1] = a[..., m] * exact(2 * m) + (out[..., m + 1] if m + 1 < a.shape[-1] else 0)
        out[..., 0] = out[..., 0] * exact(0.5)
        return out

    def table(self, middles, degrees):
        """Values at the middles, given as integers in units of 2⁻⁶⁴."""
        rows = [middles * 0 + 1, middles]
        for m in range(1, degrees):
            rows.append(2 * middles * rows[m] - (1 << 2 * BITS) * rows[m - 1])
        return _quotients(rows[:degrees])

    def derivative(self, degrees):
        """Its matrix in floats, from the right, with respect to x."""
        matrix = np.zeros((degrees, degrees))
        for m in range(1, degrees):
            matrix[m, m - 1 :: -2] = 2.0 * m
        matrix[:, 0] /= 2
        return matrix


def _quotients(rows):
    """Row m divided by 2^{64m}, rounded once (integers divide so in Python), as (cells, degrees)."""
    return np.array([[int(value) / (1 << BITS * m) for value in row] for m, row in enumerate(rows)]).T


class Series(NamedTuple):
    """Coefficients in floats, (2, K, n), and bounds on the magnitudes they stand for, (K, n)."""

    coefficients: np.ndarray
    sizes: np.ndarray


def series(a):
    """The floats of an array of intervals; coefficients of the phase alone get one degree."""
    a = a[..., None] if a.ndim == 2 else a
    values = np.array([libmp.to_float(v._mpi_[0]) for v in a.flat]).reshape(a.shape)
    widths = np.array([libmp.to_float(libmp.mpf_sub(v._mpi_[1], v._mpi_[0])) for v in a.flat]).reshape(a.shape)
    return Series(values, (np.abs(values) + 2.0**60 * widths).sum(axis=0))


class Cells(NamedTuple):
    """Middles x_c (integers in units of 2⁻⁶⁴) and half widths η ≥ |x − x_c| of cells of the noise."""

    middles: np.ndarray
    half_widths: np.ndarray


def cells(basis, left, right):
    """The cells between floats left and right of z."""
    middles, halves = [], []
    for low, high in zip(left, right, strict=True):
        low, high = ((Fraction(z) - basis.centre) / basis.scale for z in (float(low), float(high)))
        middle = round((low + high) / 2 * 2**BITS)
        half = max(high - Fraction(middle, 2**BITS), Fraction(middle, 2**BITS) - low)
        middles.append(middle)
        halves.append(math.nextafter(float(half), math.inf))
    return Cells(np.array(middles, dtype=object), np.array(halves))


class Expansion(NamedTuple):
    """A_j (ORDERS, 2, cells, K), S_j (ORDERS, cells, K) and the bound on all that follows (cells); γ."""

    coefficients: np.ndarray
    sizes: np.ndarray
    rest: np.ndarray
    gamma: float


def expansion(basis, s, place):
    """Taylor's polynomials of a series in the noise."""
    harmonics, degrees = s.sizes.shape
    gamma = (4 * degrees + 4 * harmonics + 64) * ROUNDOFF
    table, derivative = basis.table(place.middles, degrees), basis.derivative(degrees)
    values, sizes, power = s.coefficients, s.sizes, np.ones((len(place.middles), 1))
    parts, bounds, rest = [], [], np.zeros(len(place.middles))
    for j in range(max(degrees, ORDERS)):
        part, bound = power * (table @ np.swapaxes(values, 1, 2)), power * (np.abs(table) @ sizes.T)
        if j < ORDERS:
            parts.append(part)
            bounds.append(bound)
        else:
            rest += (np.hypot(*part) + degrees * gamma * bound).sum(axis=1)
        values, sizes = values @ derivative / (j + 1), sizes @ derivative / (j + 1)
        power = np.maximum(power * place.half_widths[:, None], 1e-200)
    return Expansion(np.array(parts), np.array(bounds), rest * (1 + 64 * harmonics * gamma) + 1e-200, gamma)


@lru_cache(maxsize=16)
def bernstein(degree):
    """The matrix from the powers of t, −1 ≤ t ≤ 1, to Bernstein's form; none of its entries exceeds 1."""
    rows = np.zeros((degree + 1, degree + 1))
    for i, j in np.ndindex(rows.shape):
        powers = [math.comb(j, m) * 2**m * (-1) ** (j - m) for m in range(j + 1)]  # of (1 + t)/2 in tʲ
        rows[i, j] = float(sum(c * Fraction(math.comb(i, m), math.comb(degree, m)) for m, c in enumerate(powers)))
    return rows


class Waves(NamedTuple):
    """Functions of the phase: cosines and sines (2, n, K), off by γ of their magnitudes (n, K), and by rest (n)."""

    coefficients: np.ndarray
    sizes: np.ndarray
    rest: np.ndarray
    gamma: float


def waves(a):
    """One function of the phase from intervals, (2, K)."""
    s = series(a)
    gamma = (4 * len(s.sizes) + 68) * ROUNDOFF
    return Waves(s.coefficients[:, None, :, 0], s.sizes[None, :, 0], np.zeros(1), gamma)


@lru_cache(maxsize=16)
def _circle(number):
    """Cosines and sines of 2πi/number, i = 0 … number − 1, rounded once."""
    with mpmath.workprec(100):
        angles = [2 * mpmath.pi * i / number for i in range(number)]
        return np.array([[float(mpmath.cos(x)) for x in angles], [float(mpmath.sin(x)) for x in angles]])


class Phases:
    """Cells of φ around πi/N, i = 0 … N − 1."""

    def __init__(self, number, harmonics):
        self.half_width = math.pi / (2 * number) * (1 + 2.0**-50)
        self.cos, self.sin = _circle(number)[:, np.outer(np.arange(harmonics), np.arange(number)) % number]

    def bounds(self, w):
        """Lower bounds in all cells, and upper bounds in their middles, each (n, N)."""
        steep = 2 * self.half_width * np.arange(len(self.cos))
        a, b = w.coefficients
        value = a @ self.cos + b @ self.sin
        slope = (b * steep) @ self.cos - (a * steep) @ self.sin
        loose = w.gamma * (w.sizes * (1 + steep + steep**2)).sum(axis=1) + w.rest
        bent = (np.hypot(a, b) * steep**2 / 2).sum(axis=1)
        more = 1 + 64 * len(self.cos) * w.gamma
        loose, bent = (more * x + 1e-200 for x in (loose, bent))
        return value - np.abs(slope) - (loose + bent)[:, None], value + loose[:, None]
