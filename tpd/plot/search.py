"""Picture of a search over the (mu, lam) plane."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes

from tpd.design.result import HarmonicDesign
from tpd.design.study import UpliftRegion
from tpd.plot.style import GREY, INK, LABELS, ORANGE, new_axes


def plot_search(design: HarmonicDesign, region: UpliftRegion | None = None, ax: Axes | None = None) -> Axes:
    """Draw screened designs by their value, search paths and ends, refused designs and the answer.

    Args:
        design: the answer of `optimise`.
        region: uplift margin over the plane, shaded where a block at rest stays at rest.
        ax: default that of a new figure.
    """
    ax = cast(Axes, new_axes() if ax is None else ax)
    if region is not None and (region.margin > 0.0).any():
        levels: dict[str, Any] = {"levels": [0.0, np.inf], "colors": [GREY], "alpha": 0.25}
        # Contours rather than points: the margin is a closed form, known everywhere.
        ax.contourf(region.mass_ratio, region.length_ratio, region.margin, **levels)
        ax.plot([], [], color=GREY, lw=6, alpha=0.4, label="no uplift once the bob has settled")
    _screened(design, ax)
    for i, path in enumerate(design.search.paths):
        ax.plot(path[:, 0], path[:, 1], color=INK, lw=0.8, label=None if i else "search paths")
    # An end that breaks a limit has an infinite value: it is no candidate and is not marked.
    _points(ax, design.search.ends[np.isfinite(design.search.end_values)], "o", 5.0, "ends of searches")
    refused = [v.design for v in design.verified if v.reasons]
    _points(ax, np.array(refused).reshape(-1, 3), "X", 9.0, "refused", mfc="white")
    if design.winner is not None:
        _points(ax, design.winner.design[None], "*", 17.0, "answer", mfc=ORANGE)
    limits = {"xlim": _padded(design.space.mass_ratio), "ylim": _padded(design.space.length_ratio)}
    ax.set(xlabel=LABELS["mu"], ylabel=LABELS["lam"], **limits)
    ax.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=7, frameon=False, markerscale=0.7
    )
    return ax


def _screened(design: HarmonicDesign, ax: Axes) -> None:
    s = design.search
    within, beyond = (
        s.screened_feasible & ~s.screened_overturned,
        ~s.screened_feasible & ~s.screened_overturned,
    )
    value, bare = s.screened_value[within], design.bare.value
    if value.size:
        # Colours begin at zero, or below where designs rest; a few bad designs must not make others alike.
        top = 1.2 * bare if 0.0 < bare <= 1.0 else float(np.max(value[np.isfinite(value)], initial=0.1))
        # At a tilt of nu the block topples: there is nothing to tell apart beyond it.
        top = min(top, 1.0)
        scale: dict[str, Any] = {"cmap": "viridis", "vmin": min(0.0, float(np.min(value))), "vmax": top}
        points = ax.scatter(*s.screened[within, :2].T, c=value, s=26, lw=0.4, ec="white", **scale)
        label = "within the limits: tilt / slenderness (-)"
        cast(Any, ax.figure).colorbar(
            points, ax=ax, label=label, extend="max" if (value > top).any() else "neither"
        )
    ax.scatter(
        *s.screened[beyond, :2].T, marker="^", s=14, fc="none", ec=GREY, lw=0.8, label="beyond a limit"
    )
    # Open and filled markers of different shapes stay apart in grey.
    lost = s.screened[s.screened_overturned, :2].T
    ax.scatter(*lost, marker="x", c=INK, s=14, lw=0.7, label="overturned or not settled")


def _points(ax: Axes, designs: np.ndarray, marker: str, size: float, label: str, mfc: str = "none") -> None:
    if len(designs):
        ax.plot(*designs[:, :2].T, ls="", marker=marker, ms=size, mfc=mfc, mec=INK, label=label)


def _padded(bounds: tuple[float, float]) -> tuple[float, float]:
    # Designs at a bound would otherwise lie on the frame, half hidden.
    pad = 0.03 * (bounds[1] - bounds[0])
    return bounds[0] - pad, bounds[1] + pad
