"""Files that somebody wrote, read or refused in one sentence; files of ours, written whole or not at all."""

from __future__ import annotations

import csv
import errno
import json
import stat
from codecs import BOM_UTF8
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from fpsolve.errors import OutputError
from fpsolve.messages import Code, Message, Remedy

LOCK = ".fpsolve.lock"
"""The name of the file that is locked."""
LOCK_SECONDS = 0.1
"""Seconds for which a run tries to lock a folder: another run may just have removed the file of its lock."""
NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP)
"""Numbers of the errors of file systems that have no locks."""
LARGEST = 2**29
"""Largest size of a file that is read as a whole, in bytes."""
_announce: ContextVar[Callable[[Path], object]] = ContextVar("announce", default=lambda _: None)


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """The `draft_of` a file, which takes its place when the body succeeds, and is removed when it fails.

    Missing folders are made. Who may read the file follows from the umask, as for any new file.

    Raises:
        OSError: the folder cannot be made, or the file cannot be written; it names `path`.
    """
    draft = draft_of(path)
    try:
        _announce.get()(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            draft.touch()
            yield draft
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as failure:
        raise OSError(failure.errno, failure.strerror or str(failure), str(path)) from failure


def draft_of(path: Path) -> Path:
    """The unfinished file beside `path`, with the same ending, which a killed run leaves."""
    return path.with_name(f".fpsolve-{path.name}")


@contextmanager
def announced(take: Callable[[Path], object]) -> Iterator[None]:
    """In the body `take` is called with the path of each file that will be written, before the file is there."""
    token = _announce.set(take)
    try:
        yield
    finally:
        _announce.reset(token)


@contextmanager
def writable(folder: Path) -> Iterator[None]:
    """Make a folder for results, with those around it, for a body that writes into it.

    Raises:
        OutputError: it cannot be made, or something in it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        raise OutputError(f"{folder} cannot be made: {failure.strerror or failure}", Remedy.FOLDER) from failure
    try:
        yield
    except OSError as failure:
        place, reason = failure.filename or folder, failure.strerror or failure
        raise OutputError(f"{place} cannot be written: {reason}", Remedy.FOLDER) from failure


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Make a folder for results, and keep other runs out of it during the body.

    The lock is one of the operating system on a hidden file. It ends with the process, so that a file that a killed run
    leaves does not hinder the next one; else the file is removed with the lock still held. On a file system without
    locks no run is kept out: a file whose existence is the lock would stay when a run on another machine is killed.

    Raises:
        OutputError: the folder cannot be made or written to, or another run has it.
    """
    from filelock import FileLock, Timeout  # 27 ms, for commands that write alone

    path = folder / LOCK
    lock = FileLock(path, timeout=LOCK_SECONDS, poll_interval=LOCK_SECONDS / 2, fallback_to_soft=False)
    with writable(folder):
        try:
            lock.acquire()
        except Timeout:
            raise OutputError(Message(Code.BEING_WRITTEN, place=str(folder), remedy=Remedy.FOLDER)) from None
        except OSError as failure:
            if failure.errno not in NO_LOCKS:
                raise
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        lock.release()


def write_json(path: Path, data: object) -> None:
    """Data without NaN or infinities as JSON."""
    write_text(path, json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n")


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    with atomic(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(rows)


def write_text(path: Path, text: str) -> None:
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    with atomic(path) as draft:
        draft.write_bytes(content)


@dataclass
class Unreadable(Exception):
    """A file that is not what it should be: a sentence on why, and what to do; the line, where that is in the file."""

    sentence: str
    line: int | None = None


class Words(NamedTuple):
    """What messages on a file speak of: "the case", "a case file", "fig1.toml", "TOML", what to do if empty."""

    content: str
    kind: str
    example: str
    format: str
    start: str
    may_have_mark: bool = False


def read_bytes(path: Path, words: Words, most: int = LARGEST) -> bytes:
    """What a plain file of so many bytes at most holds. Raises Unreadable."""
    try:
        about = path.stat()
        mode = about.st_mode
        if stat.S_ISDIR(mode):
            raise Unreadable(f"is a directory; name {words.kind} in it, such as {words.example}")
        if not stat.S_ISREG(mode):
            raise Unreadable(f"is a pipe or a device, not a file; write {words.content} into a file and name that")
        if about.st_size > most:
            said = f"has {about.st_size} bytes, and {words.kind} has at most {most}"
            raise Unreadable(f"{said}; name another, such as {words.example}")
        return path.read_bytes()
    except FileNotFoundError:
        raise Unreadable(f"no such file; look in {path.parent.resolve()} or give the full path") from None
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise Unreadable(f"cannot be read ({reason}); check its name and permissions") from None


def read_text(path: Path, words: Words, *, may_be_latin: bool = False, most: int = LARGEST) -> str:
    """The text of a file in UTF-8, or Latin-1 if it may be, without a byte order mark where it may have one.

    Raises:
        Unreadable: it is none.
    """
    return text_of(read_bytes(path, words, most), words, may_be_latin=may_be_latin)


def text_of(content: bytes, words: Words, *, may_be_latin: bool = False) -> str:
    """The text of what a file holds, see `read_text`. Raises Unreadable."""
    if content.startswith(BOM_UTF8) and not words.may_have_mark:
        raise Unreadable('starts with a byte order mark; save it as "UTF-8", not "UTF-8 with BOM"', 1)
    content = content.removeprefix(BOM_UTF8)
    if b"\0" in content:
        raise Unreadable(f"is binary or UTF-16, not UTF-8 text; name a {words.format} file, or save it as UTF-8")
    try:
        text = content.decode()
    except UnicodeDecodeError as error:
        if may_be_latin:
            return content.decode("latin-1")
        line = content.count(b"\n", 0, error.start) + 1
        raise Unreadable(f"is not UTF-8 text: byte 0x{content[error.start]:02x}; save it as UTF-8", line) from None
    if not text.strip():
        raise Unreadable(f"is empty; {words.start}")
    return text
