"""The simulations of a case: each curve is simulated, here or on a cluster, and kept as it is finished."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

from fpsolve.case.case import Case, Curve
from fpsolve.output.records import Records, append, record_of, simulated_of, simulation_key
from fpsolve.pool import Pool
from fpsolve.study.results import SimulatedCurve
from fpsolve.study.simulate import simulate_curve, simulate_curves, simulation_steps, simulation_work
from fpsolve.workflow.progress import Advance

SIMULATED_RECORDS = "records/simulated"


class Simulations:
    """The simulations of the curves of a case; finished ones are taken from their records.

    Args:
        case: whose curves these are.
        folder: where they are kept.
        is_fresh: whether to simulate all of them again.
    """

    def __init__(self, case: Case, folder: Path, *, is_fresh: bool = False) -> None:
        self.case, self.folder = case, folder
        self.asked: dict[str, Any] = {"orders": case.simulated.tolist(), "setting": case.monte_carlo}
        self.records = Records(folder / SIMULATED_RECORDS)
        if is_fresh:
            self.records.remove()
        curves = case.curves() if self.records.look().are_there else ()
        self._known = {curve.number for curve in curves if self._found(curve)}

    @property
    def known(self) -> int:
        return len(self._known)

    def curves(self, progress: Advance, pool: Pool | None) -> Iterator[SimulatedCurve]:
        """The simulations in the order of the curves; an interrupt ends them with what is done.

        Args:
            progress: called as often as `simulation_work` counts.
            pool: who simulates; None for all processors of this machine.
        """
        others = [curve for curve in self.case.curves() if curve.number not in self._known]
        if self._known:
            progress(simulation_work(self.case) - sum(map(simulation_steps, others)), known=True)

        def made(pool: Pool) -> Iterator[SimulatedCurve]:
            for curve, found in zip(others, pool.map(partial(simulate_curve, **self.asked), others), strict=True):
                progress(simulation_steps(curve))
                yield found

        with pool or nullcontext():
            elsewhere = made(pool) if pool else None
            for found in simulate_curves(self.case, progress=progress, known=self._found, made=elsewhere):
                if not found.interrupted and found.curve.number not in self._known:
                    append(self.records.folder, self._key(found.curve), record_of(found))
                yield found

    def _found(self, curve: Curve) -> SimulatedCurve | None:
        """Its simulation, if that is known; a record of another form does not count."""
        address = self.records.address(self._key(curve))
        try:
            return None if address is None else simulated_of(self.records.read(address), curve)
        except ValueError:
            return None

    def _key(self, curve: Curve) -> str:
        return simulation_key(curve, **self.asked)
