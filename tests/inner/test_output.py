"""Figures, read from where matplotlib has put all."""

from itertools import combinations

import matplotlib.figure
import numpy as np
import pytest

from fpsolve.exponent.error import Estimate, Failure
from fpsolve.exponent.quantities import SUMMARY_NUMBERS
from fpsolve.results import Table
from fpsolve.solve.set_result import MomentColumns, SetResult
from fpsolve.tell.figures import coloured_by, main_figure
from fpsolve.theory.perturbation import second_order
from tests.conftest import sampled
from tests.kit import TEXT, case_in

FIGURED = TEXT.replace("figure = false", "figure = true").replace(
    "[2.0, 0.0, -1.0]", "{ start = -2.0, stop = 4.0, num = 13 }"
)
BOTH = "vary.noise.treatment=['exact', 'ou-reduction']"
OMEGA = "vary.oscillator.omega={start=0.4, stop=4.0, num=9, scale='log'}"


def many(count):
    return f"vary.noise.D0={{start=0.1, stop=3.0, num={count}, scale='log'}}"


@pytest.fixture
def drawn(pictures, monkeypatch, tmp_path):
    """Draws the figure of a case as if perturbation theory were exact; nothing is known of sets that fail."""
    figures = []

    class Recorded(matplotlib.figure.Figure):
        def savefig(self, path, **_options):
            self.canvas.draw()
            figures.append(self)

    def draw(*sets, fails=()):
        case, results = case_in(tmp_path, FIGURED, sets), []
        for parameter_set in case.sets():
            theory, p = second_order(parameter_set.problem), case.p[: 0 if parameter_set.number in fails else None]
            value, slope, nothing = (
                theory.moment_exponent(p),
                (theory.moment_exponent(p + 1) - theory.moment_exponent(p - 1)) / 2,
                0 * p,
            )
            known = {
                name: Estimate(getattr(theory, name), 0.0, 1.0)
                for name in ("lyapunov_exponent", "stability_index")
                if p.size and abs(getattr(theory, name)) <= 20
            }
            told = () if p.size else (Failure(None, "it was too hard"),)
            columns = MomentColumns(p, value, slope, nothing, nothing, nothing, value)
            results.append(SetResult(parameter_set, columns, dict.fromkeys(SUMMARY_NUMBERS) | known, failures=told))
        main_figure(case, results, [], Table(case, results)).write(tmp_path)
        return figures[-1]

    monkeypatch.setattr(matplotlib.figure, "Figure", Recorded)
    return draw


P, D0, INDEX = "order of the moment $p$", "noise intensity $D_0$ (1/time)", "stability index $\\delta_p$"
PLANE = [
    OMEGA,
    "vary.noise.D0={start=0.02, stop=2.0, num=9, scale='log'}",
    "figure={x='oscillator.omega', y='stability_index'}",
]
FIGURES = [
    (PLANE, "frequency", [INDEX], ["failed or not solved", "no stability index from -20 to 20"]),
    (
        [many(9), BOTH, "figure.width='single column'"],
        P,
        ["number of the parameter set"],
        ["finite elements"],
    ),
    ([many(8), "figure.mark=['stability_index', 'lyapunov_exponent']"], P, [], [INDEX, "slope $\\lambda$ at $p = 0$"]),
    ([many(9)], P, [D0], ["finite elements", "perturbation, Eq. (37), of 3 parameter sets", INDEX]),
    ([many(2), f"title='{'A title of many words ' * 12}'"], P, [], ["finite elements", INDEX]),
    (
        [many(9), "figure={x='noise.D0', y={moment=2.0}, xlabel='size $D$', lines=false}"],
        "size $D$",
        [],
        ["finite elements"],
    ),
]


@pytest.mark.parametrize(("sets", "axis", "bars", "legend"), sampled(*FIGURES, keep=3))
def test_figure_has_labels_and_a_legend_that_cover_nothing_on_the_canvas(drawn, sets, axis, bars, legend):
    figure = drawn(*sets, fails=(7, 8) if sets is PLANE else ())
    axes, *others = figure.axes
    assert axis in axes.get_xlabel()
    assert [each.get_ylabel() for each in others] == bars
    found = [*figure.legends, *(each for axes in figure.axes if (each := axes.get_legend()))]
    words = [text for each in found for text in each.get_texts()]
    told = {text.get_text() for text in words}
    assert set(legend) <= told
    assert not ("lines=false" in sets[-1] and "perturbation" in str(told))
    for mesh in (each for each in axes.collections if type(each).__name__ == "QuadMesh"):
        assert (mesh.norm.vmin, mesh.get_array().shape) == (-mesh.norm.vmax, (9, 9))  # 0 is in the middle
    texts = [*words, *figure.texts, *(text for each in figure.subfigs for text in each.texts)]
    texts += [text for each in figure.axes for text in (each.title, each.xaxis.label, each.yaxis.label)]
    boxes = [text.get_window_extent() for text in texts if text.get_text()]
    assert all(figure.bbox.padded(1).count_contains(box.get_points()) == 2 for box in boxes)
    for one, other in combinations(boxes, 2):
        assert min(min(one.max[k], other.max[k]) - max(one.min[k], other.min[k]) for k in (0, 1)) <= 1
    for box in (each.get_window_extent() for each in found):
        for line in axes.lines:
            path = line.get_transform().transform_path(line.get_path())
            if np.size(line.get_xdata()) and line.get_gid() is None and box.overlaps(axes.bbox):
                assert not path.intersects_bbox(box, filled=False)


@pytest.mark.parametrize(("rows", "key"), [("x1 y2", "b"), ("x1 x2 y1", None)])
def test_colours_tell_curves_from_each_other(rows, key):
    told, values = coloured_by([{"a": a, "b": float(b)} for a, b in rows.split()])
    assert (told, values.tolist()) == (key, [1, 2, 3][: len(values)])
