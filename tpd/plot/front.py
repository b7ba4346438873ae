"""Picture of the front of mass against rocking."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from matplotlib.axes import Axes

from tpd.analysis.attractors import Starts
from tpd.design.result import Design
from tpd.plot.style import BLUE, GREY, INK, LABELS, ORANGE, in_degrees, new_axes

if TYPE_CHECKING:
    from tpd.design.pareto import Front


def plot_front(front: Front, design: Design, ax: Axes | None = None) -> Axes:
    """Draw the least value for every mass, the bare block and the answer.

    The last two are left out where the design was sought from other starts, since their values are of other
    motions.
    """
    ax = cast(Axes, new_axes() if ax is None else ax)
    nu, mass = design.scene.block.slenderness, design.scene.block.mass
    # Masses without a design within the limits have no point, rather than one at zero.
    known = np.isfinite(front.value)
    tilts = np.maximum(front.value[known], 0.0) * nu
    ax.plot(
        front.mass_ratio[known] * mass,
        tilts,
        "o-",
        color=BLUE,
        ms=4,
        clip_on=False,
        label="best design of its mass",
    )
    # A value over other starts than the front's would be compared with it by the eye.
    if design.starts == Starts.any():
        if np.isfinite(design.bare.value):
            ax.axhline(design.bare.value * nu, color=GREY, ls="--", label="bare block")
        if design.winner is not None:
            at = (design.winner.mass_ratio * mass, max(design.winner.value, 0.0) * nu)
            ax.plot(*at, "*", ms=16, mfc=ORANGE, mec=INK, label="answer")
    ax.set(xlabel=LABELS["pendulum_mass"] + ", at most", ylabel=f"{design.risk.name} tilt, 0 at rest (rad)")
    ax.set_ylim(bottom=0.0 if not tilts.size or tilts.max() > 0.0 else None)
    # Masses are compared by their distance from none at all, as the tilts are.
    ax.set_xlim(left=0.0)
    in_degrees(ax)
    ax.legend(fontsize=8, frameon=False)
    return ax
