"""Λ(p) and the lines of a chart as plotly takes them; texts are escaped, as it reads them as HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from fpsolve.case.case import Case
from fpsolve.exponent.quantities import MOMENT
from fpsolve.show.limits import EACH
from fpsolve.study.chart import Chart, charted
from fpsolve.study.results import CurveResult


def of_moments(case: Case, results: Sequence[CurveResult]) -> dict[str, Any] | None:
    """Λ(p) of the first curves, if the case asks for it."""
    if MOMENT.name not in case.asked:
        return None
    moments = [(result.curve.label or MOMENT.symbol, result.moments) for result in results[:EACH]]
    lines = [
        _line(name, each.p.tolist(), each.value.tolist(), error_y={"array": each.error_estimate.tolist()})
        for name, each in moments
    ]
    unit = escape(MOMENT.timed(case.units.time).unit)
    return _plot("Λ(p)", lines, [{"title": {"text": "p"}}, {"title": {"text": f"{MOMENT.symbol} ({unit})"}}])


def of_chart(case: Case, chart: Chart) -> dict[str, Any]:
    """The lines, with their special points."""
    lines = []
    for line in chart.lines:
        for branch in line.branches:
            x, y, labels = branch.x.tolist(), branch.y.tolist(), list(branch.labels)
            ends = slice(1 if branch.closed else 0)
            text = [escape(label) for label in labels + labels[ends]]
            lines.append(_line(line.zero.equation, x + x[ends], y + y[ends], text=text))
    frame = charted(case).x, charted(case).y
    return _plot("Where stability ends", lines, [{"title": {"text": escape(a.key)}, "type": a.scale} for a in frame])


def _line(name: str, x: list[float], y: list[float], **more: Any) -> dict[str, Any]:
    return {"x": x, "y": y, "name": escape(name), "mode": "lines+markers", **more}


def _plot(title: str, data: list[dict[str, Any]], axes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    look: dict[str, Any] = {
        "margin": {"t": 60},
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": -0.25, "yanchor": "top"},
    }
    layout = {**look, "showlegend": True, "xaxis": axes[0], "yaxis": axes[1]}
    return {"title": f"{title}, with numbers where the pointer is", "data": data, "layout": layout}
