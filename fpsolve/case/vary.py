"""[vary]: which parameters may take several values, and what these may be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from fpsolve.case.messages import Refusal, nearest, own_faults, refuse, too_long
from fpsolve.case.sections import MAX_MOMENTS, Moments, NoiseSection, NonEmpty, Values, flat, same
from fpsolve.model.parameters import STRICT
from fpsolve.model.vibro_impact import VibroImpactOscillator

_VARIED_SECTIONS: Mapping[str, Any] = {"oscillator": VibroImpactOscillator, "noise": NoiseSection}
PARAMETERS: Mapping[str, FieldInfo] = {
    f"{section}.{name}": field
    for section, model in _VARIED_SECTIONS.items()
    for name, field in model.__pydantic_fields__.items()
    if field.annotation is float
}
"""The keys that [vary] may name, each with its record."""
ABSCISSAE: Mapping[str, FieldInfo] = {"p": Moments.__pydantic_fields__["p"], **PARAMETERS}
"""What a figure may have along its x-axis, each with its record."""
VARIABLE: Mapping[str, TypeAdapter[Values]] = {
    key: TypeAdapter(
        Annotated[
            tuple[Annotated[float, Field(), *field.metadata], ...],
            Field(strict=False, min_length=1, max_length=MAX_MOMENTS),
        ],
        config=STRICT,
    )
    for key, field in PARAMETERS.items()
}
"""What the lists of [vary] may hold."""


def _vary(value: Any) -> Any:
    """[vary] with its keys made flat, checked value by value against the ranges of the keys."""
    table = flat(value)
    if isinstance(table, dict):
        refuse(refusal for key, values in table.items() for refusal in _varied_refusals(key, values))
    return table


def _varied_refusals(key: str, values: Any) -> Iterator[Refusal]:
    if key not in VARIABLE:
        guess = nearest(key, VARIABLE)
        yield (key,), values, f"cannot be varied;{guess} known keys: {', '.join(VARIABLE)}; rename or remove it"
        return
    try:
        numbers = VARIABLE[key].validate_python(values)
    except ValidationError as error:
        yield from (((key, *detail["loc"]), detail["input"], too_long(detail)) for detail in own_faults(error))
        return
    order = sorted(range(len(numbers)), key=numbers.__getitem__)
    for i in sorted(max(pair) for pair in pairwise(order) if same(*(numbers[place] for place in pair))):
        yield (key, i), numbers[i], f"got {numbers[i]} twice; values must be distinct; remove one of them"


Vary = Annotated[dict[str, NonEmpty], BeforeValidator(_vary)]
