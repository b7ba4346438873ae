"""Pictures of maps over two parameters, spectra, fragility curves and records."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, TickedStroke

from tpd.answers.design_map import DesignMap
from tpd.answers.fold_curve import FoldCurve
from tpd.answers.fragility import Curve, Fragility
from tpd.answers.spectra import OVERTURNS, ROCKS, STANDS, UNDECIDED, OverturningSpectrum, RockingSpectrum
from tpd.core import checks
from tpd.formats.channel import STANDARD_GRAVITY
from tpd.plots.style import CASES, GREY, HALO, INK, LABELS, LINES, SMALL, edge, legend, new_axes, own_style
from tpd.records.intensity import base_motion, significant_times, spectral_acceleration
from tpd.scene.ground_motion import LEAST_EARTHQUAKES
from tpd.scene.record import Record

_MOVING = ("rocking", "sticking", "near_fold", "grazing")
"""Statuses of periodic motions, which have an amplitude."""
# Hatching and label of statuses without an amplitude, by name.
_HATCHES = {
    "rest": ("", "rest; no attracting orbit"),
    "held": ("----", "sticks in a tilted position"),
    "neutral": ("||||", "neutral orbit"),
    "unstable": ("////", "unstable orbits only"),
    "not_known": ("....", "no orbit found"),
    "overturned": ("xxxx", "overturns"),
    "not_settled": ("\\\\\\\\", "does not settle"),
}
_OTHER = ("++++", "no result")
_QUANTITIES = {
    "amplitude": r"largest tilt $|\varphi|$ (rad)",
    "swing": r"largest bob angle $|\psi|$ (rad)",
    "margin": "uplift margin of the resting block (-)",
}


@own_style()
def plot_map(m: DesignMap, quantity: str = "amplitude", *, ax: Axes | None = None) -> Axes:
    """Draw one quantity of a map in colour.

    Designs without this quantity are hatched. A line marks where a block at rest begins to lift.

    Args:
        m: the map.
        quantity: "amplitude", "swing" or "margin".
        ax: axes to draw on; by default those of a new figure.

    Returns:
        The axes.

    Raises:
        ValueError: another quantity.
    """
    checks.one_of("quantity", quantity, tuple(_QUANTITIES))
    ax = cast(Axes, new_axes(size=(7.0, 5.4)) if ax is None else ax)
    values = getattr(m, quantity)
    # Only these statuses have the quantity.
    coloured = {"amplitude": _MOVING, "swing": (*_MOVING, "rest"), "margin": tuple(m.counts)}[quantity]
    shown = np.isfinite(values) & np.isin(m.status, coloured)
    low, high = 0.0, 1.0
    if shown.any():
        # Quantiles as ends of the colour scale: with the extremes, a few designs close to resonance would
        # leave one colour for all others.
        low, high = (float(x) for x in np.quantile(values[shown], (0.02, 0.995)))
    mesh = ax.pcolormesh(m.x, m.y, np.where(shown, values, np.nan), vmin=low, vmax=high, rasterized=True)
    beyond = bool((values[shown] < low).any()), bool((values[shown] > high).any())
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(beyond, "neither")
    cast(Any, ax.figure).colorbar(mesh, ax=ax, label=_QUANTITIES[quantity], extend=extend)
    handles = _hatched(ax, m, coloured)
    if m.margin.min() < 0.0 < m.margin.max():
        # On one side of the line a block at rest lifts after the bob has settled; on the other side it stays.
        edge(ax, m.x, m.y, m.margin, "uplift margin 0", 0.5)
    ax.set(xlabel=LABELS[m.x_name], ylabel=LABELS[m.y_name])
    legend(ax, handles=handles)
    return ax


def _hatched(ax: Axes, m: DesignMap, coloured: tuple[str, ...]) -> list[Any]:
    """Hatch the designs without a colour, and return the handles of the legend."""
    uncoloured = [s for s in m.counts if s not in coloured]
    kinds = {s: _HATCHES.get(s, _OTHER) for s in uncoloured}
    # With a start, the status is the outcome of one motion. Without a start it is about all orbits.
    if m.start is not None and "rest" in kinds:
        kinds["rest"] = ("", "settles at rest")
    handles = []
    # Statuses without an entry share one hatching, so the kinds are made unique.
    for hatch, label in dict.fromkeys(kinds.values()):
        here = np.isin(m.status, [s for s in uncoloured if kinds[s] == (hatch, label)])
        if hatch:
            ax.contourf(m.x, m.y, here, levels=[0.5, 1.5], colors="none", hatches=[hatch])
        handles.append(Patch(facecolor="white", edgecolor=INK, hatch=hatch, lw=0.6, label=label))
    return handles


@own_style()
def plot_fold_curve(curve: FoldCurve, ax: Any = None) -> Any:
    """Draw a curve of folds, with ticks on the side on which the orbits are lost.

    Args:
        curve: the answer of `tpd.fold_curve`.
        ax: axes to draw on, for example those of a map of the same parameters; by default those of a new
            figure.

    Returns:
        The axes.
    """
    if ax is None:
        ax = new_axes()
        ax.set(xlabel=LABELS[curve.x_name], ylabel=LABELS[curve.y_name])
    # Ticks are drawn to the left or to the right of the direction in which the points follow each other.
    (x, y), (east, north) = curve.tangents.T, curve.gradients.T
    side = 1.0 if np.sum(x * north - y * east) > 0.0 else -1.0
    ticks = TickedStroke(angle=90.0 * side, length=0.7, spacing=9.0, linewidth=0.8)
    ax.plot(*curve.points.T, color=INK, lw=1.6, path_effects=[*HALO, ticks, Normal()])
    if len(curve.points):
        middle = curve.points[len(curve.points) // 2]
        text = ax.annotate("fold", middle, fontsize=SMALL, ha="center")
        text.set_path_effects(HALO)
    return ax


@own_style()
def plot_overturning_spectrum(spectrum: OverturningSpectrum, axes: Any = None) -> Any:
    """Draw the outcome of every pulse, without and with the pendulum side by side.

    A cross is a pulse without a result.

    Args:
        spectrum: the answer of `tpd.overturning_spectrum`.
        axes: one or two axes to draw on; by default those of a new figure.

    Returns:
        The axes, an array of one or two.
    """
    cells = spectrum.cases
    if axes is None:
        axes = np.atleast_1d(new_axes(1, (4.2 * len(cells) + 0.8, 4.6), columns=len(cells)))
    # A worse outcome has a darker colour, also in a grey print.
    colours = ListedColormap(["#ffffff", "#d9e4f1", "#f0b97d", "#8a4b14"])
    norm = BoundaryNorm([STANDS - 0.5, STANDS + 0.5, ROCKS + 0.5, OVERTURNS + 0.5, 1e9], colours.N)
    image = None
    for ax, cell, case in zip(axes, cells, CASES, strict=False):
        # The cells count the impacts before overturning. The picture only distinguishes overturning without
        # an impact, the worst outcome, from overturning after impacts.
        shown = np.where(cell == OVERTURNS, OVERTURNS + 1, np.where(cell > OVERTURNS, OVERTURNS, cell))
        values = np.ma.masked_less(shown, STANDS)
        grid = spectrum.frequency_ratios, spectrum.acceleration_ratios
        image = ax.pcolormesh(*grid, values, cmap=colours, norm=norm, rasterized=True)
        size, ratio = np.nonzero(cell == UNDECIDED)
        if size.size:
            # A pulse without a result would be white, as if the block stood.
            at = spectrum.frequency_ratios[ratio], spectrum.acceleration_ratios[size]
            ax.plot(*at, ls="", marker="x", ms=5, color=INK, label=f"no result: {size.size} of {cell.size}")
            ax.legend(fontsize=SMALL, loc="upper left")
        ax.set(title=case["label"], xlabel=r"frequency of the pulse $\omega_p/p$ (-)")
    axes[0].set_ylabel(r"largest acceleration $a_p/(g\,\tan\alpha)$ (-)")
    ticks = [STANDS, ROCKS, OVERTURNS, 0.5 * (OVERTURNS + 0.5 + 1e9)]
    bar = axes[0].figure.colorbar(
        image, ax=list(axes), ticks=ticks, spacing="uniform", location="bottom", shrink=0.9, aspect=50
    )
    bar.ax.set_xticklabels(
        ["stands", "rocks", "overturns\nafter impacts", "overturns\nwithout impact"], fontsize=SMALL
    )
    return axes


@own_style()
def plot_rocking_spectrum(spectrum: RockingSpectrum, ax: Any = None) -> Any:
    """Draw the largest tilt over the slenderness against 2 pi/p.

    Blocks that overturn, and blocks without a result, are marked above the axes.

    Args:
        spectrum: the answer of `tpd.rocking_spectrum`.
        ax: axes to draw on; by default those of a new figure.

    Returns:
        The axes.
    """
    ax = new_axes() if ax is None else ax
    for tilts, style in zip(spectrum.cases, LINES, strict=False):
        ax.plot(spectrum.periods, np.where(np.isfinite(tilts), tilts, np.nan), **style)
        # Marks above the frame cannot be taken for tilts.
        level = 1.02 if style is LINES[0] else 1.06
        for where, marker, outcome in (
            (np.isinf(tilts), "|", "overturns"),
            (np.isnan(tilts), "x", "no result"),
        ):
            # A missing answer is rare. The legend has an entry for it only if there is one.
            if marker == "x" and not where.any():
                continue
            marks = {"ls": "", "marker": marker, "color": style["color"], "clip_on": False}
            place = {"transform": ax.get_xaxis_transform(), "label": f"{style['label']}: {outcome}"}
            ax.plot(spectrum.periods[where], np.full(where.sum(), level), **marks, **place)
    ax.set(
        xlabel=r"$2\pi/p$ of the block (s)", ylabel=r"largest tilt over the slenderness (-)", ylim=(0.0, None)
    )
    legend(ax, loc="best")
    return ax


@own_style()
def plot_fragility(fragility: Fragility, state: str = "overturned", ax: Any = None) -> Any:
    """Draw the fragility for one damage state: shares at the intensity levels, and fitted lognormal curves.

    The curves have 95 % confidence intervals. Fewer than five earthquakes get no curve. A bar at an intensity
    level is the range of shares that motions without a result could have.

    Args:
        fragility: the answer of `tpd.fragility`.
        state: name of the damage state.
        ax: axes to draw on; by default those of a new figure.

    Returns:
        The axes.

    Raises:
        ValueError: the fragility does not have this damage state.
    """
    checks.one_of("state", state, tuple(fragility.without_pendulum))
    ax = new_axes() if ax is None else ax
    # The curve continues a little beyond the intensity levels.
    fine = np.linspace(0.5 * fragility.stripes[0], 1.1 * fragility.stripes[-1], 300)
    # Through a few earthquakes a curve would rank the cases by chance, so only their shares are drawn.
    fine = fine if fragility.earthquakes >= LEAST_EARTHQUAKES else fine[:0]
    for case, style in zip(fragility.cases, CASES, strict=False):
        _curve(ax, fragility.stripes, case[state], fine, style)
    unit = "" if fragility.unit == "-" else f" ({fragility.unit})"
    ax.set(xlabel=f"{fragility.intensity}{unit}", ylabel=f"share of motions: {state} (-)", ylim=(0.0, 1.0))
    legend(ax)
    return ax


def _curve(ax: Any, stripes: np.ndarray, curve: Curve, fine: np.ndarray, style: dict[str, Any]) -> None:
    """Draw the shares of one case at the intensity levels, and the fitted curve with its interval."""
    # The total leaves out the motions without a result, which the bars need again.
    has_share, is_open, motions = curve.total > 0, curve.undecided > 0, curve.total + curve.undecided
    shares = (curve.counts / np.maximum(curve.total, 1))[has_share]
    # Marks are open without the pendulum and filled with it, so that a grey print shows the difference.
    marks = style | {"ls": "", "ms": 6.0, "mec": INK}
    ax.plot(stripes[has_share], shares, clip_on=False, zorder=3, **marks)
    if is_open.any():
        # A bar goes from the share if no motion without a result had reached the state, to the share if all
        # had.
        ends = (curve.counts / motions)[is_open], ((curve.counts + curve.undecided) / motions)[is_open]
        label = f"{style['label']}: {curve.undecided.sum()} runs without a result"
        ax.vlines(stripes[is_open], *ends, colors=style["color"], lw=5, alpha=0.35, label=label)
    # No curve can be fitted if all runs, or no runs, reach the state.
    fit = curve.fit
    if fine.size and 0.0 < fit.median < np.inf:
        ax.fill_between(fine, *fit.band(fine), color=style["color"], alpha=0.2, lw=0)
        label = f"{style['label']}: median {fit.median:.3g}"
        ax.plot(fine, fit.probability(fine), color=style["color"], ls=style["ls"], lw=1.6, label=label)


@own_style()
def plot_record(record: Record, axes: Any = None) -> Any:
    """Draw acceleration, velocity and displacement of a record against time, and its response spectrum.

    Each peak is marked. The time between 5 % and 95 % of the energy is shaded. The spectrum has 5 % damping.

    Args:
        record: the record.
        axes: four axes to draw on; by default those of a new figure.

    Returns:
        The four axes, an array.
    """
    if axes is None:
        figure = new_axes(size=(9.0, 5.6)).figure
        figure.clear()
        axes = figure.subplot_mosaic("as;vs;ds", width_ratios=[3, 2])
        axes = [axes[name] for name in "avds"]
    times, acceleration, velocity, displacement = base_motion(record)
    shown = (
        ("acceleration (g)", acceleration / STANDARD_GRAVITY, "PGA {:.3g} g"),
        ("velocity (m/s)", velocity, "PGV {:.3g} m/s"),
        ("displacement (m)", displacement, "PGD {:.3g} m"),
    )
    for ax, (label, values, peak) in zip(axes, shown, strict=False):
        at = int(np.argmax(np.abs(values)))
        ax.axvspan(*significant_times(record), color="0.9", lw=0.0)
        ax.plot(times, values, color=INK, lw=0.7)
        ax.plot(times[at], values[at], ls="", marker="o", ms=5, mfc="white", mec=INK)
        ax.set(ylabel=label, xlim=(0.0, times[-1]))
        ax.set_title(peak.format(abs(values[at])), fontsize=9, loc="right")
    axes[0].set_title(record.name or record.source, fontsize=9, loc="left", parse_math=False)
    axes[2].set_xlabel("time (s), shaded: 5 to 95 % of the energy")
    # Periods from stiff to tall structures.
    periods = np.geomspace(0.05, 5.0, 40)
    sizes = [spectral_acceleration(record, t) / STANDARD_GRAVITY for t in periods]
    axes[3].semilogx(periods, sizes, color=INK, lw=1.2)
    axes[3].set(xlabel="period (s)", ylabel="spectral acceleration, 5 % damping (g)", ylim=(0.0, None))
    axes[3].set_xticks([0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0], ["0.05", "0.1", "0.2", "0.5", "1", "2", "5"])
    axes[3].grid(color=GREY, lw=0.3)
    return axes
