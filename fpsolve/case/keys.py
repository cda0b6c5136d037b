"""Dotted keys such as "noise.D0": TOML has them in nested tables or, with quotes, in one."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping

from fpsolve.model.faults import table_of


def get(table: Mapping[str, object], key: str) -> object:
    """What stands under a key; None where nothing does."""
    name, inner = _split(table, key)
    return get(table_of(table.get(name)), inner) if inner else table.get(name)


def put(table: dict[str, object], key: str, value: object) -> None:
    """Set a key where it stands, or in nested tables. Raises `ValueError` where something around it is no table."""
    name, inner = _split(table, key)
    if not inner:
        table[name] = value
        return
    child = table.setdefault(name, {})
    if not isinstance(child, dict):
        raise ValueError(f"{name} is not a table, so it has no key {inner.partition('.')[0]}")
    put(child, inner, value)


def place_of(table: Mapping[str, object], key: str) -> str:
    """Where a parameter is stated: as "system.parameters.omega" or "system.parameters.omega.value"; else the key."""
    section, _, name = key.rpartition(".")
    places = (f"{place}{inner}" for place in (key, f"{section}.parameters.{name}") for inner in (".value", ""))
    return next((each for each in places if get(table, each) is not None), key)


def leaves(
    table: Mapping[str, object], is_value: Container[str] = (), section: str = ""
) -> Iterator[tuple[str, object]]:
    """All keys with their values, where the tables that have keys of `is_value` are values."""
    for name, item in table.items():
        inner = table_of(item)
        if inner and section + name not in is_value and not any(each in is_value for each in inner):
            yield from leaves(inner, is_value, f"{section}{name}.")
        else:
            yield section + name, item


def _split(table: Mapping[str, object], key: str) -> tuple[str, str]:
    """The longest beginning of a key that stands in a table, or else its first part, and the rest."""
    name = max((each for each in table if f"{key}.".startswith(f"{each}.")), key=len, default=key.partition(".")[0])
    return name, key[len(name) + 1 :]
