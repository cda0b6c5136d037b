"""What a user says of a measurement on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter, Token


def _whole(_: type, tokens: Sequence[Token]) -> int:
    """A whole number; cyclopts alone would take 2.5 for 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'got "{tokens[0].value}"; must be a whole number') from None


Count = Annotated[int, Parameter(converter=_whole)]
ModesFile = Annotated[
    Path | None, Parameter(help="A table of natural frequencies and damping ratios, Fn and Xi, as pyOMA writes it.")
]
ModeRows = Annotated[list[Count] | None, Parameter(help="A row of this table; of two modes twice.", negative="")]


@Parameter(name="*")
@dataclass(frozen=True)
class Statement:
    """The options of `fpsolve noise`."""

    record: Annotated[
        Path | None,
        Parameter(
            help="A record of values over time instead, also .wav; beside a spectrum its variance is compared with it."
        ),
    ] = None
    per: Annotated[
        Literal["Hz", "rad/s"] | None,
        Parameter(help="The unit of the frequencies; if omitted that of the file, which must state it."),
    ] = None
    sided: Annotated[
        Literal["one", "two"] | None,
        Parameter(help="Whether the integral over f > 0 is the variance, one, or half of it, two."),
    ] = None
    frequency: Annotated[
        list[float] | None,
        Parameter(
            help="Natural frequency in the unit of --per, Hz if that is omitted; of two modes twice.", negative=""
        ),
    ] = None
    damping_ratio: Annotated[
        float | None,
        Parameter(help="Damping as a share of critical damping: states an oscillator, whose verdict is told."),
    ] = None
    restitution: Annotated[
        float | None, Parameter(help="Speed after a bounce off its wall over that before; no wall if omitted.")
    ] = None
    case: Annotated[Path | None, Parameter(help="A case instead, whose noise is replaced.")] = None
    modes: ModesFile = None
    mode: ModeRows = None
    noise_in: Annotated[
        Literal["stiffness", "damping"] | None,
        Parameter(help="Where the noise is; stiffness if neither this nor --of is stated."),
    ] = None
    of: Annotated[
        Literal["stiffness", "damping", "acceleration", "height"] | None,
        Parameter(
            help="What was measured: the relative stiffness, the damping in 1/s, the vertical acceleration of the "
            "support of a pendulum in m/s^2, or the metacentric height of a ship in m; that of --noise-in if omitted."
        ),
    ] = None
    length: Annotated[
        float | None, Parameter(help="Length of the pendulum in m, from which its natural frequency follows.")
    ] = None
    gm: Annotated[float | None, Parameter(help="Mean metacentric height in m, for --of height.")] = None
    kind: Annotated[
        Literal["ornstein-uhlenbeck", "filter", "bounded", "non-gaussian"], Parameter(help="The kind of noise.")
    ] = "ornstein-uhlenbeck"
    terms: Annotated[Count, Parameter(help="How many noises of the kind are added, 1 to 3.")] = 1
    method: Annotated[
        Literal["spectrum", "whittle"],
        Parameter(help="Of a record: its spectrum by Welch's method, or Whittle's likelihood."),
    ] = "spectrum"
    column: Annotated[str | None, Parameter(help="The column of values, if the file has several.")] = None
    rate: Annotated[float | None, Parameter(help="Values of the record per second, if the file states no times.")] = (
        None
    )
    over: Annotated[str | None, Parameter(help="The column of frequencies or times, if its name does not tell.")] = None
    unit: Annotated[
        str | None, Parameter(help="The unit of the signal, such as g, or of its density, if the file states none.")
    ] = None
    scale: Annotated[float, Parameter(help="What the signal is multiplied by; a density by its square.")] = 1.0
    skip: Annotated[Count, Parameter(help="Rows of the file that are left out at its beginning; of a text lines.")] = 0
    row: Annotated[
        Count | None, Parameter(help="Which of several spectra in the rows of a file; their mean if omitted.")
    ] = None
    log_log: Annotated[
        bool, Parameter(help="The file has break points, with straight lines in the logarithms between.", negative="")
    ] = False
    named: Annotated[
        str | None,
        Parameter(
            help="A spectral density by its name instead of a file: jonswap, pierson-moskowitz, von-karman, kaimal, "
            "kanai-tajimi."
        ),
    ] = None
    parameters: Annotated[str, Parameter(help="Those of the named density, such as Hs=2,Tp=9.")] = ""
    segment: Annotated[
        float | None,
        Parameter(help="Seconds of a segment of a record; as the natural frequency needs if omitted."),
    ] = None
    rtol: Annotated[
        float | None, Parameter(help="Tolerance of the exponents of the system, relative; 1e-4 if omitted.")
    ] = None
    seconds: Annotated[
        float | None, Parameter(help="Processor time for each exponent of the system; 20 if omitted.")
    ] = None
    averages: Annotated[
        float | None, Parameter(help="How many independent periodograms the spectrum is the mean of: tells its errors.")
    ] = None
