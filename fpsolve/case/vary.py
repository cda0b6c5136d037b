"""Which parameters may take several values, what these may be, and the parameter sets that they make."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter
from pydantic.fields import FieldInfo

from fpsolve.case.sections import MAX_MOMENTS, Moments, NoiseSection, Value, Values, same
from fpsolve.model.kinds import parameter_of
from fpsolve.model.parameters import STRICT
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator
from fpsolve.model.words import choices

_VARIED_SECTIONS: Mapping[str, Any] = {"oscillator": VibroImpactOscillator, "noise": NoiseSection}
RECORDS: Mapping[str, FieldInfo] = {
    f"{section}.{name}": record
    for section, model in _VARIED_SECTIONS.items()
    for name, record in model.__pydantic_fields__.items()
}
"""The keys that [vary] may name, each with its record."""
PARAMETERS: Mapping[str, FieldInfo] = {key: record for key, record in RECORDS.items() if record.annotation is float}
"""Those of them that are numbers."""
WORDS: Mapping[str, tuple[str, ...]] = {
    key: tuple(choices(record.annotation)) for key, record in RECORDS.items() if key not in PARAMETERS
}
"""The texts that each of the others may be."""
ABSCISSAE: Mapping[str, FieldInfo] = {"p": Moments.__pydantic_fields__["p"], **PARAMETERS}
"""What a figure may have along its x-axis, each with its record."""


def _list_of(record: FieldInfo, most: int | None = None) -> TypeAdapter[Values]:
    """A list of what a key accepts, with at most so many entries."""
    kind = Annotated[
        tuple[Annotated[float, Field(), *record.metadata], ...],
        Field(strict=False, min_length=1, max_length=most),
    ]
    return TypeAdapter(kind, config=STRICT)


VARIABLE: Mapping[str, TypeAdapter[Values]] = {key: _list_of(record, MAX_MOMENTS) for key, record in PARAMETERS.items()}
"""What the lists of numbers of [vary] may hold."""
COLUMN: Mapping[str, TypeAdapter[Values]] = {key: _list_of(record) for key, record in PARAMETERS.items()}
"""What a column of a file may hold."""


@dataclass(frozen=True)
class Vary:
    """The parameter sets of a case: all combinations of some values, or values side by side.

    Attributes:
        columns: the values of each varied key; of a product its distinct values, else one for each set.
        mode: "product" for all combinations, the last key varying fastest, or "zip" for values side by side.
    """

    columns: Mapping[str, tuple[Value, ...]] = field(default_factory=dict)
    mode: Literal["product", "zip"] = "product"

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied keys."""
        return tuple(self.columns)

    def __len__(self) -> int:
        """How many parameter sets there are; one where nothing is varied."""
        lengths = map(len, self.columns.values())
        return math.prod(lengths) if self.mode == "product" else next(lengths, 1)

    def __bool__(self) -> bool:
        """Whether anything is varied."""
        return bool(self.columns)

    def values(self, key: str) -> tuple[Value, ...]:
        """The distinct values of a key in the order in which they appear."""
        return tuple(dict.fromkeys(self.columns[key]))

    def sets(self, start: int = 0, stop: int | None = None) -> Iterator[dict[str, Value]]:
        """The varied values of each set from one place to another, any place reached at once."""
        return map(self._set, range(len(self))[start:stop])

    def among(self, keys: Iterable[str]) -> Iterator[dict[str, Value]]:
        """The distinct sets of some of the keys."""
        chosen = {key: values for key, values in self.columns.items() if key in set(keys)}
        seen = dict.fromkeys(tuple(each.items()) for each in Vary(chosen, self.mode).sets())
        return map(dict, seen)

    def _set(self, place: int) -> dict[str, Value]:
        if self.mode == "zip":
            return {key: values[place] for key, values in self.columns.items()}
        chosen = []
        for values in reversed(list(self.columns.values())):
            place, at = divmod(place, len(values))
            chosen.append(values[at])
        return dict(zip(self.columns, reversed(chosen), strict=True))


def written(value: Value, style: str = "g") -> str:
    """A value of a varied key for the eye: a number in a format, a text as it is."""
    return value if isinstance(value, str) else f"{value:{style}}"


def assignments(varied: Mapping[str, Value], style: str = "") -> str:
    """Keys with their values, these in a format: "noise.D0 = 0.1, noise.r0 = 0.9"."""
    return ", ".join(f"{key} = {written(value, style)}" for key, value in varied.items())


def legend(varied: Mapping[str, Value], time_unit: str = "time") -> str:
    r"""The same for a figure: "$D_0$ = 0.1/time, treatment = exact"."""
    return ", ".join(parameter_of(key).timed(time_unit).stated(value) for key, value in varied.items())


def groups(values: Sequence[Value]) -> list[int]:
    """For each value the place of the first one that is the same."""
    if isinstance(values[0], str):
        seen: dict[Value, int] = {}
        return [seen.setdefault(value, i) for i, value in enumerate(values)]
    order = sorted(range(len(values)), key=values.__getitem__)
    runs: list[list[int]] = []
    for place in order:
        if runs and same(values[runs[-1][-1]], values[place]):
            runs[-1].append(place)
        else:
            runs.append([place])
    first = {place: min(run) for run in runs for place in run}
    return [first[i] for i in range(len(values))]


def repeats(columns: Mapping[str, tuple[Value, ...]]) -> Iterator[tuple[int, int]]:
    """The places of sets side by side that stand there already, each with the first place."""
    seen: dict[tuple[int, ...], int] = {}
    for i, row in enumerate(zip(*map(groups, columns.values()), strict=True)):
        if (first := seen.setdefault(row, i)) != i:
            yield i, first
