"""[uncertain] of a case file: how uncertain parameters are, and how many samples are drawn of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

from pydantic import TypeAdapter, ValidationError, ValidationInfo
from pydantic.fields import FieldInfo

from fpsolve.analysis.spreads import MOST_SAMPLES, Deviation, Law, deviation_of, laws_of
from fpsolve.case.kinds import parameters_of, problem_of
from fpsolve.case.sections import flat
from fpsolve.case.vary import Vary
from fpsolve.explain import DEPENDENT, Refusal, nearest, refuse, shown, shown_with_kind
from fpsolve.model.parameters import STRICT, parameter
from fpsolve.model.problem import Problem

_EXAMPLE = '"noise.D0" = 0.05 or "oscillator.restitution" = { sd = 0.02 }'
EXAMPLE = f"[uncertain] with {_EXAMPLE}"
FEWEST_SAMPLES = 20
Count = Annotated[int, parameter("how many sets are sampled", "sample = 200", ge=FEWEST_SAMPLES, le=MOST_SAMPLES)]
Seed = Annotated[int, parameter("seed of the sample", "seed = 0", ge=0)]


@dataclass(frozen=True)
class Uncertain:
    """What is uncertain of a case.

    Attributes:
        deviations: the standard deviations of the parameters, by their keys.
        sample: how many sets are sampled; 0 for none.
        seed: of the sample.
    """

    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "sample": FieldInfo.from_annotation(Count),
        "seed": FieldInfo.from_annotation(Seed),
    }
    deviations: Mapping[str, Deviation] = field(default_factory=dict)
    sample: int = 0
    seed: int = 0

    def __bool__(self) -> bool:
        """Whether anything is uncertain."""
        return bool(self.deviations)

    def laws(self, problem: Problem) -> dict[str, Law]:
        """The laws of the parameters around the values of a problem, without those of which a share is 0."""
        values = problem.values
        stated = {key: each for key, each in self.deviations.items() if each.at(float(values[key])) > 0}
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
    table, refusals, numbers = flat(value, parameters), list[Refusal](), {"sample": 0, "seed": 0}
    for name, kind in (("sample", Count), ("seed", Seed)):
        if name in table:
            stated = table.pop(name)
            try:
                numbers[name] = TypeAdapter(kind, config=STRICT).validate_python(stated)
            except ValidationError:
                refusals.append(((name,), stated, ""))
    vary: Vary = info.data.get("vary", Vary())
    deviations = dict[str, Deviation]()
    for key, stated in table.items():
        refusals += _deviation(key, stated, problem, vary, deviations)
    if not table and not refusals:
        refusals.append(((), value, f"names no parameter; write, for example, {_EXAMPLE}"))
    if numbers["sample"] and vary:
        text = "a sample is of one parameter set; remove [vary], or write --set vary={}, or leave it out"
        refusals.append((("sample",), numbers["sample"], f"got {numbers['sample']}; {text}"))
    refuse(refusals)
    return Uncertain(deviations, **numbers)


def _deviation(key: str, stated: Any, problem: Problem, vary: Vary, found: dict[str, Deviation]) -> Iterator[Refusal]:
    """What is wrong with a parameter and its deviation; without faults it joins those that are found."""
    known = problem.differentiable
    if key not in known:
        text = f"got {shown(stated)};{nearest(key, known)} must be one of {', '.join(known)}, sample, seed"
        yield (key,), stated, f"{text}; rename or remove it"
        return
    try:
        found[key] = deviation_of(stated)
    except ValueError:
        must = "must be a share of the value > 0, or { sd = number } with a standard deviation > 0, and finite"
        yield (key,), stated, f"got {shown(stated)}; {must}; write, for example, {_EXAMPLE}"
        return
    if key not in vary.keys and problem.values[key] == 0 and found[key].is_relative:
        yield (key,), stated, f"got {shown(stated)}, but a share of {key} = 0 is 0; write {{ sd = number }}"
