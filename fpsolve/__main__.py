"""The command line as `python -m fpsolve`, and as `fpsolve`."""

import os
import signal
import sys


def main() -> None:
    """Run the command line. What is imported before it has nothing to keep: there Ctrl-C ends the process at once."""
    former = signal.getsignal(signal.SIGINT)
    if former is signal.default_int_handler:  # and not ignored, as it is in the background of a shell
        signal.signal(signal.SIGINT, _end)
    from fpsolve.cli import main as run  # 140 ms, in which an interrupt may become another exception

    signal.signal(signal.SIGINT, former)
    code = run()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # as it is all done
    sys.exit(code)


def _end(*_: object) -> None:
    os.write(2, b"interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
