"""The picture of the benefit: validation runs with and without the pendulum."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.design.design import Design
from tpd.plots.style import BLUE, CASES, GREY, INK, SMALL, legend, new_axes, own_style

_SHOWN = {"overturned": "overturned", "mean tilt": "tilt, mean", "at rest": "at rest at the end"}
"""Labels of the changes over all runs, by their names."""


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
    cases = design.runs.without_pendulum, design.runs.with_pendulum
    # The kinds of start or levels have shares that overturn, if any run overturns.
    parts = design.problem.parts_of(design.runs) if any(x.is_overturned.any() for x in cases) else []
    # The first `above` rows are about all runs.
    rows, above = _rows(design.runs, parts)
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
    for (_, rows_of_part), y in zip(parts, heights[above:], strict=False):
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


def _rows(
    runs: PairedRuns, parts: list[tuple[str, np.ndarray]]
) -> tuple[list[tuple[str, float, float, float, float]], int]:
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
    for name, of in parts:
        cases = runs.without_pendulum, runs.with_pendulum
        shares = (float(np.mean(case.is_overturned[of])) for case in cases)
        rows.append((f"overturned, {name}", *shares, np.nan, np.nan))
    return rows, above
