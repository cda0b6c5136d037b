"""A TOML file as data together with the place of every key, which `tomllib` does not tell."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

from fpsolve.arrays import shortened
from fpsolve.case.keys import get, place_of, put
from fpsolve.errors import CaseError, Fault
from fpsolve.files import Unreadable, Words, read_text
from fpsolve.messages import is_control
from fpsolve.model.parameters import without_unit

_BLANK = re.compile(r"(?:\s|#[^\n]*)*+")
_KEY = re.compile(r'"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|[A-Za-z0-9_-]+')
_STRING = re.compile(r'"""(?:\\.|[^\\])*?"""+|\'\'\'.*?\'\'\'+|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'', re.DOTALL)
_WORDS = Words("the case", "a case file", "fig1.toml", "TOML", "start from a copy of cases/minimal.toml")
_SCALAR = re.compile(r"[^,\]}\n#]+")
MOST_BYTES = 2**22
"""Of a case file."""
LONGEST_SHOWN = 200
"""Letters of an assignment of the command line in a message."""
_TOO_DEEP = "lists or tables are nested too deeply; a case needs three levels"


Keys = tuple[str | int, ...]


def dotted(path: Sequence[str | int]) -> str:
    """("expect", 0, "p") as expect.0.p; the same name for a quoted "noise.D0" and a dotted noise.D0."""
    return ".".join(map(str, path))


class Scanner:
    """Walks TOML that `tomllib` has accepted, or all that comes before its error.

    Attributes:
        lines: line of each dotted key, table and list entry.
        assigned: path of each `key = value` outside inline tables, in order.
        repeated: the dotted key that is set twice first, and its second line; None where there is none.
    """

    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0
        self.lines: dict[str, int] = {}
        self.assigned: list[Keys] = []
        self.repeated: tuple[str, int] | None = None
        self._newlines = [match.start() for match in re.finditer("\n", text)]
        self._explicit: set[str] = set()
        self._entries: dict[Keys, int] = {}  # the last one of each list of tables

    def scan(self) -> Scanner:
        base: Keys = ()
        while mark := self._peek():
            if mark == "[":
                base = self._header()
            else:
                self.assigned.append(self._assignment(base))
        return self

    def _take(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.at)
        if match is None:
            raise ValueError(f"cannot read the text from character {self.at} on")
        self.at = match.end()
        return match.group()

    def _peek(self) -> str:
        self._take(_BLANK)
        return self.text[self.at : self.at + 1]

    def _skip(self, mark: str) -> bool:
        found = self._peek() == mark
        self.at += found
        return found

    def _note(self, path: Keys) -> None:
        line, key = bisect_left(self._newlines, self.at) + 1, dotted(path)
        for end in range(len(path) - 1, 0, -1):
            if (table := dotted(path[:end])) in self.lines:  # and so are all around it
                break
            self.lines[table] = line
        if key not in self._explicit:
            self._explicit.add(key)
            self.lines[key] = line
        elif self.repeated is None:
            self.repeated = key, line

    def _key(self) -> list[str]:
        parts: list[str] = []
        while not parts or self._skip("."):
            self._peek()  # past blanks
            token = self._take(_KEY)
            parts.append(tomllib.loads(f"key = {token}")["key"] if token[0] in "\"'" else token)
        return parts

    def _header(self) -> Keys:
        is_list = self.text.startswith("[[", self.at)
        self.at += 1 + is_list
        path: Keys = ()
        keys = self._key()
        for i, part in enumerate(keys):
            path = (*path, part)
            if is_list and i == len(keys) - 1:
                self._entries[path] = self._entries.get(path, -1) + 1
            if path in self._entries:
                path = (*path, self._entries[path])
        self._note(path)
        self.at += 1 + is_list
        return path

    def _assignment(self, base: Keys) -> Keys:
        path = (*base, *self._key())
        self._note(path)
        if not self._skip("="):
            raise ValueError("a key without a value")
        self._value(path)
        return path

    def _value(self, path: Keys) -> None:
        if self._skip("["):
            index = 0
            while not self._skip("]"):
                self._note((*path, index))
                self._value((*path, index))
                self._skip(",")
                index += 1
        elif self._skip("{"):
            while not self._skip("}"):
                self._assignment(path)
                self._skip(",")
        else:
            self._take(_STRING if self._peek() in ("'", '"') else _SCALAR)


class Place(NamedTuple):
    """Where a key stands: its line, or the `--set` or other option that gave it."""

    line: int | None = None
    typed: str = ""


@dataclass
class Document:
    """The data of a TOML file and of the command line's changes to it.

    Attributes:
        data: what `tomllib` made of it.
        places: where each dotted key stands.
        faults: what is wrong with the changes.
        text: the file as it was read.
    """

    data: dict[str, object] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)
    text: str = ""

    def fault(self, path: Sequence[str | int], key: str, sentence: str) -> Fault:
        """A fault at the place of this path, or of the nearest table around it that has one."""
        around = (self.places.get(dotted(path[:end])) for end in range(len(path), 0, -1))
        place = next((each for each in around if each is not None), Place())
        return Fault(f"{place.typed}: {key}" if place.typed else key, place.line, sentence)

    def override(self, text: str, typed: str) -> None:
        """Apply one `key=value` of the command line, with what was typed; what is wrong with it joins the faults."""
        try:
            if type(text) is not str:
                raise ValueError("is no text")
            if any(is_control(letter) and letter not in "\t\n" for letter in text):
                raise ValueError("has control characters")
            text = _quoted_if_bare(text)
            assigned = Scanner(text).scan().assigned
            if len(assigned) != 1:
                raise ValueError(f"must be one key=value, but there are {len(assigned)} here")
            value = get(loads(text), key := dotted(assigned[0]))
            place = place_of(self.data, key).removesuffix(".value" * isinstance(value, dict))  # a table for a table
            put(self.data, place, value)
        except RecursionError:
            self.faults.append(Fault(typed, None, _TOO_DEEP))
        except ValueError as error:
            examples = "--set oscillator.omega=2.0 or --set 'oscillator.impact=\"delta\"'"
            self.faults.append(Fault(typed, None, f"{error}; write it as in {examples}"))
        else:
            self.places = {key: each for key, each in self.places.items() if not key.startswith(f"{place}.")}
            self.places[place] = Place(typed=typed)
            for around in accumulate(place.split("."), "{}.{}".format):
                self.places.setdefault(around, Place(typed=typed))


def _quoted_if_bare(text: str) -> str:
    """key=word as key="word": a shell takes the quotes away."""
    key, _, value = map(str.strip, text.partition("="))
    is_word = re.fullmatch(r"[A-Za-z./~][\w./~: -]*", value) and value not in ("true", "false", "nan", "inf")
    return f'{key}="{value}"' if is_word else text


def read_document(
    path: str | Path, overrides: Sequence[str] = (), options: Mapping[str, str] | None = None
) -> Document:
    """Read a TOML file and apply the command line's `key=value` texts, and those that its options stand for.

    Raises:
        CaseError: the file cannot be read or is not TOML.
    """
    try:
        text = read_text(Path(path), _WORDS, most=MOST_BYTES)
        document = document_of(text)
    except Unreadable as error:
        raise CaseError(str(path), [Fault("", error.line, error.sentence)]) from None
    except RecursionError:
        raise CaseError(str(path), [Fault("", None, _TOO_DEEP)]) from None
    except ValueError as error:
        raise CaseError(str(path), [_syntax_fault(text, str(error))]) from None
    for typed, change in [
        *((f"--set {shortened(str(each), LONGEST_SHOWN)}", each) for each in overrides),
        *(options or {}).items(),
    ]:
        document.override(change, typed)
    return document


def document_of(text: str) -> Document:
    """What a text of TOML says. Raises `ValueError` or `RecursionError` where it is none."""
    data, lines = loads(text), Scanner(text).scan().lines
    return Document(data, {key: Place(line) for key, line in lines.items()}, text=text)


def loads(text: str) -> dict[str, object]:
    """The data of TOML, 0 without a sign. Raises ValueError where it is none."""
    return tomllib.loads(text, parse_float=lambda number: float(number) + 0.0)


def _syntax_fault(text: str, message: str) -> Fault:
    """tomllib's own message with its line; for a key that is set twice, which one and where."""
    where = re.search(r" \(at (?:line (\d+), column \d+|end of document)\)", message)
    line = int(where[1]) if where and where[1] else text.count("\n") + 1 if where else None
    if re.search("overwrite|twice|[Dd]uplicate", message):
        scanner = Scanner(text)
        with suppress(ValueError, RecursionError):
            scanner.scan()
        if scanner.repeated:
            key, second = scanner.repeated
            first, key = scanner.lines[key], re.sub(r"\.(\d+)(?=\.|$)", r"[\1]", key)
            return Fault(key, second, f"set twice, first on line {first}; remove one of them")
    shown = "".join(text.splitlines()[line - 1 : line]).strip() if line else ""
    return Fault("", line, f"not valid TOML: {message}; {_syntax_remedy(shown)}")


def _syntax_remedy(line: str) -> str:
    """What a line that is no TOML probably lacks."""
    key, _, value = (part.strip() for part in line.partition("="))
    if re.search(r"[^\x00-\x7f]", key):
        return f"{key} needs plain letters, as in omega = 1.0"
    if re.fullmatch(r"-?\d+,\d+", value):
        return f"write the decimal point as in {key} = {value.replace(',', '.')}"
    if re.fullmatch(r"-?[\d.]+(e-?\d+)?\s*[A-Za-z/%]+.*", value):
        return f"write the number alone, without a unit: {line}{without_unit(value)}"
    if re.fullmatch(r"[A-Za-z][\w./-]*", value):
        return f'write a text in quotes, as in {key} = "{value}"'
    if line and (slip := re.search(r",\s*,", line) or re.search(r"[\]\"'\d]\s*,\s*$", value)):
        return f"remove the comma at {slip.group().strip()!r}: {line}"
    return f"correct the syntax{' of: ' + line if line else ''}, see https://toml.io"
