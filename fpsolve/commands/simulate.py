"""Estimate the exponents from simulated paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from itertools import chain
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.commands.options import (
    AGAIN,
    FLAGS,
    Cases,
    Count,
    Done,
    Flags,
    Fresh,
    kept,
    of_sets,
    on_cases,
    saying_if_interrupted,
)
from fpsolve.files import writable
from fpsolve.pool import SERIAL, Pool
from fpsolve.results.folders import own_folder
from fpsolve.results.simulate import SIMULATION, write_simulation
from fpsolve.solve.question import idle
from fpsolve.solve.records import Records, answered
from fpsolve.solve.set_result import SetResult, SimulatedSet
from fpsolve.solve.simulate import (
    RECORDS,
    form_of_record,
    is_finished,
    refuse_obstacles,
    simulation_key,
    simulation_of,
    simulation_steps,
)
from fpsolve.tell.notes import MONTE_CARLO, notes
from fpsolve.tell.progress import PERCENT, SILENT, Phase, Watch
from fpsolve.tell.reports import write_report
from fpsolve.tell.simulate import show, simulated_response_figure
from fpsolve.tell.solved import done_of, known_of


@dataclass(eq=False)
class Simulations:
    """The simulations of the parameter sets of a case, of which an earlier run may have kept some.

    Attributes:
        case: whose parameter sets these are.
        simulated: what is done, in the order of the parameter sets.
        interruption: where an interrupt ended the simulation, what is kept, and how to go on; empty without interrupt.
        known: how many an earlier run had finished.
    """

    case: Case
    simulated: list[SimulatedSet] = field(default_factory=list)
    interruption: str = ""
    known: int = 0

    @property
    def whole(self) -> int:
        """How many parameter sets are simulated to their end."""
        return sum(not each.interrupted for each in self.simulated)

    def run(self, folder: Path, pool: Pool, watch: Watch, results: Sequence[SetResult] = (), *, is_fresh: bool) -> None:
        """Simulate the parameter sets, write what is found of each, and show it.

        Args:
            folder: where they are written and kept.
            pool: whose other machines simulate; all processors of this one where there are none.
            results: what is solved of the same parameter sets.
            is_fresh: whether to do all of them again.
        """
        case, is_elsewhere = self.case, pool.is_elsewhere
        orders, setting = case.simulated.tolist(), case.monte_carlo
        work = Phase(case.name, "simulation", sum(map(simulation_steps, case.sets())), PERCENT)
        with watch.bar(work) as progress, writable(folder), pool if is_elsewhere else SERIAL as workers:
            found_of = answered(
                Records(folder / RECORDS, is_fresh=is_fresh),
                workers,
                partial(simulation_of, orders=orders, setting=setting, progress=idle if is_elsewhere else progress),
                case.sets(),
                kind=form_of_record(),
                key=partial(simulation_key, orders=orders, setting=setting),
                keeps=is_finished,
            )
            try:
                for parameter_set, found, is_known in found_of:
                    if is_elsewhere or is_known:
                        progress(simulation_steps(parameter_set), known=is_known)
                    self.known += is_known
                    self.simulated.append(SimulatedSet(parameter_set, *found))
                    write_simulation(case, self.simulated[-1], folder)
                    simulated_response_figure(case, self.simulated[-1]).write(folder)
                    if not is_finished(found):
                        break
            except KeyboardInterrupt:
                if len(self.simulated) in (0, case.planned):  # nothing is found, or all, but not written
                    raise
        if self.whole < case.planned:
            place = f"in the simulation of parameter set {self.whole + 1} of {case.planned}"
            self.interruption = f"interrupted {place}; what was done is kept in {folder}; {AGAIN}"
        watch.shown(show(case, self.simulated, results))
        watch.noted(notes(case, self.simulated, MONTE_CARLO))


def simulate_case(
    case: Case,
    out: str | Path = "results",
    *,
    pool: Pool = SERIAL,
    is_fresh: bool = False,
    watch: Watch = SILENT,
) -> Simulations:
    """Simulate a case and write `out`/<name of the case>/monte_carlo.json, for further sets monte_carlo-2.json, ….

    A system with terms of degree 3 adds the stationary response. The files of an earlier simulation, and of a run with
    other parameters, are removed first. An interrupt (Ctrl-C) ends the simulation, and writes its estimates so far. The
    next simulation does not repeat finished sets.

    Args:
        pool: whose other machines simulate, such as a `cluster`; all processors of this one where there are none.
        is_fresh: whether to simulate all parameter sets again.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: a parameter set cannot be simulated; nothing is written.
        KeyboardInterrupt: nothing was done yet, which its text says.
    """
    refuse_obstacles(case)
    folder, simulations, started = Path(out) / case.name, Simulations(case), datetime.now(UTC)
    with (
        own_folder(folder, "simulate", case=case),
        saying_if_interrupted(lambda: kept(len(simulations.simulated), of_sets(case), folder)),
    ):
        simulations.run(folder, pool, watch, is_fresh=is_fresh)
        blocks = chain(show(case, simulations.simulated), notes(case, simulations.simulated, MONTE_CARLO))
        is_whole = not simulations.interruption
        write_report(
            case, folder, watch, blocks, started=started, files=SIMULATION, complete=is_whole, name="monte_carlo.html"
        )
    return simulations


def simulate(
    cases: Cases,
    *,
    paths: Count | None = None,
    time: float | None = None,
    seed: Count | None = None,
    estimator: str | None = None,
    fresh: Fresh = False,
    flags: Flags = FLAGS,
) -> int:
    """Simulate the system with its impacts and estimate the exponents; write monte_carlo.json into OUT/<case>/.

    Ctrl-C ends the simulation early and keeps what is done.
    It does not repeat parameter sets that an earlier simulation finished.

    Example: fpsolve simulate cases/fig1.toml --paths 100000 --seed 1 --estimator population

    Args:
        paths: Number of paths; 32768 if the case does not state it.
        time: Length of the paths; if the case does not state it, 64 transients, or 16 for more than two variables.
        seed: Seed of the random numbers; 0 if the case does not state it.
        estimator: direct, or population for strong noise or large |p|; chosen if the case does not state it.
    """

    stated = {"paths": paths, "time": time, "seed": seed, "estimator": estimator}
    typed = {
        f"--{name} {value:{'g' if name == 'time' else ''}}": f"monte_carlo.{name}={value}"
        for name, value in stated.items()
        if value is not None
    }

    def work(case: Case, pool: Pool) -> Done:
        found = simulate_case(case, flags.out, pool=pool, is_fresh=fresh, watch=flags.watch())
        what = done_of(case, found.whole)
        return Done(what, known=known_of(case, found.known), interruption=found.interruption)

    return on_cases(
        cases, flags.options, work, typed=typed, refuse=refuse_obstacles, workers=flags.workers, out=flags.out
    )
