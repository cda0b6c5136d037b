"""Print what editors need to complete and check cases."""

from __future__ import annotations

from fpsolve.case.schema import schema_text


def schema() -> int:
    """Print the JSON Schema of case files, with which editors complete and check them.

    A case file names it in its first line, "#:schema fpsolve.schema.json", for the editors Taplo and Even Better TOML.

    Example: fpsolve schema > fpsolve.schema.json
    """
    print(schema_text(), end="")
    return 0
