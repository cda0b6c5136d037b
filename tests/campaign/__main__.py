"""Random problems of a family, each number beside a second method: `python -m tests.campaign FAMILY [first last]`.

It prints a line for each number that is wrong or refused, and a summary. It ends with 1 if a number is further off than
1.5 of the stated error and the doubt of the second method together, or than 4 standard errors of the simulation, or if
more than 2 % of the numbers are refused within 15 seconds of the processor each. `--times` adds a line for each seed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict

import numpy as np
from scipy.stats import t as student

from tests.campaign import FAMILIES
from tests.campaign.numbers import DEVIATIONS, Number

REFUSED = 0.02
"""The share of numbers that may be."""
BATCHES = 32
"""Of a simulation, from whose differences its standard errors are."""


def summary(numbers: list[Number]) -> str:
    """Of the numbers of one second method."""
    known, method = [each for each in numbers if np.isfinite(each.off)], numbers[0].method
    told = (
        f"{method}: {len(numbers)} numbers, {sum(each.is_wrong for each in numbers)} wrong, "
        f"{sum(bool(each.found.reason) for each in numbers)} refused, "
        f"{sum(each.is_unknown for each in numbers)} without a second value"
    )
    if method in DEVIATIONS and known:
        within = student.ppf(0.975, BATCHES - 1)
        shares = np.array([each.off / np.hypot(each.known[1], each.found.stated) for each in known])
        return f"{told}; {np.mean(shares <= within):.1%} within the interval of 95 %"
    shares = np.array([(each.off - each.known[1]) / each.found.stated for each in known if each.found.stated])
    return f"{told}; largest error {shares.max():.2f} of the stated one" if shares.size else told


def main() -> int:
    """Print what is wrong or refused, and the summary; 1 if that is more than may be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("family", choices=FAMILIES)
    parser.add_argument("first", type=int, nargs="?", default=0)
    parser.add_argument("last", type=int, nargs="?")
    parser.add_argument("--times", action="store_true", help="a line for each seed")
    asked = parser.parse_args()
    draw, count = FAMILIES[asked.family]
    found, started = defaultdict(list), time.process_time()
    for seed in range(asked.first, count if asked.last is None else asked.last + 1):
        begun = time.process_time()
        for each in draw(seed):
            found[each.method].append(each)
            if each.is_wrong or each.found.reason:
                print(f"{seed} {each}", flush=True)
        if asked.times:
            print(f"{seed}: {time.process_time() - begun:.1f} s", flush=True)
    for numbers in found.values():
        print(summary(numbers))
    every = [each for numbers in found.values() for each in numbers]
    spent = np.array([each.found.seconds for each in every] or [0.0])
    wrong, refused = sum(each.is_wrong for each in every), sum(bool(each.found.reason) for each in every)
    print(
        f"{wrong} of {len(every)} wrong, {refused} refused; fpsolve {spent.sum():.0f} s, median "
        f"{np.median(spent):.2f} s, longest {spent.max():.1f} s; all {time.process_time() - started:.0f} s"
    )
    return int(wrong > 0 or refused > REFUSED * len(every))


if __name__ == "__main__":
    sys.exit(main())
