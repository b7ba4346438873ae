"""Pictures of motions without and with the pendulum.

Motions are drawn against time. Settled motions from rest, shares of runs that overturn, and branches of
orbits are drawn against frequency or another quantity."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from tpd.answers.bifurcations import Bifurcation, Kind
from tpd.answers.motion_history import MotionHistory
from tpd.answers.response import Branches, Response
from tpd.design.as_built import TimeHistory, time_histories
from tpd.design.design import Design
from tpd.plots.style import (
    CASES,
    GREY,
    INK,
    LABELS,
    LINES,
    ORANGE,
    SMALL,
    in_degrees,
    legend,
    new_axes,
    own_style,
)
from tpd.scene.status import SETTLED, names_of

_UNSTABLE = (0, (4, 2))
"""Dashes of unstable branches."""
_OVERTURNED = ({"marker": "^", "ms": 5.5, "mfc": "white"}, {"marker": "x", "ms": 4.5})
"""Marks where the block overturns from rest, without and with the pendulum."""
_MARKERS = {
    Kind.fold: ("o", "fold"),
    Kind.symmetry_breaking: ("D", "symmetry breaks"),
    Kind.sticking: ("s", "begins to stick"),
    Kind.grazing: ("^", "grazes"),
    Kind.unresolved: ("x", "branch ends, cause unknown"),
}
"""Marker and label of each kind of bifurcation."""


@own_style()
def plot_response(responses: Sequence[Response], own: float | None = None, *, axes: Any = None) -> Any:
    """Draw the settled amplitude from rest, and below it the share of nearby runs that overturn.

    The share counts the runs from rest within 5 % of each value and has a 95 % interval. It is more reliable
    than the outcome of a single run, which depends on chance close to overturning.

    Args:
        responses: responses without and, if there is one, with the pendulum.
        own: value of the design, which is marked, in Hz or in the unit of the quantity that varies.
        axes: two axes to draw on, or one to leave the shares out; by default those of a new figure.

    Returns:
        The axes, an array of two, or of one if no response has shares.
    """
    shares = any(r.runs is not None for r in responses)
    if axes is None:
        axes = np.atleast_1d(new_axes(1 + shares, (7.0, 6.0 if shares else 4.4)))
    axes = np.atleast_1d(axes)
    settled_names = names_of(SETTLED)
    settled = np.concatenate([r.amplitude[np.isin(r.status, settled_names)] for r in responses])
    # Leave space above all amplitudes for the marks of overturning.
    top = 1.35 * float(settled.max(initial=0.0)) or 1.0
    for i, r in enumerate(responses):
        style, is_settled, overturns = CASES[i], np.isin(r.status, settled_names), r.status == "overturned"
        # Not clipped: the mark of a block at rest lies on the frame, which would cut it in half.
        axes[0].plot(r.frequency, np.where(is_settled, r.amplitude, np.nan), **style, clip_on=False)
        if overturns.any():
            marks = {"ls": "", "mec": style["mec"], "zorder": 4, **_OVERTURNED[i]}
            axes[0].plot(r.frequency[overturns], np.full(overturns.sum(), top * (1.0 - 0.05 * i)), **marks)
        # Aperiodic motions have an amplitude so far, but it may still change.
        other = ~is_settled & ~overturns
        if other.any():
            marks = {"ls": "", "marker": "DP"[i], "mfc": "none", "ms": 5, "color": style["color"]}
            marks["label"] = f"{style['label']}: not settled"
            axes[0].plot(r.frequency[other], np.minimum(r.amplitude[other], 0.85 * top), **marks)
        if r.runs is not None and len(axes) > 1:
            value, low, high = r.overturning
            axes[1].fill_between(r.frequency, low, high, color=CASES[i]["color"], alpha=0.2, lw=0)
            axes[1].plot(r.frequency, value, **CASES[i] | {"marker": "", "lw": 1.6})
    if any((r.status == "overturned").any() for r in responses):
        place: dict[str, Any] = {
            "fontsize": SMALL,
            "va": "bottom",
            "transform": axes[0].get_yaxis_transform(),
        }
        axes[0].text(0.01, 1.02 * top, "overturns from rest", **place)
    axes[0].set_ylabel(r"settled amplitude $\Phi$ from rest (rad)")
    axes[0].set_ylim(0.0, 1.1 * top)
    in_degrees(axes[0])
    if len(axes) > 1:
        axes[1].set(ylabel="share that overturns,\nruns within 5 % (-)", ylim=(0.0, 1.0))
    for ax in axes if own is not None else ():
        ax.axvline(own, color=ORANGE, lw=1.0, ls=(0, (1, 2)))
    if own is not None:
        place = {"fontsize": SMALL, "rotation": 90, "va": "center", "ha": "right"}
        axes[0].text(own, 0.5, "design ", transform=axes[0].get_xaxis_transform(), color=ORANGE, **place)
    axes[-1].set_xlabel(LABELS[responses[0].name if responses else "frequency"])
    legend(axes[0])
    return axes


@own_style()
def plot_branches(cases: Sequence[Branches], axes: Any = None) -> Any:
    """Draw the tilt and, with a pendulum, the bob angle of all branches of symmetric orbits.

    Stable branches are solid, unstable branches dashed. Marks show folds, symmetry breaking, sticking and
    grazing.

    Args:
        cases: one or two branches over the same quantity, without and with the pendulum.
        axes: one, or two axes if a case has a pendulum; by default those of a new figure.

    Returns:
        The axes, an array.
    """
    has_pendulum = any(b.has_pendulum for b in cases)
    size = 7.0, 6.6 if has_pendulum else 4.4
    axes = np.atleast_1d(new_axes(1 + has_pendulum, size) if axes is None else axes)
    # A single case, with or without a pendulum, has the colour of the pendulum.
    colours = [GREY, LINES[1]["color"]][-len(cases) :]
    styles = [{"color": c, "lw": 2.6 if c == GREY else 1.5} for c in colours]
    for case, style in zip(cases, styles, strict=True):
        for ax, quantity in zip(axes, ("amplitude", "swing"), strict=False):
            if quantity == "amplitude" or case.has_pendulum:
                _lines(ax, case, quantity, style)
                for b in case.bifurcations:
                    marker, _ = _MARKERS[b.kind]
                    size = b.amplitude if quantity == "amplitude" else _swing(case, b)
                    marks: dict[str, Any] = {"ms": 5.5, "mfc": "white", "mew": 1.3, "zorder": 5}
                    # The orbit is unknown there, so the mark is on the axis and not on the branch.
                    if b.kind is Kind.unresolved:
                        size, marks = 0.0, {"ms": 6, "transform": ax.get_xaxis_transform(), "clip_on": False}
                    ax.plot(b.value, size, marker, mec=style["color"], **marks)
        axes[0].plot([], [], label=CASES[case.has_pendulum]["label"], **style)
    axes[0].set(ylabel=r"largest tilt $|\varphi|$ (rad)")
    if has_pendulum:
        axes[1].set(ylabel=r"largest bob angle $|\psi|$ (rad)")
    for ax in axes:
        ax.set_ylim(bottom=0.0)
        in_degrees(ax)
        ax.margins(x=0.01)
    axes[-1].set(xlabel=LABELS[cases[0].name])
    for label, ls in (("stable", "-"), ("unstable", _UNSTABLE)):
        axes[0].plot([], [], color=INK, lw=1.2, ls=ls, label=label)
    # The legend explains only the marks that occur.
    kinds = {b.kind for case in cases for b in case.bifurcations}
    for kind, (marker, label) in _MARKERS.items():
        if kind in kinds:
            axes[0].plot([], [], marker, ms=5.5, mfc="white", mec=INK, mew=1.3, label=label)
    legend(axes[0], columns=4)
    return axes


def _lines(ax: Any, case: Branches, quantity: str, style: dict[str, Any]) -> None:
    """Draw one quantity of all branches, and of the block at rest."""
    s = case.sweep
    for branch in range(s.branches):
        at = s.line(branch)
        value, size, stable = s.value[at[0]], getattr(s, quantity)[at], s.status[at] == "rocking"
        # Parts of a branch with the same stability get one line each.
        edges = [0, *(np.nonzero(np.diff(stable))[0] + 1), len(stable)]
        for begin, end in pairwise(edges):
            # One more point, so that no gap remains between a stable part and an unstable one.
            part = slice(begin, end + 1)
            ax.plot(value[part], size[part], ls="-" if stable[begin] else _UNSTABLE, **style)
    # The block can stay at rest where the uplift margin is positive.
    size = np.zeros_like(s.value) if quantity == "amplitude" else case.rest_swing
    ax.plot(s.value, np.where(case.margin > 0.0, size, np.nan), **style)


def _swing(case: Branches, b: Bifurcation) -> float:
    """Return the bob angle (rad) at a bifurcation, which is that of the nearest orbit in the sweep."""
    s = case.sweep
    # Two values on each side of the bifurcation are near enough.
    at = np.searchsorted(s.value, b.value)
    rows = slice(max(at - 2, 0), at + 2)
    # Several branches can have orbits at these values. The one with the closest amplitude is the right one.
    apart = np.abs(s.amplitude[rows] - b.amplitude)
    if np.isnan(apart).all():
        return np.nan
    return float(s.swing[rows].ravel()[np.nanargmin(apart)])


@own_style()
def plot_motions(
    histories: Sequence[TimeHistory] | Sequence[MotionHistory],
    slenderness: float,
    *,
    stroke_limit: float = np.inf,
    axes: Any = None,
) -> Any:
    """Draw the tilt of the block and, with a pendulum, the angle of the rod against time.

    Histories of type `MotionHistory` also have the base acceleration above, and the coefficient of friction
    that prevents sliding below. The line of a block that overturns ends at a cross.

    Args:
        histories: motions without and, if there is one, with the pendulum.
        slenderness: slenderness of the block. This tilt, at which a block without a pendulum topples, is
            dotted if a tilt exceeds half of it.
        stroke_limit: largest settled angle of the rod, rad, which is drawn if it is finite.
        axes: axes for each quantity; by default those of a new figure.

    Returns:
        The axes, an array.
    """
    motions = [h for h in histories if isinstance(h, MotionHistory)]
    has_pendulum = any(h.swing is not None for h in histories)
    count = 1 + has_pendulum + 2 * bool(motions)
    if axes is None:
        axes = np.atleast_1d(new_axes(count, (7.4, 1.0 + 1.8 * count)))
    # The axes are, from top to bottom, acceleration, tilt, rod and friction, of which some may be missing.
    first = 1 if motions else 0
    tilts, last = axes[first], max(float(h.times[-1]) for h in histories)
    for h, style in zip(histories, LINES, strict=False):
        # The equations have no meaning after an overturning, so the line ends at twice the slenderness. The
        # running product is zero from the first larger tilt on.
        is_small = np.abs(h.tilt) < 2.0 * slenderness
        is_shown = np.cumprod(is_small).astype(bool) if h.overturned else np.isfinite(h.tilt)
        tilts.plot(h.times, np.where(is_shown, h.tilt, np.nan), **style)
        if h.overturned and is_shown.any():
            at = h.times[is_shown][-1], h.tilt[is_shown][-1]
            tilts.plot(*at, "X", color=style["color"], mec=INK, ms=8)
            # Near the right end the word would lie on the axis of degrees.
            side, place = (-8, "right") if at[0] > 0.8 * last else (6, "left")
            tilts.annotate("overturns", at, (side, -4), textcoords="offset points", fontsize=SMALL, ha=place)
        if h.swing is not None:
            axes[first + 1].plot(h.times, np.where(is_shown, h.swing, np.nan), **style | {"label": None})
    largest = max(float(np.nanmax(np.abs(line.get_ydata()), initial=0.0)) for line in tilts.lines)
    if largest > 0.5 * slenderness:
        for side in (-1.0, 1.0):
            tilts.axhline(side * slenderness, color=ORANGE, lw=1.0, ls=":")
        tilts.annotate(r"$\nu$", (1.0, slenderness), (3, -3), ("axes fraction", "data"), "offset points")
    tilts.set_ylabel(r"tilt $\varphi$ (rad)")
    if has_pendulum:
        axes[first + 1].set_ylabel("rod from the\nvertical $\\psi$ (rad)")
        if np.isfinite(stroke_limit):
            for side, label in ((-1.0, None), (1.0, "stroke limit, settled motion")):
                axes[first + 1].axhline(side * stroke_limit, color=ORANGE, lw=1.2, ls=":", label=label)
            legend(axes[first + 1])
    if motions:
        axes[0].plot(motions[0].times, motions[0].base, color=INK, lw=0.7)
        axes[0].set_ylabel("base acceleration\n(m/s²)")
        for history, style in zip(motions, LINES, strict=False):
            # The ratio becomes infinite when the vertical force vanishes, so the picture ends at 5.
            ratio = np.abs(history.horizontal) / np.maximum(history.vertical, 1e-300)
            axes[-1].plot(history.times, np.minimum(ratio, 5.0), **style)
        axes[-1].set(ylabel="friction needed\n|H|/V (-)", ylim=(0.0, None))
    for ax in axes[first : first + 1 + has_pendulum]:
        ax.axhline(0.0, color=INK, lw=0.4)
        in_degrees(ax)
    # Lines that end at an overturning must not shorten the time axis.
    axes[-1].set(xlabel="time (s)" if motions else "time after a start from rest (s)", xlim=(0.0, last))
    legend(tilts if motions else axes[0], **({"loc": "upper right", "ncols": 2} if motions else {}))
    return axes


def plot_start(design: Design, axes: Any = None) -> Any:
    """Draw the first periods from rest of a design, without and with its pendulum; see `plot_motions`."""
    histories = time_histories(design.scene, design.pendulum)
    nu, limit = float(design.scene.block.slenderness), design.stroke_limit
    return plot_motions(histories, nu, stroke_limit=limit, axes=axes)
