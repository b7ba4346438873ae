"""Models that are JAX programs, and their steady states: orbit, verdict and derivatives."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from tpd.compiled.columns import (
    AT_REST,
    FAILED,
    HELD,
    OVERTURNED,
    SWING,
    SYMMETRIC,
    TILT,
    WIDTH,
    is_neutral,
    verdict_with,
)
from tpd.compiled.simulate import Run, SteadyNumbers
from tpd.models.base import AbstractModel
from tpd.models.period_map import Orbit, implicit, is_rocking, multipliers, refine
from tpd.scene.parameters import Parameters, from_row
from tpd.scene.pytrees import Number, State
from tpd.scene.status import NOT_ATTRACTING, SETTLED, UNANSWERED, Status, code_of, is_one_of

INEXACT = 0.05
"""Relative error of a smoothed amplitude above which the status is `inexact`."""


class Cycle(eqx.Module):
    """Period of a motion. All numbers can be differentiated in forward mode."""

    end: State
    """State at the end of the period."""
    amplitude: Number
    """Largest |phi| of the period, rad."""
    swing: Number
    """Largest |psi| of the period, rad."""
    memory: Any
    """Discrete state at the end of the period, see `Run.memory`."""
    transversality: Number
    """Smallest rate at which the motion crosses an event, divided by the usual rate. It is 0 if the motion
    grazes an event, and infinite for a model without events."""
    asymmetry: Number
    """Difference between the largest tilts to the two sides, divided by the amplitude."""
    closed: Bool[Array, ""]
    """Whether the discrete mode at the end equals the mode at the beginning. Always true for a model without
    modes."""


class AbstractFlow(AbstractModel):
    """A model whose motions are followed and differentiated by JAX programs.

    `tpd.models.settling` decides when such a motion has settled, and `tpd.models.period_map` computes its
    periodic orbit and the derivatives of the orbit.
    """

    @property
    @abstractmethod
    def round_off(self) -> float:
        """Residual of the period map, relative to the scale of the state, that is due to rounding."""

    @abstractmethod
    def resolution(self, p: Parameters) -> Number:
        """Return the largest |phi| (rad) that the model cannot distinguish from rest."""

    def settle_exactly(self, p: Parameters, y0: State) -> Run | None:
        """Return the motion that the same equations without smoothing reach from `y0`.

        The result is None if the model smooths nothing, or if its equations can be solved only with
        smoothing. It is not differentiated.
        """
        # This is the answer of a model that smooths nothing. `Smoothed` overrides it.
        del p, y0
        return None

    def solve_steady(self, x: Any, slopes: int) -> tuple[SteadyNumbers, Any]:
        """Return the steady state and the slopes (6, 10) of amplitude, swing and state."""
        # Both are one JAX program, and Newton's method needs most of the derivatives in any case.
        del slopes
        return _solve_steady(x[:WIDTH], self, x[WIDTH:])

    @abstractmethod
    def cycle(self, p: Parameters, settled: Run, y: State) -> Cycle:
        """Follow `settled.periods` forcing periods from the state `y` at tau = 0."""


@eqx.filter_jit
def _solve_steady(
    x: Float[Array, "10"], model: AbstractFlow, y0: State
) -> tuple[SteadyNumbers, Float[Array, "6 10"]]:
    """Return the answer of a model and the slopes of amplitude, swing and state, as a traced function.

    Slopes that do not exist are NaN.
    """
    sane = jnp.all(jnp.isfinite(x)) & jnp.all(jnp.isfinite(y0))
    # With NaN a solver would continue until its limit on steps. Harmless numbers replace such inputs, and the
    # status is set to failed.
    fixed = from_row(jnp.where(sane, x, 1.0))
    run = model.settle(fixed, jnp.where(sane, y0, 0.0))
    run = run._replace(status=Status.where(sane, run.status, Status.failed))
    answer, slopes = _evaluate(fixed, model, run)
    return _compare(answer, model.settle_exactly(fixed, jnp.where(sane, y0, 0.0))), slopes


def _compare(answer: SteadyNumbers, exact: Run | None) -> SteadyNumbers:
    """Return the answer of a smoothed model with its difference from the exact motion."""
    if exact is None:
        return answer
    code = code_of(exact.status)
    amplitude = jnp.where(code == code_of(Status.overturned), jnp.inf, exact.settled_tilt)
    # The difference is zero if both motions rest or both overturn, and infinite if only one does.
    error = jnp.where(answer.amplitude == amplitude, 0.0, jnp.abs(answer.amplitude / amplitude - 1.0))
    is_answered = jnp.logical_not(is_one_of(code, Status.not_settled, *UNANSWERED))
    is_settled = is_one_of(answer.status, *SETTLED, Status.overturned)
    status = jnp.where(is_settled & is_answered & (error > INEXACT), code_of(Status.inexact), answer.status)
    return answer._replace(status=status, estimate=jnp.where(is_answered, error, jnp.nan))


_verdict = verdict_with(jnp.where)
"""The verdict on a steady state in JAX programs."""


def _evaluate(p: Parameters, model: AbstractFlow, reached: Run) -> tuple[SteadyNumbers, Array]:
    """Return the answer for the motion that following has reached, and the slopes of its sizes and state.

    The slopes are those of amplitude, swing and state with respect to the parameters. Slopes that do not
    exist are NaN.
    """
    code = code_of(reached.status)
    orbit = refine(p, model, reached, code)
    multiplier, to_fold = multipliers(p.mu, orbit.by_state[:4])
    neutral = is_neutral(p.k, p.velocity_ratio, p.mu, p.zeta, multiplier)
    # The method of the class is called for speed, as for the check of the parameters.
    small = orbit.sizes[TILT] < model.__class__.resolution(model, p)
    size = multiplier, to_fold, orbit.transversality
    status = _verdict(
        code, orbit.residual, *size, neutral, small, p.zeta > 0.0, jnp.all(jnp.isfinite(orbit.y))
    )
    # If friction holds a tilted block, it also holds the block at neighbouring tilts: the multiplier is 1.
    multiplier = jnp.where(status == HELD, 1.0, multiplier)
    sizes, slopes = _sizes_of(p, reached, orbit, status, multiplier)
    periodic = is_one_of(status, *SETTLED, Status.unstable, Status.neutral)
    lyapunov = jnp.where(periodic, jnp.log(multiplier) / (reached.periods.astype(float) * p.period), jnp.nan)
    # The mirror image is half a period later, which is a whole number of half forcing periods only if the
    # number of periods is odd.
    symmetric = periodic & (reached.periods % 2 == 1) & (orbit.asymmetry < SYMMETRIC)
    has_orbit = periodic | is_one_of(status, Status.held, Status.near_fold, Status.grazing)
    multiplier = jnp.where(has_orbit, multiplier, jnp.nan)
    rest = status, reached.periods, multiplier, symmetric, lyapunov, orbit.y, reached.elapsed
    amplitude, swing = sizes
    return SteadyNumbers(amplitude, swing, *rest), slopes


def _sizes_of(p: Any, reached: Run, orbit: Orbit, status: Any, multiplier: Any) -> tuple[Any, Any]:
    """Return (amplitude, swing), and the slopes of these and of the state where they exist."""
    rests = status == AT_REST
    # An undamped bob under a block at rest swings for ever and is on no orbit, but its swing is known.
    undamped = rests & (p.zeta == 0.0)
    isolated = (is_rocking(status) | rests) & (multiplier < 1.0) & jnp.logical_not(undamped)
    # On an isolated orbit one more Newton step improves the sizes. Elsewhere I - DP may be singular, and the
    # sizes are those of the orbit before this step.
    last = jnp.stack([reached.settled_tilt, reached.settled_swing])
    last = jnp.where(status == FAILED, jnp.nan, last)
    sizes, slopes = implicit(orbit)
    last = jnp.where(is_one_of(status, *NOT_ATTRACTING), orbit.sizes, last)
    last = jnp.where(status == OVERTURNED, jnp.inf, last)
    sizes, slopes = jnp.where(isolated, sizes, last), jnp.where(isolated, slopes, jnp.nan)
    # The amplitude of a block at rest is zero for all neighbouring parameters, so its slopes are zero.
    # The swing of a bob at rest has no slope, because |psi| has a corner there.
    bob_rests = rests & (sizes[SWING] == 0.0)
    amplitude = jnp.where(rests, 0.0, sizes[TILT])
    slopes = slopes.at[TILT].set(jnp.where(rests, 0.0, slopes[TILT]))
    return jnp.stack([amplitude, sizes[SWING]]), slopes.at[SWING].set(
        jnp.where(bob_rests, jnp.nan, slopes[SWING])
    )
