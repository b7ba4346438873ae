"""Picture of the benefit: tilt with the pendulum and without, under every condition and over all runs."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpd.analysis.benefit import Benefit
from tpd.design.result import HarmonicDesign
from tpd.plot.style import BLUE, CASES, GREY, INK, new_axes

_MOST = 24
"""Most conditions that have a row of their own, evenly over all of them."""


def plot_benefit(design: HarmonicDesign, axes: Any = None) -> Any:
    """Draw mean tilts over nu, and shares overturned and at rest, of the paired runs of the best design.

    Raises:
        ValueError: a design without paired runs.
    """
    benefit = None if design.best is None else design.best.benefit
    if benefit is None:
        raise ValueError("`design` must have a design with paired runs, but has none")
    rows = _rows(design, benefit)
    axes = new_axes(1, (7.4, 1.5 + 0.26 * len(rows))) if axes is None else axes
    for y, (_, hung, bare, strong) in enumerate(rows):
        axes.plot([bare, hung], [y, y], color=INK if strong else GREY, lw=1.6 if strong else 1.0, zorder=1)
    # Marks stand over the lines, and at 0 and 1 over the frame: a half mark reads as another one.
    heights = np.arange(len(rows))
    for case, column in ((0, 2), (1, 1)):
        style = {key: CASES[case][key] for key in ("color", "marker", "label") if key in CASES[case]}
        face = "white" if case == 0 else BLUE
        values = [row[column] for row in rows]
        axes.plot(values, heights, ls="", clip_on=False, ms=7.0, mec=INK, mfc=face, zorder=2 + case, **style)
    axes.set_yticks(heights, [row[0] for row in rows], fontsize=8)
    axes.set(xlim=(0.0, 1.0), xlabel="share of the runs; tilt as a share of the slenderness (-)")
    axes.invert_yaxis()
    axes.grid(axis="x", color=GREY, lw=0.4, alpha=0.6)
    axes.axhline(len(_SHOWN) - 0.5, color=INK, lw=0.6)
    axes.legend(fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)
    return axes


_SHOWN = {
    "mean severity": "tilt, mean of all runs",
    "worst severity": "tilt, worst tenth",
    "overturned": "overturned",
    "at rest": "at rest in the end",
}
"""Changes over all runs, with their labels."""


def _rows(design: HarmonicDesign, benefit: Benefit) -> list[tuple[str, float, float, bool]]:
    """Label, size with it, size without, and whether the row is over all runs."""
    changes = {change.name: change for change in benefit.changes}
    rows = [(label, changes[n].with_it, changes[n].without, True) for n, label in _SHOWN.items()]
    hung, bare = benefit.by_condition
    known = np.flatnonzero(np.isfinite(hung))
    if len(design.conditions) == 1:
        return rows
    # Neighbouring frequencies stand together, the smaller amplitude first.
    order = np.lexsort([design.conditions.column(n)[known] for n in ("amplitude", "frequency")])
    known = known[order]
    chosen = known[np.unique(np.linspace(0, len(known) - 1, min(len(known), _MOST)).astype(int))]
    for i in map(int, chosen):
        rows.append((f"tilt, {design.conditions.label(i)}", float(hung[i]), float(bare[i]), False))
    return rows
