"""The bytes or the text of a file that somebody wrote, or one sentence on why it has none."""

from __future__ import annotations

import stat
from codecs import BOM_UTF8
from pathlib import Path
from typing import NamedTuple

from fpsolve.files import LARGEST


class Unreadable(Exception):
    """A file that is not what it should be: a sentence on why, and what to do; the line, where that is in the file."""

    def __init__(self, sentence: str, line: int | None = None) -> None:
        super().__init__(sentence)
        self.sentence, self.line = sentence, line


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
        reason = getattr(error, "strerror", None) or error
        raise Unreadable(f"cannot be read ({reason}); check its name and permissions") from None


def read_text(path: Path, words: Words, *, may_be_latin: bool = False, most: int = LARGEST) -> str:
    """The text of a file in UTF-8, or Latin-1 if it may be, without a byte order mark where it may have one.

    Raises:
        Unreadable: it is none.
    """
    content = read_bytes(path, words, most)
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
