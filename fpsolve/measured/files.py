"""Files of measuring systems and of programs, each kind read by a library, in a process of its own.

Some files that are broken end the process that reads them, or let it take all memory.
"""

from __future__ import annotations

import glob
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import redirect_stdout, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from fpsolve.files import Unreadable, read_bytes, text_of
from fpsolve.measured.table import WORDS, Part, Table, table_of
from fpsolve.measured.text import parse

MOST_TEXT, MOST_BYTES = 2**26, 2**27
"""Bytes of a text, and of another file."""
MOST_SECONDS = 60
MEMORY, PER_BYTE = 2**29, 64
"""Bytes that the process may take, and more for each of the file."""
TEXTS = (".csv", ".txt", ".dat", ".tsv", ".asc", ".prn", ".out")
"""Endings of files that are texts."""
SEISMIC, MARKS = "seismic", (b"Origin Time", b"TIMESERIES", b"WID2")
"""Files that obspy may know, and how some of them begin that are texts."""


def read_table(path: Path, *, skip: int = 0, names: str = "", by_rows: bool = False) -> Table:
    """The columns of a file, by its ending one of `KINDS`; else seismic data that obspy knows, or a text.

    Args:
        skip, names, by_rows: as for `parse`; of arrays `skip` counts rows.

    Raises:
        Unreadable: it cannot be read.
    """
    kind = path.suffix.lower()
    content = read_bytes(path, WORDS, MOST_BYTES if kind in KINDS else MOST_TEXT)
    if content.startswith(MARKS) or (kind not in (*TEXTS, *KINDS) and b"\0" in content):
        kind = SEISMIC
    found = _in_a_process(path, kind) if kind in KINDS else text_of(content, WORDS, may_be_latin=True)
    if isinstance(found, str):
        return parse(found, skip=skip, names=names, by_rows=by_rows)
    if names or by_rows:
        raise Unreadable("is no text, of which --names and --by rows tell; leave them out")
    columns = {name: each[skip:] for name, each in found.columns.items() if each.size > skip}
    if not columns:
        raise Unreadable("has no columns of real numbers; export such vectors, each with a name, or skip fewer rows")
    return replace(found, columns=columns)


def _in_a_process(path: Path, kind: str) -> Table | str:
    command = [sys.executable, "-P", "-m", __name__, kind, str(path.resolve())]
    with suppress(subprocess.TimeoutExpired):
        ended = subprocess.run(command, capture_output=True, timeout=MOST_SECONDS, check=False)
        if ended.returncode == 0:
            found = pickle.loads(ended.stdout)
            if isinstance(found, Unreadable):
                raise found
            return found
    raise Unreadable(f"is no file that {KINDS[kind][0]} reads; export it again, or as .csv")


def _numpy(path: str) -> Iterator[Part]:
    found = np.load(path, allow_pickle=False)
    yield Part("", found if isinstance(found, np.ndarray) else dict(found))


def _matlab(path: str) -> Iterator[Part]:
    import h5py
    from scipy.io import loadmat

    if h5py.is_hdf5(path):  # level 7.3
        yield from _netcdf(path)
    else:
        yield Part("", loadmat(path, simplify_cells=True))


def _netcdf(path: str) -> Iterator[Part]:
    """The variables of all groups; those of HDF5, too."""
    import h5py
    import xarray as xr

    if h5py.is_hdf5(path):
        groups = xr.open_groups(path, engine="h5netcdf", phony_dims="sort", decode_timedelta=False)
    else:
        groups = {"/": xr.open_dataset(path, engine="scipy", decode_timedelta=False)}
    for group, data in groups.items():
        for name, each in data.variables.items():
            yield Part(f"{group}/{name}".strip("/"), each.values, str(each.attrs.get("units", "")))


def _sound(path: str) -> Iterator[Part]:
    """Channels as shares of full scale."""
    from scipy.io import wavfile

    rate, data = wavfile.read(path)
    if data.dtype.kind in "iu":
        half = 2.0 ** (8 * data.dtype.itemsize - 1)
        data = (data - half * (data.dtype.kind == "u")) / half
    yield Part("channel", data, step=1 / rate)


def _universal(path: str) -> Iterator[Part]:
    """Datasets 58 over one abscissa: time responses, or power spectral densities."""
    import pyuff

    file = pyuff.UFF(path)
    sets = [file.read_sets(i) for i, number in enumerate(file.get_set_types()) if int(number) == 58]
    kinds = {each["func_type"] for each in sets}
    if kinds not in ({1}, {9}) or any(not np.array_equal(each["x"], sets[0]["x"]) for each in sets):
        raise Unreadable("has other than functions of type 1, or of type 9, over one abscissa; export those alone")
    yield Part(*("time", sets[0]["x"], "s") if kinds == {1} else ("frequency", sets[0]["x"], "Hz"))
    for i, each in enumerate(sets):
        yield Part(f"set {i + 1}", each["data"], str(each["ordinate_axis_units_lab"]).strip().replace("NONE", ""))


def _labview(path: str) -> Iterator[Part]:
    import lvm_read

    found = lvm_read.read_str(Path(path).read_text(encoding="utf-8", errors="ignore"))
    if found["Segments"] != 1:
        raise Unreadable(f"has {found['Segments']} segments; export one")
    data = found[0]
    columns = zip(data["Channel names"], data["data"].T, strict=False)
    inner = [(name, values) for name, values in columns if name not in ("X_Value", "Comment")]
    is_time = "Time" in data["X_Dimension"] and not set(data.get("X_Unit_Label", "s")) - {"", "s"}
    for (name, values), unit, step in zip(inner, data["Y_Unit_Label"], data["Delta_X"], strict=False):
        yield Part(name, values, unit, step * is_time)


def _tdms(path: str) -> Iterator[Part]:
    import nptdms

    for group in nptdms.TdmsFile.read(path).groups():
        for each in group.channels():
            about = each.properties
            step = about.get("wf_increment", 0.0) if about.get("wf_xunit_string", "s") in ("", "s") else 0.0
            yield Part(f"{group.name}.{each.name}", each[:], about.get("unit_string", ""), step)


def _parquet(path: str) -> Iterator[Part]:
    frame = pd.read_parquet(path)
    for name, each in frame.reset_index(drop=isinstance(frame.index, pd.RangeIndex)).items():
        yield Part(str(name), each.to_numpy())


def _excel(path: str) -> str:
    """The first sheet as a text."""
    return str(pd.read_excel(path, header=None, engine="openpyxl").to_csv(sep="\t", header=False, index=False))


def _seismic(path: str) -> Iterator[Part]:
    import obspy
    from obspy.core.util.base import ENTRY_POINTS

    ENTRY_POINTS["waveform"].pop("PICKLE", None)  # which may run what a file says
    for each in obspy.read(glob.escape(path)):
        is_knet = each.stats._format == "KNET"  # whose factor makes them m/s²; that of others may lead to any unit
        unit = "m/s^2" if is_knet else each.stats.get("ascii", {}).get("unit", "")
        unit = unit.lower() if unit.isupper() else unit  # M/S**2 in the SEED standard
        yield Part(each.id, each.data * each.stats.calib if is_knet else each.data, unit, each.stats.delta)


KINDS: Mapping[str, tuple[str, Callable[[str], Iterable[Part] | str]]] = {
    **dict.fromkeys((".npy", ".npz"), ("numpy", _numpy)),
    ".mat": ("scipy", _matlab),
    ".wav": ("scipy", _sound),
    **dict.fromkeys((".nc", ".h5", ".hdf5"), ("xarray", _netcdf)),
    **dict.fromkeys((".uff", ".unv", ".uf"), ("pyuff", _universal)),
    ".lvm": ("lvm_read", _labview),
    ".tdms": ("nptdms", _tdms),
    ".parquet": ("pyarrow", _parquet),
    ".xlsx": ("openpyxl", _excel),
    **dict.fromkeys((SEISMIC, ".mseed", ".sac", ".gse2"), ("obspy", _seismic)),
}
"""By the endings of files the libraries that read them."""


def _read(kind: str, path: str) -> object:
    """In the process: what a file holds, or an error that says why it holds nothing."""
    if sys.platform == "linux":
        import resource

        limit = MEMORY + PER_BYTE * Path(path).stat().st_size
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    library, read = KINDS[kind]
    try:
        with redirect_stdout(sys.stderr), warnings.catch_warnings(action="ignore"):
            found = read(path)
            return found if isinstance(found, str) else table_of(found)
    except ImportError:
        return Unreadable(f"is a file that needs {library}: pip install 'fpsolve[measured]'")
    except Unreadable as error:
        return error
    except Exception as error:  # each library raises many kinds for what is no such file
        reason = str(error)[:100] or type(error).__name__
        return Unreadable(f"is no file that {library} reads ({reason}); export it again, or as .csv")


if __name__ == "__main__":
    sys.stdout.buffer.write(pickle.dumps(_read(*sys.argv[1:])))
