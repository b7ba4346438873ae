"""Pictures of a design on ground motions."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpd.design.ground.design import GroundDesign
from tpd.design.ground.judgement import Judged
from tpd.plot.style import CASES, GREY, INK, LABELS, new_axes


def plot_groups(design: GroundDesign) -> Any:
    """Draw the shares of each group that overturn at each stripe, without and with the pendulum, one panel
    for each group: the fitted curve, its band of 95 % confidence and the shares themselves."""
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
    for count, fit, style in zip(group.counts, group.fits, CASES, strict=True):
        # Open without the pendulum and filled with it, so that they differ in grey.
        face = style.get("mfc", style["color"])
        ax.plot(
            group.stripes,
            count / group.motions,
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
        f"{d.mean:+.0%} overturned ({d.low:+.0%} to {d.high:+.0%})",
        fontsize=9,
    )
    ax.set_ylim(0.0, 1.0)


def plot_search(design: GroundDesign) -> Any:
    """Draw the designs that were followed over mass and length ratio; the darker, the larger the demand."""
    ax = new_axes()
    found = design.searched
    assert found is not None
    mu, lam = found.designs[:, 0], found.designs[:, 1]
    inside = found.feasible
    low, high = float(found.value.min()), float(max(found.value.max(), found.value.min() + 1e-9))
    # The lightest shade is kept for none, so that the best designs are seen on white.
    drawn = {"cmap": "Greys", "vmin": low - 0.3 * (high - low), "vmax": high, "edgecolors": INK, "lw": 0.6}
    shades = ax.scatter(
        mu[inside], lam[inside], c=found.value[inside], marker="o", s=46, label="within limits", **drawn
    )
    ax.scatter(mu[~inside], lam[~inside], marker="x", s=22, color=GREY, label="beyond a limit")
    if design.best is not None:
        ax.plot(*design.best[:2], ls="", marker="*", ms=15, mfc="white", mec=INK, mew=1.3, label="best trend")
    ax.figure.colorbar(shades, label="demand over all motions (-)")
    ax.set(xlabel=LABELS["mu"], ylabel=LABELS["lam"])
    ax.legend(fontsize=8, frameon=False, loc="upper center", ncols=3, bbox_to_anchor=(0.5, 1.1))
    return ax
