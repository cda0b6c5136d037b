"""Tasks for the processes of a pool, in a file that these import at once."""

import os
import signal
import time

from fpsolve.pool import processors


def square(number):
    return number * number


def deadly(number):
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.01)
    return number


def faulty(number):
    if number == 3:
        raise OSError(28, "No space left on device")
    return number


def whereabouts(_):
    time.sleep(0.05)
    return os.getpid(), processors()
