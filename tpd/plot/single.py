"""Pictures of a design. Every function draws into given axes and returns them; none shows or saves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes

from tpd.analysis.response import Response
from tpd.analysis.steady_state import sampled, simulate
from tpd.closed_form.no_uplift import uplift
from tpd.core.parameters import as_arrays
from tpd.core.scene import Pendulum
from tpd.core.status import SETTLED
from tpd.design.result import Design
from tpd.design.single_search import with_design
from tpd.models.base import AbstractModel
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed
from tpd.plot.style import BLUE, GREY, INK, LABELS, ORANGE, new_axes, png


def plot_search(design: Design, ax: Axes | None = None) -> Axes:
    """The search over the (mu, lam) plane: screened designs, paths, answer, and where a block at
    rest stays at rest."""
    ax = cast(Axes, new_axes() if ax is None else ax)
    h, space = design.history, design.space
    _no_uplift_region(design, ax)
    settled = np.isin(h.screened_status, SETTLED)
    within = settled & (h.screened_stroke <= space.stroke)
    nu, finite = design.scene.block.slenderness, np.isfinite(design.amplitude_without)
    for mask, marker, size in ((within, "o", 26), (settled & ~within, "^", 16)):
        points = ax.scatter(
            h.screened[mask, 0],
            h.screened[mask, 1],
            c=h.screened_amplitude[mask] / nu,
            cmap="viridis",
            vmin=0.0,
            vmax=max(0.4, 1.2 * design.amplitude_without / nu) if finite else 0.4,
            marker=marker,
            s=size,
            linewidths=0.4,
            edgecolors="white",
        )
        if marker == "o":
            ax.figure.colorbar(points, ax=ax, label="settled rocking amplitude / slenderness (-)")
    ax.scatter([], [], marker="o", c=GREY, s=26, label="screened, within the stroke limit")
    ax.scatter([], [], marker="^", c=GREY, s=16, label="screened, stroke beyond the limit")
    lost = ~settled
    ax.scatter(
        h.screened[lost, 0],
        h.screened[lost, 1],
        marker="x",
        c=INK,
        s=14,
        linewidths=0.7,
        label="overturned or not settled",
    )
    for i, path in enumerate(h.designs):
        ax.plot(path[:, 0], path[:, 1], color=INK, lw=0.9, label="search paths" if i == 0 else None)
    if design.winner is not None:
        ax.plot(
            design.winner.mass_ratio,
            design.winner.length_ratio,
            "*",
            ms=17,
            mfc=ORANGE,
            mec=INK,
            label="best found, not offered" if design.pendulum is None else "answer",
        )
    ax.set(
        xlabel=LABELS["mu"],
        ylabel=LABELS["lam"],
        xlim=_padded(space.mass_ratio),
        ylim=_padded(space.length_ratio),
    )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=7, frameon=False)
    return ax


def _padded(bounds: tuple[float, float]) -> tuple[float, float]:
    pad = 0.03 * (bounds[1] - bounds[0])
    return bounds[0] - pad, bounds[1] + pad


def _no_uplift_region(design: Design, ax: Axes) -> None:
    space = design.space
    mu, lam = np.linspace(*space.mass_ratio, 120), np.linspace(*space.length_ratio, 120)
    zeta = design.winner.damping_ratio if design.winner else float(np.mean(space.damping_ratio))
    grid = jnp.stack(jnp.meshgrid(jnp.asarray(mu), jnp.asarray(lam)), axis=-1)
    flat = jnp.concatenate([grid.reshape(-1, 2), jnp.full((grid.size // 2, 1), zeta)], axis=1)
    p = as_arrays(design.scene.parameters())
    margin = np.asarray(jax.vmap(lambda d: uplift(with_design(p, d)).margin)(flat)).reshape(120, 120)
    if (margin > 0).any():
        ax.contourf(mu, lam, margin, levels=[0.0, np.inf], colors=[GREY], alpha=0.25)
        ax.plot([], [], color=GREY, lw=6, alpha=0.4, label="no uplift once the bob has settled")


def plot_motion(design: Design, axes: Any = None) -> Any:
    """Tilt without the pendulum, tilt with it and bob angle against time from rest, smoothed over exact: on
    three axes, or on one where there is no pendulum."""
    hung = design.pendulum
    if axes is None:
        axes = np.atleast_1d(new_axes(1, (7.0, 2.8)) if hung is None else new_axes(3, (7.0, 6.8)))
    _course(design, None, axes[:1])
    axes[0].set(ylabel="tilt $\\varphi$ (rad)\nwithout pendulum")
    if hung is not None:
        _course(design, hung, axes[1:])
        axes[1].set(ylabel="tilt $\\varphi$ (rad)\nwith pendulum")
        axes[2].axhline(design.space.stroke, color=ORANGE, lw=1.1, ls=":")
        axes[2].axhline(-design.space.stroke, color=ORANGE, lw=1.1, ls=":", label="stroke limit (settled)")
        axes[2].set(ylabel="bob angle $\\psi$ (rad)")
        axes[2].legend(loc="upper right", fontsize=8, frameon=False, ncols=3)
    axes[-1].set(xlabel="time from a start at rest (s)")
    return axes


def _course(design: Design, hung: Pendulum | None, axes: Any) -> None:
    """One motion by both models: its tilt, and its bob angle where there are two axes. With impact loss by
    the exact one alone: the smoothed one has none."""
    p = as_arrays(design.scene.parameters(hung))
    tau = sampled(p)
    t = np.asarray(tau) / design.scene.rate
    models: tuple[tuple[AbstractModel, dict, str], ...] = (
        (Piecewise(), {"color": GREY, "lw": 2.6}, "exact"),
        (Smoothed(), {"color": INK, "lw": 0.9, "ls": (0, (4, 2))}, "smoothed"),
    )
    fallen = 2.0 * design.scene.block.slenderness
    lost = False
    for model, style, label in models[: 2 if design.scene.block.velocity_ratio == 1.0 else 1]:
        ys = np.asarray(simulate(p, jnp.zeros(4), tau, model=model).ys)
        upright = np.cumprod(np.nan_to_num(np.abs(ys[:, 0]), nan=np.inf) < fallen).astype(bool)
        lost |= not upright.all()
        for ax, angle in zip(axes, ys.T[:2], strict=False):
            ax.plot(t, np.where(upright, angle, np.nan), label=label, **style)
    axes[0].axhline(0.0, color=INK, lw=0.4)
    # A line that ends would otherwise leave its end as the end of time.
    axes[0].set_xlim(-0.02 * t[-1], 1.02 * t[-1])
    if lost:
        axes[0].text(0.5, 0.04, "overturns", transform=axes[0].transAxes, ha="center", weight="bold")
    axes[0].legend(loc="upper right", fontsize=8, frameon=False, ncols=2)


def plot_response(design: Design, responses: tuple[Response, ...], ax: Axes | None = None) -> Axes:
    """Settled amplitude from rest against frequency, without and with the pendulum."""
    ax = cast(Axes, new_axes() if ax is None else ax)
    labels = ("bare block", "with the pendulum")
    styles: tuple[dict[str, Any], ...] = ({"color": GREY, "marker": "s"}, {"color": BLUE, "marker": "o"})
    tops = [r.amplitude[np.isin(r.status, SETTLED)] for r in responses]
    top = 1.35 * max([float(x.max()) for x in tops if x.size], default=1.0) or 1.0
    for i, (r, label, style) in enumerate(zip(responses, labels, styles, strict=False)):
        settled = np.isin(r.status, SETTLED)
        ax.plot(r.frequency, np.where(settled, r.amplitude, np.nan), ms=3.5, lw=1.2, label=label, **style)
        lost = r.status == "overturned"
        level = np.full(lost.sum(), top * (1.0 - 0.05 * i))
        ax.plot(
            r.frequency[lost],
            level,
            ls="",
            marker="x" if i else "+",
            ms=5,
            color=style["color"],
            label=f"{label}: overturns",
        )
        other = ~settled & ~lost
        ax.plot(
            r.frequency[other],
            np.minimum(r.amplitude[other], 0.85 * top),
            ls="",
            marker="D",
            mfc="none",
            ms=5,
            color=style["color"],
            label=f"{label}: not settled" if other.any() else None,
        )
    ax.axvline(design.scene.motion.frequency, color=ORANGE, lw=1.0, ls="--", label="design frequency")
    ax.set(xlabel=LABELS["frequency"], ylabel=r"settled amplitude $\Phi$ from rest (rad)")
    ax.set_ylim(-0.03 * top, 1.06 * top)
    ax.legend(fontsize=8, frameon=False)
    return ax


def band(design: Design, points: int = 41) -> np.ndarray:
    """Frequencies (Hz) around that of the design, for `plot_response`."""
    return design.scene.motion.frequency * np.linspace(0.7, 1.5, points)


def pictures(design: Design, responses: tuple[Response, ...]) -> Iterator[tuple[str, bytes]]:
    """(file name, PNG) of every picture of the report."""
    yield "search.png", png(plot_search(design).figure)
    yield "motion.png", png(plot_motion(design)[0].figure)
    if responses:
        yield "response.png", png(plot_response(design, responses).figure)
