"""What all pictures share: the palette, axes of their own figure, names of axes, and PNG."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

INK, GREY, BLUE, ORANGE = "#1a1a1a", "#9a9a9a", "#1f5fa8", "#d9822b"

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
"""Of an axis, by the name of what varies along it."""


def new_axes(rows: int = 1, size: tuple[float, float] = (7.0, 4.6)) -> Any:
    """Axes of a figure of their own; an array of them if `rows` > 1."""
    figure = Figure(figsize=size, layout="constrained", dpi=130)
    FigureCanvasAgg(figure)
    return figure.subplots(rows, 1, sharex=rows > 1)


def png(figure: Any) -> bytes:
    """The picture as a file's content."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
