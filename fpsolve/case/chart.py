"""[chart]: two parameters, and what is zero on the lines of the chart."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, ValidationError, model_validator
from pydantic.fields import FieldInfo

from fpsolve.analysis.zero import Axis, Zero, axis_faults, zero_of
from fpsolve.case.messages import Refusal, nearest, own_faults, refuse, shown
from fpsolve.case.sections import Section, Text, Values
from fpsolve.case.vary import values_of
from fpsolve.model.parameters import parameter
from fpsolve.model.problem import Problem

_EXAMPLE = 'zero = ["lyapunov_exponent", { moment = 2.0 }]'


class ChartAxis(Section):
    """{ key, start, stop, scale, at }: one side of the frame."""

    key: Annotated[Text, parameter("the parameter", 'key = "oscillator.omega"')]
    start: Annotated[float, parameter("its smallest value", "start = 0.3")]
    stop: Annotated[float, parameter("its largest value", "stop = 5.0")]
    scale: Annotated[Literal["linear", "log"], parameter("how it is spread", 'scale = "log"')] = "linear"
    at: Annotated[Values, parameter("values wanted exactly", "at = [1.0, 2.0]", strict=False, max_length=1000)] = ()

    @property
    def axis(self) -> Axis:
        """The same for the solver."""
        return Axis(self.key, self.start, self.stop, self.scale, self.at)

    def refusals(self, problem: Problem, ranges: Mapping[str, FieldInfo]) -> Iterator[Refusal]:
        """A key that is none to differentiate by, or ends that are out of its range, or not in order."""
        known = problem.differentiable
        if self.key not in known:
            inert = [name for half in problem.halves for name in half.inert]
            is_inert = any(self.key == f"{half.section}.{name}" for half in problem.halves for name in half.inert)
            told = f"; {' and '.join(inert)} are not in the linear theory" if is_inert else ""
            text = f'got "{self.key}";{nearest(self.key, known)} must be one of {", ".join(known)}{told}'
            yield ("key",), self.key, f"{text}; choose one of them"
            return
        for name in ("start", "stop"):
            try:
                values_of(ranges[self.key]).validate_python([getattr(self, name)])
            except ValidationError as error:
                for detail in own_faults(error):
                    accepted = detail["msg"].replace("Input should be", "must be")
                    value = getattr(self, name)
                    yield (name,), value, f"got {value}; {self.key} {accepted}; choose another value"
                return
        yield from axis_faults(self.start, self.stop, self.scale, self.at)


def _zeros(value: Any) -> Any:
    """The entries of `zero` as `Zero`s; those already made are left."""
    if not isinstance(value, list | tuple) or not value:
        text = f"got {shown(value)}; must be a list with one entry at least; write, for example, {_EXAMPLE}"
        refuse([((), value, text)])
    made, refusals = [], list[Refusal]()
    for i, entry in enumerate(value):
        try:
            zero = entry if isinstance(entry, Zero) else zero_of(entry)
        except (ValueError, TypeError):
            known = '"lyapunov_exponent", { moment = 2.0 } or { stability_index = -1.0 }, the number finite and not 0'
            refusals.append(((i,), entry, f"got {shown(entry)}; must be {known}; write one of these"))
            continue
        if zero in made:
            refusals.append(((i,), entry, f"got {shown(entry)} twice; lines must differ; remove one of them"))
        made.append(zero)
    refuse(refusals)
    return tuple(made)


class ChartSection(Section):
    """[chart]: a frame of two parameters, and the lines in it."""

    x: Annotated[ChartAxis, parameter("the abscissa", 'x = { key = "oscillator.omega", start = 0.3, stop = 5.0 }')]
    y: Annotated[ChartAxis, parameter("the ordinate", 'y = { key = "noise.D0", start = 0.01, stop = 2.0 }')]
    zero: Annotated[
        tuple[Zero, ...],
        BeforeValidator(_zeros),
        parameter("what is zero on a line", _EXAMPLE),
    ]

    @model_validator(mode="after")
    def _two_parameters(self) -> Self:
        if self.x.key == self.y.key:
            text = f'got "{self.y.key}" for both axes; must be two parameters; choose another for one of them'
            refuse([(("y", "key"), self.y.key, text)])
        return self
