"""Files of every format give the numbers that were written, and broken ones one sentence."""

import io
import math
import struct
import sys

import numpy as np
import pytest
import xarray as xr
from scipy.io import savemat, wavfile

from fpsolve.errors import FpsolveError
from fpsolve.measured import read_modes, read_record, read_spectrum
from fpsolve.measured.signals import density_unit
from fpsolve.measured.tables import read_table

F = np.linspace(0.1, 8, 80)
G = 0.02 / (1 + F**2)
T = np.arange(400) / 50
X = np.random.default_rng(0).normal(size=400)


def csv(path, header, *columns, separator=","):
    rows = [separator.join(f"{each!r}" for each in map(float, row)) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def uff(path, function_type, x, y, unit="NONE"):
    """Dataset 58 as its format says, with even steps and numbers of double precision."""
    axis = f"{17 if function_type == 1 else 18:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}"
    head = [
        "a",
        *["NONE"] * 4,
        f"{function_type:5d}{0:10d}{1:5d}{0:10d} {'NONE':10s}{1:10d}{1:4d} {'NONE':10s}{1:10d}{1:4d}",
        f"{4:10d}{len(x):10d}{1:10d}{x[0]:13.5e}{x[1] - x[0]:13.5e}{0.0:13.5e}",
        axis,
        f"{12:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {unit:20s}",
        *[axis] * 2,
    ]
    numbers = [f"{each:20.11e}" for each in y]
    lines = ["".join(numbers[i : i + 4]) for i in range(0, len(numbers), 4)]
    path.write_text("\n".join(["    -1", "    58", *head, *lines, "    -1"]) + "\n")
    return path


def spectra(folder):
    """The same spectrum in every format, per Hz and one-sided."""
    yield csv(folder / "a.csv", "f (Hz),G (1/Hz)", F, G)
    yield csv(folder / "b.txt", "frequency [Hz]\tPSD [1/Hz]", F, G, separator="\t")
    yield csv(folder / "c.dat", "# remark\nfrequency density", F, G, separator=" ")
    yield csv(folder / "c2.csv", "f;G", F, G, separator=";")
    np.save(folder / "d.npy", np.column_stack([F, G]))
    yield folder / "d.npy"
    np.savez(folder / "e.npz", f=F, G=G)
    yield folder / "e.npz"
    savemat(folder / "f.mat", {"f": F, "G": G, "note": "text"})
    yield folder / "f.mat"
    xr.Dataset({"G": ("f", G, {"units": "1/Hz"})}, {"f": ("f", F, {"units": "Hz"})}).to_netcdf(
        folder / "g.nc", engine="h5netcdf"
    )
    yield folder / "g.nc"
    xr.Dataset({"G": (("time", "f"), G[None])}, {"f": F, "time": [0.0]}).to_netcdf(folder / "h.nc", engine="scipy")
    yield folder / "h.nc"
    yield uff(folder / "i.uff", 9, F, G)


def test_a_spectrum_from_every_format(tmp_path):
    for path in spectra(tmp_path):
        found = read_spectrum(path, per="Hz", sided="one", of="stiffness")
        assert found.frequencies == pytest.approx(2 * math.pi * F, rel=1e-6), path
        assert found.density == pytest.approx(0.5 * G, rel=1e-6), path


def records(folder):
    yield csv(folder / "a.csv", "t (s),x", T, X), None
    yield csv(folder / "b.csv", "t (ms),x", 1000 * T, X), None
    np.save(folder / "c.npy", X)
    yield folder / "c.npy", 50
    savemat(folder / "d.mat", {"time": T, "x": X})
    yield folder / "d.mat", None
    xr.Dataset({"x": ("time", X)}, {"time": T}).to_netcdf(folder / "e.nc", engine="h5netcdf")
    yield folder / "e.nc", None
    yield uff(folder / "f.unv", 1, T, X), None


def test_a_record_from_every_format(tmp_path):
    for path, rate in records(tmp_path):
        found = read_record(path, rate=rate)
        assert found.step == pytest.approx(0.02), path
        assert found.values == pytest.approx(X - X.mean(), rel=1e-5, abs=1e-6), path


@pytest.mark.parametrize(("kind", "resolution"), [("<i2", 2.0**-15), ("u1", 2.0**-7), ("<f4", 1e-6)])
def test_sound_is_a_share_of_full_scale(kind, resolution, tmp_path):
    x = 0.5 * np.sin(0.1 * np.arange(600))
    data = x if kind == "<f4" else np.round(x * {"<i2": 32768, "u1": 128}[kind] + (128 if kind == "u1" else 0))
    wavfile.write(tmp_path / "a.wav", 100, data.astype(kind))
    found = read_record(tmp_path / "a.wav")
    assert found.step == 0.01
    assert found.values == pytest.approx(x - x.mean(), abs=2 * resolution)


def test_channels_and_columns_are_chosen_by_name(tmp_path):
    wavfile.write(tmp_path / "a.wav", 50, np.column_stack([X, 2 * X]).astype("<f4"))
    path = csv(tmp_path / "b.csv", "t,left,right", T, X, 2 * X)
    for place, name in ((tmp_path / "a.wav", "channel 2"), (path, "right")):
        assert read_record(place, column=name).values == pytest.approx(2 * (X - X.mean()), abs=1e-6)
    with pytest.raises(FpsolveError, match=r'no column "rigth"; did you mean "right"\? its columns are t, left, right'):
        read_record(path, column="rigth")
    with pytest.raises(FpsolveError, match="several columns of values; state one by --column"):
        read_record(path)


@pytest.mark.parametrize(
    ("unit", "of", "factor"),
    [
        ("(m/s^2)^2/Hz", "acceleration", 1.0),
        ("g²/Hz", "acceleration", 9.80665**2),
        ("m²/s⁴/Hz", "acceleration", 1.0),
        ("(m/s2)^2/Hz", "acceleration", 1.0),
        ("g2/Hz", "acceleration", 9.80665**2),
        ("m2/Hz", "height", 1.0),
        ("%^2/Hz", "stiffness", 1e-4),
        ("1/s²/Hz", "damping", 1.0),
        ("cm²/Hz", "height", 1e-4),
    ],
)
def test_units_are_converted(unit, of, factor, tmp_path):
    found = read_spectrum(csv(tmp_path / "a.csv", f"f (Hz),G ({unit})", F, G), sided="one", of=of)
    assert found.density == pytest.approx(0.5 * factor * G)


def test_units_per_radian(tmp_path):
    """∫ G dω is the variance: S = πG."""
    path = csv(tmp_path / "a.csv", "omega (rad/s),G ((m/s^2)^2*s/rad)", F, G)
    found = read_spectrum(path, sided="one", of="acceleration")
    assert found.frequencies == pytest.approx(F)
    assert found.density == pytest.approx(math.pi * G)
    assert density_unit("m**2 / (rad/s)") == ({"m": 1}, "rad/s")


def test_modes_of_a_table(tmp_path):
    path = csv(tmp_path / "a.csv", "Fn [Hz],Xi [-]", [2.0, 3.5], [0.01, 0.02])
    assert read_modes(path) == ((2.0, 0.01), (3.5, 0.02))
    np.savez(tmp_path / "b.npz", Fn=[2.0, 3.5], Xi=[0.01, 0.02])
    assert read_modes(tmp_path / "b.npz") == read_modes(path)
    [(f, zeta)] = read_modes(csv(tmp_path / "c.csv", "omega (rad/s),damping (%)", [4 * math.pi], [1.5]))
    assert (f, zeta) == pytest.approx((2.0, 0.015))
    with pytest.raises(FpsolveError, match=r"0.01 is 1 %"):
        read_modes(csv(tmp_path / "d.csv", "Fn,Xi", [2.0], [1.5]))
    with pytest.raises(FpsolveError, match="no column of natural frequencies, such as Fn"):
        read_modes(csv(tmp_path / "e.csv", "mode,Xi", [1.0], [0.1]))


def npz_of(**arrays):
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


def npy_header(shape):
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return content.getvalue()


def damaged_npz():
    """Whose first array, which is compressed, is no more."""
    content = io.BytesIO()
    np.savez_compressed(content, f=F)
    found = bytearray(content.getvalue())
    found[60:100] = b"\xff" * 40
    return bytes(found)


def cut_wav():
    content = io.BytesIO()
    wavfile.write(content, 50, X.astype("<f4"))
    return content.getvalue()[:-400]


BROKEN = {
    "empty.csv": (b"", "is empty"),
    "binary.csv": (b"\0\1\2", "is binary"),
    "one line.csv": (b"f,G\n", "has no table of numbers"),
    "short row.csv": (b"f,G\n1,2\n3\n", r":3: has 1 cells, and the header has 2"),
    "word.csv": (b"f,G\n1,2\n3,x\n", r':3: has "x" in the column G; write a number'),
    "gap.csv": (b"f,G\n1,2\n3,\n", r":3: has nothing in the column G"),
    "commas.csv": (b"f;G\n1;2\n3;0,5\n", "write decimal points"),
    "twice.csv": (b"f,f\n1,2\n", 'two columns called "f"'),
    "pickle.npy": (npz_of(), "is no file of NumPy"),
    "huge.npy": (npy_header((2**40,)), "numbers, and at most"),
    "short.npy": (npy_header((1000,)) + b"12345678", "more than the file holds"),
    "text.npy": (b"no numpy", "is no file of NumPy"),
    "text.npz": (b"PK\3\4 no zip", "is no file of NumPy"),
    "damaged.npz": (damaged_npz(), "is no file of NumPy"),
    "new.npy": (b"\x93NUMPY\3\0" + npy_header((2**40,))[8:], "has the version 3.0"),
    "texts.npz": (npz_of(f=np.array(["a"])), "f has no numbers"),
    "cut.wav": (cut_wav(), "states 1658 bytes and has 1258"),
    "text.mat": (b"x" * 200, "is no MATLAB file"),
    "new.mat": (b"MATLAB 7.3 MAT-file" + b" " * 200, '-v7'),
    "text.wav": (b"RIFF" + struct.pack("<I", 4) + b"none", "is no WAV file"),
    "text.nc": (b"CDF\1" + b"x" * 100, "is no netCDF file"),
    "hdf.nc": (b"\x89HDF\r\n\x1a\n" + b"x" * 100, "is no netCDF file"),
    "text.uff": (b"    -1\n    58\nnothing\n    -1\n", "is no universal file"),
    "a.xlsx": (b"PK", 'the unknown ending ".xlsx"'),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_get_one_sentence(name, tmp_path):
    content, said = BROKEN[name]
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FpsolveError, match=said) as found:
        read_spectrum(path, per="Hz", sided="one")
    assert "\n" not in str(found.value)
    assert str(found.value).startswith(str(path))


def test_objects_are_not_loaded(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(FpsolveError, match="Python objects, which are not loaded"):
        read_spectrum(tmp_path / "a.npy", per="Hz", sided="one")


def test_a_missing_file_and_a_folder(tmp_path):
    for path, said in ((tmp_path / "none.csv", "no such file"), (tmp_path, "ending")):
        with pytest.raises(FpsolveError, match=said):
            read_spectrum(path, per="Hz", sided="one")


@pytest.mark.parametrize(
    ("header", "options", "said"),
    [
        ("f (Hz),G (1/Hz)", {}, "one-sided"),
        ("f,G", {"sided": "one"}, "states no unit of its frequencies"),
        ("f (Hz),G (1/Hz)", {"sided": "one", "per": "rad/s"}, "state --per Hz"),
        ("f (Hz),G (V^2/Hz)", {"sided": "one", "of": "acceleration"}, r'the unit "V\^2/Hz"'),
        ("f (Hz),G (m/s^2)", {"sided": "one"}, "in the column G has the unit"),
        ("f (kHz),G (1/Hz)", {"sided": "one", "per": "Hz"}, 'has the unit "kHz" of the column f; must be Hz, rad/s'),
        ("t (s),G (1/Hz)", {"sided": "one", "per": "Hz"}, "over times, in the column t, so that it is a record"),
        ("time,G", {"sided": "one", "per": "Hz"}, "over times, in the column time, so that it is a record"),
        ("f (1/s),G", {"sided": "one"}, "states no unit of its frequencies"),
        ("f (Hz),G", {"sided": "one", "column": "f"}, "frequencies or times in the column f; state one of G"),
    ],
)
def test_what_a_spectrum_must_state(header, options, said, tmp_path):
    with pytest.raises(FpsolveError, match=said):
        read_spectrum(csv(tmp_path / "a.csv", header, F, G), **options)


def test_one_column_needs_another(tmp_path):
    path = csv(tmp_path / "a.csv", "x", X)
    with pytest.raises(FpsolveError, match=r"write a column of frequencies, such as f \(Hz\), beside it$"):
        read_spectrum(path, sided="one")
    with pytest.raises(FpsolveError, match=r"write a column of times, such as t \(s\), beside it, or state --rate$"):
        read_record(path)


def test_the_wrong_option(tmp_path):
    wavfile.write(tmp_path / "a.wav", 50, X.astype("<f4"))
    with pytest.raises(FpsolveError, match="name it by --record"):
        read_spectrum(tmp_path / "a.wav", per="Hz", sided="one")
    found = read_spectrum(uff(tmp_path / "b.uff", 9, F, G, "g"), sided="one", of="acceleration")
    assert found.density == pytest.approx(0.5 * 9.80665**2 * G)
    with pytest.raises(FpsolveError, match="leave out --record"):
        read_record(uff(tmp_path / "a.uff", 9, F, G))


@pytest.mark.parametrize(
    ("t", "said"),
    [(np.where(T > 4, T + 1, T), "uneven steps"), (T[::-1], "do not increase"), (np.zeros_like(T), "do not increase")],
)
def test_times_are_even(t, said, tmp_path):
    with pytest.raises(FpsolveError, match=said):
        read_record(csv(tmp_path / "a.csv", "t (s),x", t, X))


@pytest.mark.parametrize("compressed", [False, True])
def test_arrays_of_matlab(compressed, tmp_path):
    """All types of numbers, small ones among them, as scipy writes them; the rest is left out."""
    arrays = {kind: np.array([[1, 2, 100]], dtype=kind) for kind in ("u1", "i2", "i4", "u8", "f4", "f8")}
    wide = np.arange(12.0).reshape(6, 2)
    others = {"text": "a", "cell": np.array([1, "a"], dtype=object), "z": np.array([1j]), "deep": {"x": 1.0}}
    savemat(
        tmp_path / "a.mat",
        {**{f"x_{k}": v for k, v in arrays.items()}, "wide": wide, **others},
        do_compression=compressed,
    )
    found = read_table(tmp_path / "a.mat").columns
    assert set(found) == {*(f"x_{kind}" for kind in arrays), "wide 1", "wide 2"}
    for kind in arrays:
        assert found[f"x_{kind}"].values.tolist() == [1, 2, 100]
    assert np.column_stack([found["wide 1"].values, found["wide 2"].values]).tolist() == wide.tolist()


def test_a_universal_file_without_pyuff(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(FpsolveError, match=r"needs pyuff: pip install 'fpsolve\[measured\]'"):
        read_spectrum(uff(tmp_path / "a.uff", 9, F, G), sided="one")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2])
def test_damaged_files_are_read_or_refused_in_one_sentence(seed, tmp_path):
    """Cut, with other bytes, with bytes that are gone or added."""
    rng = np.random.default_rng(seed)
    good = [(path, None) for path in spectra(tmp_path)]
    (tmp_path / "records").mkdir()
    good += list(records(tmp_path / "records"))
    wavfile.write(tmp_path / "a.wav", 50, X.astype("<f4"))
    said = []
    for path, rate in [*good, (tmp_path / "a.wav", None)]:
        for _ in range(40 if path.suffix != ".mat" else 4):  # which a process of its own reads
            damaged = bytearray(path.read_bytes())
            place = rng.integers(len(damaged))
            new = bytes(rng.integers(0, 256, rng.integers(0, 40)).astype("u1"))
            damaged[place : rng.choice([place + 1, place + len(new), len(damaged)])] = new
            other = tmp_path / f"damaged{path.suffix}"
            other.write_bytes(damaged)
            try:
                if path.parent.name == "records" or path.suffix == ".wav":
                    read_record(other, rate=rate or 50)
                else:
                    read_spectrum(other, per="Hz", sided="one")
            except FpsolveError as error:
                said.append(str(error))
    assert said
    assert not [each for each in said if "\n" in each]
