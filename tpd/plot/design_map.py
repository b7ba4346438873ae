"""Picture of a map of designs."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke, TickedStroke

from tpd.analysis.design_map import DesignMap
from tpd.core import checks
from tpd.plot.style import INK, LABELS, ORANGE, new_axes

_MOVING = ("rocking", "sticking", "near_fold", "grazing")
"""Statuses of periodic motions, which have an amplitude."""
_HATCHES = {
    "rest": ("", "rest, no rocking attracts"),
    "held": ("----", "held leaning"),
    "neutral": ("||||", "an orbit, neutral"),
    "unstable": ("////", "orbits, but none attracts"),
    "no_orbit": ("....", "no orbit"),
    "overturned": ("xxxx", "overturns"),
    "not_settled": ("\\\\\\\\", "does not settle"),
}
_OTHER = ("++++", "no answer")
_QUANTITIES = {
    "amplitude": r"largest tilt $|\varphi|$ (rad)",
    "stroke": r"largest bob angle $|\psi|$ (rad)",
    "margin": "uplift margin of the resting block (-)",
}


def plot_map(m: DesignMap, quantity: str = "amplitude", *, ax: Axes | None = None) -> Axes:
    """Draw one quantity of a map in colour, hatched where it has none, and the edge of no uplift.

    Args:
        m: the map.
        quantity: amplitude, stroke or margin.
        ax: default that of a new figure.

    Raises:
        ValueError: another quantity.
    """
    checks.one_of("quantity", quantity, tuple(_QUANTITIES))
    ax = cast(Axes, new_axes(size=(7.0, 5.4)) if ax is None else ax)
    values = getattr(m, quantity)
    coloured = {"amplitude": _MOVING, "stroke": (*_MOVING, "rest"), "margin": tuple(m.counts)}[quantity]
    shown = np.isfinite(values) & np.isin(m.status, coloured)
    low, high = _limits(values[shown], quantity)
    mesh = ax.pcolormesh(m.x, m.y, np.where(shown, values, np.nan), vmin=low, vmax=high, rasterized=True)
    beyond = bool((values[shown] < low).any()), bool((values[shown] > high).any())
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(beyond, "neither")
    cast(Any, ax.figure).colorbar(mesh, ax=ax, label=_QUANTITIES[quantity], extend=extend)
    handles = _hatched(ax, m, coloured) + _edge(ax, m)
    ax.set(xlabel=LABELS[m.x_name], ylabel=LABELS[m.y_name])
    if handles:
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": 2}
        ax.legend(handles=handles, fontsize=8, frameon=False, **place)
    return ax


def _limits(values: np.ndarray, quantity: str) -> tuple[float, float]:
    """Limits of the colours. A few designs next to a resonance would make all others alike."""
    if not values.size:
        return 0.0, 1.0
    high = float(np.quantile(values, 0.995))
    return (float(np.quantile(values, 0.02)), float(values.max())) if quantity == "margin" else (0.0, high)


def _hatched(ax: Axes, m: DesignMap, coloured: tuple[str, ...]) -> list[Any]:
    """Hatch designs without a colour; returns handles of the legend."""
    uncoloured = [s for s in m.counts if s not in coloured]
    kinds = {s: _HATCHES.get(s, _OTHER) for s in uncoloured}
    if m.start is not None and "rest" in kinds:
        kinds["rest"] = ("", "settles at rest")
    handles = []
    for hatch, label in dict.fromkeys(kinds.values()):
        here = np.isin(m.status, [s for s in uncoloured if kinds[s] == (hatch, label)])
        if hatch:
            ax.contourf(m.x, m.y, here, levels=[0.5, 1.5], colors="none", hatches=[hatch])
        handles.append(Patch(facecolor="white", edgecolor=INK, hatch=hatch, lw=0.6, label=label))
    return handles


def _edge(ax: Axes, m: DesignMap) -> list[Any]:
    """The line of zero uplift margin, its ticks on the side where a block at rest stays there."""
    if not (m.margin.min() < 0.0 < m.margin.max()):
        return []
    drawn = [Normal(), TickedStroke(angle=135, length=0.7, spacing=9.0)]
    cased = [Stroke(linewidth=3.2, foreground="white"), *drawn]
    ax.contour(m.x, m.y, m.margin, levels=[0.0], colors=[ORANGE], linewidths=1.4).set(path_effects=cased)
    label = "ticked side: no uplift once the bob has settled"
    return [Line2D([], [], color=ORANGE, lw=1.4, path_effects=drawn, label=label)]
