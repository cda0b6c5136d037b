"""What a simulation found: estimates with standard errors, as data and as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.data import Result, dataset
from fpsolve.drawing import draw_dots, finish, label_axes
from fpsolve.messages import Message
from fpsolve.model.quantity import EFFECTIVE_PATHS, IMPACTS, LYAPUNOV_EXPONENT, MOMENT, VARIANCE_RATE, P
from fpsolve.simulation.setup import Estimator

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class MomentEstimate:
    """Λ(p) by simulation.

    Attributes:
        p: order of the moment.
        value, standard_error: Λ(p) and the standard deviation of this estimate; None where too few paths carry it.
        estimator: "direct" or "population".
        effective_paths: how many paths carry the mean. Direct: (Σw)²/Σw² over all windows with the weights w = ‖x‖^p
            at their ends. Population: the same for the paths of a transient ago with the weights of their descendants.
    """

    p: float
    value: float | None
    standard_error: float | None
    estimator: Estimator
    effective_paths: float


@dataclass(frozen=True, repr=False)
class MonteCarlo(Result):
    """What a simulation of one parameter set found.

    Attributes:
        estimates: Λ(p), in the order of p.
        lyapunov_exponent, lyapunov_exponent_error: λ and its standard error.
        variance_rate, variance_rate_error: Λ″(0), from the variance of ln‖x‖ over the paths, and its standard error.
        paths, time, step, seed: how many paths, their length after the transient, the time step, the seed.
        impacts: how many bounces the paths without weights had.
        warnings: what limits these numbers, each with its criterion.
        interrupted: whether the simulation was stopped early.
        parameters: of the problem, by keys such as "noise.D0".
    """

    estimates: tuple[MomentEstimate, ...]
    lyapunov_exponent: float
    lyapunov_exponent_error: float
    variance_rate: float
    variance_rate_error: float
    paths: int
    time: float
    step: float
    seed: int
    impacts: int
    warnings: tuple[Message, ...]
    interrupted: bool = False
    parameters: Mapping[str, float | str] = field(default_factory=dict, compare=False)

    def to_xarray(self) -> xarray.Dataset:
        """Λ(p) over p, λ and Λ″(0), with their standard errors; NaN where too few paths carry a moment."""
        return _dataset(self)

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        label = {"label": f"{found.attrs['method']} ± 2 standard errors"}
        draw_dots(axes, found.p.values, found.moment.values, found.moment_error.values, **{**label, **kwargs})
        label_axes(axes, found.p.attrs, found.moment.attrs)
        finish(axes, **{**label, **kwargs})

    def _said(self) -> str:
        rate = f"λ = {self.lyapunov_exponent:.6g} ± {self.lyapunov_exponent_error:.0e}"
        return f"{rate}, Λ(p) at {len(self.estimates)} p, {self.paths} paths"


def _dataset(found: MonteCarlo) -> xarray.Dataset:
    """What a simulation found, over p."""
    p, value, error, effective = (
        np.array([getattr(each, name) for each in found.estimates], dtype=float)
        for name in ("p", "value", "standard_error", "effective_paths")
    )
    kind = "standard error"
    numbers = {
        MOMENT: value,
        MOMENT.error(kind): error,
        EFFECTIVE_PATHS: effective,
        LYAPUNOV_EXPONENT: found.lyapunov_exponent,
        LYAPUNOV_EXPONENT.error(kind): found.lyapunov_exponent_error,
        VARIANCE_RATE: found.variance_rate,
        VARIANCE_RATE.error(kind): found.variance_rate_error,
        IMPACTS: found.impacts,
    }
    settings = {name: getattr(found, name) for name in ("paths", "time", "step", "seed")}
    estimator = found.estimates[0].estimator if found.estimates else ""
    more = {**settings, "estimator": estimator, "interrupted": int(found.interrupted), "warnings": found.warnings}
    return dataset(MOMENT.words, "Monte Carlo", numbers, {P: p}, found.parameters, **more)
