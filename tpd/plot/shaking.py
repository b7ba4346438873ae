"""Pictures of a block under a ground motion: histories, overturning spectrum, rocking spectrum, fragility."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap

from tpd.analysis.fragility import Fragility
from tpd.analysis.overturning_spectrum import (
    OVERTURNS,
    ROCKS,
    STANDS,
    UNDECIDED,
    OverturningSpectrum,
)
from tpd.analysis.rocking_spectrum import RockingSpectrum
from tpd.analysis.shaking_history import ShakingHistory
from tpd.plot.style import BLUE, CASES, GREY, INK, ORANGE, in_degrees, new_axes

_LINES: tuple[dict[str, Any], ...] = (
    {"color": GREY, "lw": 1.6, "label": CASES[0]["label"]},
    {"color": BLUE, "lw": 1.0, "label": CASES[1]["label"]},
)


def plot_shaking(histories: Sequence[ShakingHistory], slenderness: float, axes: Any = None) -> Any:
    """Draw the base acceleration, the tilt and, with a pendulum, the rod's angle, and the friction needed.

    Args:
        histories: of the bare block and, if there is one, with the pendulum.
        slenderness: of the block; a tilt of this size is the balance of the bare block.
        axes: three, or four with a pendulum; default those of a new figure.

    Returns:
        The axes, an array.
    """
    hung = [h for h in histories if h.swing is not None]
    axes = new_axes(4 if hung else 3, (7.4, 8.2 if hung else 6.4)) if axes is None else axes
    first = histories[0]
    axes[0].plot(first.times, first.base, color=INK, lw=0.7)
    axes[0].set_ylabel("base acceleration\n(m/s²)")
    for history, style in zip(histories, _LINES, strict=False):
        axes[1].plot(history.times, history.tilt, **style)
        # Where the block all but leaves the ground, no friction is enough: the picture stops at 5.
        ratio = np.abs(history.horizontal) / np.maximum(history.vertical, 1e-300)
        axes[-1].plot(history.times, np.minimum(ratio, 5.0), **style)
        _mark_fall(axes[1], history, style)
    for side in (-1.0, 1.0):
        axes[1].axhline(side * slenderness, color=ORANGE, lw=1.0, ls=":")
    axes[1].set_ylabel("tilt φ (rad)")
    if hung:
        axes[2].plot(hung[0].times, hung[0].swing, **_LINES[1])
        axes[2].set_ylabel("rod from the\nvertical ψ (rad)")
        in_degrees(axes[2])
    axes[-1].set(ylabel="friction needed\n|H|/V (-)", xlabel="time (s)", ylim=(0.0, None))
    axes[1].legend(fontsize=8, frameon=False, loc="upper right", ncols=2)
    in_degrees(axes[1])
    return axes


def _mark_fall(ax: Any, history: ShakingHistory, style: dict[str, Any]) -> None:
    """Say where a line ends because the block falls."""
    fallen = np.flatnonzero(np.isnan(history.tilt))
    if len(fallen) and fallen[0] > 0:
        i = fallen[0] - 1
        ax.plot(history.times[i], history.tilt[i], "X", color=style["color"], mec=INK, ms=8)
        ax.annotate(
            "overturns", (history.times[i], history.tilt[i]), (6, -4), textcoords="offset points", fontsize=8
        )


def plot_overturning_spectrum(spectrum: OverturningSpectrum, axes: Any = None) -> Any:
    """Draw what every pulse does, without the pendulum and with it, side by side; a cross is a pulse without
    an answer.

    Returns:
        The axes, an array of one or two.
    """
    cells = [c for c in (spectrum.bare, spectrum.hung) if c is not None]
    if axes is None:
        figure = new_axes(1, (4.2 * len(cells) + 0.8, 4.6)).figure
        figure.clear()
        axes = np.atleast_1d(figure.subplots(1, len(cells), sharey=True))
    # From white to dark in the order of what is worse, so that it reads in grey.
    colours = ListedColormap(["#ffffff", "#d9e4f1", "#f0b97d", "#8a4b14"])
    norm = BoundaryNorm([STANDS - 0.5, STANDS + 0.5, ROCKS + 0.5, OVERTURNS + 0.5, 1e9], colours.N)
    image = None
    for ax, cell, case in zip(axes, cells, CASES, strict=False):
        # An overturning without an impact is the last of the four.
        shown = np.where(cell == OVERTURNS, OVERTURNS + 1, np.where(cell > OVERTURNS, OVERTURNS, cell))
        values = np.ma.masked_less(shown, STANDS)
        image = ax.pcolormesh(
            spectrum.frequency_ratios,
            spectrum.acceleration_ratios,
            values,
            cmap=colours,
            norm=norm,
            rasterized=True,
        )
        size, ratio = np.nonzero(cell == UNDECIDED)
        if size.size:
            # White is the colour of what stands.
            at = spectrum.frequency_ratios[ratio], spectrum.acceleration_ratios[size]
            ax.plot(*at, ls="", marker="x", ms=5, color=INK, label=f"no answer: {size.size} of {cell.size}")
            ax.legend(fontsize=8, loc="upper left")
        ax.set(title=case["label"], xlabel=r"frequency of the pulse $\omega_p/p$ (-)")
    axes[0].set_ylabel(r"largest acceleration $a_p/(g\,\tan\alpha)$ (-)")
    ticks = [STANDS, ROCKS, OVERTURNS, 0.5 * (OVERTURNS + 0.5 + 1e9)]
    bar = axes[0].figure.colorbar(
        image, ax=list(axes), ticks=ticks, spacing="uniform", location="bottom", shrink=0.9, aspect=50
    )
    bar.ax.set_xticklabels(
        ["stands", "rocks", "overturns\nafter impacts", "overturns\nwithout impact"], fontsize=8
    )
    return axes


def plot_rocking_spectrum(spectrum: RockingSpectrum, ax: Any = None) -> Any:
    """Draw the largest tilt over the slenderness against 2 pi/p; blocks that overturn are marked on top, and
    so are those without an answer."""
    ax = new_axes() if ax is None else ax
    for tilts, style in zip((spectrum.bare, spectrum.hung), _LINES, strict=False):
        if tilts is None:
            continue
        known = np.where(np.isfinite(tilts), tilts, np.nan)
        ax.plot(spectrum.periods, known, **style)
        # Above the frame, where no tilt can be.
        level = 1.02 if style is _LINES[0] else 1.06
        for where, marker, what in ((np.isinf(tilts), "|", "overturns"), (np.isnan(tilts), "x", "no answer")):
            # An answer is the rule: only what is missing is named.
            if marker == "x" and not where.any():
                continue
            ax.plot(
                spectrum.periods[where],
                np.full(where.sum(), level),
                ls="",
                marker=marker,
                color=style["color"],
                transform=ax.get_xaxis_transform(),
                clip_on=False,
                label=f"{style['label']}: {what}",
            )
    ax.set(
        xlabel=r"$2\pi/p$ of the block (s)", ylabel=r"largest tilt over the slenderness (-)", ylim=(0.0, None)
    )
    ax.legend(fontsize=8, frameon=False)
    return ax


def plot_fragility(fragility: Fragility, state: str = "overturned", ax: Any = None) -> Any:
    """Draw shares at the stripes, the lognormal curves and their 95 % bands for one damage state. A bar at a
    stripe is what motions without an answer leave open.

    Raises:
        ValueError: a state that the fragility does not have.
    """
    if state not in fragility.bare:
        raise ValueError(f"`state` must be one of {', '.join(fragility.bare)}, but is {state!r}")
    ax = new_axes() if ax is None else ax
    fine = np.linspace(0.5 * fragility.stripes[0], 1.1 * fragility.stripes[-1], 300)
    cases = [fragility.bare[state]] + ([] if fragility.hung is None else [fragility.hung[state]])
    for curve, style in zip(cases, CASES, strict=False):
        # Open without the pendulum and filled with it, so that they differ in grey.
        face = style.get("mfc", style["color"])
        ax.plot(
            fragility.stripes,
            curve.shares,
            ls="",
            marker=style["marker"],
            ms=6,
            mfc=face,
            mec=INK,
            label=f"{style['label']}: shares of {len(fragility.motions)} motions",
            clip_on=False,
            zorder=3,
        )
        if curve.undecided.any():
            # From none of the motions without an answer to all of them.
            some, n = curve.undecided > 0, curve.total + curve.undecided
            ends = curve.counts / n, (curve.counts + curve.undecided) / n
            label = f"{style['label']}: {curve.undecided.sum()} runs without an answer"
            ax.vlines(
                fragility.stripes[some], ends[0][some], ends[1][some], colors=style["color"], label=label
            )
        if 0.0 < curve.fit.median < np.inf:
            low, high = curve.fit.band(fine)
            ax.fill_between(fine, low, high, color=style["color"], alpha=0.2, lw=0)
            label = f"{style['label']}: median {curve.fit.median:.3g}"
            ax.plot(
                fine, curve.fit.probability(fine), color=style["color"], ls=style["ls"], lw=1.6, label=label
            )
    unit = "" if fragility.unit == "-" else f" ({fragility.unit})"
    ax.set(xlabel=f"{fragility.intensity}{unit}", ylabel=f"share of motions: {state} (-)", ylim=(0.0, 1.0))
    ax.legend(fontsize=8, frameon=False, loc="upper left")
    return ax
