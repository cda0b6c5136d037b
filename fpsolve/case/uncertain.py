"""[uncertain] of a case file: how uncertain parameters are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import cast

from pydantic import ValidationInfo
from pydantic.fields import FieldInfo

from fpsolve.analysis.spreads import Law, Stated, deviation_of, laws_of
from fpsolve.case.explain import DEPENDENT, checked, refuse
from fpsolve.case.kinds import problem_of
from fpsolve.case.sections import UNCERTAIN, Deviation, StandardDeviation, flat
from fpsolve.case.vary import Vary
from fpsolve.model.faults import shown
from fpsolve.model.problem import Problem

_FIELD = FieldInfo.from_annotated_attribute(cast("type[object]", Deviation), None)


@dataclass(frozen=True)
class Uncertain:
    """What is uncertain of a case.

    Attributes:
        deviations: the standard deviations of the parameters, by their keys.
    """

    deviations: Mapping[str, Stated] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """Whether anything is uncertain."""
        return bool(self.deviations)

    def laws(self, problem: Problem) -> dict[str, Law]:
        """The laws of the parameters around the values of a problem, without those of which a share is 0."""
        values = problem.values
        stated = {key: each for key, each in self.deviations.items() if deviation_of(each, float(values[key])) > 0}
        return laws_of(problem, stated)


def uncertain_of(value: object, info: ValidationInfo) -> Uncertain:
    """What [uncertain] means; an `Uncertain` is left. Raises ValidationError with all that is wrong with it."""
    if isinstance(value, Uncertain):
        return value
    if not isinstance(value, dict):
        raise ValueError(f"got {shown(value)}; must be a table; write, for example, {UNCERTAIN}")
    if (problem := problem_of(info.data)) is None:
        refuse([((), DEPENDENT)])
        return Uncertain()
    known, vary = dict.fromkeys(problem.differentiable, _FIELD), info.data.get("vary", Vary())
    found = dict[str, Stated]()
    for key, each in checked(known, flat(value, problem.parameters)).items():
        found[key] = each.model_dump() if isinstance(each, StandardDeviation) else each
    refuse(
        ((key,), f"got {shown(each)}, but a share of {key} = 0 is 0; write {{ sd = number }}")
        for key, each in found.items()
        if key not in vary.keys and not deviation_of(each, float(problem.values[key]))
    )
    return Uncertain(found)
