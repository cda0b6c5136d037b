"""The command line, fpsolve run | check | simulate | chart | design | prove | noise and others, and its messages."""

from __future__ import annotations

import math
import os
import re
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from io import TextIOWrapper
from pathlib import Path
from shlex import quote
from textwrap import fill
from time import monotonic
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, CycloptsPanel, Parameter

from fpsolve import __version__
from fpsolve.arrays import shown
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.errors import CaseError, FpsolveError, NotConverged, WorkersDied
from fpsolve.measured.statement import Count, ModeRows, ModesFile, Statement
from fpsolve.messages import Severity, escaped, message_of
from fpsolve.page.letters import HANDLER
from fpsolve.signals import INTERRUPTED, ended_by_signals

if TYPE_CHECKING:
    from fpsolve.case.case import Case
    from fpsolve.pool import Pool
    from fpsolve.workflow.progress import Watch
    from fpsolve.workflow.reports import Reporter

CHECK_FAILED, BAD_INPUT, NOT_CONVERGED, CLOSED_PIPE = 1, 2, 3, 141
TRACEBACK = "--traceback"
"""What any command takes to print also where an error was raised."""
NOTHING_STATED = Statement()

app = App(
    name="fpsolve",
    help="""Moment Lyapunov exponents of linear systems of two to four variables under random loads, by finite elements.

    A case file states a vibro-impact oscillator, [oscillator], or any other linear system, [system].

    Example: fpsolve run cases/fig1.toml

    Exit codes: 0 success, 1 a checked value differs or a design is out of reach, 2 bad input, 3 not converged,
    130 interrupted""",
    version=lambda: f"fpsolve {__version__}",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
    error_formatter=lambda error: CycloptsPanel(escaped(str(error))),
)

UNITS = "Units: omega in rad/time, c1 in 1/time, D0 in 1/time, tau0 in time"
Cases = Annotated[list[Path], Parameter(help="Case files.", consume_multiple=True, negative="")]
ProvenCases = Annotated[list[Path] | None, Parameter(help="Case files.", consume_multiple=True, negative="")]
SET = f"Another value for a key of the case, e.g. oscillator.omega=2.0 or system.zeta=0.1. {UNITS}."
Overrides = Annotated[list[str] | None, Parameter(name="--set", help=SET, negative="")]


Jobs = Annotated[Count | None, Parameter(help="Number of processes; if omitted, the number of processors.")]
Out = Annotated[Path, Parameter(help="Folder for the results.")]
Scheduler = Annotated[
    str, Parameter(help="Address of a Dask scheduler whose workers do the work, e.g. tcp://host:8786.")
]
Fresh = Annotated[bool, Parameter(help="Also solve or simulate again what an earlier run has finished.", negative="")]
Quiet = Annotated[
    bool,
    Parameter(
        help='Print only the last line, and on the standard error only errors and what is "not converged". Tables, '
        "notes and warnings are in the files.",
        negative="",
    ),
]


Report = Annotated[
    bool,
    Parameter(help="Also write report.html: one page with all results and figures.", negative=""),
]
Interactive = Annotated[
    bool,
    Parameter(
        help="Also write report.html, in which the pointer shows numbers. Needs pip install 'fpsolve[interactive]'.",
        negative="",
    ),
]


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit code, see the help of `app`.

    SIGHUP and SIGTERM interrupt it too; the exit code is then 128 and the number of the signal.
    """
    if argv is None and not sys.warnoptions:  # errors of the numbers tell what NumPy warns of
        warnings.simplefilter("ignore", RuntimeWarning)
        os.environ["PYTHONWARNINGS"] = "ignore::RuntimeWarning"  # of workers
    with ended_by_signals() as received:
        code = _run(argv)
    return 128 + received[0] if received else code


def _run(argv: Sequence[str] | None) -> int:
    for stream in (sys.stdout, sys.stderr):  # a terminal that has no Greek shows its names
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors=HANDLER)
    given = sys.argv[1:] if argv is None else argv
    try:
        try:
            Path.cwd()
        except OSError:
            raise FpsolveError("the working folder does not exist any more; change to another folder") from None
        code = _called([each for each in given if each != TRACEBACK])
        if sys.stdout is not None:  # as it is where the output is closed
            sys.stdout.flush()
    except CycloptsError:  # cyclopts has said what is wrong
        return BAD_INPUT
    except FpsolveError as failure:
        if TRACEBACK in given:
            traceback.print_exc()
        print_error(failure.message)
        return NOT_CONVERGED if isinstance(failure, NotConverged | WorkersDied) else BAD_INPUT
    except KeyboardInterrupt as interrupt:
        print_error(str(interrupt) or "interrupted")
        return INTERRUPTED
    except (BrokenPipeError, SystemExit):  # the reader of the output has gone, as with `| head -1`; rich exits then
        _drop_blocked_output()
        return CLOSED_PIPE
    except OSError as failure:
        _drop_blocked_output()
        place, reason = failure.filename or "the output", failure.strerror or failure
        print_error(f"{place} cannot be written: {reason}; send it to another place")
        return BAD_INPUT
    return code or 0


def _called(arguments: Sequence[str]) -> int | None:
    """The exit code of the command that is named; without one all are listed, without rich, whose import takes long."""
    if not arguments or [*arguments] in (["--help"], ["-h"]):
        print(_overview())
        return 0
    if split := [each for each in arguments if "\n" in each and "=" not in each]:  # values may have line ends
        raise FpsolveError(f"got {shown(split[0])}; a file's name may have no line ends here; rename the file")
    from rich.console import Console

    errors = Console(stderr=True)
    code: int | None = app(arguments, result_action="return_value", exit_on_error=False, error_console=errors)
    return code


def _overview() -> str:
    """What fpsolve is for, and what each command does."""

    def filled(text: str, first: str = "", rest: str = "") -> str:
        return fill(" ".join(text.split()), initial_indent=first, subsequent_indent=rest)

    commands = {name: app[name].help.partition("\n\n")[0] for name in sorted(app) if not name.startswith("-")}
    width = max(map(len, commands))
    about = [filled(part) for part in ["Usage: fpsolve COMMAND", *app.help.split("\n\n")]]
    told = [filled(text, f"  {name:{width}}  ", " " * (width + 4)) for name, text in commands.items()]
    told += ["", "fpsolve COMMAND --help tells of its arguments, fpsolve --version of the version."]
    told += ["With --traceback a command also prints where an error was raised."]
    return "\n".join(["\n\n".join(about), "", "Commands:", *told])


def print_error(text: str) -> None:
    """Print what is wrong on the standard error, in the words of case files."""
    from rich.console import Console
    from rich.text import Text

    try:
        Console(stderr=True).print(Text(escaped(message_of(text).words(CASE_WORDS))), style="bold red", soft_wrap=True)
    except (OSError, SystemExit):  # there is no place left to say it
        _drop_blocked_output()


def _drop_blocked_output() -> None:
    """Drop what waits in the standard output or errors and cannot be written, so that Python need not at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


@app.command
def new(
    name: Annotated[
        str,
        Parameter(
            help="A case that comes with fpsolve; if omitted, all are listed. With options the new file; if omitted, "
            "KIND.toml here."
        ),
    ] = "",
    file: Annotated[Path | None, Parameter(help="The new file, or its folder; if omitted, NAME.toml here.")] = None,
    *,
    kind: Annotated[
        str | None,
        Parameter(
            help="Write a case of this kind with comments: oscillator, which is meant if only other options are given, "
            "system for an equation of your own, parametric for noise in the stiffness, modes or plane."
        ),
    ] = None,
    frequency: Annotated[
        list[float] | None, Parameter(help="Its natural frequency in Hz; of two modes twice.", negative="")
    ] = None,
    damping_ratio: Annotated[
        list[float] | None,
        Parameter(help="Its damping as a share of critical damping; 0.01 if omitted.", negative=""),
    ] = None,
    modes: ModesFile = None,
    mode: ModeRows = None,
    restitution: Annotated[
        float | None, Parameter(help="Speed after a bounce off its wall over that before; no wall if omitted.")
    ] = None,
) -> int:
    """Copy a case that comes with fpsolve, list these cases with their titles, or write a commented one of a kind.

    Beside the new case is fpsolve.schema.json, with which editors complete and check it.

    Example: fpsolve new fig1 my_case.toml

    Example: fpsolve new my.toml --frequency 2 --damping-ratio 0.01 --restitution 0.9
    """
    from fpsolve.case.new import modes_of
    from fpsolve.workflow.noise import modes_from
    from fpsolve.workflow.shipped import copy_case, described_cases, write_case

    if any(each is not None for each in (kind, frequency, damping_ratio, restitution, modes, mode)):
        if file is not None:
            raise FpsolveError(f"got {name} and {file}; with --kind and other options name the new file only")
        if modes is not None and (frequency or damping_ratio):
            raise FpsolveError("--modes states frequencies and damping; leave out --frequency and --damping-ratio")
        if modes is None and mode is not None:
            raise FpsolveError("--mode is for the table that --modes names; name one, or leave it out")
        if modes is not None:
            table = modes_from(modes, mode or (), restitution)
            frequency = [each / (2 * math.pi) for each in table.omega]
            damping_ratio = [each for each in table.zeta if not math.isnan(each)]
        made = modes_of(frequency or [], damping_ratio or [], restitution)
        print(f"written: {escaped(str(write_case(kind or 'oscillator', made, Path(name) if name else None)))}")
        return 0
    if name:
        print(f"written: {escaped(str(copy_case(name, file)))}")
        return 0
    described = described_cases()
    for each, title in described.items():
        print(f"{each:{max(map(len, described))}}  {title}")
    return 0


@app.command
def schema() -> int:
    """Print the JSON Schema of case files, with which editors complete and check them.

    A case file names it in its first line, "#:schema fpsolve.schema.json", for the editors Taplo and Even Better TOML.

    Example: fpsolve schema > fpsolve.schema.json
    """
    from fpsolve.case.schema import schema_text

    print(schema_text(), end="")
    return 0


@app.command
def run(
    cases: Cases,
    *,
    out: Out = Path("results"),
    monte_carlo: Annotated[
        bool, Parameter(help="Also simulate, as [monte_carlo] of the case says, and draw both.", negative="")
    ] = False,
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    fresh: Fresh = False,
    json: Annotated[
        bool, Parameter(help="Print the summaries, one line of JSON for each case, instead of tables.", negative="")
    ] = False,
    everything: Annotated[
        bool, Parameter(name="--all", help='Compute everything, as quantities = "all" in [output].', negative="")
    ] = False,
    sample: Annotated[
        Count | None,
        Parameter(help="Also solve so many samples of the parameters that [uncertain] of the case names."),
    ] = None,
    report: Report = False,
    interactive: Interactive = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Solve case files; write tables, figures and ParaView files into OUT/<case>/.

    Curves that an earlier run has finished are not solved again, even if that run was killed.

    Without [output] quantities a case computes moment, lyapunov_exponent, stability_index, of walls impact_rate and
    critical_impact_factor, of terms of degree 3 the response, one of the eigenfunctions, and what other sections name.
    Only where they are named, or with --all, it computes variance_rate, critical_restitution, sensitivities, all
    eigenfunctions with densities, rate_function and excursions, too.

    Example: fpsolve run cases/fig1.toml --out results --set oscillator.omega=2.0
    """
    from fpsolve.output.tables import whole_summary
    from fpsolve.page.terminal import print_blocks
    from fpsolve.parts.intervals import refuse_wrong_samples
    from fpsolve.show.notes import left_out
    from fpsolve.show.results import done_of, known_of, last_line
    from fpsolve.workflow.cases import run_case

    code, reporter = 0, reporter_of(report, interactive)
    options = {} if sample is None else {f"--sample {sample}": f"uncertain.sample={sample}"}
    options |= {"--all": 'output.quantities="all"'} if everything else {}
    loaded = load_to_write(cases, overrides, options, monte_carlo=monte_carlo)
    for case in loaded:
        refuse_wrong_samples(case)
    pool = pool_of(jobs, scheduler) if sample else pool_of(jobs, scheduler, loaded)
    for case in loaded:
        start, watch = monotonic(), _watch(is_json=json, is_quiet=quiet)
        how: dict[str, Any] = {"monte_carlo": monte_carlo, "is_fresh": fresh, "reporter": reporter}
        outcome = run_case(case, out, pool=pool, watch=watch, **how)
        if outcome.interruption:
            print_error(outcome.interruption)
        if not (quiet or outcome.interruption):
            print_blocks(left_out(case, monte_carlo=monte_carlo))
        if json:
            print(whole_summary(case, outcome.results, outcome.facts))
        else:
            what = done_of(case, len(outcome.results), sum(each.status.fails for each in outcome.results))
            known = known_of(case, outcome.known, outcome.outdated)
            print_blocks([last_line(out / case.name, what, monotonic() - start, known)])
        if outcome.interruption:
            return INTERRUPTED
        if outcome.failures or (outcome.samples and outcome.samples.failed):
            code = NOT_CONVERGED
    return code


@app.command
def simulate(
    cases: Cases,
    *,
    out: Out = Path("results"),
    paths: Annotated[Count | None, Parameter(help="Number of paths; 32768 if the case does not state it.")] = None,
    time: Annotated[
        float | None,
        Parameter(
            help="Length of the paths; if the case does not state it, 64 transients, or 16 for more than two variables."
        ),
    ] = None,
    seed: Annotated[
        Count | None, Parameter(help="Seed of the random numbers; 0 if the case does not state it.")
    ] = None,
    estimator: Annotated[
        str | None,
        Parameter(help="direct, or population for strong noise or large |p|; direct if the case does not state it."),
    ] = None,
    jobs: Annotated[Count | None, Parameter(help="Number of processors; all if omitted.")] = None,
    scheduler: Scheduler = "",
    fresh: Fresh = False,
    report: Report = False,
    interactive: Interactive = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Simulate the system with its impacts and estimate the exponents; write monte_carlo.json into OUT/<case>/.

    Ctrl-C ends the simulation early and keeps what is done.
    Curves that an earlier simulation has finished are not simulated again.

    Example: fpsolve simulate cases/fig1.toml --paths 100000 --seed 1 --estimator population
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.results import done_of, known_of, last_line
    from fpsolve.workflow.cases import simulate_case

    reporter = reporter_of(report, interactive)
    stated = {"paths": paths, "time": time, "seed": seed, "estimator": estimator}
    options = {
        f"--{name} {value:{'g' if name == 'time' else ''}}": f"monte_carlo.{name}={value}"
        for name, value in stated.items()
        if value is not None
    }
    loaded = load_to_write(cases, overrides, options, monte_carlo=True)
    pool = pool_of(jobs, scheduler)
    for case in loaded:
        start, watch = monotonic(), _watch(is_quiet=quiet)
        how: dict[str, Any] = {"is_fresh": fresh, "reporter": reporter, "watch": watch}
        outcome = simulate_case(case, out, pool=pool if scheduler else None, **how)
        if outcome.interruption:
            print_error(outcome.interruption)
        what = done_of(case, sum(not each.interrupted for each in outcome.simulated))
        known = known_of(case, outcome.known, outcome.outdated)
        print_blocks([last_line(out / case.name, what, monotonic() - start, known)])
        if outcome.interruption:
            return INTERRUPTED
    return 0


@app.command
def check(
    cases: Cases,
    *,
    hierarchy: Annotated[
        bool,
        Parameter(
            help="Compare Λ of the even p of [moments] with the moment hierarchy instead, the equations of moments; "
            "without walls, under all noise but that with algebraic tails.",
            negative="",
        ),
    ] = False,
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Solve case files and compare the results with the values that they expect; write nothing.

    If another package registers the noise, each member of its class is compared with what follows from the others.

    Example: fpsolve check cases/fig1.toml cases/minimal.toml
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.comparison import agreement
    from fpsolve.show.comparison import show as show_comparisons
    from fpsolve.show.notes import note_on, notes
    from fpsolve.study.hierarchy import refuse_no_hierarchy
    from fpsolve.workflow.cases import check_case

    code, loaded = 0, load(cases, overrides)
    for case in loaded if hierarchy else ():
        refuse_no_hierarchy(case)
    pool = pool_of(jobs, scheduler, loaded)
    for case in loaded:
        outcome = check_case(case, by_hierarchy=hierarchy, pool=pool, watch=_watch(is_quiet=quiet))
        if quiet:
            print(f"{case.name}: {agreement(outcome.comparisons)}")
        else:
            print_blocks(show_comparisons(case, outcome.comparisons))
        print_blocks(notes(case, outcome.results, ""), [Severity.FAILURE] if quiet else list(Severity))
        print_blocks(note_on(case.name, fault) for fault in outcome.faults)
        if outcome.failures:
            code = NOT_CONVERGED
        elif outcome.faults or not all(comparison.met for comparison in outcome.comparisons):
            code = max(code, CHECK_FAILED)
    return code


@app.command
def chart(
    cases: Cases,
    *,
    out: Out = Path("results"),
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    report: Report = False,
    interactive: Interactive = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Trace where stability ends in a plane of two parameters; write chart.csv, .json, .png and .pdf into OUT/<case>/.

    [budget] line_seconds limits a line: what is traced by then is kept, and the exit code is 3.
    [budget] seconds limits a row of points of the grid; a point may take half of the time that is left for its row.
    Both limits are processor time.

    Example: fpsolve chart cases/chart.toml --set chart.x.stop=3.0
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.chart import show as show_chart
    from fpsolve.show.chart import traced
    from fpsolve.show.notes import note_on
    from fpsolve.show.results import last_line
    from fpsolve.study.chart import refuse_no_chart
    from fpsolve.workflow.cases import chart_case

    code, reporter = 0, reporter_of(report, interactive)
    loaded = load_to_write(cases, overrides)
    for case in loaded:
        refuse_no_chart(case)
    pool = pool_of(jobs, scheduler)
    for case in loaded:
        start = monotonic()
        found = chart_case(case, out, pool=pool, reporter=reporter, watch=_watch(is_quiet=quiet))
        if quiet:
            print_blocks(note_on(case.name, each) for each in dict.fromkeys(found.failures))
        else:
            print_blocks(show_chart(case, found, out / case.name))
        print_blocks([last_line(out / case.name, traced(found), monotonic() - start)])
        if found.failures:
            code = NOT_CONVERGED
    return code


@app.command
def design(
    cases: Cases,
    *,
    target: Annotated[
        str | None,
        Parameter(
            name="--for",
            help="What is wanted: 'stability_index = 1', 'lyapunov_exponent = -0.01' or 'moment(2) = 0'; as [design] "
            "target of the case states it if omitted.",
        ),
    ] = None,
    by: Annotated[
        list[str] | None,
        Parameter(
            help="A parameter that may change, such as oscillator.c1. With several the nearest point is found: that "
            "with the smallest relative changes.",
            negative="",
        ),
    ] = None,
    start: Annotated[
        list[float] | None,
        Parameter(
            name="--from", help="Its smallest value, one for each --by; half of its value if omitted.", negative=""
        ),
    ] = None,
    stop: Annotated[
        list[float] | None,
        Parameter(name="--to", help="Its largest value, one for each --by; twice its value if omitted.", negative=""),
    ] = None,
    out: Out = Path("results"),
    json: Annotated[bool, Parameter(help="Print design.json, one line for each case.", negative="")] = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Find the values of parameters with which λ, Λ(p) or δ_p has a wanted value.

    Write design.toml, the case with these values, and design.json into OUT/<case>/.

    Exit codes: 0 found, 1 it cannot be reached in the range, 2 bad input, 3 not converged.

    Example: fpsolve design cases/theorem.toml --for "stability_index = 1" --by oscillator.c1 --from -1 --to 1
    """
    from fpsolve.page.page import Note
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.design import found_of
    from fpsolve.show.design import show as show_design
    from fpsolve.show.results import last_line
    from fpsolve.study.design import refuse_no_design
    from fpsolve.workflow.cases import design_case

    code, options = 0, design_options(target, by, start, stop)
    loaded = load_to_write(cases, overrides, options)
    for case in loaded:
        refuse_no_design(case)
    for case in loaded:
        begun = monotonic()
        outcome = design_case(case, out, watch=_watch(is_json=json, is_quiet=quiet))
        if json:
            lines = (out / case.name / "design.json").read_text(encoding="utf-8").splitlines()
            print(" ".join(line.strip() for line in lines))
        is_short = quiet or json
        print_blocks(each for each in show_design(case, outcome) if isinstance(each, Note) or not is_short)
        if not json:
            print_blocks([last_line(out / case.name, found_of(outcome), monotonic() - begun)])
        if outcome.is_out_of_reach:
            code = max(code, CHECK_FAILED)
        elif outcome.found is None:
            code = NOT_CONVERGED
    return code


def design_options(
    target: str | None, by: Sequence[str] | None, start: Sequence[float] | None, stop: Sequence[float] | None
) -> dict[str, str]:
    """The keys of [design] that options state, by what was typed."""
    from json import dumps

    stated = (
        {f"--for {dumps(target, ensure_ascii=False)}": f"design.target={dumps(target)}"} if target is not None else {}
    )
    ends = {"--from": ("start", start or ()), "--to": ("stop", stop or ())}
    for option, (_, values) in ends.items():
        if len(values) not in (0, len(by or ())):
            raise FpsolveError(
                f"got {len(values)} {option} for {len(by or ())} --by; must be one for each --by, or none"
            )
    if by:
        entries = []
        for i, key in enumerate(by):
            own = [f"{name} = {values[i]!r}" for name, values in ends.values() if values]
            entries.append(f"{{ {', '.join([f'key = {dumps(key)}', *own])} }}")
        typed = [f"--by {key}" for key in by] + [
            f"{option} {each:g}" for option, (_, some) in ends.items() for each in some
        ]
        stated[" ".join(typed)] = f"design.by=[{', '.join(entries)}]"
    return stated


@app.command
def prove(
    cases: ProvenCases = None,
    *,
    width: Annotated[
        float | None,
        Parameter(help="Wanted distance of the bounds, in 1/time; if omitted, 1e-7 of the scale of each number."),
    ] = None,
    check: Annotated[
        Path | None, Parameter(help="Prove nothing, but verify a proof.json from its certificates alone.")
    ] = None,
    out: Out = Path("results"),
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    report: Report = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Prove bounds on the exponents that hold with certainty; write them with certificates into OUT/<case>/proof.json.

    A bound takes at most [budget] seconds of processor time and a third more.
    The bounds on δ_p together take at most twice as much.
    Needs python-flint: pip install 'fpsolve[proof]'.

    Exit codes: 0 proven, 3 bounds are farther apart than wanted; with --check 0 accepted, 1 rejected, 2 malformed.

    Example: fpsolve prove cases/fig1.toml --width 1e-9
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.proof import show as show_proofs
    from fpsolve.show.results import done_of, last_line
    from fpsolve.study.prove import refuse_unprovable_case
    from fpsolve.workflow.proofs import check_proof, prove_case

    if (check is None) == (not cases):
        raise FpsolveError("name either cases to prove, or with --check a proof.json to verify")
    if check is not None:
        if width is not None or overrides or jobs is not None or scheduler or report:
            raise FpsolveError("--check takes a proof.json and nothing else, as that says all that is verified")
        checked = check_proof(check)
        for text in checked.objections:
            print_error(f"{check}: {text}")
        bounds = f"bounds on {checked.claims.count} number{'s' * (checked.claims.count != 1)}"
        if checked.objections:
            objections = f"{len(checked.objections)} objection{'s' * (len(checked.objections) > 1)}"
            print(f"rejected: {escaped(str(check))} ({objections}, {bounds})")
            return CHECK_FAILED
        unfinished = "" if checked.claims.complete else "; what proved them was interrupted"
        print(f"accepted: {escaped(str(check))} ({bounds} follow from their certificates{unfinished})")
        if checked.claims.labels:
            told = "they are labels, as the certificates state matrices or rates, of which the bounds are"
            print(f"note: {', '.join(checked.claims.labels)} were not verified: {told}")
        return 0
    code, reporter = 0, reporter_of(report)
    loaded = load_to_write(cases or [], overrides)
    for case in loaded:
        refuse_unprovable_case(case, width)
    pool = pool_of(jobs, scheduler)
    for case in loaded:
        start = monotonic()
        watch = _watch(is_quiet=quiet)
        proofs = prove_case(case, out, width=width, pool=pool, reporter=reporter, watch=watch)
        if not quiet:
            print_blocks(show_proofs(case, proofs))
        unmet = sum(not each.is_met for each in proofs)
        what = done_of(case, len(proofs), unmet, "not as close as wanted")
        print_blocks([last_line(out / case.name, what, monotonic() - start)])
        if unmet:
            code = NOT_CONVERGED
    return code


@app.command
def noise(
    spectrum: Annotated[
        Path | None,
        Parameter(
            help="A spectral density: .csv, .txt, .npy, .npz, .mat, .uff or .nc, with a column of frequencies.",
        ),
    ] = None,
    *,
    stated: Statement = NOTHING_STATED,
    out: Out = Path("results"),
    json: Annotated[bool, Parameter(help="Print noise.json in one line.", negative="")] = False,
) -> int:
    """Fit a noise to what was measured, most of all at twice the natural frequency; say what it means for stability.

    Prints the section [noise] of a case, and writes noise.toml, a case with it, noise.json and a figure into
    OUT/<file>/. Frequencies of the fit are 2f, of two modes 2f1, 2f2, f1 + f2 and |f1 - f2|, and 0 for noise in the
    damping.

    Example: fpsolve noise spectrum.csv --per Hz --sided one --frequency 2.0 --damping-ratio 0.01 --averages 64

    Example: fpsolve noise --record shaking.csv --of acceleration --length 0.5 --damping-ratio 0.02 --kind filter
    """
    from fpsolve.output.noises import Convention, noise_sections
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.noise import show as show_noise
    from fpsolve.show.results import last_line
    from fpsolve.workflow.noise import measurement_of, noise_case

    start = monotonic()
    case = load([stated.case], None)[0] if stated.case else None
    data, wanted, source = measurement_of(spectrum, stated, case)
    shown = Convention(stated.per or "Hz", stated.sided or "one")
    outcome, folder, names = noise_case(data, wanted, source, shown, out, _watch(is_json=json))
    if json:
        print(" ".join(line.strip() for line in (folder / names[0]).read_text(encoding="utf-8").splitlines()))
    else:
        print(escaped(noise_sections(outcome).strip()), end="\n\n")
        print_blocks(show_noise(outcome, source, shown))
        print_blocks([last_line(folder, ", ".join(names), monotonic() - start)])
    return NOT_CONVERGED if outcome.failure is not None else 0


@app.command
def mesh(
    output: Annotated[Path, Parameter(help="The file to write: .vtu for ParaView, .msh for Gmsh.")],
    *,
    phi_cells: Annotated[Count, Parameter(help="Cells in the phase, from one impact to the next.")] = 2,
    phi_degree: Annotated[Count, Parameter(help="Degree of the elements in the phase.")] = 10,
    xi_cells: Annotated[Count, Parameter(help="Cells in the noise.")] = 4,
    xi_degree: Annotated[Count, Parameter(help="Degree of the elements in the noise.")] = 9,
    xi_min: Annotated[float, Parameter(help="Lower end of the noise, in standard deviations.")] = -8.0,
    xi_max: Annotated[float, Parameter(help="Upper end of the noise, in standard deviations.")] = 8.0,
    grading: Annotated[
        float, Parameter(help="Size of the outermost noise cells divided by that of the innermost; 1 is uniform.")
    ] = 1.0,
    full_circle: Annotated[
        bool, Parameter(help="Mesh the whole circle of phases instead of one half.", negative="")
    ] = False,
) -> int:
    """Write a mesh that a case can name as [mesh] file.

    Example: fpsolve mesh meshes/graded.vtu --phi-cells 3 --xi-cells 8 --grading 2
    """
    from fpsolve.fem.mesh import make_mesh, write_mesh

    made = make_mesh(
        phi_cells=phi_cells,
        phi_degree=phi_degree,
        xi_cells=xi_cells,
        xi_degree=xi_degree,
        xi_min=xi_min,
        xi_max=xi_max,
        grading=grading,
        full_circle=full_circle,
    )
    write_mesh(made, output)
    cells = (made.phi_lines.size - 1) * (made.z_lines.size - 1)
    unknowns = (made.phi_lines.size - 1) * (phi_degree + 1) * ((made.z_lines.size - 1) * xi_degree + 1)
    print(f"written: {escaped(str(output))} ({cells} cells, {unknowns} unknowns)")
    return 0


def load(
    paths: Sequence[Path], overrides: Sequence[str] | None, options: Mapping[str, str] = MappingProxyType({})
) -> list[Case]:
    """All cases. Raises one `FpsolveError` with the faults of all of them."""
    from fpsolve.case.case import load_case

    cases, errors = [], []
    for path in paths:
        try:
            cases.append(load_case(path, overrides or (), options))
        except CaseError as error:
            is_there = os.path.exists(path)  # noqa: PTH110  (Path.exists raises where a name is too long)
            if is_there or not re.match(r'[\w."-]+ *=', str(path)):
                errors.append(str(error))
            else:
                words = " ".join(f"--set {quote(text)}" for text in [*(overrides or ()), str(path)])
                errors.append(f"{path}: no such file; each --set takes one assignment: write {words}")
    if errors:
        raise FpsolveError("\n".join(errors))
    return cases


def load_to_write(
    paths: Sequence[Path],
    overrides: Sequence[str] | None,
    options: Mapping[str, str] = MappingProxyType({}),
    *,
    monte_carlo: bool = False,
) -> list[Case]:
    """All cases, or an error where two would write into one folder, or one that shall be simulated cannot be."""
    from fpsolve.study.simulate import refuse_obstacles

    cases = load(paths, overrides, options)
    for name, count in Counter(case.name for case in cases).items():
        if count > 1:
            raise FpsolveError(f'several cases are called "{name}" and would overwrite each other; run them apart')
    for case in cases if monte_carlo else ():
        refuse_obstacles(case)
    return cases


def pool_of(jobs: int | None, scheduler: str, cases: Sequence[Case] = ()) -> Pool:
    """Who does the work that the options ask for; no more processes than a case has sets, where cases are given."""
    from fpsolve.pool import MOST_JOBS, cluster, limit_processors, parallel

    if jobs is not None and scheduler:
        raise FpsolveError("--jobs is for this machine, and --scheduler for a cluster; name one of them")
    pool = cluster(scheduler) if scheduler else parallel(jobs, max((case.planned for case in cases), default=MOST_JOBS))
    if jobs is not None:
        limit_processors(jobs)
    return pool


def reporter_of(report: bool, interactive: bool = False) -> Reporter | None:
    """Who writes reports, if one is wanted. Raises `FpsolveError` where what it needs is not installed."""
    if not (report or interactive):
        return None
    from fpsolve.workflow.reports import Reporter

    return Reporter(is_interactive=interactive)


def _watch(*, is_json: bool = False, is_quiet: bool = False) -> Watch:
    """What is printed on the way: progress and results, with JSON no tables, or only what failed."""
    from fpsolve.page.terminal import print_blocks
    from fpsolve.workflow.progress import Bars, Watch

    if is_quiet:
        return Watch(noted=partial(print_blocks, severities=[Severity.FAILURE]), said=print_blocks)
    tables: dict[str, Any] = {} if is_json else {"shown": print_blocks}
    return Watch(Bars().bar, noted=print_blocks, said=print_blocks, **tables)


if __name__ == "__main__":
    sys.exit(main())
