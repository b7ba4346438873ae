"""Pictures that compare a block with and without its pendulum, with intervals: benefit, conditions and
front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes

from tpd.answers.paired import PairedRuns
from tpd.design.design import Design, FrontPoint
from tpd.design.harmonic import ExactMotions
from tpd.plots.style import (
    BLUE,
    CASES,
    GREY,
    INK,
    LABELS,
    NOT_RECOMMENDED,
    ORANGE,
    in_degrees,
    legend,
    new_axes,
    own_style,
)

_MOST = 24
"""Most groups of runs that have a row of their own, evenly over all of them."""
_SHOWN = {
    "mean severity": "tilt, mean",
    "worst severity": "tilt, worst tenth",
    "overturned": "overturned",
    "at rest": "at rest at the end",
}
"""Changes over all runs, with their labels."""
_QUANTITIES = {"length": "pendulum_length", "mass": "pendulum_mass", "damping": "pendulum_damping"}
"""Names of the pendulum's quantities, whose conditions have shorter ones."""


@own_style()
def plot_benefit(design: Design, ax: Any = None) -> Any:
    """Draw mean tilts over nu, and shares that overturn and that end at rest, of the validation runs of the
    best design: of all counted runs above the line; below it the mean tilts under every condition or, under
    ground motions, of every group, and for every kind of start. A bar is the 95 % interval of the
    difference. Under ground motions there is a row of rest only if a run ends at rest.

    Raises:
        ValueError: a design without validation runs.
    """
    if design.runs is None:
        raise ValueError("`design` must have validation runs, but has none")
    rows, above = _rows(design, design.runs)
    heights, values = np.arange(len(rows)), np.array([row[1:] for row in rows])
    without_it, with_it, low, high = values.T
    ax = new_axes(1, (7.4, 1.2 + 0.24 * len(rows))) if ax is None else ax
    ax.hlines(heights, without_it, with_it, color=GREY, lw=1.0, zorder=1)
    ax.hlines(
        heights,
        np.clip(without_it + low, 0, 1),
        np.clip(without_it + high, 0, 1),
        color=BLUE,
        lw=5,
        alpha=0.35,
    )
    # Marks stand over the lines, and at 0 and 1 over the frame: a half mark reads as another one.
    for case, x, size in zip(CASES, (without_it, with_it), (8.0, 5.0), strict=True):
        ax.plot(x, heights, clip_on=False, zorder=3, **case | {"ls": "", "ms": size})
    ax.set_yticks(heights, [row[0] for row in rows], fontsize=8)
    ax.set(xlim=(0.0, 1.0), xlabel="share of the runs; tilt as a share of the slenderness (-)")
    ax.invert_yaxis()
    ax.grid(axis="x", color=GREY, lw=0.4, alpha=0.6)
    ax.axhline(above - 0.5, color=INK, lw=0.6)
    legend(ax)
    return ax


def _rows(design: Design, runs: PairedRuns) -> tuple[list[tuple[str, float, float, float, float]], int]:
    """Label, value without and with the pendulum, and interval of their difference, NaN where it is not
    known; and how many of the rows are of all runs."""
    rows = []
    for name, label in _SHOWN.items():
        _, with_pendulum, without, low, high = runs.change(name)
        # Under ground motions the runs end with the record, so that no rest does not mean rocking.
        if name != "at rest" or runs.cluster is None or (with_pendulum, without) != (0.0, 0.0):
            rows.append((label, without, with_pendulum, low, high))
    above = len(rows)
    known = np.array([np.isfinite(part.with_pendulum) for part in runs.parts])
    starts = np.flatnonzero(known[len(runs.labels) :]) + len(runs.labels)
    shown = np.flatnonzero(known[: len(runs.labels)])
    if runs.cluster is None:
        # Neighbouring frequencies stand together, the smaller amplitude first.
        columns = [design.conditions.column(name)[shown] for name in ("amplitude", "frequency")]
        shown = shown[np.lexsort(columns)]
    chosen = shown[np.unique(np.linspace(0, len(shown) - 1, min(len(shown), _MOST)).astype(int))]
    # The only condition is all runs.
    parts = [runs.parts[i] for i in (*(chosen if len(runs.labels) > 1 else ()), *starts)]
    by_part = [(f"tilt, {p.label}", p.without_pendulum, p.with_pendulum, np.nan, np.nan) for p in parts]
    return rows + by_part, above


@own_style()
def plot_conditions(design: Design, axes: Any = None) -> Any:
    """Draw the steady tilt with the pendulum and without over what the conditions differ in, and below it the
    bob's angle; triangles and crosses are conditions under which the block overturns from rest.

    Returns:
        Both axes, an array.

    Raises:
        ValueError: conditions that differ in no quantity, or in several.
    """
    name = design.conditions.axis
    if name is None:
        raise ValueError("`design` must have conditions that differ in one quantity")
    best = None if design.best is None else design.best.exact
    axes = new_axes(2, (7.0, 5.6)) if axes is None else axes
    # Values that scatter come in no order.
    order = np.argsort(design.conditions.column(name), kind="stable")
    x, xlabel = _values(design, name)
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")
    cases = [design.problem.without_pendulum, *([] if best is None else [best])]
    tilts = [_known(motions, "tilt") * nu for motions in cases]
    # The marks of overturning stand above all finite tilts, so the axis needs room there.
    top = 1.3 * float(np.nanmax(tilts, initial=0.0)) or 1.0
    for i, (motions, tilt, style) in enumerate(zip(cases, tilts, CASES, strict=False)):
        rejected = i == 1 and design.pendulum is None
        label = NOT_RECOMMENDED if rejected else style["label"]
        axes[0].plot(x[order], tilt[order], **style | {"label": label})
        lost = x[motions.status == "overturned"]
        if len(lost):
            label = f"{label}: overturns from rest"
            marks = style | {"ls": "", "marker": "^X"[i], "ms": 6.0, "label": label}
            axes[0].plot(lost, np.full(len(lost), top * (1.0 - 0.05 * i)), **marks)
    # A comparison of amplitudes begins at zero; a little less, so that resting designs are seen.
    axes[0].set(ylabel=r"largest steady tilt $\Phi$ (rad)", ylim=(-0.03 * top, 1.08 * top))
    if best is not None:
        axes[1].plot(x[order], _known(best, "swing")[order], **CASES[1] | {"label": "bob"})
    if np.isfinite(design.stroke_limit):
        axes[1].axhline(design.stroke_limit, color=ORANGE, lw=1.2, ls=":", label="stroke limit")
    axes[1].set(ylabel="largest bob angle (rad)", xlabel=xlabel)
    axes[1].axhline(0.0, color=INK, lw=0.4)
    for ax in axes:
        in_degrees(ax)
        legend(ax, loc="best")
    return axes


def _known(motions: ExactMotions, size: str) -> np.ndarray:
    """A size of the orbits to settle into, NaN under conditions without one, (n,)."""
    e = motions.orbits
    return np.where(e.attracts[0] & np.isfinite(e.tilt[0]), getattr(e, size)[0], np.nan)


def _values(design: Design, name: str) -> tuple[np.ndarray, str]:
    """Values of what differs, in SI units where it has any, and their label."""
    factors, quantity = design.conditions.column(name), _QUANTITIES.get(name, name)
    if name == "slenderness":
        return factors * design.scene.block.slenderness, LABELS["nu"]
    if quantity != name and design.pendulum is None:
        return factors, f"{name} of the pendulum, as a factor (-)"
    return factors * design.scene.quantities(design.pendulum)[quantity], LABELS[quantity]


@own_style()
def plot_front(points: Sequence[FrontPoint], ax: Axes | None = None) -> Axes:
    """Draw by how much the mean tilt falls with every pendulum that is recommended, over the mass of its bob,
    with the interval; a cross at the largest mass up to which none is. The last point is the design."""
    ax = cast(Axes, new_axes() if ax is None else ax)
    # A bob may be lighter than it had to be.
    mass = np.array([p.most if p.pendulum is None else float(p.pendulum.mass) for p in points])
    saved, low, high = 100.0 * np.array([p.benefit for p in points]).T
    # Nothing is claimed of a pendulum that was not judged: it has neither a benefit nor a refusal.
    offered, refused = np.isfinite(saved), np.array([p.pendulum is None for p in points])
    around = np.maximum([saved - low, high - saved], 0.0)[:, offered]
    style = {"color": BLUE, "marker": "o", "ms": 5, "ls": "", "elinewidth": 1.2, "capsize": 3}
    ax.errorbar(mass[offered], saved[offered], around, **style, label="recommended")
    if offered[-1]:
        ax.plot(mass[-1], saved[-1], "*", ms=16, mfc=ORANGE, mec=INK, label="design")
    if refused.any():
        none = mass[refused]
        ax.plot(none, 0.0 * none, "x", ms=8, c=GREY, clip_on=False, label="none is recommended up to here")
    ax.set(xlabel=LABELS["pendulum_mass"], ylabel="fall of the mean tilt (%), 95 %")
    # Masses are compared by their distance from none at all, as the benefits are.
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=min([0.0, *low[offered]]))
    legend(ax, columns=3)
    return ax
