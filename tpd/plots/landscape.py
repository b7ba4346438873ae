"""Landscape of a search: the tilt over mass ratio and length ratio, edges of the limits, and the design."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import median_filter

from tpd.design.design import Design
from tpd.design.gaussian_process import Observations, fit
from tpd.design.orbits import Orbits, margins
from tpd.design.refine import Trials
from tpd.plots.style import HALO, INK, LABELS, NOT_RECOMMENDED, ORANGE, edge, legend, new_axes, own_style
from tpd.scene.parameters import as_arrays

_GRID = 48
"""Points along each axis."""
_HATCH, _UNKNOWN = "#bdbdbd", "#e8e8e8"
_CLIPPED = 0.1, 10.0
"""Shares of a limit beyond which a quantity is clipped: only the edge of the limit is drawn."""


@own_style()
def plot_landscape(design: Design, ax: Axes | None = None) -> Axes:
    """Draw the tilt over mass and length ratio at the damping of the best design, as a shaded field: the
    darker, the more the block tilts.

    The field is the trend that a Gaussian process estimates from all trial runs, by the linear equations.
    It is grey where the trials do not determine the trend. Hatched is where designs exceed a limit; each edge
    bears the name of its limit. Dots are the trial designs, thin lines the paths of the descents, crosses
    designs that the validation rejected, and the star is the design.

    Args:
        design: an answer of `tpd.optimise`.
        ax: default that of a new figure.

    Raises:
        ValueError: a design whose trials give no trend, for instance one that needs no pendulum.
    """
    trials, best = design.trials, design.nearest
    if trials is None or trials.process is None or best is None:
        raise ValueError("`design` must have trial runs from which a trend follows, but has none")
    ax = cast(Axes, new_axes(size=(7.0, 5.0)) if ax is None else ax)
    mu, lam = (np.linspace(*bounds, _GRID) for bounds in (design.space.mass_ratio, design.space.length_ratio))
    plane = np.stack(np.meshgrid(mu, lam), axis=-1).reshape(-1, 2)
    designs = np.column_stack([plane, np.full(len(plane), best[2])])
    field, deviation = (x.reshape(_GRID, _GRID) for x in trials.process.at(design.space.scaled(designs)))
    words = f"tilt over ν in trial runs, at ζ = {best[2]:.2g} (-)"
    _shade(ax, mu, lam, field, trials.without_pendulum, words)
    # Above the contours with their values, which would claim something there.
    if (deviation > trials.process.spread).any():
        levels = [trials.process.spread, np.inf]
        ax.contourf(mu, lam, deviation, levels=levels, colors=[_UNKNOWN], zorder=2)
        ax.fill([], [], color=_UNKNOWN, label="trend not known")
    # Next to a fold a single design may lose its orbit: a median of neighbours leaves such specks out.
    limits = _limits(design, trials, designs)
    edges = {name: median_filter(x.reshape(_GRID, _GRID), 3) for name, x in limits.items()}
    worst = np.max([np.full((_GRID, _GRID), -1.0), *edges.values()], axis=0)
    if (worst > 0.0).any():
        beyond = ax.contourf(mu, lam, worst, levels=[0.0, np.inf], colors="none", hatches=["//"], zorder=2)
        beyond.set_edgecolor(_HATCH)
        beyond.set_linewidth(0.0)
    crossed = {name: x for name, x in edges.items() if x.min() < 0.0 < x.max()}
    for i, (name, x) in enumerate(crossed.items()):
        edge(ax, mu, lam, x, name.replace("_", " "), (i + 1.0) / (len(crossed) + 1.0))
    _points(ax, trials.designs, ".", 3.0, "trial designs", INK)
    _points(ax, trials.designs[trials.undecided > 0], "s", 9.0, "runs without an answer", "none")
    if design.search is not None:
        problem = design.problem
        common = as_arrays(design.scene.parameters()), design.conditions, design.space
        least = margins(Orbits(*common, problem.risk, problem.limits, problem.geometry), designs).min(axis=1)
        if least.min() < 0.0 < least.max():
            least = least.reshape(_GRID, _GRID)
            edge(ax, mu, lam, least, "stays at rest", 0.5, color=INK, style="--")
        for i, path in enumerate(design.search.paths):
            ax.plot(*path[:, :2].T, color=INK, lw=0.5, label=None if i else "paths of the descents")
    label, fill = ("design", ORANGE) if design.pendulum is not None else (NOT_RECOMMENDED, "white")
    _points(ax, best[None], "*", 17.0, label, fill)
    rejected = np.array([v.design for v in design.validated if v.reasons]).reshape(-1, 3)
    _points(ax, rejected, "X", 7.0, "rejected by the validation", "white")
    ax.set(xlabel=LABELS["mu"], ylabel=LABELS["lam"], xlim=mu[[0, -1]], ylim=lam[[0, -1]])
    legend(ax, columns=3)
    return ax


def _limits(design: Design, trials: Trials, designs: np.ndarray) -> dict[str, np.ndarray]:
    """Logarithms of the limited quantities over their limits, by name, of designs (m, 3): exact where no run
    is needed, else through the quantiles of the trial runs as well."""
    problem, scaled = design.problem, design.space.scaled
    exact, out = problem.fixed_sizes(trials.designs), dict[str, np.ndarray]()
    for name, x in problem.fixed_sizes(designs).items():
        out[name] = np.log(np.clip(x, *_CLIPPED))
        sizes = trials.sizes[:, trials.names.index(name)]
        if not np.array_equal(sizes, exact[name]):
            # Sizes are positive and range over decades: their logarithms are smooth.
            seen = Observations(scaled(trials.designs), np.log(np.clip(sizes, *_CLIPPED)))
            out[name] = np.maximum(out[name], fit(seen, problem.seed).at(scaled(designs))[0])
    return out


def _shade(ax: Axes, mu: np.ndarray, lam: np.ndarray, field: np.ndarray, without: float, words: str) -> None:
    """The field, and contours with their values."""
    # More tilt than without a pendulum is bad enough: there is nothing to tell apart beyond it.
    low, high = float(field.min()), float(min(field.max(), max(without, np.quantile(field, 0.5))))
    levels = MaxNLocator(14).tick_values(low, high)
    style: dict[str, Any] = {"levels": levels, "extend": "max" if field.max() > levels[-1] else "neither"}
    shades = ax.contourf(mu, lam, field, cmap="Blues", **style)
    lines = ax.contour(mu, lam, field, levels=levels[::3], colors=INK, linewidths=0.4)
    for text in ax.clabel(lines, fmt="%.3g", fontsize=8, zorder=2):
        text.set_path_effects(HALO)
    bar = cast(Any, ax.figure).colorbar(shades, ax=ax, label=words)
    bar.ax.set_title(f"without: {without:.2g}", fontsize=8)


def _points(ax: Axes, designs: np.ndarray, marker: str, size: float, label: str, mfc: str) -> None:
    if len(designs):
        # Many designs lie at the edge of the space, where a mark would be cut in half.
        style: dict[str, Any] = {"ls": "", "mec": INK, "clip_on": False, "zorder": 3}
        ax.plot(*designs[:, :2].T, marker=marker, ms=size, mfc=mfc, label=label, **style)
