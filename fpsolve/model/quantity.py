"""What is computed of a problem: what each quantity is called, how it is written and drawn, its unit, its equation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from fpsolve.data import Quantity as Quantity

UNNAMED = Quantity("value", "value", "number", "", "unknown")
"""A number of which nothing more is known."""
P = Quantity("p", "p", "order of the moment", "$p$", dims=("p",))
PHASE = Quantity("phi", "φ", "phase", r"$\varphi$", "rad", ("phi",))
NOISE = Quantity("xi", "ξ", "noise", r"$\xi$", "1/time", ("xi",))
_MODES = "the highest modes of the cells, the ends of a noise interval, rounding"
_FINER = "the difference from a finer or wider discretisation, rounding"
_RATIO = "the errors of λ and N"
_ROOT = "the error of Λ(p)/p at p = δ_p over its slope"
MOMENT: Quantity = Quantity(
    "moment", "Λ(p)", "moment Lyapunov exponent", r"$\Lambda(p)$", "1/time", ("p",), "(1), (19)", "(37)", _MODES
)
DERIVATIVE = Quantity(
    "moment_derivative",
    "Λ′(p)",
    "slope of the moment Lyapunov exponent",
    r"$\Lambda'(p)$",
    "1/time",
    ("p",),
    "(19)",
    "(37)",
)
SECOND_DERIVATIVE = replace(
    DERIVATIVE,
    name="moment_second_derivative",
    symbol="Λ″(p)",
    words="curvature of the moment Lyapunov exponent",
    latex=r"$\Lambda''(p)$",
)
GROWTH = Quantity("growth_rate", "s", "growth rate of a path", r"$s = \ln\|x(t)\|/t$", "1/time")
RATE_FUNCTION: Quantity = Quantity(
    "rate_function",
    "I(s)",
    "rate function of the growth rate",
    "$I(s)$",
    "1/time",
    ("p",),
    "I(s) = p s − Λ(p), s = Λ′(p)",
    comment="at s = Λ′(p); its error is moment_error",
)
RESIDUAL = Quantity("residual", "residual", "backward error of the eigenpair", dims=("p",))
EFFECTIVE_PATHS = Quantity(
    "effective_paths", "effective paths", "effective number of paths that carry the mean", dims=("p",)
)
IMPACTS = Quantity("impacts", "impacts", "number of impacts of the paths without weights")
STATUS = Quantity("status", "status", "status of the parameter set")
SECONDS = Quantity("seconds", "seconds", "processor time", unit="s")
LYAPUNOV_EXPONENT = Quantity(
    "lyapunov_exponent", "λ", "largest Lyapunov exponent", r"$\lambda$", "1/time", (), "(2)", "(39)", _MODES
)
STABILITY_INDEX = Quantity(
    "stability_index", "δ_p", "stability index", r"$\delta_p$", "1", (), "Λ(δ_p) = 0", "(38)", _ROOT
)
VARIANCE_RATE = Quantity(
    "variance_rate", "Λ″(0)", "growth rate of the variance", r"$\Lambda''(0)$", "1/time", (), "(19)", "(37)", _FINER
)
IMPACT_RATE = Quantity(
    "impact_rate",
    "N",
    "impacts in unit time",
    r"$N = \partial\lambda/\partial\ln R$",
    "1/time",
    (),
    "N = ∂λ/∂ln R",
    "(39)",
    _FINER,
)
OF_STOPS: Mapping[str, Quantity] = {
    name: Quantity(name, symbol, words, unit=unit)
    for name, symbol, words, unit in (
        ("fast_impact_rate", "N_f", "impacts faster than 0.001 Σ|others| in unit time", "1/time"),
        ("rest_share", "r_0", "share of time at rest at the wall", "1"),
    )
}
"""What a simulation counts at a wall of more than two variables, by its name."""
CRITICAL_IMPACT_FACTOR = Quantity(
    "critical_impact_factor",
    "R_c",
    "impact factor where λ = 0",
    "$R_c$",
    "1",
    (),
    "λ = 0 at R = R_c",
    "(39)",
    _RATIO,
)
CRITICAL_RESTITUTION = Quantity(
    "critical_restitution",
    "r_c",
    "coefficient of restitution where λ = 0",
    "$r_c$",
    "1",
    (),
    "λ = 0 at r = r_c",
    "(39)",
    _RATIO,
)
LEVEL = Quantity("level", "A", "level over that of the start", "$A$", dims=("level",))
LEAST_PROBABLE = Quantity(
    "least_probable",
    "P(sup ‖x‖ ≥ A) >=",
    "lower bound of the probability of an excursion",
    r"$P(\sup\|x\| \geq A)$",
    dims=("level",),
)
MOST_PROBABLE = replace(
    LEAST_PROBABLE,
    name="most_probable",
    symbol="P(sup ‖x‖ ≥ A) <=",
    words="upper bound of the probability of an excursion",
)
UPCROSSINGS = Quantity(
    "upcrossings", "C A^−δ_p", "mean number of upcrossings for large A", r"$C A^{-\delta_p}$", dims=("level",)
)
DISPLACEMENT = Quantity("x", "x", "displacement", "$x$", "length", ("x",))
VELOCITY = Quantity("v", "v", "velocity", r"$\dot{x}$", "length/time", ("v",))
AMPLITUDE = Quantity("amplitude", "A", "amplitude", r"$A = \sqrt{x^2 + \dot{x}^2/\omega^2}$", "length", ("amplitude",))
JOINT_DENSITY = Quantity("density", "ρ", "density", r"of $(x, \dot{x})$", "time/length²", ("x", "v"))
AMPLITUDE_DENSITY = Quantity("amplitude_density", "ρ(A)", "density of the amplitude", "$A$", "1/length", ("amplitude",))


@dataclass(frozen=True)
class ResponseQuantities:
    """The quantities of a stationary response.

    Attributes:
        first, second: the variables of the system.
        amplitude: √(x₁² + x₂²/s²).
        density, amplitude_density: of the variables, and of the amplitude.
        means: by their names in files.
        has_wall: whether there are impacts.
        joint_symbol: of the density of the variables, in sentences.
    """

    first: Quantity
    second: Quantity
    amplitude: Quantity
    density: Quantity
    amplitude_density: Quantity
    means: Mapping[str, Quantity]
    has_wall: bool = True
    joint_symbol: str = "ρ(x, ẋ)"

    @property
    def numbers(self) -> Mapping[str, Quantity]:
        """The numbers that finite elements give, by the names that they have beside those of the linear system."""
        known = {name: each for name, each in self.means.items() if name not in (self.first.name, self.second.name)}
        return {
            name: replace(
                each, name=f"response_{name}", words=f"stationary {each.words}", latex="", equation="", closed_form=""
            )
            for name, each in {**known, **({"impact_rate": IMPACT_RATE} if self.has_wall else {})}.items()
        }


def _means(*each: tuple[str, str, str, str]) -> Mapping[str, Quantity]:
    return {name: Quantity(f"mean_{name}", symbol, words, unit=unit) for name, symbol, words, unit in each}


OSCILLATOR_RESPONSE = ResponseQuantities(
    DISPLACEMENT, VELOCITY, AMPLITUDE, JOINT_DENSITY, AMPLITUDE_DENSITY,
    _means(
        ("x", "⟨x⟩", "mean of x", "length"),
        ("amplitude", "⟨A⟩", "mean of the amplitude", "length"),
        ("amplitude_squared", "⟨A²⟩", "mean of the squared amplitude", "length²"),
        ("amplitude_fourth", "⟨A⁴⟩", "mean of the fourth power of the amplitude", "length⁴"),
        ("x_squared", "⟨x²⟩", "mean of x²", "length²"),
        ("v_squared", "⟨ẋ²⟩", "mean of ẋ²", "length²/time²"),
        ("energy", "⟨E⟩", "mean of the energy ½ẋ² + ½ω²x²", "length²/time²"),
    ),
)  # fmt: skip
"""The quantities of the response of the paper's oscillator."""


def response_quantities(states: Sequence[str], *, has_wall: bool) -> ResponseQuantities:
    """The quantities of the response of a system of which only the names of variables are known."""
    unit, (x, v) = "unknown", (*states, *states)[:2]
    means = _means(
        *((each, f"⟨{each}⟩", f"mean of {each}", unit) for each in (x, v)),
        ("amplitude", "⟨A⟩", "mean of the amplitude", unit),
        ("amplitude_squared", "⟨A²⟩", "mean of the squared amplitude", unit),
        ("amplitude_fourth", "⟨A⁴⟩", "mean of the fourth power of the amplitude", unit),
        *((f"{each}_squared", f"⟨{each}²⟩", f"mean of {each}²", unit) for each in states),
    )
    return ResponseQuantities(
        Quantity(x, x, x, unit=unit, dims=(x,)),
        Quantity(v, v, v, unit=unit, dims=(v,)),
        replace(AMPLITUDE, latex="$A$", unit=unit),
        replace(JOINT_DENSITY, latex="", words=f"density of ({x}, {v})", unit=unit, dims=(x, v)),
        replace(AMPLITUDE_DENSITY, unit=unit),
        means,
        has_wall,
        f"ρ({x}, {v})",
    )


def linear_response(states: Sequence[str]) -> ResponseQuantities:
    """Those of a linear system, the first and second moments; [x] is the unit of x."""
    told = (
        *((f"{x}_squared", f"{x}²", f"[{x}]²") for x in states),
        *((f"{a}_{b}", f"{a} {b}", f"[{a}] [{b}]") for a, b in combinations((*states, "mean"), 2)),
    )
    named = ((name, each.removesuffix(" mean"), unit.removesuffix(" [mean]")) for name, each, unit in told)
    means = _means(*((name, f"⟨{each}⟩", f"mean of {each}", unit) for name, each, unit in named))
    return replace(OSCILLATOR_RESPONSE, means=means, has_wall=False)


THETA = Quantity("theta", "θ", "parameter", r"$\theta$", "theta_unit", ("parameter",))
"""Any parameter; its unit is a variable beside it."""
POINTS = {
    name: Quantity(name, name, words, dims=("point",))
    for name, words in {
        "line": "what is zero",
        "branch": "number of the branch",
        "width": "how far the line may be off, as a share of the sides of the frame",
        "label": "what is special about the point",
    }.items()
}
"""The quantities of a point of a line of stability besides the two parameters."""
OVER_P: Mapping[str, Quantity] = {
    "value": MOMENT,
    "error_estimate": MOMENT.error(),
    "derivative": DERIVATIVE,
    "derivative_error": DERIVATIVE.error(),
    "perturbation": MOMENT.perturbation,
    "residual": RESIDUAL,
}
"""The quantities that are known of Λ at each p, by the attributes of results that hold them."""


def moment_at(p: float) -> Quantity:
    """Λ at one p."""
    return replace(MOMENT, symbol=f"Λ({p:g})", latex=rf"$\Lambda({p:g})$", dims=())


MEAN_SQUARE = replace(moment_at(2.0), words="growth of the mean square")
