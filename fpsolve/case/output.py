"""[output]: what is computed of each curve, and what of it is written and drawn."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, model_validator

from fpsolve.case.messages import Refusal, refuse, repeated_or_unknown, shown, shown_with_kind
from fpsolve.case.sections import MAX_MOMENTS, Section, Values
from fpsolve.exponent.quantities import QUANTITIES
from fpsolve.model.parameters import parameter

SENSITIVITIES, EIGENFUNCTIONS = "sensitivities", "eigenfunctions"
QUANTITY_NAMES = (*QUANTITIES, SENSITIVITIES, EIGENFUNCTIONS)
"""What may be asked for; eigenfunctions with the stationary density."""


def _quantities(value: Any) -> Any:
    """A list of names, each known and there once."""
    known = ", ".join(f'"{name}"' for name in QUANTITY_NAMES)
    if not isinstance(value, list | tuple) or not value:
        text = f"got {shown_with_kind(value)}; must be a non-empty list of some of {known}; name one"
        refuse([((), value, text)])
    refuse(
        repeated_or_unknown(
            value,
            QUANTITY_NAMES,
            lambda name, guess: f"got {name};{guess} known names: {known}; rename or remove it",
        )
    )
    return tuple(value)


class OutputSection(Section):
    """[output]: what is computed, the p whose eigenfunctions are written, and whether sensitivities are drawn."""

    quantities: Annotated[
        tuple[str, ...],
        BeforeValidator(_quantities),
        parameter("what is computed", 'quantities = ["lyapunov_exponent", "stability_index"]'),
    ] = QUANTITY_NAMES
    eigenfunctions: Annotated[
        Values | None,
        parameter("the p written as VTK", "eigenfunctions = [1.0, 2.0]", strict=False, max_length=MAX_MOMENTS),
    ] = None
    sensitivities: Annotated[bool, parameter("whether sensitivities are drawn", "sensitivities = true")] = False

    @property
    def asks_for_eigenfunctions(self) -> bool:
        """Whether the file itself says that they are written, and not the defaults alone."""
        return EIGENFUNCTIONS in self.quantities and (
            self.eigenfunctions is not None or "quantities" in self.model_fields_set
        )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        refuse([*self._repeated(), *self._not_asked_for()])
        return self

    def _repeated(self) -> Iterator[Refusal]:
        wanted = self.eigenfunctions or ()
        first = {p: i for i, p in reversed(list(enumerate(wanted)))}
        for i, p in enumerate(wanted):
            if first[p] != i:
                yield ("eigenfunctions", i), p, f"got {p} twice; values must be distinct; remove one"

    def _not_asked_for(self) -> Iterator[Refusal]:
        if self.sensitivities and SENSITIVITIES not in self.quantities:
            text = 'got true, but output.quantities has no "sensitivities"; add it there, or write false'
            yield ("sensitivities",), True, text
        if self.eigenfunctions and EIGENFUNCTIONS not in self.quantities:
            text = f'got {shown(self.eigenfunctions)}, but output.quantities has no "eigenfunctions"'
            yield ("eigenfunctions",), self.eigenfunctions, f"{text}; add it there, or write eigenfunctions = []"
