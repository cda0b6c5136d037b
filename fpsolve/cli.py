"""The command line `fpsolve`: its commands, their exit codes, and what is said where one fails."""

from __future__ import annotations

import logging
import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from io import TextIOWrapper
from pathlib import Path

from cyclopts import App, CycloptsError, CycloptsPanel, Group, Parameter
from rich.console import Console

from fpsolve import __version__
from fpsolve.commands.errors import BAD_INPUT, NOT_CONVERGED, drop_blocked_output, print_error
from fpsolve.errors import FpsolveError, NotConverged, WorkersDied
from fpsolve.messages import escaped, short
from fpsolve.signals import INTERRUPTED, TERMINATED, is_interrupt, sigterm_interrupts

_TEXTS = {path.stem: path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("commands/*.py")}
COMMANDS = {name: text.split('"""')[1] for name, text in sorted(_TEXTS.items()) if f"\ndef {name}(" in text}
"""What each does: the first line of a file of its name in fpsolve/commands with a function of it, read when called."""
CLOSED_PIPE = 141
TRACEBACK = "--traceback"
"""What any command takes to print also where an error was raised."""

app = App(
    name="fpsolve",
    help="""Moment Lyapunov exponents of linear systems under random loads, by finite
    elements.

    A case file states a vibro-impact oscillator, [oscillator], or any other
    linear system, [system].

    Example: fpsolve run cases/fig1.toml

    Exit codes: 0 success, 1 a checked value differs or a design is out of
    reach, 2 bad input, 3 not converged or nothing found, 130 interrupted,
    143 terminated

    Commands:
      """
    + "\n      ".join(f"{name:8}  {does}" for name, does in COMMANDS.items())
    + """

    fpsolve COMMAND --help prints its arguments, fpsolve --version the version.
    With --traceback a command also prints where an error was raised.""",
    usage="Usage: fpsolve COMMAND",
    version=lambda: f"fpsolve {__version__}",
    group_commands=Group(show=False),
    help_format="plaintext",
    default_parameter=Parameter(negative=""),  # no --no-json, and no --empty-by
    suppress_keyboard_interrupt=False,
    error_formatter=lambda error: CycloptsPanel(escaped(short(str(error)))),
)
for _name in COMMANDS:
    app.command(f"fpsolve.commands.{_name}:{_name}")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit code, see the help of `app`; SIGTERM interrupts it, too."""
    if argv is None and not sys.warnoptions:  # fpsolve tells what NumPy and matplotlib warn of
        warnings.simplefilter("ignore")
        os.environ["PYTHONWARNINGS"] = "ignore"  # of workers
        logging.disable(logging.WARNING)
    with sigterm_interrupts() as received:
        code = _run(sys.argv[1:] if argv is None else argv)
    return TERMINATED if received else code


def _run(given: Sequence[str]) -> int:
    for stream in (sys.stdout, sys.stderr):  # an output whose encoding has no Greek shows a question mark
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        code: int | None = app(
            [each for each in given if each != TRACEBACK],
            result_action="return_value",
            exit_on_error=False,
            error_console=Console(stderr=True),
        )
        if sys.stdout is not None:  # as it is where the output is closed
            sys.stdout.flush()
    except CycloptsError:  # cyclopts has said what is wrong
        return BAD_INPUT
    except FpsolveError as failure:
        if TRACEBACK in given:
            traceback.print_exc()
        print_error(failure.message)
        return NOT_CONVERGED if isinstance(failure, NotConverged | WorkersDied) else BAD_INPUT
    except (BrokenPipeError, SystemExit):  # the reader of the output has gone, as with `| head -1`; rich exits then
        drop_blocked_output()
        return CLOSED_PIPE
    except OSError as failure:
        drop_blocked_output()
        place, reason = failure.filename or "the output", failure.strerror or failure
        print_error(f"{place} cannot be written: {reason}; send it to another place")
        return BAD_INPUT
    except BaseException as failure:
        if not is_interrupt(failure):
            raise
        print_error(str(failure) if isinstance(failure, KeyboardInterrupt) and failure.args else "interrupted")
        return INTERRUPTED
    return code or 0


if __name__ == "__main__":
    sys.exit(main())
