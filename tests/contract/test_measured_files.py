"""Files of measurements as people have them: each is read as the numbers that it holds, or refused in one sentence.

The files are made here in the shapes of loggers, programs and buoys; none is of others.
"""

import io
import json
import math
import os
import re
import struct

import h5py
import nptdms
import numpy as np
import obspy
import pandas as pd
import pytest
import xarray as xr
from scipy.io import savemat, wavfile
from scipy.signal import lfilter

from fpsolve import FpsolveError
from fpsolve.measured import read_record, read_spectrum
from tests.conftest import sampled
from tests.kit import run

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


def hdf(named, **about):
    """Data sets of HDF5, as MATLAB 7.3 writes them, too."""
    file = io.BytesIO()
    with h5py.File(file, "w", userblock_size=512) as opened:
        for name, values in named.items():
            opened[name] = values
            opened[name].attrs.update(about)
    return file.getvalue()


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


def comma(*columns, separator=";"):
    """Lines of numbers as much of Europe writes them."""
    return rows(*columns, separator=separator).replace(".", ",")


def labview(unit="g", x_columns="No"):
    head = f"LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\t{x_columns}\n"
    block = f"Channels\t1\t\t\nSamples\t{T.size}\t\t\nY_Unit_Label\t{unit}\t\t\nX_Dimension\tTime\t\t\n"
    end = "***End_of_Header***"
    first = [""] * T.size if x_columns == "No" else T
    steps = f"X0\t0.0E+0\t\t\nDelta_X\t{1 / RATE}\t\t\n{end}\t\t\t\nX_Value\tAcc\tComment\n"
    return f"{head}{end}\t\n\t\n{block}{steps}{rows(first, X, separator=chr(9))}"


def tdms():
    about = {"unit_string": "g", "wf_increment": 1 / RATE}

    def write(file):
        with nptdms.TdmsWriter(file) as writer:
            writer.write_segment([nptdms.ChannelObject("tower", "top", X, about)])

    return saved(write)


def seismic(**options):
    trace = obspy.Trace(X, {"sampling_rate": RATE, "station": "TOP"})
    return saved(lambda file: obspy.Stream([trace]).write(file, **options))


def of_knet():
    """Values of 1/64 m/s² along rows, by the factor of the header."""
    head = (
        "Origin Time       2018/01/24 19:51:00\nLat.              41.0\nLong.             142.5\nDepth. (km)       30\n"
        "Mag.              6.2\nStation Code      X\nStation Lat.      41.4\nStation Long.     141.4\n"
        "Station Height(m) 30\nRecord Time       2018/01/24 19:51:37\nSampling Freq(Hz) 50Hz\nDuration Time(s)  41\n"
        "Dir.              E-W\nScale Factor      100(gal)/64\nMax. Acc. (gal)   11.971\n"
        "Last Correction   2018/01/24 19:51:37\nMemo.\n"
    )
    return head + along(np.round(64 * X).astype(int))


def along(values, count=8):
    """Values that follow each other along rows."""
    return "".join("".join(f"{each:12}" for each in values[i : i + count]) + "\n" for i in range(0, len(values), count))


def table(write, *columns):
    frame = pd.DataFrame(dict(columns))
    return saved(lambda file: getattr(frame, write)(file, index=False))


TXA = rows(T, X)
SLIST = f"TIMESERIES XX_STA__HNZ_D, {T.size} samples, 50 sps, 2026-03-01T12:00:00.000000, SLIST, FLOAT, M/S**2\n"
JITTER = T + 0.04 * np.sin(np.arange(T.size)) / RATE
KNET = of_knet()
BLANK = [""] * T.size
SCOPE = (
    ["Sample Interval", "Vertical Units", *BLANK[2:]],
    ["2.0e-02", "V", *BLANK[2:]],
    BLANK,
)
UNSAID = {"time_unit": "s", "unit": "g"}
RECORDS = {
    # name: (text or bytes, what the numbers are in m/s², what the file does not state)
    "savetxt.csv": ("# t (s),a (g)\n" + TXA, G, {}),
    "savetxt_spaces.txt": ("# t (s) a (g)\n" + rows(T, X, separator=" "), G, {}),
    "percent.dat": ("% made by a program\n% time [s]\ta [m/s^2]\n" + rows(T, X, separator="\t"), 1.0, {}),
    "quotients.csv": ("Time / ms,Acc / g\n" + rows(1000 * T, X), G, {}),
    "quotients in brackets.csv": ("t / s,a / (cm/s^2)\n" + TXA, 0.01, {}),
    "ends of names.csv": ("Time_ms,acc_x_g\n" + rows(1000 * T, X), G, {"unit": "g"}),
    "no units.csv": ("time,a_g\n" + TXA, G, UNSAID),
    "unix ms.csv": ("time,a (g)\n" + rows(unix(1e3), X), G, {"time_unit": "ms"}),
    "unix ns.csv": ("timestamp_ns,a (g)\n" + rows(unix(1e9), X), G, {}),
    "unix us.csv": ("stamp,a (g)\n" + rows(unix(1e6), X), G, {"over": "stamp", "time_unit": "us"}),
    "unix.csv": ("time (s),a (g)\n" + rows(unix(digits=3), X), G, {}),
    "millis.csv": ("millis,ax (g)\n" + rows(np.round(1000 * T), X), G, {}),
    "elapsed.csv": ("time,seconds_elapsed,z\n" + rows(unix(1e9), T, X), G, {"column": "z", "unit": "g"}),
    "slashes.txt": ("// t (s); a (cm/s2)\n" + rows(T, X, separator=";"), 0.01, {}),
    "openfast.out": (
        "\nPredictions were generated on 01-Mar-2026 at 12:00:00 using OpenFAST\nlinked with NWTC Library\n\n"
        "Description: a tower\n\n\nTime\tTwHt1ALxt\tYawPzn\n(s)\t(m/s^2)\t(deg)\n" + rows(T, X, 0 * X, separator="\t"),
        1.0,
        {"column": "TwHt1ALxt"},
    ),
    "toa5.dat": (
        '"TOA5","Tower","CR6","1234","CR6.Std.10.02","CPU:vib.CR6","55555","fast"\n"TIMESTAMP","RECORD","acc","air"\n'
        '"TS","RN","m/s^2","°C"\n"","","Smp","Smp"\n'
        + rows([f'"{each[:-1].removesuffix("0").removesuffix(".0")}"' for each in iso(" ")], range(T.size), X, T),
        1.0,
        {"column": "acc"},
    ),
    "hobo.csv": (
        '"Plot Title: tower"\n"#","Date Time, GMT+00:00","a (m/s^2)","Stopped"\n'
        + rows(range(1, T.size + 1), map(of_hobo, iso(" ")), X, [""] * T.size),
        1.0,
        {"column": "a"},
    ),
    "oscilloscope.csv": (
        "Model,MSO5\nFirmware,1.2\nPoint Format,Y\nHorizontal Scale,0.2\n\nTIME,CH1 (V)\ns,V\n" + TXA,
        2.5,
        {"unit": "m/s^2", "scale": 2.5},
    ),
    "oscilloscope_units.csv": ("Source,CH1\nSecond,Volt\nx-axis,CH1\ns,m/s^2\n" + TXA, 1.0, {}),
    "words for units.csv": ("x-axis,1\nsecond,Volt\n" + TXA, 3.0, {"unit": "m/s^2", "scale": 3.0}),
    "scope of columns.csv": (
        rows(*SCOPE, T, X, BLANK),
        G,
        {"column": "5", "rate": RATE, "unit": "g"},
    ),
    "scope of counts.csv": (
        "X,CH1,Start,Increment,\nSequence,Volt,-3.5e-03,2.0e-02,\n" + rows(range(T.size), X, [""] * T.size),
        G,
        {"column": "2", "rate": RATE, "unit": "g"},
    ),
    "pico.csv": ("Time,Channel A\n(ms),(g)\n\n" + rows(1000 * T, X), G, {}),
    "pandas.csv": (",t (s),a (g)\n" + rows(range(T.size), T, X), G, {"column": "a"}),
    "pandas_times.csv": (",a (g)\n" + rows(iso(" "), X), G, {}),
    "iso.csv": ("time,a (m/s^2)\n" + rows(iso(), X), 1.0, {}),
    "iso_zone.csv": ("time,a (m/s^2)\n" + rows([f"{each}+01:00" for each in iso()], X), 1.0, {}),
    "iso_two_words.txt": ("date;a (m/s²)\n" + rows(iso(" "), X, separator=";"), 1.0, {}),
    "arrow.txt": (rows(iso(), ["->"] * T.size, X, separator=" "), G, {"column": "3", "unit": "g"}),
    "clock.csv": ("time,a (mm/s^2)\n" + rows([each[11:] for each in iso()], X), 1e-3, {}),
    "milliseconds.csv": ("t [ms],a [g]\n" + rows(np.round(1000 * T), X, form="{:.9g}"), G, {}),
    "excel.csv": ("sep=;\nt (s);a (g)\n" + rows(T, X, separator=";"), G, {}),
    "shimmer.csv": ('"sep=\t"\nStamp\tAccel\nms\tm/(s^2)\n' + rows(1000 * T, X, separator="\t"), 1.0, {}),
    "trailing.csv": ("t (s),a (g),\n" + rows(T, X, [""] * T.size), G, {}),
    "fortran.dat": (" t(s)  a(g)\n" + rows(T, X, separator="  ", form="{:.8E}").replace("E", "D"), G, {}),
    "letters.csv": ("TIME,CH1\ns,g\n" + TXA, G, {}),
    "channels.csv": ("t (s),1,2,3,4,5,6\n" + rows(T, *[0 * T] * 5, X), G, {"column": "6", "unit": "g"}),
    "channels below.csv": (
        "t (ms),a (V),b (g)\nChannel,1,2\n" + rows(1000 * T, 0 * X, X),
        G,
        {"names": "t (ms),a (V),b (g)", "column": "b"},
    ),
    "bare.txt": (rows(X), G, {"rate": RATE, "unit": "g"}),
    "strain.txt": ("# 41 s of strain\n# sampled at 50 Hz\n" + rows(X), G, {"rate": RATE, "unit": "g"}),
    "preamble_numbers.txt": ("station 17\n3 4 5\nt (s) a (g)\n" + rows(T, X, separator=" "), G, {}),
    "words.csv": ("t (s),a (g),state\n" + rows(T, X, ["ok"] * T.size), G, {"column": "a"}),
    "quoted.csv": ('"t (s)","a (g)"\n' + rows(T, X, form='"{:.7g}"'), G, {}),
    "crlf.csv": (("t (s),a (g)\n" + TXA).replace("\n", "\r\n"), G, {}),
    "mark.csv": ("\ufefft (s),a (g)\n" + TXA, G, {}),
    "latin.csv": (("Mesure à 5 °C\nt (s),a (m/s²)\n" + TXA).encode("latin-1"), 1.0, {}),
    "commas.csv": ("Zeit (s);Beschleunigung (g)\n" + comma(T, X), G, {}),
    "commas and tabs.txt": ("Zeit (s)\tBeschleunigung (g)\n" + comma(T, X, separator="\t"), G, {}),
    "jitter.csv": ("t (s),a (g)\n" + rows(JITTER, X), G, {}),
    "motion.AT2": (peer(X), G, {"by": "rows", "rate": RATE, "unit": "g", "skip": 4}),
    "unidades.txt": ("UNIDADES DE LOS DATOS : Gal\n N00E N90E\n" + rows(X, -X, separator=" "), 0.01,
                     {"column": "N00E", "rate": RATE, "unit": "Gal"}),
    "knet.EW": (KNET, 1.0, {}),
    "knet.txt": (KNET, 1.0, {}),
    "rows.txt": ("Scale Factor 1(gal)/64\n" + along(np.round(64 * X).astype(int)), 0.01,
                 {"by": "rows", "rate": RATE, "unit": "gal", "scale": 1 / 64}),
    "slist.ascii": (SLIST + along(X, 6), 1.0, {}),
    "tower.mseed": (seismic(format="MSEED"), 1.0, {"unit": "m/s^2"}),
    "tower.sac": (seismic(format="SAC"), 1.0, {"unit": "m/s^2"}),
    "labview.lvm": (labview(), G, {}),
    "labview x.lvm": (labview(x_columns="One"), G, {}),
    "tower.tdms": (tdms(), G, {}),
    "skipped.csv": ("t (s),a (g)\nx,y\n" + TXA, G, {"skip": 2, "rate": RATE, "column": "2", "unit": "g"}),
    "named.csv": ("x,y\n" + TXA, G, {"names": "t (s),a (g)"}),
    "58.unv": (uff(1, T, X, "g"), G, {}),
    "58b.uff": (uff(1, T, X, "g", is_binary=True), G, {}),
    "58b_crlf.uff": (uff(1, T, X, "g", "\r\n", is_binary=True), G, {}),
    "bext.wav": (
        wav((b"bext", b"station" * 40), (b"cue ", b"\0" * 28), (b"id3 ", b"ID3" + b"x" * 30)),
        G,
        {"unit": "g", "scale": 4.0},
    ),
    "two bytes.wav": (wav(values=(X / 4 * 2**15).astype("<i2")), 1.0, {"unit": "m/s^2", "scale": 4.0}),
    "one byte.wav": (wav(values=(X / 2 * 2**7 + 2**7).astype("u1")), 1.0, {"unit": "m/s^2", "scale": 2.0}),
    "stereo.wav": (
        wav(values=np.column_stack([0 * X, X]).astype("<f4")), 1.0, {"column": "channel 2", "unit": "m/s^2"}
    ),
    "matlab.mat": (matlab(), G, UNSAID),
    "compressed.mat": (matlab(do_compression=True), G, UNSAID),
    "matlab4.mat": (matlab(format="4"), G, UNSAID),
    "struct.mat": (saved(lambda file: savemat(file, {"tower": {"t": T, "a": X, "note": "text"}})), G,
                   {"over": "tower.t", **UNSAID}),
    "level 7.3.mat": (hdf({"a": X[:, None], "t": T[:, None]}), G, UNSAID),
    "strain.h5": (hdf({"strain/Strain": X}, units="g"), G, {"rate": RATE}),
    "plain.npy": (arrays(np.save, arr=np.column_stack([T, X])), G, {"over": "1", **UNSAID}),
    "values.npy": (arrays(np.save, arr=np.r_[9.0, X]), 1.0, {"rate": RATE, "skip": 1, "unit": "m/s^2"}),
    "datetime.nc": (
        netcdf(
            {"a": ("time", X, {"units": "m s-2"})},
            {"time": np.datetime64("2026-03-01T00:00") + np.round(1e9 * T).astype("timedelta64[ns]")},
        ),
        1.0,
        {},
    ),
    "cf.nc": (netcdf({"a": ("t", X, {"units": "g"})}, {"t": ("t", T, {"units": "seconds"})}), G, {}),
    "sheet.xlsx": (table("to_excel", ("t (s)", T), ("a (g)", X)), G, {}),
    "table.parquet": (table("to_parquet", ("t (s)", T), ("a (g)", X)), G, {}),
}  # fmt: skip
SPREAD = np.cos(np.radians(np.arange(0.0, 360.0, 15.0))) ** 2 / 180
ALL_WAYS = np.array([0.9 * D, 1.1 * D])[:, :, None] * SPREAD
WAVES = netcdf(
    {"efth": (("time", "freq", "dir"), ALL_WAYS, {"units": "m^{2}.s.degree^{-1}"})},
    {"time": [0.0, 1.0], "freq": ("freq", F, {"units": "Hz"}), "dir": np.arange(0.0, 360.0, 15.0)},
)  # fmt: skip
"""As wavespectra has them: over times, frequencies and directions."""
PLAIN = {"of": "stiffness", "per": "Hz", "unit": "1/Hz"}
UNITS = {
    ("(m/s^2)^2/Hz", "acceleration"): 1.0,
    ("g²/Hz", "acceleration"): G**2,
    ("m²/s⁴/Hz", "acceleration"): 1.0,
    ("(m/s2)^2/Hz", "acceleration"): 1.0,
    ("g2/Hz", "acceleration"): G**2,
    ("m2 s-4 Hz-1", "acceleration"): 1.0,
    ("m2 s-3", "acceleration"): 1.0,
    ("m2/Hz", "height"): 1.0,
    ("m*m/Hz", "height"): 1.0,
    ("cm²/Hz", "height"): 1e-4,
    ("%^2/Hz", "stiffness"): 1e-4,
    ("1/s²/Hz", "damping"): 1.0,
}
FDA = rows(F, D)
ZERO = np.r_[0.0, D]
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
    "kilohertz.csv": ("f (kHz),G (g^2/Hz)\n" + rows(F / 1000, D), G**2, {}),
    "stated.csv": ("f (Hz),G\n" + FDA, G**2, {"unit": "g^2/Hz"}),
    "root.txt": (rows(F, np.sqrt(D), form="{:.17g}"), G**2, {"over": "1", "per": "Hz", "unit": "g/sqrt(Hz)"}),
    "columns.csv": ("n,f (Hz),lower,G ((m/s^2)^2/Hz)\n" + rows(F, F, D, D), 1.0, {"column": "G"}),
    "channels.csv": (
        "f (Hz),1,2,3,4,5\n" + rows(F, F, F, D, F, F), 1.0, {"of": "stiffness", "column": "3", "unit": "1/Hz"}
    ),
    "falling.csv": ("f (Hz),G (g^2/Hz)\n" + rows(F[::-1], D[::-1]), G**2, {}),
    "zeros.csv": ("f (Hz),G (g^2/Hz)\n" + rows(np.r_[0.01, F], ZERO), G**2, {}),
    "buoy.sp": (
        "Station: X\nfreq Band energy\nHz width m*m/Hz deg\n" + rows(np.r_[0.01, F], np.r_[0, F], ZERO, separator=" "),
        1.0,
        {"of": "height", "column": "energy", "per": "Hz", "unit": "m^2/Hz"},
    ),
    "jcamp.jdx": (f"##XUNITS=HZ\n##XYPOINTS=(XY..XY)\n{FDA}##END=\n", 1.0, {"over": "1", **PLAIN}),
    "omega.csv": ("omega (rad/s),G ((m/s^2)^2*s/rad)\n" + rows(2 * np.pi * F, D, form="{:.17g}"), 2 * np.pi, {}),
    "hertz called omega.csv": ("omega,G (1/Hz)\n" + FDA, 1.0, PLAIN),
    "plain.npy": (arrays(np.save, arr=np.column_stack([F, D])), 1.0, {"over": "1", **PLAIN}),
    "named.npz": (arrays(f=F, G=D), 1.0, PLAIN),
    "named.mat": (saved(lambda file: savemat(file, {"f": F, "G": D, "note": "text"})), 1.0, PLAIN),
    "units.nc": (
        netcdf({"G": ("f", D, {"units": "1/Hz"})}, {"f": ("f", F, {"units": "Hz"})}), 1.0, {"of": "stiffness"}
    ),
    "classic.nc": (
        netcdf({"G": (("time", "f"), D[None])}, {"f": F, "time": [0.0]}, "scipy"), 1.0, {"column": "G", **PLAIN}
    ),
    "plain.uff": (uff(9, F, D), 1.0, PLAIN),
    "crlf.uff": (uff(9, F, D, "g^2/Hz", "\r\n"), G**2, {}),
}  # fmt: skip


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("name", RECORDS)
def test_record_of_a_logger_has_its_values_and_its_step(name, tmp_path):
    content, factor, options = RECORDS[name]
    found = read_record(written(tmp_path, name, content), of="acceleration", **options)
    assert found.step == pytest.approx(1 / RATE, rel=1e-6 if name == "jitter.csv" else 1e-9)
    assert found.values == pytest.approx(factor * (X - X.mean()), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", SPECTRA)
def test_spectrum_of_a_program_has_its_frequencies_and_its_densities(name, tmp_path):
    """S = G/2 of a one-sided density per Hz."""
    content, factor, options = SPECTRA[name]
    found = read_spectrum(written(tmp_path, name, content), **{"sided": "one", "of": "acceleration", **options})
    assert found.frequencies == pytest.approx(2 * math.pi * F, rel=1e-9)
    assert found.density == pytest.approx(0.5 * factor * D, rel=1e-9)
    assert bool(found.notes) == ("zeros" in name or "buoy" in name)


KINDS = {"record": (read_record, RECORDS), "spectrum": (read_spectrum, SPECTRA)}
STATED = [
    (kind, name, left)
    for kind, (_, table) in KINDS.items()
    for name, (_, _, options) in table.items()
    for left in options.keys() - {"of", "names", "scale", "skip"}
]


@pytest.mark.parametrize(("kind", "name", "left"), sampled(*sorted(STATED), keep=20))
def test_nothing_that_changes_a_number_is_assumed(kind, name, left, tmp_path):
    """What a file does not state, and nobody does, is refused; or the number is right without it."""
    read, table = KINDS[kind]
    content, factor, options = table[name]
    more = {"of": "acceleration", **({"sided": "one"} if kind == "spectrum" else {}), **options}
    del more[left]
    said, found = "", None
    try:
        found = read(written(tmp_path, name, content), **more)
    except FpsolveError as error:
        said = str(error)
    if found is None:
        assert re.search("--(column|unit|time-unit|rate|over|per|by|scale|names)|remove the row", said)
        assert "\n" not in said
    else:
        values, right = (found.density, D / 2) if kind == "spectrum" else (found.values, X - X.mean())
        assert values == pytest.approx(factor * right, rel=1e-9, abs=1e-12)
        assert kind == "spectrum" or found.step == pytest.approx(1 / RATE, rel=1e-9)


@pytest.mark.parametrize("shift", [0.0, EPOCH])
def test_times_that_are_not_quite_even_are_taken_with_a_note(shift, tmp_path):
    even = shift + np.arange(1000) / 30
    for times in ([f"{each:.2f}" for each in even], even + 1e-3 * np.sin(np.arange(1000))):
        text = "t (s),a (g)\n" + rows(times, X[:1000], form="{:.14g}")
        found = read_record(written(tmp_path, "a.csv", text), of="acceleration")
        assert found.step == pytest.approx(1 / 30, rel=1e-4)
        assert re.search(r"a step off even ones, and the mean step 0\.033\d* s is taken; --rate", *found.notes)


SAME = ("sheet.xlsx", "table.parquet", "matlab.mat", "matlab4.mat", "struct.mat", "bext.wav", "cf.nc", "58.unv",
        "tower.tdms", "tower.mseed", "knet.EW", "labview.lvm", "commas.csv")  # fmt: skip
"""Of each format one: its verdict is that of savetxt.csv."""


@pytest.mark.parametrize("name", sampled(*SAME, keep=3))
def test_same_record_in_another_format_has_the_same_verdict(name, tmp_path):
    def verdict(name):
        content, factor, options = RECORDS[name]
        stated = options | {"scale": options.get("scale", 1.0) * G / factor}
        words = [f"--{key.replace('_', '-')}={each}" for key, each in stated.items()]
        path = written(tmp_path, name, content)
        system = ["--of", "acceleration", "--frequency", "2", "--damping-ratio", "0.01", "--kind", "filter", "--json"]
        ended = run(tmp_path, "noise", "--record", path.name, *words, *system)
        assert ended.code == 0, ended.err
        found = json.loads(ended.out)
        return [found[key]["value"] for key in ("lyapunov_exponent", "second_moment")]

    assert verdict(name) == pytest.approx(verdict("savetxt.csv"), rel=1e-9)


GAP = np.r_[0:1000, 1500:2048]
HALF = np.sort(np.random.default_rng(0).permutation(2048)[:1024])
DAMAGED = bytearray(arrays(np.savez_compressed, f=F))
DAMAGED[60:100] = b"\xff" * 40
COMMAS = rows(X, form="{:.3f}").replace(".", ",")
COLUMN = "state one by --column"
BAD_RECORDS = {
    # name: (content, options, what is said)
    "one column of commas.csv": (COMMAS, {"rate": RATE}, "has 2 columns of values"),
    "a name over commas.csv": ("acc\n" + COMMAS, {"rate": RATE}, "has 2 columns of values"),
    "rows.csv": ("Scale Factor 3920(gal)/6182761\n" + along(range(800)), {"rate": RATE}, f"{COLUMN}, or --by rows"),
    "days.csv": ("t,a\n" + rows(["01.03.2026 12:00:00"] * 99, X[:99]), {}, "do not increase"),
    "clock of two.csv": ("t,a (g)\n" + rows([f"00:{k:02d}" for k in range(60)], X[:60]), {}, "no unit of the times"),
    "clock of commas.csv": (
        "t;a (g)\n" + rows([f"12:00:{k:02d},5" for k in range(60)], X[:60], separator=";"), {}, "no unit of the times"
    ),
    "mixed.csv": ("t (s);a (g)\n" + rows(T, [f"{x:.2f}".replace(".", ",") for x in X], separator=";"), {}, "one dec"),
    "names like units.csv": ("Station,MM01\nt,h\n" + TXA, {"rate": RATE, "column": "Station"}, 'no column "Station"'),
    "limits.txt": ("Sensor range / g\nPeak value 0.34 (g)\n" + rows(X), {"rate": RATE}, "no unit of the column 1"),
    "twice.csv": ("t (s),a (g)\n" + rows(T[np.r_[:1000, 999:2047]], X), {}, "uneven steps"),
    "a text.npy": (arrays(np.save, arr=X), {"names": "a (g)"}, "is no text, of which --names"),
    "gap.csv": ("t (s),a (g)\n" + rows(T[GAP], X[GAP]), {}, r"uneven steps, 10.02 s at line 1002"),
    "gap unix.csv": ("t (s),a (g)\n" + rows(unix(1, 3, T[GAP]), X[GAP]), {}, r"uneven steps, 10.02 s at line 1002"),
    "half is missing.csv": ("t (s),a (g)\n" + rows(unix(1, 3, T[HALF]), X[HALF]), {}, "uneven steps"),
    "a gap of rounded times.csv": (
        "t (s),a (g)\n" + rows([f"{k / 30:.2f}" for k in range(1000) if k != 500], X[:999]), {}, "uneven steps"
    ),
    "back.csv": ("t (s),x (g)\n" + rows(T[::-1], X), {}, "do not increase"),
    "standing.csv": ("t (s),x (g)\n" + rows(0 * T, X), {}, "do not increase"),
    "whole seconds.csv": ("t (s),a (g)\n" + rows([f"{int(t)}" for t in T], X), {}, "state --rate"),
    "no unit.csv": ("t (s),a\n" + TXA, {}, r"no unit of the column a; state --unit, such as m/s\^2"),
    "a name with a unit.csv": ("t (s),acc_g\n" + TXA, {}, r"no unit of the column acc_g \(it has 'acc_g'\)"),
    "gal.txt": (
        "UNIDADES DE LOS DATOS : Gal\nN00E N90E\n" + rows(X, -X, separator=" "),
        {"rate": RATE, "column": "N00E"},
        r"\(it has 'UNIDADES DE LOS DATOS : Gal'\); state --unit",
    ),
    "no unit of times.csv": ("t,a (g)\n" + TXA, {}, "no unit of the times t; state --time-unit, such as s or ms"),
    "unix.csv": ("time,a (g)\n" + rows(unix(1e3), X), {}, "no unit of the times time; state --time-unit"),
    "counter.csv": ("Sample,a (g)\n" + rows(range(T.size), X), {"column": "a"}, "no times of its values; state --rate"),
    "rate.csv": ("# 50 Hz\n" + rows(X), {}, r"\(it has '50 Hz'\); state --rate, in values per second"),
    "volts.csv": ("t (s),a (V)\n" + TXA, {}, r"state --unit m/s\^2 and --scale, how many m/s\^2 one V stands for"),
    "other signal.csv": ("t (s),a (mm)\n" + TXA, {}, "or another --of"),
    "decibel.csv": ("t (s),a (dB)\n" + TXA, {}, r'the unit "dB", which is not known; its values are levels'),
    "prose.txt": ("nothing was measured today\nnor tomorrow\n", {}, "has no table of numbers"),
    "value.csv": (f"t (s),a (g)\n{TXA}{T[-1] + 1 / RATE},nan\n", {}, 'has "nan" in the column a, line 2050'),
    "several.csv": ("t,left,right\n" + rows(T, X, X), {}, f"has 2 columns of values; {COLUMN}"),
    "misspelt.csv": (
        "t,left,right\n" + rows(T, X, X),
        {"column": "rigth"},
        r'no column "rigth"; did you mean "right"\? there are left, right',
    ),
    "one.csv": ("x\n" + rows(X), {}, "no times of its values; state --rate"),
    "names.csv": ("t (s),a (g)\n" + TXA, {"names": "t (s),a (g),b (g)"}, ":2: has 2 columns, and others are named"),
    "spectrum.uff": (uff(9, F, D), {}, COLUMN),
}  # fmt: skip
ONE = {"sided": "one", "per": "Hz"}
BAD_SPECTRA = {
    "empty.csv": (b"", ONE, "is empty"),
    "binary.csv": (b"\0\1\2", ONE, "is binary"),
    "one line.csv": ("f,G\n", ONE, "has no table of numbers"),
    "long row.csv": ("f,G\n1,2\n2,3\n3,4,5\n6,7\n7,8\n", ONE, r":4: is no table of 2 columns"),
    "short row.csv": ("f,G\n1,2\n2,3\n3\n4,5\n5,6\n", ONE, ":4: is no table of 2 columns"),
    "word.csv": ("f,G\n1,2\n3,x\n4,5\n5,6\n", {"unit": "1/Hz", **ONE}, 'has "x" in the column G, line 3; write a'),
    "trailer.csv": ("f,G\n1,2\n3,4\n4,5\nMean,3.7\n", ONE, ":5: is no table of 2 columns of numbers"),
    "quote.csv": ('f,G,n\n1,2,a\n3,4,"b\n4,5,"c\n5,6,d\n6,7,e\n', ONE, "is no table of 3 columns"),
    "rpm.csv": ("f (rpm),G (1/Hz)\n" + FDA, {"sided": "one"}, 'has the unit "rpm", which is not known'),
    "periods.csv": ("T (s),G (1/Hz)\n" + FDA, {"sided": "one", "over": "T"}, 'has the unit "s", and not Hz'),
    "two frequencies.csv": ("low (Hz),f (Hz),G (1/Hz)\n" + rows(F, F, D), {**ONE, "column": "G"}, "2 columns of frequ"),
    "arithmetic.csv": ("f (Hz),10 log10 G (1/Hz)\n" + FDA, ONE, "no unit of the column 10 log10 G"),
    "two units.csv": ("f (Hz),G (g^2/Hz)\nHz,1/Hz\n" + FDA, ONE, "no unit of the column G"),
    "complex.npz": (arrays(f=F, S=D + 1j, coherence=D), ONE, f"has 2 columns of values; {COLUMN}"),
    "sizes.npz": (arrays(f=F, S=D[1:]), {"unit": "1/Hz", **ONE}, "has 160 frequencies in f and 159 values in S"),
    "twice.csv": ("f,f\n1,2\n2,3\n", ONE, 'two columns called "f"'),
    "twice.npz": (arrays(**{"G (g)": D, "G (m)": D}), ONE, 'two columns called "G"'),
    "archive.npy": (arrays(np.save, arr=np.array("text")), ONE, "has no columns of real numbers"),
    "huge.npy": (npy_header((2**40,)), ONE, "is no file that numpy reads .*allocate"),
    "short.npy": (npy_header((1000,)) + b"12345678", ONE, "is no file that numpy reads"),
    "text.npy": (b"no numpy", ONE, "is no file that numpy reads"),
    "text.npz": (b"PK\3\4 no zip", ONE, "is no file that numpy reads"),
    "damaged.npz": (bytes(DAMAGED), ONE, "is no file that numpy reads"),
    "texts.npz": (arrays(f=np.array(["a"])), ONE, "has no columns of real numbers"),
    "objects.npy": (arrays(np.save, arr=np.array([{}], dtype=object)), ONE, "Object arrays cannot be loaded"),
    "record.wav": (wav(), ONE, "or a record by --record"),
    "text.wav": (b"RIFF" + struct.pack("<I", 4) + b"none", ONE, "is no file that scipy reads"),
    "text.mat": (b"x" * 200, ONE, "is no file that scipy reads"),
    "new.mat": (b"MATLAB 7.3 MAT-file" + b" " * 200, ONE, "is no file that scipy reads"),
    "text.nc": (b"CDF\1" + b"x" * 100, ONE, "is no file that xarray reads"),
    "hdf.nc": (b"\x89HDF\r\n\x1a\n" + b"x" * 100, ONE, "is no file that xarray reads"),
    "waves.nc": (WAVES, {"of": "height", "sided": "one"}, "its columns are efth, time, freq, dir"),
    "text.uff": (b"    -1\n    58\nnothing\n    -1\n", ONE, "is no file that pyuff reads"),
    "latin.uff": (uff(9, F, D, "m/s\xb2"), ONE, "which is not known"),
    "a.xlsx": (b"PK", ONE, "is no file that openpyxl reads"),
    "a.parquet": (b"PAR1", ONE, "is no file that pyarrow reads"),
    "a.tdms": (b"TDSm", ONE, "is no file that nptdms reads|has no columns"),
    "a.lvm": (b"LabVIEW Measurement", ONE, "is no file that lvm_read reads"),
    "a.bin": (b"\0\1\2", ONE, "is no file that obspy reads"),
    "sides.csv": ("f (Hz),G (1/Hz)\n" + FDA, {}, "one-sided"),
    "root.txt": (rows(F, np.sqrt(D)), ONE, "has no columns of frequencies; state one by --over"),
    "no density.csv": ("f (Hz),G\n" + FDA, ONE, "no unit of the column G; state --unit, such as 1/Hz"),
    "no unit.csv": ("f,G (s)\n" + FDA, {"sided": "one"}, "no unit of the frequencies f; state --per, Hz or rad/s"),
    "inverse.csv": ("f (1/s),G (s)\n" + FDA, {"sided": "one"}, "no unit of the frequencies f"),
    "other.csv": ("f (Hz),G (1/Hz)\n" + FDA, {"sided": "one", "per": "rad/s"}, "--per and --unit that belong together"),
    "called.csv": ("omega,G (1/Hz)\n" + FDA, {"sided": "one"}, "frequencies omega .* --per and --unit that belong"),
    "volts.csv": ("f (Hz),G (V^2/Hz)\n" + FDA, ONE, r'the unit "V\^2/Hz", which is none of a density'),
    "signal.csv": ("f (Hz),G (m/s^2)\n" + FDA, {"of": "acceleration", **ONE}, r"such as \(m/s\^2\)\^2/Hz"),
    "levels.csv": ("f (Hz),RIN (dBc/Hz)\n" + FDA, ONE, r"values are levels L: convert them, G = 10\^\(L/10\)"),
    "t.csv": ("t (s),G (1/Hz)\n" + FDA, ONE, "or a record by --record; its columns are t, G"),
    "f.csv": ("f (Hz),G\n" + FDA, {**ONE, "column": "f"}, 'no column "f"; there are G'),
    "channels.csv": ("f (Hz),1,2,3,4,5\n" + rows(F, *[D] * 5), ONE, f"5 columns of values; {COLUMN}"),
    "on its side.txt": (  # a row for each time, as buoys write them
        "#YY MM DD " + rows(*F[:, None], separator=" ") + 3 * rows(["2026 03 01"], *D[:, None], separator=" "),
        ONE,
        "has no columns of frequencies",
    ),
    **{  # which would take for ever, or is none
        f"{k}.csv": (f"f (Hz),G [{unit}]\n{FDA}", ONE, "which is not known")
        for k, unit in enumerate(["9**9**9**9", "m^(9)^(9)", "9⁹⁹⁹⁹", "(" * 9, "x" * 50, "__import__"])
    },
}  # fmt: skip
READERS = {"record": (read_record, BAD_RECORDS), "spectrum": (read_spectrum, BAD_SPECTRA)}
REFUSED = [(kind, name) for kind, (_, table) in READERS.items() for name in table]


@pytest.mark.parametrize(("kind", "name"), REFUSED)
def test_file_that_cannot_be_read_is_refused_in_one_sentence(kind, name, tmp_path):
    read, table = READERS[kind]
    content, options, said = table[name]
    path = written(tmp_path, name, content)
    with pytest.raises(FpsolveError, match=said) as found:
        read(path, **({"of": "acceleration"} if kind == "record" else {}), **options)
    assert "\n" not in str(found.value)
    assert str(found.value).startswith(str(path))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.csv", "no such file"),
        ("", "is a directory"),
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
@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, (_, table) in KINDS.items() for name in table][::4])
def test_damaged_file_is_read_or_refused_in_one_sentence(kind, name, tmp_path):
    """Bits that have turned, bytes that are gone or added, and files that are cut."""
    rng, said = np.random.default_rng(len(name)), ""
    read, table = KINDS[kind]
    content, _, options = table[name]
    good = content.encode() if isinstance(content, str) else content
    for _ in range(2):
        damaged, new = bytearray(good), bytes(rng.integers(0, 256, rng.integers(1, 40)).astype("u1"))
        place = int(rng.integers(len(damaged)))
        damaged[place] ^= 1 << int(rng.integers(8))
        end = (place, place + 1, place + len(new), len(damaged))[rng.integers(4)]
        damaged[place:end] = (b"", new, b"\xff" * len(new))[rng.integers(3)]
        path = written(tmp_path, f"damaged.{name.rpartition('.')[2]}", bytes(damaged))
        try:
            found = read(path, **{"of": "acceleration", **({"sided": "one"} if kind == "spectrum" else {}), **options})
            assert np.all(np.isfinite(found.density if kind == "spectrum" else found.values))
        except FpsolveError as error:
            said += str(error)
    assert "\n" not in said
