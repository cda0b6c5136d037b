"""Files of measurements as people have them: each is read as the numbers that it holds, or refused in one sentence.

The files are made here in the shapes of loggers, programs and buoys; none is of others.
"""

import io
import math
import os
import re
import struct

import numpy as np
import pytest
import xarray as xr
from scipy.io import savemat, wavfile
from scipy.signal import lfilter

from fpsolve import FpsolveError
from fpsolve.measured import read_modes, read_record, read_spectrum
from tests.conftest import sampled

RATE, EPOCH, G = 50.0, 1_700_000_000.0, 9.80665
T = np.arange(2048) / RATE
X = np.round(64 * lfilter([0.1], [1, -0.9], np.random.default_rng(1).normal(size=T.size))) / 64
"""A record whose values are the same in four bytes, in two, in one and a half, and in six decimals."""
F = np.round(np.linspace(0.05, 8.0, 160), 4)
D = np.round(0.3 / (1 + (F - 3) ** 2), 6)


def rows(*columns, separator=",", form="{:.7g}"):
    """Lines of numbers, or of words."""
    cells = [[each if isinstance(each, str) else form.format(each) for each in column] for column in columns]
    return "\n".join(separator.join(row) for row in zip(*cells, strict=True)) + "\n"


def iso(separator="T"):
    stamps = np.datetime64("2026-03-01T23:59:30") + np.round(1000 * T).astype("timedelta64[ms]")
    return [str(each).replace("T", separator) for each in stamps]


def unix(factor=1.0, digits=0, t=T):
    return [f"{factor * (EPOCH + each):.{digits}f}" for each in t]


def of_hobo(stamp):
    hour = int(stamp[11:13])
    half = "PM" if hour >= 12 else "AM"
    return f"{stamp[5:7]}/{stamp[8:10]}/{stamp[2:4]} {hour % 12 or 12:02d}{stamp[13:]} {half}"


def saved(write):
    """The bytes that something writes into a file in memory."""
    file = io.BytesIO()
    write(file)
    return file.getvalue()


def arrays(write=np.savez, **named):
    return saved(lambda file: write(file, **named))


def matlab(**options):
    return saved(lambda file: savemat(file, {"t": T, "a": X, "note": "text"}, **options))


QUARTER = (X / 4).astype("<f4")


def wav(*chunks, values=QUARTER):
    """Sound with further chunks before it."""
    content = saved(lambda file: wavfile.write(file, int(RATE), values))
    more = b"".join(name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2) for name, data in chunks)
    return b"RIFF" + struct.pack("<I", len(content) - 8 + len(more)) + b"WAVE" + more + content[12:]


def netcdf(variables, coordinates, engine="h5netcdf"):
    return bytes(xr.Dataset(variables, coordinates).to_netcdf(engine=engine))


def npy_header(shape):
    about = {"descr": "<f8", "fortran_order": False, "shape": shape}
    return saved(lambda file: np.lib.format.write_array_header_1_0(file, about))


def peer(values):
    cells = [f"{each: .7E}" for each in values]
    body = "\n".join("".join(f"{cell:>16}" for cell in cells[i : i + 5]) for i in range(0, len(cells), 5))
    head = "PEER STRONG MOTION DATABASE A\nSOMEWHERE, 3/1/2026, STATION 5, 090\nACCELERATION IN UNITS OF G\n"
    return f"{head}NPTS= {len(values)}, DT= {1 / RATE:.4f} SEC\n{body}\n"


def uff(function_type, x, y, unit="NONE", end="\n", is_binary=False):
    """Dataset 58 as its format says: lines of text, then numbers of eight bytes as text, or of four bytes."""
    data = y.astype("<f4").tobytes()
    binary = f"b{1:6d}{2:6d}{11:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}" * is_binary
    axis = f"{17 if function_type == 1 else 18:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}"
    kind = f"{function_type:5d}{0:10d}{1:5d}{0:10d} {'NONE':10s}{1:10d}{1:4d} {'NONE':10s}{1:10d}{1:4d}"
    steps = f"{2 if is_binary else 4:10d}{len(x):10d}{1:10d}{x[0]:13.5e}{x[1] - x[0]:13.5e}{0.0:13.5e}"
    ordinate = f"{12:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {unit:20s}"
    head = ["    -1", f"{58:6d}{binary}", "a", *["NONE"] * 4, kind, steps, axis, ordinate, axis, axis, ""]
    cells = [f"{each:20.11e}" for each in y]
    text = end.join("".join(cells[i : i + 4]) for i in range(0, len(cells), 4)).encode("latin-1")
    return end.join(head).encode("latin-1") + (data if is_binary else text) + f"{end}    -1{end}".encode()


TXA = rows(T, X)
RECORDS = {
    # name: (text or bytes, what the numbers are in m/s², options)
    "savetxt.csv": ("# t (s),a (g)\n" + TXA, G, {}),
    "savetxt_spaces.txt": ("# t (s) a (g)\n" + rows(T, X, separator=" "), G, {}),
    "percent.dat": ("% made by a program\n% time [s]\ta [m/s^2]\n" + rows(T, X, separator="\t"), 1.0, {}),
    "quotients.csv": ("Time / ms,Acc / g\n" + rows(1000 * T, X), G, {}),
    "quotients in brackets.csv": ("t / s,a / (cm/s^2)\n" + TXA, 0.01, {}),
    "ends of names.csv": ("Time_ms,acc_x_g\n" + rows(1000 * T, X), G, {}),
    "no units.csv": ("time,a_g\n" + TXA, 1.0, {}),
    "unix ms.csv": ("time,a (g)\n" + rows(unix(1e3), X), G, {}),
    "unix us.csv": ("stamp,a (g)\n" + rows(unix(1e6), X), G, {}),
    "unix.csv": ("time (s),a (g)\n" + rows(unix(digits=3), X), G, {}),
    "slashes.txt": ("// t (s); a (cm/s2)\n" + rows(T, X, separator=";"), 0.01, {}),
    "openfast.out": (
        "\nPredictions were generated on 01-Mar-2026 at 12:00:00 using OpenFAST\nlinked with NWTC Library\n\n"
        "Description: a tower\n\n\nTime\tTwHt1ALxt\tYawPzn\n(s)\t(m/s^2)\t(deg)\n" + rows(T, X, 0 * X, separator="\t"),
        1.0,
        {"column": "TwHt1ALxt"},
    ),
    "labview.lvm": (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n***End_of_Header***\t\n\nChannels\t1\t\n"
        "Samples\t4096\t\nX_Dimension\tTime\t\n***End_of_Header***\t\nX_Value\ta (m/s^2)\tComment\n"
        + rows(T, X, separator="\t"),
        1.0,
        {},
    ),
    "hobo.csv": (
        '"Plot Title: tower"\n"#","Date Time, GMT+00:00","a (m/s^2)","Stopped"\n'
        + rows(range(1, T.size + 1), map(of_hobo, iso(" ")), X, [""] * T.size),
        1.0,
        {},
    ),
    "oscilloscope.csv": (
        "Model,MSO5\nFirmware,1.2\nPoint Format,Y\nHorizontal Scale,0.2\n\nTIME,CH1 (V)\ns,V\n" + TXA,
        2.5,
        {"unit": "m/s^2", "scale": 2.5},
    ),
    "oscilloscope_units.csv": ("Source,CH1\nSecond,Volt\nx-axis,CH1\ns,m/s^2\n" + TXA, 1.0, {}),
    "pandas.csv": (",t (s),a (g)\n" + rows(range(T.size), T, X), G, {}),
    "pandas_times.csv": (",a (g)\n" + rows(iso(" "), X), G, {}),
    "iso.csv": ("time,a (m/s^2)\n" + rows(iso(), X), 1.0, {}),
    "iso_zone.csv": ("time,a (m/s^2)\n" + rows([f"{each}+01:00" for each in iso()], X), 1.0, {}),
    "iso_two_words.txt": ("date;a (m/s²)\n" + rows(iso(" "), X, separator=";"), 1.0, {}),
    "clock.csv": ("time,a (mm/s^2)\n" + rows([each[11:] for each in iso()], X), 1e-3, {}),
    "milliseconds.csv": ("t [ms],a [g]\n" + rows(np.round(1000 * T), X, form="{:.9g}"), G, {}),
    "excel.csv": ("sep=;\nt (s);a (g)\n" + rows(T, X, separator=";"), G, {}),
    "trailing.csv": ("t (s),a (g),\n" + rows(T, X, [""] * T.size), G, {}),
    "fortran.dat": (" t(s)  a(g)\n" + rows(T, X, separator="  ", form="{:.8E}").replace("E", "D"), G, {}),
    "letters.csv": ("TIME,CH1\ns,g\n" + TXA, G, {}),
    "channels.csv": ("t,1,2,3,4,5,6\n" + rows(T, *[0 * T] * 5, X), G, {"column": "6", "unit": "g"}),
    "many channels.csv": ("t,0,1,2,3,4\n" + rows(T, T, T, X, T, T), G, {"unit": "g", "column": "2"}),
    "channels below.csv": ("t (ms),a (V),b (g)\nChannel,1,2\n" + rows(1000 * T, 0 * X, X), G, {"column": "b"}),
    "bare.txt": (rows(X), G, {"rate": RATE, "unit": "g"}),
    "preamble_numbers.txt": ("station 17\n3 4 5\nt (s) a (g)\n" + rows(T, X, separator=" "), G, {}),
    "words.csv": ("t (s),a (g),state\n" + rows(T, X, ["ok"] * T.size), G, {"column": "a"}),
    "quoted.csv": ('"t (s)","a (g)"\n' + rows(T, X, form='"{:.7g}"'), G, {}),
    "crlf.csv": (("t (s),a (g)\n" + TXA).replace("\n", "\r\n"), G, {}),
    "mark.csv": ("\ufefft (s),a (g)\n" + TXA, G, {}),
    "latin.csv": (("Mesure à 5 °C\nt (s),a (m/s²)\n" + TXA).encode("latin-1"), 1.0, {}),
    "motion.AT2": (peer(X), G, {}),
    "skipped.csv": ("t (s),a (g)\nx,y\n" + TXA, 1.0, {"skip": 2, "rate": RATE, "column": "2"}),
    "58.unv": (uff(1, T, X, "g"), G, {}),
    "58b.uff": (uff(1, T, X, "g", is_binary=True), G, {}),
    "58b_crlf.uff": (uff(1, T, X, "g", "\r\n", is_binary=True), G, {}),
    "bext.wav": (
        wav((b"bext", b"station" * 40), (b"cue ", b"\0" * 28), (b"id3 ", b"ID3" + b"x" * 30)),
        G,
        {"unit": "g", "scale": 4.0},
    ),
    "two bytes.wav": (wav(values=(X / 4 * 2**15).astype("<i2")), 1.0, {"scale": 4.0}),
    "one byte.wav": (wav(values=(X / 2 * 2**7 + 2**7).astype("u1")), 1.0, {"scale": 2.0}),
    "stereo.wav": (wav(values=np.column_stack([0 * X, X]).astype("<f4")), 1.0, {"column": "channel 2"}),
    "matlab.mat": (matlab(), G, {"unit": "g"}),
    "compressed.mat": (matlab(do_compression=True), G, {"unit": "g"}),
    "matlab4.mat": (matlab(format="4"), G, {"unit": "g"}),
    "plain.npy": (arrays(np.save, arr=np.column_stack([T, X])), G, {"unit": "g", "over": "1"}),
    "values.npy": (arrays(np.save, arr=np.r_[9.0, X]), 1.0, {"rate": RATE, "skip": 1}),
    "datetime.nc": (
        netcdf(
            {"a": ("time", X, {"units": "m s-2"})},
            {"time": np.datetime64("2026-03-01T00:00") + np.round(1e9 * T).astype("timedelta64[ns]")},
        ),
        1.0,
        {},
    ),
    "cf.nc": (netcdf({"a": ("t", X, {"units": "g"})}, {"t": ("t", T, {"units": "seconds"})}), G, {}),
}
SPREAD = np.cos(np.radians(np.arange(0.0, 360.0, 15.0))) ** 2 / 180
ALL_WAYS = np.array([0.9 * D, 1.1 * D])[:, :, None] * SPREAD
WAVES = netcdf(
    {"efth": (("time", "freq", "dir"), ALL_WAYS, {"units": "m^{2}.s.degree^{-1}"})},
    {"time": [0.0, 1.0], "freq": ("freq", F, {"units": "Hz"}), "dir": np.arange(0.0, 360.0, 15.0)},
)  # fmt: skip
"""As wavespectra has them: over times, frequencies and directions."""
PLAIN = {"of": "stiffness", "per": "Hz"}
UNITS = {
    ("(m/s^2)^2/Hz", "acceleration"): 1.0,
    ("g²/Hz", "acceleration"): G**2,
    ("m²/s⁴/Hz", "acceleration"): 1.0,
    ("(m/s2)^2/Hz", "acceleration"): 1.0,
    ("g2/Hz", "acceleration"): G**2,
    ("m2 s-4 Hz-1", "acceleration"): 1.0,
    ("m2 s-3", "acceleration"): 1.0,
    ("m2/Hz", "height"): 1.0,
    ("cm²/Hz", "height"): 1e-4,
    ("%^2/Hz", "stiffness"): 1e-4,
    ("1/s²/Hz", "damping"): 1.0,
}
FDA = rows(F, D)
SPECTRA = {
    **{
        f"{k}.csv": (f"f (Hz),G ({unit})\n{FDA}", factor, {"of": of})
        for k, ((unit, of), factor) in enumerate(UNITS.items())
    },
    "tabs.txt": ("frequency [Hz]\tPSD [1/Hz]\n" + rows(F, D, separator="\t"), 1.0, {"of": "stiffness"}),
    "remark.dat": ("# remark\nfrequency density\n" + rows(F, D, separator=" "), 1.0, PLAIN),
    "semicolons.csv": ("f;G\n" + rows(F, D, separator=";"), 1.0, PLAIN),
    "savetxt.txt": ("# f (Hz) G ((m/s^2)^2/Hz)\n" + rows(F, D, separator=" "), 1.0, {}),
    "units below.csv": ("frequency,PSD\nHz,g^2/Hz\n" + FDA, G**2, {}),
    "stated.csv": ("f (Hz),G\n" + FDA, G**2, {"unit": "g^2/Hz"}),
    "of the signal.csv": ("f (Hz),G\n" + FDA, G**2, {"unit": "g"}),
    "columns.csv": ("n,f (Hz),lower,G ((m/s^2)^2/Hz)\n" + rows(F, F, D, D), 1.0, {"column": "G", "over": "f"}),
    "channels.csv": ("f (Hz),1,2,3,4,5\n" + rows(F, F, F, D, F, F), 1.0, {"of": "stiffness", "column": "3"}),
    "falling.csv": ("f (Hz),G (g^2/Hz)\n" + rows(F[::-1], D[::-1]), G**2, {}),
    "omega.csv": ("omega (rad/s),G ((m/s^2)^2*s/rad)\n" + rows(2 * np.pi * F, D, form="{:.17g}"), 2 * np.pi, {}),
    "hertz called omega.csv": ("omega,G (1/Hz)\n" + FDA, 1.0, PLAIN),
    "plain.npy": (arrays(np.save, arr=np.column_stack([F, D])), 1.0, PLAIN),
    "named.npz": (arrays(f=F, G=D), 1.0, PLAIN),
    "named.mat": (saved(lambda file: savemat(file, {"f": F, "G": D, "note": "text"})), 1.0, PLAIN),
    "units.nc": (netcdf({"G": ("f", D, {"units": "1/Hz"})}, {"f": ("f", F, {"units": "Hz"})}), 1.0, {"of": None}),
    "classic.nc": (netcdf({"G": (("time", "f"), D[None])}, {"f": F, "time": [0.0]}, "scipy"), 1.0, PLAIN),
    "waves.nc": (WAVES, 1.0, {"of": "height"}),
    "one time.nc": (WAVES, 1.1, {"of": "height", "row": 2}),
    "plain.uff": (uff(9, F, D), 1.0, PLAIN),
    "latin.uff": (uff(9, F, D, "m/s\xb2"), 1.0, {}),
    "crlf.uff": (uff(9, F, D, "g", "\r\n"), G**2, {}),
}  # fmt: skip


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("name", RECORDS)
def test_record_of_a_logger_has_its_values_and_its_step(name, tmp_path):
    content, factor, options = RECORDS[name]
    found = read_record(written(tmp_path, name, content), of="acceleration", **options)
    assert found.step == pytest.approx(1 / RATE, rel=1e-9)
    assert found.values == pytest.approx(factor * (X - X.mean()), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", SPECTRA)
def test_spectrum_of_a_program_has_its_frequencies_and_its_densities(name, tmp_path):
    """S = G/2 of a one-sided density per Hz."""
    content, factor, options = SPECTRA[name]
    found = read_spectrum(written(tmp_path, name, content), **{"sided": "one", "of": "acceleration", **options})
    assert found.frequencies == pytest.approx(2 * math.pi * F, rel=1e-9)
    assert found.density == pytest.approx(0.5 * factor * D, rel=1e-9)


MODES = {
    "pyoma.csv": ("Fn [Hz],Xi [-]\n2.0,0.01\n3.5,0.02\n", ((2.0, 0.01), (3.5, 0.02))),
    "pyoma.npz": (arrays(Fn=[2.0, 3.5], Xi=[0.01, 0.02]), ((2.0, 0.01), (3.5, 0.02))),
    "percent.csv": (f"omega (rad/s),damping (%)\n{4 * math.pi},1.5\n", ((2.0, 0.015),)),
}


@pytest.mark.parametrize("name", MODES)
def test_modes_of_a_table_are_frequencies_in_hertz_and_damping_ratios(name, tmp_path):
    content, modes = MODES[name]
    assert np.array(read_modes(written(tmp_path, name, content))) == pytest.approx(np.array(modes))


STAMPS = rows(unix(1e3), X)
NOTED = [
    # header and rows, options, what is noted
    ("t (s),a\n" + TXA, {"of": "stiffness"}, ""),
    ("Sample,a\n" + rows(range(T.size), X), {"of": "stiffness"}, "Sample is taken as times in s.*--rate"),
    ("Sample,a\n" + rows(range(T.size), X), {"of": "stiffness", "rate": RATE, "column": "a"}, ""),
    ("t (s),a\n" + TXA, {"of": "acceleration"}, "taken as m/s².*--unit"),
    ("stamp,a\n" + STAMPS, {}, "^the times in stamp are taken as ms since 1970; --rate states other ones$"),
    ("stamp,a\n" + STAMPS, {"rate": 10.0, "column": "a"}, ""),
    (rows(range(99), np.arange(99) % 7), {}, "the column 1 is taken as times in s"),
    *[
        ("t (s),a (g)\n" + rows([f"{shift + k / 30:.2f}" for k in range(1000)], X[:1000]), {"of": "acceleration"},
         r"rounded to 0\.01 s")
        for shift in (0.0, EPOCH)
    ],
]  # fmt: skip


@pytest.mark.parametrize(("text", "options", "note"), NOTED)
def test_what_a_record_does_not_state_is_taken_with_a_note(text, options, note, tmp_path):
    found = read_record(written(tmp_path, "a.csv", text), **options)
    assert len(found.notes) == bool(note)
    assert all(pytest.approx(found.step, rel=1e-4) == 1 / 30 for each in found.notes if "rounded" in each)
    for each in found.notes:
        assert re.search(note, each)


GAP = np.r_[0:1000, 1500:2048]
HALF = np.sort(np.random.default_rng(0).permutation(2048)[:1024])
DAMAGED = bytearray(arrays(np.savez_compressed, f=F))
DAMAGED[60:100] = b"\xff" * 40
COMMAS = rows(X, form="{:.3f}").replace(".", ",")
COLUMN = "state one by --column"
BAD_RECORDS = {
    # name: (content, options, what is said)
    "commas.csv": ("t (s);a (g)\n" + rows(T, X, separator=";").replace(".", ","), {}, "write decimal points"),
    "commas in all.csv": (
        "Zeit;Beschleunigung\ns;m/s²\n" + rows(T, X, separator=";", form="{:.9f}").replace(".", ","),
        {},
        r":3: has \"0,0{9}\" in the column Zeit; write decimal points",
    ),
    "one column of commas.csv": (
        COMMAS, {"rate": RATE}, r':1: has ".*"; write decimal points; if these are two columns, name'
    ),
    "a name over commas.csv": ("acc\n" + COMMAS, {"rate": RATE}, ":2: has"),
    "days.csv": ("t,a\n" + rows(["01.03.2026 12:00:00"] * 99, X[:99]), {}, "write times alike, such as 2026"),
    "gap.csv": ("t (s),a (g)\n" + rows(T[GAP], X[GAP]), {}, r"uneven steps, 10.02 s at line 1002"),
    "gap unix.csv": ("t (s),a (g)\n" + rows(unix(1, 3, T[GAP]), X[GAP]), {}, r"uneven steps, 10.02 s at line 1002"),
    "half is missing.csv": ("t (s),a (g)\n" + rows(unix(1, 3, T[HALF]), X[HALF]), {}, "uneven steps"),
    "a gap of rounded times.csv": (
        "t (s),a\n" + rows([f"{k / 30:.2f}" for k in range(1000) if k != 500], X[:999]), {}, "uneven steps"
    ),
    "back.csv": ("t (s),x\n" + rows(T[::-1], X), {}, "do not increase"),
    "standing.csv": ("t (s),x\n" + rows(0 * T, X), {}, "do not increase"),
    "whole seconds.csv": ("t (s),a (g)\n" + rows([f"{int(t)}" for t in T], X), {}, "state --rate"),
    "volts.csv": ("t (s),a (V)\n" + TXA, {"of": "acceleration"}, r"state --unit"),
    "decibel.csv": ("t (s),a (dB)\n" + TXA, {"of": "acceleration"}, r'the unit "dB"'),
    "prose.txt": ("nothing was measured today\nnor tomorrow\n", {}, "has no table of numbers"),
    "value.csv": (f"t (s),a (g)\n{TXA}{T[-1] + 1 / RATE},nan\n", {}, "value nan in line 2050"),
    "cut.at2": (peer(X)[:-300], {}, "states 2048 values and has"),
    "several.csv": ("t,left,right\n" + rows(T, X, X), {}, f"several columns of values; {COLUMN}"),
    "misspelt.csv": (
        "t,left,right\n" + rows(T, X, X),
        {"column": "rigth"},
        r'no column "rigth"; did you mean "right"\? its columns are t, left, right',
    ),
    "one.csv": ("x\n" + rows(X), {}, r"write a column of times, such as t \(s\), beside it, or state --rate$"),
    "spectrum.uff": (uff(9, F, D), {}, "leave out --record"),
}  # fmt: skip
ONE = {"sided": "one", "per": "Hz"}
BAD_SPECTRA = {
    "empty.csv": (b"", ONE, "is empty"),
    "binary.csv": (b"\0\1\2", ONE, "is binary"),
    "one line.csv": ("f,G\n", ONE, "has no table of numbers"),
    "short row.csv": ("f,G\n1,2\n3\n", ONE, r":3: has 1 cells, and the header has 2"),
    "word.csv": ("f,G\n1,2\n3,x\n", ONE, r':3: has "x" in the column G; write a number'),
    "gap.csv": ("f,G\n1,2\n3,\n", ONE, r":3: has nothing in the column G"),
    "commas.csv": ("f;G\n1;2\n3;0,5\n", ONE, "write decimal points"),
    "twice.csv": ("f,f\n1,2\n", ONE, 'two columns called "f"'),
    "archive.npy": (arrays(), ONE, "is no file of NumPy"),
    "huge.npy": (npy_header((2**40,)), ONE, "numbers, and at most"),
    "short.npy": (npy_header((1000,)) + b"12345678", ONE, "more than the file holds"),
    "text.npy": (b"no numpy", ONE, "is no file of NumPy"),
    "text.npz": (b"PK\3\4 no zip", ONE, "is no file of NumPy"),
    "damaged.npz": (bytes(DAMAGED), ONE, "is no file of NumPy"),
    "new.npy": (b"\x93NUMPY\3\0" + npy_header((2**40,))[8:], ONE, "has the version 3.0"),
    "texts.npz": (arrays(f=np.array(["a"])), ONE, "f has no numbers"),
    "objects.npy": (arrays(np.save, arr=np.array([{}], dtype=object)), ONE, "Python objects, which are not loaded"),
    "cut.wav": (wav()[:-400], ONE, "states 8250 bytes and has 7850"),
    "record.wav": (wav(), ONE, "name it by --record"),
    "text.wav": (b"RIFF" + struct.pack("<I", 4) + b"none", ONE, "is no WAV file"),
    "text.mat": (b"x" * 200, ONE, "is no MATLAB file"),
    "new.mat": (b"MATLAB 7.3 MAT-file" + b" " * 200, ONE, "-v7"),
    "text.nc": (b"CDF\1" + b"x" * 100, ONE, "is no netCDF file"),
    "hdf.nc": (b"\x89HDF\r\n\x1a\n" + b"x" * 100, ONE, "is no netCDF file"),
    "text.uff": (b"    -1\n    58\nnothing\n    -1\n", ONE, "is no universal file"),
    "a.xlsx": (b"PK", ONE, 'the unknown ending ".xlsx"'),
    "sides.csv": ("f (Hz),G (1/Hz)\n" + FDA, {}, "one-sided"),
    "no unit.csv": ("f,G\n" + FDA, {"sided": "one"}, "states no unit of its frequencies"),
    "inverse.csv": ("f (1/s),G\n" + FDA, {"sided": "one"}, "states no unit of its frequencies"),
    "other.csv": ("f (Hz),G (1/Hz)\n" + FDA, {"sided": "one", "per": "rad/s"}, "state --per Hz"),
    "called.csv": ("omega,G (1/Hz)\n" + FDA, {"sided": "one"}, "frequencies called omega; state --per Hz"),
    "volts.csv": ("f (Hz),G (V^2/Hz)\n" + FDA, {**ONE, "of": "acceleration"}, r'the unit "V\^2/Hz"'),
    "no density.csv": ("f (Hz),G (m/s^2)\n" + FDA, ONE, "in the column G has the unit"),
    "kilo.csv": ("f (kHz),G (1/Hz)\n" + FDA, ONE, 'has the unit "kHz" of the column f; must be Hz, rad/s'),
    "t.csv": ("t (s),G (1/Hz)\n" + FDA, ONE, "over times, in the column t, so that it is a record"),
    "time.csv": ("time,G\n" + FDA, ONE, "over times, in the column time, so that it is a record"),
    "f.csv": ("f (Hz),G\n" + FDA, {**ONE, "column": "f"}, "frequencies or times in the column f; state one of G"),
    "one.csv": ("x\n" + rows(X), {"sided": "one"}, r"write a column of frequencies, such as f \(Hz\), beside it$"),
    "channels.csv": ("f (Hz),1,2,3,4,5\n" + rows(F, *[D] * 5), ONE, f"several columns of values; {COLUMN}"),
    "on its side.txt": (  # a row for each time, as buoys write them
        "#YY MM DD " + rows(*F[:, None], separator=" ") + 3 * rows(["2026 03 01"], *D[:, None], separator=" "),
        ONE,
        "several columns of values",
    ),
}  # fmt: skip
BAD_MODES = {
    "percent.csv": ("Fn,Xi\n2.0,1.5\n", {}, r"0.01 is 1 %"),
    "no frequency.csv": ("mode,Xi\n1.0,0.1\n", {}, "no column of natural frequencies, such as Fn"),
}
READERS = {
    "record": (read_record, BAD_RECORDS),
    "spectrum": (read_spectrum, BAD_SPECTRA),
    "modes": (read_modes, BAD_MODES),
}
REFUSED = [(kind, name) for kind, (_, table) in READERS.items() for name in table]


@pytest.mark.parametrize(("kind", "name"), REFUSED)
def test_file_that_cannot_be_read_is_refused_in_one_sentence(kind, name, tmp_path):
    read, table = READERS[kind]
    content, options, said = table[name]
    path = written(tmp_path, name, content)
    with pytest.raises(FpsolveError, match=said) as found:
        read(path, **options)
    assert "\n" not in str(found.value)
    assert str(found.value).startswith(str(path))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.csv", "no such file"),
        ("", "ending"),
        ("pipe.csv", "a pipe or a device"),
        ("large.csv", "has 67108865 bytes, and .* has at most 67108864"),
    ],
)
def test_what_is_no_file_is_refused(name, said, tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    with (tmp_path / "large.csv").open("wb") as file:
        file.truncate(2**26 + 1)
    with pytest.raises(FpsolveError, match=said):
        read_spectrum(tmp_path / name, per="Hz", sided="one")


@pytest.mark.slow
@pytest.mark.parametrize("name", sampled("savetxt.csv", *RECORDS, *SPECTRA, keep=0))
def test_damaged_file_is_read_or_refused_in_one_sentence(name, tmp_path):
    """Bits that have turned, bytes that are gone or added, and files that are cut."""
    rng, said = np.random.default_rng(len(name)), ""
    content = (SPECTRA.get(name) or RECORDS[name])[0]
    good = content.encode() if isinstance(content, str) else content
    for _ in range(1 if name.endswith(".mat") else 5):  # which a process of its own reads
        damaged, new = bytearray(good), bytes(rng.integers(0, 256, rng.integers(1, 40)).astype("u1"))
        place = int(rng.integers(len(damaged)))
        damaged[place] ^= 1 << int(rng.integers(8))
        end = (place, place + 1, place + len(new), len(damaged))[rng.integers(4)]
        damaged[place:end] = (b"", new, b"\xff" * len(new))[rng.integers(3)]
        path = written(tmp_path, f"damaged.{name.rpartition('.')[2]}", bytes(damaged))
        try:
            found = read_spectrum(path, per="Hz", sided="one") if name in SPECTRA else read_record(path, rate=RATE)
            assert np.all(np.isfinite(found.density if name in SPECTRA else found.values))
        except FpsolveError as error:
            said += str(error)
    assert "\n" not in said
