"""Picture of all branches of orbits over frequency or another quantity."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from tpd.analysis.bifurcations import Bifurcation, Kind
from tpd.analysis.response import Branches, Response
from tpd.core.status import SETTLED
from tpd.plot.style import BLUE, GREY, INK, LABELS, in_degrees, new_axes

_STYLES: tuple[dict[str, Any], ...] = ({"color": GREY, "lw": 2.6}, {"color": BLUE, "lw": 1.5})
# Open and filled marks of one shape look alike where they are small or lie over each other.
_FROM_REST: tuple[dict[str, Any], ...] = (
    {"marker": "p", "ls": "", "ms": 4.5, "mfc": "white"},
    {"marker": "*", "ls": "", "ms": 5.5, "mfc": INK},
)
"""Marks of motions from rest, without a pendulum and with it."""
_LOST: tuple[dict[str, Any], ...] = (
    {"marker": "+", "ls": "", "ms": 5.0},
    {"marker": "x", "ls": "", "ms": 4.5},
)
"""Marks where a motion from rest does not settle, without a pendulum and with it."""
_MARKERS = {
    Kind.fold: ("o", "fold"),
    Kind.symmetry_breaking: ("D", "symmetry breaks"),
    Kind.sticking: ("s", "begins to stick"),
    Kind.grazing: ("^", "grazes"),
    Kind.unresolved: ("x", "lost, cause not found"),
}


def plot_branches(
    cases: Mapping[str, Branches], *, settled: Mapping[str, Response] | None = None, axes: Any = None
) -> Any:
    """Draw amplitude, and with a pendulum stroke, of all branches: stable solid, unstable dashed, with marks
    where they fold, lose their symmetry, stick or graze.

    Args:
        cases: one or two by their labels, over the same name: the bare block and with a pendulum.
        settled: motions from rest over frequency, by the same labels; drawn as marks.
        axes: one, or two if a case has a pendulum; default those of a new figure.

    Returns:
        The axes, an array.
    """
    hung = any(b.hung for b in cases.values())
    axes = np.atleast_1d(new_axes(1 + hung, (7.0, 6.6 if hung else 4.4)) if axes is None else axes)
    styles = _STYLES[-len(cases) :]
    for (label, case), style in zip(cases.items(), styles, strict=False):
        responses = None if settled is None else settled.get(label)
        for ax, quantity in zip(axes, ("amplitude", "stroke"), strict=False):
            if quantity == "amplitude" or case.hung:
                _lines(ax, case, quantity, style)
                _marks(ax, case, quantity, style["color"])
                _dots(ax, responses, quantity, style["color"], case.hung)
    axes[0].set(ylabel=r"largest tilt $|\varphi|$ (rad)")
    if hung:
        axes[1].set(ylabel=r"largest bob angle $|\psi|$ (rad)")
    for ax in axes:
        # Room for what does not settle, above all branches.
        ax.set_ylim(0.0, ax.get_ylim()[1] * (1.0 if settled is None else 1.12))
        in_degrees(ax)
        ax.margins(x=0.01)
    first = next(iter(cases.values()))
    axes[-1].set(xlabel=LABELS[first.name])
    _legend(axes[0], cases, settled)
    return axes


def _lines(ax: Any, case: Branches, quantity: str, style: dict[str, Any]) -> None:
    s = case.sweep
    for branch in range(s.branches):
        at = s.line(branch)
        value, size, stable = s.value[at[0]], getattr(s, quantity)[at], s.status[at] == "rocking"
        for run in _runs(stable):
            # One point further, so that the next run begins where this one ends.
            part = slice(run.start, run.stop + 1)
            ax.plot(value[part], size[part], ls="-" if stable[run.start] else (0, (4, 2)), **style)
    size = np.zeros_like(s.value) if quantity == "amplitude" else case.rest_stroke
    ax.plot(s.value, np.where(case.margin > 0.0, size, np.nan), **style)


def _runs(flags: np.ndarray) -> list[slice]:
    """Slices within which all flags are equal."""
    edges = [0, *(np.nonzero(np.diff(flags))[0] + 1), len(flags)]
    return [slice(a, b) for a, b in pairwise(edges)]


def _marks(ax: Any, case: Branches, quantity: str, color: str) -> None:
    for b in case.bifurcations:
        marker, _ = _MARKERS[b.kind]
        size = b.amplitude if quantity == "amplitude" else _stroke(case, b)
        if b.kind is Kind.unresolved:
            ax.plot(b.value, 0.0, marker, ms=6, mec=color, transform=ax.get_xaxis_transform(), clip_on=False)
        else:
            ax.plot(b.value, size, marker, ms=5.5, mfc="white", mec=color, mew=1.3, zorder=5)


def _stroke(case: Branches, b: Bifurcation) -> float:
    """Stroke (rad) of the orbit at a bifurcation, from the orbit next to it in the sweep."""
    s = case.sweep
    at = np.searchsorted(s.value, b.value)
    rows = slice(max(at - 2, 0), at + 2)
    apart = np.abs(s.amplitude[rows] - b.amplitude)
    if np.isnan(apart).all():
        return np.nan
    return float(s.stroke[rows].ravel()[np.nanargmin(apart)])


def _dots(ax: Any, response: Response | None, quantity: str, color: str, hung: bool) -> None:
    """Mark motions from rest, filled with a pendulum and open without; near the top where the block
    overturns or does not settle."""
    if response is None:
        return
    known = np.isin(response.status, SETTLED)
    size = getattr(response, quantity)
    ax.plot(response.frequency[known], size[known], mec=INK, zorder=4, clip_on=False, **_FROM_REST[hung])
    lost = response.frequency[~known]
    level = np.full(len(lost), 0.98 - 0.04 * hung)
    ax.plot(lost, level, mec=color, transform=ax.get_xaxis_transform(), **_LOST[hung])


def _legend(ax: Any, cases: Mapping[str, Branches], settled: Any) -> None:
    for label, style in zip(cases, _STYLES[-len(cases) :], strict=False):
        ax.plot([], [], label=label, **style)
    ax.plot([], [], color=INK, lw=1.2, label="stable")
    ax.plot([], [], color=INK, lw=1.2, ls=(0, (4, 2)), label="unstable")
    kinds = {b.kind for case in cases.values() for b in case.bifurcations}
    for kind, (marker, label) in _MARKERS.items():
        if kind in kinds:
            ax.plot([], [], marker, ms=5.5, mfc="white", mec=INK, mew=1.3, label=label)
    for label, response in (settled or {}).items():
        hung = cases[label].hung
        ax.plot([], [], mec=INK, label=f"from rest, {label}", **_FROM_REST[hung])
        if not np.isin(response.status, SETTLED).all():
            ax.plot([], [], mec=INK, label=f"overturns or does not settle, {label}", **_LOST[hung])
    ax.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=4 if settled is None else 2,
        fontsize=8,
        frameon=False,
    )
