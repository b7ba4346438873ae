"""Objective over the motions that are reached from given starts, by any model.

Every start is followed under every condition, and the motion that it settles into is differentiated exactly.
With the nonlinear equations it is the objective of the search after a refusal. With the exact piecewise model
and a seeded set of starts it is the objective over basins of attraction. A start that changes basins makes
the merit jump: the last one finishes a search that closed forms have led near a good design."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array

from tpd.analysis.attractors import Starts
from tpd.analysis.steady_state import answered
from tpd.closed_form import uplift
from tpd.core.batch import in_chunks
from tpd.core.conditions import Conditions, under, under_all
from tpd.core.parameters import Parameters, as_arrays
from tpd.core.status import Status
from tpd.design.objective import (
    NONE,
    REST,
    ROCKING,
    UNSTABLE,
    AbstractObjective,
    Count,
    Evaluation,
    Orbits,
)
from tpd.models.base import AbstractModel, Settled
from tpd.models.batches import settle_all
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed


@dataclass(frozen=True)
class Followed(AbstractObjective):
    """Merits of the motions that `starts` reach by `model`."""

    model: AbstractModel
    starts: Starts
    orbits: Orbits | None = None
    """Closed form that states the reserve, if it is a limit: the reserve of the largest symmetric orbit."""

    @property
    def holds_reserve(self) -> bool:
        """Only the closed form knows the reserve."""
        return self.orbits is not None

    def evaluate(self, designs: np.ndarray, progress: Count | None = None) -> Evaluation:
        """See `AbstractObjective`. A start that overturns counts as two less the uplift margin, whose
        derivative leads out; tilt and stroke are those of the other starts."""
        runs = self._runs(designs, progress)
        merit, merit_slope, tilt, tilt_slope, stroke, stroke_slope, multiplier, kind, margin = runs
        # A start that overturns has no tilt and no stroke; its merit counts all the same.
        gone = kind == NONE
        tallest = np.argmax(np.where(gone, -np.inf, tilt), axis=-1)
        widest = np.argmax(stroke, axis=-1)
        if self.starts.worst:
            leading = np.argmax(merit, axis=-1)
            merit, merit_slope = _pick(merit, leading), _pick(merit_slope, leading)
        else:
            merit, merit_slope = merit.mean(axis=-1), merit_slope.mean(axis=-2)
        multiplier = np.where(gone, -np.inf, multiplier).max(axis=-1)
        # A motion that is followed does not know how far it is from where it stops attracting.
        bound = None if self.orbits is None else self.orbits.evaluate(designs)
        nothing = np.ones_like(merit), np.zeros_like(merit_slope)
        return Evaluation(
            merit=merit,
            merit_slope=merit_slope,
            tilt=_pick(tilt, tallest),
            tilt_slope=_pick(tilt_slope, tallest),
            stroke=_pick(stroke, widest),
            stroke_slope=_pick(stroke_slope, widest),
            margin=margin[..., 0],
            multiplier=np.where(gone.all(axis=-1), np.inf, multiplier),
            reserve=nothing[0] if bound is None else bound.reserve,
            reserve_slope=nothing[1] if bound is None else bound.reserve_slope,
            kind=_pick(kind, tallest),
            root=np.full((*merit.shape, 2), np.nan),
            design=designs,
            lost=gone.mean(axis=-1),
            unsettled=(kind == UNSTABLE).mean(axis=-1),
        )

    def over(self, conditions: Conditions) -> Followed:
        """See `AbstractObjective`; the closed form moves with it."""
        other = super().over(conditions)
        orbits = None if self.orbits is None else self.orbits.over(conditions)
        return replace(other, orbits=orbits)

    def _runs(self, designs: np.ndarray, progress: Count | None) -> tuple:
        """Results of `_differentiated` for every start, leading axes (m, n, starts)."""
        factors = self.conditions.factor_rows()
        m, n, s = len(designs), len(factors), self.starts.size
        p = under_all(self.p, designs, self.conditions)
        every = jax.tree.map(lambda x: np.repeat(np.asarray(x), s), p)
        y0 = np.tile(self.starts.states(float(self.p.nu)), (m * n, 1))
        pairs = np.repeat(designs, n * s, axis=0), np.tile(np.repeat(factors, s, axis=0), (m, 1))
        if isinstance(self.model, Piecewise):
            # Motions by events end after very different numbers of events: a work queue follows them.
            settled = settle_all(every, y0, model=self.model, progress=progress)
            out = in_chunks(_of_settled(self.model), (self.p, *pairs, settled), chunk=_chunk(self.model))
        else:
            batch = self.p, *pairs, y0
            out = in_chunks(_of_start(self.model), batch, chunk=_chunk(self.model), progress=progress)
        return tuple(x.reshape(m, n, s, *x.shape[1:]) for x in out)


def _chunk(model: AbstractModel) -> int:
    """Motions solved at once. A batch of adaptive integrations takes the steps of its slowest member in every
    lane, so few lanes are best; the exact model's period map is a short batch without steps."""
    return 32 if isinstance(model, Piecewise) else 4 if isinstance(model, Smoothed) else 1


@lru_cache(maxsize=8)
def _of_start(model: AbstractModel) -> Callable:
    """`_differentiated` after following one start by a model."""

    def run(args: tuple[Parameters, Array, Array, Array]) -> tuple:
        p, design, factors, y0 = args
        settled = model.settle(as_arrays(under(p, design, factors)), y0)
        return _differentiated(model, p, design, factors, settled)

    return run


@lru_cache(maxsize=8)
def _of_settled(model: AbstractModel) -> Callable:
    """`_differentiated` of a motion that has been followed."""

    def run(args: tuple[Parameters, Array, Array, Settled]) -> tuple:
        p, design, factors, settled = args
        return _differentiated(model, p, design, factors, settled)

    return run


def _differentiated(
    model: AbstractModel, p: Parameters, design: Array, factors: Array, settled: Settled
) -> tuple:
    """Merit, tilt and stroke with their derivatives, multiplier, kind and margin of one followed start."""
    q = as_arrays(under(p, design, factors))
    steady, by_leaf = answered(q, model, settled)
    # Chain rule: derivatives in the parameters come from the model, those of the parameters in the design
    # from the condition.
    slopes = by_leaf[:2] @ jax.jacfwd(partial(_leaves, p, factors))(design)
    lift, lift_slope = jax.value_and_grad(lambda x: jnp.asarray(uplift(under(p, x, factors)).margin))(design)
    status = steady.status
    rocks = (status == Status.rocking) | (status == Status.sticking)
    rests, lost = status == Status.rest, (status == Status.overturned) | (status == Status.failed)
    kind = jnp.where(rests, REST, jnp.where(lost, NONE, jnp.where(rocks, ROCKING, UNSTABLE)))
    tilt = jnp.where(lost, jnp.inf, steady.amplitude / q.nu)
    finite = jnp.where(jnp.isfinite(slopes), slopes, 0.0)
    tilt_slope = jnp.where(rocks, finite[0], 0.0) / q.nu
    stroke = jnp.where(lost, 0.0, steady.stroke)
    stroke_slope = jnp.where(rocks | rests, finite[1], 0.0)
    # The same scale as for orbits, so that an answer can be compared across objectives.
    merit = jnp.where(lost, 2.0 - lift, jnp.where(rests, -lift, tilt))
    merit_slope = jnp.where(lost | rests, -lift_slope, tilt_slope)
    multiplier = jnp.where(rocks, steady.multiplier, jnp.where(rests, 0.0, jnp.inf))
    return merit, merit_slope, tilt, tilt_slope, stroke, stroke_slope, multiplier, kind, lift


def _leaves(p: Parameters, factors: Array, design: Array) -> Array:
    """Leaves of the parameters under a condition, in the order of the slopes."""
    return ravel_pytree(as_arrays(under(p, design, factors)))[0]


def _pick(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Elements (m, n, ...) of values (m, n, s, ...) at the starts `which` (m, n)."""
    index = which.reshape(*which.shape, *(1,) * (values.ndim - which.ndim))
    return np.take_along_axis(values, index, axis=2)[:, :, 0]
