"""Picture of a design over the quantity that its conditions differ in."""

from __future__ import annotations

from typing import Any

import numpy as np

from tpd.design.result import HarmonicDesign
from tpd.design.verified import Bare, Verified
from tpd.plot.style import CASES, INK, LABELS, ORANGE, in_degrees, new_axes, overturned

_QUANTITIES = {"length": "pendulum_length", "mass": "pendulum_mass", "damping": "pendulum_damping"}
"""Names of the pendulum's quantities, whose conditions have shorter ones."""


def plot_conditions(design: HarmonicDesign, axes: Any = None) -> Any:
    """Draw the steady tilt with the pendulum and without, and the bob's angle; returns both axes.

    Raises:
        ValueError: conditions that differ in no quantity, or in several.
    """
    name = design.conditions.axis
    if name is None:
        raise ValueError("`design` must have conditions that differ in one quantity")
    axes = new_axes(2, (7.0, 5.6)) if axes is None else axes
    # Values that scatter come in no order.
    order = np.argsort(design.conditions.column(name), kind="stable")
    x, xlabel = _values(design, name)
    _tilts(axes[0], design, x, order)
    if design.best is not None:
        stroke = np.where(_known(design.best), design.best.evaluation.stroke[0], np.nan)
        axes[1].plot(x[order], stroke[order], **CASES[1] | {"label": "bob"})
    if np.isfinite(design.stroke_limit):
        axes[1].axhline(design.stroke_limit, color=ORANGE, lw=1.2, ls=":", label="stroke limit")
    axes[1].set(ylabel="largest bob angle (rad)", xlabel=xlabel)
    axes[1].axhline(0.0, color=INK, lw=0.4)
    for ax in axes:
        in_degrees(ax)
        if ax.get_legend_handles_labels()[0]:
            ax.legend(fontsize=8, frameon=False)
    return axes


def _tilts(ax: Any, design: HarmonicDesign, x: np.ndarray, order: np.ndarray) -> None:
    """Draw the tilts with and without the pendulum, and mark where the block overturns from rest."""
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")
    cases: list[Bare | Verified] = [design.bare, *([design.best] if design.best else [])]
    tilts = [np.where(_known(of), of.evaluation.tilt[0], np.nan) * nu for of in cases]
    # The marks of overturning stand above all finite tilts, so the axis needs room there.
    top = 1.3 * max((float(np.nanmax(t)) for t in tilts if np.isfinite(t).any()), default=1.0) or 1.0
    for i, (of, tilt) in enumerate(zip(cases, tilts, strict=True)):
        refused = i == 1 and design.winner is None
        label = "best found, not offered" if refused else CASES[i]["label"]
        ax.plot(x[order], tilt[order], **CASES[i] | {"label": label})
        overturned(ax, x[of.exact.status == "overturned"], top, i)
    # A comparison of amplitudes begins at zero; a little less, so that resting designs are seen.
    ax.set(ylabel=r"largest steady tilt $\Phi$ (rad)", ylim=(-0.03 * top, 1.08 * top))


def _known(of: Bare | Verified) -> np.ndarray:
    """Under which conditions there is a motion to settle into, (n,)."""
    e = of.evaluation
    return e.attracts[0] & np.isfinite(e.tilt[0])


def _values(design: HarmonicDesign, name: str) -> tuple[np.ndarray, str]:
    """Values of what differs, in SI units where it has any, and their label."""
    factors, quantity = design.conditions.column(name), _QUANTITIES.get(name, name)
    if name == "slenderness":
        return factors * design.scene.block.slenderness, LABELS["nu"]
    if quantity != name and design.pendulum is None:
        return factors, f"{name} of the pendulum, as a factor (-)"
    return factors * design.scene.quantities(design.pendulum)[quantity], LABELS[quantity]
