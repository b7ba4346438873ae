"""Pictures that compare a block with and without its pendulum: benefit and conditions."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.design.design import Design
from tpd.design.harmonic import ExactMotions
from tpd.plots.style import (
    BLUE,
    CASES,
    GREY,
    INK,
    LABELS,
    NOT_RECOMMENDED,
    ORANGE,
    SMALL,
    in_degrees,
    legend,
    new_axes,
    own_style,
)

_SHOWN = {"overturned": "overturned", "mean tilt": "tilt, mean", "at rest": "at rest at the end"}
"""Labels of the changes over all runs, by their names."""
_QUANTITIES = {"length": "pendulum_length", "mass": "pendulum_mass", "damping": "pendulum_damping"}
"""Names of the pendulum's quantities by the shorter names of the conditions."""


@own_style()
def plot_benefit(design: Design, ax: Any = None) -> Any:
    """Draw the results of the validation runs of the best design, with and without the pendulum.

    Above a line: share of all counted runs that overturn, mean tilt over nu, and share that ends at rest. A
    wide bar is the 95 % interval of the difference. Under ground motions the row on rest is drawn only if a
    run ends at rest. Below the line: shares that overturn for each kind of start, or for each level, with
    their own 95 % intervals, if a run overturns.

    Args:
        design: the answer of `optimise`.
        ax: axes to draw on; by default those of a new figure.

    Returns:
        The axes.

    Raises:
        ValueError: a design without validation runs.
    """
    if design.runs is None:
        raise ValueError("`design` must have validation runs, but has none")
    # The first `above` rows are about all runs.
    rows, above = _rows(design, design.runs)
    heights, values = np.arange(len(rows)), np.array([row[1:] for row in rows])
    without, pendulum, low, high = values.T
    ax = new_axes(1, (7.4, 1.2 + 0.24 * len(rows))) if ax is None else ax
    ax.hlines(heights, without, pendulum, color=GREY, lw=1.0, zorder=1)
    # The interval is that of the difference: its ends are drawn relative to the value without the pendulum.
    ends = (np.clip(without + x, 0.0, 1.0) for x in (low, high))
    ax.hlines(heights, *ends, color=BLUE, lw=5, alpha=0.35)
    # Marks are not clipped: half of a mark at 0 or 1 could be taken for another mark.
    for case, x, size in zip(CASES, (without, pendulum), (8.0, 5.0), strict=True):
        ax.plot(x, heights, clip_on=False, zorder=3, **case | {"ls": "", "ms": size})
    # Two thin bars, a little apart, so that both can be seen where they overlap.
    for (_, rows_of_part), y in zip(_overturning(design, design.runs), heights[above:], strict=False):
        cases = design.runs.without_pendulum, design.runs.with_pendulum
        for runs, case, shift in zip(cases, CASES, (0.16, -0.16), strict=True):
            share = runs.of(rows_of_part).share_overturned
            ax.hlines(y + shift, share.low, share.high, color=case["color"], lw=1.2, zorder=2)
    ax.set_yticks(heights, [row[0] for row in rows], fontsize=SMALL)
    ax.set(xlim=(0.0, 1.0), xlabel="share of the runs; tilt as a share of the slenderness (-)")
    ax.invert_yaxis()
    ax.grid(axis="x", color=GREY, lw=0.4, alpha=0.6)
    ax.axhline(above - 0.5, color=INK, lw=0.6)
    legend(ax)
    return ax


def _overturning(design: Design, runs: PairedRuns) -> list[tuple[str, np.ndarray]]:
    """Return the kinds of start or levels whose shares that overturn are drawn; none if no run overturns."""
    falls = any(case.is_overturned.any() for case in (runs.with_pendulum, runs.without_pendulum))
    return design.problem.parts_of(runs) if falls else []


def _rows(design: Design, runs: PairedRuns) -> tuple[list[tuple[str, float, float, float, float]], int]:
    """Return the rows of the picture of the benefit, and the number of rows about all runs.

    A row is a label, the values without and with the pendulum, and the ends of the interval of their
    difference, which are NaN if unknown.
    """
    rows = []
    for name, label in _SHOWN.items():
        _, with_pendulum, without, low, high = runs.change(name)
        # Under ground motions the runs end with the record, and a block that still moves then may come to
        # rest later. A row of zeros would suggest that it does not.
        if name != "at rest" or runs.cluster is None or (with_pendulum, without) != (0.0, 0.0):
            rows.append((label, without, with_pendulum, low, high))
    above = len(rows)
    for name, of in _overturning(design, runs):
        cases = runs.without_pendulum, runs.with_pendulum
        shares = (float(np.mean(case.is_overturned[of])) for case in cases)
        rows.append((f"overturned, {name}", *shares, np.nan, np.nan))
    return rows, above


@own_style()
def plot_conditions(design: Design, axes: Any = None) -> Any:
    """Draw the steady tilt with and without the pendulum, and below it the bob angle.

    The horizontal axis is the quantity in which the conditions differ. Triangles and crosses are conditions
    under which the block overturns from rest.

    Args:
        design: the answer of `optimise`.
        axes: two axes to draw on; by default those of a new figure.

    Returns:
        Both axes, an array.

    Raises:
        ValueError: conditions that differ in no quantity, or in several.
    """
    name = design.conditions.axis
    if name is None:
        raise ValueError("`design` must have conditions that differ in one quantity")
    axes = new_axes(2, (7.0, 5.6)) if axes is None else axes
    # Conditions with random values are not sorted.
    order = np.argsort(design.conditions.column(name), kind="stable")
    x, xlabel = _values(design, name)
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")
    # A design that is not recommended is drawn as well, with another label.
    cases = design.exact_motions
    tilts = [_attracting(motions, "tilt") * nu for motions in cases]
    # Leave space above all finite tilts for the marks of overturning.
    top = 1.3 * float(np.nanmax(tilts, initial=0.0)) or 1.0
    for i, (motions, tilt, style) in enumerate(zip(cases, tilts, CASES, strict=False)):
        is_rejected = i == 1 and design.pendulum is None
        label = NOT_RECOMMENDED if is_rejected else style["label"]
        axes[0].plot(x[order], tilt[order], **style | {"label": label})
        overturned = x[motions.status == "overturned"]
        if len(overturned):
            label = f"{label}: overturns from rest"
            marks = style | {"ls": "", "marker": "^X"[i], "ms": 6.0, "label": label}
            axes[0].plot(overturned, np.full(len(overturned), top * (1.0 - 0.05 * i)), **marks)
    # The axis begins a little below zero, where the marks of a block at rest are visible.
    axes[0].set(ylabel=r"largest steady tilt $\Phi$ (rad)", ylim=(-0.03 * top, 1.08 * top))
    for motions in cases[1:]:
        axes[1].plot(x[order], _attracting(motions, "swing")[order], **CASES[1] | {"label": "bob"})
    if np.isfinite(design.stroke_limit):
        axes[1].axhline(design.stroke_limit, color=ORANGE, lw=1.2, ls=":", label="stroke limit")
    axes[1].set(ylabel="largest bob angle (rad)", xlabel=xlabel)
    axes[1].axhline(0.0, color=INK, lw=0.4)
    for ax in axes:
        in_degrees(ax)
        legend(ax, loc="best")
    return axes


def _attracting(motions: ExactMotions, size: str) -> np.ndarray:
    """Return a size of the attracting orbit under each condition, (n,); NaN if there is no such orbit."""
    e = motions.orbits
    # Row 0 is the only design in these arrays.
    return np.where(e.attracts[0] & np.isfinite(e.tilt[0]), getattr(e, size)[0], np.nan)


def _values(design: Design, name: str) -> tuple[np.ndarray, str]:
    """Return the values of the quantity in which the conditions differ, and the axis label.

    Values have SI units, except for a quantity of the pendulum if no pendulum is recommended: its values are
    then factors.
    """
    factors, quantity = design.conditions.column(name), _QUANTITIES.get(name, name)
    if name == "slenderness":
        return factors * design.scene.block.slenderness, LABELS["nu"]
    if quantity != name and design.pendulum is None:
        return factors, f"{name} of the pendulum, as a factor (-)"
    return factors * design.scene.quantities(design.pendulum)[quantity], LABELS[quantity]
