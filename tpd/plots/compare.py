"""Pictures that compare a block with and without its pendulum, with intervals: benefit, conditions, front,
fragility of one set of motions and of several groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes

from tpd.answers.fragility import Fragility
from tpd.answers.paired import Benefit
from tpd.answers.statistics import Lognormal
from tpd.core import checks
from tpd.design.build import FrontPoint
from tpd.design.ground.design import GroundDesign
from tpd.design.result import HarmonicDesign
from tpd.design.verified import Bare, Verified
from tpd.plots.style import BLUE, CASES, GREY, INK, LABELS, ORANGE, in_degrees, legend, new_axes, own_style

_MOST = 24
"""Most conditions that have a row of their own, evenly over all of them."""
_SHOWN = {
    "mean severity": "tilt, mean of all runs",
    "worst severity": "tilt, worst tenth",
    "overturned": "overturned",
    "at rest": "at rest in the end",
}
"""Changes over all runs, with their labels."""
_QUANTITIES = {"length": "pendulum_length", "mass": "pendulum_mass", "damping": "pendulum_damping"}
"""Names of the pendulum's quantities, whose conditions have shorter ones."""
_INTENSITIES = {
    "pga_star": r"PGA / (g tan $\alpha$) (-)",
    "pgv_star": r"p PGV / (g tan $\alpha$) (-)",
    "pga": "PGA (m/s²)",
    "pgv": "PGV (m/s)",
    "scale": "factor on each motion (-)",
}


@own_style()
def plot_benefit(design: HarmonicDesign, ax: Any = None) -> Any:
    """Draw mean tilts over nu, and shares overturned and at rest, of the paired runs of the best design: over
    all runs above the line, under every condition below it. A bar is the 95 % interval of the difference.

    Raises:
        ValueError: a design without paired runs.
    """
    benefit = None if design.best is None else design.best.benefit
    if benefit is None:
        raise ValueError("`design` must have a design with paired runs, but has none")
    rows = _rows(design, benefit)
    heights, values = np.arange(len(rows)), np.array([row[1:] for row in rows])
    bare, hung, low, high = values.T
    ax = new_axes(1, (7.4, 1.2 + 0.24 * len(rows))) if ax is None else ax
    ax.hlines(heights, bare, hung, color=GREY, lw=1.0, zorder=1)
    ax.hlines(heights, np.clip(bare + low, 0, 1), np.clip(bare + high, 0, 1), color=BLUE, lw=5, alpha=0.35)
    # Marks stand over the lines, and at 0 and 1 over the frame: a half mark reads as another one.
    for case, x, size in zip(CASES, (bare, hung), (8.0, 5.0), strict=True):
        ax.plot(x, heights, clip_on=False, zorder=3, **case | {"ls": "", "ms": size})
    ax.set_yticks(heights, [row[0] for row in rows], fontsize=8)
    ax.set(xlim=(0.0, 1.0), xlabel="share of the runs; tilt as a share of the slenderness (-)")
    ax.invert_yaxis()
    ax.grid(axis="x", color=GREY, lw=0.4, alpha=0.6)
    ax.axhline(len(_SHOWN) - 0.5, color=INK, lw=0.6)
    legend(ax)
    return ax


def _rows(design: HarmonicDesign, benefit: Benefit) -> list[tuple[str, float, float, float, float]]:
    """Label, size without and with it, and interval of their difference, NaN where it is not known."""
    changes = {change.name: change for change in benefit.changes}
    rows = []
    for name, label in _SHOWN.items():
        _, with_it, without, low, high = changes[name]
        rows.append((label, without, with_it, low, high))
    hung, bare = benefit.by_condition
    known = np.flatnonzero(np.isfinite(hung))
    if len(design.conditions) == 1:
        return rows
    # Neighbouring frequencies stand together, the smaller amplitude first.
    order = np.lexsort([design.conditions.column(n)[known] for n in ("amplitude", "frequency")])
    known = known[order]
    chosen = known[np.unique(np.linspace(0, len(known) - 1, min(len(known), _MOST)).astype(int))]
    label = design.conditions.label
    return rows + [
        (f"tilt, {label(i)}", float(bare[i]), float(hung[i]), np.nan, np.nan) for i in map(int, chosen)
    ]


@own_style()
def plot_conditions(design: HarmonicDesign, axes: Any = None) -> Any:
    """Draw the steady tilt with the pendulum and without over what the conditions differ in, and below it the
    bob's angle; triangles and crosses are conditions under which the block overturns from rest.

    Returns:
        Both axes, an array.

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
    nu = design.scene.block.slenderness * design.conditions.column("slenderness")
    cases: list[Bare | Verified] = [design.bare, *([design.best] if design.best else [])]
    tilts = [_known(of, "tilt") * nu for of in cases]
    # The marks of overturning stand above all finite tilts, so the axis needs room there.
    top = 1.3 * float(np.nanmax(tilts, initial=0.0)) or 1.0
    for i, (of, tilt, style) in enumerate(zip(cases, tilts, CASES, strict=False)):
        refused = i == 1 and design.winner is None
        label = "best found, not offered" if refused else style["label"]
        axes[0].plot(x[order], tilt[order], **style | {"label": label})
        lost = x[of.exact.status == "overturned"]
        if len(lost):
            label = f"{style['label']}: overturns from rest"
            marks = style | {"ls": "", "marker": "^X"[i], "ms": 6.0, "label": label}
            axes[0].plot(lost, np.full(len(lost), top * (1.0 - 0.05 * i)), **marks)
    # A comparison of amplitudes begins at zero; a little less, so that resting designs are seen.
    axes[0].set(ylabel=r"largest steady tilt $\Phi$ (rad)", ylim=(-0.03 * top, 1.08 * top))
    if design.best is not None:
        axes[1].plot(x[order], _known(design.best, "stroke")[order], **CASES[1] | {"label": "bob"})
    if np.isfinite(design.stroke_limit):
        axes[1].axhline(design.stroke_limit, color=ORANGE, lw=1.2, ls=":", label="stroke limit")
    axes[1].set(ylabel="largest bob angle (rad)", xlabel=xlabel)
    axes[1].axhline(0.0, color=INK, lw=0.4)
    for ax in axes:
        in_degrees(ax)
        legend(ax, loc="best")
    return axes


def _known(of: Bare | Verified, size: str) -> np.ndarray:
    """A size of the motions to settle into, NaN under conditions without one, (n,)."""
    e = of.evaluation
    return np.where(e.attracts[0] & np.isfinite(e.tilt[0]), getattr(e, size)[0], np.nan)


def _values(design: HarmonicDesign, name: str) -> tuple[np.ndarray, str]:
    """Values of what differs, in SI units where it has any, and their label."""
    factors, quantity = design.conditions.column(name), _QUANTITIES.get(name, name)
    if name == "slenderness":
        return factors * design.scene.block.slenderness, LABELS["nu"]
    if quantity != name and design.pendulum is None:
        return factors, f"{name} of the pendulum, as a factor (-)"
    return factors * design.scene.quantities(design.pendulum)[quantity], LABELS[quantity]


@own_style()
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
    legend(ax, columns=3)
    return ax


@own_style()
def plot_fragility(fragility: Fragility, state: str = "overturned", ax: Any = None) -> Any:
    """Draw shares at the stripes, the lognormal curves and their 95 % bands for one damage state. A bar at a
    stripe is what motions without an answer leave open.

    Raises:
        ValueError: a state that the fragility does not have.
    """
    checks.one_of("state", state, tuple(fragility.bare))
    ax = new_axes() if ax is None else ax
    fine = np.linspace(0.5 * fragility.stripes[0], 1.1 * fragility.stripes[-1], 300)
    cases = [fragility.bare[state]] + ([] if fragility.hung is None else [fragility.hung[state]])
    for i, c in enumerate(cases):
        _curve(ax, fragility.stripes, c.counts, c.undecided, c.total + c.undecided, c.fit, fine, i)
    unit = "" if fragility.unit == "-" else f" ({fragility.unit})"
    ax.set(xlabel=f"{fragility.intensity}{unit}", ylabel=f"share of motions: {state} (-)", ylim=(0.0, 1.0))
    legend(ax)
    return ax


@own_style()
def plot_groups(design: GroundDesign, axes: Any = None) -> Any:
    """Draw the shares of each group that overturn at each stripe, without and with the pendulum, one panel
    for each group: the fitted curve, its band of 95 % confidence and the shares themselves; a bar where runs
    without an answer leave a share open.

    Returns:
        The axes, an array.
    """
    groups = design.judged
    if axes is None:
        size = (3.6 * max(len(groups), 2), 3.6)
        axes = np.atleast_1d(new_axes(1, size, columns=len(groups)))
    for ax, group in zip(axes, groups, strict=True):
        fine = np.linspace(0.8 * group.stripes[0], 1.05 * group.stripes[-1], 200)
        for i, (count, unknown, fit) in enumerate(zip(group.counts, group.unknown, group.fits, strict=True)):
            _curve(ax, group.stripes, count, unknown, group.motions, fit, fine, i)
        d = group.difference
        said = f"{group.name}: {group.motions} motions, {group.events} earthquakes\noverturned {d.words()}"
        unknown = f"\n{group.undecided} runs without an answer" if group.undecided else ""
        ax.set_title(said + unknown, fontsize=9)
        ax.set(xlabel=_INTENSITIES[design.conditions.intensity], ylim=(0.0, 1.0))
    axes[0].set_ylabel("share of motions that overturn the block (-)")
    legend(axes[0], loc="upper left")
    return axes


def _curve(
    ax: Any,
    stripes: np.ndarray,
    count: np.ndarray,
    unknown: np.ndarray,
    motions: Any,
    fit: Lognormal,
    fine: np.ndarray,
    case: int,
) -> None:
    """Shares of `motions` at the stripes, bars for those that are unknown, and the fit with its band."""
    style, known, open_at = CASES[case], motions - unknown > 0, unknown > 0
    shares = (count / np.maximum(motions - unknown, 1))[known]
    # Open without the pendulum and filled with it, so that they differ in grey.
    marks = style | {"ls": "", "ms": 6.0, "mec": INK}
    ax.plot(stripes[known], shares, clip_on=False, zorder=3, **marks)
    if open_at.any():
        # From the share if none of the runs without an answer had reached the state to that if all had.
        ends = (count / motions)[open_at], ((count + unknown) / motions)[open_at]
        label = f"{style['label']}: {unknown.sum()} runs without an answer"
        ax.vlines(stripes[open_at], *ends, colors=style["color"], lw=5, alpha=0.35, label=label)
    if 0.0 < fit.median < np.inf:
        ax.fill_between(fine, *fit.band(fine), color=style["color"], alpha=0.2, lw=0)
        label = f"{style['label']}: median {fit.median:.3g}"
        ax.plot(fine, fit.probability(fine), color=style["color"], ls=style["ls"], lw=1.6, label=label)
