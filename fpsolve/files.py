"""Writing files whole or not at all, into folders that one run has for itself."""

from __future__ import annotations

import csv
import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

from fpsolve.errors import OutputError, Remedy

LOCK = ".fpsolve.lock"
TEMPORARY = r"\.fpsolve-[a-z0-9_]{8}(\.\w+)?"
"""The pattern of the names of files that are being written; what is killed leaves them."""


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary file beside `path`, with the same ending, that takes its place when the body succeeds.

    Folders are made as needed; when the body fails nothing is left of the file.

    Raises:
        OSError: the folder cannot be made, or the file cannot be written; it names `path`.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".fpsolve-", suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as failure:
        raise OSError(failure.errno, failure.strerror or str(failure), str(path)) from failure


@contextmanager
def writable(folder: Path) -> Iterator[None]:
    """Make a folder for results, with those around it, for a body that writes into it.

    Raises:
        OutputError: it cannot be made, or something in it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        raise OutputError(f"{folder} cannot be made: {failure.strerror or failure}; {Remedy.FOLDER}") from failure
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{folder} cannot be written to; {Remedy.FOLDER}")
    try:
        yield
    except OSError as failure:
        place, reason = failure.filename or folder, failure.strerror or failure
        raise OutputError(f"{place} cannot be written: {reason}; {Remedy.FOLDER}") from failure


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Make a folder for results, and keep other runs out of it during the body.

    The lock is one of the operating system on a hidden file, which ends with the process however that ends. The file is
    removed with the lock still held; what was killed leaves it, and then it does not hinder the next run. Where there
    are no such locks nobody is kept out; on Windows, too, where the file, open as it is, cannot be removed and stays.

    Raises:
        OutputError: the folder cannot be made or written to, or another run has it.
    """
    path = folder / LOCK
    with writable(folder):
        handle = _lock(path)
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(handle)


def _lock(path: Path) -> int:
    """An open file that is locked and stands at its path; one that its owner removed meanwhile is opened anew."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        if not _is_ours(handle):
            os.close(handle)
            raise OutputError(f"{path.parent} is being written by another run; wait for it, or {Remedy.FOLDER}")
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        os.close(handle)


def _is_ours(handle: int) -> bool:
    """Lock an open file, unless another has locked it; file systems that know no locks say nothing against it."""
    try:
        import fcntl
    except ImportError:  # on Windows
        return True
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def write_json(path: Path, data: Any) -> None:
    """Data without NaN or infinities as JSON."""
    write_text(path, json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n")


@contextmanager
def draft(path: Path) -> Iterator[TextIO]:
    """A file that is open for writing text as UTF-8, line ends as they are, and takes its place when it is whole."""
    with atomic(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        yield file


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Iterable[Any]]) -> None:
    """A table with its headings."""
    with draft(path) as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(rows)


def write_text(path: Path, text: str) -> None:
    """Text as UTF-8."""
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
