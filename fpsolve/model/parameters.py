"""What all parameters have in common: strict types, ranges, and words for messages, tables and figures."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import Enum
from typing import Annotated, Any, ClassVar, NamedTuple, Self, cast

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from fpsolve.arrays import shown
from fpsolve.data import plain_unit
from fpsolve.drawing import is_math
from fpsolve.messages import Message, is_control
from fpsolve.model.quantity import Quantity

SIZE = {"ge": 1e-15, "le": 1e15}
"""The range of a positive parameter: whatever the others are, no formula overflows or divides by nothing."""
ANY_SIGN = {"ge": -SIZE["le"], "le": SIZE["le"]}
"""The range of a parameter of any sign."""
DERIVED = {"ge": 1e-32, "le": 1e32}
"""The range of a positive parameter that is made of such parameters."""
GREEK = (
    "(alpha|beta|gamma|delta|epsilon|zeta|eta|theta|iota|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|upsilon|phi|chi|psi|"
    r"omega|Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Phi|Psi|Omega)_?(\d*|(?<=_)[a-zA-Z])"
)
"""A name that is a Greek letter, with a number or a letter below it."""
UNITS = {
    "%": (0.01, ""),
    "Hz": (2 * math.pi, ", in rad/time"),
    "rpm": (math.pi / 30, ", in rad/time"),
    "deg": (math.pi / 180, ", in rad"),
}
"""The units that are known in numbers: by which factor to multiply, and what unit that gives."""
Table = Mapping[str, Any]
"""A table of a case file."""
STRICT: ConfigDict = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)
"""The rules of all tables: no unknown keys, no conversions, finite numbers only."""


class Section(BaseModel):
    """A table of a case file: immutable, no unknown keys, no conversions, finite numbers only."""

    model_config = STRICT | ConfigDict(frozen=True)

    def model_copy(self, **changes: Any) -> Self:
        """A copy with other values, without what follows from the old ones."""
        made = super().model_copy(**changes)
        for name in made.__dict__.keys() - type(made).model_fields.keys():
            del made.__dict__[name]
        return made


def parameter(
    meaning: str, example: str, symbol: str = "", unit: str = "", *, name: str | None = None, **rules: Any
) -> FieldInfo:
    """All that is said about a parameter, to stand beside its type.

    Args:
        meaning: what it is, and after a semicolon a remark.
        example: a line of TOML that states it.
        symbol: in LaTeX, with dollars.
        unit: such as "rad/time".
        name: what an axis calls it; None for the meaning without the remark.
        rules: its range, by `gt`, `ge`, `lt` and `le`, and what else pydantic's `Field` takes.
    """
    return Field(
        title=name or meaning.partition(";")[0],
        description=meaning,
        examples=[example],
        json_schema_extra={"symbol": symbol, "unit": unit},
        **rules,
    )


def example_of(field: FieldInfo) -> str:
    """The line of TOML that states a `parameter`, or nothing."""
    return str((field.examples or [""])[0])


def meaning_of(field: FieldInfo) -> str:
    """What a `parameter` is, with its unit."""
    unit, meaning = _extra(field).get("unit"), field.description or ""
    return f"{meaning}, in {plain_unit(unit)}" if unit else meaning


def without_unit(value: Any) -> str:
    """What to write for a text such as "1.0 Hz": "; write 6.283185 for 1.0 Hz, in rad/time"; "" for others."""
    text = value if isinstance(value, str) else ""
    if re.fullmatch(r"[+-]?\d+,\d+([eE][+-]?\d+)?", text):
        return f"; write the decimal point as {text.replace(',', '.')}"
    match = re.fullmatch(rf"\s*([-+]?(?:\d++\.?\d*+|\.\d++)(?:[eE][-+]?\d++)?)\s*({'|'.join(UNITS)})\s*", text)
    if match is None:
        return ""
    factor, into = UNITS[match[2]]
    return f"; write {float(match[1]) * factor:.7g} for {match[1]} {match[2]}{into}"


def _extra(field: FieldInfo) -> Mapping[str, str]:
    return cast("Mapping[str, str]", field.json_schema_extra or {})


def stated_field(annotation: Any, meaning: str, example: str, default: Any = PydanticUndefined) -> FieldInfo:
    """The field of an entry of a table that is no parameter, with what is said about it as of a `parameter`."""
    annotated: Any = Annotated[annotation, parameter(meaning, example)]
    return FieldInfo.from_annotated_attribute(annotated, default)


def _printed(text: str) -> str:
    if any(map(is_control, text)):
        raise ValueError(f"got {shown(text)}; must have no control characters; leave them out")
    return text


def _symbol(text: str) -> str:
    symbol = _printed(text).strip(" $")
    if not is_math(f"${symbol}$"):
        raise ValueError(f"got {shown(text)}; must be a symbol that matplotlib can draw; write, for example, \\\\zeta")
    return symbol


Line = Annotated[str, Field(min_length=1, max_length=80), AfterValidator(_printed)]


class Words(Section):
    """What a case file calls a parameter, or a noise."""

    symbol: Annotated[
        Line, AfterValidator(_symbol), parameter("its symbol in LaTeX, without dollars", 'symbol = "\\\\zeta"')
    ] = ""
    unit: Annotated[Line, parameter("its unit, 1 for none", 'unit = "rad/time"')] = ""
    words: Annotated[Line, parameter("what it is, on an axis", 'words = "damping ratio"')] = ""

    def of(self, plain: Quantity) -> Quantity:
        """A quantity, as far as this says otherwise."""
        latex = f"${self.symbol}$" if self.symbol else plain.latex
        return replace(plain, words=self.words or plain.words, latex=latex, unit=self.unit or plain.unit)


class Parameter(NamedTuple):
    """A parameter of a problem.

    Attributes:
        value: a number, or a word such as "delta".
        quantity: its key, such as "noise.D0", its symbol, its words and its unit.
        kind: the class that it is a parameter of.
    """

    value: float | str
    quantity: Quantity
    kind: type[Parametrised]

    @property
    def field(self) -> FieldInfo | None:
        """The range that it may have; None where that is not stated."""
        return self.kind.__pydantic_fields__.get(self.quantity.name.rpartition(".")[2])


class Parametrised:
    """A system or a noise, a kind with named parameters; here those of a pydantic dataclass.

    Attributes:
        kind: the name by which case files know it.
        section: the first part of the keys of its parameters, such as "noise".
        words: parameters that the class itself decides, by their names.
        stated: what case files say of it besides its parameters, such as the `words`, by its names.
        naming: what case files say of what it gives, by its names.
        about: what they say of that.
        variants: other classes of this kind, with other parameters; a table of a case file tells by its keys which.
    """

    kind: ClassVar[str] = ""
    section: ClassVar[str]
    words: ClassVar[Mapping[str, str]] = {}
    stated: ClassVar[Mapping[str, FieldInfo]] = {}
    variants: ClassVar[Sequence[type[Parametrised]]] = ()
    naming: ClassVar[Mapping[str, FieldInfo]] = {}
    about: Words = Words()
    __pydantic_fields__: ClassVar[Mapping[str, FieldInfo]] = {}

    @classmethod
    def from_table(cls, table: Table) -> Parametrised:
        """What a table of a case file states. Raises `ValueError` where a parameter is out of range."""
        return cls(**table)

    def called(self, about: Words) -> Self:
        """This one, which gives what is called so."""
        object.__setattr__(self, "about", about)
        return self

    def quantity_of(self, name: str) -> Quantity:
        """The name, the words and the unit of a parameter."""
        key, field = f"{self.section}.{name}", self.__pydantic_fields__.get(name)
        if field is None:
            return unknown_parameter(key)
        extra = _extra(field)
        return Quantity(key, key, field.title or key, extra["symbol"], extra["unit"] or "1")

    @property
    def values(self) -> Mapping[str, float | str]:
        """The values of the parameters by their names; the words of the class last."""
        found: dict[str, float | str] = {}
        for name in self.__pydantic_fields__:
            value = vars(self)[name]
            if isinstance(value, Enum | int | float):
                found[name] = str(value.value) if isinstance(value, Enum) else float(value)
        return {**found, **self.words}

    @property
    def inert(self) -> Sequence[str]:
        """The names of parameters on which the linear problem does not depend."""
        return ()

    @property
    def differentiable(self) -> Sequence[str]:
        """The names of the parameters by which the linear problem can be differentiated."""
        return [name for name, value in self.values.items() if not isinstance(value, str) and name not in self.inert]

    @property
    def remarks(self) -> Sequence[Message]:
        """What limits the meaning of these parameters, each with its criterion."""
        return ()

    def at(self, values: Mapping[str, float | str]) -> Self:
        """It with other values of some parameters. Raises `ValueError` where there is none, or it is out of range."""
        for name in values:
            if name not in self.values:
                raise ValueError(f"got {name}; the parameters are {', '.join(self.values) or 'none'}")
        return self._with(values)

    def _with(self, values: Mapping[str, float | str]) -> Self:
        made: Self = replace(cast("Any", self), **values)
        return made


def unknown_parameter(key: str) -> Quantity:
    """A parameter of which no more than its key is known; a Greek name such as omega_0 is its symbol; epsilon is ε."""
    if key.endswith(".epsilon"):
        return Quantity(key, key, "small parameter", r"$\varepsilon$")
    greek = re.fullmatch(GREEK, key.rpartition(".")[2])
    latex = rf"$\{greek[1]}{f'_{{{greek[2]}}}' if greek[2] else ''}$" if greek else ""
    return Quantity(key, key, key, latex, "unknown")
