"""What a certificate states: a system and its noise, and the series that a proof is about.

Parameters are exact decimals, all other numbers are floats taken as they are, so every coefficient of the
series follows in intervals. A system is ẋ = (A₀ + ξA₁)x, that of the paper by its parameters, others as sums of terms
ε^order (offset + slope ξ) A. Where coordinates P are stated, phase and size are those of P⁻¹x. At a phase φ of x =
‖x‖ (cos φ, −sin φ) a matrix A turns it by h = e′ᵀAe and stretches it by q = eᵀAe, waves in 2φ.
"""

from decimal import Decimal
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
    """A noise in units of its own: of what kind, ν, b′(0) (b = slope·z, over 1 − z² if bounded), the unit squared."""

    kind: str  # "line", "bounded", "circle" for z = cos θ with ½ν∂θθ, "chain", "white"
    nu: Fraction = Fraction(1)
    slope: Fraction = Fraction(0)
    square: Fraction = Fraction(1)
    states: tuple = ()
    rates: tuple = ()
    ito: bool = False


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


def decimal(value):
    """The exact value of a decimal as written; of a float, of the decimal that Python writes for it."""
    require(isinstance(value, str | int | float | Decimal) and not isinstance(value, bool), f"{value!r} is no number.")
    number = Decimal(repr(value) if isinstance(value, float) else value)
    require(number.is_finite() and abs(number.adjusted()) < 400, f"{value} is out of range.")
    return Fraction(number)


def binary(values):
    """Floats from numbers of JSON, all finite."""
    array = np.array(values, dtype=object)
    good = [isinstance(v, int | float | Decimal) and not isinstance(v, bool) for v in array.flat]
    require(all(good), "A number of the certificate is missing.")
    array = np.array([float(v) for v in array.flat]).reshape(array.shape)
    require(np.isfinite(array).all(), "A number of the certificate is not finite.")
    return array


SYSTEM_NAMES = ({"stiffness", "damping", "restitution"},)
NOISE_NAMES = (
    *({"a", "k"}, {"s", "interpretation"}, {"amplitude", "sigma"}, {"alpha", "standard_deviation"}),
    *({"alpha", "sigma"}, {"D0", "tau0"}, {"D0", "tau0", "r0", "treatment"}),
)
WORDS = ("oscillator.impact", "noise.treatment", "noise.interpretation")


def model_of(certificate):
    """The constants of a certificate."""
    quantity = certificate["quantity"]
    require(quantity in ("moment", "lyapunov_exponent"), f"No quantity is called {quantity!r}.")
    given = _given(certificate["parameters"])
    for part, told in (("motion", SYSTEM_NAMES), ("chain", NOISE_NAMES)):
        section = "system" if part == "motion" else "noise"
        names = {name.partition(".")[2] for name in given if name.startswith(f"{section}.")}
        require(certificate.get(part) is None or names not in told, f"Its labels tell another {section}.")
    noise = _noise(given) if certificate.get("chain") is None else _chain(certificate["chain"])
    require(Fraction(1, 10**80) < noise.nu < 10**80, "The rate of the noise is out of range.")
    if (motion := certificate.get("motion")) is not None:
        still, driven, jumps = _motion(motion)
    else:
        still, driven, jumps = (_parametric if "system.stiffness" in given else _oscillator)(given)
    if noise.ito:
        still = [[still[i][j] - noise.square * _times(driven, driven)[i][j] / 2 for j in (0, 1)] for i in (0, 1)]
    kappa = cs.exact(0)
    for ray, log_factor in jumps:
        speeds = [ray[1] * x - ray[0] * y for x, y in (_moved(a, ray) for a in (still, driven))]
        kappa = kappa + log_factor * _direction(*speeds, noise)
    unit = cs.IV.sqrt(cs.exact(noise.square))
    return Model(
        still=_polar(still, cs.exact(1)),
        driven=_polar(driven, unit),
        kappa=kappa / cs.IV.pi,
        noise=noise,
        moment=quantity == "moment",
        p=decimal(certificate["p"]) if quantity == "moment" else Fraction(0),
        mu=float(binary(certificate["mu"])),
    )


def _given(parameters):
    """Parameters by their keys, without the name of the noise; words, and exact decimals."""
    found = {}
    for key, value in parameters.items():
        plain = f"{key.partition('.')[0]}.{key.rpartition('.')[2]}"
        require(plain not in found, "Two parameters have one name.")
        found[plain] = value if plain in WORDS else decimal(value)
    return found


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
    if noise.kind in ("line", "white"):
        speeds = [still] if driven == 0 else [Fraction(0)]
    elif noise.kind == "chain":
        speeds = [still + driven * x for x in noise.states]
    else:
        speeds = [still] if driven**2 * noise.square < still**2 else [Fraction(0)]
    require(all(x > 0 for x in speeds) or all(x < 0 for x in speeds), "The phase must cross each jump one way.")
    return 1 if speeds[0] > 0 else -1


def _oscillator(given):
    """A₀, A₁ and the jump of the paper's oscillator in (x, v/ω)."""
    omega, eps = given["oscillator.omega"], given["oscillator.epsilon"]
    require(omega > 0, "omega must be positive: the phase must cross each impact forward.")
    loss = eps**2 * (1 - given["oscillator.restitution"])
    still, driven = [[Fraction(0), omega], [-omega, eps**2 * given["oscillator.c1"]]], [[Fraction(0)] * 2, [0, eps]]
    return still, driven, [((Fraction(0), Fraction(1)), _log_factor(given["oscillator.impact"], loss))]


def _parametric(given):
    """The same of ẍ + 2·damping·ẋ + (stiffness + ξ)x = 0 in (x, ẋ)."""
    names = {name.partition(".")[2] for name in given if name.startswith("system.")}
    require(names in SYSTEM_NAMES, "Other parameters.")
    require(given["system.restitution"] > 0, "The wall leaves no positive factor.")
    still = [[Fraction(0), Fraction(1)], [-given["system.stiffness"], -2 * given["system.damping"]]]
    wall = (Fraction(0), Fraction(1)), cs.IV.log(cs.exact(given["system.restitution"]))
    return still, [[Fraction(0)] * 2, [Fraction(-1), Fraction(0)]], [wall]


def _motion(stated):
    """A₀, A₁ and the jumps of a system that is stated by floats."""
    require(stated["numbers"] == "binary", "The numbers of a system are binary.")
    require(set(stated) == {"numbers", "epsilon", "terms", "jumps", "coordinates"}, "A system has other keys.")
    eps, sums = Fraction(float(binary(stated["epsilon"]))), [[[Fraction(0)] * 2 for _ in (0, 1)] for _ in (0, 1)]
    require(eps > 0, "epsilon must be positive.")
    for term in stated["terms"]:
        order, a = term["order"], _fractions(term["matrix"], (2, 2))
        require(isinstance(order, int) and not isinstance(order, bool) and 0 <= order < 100, "An order is none.")
        for total, part in zip(sums, ("offset", "slope"), strict=True):
            for i, j in np.ndindex(2, 2):
                total[i][j] += eps**order * Fraction(float(binary(term[part]))) * a[i][j]
    (a, b), (c, d) = change = _fractions(stated["coordinates"], (2, 2))
    require(a * d != b * c, "The coordinates have no inverse.")
    back = [[x / (a * d - b * c) for x in row] for row in ([d, -b], [-c, a])]
    jumps = []
    for jump in stated["jumps"]:
        ray = _fractions(jump["ray"], (2,))
        require(any(ray), "A ray has no direction.")
        jumps.append((_moved(back, ray), cs.exact(float(binary(jump["log_factor"])))))
    return *(_times(_times(back, total), change) for total in sums), jumps


def _fractions(numbers, shape):
    """Floats as they stand."""
    floats = binary(numbers)
    require(floats.shape == shape, "A matrix or a ray has another shape.")
    return np.vectorize(Fraction, otypes=[object])(floats).tolist()


def _log_factor(impact, loss):
    """ln R of an impact."""
    require(impact in ("delta", "restitution"), f"No impact is called {impact!r}.")
    require(impact == "delta" or loss < 1, "The impact leaves no positive factor.")
    return cs.exact(-loss) if impact == "delta" else cs.IV.log(cs.exact(1 - loss))


def _chain(stated):
    """A chain that is stated by floats; its diagonal follows from the rates."""
    require(stated["numbers"] == "binary", "The numbers of a chain are binary.")
    require(set(stated) == {"numbers", "states", "rates"}, "A chain has other keys.")
    n = len(stated["states"])
    return _chain_of(_fractions(stated["states"], (n,)), _fractions(stated["rates"], (n, n)))


def _chain_of(states, rates):
    rows = []
    for i, row in enumerate(rates):
        others = [0 if i == j else rate for j, rate in enumerate(row)]
        require(min(others) >= 0, "A rate is negative.")
        rows.append(tuple(rate if i != j else -sum(others) for j, rate in enumerate(others)))
    return Noise("chain", states=tuple(states), rates=tuple(rows))


def _noise(given):
    """The noise by its parameters."""
    names = {name.partition(".")[2] for name in given if name.startswith("noise.")}
    value = {name: given[f"noise.{name}"] for name in names}
    require(all(x > 0 for name, x in value.items() if f"noise.{name}" not in WORDS and name != "r0"), "All are > 0.")
    if names == {"a", "k"}:
        return _chain_of((-value["a"], value["a"]), ((0, value["k"]), (value["k"], 0)))
    if names == {"s", "interpretation"}:
        require(value["interpretation"] in ("ito", "stratonovich"), "No such interpretation.")
        ito, nothing = value["interpretation"] == "ito", (Fraction(0),)
        return Noise("white", square=value["s"] ** 2, states=nothing, rates=(nothing,), ito=ito)
    if names == {"amplitude", "sigma"}:
        return Noise("circle", value["sigma"] ** 2, Fraction(0), value["amplitude"] ** 2)
    if names == {"alpha", "standard_deviation"}:
        return Noise("line", 2 * value["alpha"], Fraction(1, 2), value["standard_deviation"] ** 2)
    if names == {"alpha", "sigma"}:
        alpha = value["alpha"]
        return Noise("line", 2 * alpha, Fraction(1, 2), value["sigma"] ** 2 / (2 * alpha))
    if names == {"D0", "tau0"}:
        return Noise("line", 2 / value["tau0"], Fraction(1, 2), value["D0"] / value["tau0"])
    d0, tau, r0, treatment = (value[name] for name in ("D0", "tau0", "r0", "treatment"))
    if treatment == "exact" and r0 < 1:
        return Noise("bounded", (1 - r0) / tau, 1 / (1 - r0), 2 * d0 / (tau * (1 - r0)))
    require(treatment == "ou-reduction" or (treatment == "exact" and r0 == 1), f"No {treatment} noise with r0 {r0}.")
    require(r0 < Fraction(5, 3), "The reduction to OU noise needs r0 < 5/3.")
    tau1 = 2 * (2 - r0) / (5 - 3 * r0) * tau
    return Noise("line", 2 / tau1, Fraction(1, 2), d0 * tau1 / tau**2)


def deltas(certificate):
    """δ of the lower and of the upper proof."""
    found = [float(binary(certificate[name]["delta"])) for name in ("lower", "upper")]
    require(min(found) >= 0, "delta must not be negative.")
    return found


BASES = {"line": ("core",), "bounded": ("core", "whole"), "circle": ("circle",)}


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
