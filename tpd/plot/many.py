"""Pictures of a design over many conditions. Every function draws into given axes and returns them."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes

from tpd.design.many_result import DesignOver
from tpd.design.objective import Told
from tpd.design.pareto import Front
from tpd.plot.style import BLUE, GREY, INK, LABELS, ORANGE, new_axes

_SHOWN = 300
"""Screened designs drawn, the best."""


def plot_conditions(design: DesignOver, axes: Any = None) -> Any:
    """Tilt and stroke over the frequency (or whatever the conditions differ in), with the pendulum and
    without; what overturns from rest is marked."""
    axes = new_axes(2, (7.0, 5.6)) if axes is None else axes
    name = cast(str, design.conditions.along)
    own, unit = design.conditions.units.get(name, (1.0, "as a factor on the scene's, -"))
    # What scatters comes in no order.
    order = np.argsort(design.conditions.column(name), kind="stable")
    x, label = design.conditions.column(name)[order] * own, f"{name} ({unit})"
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")[order]
    told: list[tuple[Told, np.ndarray, str, dict[str, Any]]] = [
        (design.bare, design.bare_reached, "bare block", {"color": GREY, "marker": "s"})
    ]
    if design.winner is not None:
        told.append(
            (design.winner.told, design.winner.reached, "with the pendulum", {"color": BLUE, "marker": "o"})
        )
    shown = [t.attracts[0] if design.reached is None else np.isfinite(t.tilt[0]) for t, *_ in told]
    tilts = [np.where(on, t.tilt[0], np.nan)[order] * nu for on, (t, *_) in zip(shown, told, strict=True)]
    top = 1.3 * max((float(np.nanmax(t)) for t in tilts if np.isfinite(t).any()), default=1.0)
    for i, (t, reached, what, style) in enumerate(told):
        axes[0].plot(x, tilts[i], ms=3.5, lw=1.2, ls="-" if i else "--", label=what, **style)
        lost = reached[order] == "overturned"
        if lost.any():
            level = np.full(lost.sum(), top * (1.0 - 0.06 * i))
            axes[0].plot(
                x[lost],
                level,
                ls="",
                marker="x" if i else "+",
                color=style["color"],
                label=f"{what}: overturns from rest",
            )
        if what != "bare block":
            # Nothing settles where every start overturns.
            stroke = np.where(np.broadcast_to(t.lost, t.kind.shape)[0] < 1.0, t.stroke[0], np.nan)
            axes[1].plot(x, stroke[order], ms=3.5, lw=1.2, label="bob", **style)
    axes[0].set(ylabel=r"largest steady tilt $\Phi$ (rad)", ylim=(-0.03 * top, 1.08 * top))
    axes[0].legend(fontsize=8, frameon=False)
    axes[1].axhline(design.space.stroke, color=ORANGE, lw=1.0, ls=":", label="stroke limit")
    axes[1].set(ylabel="largest bob angle (rad)", xlabel=label)
    axes[1].legend(fontsize=8, frameon=False)
    return axes


def plot_landscape(design: DesignOver, ax: Axes | None = None) -> Axes:
    """The search over the (mu, lam) plane: screened designs by value, paths, ends and the answer."""
    ax = cast(Axes, new_axes() if ax is None else ax)
    best = np.argsort(design.screened_value, kind="stable")[:_SHOWN]
    value = design.screened_value[best]
    # Beyond a limit a value holds what it exceeds that by: not for the scale of the colours.
    within = value <= 1.2 * design.bare_value
    label = f"{design.measure.name} tilt / slenderness"
    if not within.any():
        within, label = value <= np.median(value), f"{label}, plus what exceeds limits"
    points = ax.scatter(
        *design.screened[best][within, :2].T,
        c=value[within],
        cmap="viridis",
        s=24,
        linewidths=0.4,
        edgecolors="white",
    )
    ax.figure.colorbar(points, ax=ax, label=f"{label} (-)")
    ax.scatter(
        *design.screened[best][~within, :2].T,
        marker="x",
        c=GREY,
        s=12,
        linewidths=0.7,
        label="worse, or beyond a limit",
    )
    for i, path in enumerate(design.paths):
        ax.plot(
            path[:, 0], path[:, 1], color=INK, lw=0.6, alpha=0.6, label="search paths" if i == 0 else None
        )
    kept = np.isfinite(design.end_values)
    if kept.any():
        style = {"ls": "", "marker": "o", "mfc": "none", "mec": INK, "ms": 5}
        ax.plot(*design.ends[kept, :2].T, label="ends of searches", **style)
    refused = np.array([(j.mass_ratio, j.length_ratio) for j in design.judged if j.objections])
    if len(refused):
        ax.plot(*refused.T, "X", ms=10, mfc="white", mec=INK, label="refused when judged")
    if design.winner is not None:
        ax.plot(
            design.winner.mass_ratio,
            design.winner.length_ratio,
            "*",
            ms=17,
            mfc=ORANGE,
            mec=INK,
            label="answer",
        )
    ax.set(xlabel=LABELS["mu"], ylabel=LABELS["lam"])
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=4, fontsize=7, frameon=False)
    return ax


def plot_front(front: Front, design: DesignOver, ax: Axes | None = None) -> Axes:
    """The least value for every mass, and the answer; not where that is one of another measure, over what
    starts reach."""
    ax = cast(Axes, new_axes() if ax is None else ax)
    nu, mass = design.scene.block.slenderness, design.scene.block.mass
    kept = np.isfinite(front.value)
    ax.plot(
        front.mass_ratio[kept] * mass,
        front.value[kept] * nu,
        "o-",
        color=BLUE,
        ms=4,
        label="best design of its mass",
    )
    if design.reached is None:
        ax.axhline(design.bare_value * nu, color=GREY, ls="--", label="bare block")
    if design.winner is not None and design.reached is None:
        ax.plot(
            design.winner.mass_ratio * mass,
            design.winner.value * nu,
            "*",
            ms=16,
            mfc=ORANGE,
            mec=INK,
            label="answer",
        )
    ax.set(xlabel=LABELS["pendulum_mass"] + ", at most", ylabel=f"{design.measure.name} tilt (rad)")
    ax.legend(fontsize=8, frameon=False)
    return ax
