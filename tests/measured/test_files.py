"""Files as people have them: each tells the same S(2f) as scipy's Welch of its numbers, or what to do.

The files are made here in the shapes of loggers, programs and buoys; none is of others.
"""

import io
import math
import struct

import numpy as np
import pytest
import xarray as xr
from scipy.io import savemat, wavfile
from scipy.signal import lfilter, welch

from fpsolve.errors import FpsolveError
from fpsolve.measured import read_record, read_spectrum, tables
from fpsolve.measured import text as text_tables
from tests.measured.test_reading import uff

RATE, F0 = 50.0, 2.0
"""Samples per second of all records, and the natural frequency in Hz."""
T = np.arange(4096) / RATE
X = np.round(lfilter([0.1], [1, -0.9], np.random.default_rng(1).normal(size=T.size)), 5)
G = 9.80665
F = np.round(np.linspace(0.05, 8.0, 160), 4)
D = np.round(0.3 / (1 + (F - 3) ** 2), 6)
EPOCH = 1_700_000_000.0


def rows(*columns, separator=",", form="{:.7g}"):
    """Lines of numbers."""
    return "\n".join(separator.join(form.format(each) for each in row) for row in zip(*columns, strict=True)) + "\n"


def iso(t, separator="T"):
    stamps = np.datetime64("2026-03-01T23:59:30") + np.round(1000 * t).astype("timedelta64[ms]")
    return [str(each).replace("T", separator) for each in stamps]


def stamped(stamps, values, separator=","):
    return "\n".join(f"{a}{separator}{b:.7g}" for a, b in zip(stamps, values, strict=True)) + "\n"


def saved(write):
    """The bytes that something writes into a file in memory."""
    file = io.BytesIO()
    write(file)
    return file.getvalue()


def wav(*chunks):
    """Sound of 32 bit numbers with further chunks before it."""
    content = saved(lambda file: wavfile.write(file, int(RATE), (X / 4).astype("<f4")))
    more = b"".join(name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2) for name, data in chunks)
    return b"RIFF" + struct.pack("<I", len(content) - 8 + len(more)) + b"WAVE" + more + content[12:]


def netcdf(data):
    return bytes(data.to_netcdf(engine="h5netcdf"))


def peer(name, values, unit="G"):
    lines = [
        f"PEER STRONG MOTION DATABASE {name}",
        "SOMEWHERE, 3/1/2026, STATION 5, 090",
        f"ACCELERATION IN UNITS OF {unit}",
    ]
    cells = [f"{each: .7E}" for each in values]
    body = "\n".join("".join(f"{cell:>16}" for cell in cells[i : i + 5]) for i in range(0, len(cells), 5))
    return "\n".join([*lines, f"NPTS= {len(values)}, DT= {1 / RATE:.4f} SEC", body]) + "\n"


TEXT_RECORDS = {
    # name: (text, what the numbers are in m/s², options)
    "savetxt.csv": ("# t (s),a (g)\n" + rows(T, X), G, {}),
    "savetxt_spaces.txt": ("# t (s) a (g)\n" + rows(T, X, separator=" "), G, {}),
    "percent.dat": ("% made by a program\n% time [s]\ta [m/s^2]\n" + rows(T, X, separator="\t"), 1.0, {}),
    "quotients.csv": ("Time / ms,Acc / g\n" + rows(1000 * T, X), G, {}),
    "quotients in brackets.csv": ("t / s,a / (cm/s^2)\n" + rows(T, X), 0.01, {}),
    "ends of names.csv": ("Time_ms,acc_x_g\n" + rows(1000 * T, X), G, {}),
    "no units.csv": ("time,a_g\n" + rows(T, X), 1.0, {}),
    "unix ms.csv": ("time,a (g)\n" + stamped([f"{1000 * (EPOCH + t):.0f}" for t in T], X), G, {}),
    "unix us.csv": ("stamp,a (g)\n" + stamped([f"{1e6 * (EPOCH + t):.0f}" for t in T], X), G, {}),
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
        + "\n".join(
            f"{i + 1},{each[5:7]}/{each[8:10]}/{each[2:4]} {int(each[11:13]) % 12 or 12:02d}{each[13:]} "
            f"{'PM' if int(each[11:13]) >= 12 else 'AM'},{x:.7g},"
            for i, (each, x) in enumerate(zip(iso(T, " "), X, strict=True))
        ),
        1.0,
        {},
    ),
    "oscilloscope.csv": (
        "Model,MSO5\nFirmware,1.2\nPoint Format,Y\nHorizontal Scale,0.2\n\nTIME,CH1 (V)\ns,V\n" + rows(T, X),
        2.5,
        {"unit": "m/s^2", "scale": 2.5},
    ),
    "oscilloscope_units.csv": ("Source,CH1\nSecond,Volt\nx-axis,CH1\ns,m/s^2\n" + rows(T, X), 1.0, {}),
    "pandas.csv": (
        ",t (s),a (g)\n" + "\n".join(f"{i},{a:.7g},{b:.7g}" for i, (a, b) in enumerate(zip(T, X, strict=True))),
        G,
        {},
    ),
    "pandas_times.csv": (",a (g)\n" + stamped(iso(T, " "), X), G, {}),
    "iso.csv": ("time,a (m/s^2)\n" + stamped(iso(T), X), 1.0, {}),
    "iso_zone.csv": ("time,a (m/s^2)\n" + stamped([f"{each}+01:00" for each in iso(T)], X), 1.0, {}),
    "iso_two_words.txt": ("date;a (m/s²)\n" + stamped(iso(T, " "), X, ";"), 1.0, {}),
    "clock.csv": ("time,a (mm/s^2)\n" + stamped([each[11:] for each in iso(T)], X), 1e-3, {}),
    "unix.csv": ("time (s),a (g)\n" + stamped([f"{EPOCH + t:.3f}" for t in T], X), G, {}),
    "milliseconds.csv": ("t [ms],a [g]\n" + rows(np.round(1000 * T), X, form="{:.9g}"), G, {}),
    "excel.csv": ("sep=;\nt (s);a (g)\n" + rows(T, X, separator=";"), G, {}),
    "trailing.csv": ("t (s),a (g),\n" + rows(T, X).replace("\n", ",\n"), G, {}),
    "fortran.dat": (" t(s)  a(g)\n" + rows(T, X, separator="  ", form="{:.8E}").replace("E", "D"), G, {}),
    "letters.csv": ("TIME,CH1\ns,g\n" + rows(T, X), G, {}),
    "channels.csv": ("t (ms),1,2\n" + rows(1000 * T, 0 * X, X), G, {"unit": "g", "column": "2"}),
    "many channels.csv": ("t,0,1,2,3,4\n" + rows(T, T, T, X, T, T), G, {"unit": "g", "column": "2"}),
    "channels below.csv": ("t (ms),a (V),b (g)\nChannel,1,2\n" + rows(1000 * T, 0 * X, X), G, {"column": "b"}),
    "bare.txt": (rows(X), G, {"rate": RATE, "unit": "g"}),
    "preamble_numbers.txt": ("station 17\n3 4 5\nt (s) a (g)\n" + rows(T, X, separator=" "), G, {}),
    "words.csv": (
        "t (s),a (g),state\n" + "".join(f"{a:.7g},{b:.7g},ok\n" for a, b in zip(T, X, strict=True)),
        G,
        {"column": "a"},
    ),
    "quoted.csv": ('"t (s)","a (g)"\n' + "".join(f'"{a:.7g}","{b:.7g}"\n' for a, b in zip(T, X, strict=True)), G, {}),
    "crlf.csv": (("t (s),a (g)\n" + rows(T, X)).replace("\n", "\r\n"), G, {}),
    "mark.csv": ("\ufefft (s),a (g)\n" + rows(T, X), G, {}),
    "motion.AT2": (peer("A", X), G, {}),
}


def binary_uff(end):
    """Dataset 58b as its format says: lines of text, then numbers of four bytes."""
    axis = f"{17:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}"
    data = X.astype("<f4").tobytes()
    lines = [
        "    -1",
        f"{58:6d}b{1:6d}{2:6d}{11:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}",
        "a",
        *["NONE"] * 4,
        f"{1:5d}{0:10d}{1:5d}{0:10d} {'NONE':10s}{1:10d}{1:4d} {'NONE':10s}{1:10d}{1:4d}",
        f"{2:10d}{X.size:10d}{1:10d}{0.0:13.5e}{1 / RATE:13.5e}{0.0:13.5e}",
        axis,
        f"{12:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'g':20s}",
        axis,
        axis,
        "",
    ]
    return end.join(lines).encode() + data + f"{end}    -1{end}".encode()


TEXT_RECORDS["channels.csv"] = (
    "t," + ",".join(f"{k}" for k in range(1, 7)) + "\n" + rows(T, *[0 * T] * 5, X),
    G,
    {"column": "6", "unit": "g"},
)
BINARY_RECORDS = {
    "58b.uff": (lambda: binary_uff("\n"), G, {}),
    "58b_crlf.uff": (lambda: binary_uff("\r\n"), G, {}),
    "latin.csv": (lambda: ("Mesure à 5 °C\nt (s),a (m/s²)\n" + rows(T, X)).encode("latin-1"), 1.0, {}),
    "bext.wav": (
        lambda: wav((b"bext", b"station" * 40), (b"cue ", b"\0" * 28), (b"id3 ", b"ID3" + b"x" * 30)),
        G,
        {"unit": "g", "scale": 4.0},
    ),
    "matlab.mat": (lambda: saved(lambda file: savemat(file, {"t": T, "a": X})), G, {"unit": "g"}),
    "matlab4.mat": (lambda: saved(lambda file: savemat(file, {"t": T, "a": X}, format="4")), G, {"unit": "g"}),
    "single.mat": (
        lambda: saved(lambda file: savemat(file, {"t": (T + 10).astype("f4"), "a": X})),
        G,
        {"unit": "g"},
    ),
    "plain.npy": (lambda: saved(lambda file: np.save(file, np.column_stack([T, X]))), G, {"unit": "g", "over": "1"}),
    "datetime.nc": (
        lambda: netcdf(
            xr.Dataset(
                {"a": ("time", X, {"units": "m s-2"})},
                {"time": np.datetime64("2026-03-01T00:00") + np.round(1e9 * T).astype("timedelta64[ns]")},
            )
        ),
        1.0,
        {},
    ),
    "cf.nc": (
        lambda: netcdf(xr.Dataset({"a": ("t", X, {"units": "g"})}, {"t": ("t", T, {"units": "seconds"})})),
        G,
        {},
    ),
}


def welch_at(f, x, step, length):
    """G at f: `scipy.signal.welch` with Hann's window and half of the segments overlapping, interpolated."""
    places, density = welch(x, 1 / step, nperseg=length, noverlap=length // 2, detrend="constant")
    return float(np.interp(f, places, density))


@pytest.mark.parametrize("name", [*TEXT_RECORDS, *BINARY_RECORDS])
def test_a_record_as_people_have_it(name, tmp_path):
    path = tmp_path / name
    if name in TEXT_RECORDS:
        text, factor, options = TEXT_RECORDS[name]
        path.write_bytes(text.encode())
    else:
        make, factor, options = BINARY_RECORDS[name]
        path.write_bytes(make())
    found = read_record(path, of="acceleration", **options)
    assert found.step == pytest.approx(1 / RATE, rel=1e-9 if name != "single.mat" else 1e-5)
    single = {"bext.wav": 4.0, "58b.uff": 1.0, "58b_crlf.uff": 1.0}.get(name)  # numbers of four bytes
    x = factor * (X if single is None else single * (X / single).astype("f4").astype(float))
    length = found.segment_length()
    spectrum = found.spectrum(length)
    here = float(np.interp(2 * F0 * 2 * math.pi, spectrum.frequencies, 2 * spectrum.density))
    assert here == pytest.approx(welch_at(2 * F0, x, found.step, length), rel=1e-9)


def waves():
    """As wavespectra has them: over times, frequencies and directions."""
    directions = np.arange(0.0, 360.0, 15.0)
    spread = np.cos(np.radians(directions)) ** 2 / 180
    values = np.array([D * k for k in (0.9, 1.1)])[:, :, None] * spread
    return netcdf(
        xr.Dataset(
            {"efth": (("time", "freq", "dir"), values, {"units": "m^{2}.s.degree^{-1}"})},
            {"time": [0.0, 1.0], "freq": ("freq", F, {"units": "Hz"}), "dir": directions},
        )
    )


SPECTRA = {
    "savetxt.txt": ("# f (Hz) G ((m/s^2)^2/Hz)\n" + rows(F, D, separator=" "), 1.0, {}),
    "units below.csv": ("frequency,PSD\nHz,g^2/Hz\n" + rows(F, D), G**2, {}),
    "udunits.csv": ("f (Hz),G (m2 s-4 Hz-1)\n" + rows(F, D), 1.0, {}),
    "stated.csv": ("f (Hz),G\n" + rows(F, D), G**2, {"unit": "g^2/Hz"}),
    "of the signal.csv": ("f (Hz),G\n" + rows(F, D), G**2, {"unit": "g"}),
    "columns.csv": ("n,f (Hz),lower,G ((m/s^2)^2/Hz)\n" + rows(F, F, D, D), 1.0, {"column": "G", "over": "f"}),
    "seconds.csv": ("f (Hz),G (m2 s-3)\n" + rows(F, D), 1.0, {}),
    "falling.csv": ("f (Hz),G (g^2/Hz)\n" + rows(F[::-1], D[::-1]), G**2, {}),
}
WAVES = {
    "waves.nc": (waves(), 1.0, {"of": "height"}),
    "one time.nc": (waves(), 1.1, {"of": "height", "row": 2}),
}


@pytest.mark.parametrize("name", [*SPECTRA, *WAVES, "latin.uff", "crlf.uff"])
def test_a_spectrum_as_people_have_it(name, tmp_path):
    path = tmp_path / name
    options = {"of": "acceleration"}
    if name in SPECTRA:
        text, factor, more = SPECTRA[name]
        path.write_text(text, encoding="utf-8")
    elif name in WAVES:
        content, factor, more = WAVES[name]
        options = {"of": "stiffness"} if name != "waves.nc" else {}
        path.write_bytes(content)
    else:
        factor, more = (G**2, {}) if name == "crlf.uff" else (1.0, {})
        made = uff(path, 9, F, D, "g" if name == "crlf.uff" else "m/s^2").read_bytes()
        made = made.replace(b"\n", b"\r\n") if name == "crlf.uff" else made.replace(b"m/s^2", b"m/s\xb2 ")
        path.write_bytes(made)
    found = read_spectrum(path, sided="one", **{**options, **more})
    here = float(np.interp(2 * F0 * 2 * math.pi, found.frequencies, 2 * found.density))
    assert here == pytest.approx(factor * np.interp(2 * F0, F, D), rel=1e-9 if "uff" not in name else 1e-6)


GAP = np.r_[0:1000, 2000:4096]
HALF = np.sort(np.random.default_rng(0).permutation(4096)[:2048])


def unix(t, digits=3):
    """A record at Unix times."""
    return "t (s),a (g)\n" + stamped([f"{EPOCH + each:.{digits}f}" for each in t], X[: len(t)])


REFUSED = {
    "commas.csv": ("t (s);a (g)\n" + rows(T, X, separator=";").replace(".", ","), {}, "write decimal points"),
    "commas in all.csv": (
        "Zeit;Beschleunigung\ns;m/s²\n" + rows(T, X, separator=";", form="{:.9f}").replace(".", ","),
        {},
        r":3: has \"0,000000000\" in the column Zeit; write decimal points",
    ),
    "one column of commas.csv": (
        "\n".join(f"{x:.3f}".replace(".", ",") for x in X),
        {"rate": RATE},
        r':1: has "0,035"; write decimal points; if these are two columns, name them in a line above',
    ),
    "a name over commas.csv": ("acc\n" + "\n".join(f"{x:.3f}".replace(".", ",") for x in X), {"rate": RATE}, ":2: has"),
    "days.csv": ("t,a\n" + stamped(["01.03.2026 12:00:00"] * 99, X[:99]), {}, "write times alike, such as 2026"),
    "gap.csv": ("t (s),a (g)\n" + rows(T[GAP], X[GAP]), {}, r"uneven steps, 20.02 s at line 1002"),
    "gap unix.csv": (unix(T[GAP]), {}, r"uneven steps, 20.02 s at line 1002"),
    "half is missing.csv": (unix(T[HALF]), {}, "uneven steps"),
    "whole seconds.csv": ("t (s),a (g)\n" + stamped([f"{int(t)}" for t in T], X), {}, "state --rate"),
    "volts.csv": ("t (s),a (V)\n" + rows(T, X), {}, r"state --unit"),
    "decibel.csv": ("t (s),a (dB)\n" + rows(T, X), {}, r'the unit "dB"'),
    "prose.txt": ("nothing was measured today\nnor tomorrow\n", {}, "has no table of numbers"),
    "value.csv": ("t (s),a (g)\n" + rows(T, X) + f"{T[-1] + 1 / RATE},nan\n", {}, "value nan in line 4098"),
    "cut.at2": (peer("A", X)[:-300], {}, "states 4096 values and has"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_says_what_to_do(name, tmp_path):
    text, options, said = REFUSED[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(FpsolveError, match=said) as found:
        read_record(tmp_path / name, of="acceleration", **options)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("shift", [0.0, EPOCH])
def test_times_that_a_logger_has_rounded_are_told_from_gaps(shift, tmp_path):
    path = tmp_path / "a.csv"
    t = np.arange(1000) / 30
    path.write_text("t (s),a (g)\n" + stamped([f"{shift + each:.2f}" for each in t], X[:1000]), encoding="utf-8")
    found = read_record(path, of="acceleration")
    assert found.step == pytest.approx(1 / 30, rel=1e-4)
    assert "rounded to 0.01 s" in found.notes[0]
    path.write_text(
        "t (s),a (g)\n" + stamped([f"{shift + each:.2f}" for each in np.delete(t, 500)], X[:999]), encoding="utf-8"
    )
    with pytest.raises(FpsolveError, match="uneven steps"):
        read_record(path, of="acceleration")


def test_units_are_never_guessed_silently(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t (s),a\n" + rows(T, X), encoding="utf-8")
    assert read_record(path, of="stiffness").notes == ()
    path.write_text("Sample,a\n" + rows(range(4096), X), encoding="utf-8")
    [note] = read_record(path, of="stiffness").notes
    assert "Sample is taken as times in s" in note
    assert "--rate" in note
    assert read_record(path, of="stiffness", rate=RATE, column="a").notes == ()
    path.write_text("t (s),a\n" + rows(T, X), encoding="utf-8")
    [note] = read_record(path, of="acceleration").notes
    assert "taken as m/s²" in note
    assert "--unit" in note
    assert read_record(path, of="acceleration", unit="g").values == pytest.approx(G * (X - X.mean()))


def test_times_since_1970_are_told_by_their_size(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("stamp,a\n" + stamped([f"{1000 * (EPOCH + t):.0f}" for t in T], X), encoding="utf-8")
    found = read_record(path)
    assert found.notes == ("the times in stamp are taken as ms since 1970; --rate states other ones",)
    assert found.step == pytest.approx(1 / RATE, rel=1e-9)
    assert read_record(path, rate=10.0, column="a").notes == ()


def test_whole_numbers_that_increase_are_a_column_of_their_own(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(rows(range(99), np.arange(99) % 7), encoding="utf-8")
    assert read_record(path).values.size == 99


def test_a_table_on_its_side_is_refused(tmp_path):
    """A row for each time, columns are frequencies, as buoys write them."""
    lines = ["#YY MM DD " + " ".join(f"{f:.4f}" for f in F), *("2026 03 01 " + " ".join(map(str, D)) for _ in range(3))]
    (tmp_path / "a.txt").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(FpsolveError, match="several columns of values"):
        read_spectrum(tmp_path / "a.txt", per="Hz", sided="one")


def test_channels_that_are_called_by_numbers_are_no_frequencies(tmp_path):
    (tmp_path / "a.csv").write_text("f (Hz),1,2,3,4,5\n" + rows(F, *[D] * 5), encoding="utf-8")
    with pytest.raises(FpsolveError, match="several columns of values; state one by --column"):
        read_spectrum(tmp_path / "a.csv", sided="one")
    assert read_spectrum(tmp_path / "a.csv", sided="one", column="3").density == pytest.approx(D / 2)


def test_frequencies_that_are_called_omega_are_not_taken_in_hertz(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("omega,G (1/Hz)\n" + rows(F, D), encoding="utf-8")
    with pytest.raises(FpsolveError, match="frequencies called omega; state --per Hz"):
        read_spectrum(path, sided="one")
    assert read_spectrum(path, sided="one", per="Hz").frequencies == pytest.approx(2 * math.pi * F)


def test_rows_are_left_out_at_the_beginning(tmp_path):
    (tmp_path / "a.csv").write_text("t (s),a (g)\n" + rows(T, X), encoding="utf-8")
    np.save(tmp_path / "b.npy", X)
    for path, skip in (("a.csv", 101), ("b.npy", 100)):
        found = read_record(tmp_path / path, rate=RATE, skip=skip, column="2" if path == "a.csv" else None)
        assert found.values == pytest.approx(X[100:] - X[100:].mean())


@pytest.mark.slow
def test_rotten_files_are_read_or_refused_in_one_sentence(tmp_path):
    """Bits that have turned, bytes that are gone, added, or all ones."""
    rng = np.random.default_rng(0)
    good = {name: text.encode() for name, (text, _, _) in TEXT_RECORDS.items()}
    good |= {name: make() for name, (make, _, _) in BINARY_RECORDS.items() if not name.endswith(".mat")}
    good |= {name: content for name, (content, _, _) in WAVES.items()}
    said = list[str]()
    for name, content in good.items():
        path = tmp_path / f"rotten{name[name.rindex('.') :]}"
        for _ in range(3):
            rotten = bytearray(content)
            place, count = int(rng.integers(len(rotten))), int(rng.integers(1, 40))
            more = bytes(rng.integers(0, 256, count).astype("u1"))
            rotten[place] ^= 1 << int(rng.integers(8))
            kept = rng.integers(4)
            rotten[place : place + (count if kept != 1 else 0)] = (b"", more, b"\xff" * count, more)[kept]
            path.write_bytes(rotten)
            try:
                read_spectrum(path, per="Hz", sided="one") if name in WAVES else read_record(path, rate=RATE)
            except FpsolveError as error:
                said.append(str(error))
    assert len(said) > 25
    assert not [each for each in said if "\n" in each]


@pytest.mark.slow
def test_what_is_too_large_is_refused_before_it_is_read(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "a.npz", **{f"a{k}": np.zeros(2**18) for k in range(4)})
    (tmp_path / "b.csv").write_text("t,x\n" + "1,2\n" * 5000, encoding="utf-8")
    savemat(tmp_path / "c.mat", {f"a{k}": np.zeros(2**18) for k in range(4)}, do_compression=True)
    monkeypatch.setattr(tables, "MOST_NUMBERS", 2**19)
    monkeypatch.setattr(text_tables, "MOST_LINES", 4000)
    for name, most in (("a.npz", 2**19), ("b.csv", 4000), ("c.mat", 2**19)):
        with pytest.raises(FpsolveError, match=f"{most}"):
            read_record(tmp_path / name, rate=1.0)
