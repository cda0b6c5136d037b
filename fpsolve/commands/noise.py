"""Fit a noise to a measurement; print what it means for stability."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Annotated, Literal

from cyclopts import Parameter

from fpsolve.case.case import Case
from fpsolve.commands.errors import NOT_CONVERGED
from fpsolve.commands.options import OPTIONS, Count, print_in_one_line
from fpsolve.errors import FpsolveError
from fpsolve.fem.factors import one_thread
from fpsolve.files import writable, write_json, write_text
from fpsolve.measured import Record, Spectrum, read_record, read_spectrum
from fpsolve.measured.named import NAMED, named_spectrum, parameters_of
from fpsolve.measured.signals import SIGNALS, factor_of
from fpsolve.measured.spectrum import UNITS
from fpsolve.measured.weak import GRAVITY
from fpsolve.messages import escaped
from fpsolve.results.folders import own_folder
from fpsolve.results.noise import case_of, noise_sections, summary
from fpsolve.solve.noise import (
    FILES,
    RTOL,
    SECONDS,
    STEPS_OF_A_FIT,
    Modes,
    Wanted,
    measure,
    natural_frequencies,
    refuse_wrong_case,
)
from fpsolve.tell.noise import draw_noise, show
from fpsolve.tell.progress import SOLVES, Phase
from fpsolve.tell.solved import last_line
from fpsolve.tell.terminal import print_blocks


@Parameter(name="*")
@dataclass(frozen=True)
class Statement:
    """The options of `fpsolve noise`.

    Attributes:
        record: A record of values over time instead, also .wav.
        per: The unit of the frequencies; if omitted that of the file, which must state it.
        sided: Whether the integral over f > 0 is the variance, one, or half of it, two.
        frequency: Natural frequency in the unit of --per, Hz if that is omitted; of two modes twice.
        damping_ratio: Damping as a share of critical damping; it states an oscillator, to give λ and Λ(2).
        restitution: Speed after a bounce off its wall over that before; no wall if omitted.
        case: A case instead, whose noise is replaced.
        noise_in: Where the noise is; stiffness if neither this nor --of is stated.
        length: Length of the pendulum in m, from which its natural frequency follows.
        gm: Mean metacentric height in m, for --of height.
        kind: The kind of noise.
        terms: How many noises of the kind are added, 1 or 2.
        column: The column of values, if the file has several.
        rate: Values of the record per second, in place of the times of the file.
        over: The column of frequencies or times, if its name does not say so.
        unit: The unit of the signal, such as g, or of its density, in place of that of the file.
        time_unit: The unit of the times of a record, such as ms, in place of that of the file.
        scale: Factor of the signal; a density has its square.
        skip: Rows at the beginning of the file to leave out; lines of a text.
        names: Names of the columns of a text with their units, such as "t (s),a (g)", in place of its own.
        by: How the values of a record follow each other in a text.
        parameters: Those of the named density, such as Hs=2,Tp=9.
        segment: Seconds of a segment of a record; as the natural frequency needs if omitted.
        rtol: Tolerance of the exponents of the system, relative; 1e-4 if omitted.
        seconds: Processor time for each exponent of the system; 20 if omitted.
        averages: Number of independent periodograms of which the spectrum is the mean; it gives the errors.
    """

    record: Path | None = None
    per: Literal["Hz", "rad/s"] | None = None
    sided: Literal["one", "two"] | None = None
    frequency: list[float] | None = None
    damping_ratio: float | None = None
    restitution: float | None = None
    case: Path | None = None
    noise_in: Literal["stiffness", "damping"] | None = None
    of: Annotated[
        Literal["stiffness", "damping", "acceleration", "height"] | None,
        Parameter(
            help="The signal: relative stiffness, damping in 1/s, vertical acceleration of a pendulum's support in "
            "m/s^2, or metacentric height of a ship in m. If omitted, that of --noise-in."
        ),
    ] = None
    length: float | None = None
    gm: float | None = None
    kind: Literal["ornstein-uhlenbeck", "filter", "bounded", "non-gaussian"] = "ornstein-uhlenbeck"
    terms: Count = 1
    column: str | None = None
    rate: float | None = None
    over: str | None = None
    unit: str | None = None
    time_unit: str | None = None
    scale: float = 1.0
    skip: Count = 0
    names: str = ""
    by: Literal["columns", "rows"] = "columns"
    named: Annotated[
        str | None,
        Parameter(
            help="A spectral density by its name instead of a file: jonswap, pierson-moskowitz, von-karman, kaimal, "
            "kanai-tajimi."
        ),
    ] = None
    parameters: str = ""
    segment: float | None = None
    rtol: float | None = None
    seconds: float | None = None
    averages: float | None = None


NOTHING_STATED = Statement()
OF_SPECTRA, OF_RECORDS = ("sided", "averages"), ("segment", "rate", "time_unit", "by")
OF_FILES = ("over", "skip", "names", "column", "unit")
"""Options for files alone: of one kind, of any."""
RANGES = {
    "gm": (0.0, math.inf, "> 0, in m"),
    "length": (0.0, math.inf, "> 0, in m"),
    "rtol": (0.0, 1.0, "> 0 and < 1"),
    "seconds": (0.0, math.inf, "> 0, in seconds"),
    "scale": (-math.inf, math.inf, "finite"),
    "frequency": (1e-12, 1e12, "> 1e-12 and < 1e12; state it in Hz"),
    "damping_ratio": (-1.0, 1.0, "> -1 and < 1; 0.01 is 1 % of critical damping"),
    "restitution": (0.0, 1.0 + 1e-15, "> 0 and <= 1; 1 means no wall"),
}
"""Between which numbers the values of options are, and how that is said."""


def measurement_of(
    spectrum: Path | None, stated: Statement, case: Case | None
) -> tuple[Spectrum | Record, Wanted, Path]:
    """What was measured, in the unit of its signal, what is to be fitted, and the file.

    Raises:
        FpsolveError: the options contradict each other, or a file cannot be read.
    """
    given, of = vars(stated), stated.of or stated.noise_in or "stiffness"
    place, source = SIGNALS[of].noise_in, spectrum or stated.record or Path(stated.named or "")
    has_file = bool(spectrum or stated.record)
    if stated.noise_in not in (None, place):
        raise FpsolveError(f"got --of {of} and --noise-in {stated.noise_in}; {of} is in the {place}; leave one out")
    if spectrum and stated.record:
        raise FpsolveError(f"got {spectrum} and --record {stated.record}, a spectrum and a record; leave out one")
    if not source.name:
        raise FpsolveError("name a file, that of a spectrum or of a record by --record, or a density by --named")
    for options, is_wrong, told in (
        (["named"], has_file, "is in place of a file, and one was named"),
        (["parameters"], not stated.named, "are those of --named"),
        ([*OF_SPECTRA, *OF_RECORDS, *OF_FILES], not has_file, "is for a file, and a density was named"),
        (OF_SPECTRA, not spectrum, "is for a spectrum, and a record was named"),
        (OF_RECORDS, spectrum, "is for a record, and a spectrum was named"),
        (["gm"], of != "height", "belongs to --of height"),
        (["length"], of != "acceleration", "is for --of acceleration"),
        (["damping_ratio", "restitution"], case, "is of the system, which --case states"),
    ):
        for option in options:
            if is_wrong and given[option] != vars(NOTHING_STATED)[option]:
                raise FpsolveError(f"--{option.replace('_', '-')} {told}; leave it out")
    if of == "height" and stated.gm is None:
        raise FpsolveError("--of height needs --gm; state the mean metacentric height in m by --gm")
    if stated.restitution is not None and stated.damping_ratio is None:
        raise FpsolveError("--restitution needs the damping of the oscillator, too; state --damping-ratio")
    for option, (low, high, accepted) in RANGES.items():
        for value in given[option] if isinstance(given[option], list) else [given[option]]:
            if value is not None and not low < value < high:
                raise FpsolveError(f"got --{option.replace('_', '-')} {value:g}; must be {accepted}")
    modes = _modes(stated, case)
    if case:
        refuse_wrong_case(case, of, stated.terms)
    limits = stated.rtol or RTOL, stated.seconds or SECONDS
    wanted = Wanted(of, stated.kind, stated.terms, modes, stated.gm, case, stated.segment, *limits)
    if stated.named:
        return _named(stated.named, stated, of, 2 * modes.omega[0]), wanted, source

    how = {option: given[option] for option in ("scale", *OF_FILES)}
    if stated.record:
        how_fast = {option: given[option] for option in ("rate", "time_unit", "by")}
        return read_record(source, of=of, **how_fast, **how), wanted, source
    more = {option: given[option] for option in ("per", *OF_SPECTRA)}
    return read_spectrum(source, of=of, **more, **how), wanted, source


def _named(name: str, stated: Statement, of: str, near: float) -> Spectrum:
    """The density that is named, in the unit of its signal."""
    try:
        found = named_spectrum(name, near, **parameters_of(stated.parameters))
        factor = factor_of(NAMED[name].unit, SIGNALS[of].unit) if stated.scale == 1.0 else stated.scale
    except ValueError as error:
        raise FpsolveError(f"--named: {error}") from None
    return found.scaled(factor)


def _modes(stated: Statement, case: Case | None) -> Modes:
    """The natural frequencies and the damping by the one option that states them."""
    unit = UNITS[stated.per or "Hz"]
    found = {
        "--frequency": [unit * each for each in stated.frequency or ()],
        "--length": [math.sqrt(GRAVITY / stated.length)] if stated.length else [],
        "--case": [*natural_frequencies(case.system)[:2]] if case else [],
    }
    if case and not found["--case"]:
        raise FpsolveError(f"{case.path}: does not oscillate without noise, so that no frequency matters most")
    told = {
        option: ", ".join(f"{each / (2 * math.pi):.4g} Hz" for each in omega)
        for option, omega in found.items()
        if omega
    }
    if not told:
        raise FpsolveError("state the natural frequency by --frequency, or a system by --case")
    if len(told) > 1:
        text = " and ".join(f"{option} {words}" for option, words in told.items())
        raise FpsolveError(f"got {text}; leave out one of {' and '.join(told)}")
    [omega] = filter(None, found.values())
    if len(omega) > 2:
        raise FpsolveError(f"got {len(omega)} natural frequencies; state one or two by --frequency")
    return Modes(tuple(omega), math.nan if stated.damping_ratio is None else stated.damping_ratio, stated.restitution)


def noise(
    spectrum: Path | None = None,
    *,
    stated: Statement = NOTHING_STATED,
    out: Path = Path("results"),
    json: bool = False,
) -> int:
    """Fit a noise to a measurement, closest at twice the natural frequency; print what it means for stability.

    Print the section [noise] of a case; write noise.toml, a case with it,
    noise.json and a figure into OUT/<file>/. Frequencies of the fit are 2f,
    of two modes 2f1, 2f2, f1 + f2 and |f1 - f2|, and 0 for noise in the
    damping.

    Example: fpsolve noise spectrum.csv --per Hz --sided one --frequency 2.0 --damping-ratio 0.01 --averages 64

    Example: fpsolve noise --record shaking.csv --of acceleration --length 0.5 --damping-ratio 0.02 --kind filter

    Args:
        spectrum: A spectral density: .csv, .txt, .npy, .npz, .mat, .uff or .nc, with a column of frequencies.
        out: Folder for the results.
        json: Print noise.json in one line.
    """

    start = monotonic()
    case = OPTIONS.load([stated.case])[0] if stated.case else None
    data, wanted, source = measurement_of(spectrum, stated, case)
    per = stated.per or "Hz"
    folder, phase = out / source.name, Phase(source.stem, "solving", STEPS_OF_A_FIT, SOLVES)
    try:
        with one_thread(), OPTIONS.watch(is_json=json).bar(phase) as progress:
            outcome = measure(data, wanted, progress)  # the arrays are small
    except FpsolveError as error:
        raise FpsolveError(f"{source}: {error}") from None
    with own_folder(folder, "noise"), writable(folder):
        text = case_of(outcome, folder)
        write_json(folder / "noise.json", summary(outcome, source))
        if text:
            write_text(folder / "noise.toml", text)
        draw_noise(outcome, source, per, folder)
    if json:
        print_in_one_line(folder / "noise.json")
    else:
        print_blocks(show(outcome, source, per))
        print(escaped(noise_sections(outcome).strip()), end="\n\n")
        names = ", ".join(name for name in FILES if text or name != "noise.toml")
        print_blocks([last_line(folder, names, monotonic() - start)])
    return NOT_CONVERGED if outcome.failure is not None else 0
