"""Picture of the response over frequency from rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes

from tpd.analysis.response import Response
from tpd.core.status import SETTLED
from tpd.plot.style import CASES, LABELS, ORANGE, in_degrees, new_axes, overturned


def plot_response(
    responses: Sequence[Response],
    frequency: float,
    ax: Axes | None = None,
    *,
    toppling: Sequence[float] | None = None,
) -> Axes:
    """Draw the settled amplitude from rest against frequency: open marks bare, filled ones with a pendulum.

    Args:
        responses: of the bare block and, if there is one, with the pendulum.
        frequency: of the design, Hz, or the value of what the responses vary.
        ax: default that of a new figure.
        toppling: tilts (rad) at which the block topples by itself, one for each response: there an
            overturning is marked. By default the marks are near the top.
    """
    # Points rather than lines alone: between two frequencies another motion may be reached.
    ax = cast(Axes, new_axes() if ax is None else ax)
    levels: list[float | None] = [None] * len(responses) if toppling is None else list(toppling)
    settled = [np.isin(r.status, SETTLED) for r in responses]
    top = _top(responses, settled, levels)
    for i, (r, known) in enumerate(zip(responses, settled, strict=True)):
        # The axis begins at zero, and a block at rest has its mark there: it must not be cut in half.
        ax.plot(r.frequency, np.where(known, r.amplitude, np.nan), **CASES[i], clip_on=False)
        overturned(ax, r.frequency[r.status == "overturned"], top, i, levels[i])
        other = ~known & (r.status != "overturned")
        if other.any():
            style: dict[str, Any] = {"ls": "", "marker": "DP"[i], "mfc": "none", "ms": 5}
            style |= {"color": CASES[i]["color"], "label": f"{CASES[i]['label']}: not settled"}
            ax.plot(r.frequency[other], np.minimum(r.amplitude[other], 0.85 * top), **style)
    ax.axvline(frequency, color=ORANGE, lw=1.0, ls="--", label="design frequency")
    for i, level in enumerate(toppling or ()):
        label = f"tilt at which it topples, {CASES[i]['label']}"
        ax.axhline(level, color=CASES[i].get("mec", CASES[i]["color"]), lw=0.6, ls=":", label=label)
    name = responses[0].name if responses else "frequency"
    ax.set(xlabel=LABELS[name], ylabel=r"settled amplitude $\Phi$ from rest (rad)")
    ax.set_ylim(0.0, 1.06 * top)
    in_degrees(ax)
    ax.legend(fontsize=8, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return ax


def _top(responses: Sequence[Response], settled: list[np.ndarray], levels: list[float | None]) -> float:
    """Largest tilt (rad) that the axis has room for."""
    sizes = [r.amplitude[known] for r, known in zip(responses, settled, strict=True)]
    largest = max([float(x.max()) for x in sizes if x.size], default=1.0)
    # Toppling tilts bound all that is drawn; without them the marks of overturning need room above.
    known = [x for x in levels if x is not None]
    return max([largest, *known]) if known else 1.35 * largest or 1.0
