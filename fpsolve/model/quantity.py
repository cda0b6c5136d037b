"""What is computed of a problem: what each quantity is called, how it is written and drawn, its unit, its equation."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from textwrap import wrap
from typing import Any, Self

from pydantic.fields import FieldInfo

from fpsolve.data import Variable, described
from fpsolve.model.noise import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.model.parameters import symbol_of, unit_of
from fpsolve.model.problem import Problem
from fpsolve.model.vibro_impact import VibroImpactOscillator
from fpsolve.pictures import title_of


@dataclass(frozen=True)
class Quantity:
    """Something that is computed of a problem, or that this depends on.

    Attributes:
        name: in case files and results.
        symbol: in sentences and tables.
        words: what it is, in small letters.
        latex: its symbol on an axis, with dollars.
        unit: "1" for none.
        equation: the number of its perturbation theory; empty where there is none.
    """

    name: str
    symbol: str
    words: str
    latex: str
    unit: str = "1"
    equation: str = ""

    @property
    def attributes(self) -> dict[str, str]:
        """Those of a variable of xarray: long_name, symbol, units and equation."""
        return described(self.words, self.latex, self.unit, equation=self.equation)

    @property
    def title(self) -> str:
        """Of an axis, in LaTeX, with the unit."""
        return title_of(self.attributes)

    def timed(self, unit: str) -> Self:
        """The same with a unit of time: "1/s" instead of "1/time"."""
        return replace(self, unit=re.sub(r"\btime\b", unit, self.unit))

    def stated(self, value: float | str) -> str:
        r"""A value of it in a figure: "$D_0$ = 0.1/time", "impact = delta"."""
        name = self.latex or self.name.rpartition(".")[2]
        if isinstance(value, str):
            return f"{name} = {value}"
        unit = "" if self.unit in ("1", "unknown") else f" {self.unit}"
        return f"{name} = {value:g}{unit.removeprefix(' 1')}"

    def variable(self, values: Any, *dims: str) -> Mapping[str, Variable]:
        """A variable of xarray, by its name."""
        return {self.name: (dims, values, self.attributes)}

    def with_error(self, values: Any, errors: Any, *dims: str, kind: str = "error estimate") -> Mapping[str, Variable]:
        """Two variables of xarray: the values by its name, and their errors, of a kind, by `<name>_error`."""
        about = described(f"{kind} of the {self.words}", units=self.unit)
        return {**self.variable(values, *dims), f"{self.name}_error": (dims, errors, about)}

    def by(self, other: Quantity) -> Quantity:
        """Its partial derivative by another one."""
        return Quantity(
            name=f"{self.name}_by_{other.name}",
            symbol=f"∂{self.symbol}/∂{other.symbol}",
            words=f"derivative of the {self.words} by {other.name}",
            latex=rf"$\partial {self.latex.strip('$')}/\partial {other.latex.strip('$')}$" if other.latex else "",
            unit=_over(self.unit, other.unit),
        )


def _over(unit: str, other: str) -> str:
    """The unit of a ratio."""
    if "unknown" in (unit, other):
        return "unknown"
    if other == "1" or unit == other:
        return unit if other == "1" else "1"
    return f"{unit}/{other if other.isidentifier() else f'({other})'}"


LINE = 90
"""Letters of a line of parameters at most."""
UNNAMED = Quantity("value", "value", "number", "", "unknown")
"""Of a number of which nothing more is known."""
P = Quantity("p", "p", "order of the moment", "$p$")
PHASE = Quantity("phi", "φ", "phase", r"$\varphi$", "rad")
NOISE = Quantity("xi", "ξ", "noise", r"$\xi$", "1/time")
MOMENT = Quantity("moment", "Λ(p)", "moment Lyapunov exponent", r"$\Lambda(p)$", "1/time", "(37)")
DERIVATIVE = Quantity(
    "derivative", "Λ′(p)", "slope of the moment Lyapunov exponent", r"$\Lambda'(p)$", "1/time", "(37)"
)
SECOND_DERIVATIVE = Quantity(
    "second_derivative", "Λ″(p)", "curvature of the moment Lyapunov exponent", r"$\Lambda''(p)$", "1/time", "(37)"
)
RESIDUAL = Quantity("residual", "residual", "backward error of the eigenpair", "")
LYAPUNOV_EXPONENT = Quantity("lyapunov_exponent", "λ", "largest Lyapunov exponent", r"$\lambda$", "1/time", "(39)")
STABILITY_INDEX = Quantity("stability_index", "δ_p", "stability index", r"$\delta_p$", equation="(38)")
VARIANCE_RATE = Quantity("variance_rate", "Λ″(0)", "growth rate of the variance", r"$\Lambda''(0)$", "1/time", "(37)")
IMPACT_RATE = Quantity("impact_rate", "N", "impact rate", r"$N = \partial\lambda/\partial\ln R$", "1/time", "(39)")
CRITICAL_IMPACT_FACTOR = Quantity("critical_impact_factor", "R_c", "critical impact factor", "$R_c$", equation="(39)")
CRITICAL_RESTITUTION = Quantity(
    "critical_restitution", "r_c", "critical coefficient of restitution", "$r_c$", equation="(39)"
)
THETA = Quantity("theta", "θ", "parameter", r"$\theta$", "theta_unit")
"""Any parameter; its unit is a variable beside it."""
_FIELDS: Mapping[str, FieldInfo] = {
    f"{half}.{name}": field
    for half, kinds in (("oscillator", [VibroImpactOscillator]), ("noise", [NonGaussianNoise, OrnsteinUhlenbeck]))
    for kind in kinds
    for name, field in kind.__pydantic_fields__.items()  # type: ignore[attr-defined]
}


def moment_at(p: float) -> Quantity:
    """Λ at one p."""
    return replace(MOMENT, symbol=f"Λ({p:g})", latex=rf"$\Lambda({p:g})$")


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
