"""Landscape of a search over mass ratio and length ratio, edges of the limits, and the design."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, MaxNLocator
from scipy.ndimage import median_filter

from tpd.design.design import Design
from tpd.design.search import Search
from tpd.design.trend import Trend
from tpd.design.trials import Trials
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
from tpd.scene.scene import NO_PENDULUM

_GRID, _COARSE = 48, 32
"""Numbers of points along each axis for a trend, and for orbits."""
_HATCH, _UNKNOWN = "#bdbdbd", "#e8e8e8"
"""Colours of the hatching where a limit is exceeded, and of the area where the trend is unknown."""
_CLIPPED = 0.1, 10.0
"""Smallest and largest ratio of a limited quantity to its limit. Other ratios are clipped, because only the
edge at a ratio of 1 is drawn."""


@own_style()
def plot_landscape(design: Design, ax: Axes | None = None) -> Axes:
    """Draw the mean tilt over mass ratio and length ratio, at the damping ratio of the best design.

    Under harmonic excitation the field is the objective of the descents by the exact orbits, and hatched
    where a limit is exceeded, with the angles of the bob as the runs corrected them. Lines are the paths of
    the descents, from their starts (open circles), and the numbers are the designs before and after each
    correction.

    Under ground motions dark areas have a large tilt. The field is the trend of all trial runs of the linear
    model, by a smoothing spline. It is grey where the trials do not determine the trend, and hatched where a
    limit is exceeded; the name of the limit stands at its edge. Dots are trial designs, crosses the designs
    that the validation rejected, and the star is the best design.

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
    trials, best, space = design.trials, design.nearest, design.space
    if trials is None or best is None or (trials.risk is None and design.search is None):
        raise ValueError("`design` must have descents or a trend of trial runs, but has neither")
    ax = cast(Axes, new_axes(size=(7.0, 5.0)) if ax is None else ax)
    if len(space.names) == 1:
        if trials.risk is None:
            raise ValueError("`design` must have two parameters that the descents vary, but has one")
        return _curve(ax, design, trials, best)
    axes, (low, high) = space.searched[:2], space.bounds[:, :2]
    x, y = np.linspace(low, high, _GRID).T
    if design.search is not None:
        x, y = np.geomspace(np.maximum(low, 1e-3 * high), high, _COARSE).T
    designs = np.tile(best, (x.size * y.size, 1))
    designs[:, axes] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # With two axes, one of the three parameters has the value of the best design everywhere.
    (other,) = {0, 1, 2} - {*axes.tolist()}
    where = f"at {'μλζ'[other]} = {best[other]:.2g} (-)"
    across, up = (LABELS[name] for name in space.names[:2])
    ax.set(xlabel=across, ylabel=up, xlim=x[[0, -1]], ylim=y[[0, -1]])
    (_trials if design.search is None else _descents)(ax, design, x, y, designs, where)
    # A recommended design is the last validated one and has no reasons.
    rejected = [v.design[axes] for v in design.validated if v.reasons and design.search is None]
    _star(ax, design, best[axes])
    _points(ax, np.array(rejected), "X", 7.0, "rejected by the validation", "white")
    legend(ax)
    return ax


def _trials(ax: Axes, design: Design, x: np.ndarray, y: np.ndarray, designs: np.ndarray, where: str) -> None:
    """Draw the trend of the trial runs at designs (m, 3) of a grid, and the trials."""
    trials = cast(Trials, design.trials)
    risk, at, axes = cast(Trend, trials.risk), design.space.logarithms(designs), design.space.searched[:2]
    field, deviation = (z.reshape(len(y), len(x)) for z in risk.at(at))
    _shade(ax, x, y, field, trials.without_pendulum, f"tilt over ν in trial runs, {where}")
    # The grey area covers the contours and their values, because the trend is not known there.
    spread = np.std(risk.values)
    if (deviation > spread).any():
        # The trend is unknown where its standard deviation is as large as that of all trial values.
        levels = [spread, np.inf]
        ax.contourf(x, y, deviation, levels=levels, colors=[_UNKNOWN], zorder=2)
        ax.fill([], [], color=_UNKNOWN, label="trend not known")
    _hatch(ax, x, y, _limits(design, trials, designs))
    _points(ax, trials.designs[:, axes], ".", 3.0, "trial designs", INK)
    _points(ax, trials.designs[trials.undecided > 0][:, axes], "s", 9.0, "runs without a result", "none")


def _descents(
    ax: Axes, design: Design, x: np.ndarray, y: np.ndarray, designs: np.ndarray, where: str
) -> None:
    """Draw the objective of the descents at designs (m, 3) of a grid, and their paths, over logarithmic
    axes."""
    axes, search = design.space.searched[:2], cast(Search, design.search)
    problem: Any = design.problem
    # Exact orbits under the conditions of the descents, with the limits after the last correction.
    orbits = replace(problem.searched, factors=search.factors)
    e = orbits.evaluate(designs)
    value, without = (orbits.value(of) for of in (e, orbits.evaluate(np.array([NO_PENDULUM]))))
    label = f"{orbits.objective.label}, {where}"
    _shade(ax, x, y, value.reshape(len(y), len(x)), float(without[0]), label)
    # One edge for each limit shows which limit holds the design.
    sizes = {s.name: np.log(np.clip(s.value.max(axis=1), *_CLIPPED)) for s in orbits.limited(e)}
    _hatch(ax, x, y, sizes)
    # The block can stay at rest where the smallest uplift margin over all conditions is positive.
    margin = problem.orbits.margins(designs).min(axis=1)
    if margin.min() < 0.0 < margin.max():
        edge(ax, x, y, margin.reshape(len(y), len(x)), "stays at rest", 0.5, color=INK, style="--")
    for i, path in enumerate(search.paths):
        ax.plot(*path[:, axes].T, color=INK, lw=0.9, zorder=3, label=None if i else "descents")
        ax.plot(*path[0, axes], "o", ms=6.0, mfc="white", mec=INK, zorder=3)
    for i, corrected in enumerate(search.corrected[:, axes]):
        text = ax.annotate(str(i), corrected, (4, 4), textcoords="offset points", fontsize=SMALL, zorder=5)
        text.set_path_effects(HALO)
    ax.plot(*search.corrected[:, axes].T, color=ORANGE, lw=1.2, zorder=3, label="corrections by runs")
    ax.set(xscale="log", yscale="log")
    for axis in (ax.xaxis, ax.yaxis):
        # Over less than a decade the default marks would be a single one.
        axis.set_major_formatter("{x:g}")
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_formatter("")


def _hatch(ax: Axes, x: np.ndarray, y: np.ndarray, edges: dict[str, np.ndarray]) -> None:
    """Hatch the area in which a limit is exceeded, and draw the edge of each limit with its name.

    `edges` are values at all points of the grid that are positive where a limit is exceeded.
    """
    # Close to a fold, single designs can lose their orbit. The median over neighbours removes such specks.
    edges = {name: median_filter(z.reshape(len(y), len(x)), 3) for name, z in edges.items()}
    # The largest logarithm over all limits is positive where any limit is exceeded.
    worst = np.max([np.full((len(y), len(x)), -1.0), *edges.values()], axis=0)
    if (worst > 0.0).any():
        beyond = ax.contourf(x, y, worst, levels=[0.0, np.inf], colors="none", hatches=["//"], zorder=2)
        beyond.set_edgecolor(_HATCH)
        beyond.set_linewidth(0.0)
    # A limit that all designs keep, or that all exceed, has no edge.
    crossed = {name: z for name, z in edges.items() if z.min() < 0.0 < z.max()}
    for i, (name, z) in enumerate(crossed.items()):
        edge(ax, x, y, z, name.replace("_", " "), (i + 1.0) / (len(crossed) + 1.0))


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
