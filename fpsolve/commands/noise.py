"""Fit a noise to what was measured; say what it means for stability."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from fpsolve.commands.options import NOT_CONVERGED, Count, Options
from fpsolve.errors import FpsolveError
from fpsolve.fem.factors import one_thread
from fpsolve.files import alone, writable, write_json, write_text
from fpsolve.measured import Record, Spectrum, read_modes, read_record, read_spectrum
from fpsolve.measured.named import NAMED, named_spectrum, parameters_of
from fpsolve.measured.reading import checked_scale
from fpsolve.measured.signals import SIGNALS, factor_of, powers
from fpsolve.measured.spectrum import UNITS
from fpsolve.measured.units import GRAVITY
from fpsolve.messages import escaped
from fpsolve.results.noise import case_of, noise_sections, summary
from fpsolve.solve.noise import (
    FILES,
    STEPS_OF_A_FIT,
    Modes,
    NoiseOutcome,
    Wanted,
    measure,
    natural_frequencies,
    refuse_wrong_case,
)
from fpsolve.tell.noise import Convention, draw_noise, show
from fpsolve.tell.progress import SILENT, SOLVES, Phase, Watch
from fpsolve.tell.solved import last_line
from fpsolve.tell.terminal import print_blocks

if TYPE_CHECKING:
    from fpsolve.case.case import Case
    from fpsolve.solve.noise import Modes


def write_noise(outcome: NoiseOutcome, source: Path, shown: Convention, folder: Path) -> list[str]:
    """noise.json, noise.png, noise.pdf, and noise.toml where there is a system: their names."""
    text = case_of(outcome, folder)
    write_json(folder / "noise.json", summary(outcome, source))
    if text:
        write_text(folder / "noise.toml", text)
    else:  # of other options
        (folder / "noise.toml").unlink(missing_ok=True)
    draw_noise(outcome, source, shown, folder)
    return [name for name in FILES if text or name != "noise.toml"]


def noise_case(
    data: Spectrum | Record, wanted: Wanted, source: Path, shown: Convention, out: Path, watch: Watch = SILENT
) -> tuple[NoiseOutcome, Path, list[str]]:
    """Fit a noise, and write it with a figure into a folder called as the file of the measurement.

    Args:
        data, wanted: see `measure`.
        source: the file.
        shown: how densities are shown.
        out: where the folder is made.
        watch: of the progress, with a bar for the fit and what it means.

    Returns:
        What became of it, the folder, and the names of the files.

    Raises:
        FpsolveError: there is no fit; nothing is written.
        OutputError: the folder cannot be made or written to, or another run writes into it.
    """
    folder = out / source.name  # with its ending, so that it is none of a case
    try:
        with one_thread(), watch.bar(Phase(source.stem, "solving", STEPS_OF_A_FIT, SOLVES)) as progress:
            outcome = measure(data, wanted, progress)  # the arrays are small
    except FpsolveError as error:
        raise FpsolveError(f"{source}: {error}") from None
    with alone(folder), writable(folder):
        names = write_noise(outcome, source, shown, folder)
    return outcome, folder, names


CLOSE = 0.02
"""By which share of it two statements of a frequency may differ."""


@Parameter(name="*")
@dataclass(frozen=True)
class Statement:
    """The options of `fpsolve noise`.

    Attributes:
        record: A record of values over time instead, also .wav; beside a spectrum its variance is compared with it.
        per: The unit of the frequencies; if omitted that of the file, which must state it.
        sided: Whether the integral over f > 0 is the variance, one, or half of it, two.
        frequency: Natural frequency in the unit of --per, Hz if that is omitted; of two modes twice.
        damping_ratio: Damping as a share of critical damping: states an oscillator, whose verdict is told.
        restitution: Speed after a bounce off its wall over that before; no wall if omitted.
        case: A case instead, whose noise is replaced.
        modes: A table of natural frequencies and damping ratios, Fn and Xi, as pyOMA writes it.
        mode: A row of this table; of two modes twice.
        noise_in: Where the noise is; stiffness if neither this nor --of is stated.
        length: Length of the pendulum in m, from which its natural frequency follows.
        gm: Mean metacentric height in m, for --of height.
        kind: The kind of noise.
        terms: How many noises of the kind are added, 1 or 2.
        column: The column of values, if the file has several.
        rate: Values of the record per second, if the file states no times.
        over: The column of frequencies or times, if its name does not tell.
        unit: The unit of the signal, such as g, or of its density, if the file states none.
        scale: What the signal is multiplied by; a density by its square.
        skip: Rows of the file that are left out at its beginning; of a text lines.
        row: Which of several spectra in the rows of a file; their mean if omitted.
        log_log: The file has break points, with straight lines in the logarithms between.
        parameters: Those of the named density, such as Hs=2,Tp=9.
        segment: Seconds of a segment of a record; as the natural frequency needs if omitted.
        rtol: Tolerance of the exponents of the system, relative; 1e-4 if omitted.
        seconds: Processor time for each exponent of the system; 20 if omitted.
        averages: How many independent periodograms the spectrum is the mean of: tells its errors.
    """

    record: Path | None = None
    per: Literal["Hz", "rad/s"] | None = None
    sided: Literal["one", "two"] | None = None
    frequency: list[float] | None = None
    damping_ratio: float | None = None
    restitution: float | None = None
    case: Path | None = None
    modes: Path | None = None
    mode: list[Count] | None = None
    noise_in: Literal["stiffness", "damping"] | None = None
    of: Annotated[
        Literal["stiffness", "damping", "acceleration", "height"] | None,
        Parameter(
            help="What was measured: the relative stiffness, the damping in 1/s, the vertical acceleration of the "
            "support of a pendulum in m/s^2, or the metacentric height of a ship in m; that of --noise-in if omitted."
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
    scale: float = 1.0
    skip: Count = 0
    row: Count | None = None
    log_log: bool = False
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


def measurement_of(
    spectrum: Path | None, stated: Statement, case: Case | None
) -> tuple[Spectrum | Record, Wanted, Path]:
    """What was measured, in the unit of its signal, what is to be fitted, and the file.

    Raises:
        FpsolveError: the options contradict each other, or a file cannot be read.
    """

    of = stated.of or stated.noise_in or "stiffness"
    place = SIGNALS[of].noise_in
    if stated.noise_in not in (None, place):
        raise FpsolveError(f"got --of {of} and --noise-in {stated.noise_in}; {of} is in the {place}; leave one out")
    source = spectrum or stated.record or (Path(stated.named) if stated.named else None)
    if source is None:
        raise FpsolveError("name a file, that of a spectrum or of a record by --record, or a density by --named")
    if stated.named and (spectrum or stated.record):
        raise FpsolveError("--named is in place of a file; leave one of them out")
    if stated.parameters and not stated.named:
        raise FpsolveError("--parameters are those of --named; name a density, or leave them out")
    modes = _modes(stated, of, case)
    if case:
        refuse_wrong_case(case, of, stated.terms)
    if (of == "height") != (stated.gm is not None):
        remedy = "leave it out" if stated.gm is not None else "state the mean metacentric height in m by --gm"
        raise FpsolveError(f"--gm belongs to --of height; {remedy}")
    if stated.gm is not None and not 0 < stated.gm < math.inf:
        raise FpsolveError(f"got --gm {stated.gm}; must be > 0, in m")
    wanted = Wanted(of, stated.kind, stated.terms, modes, stated.gm, case, stated.segment)
    limits = {name: each for name in ("rtol", "seconds") if (each := getattr(stated, name)) is not None}
    for name, each in limits.items():
        if not 0 < each < math.inf or (name == "rtol" and each >= 1):
            raise FpsolveError(f"got --{name} {each:g}; must be > 0{' and < 1' if name == 'rtol' else ', in seconds'}")
    wanted = replace(wanted, **limits)
    if stated.named:
        of_files = "rate", "segment", "sided", "averages", "column", "over", "row", "skip", "log_log"
        _refuse_stated(stated, of_files, "is for a file, and a density was named")
        return _named(stated, of, 2 * modes.omega[0]), wanted, source
    how: dict[str, Any] = {
        "of": of,
        "unit": stated.unit,
        "scale": stated.scale,
        "skip": stated.skip,
        "over": stated.over,
    }
    of_record = how if spectrum is None else {"of": of}
    record = read_record(stated.record, rate=stated.rate, column=stated.column, **of_record) if stated.record else None
    if spectrum is not None:
        of_records = "segment", *(["rate"] if record is None else [])
        _refuse_stated(stated, of_records, "is for a record, and a spectrum was named")
    if spectrum is None and record is not None:
        names = "sided", "averages", "row", "log_log"
        _refuse_stated(stated, names, "is for a spectrum, and a record was named")
        return record, wanted, source
    data = read_spectrum(
        spectrum or source,
        per=stated.per,
        sided=stated.sided,
        column=stated.column if record is None else None,
        row=stated.row,
        log_log=stated.log_log,
        averages=stated.averages,
        variance=None if record is None else float(record.values.var()),
        **how,
    )
    return data, wanted, source


def _refuse_stated(stated: Statement, names: Sequence[str], told: str) -> None:
    """Refuse options that are for something else. Raises `FpsolveError`."""
    for name in names:
        if getattr(stated, name) != getattr(NOTHING_STATED, name):
            raise FpsolveError(f"--{name.replace('_', '-')} {told}; leave it out")


def _named(stated: Statement, of: str, near: float) -> Spectrum:
    """The density that is named, in the unit of its signal."""

    assert stated.named is not None
    try:
        found = named_spectrum(stated.named, near, **parameters_of(stated.parameters))
        unit = stated.unit or NAMED[stated.named].unit
        if stated.scale == 1.0 and powers(unit) not in [powers(each) for each in SIGNALS[of].units]:
            signal = SIGNALS[of]
            text = (
                f"is in {unit}, and {signal.words} in {signal.unit}; state by --scale how much of this is in one {unit}"
            )
            raise ValueError(f"{stated.named} {text}")
        factor = factor_of(of, powers(unit), unit) if stated.scale == 1.0 else checked_scale(stated.scale)
    except ValueError as error:
        raise FpsolveError(f"--named: {error}") from None
    return found.scaled(factor)


def _modes(stated: Statement, of: str, case: Case | None) -> Modes:
    """The natural frequencies and the damping by the one option that states them."""
    import numpy as np

    restitution, zeta = stated.restitution, stated.damping_ratio
    if zeta is not None and math.isnan(zeta):
        raise FpsolveError("got --damping-ratio nan; must be -1 < value < 1; leave it out if it is not known")
    if stated.mode and stated.modes is None:
        raise FpsolveError("--mode is for the table that --modes names; name one, or leave it out")
    if case and (zeta is not None or restitution is not None or stated.modes is not None):
        raise FpsolveError("--case states the system; leave out --damping-ratio, --restitution and --modes")
    if stated.restitution is not None and zeta is None and stated.modes is None:
        raise FpsolveError("--restitution needs the damping of the oscillator, too; state --damping-ratio")
    hertz = UNITS[stated.per or "Hz"] / (2 * math.pi)
    found = dict[str, tuple[float, ...]]()
    if stated.frequency:
        found["--frequency"] = tuple(each * hertz for each in stated.frequency)
    if stated.length is not None:
        if of != "acceleration" or not 0 < stated.length < math.inf:
            raise FpsolveError(f"got --length {stated.length}; must be > 0, in m, and is for --of acceleration")
        found["--length"] = (math.sqrt(GRAVITY / stated.length) / (2 * math.pi),)
    if case:
        found["--case"] = tuple(each / (2 * math.pi) for each in natural_frequencies(case.system)[:2])
        if not found["--case"]:
            raise FpsolveError(f"{case.path}: does not oscillate without noise, so that no frequency matters most")
    table = modes_from(stated.modes, stated.mode or (), restitution) if stated.modes else None
    if table is not None:
        found["--modes"] = tuple(each / (2 * math.pi) for each in table.omega)
    if not found:
        raise FpsolveError("state the natural frequency by --frequency, or a system by --case or --modes")
    (first, frequencies), *others = found.items()
    for name, other in others:
        if len(other) != len(frequencies) or not np.allclose(np.sort(other), np.sort(frequencies), rtol=CLOSE):
            told = " and ".join(f"{key} {', '.join(f'{f:.4g} Hz' for f in each)}" for key, each in found.items())
            raise FpsolveError(f"got {told}; leave out one of {first} and {name}")
    known = zeta if zeta is not None else table.zeta if table is not None else math.nan
    for option, values, low, high, remedy in (
        ("--frequency", frequencies, 1e-12, 1e12, "state it in Hz"),
        ("--damping-ratio", [] if math.isnan(known) else [known], -1.0, 1.0, "0.01 is 1 % of critical damping"),
        ("--restitution", [] if restitution is None else [restitution], 0.0, 1.0 + 1e-15, "1 means no wall"),
    ):
        for value in values:
            if not low < value < high:
                raise FpsolveError(f"got {option} {value:g}; must be > {low:g} and < {high:g}; {remedy}")
    if len(frequencies) > 2:
        raise FpsolveError(f"got {len(frequencies)} frequencies; must be one or two; choose those of the coupled modes")
    return Modes(tuple(2 * math.pi * each for each in frequencies), known, restitution)


def modes_from(path: Path, numbers: Sequence[int], restitution: float | None) -> Modes:
    """One or two modes of a table, by their rows from 1 on; all if none are stated. Unknown damping is NaN.

    Raises:
        FpsolveError: the file is none, there are more than two modes, or a number is none of a row.
    """

    found = read_modes(path)
    for number in numbers:
        if not 1 <= number <= len(found):
            raise FpsolveError(f"{path}: got --mode {number}; must be from 1 to {len(found)}, the number of its row")
    chosen = [found[number - 1] for number in numbers] if numbers else found
    if len(chosen) > 2:
        raise FpsolveError(f"{path}: has {len(chosen)} modes; choose one or two by --mode, such as --mode 1 --mode 2")
    omega = tuple(2 * math.pi * each.frequency for each in chosen)
    return Modes(omega, chosen[0].damping_ratio, restitution)


NOTHING_STATED = Statement()


def noise(
    spectrum: Path | None = None,
    *,
    stated: Statement = NOTHING_STATED,
    out: Path = Path("results"),
    json: bool = False,
) -> int:
    """Fit a noise to what was measured, most of all at twice the natural frequency; say what it means for stability.

    Prints the section [noise] of a case, and writes noise.toml, a case with it, noise.json and a figure into
    OUT/<file>/. Frequencies of the fit are 2f, of two modes 2f1, 2f2, f1 + f2 and |f1 - f2|, and 0 for noise in the
    damping.

    Example: fpsolve noise spectrum.csv --per Hz --sided one --frequency 2.0 --damping-ratio 0.01 --averages 64

    Example: fpsolve noise --record shaking.csv --of acceleration --length 0.5 --damping-ratio 0.02 --kind filter

    Args:
        spectrum: A spectral density: .csv, .txt, .npy, .npz, .mat, .uff or .nc, with a column of frequencies.
        out: Folder for the results.
        json: Print noise.json in one line.
    """

    start = monotonic()
    case = Options().load([stated.case])[0] if stated.case else None
    data, wanted, source = measurement_of(spectrum, stated, case)
    shown = Convention(stated.per or "Hz", stated.sided or "one")
    outcome, folder, names = noise_case(data, wanted, source, shown, out, Options().watch(is_json=json))
    if json:
        print(" ".join(line.strip() for line in (folder / names[0]).read_text(encoding="utf-8").splitlines()))
    else:
        print(escaped(noise_sections(outcome).strip()), end="\n\n")
        print_blocks(show(outcome, source, shown))
        print_blocks([last_line(folder, ", ".join(names), monotonic() - start)])
    return NOT_CONVERGED if outcome.failure is not None else 0
