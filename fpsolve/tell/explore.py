"""What `fpsolve explore` answers: numbers, sentences and curves of a case with other values of its parameters.

Beside a curve that is the map of stability, T and densities, and simulated paths. A question of a page that is newer
than another one of its kind ends that before its next factorisation: the last position of a slider wins, and nobody
waits for what is not wanted any more. So does a page that is closed.
"""

from __future__ import annotations

import math
import re
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import partial
from html import unescape
from itertools import chain
from pathlib import Path
from time import perf_counter

import numpy as np
from pydantic import ValidationError

from fpsolve.analysis.axis import bounds_of, check_axes
from fpsolve.analysis.density import stationary_density, tilted_density
from fpsolve.analysis.scan import Scan, scan_row
from fpsolve.arrays import FloatArray
from fpsolve.budget import Meter, charge, watched
from fpsolve.case.case import CHEAP, CHEAP_OF_WALLS, Case, load_case
from fpsolve.case.explain import explain, is_number
from fpsolve.case.refusals import obstacle
from fpsolve.case.rewrite import rewritten
from fpsolve.case.sections import ChartSection, FigureSection, Moments, OutputSection
from fpsolve.case.uncertain import Uncertain
from fpsolve.case.vary import Vary
from fpsolve.data import Quantity
from fpsolve.errors import FpsolveError
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import DIRECTIONS
from fpsolve.exponent.quantities import MOMENT, SUMMARY_NUMBERS
from fpsolve.messages import message_of
from fpsolve.model.equation import equations_of
from fpsolve.model.faults import TableError
from fpsolve.model.plane import BELOW
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.model.quantity import GROWTH
from fpsolve.results.nodes import Nodes
from fpsolve.solve.chart import Chart, begun_lines, solve_chart
from fpsolve.solve.question import Job, Numerics, fault
from fpsolve.solve.set_result import SetResult
from fpsolve.solve.sets import everything, result_of, solve_set
from fpsolve.tell import solved as results
from fpsolve.tell.blocks import Column, Drawing, Grid, Sentence
from fpsolve.tell.chart import NAMED, show
from fpsolve.tell.local import Answer, LocalPage, Question
from fpsolve.tell.notes import notes
from fpsolve.tell.numbers import meaning, moment_grid, summary_numbers, verdict
from fpsolve.tell.progress import waiting
from fpsolve.tell.reports import page_of, part_of_page
from fpsolve.tell.text import sampled

MOVING_RTOL = 1e-6
"""Relative error of Λ(p) while a slider moves, at least; a larger one takes a second solve of each p to be sure."""
MOVING_P = 7
"""About so many p are solved while a slider moves; 0, 2 and the ends are among them."""
FEW = 9
"""A case with fewer p is shown at others, too."""
USUAL_P = np.linspace(-2.0, 4.0, 13)
"""These, of two variables under one noise that is a number."""
FEWEST_P = np.array([0.0, 2.0])
"""These of others, where each takes long."""
FACTOR = 10.0
"""From a positive value to the ends of its slider, where nothing says how far it may go."""
BEYOND = 3.0
"""The same of a value of any sign."""
NO_BOUND = 1e3
"""A bound from which on it keeps formulas from overflow, and tells nothing of what is usual."""
NUMBERS = {MOMENT.name, *SUMMARY_NUMBERS, "classes", "discretisation"}
"""The parts that are solved."""
PIXELS = 144, 72
"""Of a picture, each way."""
STEP = 16
"""So many pixels apart, either way, are the numbers of its table."""
PATHS, POINTS = 10, 400
"""Paths, and points of each; the motion is shown for as many steps."""


class Explorer:
    """Answers to the pages that show a case; several pages do not know of each other.

    Args:
        case: of its parameter sets the first one is shown.
        code: Python that makes its problem.
    """

    def __init__(self, case: Case, code: str) -> None:
        first = next(case.sets(0, 1)).problem
        method, kinds = choose(first), CHEAP + CHEAP_OF_WALLS * bool(first.system.jumps)
        self.moves, has_square = method.is_quick, method.reason(2.0) is None
        more = USUAL_P if case.p.size < FEW and self.moves else FEWEST_P
        p = np.union1d(case.p, [each for each in more if method.reason(each) is None])
        quantities = kinds if method.has_pairs else kinds[:1]
        self.source, self.code, self.first, self.quantities = case, code, first, quantities
        self._written = quantities[: 2 + has_square]
        changed = {
            "vary": Vary(), "figure": FigureSection(), "uncertain": Uncertain(), "expect": (), "chart": None,
            "moments": case.moments.model_copy(update={"p": tuple(p.tolist())}),
            "output": OutputSection(quantities=quantities), "system": first.system, "noise": first.noise,
        }  # fmt: skip
        self.case = case.model_copy(update=changed)
        chosen = np.isin(p, (p[0], 0.0, 2.0, p[-1])) | (np.arange(p.size) % (1 + p.size // MOVING_P) == 0)
        self._few, self._drawing = p[chosen].tolist(), threading.Lock()
        self._newest, self._stopped = dict[tuple[str, str], float](), dict[str, float]()
        self._so_far = dict[str, dict[str, Answer | str]]()
        self._answers: dict[str, Callable[[Question], Answer]] = {
            "start": self._start,
            "move": self._move,
            "solve": self._solve,
            "map": self._map,
            "listen": lambda asked: self._so_far.pop(str(asked.get("page")), {}),
            "field": lambda asked: field_of(self._at(asked), asked.get("p")),
            "paths": self._paths,
            "save": self._save,
            "report": self._report,
            "python": self._python,
        }

    def answer(self, name: str, question: Question, is_gone: Callable[[], bool] = bool) -> Answer:
        """The answer to a question by its name, or a sentence why there is none.

        Args:
            name: "stop" ends all that the page has asked before.
            question: the "page" that asks, its "number", and "values" of parameters by their keys.
            is_gone: whether nobody waits for the answer any more.
        """
        page, number = str(question.get("page")), question.get("number")
        if not isinstance(number, int | float):
            return {"refused": f"got {number!r} as the number of a question; must be a number; load the page again"}
        if name == "stop":
            self._stopped[page] = number
            return {}
        asked = page, "curve" if name in ("move", "solve") else name
        self._newest[asked] = max(number, self._newest.get(asked, number))

        def look(meter: Meter) -> None:
            """Before the next factorisation end what is not wanted any more, or let the page know what it waits for."""
            if is_gone() or self._newest[asked] != number or number < self._stopped.get(page, number):
                raise KeyboardInterrupt
            self._so_far.setdefault(page, {})["waits"] = waiting(meter) if meter.number else ""

        try:
            started = perf_counter()
            with watched(look):
                return {**self._answers[name](question), "seconds": perf_counter() - started}
        except KeyboardInterrupt:
            return {"stopped": True}
        except FpsolveError as failure:
            return {"refused": failure.message}
        except Exception as failure:
            return {"refused": str(fault(failure))}

    def _start(self, _: Question) -> Answer:
        """The sliders, and what the page is about."""
        time, chart = self.case.units.time, self.source.chart
        return {
            "title": self.source.title,
            "file": self.source.path.name if self.source.text else "",
            "knobs": list(self._knobs()),
            "moves": self.moves,
            "unit": MOMENT.timed(time).unit,
            "time": "time" if time == "time" else f"time ({time})",
            "axes": [chart.x.key, chart.y.key] if chart else [],
        }

    def _knobs(self) -> Iterator[Answer]:
        """The parameters that the numbers depend on, each with its words and the ends of its slider."""
        linear, known = {*self.first.differentiable, *self.first.undifferentiable}, self.first.parameters
        for key in [key for key in known if key in linear]:
            about, value = known[key].quantity.timed(self.case.units.time), float(self.first.values[key])
            low, high, is_log = self._range(key, value)
            yield {
                "key": key, "words": "" if about.words == key else about.words, "symbol": _letters(about.latex),
                "unit": about.unit_in_words, "value": value, "ends": [min(low, value), max(high, value)],
                "log": is_log and min(low, value) > 0, "axis": key in self.first.differentiable,
            }  # fmt: skip

    def _range(self, key: str, value: float) -> tuple[float, float, bool]:
        """The ends of a slider, those of a chart, of what is varied, of the parameter, or usual ones; if by logarithms.

        What a parameter may not reach is a hundredth of its range away.
        """
        for axis in (self.source.chart.x, self.source.chart.y) if self.source.chart else ():
            if axis.key == key:
                return axis.start, axis.stop, axis.scale == "log"
        varied = self.source.vary.columns.get(key, ())
        if len(varied) > 1 and not self.source.vary.is_text(key):
            low, high = float(min(varied)), float(max(varied))
            return low, high, low > 0 and high >= 8 * low
        low, high = bounds_of(self.first, key)
        if self.first.parameters[key].field is None and value > 0:
            low = 0.0
        if max(abs(low), abs(high)) < NO_BOUND:
            inset = 0.01 * (high - low)
            return low + inset * (low != round(low, 12)), high - inset * (high != round(high, 12)), False
        if value > 0 and low >= 0:
            return value / FACTOR, min(FACTOR * value, high), True
        size = BEYOND * abs(value) or 1.0
        return max(low, -size), min(size, high), False

    def _at(self, question: Question) -> Case:
        """The case with the values of a question. Raises `FpsolveError` where there is none."""
        values = question.get("values")
        known = {str(each["key"]) for each in self._knobs()}
        if not isinstance(values, dict) or not {*values} <= known:
            raise FpsolveError(f"got {values!r}; must be values by their keys, which are {', '.join(sorted(known))}")
        try:
            problem = self.first.at(values)
        except (TypeError, ValueError) as failure:
            text = re.sub(r"^\w+: (?=\w+: )", "", str(failure), flags=re.MULTILINE)  # without names of classes
            raise FpsolveError(text) from failure
        if sentence := obstacle(self.first, values, self.case.p):
            raise FpsolveError(sentence)
        return self.case.model_copy(update={"system": problem.system, "noise": problem.noise})

    def _solved(self, case: Case, *, is_moving: bool = False) -> SetResult:
        """What `run` finds of a case; while a slider moves at fewer p, within a larger error."""
        asked = {name: settings for name, settings in everything(case).items() if name in NUMBERS}
        numerics = Numerics.of(case)
        if is_moving:
            asked[MOMENT.name] = {"p": self._few, "slopes": False}
            numerics = replace(numerics, rtol=max(numerics.rtol, MOVING_RTOL))
        found = result_of(solve_set(Job(next(case.sets()), asked, numerics)))
        if not found.moments.p.size:
            raise FpsolveError(message_of(found.failures[0].reason))
        return found

    def _move(self, question: Question) -> Answer:
        """The numbers as fast as that goes."""
        case = self._at(question)
        return self._told(case, self._solved(case, is_moving=True))

    def _solve(self, question: Question) -> Answer:
        """All numbers, as `run` finds them."""
        case = self._at(question)
        found = self._solved(case)
        return {**self._told(case, found), "table": part_of_page([moment_grid(case, found)])}

    def _told(self, case: Case, result: SetResult) -> Answer:
        """The curve, the equation, and what a report says of it."""
        moments, order = result.moments, np.argsort(result.moments.p)
        columns = moments.p, moments.value, moments.derivative, moments.error_estimate
        index, exponent = result.stability_index, result.lyapunov_exponent
        return {
            "curve": [listed(each[order]) for each in columns],
            "root": index.value if index else None,
            "exponent": exponent.value if exponent else None,
            "equations": equations_of(case.system),
            "verdict": part_of_page([Sentence(verdict(case, result)), *meaning(result)]),
            "numbers": part_of_page([*summary_numbers(case, result), *notes(case, [result], "")]),
            "table": "",  # which nobody reads while a slider moves
        }

    def _map(self, question: Question) -> Answer:
        """The lines on which stability ends; what there is of them so far, while they are traced."""

        def tell(found: Answer) -> None:
            self._so_far.setdefault(str(question.get("page")), {})["map"] = found

        return map_of(self._at(question), question.get("axes"), tell)

    def _paths(self, question: Question) -> Answer:
        """Simulated paths, and the λ that they grow by."""
        case = self._at(question)
        exponent = self._solved(case, is_moving=True).lyapunov_exponent
        return {**paths_of(case), "exponent": exponent.value if exponent else None}

    def _save(self, question: Question) -> Answer:
        """A case of which `run` gives these numbers."""
        return {"name": f"{self.source.name}-explored.toml", "text": self._text(self._at(question))}

    def _text(self, case: Case) -> str:
        changed = self._changed(case) | {key: case.problem.values[key] for key in self.source.vary.keys}
        others, p, names = dict[str, object](), self.case.p.tolist(), self.source.output.names
        if p != self.source.p.tolist():
            others["moments.p"] = p
        if names is not None and not {*self.quantities} <= {*names}:
            others["output.quantities"] = [*dict.fromkeys((*names, *self.quantities))]
        without = "expect", "vary", "figure"
        return rewritten(self.source, self.source.path.parent, changed, without=without, others=others)

    def _report(self, question: Question) -> Answer:
        """The report of these numbers."""
        started, case = datetime.now(UTC), self._at(question)
        found = self._solved(case)
        with self._drawing:  # matplotlib draws in one style at a time
            page = page_of(
                case,
                chain(results.show(case, [found], Path()), notes(case, [found], "")),
                started,
                file=f"{self.source.name}-explored.toml",
                more="`fpsolve run` of the case below writes all numbers.",
                case_text=self._text(case) if self.source.text else "",
            )
        return {"name": f"{self.source.name}-explored.html", "text": page}

    def _python(self, question: Question) -> Answer:
        """Python that computes these numbers."""
        names = ["moment_lyapunov", *self._written[1:]]
        p, rtol = self.case.p.tolist(), self.case.rtol
        calls = [f"print({name}(problem, {f'{p}, ' * (name == names[0])}rtol={rtol}))" for name in names]
        lines = [
            f"from fpsolve import load_case, {', '.join(names)}",
            "",
            f"problem = {self.code}.at({self._changed(self._at(question))})",
        ]
        return {"text": "\n".join([*lines, *calls, ""])}

    def _changed(self, case: Case) -> dict[str, float | str]:
        """The parameters with other values than in the file."""
        fixed = self.source.problem.values
        return {key: value for key, value in case.problem.values.items() if value != fixed[key]}


def _letters(latex: str) -> str:
    """A symbol in letters, such as τ₀; empty where it needs more than these."""
    text = unescape(re.sub(r"\\(?:var)?([A-Za-z]+)", r"&\1;", latex.strip("$")))
    text = re.sub(r"_(\d)", lambda digit: digit[1].translate(BELOW), text)
    return "" if re.search(r"[&_^{}]", text) else text


def map_of(case: Case, axes: object, tell: Callable[[Answer], None]) -> Answer:
    """The lines λ = 0 and Λ(2) = 0 over two parameters, as `chart` traces them, and the regions between them.

    Args:
        axes: two tables such as those of [chart].
        tell: takes what there is so far, of the grid that is searched for a line its rows.
    """
    lines = ["lyapunov_exponent = 0"] * case.method.has_pairs + ["moment(2) = 0"] * (case.method.reason(2.0) is None)
    x, y = axes if isinstance(axes, list) and len(axes) == 2 else (None, None)
    try:
        frame = ChartSection.model_validate({"x": x, "y": y, "lines": lines})
        check_axes(case.problem, frame.x, frame.y)
    except ValidationError as failure:
        texts = [f"{key}: {text}" for _, key, text in explain(failure.errors(), ChartSection.model_fields)]
        raise FpsolveError("\n".join(texts)) from failure
    except TableError as failure:
        raise FpsolveError(str(failure)) from failure
    sides = frame.x, frame.y
    case, grid = case.model_copy(update={"chart": frame}), list[list[float | None]]()

    def answer(chart: Chart) -> Answer:
        return {
            "axes": [asdict(side) for side in sides],
            "grid": [*grid],
            "lines": [
                {"name": line.target.equation, "branches": [[*map(listed, each.path)] for each in line.branches]}
                for line in chart.lines
            ],
            "regions": [
                {"name": each.name, "at": [float(side.value(u)) for side, u in zip(sides, each.at, strict=True)]}
                for each in (chart.regions.each if chart.regions else ())
                if each.share >= NAMED
            ],
            "told": part_of_page(each for each in show(case, chart) if not isinstance(each, Drawing)),
        }

    def scans() -> Iterator[Scan]:
        for row in chain.from_iterable(line.rows() for line in begun):
            grid[:] = grid if row.number else [[None] * row.count] * row.count
            found = scan_row(row)
            grid[row.number] = listed(np.sign(found.values))
            tell(answer(chart))
            yield found

    chart, begun = Chart((), ()), begun_lines(case)
    for chart in solve_chart(begun, scans()):
        tell(answer(chart))
    grid.clear()
    return answer(chart)


def field_of(case: Case, p: object) -> Answer:
    """T and the stationary density over phase and noise, of three and four variables densities of directions."""
    if not is_number(p):
        raise FpsolveError(f"got p = {p!r}; must be a finite number; write, for example, 2")
    if why := case.method.no_picture:
        raise FpsolveError(why)
    solver = Numerics.of(case).solver(case.problem)
    stationary = solver.pair(0.0)
    density, pair = stationary_density(stationary), solver.pair(float(str(p)))  # which refuses one that misleads
    grid = density.grid
    unit = Quantity("", "", "", unit=grid.unit).timed(case.units.time).in_words()
    if case.method.pictures == DIRECTIONS:
        found = [density, *([tilted_density(pair)] if pair.p else [])]
        names = [each.in_words() for each in grid.quantities]
        panels = [panel(each.name + unit, grid.first, grid.second, each.values, names) for each in found]
        said = [Sentence(repr(each)) for each in found]
    else:
        noise = case.problem.noise_quantity.timed(case.units.time)
        nodes, names = Nodes.of(pair).seen(pair), ["phase φ (rad)", noise.in_words(" ξ")]
        draw = partial(panel, x=nodes.phi.ravel(), y=nodes.y, names=names, is_chain=nodes.is_lines)
        panels = [
            draw(f"eigenfunction T of p = {pair.p:g}", values=nodes.fields(pair).T),
            draw(f"stationary density{unit}", values=nodes.fields(stationary).T_adjoint),
        ]
        said = []
    pictures, tables = zip(*panels, strict=True)
    return {"panels": pictures, "told": part_of_page([*tables, *said])}


def listed(values: FloatArray) -> list[float | None]:
    """Numbers for JSON, which has no NaN."""
    return [each if math.isfinite(each) else None for each in values.tolist()]


def panel(
    title: str, x: FloatArray, y: FloatArray, values: FloatArray, names: Sequence[str], is_chain: bool = False
) -> tuple[Answer, Grid]:
    """A picture of values at nodes, on pixels between them, x first, of the states of a chain strips; and its table."""
    u, v = (np.linspace(each[0], each[-1], count) for each, count in zip((x, y), PIXELS, strict=True))
    rows = np.array([np.interp(u, x, column) for column in values.T])
    near = np.abs(v[:, None] - y).argmin(axis=1)
    pixels = np.array([column[near] if is_chain else np.interp(v, y, column) for column in rows.T])
    ends = [[u[0], u[-1]], [v[0], v[-1]]]
    picture: Answer = {"title": title, "ends": ends, "names": names, "values": [*map(listed, pixels)]}
    columns = [Column(" \\ ".join(names)), *(Column(f"{each:.3g}") for each in v[::STEP])]
    cells = np.column_stack([u, pixels[:, ::STEP]])[::STEP]
    return picture, Grid(title, columns, [[f"{each:.4g}" for each in row] for row in cells])


def paths_of(case: Case) -> Answer:
    """ln‖x(t)‖ of ten simulated paths, and the motion of one of them, whose wall throws it back."""
    from fpsolve.simulation.batches import standard_error
    from fpsolve.simulation.coefficients import coefficients, starting_state  # which takes 110 ms
    from fpsolve.simulation.kernels import RENORMALISED, advance
    from fpsolve.simulation.setup import obstacles, simulated_parts

    system, noise = simulated_parts(case.problem)
    if told := obstacles(system, noise):
        raise FpsolveError("; ".join(told.values()))
    known, rng = coefficients(system, noise), np.random.default_rng(case.monte_carlo.seed)
    h = known.default_step
    motion, (y, xi) = known.motion(h), starting_state(noise, PATHS, rng, known.size(h))

    def followed(count: int) -> tuple[FloatArray, FloatArray]:
        """After every so many steps ln‖x‖ of all paths, and the first variable of the first one."""
        log_norm, push = np.zeros((2, PATHS))
        logs, first = np.zeros((POINTS + 1, PATHS)), np.zeros(POINTS + 1)
        for k in range(POINTS + 1):
            logs[k], first[k] = log_norm, y[0, 0]
            charge(PATHS)
            advance(motion, h, y, xi, log_norm, push, np.zeros(2), count, RENORMALISED, rng)
        return logs, first * np.exp(logs[:, 0])

    short = h * np.arange(POINTS + 1)
    long = short * max(1, round(64 * known.transient() / h / POINTS))
    with Meter(math.inf).running():
        logs, _ = followed(round(long[1] / h))
        _, first = followed(1)
    if not (np.isfinite(logs).all() and np.isfinite(first).all()):
        raise FpsolveError("the paths leave the range of numbers; take a weaker noise")
    has_wall = any(abs(math.cos(jump.phase)) < 1e-12 for jump in system.jumps)  # at x = 0
    rates = logs[-1] / long[-1]
    mean, error = float(rates.mean()), standard_error(rates)
    rows: list[Sequence[str]] = [[f"{k}", f"{rate:.4g}"] for k, rate in enumerate(rates, 1)]
    unit = GROWTH.timed(case.units.time).unit
    grid = Grid("", [Column("path"), Column(f"ln‖x‖/t ({unit})")], rows)
    said = Sentence(f"Their mean growth rate ({unit}) is {sampled(mean, error)} ± {error:.1e}, a standard error.")
    return {
        "time": long.tolist(), "logs": logs.T.tolist(), "short": short.tolist(),
        "motion": (np.abs(first) if has_wall else first).tolist(),
        "name": case.problem.linear.states[0].removesuffix("₁"), "told": part_of_page([said, grid]),
    }  # fmt: skip


class Explored:
    """A page that a notebook shows as a cell; `close` ends it.

    Attributes:
        address: of the page, on this machine.
    """

    def __init__(self, explorer: Explorer) -> None:
        self._page = LocalPage(explorer.answer)
        self.address = self._page.address
        threading.Thread(target=self._page.serve_forever, daemon=True).start()

    def close(self) -> None:
        """Serve the page no more."""
        self._page.shutdown()
        self._page.server_close()

    def __repr__(self) -> str:
        return f"{self.address} shows it in a browser of this machine; close() ends it"

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.address}" title="fpsolve explore" width="100%" height="900"></iframe>'


def explore(problem: Problem | Case | str | Path) -> Explored:
    """`fpsolve explore` in a notebook: Λ(p) with a slider for every parameter.

    The page is served by this process to this machine alone, at a free port of 127.0.0.1.

    >>> page = explore(problem)  # the last line of a cell shows it
    >>> page.close()

    Args:
        problem: a motion and its noise; or a case, or its file, whose first parameter set is shown.

    Raises:
        CaseError: with every fault of the file.
        TypeError: it is something else.
    """
    if isinstance(problem, str | Path):
        problem = load_case(problem)
    if isinstance(problem, Case):
        return Explored(Explorer(problem, f"load_case({problem.path.name!r}).problem"))
    own, many = checked_problem(problem), Moments(p=tuple(USUAL_P.tolist()))
    moments = many if choose(own).is_function and choose(own).interval[0] < 0 else Moments(p=(2.0,))
    case = Case.model_construct(title="", system=own.system, noise=own.noise, moments=moments)
    return Explored(Explorer(case, "problem"))  # the other sections are as where none is stated
