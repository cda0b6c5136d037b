"""Columns of numbers with names and units, from the files of measuring systems and of programs.

A column of an array of NumPy or MATLAB with several columns is called by its number, "2", or "name 2".
"""

from __future__ import annotations

import io
import math
import re
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.files import Unreadable, read_bytes
from fpsolve.measured.columns import WORDS, Column, Table
from fpsolve.measured.matlab import MatError, read_mat
from fpsolve.measured.text import MOST_TEXT, NO_TABLE, read_peer_table, read_text_table

MOST_NUMBERS = 2**25
"""Of all arrays of a file."""
MOST_BYTES = 2**27
"""Of a file that is no text."""
MOST_COLUMNS = 64


def read_table(path: str | Path, skip: int = 0) -> Table:
    """The columns of a file by its ending.

    Args:
        path: .csv, .txt, .dat, .tsv and others: text; .at2, .vt2: PEER; .npy, .npz: NumPy; .mat: MATLAB; .wav: sound;
            .uff, .unv, .uf: universal files, which need pyuff; .nc: netCDF, as xarray writes it.
        skip: rows at its beginning that are left out, of a text its lines.

    Raises:
        FpsolveError: the file is none of these, or broken: one sentence.
    """
    path = Path(path)
    reader, of_text = READERS.get(path.suffix.lower()), TEXTS.get(path.suffix.lower())
    try:
        if of_text is not None:
            table = of_text(path, skip)
        elif reader is None:
            known = ", ".join([*TEXTS, *READERS])
            raise Unreadable(f'has the unknown ending "{path.suffix}"; must be one of {known}; export it as .csv')
        else:
            table = reader(path)
            cut = {name: replace(each, values=each.values[skip:]) for name, each in table.columns.items()}
            table = replace(table, columns=cut) if skip else table
        if not table.columns or not all(each.values.size for each in islice(table.columns.values(), 1)):
            raise Unreadable(f"{NO_TABLE}; export columns of numbers{', or skip fewer rows' if skip else ''}")
        return table
    except Unreadable as error:
        place = path if error.line is None else f"{path}:{error.line}"
        raise FpsolveError(f"{place}: {error.sentence}") from None


def _looked_at(shape: tuple[int, ...], name: str, itemsize: int = 8, size: float = math.inf) -> None:
    """Refuse what is too large, or states more numbers than its file can hold. Raises Unreadable."""
    count = math.prod(shape)
    if count > MOST_NUMBERS:
        text = f"has {count} numbers, and at most {MOST_NUMBERS} are read; cut the measurement"
        raise Unreadable(_of_name(name, text))
    if count * itemsize > size:
        raise Unreadable(_of_name(name, f"states {count} numbers, more than the file holds; copy or export it again"))


def _of_name(name: str, text: str) -> str:
    """A sentence on an array of a file; on the only one, which has no name, it is one on the file."""
    return f"{name} {text}".strip()


def _split(name: str, array: Any, unit: str = "") -> Iterator[tuple[str, Column]]:
    """The columns of an array of real numbers; those of a table by their numbers."""
    found = np.asarray(array)
    if found.dtype.kind == "c":
        raise Unreadable(_of_name(name, "has complex numbers; export real ones, such as a power spectral density"))
    if found.dtype.kind not in "iufb":
        raise Unreadable(_of_name(name, "has no numbers; export numbers"))
    with np.errstate(invalid="ignore"):  # what is no number is said of its row later
        resolution = float(np.finfo(found.dtype).eps) if found.dtype.kind == "f" else 0.0
        found = np.squeeze(found).astype(float)
    if found.ndim == 0:
        return
    if found.ndim == 1:
        yield name or "1", Column(found, unit, resolution * float(np.max(abs(found), initial=0.0)))
        return
    if found.ndim > 2:
        raise Unreadable(_of_name(name, f"has {found.ndim} dimensions; export one or two, a column for each quantity"))
    if found.shape[1] > MOST_COLUMNS and found.shape[0] <= MOST_COLUMNS:
        found = found.T
    if found.shape[1] > MOST_COLUMNS:
        raise Unreadable(_of_name(name, f"has {found.shape[1]} columns; export at most {MOST_COLUMNS}"))
    for i, values in enumerate(found.T):
        yield f"{name} {i + 1}".strip(), Column(values, unit)


def _of_npy(path: Path) -> Table:
    content = read_bytes(path, WORDS, MOST_BYTES)
    return Table(path, dict(_of_array("", npy(content))))


def _of_array(name: str, array: Any) -> Iterator[tuple[str, Column]]:
    """The columns of an array, by the names of its fields where it has such."""
    if array.dtype.names is None:
        yield from _split(name, array)
        return
    for each in array.dtype.names:
        yield from _split(each, array[each])


def npy(content: bytes, name: str = "") -> Any:
    """An array in the format of NumPy without Python objects, whose size is looked at first."""
    file = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(file)
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        if version not in read:  # names of fields that are not Latin letters, or none of NumPy's
            text = f"has the version {'.'.join(map(str, version))} of NumPy's format; save an array of numbers"
            raise Unreadable(_of_name(name, text))
        shape, _, dtype = read[version](file)
        if dtype.hasobject:
            text = "holds Python objects, which are not loaded; save an array of numbers"
            raise Unreadable(_of_name(name, text))
        _looked_at(shape, name, dtype.itemsize, len(content))
        file.seek(0)
        return np.load(file, allow_pickle=False)
    except Unreadable:
        raise
    except Exception as error:  # what reads the header raises many kinds for what is none
        raise Unreadable(f"is no file of NumPy ({_reason(error)}); save it with numpy.save or numpy.savez") from None


def _of_npz(path: Path) -> Table:
    content = read_bytes(path, WORDS, MOST_BYTES)
    columns = dict[str, Column]()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            _looked_at((sum(entry.file_size for entry in archive.infolist()) // 8,), "")
            for entry in archive.infolist():
                name = entry.filename.removesuffix(".npy")
                columns |= _of_array(name, npy(archive.read(entry), name))
    except Unreadable:
        raise
    except Exception as error:  # each part of the archive raises its own kinds
        raise Unreadable(f"is no file of NumPy ({_reason(error)}); save it with numpy.savez") from None
    return Table(path, columns)


def _of_mat(path: Path) -> Table:
    content = read_bytes(path, WORDS, MOST_BYTES)
    if content[:8] == b"\x89HDF\r\n\x1a\n" or b"MATLAB 7.3" in content[:128]:
        raise Unreadable('is a MATLAB 7.3 file, which is HDF5; save it by save(..., "-v7")')
    columns = dict[str, Column]()
    try:
        for name, array in read_mat(path, MOST_NUMBERS).items():
            columns |= _split(name, array)
    except MatError as error:
        raise Unreadable(f'is no MATLAB file ({_reason(error)}); save it by save(..., "-v7")') from None
    if not columns:
        raise Unreadable("has no arrays of real numbers at its top level; save vectors, not structs or cells")
    return Table(path, columns)


def _of_wav(path: Path) -> Table:
    """Channels as shares of full scale."""
    from scipy.io import wavfile

    content = read_bytes(path, WORDS, MOST_BYTES)
    stated = int.from_bytes(content[4:8], "big" if content.startswith(b"RIFX") else "little") + 8
    if content[:4] in (b"RIFF", b"RIFX") and stated > len(content):
        raise Unreadable(f"states {stated} bytes and has {len(content)}; copy or export it again")
    try:
        with warnings.catch_warnings(action="ignore", category=wavfile.WavFileWarning):  # of chunks that are no sound
            rate, data = wavfile.read(io.BytesIO(content))
    except Exception as error:  # scipy raises many kinds for what is no such file
        raise Unreadable(f"is no WAV file ({_reason(error)}); export it again as PCM") from None
    _looked_at(data.shape, "")
    if not rate > 0:
        raise Unreadable("states a rate of 0; export it again")
    if data.dtype.kind in "iu":
        limits = np.iinfo(data.dtype)
        half = 0.5 * (float(limits.max) - float(limits.min) + 1)
        data = (data.astype(float) - (half if data.dtype.kind == "u" else 0.0)) / half
    return Table(path, dict(_split("" if data.ndim == 1 else "channel", data)), rate=float(rate), kind="record")


def _is_utf8(content: bytes) -> bool:
    """Whether a universal file is in UTF-8, or has binary numbers, whose bytes are no text."""
    try:
        content.decode()
    except UnicodeDecodeError:
        return b"58b" in content
    return True


UFF_KINDS = {1: "record", 9: "spectrum"}
"""What the functions of dataset 58 are: time response, power spectral density."""


def _of_uff(path: Path) -> Table:
    content = read_bytes(path, WORDS, MOST_TEXT)
    try:
        import pyuff
    except ImportError:
        raise Unreadable("is a universal file, which needs pyuff: pip install 'fpsolve[measured]'") from None
    try:
        with TemporaryDirectory() as folder:
            utf8 = Path(folder) / "a.uff"  # of what is in Latin-1, which pyuff does not read
            utf8.write_bytes(content if _is_utf8(content) else content.decode("latin-1").encode())
            found = pyuff.UFF(str(utf8))
            sets = [found.read_sets(i) for i, number in enumerate(found.get_set_types()) if int(number) == 58]
        used = [each for each in sets if each["func_type"] in UFF_KINDS]
        columns, kinds, axes = dict[str, Column](), list[str](), list[FloatArray]()
        for i, each in enumerate(used):
            x, y = np.asarray(each["x"], dtype=float), np.asarray(each["data"])
            if np.iscomplexobj(y):
                y = y.real if not np.any(y.imag) else y
            unit = str(each.get("ordinate_axis_units_lab", "")).strip()
            if unit.upper() == "NONE":
                unit = ""
            elif each["func_type"] == 9 and unit and "hz" not in unit.lower():  # that of the signal
                unit = f"({unit})^2/Hz"
            [(_, column)] = _split(str(i + 1), y, unit)
            if x.shape != column.values.shape:
                raise Unreadable(
                    f"has {x.size} abscissae and {column.values.size} values in set {i + 1}; export it again"
                )
            title = str(each.get("id1", "")).strip()
            name = title if title and title.upper() != "NONE" and title not in columns else f"set {i + 1}"
            columns[name] = column
            axes.append(x)
            kinds.append(UFF_KINDS[each["func_type"]])
    except Unreadable:
        raise
    except Exception as error:  # pyuff raises many kinds for what is no such file
        raise Unreadable(f"is no universal file ({_reason(error)}); export datasets 58 again") from None
    if not columns:
        raise Unreadable("has no time response and no power spectral density (datasets 58 of function type 1 or 9)")
    if len(set(kinds)) > 1 or any(not np.array_equal(axes[0], each) for each in axes):
        raise Unreadable("has functions over several abscissae; export those of one kind and one abscissa")
    is_record = kinds[0] == "record"
    abscissa = "time" if is_record else "frequency"
    return Table(
        path,
        {abscissa: Column(axes[0], "s" if is_record else "Hz"), **columns},
        abscissa=abscissa,
        kind=kinds[0],
    )


def _of_netcdf(path: Path) -> Table:
    import xarray as xr

    content = read_bytes(path, WORDS, MOST_BYTES)
    try:
        if content[:8] == b"\x89HDF\r\n\x1a\n":
            _look_into_hdf(content)
            engine: Any = "h5netcdf"
        else:
            engine = "scipy"
        options: dict[str, Any] = {"decode_times": False, "decode_timedelta": False}
        source = io.BytesIO(content)
        with warnings.catch_warnings(action="ignore"), xr.open_dataset(source, engine=engine, **options) as found:
            return _of_dataset(path, found.squeeze(drop=True))
    except Unreadable:
        raise
    except Exception as error:  # each engine raises its own kinds for what is no such file
        raise Unreadable(f"is no netCDF file ({_reason(error)}); write it by xarray's to_netcdf") from None


def _of_dataset(path: Path, found: Any) -> Table:
    """The variables over one dimension; of waves, over frequencies and directions, too. Raises Unreadable."""
    waves = next(
        (each for each in found.data_vars.values() if set(each.dims) & {"freq", "frequency"} and each.ndim > 1), None
    )
    if waves is not None:
        return _of_waves(path, waves)
    wide = [str(name) for name, each in found.data_vars.items() if each.ndim > 1]
    vectors = {str(name): each for name, each in found.variables.items() if each.ndim == 1}
    numbers = {name: each for name, each in vectors.items() if each.dtype.kind in "iuf"}
    sizes = {each.dims[0] for each in numbers.values()}
    if not numbers:
        raise Unreadable(f"has no variable of one dimension{_such_as(wide)}; select one, such as one time")
    if len(sizes) > 1:
        names = ", ".join(sorted(map(str, sizes)))
        raise Unreadable(f"has variables over several dimensions ({names}); keep those over one of them")
    columns = dict[str, Column]()
    for name, each in numbers.items():
        unit = str(each.attrs.get("units", "")).partition(" since ")[0]  # of times in the conventions of CF
        columns |= _split(name, each.values, unit)
    [dimension] = sizes
    return Table(path, columns, abscissa=str(dimension) if dimension in columns else "")


def _of_waves(path: Path, waves: Any) -> Table:
    """Spectra over frequencies, integrated over directions, one for each time or place. Raises Unreadable."""
    [f] = {"freq", "frequency"} & set(waves.dims)
    unit = str(waves.attrs.get("units", ""))
    for name in {"dir", "direction", "directions"} & set(waves.dims):
        angles = np.asarray(waves[name].values, dtype=float)
        turn = 360.0 if "rad" not in str(waves[name].attrs.get("units", "")) else 2 * math.pi
        steps = np.diff(np.sort(angles))
        if angles.size < 2 or not np.allclose(steps, turn / angles.size, rtol=1e-3):
            raise Unreadable(f"has directions in {name} that do not divide the circle evenly; integrate over them")
        waves = waves.sum(name) * (turn / angles.size)
        unit = re.sub(r"[ ./*]*(deg\w*|rad\w*)[\^{]*-?\d*\}?", "", unit)
    values = np.asarray(waves.transpose(..., f).values, dtype=float)
    values = values.reshape(-1, values.shape[-1])
    over = Column(np.asarray(waves[f].values, dtype=float), str(waves[f].attrs.get("units", "")))
    _looked_at(values.shape, str(waves.name))
    return Table(path, {"f": over, "S": Column(values[0], unit)}, abscissa="f", kind="spectrum", rows=values)


def _look_into_hdf(content: bytes) -> None:
    """Refuse variables elsewhere, and those that are too large. Raises Unreadable."""
    import h5py

    total = 0
    with h5py.File(io.BytesIO(content), "r") as file:
        for name in file:
            link = file.get(name, getlink=True)
            each = file.get(name) if isinstance(link, h5py.HardLink) else None
            if isinstance(link, h5py.HardLink) and each is None:
                raise Unreadable(f"{name} cannot be read; copy the file, or write it again by xarray's to_netcdf")
            if each is None or (isinstance(each, h5py.Dataset) and (each.is_virtual or each.external)):
                raise Unreadable(f"{name} leads to another file; write one file by xarray's to_netcdf")
            if isinstance(each, h5py.Dataset):
                total += math.prod(each.shape or ())
                _looked_at((total,), "")


def _such_as(names: list[str]) -> str:
    return f" but {names[0]}, which has more" if names else ""


def _reason(error: BaseException) -> str:
    """What a library says, in one line of a readable length."""
    said = str(error)
    text = " ".join(said.split()) or type(error).__name__
    return text if len(text) <= 100 else f"{text[:97]}..."


TEXTS: Mapping[str, Callable[[Path, int], Table]] = {
    **dict.fromkeys((".csv", ".txt", ".dat", ".tsv", ".out", ".lvm", ".asc", ".prn", ".spec"), read_text_table),
    **dict.fromkeys((".at2", ".vt2"), read_peer_table),
}
READERS: Mapping[str, Callable[[Path], Table]] = {
    ".npy": _of_npy,
    ".npz": _of_npz,
    ".mat": _of_mat,
    ".wav": _of_wav,
    **dict.fromkeys((".uff", ".unv", ".uf"), _of_uff),
    ".nc": _of_netcdf,
}
"""By the endings of files."""
