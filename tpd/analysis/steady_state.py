"""Steady states and trajectories, for every model alike, and their exact derivatives.

A settled motion is a fixed point y* of the period map P. Newton's method on P finishes what
following began, and the implicit function theorem gives dy*/dp = (I - DP)^-1 dP/dp, so a gradient
costs a few periods however long the transient was. With nine parameters and four states against
two answers over many steps, forward mode along those periods is the cheap one; what comes out is
linear in the direction, hence usable in forward and in reverse mode. Where a multiplier reaches the
unit circle it does not exist.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jax.lax import stop_gradient
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from tpd.analysis.period_map import RESIDUAL, Orbit, implicit, multipliers, refine
from tpd.core import checks
from tpd.core.eigenvalues import is_neutral
from tpd.core.formatting import counted_periods, number
from tpd.core.orbit_terms import GRAZING, NEAR_FOLD
from tpd.core.parameters import Number, Parameters, State, as_arrays, check_parameters
from tpd.core.status import Status, is_moving, is_settled, status_name
from tpd.exact.derivatives import refused, refused_in, with_slopes
from tpd.models.base import AbstractChoice, AbstractModel, Settled
from tpd.models.piecewise import Piecewise

_SYMMETRIC = 1e-6
"""Largest difference between the tilts to either side, over the amplitude, of a symmetric motion."""
_APERIODIC = 5e-3
"""Lyapunov exponent, per unit tau, above which a motion that did not repeat is called aperiodic."""


class Steady(eqx.Module):
    """A steady state; angles in rad.

    `amplitude` is the largest |phi| and `stroke` the largest |psi| over the settled period(s). They and
    `state` are differentiable in every parameter when `status` is rocking, sticking or rest; elsewhere
    their derivative is NaN and `status` says why. Stroke and state of a bob under a resting block have
    none either if zeta = 0: the bob rings for ever, and its reach depends on how the block came to rest.
    Nor has the stroke of a bob that hangs still, being at the corner of |psi|. The derivatives of
    `multiplier`, `lyapunov` and `estimate` are always NaN, and so are all second ones. At mu = 0 the stroke
    is that of a bob too light to be felt. An overturned block has infinite amplitude and stroke.
    """

    amplitude: Number
    stroke: Number
    status: Status
    periods: Int[Array, "..."]
    """Forcing periods in one period of the motion."""
    multiplier: Number
    """Largest modulus of the Floquet multipliers; below 1 the motion attracts. NaN of a motion that is
    not periodic."""
    symmetric: Bool[Array, "..."]
    """Whether the motion is its own mirror image half a period of it later."""
    lyapunov: Number
    """Rate, per unit tau, at which neighbouring motions separate (negative: approach). Of a periodic
    motion exact; of one that does not repeat an estimate; NaN where neither applies."""
    state: Float[Array, "... 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the forcing period."""
    elapsed: Int[Array, "..."]
    """Forcing periods followed before the repetition was recognised."""
    estimate: Number = math.nan
    """Estimated relative error of the amplitude, if `Auto` chose the model."""
    model: str = eqx.field(static=True, default="")
    """The model that `Auto` chose."""
    reason: str = eqx.field(static=True, default="")
    """Why, in a sentence."""

    def __str__(self) -> str:
        if not (checks.is_concrete(self.amplitude) and jnp.ndim(self.amplitude) == 0):
            # Batched and traced answers have no single status.
            return repr(self)
        lines = [
            f"{status_name(self.status)}: {Status[self.status]}",
            f"  amplitude    {self.amplitude:.6g} rad",
            f"  stroke       {self.stroke:.6g} rad",
            f"  multiplier   {number(float(self.multiplier))}",
            f"  repeats      after {counted_periods(int(self.periods))}",
        ]
        chosen = f"  model        {self.model}, estimated error {self.estimate:.2g}: {self.reason}"
        return "\n".join([*lines, chosen] if self.model else lines)


class Trajectory(eqx.Module):
    """States over dimensionless time: `ys` has shape (times, 4), order phi, psi, phi', psi'."""

    times: Float[Array, "times"]
    ys: Float[Array, "times 4"]
    status: Status


@lru_cache(maxsize=1)
def at_rest() -> State:
    """The default start: block and bob at rest, at tau = 0."""
    # Made once, and as a number also where it is first asked for under a trace.
    with jax.ensure_compile_time_eval():
        return jnp.zeros(4)


@lru_cache(maxsize=1)
def _default() -> Piecewise:
    """Default model: to make one, and check it, takes a third of the time of a call."""
    return Piecewise()


def steady_state(
    p: Parameters,
    *,
    model: AbstractModel | AbstractChoice | None = None,
    y0: ArrayLike | None = None,
    throw: bool = False,
) -> Steady:
    """The motion that the block settles into from a stated start.

    Args:
        p: dimensionless parameters; gradients with respect to them are exact.
        model: `Piecewise()`, the exact solution of the linear equations (default), `Smoothed()`,
            `Segmented()`, or `Auto()`, which chooses.
        y0: start (phi, psi, phi', psi') in rad and rad per unit tau, at tau = 0; default at rest.
        throw: raise an error where the status is not rocking, sticking or rest.

    Raises:
        ValueError: bad input, or a parameter that the model has no term for.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    model = _default() if model is None else model
    check_parameters(p)
    checks.instance("model", model, (AbstractModel, AbstractChoice))
    checks.flag("throw", throw)
    start = at_rest() if y0 is None else _state(y0)
    if isinstance(model, AbstractChoice):
        steady = model.steady(p, start)
    else:
        model.check(p)
        steady = _steady_state(as_arrays(p), model, start)
    if throw:
        settled = is_settled(steady.status)
        steady = eqx.tree_at(
            lambda s: s.amplitude, steady, steady.status.error_if(steady.amplitude, ~settled)
        )
    return steady


def simulate(
    p: Parameters, y0: ArrayLike, times: ArrayLike, *, model: AbstractModel | None = None
) -> Trajectory:
    """The motion from `y0` at `times[0]`, at increasing dimensionless `times`, shape (n,).

    After an overturning the exact model's states and their derivatives are NaN, and the status says so.
    Derivatives in p and y0 are exact in both modes, those in `times` in forward mode only.

    Raises:
        ValueError: bad input, or a parameter that the model has no term for.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    model = _default() if model is None else model
    check_parameters(p)
    checks.instance("model", model, AbstractModel)
    model.check(p)
    checks.numbers("times", times, (-1,), "a vector of two or more increasing numbers")
    clock = jnp.asarray(times, dtype=jnp.float64)
    if clock.ndim != 1 or clock.shape[0] < 2:
        raise ValueError(f"`times` must be a vector of two or more, but has shape {clock.shape}")
    if not isinstance(clock, jax.core.Tracer):
        known = np.asarray(clock)
        if not (np.all(np.isfinite(known)) and np.all(np.diff(known) > 0)):
            raise ValueError("`times` must increase and be finite, but do not")
    ys, status = _trajectory(as_arrays(p), model, _state(y0), clock)
    return Trajectory(clock, ys, status)


def sampled(p: Parameters, periods: int = 24, per_period: int = 60) -> Float[Array, "times"]:
    """Times tau over the first forcing periods, fine enough to draw."""
    return jnp.asarray(np.linspace(0.0, 1.0, per_period * periods + 1) * periods) * p.period


def _state(y0: ArrayLike) -> State:
    checks.numbers("y0", y0, (4,), "(phi, psi, phi', psi')")
    return jnp.asarray(y0, dtype=jnp.float64)


@eqx.filter_jit
def _trajectory(p: Parameters, model: AbstractModel, y0: State, times: Array) -> tuple[Array, Status]:
    ys, status = _followed(p, y0, times, model=model)
    return refused(ys, jnp.isfinite(ys)), status


@eqx.filter_custom_jvp
def _followed(p: Parameters, y0: State, times: Array, *, model: AbstractModel) -> tuple[Array, Status]:
    return model.trajectory(p, y0, times)


@_followed.def_jvp
def _followed_jvp(primals: tuple, tangents: tuple, *, model: AbstractModel) -> tuple:
    """All derivatives of one run with respect to parameters and start, so that what comes out is
    linear in the direction and can be transposed. That in the times is for forward mode only."""
    p, y0, times = primals
    x, unflatten = ravel_pytree((p, y0))

    def run(x: Float[Array, "n"]) -> tuple[Array, Status]:
        p, y0 = unflatten(x)
        return model.trajectory(p, y0, times)

    def push(direction: Float[Array, "n"]) -> tuple[Array, Array, Status]:
        return jax.jvp(run, (x,), (direction,), has_aux=True)

    ys, slopes, status = jax.vmap(push, out_axes=(None, -1, None))(jnp.eye(x.size))
    moved = jax.tree.map(_or_zero, tangents[:2], (p, y0), is_leaf=lambda leaf: leaf is None)
    out = slopes @ ravel_pytree(moved)[0]
    if tangents[2] is not None:
        out = out + jax.jvp(lambda t: model.trajectory(p, y0, t)[0], (times,), (tangents[2],))[1]
    return (ys, status), (out, jax.tree.map(lambda _: None, status))


def _or_zero(tangent: Array | None, primal: Any) -> Any:
    return jax.tree.map(jnp.zeros_like, primal) if tangent is None else tangent


def _steady_state(p: Parameters, model: AbstractModel, y0: State) -> Steady:
    # Value and slopes come out of one program and are joined here: forward and reverse mode, at any nesting,
    # then cost one product with the slopes and never run through the loops that found the orbit.
    if all(checks.is_concrete(x) for x in (*jax.tree.leaves(p), y0)):
        return _solved(p, model, y0)[0]
    steady, slopes = _solved(stop_gradient(p), model, stop_gradient(y0))
    if all(checks.is_concrete(x) for x in jax.tree.leaves(p)):
        return steady
    # Not in what is compiled, so that the first gradient after a value has nothing to compile.
    sizes = jnp.stack([steady.amplitude, steady.stroke])
    answer = with_slopes(ravel_pytree(p)[0], jnp.concatenate([sizes, steady.state]), slopes)
    numbers = steady.multiplier, steady.lyapunov, steady.estimate
    unknown = (refused_in(p, jnp.asarray(x, dtype=jnp.float64)) for x in numbers)
    return eqx.tree_at(
        lambda s: (s.amplitude, s.stroke, s.state, s.multiplier, s.lyapunov, s.estimate),
        steady,
        (answer[0], answer[1], answer[2:], *unknown),
    )


def _solved(p: Parameters, model: AbstractModel, y0: State) -> tuple[Steady, Float[Array, "6 n"]]:
    """The steady state, and the slopes of amplitude, stroke and state: NaN where there are none."""
    # `eqx.filter_jit` sorts the leaves in Python at every call. A model without numbers needs none of that.
    return (_solved_with if jax.tree.leaves(model) else _solved_by)(p, model, y0)


def _solve(p: Parameters, model: AbstractModel, y0: State) -> tuple[Steady, Float[Array, "6 n"]]:
    flat, unflatten = ravel_pytree(p)
    sane = jnp.all(jnp.isfinite(flat)) & jnp.all(jnp.isfinite(y0))
    # A solver fed with NaN would try until its bound; it gets something harmless instead.
    fixed = unflatten(jnp.where(sane, flat, 1.0))
    settled = model.settle(fixed, jnp.where(sane, y0, 0.0))
    settled = eqx.tree_at(lambda s: s.status, settled, Status.where(sane, settled.status, Status.failed))
    return answered(fixed, model, settled)


_solved_by = jax.jit(_solve, static_argnums=1)
_solved_with = eqx.filter_jit(_solve)


def answered(fixed: Parameters, model: AbstractModel, settled: Settled) -> tuple[Steady, Float[Array, "6 n"]]:
    """The steady state of a motion that has been followed, and the slopes of amplitude, stroke and state in
    the leaves of `fixed`: NaN where there are none."""
    orbit, separation = refine(fixed, model, settled)
    multiplier, to_fold = multipliers(fixed, orbit.by_state[:4])
    neutral = is_neutral(fixed, multiplier)
    status = _verdict(settled, orbit, multiplier, neutral, to_fold, separation, model.resolution(fixed))
    # A bob that swings for ever is on no orbit; of any other under a resting block a period was followed,
    # unless it has more steps than that may take.
    cut_short = (settled.status == Status.rest) & (fixed.zeta > 0.0) & ~jnp.isfinite(orbit.residual)
    status = Status.where(cut_short, Status.event_bound, status)
    # Without a finite derivative of the period map nothing can be said about stability.
    status = Status.where((status == Status.unstable) & ~jnp.isfinite(multiplier), Status.failed, status)
    sound = jnp.all(jnp.isfinite(orbit.y)) | (status == Status.overturned)
    status = Status.where(sound, status, Status.failed)
    # The tilt at which friction holds a block is a state next to which it is held as well.
    multiplier = jnp.where(status == Status.held, 1.0, multiplier)
    sizes, slopes = _answers(fixed, settled, orbit, status, multiplier)
    periodic = is_settled(status) | _is_marginal(status)
    periods, duration = settled.periods, settled.periods * fixed.period
    lyapunov = jnp.where(periodic, jnp.log(multiplier) / duration, separation)
    symmetric = periodic & (periods % 2 == 1) & (orbit.asymmetry < _SYMMETRIC)
    followed = periodic | (status == Status.held) | _is_singular(status)
    multiplier = jnp.where(followed, multiplier, jnp.nan)
    steady = Steady(
        sizes[0], sizes[1], status, periods, multiplier, symmetric, lyapunov, orbit.y, settled.elapsed
    )
    return steady, slopes


def _answers(
    fixed: Parameters, settled: Settled, orbit: Orbit, status: Status, multiplier: Number
) -> tuple[Float[Array, "2"], Float[Array, "6 n"]]:
    """(amplitude, stroke), and the slopes of these and the state where they exist."""
    # A bob that swings for ever under a resting block is on no orbit, but its reach is known.
    ringing = (status == Status.rest) & (fixed.zeta == 0.0)
    isolated = is_settled(status) & (multiplier < 1.0) & ~ringing
    # On an isolated orbit the sizes gain one more Newton step. Elsewhere I - DP may be singular: then they
    # are those of the orbit as it was found, or, of a motion that did not repeat, the largest met.
    last = jnp.where(status == Status.failed, jnp.nan, jnp.stack([settled.amplitude, settled.stroke]))
    sizes, slopes = implicit(orbit)
    followed = _is_marginal(status) | _is_singular(status)
    last = jnp.where(followed | (status == Status.aperiodic), orbit.sizes, last)
    sizes = jnp.where(isolated, sizes, jnp.where(status == Status.overturned, jnp.inf, last))
    slopes = jnp.where(isolated, slopes, jnp.nan)
    rests = status == Status.rest
    sizes = sizes.at[0].set(jnp.where(rests, 0.0, sizes[0]))
    slopes = slopes.at[0].set(jnp.where(rests, 0.0, slopes[0]))
    # The stroke of a bob that hangs still is at the corner of |psi|.
    slopes = slopes.at[1].set(jnp.where(rests & (sizes[1] == 0.0), jnp.nan, slopes[1]))
    return sizes, slopes


def _is_marginal(status: Status) -> Bool[Array, ""]:
    """Whether an orbit was found that does not attract."""
    return (status == Status.unstable) | (status == Status.neutral)


def _is_singular(status: Status) -> Bool[Array, ""]:
    """Whether an orbit was found whose gradient is refused."""
    return (status == Status.near_fold) | (status == Status.grazing)


def _verdict(
    settled: Settled,
    orbit: Orbit,
    multiplier: Number,
    neutral: Bool[Array, ""],
    to_fold: Number,
    separation: Number,
    resolution: Number,
) -> Status:
    """The status of a motion, from what Newton's method on its period map has found."""
    # From the weakest statement to the strongest: each line overrules those above it. Stability comes first,
    # because its numbers mean nothing if an event was grazed, next to a fold, or off an orbit; and a motion
    # smaller than what the model can resolve is rest, whatever its multipliers.
    moving = is_moving(settled.status)
    status = Status.where(moving & (multiplier > 1.0), Status.unstable, settled.status)
    status = Status.where(moving & neutral, Status.neutral, status)
    status = Status.where(moving & (orbit.transversality < GRAZING), Status.grazing, status)
    status = Status.where(moving & (to_fold < 2.0 * NEAR_FOLD), Status.near_fold, status)
    status = Status.where(moving & ~(orbit.residual < RESIDUAL), Status.not_settled, status)
    status = Status.where(separation > _APERIODIC, Status.aperiodic, status)
    return Status.where(moving & (orbit.sizes[0] < resolution), Status.rest, status)
