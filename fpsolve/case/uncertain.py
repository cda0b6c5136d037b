"""[uncertain] of a case file: how uncertain parameters are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationInfo

from fpsolve.analysis.spreads import Law, deviation_of, laws_of
from fpsolve.case.explain import DEPENDENT, Refusal, nearest, refuse, shown, shown_with_kind
from fpsolve.case.kinds import parameters_of, problem_of
from fpsolve.case.sections import flat
from fpsolve.case.vary import Vary
from fpsolve.model.problem import Problem

_EXAMPLE = '"noise.D0" = 0.05 or "oscillator.restitution" = { sd = 0.02 }'
EXAMPLE = f"[uncertain] with {_EXAMPLE}"


@dataclass(frozen=True)
class Uncertain:
    """What is uncertain of a case.

    Attributes:
        deviations: the standard deviations of the parameters, by their keys.
    """

    deviations: Mapping[str, Any] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """Whether anything is uncertain."""
        return bool(self.deviations)

    def laws(self, problem: Problem) -> dict[str, Law]:
        """The laws of the parameters around the values of a problem, without those of which a share is 0."""
        values = problem.values
        stated = {key: each for key, each in self.deviations.items() if deviation_of(each, float(values[key])) > 0}
        return laws_of(problem, stated)


def uncertain_of(value: Any, info: ValidationInfo) -> Uncertain:
    """What [uncertain] means; an `Uncertain` is left. Raises ValidationError with all that is wrong with it."""
    if isinstance(value, Uncertain):
        return value
    if not isinstance(value, dict):
        raise ValueError(
            f"got {shown_with_kind(value)}; must be a table; write, for example, [uncertain] with {_EXAMPLE}"
        )
    parameters, problem = parameters_of(info.data, info.context or {}), problem_of(info.data)
    if parameters is None or problem is None:
        refuse([((), value, DEPENDENT)])
        return Uncertain()
    table, refusals = flat(value, parameters), list[Refusal]()
    vary: Vary = info.data.get("vary", Vary())
    deviations = dict[str, Any]()
    for key, stated in table.items():
        refusals += _deviation(key, stated, problem, vary, deviations)
    if not table:
        refusals.append(((), value, f"names no parameter; write, for example, {_EXAMPLE}"))
    refuse(refusals)
    return Uncertain(deviations)


def _deviation(key: str, stated: Any, problem: Problem, vary: Vary, found: dict[str, Any]) -> Iterator[Refusal]:
    """What is wrong with a parameter and its deviation; without faults it joins those that are found."""
    known = problem.differentiable
    if key not in known:
        text = f"got {shown(stated)};{nearest(key, known)} must be one of {', '.join(known)}"
        yield (key,), stated, f"{text}; rename or remove it"
        return
    try:
        deviation = deviation_of(stated, float(problem.values[key]))
    except ValueError:
        must = "must be a share of the value > 0, or { sd = number } with a standard deviation > 0, and finite"
        yield (key,), stated, f"got {shown(stated)}; {must}; write, for example, {_EXAMPLE}"
        return
    found[key] = stated
    if key not in vary.keys and not deviation:
        yield (key,), stated, f"got {shown(stated)}, but a share of {key} = 0 is 0; write {{ sd = number }}"
