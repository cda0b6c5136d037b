"""What the figures show, read from the drawn figures themselves."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex

from fpsolve.case.case import load_case
from fpsolve.drawing import figure_for
from fpsolve.output.figures import Series, draw_series, main_figure
from fpsolve.simulation.response import Response
from fpsolve.workflow.simulate import simulated_response_figure
from tests.kit import solve_case

pytestmark = pytest.mark.usefixtures("pictures")
MEANS = "x", "x_squared", "v_squared", "amplitude", "energy"
CASE = load_case(Path(__file__).parents[2] / "cases/minimal.toml")


def series(count=9, scale=1.0, **more):
    """A parabola through 0 and 1, from -2 to 2."""
    p = np.linspace(-2, 2, count)
    return Series({}, p, scale * p * (p - 1), p, scale * p * (p - 1), **more)


def picture(folder, *curves, title="Title"):
    with figure_for([folder / "figure.png"], title) as figure:
        draw_series(figure.add_subplot(), CASE, curves, "(37)")


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize(
    "title", ["Short", "A title so long that it fills all of the line above the axes, and more", "A\nB"]
)
@pytest.mark.parametrize("scale", [1e-2, 1e-7])
def test_title_is_clear_of_the_power_of_ten(drawn, tmp_path, title, scale):
    picture(tmp_path, series(scale=scale / 10), title=title)
    (axes,) = drawn[0].axes
    power, words = axes.yaxis.get_offset_text(), drawn[0].texts[0].get_window_extent()
    assert power.get_text()
    power = power.get_window_extent()
    assert max(words.y0 - power.y1, words.x0 - power.x1) > 0.5 * power.height
    assert words.y1 < drawn[0].bbox.y1


def test_letters_that_no_font_has_draw_no_warning(tmp_path):
    picture(tmp_path, series(), title="日本")
    assert (tmp_path / "figure.png").stat().st_size


@pytest.mark.parametrize("count", [3, 33, 200])
def test_all_that_is_simulated_is_drawn(drawn, tmp_path, count):
    p = np.linspace(-2, 2, count)
    simulated = np.array([p, p * (p - 1), np.full(count, 0.01)])
    picture(tmp_path, series(simulated=simulated))
    dots = drawn[0].axes[0].containers[0].lines[0]
    np.testing.assert_array_equal(dots.get_xydata(), simulated[:2].T)
    assert "Monte Carlo ± 2 standard errors" in legend(drawn[0])


@pytest.mark.parametrize(("count", "words"), [(33, "finite elements"), (100, "finite elements (not all marked)")])
def test_legend_tells_that_markers_are_left_out(drawn, tmp_path, count, words):
    picture(tmp_path, series(count))
    assert legend(drawn[0])[0] == words


def marks(figure):
    """x, y and colour of the marks of stability indices."""
    found = [each for each in figure.axes[0].collections if isinstance(each, PathCollection)]
    return [
        (*place, to_hex(colour).upper())
        for each in found
        for place, colour in zip(each.get_offsets().tolist(), each.get_facecolors(), strict=True)
    ]


@pytest.mark.slow
def test_stability_index_is_marked_on_the_zero_line(drawn, tmp_path):
    others = [series(root=1.0), series(), series(root=-0.5)]
    picture(tmp_path, *others)
    lines = [line for line in drawn[0].axes[0].lines if np.size(line.get_xdata())]
    curves = [line.get_color() for line in lines if line.get_marker() in ("o", "s", "D")]
    assert marks(drawn[0]) == [(1.0, 0.0, curves[0]), (-0.5, 0.0, curves[2])]
    picture(tmp_path, series())
    assert [legend(figure).count(r"stability index $\delta_p$") for figure in drawn] == [1, 0]


@pytest.mark.slow
def test_the_labels_of_a_response_have_units_and_room(drawn, tmp_path):
    edges, density = np.linspace(0, 3, 31), np.exp(-3 * (np.linspace(0, 3, 30) - 1.5) ** 2)
    response = Response(
        means=dict.fromkeys(MEANS, (1.0, 0.01)), x_edges=edges, v_edges=np.linspace(-3, 3, 21),
        density=np.ones((30, 20)), amplitude_edges=edges, amplitude_density=density, amplitude_error=0.01 * density,
        outside=0.0, impact_rate=1.0, time=1.0,
    )  # fmt: skip
    simulated = SimpleNamespace(response=response, curve=CASE.curve({}))
    simulated_response_figure(CASE, simulated).write(tmp_path)
    plane, radial, bar = drawn[0].axes
    labels = [plane.xaxis.label, plane.yaxis.label, bar.yaxis.label, radial.xaxis.label, radial.yaxis.label]
    units = ["(length)", "(length/time)", "(time/length²)", "(length)", "(1/length)"]
    assert [label.get_text().rpartition(" ")[2] for label in labels] == units
    left, right = bar.yaxis.label.get_window_extent(), radial.yaxis.label.get_window_extent()
    assert right.x0 - left.x1 > 1.5 * left.width
    curve = radial.lines[0].get_path().transformed(radial.transData)
    assert not curve.intersects_bbox(radial.get_legend().get_window_extent(), filled=False)


@pytest.mark.parametrize(("p", "count"), [("[-1.0, 2.0]", 1), ("[1.0, 2.0]", 0)])
def test_stability_index_of_a_case_is_marked_where_p_reaches_it(drawn, tmp_path, p, count):
    case = load_case(CASE.path, [f"moments.p={p}"])
    results = solve_case(case)
    main_figure(case, results, []).write(tmp_path)
    found = [x for x, _, _ in marks(drawn[0])]
    assert found == [results[0].stability_index.value][:count]


@pytest.mark.slow
def test_theory_that_is_not_drawn_is_not_computed(drawn, tmp_path, monkeypatch):
    """Of many curves over a parameter: 200 points for each of 10,000 sets would take minutes."""
    over = 'vary={ mode = "zip", "noise.D0" = {start=0.1,stop=0.2,num=30}, "noise.tau0" = {start=0.5,stop=0.6,num=30} }'
    sets = [over, "expect=[]", 'figure={x="noise.D0",y="lyapunov_exponent"}', 'output.quantities=["lyapunov_exponent"]']
    case = load_case(CASE.path, sets)
    results = solve_case(case)
    make, made = type(case).curve, []
    monkeypatch.setattr(type(case), "curve", lambda *arguments: made.append(1) or make(*arguments))
    main_figure(case, results, []).write(tmp_path)
    assert len(made) <= 3 * 400  # of three lines, as the legend says
