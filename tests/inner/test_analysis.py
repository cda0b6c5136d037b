"""Internals of lines of stability: curves F(u, v) = 0 whose lengths, ends, folds and crossings are known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fpsolve import NotConverged
from fpsolve.analysis import Axis, boundary
from fpsolve.analysis.continuation import LONGEST, PIECES, find_branches
from fpsolve.analysis.scan import Row, Sample, scan_row, scanned
from fpsolve.analysis.special_points import crossings, with_folds, with_values
from fpsolve.exponent import Budget
from tests.numbers.test_honesty import GAUSSIAN


def field(f, hole=(0, 0, -1)):
    """F from a function that gives F, ∂F/∂u and ∂F/∂v; it does not exist in a disc (u, v, radius)."""

    def sample(at):
        assert np.all((at >= 0) & (at <= 1)), "F is asked for outside of the square"
        if math.hypot(at[0] - hole[0], at[1] - hole[1]) < hole[2]:
            raise NotConverged("a hole")
        value, *slope = f(*at)
        return Sample(at, float(value), np.array(slope, dtype=float), 0.0, 1.0)

    return sample


def circle(u0, v0, r, **more):
    return field(lambda u, v: ((u - u0) ** 2 + (v - v0) ** 2 - r**2, 2 * (u - u0), 2 * (v - v0)), **more)


def straight(a, b, c, **more):
    return field(lambda u, v: (a * u + b * v - c, a, b), **more)


def scan_of(of):
    return scanned(13, (scan_row(Row(of, 13, number)) for number in range(13)))


def length(branch):
    return float(np.sum(np.linalg.norm(np.diff(branch.fine, axis=0), axis=1)))


def pair(u, v, gap=0.01):
    one, other = v - 0.41, v - 0.41 - gap - 0.005 * u
    return one * other, -0.005 * one, one + other


S = field(lambda u, v: (u - 0.5 - 6 * (v - 0.5) ** 3 + (v - 0.5), 1, 1 - 18 * (v - 0.5) ** 2))
CURVES = {  # F, the lengths of its branches, how many are closed, folds in u and in v, obstacles
    "circle": (circle(0.5, 0.5, 0.4), [0.8 * math.pi], 1, 2, 2, 0),
    "circle between nodes": (circle(0.31, 0.64, 0.006), [0.012 * math.pi], 1, 2, 2, 0),
    "circle that leaves": (circle(0.9, 0.5, 0.3), [0.6 * (math.pi - math.acos(1 / 3))], 0, 1, 2, 0),
    "corner": (straight(1, 2, 1e-3), [1e-3 * math.sqrt(1.25)], 0, 0, 0, 0),
    "along an edge": (straight(0, 1, 0), [1], 0, 0, 0, 0),
    "s": (S, [1.60405], 0, 2, 0, 0),
    "two close lines": (field(pair), [1, 1], 0, 0, 0, 0),
    "hairpin": (
        field(lambda u, v: (1e3 * ((v - 0.5) ** 2 - 2e-4 * (u - 0.19)), -0.2, 2e3 * (v - 0.5))), [1.6205], 0, 1, 0, 0,
    ),
    "hole": (straight(0, 1, 0.47, hole=(0.5, 0.5, 0.2)), [0.5 - math.sqrt(0.2**2 - 0.03**2)] * 2, 0, 0, 0, 2),
    "none": (circle(0.5, 0.5, 0.0), [], 0, 0, 0, 0),
}  # fmt: skip


@pytest.mark.parametrize("name", CURVES)
def test_branches_of_a_curve_are_whole(name):
    of, lengths, closed, in_u, in_v, obstacles = CURVES[name]
    branches = list(find_branches(of, scan_of(of)))
    assert sorted(map(length, branches)) == pytest.approx(sorted(lengths), rel=6e-3, abs=1e-4)
    assert closed is None or sum(each.closed for each in branches) == closed
    assert sum(len(each.obstacles) for each in branches) == obstacles
    for branch in branches:
        steps = np.diff(branch.fine[::PIECES], axis=0)
        assert np.all(np.linalg.norm(steps, axis=1) < 2 * LONGEST)
        assert all(abs(of(point.at).value) <= 1e-10 for point in branch.points)
        ends = [] if branch.closed else [branch.points[0], branch.points[-1]]
        assert sum(bool(each.label) for each in ends) == len(ends) - len(branch.obstacles)
        folded = with_folds(of, branch, ("x", "y"))
        labels = [point.label for point in folded.points]
        for count, label in ((in_u, "fold in x"), (in_v, "fold in y")):
            assert count is None or sum(label in each for each in labels) == count


def test_folds_values_and_crossings_of_a_curve_are_exact():
    [branch] = find_branches(S, scan_of(S))
    found = with_values(S, with_folds(S, branch, ("x", "y")), 0, [(0.45, "wanted")])
    at = {label: sorted(p.at[1] for p in found.points if p.label == label) for label in ("fold in x", "wanted")}
    w = 1 / math.sqrt(18)
    assert at["fold in x"] == pytest.approx([0.5 - w, 0.5 + w], abs=1e-9)
    assert at["wanted"] == pytest.approx(np.sort(np.roots([6, 0, -1, 0.05]).real) + 0.5, abs=1e-9)
    one, other = circle(0.4, 0.5, 0.3), circle(0.6, 0.5, 0.3)
    [first], [second] = (list(find_branches(each, scan_of(each))) for each in (one, other))
    met = sorted(tuple(point.at) for (_, point), _ in crossings(first, second, (one, other)))
    assert np.allclose(met, [(0.5, 0.5 - math.sqrt(0.08)), (0.5, 0.5 + math.sqrt(0.08))], atol=1e-9)


def test_seconds_of_a_set_end_a_point_of_a_line_and_not_the_line():
    x, y = Axis("oscillator.c1", -1.0, 1.0), Axis("noise.sigma", 0.5, 1.0)
    line = boundary(GAUSSIAN, "lyapunov_exponent = 0", x, y, nodes=3)
    found = replace(line, budget=Budget(seconds=1e-9)).zero_field
    with pytest.raises(NotConverged, match="budget"):
        found(np.array([0.3, 0.6]))
    assert found.stopped is None
