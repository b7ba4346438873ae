"""Landscape of a search: tilt over mass ratio and length ratio, edges of the limits, and the design."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import median_filter

from tpd.design.design import Design
from tpd.design.refine import Trials
from tpd.plots.style import (
    HALO,
    INK,
    LABELS,
    NOT_RECOMMENDED,
    ORANGE,
    SMALL,
    edge,
    legend,
    new_axes,
    own_style,
)

_GRID = 48
"""Number of points along each axis."""
_HATCH, _UNKNOWN = "#bdbdbd", "#e8e8e8"
"""Colours of the hatching where a limit is exceeded, and of the area where the trend is unknown."""
_CLIPPED = 0.1, 10.0
"""Smallest and largest ratio of a limited quantity to its limit. Other ratios are clipped, because only the
edge at a ratio of 1 is drawn."""


@own_style()
def plot_landscape(design: Design, ax: Axes | None = None) -> Axes:
    """Draw the mean tilt over mass ratio and length ratio, at the damping ratio of the best design.

    Dark areas have a large tilt. The field is the trend of all trial runs of the linear model, by a
    smoothing spline. It is grey where the trials do not determine the trend, and hatched where a limit
    is exceeded; the name of the limit stands at its edge. Dots are trial designs, thin lines the paths of the
    descents, crosses the designs that the validation rejected, and the star is the best design.

    If the mass or the length is fixed, the damping ratio is on its axis. If only one parameter is searched,
    the tilt is drawn as a curve over this parameter.

    Args:
        design: the answer of `tpd.optimise`.
        ax: axes to draw on; by default those of a new figure.

    Returns:
        The axes.

    Raises:
        ValueError: the trials of the design have no trend, for example because no pendulum is needed.
    """
    trials, best = design.trials, design.nearest
    if trials is None or trials.risk is None or best is None:
        raise ValueError("`design` must have trial runs from which a trend follows, but has none")
    ax = cast(Axes, new_axes(size=(7.0, 5.0)) if ax is None else ax)
    space = design.space
    if len(space.names) == 1:
        return _curve(ax, design, trials, best)
    axes = space.searched[:2]
    low, high = space.bounds[:, :2]
    x, y = np.linspace(low, high, _GRID).T
    designs = np.tile(best, (_GRID**2, 1))
    designs[:, axes] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    field, deviation = (z.reshape(_GRID, _GRID) for z in trials.risk.at(space.logarithms(designs)))
    # With two axes, one of the three parameters has the value of the best design everywhere.
    (other,) = {0, 1, 2} - {*axes.tolist()}
    label = f"tilt over ν in trial runs, at {'μλζ'[other]} = {best[other]:.2g} (-)"
    _shade(ax, x, y, field, trials.without_pendulum, label)
    # The grey area covers the contours and their values, because the trend is not known there.
    spread = np.std(trials.risk.values)
    if (deviation > spread).any():
        # The trend is unknown where its standard deviation is as large as that of all trial values.
        levels = [spread, np.inf]
        ax.contourf(x, y, deviation, levels=levels, colors=[_UNKNOWN], zorder=2)
        ax.fill([], [], color=_UNKNOWN, label="trend not known")
    # Close to a fold, single designs can lose their orbit. The median over neighbours removes such specks.
    limits = _limits(design, trials, designs)
    edges = {name: median_filter(z.reshape(_GRID, _GRID), 3) for name, z in limits.items()}
    # The largest logarithm over all limits is positive where any limit is exceeded.
    worst = np.max([np.full((_GRID, _GRID), -1.0), *edges.values()], axis=0)
    if (worst > 0.0).any():
        beyond = ax.contourf(x, y, worst, levels=[0.0, np.inf], colors="none", hatches=["//"], zorder=2)
        beyond.set_edgecolor(_HATCH)
        beyond.set_linewidth(0.0)
    # A limit that all designs keep, or that all exceed, has no edge.
    crossed = {name: z for name, z in edges.items() if z.min() < 0.0 < z.max()}
    for i, (name, z) in enumerate(crossed.items()):
        edge(ax, x, y, z, name.replace("_", " "), (i + 1.0) / (len(crossed) + 1.0))
    _points(ax, trials.designs[:, axes], ".", 3.0, "trial designs", INK)
    _points(ax, trials.designs[trials.undecided > 0][:, axes], "s", 9.0, "runs without a result", "none")
    # The block can stay at rest where the smallest uplift margin over all conditions is positive.
    margin = design.problem.least_margins(designs)
    if margin.min() < 0.0 < margin.max():
        edge(ax, x, y, margin.reshape(_GRID, _GRID), "stays at rest", 0.5, color=INK, style="--")
    for i, path in enumerate(design.paths):
        ax.plot(*path[:, axes].T, color=INK, lw=0.5, label=None if i else "paths of the descents")
    _star(ax, design, best[axes])
    # A recommended design is the last validated one and has no reasons.
    rejected = np.array([v.design for v in design.validated if v.reasons]).reshape(-1, 3)
    _points(ax, rejected[:, axes], "X", 7.0, "rejected by the validation", "white")
    across, up = (LABELS[name] for name in space.names[:2])
    ax.set(xlabel=across, ylabel=up, xlim=x[[0, -1]], ylim=y[[0, -1]])
    legend(ax)
    return ax


def _curve(ax: Axes, design: Design, trials: Trials, best: np.ndarray) -> Axes:
    """Draw the mean tilt over the only parameter that is searched."""
    assert trials.risk is not None
    space, column = design.space, design.space.searched[0]
    designs = np.tile(best, (_GRID, 1))
    low, high = space.bounds
    designs[:, column] = x = np.linspace(low, high, _GRID)[:, 0]
    trend, deviation = trials.risk.at(space.logarithms(designs))
    around = trend - 2.0 * deviation, trend + 2.0 * deviation
    ax.fill_between(x, *around, color=_UNKNOWN, label="trend, 2 standard deviations")
    ax.plot(x, trend, color=INK)
    ax.axhline(trials.without_pendulum, color=INK, ls="--", label="without the pendulum")
    over = np.max([np.full(len(x), -1.0), *_limits(design, trials, designs).values()], axis=0) > 0.0
    if over.any():
        # The transform fills the whole height of the axes, independent of the tilts.
        style: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "fc": "none", "ec": _HATCH}
        ax.fill_between(x, 0.0, 1.0, over, hatch="//", lw=0.0, label="exceeds a limit", **style)
    _points(ax, np.column_stack([trials.designs[:, column], trials.value]), ".", 3.0, "trial designs", INK)
    _star(ax, design, np.array([best[column], trials.risk.at(space.logarithms(best[None]))[0][0]]))
    ax.set(xlabel=LABELS[space.names[0]], ylabel="tilt over ν in trial runs (-)", xlim=x[[0, -1]])
    legend(ax)
    return ax


def _limits(design: Design, trials: Trials, designs: np.ndarray) -> dict[str, np.ndarray]:
    """Return quantities that are positive where a limit is exceeded, by name, for designs of shape (m, 3).

    They are those that decide which designs are feasible: logarithms of exact values over their limits where
    no run is needed, and otherwise the trends of the trials.
    """
    out = {n: np.log(np.clip(x, *_CLIPPED)) for n, x in design.problem.fixed_sizes(designs).items()}
    at = design.space.logarithms(designs)
    for name, trend in trials.limits.items():
        out[name] = np.maximum(out.get(name, -np.inf), trend.at(at)[0])
    return out


def _shade(ax: Axes, x: np.ndarray, y: np.ndarray, field: np.ndarray, without: float, label: str) -> None:
    """Draw the field with a colour bar, and contours with their values."""
    # Designs with more tilt than without a pendulum are of no interest, so the colours end there.
    low, high = float(field.min()), float(min(field.max(), max(without, np.quantile(field, 0.5))))
    levels = MaxNLocator(14).tick_values(low, high)
    style: dict[str, Any] = {"levels": levels, "extend": "max" if field.max() > levels[-1] else "neither"}
    shades = ax.contourf(x, y, field, cmap="Blues", **style)
    lines = ax.contour(x, y, field, levels=levels[::3], colors=INK, linewidths=0.4)
    for text in ax.clabel(lines, fmt="%.3g", fontsize=SMALL, zorder=2):
        text.set_path_effects(HALO)
    bar = cast(Any, ax.figure).colorbar(shades, ax=ax, label=label)
    bar.ax.set_title(f"without: {without:.2g}", fontsize=SMALL)


def _star(ax: Axes, design: Design, at: np.ndarray) -> None:
    """Mark the best design."""
    label, fill = ("design", ORANGE) if design.pendulum is not None else (NOT_RECOMMENDED, "white")
    _points(ax, at[None], "*", 17.0, label, fill)


def _points(ax: Axes, designs: np.ndarray, marker: str, size: float, label: str, mfc: str) -> None:
    """Mark designs, (m, 2), if there are any."""
    if len(designs):
        # Many designs lie on the bounds of the space, where clipping would cut their marks in half.
        style: dict[str, Any] = {"ls": "", "mec": INK, "clip_on": False, "zorder": 3}
        ax.plot(*designs.T, marker=marker, ms=size, mfc=mfc, label=label, **style)
