"""Figures of few and of many curves, of maps and of narrow columns: read from where matplotlib has put all."""

import time

import numpy as np
import pytest
import xarray as xr

from fpsolve.case.vary import map_key
from fpsolve.drawing import label_of
from fpsolve.output.datasets import write_dataset
from fpsolve.output.figures import Encoding, main_figure
from fpsolve.output.tables import write_results
from fpsolve.theory.perturbation import second_order
from tests.conftest import sampled
from tests.output.drawing import case_of, drawn_case, results_of, texts, tick_labels, words

NARROW = "figure.width='single column'"


def intensities(count):
    return f"vary.noise.D0={{start=0.1, stop=3.0, num={count}, scale='log'}}"


def over(x, y='"lyapunov_exponent"'):
    return f"figure={{x='{x}', y={y}}}"


PLANE = [
    "vary.oscillator.omega={start=0.4, stop=4.0, num=20, scale='log'}",
    "vary.noise.D0={start=0.02, stop=2.0, num=20, scale='log'}",
    over("oscillator.omega", "{moment=2.0}"),
]
COARSE = [text.replace("num=20", "num=9") for text in PLANE]
THREE = "vary.oscillator.omega=[1.0, 2.0, 4.0]"
BOTH = "vary.noise.treatment=['exact', 'ou-reduction']"
FIGURES = {
    "one": [],
    "two": [intensities(2)],
    "eight": [intensities(8), "figure.mark=['stability_index', 'lyapunov_exponent']"],
    "nine": [intensities(9)],
    "twenty": [intensities(20)],
    "fifty, marked": [intensities(50), "figure.mark=['stability_index', 'lyapunov_exponent']"],
    "exact and reduced": ["vary.noise.D0=[0.5, 1.0]", BOTH],
    "exact and reduced, many": [intensities(20), BOTH],
    "four keys": [
        "vary={mode='zip', noise.D0=[0.1, 0.2, 0.3], noise.tau0=[0.5, 0.6, 0.7], oscillator.omega=[1.0, 2.0, 3.0], "
        "oscillator.restitution=[0.7, 0.8, 0.9]}"
    ],
    "over a parameter": [intensities(9), "vary.oscillator.omega=[1.0, 2.0]", over("noise.D0")],
    "fifty over a parameter": [
        intensities(50), "vary.oscillator.omega=[0.5, 1.0, 2.0, 4.0]", over("oscillator.omega"), "figure.map=false"
    ],
    "map": PLANE,
    "map of the index": [*PLANE[:2], over("noise.D0", '"stability_index"')],
    "long title": [
        intensities(3), "oscillator.omega=2.0", "oscillator.restitution=0.75", "moments.p=[-1.0, 0.5, 1.0, 2.0, 3.0]",
        f"title='{'A title of many words ' * 12}'",
    ],
    "small numbers": [intensities(2), "oscillator.epsilon=0.001"],
    "near numbers": ["vary.noise.D0={start=1.0, stop=1.0001, num=12}", over("noise.D0")],
    "seconds": [intensities(9), "units.time='s'"],
    "one decade": ["vary.noise.D0={start=0.3, stop=2.9, num=40, scale='log'}", over("noise.D0")],
    "six decades": ["vary.noise.D0={start=1e-5, stop=10.0, num=40, scale='log'}", over("noise.D0")],
}  # fmt: skip


SHOWN = ("eight", "exact and reduced, many", "map")


@pytest.mark.parametrize("name", sampled(*SHOWN, *(name for name in FIGURES if name not in SHOWN), keep=len(SHOWN)))
def test_all_has_its_place(sound, tmp_path, name):
    """Legends cover no data, all that is written is on the canvas and readable, and no two texts overlap."""
    drawn_case(tmp_path, [*FIGURES[name], *[NARROW] * (len(name) % 2)])  # of every second one
    assert len(sound) == 2  # as .png and as .pdf


@pytest.mark.parametrize("count", sampled(8, 1, 2, keep=2))
def test_up_to_eight_curves_are_named(drawn, tmp_path, count):
    drawn_case(tmp_path, ["vary={}"] if count == 1 else [intensities(count)])
    [figure] = drawn
    assert len([text for text in words(figure) if text.startswith("$D_0$ = ")]) == (count if count > 1 else 0)
    assert len(figure.axes) == 1


def test_more_have_a_colour_for_the_value_of_the_key(pictures, drawn, tmp_path):
    drawn_case(tmp_path, [intensities(9)])
    axes, bar = drawn[0].axes
    assert bar.get_ylabel() == "noise intensity $D_0$ (1/time)"
    assert bar.get_yscale() == "log"
    np.testing.assert_allclose(bar.get_ylim(), (0.1, 3.0))
    assert [label.get_text() for label in list(tick_labels(drawn[0]))[3]] == ["0.1", "0.2", "0.5", "1", "2"]
    [lines] = [each for each in axes.collections if len(each.get_paths()) == 9]
    assert len({tuple(colour) for colour in lines.get_colors()}) == 9
    assert words(drawn[0]) == ["finite elements", "perturbation, Eq. (37), of 3 curves", "stability index $\\delta_p$"]
    assert not any(line.get_marker() == "o" for line in axes.lines)


def test_line_styles_tell_texts(drawn, tmp_path):
    drawn_case(tmp_path, [intensities(9), BOTH])
    axes, bar = drawn[0].axes
    first, second = [each.get_linestyles()[0] for each in axes.collections if len(each.get_paths()) == 9]
    assert first != second
    assert {"finite elements, treatment = exact", "finite elements, treatment = ou-reduction"} <= set(words(drawn[0]))
    assert bar.get_ylabel().startswith("noise intensity")


VARIED = [{"a": a, "b": b, "c": c} for a in (1.0, 2.0) for b in (1.0, 2.0, 3.0) for c in ("x", "y")]


@pytest.mark.parametrize(
    ("varied", "key", "styles", "unencoded"),
    [
        ([{"a": 1.0, "b": 5.0}, {"a": 2.0, "b": 5.0}], "a", 1, ()),
        (VARIED, "b", 4, ()),
        ([each | {"a": each["a"] + i} for i in range(0, 8, 2) for each in VARIED], "a", 2, (("b", 3),)),
        ([{"a": 1.0, "b": 1.0}, {"a": 2.0, "b": 1.0}, {"a": 2.0, "b": 2.0}], None, 1, ()),
        ([{"a": 1.0, "b": 3.0}, {"a": 2.0, "b": 1.0}, {"a": 3.0, "b": 1.0}], "a", 1, ()),
        ([{"c": "x"}, {"c": "y"}], None, 2, ()),
    ],
)
def test_what_tells_curves_from_each_other(varied, key, styles, unencoded):
    told = Encoding.of(varied)
    assert (told.key, len(set(told.styles)), told.unencoded) == (key, styles, unencoded)
    assert told.colours.tolist() == ([each[key] for each in varied] if key else [*range(1, len(varied) + 1)])


def test_many_values_side_by_side_are_numbered(drawn, tmp_path):
    numbers = "[0.1, 0.2, 0.3, 0.1, 0.2, 0.3, 0.1, 0.2, 0.3, 0.4]", "[1, 2, 3, 2, 3, 1, 3, 1, 2, 1]"
    drawn_case(tmp_path, [f"vary={{mode='zip', noise.D0={numbers[0]}, oscillator.omega={numbers[1]}}}"])
    assert drawn[0].axes[1].get_ylabel() == "number of the curve"


def test_the_parameters_that_are_held_stand_below_the_title(drawn, tmp_path):
    drawn_case(tmp_path, [intensities(9), "oscillator.omega=2.0", "units.time='s'", "figure.title='Mine'"])
    headings = [drawn[0].texts[0], drawn[0].subfigs[0].texts[0]]
    title, told = (text.get_text() for text in headings)
    assert title.startswith("Mine\nwith vary.noise.D0 = ")
    assert "oscillator.omega = 2.0" in " ".join(title.split())
    shown = "$\\omega$ = 2 rad/s, $r$ = 0.8, $c_1$ = 0.1/s, $\\varepsilon$ = 0.1, $\\tau_0$ = 0.5 s, $r_0$ = 0.95"
    assert [text for text in shown.split(", ") if text not in told] == []
    assert "D_0" not in told
    assert len(told.splitlines()) <= 2
    assert headings[1].get_fontsize() >= 11
    assert not [text.get_text() for text in texts(drawn[0]) if "/time" in text.get_text()]


def test_the_width_of_a_figure_and_the_ends_of_its_axes(drawn, tmp_path):
    drawn_case(tmp_path, [intensities(2)])
    drawn_case(tmp_path, [intensities(2), NARROW, "figure.xlim=[-1.0, 2.5]", "figure.ylim=[-0.001, 0.02]"])
    assert [figure.get_figwidth() for figure in drawn] == [7.2, 3.5]
    axes = drawn[1].axes[0]
    assert (axes.get_xlim(), axes.get_ylim()) == ((-1.0, 2.5), (-0.001, 0.02))


@pytest.mark.parametrize("count", sampled(12, 2))
def test_what_is_marked(drawn, tmp_path, count):
    """The tangent at 0 has the slope λ, and is long enough to be seen."""
    drawn_case(tmp_path, [intensities(count), "figure.mark=['lyapunov_exponent']", "oscillator.omega=0.5"])
    case = drawn_case(tmp_path, [intensities(count), "figure.mark=[]", "oscillator.omega=0.5"])
    marked, plain = drawn
    assert "slope $\\lambda$ at $p = 0$" in words(marked)
    assert not any("$\\delta_p$" in text or "lambda" in text for text in words(plain))
    axes = marked.axes[0]
    tangents = [
        path for each in axes.collections for path in each.get_paths() if len(path) == 2 and path.vertices[0, 0] < 0
    ]
    slopes = [np.subtract(*path.vertices[:, 1]) / np.subtract(*path.vertices[:, 0]) for path in tangents[-count:]]
    expected = [curve.problem for curve in case.curves()]
    np.testing.assert_allclose(slopes, [second_order(each).lyapunov_exponent for each in expected])
    for path in tangents:
        start, stop = axes.transData.transform(path.vertices)
        assert np.hypot(*(stop - start)) > 0.12 * axes.bbox.width


def test_a_moment_over_a_parameter(drawn, tmp_path):
    drawn_case(tmp_path, [intensities(9), over("noise.D0", "{moment=2.0}")])
    [axes] = drawn[0].axes
    assert axes.get_ylabel() == "moment Lyapunov exponent $\\Lambda(2)$ (1/time)"
    assert axes.get_xscale() == "log"
    points = next(line for line in axes.lines if line.get_marker() == "o" and np.size(line.get_xdata()) == 9)
    theory = next(line for line in axes.lines if np.size(line.get_xdata()) > 100)
    np.testing.assert_allclose(np.interp(points.get_xdata(), *theory.get_data()), points.get_ydata(), rtol=1e-3)


@pytest.mark.slow
def test_a_parameter_is_called_alike_in_all_figures(drawn, tmp_path):
    """In figures over it, beside their colours, and in plots of results.nc."""
    case = drawn_case(tmp_path, COARSE)
    drawn_case(tmp_path, [intensities(9), over("noise.D0")])
    drawn_case(tmp_path, [intensities(9)])
    along, over_it, bar = (
        drawn[0].axes[0].get_ylabel(), drawn[1].axes[0].get_xlabel(), drawn[2].axes[1].get_ylabel(),
    )  # fmt: skip
    write_dataset(case, write_results(case, results_of(case), tmp_path, {}), tmp_path, {})
    with xr.open_dataset(tmp_path / "results.nc") as found:
        assert {along, over_it, bar, label_of(found["noise.D0"].attrs)} == {"noise intensity $D_0$ (1/time)"}
        assert drawn[2].axes[0].get_xlabel() == label_of(found["p"].attrs) == "order of the moment $p$"


@pytest.mark.slow
def test_a_map_is_centred_at_zero_and_has_its_line(pictures, drawn, tmp_path):
    drawn_case(tmp_path, PLANE)
    axes, bar = drawn[0].axes
    [mesh] = [each for each in axes.collections if type(each).__name__ == "QuadMesh"]
    assert mesh.norm.vmin == -mesh.norm.vmax
    assert mesh.norm(0.0) == pytest.approx(0.5)
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert bar.get_ylabel().split("\n") == ["moment Lyapunov exponent", "$\\Lambda(2)$ (1/time)"]
    assert words(drawn[0]) == ["zero, interpolated between the values"]
    assert len([label for label in list(tick_labels(drawn[0]))[3] if label.get_text()]) >= 3


def test_what_failed_is_hatched_and_what_is_not_there_is_grey(drawn, tmp_path):
    sets = [*PLANE[:2], over("noise.D0", '"stability_index"')]
    drawn_case(tmp_path, sets, fails=lambda number: number in (7, 8, 9))
    axes = drawn[0].axes[0]
    failed, absent = (each for each in axes.collections if type(each).__name__ == "PatchCollection")
    assert (len(failed.get_paths()), failed.get_hatch()) == (3, "/////")
    assert len(absent.get_paths()) > 0
    assert absent.get_hatch() is None
    assert words(drawn[0])[:2] == ["failed or not solved", "no stability index from -20 to 20"]


@pytest.mark.parametrize(
    ("count", "more", "key"), [(9, "", "noise.D0"), (8, "", ""), (8, "figure.map=true", "noise.D0")]
)
def test_when_it_is_a_map(drawn, tmp_path, count, more, key):
    sets = [intensities(count), "vary.oscillator.omega=[1.0, 2.0, 4.0]", over("oscillator.omega"), more]
    case = case_of(tmp_path, list(filter(None, sets)))
    assert (map_key(case.figure, case.vary) or "") == key
    if more:
        main_figure(case, results_of(case), []).write(tmp_path)
        [mesh] = [each for each in drawn[0].axes[0].collections if type(each).__name__ == "QuadMesh"]
        assert mesh.get_array().shape == (count, 3)


@pytest.mark.parametrize(
    ("sets", "x", "y", "is_map"),
    [
        ([intensities(9), THREE], "noise.D0", "lyapunov_exponent", True),
        ([intensities(9), "vary.oscillator.omega=[1.0, 2.0]"], "noise.D0", "lyapunov_exponent", False),
        ([intensities(4), THREE, "output.quantities=['moment']"], "noise.D0", 2, True),
        ([intensities(2), THREE], "p", "moment", None),
        ([intensities(9), THREE, "figure.x='p'"], "p", "moment", None),
        ([intensities(9), BOTH], "p", "moment", None),
    ],
)
def test_many_curves_over_two_keys_are_a_map_unasked(tmp_path, sets, x, y, is_map):
    figure = case_of(tmp_path, sets).figure
    assert (figure.x, figure.moment or figure.y, figure.map) == (x, y, is_map)


def test_ticks_of_stability_indices_cover_none(pictures, drawn, tmp_path):
    drawn_case(tmp_path, ["vary.noise.D0=[0.9, 1.0, 1.1]"])
    [ticks] = [each for each in drawn[0].axes[0].collections if len(each.get_offsets()) == 3]
    assert np.all(np.diff(ticks.get_sizes()) < 0)


@pytest.mark.slow
def test_thousands_of_curves_take_seconds(pictures, tmp_path):
    case = case_of(tmp_path, ["vary.noise.D0={start=0.1, stop=3.0, num=2500}"])
    results = results_of(case)
    started = time.process_time()
    main_figure(case, results, []).write(tmp_path)
    assert time.process_time() - started < 5  # some 1 where nothing else runs
    assert (tmp_path / "figure.pdf").stat().st_size < 500_000


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", sampled("two", "map", "over a parameter", keep=2))
@pytest.mark.parametrize("most", sampled(0, 1))
def test_what_failed_leaves_a_figure(sound, tmp_path, name, most):
    """Also where nothing is solved, or one set alone."""
    drawn_case(tmp_path, FIGURES[name], fails=lambda number: number > most)
    assert len(sound) == 2
