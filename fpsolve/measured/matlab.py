"""Arrays of real numbers from MATLAB files of level 5, which `save` writes with -v6 and -v7.

`scipy.io.loadmat` reads more, but some files that are broken end the process. A file is a header of 128 bytes and
elements. An element is a type, a size and as many bytes, up to the next multiple of 8; one of up to 4 bytes has the
size in the upper half of the type. A matrix is an element of elements: flags, dimensions, name, numbers. It may be
compressed as a whole.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

HEADER = 128
MATRIX, COMPRESSED = 14, 15
TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Of numbers, by their codes."""
NUMERIC = range(6, 16)
"""Classes of arrays of numbers, from double to uint64."""
COMPLEX = 0x800
MOST_NAMES = 63


class MatError(ValueError):
    """What is wrong with a file."""


class _Element(NamedTuple):
    kind: int
    data: bytes


def read_mat(content: bytes, most: int) -> Iterator[tuple[str, Any]]:
    """The arrays of real numbers at the top level of a file, with their names; others are left out.

    Args:
        content: of the file.
        most: numbers that an array has at most.

    Raises:
        MatError: the file is none of level 5, or is broken.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:HEADER], "")
    if not order:
        raise MatError("it has no header of level 5")
    for kind, data in _elements(content[HEADER:], order):
        if kind == COMPRESSED:
            try:
                data = zlib.decompressobj().decompress(data, 8 * most + 1024)
            except zlib.error as error:
                raise MatError(str(error)) from None
            inner = next(_elements(data, order), _Element(0, b""))
            kind, data = inner
        if kind == MATRIX and (found := _array(data, order, most)) is not None:
            yield found


def _elements(data: bytes, order: str) -> Iterator[_Element]:
    place, byteorder = 0, "little" if order == "<" else "big"

    def number(at: int) -> int:
        return int.from_bytes(data[at : at + 4], byteorder)  # type: ignore[arg-type]

    while place + 8 <= len(data):
        kind, size = number(place), number(place + 4)
        if kind >> 16:
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise MatError(f"a small element has {size} bytes")
            yield _Element(kind, data[place + 4 : place + 4 + size])
            place += 8
            continue
        start, end = place + 8, place + 8 + size
        if end > len(data):
            raise MatError(f"an element states {size} bytes, and {len(data) - start} are left")
        yield _Element(kind, data[start:end])
        place = end if kind == COMPRESSED else end + -end % 8


def _array(data: bytes, order: str, most: int) -> tuple[str, Any] | None:
    """The name and the numbers of a matrix; None where it holds no real numbers."""
    parts = list(_elements(data, order))
    if len(parts) < 3 or len(parts[0].data) < 4:
        raise MatError("a matrix has no flags, dimensions and name")
    flags = int(np.frombuffer(parts[0].data[:4], f"{order}u4")[0])
    if flags & 0xFF not in NUMERIC or flags & COMPLEX:
        return None
    if len(parts) < 4 or parts[3].kind not in TYPES or len(parts[1].data) % 4:
        raise MatError("a matrix has no numbers")
    shape = [int(each) for each in np.frombuffer(parts[1].data, f"{order}i4")]
    values = np.frombuffer(
        parts[3].data[: len(parts[3].data) // _size(parts[3]) * _size(parts[3])], _type(parts[3], order)
    )
    if len(shape) < 2 or min(shape) < 0 or math.prod(shape) != values.size or values.size > most:
        raise MatError(f"a matrix of the shape {shape} has {values.size} numbers")
    return parts[2].data[:MOST_NAMES].decode("latin-1"), values.reshape(shape, order="F")


def _type(element: _Element, order: str) -> str:
    return f"{order}{TYPES[element.kind]}"


def _size(element: _Element) -> int:
    return int(TYPES[element.kind][1])
