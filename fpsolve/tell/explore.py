"""What `fpsolve explore` answers: numbers, sentences and curves of a case with other values of its parameters.

A question of a page that is newer than another one of its kind ends that before its next factorisation: the last
position of a slider wins, and nobody waits for what is not wanted any more.
"""

from __future__ import annotations

import math
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from html import unescape
from itertools import chain
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from pydantic import ValidationError

from fpsolve.budget import Meter, watched
from fpsolve.case.case import CHEAP, CHEAP_OF_WALLS, Case, load_case
from fpsolve.case.explain import UNBOUNDED, explain
from fpsolve.case.refusals import obstacle
from fpsolve.case.rewrite import rewritten
from fpsolve.case.sections import FigureSection, Moments, OutputSection
from fpsolve.case.uncertain import Uncertain
from fpsolve.case.vary import Vary
from fpsolve.errors import FpsolveError
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.quantities import INDICES, MOMENT
from fpsolve.messages import message_of
from fpsolve.model.equation import equations_of
from fpsolve.model.plane import BELOW
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.results.csv_json import facts_of
from fpsolve.solve.curve import CurveResult
from fpsolve.solve.question import Job, Numerics, fault
from fpsolve.solve.sets import everything, result_of, solve_curve
from fpsolve.tell import solved as results
from fpsolve.tell.blocks import Sentence
from fpsolve.tell.html import page_of, part_of_page
from fpsolve.tell.local import LocalPage
from fpsolve.tell.notes import notes
from fpsolve.tell.numbers import indices, moment_grid
from fpsolve.tell.problem import show as show_problem
from fpsolve.tell.progress import waiting
from fpsolve.tell.reports import COMPLETE
from fpsolve.tell.verdict import meaning, verdict
from fpsolve.tell.views import field_of, listed, map_of, paths_of

MOVING_RTOL = 1e-6
"""Relative error of Λ(p) while a slider moves, at least; a larger one takes a second solve of each p to be sure."""
APART = 1 / 6
"""Share of the interval of p between those that are solved while a slider moves, at least; 0, 2 and the ends are."""
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
MOST_EQUATIONS = 6
"""Lines of the equations of motion that the page shows; more would fill it."""
NO_BOUND = 1e3
"""A bound from which on it keeps formulas from overflow, and tells nothing of what is usual."""
NUMBERS = {MOMENT.name, *INDICES, "classes", "discretisation"}
"""The parts that are solved."""
Answer = Mapping[str, Any]
"""What JSON can hold."""
_is_gone: ContextVar[Callable[[], bool]] = ContextVar("is_gone", default=bool)


class Explorer:
    """Answers to the pages that show a case; several pages do not know of each other.

    Args:
        case: of its curves the first one is shown.
        code: Python that makes its problem.
    """

    def __init__(self, case: Case, code: str) -> None:
        first = next(case.curves(0, 1)).problem
        kinds = CHEAP + CHEAP_OF_WALLS * bool(first.system.jumps)
        p, method = case.p, choose(first)
        self.moves, has_square = method.is_quick, method.reason(2.0) is None
        if has_square:
            more = USUAL_P if p.size < FEW and self.moves else FEWEST_P
            p = np.union1d(p, more[more >= method.interval[0]] if method.has_pairs else more[1:])
        quantities = kinds if method.has_pairs else kinds[:1]
        self.source, self.code, self.first, self.quantities = case, code, first, quantities
        self._written = quantities[: 2 + has_square]
        is_same = np.array_equal(np.sort(case.p), p)
        changed = {"vary": Vary(), "figure": FigureSection(), "uncertain": Uncertain(), "expect": (), "chart": None}
        changed["moments"] = case.moments.model_copy(update={} if is_same else {"p": tuple(p.tolist())})
        changed["output"] = OutputSection(quantities=quantities)
        self.case = case.model_copy(update={**changed, "system": first.system, "noise": first.noise})
        few = [p[0], p[-1], *p[(p == 0) | (p == 2)]]
        for each in p:
            if np.min(np.abs(few - each)) >= APART * np.ptp(p):
                few.append(each)
        self._few, self._drawing = np.unique(few).tolist(), threading.Lock()
        self._newest, self._so_far = dict[tuple[str, str], float](), dict[str, dict[str, Any]]()
        self._answers: dict[str, Callable[[Mapping[str, Any]], Answer]] = {
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
            "stop": lambda _: {},
        }

    def answer(self, name: str, question: Mapping[str, Any], is_gone: Callable[[], bool] = bool) -> Answer:
        """The answer to a question by its name, or a sentence why there is none.

        Args:
            name: "stop" ends what the page asked for "of" a kind.
            question: the "page" that asks, its "number", and "values" of parameters by their keys.
            is_gone: whether nobody waits for the answer any more.
        """
        _is_gone.set(is_gone)
        kind = {"move": "curve", "solve": "curve", "stop": str(question.get("of"))}.get(name, name)
        asked, number = (str(question.get("page")), kind), question.get("number")
        if not isinstance(number, int | float):
            return {"refused": f"got {number!r} as the number of a question; must be a number; load the page again"}
        self._newest[asked] = max(number, self._newest.get(asked, number))
        try:
            started = perf_counter()
            with watched(partial(self._wait, asked, number)):
                return {**self._answers[name](question), "seconds": perf_counter() - started}
        except KeyboardInterrupt:
            return {"stopped": True}
        except FpsolveError as failure:
            return {"refused": failure.message}
        except Exception as failure:
            return {"refused": str(fault(failure))}

    def _wait(self, asked: tuple[str, str], number: float, meter: Meter) -> None:
        """Let the page know what it waits for, before the next factorisation."""
        self._look(asked, number)
        self._so_far.setdefault(asked[0], {})["waits"] = waiting(meter) if meter.number else ""

    def _look(self, asked: tuple[str, str], number: float) -> None:
        """End what is not wanted any more."""
        if self._newest[asked] != number or _is_gone.get()():
            raise KeyboardInterrupt

    def _start(self, _: Mapping[str, Any]) -> Answer:
        """The sliders, and what the page is about."""
        unit = MOMENT.timed(self.case.units.time).unit
        return {
            "title": self.source.title,
            "file": self.source.path.name if self.source.text else "",
            "knobs": list(self._knobs()),
            "moves": self.moves,
            "unit": unit,
        }

    def _knobs(self) -> Iterator[Answer]:
        """The parameters that the numbers depend on, each with its words and the ends of its slider."""
        linear, known = {*self.first.differentiable, *self.first.undifferentiable}, self.first.parameters
        for key in [key for key in known if key in linear]:
            about, value = known[key].quantity.timed(self.case.units.time), float(self.first.values[key])
            low, high, scale = self._range(key, value)
            words = "" if about.words == key else about.words
            yield {
                "key": key, "words": words, "symbol": _letters(about.latex), "unit": about.unit_in_words,
                "value": value, "ends": [min(low, value), max(high, value)],
                "log": scale == "log" and min(low, value) > 0, "axis": key in self.first.differentiable,
            }  # fmt: skip

    def _range(self, key: str, value: float) -> tuple[float, float, str]:
        """The ends of a slider: those of a chart, of what is varied, of the parameter, or usual ones."""
        for axis in (self.source.chart.x, self.source.chart.y) if self.source.chart else ():
            if axis.key == key:
                return axis.start, axis.stop, axis.scale
        varied = self.source.vary.columns.get(key, ())
        if len(varied) > 1 and not self.source.vary.is_text(key):
            low, high = float(min(varied)), float(max(varied))
            return low, high, "log" if low > 0 and high >= 8 * low else "linear"
        field = self.first.parameters[key].field
        least = 0.0 if field is None and value > 0 else -math.inf
        bounds = {"gt": least, "ge": least, "lt": math.inf, "le": math.inf}
        for rule in field.metadata if field else ():
            bounds |= {name: float(getattr(rule, name)) for name in bounds if hasattr(rule, name)}
        low, high = max(bounds["gt"], bounds["ge"]), min(bounds["lt"], bounds["le"])
        if max(abs(low), abs(high)) < NO_BOUND:
            inset = 0.01 * (high - low)
            return low + inset * (low == bounds["gt"]), high - inset * (high == bounds["lt"]), "linear"
        if value == 0:
            return (0.0 if low >= 0 else -1.0), 1.0, "linear"
        if value > 0 and low >= 0:
            return value / FACTOR, min(FACTOR * value, high), "log"
        return max(low, -BEYOND * abs(value)), min(BEYOND * abs(value), high), "linear"

    def _at(self, question: Mapping[str, Any]) -> Case:
        """The case with the values of a question. Raises `FpsolveError` where there is none."""
        values = question.get("values")
        known = {each["key"] for each in self._knobs()}
        if not isinstance(values, dict) or not {*values} <= known:
            raise FpsolveError(f"got {values!r}; must be values by their keys, which are {', '.join(sorted(known))}")
        try:
            problem = self.first.at(values)
        except ValidationError as failure:
            ranges = {key.rpartition(".")[2]: each.field or UNBOUNDED for key, each in self.first.parameters.items()}
            raise FpsolveError(
                "\n".join(f"{key}: {text}" for _, key, text in explain(failure.errors(), ranges))
            ) from failure
        except (TypeError, ValueError) as failure:
            raise FpsolveError(str(failure)) from failure
        if sentence := obstacle(self.first, values, self.case.p):
            raise FpsolveError(sentence)
        return self.case.model_copy(update={"system": problem.system, "noise": problem.noise})

    def _solved(self, case: Case, *, is_moving: bool = False) -> CurveResult:
        """What `run` finds of a case; while a slider moves at fewer p, within a larger error."""
        asked = {name: settings for name, settings in everything(case).items() if name in NUMBERS}
        numerics = Numerics.of(case)
        if is_moving:
            asked[MOMENT.name] = {"p": self._few, "slopes": False}
            numerics = replace(numerics, rtol=max(numerics.rtol, MOVING_RTOL))
        found = result_of(solve_curve(Job(next(case.curves()), asked, numerics)))
        if not found.moments.p.size:
            raise FpsolveError(message_of(found.failures[0].reason))
        return found

    def _move(self, question: Mapping[str, Any]) -> Answer:
        """The numbers as fast as that goes."""
        case = self._at(question)
        return self._told(case, self._solved(case, is_moving=True))

    def _solve(self, question: Mapping[str, Any]) -> Answer:
        """All numbers, as `run` finds them."""
        case = self._at(question)
        found = self._solved(case)
        return {**self._told(case, found), "table": part_of_page([moment_grid(case, found)])}

    def _told(self, case: Case, result: CurveResult) -> Answer:
        """The curve, the equation, and what a report says of it."""
        moments, order = result.moments, np.argsort(result.moments.p)
        equations = equations_of(case.system)
        names = ("p", "value", "derivative", "error_estimate")
        index, exponent = result.stability_index, result.lyapunov_exponent
        return {
            "curve": [listed(getattr(moments, name)[order]) for name in names],
            "root": index.value if index else None,
            "exponent": exponent.value if exponent else None,
            "equations": equations if len(equations) <= MOST_EQUATIONS else [],
            "verdict": part_of_page([Sentence(verdict(case, result)), *meaning(result)]),
            "numbers": part_of_page([*indices(case, result), *notes(case, [result], "")]),
            "table": "",  # which nobody reads while a slider moves
        }

    def _map(self, question: Mapping[str, Any]) -> Answer:
        """The lines on which stability ends; what there is of them so far, while they are traced."""

        def tell(found: Answer) -> None:
            self._so_far.setdefault(str(question.get("page")), {})["map"] = found

        return map_of(self._at(question), question.get("axes"), tell)

    def _paths(self, question: Mapping[str, Any]) -> Answer:
        """Simulated paths, and the λ that they grow by."""
        case, asked = self._at(question), (str(question.get("page")), "paths")
        exponent = self._solved(case, is_moving=True).lyapunov_exponent
        found = paths_of(case, partial(self._look, asked, question["number"]))
        return {**found, "exponent": exponent.value if exponent else None}

    def _save(self, question: Mapping[str, Any]) -> Answer:
        """A case of which `run` gives these numbers."""
        return {"name": f"{self.source.name}-explored.toml", "text": self._text(self._at(question))}

    def _text(self, case: Case) -> str:
        held = self.source.problem.values
        values = case.problem.values
        changed = {key: value for key, value in values.items() if value != held[key] or key in self.source.vary.keys}
        lists, p, names = dict[str, Any](), self.case.p.tolist(), self.source.output.names
        if p != self.source.p.tolist():
            lists["moments.p"] = p
        if names is not None and not {*self.quantities} <= {*names}:
            lists["output.quantities"] = dict.fromkeys((*names, *self.quantities))
        without = "expect", "vary", "figure"
        return rewritten(self.source, self.source.path.parent, changed, without=without, lists=lists)

    def _report(self, question: Mapping[str, Any]) -> Answer:
        """The report of these numbers."""
        started, case = datetime.now(UTC), self._at(question)
        found = self._solved(case)
        with self._drawing:  # matplotlib draws in one style at a time
            page = page_of(
                chain(results.show(case, [found], Path()), notes(case, [found], "")),
                title=case.headline,
                state=COMPLETE,
                equations=equations_of(case.system),
                about=list(show_problem(case)),
                facts={**facts_of(case, started), "case_text": self._text(case) if self.source.text else ""},
                file=f"{self.source.name}-explored.toml",
                more="`fpsolve run` of the case below writes all numbers.",
            )
        return {"name": f"{self.source.name}-explored.html", "text": page}

    def _python(self, question: Mapping[str, Any]) -> Answer:
        """Python that computes these numbers."""
        values, held = self._at(question).problem.values, self.source.problem.values
        changed = {key: value for key, value in values.items() if value != held[key]}
        names = ["moment_lyapunov", *self._written[1:]]
        p, rtol = self.case.p.tolist(), self.case.rtol
        calls = [f"print({name}(problem, {f'{p}, ' * (name == names[0])}rtol={rtol}))" for name in names]
        lines = [
            f"from fpsolve import load_case, {', '.join(names)}",
            "",
            f"problem = {self.code}.at({changed})",
        ]
        return {"text": "\n".join([*lines, *calls, ""])}


def _letters(latex: str) -> str:
    """A symbol in letters, such as τ₀; empty where it needs more than these."""
    text = unescape(re.sub(r"\\(?:var)?([A-Za-z]+)", r"&\1;", latex.strip("$")))
    text = re.sub(r"_(\d)", lambda digit: digit[1].translate(BELOW), text)
    return "" if re.search(r"[&_^{}]", text) else text


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
    """What `fpsolve explore` shows, in a notebook: Λ(p) with a slider for every parameter.

    The page is served by this process to this machine alone, at a free port of 127.0.0.1.

    >>> page = explore(problem)  # the last line of a cell shows it
    >>> page.close()

    Args:
        problem: a motion and its noise; or a case, or its file, whose first curve is shown.

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
    make: Any = Case.model_construct  # the other sections are as where none is stated
    case = make(title="", system=own.system, noise=own.noise, moments=moments)
    return Explored(Explorer(case, "problem"))
