"""Style of all pictures: palette, markers, labels of axes, new axes, PNG and SVG."""

from __future__ import annotations

import io
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

INK, GREY, BLUE, ORANGE = "#1a1a1a", "#9a9a9a", "#1f5fa8", "#d9822b"

CASES: tuple[dict[str, Any], ...] = (
    {"color": GREY, "marker": "s", "ls": "--", "ms": 5.0, "mfc": "white", "mec": INK, "lw": 1.2}
    | {"label": "bare block"},
    {"color": BLUE, "marker": "o", "ls": "-", "ms": 3.5, "mfc": BLUE, "mec": BLUE, "lw": 1.2}
    | {"label": "with the pendulum"},
)
"""Lines of the bare block and of the block with a pendulum, which differ in grey as well."""
LINES: tuple[dict[str, Any], ...] = tuple(
    {"color": case["color"], "label": case["label"], "lw": lw}
    for case, lw in zip(CASES, (2.2, 1.0), strict=True)
)
"""Dense lines of both, without markers: the broad one below the thin one."""

LABELS = {
    "nu": r"slenderness $\nu$ = a/b (-)",
    "mu": r"mass ratio $\mu$ = m/M (-)",
    "lam": r"length ratio $\lambda$ = l/b (-)",
    "zeta": r"damping ratio of the hinge $\zeta$ (-)",
    "k": "friction of the contact k (-)",
    "f": r"base acceleration f = $\alpha\omega^2$/g (-)",
    "xi": r"frequency ratio $\xi$ = $\omega/\omega_0$ (-)",
    "e": "velocity ratio of an impact e (-)",
    "rho": r"inertia ratio $\rho$ (-)",
    "width": "width of the block (m)",
    "height": "height of the block (m)",
    "mass": "mass of the block (kg)",
    "friction": "friction of the contact k (-)",
    "restitution": "velocity ratio of an impact e (-)",
    "amplitude": "amplitude of the base motion (m)",
    "frequency": "frequency of the base motion (Hz)",
    "pendulum_mass": "mass of the bob (kg)",
    "pendulum_length": "length of the pendulum (m)",
    "pendulum_damping": "damping ratio of the hinge (-)",
}
"""Labels of an axis by the name of the quantity along it."""


def in_degrees(ax: Any) -> None:
    """Give a vertical axis in radians a second scale in degrees."""
    ax.secondary_yaxis("right", functions=(np.degrees, np.radians)).set_ylabel("degrees")


def legend(ax: Any, columns: int = 2, **place: Any) -> None:
    """A legend without a frame, above the axes unless `place` says otherwise, if anything has a label."""
    if ax.get_legend_handles_labels()[0]:
        above = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": columns}
        ax.legend(fontsize=8, frameon=False, **(place or above))


def new_axes(rows: int = 1, size: tuple[float, float] = (7.0, 4.6), columns: int = 1) -> Any:
    """Axes of a new figure; an array of them if there are several, which share the axis between them."""
    figure = Figure(figsize=size, layout="constrained", dpi=130)
    FigureCanvasAgg(figure)
    return figure.subplots(rows, columns, sharex=rows > 1, sharey=columns > 1)


def svg(figure: Any) -> bytes:
    """Content of an SVG file of the figure, the same for the same figure; its words stay words."""
    buffer = io.BytesIO()
    # Without a date and with a fixed salt of its identifiers a repeated run writes the same file.
    with matplotlib.rc_context({"svg.hashsalt": "tpd", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def png(figure: Any) -> bytes:
    """Content of a PNG file of the figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
