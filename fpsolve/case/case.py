"""A case file: TOML in, a validated `Case` of `ParameterSet`s out, or one message for each fault of the file."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import (
    AliasChoices,
    BeforeValidator,
    InstanceOf,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo

from fpsolve.arrays import FloatArray, require, shortened
from fpsolve.case.explain import explain, refuse
from fpsolve.case.keys import place_of
from fpsolve.case.kinds import half_of, kinds_of, system_of
from fpsolve.case.read_vary import EXAMPLE, vary_of
from fpsolve.case.refusals import REFUSALS
from fpsolve.case.sections import (
    EIGENFUNCTIONS,
    EVERYTHING,
    EXCURSIONS,
    MOST_NAMED,
    QUANTITY_NAMES,
    RESPONSE,
    SENSITIVITIES,
    UNCERTAIN,
    ChartSection,
    ExcursionSection,
    Expectation,
    FigureSection,
    MeshSection,
    MomentAt,
    Moments,
    MonteCarloSection,
    OutputSection,
    ResponseSection,
    Text,
    UncertainSection,
    UnitsSection,
    Varied,
    VarySection,
    as_kind,
)
from fpsolve.case.toml import Document, Place, read_document
from fpsolve.case.uncertain import Uncertain, uncertain_of
from fpsolve.case.vary import Vary, assignments
from fpsolve.errors import CaseError, Fault
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Budget, Method
from fpsolve.exponent.quantities import (
    CRITICAL_IMPACT_FACTOR,
    IMPACT_RATE,
    LYAPUNOV_EXPONENT,
    MOMENT,
    OF_IMPACTS,
    STABILITY_INDEX,
)
from fpsolve.fem.mesh import CylinderMesh, make_mesh, read_mesh
from fpsolve.messages import is_control
from fpsolve.model.faults import table_of, written_path
from fpsolve.model.noise import Noise
from fpsolve.model.parameters import Parameter, Section, parameter
from fpsolve.model.plane import System
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import DERIVATIVE, Quantity

COMPUTED = ("oscillator", "system", "noise", "vary", "mesh")
"""The sections that say of what the numbers are."""
CHEAP = (MOMENT.name, LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name)
"""What is computed where nothing is named, beside one eigenfunction."""
CHEAP_OF_WALLS = (IMPACT_RATE.name, CRITICAL_IMPACT_FACTOR.name)
"""What is computed in addition of a system with walls."""
MOST_DRAWN = 10
"""Of so many parameter sets at most the response is computed unasked, and densities of it are written."""
MOST_TOLD = 15
"""Largest number of parameters that a figure names."""
USUAL_P = 2.0


@dataclass(frozen=True)
class ParameterSet:
    """One parameter set of a case; its problem is made when it is asked for, which may raise `ValueError`.

    Attributes:
        base: the problem of the case, without what is varied.
        varied: the parameters that [vary] names, by their dotted keys, such as "noise.D0".
        number: its place among the parameter sets of its case, from 1 on.
    """

    base: Problem
    varied: Varied
    number: int = 1

    @cached_property
    def problem(self) -> Problem:
        """What the solver takes."""
        return self.base.at(self.varied) if self.varied else self.base

    @cached_property
    def is_possible(self) -> bool:
        """Whether its parameters do not contradict each other."""
        try:
            return self.problem is not None
        except ValueError:
            return False

    @property
    def noise(self) -> Noise:
        """The noise."""
        return self.problem.noise

    @cached_property
    def parameters(self) -> Varied:
        """The values of all parameters by their dotted keys."""
        return {**self.base.values, **self.varied}

    @property
    def digest(self) -> str:
        """What tells it from all parameter sets of all cases, in 64 letters; its problem is not made for that."""
        stated = [repr(self.base), sorted(self.parameters.items())]
        return sha256(json.dumps(stated).encode()).hexdigest()

    @property
    def label(self) -> str:
        """What varies, for the eye: "noise.D0 = 0.1, noise.r0 = 0.9"."""
        return assignments(self.varied, "g")

    @property
    def of(self) -> str:
        """Which of the parameter sets, after a title: ", noise.D0 = 0.1"."""
        return f", {self.label}" if self.varied else ""

    @property
    def suffix(self) -> str:
        """What the names of its files end in: nothing for the first parameter set, "-2" for the second."""
        return "" if self.number == 1 else f"-{self.number}"

    def fixed(self, time_unit: str, varied: Collection[str] = ()) -> list[str]:
        """The first parameters but the varied ones, without the nonlinear ones that are 0, in words, for a figure."""
        linear = self.problem.differentiable
        told = [
            each.quantity.timed(time_unit).stated(each.value)
            for key, each in self.problem.parameters.items()
            if key not in varied and (each.value or key in linear)
        ]
        return told[:MOST_TOLD] + ["…"] * (len(told) > MOST_TOLD)


class Case(Section):
    """The content of one case file; made by `load_case`.

    Raises:
        pydantic.ValidationError: with every fault of the sections and of what they say about each other.
    """

    title: Annotated[Text, parameter("the heading of its results", 'title = "Fig. 1"')]
    system: Annotated[
        InstanceOf[System],
        BeforeValidator(partial(half_of, "system")),
        parameter(
            "the system, such as the oscillator of Eq. (3)",
            "[oscillator], or [system] for your own equation",
            validation_alias=AliasChoices("oscillator", "system"),
        ),
    ]
    noise: Annotated[
        InstanceOf[Noise],
        BeforeValidator(partial(half_of, "noise")),
        parameter("the noise, such as that of Eqs. (7)-(8)", '[noise] with kind = "white" and s = 0.5'),
    ]
    moments: Annotated[Moments, parameter("the orders p of the moments", "[moments] with p = [2.0]")]
    budget: Annotated[
        Budget,
        as_kind(Budget),
        parameter("the limits of the cost of a parameter set", "[budget]"),
    ] = Budget()
    vary: Annotated[
        InstanceOf[Vary],
        BeforeValidator(vary_of, json_schema_input_type=VarySection),
        parameter("the parameter sets", EXAMPLE),
    ] = Vary()
    mesh: Annotated[MeshSection, parameter("a mesh, instead of one that is chosen", "[mesh]")] = MeshSection()
    monte_carlo: Annotated[MonteCarloSection, parameter("how the system is simulated", "[monte_carlo]")] = (
        MonteCarloSection()
    )
    units: Annotated[UnitsSection, parameter("what units are called", "[units]")] = UnitsSection()
    figure: Annotated[FigureSection, parameter("what is drawn", "[figure]")] = FigureSection()
    output: Annotated[OutputSection, parameter("what is written", "[output]")] = OutputSection()
    chart: Annotated[ChartSection | None, parameter("the lines of a chart, on which stability ends", "[chart]")] = None
    uncertain: Annotated[
        InstanceOf[Uncertain],
        BeforeValidator(uncertain_of, json_schema_input_type=UncertainSection),
        parameter("how uncertain parameters are", UNCERTAIN),
    ] = Uncertain()
    expect: Annotated[tuple[Expectation, ...], parameter("values to check", "[[expect]]", strict=False)] = ()
    excursions: Annotated[
        ExcursionSection,
        parameter("how far ‖x‖ may rise above its start, and what that start is", "[excursions]"),
    ] = ExcursionSection()
    response: Annotated[
        ResponseSection,
        parameter(
            "the stationary response to terms of degree 3, whose density is written, or of degree 0", "[response]"
        ),
    ] = ResponseSection()
    _path: Path = PrivateAttr(default=Path("case.toml"))
    _overrides: tuple[str, ...] = PrivateAttr(default=())
    _document: Document = PrivateAttr(default_factory=Document)

    @cached_property
    def problem(self) -> Problem:
        """The problem without [vary]."""
        return Problem(self.system, self.noise)

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Its parameters by their dotted keys, with symbol, words and unit."""
        return self.problem.parameters

    def about(self, key: str) -> Quantity:
        """The quantity of a parameter, in the time unit of [units]."""
        return self.parameters[key].quantity.timed(self.units.time)

    @property
    def path(self) -> Path:
        return self._path

    @property
    def text(self) -> str:
        """The file, as it was read."""
        return self._document.text

    @property
    def overrides(self) -> tuple[str, ...]:
        """The changes of the command line, as typed."""
        return self._overrides

    def refusal(self, sentence: str, *path: str | int) -> CaseError:
        """The error of a key, with its line."""
        return CaseError(str(self.path), [self._document.fault(path, written_path(path), sentence)])

    @property
    def name(self) -> str:
        """The file's name without its ending."""
        return self._path.stem

    @property
    def p(self) -> FloatArray:
        """The orders of the moments, shape (n,)."""
        return self.moments.values

    @property
    def rtol(self) -> float:
        """The relative error wanted of Λ(p), as the case states it, or else what is usual for its problem."""
        return self.moments.rtol if "rtol" in self.moments.model_fields_set else self.method.usual_rtol

    @cached_property
    def method(self) -> Method:
        """The method for Λ(p) of its first set."""
        return choose(self.problem)

    @cached_property
    def available(self) -> tuple[str, ...]:
        """The names of what there is of this case; the response if some of the first parameter sets have one."""
        if not self.method.has_pairs:
            return MOMENT.name, SENSITIVITIES
        is_there = dict.fromkeys(OF_IMPACTS, bool(self.problem.linear.jumps))
        is_there |= {EIGENFUNCTIONS: not self.method.no_picture, RESPONSE: self.responds}
        return tuple(name for name in QUANTITY_NAMES if is_there.get(name, True))

    @cached_property
    def asked(self) -> tuple[str, ...]:
        """The names of what is computed: those of [output], or else what is cheap and what other sections name."""
        if self.output.quantities == EVERYTHING:
            return self.available
        if self.output.names is not None:
            return self.output.names
        named = {*CHEAP, *CHEAP_OF_WALLS}.intersection(self.available)
        named |= {RESPONSE if each.of_response else each.quantity for each in self.expect}
        named |= self.model_fields_set & {EXCURSIONS, RESPONSE}
        usual = {
            RESPONSE: self.responds and self.planned <= MOST_DRAWN,
            SENSITIVITIES: self.output.sensitivities,
            EIGENFUNCTIONS: self.output.asks_for_eigenfunctions
            or (self.output.eigenfunctions is None and self.method.pictures.is_seen),
        }
        named -= {RESPONSE} if self.response.off else set()
        return tuple(name for name in QUANTITY_NAMES if name in named or usual.get(name))

    @property
    def unasked(self) -> tuple[str, ...]:
        """Further quantities of this case, if it names none."""
        known = {*self.asked, DERIVATIVE.name, RESPONSE}
        known -= set() if self.output.asks_for_eigenfunctions else {EIGENFUNCTIONS}
        return tuple(each for each in self.available if self.output.names is None and each not in known)

    @property
    def shown(self) -> FloatArray:
        """The p whose eigenfunctions are written: those of [output]; where that names none, at most nine, evenly
        spread, of more than two variables at most three; unasked that next to 2, of the first parameter set alone.
        """
        wanted = self.output.eigenfunctions
        if EIGENFUNCTIONS not in self.asked or self.method.no_picture:
            wanted = ()
        elif not self.output.asks_for_eigenfunctions:
            wanted = (USUAL_P,)
        if wanted is None:
            return _spread(self.p, self.method.pictures.most)
        return np.array([self.p[np.argmin(np.abs(self.p - p))] for p in wanted])

    @property
    def usual_p(self) -> float:
        """The p at which sets are compared by their eigenfunctions: of those that are shown, or of all, next to 2."""
        return float(min(self.shown if self.shown.size else self.p, key=lambda p: abs(p - USUAL_P), default=USUAL_P))

    @property
    def leaves_out_response(self) -> bool:
        """Whether no response is computed, as there are too many parameter sets and nobody names it."""
        return self.output.names is None and self.responds and RESPONSE not in self.asked

    @cached_property
    def responds(self) -> bool:
        """Whether some of the first parameter sets have a response, and it is not left out."""
        nonlinear = (each.is_possible and each.problem.linear.responds for each in self.sets(0, MOST_DRAWN))
        return not self.response.off and any(nonlinear)

    @property
    def differentiated(self) -> FloatArray:
        """The p at which Λ is differentiated by the parameters: at most nine, evenly spread, or all for intervals."""
        return self.p if self.uncertain else _spread(self.p)

    @property
    def simulated(self) -> FloatArray:
        """The p that are simulated: those of [monte_carlo], or else all, or of populations at most nine."""
        if self.monte_carlo.p is not None:
            return np.array(self.monte_carlo.p)
        return _spread(self.p) if self.monte_carlo.estimator == "population" else self.p

    @property
    def planned(self) -> int:
        """How many parameter sets there are, without making them."""
        return len(self.vary)

    @property
    def fixed(self) -> Varied:
        """The values of the parameters that are not varied, by their keys."""
        [first] = self.sets(0, 1)
        return {key: value for key, value in first.parameters.items() if key not in self.vary.keys}

    def sets(self, start: int = 0, stop: int | None = None) -> Iterator[ParameterSet]:
        """Its parameter sets, from one place to another; each is made when it is asked for."""
        sets = enumerate(self.vary.sets[start:stop], start + 1)
        return (ParameterSet(self.problem, varied, number) for number, varied in sets)

    def parameter_set(self, varied: Varied) -> ParameterSet:
        """The case's parameter set with some parameters replaced, by their dotted keys."""
        return ParameterSet(self.problem, varied)

    @property
    def headline(self) -> str:
        """The title, and in a second line what the command line has changed of what is computed."""
        return self._with_changes(self.title)

    @property
    def caption(self) -> str:
        """The headline of its figure, which may have a title of its own."""
        return self._with_changes(self.figure.title or self.title)

    @cached_property
    def theory_reduces_noise(self) -> bool:
        """Whether perturbation theory takes the reduction in place of the noise of some parameter set."""
        texts = [key for key in self.vary.keys if self.vary.is_text(key)]
        words = {tuple(map(each.__getitem__, texts)) for each in self.vary.sets}
        kinds = (self.parameter_set(dict(zip(texts, each, strict=True))) for each in words)
        return any(each.is_possible and each.noise.approximates_spectrum for each in kinds)

    def heading(self, parameter_set: ParameterSet) -> str:
        """The headline, with which of the parameter sets."""
        return self._with_changes(f"{self.title}: {parameter_set.label}" if parameter_set.varied else self.title)

    def _with_changes(self, title: str) -> str:
        split = [map(str.strip, text.split("=", 1)) for text in self._overrides]
        told = [
            shortened(f"{key} = {value}".expandtabs(1)) for key, value in split if key.partition(".")[0] in COMPUTED
        ]
        return f"{title}\nwith {', '.join(told)}" if told else title

    def cylinder_mesh(self) -> CylinderMesh | None:
        """The mesh that the case states, its file sought beside the case; None leaves it to the solver."""
        stated = self.mesh.model_dump(exclude_none=True)
        if self.mesh.file is not None:
            return read_mesh(self.path.parent / self.mesh.file)
        return make_mesh(**stated) if stated else None

    @model_validator(mode="before")
    @classmethod
    def _is_complete(cls, data: dict[str, object]) -> dict[str, object]:
        """With one system; without orders of moments where other quantities are named."""
        if {"oscillator", "system"} <= set(data):
            text = "stands beside [system], but a case has one system; remove one of the two"
            refuse([(("oscillator",), text)])
        named = table_of(data.get("output")).get("quantities")
        is_of_p = not isinstance(named, list | tuple) or MOMENT.name in named
        return data if is_of_p else {"moments": Moments.model_construct(p=()), **data}

    @model_validator(mode="after")
    def _draws_a_map_of_many(self) -> Self:
        """Over two keys with more curves than a legend names, λ is drawn in place of all Λ(p), or that of one p."""
        is_stated = bool(self.figure.model_fields_set & {"x", "y", "map", "mark"})
        if is_stated or self.planned <= MOST_NAMED or self.vary.mode == "zip":
            return self
        keys = sorted(self.vary.keys, key=lambda key: -len(self.vary.values(key)))
        if self.vary.crossing(keys[0]) and self.p.size:
            has_exponent = LYAPUNOV_EXPONENT.name in self.asked
            y = LYAPUNOV_EXPONENT.name if has_exponent else MomentAt(moment=float(self.p[np.argmin(abs(self.p - 2))]))
            over = {"x": keys[0], "y": y, "map": len(self.vary.values(keys[1])) > 2}
            self.__dict__["figure"] = self.figure.model_copy(update=over)
        return self

    @field_validator(*REFUSALS)
    @classmethod
    def _agrees_with_those_before(cls, section: object, info: ValidationInfo) -> object:
        refuse(REFUSALS[str(info.field_name)](section, info.data, info.context or {}))
        return section


def load_case(path: str | Path, overrides: Sequence[str] = (), options: Mapping[str, str] | None = None) -> Case:
    """Read and check a case file.

    >>> load_case("minimal.toml", ["noise.D0=2.0"]).problem.values["noise.D0"]
    2.0

    Args:
        path: a TOML file.
        overrides: texts such as "oscillator.omega=2.0", each a key with its sections and a TOML value.
        options: more of these, by how messages shall call them.

    Raises:
        CaseError: with every fault of the file and of the overrides, each with its line and its remedy.
    """
    require(path, str | Path, "path", "the path of a case file")
    require(overrides, list | tuple, "overrides", 'a list of texts, such as ["noise.D0=2.0"]')
    document = read_document(path, overrides, options)
    faults, data, name = document.faults, document.data, Path(path).stem
    if any(map(is_control, name)) or not name.strip("."):  # which names the folder of its results
        text = "its name must have no control characters, and be more than dots; rename the file"
        faults.append(Fault("", None, text))
    context = {"folder": Path(path).parent, "varies": bool(data.get("vary"))}
    try:
        case = Case.model_validate(data, context=context)
        for key in case.vary.keys:  # which replaces what the command line says of it
            if document.places.get(place_of(data, key), Place()).typed:
                remedy = f"write --set 'vary.\"{key}\"=[…]', or --set 'vary={{}}' as well"
                faults.append(document.fault((key,), key, f"has no effect, as the case varies {key}; {remedy}"))
    except ValidationError as error:
        kinds, fields = kinds_of(data), dict[str, FieldInfo]()
        for key, field in Case.model_fields.items():  # of [system] and [noise] with the keys of their kinds
            section = system_of(data) if key == "system" else key
            fields[section] = copy(field)
            fields[section].annotation = kinds.get(section, field.annotation)
        faults += (document.fault(*fault) for fault in explain(error.errors(), fields))
    except RecursionError:
        faults.append(Fault("", None, "tables are nested too deeply; name each key with its section only"))
    if faults:
        raise CaseError(str(path), sorted(faults, key=lambda fault: fault.line or 0))
    case._path, case._overrides, case._document = Path(path), tuple(overrides), document
    return case


def _spread(p: FloatArray, most: int = 9) -> FloatArray:
    return np.sort(p)[np.unique(np.linspace(0, p.size - 1, min(p.size, most)).round().astype(int))]
