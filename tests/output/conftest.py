"""What tests of figures share: the figures that are drawn while a test runs."""

from pathlib import Path

import matplotlib.figure
import pytest

from tests.output.drawing import assert_sound


@pytest.fixture
def drawn(monkeypatch):
    """The figures; laid out for tests that take `pictures` before. Their files stay empty."""
    figures = []

    class Recorded(matplotlib.figure.Figure):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            figures.append(self)

        def savefig(self, path, **_options):
            Path(path).touch()

    monkeypatch.setattr(matplotlib.figure, "Figure", Recorded)
    return figures


@pytest.fixture
def sound(pictures, monkeypatch):
    """The figures, once for each file; looked at instead of being written, in the style that they are drawn in."""
    figures = []

    class Checked(matplotlib.figure.Figure):
        def savefig(self, path, **_options):
            if self not in figures:
                assert_sound(self)
            figures.append(self)
            Path(path).touch()

    monkeypatch.setattr(matplotlib.figure, "Figure", Checked)
    return figures
