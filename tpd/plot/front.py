"""Picture of the front of mass against benefit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from matplotlib.axes import Axes

from tpd.design.front import FrontPoint
from tpd.plot.style import BLUE, GREY, INK, LABELS, ORANGE, new_axes


def plot_front(points: Sequence[FrontPoint], ax: Axes | None = None) -> Axes:
    """Draw by how much the mean tilt falls with every bob that is offered, over its own mass, with the
    interval; a cross at the largest mass up to which none is offered. The last point is the answer."""
    ax = cast(Axes, new_axes() if ax is None else ax)
    # A bob may be lighter than it had to be.
    mass = np.array([p.most if p.pendulum is None else float(p.pendulum.mass) for p in points])
    saved, low, high = 100.0 * np.array([p.saved for p in points]).T
    # Nothing is claimed of a pendulum that was not judged: it has neither a benefit nor a refusal.
    offered, refused = np.isfinite(saved), np.array([p.pendulum is None for p in points])
    around = np.maximum([saved - low, high - saved], 0.0)[:, offered]
    style = {"color": BLUE, "marker": "o", "ms": 5, "ls": "", "elinewidth": 1.2, "capsize": 3}
    ax.errorbar(mass[offered], saved[offered], around, **style, label="offered")
    if offered[-1]:
        ax.plot(mass[-1], saved[-1], "*", ms=16, mfc=ORANGE, mec=INK, label="answer")
    if refused.any():
        none = mass[refused]
        ax.plot(none, 0.0 * none, "x", ms=8, c=GREY, clip_on=False, label="none is offered up to here")
    ax.set(xlabel=LABELS["pendulum_mass"], ylabel="fall of the mean tilt (%), 95 %")
    # Masses are compared by their distance from none at all, as the benefits are.
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=min([0.0, *low[offered]]))
    ax.legend(fontsize=8, frameon=False)
    return ax
