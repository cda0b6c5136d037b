"""What is computed of a problem: what each quantity is called, how it is written and drawn, its unit, its equation."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from enum import Enum
from textwrap import wrap

from pydantic.fields import FieldInfo

from fpsolve.data import Quantity as Quantity
from fpsolve.model.noise import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.model.parameters import symbol_of, unit_of
from fpsolve.model.problem import Problem
from fpsolve.model.vibro_impact import VibroImpactOscillator

LINE = 90
"""Letters of a line of parameters at most."""
UNNAMED = Quantity("value", "value", "number", "", "unknown")
"""Of a number of which nothing more is known."""
P = Quantity("p", "p", "order of the moment", "$p$", dims=("p",))
PHASE = Quantity("phi", "φ", "phase", r"$\varphi$", "rad", ("phi",))
NOISE = Quantity("xi", "ξ", "noise", r"$\xi$", "1/time", ("xi",))
_MODES = "the highest modes of the cells, the ends of a noise interval, rounding"
_FINER, _RATIO = "the difference from a finer or wider discretisation, rounding", "the errors of λ and N"
_ROOT = "the error of Λ(p)/p at p = δ_p over its slope"
MOMENT = Quantity(
    "moment", "Λ(p)", "moment Lyapunov exponent", r"$\Lambda(p)$", "1/time", ("p",), "(1), (19)", "(37)", _MODES
)
DERIVATIVE = Quantity(
    "derivative", "Λ′(p)", "slope of the moment Lyapunov exponent", r"$\Lambda'(p)$", "1/time", ("p",), "(19)", "(37)"
)
SECOND_DERIVATIVE = replace(
    DERIVATIVE,
    name="second_derivative",
    symbol="Λ″(p)",
    words="curvature of the moment Lyapunov exponent",
    latex=r"$\Lambda''(p)$",
)
RESIDUAL = Quantity("residual", "residual", "backward error of the eigenpair", dims=("p",))
EFFECTIVE_PATHS = Quantity(
    "effective_paths", "effective paths", "effective number of paths that carry the mean", dims=("p",)
)
IMPACTS = Quantity("impacts", "impacts", "number of impacts of the paths without weights")
SECONDS = Quantity("seconds", "seconds", "time of the processor", unit="s")
RARE = Quantity("rare", "rare", "whether rare paths carry the moment", dims=("p",))
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
    "impact rate",
    r"$N = \partial\lambda/\partial\ln R$",
    "1/time",
    (),
    "N = ∂λ/∂ln R",
    "(39)",
    _FINER,
)
CRITICAL_IMPACT_FACTOR = Quantity(
    "critical_impact_factor", "R_c", "critical impact factor", "$R_c$", "1", (), "λ = 0 at R = R_c", "(39)", _RATIO
)
CRITICAL_RESTITUTION = Quantity(
    "critical_restitution",
    "r_c",
    "critical coefficient of restitution",
    "$r_c$",
    "1",
    (),
    "λ = 0 at r = r_c",
    "(39)",
    _RATIO,
)
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
"""What is known of a point of a line of stability besides the two parameters."""
MOMENTS: Mapping[str, Quantity] = {
    "p": P,
    "value": MOMENT,
    "derivative": DERIVATIVE,
    "perturbation": MOMENT.perturbation,
    "error_estimate": MOMENT.error(),
    "residual": RESIDUAL,
}
"""The columns of a table over p, by their names in moments.csv, in summary.json and as attributes of results."""
STORED_MOMENTS = {
    "value": MOMENT,
    "error_estimate": MOMENT.error(),
    "derivative": replace(DERIVATIVE, name="moment_derivative"),
    "perturbation": MOMENT.perturbation,
}
"""Those of them that results.nc holds, by the same names, as they are called there."""
_FIELDS: Mapping[str, FieldInfo] = {
    f"{half}.{name}": field
    for half, kinds in (("oscillator", [VibroImpactOscillator]), ("noise", [NonGaussianNoise, OrnsteinUhlenbeck]))
    for kind in kinds
    for name, field in kind.__pydantic_fields__.items()  # type: ignore[attr-defined]
}


def moment_at(p: float) -> Quantity:
    """Λ at one p."""
    return replace(MOMENT, symbol=f"Λ({p:g})", latex=rf"$\Lambda({p:g})$", dims=())


def parameter_of(key: str) -> Quantity:
    """A parameter of a problem, by its key, such as "noise.D0"."""
    field = _FIELDS.get(key)
    if field is None:
        return Quantity(key, key, key, "", "unknown")
    return Quantity(key, key, field.title or key, symbol_of(field), unit_of(field) or "1")


def parameter_values(problem: Problem, original: NonGaussianNoise | None = None) -> Mapping[str, float | str]:
    """The parameters of a problem by their keys, as far as they are numbers or words.

    Args:
        problem: a motion and its noise.
        original: the noise of Eq. (7) that the noise is the reduction of; then its parameters are told.
    """
    found: dict[str, float | str] = {}
    for half, part in (("oscillator", problem.system), ("noise", original or problem.noise)):
        for name, value in vars(part).items():
            if isinstance(value, Enum | int | float):
                found[f"{half}.{name}"] = str(value.value) if isinstance(value, Enum) else float(value)
    if original is not None:
        found["noise.treatment"] = "exact" if problem.noise == original else "ou-reduction"
    return found


def parameter_words(parameters: Mapping[str, float | str], keys: Collection[str]) -> str:
    """Some of the parameters with their units, by dotted keys: "noise.D0 = 0.1 (1/time), noise.r0 = 0.9"."""
    return ", ".join(f"{key} = {_valued(key, parameters[key])}" for key in keys)


def parameter_lines(parameters: Mapping[str, float | str], besides: Collection[str] = ()) -> list[str]:
    """The same of all parameters besides some, in lines for the oscillator and for the noise, none of them long."""
    lines: list[str] = []
    for half in ("oscillator", "noise"):
        keys = [key for key in parameters if key.startswith(f"{half}.") and key not in besides]
        words = [f"{key.partition('.')[2]} = {_valued(key, parameters[key])}" for key in keys]
        lines += wrap(f"{half}: {', '.join(each.replace(' ', chr(160)) for each in words)}", LINE) if words else []
    return [line.replace(chr(160), " ") for line in lines]


def _valued(key: str, value: float | str) -> str:
    """The value of a parameter with its unit."""
    unit = parameter_of(key).unit
    if isinstance(value, str) or unit in ("1", "unknown"):
        return value if isinstance(value, str) else f"{value:g}"
    return f"{value:g} ({unit})"


def density_unit(noise: Quantity) -> str:
    """Of a density per radian and unit of ξ."""
    return {"1/time": "time/rad", "1": "1/rad"}.get(noise.unit, "unknown")


def noise_of(problem: Problem) -> Quantity:
    """ξ, whose unit the motion decides."""
    return NOISE if isinstance(problem.system, VibroImpactOscillator) else replace(NOISE, unit="unknown")
