"""Lines as plotly takes them for a page; texts are escaped, as it reads them as HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any


def line_of(name: str, x: list[float], y: list[float], **more: Any) -> dict[str, Any]:
    """A line with its points."""
    return {"x": x, "y": y, "name": escape(name), "mode": "lines+markers", **more}


def plot_of(title: str, data: list[dict[str, Any]], axes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Lines in a frame with two axes."""
    look: dict[str, Any] = {
        "margin": {"t": 60},
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": -0.25, "yanchor": "top"},
    }
    layout = {**look, "showlegend": True, "xaxis": axes[0], "yaxis": axes[1]}
    return {"title": f"{title}, with numbers where the pointer is", "data": data, "layout": layout}
