"""Curves F(u, v) = 0 of polynomials and sines, whose points, lengths, folds and crossings are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fpsolve.analysis.continuation import (
    FRAME,
    LONGEST,
    MOST_CORRECTIONS,
    SHORTEST,
    correct,
    find_branches,
    find_zero,
    with_branch,
)
from fpsolve.analysis.scan import FINE, TOLERANCE, Row, Sample, scan_row, scanned
from fpsolve.analysis.special_points import crossings, with_folds, with_points, with_values
from fpsolve.errors import NotConverged
from fpsolve.messages import Code, Message
from tests.conftest import sampled

NODES = 13
NAMES = ("x", "y")


def field(f, hole=None):
    """F from a function that gives F, ∂F/∂u and ∂F/∂v; it does not exist in a disc (u, v, radius)."""

    def sample(at):
        assert np.all((at >= 0) & (at <= 1)), "F is asked for outside of the square"
        if hole is not None and math.hypot(at[0] - hole[0], at[1] - hole[1]) < hole[2]:
            raise NotConverged("a hole")
        value, by_u, by_v = f(*at)
        return Sample(at, float(value), np.array([by_u, by_v], dtype=float), 0.0, 1.0)

    return sample


def circle(u0, v0, radius):
    return field(lambda u, v: ((u - u0) ** 2 + (v - v0) ** 2 - radius**2, 2 * (u - u0), 2 * (v - v0)))


def line(a, b, c):
    """a u + b v = c."""
    return field(lambda u, v: (a * u + b * v - c, a, b))


def scan_of(of, nodes=NODES):
    rows = [Row(lambda: of, nodes, number) for number in range(nodes)]
    return scanned(rows, map(scan_row, rows))


def lines(of, nodes=NODES, longest=LONGEST):
    """All branches, each checked for what must always hold."""
    branches = list(find_branches(of, scan_of(of, nodes), longest))
    for branch in branches:
        check(branch, of, longest)
    for i, one in enumerate(branches):
        for other in branches[:i]:
            assert not any(one.holds(point.sample, 1e-6) for point in other.points[1:-1]), "traced twice"
    return branches


def check(branch, of, longest=LONGEST):
    """Points are on the curve, in order, close to each other; ends are on the frame, or an obstacle is told."""
    at = branch.at
    steps = np.diff(at, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    assert np.all((at >= 0) & (at <= 1))
    for point in branch.points:
        assert abs(of(point.sample.at).value) <= TOLERANCE
    assert np.all(lengths > 0)
    assert np.all(lengths < 2 * longest)
    tangents = np.array([point.sample.tangent for point in branch.points])
    tangents = np.concatenate([tangents, tangents[:1]]) if branch.closed else tangents
    along = steps / lengths[:, None]
    firm = lengths > 1e-6  # where the direction of a step is not rounding
    assert np.all(np.sum(along * tangents[:-1], axis=1)[firm] > 0.9)
    assert np.all(np.sum(along * tangents[1:], axis=1)[firm] > 0.9)
    ends = [] if branch.closed else [branch.points[0], branch.points[-1]]
    inner = 0
    for point in ends:
        on_frame = np.any((point.sample.at == 0) | (point.sample.at == 1))
        assert (FRAME in point.label) == on_frame
        inner += not on_frame
    assert inner == len(branch.obstacles)
    assert not any(FRAME in point.label for point in (branch.points if branch.closed else branch.points[1:-1]))


def length(branch):
    return float(np.sum(np.linalg.norm(np.diff(branch.at, axis=0), axis=1)))


def labelled(branch, label):
    return [point.sample.at for point in branch.points if label in point.label.split("; ")]


def apart(branch, points):
    """How far points are from a branch."""
    return max(float(np.min(np.linalg.norm(branch.fine - point, axis=1))) for point in points)


@pytest.mark.parametrize(("u", "v", "radius"), [(0.5, 0.5, 0.4), (0.31, 0.64, 0.2), (0.7, 0.2, 0.03)])
def test_a_circle_is_closed(u, v, radius):
    [branch] = lines(circle(u, v, radius))
    assert branch.closed
    assert not branch.obstacles
    assert length(branch) == pytest.approx(2 * math.pi * radius, rel=2e-3)  # of chords that turn by 0.15
    assert np.allclose(np.linalg.norm(branch.at - (u, v), axis=1), radius, rtol=0, atol=1e-8)


@pytest.mark.parametrize("seed", sampled(*range(12), keep=6))
def test_a_circle_between_the_nodes_is_found(seed):
    """A circle of more than half the diagonal of a cell of the finer grid has a point of that inside."""
    least = math.sqrt(0.5) / ((NODES - 1) * (FINE - 1))
    u, v = np.random.default_rng(seed).uniform(0.1, 0.9, 2)
    [branch] = lines(circle(u, v, 1.01 * least))
    assert branch.closed
    assert length(branch) == pytest.approx(2 * math.pi * 1.01 * least, rel=2e-3)
    assert least < 0.005


def test_a_circle_that_leaves_the_frame():
    branches = lines(circle(0.9, 0.5, 0.3))
    [branch] = branches
    angle = 2 * math.pi - 2 * math.acos(0.1 / 0.3)
    assert length(branch) == pytest.approx(0.3 * angle, rel=2e-3)
    assert branch.at[[0, -1], 0] == pytest.approx([1, 1], abs=0)


@pytest.mark.parametrize("beyond", sampled(1e-9, 0.0, -1e-3, -1e-6, -1e-9, 1e-6, 1e-3))
def test_a_circle_that_about_touches_the_frame(beyond):
    """It is whole, but for what is outside."""
    of = circle(0.5, 0.5, 0.5 + beyond)
    branches = lines(of)
    angle = 2 * math.pi - 8 * math.acos(min(1.0, 0.5 / (0.5 + beyond)))
    assert sum(map(length, branches)) == pytest.approx((0.5 + beyond) * angle, abs=0.01)
    assert not any(branch.obstacles for branch in branches)


@pytest.mark.parametrize("size", [1e-4, 1e-3, 0.01, 0.3])
@pytest.mark.parametrize("corner", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_a_corner_that_is_cut_off(corner, size):
    a, b = 1 - 2 * np.array(corner)
    of = field(lambda u, v: (abs(u - corner[0]) + 2 * abs(v - corner[1]) - size, a, 2 * b))
    [branch] = lines(of)
    ends = sorted((abs(branch.at[[0, -1]] - corner)).tolist())
    assert np.allclose(ends, [[0, size / 2], [size, 0]], atol=1e-9)


@pytest.mark.parametrize("slope", [0.3, 1.0, 7.0])
def test_a_line_through_a_corner(slope):
    """u = v/slope leaves through the corner exactly, or within rounding."""
    [branch] = lines(line(slope, -1, 0))
    assert np.allclose(sorted(branch.at[[0, -1]].tolist())[0], 0, atol=1e-9)
    [branch] = lines(line(slope, 1, slope + 1))
    assert min(np.linalg.norm(branch.at[k] - 1) for k in (0, -1)) < 1e-9


def test_a_curve_through_two_corners():
    [branch] = lines(field(lambda u, v: (v - u**2, -2 * u, 1)))
    assert np.allclose(branch.at[0], (0, 0), atol=1e-9) or np.allclose(branch.at[-1], (0, 0), atol=1e-9)
    assert length(branch) == pytest.approx(math.sqrt(5) / 2 + math.asinh(2) / 4, rel=1e-4)


@pytest.mark.parametrize("of", [line(0, 1, 0), line(0, -1, -1), line(1, 0, 0), line(-3, 0, -3)])
def test_a_curve_along_an_edge(of):
    [branch] = lines(of)
    assert length(branch) == pytest.approx(1)
    assert not with_folds(of, branch, NAMES).points[0].label.startswith("fold")


@pytest.mark.parametrize("slope", [1e-3, 1e-6, 1e-12])
@pytest.mark.parametrize("middle", [0.5, 0.0, 0.123])
def test_a_line_nearly_along_an_edge(slope, middle):
    of = field(lambda u, v: (v - slope * (u - middle), -slope, 1))
    branches = lines(of)
    assert sum(map(length, branches)) == pytest.approx(1 - middle, abs=1e-3) or slope == 1e-12
    assert not any(branch.obstacles for branch in branches)


def test_a_parabola_that_touches_the_frame():
    """v = 4 (u − ½)² touches v = 0 and ends in two corners."""
    of = field(lambda u, v: (v - 4 * (u - 0.5) ** 2, -8 * (u - 0.5), 1))
    branches = lines(of)
    assert sum(map(length, branches)) == pytest.approx(math.sqrt(17) / 2 + math.asinh(4) / 8, rel=1e-3)
    assert not any(branch.obstacles for branch in branches)


def s_curve():
    """v = ½ + 6w³ − w with w = u − ½ turns back in v where 18w² = 1; u and v exchanged."""
    return field(lambda u, v: (u - 0.5 - 6 * (v - 0.5) ** 3 + (v - 0.5), 1, 1 - 18 * (v - 0.5) ** 2))


def test_an_s_has_two_folds():
    of = s_curve()
    [branch] = lines(of)
    folded = with_folds(of, branch, NAMES)
    w = 1 / math.sqrt(18)
    expected = [[0.5 + 6 * s**3 - s, 0.5 + s] for s in (-w, w)]
    assert np.allclose(sorted(labelled(folded, "fold in x"), key=lambda at: at[1]), expected, rtol=0, atol=1e-9)
    assert not labelled(folded, "fold in y")
    assert len(folded.points) == len(branch.points) + 2
    check(folded, of)


@pytest.mark.parametrize("value", sampled(0.5 + 4 / 3 / math.sqrt(72) - 1e-7, 0.45, 0.5, 0.3, keep=2))
def test_values_of_an_s(value):
    """6w³ − w = u − ½ has three roots between the folds, and one beyond; 1e-7 from a fold two are 1e-4 apart."""
    of = s_curve()
    [branch] = lines(of)
    found_there = with_values(of, with_folds(of, branch, NAMES), 0, [(value, "wanted")])
    roots = np.roots([6, 0, -1, 0.5 - value])
    expected = np.sort(roots[abs(roots.imag) < 1e-9].real) + 0.5
    at = np.array(sorted(labelled(found_there, "wanted"), key=lambda at: at[1]))
    assert np.all(at[:, 0] == value)
    inside = expected[(expected > 0) & (expected < 1)]
    slope = abs(1 - 18 * (inside - 0.5) ** 2)
    assert np.all(abs(at[:, 1] - inside) < np.minimum(1e-9 / slope, 2e-5))
    check(found_there, of)


def test_folds_of_a_circle():
    of = circle(0.4, 0.55, 0.3)
    [branch] = lines(of)
    branch = with_folds(of, branch, NAMES)
    for label, expected in (("fold in x", [(0.1, 0.55), (0.7, 0.55)]), ("fold in y", [(0.4, 0.25), (0.4, 0.85)])):
        assert np.allclose(
            sorted(np.round(at, 12).tolist() for at in labelled(branch, label)), expected, rtol=0, atol=1e-9
        )
    check(branch, of)


def test_a_fold_at_a_point_that_is_there():
    of = circle(0.5, 0.5, 0.25)
    [branch] = lines(of)
    known = with_values(of, branch, 0, [(0.25, "side"), (0.5, "top")])
    folded = with_folds(of, known, NAMES)
    assert [len(labelled(folded, label)) for label in ("fold in x", "fold in y", "side", "top")] == [2, 2, 1, 2]
    assert len(folded.points) == len(known.points) + 1  # at u = 0.75
    again = with_folds(of, with_values(of, folded, 0, [(0.25, "side")]), NAMES)
    assert [point.label for point in again.points] == [point.label for point in folded.points]


@pytest.mark.parametrize("noise", [0.0, 1e-8])
def test_a_straight_line_has_no_folds(noise):
    """Where ∂F/∂v is rounding."""
    rng = np.random.default_rng(3)
    of = field(lambda u, v: (u - 0.37, 1, noise * rng.normal()))
    [branch] = lines(of)
    assert len(branch.points) > 40
    assert all("fold" not in point.label for point in with_folds(of, branch, NAMES).points)


def test_values_are_found_exactly():
    of = field(lambda u, v: (v - 0.5 - 0.3 * np.sin(7 * u), -2.1 * np.cos(7 * u), 1))
    [branch] = lines(of)
    wanted = [(0.0, "left"), (0.3, "a"), (0.8, "b"), (1.0, "right"), (-0.1, "no")]
    branch = with_values(of, with_folds(of, branch, NAMES), 0, wanted)
    for value, label in wanted[:-1]:
        [at] = labelled(branch, label)
        assert at[0] == value
        assert at[1] == pytest.approx(0.5 + 0.3 * math.sin(7 * value), abs=1e-9)
    assert not labelled(branch, "no")
    heights = with_values(of, branch, 1, [(0.65, "high")])
    expected = np.array([1, 5, 13]) * math.pi / 42
    assert np.allclose(sorted(at[0] for at in labelled(heights, "high")), expected, rtol=0, atol=1e-9)
    check(heights, of)


def hyperbola(size, turned=False):
    def value(u, v):
        u, v = u - 0.5, v - 0.5
        return (u * u - v * v - size, 2 * u, -2 * v) if turned else (u * v - size, v, u)

    return field(value)


@pytest.mark.parametrize("size", sampled(-1e-6, 1e-4, 1e-2, 1e-6, -1e-4))
@pytest.mark.parametrize("turned", sampled(True, False))
def test_two_branches_of_a_hyperbola(size, turned):
    of = hyperbola(size, turned)
    branches = lines(of)
    assert len(branches) == 2
    for branch in branches:
        assert not branch.obstacles
        assert [FRAME in branch.points[k].label for k in (0, -1)] == [True, True]
        middle = branch.fine - 0.5
        closest = np.min(np.linalg.norm(middle, axis=1))
        assert closest == pytest.approx(math.sqrt((1 if turned else 2) * abs(size)), rel=1e-2)


@pytest.mark.slow
def test_a_saddle_ends_four_arms():
    """Branches that meet end there, each with an obstacle, and none goes on along another."""
    of = hyperbola(0.0)
    branches = lines(of)
    assert len(branches) == 4
    for branch in branches:
        assert len(branch.obstacles) == 1
        assert "meets another branch" in branch.obstacles[0]
        assert length(branch) == pytest.approx(0.5, abs=10 * SHORTEST)
        assert min(np.ptp(branch.at, axis=0)) < 1e-4


@pytest.mark.slow
def test_a_figure_eight():
    """(x² + y²)² = a²(x² − y²), Bernoulli's lemniscate of length 5.244116 a."""
    a = 0.4

    def value(u, v):
        x, y = u - 0.513, v - 0.489
        square = x * x + y * y
        return square**2 - a**2 * (x * x - y * y), 4 * x * square - 2 * a**2 * x, 4 * y * square + 2 * a**2 * y

    of = field(value)
    branches = lines(of)
    assert sum(map(length, branches)) == pytest.approx(5.244115108584239 * a, rel=2e-3)
    for branch in branches:  # each is one half: it does not go on across the node
        x = branch.at[:, 0] - 0.513
        assert np.all(x > -1e-4) or np.all(x < 1e-4)


def test_a_cusp_does_not_hang():
    of = field(lambda u, v: ((v - 0.5) ** 2 - (u - 0.3) ** 3, -3 * (u - 0.3) ** 2, 2 * (v - 0.5)))
    branches = lines(of)
    expected = 2 * 8 / 27 * ((1 + 9 / 4 * 0.5 ** (2 / 3)) ** 1.5 - 1)
    assert sum(map(length, branches)) == pytest.approx(expected, abs=0.01)


@pytest.mark.slow
def test_steps_do_not_jump_to_a_neighbour():
    """sin(8 π u) = 0.1 v has 8 lines, closer than the longest step."""
    number, w = 8, 8 * math.pi
    of = field(lambda u, v: (np.sin(w * u) - 0.1 * v, w * np.cos(w * u), -0.1))
    branches = [branch for branch in lines(of, nodes=17, longest=0.15) if length(branch) > 0.5]
    assert len(branches) == number
    for branch in branches:
        u, v = branch.at.T
        k = np.round(u * number - (-1) ** np.round(u * number) * np.arcsin(0.1 * v) / math.pi)
        assert np.all(k == k[0])
        assert np.allclose(sorted(v[[0, -1]]), [0, 1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("gap", sampled(0.01, 0.03))
@pytest.mark.parametrize("longest", sampled(0.05, LONGEST))
def test_two_close_lines_are_both_found(gap, longest):
    """Also where they are closer than a step, if not than the finer grid of a scan."""
    of = field(
        lambda u, v: ((v - 0.41) * (v - 0.41 - gap - 0.005 * u), 0.005 * (0.41 - v), 2 * v - 0.82 - gap - 0.005 * u)
    )
    branches = lines(of, longest=longest)
    assert sorted(round(length(branch), 4) for branch in branches) == pytest.approx([1, 1], abs=1e-3)


@pytest.mark.slow
def test_nested_circles():
    radii = np.array([0.05, 0.1, 0.12, 0.3])

    def value(u, v):
        r = math.hypot(u - 0.5, v - 0.5)
        parts = r - radii
        slope = sum(np.prod(np.delete(parts, k)) for k in range(radii.size))
        return np.prod(parts) * 1e4, slope * 1e4 * (u - 0.5) / max(r, 1e-9), slope * 1e4 * (v - 0.5) / max(r, 1e-9)

    branches = lines(field(value), nodes=25)
    assert sorted(length(branch) for branch in branches) == pytest.approx(2 * math.pi * radii, rel=3e-3)


def test_a_thin_hairpin_is_not_closed():
    """Its arms are closer than a step for a long way from its end, the parabola (v − ½)² = 2e-4 (u − 0.19)."""
    of = field(lambda u, v: (1e3 * ((v - 0.5) ** 2 - 2e-4 * (u - 0.19)), -0.2, 2e3 * (v - 0.5)))
    [branch] = lines(of, longest=0.05)
    assert not branch.closed
    assert branch.at[[0, -1], 0].tolist() == [1, 1]
    assert min(branch.at[:, 0]) == pytest.approx(0.19, abs=1e-4)


def test_a_hole_ends_a_branch():
    of = field(lambda u, v: (v - 0.47, 0, 1), hole=(0.5, 0.5, 0.2))
    branches = lines(of)
    half = math.sqrt(0.2**2 - 0.03**2)
    assert len(branches) == 2
    inner = sorted(float(branch.at[k, 0]) for branch in branches for k in (0, -1) if 0 < branch.at[k, 0] < 1)
    assert inner == pytest.approx([0.5 - half, 0.5 + half], abs=10 * SHORTEST)
    assert [branch.obstacles for branch in branches] == [("a hole",), ("a hole",)]


def test_a_branch_between_two_holes_is_found():
    """All cells that it passes miss a node, but their edges do not."""

    def value(u, v):
        if abs(u - 0.5) > 0.1:
            raise NotConverged("a hole")
        return v - 0.5 - 0.1 * u, -0.1, 1

    of = field(value)
    [branch] = lines(of, nodes=6)
    assert branch.at[[0, -1], 0] == pytest.approx([0.4, 0.6], abs=10 * SHORTEST)
    assert branch.obstacles == ("a hole", "a hole")


def test_no_curve():
    assert lines(field(lambda u, v: (1 + u + v, 1, 1))) == []
    assert lines(field(lambda u, v: (u, 1, 0), hole=(0.5, 0.5, 1))) == []
    assert lines(field(lambda u, v: (0, 0, 0))) == []


def test_no_curve_but_a_point():
    """(u − ½)² + (v − ½)² = 0 has no tangent."""
    assert lines(circle(0.5, 0.5, 0.0)) == []


def test_the_interpolation_of_a_scan_is_exact_for_cubics(rng):
    a = rng.normal(size=(4, 4)) * (np.add.outer(np.arange(4), np.arange(4)) <= 3)
    polynomial = np.polynomial.polynomial
    by_u, by_v = polynomial.polyder(a, axis=0), polynomial.polyder(a, axis=1)
    scan = scan_of(field(lambda u, v: [polynomial.polyval2d(u, v, each) for each in (a, by_u, by_v)]), 4)
    for at in rng.uniform(size=(20, 2)):
        sample = scan(at)
        assert sample.value == pytest.approx(polynomial.polyval2d(*at, a), abs=1e-12)
        assert np.allclose(sample.gradient, [polynomial.polyval2d(*at, each) for each in (by_u, by_v)], atol=1e-8)


def test_the_interpolation_converges_with_the_fourth_power(rng):
    of = field(lambda u, v: (np.sin(3 * u + 2 * v), 3 * np.cos(3 * u + 2 * v), 2 * np.cos(3 * u + 2 * v)))
    at = rng.uniform(size=(100, 2))
    errors = []
    for nodes in (9, 17, 33):
        scan = scan_of(of, nodes)
        errors.append(max(abs(scan(each).value - np.sin(3 * each[0] + 2 * each[1])) for each in at))
    assert np.log2(errors[0] / errors[1]) > 3.5
    assert np.log2(errors[1] / errors[2]) > 3.5


def test_a_scan_tells_of_holes():
    scan = scan_of(field(lambda u, v: (u - v, 1, -1), hole=(0.5, 0.5, 0.2)), 11)
    assert scan.reasons == ("a hole",)
    inside = np.hypot(*np.meshgrid(scan.nodes - 0.5, scan.nodes - 0.5)) < 0.2
    assert np.array_equal(np.isnan(scan.values), inside)


def test_rows_go_along_v_and_each_begins_anew():
    """F notes where it is asked for; it exists below the diagonal."""
    begun = []

    def begin():
        begun.append([])
        of = field(lambda u, v: (u - v**2, 1, -2 * v), hole=(0, 1, 0.5))
        return lambda at: (begun[-1].append(tuple(at)), of(at))[1]

    rows, told = [Row(begin, 4, number) for number in range(4)], []
    scan = scanned(rows, map(scan_row, rows), lambda: told.append(len(begun)))
    u, v = np.meshgrid(scan.nodes, scan.nodes, indexing="ij")
    exists = np.hypot(u, v - 1) >= 0.5
    assert np.array_equal(scan.values[exists], (u - v**2)[exists])
    assert np.array_equal(scan.gradients[exists], np.stack([np.ones_like(u), -2 * v], axis=-1)[exists])
    assert np.all(np.isnan(scan.values[~exists]))
    expected = [[(s, t) for t in scan.nodes] for s in scan.nodes]
    assert begun == expected
    assert told == [1] * 4 + [2] * 4 + [3] * 4 + [4] * 4  # a row at a time, before the next is begun


def test_what_is_no_failure_of_a_solve_ends_a_scan():
    def broken(at):
        raise ZeroDivisionError("a mistake")

    with pytest.raises(ZeroDivisionError, match="a mistake"):
        scan_of(broken)


@pytest.mark.parametrize("of", [circle(0.5, 0.5, 0.3), line(1, 1, 0.8)])
def test_each_point_is_told_as_it_is_found(of):
    told = []
    [branch] = find_branches(of, scan_of(of), stepped=lambda: told.append(1))
    assert len(told) == len(branch.points)


def test_a_branch_is_not_sought_again_where_the_scan_is_off():
    """F = f·(e^{−25u} + …), f = v² − 0.8u − 0.01: many zeros of its interpolation are far from the one branch f = 0.

    Each took some solves to lead there again, together 442.
    """
    solved = []

    def curve(u, v):
        solved.append(1)
        f, size = v**2 - 0.01 - 0.8 * u, math.exp(-25 * u)
        return f * (size + 1e-3), -0.8 * (size + 1e-3) - 25 * f * size, 2 * v * (size + 1e-3)

    of = field(curve)
    scan, near = scan_of(of), 1e-3
    solved.clear()
    [branch] = find_branches(of, scan)
    assert len(solved) < 2.5 * len(branch.points)
    check(branch, of)
    rough = [find_zero(scan, seed.at) for seed in scan.seeds()]
    assert sum(each is not None and not branch.holds(each, near) for each in rough) > 50


def steep(told=None):
    """F = e^{40(v − 0.3 − 0.4u)} − 1, from whose upper side Newton's method begins with short steps."""

    def curve(u, v):
        if told is not None:
            told.append((u, v))
        size = math.exp(40 * (v - 0.3 - 0.4 * u))
        return size - 1, -16 * size, 40 * size

    return field(curve)


@pytest.mark.parametrize("height", [0.03, 0.05, 0.055])
def test_newton_s_method_goes_on_while_it_gains_a_digit_a_step(height):
    """From 0.055 above F is 8.0, 2.7, 0.8, 0.15, 0.009, 4e-5, 1e-9; from 0.08 above it is 0.8 and 0.16 in the end."""
    told = []
    at = np.array([0.5, 0.5 + height])
    sample = correct(steep(told), at, np.array([1.0, 0.0]))
    assert sample.at == pytest.approx([0.5, 0.5], abs=1e-10)
    assert len(told) > MOST_CORRECTIONS
    assert correct(steep(), np.array([0.5, 0.58]), np.array([1.0, 0.0])) is None


def met(one, other):
    """Crossings of all branches of two curves, as sorted points; each is checked."""
    found_there = []
    for a in lines(one):
        for b in lines(other):
            for (place, point), (other_place, other_point) in crossings(a, b, (one, other)):
                check(with_points(a, [(place, point)]), one)
                check(with_points(b, [(other_place, other_point)]), other)
                assert abs(one(point.sample.at).value) < 1e-9
                assert abs(other(other_point.sample.at).value) < 1e-9
                found_there.append(tuple(point.sample.at))
    return sorted(found_there)


def test_crossings_of_circles():
    """Circles of 0.3 at (0.4, 0.5) and (0.6, 0.5) meet at u = ½, v = ½ ± √(0.09 − 0.01)."""
    half = math.sqrt(0.08)
    assert np.allclose(
        met(circle(0.4, 0.5, 0.3), circle(0.6, 0.5, 0.3)), [(0.5, 0.5 - half), (0.5, 0.5 + half)], atol=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.8 - 1e-5, 0.8 - 1e-3])
def test_crossings_that_are_close(height):
    """A line just below the top of a circle meets it twice, 2√(2·0.3·gap) apart, and another just above it never."""
    half = math.sqrt(0.3**2 - (height - 0.5) ** 2)
    of = circle(0.5, 0.5, 0.3)
    assert np.allclose(met(of, line(0, 1, height)), [(0.5 - half, height), (0.5 + half, height)], rtol=0, atol=1e-6)
    assert met(of, line(0, 1, 0.8001)) == []


@pytest.mark.slow
def test_crossings_at_the_frame():
    assert np.allclose(met(line(1, -1, 0), line(2, -1, 1)), [(1, 1)], atol=1e-9)
    assert np.allclose(met(line(0.5, 1, 0.5), line(-1, 1, 0.5)), [(0, 0.5)], atol=1e-9)


@pytest.mark.slow
def test_a_curve_does_not_cross_itself():
    assert met(circle(0.5, 0.5, 0.3), circle(0.5, 0.5, 0.3)) == []
    assert met(circle(0.5, 0.5, 0.3), circle(0.5, 0.5, 0.301)) == []


@pytest.mark.slow
def test_many_crossings_are_in_order():
    wave = field(lambda u, v: (v - 0.5 - 0.3 * np.sin(25 * u), -7.5 * np.cos(25 * u), 1))
    [a], [b] = lines(wave), lines(line(0, 1, 0.5))
    new = [placed for placed, _ in crossings(a, b, (wave, line(0, 1, 0.5)))]
    assert np.allclose(sorted(point.sample.at[0] for _, point in new), np.arange(8) * math.pi / 25, atol=1e-9)
    check(with_points(a, new), wave)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=10, max_size=10))
def test_random_cubics(coefficients):
    """Points lie on the curve, and F changes its sign nowhere else; where it has no saddle ends are on the frame."""
    polynomial, a, fine = np.polynomial.polynomial, np.zeros((4, 4)), np.linspace(0, 1, 61)
    a[[0, 0, 0, 0, 1, 1, 1, 2, 2, 3], [0, 1, 2, 3, 0, 1, 2, 0, 1, 0]] = coefficients
    parts = a, 2 * polynomial.polyder(a, axis=0), 2 * polynomial.polyder(a, axis=1)
    of = field(lambda u, v: [polynomial.polyval2d(2 * u - 1, 2 * v - 1, each) for each in parts])
    values, by_u, by_v = (polynomial.polygrid2d(2 * fine - 1, 2 * fine - 1, each) for each in parts)
    branches = list(find_branches(of, scan_of(of, NODES)))
    slope = np.hypot(by_u, by_v)
    is_regular = np.all(np.maximum(abs(values), 0.05 * slope) > 3e-3)
    for branch in branches:
        assert all(abs(of(point.sample.at).value) <= TOLERANCE for point in branch.points)
        if is_regular:
            check(branch, of)
            assert not branch.obstacles
            check(with_folds(of, branch, NAMES), of)
    for k, m in np.argwhere((values[1:] * values[:-1] < 0) & (slope[1:] > 0.1) & (slope[:-1] > 0.1)):
        between = np.array([fine[k] + abs(values[k, m]) / abs(values[k + 1, m] - values[k, m]) / 60, fine[m]])
        assert any(apart(branch, [between]) < 0.02 for branch in branches), between


def test_a_branch_that_broke_off_goes_where_another_runs_through_it():
    [whole] = lines(line(1.0, -1.0, 0.1))
    [other] = lines(line(1.0, -1.0, 0.5))
    broken = replace(whole, points=whole.points[:3], obstacles=(Message(Code.LINE_SPENT, most=1.0),))
    assert with_branch((broken, other), whole) == (other, whole)
    assert with_branch((broken,), other) == (broken, other)
    assert with_branch((other,), whole) == (other, whole)


@pytest.mark.parametrize("seed", range(4))
def test_points_that_are_off_do_not_lead_astray(seed):
    """F with errors of 2e-3, as another mesh at each point makes them: a few points, each as near as its width."""
    rng = np.random.default_rng(seed)
    calls = []

    def noisy(at):
        calls.append(at)
        gap = math.hypot(at[0] - 0.2, at[1] - 0.1) - 0.6
        slope = (at - np.array([0.2, 0.1])) / (gap + 0.6)
        return Sample(at, gap + 2e-3 * rng.uniform(-1, 1), slope, 2e-3, 1.0, rtol=2e-3)

    (branch,) = find_branches(noisy, scan_of(noisy, 5))
    for point in branch.points:
        assert abs(math.hypot(*(point.sample.at - [0.2, 0.1])) - 0.6) <= point.sample.width
    assert [point.label for point in branch.points if point.label] == [FRAME, FRAME]
    assert len(calls) < 150
