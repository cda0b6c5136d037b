"""The curves of a case, simulated here or on a cluster, and kept as they are finished."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.case.curves import Curve
from fpsolve.output.records import Records, append
from fpsolve.pool import Pool
from fpsolve.study.results import SimulatedCurve
from fpsolve.study.simulate import SimulateCurve, simulate_curves, simulation_steps
from fpsolve.study.simulated import simulated_of, simulation_key, to_record

SIMULATED_RECORDS = "records/simulated"


def simulated_curves(
    case: Case, folder: Path, progress: Callable[[], None], *, pool: Pool | None, is_fresh: bool
) -> Iterator[SimulatedCurve]:
    """The simulations of all curves, in their order; those that are done already are taken from their records.

    Args:
        pool: who simulates; None for all processors of this machine.
        is_fresh: whether to simulate all of them anew.
    """
    records, task = Records(folder / SIMULATED_RECORDS), SimulateCurve.of(case)
    if is_fresh:
        records.remove()
    records.look()

    def key(curve: Curve) -> str:
        return simulation_key(curve, task.orders, task.setting)

    def known(curve: Curve) -> SimulatedCurve | None:
        place = records.place(key(curve))
        return None if place is None else simulated_of(records.read(place), curve)

    if pool is None:
        found = simulate_curves(case, progress=progress, known=known)
    else:
        found = _by_pool(case, pool, task, known, progress)
    for simulated in found:
        if not simulated.interrupted and records.place(key(simulated.curve)) is None:
            append(records.folder, key(simulated.curve), to_record(simulated))
        yield simulated


def _by_pool(
    case: Case,
    pool: Pool,
    task: SimulateCurve,
    known: Callable[[Curve], SimulatedCurve | None],
    progress: Callable[[], None],
) -> Iterator[SimulatedCurve]:
    """The same, by the workers of a pool; an interrupt ends it with what is done."""
    done = 0
    with pool:
        simulated = pool.map(task, (curve for curve in case.curves() if known(curve) is None))
        try:
            for curve in case.curves():
                found = known(curve) or next(simulated)
                for _ in range(simulation_steps(curve)):
                    progress()
                yield found
                done += 1
        except KeyboardInterrupt:
            if not done:
                raise
