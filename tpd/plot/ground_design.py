"""Pictures of a design on ground motions."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpd.design.ground.design import GroundDesign
from tpd.design.ground.judgement import Judged
from tpd.plot.style import BLUE, CASES, INK, LABELS, new_axes


def plot_groups(design: GroundDesign) -> Any:
    """Draw the shares of each group that overturn at each stripe, without and with the pendulum, one panel
    for each group: the fitted curve, its band of 95 % confidence and the shares themselves; a bar where runs
    without an answer leave a share open."""
    groups = design.judged
    figure = new_axes(size=(3.6 * max(len(groups), 2), 3.6)).figure
    # Panels side by side, which `new_axes` does not make.
    figure.clf()
    panels = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    for ax, group in zip(panels, groups, strict=True):
        _panel(ax, group)
        ax.set_xlabel(_INTENSITIES[design.conditions.intensity])
    panels[0].set_ylabel("share of motions that overturn the block (-)")
    panels[0].legend(fontsize=8, frameon=False, loc="upper left")
    return panels


_INTENSITIES = {
    "pga_star": r"PGA / (g tan $\alpha$) (-)",
    "pgv_star": r"p PGV / (g tan $\alpha$) (-)",
    "pga": "PGA (m/s²)",
    "pgv": "PGV (m/s)",
    "scale": "factor on each motion (-)",
}


def _panel(ax: Any, group: Judged) -> None:
    fine = np.linspace(0.8 * group.stripes[0], 1.05 * group.stripes[-1], 200)
    for count, unknown, fit, style in zip(group.counts, group.unknown, group.fits, CASES, strict=True):
        known, open_at = group.motions - unknown, np.flatnonzero(unknown)
        # From the share if none of the runs without an answer overturned to that if all did.
        low, high = count / group.motions, (count + unknown) / group.motions
        ax.vlines(group.stripes[open_at], low[open_at], high[open_at], color=style["color"], lw=5, alpha=0.35)
        # Open without the pendulum and filled with it, so that they differ in grey.
        face = style.get("mfc", style["color"])
        ax.plot(
            group.stripes[known > 0],
            (count / np.maximum(known, 1))[known > 0],
            ls="",
            marker=style["marker"],
            ms=6,
            mfc=face,
            mec=INK,
            label=style["label"],
            clip_on=False,
            zorder=3,
        )
        if 0.0 < fit.median < np.inf:
            low, high = fit.band(fine)
            ax.fill_between(fine, low, high, color=style["color"], alpha=0.18, lw=0)
            ax.plot(fine, fit.probability(fine), color=style["color"], ls=style["ls"], lw=1.6)
    d = group.difference
    ax.set_title(
        f"{group.name}: {group.motions} motions, {group.events} earthquakes\n"
        f"{d.mean:+.0%} overturned ({d.low:+.0%} to {d.high:+.0%})"
        + (f"\n{group.undecided} runs without an answer" if group.undecided else ""),
        fontsize=9,
    )
    ax.set_ylim(0.0, 1.0)


def plot_search(design: GroundDesign) -> Any:
    """Draw the trend of the tilt over mass and length ratio, at the damping of the best design, and the
    designs that were followed, in a square those with runs without an answer; the darker, the larger the
    tilt."""
    ax = new_axes()
    found, surface = design.searched, design.surface
    assert found is not None
    if surface is not None and design.best is not None:
        _trend(ax, design)
    mu, lam = found.designs[:, 0], found.designs[:, 1]
    inside = found.feasible
    ax.plot(mu[inside], lam[inside], ls="", marker="o", ms=5, mfc=BLUE, mec=INK, label="within limits")
    ax.plot(mu[~inside], lam[~inside], ls="", marker="x", ms=5, color=INK, label="beyond a limit")
    if (unknown := found.undecided > 0).any():
        ring = {"ls": "", "marker": "s", "ms": 9, "mfc": "none", "mec": INK}
        ax.plot(mu[unknown], lam[unknown], **ring, label="runs without an answer")
    if design.best is not None:
        ax.plot(*design.best[:2], ls="", marker="*", ms=16, mfc="white", mec=INK, mew=1.3, label="best trend")
    ax.set(xlabel=LABELS["mu"], ylabel=LABELS["lam"])
    ax.legend(fontsize=8, frameon=False, loc="upper center", ncols=3, bbox_to_anchor=(0.5, 1.1))
    return ax


def _trend(ax: Any, design: GroundDesign) -> None:
    """Shades and contours of the response surface."""
    surface, best, space = design.surface, design.best, design.space
    assert surface is not None
    assert best is not None
    mu, lam = (np.linspace(*bounds, 60) for bounds in (space.mass_ratio, space.length_ratio))
    grid = np.stack(np.meshgrid(mu, lam), axis=-1).reshape(-1, 2)
    whole = np.column_stack([grid, np.full(len(grid), best[2])])
    trend = surface.at(space.scaled(whole))[0].reshape(60, 60)
    shades = ax.contourf(mu, lam, trend, levels=12, cmap="Greys", alpha=0.75)
    ax.figure.colorbar(shades, label=f"trend of the tilt over ν at ζ = {best[2]:.2g} (-)")
