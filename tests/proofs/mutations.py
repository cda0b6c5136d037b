"""Changed entries whose claim no longer follows from their certificate, for tests of a checker.

A change may leave a proof: each mutation says whether the claim may still follow, and only the others must be refused.
"""

import copy
import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev, hermite_e

from tests.oracles.certificate_statement import model_of

Truth = Callable[[dict[str, Any], float | None], float]
SIDES = {"upper": 1, "lower": -1}


class Mutation(NamedTuple):
    """A changed entry, what was changed, and what tells whether its claim may follow all the same."""

    change: str
    entry: dict[str, Any]
    may_follow: Callable[[], bool]


def mutations(entry: dict[str, Any], truth: Truth, tolerance: float = 1e-11) -> Iterator[Mutation]:
    """All mutations of an entry; `truth` gives Λ(p), or λ for p = None, of what is stated, to within the tolerance."""
    yield from changed_coefficients(entry)
    yield from changed_sides(entry)
    yield from changed_statements(entry, truth, tolerance)
    yield from moved_bounds(entry, truth, tolerance)


def changed_coefficients(entry: dict[str, Any]) -> Iterator[Mutation]:
    """Single cosines and sines changed by 100 δ and 1e4 δ of u: where samples of a side then fail, nothing follows."""
    size = 1.0 if entry["p"] is None else abs(float(entry["certificate"]["cosine"][0][0]))
    delta = max(float(entry["certificate"][name]["delta"]) for name in SIDES)
    last = len(entry["certificate"]["cosine"]) - 1
    places = {(name, min(k, last), m) for name in ("cosine", "sine") for k, m in ((1, 0), (1, 1), (2, 0), (last, 2))}
    for times in (100, 10000):
        for name, k, m in sorted(places):
            new = copy.deepcopy(entry)
            row = new["certificate"][name][k]
            row[m] = float(row[m]) + times * delta * size
            yield Mutation(f"{name}[{k}][{m}] by {times} delta", new, partial(_may_hold, new))


def changed_sides(entry: dict[str, Any]) -> Iterator[Mutation]:
    """The two sides exchanged, or one of them with a smaller δ (and bound), another W, or other tails."""
    new = copy.deepcopy(entry)
    certificate = new["certificate"]
    certificate["upper"], certificate["lower"] = certificate["lower"], certificate["upper"]
    new["lower"], new["upper"] = (
        certificate["mu"] + s * 2 * certificate[n]["delta"] for s, n in ((-1, "lower"), (1, "upper"))
    )
    yield Mutation("sides exchanged", new, partial(_may_hold, new))
    for name, sign in SIDES.items():
        for factor in (0.0, 0.3, 0.7):
            new = copy.deepcopy(entry)
            side = new["certificate"][name]
            side["delta"] = factor * float(side["delta"])
            new[name] = float(new["certificate"]["mu"]) + sign * (1 + 1e-9) * side["delta"] + sign * 1e-15
            yield Mutation(f"{name} delta times {factor}", new, partial(_may_hold, new))
        for factor in (-1.0, 0.0, 0.5, 2.0):
            new = copy.deepcopy(entry)
            side = new["certificate"][name]
            side["values"] = [factor * float(value) for value in side["values"]]
            yield Mutation(f"{name} W times {factor}", new, partial(_may_hold, new))
        for last in (0, 1) if entry["certificate"][name]["tails"] else ():
            for change in (-10.0, 0.1, 10.0):
                new = copy.deepcopy(entry)
                tails = new["certificate"][name]["tails"]
                tails[last] = float(tails[last]) + (2 * last - 1) * change
                yield Mutation(f"{name} tail {last} by {change}", new, partial(_may_hold, new))


PLACES = (("still", 0, 1), ("still", 1, 0), ("still", 1, 1), ("driven", 1, 1), ("jumps", 0, "log_factor"))
"""What is changed of an oscillator."""


def changed_statements(entry: dict[str, Any], truth: Truth, tolerance: float = 1e-11) -> Iterator[Mutation]:
    """Each number that is stated, and p, changed by 1e-4 and 1e-2 of itself."""
    places: list[tuple[Any, ...]] = [("stated", *place) for place in PLACES]
    places += [("stated", "noise", name) for name in ("unit", "nu")] + [("p",)] * (entry["p"] is not None)
    for *above, last in places:
        for factor in (0.9999, 1.01):
            new = copy.deepcopy(entry)
            where = new["certificate"]
            for place in above:
                where = where[place]
            where[last] *= factor
            if last == "p":
                new["p"] = where[last]
            yield Mutation(f"{above} {last} = {where[last]}", new, partial(_is_true, new, truth, tolerance))


def moved_bounds(entry: dict[str, Any], truth: Truth, tolerance: float = 1e-11) -> Iterator[Mutation]:
    """A bound, or both of them with μ, past the true value."""
    certificate = entry["certificate"]
    value = truth(certificate["stated"], certificate["p"])
    lower, upper = entry["lower"], entry["upper"]
    delta = sum(float(certificate[name]["delta"]) for name in SIDES) / 2
    for new_lower, new_upper, shift in (
        (value + 0.1 * (upper - value), upper, 0.0),
        (lower, value - 0.1 * (value - lower), 0.0),
        *((lower + s * delta, upper + s * delta, s * delta) for s in (-4, -2.5, 2.5, 4)),
    ):
        new = copy.deepcopy(entry)
        new["lower"], new["upper"] = new_lower, new_upper
        new["certificate"]["mu"] = float(certificate["mu"]) + shift
        yield Mutation(f"[{new_lower}, {new_upper}]", new, partial(_is_true, new, truth, tolerance))


def _may_hold(entry: dict[str, Any]) -> bool:
    return not violated(entry["certificate"])


def _is_true(entry: dict[str, Any], truth: Truth, tolerance: float) -> bool:
    """Whether the bounds hold, or might within the tolerance of the true value."""
    value = truth(entry["certificate"]["stated"], entry["certificate"]["p"])
    return entry["lower"] - tolerance <= value <= entry["upper"] + tolerance


def violated(certificate: dict[str, Any]) -> bool:
    """Whether a side clearly fails at a sample, (*) or its tails: floats suffice to refute, if not to prove."""
    return any(
        _violated_side(certificate, certificate[name], sign) or _violated_tail(certificate, certificate[name], sign)
        for name, sign in SIDES.items()
    )


def _violated_tail(certificate: dict[str, Any], side: dict[str, Any], sign: int) -> bool:
    """Whether the slope of ln T clearly jumps the wrong way at an end of the core, or that of T in a tail."""
    if side["tails"] is None:
        return False
    nodes, values, tails = (np.array([float(side[name][i]) for i in (0, -1)]) for name in ("nodes", "values", "tails"))
    u, steep, _, _ = samples(certificate, nodes)
    rise = sign * (steep if certificate["p"] is None else steep / u)
    toward, gauge = np.array([-1, 1]), float(certificate["basis"].get("gauge", 0))
    jump = (toward * (values - tails + rise)).min(axis=0)
    return bool((jump < -1e-6).any() or (toward * (tails + sign * gauge) < -1e-6).any())


def _violated_side(certificate: dict[str, Any], side: dict[str, Any], sign: int) -> bool:
    """Whether (*) of the upper (sign 1) or lower side clearly fails at the middle of a cell."""
    nodes, values = (np.array([float(v) for v in side[name]]) for name in ("nodes", "values"))
    z, w = (nodes[1:] + nodes[:-1]) / 2, (values[1:] + values[:-1]) / 2
    slope, delta = np.diff(values) / np.diff(nodes), float(side["delta"])
    u, steep, mismatch, noise_drift = samples(certificate, z)
    moment = certificate["p"] is not None
    gauge = float(certificate["basis"].get("gauge", 0))
    inward = noise_drift - (gauge + steep / u if moment else 0)
    excess = (delta - sign * (mismatch / u if moment else mismatch)) / float(model_of(certificate).nu)
    margin = excess + w * inward - (sign * w**2 / 2 if moment else 0) - slope / 2
    size = np.abs(excess) + np.abs(w * inward) + w**2 + np.abs(slope)
    return bool((u <= 0).any() and moment) or bool((margin < -1e-4 * size).any())


def powers(basis: dict[str, Any], degrees: int, z: np.ndarray) -> np.ndarray:
    """B_m, B_m′ and B_m″ at z by numpy's polynomials, (3, degrees, points)."""
    tables = []
    for unit in np.eye(degrees):
        m = int(np.argmax(unit))
        if basis["kind"] == "core":
            scale = float(basis["scale"])
            y = (z - float(basis["centre"])) / scale
            norm = math.sqrt(math.factorial(m))
            tables.append([hermite_e.hermeval(y, hermite_e.hermeder(unit, j)) / norm / scale**j for j in range(3)])
        else:
            integral = chebyshev.chebint(chebyshev.chebmul([0.5, 0, -0.5], np.roll(unit, -1)))
            integral[0] = 0
            b = np.array([1.0]) if m == 0 else integral
            tables.append([chebyshev.chebval(z, chebyshev.chebder(b, j)) for j in range(3)])
    return np.swapaxes(np.array(tables), 0, 1)


def samples(certificate: dict[str, Any], z: np.ndarray, phi: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
    """u, u_z, Lβu − μu (of λ: the drift less μ) at phases × z from Eqs. (17)-(19) in floats, and b at z."""
    model = model_of(certificate)
    kappa = float(model.kappa.a)
    cosine, sine = (np.array([[float(v) for v in row] for row in certificate[name]]) for name in ("cosine", "sine"))
    b0, b1, b2 = powers(certificate["basis"], cosine.shape[1], z)
    phi = np.linspace(0, np.pi, 8 * len(cosine) + 48, endpoint=False) if phi is None else phi
    turned = 2 * np.arange(len(cosine))
    waves = np.cos(np.outer(phi, turned)), np.sin(np.outer(phi, turned))
    across = waves[0] @ cosine + waves[1] @ sine
    along = (waves[0] * turned) @ sine - (waves[1] * turned) @ cosine
    u, steep, second = across @ b0, across @ b1, across @ b2
    beta = float(certificate["basis"].get("gauge", 0))
    carrier = u * float(model.p) if model.moment else np.ones_like(u)
    v = along @ b0 + kappa * carrier
    polar = np.stack([1 + 0 * phi, np.cos(2 * phi), np.sin(2 * phi)], axis=-1)
    (h0, q0), (h1, q1) = (
        [polar @ np.array([[float(c.a)] for c in wave]) for wave in part] for part in (model.still, model.driven)
    )
    b = float(model.slope) * z / (1 - z**2 if model.bounded else 1)
    noise = float(model.nu) * (second / 2 + beta * steep + beta**2 / 2 * u - b * (steep + beta * u))
    mismatch = noise + h0 * v + q0 * carrier + z * (h1 * v + q1 * carrier) - model.mu * (u if model.moment else 1)
    return u, steep, mismatch, b
