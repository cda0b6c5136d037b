"""Figures, read from where matplotlib has put all."""

from itertools import combinations

import matplotlib.figure
import numpy as np
import pytest

from fpsolve.exponent.error import Estimate, Failure
from fpsolve.exponent.quantities import INDICES
from fpsolve.results import Table
from fpsolve.solve.curve import CurveResult, MomentColumns
from fpsolve.tell.figures import Encoding, main_figure
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
        for curve in case.curves():
            theory, p = second_order(curve.problem), case.p[: 0 if curve.number in fails else None]
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
            results.append(CurveResult(curve, columns, dict.fromkeys(INDICES) | known, failures=told))
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
        [D0],
        ["finite elements, treatment = exact", "finite elements, treatment = ou-reduction"],
    ),
    ([many(8), "figure.mark=['stability_index', 'lyapunov_exponent']"], P, [], [INDEX, "slope $\\lambda$ at $p = 0$"]),
    ([many(9)], P, [D0], ["finite elements", "perturbation, Eq. (37), of 3 curves", INDEX]),
    ([many(2), f"title='{'A title of many words ' * 12}'"], P, [], ["finite elements", INDEX]),
    ([many(9), "figure={x='noise.D0', y={moment=2.0}}"], D0, [], ["finite elements"]),
]


@pytest.mark.parametrize(("sets", "axis", "bars", "legend"), sampled(*FIGURES, keep=3))
def test_figure_has_labels_and_a_legend_that_cover_nothing_on_the_canvas(drawn, sets, axis, bars, legend):
    figure = drawn(*sets, fails=(7, 8) if sets is PLANE else ())
    axes, *others = figure.axes
    assert axis in axes.get_xlabel()
    assert [each.get_ylabel() for each in others] == bars
    found = [*figure.legends, *(each for axes in figure.axes if (each := axes.get_legend()))]
    words = [text for each in found for text in each.get_texts()]
    assert set(legend) <= {text.get_text() for text in words}
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


VARIED = [{"a": a, "b": b, "c": c} for a in (1.0, 2.0) for b in (1.0, 2.0, 3.0) for c in ("x", "y")]


@pytest.mark.parametrize(
    ("varied", "key", "kinds", "untold"),
    [
        (VARIED, "b", 4, {}),
        ([each | {"a": each["a"] + i} for i in range(0, 8, 2) for each in VARIED], "a", 1, {"b": 3, "c": 2}),
        ([{"a": 1.0, "b": 1.0}, {"a": 2.0, "b": 1.0}, {"a": 2.0, "b": 2.0}], None, 1, {}),
        ([{"a": 1.0, "b": 3.0}, {"a": 2.0, "b": 1.0}, {"a": 3.0, "b": 1.0}], "a", 1, {}),
        ([{"c": "x"}, {"c": "y"}], None, 2, {}),
    ],
)
def test_colours_and_styles_tell_curves_from_each_other(varied, key, kinds, untold):
    told = Encoding.of(varied)
    assert (told.key, len({tuple(each.values()) for each in told.kinds}), told.untold) == (key, kinds, untold)
    assert told.colours.tolist() == ([each[key] for each in varied] if key else [*range(1, len(varied) + 1)])
