"""Style of all pictures: palette, markers, labels of axes, new axes, PNG and SVG."""

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

HALO: list[Any] = [withStroke(linewidth=2.5, foreground="white")]
"""Path effects of words and lines over a field."""
CASES: tuple[dict[str, Any], ...] = (
    {"color": GREY, "marker": "s", "ls": "--", "ms": 5.0, "mfc": "white", "mec": INK, "lw": 1.2}
    | {"label": "without pendulum"},
    {"color": BLUE, "marker": "o", "ls": "-", "ms": 3.5, "mfc": BLUE, "mec": BLUE, "lw": 1.2}
    | {"label": "with pendulum"},
)
"""Lines without and with the pendulum, which differ in grey as well."""
NOT_RECOMMENDED = "best design, not recommended"
"""Label of a design that is shown although it is not recommended."""
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


@contextlib.contextmanager
def own_style() -> Iterator[None]:
    """Draw in the style of this package, whatever the settings of the user are, which stay as they are; as a
    decorator for a function that draws."""
    # Without a date and with a fixed salt of its identifiers a repeated run writes the same file. Words stay
    # words.
    with matplotlib.style.context(["default", {"svg.hashsalt": "tpd", "svg.fonttype": "none"}]):
        yield


class Picture(Figure):
    """A figure of this package. Matplotlib also reads settings when it draws and measures a figure."""

    draw = own_style()(Figure.draw)
    savefig = own_style()(Figure.savefig)
    get_tightbbox = own_style()(Figure.get_tightbbox)


def in_degrees(ax: Any) -> None:
    """Give a vertical axis in radians a second scale in degrees."""
    ax.secondary_yaxis("right", functions=(np.degrees, np.radians)).set_ylabel("degrees")


def legend(ax: Any, columns: int = 2, **place: Any) -> None:
    """A legend without a frame, above the axes unless `place` says otherwise, if anything has a label."""
    if ax.get_legend_handles_labels()[0]:
        above = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": columns}
        ax.legend(fontsize=8, frameon=False, **(place or above))


def edge(
    ax: Any, x: Any, y: Any, z: Any, name: str, share: float, *, color: str = ORANGE, style: str = "-"
) -> None:
    """Draw the line where `z` is zero, with its name at a share of the length of its longest part."""
    line = ax.contour(x, y, z, levels=[0.0], colors=[color], linewidths=1.4, linestyles=style)
    # In grey the line may be as dark as the field.
    line.set_path_effects(HALO)
    longest = max(line.allsegs[0], key=len)
    # Lines run on beside each other: their names are apart because their shares differ.
    text = ax.annotate(name, longest[int(share * (len(longest) - 1))], fontsize=8, ha="center", va="center")
    text.set_path_effects(HALO)


def new_axes(rows: int = 1, size: tuple[float, float] = (7.0, 4.6), columns: int = 1) -> Any:
    """Axes of a new figure; an array of them if there are several, which share the axis between them."""
    figure = Picture(figsize=size, layout="constrained", dpi=130)
    FigureCanvasAgg(figure)
    return figure.subplots(rows, columns, sharex=rows > 1, sharey=columns > 1)


def svg(figure: Any) -> bytes:
    """Content of an SVG file of the figure, the same for the same figure; its words stay words."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def png(figure: Any) -> bytes:
    """Content of a PNG file of the figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
