"""Figures of cases whose curves are those of perturbation theory, and what matplotlib says of where all is in them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np

from fpsolve.exponent.error import Estimate, Failure
from fpsolve.exponent.quantities import INDICES
from fpsolve.output.figures import main_figure
from fpsolve.results.curve import CurveResult, MomentColumns
from fpsolve.theory.perturbation import second_order
from tests.kit import case_in, case_text

MOMENTS = "[moments]\np = { start = -2.0, stop = 4.0, num = 13 }\n"
CASE = case_text(MOMENTS, "Moment Lyapunov exponents of a vibro-impact oscillator", {"D0": 0.1})


def case_of(folder: Path, sets=()):
    return case_in(folder, CASE, sets, "drawn")


def results_of(case, fails=lambda number: False):
    """As if perturbation theory were exact; without any p for the numbers that fail."""
    return [_result(case, curve, has_failed=fails(curve.number)) for curve in case.curves()]


def _result(case, curve, *, has_failed):
    theory = second_order(curve.problem)
    p = case.p[:0] if has_failed else case.p
    value, nothing = theory.moment_exponent(p), np.zeros(p.size)
    slope = (theory.moment_exponent(p + 1) - theory.moment_exponent(p - 1)) / 2  # of a parabola
    found = {name: getattr(theory, name) for name in ("lyapunov_exponent", "stability_index")}
    known = {name: Estimate(each, 0.0, 1.0) for name, each in found.items() if not has_failed and abs(each) <= 20}
    estimates = {**dict.fromkeys(INDICES), **known}
    failures = (Failure(None, "it was too hard"),) if has_failed else ()
    return CurveResult(
        curve, MomentColumns(p, value, slope, nothing, nothing, nothing, value), estimates, failures=failures
    )


def drawn_case(folder: Path, sets=(), *, fails=lambda number: False):
    case = case_of(folder, sets)
    main_figure(case, results_of(case, fails), []).write(folder)
    return case


def legends(figure):
    return [*figure.legends, *(each for axes in figure.axes if (each := axes.get_legend()))]


def words(figure):
    return [text.get_text() for legend in legends(figure) for text in legend.get_texts()]


def tick_labels(figure):
    """The labels of each axis that are seen."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            room = 1e-9 * (high - low)
            seen = [tick for tick in ticks if low - room <= tick.get_loc() <= high + room]
            labels = [label for tick in seen for label in (tick.label1, tick.label2)]
            yield [label for label in labels if label.get_visible() and label.get_text()]


def texts(figure):
    """All that is written."""
    yield from (text for each in (figure, *figure.subfigs) for text in each.texts)
    yield from (text for legend in legends(figure) for text in legend.get_texts())
    yield from (label for labels in tick_labels(figure) for label in labels)
    for axes in figure.axes:
        yield from (axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts)
        yield from (axis.get_offset_text() for axis in (axes.xaxis, axes.yaxis) if axis.get_offset_text().get_text())


def data_paths(figure):
    """What is drawn of the curves, as paths in pixels inside of their axes."""
    for axes in figure.axes:
        for line in axes.lines:
            if np.size(line.get_xdata()) and line.get_gid() is None:
                yield axes, line.get_transform().transform_path(line.get_path())
        for collection in axes.collections:
            for path in collection.get_paths():
                yield axes, collection.get_transform().transform_path(path)


def assert_sound(figure):
    """Legends cover no data, all that is written is on the canvas, and no two texts overlap."""
    figure.canvas.draw()
    canvas = figure.bbox.padded(1)
    boxes = [legend.get_window_extent() for legend in legends(figure)]
    written = [(text, text.get_window_extent()) for text in texts(figure) if text.get_text() and text.get_visible()]
    for thing, box in [*written, *((legend, box) for legend, box in zip(legends(figure), boxes, strict=True))]:
        assert canvas.x0 <= box.x0 <= box.x1 <= canvas.x1, (thing, box)
        assert canvas.y0 <= box.y0 <= box.y1 <= canvas.y1, (thing, box)
    for text, _ in written:
        assert text.get_fontsize() >= 6, text
    for box in boxes:
        for axes, path in data_paths(figure):
            if box.overlaps(axes.bbox):
                assert not path.intersects_bbox(box, filled=False), "the legend covers a curve"
                assert not box.count_contains(path.vertices), "the legend covers a point"
    for labels in tick_labels(figure):
        for one, other in combinations([label.get_window_extent() for label in labels], 2):
            assert not one.overlaps(other), labels
    for (one, box), (other, second) in combinations(written, 2):
        across, along = (min(box.max[k], second.max[k]) - max(box.min[k], second.min[k]) for k in (0, 1))
        assert min(across, along) <= 1, (one, other)
