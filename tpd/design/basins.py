"""The tilts of the motions that a seeded set of starts really reaches, whatever these motions are.

The symmetric orbits of `Objective` bound what may be settled into and know nothing of how much of the
state space leads where, nor of motions that are asymmetric, stick or take several periods. Here every start
is followed by events under every condition, and what it settles into is differentiated exactly. That costs
a thousand times as much, and a start that changes sides makes a leap: so it finishes a search that the
orbits have led near a good design.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array

from tpd.analysis.attractors import Starts
from tpd.analysis.steady_state import answered
from tpd.analysis.work_queue import settle_all
from tpd.closed_form.no_uplift import uplift
from tpd.core.batch import in_chunks
from tpd.core.conditions import under, under_all
from tpd.core.parameters import Parameters, as_arrays
from tpd.core.status import Status
from tpd.design.objective import KINDS, Objective, Told
from tpd.models.base import Settled
from tpd.models.piecewise import Piecewise

_ROCKING, _REST, _UNSTABLE, _NONE = (KINDS.index(k) for k in ("rocking", "rest", "unstable", "no_orbit"))


@dataclass(frozen=True, kw_only=True)
class ReachedObjective(Objective):
    """An `Objective` over the motions that the starts reach. Tilt, stroke and merit are of these; how far
    an orbit is from where it stops attracting is still that of the largest symmetric one."""

    starts: Starts
    by_share: bool
    """Whether the merit under a condition is the mean over the starts, every motion weighted by the share
    that reaches it, rather than that of the worst start."""
    periods: int
    """Most forcing periods that a start is followed."""

    def told(self, designs: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Told:
        """Designs (mu, lam, zeta), shape (m, 3), under all conditions. A start that overturns counts as two
        less the uplift margin, whose slope leads out; its tilt and stroke do not."""
        bound = super().told(designs)
        runs = self._runs(designs, progress)
        merit, merit_slope, tilt, tilt_slope, stroke, stroke_slope, multiplier, kind = runs
        gone = kind == _NONE
        worst = np.argmax(np.where(gone, -np.inf, merit), axis=-1)
        if self.by_share:
            merit, merit_slope = merit.mean(axis=-1), merit_slope.mean(axis=-2)
        else:
            leading = np.argmax(merit, axis=-1)
            merit, merit_slope = _pick(merit, leading), _pick(merit_slope, leading)
        widest = np.argmax(stroke, axis=-1)
        multiplier = np.where(gone, -np.inf, multiplier).max(axis=-1)
        return bound._replace(
            merit=merit,
            merit_slope=merit_slope,
            tilt=_pick(tilt, worst),
            tilt_slope=_pick(tilt_slope, worst),
            stroke=_pick(stroke, widest),
            stroke_slope=_pick(stroke_slope, widest),
            multiplier=np.where(gone.all(axis=-1), np.inf, multiplier),
            kind=_pick(kind, worst),
            lost=gone.mean(axis=-1),
            loose=(kind == _UNSTABLE).mean(axis=-1),
        )

    def elasticities(self, told: Told, design: np.ndarray) -> dict[str, float]:
        """d ln(value)/d ln(x) of mass, length and damping ratio, as long as every start reaches the motion
        that it does: from the slopes of the merits, weighted as the measure does. None where a motion that
        counts has no slope."""
        value, n = float(self.value(told)[0]), len(self.conditions)
        left, weights = 1.0, np.zeros(n)
        for i in np.argsort(-told.merit[0], kind="stable"):
            weights[i] = min(self.measure.cap(n), left)
            left -= weights[i]
        if np.any(np.broadcast_to(told.loose, told.kind.shape)[0][weights > 0.0]):
            return {}
        slopes = weights @ told.merit_slope[0]
        return {
            name: float(slope * x / abs(value))
            for name, slope, x in zip(("mass", "length", "damping"), slopes, design, strict=True)
        }

    def _runs(self, designs: np.ndarray, progress: Callable[[int, int], None] | None) -> tuple:
        """Everything of every start, leading axes (m, n, starts)."""
        factors = np.asarray(self.conditions.rows())
        m, n, s = len(designs), len(factors), self.starts.size
        p = under_all(self.p, jnp.asarray(designs), self.conditions)
        every = jax.tree.map(lambda x: np.repeat(np.asarray(x), s), p)
        y0 = np.tile(self.starts.states(float(self.p.nu)), (m * n, 1))
        settled = settle_all(every, y0, model=Piecewise(max_periods=self.periods), progress=progress)
        cells = np.repeat(designs, n * s, axis=0), np.tile(np.repeat(factors, s, axis=0), (m, 1))
        out = in_chunks(_one, (self.p, *cells, settled))
        return tuple(x.reshape(m, n, s, *x.shape[1:]) for x in out)


def _pick(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Of (m, n, s, ...) those of the start `which`, (m, n, ...)."""
    index = which.reshape(*which.shape, *(1,) * (values.ndim - which.ndim))
    return np.take_along_axis(values, index, axis=2)[:, :, 0]


def _one(args: tuple[Parameters, Array, Array, Settled]) -> tuple:
    """Of one start that was followed: merit, tilt and stroke with their slopes, multiplier and kind."""
    p, design, factors, settled = args
    there = partial(_flat, p, factors)
    q = as_arrays(under(p, design, factors))
    steady, by_leaf = answered(q, Piecewise(lyapunov_periods=0), settled)
    slopes = by_leaf[:2] @ jax.jacfwd(there)(design)
    lift, lift_slope = jax.value_and_grad(lambda x: jnp.asarray(uplift(under(p, x, factors)).margin))(design)
    status = steady.status
    rocks = (status == Status.rocking) | (status == Status.sticking)
    rests, lost = status == Status.rest, (status == Status.overturned) | (status == Status.failed)
    kind = jnp.where(rests, _REST, jnp.where(lost, _NONE, jnp.where(rocks, _ROCKING, _UNSTABLE)))
    tilt = jnp.where(lost, jnp.inf, steady.amplitude / q.nu)
    sound = jnp.where(jnp.isfinite(slopes), slopes, 0.0) * rocks
    stroke = jnp.where(lost, 0.0, steady.stroke)
    stroke_slope = jnp.where(rests, jnp.where(jnp.isfinite(slopes[1]), slopes[1], 0.0), sound[1])
    merit = jnp.where(lost, 2.0 - lift, jnp.where(rests, -lift, tilt))
    merit_slope = jnp.where(lost | rests, -lift_slope, sound[0] / q.nu)
    multiplier = jnp.where(rocks, steady.multiplier, jnp.where(rests, 0.0, jnp.inf))
    return merit, merit_slope, tilt, sound[0] / q.nu, stroke, stroke_slope, multiplier, kind


def _flat(p: Parameters, factors: Array, design: Array) -> Array:
    """The leaves of the parameters under a condition, in the order of the slopes."""
    return ravel_pytree(as_arrays(under(p, design, factors)))[0]
