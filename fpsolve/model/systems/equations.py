"""A system of one or more variables written as equations: ẋ = v, v̇ = −ω²x − 2ζωv − kx³ − ξx, with walls."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from operator import itemgetter
from typing import Annotated, ClassVar, Self, cast

import numpy as np
from pydantic import BeforeValidator, Field
from pydantic.fields import FieldInfo

from fpsolve.arrays import ROUNDED, Constant, FloatArray, Linear, identity, one, real_number, shortened, shown
from fpsolve.messages import Code, Message
from fpsolve.model.expressions import (
    HIGHEST_DEGREE,
    NUMBER,
    TIME,
    WAVES,
    ExpressionError,
    Form,
    Monomial,
    Series,
    constant,
    evaluate,
    log_of,
    name_fault,
    names_in,
    product,
    summands,
)
from fpsolve.model.faults import TableError
from fpsolve.model.noises.clock import Clock, Wave
from fpsolve.model.parameters import Section, Table, Words, parameter, stated_field, unknown_parameter, without_unit
from fpsolve.model.plane import (
    MOST_VARIABLES,
    CoefficientMatrix,
    CubicTerms,
    Function,
    Jump,
    LinearMotion,
    NoiseDerivative,
    ParameterDerivative,
    Stop,
    System,
    as_plane,
    common_unit,
)
from fpsolve.model.quantity import AMPLITUDE, JOINT_DENSITY, Quantity

EPSILON = "epsilon"
_COMBINED = 'a sum of several is for kind = "modes", whose masses tell how these share an impact'


Place = tuple[str | int, ...]
"""Keys and numbers, by which what is wrong is found in a case file."""


class StatedParameter(Words):
    """A parameter in a case file: a number, or a table with one."""

    value: Annotated[float, parameter("the value of a parameter", "omega = 1.0")]


class StatedWall(Section):
    """A wall in a case file."""

    at: Annotated[str, parameter("where the wall is", 'at = "x = 0"')]
    restitution: Annotated[object, parameter("R of v+ = -R v-, a number or an expression", "restitution = 0.8")]


Parameters = dict[
    str,
    Annotated[
        StatedParameter,
        BeforeValidator(
            lambda value: value if isinstance(value, dict | StatedParameter) else {"value": value},
            json_schema_input_type=float | StatedParameter,
        ),
    ],
]
Texts = Annotated[tuple[str, ...], Field(strict=False, min_length=1, max_length=MOST_VARIABLES)]


@contextmanager
def placed(*place: str | int) -> Iterator[None]:
    """Say where in a table a text is that is no arithmetic. Raises `TableError`."""
    try:
        yield
    except ExpressionError as error:
        raise TableError(str(error), *place) from None


@dataclass
class Read:
    """What texts say.

    Attributes:
        rates: of the variables.
        delays: by what is written as x(t - tau) the number of x, and tau.
        speeds: by what is written as cos(nu*t) nu.
        linear: the names in terms of degree 1.
    """

    rates: list[Form] = field(default_factory=list)
    delays: dict[str, tuple[int, Series]] = field(default_factory=dict)
    speeds: dict[str, Series] = field(default_factory=dict)
    linear: set[str] = field(default_factory=set)


def walls_of(walls: object) -> tuple[StatedWall, ...]:
    """Walls v⁺ = −R v⁻ from mappings with their keys, where they are and R. Raises `TableError`."""
    found = list[StatedWall]()
    for number, wall in enumerate(walls if isinstance(walls, list | tuple) else (walls,)):
        if not isinstance(wall, Mapping) or set(wall) != {"at", "restitution"}:
            raise TableError(f"got {shown(wall)}; must have the keys at and restitution alone", "walls", number)
        found.append(StatedWall.model_construct(**wall))
    return tuple(found)


@dataclass(frozen=True)
class EquationSystem(System):
    """Rates, each linear in the variables and affine in the noise, as text; see `PlaneSystem.of_equations`.

    Σ εⁿ (A + ξ B) x has one matrix for each power n of a parameter called epsilon, constant and with the noise. Without
    such a parameter ε = 1, what is constant has the order 0 and the noise the order 1. Of two variables there may be
    terms of degree 3 without the noise.

    Args:
        variables: their names, one or more.
        drift: their rates.
        named: the values of the parameters by their names.
        noises: what the noise is called in the rates, and the section that states it, one pair.
        walls: where the state is reflected, one at most.
        quantities: what parameters are, by their names, as far as that is stated.

    Raises:
        TableError: one of these is not what it must be, with its place.
    """

    variables: Sequence[str]
    drift: Sequence[str]
    named: tuple[tuple[str, float], ...] = ()
    noises: tuple[tuple[str, str], ...] = (("xi", "noise"),)
    walls: tuple[StatedWall, ...] = ()
    quantities: tuple[tuple[str, Quantity], ...] = field(default=(), repr=False, compare=False)

    kind: ClassVar[str] = "equations"
    source: ClassVar[str] = "drift"
    """The key of what its rates are written in."""
    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "variables": stated_field(Texts, "the names of the variables, one or more", 'variables = ["x", "v"]'),
        "drift": stated_field(Texts, "the rates of the variables", 'drift = ["v", "-omega**2 * x - xi * x"]'),
        "parameters": stated_field(Parameters, "the parameters by their names", "parameters = { omega = 1.0 }", {}),
        "noises": stated_field(
            dict[str, str],
            "the names of the noises, with their sections",
            'noises = { xi = "noise" }',
            {"xi": "noise"},
        ),
        "walls": stated_field(
            Annotated[tuple[StatedWall, ...], Field(strict=False)],
            "where the state is reflected",
            'walls = [{ at = "x = 0", restitution = 0.8 }]',
            (),
        ),
    }

    def __post_init__(self) -> None:
        for key, each in (("variables", self.variables), ("drift", self.drift)):
            texts = tuple(each) if isinstance(each, list | tuple) else (each,)
            if not 1 <= len(texts) <= MOST_VARIABLES or not all(isinstance(text, str) for text in texts):
                raise TableError(f"got {shown(each)}; must be a list of 1 to {MOST_VARIABLES} texts", key)
            object.__setattr__(self, key, texts)
        if len(self.drift) != len(self.variables):
            counts = f"{len(self.drift)} rates of {len(self.variables)} variables"
            raise TableError(
                f"got {counts}; must be one rate for each variable, in their order; add or leave out some", "drift"
            )
        self._refuse_faults()

    def _refuse_faults(self) -> None:
        """Refuse names, values, noises and walls that are not what they must be. Raises `TableError`."""
        known = set[object]()
        for name, path in self._given_names():
            fault = name_fault(name) if isinstance(name, str) else "must be a text"
            if not fault and (name in self.stated or name == "kind"):
                fault = "is a key of [system]; rename it"
            if not fault and name == EPSILON and path[0] != "parameters":
                fault = "is the name of the small parameter; rename it"
            if fault:
                raise TableError(f"got the name {shown(name)}; it {fault}", *path)
            if name in known:
                raise TableError(f"got the name {name} twice; all names must differ; rename one of them", *path)
            known.add(name)
        for name, value in self.named:
            try:
                real_number(value, name)
            except ValueError:
                text = f"got {shown(value)}; must be a finite number{without_unit(value)}"
                raise TableError(text, "parameters", name) from None
            if name == EPSILON and not value > 0:
                raise TableError(f"got {value:g}; must be > 0; epsilon = 1 is the unscaled system", "parameters", name)
        if not self.noises:
            raise TableError("got no noise; must be one at least; write one into drift and name it here", "noises")
        sections = [section for _, section in self.noises]
        for name, section in self.noises:
            if sections.count(section) > 1 or (len(sections) > 1 and section == "noise"):
                must = 'must have a section of its own, such as "noise.axial" and "noise.lateral"'
                raise TableError(f"got {shown(section)}; each of several noises {must}; rename it", "noises", name)
            if not re.fullmatch(r"noise(\.[A-Za-z0-9_-]+)?", str(section)):
                must = 'must be the name of a section, "noise" or, for example, "noise.axial"'
                raise TableError(f"got {shown(section)}; {must}; rename it", "noises", name)
            if fault := self._unused(name, section):
                raise TableError(fault, "noises", name)
        if self.walls and (self.pasts or len(self.walls) > 1 or len(self.variables) < 2):
            found = f"{len(self.walls)} for {len(self.variables)} variables{' with a delay' * bool(self.pasts)}"
            why = "must be one at most, none of one variable, and none with a delay"
            raise TableError(f"got {found}; {why}; leave out walls", "walls")
        linear = self.linear()  # refuses what it cannot be
        for i, name in enumerate(self.variables if linear.cubic else ()):
            if name.startswith(AMPLITUDE.name) or name == JOINT_DENSITY.name:
                what = "which has another meaning in the stationary response of terms of degree 3; rename it"
                raise TableError(f"got the name {name}, {what}", "variables", i)

    def _given_names(self) -> Iterator[tuple[object, Place]]:
        """All names with their places."""
        yield from ((name, ("variables", i)) for i, name in enumerate(self.variables))
        yield from ((name, ("parameters", str(name))) for name, _ in self.named)
        yield from ((name, ("noises", str(name))) for name, _ in self.noises)

    def _unused(self, name: str, section: str) -> str:
        """What is wrong where a noise drives nothing."""
        if name in self._used:
            return ""
        others = sorted(self._used.difference(self.variables, self.values, dict(self.noises)))
        if not others:
            _ = self._read  # its fault may be why the noise is in none
        named = f', or name the noise, noises = {{ {others[0]} = "{section}" }}' if others else ", or remove it"
        return f"{name} is in no rate; write it into drift{named}"

    def _texts(self) -> Iterator[tuple[str, Place]]:
        """What the rates are written in, with their places."""
        yield from ((text, ("drift", i)) for i, text in enumerate(self.drift))

    @cached_property
    def _used(self) -> frozenset[str]:
        """The names in these. Raises `TableError`."""
        found = frozenset[str]()
        for text, place in self._texts():
            with placed(*place):
                found |= names_in(text)
        return found

    @property
    def _in_walls(self) -> frozenset[str]:
        """The names in restitutions."""
        return frozenset[str]().union(*(names_in(str(wall.restitution)) for wall in self.walls))

    @classmethod
    def named_of(cls, table: Table) -> tuple[tuple[tuple[str, float], ...], tuple[tuple[str, Quantity], ...]]:
        """The parameters of a table, and what they are. Raises `TableError` where two have one symbol."""
        parameters: Mapping[str, StatedParameter] = table.get("parameters", {})
        quantities = tuple(
            (name, each.of(unknown_parameter(f"{cls.section}.{name}"))) for name, each in parameters.items()
        )
        signs = [quantity.shown.strip("$") for _, quantity in quantities]
        for name, sign in zip(parameters, signs, strict=True):
            if parameters[name].symbol and signs.count(sign) > 1:
                text = f"got the symbol {sign} of two parameters; all must differ; choose another one"
                raise TableError(text, "parameters", name, "symbol")
        return tuple((name, each.value) for name, each in parameters.items()), quantities

    @classmethod
    def from_table(cls, table: Table) -> EquationSystem:
        named, quantities = cls.named_of(table)
        return cls(
            variables=table["variables"],
            drift=table["drift"],
            named=named,
            noises=tuple(table.get("noises", {"xi": "noise"}).items()),
            walls=table.get("walls", ()),
            quantities=quantities,
        )

    @property
    def epsilon(self) -> float:
        """The parameter of this name; 1 where there is none."""
        return dict(self.named).get(EPSILON, 1.0)

    @property
    def remarks(self) -> Sequence[Message]:
        """Which parameters are in no rate and in no restitution."""
        used = self._used | self._in_walls
        unused = tuple(f"{self.section}.{name}" for name, _ in self.named if name not in used)
        return [Message(Code.UNUSED, keys=unused)] if unused else []

    @property
    def noise_sections(self) -> Sequence[str]:
        return tuple(section for _, section in self.noises)

    @property
    def values(self) -> Mapping[str, float | str]:
        return dict(self.named)

    def quantity_of(self, name: str) -> Quantity:
        return dict(self.quantities).get(name) or super().quantity_of(name)

    def _with(self, values: Mapping[str, float | str]) -> Self:
        return replace(self, named=tuple({**dict(self.named), **cast("dict[str, float]", values)}.items()))

    @cached_property
    def _read(self) -> Read:
        return self._read_by("")

    def _read_by(self, by: str) -> Read:
        """The rates, with their derivatives by a parameter. Raises `TableError`."""
        read = Read()
        names = {
            **{name: product(name) for name in self.variables},
            **{name: product(noise=name) for name, _ in self.noises},
            **self._names(by),
        }
        terms, of_time = list[tuple[int, float, str, Form]](), partial(self._of_time, read, by)
        for i, (variable, text) in enumerate(zip(self.variables, self.drift, strict=True)):
            with placed("drift", i):
                for sign, term in summands(text) if text.strip() != "0" else ():
                    terms.append((i, sign, term, evaluate(term, names, f"{variable}'s rate", of_time)))
        read.rates = [Form({})] * len(self.variables)
        is_linear = bool(read.delays) or any(not each[0] for *_, form in terms for each in form.parts)
        for i, sign, term, form in terms:
            if fault := next(filter(None, (self._fault(each, is_linear) for each in form.parts)), ""):
                raise TableError(f"the term {shortened(term)} of {self.variables[i]}'s rate {fault}", "drift", i)
            if any(len(each[0]) == 1 for each in form.parts):
                read.linear.update(names_in(term))
            read.rates[i] = read.rates[i].plus(form, sign)
        return read

    def _values(self, by: str = "") -> dict[str, Form]:
        """The numbers that parameters are, with their derivatives by one of them."""
        return {name: constant(value, float(name == by)) for name, value in self.named}

    def _names(self, by: str) -> dict[str, Form]:
        """What parameters are in rates, where ε stands for itself."""
        return self._values(by) | {name: product(power=1) for name in self.values if name == EPSILON}

    def _of_time(self, read: Read, by: str, name: str, time: str, written: str) -> Form | None:
        """What x(t - tau) is, and cos(nu*t + phi) by waves of the frequency nu; both are noted; else None."""
        if name not in WAVES and not self.drift:
            return None
        names = self._values(by) | {name: product(name) for name in (*self.variables, TIME)}
        names |= {name: product(noise=name) for name, _ in self.noises}
        parts = dict(evaluate(time, names, f"the time of {written}").parts)
        (first, slope), speed = parts.pop(NUMBER, (0.0, 0.0)), parts.pop(((TIME,), "", 0), (0.0, 0.0))
        if name in WAVES:
            if parts or not speed[0]:
                must = f"write {name}(nu*t), nu not 0, a number or an expression in the parameters"
                raise ExpressionError(f"got {written}; {must}")
            read.speeds[written] = speed
            turned, sign = first if name == "cos" else first - 0.5 * math.pi, math.copysign(1.0, speed[0])
            c, s = (round(each(turned), 16) for each in (math.cos, math.sin))
            waves = {"cos": (c, -s * slope), "sin": (-sign * s, -sign * c * slope)}
            return Form({((), f"{each} {abs(speed[0])!r}", 0): value for each, value in waves.items() if any(value)})
        fault = "" if name in self.variables else f"{name} is none of the variables {', '.join(self.variables)}"
        if parts or speed != (1.0, 0.0):
            fault = (
                "a delay may not depend on the state, the noise or the time: write x(t - tau), tau a number or an "
                "expression in the parameters"
            )
        elif not fault and not -first > 0:
            fault = f"the delay is {-first:g}; must be > 0; change it, or write {name}"
        if fault:
            raise ExpressionError(f"got {written}; {fault}")
        read.delays[written] = self.variables.index(name), (-first, -slope)
        return product(written)

    @cached_property
    def clock(self) -> Clock | None:
        frequencies = [abs(speed) for speed, _ in self._read.speeds.values()]
        try:
            return Clock(*common_unit(frequencies, "frequencies")) if frequencies else None
        except ValueError as failure:
            raise TableError(str(failure), self.source) from None

    @cached_property
    def pasts(self) -> tuple[tuple[int, float], ...]:
        found = tuple((variable, delay) for variable, (delay, _) in self._read.delays.values())
        return found * 2 if len(found) == len(self.variables) == 1 else found  # a matrix has more than two rows here

    def _fault(self, monomial: Monomial, is_linear: bool) -> str:
        """What is wrong with a product in a rate, and what to do; or nothing."""
        states, noise, _ = monomial
        degree = len(states)
        told = f"is of degree {degree} in {', '.join(self.variables)}"
        if not (degree or (noise and not self.walls)):
            return f"{told}; only noise may be alone, without walls: leave it out, or measure the variables from rest"
        if degree <= 1:
            return ""
        if is_linear or len(self.variables) != 2:
            return f"{told}; with a delay, noise alone, or any but two variables it must be of degree 1: leave it out"
        if degree < HIGHEST_DEGREE or noise:
            return f"{told}; must be of degree 1 or, without a noise, {HIGHEST_DEGREE}: leave it out"
        return ""

    def _terms_of(self, rates: Sequence[Form], at: int, last: Sequence[str] = ()) -> tuple[CoefficientMatrix, ...]:
        """The terms of rates, of their values for `at` = 0, of their derivatives for 1; those of degree 0 with a last
        variable if it has a name.
        """
        has_orders = EPSILON in self.values
        names = {name: section[6:] for name, section in self.noises} if len(self.noises) > 1 else {}
        columns, size = [*self.variables, *last, *self._read.delays], len(self.variables) + len(last) + len(self.pasts)
        matrices = defaultdict[tuple[int, str], FloatArray](lambda: np.zeros(2 * (size,)))
        for i, form in enumerate(rates):
            for (states, noise, power), series in form.parts.items():
                if len(states) == 1 or (last and not states):
                    order = power if has_orders else int(bool(noise))
                    matrices[order, noise][i, columns.index((*states, *last)[0])] += series[at]
        terms = [
            CoefficientMatrix(order, matrix, *self._coefficient(noise, names))
            for (order, noise), matrix in sorted(matrices.items(), key=itemgetter(0))
            if at == 0 or matrix.any()
        ]
        return as_plane(terms, has_turn=not at)

    def _coefficient(self, noise: str, names: Mapping[str, str]) -> tuple[Constant | Linear | Function, str]:
        """The coefficient of a noise, or of "cos 0.5", a wave of the clock, and the name of the noise in terms."""
        wave, _, speed = noise.partition(" ")
        if speed and self.clock:
            return Function(Wave(wave, round(float(speed) / self.clock.nu))), TIME
        return identity if noise else one, names.get(noise, "")

    def linear(self) -> LinearMotion:
        return self._linear

    @cached_property
    def _linear(self) -> LinearMotion:
        rates, names = self._read.rates, self.variables
        is_forced = any(not each[0] for form in rates for each in form.parts)
        whole = LinearMotion(self._terms_of(rates, 0, [""]), epsilon=self.epsilon, pasts=self.pasts, names=names)
        past = (f"{names[k]}(t − {delay:.10g})" for k, delay in self.pasts)
        names = (*names, f"{names[0]}*") if len(names) == 1 and not self.pasts else names  # as `as_plane` has it
        return LinearMotion(
            self._terms_of(rates, 0),
            self._jumps(),
            self.epsilon,
            self._stop(),
            pasts=self.pasts,
            clock=self.clock,
            cubic=self._cubic(),
            forced=whole if is_forced else None,
            names=names,
            columns=(*names, *[""] * is_forced, *past),
        )

    def _cubic(self) -> CubicTerms | None:
        """The terms of degree 3; None where there are none, or all are 0."""
        matrix = np.zeros((2, HIGHEST_DEGREE + 1))
        for i, form in enumerate(self._read.rates):
            for (states, _, power), series in form.parts.items():
                if len(states) == HIGHEST_DEGREE:
                    matrix[i, states.count(self.variables[1])] += self.epsilon**power * series[0]
        return CubicTerms(matrix) if matrix.any() else None

    def _jumps(self) -> tuple[Jump, ...]:
        """Where the phase passes the ray of the wall: x = 0 is φ = π/2, v = 0 is φ = 0."""
        if not self.walls or len(self.variables) > 2:
            return ()
        place, _, _ = self._place()
        return (Jump(math.pi / 2 if place == 0 else 0.0, self._log_factor()[0]),)

    def _stop(self) -> Stop | None:
        """The wall of more than two variables. Raises `TableError`."""
        if not self.walls or len(self.variables) == 2:
            return None
        coordinates, restitution = self._wall_coordinates(), math.exp(self._log_factor()[0])
        if restitution > 1:
            text = f"got {restitution:g}; must be <= 1 at a wall of more than two variables; reduce it"
            raise TableError(text, "walls", 0, "restitution")
        return Stop(coordinates, restitution)

    def _wall_coordinates(self) -> FloatArray:
        """q, q̇ and all others as rows: an impact changes the velocity alone."""
        i, j, speed = self._place()
        order = [i, j, *(k for k in range(len(self.variables)) if k not in (i, j))]
        rows = np.eye(len(order))[order]
        rows[1] *= speed
        return rows

    def _place(self) -> tuple[int, int, float]:
        """Which of the variables is 0 at the wall, which one is its rate, and over what. Raises `TableError`."""
        at, names = self.walls[0].at, self.variables
        match = re.fullmatch(r"\s*(\w+)\s*=\s*0(?:\.0*)?\s*", str(at))
        if match is None or match[1] not in names:
            must = f'must be "{names[0]} = 0" or "{names[1]} = 0"; jumps on other rays are for PlaneSystem in Python'
            must = must if len(names) == 2 else f'must be one variable, such as "{names[0]} = 0"; {_COMBINED}'
            raise TableError(f'got {shown(at)}; {must}; write, for example, at = "{names[0]} = 0"', "walls", 0, "at")
        i = names.index(variable := match[1])
        parts = self._read.rates[i].parts
        speed = sum(series[0] * self.epsilon**power for (_, _, power), series in parts.items())
        kinds = {(states, noise) for states, noise, _ in parts}
        other = next((name for name in names if name != variable and kinds == {((name,), "")}), "")
        is_alone, other = bool(other), other or (names[1 - i] if len(names) == 2 else "v, another variable,")
        if not (is_alone and speed > 0):
            must = f"there {variable}'s rate must be c*{other} with c > 0 and nothing else"
            told = f"but it is {' '.join(self.drift[i].split())}{f', c = {speed:g}' if is_alone else ''}"
            remedy = "choose variables for which it is, or remove the wall"
            raise TableError(f'got "{variable} = 0"; {must}, {told}; {remedy}', "walls", 0, "at")
        return i, names.index(other), speed

    def _log_factor(self, by: str = "") -> Series:
        """ln R of the wall and its derivative by a parameter. Raises `TableError`."""
        restitution = self.walls[0].restitution
        with placed("walls", 0, "restitution"):
            if isinstance(restitution, bool) or not isinstance(restitution, str | float | int):
                must = "must be a number > 0, or an expression in the parameters"
                raise ExpressionError(f"got {shown(restitution)}; {must}; write, for example, restitution = 0.8")
            logs = log_of(str(restitution), self._values(by), "the restitution")
        return logs  # noqa: RET504

    @cached_property
    def _derivatives(self) -> Mapping[str, ParameterDerivative]:
        """∂/∂θ by the parameters, without those for which it is infinite."""
        found = dict[str, ParameterDerivative]()
        for name, _ in self.named:
            with suppress(TableError):
                read = self._read_by(name)
                terms = self.by_epsilon() if name == EPSILON else self._terms_of(read.rates, 1)
                jumps = (self._log_factor(name)[1],) if self.walls else ()
                speed, slope = next(iter(read.speeds.values()), (1.0, 0.0))
                clock = NoiseDerivative(turning=slope / speed * self.clock.nu) if slope and self.clock else None
                found[name] = ParameterDerivative(terms=terms, jumps=jumps if any(jumps) else (), noise=clock)
        return found

    @cached_property
    def inert(self) -> Sequence[str]:
        """The parameters that are in no term of degree 1, but in others."""
        return tuple(name for name, _ in self.named if name in self._used - self._in_walls - self._read.linear)

    @property
    def differentiable(self) -> Sequence[str]:
        return tuple(name for name in self._derivatives if name not in self.inert and self._keeps_ratios(name))

    def _keeps_ratios(self, name: str) -> bool:
        """Whether ratios of delays and of frequencies, and the coordinates of a wall, remain as a parameter changes."""
        read = self._read_by(name)
        recurring = [delay for _, delay in read.delays.values()], [*read.speeds.values()]
        rates = [[slope / value for value, slope in each] for each in recurring if each]
        alike = all(np.ptp(each) <= ROUNDED * max(map(abs, each)) for each in rates)
        stop = self.linear().stop
        is_moved = stop and (self._moves_wall(name) or (stop.restitution == 1 and self._derivatives[name].jumps))
        return alike and not is_moved

    def _moves_wall(self, name: str) -> bool:
        """Whether the coordinates of a wall depend on a parameter."""
        return name in names_in(self.drift[self._place()[0]])

    def derivative(self, name: str) -> ParameterDerivative:
        """∂/∂θ, exact but for rounding. Raises `ValueError` where it is infinite."""
        if name not in self._derivatives:
            raise ValueError(f"the derivative of the system by {name} is not finite; choose another value of {name}")
        return self._derivatives[name]
