"""Maps, spectra, fragility and records: designs on a grid, what pulses do to a block, blocks of all sizes."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from tpd.answers.design_map import DesignMap
from tpd.answers.fragility import Fragility
from tpd.answers.spectra import OVERTURNS, ROCKS, STANDS, UNDECIDED, OverturningSpectrum, RockingSpectrum
from tpd.answers.statistics import Lognormal
from tpd.core import checks
from tpd.formats.channel import STANDARD_GRAVITY
from tpd.plots.style import CASES, GREY, INK, LABELS, LINES, edge, legend, new_axes, own_style
from tpd.records.intensity import base_motion, significant_times, spectral_acceleration
from tpd.scene.record import Record

_MOVING = ("rocking", "sticking", "near_fold", "grazing")
"""Statuses of periodic motions, which have an amplitude."""
_HATCHES = {
    "rest": ("", "rest, no attracting orbit found"),
    "held": ("----", "held leaning"),
    "neutral": ("||||", "an orbit, neutral"),
    "unstable": ("////", "orbits found, none attracts"),
    "not_known": ("....", "no orbit found"),
    "overturned": ("xxxx", "overturns"),
    "not_settled": ("\\\\\\\\", "does not settle"),
}
_OTHER = ("++++", "no answer")
_QUANTITIES = {
    "amplitude": r"largest tilt $|\varphi|$ (rad)",
    "swing": r"largest bob angle $|\psi|$ (rad)",
    "margin": "uplift margin of the resting block (-)",
}


@own_style()
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
    coloured = {"amplitude": _MOVING, "swing": (*_MOVING, "rest"), "margin": tuple(m.counts)}[quantity]
    shown = np.isfinite(values) & np.isin(m.status, coloured)
    low, high = 0.0, 1.0
    if shown.any():
        # A few designs next to a resonance would make all others alike, and so would a scale from zero.
        low, high = (float(x) for x in np.quantile(values[shown], (0.02, 0.995)))
    mesh = ax.pcolormesh(m.x, m.y, np.where(shown, values, np.nan), vmin=low, vmax=high, rasterized=True)
    beyond = bool((values[shown] < low).any()), bool((values[shown] > high).any())
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(beyond, "neither")
    cast(Any, ax.figure).colorbar(mesh, ax=ax, label=_QUANTITIES[quantity], extend=extend)
    handles = _hatched(ax, m, coloured)
    if m.margin.min() < 0.0 < m.margin.max():
        # The bob has settled: a block at rest lifts on one side of the line and stays on the other.
        edge(ax, m.x, m.y, m.margin, "uplift margin 0", 0.5)
    ax.set(xlabel=LABELS[m.x_name], ylabel=LABELS[m.y_name])
    if handles:
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": 2}
        ax.legend(handles=handles, fontsize=8, frameon=False, **place)
    return ax


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


@own_style()
def plot_overturning_spectrum(spectrum: OverturningSpectrum, axes: Any = None) -> Any:
    """Draw what every pulse does, without the pendulum and with it, side by side; a cross is a pulse without
    an answer.

    Returns:
        The axes, an array of one or two.
    """
    cells = spectrum.cases
    if axes is None:
        axes = np.atleast_1d(new_axes(1, (4.2 * len(cells) + 0.8, 4.6), columns=len(cells)))
    # From white to dark in the order of what is worse, so that it reads in grey.
    colours = ListedColormap(["#ffffff", "#d9e4f1", "#f0b97d", "#8a4b14"])
    norm = BoundaryNorm([STANDS - 0.5, STANDS + 0.5, ROCKS + 0.5, OVERTURNS + 0.5, 1e9], colours.N)
    image = None
    for ax, cell, case in zip(axes, cells, CASES, strict=False):
        # An overturning without an impact is the last of the four.
        shown = np.where(cell == OVERTURNS, OVERTURNS + 1, np.where(cell > OVERTURNS, OVERTURNS, cell))
        values = np.ma.masked_less(shown, STANDS)
        grid = spectrum.frequency_ratios, spectrum.acceleration_ratios
        image = ax.pcolormesh(*grid, values, cmap=colours, norm=norm, rasterized=True)
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


@own_style()
def plot_rocking_spectrum(spectrum: RockingSpectrum, ax: Any = None) -> Any:
    """Draw the largest tilt over the slenderness against 2 pi/p; blocks that overturn are marked on top, and
    so are those without an answer."""
    ax = new_axes() if ax is None else ax
    for tilts, style in zip(spectrum.cases, LINES, strict=False):
        known = np.where(np.isfinite(tilts), tilts, np.nan)
        ax.plot(spectrum.periods, known, **style)
        # Above the frame, where no tilt can be.
        level = 1.02 if style is LINES[0] else 1.06
        for where, marker, what in ((np.isinf(tilts), "|", "overturns"), (np.isnan(tilts), "x", "no answer")):
            # An answer is the rule: only what is missing is named.
            if marker == "x" and not where.any():
                continue
            marks = {"ls": "", "marker": marker, "color": style["color"], "clip_on": False}
            place = {"transform": ax.get_xaxis_transform(), "label": f"{style['label']}: {what}"}
            ax.plot(spectrum.periods[where], np.full(where.sum(), level), **marks, **place)
    ax.set(
        xlabel=r"$2\pi/p$ of the block (s)", ylabel=r"largest tilt over the slenderness (-)", ylim=(0.0, None)
    )
    legend(ax, loc="best")
    return ax


@own_style()
def plot_fragility(fragility: Fragility, state: str = "overturned", ax: Any = None) -> Any:
    """Draw shares at the stripes, the lognormal curves and their 95 % bands for one damage state. A bar at a
    stripe is what motions without an answer leave open.

    Raises:
        ValueError: a state that the fragility does not have.
    """
    checks.one_of("state", state, tuple(fragility.without_pendulum))
    ax = new_axes() if ax is None else ax
    fine = np.linspace(0.5 * fragility.stripes[0], 1.1 * fragility.stripes[-1], 300)
    for i, c in enumerate(case[state] for case in fragility.cases):
        _curve(ax, fragility.stripes, c.counts, c.undecided, c.total + c.undecided, c.fit, fine, i)
    unit = "" if fragility.unit == "-" else f" ({fragility.unit})"
    ax.set(xlabel=f"{fragility.intensity}{unit}", ylabel=f"share of motions: {state} (-)", ylim=(0.0, 1.0))
    legend(ax)
    return ax


def _curve(
    ax: Any,
    stripes: np.ndarray,
    count: np.ndarray,
    unknown: np.ndarray,
    motions: Any,
    fit: Lognormal,
    fine: np.ndarray,
    case: int,
) -> None:
    """Shares of `motions` at the stripes, bars for those that are unknown, and the fit with its band."""
    style, known, open_at = CASES[case], motions - unknown > 0, unknown > 0
    shares = (count / np.maximum(motions - unknown, 1))[known]
    # Open without the pendulum and filled with it, so that they differ in grey.
    marks = style | {"ls": "", "ms": 6.0, "mec": INK}
    ax.plot(stripes[known], shares, clip_on=False, zorder=3, **marks)
    if open_at.any():
        # From the share if none of the runs without an answer had reached the state to that if all had.
        ends = (count / motions)[open_at], ((count + unknown) / motions)[open_at]
        label = f"{style['label']}: {unknown.sum()} runs without an answer"
        ax.vlines(stripes[open_at], *ends, colors=style["color"], lw=5, alpha=0.35, label=label)
    if 0.0 < fit.median < np.inf:
        ax.fill_between(fine, *fit.band(fine), color=style["color"], alpha=0.2, lw=0)
        label = f"{style['label']}: median {fit.median:.3g}"
        ax.plot(fine, fit.probability(fine), color=style["color"], ls=style["ls"], lw=1.6, label=label)


@own_style()
def plot_record(record: Record, axes: Any = None) -> Any:
    """Draw acceleration, velocity and displacement of a record over time, each with its peak, and the
    response spectrum for 5 % damping. The time between 5 % and 95 % of the energy is shaded.

    Returns:
        The four axes, an array.
    """
    if axes is None:
        figure = new_axes(size=(9.0, 5.6)).figure
        figure.clear()
        axes = figure.subplot_mosaic("as;vs;ds", width_ratios=[3, 2])
        axes = [axes[name] for name in "avds"]
    times = float(record.dt) * np.arange(len(record.acceleration))
    acceleration, velocity, displacement = base_motion(record)
    shown = (
        ("acceleration (g)", acceleration / STANDARD_GRAVITY, "PGA {:.3g} g"),
        ("velocity (m/s)", velocity, "PGV {:.3g} m/s"),
        ("displacement (m)", displacement, "PGD {:.3g} m"),
    )
    for ax, (label, values, words) in zip(axes, shown, strict=False):
        at = int(np.argmax(np.abs(values)))
        ax.axvspan(*significant_times(record), color="0.9", lw=0.0)
        ax.plot(times, values, color=INK, lw=0.7)
        ax.plot(times[at], values[at], ls="", marker="o", ms=5, mfc="white", mec=INK)
        ax.set(ylabel=label, xlim=(0.0, times[-1]))
        ax.set_title(words.format(abs(values[at])), fontsize=9, loc="right")
    axes[0].set_title(record.name or record.source, fontsize=9, loc="left")
    axes[2].set_xlabel("time (s), shaded: 5 to 95 % of the energy")
    periods = np.geomspace(0.05, 5.0, 40)
    sizes = [spectral_acceleration(record, t) / STANDARD_GRAVITY for t in periods]
    axes[3].semilogx(periods, sizes, color=INK, lw=1.2)
    axes[3].set(xlabel="period (s)", ylabel="spectral acceleration, 5 % damping (g)", ylim=(0.0, None))
    axes[3].set_xticks([0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0], ["0.05", "0.1", "0.2", "0.5", "1", "2", "5"])
    axes[3].grid(color=GREY, lw=0.3)
    return axes
