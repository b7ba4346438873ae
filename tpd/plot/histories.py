"""Picture of time histories from rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tpd.design.study import TimeHistory
from tpd.plot.style import GREY, INK, ORANGE, in_degrees, new_axes

_STYLES: dict[str, dict[str, Any]] = {
    "exact": {"color": GREY, "lw": 2.6},
    "smoothed": {"color": INK, "lw": 0.9, "ls": (0, (4, 2))},
}


def plot_histories(
    histories: Sequence[TimeHistory], slenderness: float, stroke_limit: float = np.inf, axes: Any = None
) -> Any:
    """Draw the tilt without the pendulum and, if there is one, tilt and bob angle with it.

    Args:
        histories: of the bare block and with the pendulum, by one or two models each.
        slenderness: of the block; a tilt beyond twice of it is shown as overturned.
        stroke_limit: rad, drawn if finite.
        axes: one, or three with a pendulum; default those of a new figure.

    Returns:
        The axes, an array.
    """
    hung = [h for h in histories if h.with_pendulum]
    if axes is None:
        axes = np.atleast_1d(new_axes(3, (7.0, 6.8)) if hung else new_axes(1, (7.0, 2.8)))
    for history in histories:
        _draw(axes[1:] if history.with_pendulum else axes[:1], history, slenderness)
    if hung and np.isfinite(stroke_limit):
        for side, label in ((-1.0, None), (1.0, "stroke limit (settled)")):
            axes[2].axhline(side * stroke_limit, color=ORANGE, lw=1.2, ls=":", label=label)
    _finish(axes, max(h.time[-1] for h in histories))
    return axes


def _finish(axes: Any, last: float) -> None:
    """Scales, labels and legend of one axis, or of three with a pendulum; `last` time in s."""
    labels = (
        "tilt $\\varphi$ (rad)\nwithout pendulum",
        "tilt $\\varphi$ (rad)\nwith pendulum",
        "bob angle $\\psi$ (rad)",
    )
    # One scale for both tilts, which are compared.
    top = max(max(np.abs(ax.get_ylim())) for ax in axes[:2])
    for i, (ax, label) in enumerate(zip(axes, labels, strict=False)):
        ax.axhline(0.0, color=INK, lw=0.4)
        # Autoscaling would take the end of a line that overturns for the end of time.
        ax.set(ylabel=label, xlim=(-0.02 * last, 1.02 * last))
        if i < 2:
            ax.set_ylim(-top, top)
    # After the limits are set, which the second scale follows.
    for ax in axes:
        in_degrees(ax)
    axes[-1].set(xlabel="time from a start at rest (s)")
    handles = dict(zip(*axes[-1].get_legend_handles_labels()[::-1], strict=True))
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "ncols": 3}
    axes[0].legend(handles.values(), handles, fontsize=8, frameon=False, **place)


def _draw(axes: Any, history: TimeHistory, slenderness: float) -> None:
    """Add one motion: its tilt, and its bob angle where there are two axes."""
    # After the block has overturned the equations mean nothing: the line ends there for good, even where a
    # smoothed model comes back below the bound.
    small = np.nan_to_num(np.abs(history.tilt), nan=np.inf) < 2.0 * slenderness
    upright = np.cumprod(small).astype(bool)
    for ax, angle in zip(axes, (history.tilt, history.bob), strict=False):
        ax.plot(history.time, np.where(upright, angle, np.nan), label=history.model, **_STYLES[history.model])
    # The smoothed model may overturn a block that stands by the exact one.
    if history.model == "exact" and not upright.all():
        axes[0].text(0.5, 0.04, "overturns", transform=axes[0].transAxes, ha="center", weight="bold")
