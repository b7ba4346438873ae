"""Picture of motions over time, without a pendulum and with it, under harmonic shaking or a ground motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tpd.answers.shaking_history import ShakingHistory
from tpd.design.result import HarmonicDesign
from tpd.design.study import TimeHistory, time_histories
from tpd.plot.style import INK, LINES, ORANGE, in_degrees, legend, new_axes


def plot_motions(
    histories: Sequence[TimeHistory] | Sequence[ShakingHistory],
    slenderness: float,
    *,
    stroke_limit: float = np.inf,
    axes: Any = None,
) -> Any:
    """Draw the tilts, with a pendulum the rod's angle, and of a ground motion the base's acceleration above
    them and the friction needed below. A cross marks where the block overturns: its line ends there.

    Args:
        histories: of the bare block and, if there is one, with the pendulum.
        slenderness: of the block; a tilt of this size, the balance of the bare block, is dotted where a
            motion comes near it.
        stroke_limit: largest settled angle of the rod, rad, drawn if finite.
        axes: one for each quantity; default those of a new figure.

    Returns:
        The axes, an array.
    """
    shaken = [h for h in histories if isinstance(h, ShakingHistory)]
    rows = [_columns(h) for h in histories]
    hung = any(swing is not None for _, _, swing in rows)
    count = 1 + hung + 2 * bool(shaken)
    if axes is None:
        axes = np.atleast_1d(new_axes(count, (7.4, 1.0 + 1.8 * count)))
    first = 1 if shaken else 0
    tilts, last = axes[first], max(float(time[-1]) for time, _, _ in rows)
    for (time, tilt, swing), style in zip(rows, LINES, strict=False):
        # After the block has overturned the equations mean nothing.
        upright = np.cumprod(np.nan_to_num(np.abs(tilt), nan=np.inf) < 2.0 * slenderness).astype(bool)
        tilts.plot(time, np.where(upright, tilt, np.nan), **style)
        if not upright.all() and upright.any():
            _mark_fall(tilts, time[upright][-1], tilt[upright][-1], style["color"])
        if swing is not None:
            axes[first + 1].plot(time, np.where(upright, swing, np.nan), **style | {"label": None})
    largest = max(float(np.nanmax(np.abs(line.get_ydata()), initial=0.0)) for line in tilts.lines)
    if largest > 0.5 * slenderness:
        for side in (-1.0, 1.0):
            tilts.axhline(side * slenderness, color=ORANGE, lw=1.0, ls=":")
        tilts.annotate(r"$\nu$", (1.0, slenderness), (3, -3), ("axes fraction", "data"), "offset points")
    tilts.set_ylabel(r"tilt $\varphi$ (rad)")
    if hung:
        axes[first + 1].set_ylabel("rod from the\nvertical $\\psi$ (rad)")
        if np.isfinite(stroke_limit):
            for side, label in ((-1.0, None), (1.0, "limit on the settled stroke")):
                axes[first + 1].axhline(side * stroke_limit, color=ORANGE, lw=1.2, ls=":", label=label)
            legend(axes[first + 1], loc="upper right")
    if shaken:
        _of_ground(axes[0], axes[-1], shaken)
    for ax in axes[first : first + 1 + hung]:
        ax.axhline(0.0, color=INK, lw=0.4)
        in_degrees(ax)
    # Autoscaling would take the end of a line that overturns for the end of time.
    axes[-1].set(xlabel="time (s)" if shaken else "time from a start at rest (s)", xlim=(0.0, last))
    legend(axes[0] if not shaken else tilts, **({"loc": "upper right", "ncols": 2} if shaken else {}))
    return axes


def plot_start(design: HarmonicDesign, axes: Any = None) -> Any:
    """Draw the first periods from rest of a design, see `plot_motions`."""
    histories = time_histories(design.scene, design.pendulum)
    nu, limit = float(design.scene.block.slenderness), design.stroke_limit
    return plot_motions(histories, nu, stroke_limit=limit, axes=axes)


def _columns(h: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Time (s), tilt, and angle of the rod with a pendulum (rad)."""
    if isinstance(h, ShakingHistory):
        return h.times, h.tilt, h.swing
    return h.time, h.tilt, h.bob if h.with_pendulum else None


def _of_ground(above: Any, below: Any, histories: list[ShakingHistory]) -> None:
    """Draw the base's acceleration, and the friction that keeps the block from sliding."""
    above.plot(histories[0].times, histories[0].base, color=INK, lw=0.7)
    above.set_ylabel("base acceleration\n(m/s²)")
    for history, style in zip(histories, LINES, strict=False):
        # Where the block all but leaves the ground, no friction is enough: the picture stops at 5.
        ratio = np.abs(history.horizontal) / np.maximum(history.vertical, 1e-300)
        below.plot(history.times, np.minimum(ratio, 5.0), **style)
    below.set(ylabel="friction needed\n|H|/V (-)", ylim=(0.0, None))


def _mark_fall(ax: Any, time: float, tilt: float, color: str) -> None:
    """Say where a line ends because the block falls."""
    ax.plot(time, tilt, "X", color=color, mec=INK, ms=8)
    ax.annotate("overturns", (time, tilt), (6, -4), textcoords="offset points", fontsize=8)
