"""Pictures of charts: what the legend lists, and where regions have their names."""

from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve.analysis.regions import Region, Regions
from fpsolve.analysis.stability import Branch
from fpsolve.analysis.zero import Zero
from fpsolve.workflow.chart import chart_figure
from tests.kit import case_in, case_text
from tests.output.drawing import words

pytestmark = pytest.mark.usefixtures("pictures")
CHART = """[moments]
p = [2.0]
[chart]
x = { key = "oscillator.omega", start = 0.5, stop = 3.0 }
y = { key = "noise.D0", start = 0.01, stop = 1.0 }
zero = ["lyapunov_exponent", { moment = 2.0 }]
"""
N = 80
LONG = "almost surely unstable, second moment unstable"
LINE = Branch(x=np.array([1.0, 2.0]), y=np.array([0.2, 0.9]), width=np.zeros(2), labels=("", ""))


@pytest.fixture
def picture(tmp_path, drawn):
    """The figure of a chart with one line of two, divided at shares u of its width."""

    def make(*ends):
        index = np.searchsorted(ends, (np.arange(N) + 0.5) / N)[:, None] + np.zeros((1, N), dtype=int)
        middles = np.convolve([0.0, *ends, 1.0], [0.5, 0.5], "valid")
        each = tuple(
            Region(f"{LONG}, {'-2 < δ_p < -1' if k % 2 else 'δ_p < -2'}", {}, float(np.mean(index == k)), (at, 0.5))
            for k, at in enumerate(middles)
        )
        lines = [SimpleNamespace(zero=Zero("lyapunov_exponent"), branches=(LINE,))]
        lines.append(SimpleNamespace(zero=Zero("moment", 2.0), branches=()))
        chart = SimpleNamespace(lines=lines, closed_forms=[[], []], regions=Regions(each, index))
        chart_figure(case_in(tmp_path, case_text(CHART)), chart).write(tmp_path)
        return drawn[-1]

    return make


def test_the_legend_lists_what_is_in_the_frame(picture):
    assert words(picture()) == [r"$\lambda = 0$"]


@pytest.mark.parametrize(
    ("ends", "names"), [((), [3]), ((0.6,), [3, 3]), ((0.75,), [3, 5]), ((0.9,), [3]), ((0.45, 0.55), [3, 3])]
)
def test_regions_have_their_names_where_these_have_room(picture, ends, names):
    """In three lines, or in five short ones; else a letter, that of the legend."""
    figure = picture(*ends)
    [axes] = figure.axes
    texts = [text for text in axes.texts if text.get_text().startswith("almost")]
    assert [text.get_text().count("\n") + 1 for text in texts] == names
    renderer, edges = figure.canvas.get_renderer(), np.array([0.0, *ends, 1.0])
    for text in texts:
        box = text.get_window_extent(renderer).transformed(axes.transAxes.inverted())
        k = np.searchsorted(edges, box.x0) - 1
        assert edges[k] < box.x0 < box.x1 < edges[k + 1]
    letters = [text.get_text() for text in axes.texts if text not in texts]
    assert len(letters) == len(ends) + 1 - len(names)
    assert [word.partition(":")[0] for word in words(figure)[1:]] == letters


@pytest.mark.parametrize("value", [-1.0, 2.0])
def test_a_line_is_called_by_its_equation(value):
    zero = Zero("stability_index", value)
    assert zero.latex.strip("$").replace(r"\delta_p", "δ_p") == zero.equation == f"δ_p = {value:g}"
