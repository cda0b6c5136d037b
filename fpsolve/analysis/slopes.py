"""Derivatives by the parameters θ of a problem, as data and as a picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.data import Result, dataset
from fpsolve.drawing import add_legend, draw_bars
from fpsolve.exponent.error import Estimate
from fpsolve.messages import Message
from fpsolve.model.quantity import (
    LYAPUNOV_EXPONENT,
    MOMENT,
    STABILITY_INDEX,
    THETA,
    VARIANCE_RATE,
    P,
    Quantity,
    moment_at,
)

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

RECORDS = {each.name: each for each in (LYAPUNOV_EXPONENT, STABILITY_INDEX, VARIANCE_RATE)}
DIFFERENTIATED = tuple(RECORDS)
"""The quantities that are no function of p."""
MOST_BARS = 4
"""Of so many p sensitivities are drawn."""
Slopes = Mapping[str, Estimate]
"""∂/∂θ by the key of θ."""


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivities(Result):
    """∂/∂θ for every parameter θ of a problem; all are `Estimate`s by the key of θ, such as "oscillator.omega".

    Attributes:
        theta: the values of the parameters.
        quantities: what the parameters are.
        p: the moments, shape (n,).
        moments: ∂Λ(p)/∂θ, one mapping for each p; empty where Λ(p) did not converge.
        indices: ∂/∂θ of "lyapunov_exponent", "stability_index" and "variance_rate"; without those that do not exist.
        notes: what is one-sided, and what is missing, and why.
    """

    theta: Mapping[str, float]
    quantities: Mapping[str, Quantity]
    p: FloatArray
    moments: tuple[Slopes, ...]
    indices: Mapping[str, Slopes]
    notes: tuple[Message, ...] = ()

    def to_xarray(self) -> xarray.Dataset:
        """The derivatives over p and θ, and their errors; NaN where there is none."""
        numbers = _labelled(MOMENT, self.moments, self.theta)
        for name, record in RECORDS.items():
            if name in self.indices:
                numbers |= _labelled(record, [self.indices[name]], self.theta)
        names, units = ([getattr(each, of) for each in self.quantities.values()] for of in ("name", "unit"))
        coordinates = {
            P: self.p,
            replace(THETA, name="parameter", words="key of a parameter", latex="", unit="1"): np.array(
                names, dtype=str
            ),
            THETA: np.array([*self.theta.values()], dtype=float),
            replace(THETA, name="theta_unit", words="unit of theta", latex="", unit="1"): np.array(units, dtype=str),
        }
        return dataset("sensitivities", "finite elements", numbers, coordinates, self.theta, notes=self.notes)

    def shown(self) -> Mapping[str, tuple[float, Slopes]]:
        """What pictures show: by their symbols λ, as p = 0, and Λ of some p, each with its derivatives."""
        rows = [(float(p), slopes) for p, slopes in zip(self.p, self.moments, strict=True) if p and slopes]
        chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_BARS)).round().astype(int))
        exponent = self.indices.get(LYAPUNOV_EXPONENT.name)
        first = {LYAPUNOV_EXPONENT.latex: (0.0, exponent)} if exponent else {}
        return first | {moment_at(rows[i][0]).latex: rows[i] for i in chosen}

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        bars = {
            label: np.array([self.theta[key] * each.value for key, each in slopes.items()])
            for label, (_, slopes) in self.shown().items()
        }
        draw_bars(axes, bars, [each.latex or key for key, each in self.quantities.items()], **kwargs)
        axes.set_xlabel(r"effect of a relative change, $\theta\,\partial/\partial\theta$ (1/time)")
        if bars:
            add_legend(axes)

    def _said(self) -> str:
        what = [*self.indices, *[f"Λ({p:g})" for p in self.p[:1]], *["..."] * (self.p.size > 1)]
        return f"of {', '.join(what) or 'nothing'} by {len(self.theta)} parameters"


def _labelled(record: Quantity, rows: Sequence[Slopes], theta: Mapping[str, float]) -> dict[Quantity, FloatArray]:
    """Derivatives by θ and their errors; without p there is one row."""
    slope = record.by(THETA)
    shape = (len(rows), len(theta))[2 - len(slope.dims) :]

    def array(of: Callable[[Estimate], float]) -> FloatArray:
        numbers = [of(row[key]) if key in row else np.nan for row in rows for key in theta]
        return np.array(numbers, dtype=float).reshape(shape)

    values, errors = array(lambda each: each.value), array(lambda each: each.error_estimate)
    return {slope: values, slope.error(): errors}
