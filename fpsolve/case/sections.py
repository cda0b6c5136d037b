"""The sections of a case file, each with the rules that it can check by itself.

What keys of the system, the noise and the budget mean stands where these do; the others stand here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Tag,
    WrapValidator,
    model_validator,
)

from fpsolve.analysis.axis import Axis, Scale, check_range
from fpsolve.analysis.excursions import STATIONARY
from fpsolve.analysis.target import Target, target_of
from fpsolve.arrays import FloatArray
from fpsolve.case.explain import (
    BY_KIND,
    LIST,
    NUMBER,
    TABLE,
    WORD,
    Refusal,
    refuse,
)
from fpsolve.case.keys import leaves
from fpsolve.drawing import is_math
from fpsolve.exponent.method import RTOL, RTOL_BEYOND_PLANE, RTOL_OF_SEVERAL, RTOLS
from fpsolve.exponent.quantities import MOMENT, QUANTITIES, SUMMARY_NUMBERS, DrawnName, QuantityName
from fpsolve.fem.mesh import MAX_CELLS, MAX_DEGREE
from fpsolve.messages import is_control
from fpsolve.model.faults import shown
from fpsolve.model.parameters import STRICT, Section, parameter
from fpsolve.model.quantity import DERIVATIVE, RATE_FUNCTION, Quantity, moment_at
from fpsolve.simulation.setup import BATCHES, MAX_PATHS, PATHS, Estimator

MAX_MOMENTS = 100_000
MAX_NODES = 1000
DIGITS = 12
SAME = 10.0**-DIGITS
"""p that differ by no more are one p."""
EXCURSIONS = "excursions"
RESPONSE = "response"
SENSITIVITIES = "sensitivities"
EIGENFUNCTIONS = "eigenfunctions"
OF_MOMENTS = DERIVATIVE.name, RATE_FUNCTION.name
"""What follows from Λ(p)."""
PARTS: tuple[str, ...] = EXCURSIONS, RESPONSE, SENSITIVITIES, EIGENFUNCTIONS
"""What else may be asked for: the names of files of `fpsolve/solve`, each with a question, in the order of work."""
QUANTITY_NAMES = (MOMENT.name, *OF_MOMENTS, *SUMMARY_NUMBERS, *PARTS)
"""What may be asked for."""
EVERYTHING = "all"
"""What stands for all of these."""
WANTED = (
    f"wanted relative error; if omitted {RTOL_OF_SEVERAL:g} under two noises that are not white, "
    f"{RTOL_BEYOND_PLANE:g} for more than two variables"
)
_APART = 1e-9
"""How far the ends of an axis are from each other at least, relative to their size."""
_MOST_ALONG = 1000
"""Largest number of places along an axis of the density of the response."""
_MOST_PLACES = 4_000_000
"""Largest number of places at which it is written."""
UNCERTAIN = '[uncertain] with "noise.D0" = 0.05 or "oscillator.restitution" = { sd = 0.02 }'
MOST_NAMED = 8
"""Curves that a legend can tell apart; of more, and of a map, colours tell the value of a key."""
_LINES = 'lines = ["lyapunov_exponent = 0", "moment(2) = 0"]'

Values = tuple[float, ...]
Value = float | str
Varied = Mapping[str, Value]
"""The values of the varied keys of one parameter set."""
NonEmpty = Annotated[Values, Field(strict=False, min_length=1, max_length=MAX_MOMENTS)]
Cells = Annotated[int | None, Field(ge=1, le=MAX_CELLS)]
Degree = Annotated[int | None, Field(ge=1, le=MAX_DEGREE)]
ExpectedName = Annotated[
    QuantityName,
    WrapValidator(
        lambda value, known: value if str(value).startswith(f"{RESPONSE}.") else known(value),
        json_schema_input_type=QuantityName | Annotated[str, Field(pattern=rf"^{RESPONSE}\.")],
    ),
]
"""What an expectation may be of; the numbers of the response, which its system decides, have its name before them."""
MarkedName = Literal["stability_index", "lyapunov_exponent"]


MOST_TEXT = 500
"""Letters of a text that stands above tables and figures."""


def _printed(text: str) -> str:
    controls = [each for each in dict.fromkeys(text) if is_control(each) and each != "\n"]
    if controls:
        accepted = "must have no control characters but line ends"
        raise ValueError(f"got {shown(text)}; {accepted}; leave out {', '.join(map(shown, controls))}")
    return text


Text = Annotated[str, Field(min_length=1, max_length=MOST_TEXT), AfterValidator(_printed)]


def as_kind(kind: type) -> BeforeValidator:
    """Makes a dataclass of a table."""
    return BeforeValidator(lambda value: kind(**value) if isinstance(value, dict) else value)


def digits(value: Value) -> str:
    """A value of a varied key as a text, by which it is told from others."""
    return value if isinstance(value, str) else f"{value + 0.0:.{DIGITS}g}"


def same(value: Value, other: Value) -> bool:
    """Whether two values of a varied key are one."""
    return digits(value) == digits(other)


def flat(table: Mapping[str, Any], whole: Iterable[str] = ()) -> dict[str, Any]:
    """Nested tables as one: noise.D0 = 1.0 means the same as "noise.D0" = 1.0.

    Args:
        table: with the values of keys, or tables of them; a range is a value.
        whole: the keys whose tables are values, not sections.
    """
    result: dict[str, Any] = {}
    for key, value in leaves(table, {*whole, *RANGE}):
        if key in result:
            raise ValueError(f"{key} stands twice, once with quotes and once without; remove one of them")
        result[key] = value
    return result


def _distinct(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """A list without entries that stand twice."""
    first = dict[Any, int]()
    twice = [(i, each) for i, each in enumerate(values) if first.setdefault(each, i) != i]
    refuse(((i,), f"got {shown(each)} twice; values must be distinct; remove one") for i, each in twice)
    return values


class Sweep(Section):
    """{ start, stop, num, scale }: numbers a constant step or a constant factor apart, both ends included."""

    start: Annotated[float, parameter("the first value", "start = 1.0")]
    stop: Annotated[float, parameter("the last value", "stop = 6.0")]
    num: Annotated[int, parameter("how many values", "num = 33", ge=2, le=MAX_MOMENTS)]
    scale: Annotated[Scale, parameter("whether they differ by a constant step or factor", 'scale = "log"')] = "linear"

    @model_validator(mode="after")
    def _increases(self) -> Self:
        check_range(self.start, self.stop, self.scale, ", or list a single value as in [2.0]")
        return self

    @property
    def values(self) -> FloatArray:
        """The numbers, those between the ends without the rounding errors of the division, and 0 without a sign."""
        if self.scale == "log":
            inner = [float(f"{value:.{DIGITS}g}") for value in np.geomspace(self.start, self.stop, self.num)[1:-1]]
        else:
            size = max(abs(self.start), abs(self.stop))
            decimals = max(DIGITS, DIGITS - 1 - math.floor(math.log10(size)))
            inner = [round(value, decimals) for value in np.linspace(self.start, self.stop, self.num)[1:-1].tolist()]
        return np.array([self.start, *inner, self.stop]) + 0.0


RANGE = frozenset(Sweep.__pydantic_fields__)
"""The keys that tell a range from a section."""
Names: Any = Annotated[
    tuple[Literal[*QUANTITY_NAMES], ...],  # type: ignore[valid-type]
    Field(strict=False, min_length=1),
    AfterValidator(_distinct),
]


class Moments(Section):
    """[moments]: the orders p, and the relative error wanted of Λ(p)."""

    p: Annotated[
        Annotated[NonEmpty, Tag(LIST)] | Annotated[Sweep, Tag(TABLE)],
        BY_KIND,
        parameter(
            "orders of the moments",
            "p = [1.0, 2.0] or p = { start = -2.0, stop = 6.0, num = 33 }",
            "$p$",
            name="order of the moment",
        ),
    ]
    rtol: Annotated[float, parameter(WANTED, "rtol = 1e-8", **RTOLS, name="wanted relative error")] = RTOL

    @property
    def values(self) -> FloatArray:
        """All p, in the file's order."""
        return self.p.values if isinstance(self.p, Sweep) else np.array(self.p)

    def has(self, p: float) -> bool:
        """Whether p is one of them."""
        return bool(np.any(np.abs(self.values - p) <= SAME))

    @model_validator(mode="after")
    def _distinct(self) -> Self:
        values = np.sort(self.values)
        with np.errstate(over="ignore"):
            close = values[1:][np.diff(values) <= SAME]
        if close.size:
            text = f"{close[0]} stands twice; p must differ by more than {SAME:g}; remove one of them"
            refuse([(("p",), text)])
        return self


_Column = NonEmpty | Annotated[list[str], Field(min_length=1)] | Sweep
"""The values of a key of [vary]."""
OPEN = STRICT | ConfigDict(extra="allow")


class VarySection(BaseModel):
    """The parameter sets: the values of keys, with quotes and dots or in tables; or a file of sets."""

    model_config = OPEN
    __pydantic_extra__: dict[str, _Column | dict[str, _Column | dict[str, Any]]]

    mode: Annotated[
        Literal["product", "zip"],
        parameter(
            "product: all combinations, the last key fastest; zip: the n-th values of all keys together", 'mode = "zip"'
        ),
    ] = "product"
    file: Annotated[
        Text, parameter("a file of sets: a header that names the keys, and a row for each set", 'file = "sets.csv"')
    ] = ""


class StandardDeviation(Section):
    """{ sd }: a standard deviation in the unit of the parameter."""

    sd: Annotated[float, parameter("standard deviation", "sd = 0.02", gt=0)]


Deviation = Annotated[
    Annotated[float, Field(gt=0), Tag(NUMBER)] | Annotated[StandardDeviation, Tag(TABLE)],
    BY_KIND,
    parameter("a share of the value > 0, or a standard deviation > 0", UNCERTAIN),
]
"""How uncertain a parameter is."""


class UncertainSection(BaseModel):
    """How uncertain parameters are: by their keys, with quotes and dots or in tables."""

    model_config = OPEN
    __pydantic_extra__: dict[str, Deviation | dict[str, Deviation | dict[str, Any]]]


class MeshSection(Section):
    """[mesh]: a mesh file, or some of the numbers that make one; ξ in noise units."""

    file: Annotated[
        str | None,
        parameter("a mesh file, as a path from the folder of the case", 'file = "../meshes/default.vtu"', min_length=1),
    ] = None
    phi_cells: Annotated[Cells, parameter("cells around the phase", "phi_cells = 2")] = None
    phi_degree: Annotated[Degree, parameter("degree of the elements in the phase", "phi_degree = 10")] = None
    xi_cells: Annotated[Cells, parameter("cells along the noise", "xi_cells = 4")] = None
    xi_degree: Annotated[Degree, parameter("degree of the elements along the noise", "xi_degree = 9")] = None
    xi_min: Annotated[
        float | None, parameter("lower end of the noise, in standard deviations", "xi_min = -8.0", lt=0)
    ] = None
    xi_max: Annotated[
        float | None, parameter("upper end of the noise, in standard deviations", "xi_max = 8.0", gt=0)
    ] = None

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        numbers = ", ".join(self.model_dump(exclude_none=True, exclude={"file"}))
        if self.file is not None and numbers:
            text = f"a mesh must be either a file or made from numbers; remove file, or remove {numbers}"
            refuse([(("file",), text)])
        return self


class MonteCarloSection(Section):
    """[monte_carlo]: how the system is simulated; time and step are chosen where they are not stated."""

    paths: Annotated[int, parameter("how many paths", "paths = 32768", ge=BATCHES, le=MAX_PATHS)] = PATHS
    time: Annotated[float | None, parameter("length of the paths, in the units of 1/omega", "time = 400.0", gt=0)] = (
        None
    )
    step: Annotated[float | None, parameter("time step", "step = 0.05", gt=0)] = None
    seed: Annotated[int, parameter("seed of the random numbers", "seed = 0", ge=0)] = 0
    estimator: Annotated[Estimator | None, parameter("how moments are estimated", 'estimator = "population"')] = None
    p: Annotated[NonEmpty | None, parameter("orders of the moments that are simulated", "p = [1.0, 2.0]")] = None


class MomentAt(Section):
    """{ moment = p }: Λ at one p."""

    moment: Annotated[float, parameter("order of the moment", "moment = 2.0")]


def _increasing(ends: tuple[float, float]) -> tuple[float, float]:
    size = max(map(abs, ends))
    if size > 1e30 or not ends[1] - ends[0] > _APART * size:
        raise ValueError(
            f"got {shown(ends)}; must be a list of two numbers, the smaller one first, from -1e30 to 1e30, which "
            "differ in their first 9 digits; write, for example, [0.0, 4.0]"
        )
    return ends


Limits = Annotated[tuple[float, float], Field(strict=False), AfterValidator(_increasing)]


def _drawn(text: str) -> str:
    """Text that matplotlib can draw."""
    if "$" in text and not is_math(text):
        rule = 'must have between dollars what matplotlib can draw; write, for example, "order $p$"'
        raise ValueError(f"got {shown(text)}; {rule}")
    return text


DrawnText = Annotated[Text, AfterValidator(_drawn)]


class FigureSection(Section):
    """[figure]: the axes, what is marked, and how it is set; x is "p" or a varied key."""

    x: Annotated[Text, parameter("the abscissa", 'x = "p"')] = "p"
    y: Annotated[
        Annotated[DrawnName, Tag(WORD)] | Annotated[MomentAt, Tag(TABLE)],
        BY_KIND,
        parameter("the ordinate", "y = { moment = 2.0 }"),
    ] = "moment"
    map: Annotated[bool | None, parameter("whether the figure is a map in colours over two keys", "map = true")] = None
    title: Annotated[Text | None, parameter("the title instead of that of the case", 'title = "Stability"')] = None
    width: Annotated[
        Literal["single column", "double column"], parameter("printed width", 'width = "single column"')
    ] = "double column"
    xlim: Annotated[Limits | None, parameter("ends of the abscissa", "xlim = [0.0, 4.0]")] = None
    ylim: Annotated[Limits | None, parameter("ends of the ordinate", "ylim = [-0.1, 0.1]")] = None
    xlabel: Annotated[DrawnText | None, parameter("label of the abscissa", 'xlabel = "order $p$"')] = None
    ylabel: Annotated[DrawnText | None, parameter("label of the ordinate", 'ylabel = "$g(p)$ (1/s)"')] = None
    lines: Annotated[bool, parameter("whether curves of perturbation theory are drawn", "lines = false")] = True
    mark: Annotated[
        tuple[MarkedName, ...],
        parameter("what is marked", 'mark = ["stability_index"]', strict=False),
        AfterValidator(_distinct),
    ] = ("stability_index",)

    @property
    def moment(self) -> float | None:
        """The p whose Λ(p) is drawn over a parameter; None where another quantity is drawn."""
        return self.y.moment if isinstance(self.y, MomentAt) else None

    @property
    def needed(self) -> str:
        """The name of the quantity that must be computed for it."""
        return str(self.y) if self.moment is None else MOMENT.name

    @property
    def quantity(self) -> Quantity:
        """What is drawn."""
        return QUANTITIES[self.needed] if self.moment is None else moment_at(self.moment)

    @model_validator(mode="after")
    def _fits_x(self) -> Self:
        written = self.y if self.moment is None else {"moment": self.moment}
        names = '{ moment = 2.0 }, "lyapunov_exponent" or "stability_index"'
        if self.x == "p" and self.y != "moment":
            remedy = 'must be "moment" where x = "p"; write y = "moment", or set x to a key of [vary]'
            refuse([(("y",), f"got {shown(written)}; {remedy}")])
        if self.x != "p" and self.y == "moment":
            text = f'got {shown(written)}; must be {names} where x is not "p"; write one of these'
            refuse([(("y",), text)])
        if self.x != "p" and self.mark and "mark" in self.model_fields_set:
            text = f'got {shown(self.mark)}; only Λ(p) over p has marks; write x = "p", or remove it'
            refuse([(("mark",), text)])
        return self


class UnitsSection(Section):
    """[units]: what the unit of time of all numbers is called, which labels outputs and changes no number."""

    time: Annotated[
        str,
        parameter("what the unit of time is called: 1 to 12 letters", 'time = "s"', pattern=r"^[^\W\d_]{1,12}$"),
    ] = "time"


class OutputSection(Section):
    """[output]: what is computed, the p whose eigenfunctions are written, and what is drawn."""

    quantities: Annotated[
        Annotated[Annotated[Names, Tag(LIST)] | Annotated[Literal["all"], Tag(WORD)], BY_KIND] | None,
        parameter("what is computed", 'quantities = ["lyapunov_exponent", "stability_index"]'),
    ] = None
    eigenfunctions: Annotated[
        Annotated[Values, Field(strict=False, max_length=MAX_MOMENTS), AfterValidator(_distinct)] | None,
        parameter("the p whose eigenfunctions are written for ParaView", "eigenfunctions = [1.0, 2.0]"),
    ] = None
    figure: Annotated[bool, parameter("whether the figure is drawn", "figure = false")] = True
    sensitivities: Annotated[bool, parameter("whether sensitivities are drawn", "sensitivities = true")] = False

    @property
    def names(self) -> tuple[str, ...] | None:
        """What is computed, if the file says so."""
        return QUANTITY_NAMES if self.quantities == EVERYTHING else self.quantities  # type: ignore[return-value]

    @property
    def lists_quantities(self) -> bool:
        """Whether the file names each quantity that it wants, so that it is told which of them there are not."""
        return self.quantities not in (None, EVERYTHING)

    def lacks(self, name: str) -> bool:
        """Whether the file says what is computed, and not this."""
        return self.names is not None and name not in self.names

    @property
    def asks_for_eigenfunctions(self) -> bool:
        """Whether the file itself says that they are written, and not the defaults alone."""
        return EIGENFUNCTIONS in (self.names or ()) or (self.names is None and bool(self.eigenfunctions))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        wrong = list[Refusal]()
        for name, value, instead in (
            ("sensitivities", self.sensitivities, "false"),
            ("eigenfunctions", self.eigenfunctions, "eigenfunctions = []"),
        ):
            if value and self.lacks(name):
                text = f'got {shown(value)}, but output.quantities has no "{name}"; add it there, or write {instead}'
                wrong.append(((name,), text))
        for at, name in enumerate(self.names or ()):
            if name in OF_MOMENTS and self.lacks(MOMENT.name):
                text = f"got {shown(name)}, which follows from Λ(p); add {shown(MOMENT.name)}, or remove it"
                wrong.append((("quantities", at), text))
        refuse(wrong)
        return self


class ChartSection(Section):
    """[chart]: a frame of two parameters, and the lines in it."""

    x: Annotated[
        Axis, as_kind(Axis), parameter("the abscissa", 'x = { key = "oscillator.omega", start = 0.3, stop = 5.0 }')
    ]
    y: Annotated[Axis, as_kind(Axis), parameter("the ordinate", 'y = { key = "noise.D0", start = 0.01, stop = 2.0 }')]
    lines: Annotated[
        tuple[Annotated[Target, BeforeValidator(target_of, json_schema_input_type=str)], ...],
        parameter("what holds on each line", _LINES, strict=False, min_length=1),
        AfterValidator(_distinct),
    ]
    nodes: Annotated[
        int | None,
        parameter(
            "points of the grid that is searched for lines, each way; if omitted 13, or 7 where a point takes seconds: "
            "λ and odd p of more than two variables, or two noises that are not white",
            "nodes = 25",
            ge=2,
            le=MAX_NODES,
        ),
    ] = None
    step: Annotated[
        float | None,
        parameter(
            "longest step along a line, in sides of the frame; if omitted 0.02, or 0.05 where a point takes seconds",
            "step = 0.1",
            ge=0.001,
            le=0.1,
        ),
    ] = None


class ExcursionSection(Section):
    """[excursions]: how far ‖x‖ may rise above its start, and what that start is."""

    levels: Annotated[
        tuple[Annotated[float, Field(gt=1)], ...],
        parameter(
            "A of P(sup ‖x‖ ≥ A), where the start has the length 1",
            "levels = [2.0, 10.0, 100.0]",
            strict=False,
            min_length=1,
            max_length=100,
        ),
    ] = (2.0, 10.0, 100.0)
    phi: Annotated[
        Annotated[float, Tag(NUMBER)] | Annotated[Literal["uniform"], Tag(WORD)],
        BY_KIND,
        parameter("phase of the start x = (cos φ, −sin φ), in radians", "phi = 0.0"),
    ] = 0.0
    xi: Annotated[
        Annotated[float, Tag(NUMBER)] | Annotated[Literal["stationary"], Tag(WORD)],
        BY_KIND,
        parameter("the noise at the start", 'xi = "stationary"'),
    ] = STATIONARY


class ResponseGrid(Section):
    """{ amplitude, phi, xi }: at how many places along each axis a density is written."""

    amplitude: Annotated[int, parameter("amplitudes", "amplitude = 80", ge=2, le=_MOST_ALONG)] = 80
    phi: Annotated[int, parameter("phases from impact to impact", "phi = 49", ge=3, le=_MOST_ALONG)] = 49
    xi: Annotated[int, parameter("values of the noise", "xi = 25", ge=2, le=_MOST_ALONG)] = 25

    @model_validator(mode="after")
    def _of_moderate_size(self) -> Self:
        if (size := self.amplitude * self.phi * self.xi) > _MOST_PLACES:
            text = f"makes {size} places; must be at most {_MOST_PLACES}; use fewer along some axis"
            raise ValueError(text)
        return self


class ResponseSection(Section):
    """[response]: the stationary response to terms of degree 3, whose density is written, or of degree 0."""

    rtol: Annotated[float, parameter("wanted relative error of its means", "rtol = 1e-6", ge=1e-10, le=0.1)] = 1e-6
    off: Annotated[bool, parameter("true computes no response", "off = true")] = False
    grid: Annotated[
        ResponseGrid, parameter("places of the written density", "grid = { amplitude = 80, phi = 49, xi = 25 }")
    ] = ResponseGrid()


class Expectation(Section):
    """[[expect]]: a value that the result must have, on the parameter sets that `where` selects."""

    quantity: Annotated[
        ExpectedName, parameter("what is checked; also response.energy and the like", 'quantity = "moment"')
    ]
    p: Annotated[float | None, parameter("order of the moment", "p = 2.0")] = None
    value: Annotated[float, parameter("the expected value", "value = 0.01416")]
    rtol: Annotated[float | None, parameter("relative tolerance", "rtol = 1e-3", gt=0)] = None
    atol: Annotated[float | None, parameter("absolute tolerance", "atol = 1e-6", gt=0)] = None
    source: Annotated[Text, parameter("where the value comes from", 'source = "Eq. (37), second order"')]
    where: Annotated[
        dict[str, Annotated[Annotated[float, Tag(NUMBER)] | Annotated[str, Tag(WORD)], BY_KIND]],
        BeforeValidator(
            lambda table: flat(table) if isinstance(table, dict) else table,
            json_schema_input_type=dict[str, Value | dict[str, Value]],
        ),
        parameter("which parameter sets, by values of varied keys", 'where = { "noise.D0" = 1.0 }'),
    ] = Field(default_factory=dict)

    @property
    def of_response(self) -> str:
        """Which number of the response is checked; empty where it is none of these."""
        section, _, name = self.quantity.partition(".")
        return name if section == RESPONSE else ""

    def selects(self, varied: Varied) -> bool:
        """Whether this is about the parameter set with these varied values; without `where`, about all sets."""
        return all(same(varied[key], value) for key, value in self.where.items())

    @model_validator(mode="after")
    def _complete(self) -> Self:
        refusals: list[Refusal] = []
        if self.quantity == "moment" and self.p is None:
            refusals.append((("p",), "missing; a moment needs its order; add, for example, p = 2.0"))
        if self.quantity != "moment" and self.p is not None:
            text = f"got {self.p}; {self.quantity} does not depend on p; remove p, or check the moment"
            refusals.append((("p",), text))
        if self.rtol is None and self.atol is None:
            refusals.append((("rtol",), "missing, and so is atol; add, for example, rtol = 1e-3"))
        refuse(refusals)
        return self
