"""Picture of the response over frequency from rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes

from tpd.analysis.response import Response
from tpd.core.status import SETTLED
from tpd.plot.style import CASES, LABELS, ORANGE, new_axes, overturned


def plot_response(responses: Sequence[Response], frequency: float, ax: Axes | None = None) -> Axes:
    """Draw the settled amplitude from rest against frequency.

    Args:
        responses: of the bare block and, if there is one, with the pendulum.
        frequency: of the design, Hz.
        ax: default that of a new figure.
    """
    # Points rather than lines alone: between two frequencies another motion may be reached.
    ax = cast(Axes, new_axes() if ax is None else ax)
    settled = [np.isin(r.status, SETTLED) for r in responses]
    sizes = [r.amplitude[known] for r, known in zip(responses, settled, strict=True)]
    top = 1.35 * max([float(x.max()) for x in sizes if x.size], default=1.0) or 1.0
    for i, (r, known) in enumerate(zip(responses, settled, strict=True)):
        ax.plot(r.frequency, np.where(known, r.amplitude, np.nan), **CASES[i])
        overturned(ax, r.frequency[r.status == "overturned"], top, i)
        other = ~known & (r.status != "overturned")
        if other.any():
            style: dict[str, Any] = {"ls": "", "marker": "D", "mfc": "none", "ms": 5}
            style |= {"color": CASES[i]["color"], "label": f"{CASES[i]['label']}: not settled"}
            ax.plot(r.frequency[other], np.minimum(r.amplitude[other], 0.85 * top), **style)
    ax.axvline(frequency, color=ORANGE, lw=1.0, ls="--", label="design frequency")
    ax.set(xlabel=LABELS["frequency"], ylabel=r"settled amplitude $\Phi$ from rest (rad)")
    ax.set_ylim(-0.03 * top, 1.06 * top)
    ax.legend(fontsize=8, frameon=False)
    return ax
