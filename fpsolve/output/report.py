"""report.html: what was found of a case on one page that opens from disk, with nothing fetched from elsewhere."""

from __future__ import annotations

import re
import sys
import tempfile
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from subprocess import DEVNULL, TimeoutExpired
from subprocess import run as run_child
from typing import Any

from fpsolve.case.case import MOST_DRAWN, Case, Curve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.data import plain_unit, written
from fpsolve.errors import FpsolveError
from fpsolve.exponent.error import digits
from fpsolve.exponent.quantities import INDICES, LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX
from fpsolve.files import plain_text, write_text
from fpsolve.messages import Code, Message, Severity, message_of
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import RATE_FUNCTION
from fpsolve.output.charts import draw_chart
from fpsolve.output.directions import directions_file, draw_densities
from fpsolve.output.figures import draw, draw_rates, draw_response, draw_sensitivities, draw_stationary_responses
from fpsolve.output.meanings import equations_of, meanings, noises_of, parts_of, region_meaning, simulated_meanings
from fpsolve.output.proofs import PROOF, between, excursion_in_words, proof_grid, proofs_grid
from fpsolve.output.screen import Column, Grid
from fpsolve.output.sentences import excursions, shape_of_response
from fpsolve.output.terminal import (
    INTERVAL,
    MOST_TABLES,
    STYLES,
    chart_grid,
    curve_grid,
    exponent_grid,
    interval_text,
    moment_grid,
    sample_grid,
    simulation_grid,
    verdicts,
)
from fpsolve.parts.intervals import Samples, spreads_of
from fpsolve.proofs.balls import MissingFlint
from fpsolve.proofs.certificate import MalformedProof
from fpsolve.proofs.claims import CurveClaims, claims_from
from fpsolve.proofs.statement import statement_of
from fpsolve.study.chart import Chart, charted
from fpsolve.study.prove import CurveProof
from fpsolve.study.results import CurveResult, SimulatedCurve

REPORT = "report.html"
MOST_CHECKED = 3e7
"""Operations for the certificates of a curve that a report checks: some seconds."""
_OTHERS = "summary.json", "monte_carlo.json", "chart.json", "design.json", "proof.json"
"""What a command says that it has done."""
MOST_PICTURES, MOST_REMARKS = 3, 100
"""Curves whose eigenfunctions are shown, and messages that are told."""
PATIENCE = 120.0
"""Seconds that pictures of eigenfunctions may take."""
_FURTHER = re.compile(r"<(metadata|style)\b.*?</\1>", re.DOTALL)
"""Elements of SVG that would be of the whole page, or that no page needs."""
_COMMENT, _ID, _REFERENCE = re.compile(r"<!--.*?-->", re.DOTALL), re.compile(r'\bid="'), re.compile(r'(href="#|url\(#)')


@dataclass(frozen=True)
class Figure:
    """A figure of a report: SVG, or the content of a PNG file in base64, or why there is none."""

    title: str
    svg: str = ""
    png: str = ""
    missing: str = ""


@dataclass(frozen=True, eq=False)
class Found:
    """What a report tells of a case, as far as it is there.

    Attributes:
        results, simulated, chart, samples, proofs: what was found.
        facts: on the run, see `facts_of`.
        complete: whether all was done that was planned.
    """

    facts: Mapping[str, Any]
    results: Sequence[CurveResult] = ()
    simulated: Sequence[SimulatedCurve] = ()
    chart: Chart | None = None
    samples: Samples | None = None
    proofs: Sequence[CurveProof] = ()
    complete: bool = True


@dataclass(frozen=True)
class Reporter:
    """Writes reports.

    Args:
        is_interactive: whether Λ(p) and charts tell their numbers where the pointer is.

    Raises:
        FpsolveError: that needs plotly, which is not installed.
    """

    is_interactive: bool = False

    def __post_init__(self) -> None:
        if self.is_interactive and find_spec("plotly") is None:
            raise FpsolveError("--interactive needs plotly; install it by pip install 'fpsolve[interactive]'")

    def write(self, case: Case, found: Found, folder: Path) -> Message | None:
        """Write report.html into a folder; what to say where that failed.

        Raises:
            OSError: it cannot be written.
        """
        try:
            text = self._page(case, found, folder)
        except OSError:
            raise
        except Exception as failure:  # what is finished is there already, and shall not be lost for its picture
            return Message(Code.NO_REPORT, kind=type(failure).__name__, text=str(failure))
        write_text(folder / REPORT, text)
        return None

    def _page(self, case: Case, found: Found, folder: Path) -> str:
        from jinja2 import Environment, StrictUndefined

        template = files("fpsolve.output").joinpath(REPORT).read_text(encoding="utf-8")
        page = Environment(autoescape=True, undefined=StrictUndefined).from_string(template)
        plots = list(_plots(case, found)) if self.is_interactive else []
        grids = list(_grids(case, found))
        curve = next(case.curves(0, 1))
        return page.render(
            title=case.headline,
            state="Complete." if found.complete else "Not complete: the run ended early, and this is what was done.",
            facts=found.facts,
            file=case.path.name,
            equations=equations_of(curve.problem),
            about=list(_about(case, found, curve)),
            parameters=list(_parameters(case, curve)),
            meanings=list(_meanings(case, found, _claimed(folder) if found.results else {})),
            figures=list(_figures(case, found, folder)),
            plots=plots,
            plotly=_plotly() if plots else "",
            grids=grids,
            more=_more(found, folder),
            remarks=list(_remarks(case, found)),
        )


def _about(case: Case, found: Found, curve: Curve) -> Iterator[str]:
    yield from noises_of(curve.problem)
    if case.system.is_nonlinear:
        yield "Terms of degree 3 act on the stationary response only: Λ(p), λ and δ_p are of the linear system."
    if found.chart is not None:
        keys = f"{charted(case).x.key} and {charted(case).y.key}"
        yield f"The chart is over {keys}; the equation above has the values of the case."
    if case.planned > 1:
        yield f"{case.planned} curves, over {', '.join(case.vary.keys)}; the equation above is that of the first one."


def _parameters(case: Case, curve: Curve) -> Iterator[dict[str, Any]]:
    for key, each in curve.problem.parameters.items():
        quantity = each.quantity.timed(case.units.time)
        values = dict.fromkeys(case.vary.values(key)) if key in case.vary.keys else [each.value]
        shown = ", ".join(map(written, values)) if len(values) <= MOST_TABLES else f"{len(values)} values"
        unit = "" if quantity.unit in ("1", "unknown") else plain_unit(quantity.unit)
        words = "" if quantity.words == key else quantity.words
        yield {"key": key, "symbol": parts_of(quantity.latex), "value": shown, "unit": unit, "words": words}


def _claimed(folder: Path) -> dict[frozenset[Any], CurveClaims]:
    """What a proof.json beside the results claims, by the parameters."""
    try:
        curves = claims_from(plain_text(folder / PROOF)).curves
    except (OSError, ValueError, MalformedProof):  # there is none, or it is none of ours
        return {}
    numbers = [{key: v if isinstance(v, str) else float(v) for key, v in each.parameters.items()} for each in curves]
    return {frozenset(key.items()): each for key, each in zip(numbers, curves, strict=True)}


def _verdicts(claims: CurveClaims | None, problem: Problem) -> list[str]:
    """What is claimed of paths and moments: proven where it follows from certificates for this system."""
    if claims is None or not claims.verdicts:
        return []
    bounds = [each for claim in claims.claims.values() for each in claim.bounds]
    certificates = [each.certificate for each in bounds if each.certificate is not None]
    says = f"{PROOF} says: {'; '.join(claims.verdicts)}. This"
    if sum(each.work for each in certificates) > MOST_CHECKED:
        return [f"{says} was not checked here, as that takes long; `fpsolve prove --check {PROOF}` does it."]
    try:
        own = statement_of(problem)
        is_own = all((each.motion, each.chain) == (own.motion, own.chain) for each in certificates)
        objection = next(claims.objections(), "") if is_own else "its certificates are of another system"
    except MissingFlint as missing:
        return [f"{says} was not checked here: {missing}."]
    except (FpsolveError, TypeError, ValueError) as failure:
        objection = str(failure)
    return [f"{says} does not follow: {objection}."] if objection else [f"Proven: {each}." for each in claims.verdicts]


def _meanings(
    case: Case, found: Found, claimed: Mapping[frozenset[Any], CurveClaims]
) -> Iterator[tuple[str, list[str]]]:
    """By curves what their numbers say, and what is proven of them; of many curves, whose table is enough, nothing."""
    time_unit = case.units.time
    if len(found.results) <= MOST_DRAWN:
        for result in found.results:
            parameters = frozenset(result.curve.parameters.items())
            sure = [f"{each}, as parameters are uncertain." for each in verdicts(spreads_of(case, result))]
            rare = [text] if (text := excursions(case, result)) else []
            rare += [shape_of_response(result.response, case.system.response)] if result.response else []
            proven = _verdicts(claimed.get(parameters), result.curve.problem)
            if told := [*meanings(result, time_unit), *rare, *sure, *proven]:
                yield result.curve.label, told
    if not found.results and len(found.simulated) <= MOST_DRAWN:
        for each in found.simulated:
            yield each.curve.label, list(simulated_meanings(each, time_unit))
    for proof in found.proofs[:MOST_DRAWN]:
        bounds = [(LYAPUNOV_EXPONENT.symbol, proof.exponent), (STABILITY_INDEX.symbol, proof.index)]
        told = [f"{symbol} is {between(each)}" for symbol, each in bounds if each is not None and each.is_proven]
        told += [text] if (text := excursion_in_words(proof)) else []
        if told := [*proof.verdicts, *told]:
            yield proof.curve.label, [f"Proven: {each}." for each in told]
    if found.chart is not None and found.chart.regions is not None:
        ordered = sorted(found.chart.regions.each, key=lambda region: -region.share)
        zeros = [line.zero for line in found.chart.lines]
        yield "", [f"{each.share:.1%} of the frame: {each.name}.{region_meaning(each, zeros)}" for each in ordered]


def _figures(case: Case, found: Found, folder: Path) -> Iterator[Figure]:
    """All figures of the result, drawn again as SVG; of one that fails the reason."""
    jobs = list[tuple[str, str, Callable[..., None]]]()
    if found.results:
        over = "p" if case.figure.x == "p" else case.about(case.figure.x).words
        title = f"The {case.figure.quantity.words}, {case.figure.quantity.symbol}, over {over}"
        jobs.append(("figure", title, partial(draw, case, found.results, found.simulated, folder)))
        title = f"The {RATE_FUNCTION.words}, {RATE_FUNCTION.symbol}"
        jobs.append(("rate_function", title, partial(draw_rates, case, found.results, folder)))
    for result in found.results[:MOST_PICTURES]:
        title = f"Effect of the parameters{_of(result.curve)}"
        jobs.append((f"sensitivities{result.curve.suffix}", title, partial(draw_sensitivities, case, [result], folder)))
        if directions_file(result.curve, folder).is_file():
            title = (
                f"Densities of {'energy share and phase difference' if case.problem.dimension == 4 else 'directions'}"
            )
            draw_it = partial(draw_densities, case, [result], folder)
            jobs.append((f"densities{result.curve.suffix}", f"{title}{_of(result.curve)}", draw_it))
        if result.response and result.response.density:
            title = f"Stationary response{_of(result.curve)}"
            draw_it = partial(draw_stationary_responses, case, [result], found.simulated, folder)
            jobs.append((f"response{result.curve.suffix}", title, draw_it))
    for each in found.simulated[:MOST_PICTURES]:
        title = f"Simulated stationary response{_of(each.curve)}"
        jobs.append((f"monte_carlo_response{each.curve.suffix}", title, partial(draw_response, case, each, folder)))
    if found.chart is not None and found.chart.lines:
        title = f"Where stability ends, over {charted(case).x.key} and {charted(case).y.key}"
        jobs.append(("chart", title, partial(draw_chart, case, found.chart, folder)))
    with tempfile.TemporaryDirectory() as place:
        for name, title, job in jobs:
            path = Path(place) / f"{name}.svg"
            try:
                job(into=path)
                if path.exists():  # there may be nothing to draw
                    yield Figure(title, svg=_inlined(path.read_text(encoding="utf-8"), name))
            except Exception as failure:
                yield Figure(title, missing=_no_picture(f"{type(failure).__name__}: {failure}"))
        if found.results and case.shown.size and case.problem.dimension == 2:
            yield from _eigenfunctions(case, found.results[:MOST_PICTURES], folder, Path(place))


def _inlined(svg: str, name: str) -> str:
    """SVG that stands in a page beside others: without its prologue, size and comments, its ids with a name."""
    head, rest = _COMMENT.sub("", svg[svg.index("<svg") :]).split(">", 1)
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    rest = _REFERENCE.sub(rf"\1{name}-", _ID.sub(f'id="{name}-', _FURTHER.sub("", rest)))
    return f'{head} aria-hidden="true">{rest}'


def _eigenfunctions(case: Case, results: Sequence[CurveResult], folder: Path, place: Path) -> Iterator[Figure]:
    """Pictures of the eigenfunctions that were written, rendered by a process of its own, which may crash."""
    name = f"p{case.usual_p + 0.0:+}.vtu"
    there = [(each.curve, folder.resolve() / f"eigenfunctions{each.curve.suffix}" / name) for each in results]
    pictures = [(curve, path, place / f"{curve.number}.png") for curve, path in there if path.is_file()]
    if not pictures:
        return
    # with -P no file of the working folder is taken for a module
    command = [sys.executable or "python", "-P", "-m", "fpsolve.output.pictures"]
    command += [str(each) for _, *pair in pictures for each in pair]
    reason = "nothing was drawn"
    try:
        done = run_child(command, stdin=DEVNULL, capture_output=True, timeout=PATIENCE, check=False)
        reason = f"the process that draws it ended with {done.returncode}" if done.returncode else reason
    except (OSError, TimeoutExpired) as failure:
        reason = str(failure)
    for curve, _, picture in pictures:
        title = f"Eigenfunction T(φ, ξ) of p = {case.usual_p:g}{_of(curve)}"
        if picture.is_file():
            yield Figure(title, png=b64encode(picture.read_bytes()).decode())
        else:
            yield Figure(title, missing=_no_picture(f"{reason}; show.py draws it in ParaView"))


def _no_picture(reason: str) -> str:
    return Message(Code.NO_PICTURE, reason=reason).words(CASE_WORDS)


def _of(curve: Curve) -> str:
    """Which of the curves, after a title."""
    return f", {curve.label}" if curve.varied else ""


def _grids(case: Case, found: Found) -> Iterator[Grid]:
    """The tables of the terminal, and of each curve its indices."""
    results, simulated = found.results, found.simulated
    if results and (len(results) > MOST_TABLES or case.figure.x != "p"):
        yield curve_grid(case, results)
    elif results:
        for result in results:
            yield from [_index_grid(case, result)] if any(result.estimates.values()) else []
            yield from [moment_grid(case, result)] if result.moments.p.size else []
            yield from [_response_grid(case, result)] if result.response else []
    solved = {result.curve.key: result for result in results}
    pairs = [(each, solved.get(each.curve.key)) for each in simulated]
    if pairs and len(pairs) <= MOST_TABLES and case.figure.x == "p":
        yield from (simulation_grid(case, *pair) for pair in pairs)
    elif pairs:
        yield exponent_grid(case, pairs)
    if found.samples is not None:
        yield sample_grid(case, found.samples)
    if found.chart is not None:
        yield chart_grid(case, found.chart)
    if len(found.proofs) > MOST_TABLES:
        yield proofs_grid(case, found.proofs)
    else:
        yield from (proof_grid(case, proof) for proof in found.proofs)


def _index_grid(case: Case, result: CurveResult) -> Grid:
    """λ, δ_p and the other indices with their errors, beside perturbation theory."""
    columns = [Column("symbol"), Column("value"), Column("± error"), Column("unit"), Column("perturbation theory")]
    spreads = spreads_of(case, result).indices
    columns += [Column(INTERVAL)] * bool(spreads)
    grid = Grid(case.heading(result.curve), [Column("quantity", is_text=True), *columns])
    for name, index in INDICES.items():
        estimate = result.estimates[name]
        if estimate is None:
            continue
        theory, unit = index.theory(result.curve.problem), index.timed(case.units.time).unit
        told = f"{theory:.6g}, Eq. {index.closed_form}" if abs(theory) < float("inf") else ""
        number = digits(estimate.value, estimate.error_estimate)
        row = [index.words, index.symbol, number, f"{estimate.error_estimate:.0e}", "" if unit == "1" else unit, told]
        interval = interval_text(spreads[name]) if name in spreads else ""
        grid.rows.append([*row, *[interval] * bool(spreads)])
    return grid


def _response_grid(case: Case, result: CurveResult) -> Grid:
    """The numbers of the stationary response with their errors."""
    columns = [Column("symbol"), Column("value"), Column("± error"), Column("unit")]
    grid = Grid(case.heading(result.curve), [Column("quantity", is_text=True), *columns])
    for name, each in result.response.numbers.items() if result.response else ():
        about = case.system.response.numbers[name].timed(case.units.time)
        value = digits(each.value, each.error_estimate)
        unit = "" if about.unit == "unknown" else about.unit
        grid.rows.append([about.words, about.symbol, value, f"{each.error_estimate:.0e}", unit])
    return grid


def _more(found: Found, folder: Path) -> str:
    """Where all numbers are, and what other commands have left beside them."""
    names = ["summary.json", "curves.csv", "moments.csv", "results.nc"] * bool(found.results)
    names += ["monte_carlo.json"] * bool(found.simulated) + ["chart.csv", "chart.json"] * (found.chart is not None)
    names += ["sample.json"] * (found.samples is not None) + ["proof.json"] * bool(found.proofs)
    others = [name for name in _OTHERS if name not in names and (folder / name).is_file()]
    also = f" Other commands wrote {', '.join(others)} there; their own --report shows it." if others else ""
    return f"All numbers are in {', '.join(names)}, in the folder of the results, {folder.name}.{also}"


def _remarks(case: Case, found: Found) -> Iterator[dict[str, str]]:
    """Failures, warnings and notes, each text once with the curves that it is of."""
    whose: dict[tuple[Severity, str], list[str]] = {}
    told = [(each.curve, each.remarks) for each in found.results]
    for curve, remarks in told + [(each.curve, each.remarks) for each in found.simulated]:
        for severity, messages in remarks.items():
            for message in messages:
                whose.setdefault((severity, message_of(message).words(CASE_WORDS)), []).append(curve.label)
    for message in (*(found.chart.remarks if found.chart else ()), *(found.samples.remarks if found.samples else ())):
        whose.setdefault((message.severity, message.words(CASE_WORDS)), []).append("")
    ordered = sorted(whose.items(), key=lambda pair: list(STYLES).index(pair[0][0]))
    for (severity, text), labels in ordered[:MOST_REMARKS]:
        named = [each for each in dict.fromkeys(labels) if each]
        place = (
            f"{'; '.join(named)}: " if 0 < len(named) <= MOST_PICTURES else f"{len(named)} curves: " if named else ""
        )
        yield {"severity": severity.value, "word": STYLES[severity][0], "text": place + text}


def _plotly() -> str:
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


def _plots(case: Case, found: Found) -> Iterator[dict[str, Any]]:
    """Λ(p) of the curves and the lines of a chart as plotly takes them; texts are escaped, as it reads them as HTML."""
    unit = escape(MOMENT.timed(case.units.time).unit)
    if MOMENT.name in case.asked and found.results:
        moments = [(result.curve.label or MOMENT.symbol, result.moments) for result in found.results[:MOST_TABLES]]
        lines = [
            _line(name, each.p.tolist(), each.value.tolist(), error_y={"array": each.error_estimate.tolist()})
            for name, each in moments
        ]
        yield _plot("Λ(p)", lines, [{"title": {"text": "p"}}, {"title": {"text": f"{MOMENT.symbol} ({unit})"}}])
    if found.chart is not None and found.chart.lines:
        lines = []
        for line in found.chart.lines:
            for branch in line.branches:
                x, y, labels = branch.x.tolist(), branch.y.tolist(), list(branch.labels)
                ends = slice(1 if branch.closed else 0)
                text = [escape(label) for label in labels + labels[ends]]
                lines.append(_line(line.zero.equation, x + x[ends], y + y[ends], text=text))
        frame = charted(case).x, charted(case).y
        yield _plot(
            "Where stability ends", lines, [{"title": {"text": escape(axis.key)}, "type": axis.scale} for axis in frame]
        )


def _line(name: str, x: list[float], y: list[float], **more: Any) -> dict[str, Any]:
    return {"x": x, "y": y, "name": escape(name), "mode": "lines+markers", **more}


def _plot(title: str, data: list[dict[str, Any]], axes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    look: dict[str, Any] = {
        "margin": {"t": 60},
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": -0.25, "yanchor": "top"},
    }
    layout = {**look, "showlegend": True, "xaxis": axes[0], "yaxis": axes[1]}
    return {"title": f"{title}, with numbers where the pointer is", "data": data, "layout": layout}
