"""The commands: fpsolve run | check | simulate | chart | prove | mesh."""

from __future__ import annotations

from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter
from rich.console import Console

from fpsolve import __version__
from fpsolve.arguments import (
    Cases,
    Count,
    Fresh,
    Jobs,
    Overrides,
    ProvenCases,
    Quiet,
    Scheduler,
    load,
    load_to_write,
    pool_of,
)
from fpsolve.case.remedies import in_words_of_a_case
from fpsolve.errors import FpsolveError
from fpsolve.process import drop_blocked_output

if TYPE_CHECKING:
    from fpsolve.workflow.watch import Watch

CHECK_FAILED, BAD_INPUT, NOT_CONVERGED, INTERRUPTED, CLOSED_PIPE = 1, 2, 3, 130, 141

app = App(
    name="fpsolve",
    help="""Moment Lyapunov exponents of a vibro-impact oscillator under coloured noise, by finite elements.

    Example: fpsolve run cases/fig1.toml

    Exit codes: 0 success, 1 a checked value differs, 2 bad input, 3 not converged, 130 interrupted""",
    version=lambda: f"fpsolve {__version__}",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)


@app.command
def run(
    cases: Cases,
    *,
    out: Annotated[Path, Parameter(help="Folder for the results.")] = Path("results"),
    monte_carlo: Annotated[
        bool, Parameter(help="Simulate too, as [monte_carlo] of the case says, and draw both.", negative="")
    ] = False,
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    fresh: Fresh = False,
    json: Annotated[
        bool, Parameter(help="Print the summaries, one line of JSON for each case, instead of tables.", negative="")
    ] = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Solve case files; write tables, figures and ParaView files into OUT/<case>/.

    What an earlier run has finished, also one that was killed, is not solved again.

    Example: fpsolve run cases/fig1.toml --out results --set oscillator.omega=2.0
    """
    from fpsolve.output.remarks import note_missing
    from fpsolve.output.terminal import done_of, known_of, print_written
    from fpsolve.workflow.cases import run_case

    code, loaded = 0, load_to_write(cases, overrides, {}, monte_carlo=monte_carlo)
    pool = pool_of(jobs, scheduler, loaded)
    for case in loaded:
        begun, watch = monotonic(), _watch(is_json=json, is_quiet=quiet)
        outcome = run_case(case, out, monte_carlo=monte_carlo, pool=pool, is_fresh=fresh, watch=watch)
        if outcome.interruption:
            print_error(outcome.interruption)
        if not quiet:
            note_missing(case, monte_carlo=monte_carlo)
        if json:
            print(_in_one_line(out / case.name / "summary.json"))
        else:
            what = done_of(case, len(outcome.results), sum(bool(each.failures) for each in outcome.results))
            print_written(out / case.name, what, monotonic() - begun, known_of(case, outcome.known))
        if outcome.interruption:
            return INTERRUPTED
        if outcome.failures:
            code = NOT_CONVERGED
    return code


@app.command
def simulate(
    cases: Cases,
    *,
    out: Annotated[Path, Parameter(help="Folder for the results.")] = Path("results"),
    paths: Annotated[Count | None, Parameter(help="How many paths; 32768 if nothing is stated.")] = None,
    time: Annotated[float | None, Parameter(help="Length of the paths; 64 transients if nothing is stated.")] = None,
    seed: Annotated[Count | None, Parameter(help="Seed of the random numbers; 0 if nothing is stated.")] = None,
    estimator: Annotated[
        str | None,
        Parameter(help="direct (if nothing is stated), or population for strong noise or large |p|."),
    ] = None,
    jobs: Annotated[Count | None, Parameter(help="How many processors; all if omitted.")] = None,
    scheduler: Scheduler = "",
    fresh: Fresh = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Simulate the system with its impacts and estimate the exponents; write monte_carlo.json into OUT/<case>/.

    Ctrl-C ends it early and keeps what is done; curves that an earlier simulation has finished are not simulated again.

    Example: fpsolve simulate cases/fig1.toml --paths 100000 --seed 1 --estimator population
    """
    from fpsolve.output.terminal import done_of, known_of, print_written
    from fpsolve.workflow.cases import simulate_case

    stated = {"paths": paths, "time": time, "seed": seed, "estimator": estimator}
    options = {
        f"--{name} {value:{'g' if name == 'time' else ''}}": f"monte_carlo.{name}={value}"
        for name, value in stated.items()
        if value is not None
    }
    loaded = load_to_write(cases, overrides, options, monte_carlo=True)
    pool = pool_of(jobs, scheduler)
    for case in loaded:
        begun, watch = monotonic(), _watch(is_quiet=quiet)
        outcome = simulate_case(case, out, pool=pool if scheduler else None, is_fresh=fresh, watch=watch)
        if outcome.interruption:
            print_error(outcome.interruption)
        what = done_of(case, sum(not each.interrupted for each in outcome.simulated))
        print_written(out / case.name, what, monotonic() - begun, known_of(case, outcome.known))
        if outcome.interruption:
            return INTERRUPTED
    return 0


@app.command
def check(
    cases: Cases,
    *,
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Solve case files and compare with the values that they expect; write nothing.

    Example: fpsolve check cases/fig1.toml cases/minimal.toml
    """
    from fpsolve.output.terminal import agreement, print_comparisons, print_failures, print_warnings
    from fpsolve.workflow.cases import check_case

    code, loaded = 0, load(cases, overrides, {})
    pool = pool_of(jobs, scheduler, loaded)
    for case in loaded:
        outcome = check_case(case, pool=pool, watch=_watch(is_quiet=quiet))
        if quiet:
            print(f"{case.name}: {agreement(outcome.comparisons)}")
            print_failures(case, outcome.results, file="")
        else:
            print_comparisons(case, outcome.comparisons)
            print_warnings(case, outcome.results, file="")
        if outcome.failures:
            code = NOT_CONVERGED
        elif not all(comparison.met for comparison in outcome.comparisons):
            code = max(code, CHECK_FAILED)
    return code


@app.command
def chart(
    cases: Cases,
    *,
    out: Annotated[Path, Parameter(help="Folder for the results.")] = Path("results"),
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Trace where stability ends in a plane of two parameters; write chart.csv, .json, .png and .pdf into OUT/<case>/.

    Example: fpsolve chart cases/chart.toml --set chart.x.stop=3.0
    """
    from fpsolve.output.remarks import FAILURE, print_remark
    from fpsolve.output.terminal import print_chart, print_written, traced
    from fpsolve.study.chart import refuse_no_chart
    from fpsolve.workflow.cases import chart_case

    code, loaded = 0, load_to_write(cases, overrides, {}, monte_carlo=False)
    for case in loaded:
        refuse_no_chart(case)
    pool = pool_of(jobs, scheduler)
    for case in loaded:
        begun = monotonic()
        found = chart_case(case, out, pool=pool, watch=_watch(is_quiet=quiet))
        if quiet:
            for text in dict.fromkeys(found.failures):
                print_remark(f"{case.name}: {in_words_of_a_case(text)}", FAILURE)
        else:
            print_chart(case, found)
        print_written(out / case.name, traced(found), monotonic() - begun)
        if found.failures:
            code = NOT_CONVERGED
    return code


@app.command
def prove(
    cases: ProvenCases = None,
    *,
    width: Annotated[
        float | None, Parameter(help="Wanted upper - lower, in 1/time; 1e-7 of the scale of each number if omitted.")
    ] = None,
    check: Annotated[Path | None, Parameter(help="Verify a proof.json from its certificates alone instead.")] = None,
    out: Annotated[Path, Parameter(help="Folder for the results.")] = Path("results"),
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Prove bounds on the exponents that hold with certainty; write them with certificates, OUT/<case>/proof.json.

    Needs python-flint: pip install 'fpsolve[proof]'. Exit codes: 0 proven, 3 a width is not met; of --check 0 accepted,
    1 rejected, 2 malformed.

    Example: fpsolve prove cases/fig1.toml --width 1e-9
    """
    from fpsolve.output.proofs import print_proofs
    from fpsolve.output.terminal import done_of, print_written
    from fpsolve.study.prove import refuse_unprovable_case
    from fpsolve.workflow.proofs import prove_case

    if (check is None) == (not cases):
        raise FpsolveError("name either cases to prove, or with --check a proof.json to verify")
    if check is not None:
        if width is not None or overrides or jobs is not None or scheduler:
            raise FpsolveError("--check takes a proof.json and nothing else, as that says all that is verified")
        return _verify(check)
    code, loaded = 0, load_to_write(cases or [], overrides, {}, monte_carlo=False)
    for case in loaded:
        refuse_unprovable_case(case, width)
    pool = pool_of(jobs, scheduler)
    for case in loaded:
        begun = monotonic()
        proofs = prove_case(case, out, width=width, pool=pool, watch=_watch(is_quiet=quiet))
        if not quiet:
            print_proofs(case, proofs)
        unmet = sum(not each.is_met for each in proofs)
        print_written(out / case.name, done_of(case, len(proofs), unmet, "not as close as wanted"), monotonic() - begun)
        if unmet:
            code = NOT_CONVERGED
    return code


def _verify(path: Path) -> int:
    """Check a proof.json, and say which claims do not follow."""
    from fpsolve.workflow.proofs import check_proof

    checked = check_proof(path)
    for text in checked.objections:
        print_error(f"{path}: {text}")
    bounds = f"bounds on {checked.claims.count} number{'s' * (checked.claims.count != 1)}"
    if checked.objections:
        objections = f"{len(checked.objections)} objection{'s' * (len(checked.objections) > 1)}"
        print(f"rejected: {path} ({objections}, {bounds})")
        return CHECK_FAILED
    unfinished = "" if checked.claims.complete else "; what proved them was interrupted"
    print(f"accepted: {path} ({bounds} follow from their certificates{unfinished})")
    return 0


@app.command
def mesh(
    output: Annotated[Path, Parameter(help="The file to write: .vtu for ParaView, .msh for Gmsh.")],
    *,
    phi_cells: Annotated[Count, Parameter(help="Cells in the phase from one impact to the next.")] = 2,
    phi_degree: Annotated[Count, Parameter(help="Degree of the elements in the phase.")] = 10,
    xi_cells: Annotated[Count, Parameter(help="Cells in the noise.")] = 4,
    xi_degree: Annotated[Count, Parameter(help="Degree of the elements in the noise.")] = 9,
    xi_min: Annotated[float, Parameter(help="Lower end of the noise, in standard deviations.")] = -8.0,
    xi_max: Annotated[float, Parameter(help="Upper end of the noise, in standard deviations.")] = 8.0,
    grading: Annotated[
        float, Parameter(help="Size of the outermost noise cells over the innermost; 1 is uniform.")
    ] = 1.0,
    full_circle: Annotated[bool, Parameter(help="Mesh the whole circle instead of one half.", negative="")] = False,
) -> int:
    """Write a mesh that a case can name as [mesh] file.

    Example: fpsolve mesh meshes/graded.vtu --phi-cells 3 --xi-cells 8 --grading 2
    """
    from fpsolve.fem.mesh import make_mesh
    from fpsolve.fem.mesh_file import write_mesh

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
    print(f"written: {output} ({cells} cells, {unknowns} unknowns)")
    return 0


def print_error(text: str) -> None:
    """Tell what is wrong, in the words of case files."""
    from rich.text import Text

    try:
        Console(stderr=True).print(Text(in_words_of_a_case(text)), style="bold red", soft_wrap=True)
    except (OSError, SystemExit):  # nobody can be told
        drop_blocked_output()


def _in_one_line(summary: Path) -> str:
    """A file of JSON, which may be long, as one line."""
    return "".join(line.strip() + " " for line in summary.read_text(encoding="utf-8").splitlines()).rstrip()


def _watch(*, is_json: bool = False, is_quiet: bool = False) -> Watch:
    """Shows progress, and prints what is found, or only what limits it; or only what failed."""
    from fpsolve.output.terminal import print_failures, print_results, print_simulation, print_warnings
    from fpsolve.progress import Bars, hidden
    from fpsolve.workflow.watch import Watch

    if is_quiet:
        return Watch(hidden, print_failures)
    bar = Bars().phase
    return Watch(bar, print_warnings) if is_json else Watch(bar, print_results, print_simulation)
