"""What is wrong, on the standard error, and exit codes."""

from __future__ import annotations

import os
import sys

from rich.console import Console
from rich.text import Text

from fpsolve.messages import escaped, message_of

CHECK_FAILED, BAD_INPUT, NOT_CONVERGED = 1, 2, 3
"""Exit codes where a check fails, where input is wrong, and where something did not converge."""


def print_error(text: str) -> None:
    """Print what is wrong on the standard error."""
    try:
        Console(stderr=True).print(Text(escaped(message_of(text))), style="bold red", soft_wrap=True)
    except (OSError, SystemExit):  # there is no place left to say it
        drop_blocked_output()


def drop_blocked_output() -> None:
    """Drop what waits in the standard output or errors and cannot be written, so that Python need not at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
