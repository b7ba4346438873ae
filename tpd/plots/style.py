"""Common style of all pictures: colours, markers, axis labels, new axes, PNG and SVG files."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from typing import Any

import matplotlib.style
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

INK, GREY, BLUE, ORANGE = "#1a1a1a", "#9a9a9a", "#1f5fa8", "#d9822b"
"""Colours of lines and texts. Grey is the block without the pendulum, blue the block with the pendulum."""
HALO: list[Any] = [withStroke(linewidth=2.5, foreground="white")]
"""Path effects that keep labels and lines readable on a shaded field."""
CASES: tuple[dict[str, Any], ...] = (
    {"color": GREY, "marker": "s", "ls": "--", "ms": 5.0, "mfc": "white", "mec": INK, "lw": 1.2}
    | {"label": "without pendulum"},
    {"color": BLUE, "marker": "o", "ls": "-", "ms": 3.5, "mfc": BLUE, "mec": BLUE, "lw": 1.2}
    | {"label": "with pendulum"},
)
"""Line styles without and with the pendulum, which can be told apart in a grey print."""
NOT_RECOMMENDED = "best design, not recommended"
"""Label of the best design if no design is recommended."""
LINES: tuple[dict[str, Any], ...] = tuple(
    {"color": case["color"], "label": case["label"], "lw": lw}
    for case, lw in zip(CASES, (2.2, 1.0), strict=True)
)
"""Line styles without and with the pendulum for dense lines, without markers: the thin line is on top."""

LABELS = {
    "nu": r"slenderness $\nu$ = a/b (-)",
    "mu": r"mass ratio $\mu$ = m/M (-)",
    "lam": r"length ratio $\lambda$ = l/b (-)",
    "zeta": r"damping ratio of the hinge $\zeta$ (-)",
    "k": "friction of the contact k (-)",
    "f": r"base acceleration f = $\alpha\omega^2$/g (-)",
    "xi": r"frequency ratio $\xi$ = $\omega/\omega_0$ (-)",
    "e": "coefficient of restitution e (-)",
    "rho": r"inertia ratio $\rho$ (-)",
    "kappa": r"height of the hinge over that of the centroid $\kappa$ (-)",
    "width": "width of the block (m)",
    "height": "height of the block (m)",
    "centroid_height": "height of the centroid (m)",
    "mass": "mass of the block (kg)",
    "friction": "friction of the contact k (-)",
    "restitution": "coefficient of restitution e (-)",
    "amplitude": "amplitude of the excitation (m)",
    "frequency": "frequency of the excitation (Hz)",
    "pendulum_mass": "mass of the bob (kg)",
    "pendulum_length": "length of the pendulum (m)",
    "pendulum_damping": "damping ratio of the hinge (-)",
    "pendulum_hinge_height": "height of the hinge (m)",
}
"""Axis labels by the names of the quantities."""


SMALL = 9
"""Size (pt) of the smallest text, which can be read on a telephone."""


@contextlib.contextmanager
def own_style() -> Iterator[None]:
    """Draw in the style of this package, independent of the user's Matplotlib settings, which do not change.

    Use it as a context manager, or as a decorator of a function that draws.
    """
    # The fixed salt of the identifiers in an SVG file makes repeated runs write identical files. With the
    # font type "none", texts stay texts and can be searched and selected.
    with matplotlib.style.context(["default", {"svg.hashsalt": "tpd", "svg.fonttype": "none"}]):
        yield


class Picture(Figure):
    """A figure in the style of this package."""

    # Matplotlib reads the settings of the user again when it draws, saves or measures a figure.

    draw = own_style()(Figure.draw)
    savefig = own_style()(Figure.savefig)
    get_tightbbox = own_style()(Figure.get_tightbbox)


def in_degrees(ax: Any) -> None:
    """Add a second scale in degrees to a vertical axis in radians."""
    ax.secondary_yaxis("right", functions=(np.degrees, np.radians)).set_ylabel("degrees")


def legend(ax: Any, columns: int = 2, handles: Any = None, **place: Any) -> None:
    """Add a legend without a frame if any line has a label.

    Args:
        ax: the axes.
        columns: number of columns.
        handles: handles of the legend; by default those of the lines with labels.
        place: position, as arguments of `Axes.legend`; by default above the axes.
    """
    if handles or ax.get_legend_handles_labels()[0]:
        above = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": columns}
        ax.legend(handles=handles, fontsize=SMALL, frameon=False, **(place or above))


def edge(
    ax: Any, x: Any, y: Any, z: Any, name: str, share: float, *, color: str = ORANGE, style: str = "-"
) -> None:
    """Draw the line where a function of two variables is zero, and write its name on the line.

    Args:
        ax: the axes.
        x: values of the first variable, shape (n,).
        y: values of the second variable, shape (m,).
        z: values of the function, shape (m, n).
        name: text on the line.
        share: position of the text on the longest part of the line, from 0 to 1.
        color: colour of the line.
        style: line style.
    """
    line = ax.contour(x, y, z, levels=[0.0], colors=[color], linewidths=1.4, linestyles=style)
    # In a grey print the line can be as dark as the field, so it gets a white edge.
    line.set_path_effects(HALO)
    longest = max(line.allsegs[0], key=len)
    # Edges of several limits often run side by side. Callers choose different shares for them, so that the
    # names do not overlap.
    text = ax.annotate(
        name, longest[int(share * (len(longest) - 1))], fontsize=SMALL, ha="center", va="center", zorder=4
    )
    text.set_path_effects(HALO)


def new_axes(rows: int = 1, size: tuple[float, float] = (7.0, 4.6), columns: int = 1) -> Any:
    """Return the axes of a new figure: an array if there are several, with shared scales.

    Args:
        rows: number of axes above each other.
        size: width and height of the figure, inches.
        columns: number of axes side by side.
    """
    # A canvas of its own keeps the figure out of pyplot, which would store it until the process ends.
    figure = Picture(figsize=size, layout="constrained", dpi=130)
    FigureCanvasAgg(figure)
    return figure.subplots(rows, columns, sharex=rows > 1, sharey=columns > 1)


def saved(picture: Any, kind: str = "png") -> bytes:
    """Return the content of a file of a picture. Equal pictures have equal files.

    Args:
        picture: axes, an array of axes of one figure, a figure, or the content itself.
        kind: "png" or "svg".
    """
    if isinstance(picture, bytes):
        return picture
    buffer = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else None
    np.ravel(picture)[0].figure.savefig(buffer, format=kind, metadata=metadata)
    return buffer.getvalue()
