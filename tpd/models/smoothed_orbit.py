"""Steady state of a smoothed model in JAX: following, Newton's method on the period map, and the verdict.

`tpd.compiled.repetition`, `period_map` and `steady` have the same rules for the exact motions, and explain
them. A smoothed motion has neither events nor contact modes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from tpd.compiled.columns import (
    AT_REST,
    FAILED,
    LAST_STEP,
    NEWTON_STEPS,
    OVERTURNED,
    ROCKING,
    SWING,
    SYMMETRIC,
    TILT,
    WIDTH,
    is_neutral,
    verdict,
)
from tpd.compiled.simulate import Run, SteadyNumbers
from tpd.models.base import scale_of
from tpd.scene.parameters import Parameters, from_row
from tpd.scene.pytrees import State
from tpd.scene.status import NOT_ATTRACTING, SETTLED, UNANSWERED, Status, code_of, is_one_of

INEXACT = 0.05
"""Relative error of a smoothed amplitude above which the status is `inexact`."""
LONGEST = 8
"""Longest period, in forcing periods, that is recognised as a repetition."""
_EXACT = 1e-3
"""Largest change in a period for which its decay does not matter, as a share of the tolerance."""

Sizes = Float[Array, "2"]
"""Largest |phi| and |psi|, rad."""


class Cycle(NamedTuple):
    """Settled periods of a motion. All numbers can be differentiated in forward mode."""

    end: State
    """State at the end."""
    sizes: Sizes
    asymmetry: Any
    """Difference between the largest tilts to the two sides, divided by the amplitude."""


class History(NamedTuple):
    """The forcing periods of a motion so far."""

    states: Float[Array, "8 4"]
    """States at the ends of the last periods, the newest first; infinite where there are fewer periods."""
    sizes: Float[Array, "8 2"]
    """Largest |phi| and |psi| of these periods, rad."""
    peaks: Sizes
    """Largest |phi| and |psi| so far, rad."""
    repeats: Int[Array, ""]
    """Number of periods after which the motion repeats; 0 if it does not repeat."""
    elapsed: Int[Array, ""]
    """Number of periods so far."""
    overturned: Bool[Array, ""]
    bounded: Bool[Array, ""]
    """Whether the solver kept its limit on steps."""

    def add(self, period: tuple, scale: Float[Array, "4"], tolerance: float) -> History:
        """Return the history with one more period, which is its end, its sizes and the last two fields."""
        y, sizes, overturned, bounded = period
        # The new state is compared with the states after the last few periods: a motion of period n repeats
        # the n-th of them. States are compared, and not amplitudes, because two different motions may have
        # the same amplitude.
        distances = lambda y, states: jnp.max(jnp.abs(y[None] - states) / scale[None], axis=1)  # noqa: E731
        errors, before = distances(y, self.states), distances(self.states[0], self.states[1:])
        # The sum of all further changes must be small as well, see `tpd.compiled.repetition`.
        falls = jnp.append(jnp.where(jnp.isfinite(before), before, 0.0), 0.0) - errors
        close = (errors < tolerance) & ((errors < _EXACT * tolerance) | (errors**2 < tolerance * falls))
        # A transient that alternates and converges to a motion of period one repeats after two periods sooner
        # than after one. Once one error is below the tolerance, the shortest period with a similarly small
        # error is therefore selected.
        repeats = jnp.where(jnp.any(close), jnp.argmax(errors < 100.0 * tolerance) + 1, 0)
        # After an early end the state may be unchanged, which is not a repetition.
        repeats = jnp.where(bounded, repeats, 0)
        states, every = (
            jnp.concatenate([new[None], old[:-1]]) for new, old in ((y, self.states), (sizes, self.sizes))
        )
        peaks = jnp.maximum(self.peaks, sizes)
        return History(states, every, peaks, repeats, self.elapsed + 1, overturned, bounded)

    def run(self) -> Run:
        """Return the settled motion with its status."""
        periods, y = jnp.maximum(self.repeats, 1), self.states[0]
        # Only the periods of the repeating motion itself count. Earlier periods belong to the transient.
        counted = (jnp.arange(LONGEST) < periods) | (self.repeats == 0)
        settled = jnp.max(jnp.where(counted[:, None], self.sizes, 0.0), axis=0)
        # Later lines overrule earlier ones.
        moving = Status.where(settled[TILT] == 0.0, Status.rest, Status.rocking)
        status = Status.where(self.repeats > 0, moving, Status.not_settled)
        status = Status.where(self.bounded, status, Status.event_bound)
        status = Status.where(self.overturned, Status.overturned, status)
        status = Status.where(jnp.all(jnp.isfinite(y)), status, Status.failed)
        (tilt, swing), (settled_tilt, settled_swing) = jnp.where(
            self.overturned, jnp.inf, jnp.stack([self.peaks, settled])
        )
        # The sum of tilt and swing is an upper bound of the rod angle.
        rods = tilt + swing, settled_tilt + settled_swing
        return Run(tilt, settled_tilt, swing, settled_swing, *rods, y, status, periods, self.elapsed)


def settle(
    one_period: Callable[[State], tuple],
    p: Parameters,
    y0: State,
    *,
    tolerance: float,
    max_periods: int,
) -> Run:
    """Run `one_period` repeatedly, as a traced loop, until the outcome of the motion is known.

    The loop ends if the state repeats after 1 to `LONGEST` periods within `tolerance` times its scale, if the
    block overturns, or after `max_periods` periods. `one_period` is a function of the state, and returns what
    `History.add` takes.
    """
    scale, no = scale_of(p), jnp.zeros((), bool)
    states, zero = jnp.full((LONGEST, 4), jnp.inf).at[0].set(y0), jnp.zeros((), int)
    first = History(states, jnp.zeros((LONGEST, 2)), jnp.abs(y0[:2]), zero, zero, no, ~no)

    def goes_on(h: History) -> Bool[Array, ""]:
        return (h.repeats == 0) & ~h.overturned & h.bounded & (h.elapsed < max_periods)

    def step(h: History) -> History:
        return h.add(one_period(h.states[0]), scale, tolerance)

    return jax.lax.while_loop(goes_on, step, first).run()


class Orbit(NamedTuple):
    """Approximation of a periodic orbit, with the derivatives of one run along it."""

    y: Any
    """State at the beginning."""
    residual: Any
    """Largest difference between end and beginning, relative to the scale of the state."""
    end: Any
    """State at the end."""
    sizes: Any
    """Amplitude and swing, rad."""
    by_parameter: Any
    """Derivative d(end, sizes)/dp at a fixed initial state, shape (6, n)."""
    by_state: Any
    """Derivative d(end, sizes)/dy at fixed parameters, shape (6, 4)."""
    asymmetry: Any
    """See `Cycle.asymmetry`."""
    step: Any
    """Newton step from the beginning; zero if it does not exist."""
    longest: Any
    """Largest component of the Newton step, relative to the scale of the state."""


def refine(p: Parameters, model: Any, reached: Run, code: Any) -> Orbit:
    """Solve for the periodic orbit near the motion that following has reached.

    `tpd.compiled.period_map` explains the method. One run in forward mode gives the period map P and its
    derivative DP, hence the Newton step and the Floquet multipliers, and together with dP/dp the derivative
    of the orbit.

    Args:
        p: dimensionless parameters.
        model: smoothed model of the motion.
        reached: motion that following has reached.
        code: number of its status.
    """
    run = _linearised(p, model, reached.periods)
    # A motion that overturns or does not repeat has no orbit to solve for.
    has_orbit = (code == ROCKING) | (code == AT_REST)

    def goes_on(w: tuple[State, Orbit, Any]) -> Any:
        _, best, steps = w
        return has_orbit & (steps < NEWTON_STEPS) & (best.residual > model.round_off)

    def step(w: tuple[State, Orbit, Any]) -> tuple[State, Orbit, Any]:
        y, best, steps = w
        orbit = run(y)
        better = orbit.residual < best.residual
        # A step that increases the error is halved, unless it was tiny. Then the iteration ends.
        again = ~better & jnp.isfinite(best.residual) & (best.longest > LAST_STEP)
        onward = jnp.where(again, 0.5 * (y + best.y), y + orbit.step)
        steps = jnp.where(better | again, steps + 1, NEWTON_STEPS)
        return onward, _where(better, orbit, best), steps

    # Before the first run the error is infinite, so every run is better.
    infinite, sizes = jnp.full((), jnp.inf), jnp.stack([reached.settled_tilt, reached.settled_swing])
    slopes = jnp.full((6, WIDTH), jnp.inf), jnp.full((6, 4), jnp.inf)
    none = Orbit(
        reached.state, infinite, jnp.full(4, jnp.inf), sizes, *slopes, infinite, jnp.zeros(4), infinite
    )
    return jax.lax.while_loop(goes_on, step, (reached.state, none, jnp.zeros((), int)))[1]


def _where(condition: Any, a: Any, b: Any) -> Any:
    """Select one of two pytrees of numbers."""
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)


def _linearised(p: Parameters, model: Any, periods: Any) -> Callable[[State], Orbit]:
    """Return a function that runs the periods of a motion from a state, with all derivatives (traced)."""
    flat, unflatten = ravel_pytree(p)
    # The angle and the rate of the bob count for the residual if the block feels them, or if they decay.
    size, scale = flat.size, scale_of(p, bob=jnp.asarray((p.mu > 0) | (p.zeta > 0)))

    def run(x: Float[Array, "n"]) -> tuple[Float[Array, "6"], Any]:
        cycle = model.cycle(unflatten(x[:size]), periods, x[size:])
        return jnp.concatenate([cycle.end, cycle.sizes]), cycle.asymmetry

    def along(y: State) -> Orbit:
        x = jnp.concatenate([flat, y])

        def push(direction: Float[Array, "n"]) -> tuple[Array, Array, Any]:
            return jax.jvp(run, (x,), (direction,), has_aux=True)

        # One forward pass for each parameter and each component of the state, all in one batch.
        out, columns, asymmetry = jax.vmap(push, out_axes=(None, 1, None))(jnp.eye(x.size))
        residual = jnp.max(jnp.abs(out[:4] - y) / scale)
        by_parameter, by_state = columns[:, :size], columns[:, size:]
        step = jnp.linalg.solve(jnp.eye(4) - by_state[:4], out[:4] - y)
        # If I - DP is singular, there is no step, and the next run begins at the same state.
        step = jnp.where(jnp.all(jnp.isfinite(step)), step, 0.0)
        longest = jnp.max(jnp.abs(step) / scale)
        return Orbit(y, residual, out[:4], out[4:], by_parameter, by_state, asymmetry, step, longest)

    return along


def multipliers(mu: Any, jacobian: Any) -> tuple[Any, Any]:
    """Return the largest modulus of the Floquet multipliers, and the smallest distance of one from +1.

    For mu = 0 only the multipliers of the block count.
    """
    # A bob without mass (mu = 0) does not act on the block. If its rows and columns are zero, the eigenvalues
    # are the multipliers of the block and two zeros.
    bob = jnp.where(mu > 0.0, 1.0, 0.0)
    feels = jnp.stack([1.0 + 0.0 * bob, bob, 1.0 + 0.0 * bob, bob])
    felt = jacobian * (feels[:, None] * feels[None])
    # `eigvals` must not receive infinite numbers. The modulus is then infinite.
    finite = jnp.all(jnp.isfinite(felt))
    values = jnp.linalg.eigvals(_where(finite, felt, jnp.zeros((4, 4))))
    return _where(finite, jnp.max(jnp.abs(values)), jnp.inf), jnp.min(jnp.abs(1.0 - values))


def implicit(orbit: Orbit) -> tuple[Any, Any]:
    """Return (amplitude, swing) after one more Newton step, and the derivatives of the orbit.

    The derivatives are those of (amplitude, swing, state) with respect to the parameters, shape (6, n).
    """
    # The implicit function theorem, see `tpd.compiled.steady`. At a fold the caller replaces the slopes by
    # NaN.
    right = jnp.concatenate([(orbit.end - orbit.y)[:, None], orbit.by_parameter[:4]], axis=1)
    follow = jnp.linalg.solve(jnp.eye(4) - orbit.by_state[:4], right)
    moves = orbit.by_state[4:] @ follow
    slopes = jnp.concatenate([orbit.by_parameter[4:] + moves[:, 1:], follow[:, 1:]])
    return orbit.sizes + moves[:, 0], slopes


@eqx.filter_jit
def solve_steady(x: Float[Array, "14"], model: Any) -> tuple[SteadyNumbers, Float[Array, "6 10"]]:
    """Return the answer of a smoothed model, compared with the exact motion, and its slopes.

    `x` has the ten parameters and the initial state. The slopes are those of amplitude, swing and state with
    respect to the parameters. Slopes that do not exist are NaN.
    """
    sane = jnp.all(jnp.isfinite(x))
    # With NaN a solver would continue until its limit on steps. Harmless numbers replace such inputs, and the
    # status is set to failed.
    p, y0 = from_row(jnp.where(sane, x[:WIDTH], 1.0)), jnp.where(sane, x[WIDTH:], 0.0)
    run = model.settle(p, y0)
    answer, slopes = _evaluate(p, model, run._replace(status=Status.where(sane, run.status, Status.failed)))
    return _compare(answer, model.settle_exactly(p, y0)), slopes


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


def _evaluate(p: Parameters, model: Any, reached: Run) -> tuple[SteadyNumbers, Array]:
    """Return the answer for the motion that following has reached, and the slopes of its sizes and state."""
    code = code_of(reached.status)
    orbit = refine(p, model, reached, code)
    multiplier, to_fold = multipliers(p.mu, orbit.by_state[:4])
    neutral = is_neutral(p.k, p.velocity_ratio, p.mu, p.zeta, multiplier)
    small = orbit.sizes[TILT] < model.resolution(p)
    rest = neutral, small, p.zeta > 0.0, jnp.all(jnp.isfinite(orbit.y))
    # No event of a smoothed motion grazes.
    status = verdict(code, orbit.residual, multiplier, to_fold, jnp.inf, *rest)
    sizes, slopes = _sizes_of(p, reached, orbit, status, multiplier)
    periodic = is_one_of(status, *SETTLED, Status.unstable, Status.neutral)
    lyapunov = jnp.where(periodic, jnp.log(multiplier) / (reached.periods.astype(float) * p.period), jnp.nan)
    # The mirror image is half a period later, which is a whole number of half forcing periods only if the
    # number of periods is odd.
    symmetric = periodic & (reached.periods % 2 == 1) & (orbit.asymmetry < SYMMETRIC)
    has_orbit = periodic | is_one_of(status, Status.near_fold)
    multiplier = jnp.where(has_orbit, multiplier, jnp.nan)
    rest = status, reached.periods, multiplier, symmetric, lyapunov, orbit.y, reached.elapsed
    amplitude, swing = sizes
    return SteadyNumbers(amplitude, swing, *rest), slopes


def _sizes_of(p: Any, reached: Run, orbit: Orbit, status: Any, multiplier: Any) -> tuple[Any, Any]:
    """Return (amplitude, swing), and the slopes of these and of the state where they exist."""
    rests = status == AT_REST
    # An undamped bob under a block at rest swings for ever and is on no orbit, but its swing is known.
    undamped = rests & (p.zeta == 0.0)
    isolated = ((status == ROCKING) | rests) & (multiplier < 1.0) & jnp.logical_not(undamped)
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
    slopes = slopes.at[TILT].set(jnp.where(rests, 0.0, slopes[TILT]))
    slopes = slopes.at[SWING].set(jnp.where(bob_rests, jnp.nan, slopes[SWING]))
    return jnp.stack([jnp.where(rests, 0.0, sizes[TILT]), sizes[SWING]]), slopes
