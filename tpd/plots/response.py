"""Pictures of motions, without a pendulum and with it: over time; over frequency or another quantity those
settled into from rest, with the share of runs that overturn, and all branches of orbits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from tpd.answers.bifurcations import Bifurcation, Kind
from tpd.answers.motion_history import MotionHistory
from tpd.answers.response import Branches, Response
from tpd.design.as_built import TimeHistory, time_histories
from tpd.design.design import Design
from tpd.plots.style import CASES, GREY, INK, LABELS, LINES, ORANGE, in_degrees, legend, new_axes, own_style
from tpd.scene.status import SETTLED, names_of

_UNSTABLE = (0, (4, 2))
_LOST = ({"marker": "^", "ms": 5.5, "mfc": "white"}, {"marker": "x", "ms": 4.5})
"""Marks where a motion from rest overturns, without a pendulum and with it."""
_MARKERS = {
    Kind.fold: ("o", "fold"),
    Kind.symmetry_breaking: ("D", "symmetry breaks"),
    Kind.sticking: ("s", "begins to stick"),
    Kind.grazing: ("^", "grazes"),
    Kind.unresolved: ("x", "lost, cause not found"),
}


@own_style()
def plot_response(responses: Sequence[Response], own: float | None = None, *, axes: Any = None) -> Any:
    """Draw the settled amplitude from rest, and below it the share of the runs from rest within 5 % of each
    value that overturn, with its 95 % interval: next to overturning a single run is chance, a share is not.

    Args:
        responses: of the bare block and, if there is one, with the pendulum.
        own: value of the design, marked; Hz, or of what the responses vary.
        axes: two, or one to leave the shares out; default those of a new figure.

    Returns:
        The axes, an array; one alone where no response has shares.
    """
    shares = any(r.runs is not None for r in responses)
    if axes is None:
        axes = np.atleast_1d(new_axes(1 + shares, (7.0, 6.0 if shares else 4.4)))
    axes = np.atleast_1d(axes)
    known_names = names_of(SETTLED)
    settled = np.concatenate([r.amplitude[np.isin(r.status, known_names)] for r in responses])
    # Marks of overturning stand above all amplitudes.
    top = 1.35 * float(settled.max(initial=0.0)) or 1.0
    for i, r in enumerate(responses):
        style, known, lost = CASES[i], np.isin(r.status, known_names), r.status == "overturned"
        # The axis begins at zero, and a block at rest has its mark there: it must not be cut in half.
        axes[0].plot(r.frequency, np.where(known, r.amplitude, np.nan), **style, clip_on=False)
        if lost.any():
            marks = {"ls": "", "mec": style["mec"], "zorder": 4, **_LOST[i]}
            axes[0].plot(r.frequency[lost], np.full(lost.sum(), top * (1.0 - 0.05 * i)), **marks)
        other = ~known & ~lost
        if other.any():
            marks = {"ls": "", "marker": "DP"[i], "mfc": "none", "ms": 5, "color": style["color"]}
            marks["label"] = f"{style['label']}: not settled"
            axes[0].plot(r.frequency[other], np.minimum(r.amplitude[other], 0.85 * top), **marks)
        if r.runs is not None and len(axes) > 1:
            value, low, high = r.overturning
            axes[1].fill_between(r.frequency, low, high, color=CASES[i]["color"], alpha=0.2, lw=0)
            axes[1].plot(r.frequency, value, **CASES[i] | {"marker": "", "lw": 1.6})
    if any((r.status == "overturned").any() for r in responses):
        words: dict[str, Any] = {"fontsize": 8, "va": "bottom", "transform": axes[0].get_yaxis_transform()}
        axes[0].text(0.01, 1.02 * top, "overturns from rest", **words)
    axes[0].set_ylabel(r"settled amplitude $\Phi$ from rest (rad)")
    axes[0].set_ylim(0.0, 1.1 * top)
    in_degrees(axes[0])
    if len(axes) > 1:
        axes[1].set(ylabel="share that overturns\nwithin 5 % of the value (-)", ylim=(0.0, 1.0))
    for ax in axes if own is not None else ():
        ax.axvline(own, color=ORANGE, lw=1.0, ls=(0, (1, 2)))
    if own is not None:
        place: dict[str, Any] = {"fontsize": 8, "rotation": 90, "va": "center", "ha": "right"}
        axes[0].text(own, 0.5, "design ", transform=axes[0].get_xaxis_transform(), color=ORANGE, **place)
    axes[-1].set_xlabel(LABELS[responses[0].name if responses else "frequency"])
    legend(axes[0])
    return axes


@own_style()
def plot_branches(cases: Mapping[str, Branches], axes: Any = None) -> Any:
    """Draw amplitude, and with a pendulum stroke, of all branches: stable solid, unstable dashed, with marks
    where they fold, lose their symmetry, stick or graze.

    Args:
        cases: one or two by their labels, over the same name: the bare block and with a pendulum.
        axes: one, or two if a case has a pendulum; default those of a new figure.

    Returns:
        The axes, an array.
    """
    with_it = any(b.has_pendulum for b in cases.values())
    axes = np.atleast_1d(new_axes(1 + with_it, (7.0, 6.6 if with_it else 4.4)) if axes is None else axes)
    colours = [GREY, LINES[1]["color"]][-len(cases) :]
    styles = [{"color": c, "lw": 2.6 if c == GREY else 1.5} for c in colours]
    for (label, case), style in zip(cases.items(), styles, strict=True):
        for ax, quantity in zip(axes, ("amplitude", "swing"), strict=False):
            if quantity == "amplitude" or case.has_pendulum:
                _lines(ax, case, quantity, style)
                for b in case.bifurcations:
                    marker, _ = _MARKERS[b.kind]
                    size = b.amplitude if quantity == "amplitude" else _stroke(case, b)
                    marks: dict[str, Any] = {"ms": 5.5, "mfc": "white", "mew": 1.3, "zorder": 5}
                    if b.kind is Kind.unresolved:
                        size, marks = 0.0, {"ms": 6, "transform": ax.get_xaxis_transform(), "clip_on": False}
                    ax.plot(b.value, size, marker, mec=style["color"], **marks)
        axes[0].plot([], [], label=label, **style)
    axes[0].set(ylabel=r"largest tilt $|\varphi|$ (rad)")
    if with_it:
        axes[1].set(ylabel=r"largest bob angle $|\psi|$ (rad)")
    for ax in axes:
        ax.set_ylim(bottom=0.0)
        in_degrees(ax)
        ax.margins(x=0.01)
    axes[-1].set(xlabel=LABELS[next(iter(cases.values())).name])
    for label, ls in (("stable", "-"), ("unstable", _UNSTABLE)):
        axes[0].plot([], [], color=INK, lw=1.2, ls=ls, label=label)
    kinds = {b.kind for case in cases.values() for b in case.bifurcations}
    for kind, (marker, label) in _MARKERS.items():
        if kind in kinds:
            axes[0].plot([], [], marker, ms=5.5, mfc="white", mec=INK, mew=1.3, label=label)
    legend(axes[0], columns=4)
    return axes


def _lines(ax: Any, case: Branches, quantity: str, style: dict[str, Any]) -> None:
    s = case.sweep
    for branch in range(s.branches):
        at = s.line(branch)
        value, size, stable = s.value[at[0]], getattr(s, quantity)[at], s.status[at] == "rocking"
        edges = [0, *(np.nonzero(np.diff(stable))[0] + 1), len(stable)]
        for begin, end in pairwise(edges):
            # One point further, so that the next run begins where this one ends.
            part = slice(begin, end + 1)
            ax.plot(value[part], size[part], ls="-" if stable[begin] else _UNSTABLE, **style)
    size = np.zeros_like(s.value) if quantity == "amplitude" else case.rest_swing
    ax.plot(s.value, np.where(case.margin > 0.0, size, np.nan), **style)


def _stroke(case: Branches, b: Bifurcation) -> float:
    """Stroke (rad) of the orbit at a bifurcation, from the orbit next to it in the sweep."""
    s = case.sweep
    at = np.searchsorted(s.value, b.value)
    rows = slice(max(at - 2, 0), at + 2)
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
    """Draw the tilts, with a pendulum the rod's angle, and of a ground motion the base's acceleration above
    them and the friction needed below. A cross marks where the block overturns: its line ends there.

    Args:
        histories: of the bare block and, if there is one, with the pendulum.
        slenderness: of the block; a tilt of this size, the balance of the bare block, is dotted where a
            motion comes near it.
        stroke_limit: largest settled angle of the rod, rad, drawn if finite.
        axes: one for each quantity; default those of a new figure.

    Returns:
        The axes, an array.
    """
    shaken = [h for h in histories if isinstance(h, MotionHistory)]
    rows = [
        (h.times, h.tilt, h.swing, h.overturned)
        if isinstance(h, MotionHistory)
        else (h.time, h.tilt, h.bob if h.with_pendulum else None, h.overturned)
        for h in histories
    ]
    with_it = any(swing is not None for _, _, swing, _ in rows)
    count = 1 + with_it + 2 * bool(shaken)
    if axes is None:
        axes = np.atleast_1d(new_axes(count, (7.4, 1.0 + 1.8 * count)))
    first = 1 if shaken else 0
    tilts, last = axes[first], max(float(time[-1]) for time, *_ in rows)
    for (time, tilt, swing, falls), style in zip(rows, LINES, strict=False):
        # After the block has overturned the equations mean nothing.
        upright = np.cumprod(np.abs(tilt) < 2.0 * slenderness).astype(bool) if falls else np.isfinite(tilt)
        tilts.plot(time, np.where(upright, tilt, np.nan), **style)
        if falls and upright.any():
            at = time[upright][-1], tilt[upright][-1]
            tilts.plot(*at, "X", color=style["color"], mec=INK, ms=8)
            tilts.annotate("overturns", at, (6, -4), textcoords="offset points", fontsize=8)
        if swing is not None:
            axes[first + 1].plot(time, np.where(upright, swing, np.nan), **style | {"label": None})
    largest = max(float(np.nanmax(np.abs(line.get_ydata()), initial=0.0)) for line in tilts.lines)
    if largest > 0.5 * slenderness:
        for side in (-1.0, 1.0):
            tilts.axhline(side * slenderness, color=ORANGE, lw=1.0, ls=":")
        tilts.annotate(r"$\nu$", (1.0, slenderness), (3, -3), ("axes fraction", "data"), "offset points")
    tilts.set_ylabel(r"tilt $\varphi$ (rad)")
    if with_it:
        axes[first + 1].set_ylabel("rod from the\nvertical $\\psi$ (rad)")
        if np.isfinite(stroke_limit):
            for side, label in ((-1.0, None), (1.0, "limit on the settled stroke")):
                axes[first + 1].axhline(side * stroke_limit, color=ORANGE, lw=1.2, ls=":", label=label)
            legend(axes[first + 1])
    if shaken:
        axes[0].plot(shaken[0].times, shaken[0].base, color=INK, lw=0.7)
        axes[0].set_ylabel("base acceleration\n(m/s²)")
        for history, style in zip(shaken, LINES, strict=False):
            # Where the block all but leaves the ground, no friction is enough: the picture stops at 5.
            ratio = np.abs(history.horizontal) / np.maximum(history.vertical, 1e-300)
            axes[-1].plot(history.times, np.minimum(ratio, 5.0), **style)
        axes[-1].set(ylabel="friction needed\n|H|/V (-)", ylim=(0.0, None))
    for ax in axes[first : first + 1 + with_it]:
        ax.axhline(0.0, color=INK, lw=0.4)
        in_degrees(ax)
    # Autoscaling would take the end of a line that overturns for the end of time.
    axes[-1].set(xlabel="time (s)" if shaken else "time from a start at rest (s)", xlim=(0.0, last))
    legend(axes[0] if not shaken else tilts, **({"loc": "upper right", "ncols": 2} if shaken else {}))
    return axes


def plot_start(design: Design, axes: Any = None) -> Any:
    """Draw the first periods from rest of a design, see `plot_motions`."""
    histories = time_histories(design.scene, design.pendulum)
    nu, limit = float(design.scene.block.slenderness), design.stroke_limit
    return plot_motions(histories, nu, stroke_limit=limit, axes=axes)
