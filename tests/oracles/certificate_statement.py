"""What a certificate states: a system and its noise, and the series that a proof is about.

Numbers are floats taken as they are, so every coefficient of the series follows in intervals. A system is ẋ = (A₀ +
ξA₁)x in the sense of Stratonovich; phase and size are those of P⁻¹x. At a phase φ of x = ‖x‖ (cos φ, −sin φ) a matrix
A turns it by h = e′ᵀAe and stretches it by q = eᵀAe, waves in 2φ.
"""

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from tests.oracles import certificate_series as cs


class Refused(Exception):
    """The claim does not follow; the message says why."""


class Polar(NamedTuple):
    """h and q of a matrix, each its mean and the factors of cos 2φ and sin 2φ, in intervals."""

    turning: tuple
    stretching: tuple


class Noise(NamedTuple):
    """A noise in a unit of its own: of what kind, ν, b′(0) (b = slope·z, over 1 − z² if bounded), the unit."""

    kind: str  # "gaussian", "bounded", "circle" for z = cos θ with ½ν∂θθ, "chain", "white"
    nu: Fraction = Fraction(1)
    slope: Fraction = Fraction(0)
    unit: Fraction = Fraction(1)
    states: tuple = ()
    rates: tuple = ()


class Model(NamedTuple):
    """Constants: of the phase, of the noise, and what is bounded."""

    still: Polar
    driven: Polar  # times the unit of the noise
    kappa: object  # how fast the sawtooth of ln R rises with the phase, an interval
    noise: Noise
    moment: bool
    p: Fraction
    mu: float

    @property
    def nu(self):
        return self.noise.nu

    @property
    def slope(self):
        return self.noise.slope

    @property
    def bounded(self):
        return self.noise.kind == "bounded"

    @property
    def plain(self):
        """Whether T is the trial function itself."""
        return self.noise.kind in ("circle", "chain", "white")


class Trial(NamedTuple):
    """A basis, the gauge β and the series, in intervals, that (*) is about."""

    basis: object
    gauge: float
    residual: object  # D(Lβu − μu), or of λ: D times the drift of ρ + s ln R + f, less μ
    steep: object  # u_z or f_z
    divisor: object  # u or 1
    function: object  # u or f


class Side(NamedTuple):
    """One of the two proofs: its name and sign (1 for the upper bound), δ, the nodes, W there and in the tails."""

    name: str
    sign: int
    delta: float
    nodes: np.ndarray
    values: np.ndarray
    tails: np.ndarray | None


def require(condition, reason):
    """Refuse unless the condition holds."""
    if not condition:
        raise Refused(reason)


def number(value):
    """The exact value of a float."""
    return Fraction(float(binary(value)))


def binary(values):
    """Floats from numbers of JSON, all finite."""
    array = np.array(values, dtype=object)
    good = [isinstance(v, int | float) and not isinstance(v, bool) for v in array.flat]
    require(all(good), "A number of the certificate is missing.")
    array = np.array([float(v) for v in array.flat]).reshape(array.shape)
    require(np.isfinite(array).all(), "A number of the certificate is not finite.")
    return array


def model_of(certificate):
    """The constants of a certificate."""
    stated = certificate["stated"]
    require(set(stated) == {"still", "driven", "jumps", "coordinates", "noise"}, "A statement has other keys.")
    noise = _noise(stated["noise"])
    still, driven, jumps = _motion(stated)
    kappa = cs.exact(0)
    for ray, log_factor in jumps:
        speeds = [ray[1] * x - ray[0] * y for x, y in (_moved(a, ray) for a in (still, driven))]
        kappa = kappa + log_factor * _direction(*speeds, noise)
    unit = cs.exact(noise.unit)
    moment = certificate["p"] is not None
    return Model(
        still=_polar(still, cs.exact(1)),
        driven=_polar(driven, unit),
        kappa=kappa / cs.IV.pi,
        noise=noise,
        moment=moment,
        p=number(certificate["p"]) if moment else Fraction(0),
        mu=float(binary(certificate["mu"])),
    )


def _polar(a, size):
    """h and q of a matrix times an interval, from e = (cos φ, −sin φ) and e′ = (−sin φ, −cos φ)."""
    halves = (a[0][1] - a[1][0], -a[0][1] - a[1][0], a[1][1] - a[0][0]), (a[0][0] + a[1][1], a[0][0] - a[1][1])
    turning, stretching = halves[0], (*halves[1], -a[0][1] - a[1][0])
    return Polar(*(tuple(cs.exact(x / 2) * size for x in wave) for wave in (turning, stretching)))


def _moved(a, x):
    return tuple(row[0] * x[0] + row[1] * x[1] for row in a)


def _times(a, b):
    columns = [_moved(a, (b[0][j], b[1][j])) for j in (0, 1)]
    return [[columns[j][i] for j in (0, 1)] for i in (0, 1)]


def _direction(still, driven, noise):
    """Whether the phase passes a ray forward (1) or backward (−1), where its speed is still + driven ξ."""
    if noise.kind in ("gaussian", "white"):
        speeds = [still] if driven == 0 else [Fraction(0)]
    elif noise.kind == "chain":
        speeds = [still + driven * noise.unit * x for x in noise.states]
    else:
        speeds = [still] if driven**2 * noise.unit**2 < still**2 else [Fraction(0)]
    require(all(x > 0 for x in speeds) or all(x < 0 for x in speeds), "The phase must cross each jump one way.")
    return 1 if speeds[0] > 0 else -1


def _motion(stated):
    """A₀, A₁ and the jumps of y, x = P y."""
    (a, b), (c, d) = change = _fractions(stated["coordinates"], (2, 2))
    require(a * d != b * c, "The coordinates have no inverse.")
    back = [[x / (a * d - b * c) for x in row] for row in ([d, -b], [-c, a])]
    jumps = []
    for jump in stated["jumps"]:
        require(set(jump) == {"ray", "log_factor"}, "A jump has other keys.")
        ray = _fractions(jump["ray"], (2,))
        require(any(ray), "A ray has no direction.")
        jumps.append((_moved(back, ray), cs.exact(float(binary(jump["log_factor"])))))
    matrices = (_fractions(stated[name], (2, 2)) for name in ("still", "driven"))
    return *(_times(_times(back, a), change) for a in matrices), jumps


def _fractions(numbers, shape):
    """Floats as they stand."""
    floats = binary(numbers)
    require(floats.shape == shape, "A matrix or a ray has another shape.")
    return np.vectorize(Fraction, otypes=[object])(floats).reshape(shape).tolist()


def _noise(stated):
    """The noise; the diagonal of rates follows from the others."""
    require(set(stated) == {"kind", "unit", "nu", "slope", "states", "rates"}, "A noise has other keys.")
    kind, (unit, nu, slope) = stated["kind"], (number(stated[name]) for name in ("unit", "nu", "slope"))
    require(kind in ("gaussian", "bounded", "circle", "chain", "white"), f"No noise is called {kind!r}.")
    require(unit > 0 and nu >= 0 and slope >= 0, "A number of the noise is negative.")
    if kind not in ("chain", "white"):
        require(stated["states"] == [] and stated["rates"] == [], "Only a chain has states.")
        require(nu > 0 and (slope > 0 or kind == "circle"), "A rate of the noise is not positive.")
        require(Fraction(1, 10**80) < nu < 10**80, "The rate of the noise is out of range.")
        return Noise(kind, nu, slope, unit)
    n, rows = len(stated["states"]), []
    for i, row in enumerate(_fractions(stated["rates"], (n, n))):
        others = [Fraction(0) if i == j else rate for j, rate in enumerate(row)]
        require(min(others) >= 0, "A rate is negative.")
        rows.append(tuple(rate if i != j else -sum(others) for j, rate in enumerate(others)))
    states = tuple(_fractions(stated["states"], (n,)))
    require(kind == "chain" or (states, rows) == ((0,), [(0,)]), "White noise rests in one state.")
    return Noise(kind, unit=unit, states=states, rates=tuple(rows))


def deltas(certificate):
    """δ of the lower and of the upper proof."""
    found = [float(binary(certificate[name]["delta"])) for name in ("lower", "upper")]
    require(min(found) >= 0, "delta must not be negative.")
    return found


BASES = {"gaussian": ("core",), "bounded": ("core", "whole"), "circle": ("circle",)}


def read_trial(model, certificate):
    """The trial function with what follows from it."""
    about = certificate["basis"]
    kind, allowed = about["kind"], BASES.get(model.noise.kind, ("states",))
    require(kind in allowed or (kind == "whole" and "core" in allowed), f"Such noise has no basis called {kind!r}.")
    floats = np.stack([binary(certificate["cosine"]), binary(certificate["sine"])])
    least = 1 if model.plain else 2
    require(floats.ndim == 3 and least <= floats.shape[2] <= 150, "The coefficients are no table of 2 to 150 degrees.")
    if kind == "whole":
        require(model.bounded, "Only bounded noise has a whole interval.")
        gauge = float(binary(about.get("gauge", 0.0)))
        basis = cs.Chebyshev()
    elif kind == "core":
        centre, scale, gauge = (float(binary(about[name])) for name in ("centre", "scale", "gauge"))
        require(scale > 0, "The scale must be positive.")
        basis = cs.Hermite(centre, scale)
    else:
        states = len(model.noise.states)
        require(kind == "circle" or floats.shape[2] == states, "A chain has a column for each state.")
        room = floats.shape[2] + (2 if kind == "circle" else 0)
        return _plain(model, cs.intervals(floats, floats.shape[1] + 2, room))
    require(gauge == 0 or (model.moment and kind == "core"), "A gauge needs a moment and a core.")
    given = cs.intervals(floats, floats.shape[1] + 2, floats.shape[2] + 6)
    return (_whole if kind == "whole" else _core)(model, basis, gauge, given)


def read_side(model, trial, certificate, name):
    """The proof of the "upper" or of the "lower" bound."""
    given = certificate[name]
    nodes, values, tails = binary(given["nodes"]), binary(given["values"]), given["tails"]
    require(nodes.ndim == 1 and len(nodes) > 1 and nodes.shape == values.shape, "Nodes and values do not match.")
    require(np.all(np.diff(nodes) > 0), "The nodes do not rise.")
    require((tails is None) == isinstance(trial.basis, cs.Chebyshev), "A core has tails, the whole interval has none.")
    if tails is None:
        require(nodes[0] == -1 and nodes[-1] == 1, "The whole interval is [-1, 1].")
        require(values[0] <= 0 <= values[-1], "W pushes out at an end of the whole interval.")
    else:
        tails = binary(tails)
        require(tails.shape == (2,), "A core has two tails.")
        require(not model.bounded or (nodes[0] > -1 and nodes[-1] < 1), "The core leaves the range of the noise.")
        reach = np.abs(nodes[[0, -1]] - float(trial.basis.centre)) / float(trial.basis.scale)
        require((reach <= 29).all(), "The core reaches further than 29 scales.")
    sign = {"upper": 1, "lower": -1}[name]
    return Side(name, sign, float(binary(given["delta"])), nodes, values, tails)


def transport(model, function, divisor):
    """h(∂φ + pκ)u + p q u of the steady part and of what z multiplies; for λ these of f, with 1 in the place of pu."""
    carrier = divisor * (cs.exact(model.p) if model.moment else 1)
    v = cs.phase_slope(function) + carrier * model.kappa
    parts = model.still, model.driven
    return [cs.times_wave(v, part.turning) + cs.times_wave(carrier, part.stretching) for part in parts]


def _divisor(model, function):
    """u, or the constant 1 for λ."""
    one = function * 0
    one[(0, 0, slice(None)) if model.noise.states else (0,) * one.ndim] = cs.IV.mpf(1)
    return function if model.moment else one


def _between(model, basis, function, steep, second, gauge):
    """Lβu − μu without the drift −νb(∂z + β) of the noise, and u or 1."""
    divisor = _divisor(model, function)
    still, driven = transport(model, function, divisor)
    beta, half = cs.exact(gauge), cs.exact(model.nu / 2)
    diffusion = (second + steep * (beta * 2) + function * beta**2) * half
    return diffusion + still + basis.times_z(driven) - divisor * cs.exact(model.mu), divisor


def _plain(model, u):
    """The trial function on a circle, Σ u_km cos mθ, in the states of a chain, or of the phase alone."""
    divisor, noise = _divisor(model, u), model.noise
    still, driven = transport(model, u, divisor)
    residual = still - divisor * cs.exact(model.mu)
    if noise.kind == "circle":
        squares = np.array([cs.exact(noise.nu * m**2 / 2) for m in range(u.shape[-1])], dtype=object)
        residual = residual + cs.Chebyshev().times_z(driven) - u * squares
    elif noise.kind == "chain":
        rates = np.array([[cs.exact(x) for x in row] for row in noise.rates], dtype=object)
        residual = residual + driven * np.array([cs.exact(x) for x in noise.states], dtype=object) + u @ rates.T
    else:
        again = transport(model, driven, driven if model.moment else driven * 0)[1]
        residual = residual + again * cs.exact(0.5)
    return Trial(None, 0.0, residual, None, divisor, u)


def _core(model, basis, gauge, u):
    """The trial function in Hermite's polynomials."""
    steep = basis.slope(u)
    rest, divisor = _between(model, basis, u, steep, basis.slope(steep), gauge)
    drift = (steep + u * cs.exact(gauge)) * cs.exact(model.nu * model.slope)
    if model.bounded:
        drift = drift + basis.times_z(rest)
    return Trial(basis, gauge, rest - basis.times_z(drift), steep, divisor, u)


def _whole(model, basis, gauge, given):
    """The trial function on [−1, 1]: u_z/(1 − z²) = Σ c_m T_{m−1}."""
    quotient = cs.shifted(given, -1, -1)
    steep = quotient - basis.times_z(basis.times_z(quotient))
    u = basis.integral(steep)
    u[..., 0] = given[..., 0]
    rest, divisor = _between(model, basis, u, steep, basis.slope(steep), gauge)
    residual = rest - basis.times_z(quotient) * cs.exact(model.nu * model.slope)
    return Trial(basis, gauge, residual, steep, divisor, u)
