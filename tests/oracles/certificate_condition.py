"""The condition (*) of one side of a certificate, in all cells of a core or of the whole interval.

Times D̂u it is a polynomial in the noise and a wave of the phase,

    N = α u − D̂W u_z − (q/ν)D̂(Lβu − μu) ≥ 0,   α = D̂(δ/ν − ½W′ − βW − ½qW²) + D̂bW,

for λ without the terms with u_z, β and W².  D̂ = 1 for noise without bounds, where D̂bW = b′(0)zW, and D̂ = 1 − z² for
bounded noise, where it is b′(0)zW.  That N vanishes at an end of the whole interval if W does.  So the last cell may
instead have D̂ = 1 + z and D̂bW = b′(0)zW/(1 − z): W is linear and W(1) ≥ 0, hence W/(1 − z) ≥ W(z_l)/(1 − z_l) with
the inner end z_l ≥ 0 of the cell.  The first cell is its mirror image.

The factors of u, u_z and Lβu − μu are polynomials in t, −1 ≤ t ≤ 1, of a cell; with Taylor's polynomials of the three
(see `certificate_series`) and in Bernstein's form N is sharp at both ends of the cell, where (*) may be all but an
equality, next to a much greater N at the other end.

**Rounding.**  The middle of a cell and its distance from the ends are exact fractions, so a factor is less than 64
roundings (2⁻⁵³) from the truth, in terms of the sum of all magnitudes in it.  With those of Taylor's polynomials,
ORDERS γ, of products, of Bernstein's form and of values at phases, N is off by less than 16 γ of all magnitudes in it.
"""

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from tests.oracles import certificate_series as cs
from tests.oracles import certificate_statement as cf

LEVELS = ((1, 1), (2, 2), (4, 4), (8, 8))
"""(Times as many phases, parts of a cell), one after the other where a bound is too coarse."""
BOXES = 2**15  # at a time


class Parts(NamedTuple):
    """Parts of cells: their ends; the left end of their cell with W there; the slope of W."""

    left: np.ndarray
    right: np.ndarray
    foot: np.ndarray
    value: np.ndarray
    slope: np.ndarray


def divided(nodes, values, cells, parts):
    """Cells in equal parts."""
    z_l, z_r, w_l, w_r = (a[:, None] for a in (nodes[cells], nodes[cells + 1], values[cells], values[cells + 1]))
    z = z_l + (z_r - z_l) * (np.arange(parts + 1) / parts)
    z[:, -1] = z_r[:, 0]
    whole = (np.broadcast_to(a, (len(cells), parts)) for a in (z_l, w_l, (w_r - w_l) / (z_r - z_l)))
    return Parts(*(a.ravel() for a in (z[:, :-1], z[:, 1:], *whole)))


class Weight(NamedTuple):
    """Polynomials in t, one of each cell: coefficients (degree + 1, cells) and the magnitudes that went into them."""

    coefficients: np.ndarray
    size: np.ndarray

    def __mul__(self, other):
        """The product with another, or with a number."""
        if not isinstance(other, Weight):
            return Weight(self.coefficients * other, self.size * np.abs(other))
        a, b = self.coefficients, other.coefficients
        product = np.zeros((len(a) + len(b) - 1, a.shape[1]))
        for i, row in enumerate(a):
            product[i : i + len(b)] += row * b
        return Weight(product, self.size * other.size)

    def __add__(self, other):
        """The sum of two."""
        a, b = self.coefficients, other.coefficients
        total = np.zeros((max(len(a), len(b)), a.shape[1]))
        total[: len(a)] += a
        total[: len(b)] += b
        return Weight(total, self.size + other.size)


def _weight(*coefficients):
    """From coefficients that are a few roundings from the truth."""
    rows = np.array(np.broadcast_arrays(*coefficients))
    return Weight(rows, np.abs(rows).sum(axis=0))


def _floats(fractions):
    """The nearest floats."""
    return np.array([float(x) for x in fractions])


def weights(model, trial, side, parts, place, flat=False):
    """The factors of u, u_z and the residual of the trial function; `flat` takes the other D̂ of an end of [−1, 1]."""
    middles = [trial.basis.centre + trial.basis.scale * Fraction(m, 2**cs.BITS) for m in place.middles]
    eta = place.half_widths * float(trial.basis.scale)
    away = _floats(m - Fraction(float(z)) for m, z in zip(middles, parts.foot, strict=True))
    w = Weight(
        np.array([parts.value + parts.slope * away, parts.slope * eta]),
        np.abs(parts.value) + np.abs(parts.slope) * (np.abs(away) + eta),
    )
    z, one, nu = _weight(_floats(middles), eta), _weight(np.ones(len(eta))), float(model.nu)
    factor, pushed = one, w
    if model.bounded:
        factor = _weight(_floats((1 - m) * (1 + m) for m in middles), -2 * z.coefficients[0] * eta, -(eta**2))
    if flat:
        factor, pushed = _at_end(parts, z)
    alpha = one * (side.delta / nu) + one * (-parts.slope / 2)
    if model.moment:
        alpha = alpha + w * -trial.gauge + w * w * (-side.sign / 2)
    alpha = factor * alpha + z * pushed * float(model.slope)
    mismatch = one if side.tails is not None else factor  # the residual of a core has its factor
    return alpha, factor * w * (-1.0 if model.moment else 0.0), mismatch * (-side.sign / nu)


def _at_end(parts, z):
    """D̂ and D̂bW/(b′(0)z) at the ends of the whole interval, in parts on one side of 0."""
    inner, end = np.where(parts.right == 1, parts.left, parts.right), np.where(parts.right == 1, 1.0, -1.0)
    steps, distance = parts.slope * (inner - parts.foot), 1 - np.abs(inner)
    pushed = Weight(((parts.value + steps) / distance)[None], (np.abs(parts.value) + np.abs(steps)) / distance)
    middle, eta = z.coefficients
    return _weight(1 + end * middle, end * eta), pushed


def _sum(factors, expansions):
    """Waves of the phase: coefficients in Bernstein's form (all of one cell after those of another) of a sum."""
    degree = max(len(w.coefficients) for w in factors) + cs.ORDERS - 2
    total = np.zeros((degree + 1, *expansions[0].coefficients.shape[1:]))
    for w, e in zip(factors, expansions, strict=True):
        for i, row in enumerate(w.coefficients):
            total[i : i + cs.ORDERS] += row[:, None] * e.coefficients
    form = np.tensordot(total, cs.bernstein(degree), axes=(0, 1))  # (2, cells, K, degree + 1)
    form = np.moveaxis(form, -1, 2).reshape(2, -1, total.shape[-1])
    pairs = list(zip(factors, expansions, strict=True))
    sizes = sum(w.size[:, None] * e.sizes.sum(axis=0) for w, e in pairs)
    rest = sum(w.size * e.rest for w, e in pairs)
    return cs.Waves(form, *(np.repeat(x, degree + 1, axis=0) for x in (sizes, rest)), 16 * expansions[0].gamma)


class Verdict(NamedTuple):
    """Of each part of a cell: it is proved; it is refuted at one of its ends."""

    proved: np.ndarray
    refuted: np.ndarray


def _least(grid, factors, expansions):
    """A lower bound of a sum in parts of cells, and an upper bound of its least value at their ends."""
    number = expansions[0].coefficients.shape[2]
    bounds, values = grid.bounds(_sum(factors, expansions))
    values = values.reshape(number, -1, values.shape[1])
    return bounds.reshape(number, -1).min(axis=1), np.minimum(values[:, 0], values[:, -1]).min(axis=1)


def judge(model, trial, side, pieces, grid, parts):
    """(*) in parts of cells, for all phases."""
    place = cs.cells(trial.basis, parts.left, parts.right)
    expansions = [cs.expansion(trial.basis, s, place) for s in pieces]
    least, values = _least(grid, weights(model, trial, side, parts, place), expansions)
    u, u_values = _least(grid, [_weight(np.ones(len(least)))], expansions[:1])
    proved = least >= 0
    ends = (parts.left == -1) & (parts.right <= 0) | (parts.right == 1) & (parts.left >= 0)
    if side.tails is None and (ends & ~proved).any():
        chosen = [Parts(*(a[ends] for a in parts)), cs.Cells(*(a[ends] for a in place))]
        some = [cs.Expansion(e.coefficients[:, :, ends], e.sizes[:, ends], e.rest[ends], e.gamma) for e in expansions]
        proved[ends] |= _least(grid, weights(model, trial, side, *chosen, flat=True), some)[0] >= 0
    return Verdict(proved & (u > 0), (values < 0) | (u_values < 0))


def check(model, trial, side, phases):
    """Refuse unless (*) holds in every cell: coarse cells are divided, with more phases."""
    pieces = [cs.series(a) for a in (trial.divisor, trial.steep, trial.residual)]
    harmonics, nodes = len(pieces[0].sizes), side.nodes
    phases = min(max(phases, 4 * harmonics), 4096)
    waiting = np.arange(len(nodes) - 1)
    for more, parts in LEVELS:
        grid = cs.Phases(phases * more, harmonics)
        step, left = max(1, BOXES // (phases * more * parts)), []
        for start in range(0, len(waiting), step):
            cells = waiting[start : start + step]
            verdict = judge(model, trial, side, pieces, grid, divided(nodes, side.values, cells, parts))
            for cell in cells[verdict.refuted.reshape(-1, parts).any(axis=1)]:
                raise cf.Refused(f"The {side.name} condition fails {_between(nodes, cell)}.")
            left.append(cells[~verdict.proved.reshape(-1, parts).all(axis=1)])
        waiting = np.concatenate(left)
        if not len(waiting):
            return
    raise cf.Refused(f"The {side.name} condition could not be shown {_between(nodes, waiting[0])}.")


def _between(nodes, cell):
    return f"between z = {nodes[cell]:.6g} and {nodes[cell + 1]:.6g}"
