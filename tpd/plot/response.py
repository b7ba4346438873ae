"""Pictures over frequency or another quantity: motions settled into from rest, with the share of runs that
overturn, and all branches of orbits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from tpd.analysis.bifurcations import Bifurcation, Kind
from tpd.analysis.response import Branches, Response
from tpd.core.status import SETTLED
from tpd.plot.style import CASES, GREY, INK, LABELS, LINES, ORANGE, in_degrees, legend, new_axes

_UNSTABLE = (0, (4, 2))
_LOST: tuple[dict[str, Any], ...] = (
    {"marker": "^", "ls": "", "ms": 5.5, "mfc": "white"},
    {"marker": "x", "ls": "", "ms": 4.5},
)
"""Marks where a motion from rest overturns, without a pendulum and with it."""
_MARKERS = {
    Kind.fold: ("o", "fold"),
    Kind.symmetry_breaking: ("D", "symmetry breaks"),
    Kind.sticking: ("s", "begins to stick"),
    Kind.grazing: ("^", "grazes"),
    Kind.unresolved: ("x", "lost, cause not found"),
}


def plot_response(
    responses: Sequence[Response],
    own: float | None = None,
    *,
    toppling: Sequence[float] | None = None,
    axes: Any = None,
) -> Any:
    """Draw the settled amplitude from rest, and below it the share of the runs from rest near each value that
    overturn, with its 95 % interval: next to overturning a single run is chance, a share is not.

    Args:
        responses: of the bare block and, if there is one, with the pendulum.
        own: value of the design, marked; Hz, or of what the responses vary.
        toppling: tilts (rad) at which the block topples by itself, one for each response: there an
            overturning is marked. By default the marks are near the top.
        axes: two, or one to leave the shares out; default those of a new figure.

    Returns:
        The axes, an array; one alone where no response has shares.
    """
    shares = any(r.overturning is not None for r in responses)
    if axes is None:
        axes = np.atleast_1d(new_axes(1 + shares, (7.0, 6.0 if shares else 4.4)))
    axes = np.atleast_1d(axes)
    top = _top(responses, toppling)
    for i, r in enumerate(responses):
        _amplitudes(axes[0], r, i, top, None if toppling is None else toppling[i])
        if r.overturning is not None and len(axes) > 1:
            value, low, high = r.overturning
            axes[1].fill_between(r.frequency, low, high, color=CASES[i]["color"], alpha=0.2, lw=0)
            axes[1].plot(r.frequency, value, **CASES[i] | {"marker": "", "lw": 1.6})
    axes[0].set_ylabel(r"settled amplitude $\Phi$ from rest (rad)")
    axes[0].set_ylim(0.0, 1.06 * top)
    in_degrees(axes[0])
    if len(axes) > 1:
        axes[1].set(ylabel="share that overturns (-)", ylim=(0.0, 1.0))
    for ax in axes if own is not None else ():
        ax.axvline(own, color=ORANGE, lw=1.0, ls=(0, (1, 2)))
    if own is not None:
        place: dict[str, Any] = {"fontsize": 8, "rotation": 90, "va": "center", "ha": "right"}
        axes[0].text(own, 0.5, "design ", transform=axes[0].get_xaxis_transform(), color=ORANGE, **place)
    axes[-1].set_xlabel(LABELS[responses[0].name if responses else "frequency"])
    legend(axes[0])
    return axes


def _amplitudes(ax: Any, r: Response, case: int, top: float, level: float | None) -> None:
    """Settled amplitudes, and marks where the block overturns or does not settle."""
    style, known, lost = CASES[case], np.isin(r.status, SETTLED), r.status == "overturned"
    # The axis begins at zero, and a block at rest has its mark there: it must not be cut in half.
    ax.plot(r.frequency, np.where(known, r.amplitude, np.nan), **style, clip_on=False)
    if lost.any():
        height = top * (1.0 - 0.05 * case) if level is None else level
        ax.plot(r.frequency[lost], np.full(lost.sum(), height), mec=style["mec"], zorder=4, **_LOST[case])
        words = "overturns from rest " if case == 0 else ""
        ax.text(0.01, height - 0.02 * top, words, fontsize=8, va="top", transform=ax.get_yaxis_transform())
    other = ~known & ~lost
    if other.any():
        marks = {"ls": "", "marker": "DP"[case], "mfc": "none", "ms": 5, "color": style["color"]}
        label = f"{style['label']}: not settled"
        ax.plot(r.frequency[other], np.minimum(r.amplitude[other], 0.85 * top), label=label, **marks)


def _top(responses: Sequence[Response], toppling: Sequence[float] | None) -> float:
    """Largest tilt (rad) that the axis has room for."""
    sizes = [r.amplitude[np.isin(r.status, SETTLED)] for r in responses]
    largest = max([float(x.max()) for x in sizes if x.size], default=1.0)
    # Toppling tilts bound all that is drawn; without them the marks of overturning need room above.
    return max(largest, *toppling) if toppling else 1.35 * largest or 1.0


def plot_branches(
    cases: Mapping[str, Branches], *, settled: Mapping[str, Response] | None = None, axes: Any = None
) -> Any:
    """Draw amplitude, and with a pendulum stroke, of all branches: stable solid, unstable dashed, with marks
    where they fold, lose their symmetry, stick or graze.

    Args:
        cases: one or two by their labels, over the same name: the bare block and with a pendulum.
        settled: motions from rest over frequency, by the same labels; drawn as small dots, and above all
            branches as triangles and crosses where the block overturns or does not settle.
        axes: one, or two if a case has a pendulum; default those of a new figure.

    Returns:
        The axes, an array.
    """
    hung = any(b.hung for b in cases.values())
    axes = np.atleast_1d(new_axes(1 + hung, (7.0, 6.6 if hung else 4.4)) if axes is None else axes)
    colours = [GREY, LINES[1]["color"]][-len(cases) :]
    styles = [{"color": c, "lw": 2.6 if c == GREY else 1.5} for c in colours]
    for (label, case), style in zip(cases.items(), styles, strict=True):
        response = None if settled is None else settled.get(label)
        for ax, quantity in zip(axes, ("amplitude", "stroke"), strict=False):
            if quantity == "amplitude" or case.hung:
                _lines(ax, case, quantity, style)
                _marks(ax, case, quantity, style["color"])
                if response is not None:
                    _dots(ax, response, quantity, case.hung)
        axes[0].plot([], [], label=label, **style)
    axes[0].set(ylabel=r"largest tilt $|\varphi|$ (rad)")
    if hung:
        axes[1].set(ylabel=r"largest bob angle $|\psi|$ (rad)")
    for ax in axes:
        # Room for what does not settle, above all branches.
        ax.set_ylim(0.0, ax.get_ylim()[1] * (1.0 if settled is None else 1.12))
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
    size = np.zeros_like(s.value) if quantity == "amplitude" else case.rest_stroke
    ax.plot(s.value, np.where(case.margin > 0.0, size, np.nan), **style)


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


def _dots(ax: Any, response: Response, quantity: str, hung: bool) -> None:
    """Mark motions from rest; near the top where the block overturns or does not settle."""
    known = np.isin(response.status, SETTLED)
    marks: dict[str, Any] = {"ls": "", "marker": "os"[not hung], "ms": 3.0, "mec": INK, "zorder": 4}
    filled = CASES[hung]["mfc"]
    ax.plot(response.frequency[known], getattr(response, quantity)[known], mfc=filled, clip_on=False, **marks)
    lost = response.frequency[~known]
    level = np.full(len(lost), 0.98 - 0.04 * hung)
    ax.plot(lost, level, mec=CASES[hung]["mec"], transform=ax.get_xaxis_transform(), **_LOST[hung])
