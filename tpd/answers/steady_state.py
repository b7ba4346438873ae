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
from collections import namedtuple
from functools import lru_cache, partial
from typing import Any, cast

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float, Int

from tpd.answers.period_map import Orbit, implicit, is_rocking, multipliers, refine
from tpd.core import checks
from tpd.core.formatting import counted_periods, number
from tpd.exact.calling import LINEAR, parts
from tpd.exact.derivatives import joined, refused
from tpd.exact.rows import numbers_of, packed
from tpd.exact.runs import Settled, solve
from tpd.exact.terms import GRAZING, NEAR_FOLD, RESIDUAL, STEADY_STATUSES, SYMMETRIC, is_neutral
from tpd.models.base import AbstractChoice, AbstractCompiled, AbstractFlow, AbstractModel
from tpd.models.compiled import Piecewise
from tpd.scene.parameters import Parameters, as_arrays, check_parameters, from_row
from tpd.scene.pytrees import Number, State, single
from tpd.scene.status import (
    NOT_ATTRACTING,
    SETTLED,
    UNANSWERED,
    Status,
    code_of,
    codes_of,
    is_one_of,
    status_name,
)

_STATUSES = codes_of(STEADY_STATUSES)
"""Numbers of statuses by those of compiled code."""
INEXACT = 0.05
"""Largest relative error of the amplitude of a smoothed motion that is not `inexact`."""


class Steady(eqx.Module):
    """A steady state; angles in rad.

    `amplitude` is the largest |phi| and `swing` the largest |psi| over the settled period(s). They and
    `state` are differentiable in every parameter when `status` is rocking, sticking or rest; elsewhere
    their derivative is NaN and `status` says why, but where it is inexact: then they belong to the smoothed
    motion. Stroke and state of a bob under a resting block have
    none either if zeta = 0: the bob rings for ever, and its reach depends on how the block came to rest.
    Nor has the stroke of a bob that hangs still, being at the corner of |psi|. The derivatives of
    `multiplier`, `lyapunov` and `estimate` are always NaN, and so are all second ones; those in the start are
    zero where the others are numbers. At mu = 0 the stroke is that of a bob too light to be felt. An
    overturned block has infinite amplitude and stroke.
    """

    amplitude: Number
    swing: Number
    status: Status
    periods: Int[Array, "..."] | int
    """Forcing periods in one period of the motion."""
    multiplier: Number
    """Largest modulus of the Floquet multipliers; below 1 the motion attracts. NaN of a motion that is
    not periodic."""
    symmetric: Bool[Array, "..."] | np.bool_
    """Whether the motion is its own mirror image half a period of it later."""
    lyapunov: Number
    """Rate, per unit tau, at which neighbouring motions separate (negative: approach). Of a periodic
    motion exact; of one that does not repeat an estimate, by `Piecewise` alone; NaN where neither applies."""
    state: Float[Array | np.ndarray, "... 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the forcing period."""
    elapsed: Int[Array, "..."] | int
    """Forcing periods followed before the repetition was recognised."""
    estimate: Number = math.nan
    """Estimated relative error of the amplitude, if `Auto` chose the model. Of `Smoothed` the relative
    difference from the exact amplitude that is reached from the same start, infinite where one of both rests
    or overturns and the other does not; NaN where the exact motion is not known."""
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
            f"  swing        {self.swing:.6g} rad",
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


_MOST_TIMES = 1_000_000
"""Most times of a trajectory."""


@lru_cache(maxsize=1)
def _default() -> Piecewise:
    """Default model: to make one, and check it, takes a third of the time of a call."""
    return Piecewise()


def steady_state(
    p: Parameters,
    *,
    model: AbstractModel | AbstractChoice | None = None,
    y0: checks.Vector | None = None,
    throw: bool = False,
) -> Steady:
    """The motion that the block settles into from a stated start.

    Args:
        p: dimensionless parameters; gradients with respect to them are exact.
        model: `Piecewise()`, the exact solution of the linear equations (default), `Smoothed()`,
            `Nonlinear()`, the nonlinear equations without derivatives, or `Auto()`, which chooses. The answer
            of `Smoothed()` is compared with the exact motion from the same start, and its status is inexact
            where their amplitudes differ by more than 5 %: see `Steady.estimate`.
        y0: start (phi, psi, phi', psi') in rad and rad per unit tau, at tau = 0; default at rest.
        throw: raise an error where the status is not rocking, sticking or rest.

    Raises:
        ValueError: bad input, or a parameter that the model has no term for.
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    model = _default() if model is None else model
    checks.instance("model", model, (AbstractModel, AbstractChoice))
    checks.flag("throw", throw)
    start: Any = np.zeros(4) if y0 is None else checks.state(y0)
    if isinstance(model, AbstractChoice):
        steady = model.steady(p, start)
    else:
        # By its class: what equinox makes of a method of an object takes longer than the check.
        model.__class__.check(model, p)  # pyright: ignore[reportArgumentType]
        steady = _steady_state(p, model, start)
    if throw:
        settled = is_one_of(steady.status, *SETTLED)
        steady = eqx.tree_at(
            lambda s: s.amplitude, steady, steady.status.error_if(jnp.asarray(steady.amplitude), ~settled)
        )
    return steady


def simulate(
    p: Parameters, y0: checks.Vector, times: checks.Vector, *, model: AbstractModel | None = None
) -> Trajectory:
    """The motion from `y0` at `times[0]`, at increasing dimensionless `times`, shape (n,).

    After an overturning the exact model's states and their derivatives are NaN, and the status says so.
    Derivatives in p and y0 are exact in both modes, those in `times` in forward mode only.

    Raises:
        ValueError: bad input, or a parameter that the model has no term for.
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    model = _default() if model is None else model
    checks.instance("model", model, AbstractModel)
    model.check(p)
    clock = checks.increasing("times", times)
    # Ctrl-C waits for compiled code to return.
    checks.count("number of times", clock.size, most=_MOST_TIMES)
    p, longest = single(p), f"{model.most_periods} forcing periods in one call"
    checks.at_most("times[-1] - times[0]", clock[-1] - clock[0], model.most_periods * p.period, longest)
    clock = jnp.asarray(clock)
    ys, status = _trajectory(as_arrays(p), model, checks.state(y0), clock)
    return Trajectory(clock, ys, status)


def sampled(p: Parameters, periods: int = 24, per_period: int = 60) -> Float[Array, "times"]:
    """Times tau over the first forcing periods, fine enough to draw."""
    return jnp.asarray(np.linspace(0.0, 1.0, per_period * periods + 1) * periods) * p.period


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
    moved = jax.tree.map(
        lambda tangent, x: jax.tree.map(jnp.zeros_like, x) if tangent is None else tangent,
        *(tangents[:2], (p, y0)),
        is_leaf=lambda leaf: leaf is None,
    )
    out = slopes @ ravel_pytree(moved)[0]
    if tangents[2] is not None:
        out = out + jax.jvp(lambda t: model.trajectory(p, y0, t)[0], (times,), (tangents[2],))[1]
    return (ys, status), (out, jax.tree.map(lambda _: None, status))


def _steady_state(p: Parameters, model: AbstractModel, y0: State) -> Steady:
    # Value and slopes come first and are joined here: forward and reverse mode, at any nesting, then cost one
    # product with the slopes and never run through the loops that found the orbit.
    values = numbers_of(p)
    plain = _PLAIN.issuperset(map(type, values)) and type(y0) is np.ndarray
    compiled = isinstance(model, AbstractCompiled)
    if plain and compiled:
        # The usual call, which takes as long as two questions of JAX's: none is asked.
        return _steady(_answer(solve(model.equations, np.array(values), y0, model.limits))[0])
    if any(np.size(x) != 1 for x in values):
        raise ValueError("`p` must be single numbers: `jax.vmap` and `tpd.in_chunks` take batches")
    values = single(values)
    known, *still = all(map(checks.is_concrete, (*values, y0))), *map(_still, values)
    start = _still(y0)
    if compiled:
        # By compiled code; of numbers without any program of JAX.
        sure = all(map(checks.is_concrete, (*still, start)))
        x = np.array(still, dtype=float) if sure else packed(still)
        start = start if sure else jnp.asarray(start, float)
        answer, slopes = _answer(solve(model.equations, x, start, model.limits))
    else:
        x: Any = np.array(still, dtype=float) if all(map(checks.is_concrete, still)) else packed(still)
        # `eqx.filter_jit` sorts the leaves in Python at every call. A model without numbers needs none of it.
        flow = cast("AbstractFlow", model)
        answer, slopes = (_solved_with if jax.tree.leaves(flow) else _solved_by)(x, flow, start)
    return _steady(answer if known else _joined((*values, *y0), answer, slopes))


_PLAIN = {float, np.float64}
"""Types of parameters that are known to the engine as they are."""


def _still(x: Any) -> Any:
    """A number or an array, as it is where it is differentiated: known if it is known there."""
    return x if checks.is_concrete(x) else stop_gradient(x)


_Answer = namedtuple(
    "_Answer",
    "amplitude swing status periods multiplier symmetric lyapunov state elapsed estimate",
    defaults=(math.nan,),
)
"""Numbers of a `Steady`, in the order of its fields."""


def _steady(answer: _Answer) -> Steady:
    # From its leaves, because fields are annotated with arrays of JAX's, and known numbers are NumPy's.
    return jax.tree.unflatten(_structure(), answer)


@lru_cache(maxsize=1)
def _structure() -> Any:
    """Structure of the pytree of a `Steady`."""
    none, count, no = jnp.zeros(()), jnp.zeros((), int), jnp.zeros((), bool)
    return jax.tree.structure(
        Steady(none, none, Status.failed, count, none, no, none, jnp.zeros(4), count, none)
    )


_DEPENDING = "amplitude", "swing", "state", "multiplier", "lyapunov", "estimate"
"""Numbers of an answer that depend on parameters; the derivatives of the last three nobody has computed."""


def _joined(values: tuple, answer: _Answer, slopes: Any) -> _Answer:
    """An answer whose numbers depend on parameters, with these slopes of amplitude, stroke and state."""
    # What is known need not be differentiated in. An orbit that is settled does not move with the start.
    moving = [i for i, x in enumerate(values) if not checks.is_concrete(x)]
    unknown = np.full(len(moving), np.nan)
    by = [slopes[:, i] if i < 9 else 0.0 * slopes[:, 0] for i in moving]
    numbers = tuple(getattr(answer, name) for name in _DEPENDING)
    rows = *([s[k] for s in by] for k in range(2)), [s[2:] for s in by], unknown, unknown, unknown
    found = joined(tuple(jnp.asarray(values[i], dtype=jnp.float64) for i in moving), numbers, rows)
    return answer._replace(**dict(zip(_DEPENDING, found, strict=True)))


def _answer(out: Any) -> tuple[_Answer, Any]:
    """The answer in the record of compiled code, and the slopes of amplitude, stroke and state."""
    record = LINEAR.entry().STEADY
    if isinstance(out, np.ndarray):
        # Numbers of NumPy, and not arrays without axes.
        of: Any = _known(record)._make(out.view(record)[0])
        xp, whole = np, int
    else:
        of, xp, whole = parts(out, record), jnp, partial(jnp.asarray, dtype=int)
    # An array, by which equinox looks up the message of a status.
    status = xp.asarray(xp.asarray(_STATUSES)[whole(of.status)])
    about = whole(of.periods), of.multiplier, of.symmetric == 1.0, of.lyapunov, of.y, whole(of.elapsed)
    return _Answer(of.amplitude, of.swing, status, *about), of.by


@lru_cache(maxsize=1)
def _known(record: np.dtype) -> Any:
    """A tuple with the names of a record."""
    return namedtuple("_known", record.names or ())


def _solve(x: Float[Array, "9"], model: AbstractFlow, y0: State) -> tuple[_Answer, Float[Array, "6 9"]]:
    """The answer, and the slopes of amplitude, stroke and state: NaN where there are none. Traced."""
    sane = jnp.all(jnp.isfinite(x)) & jnp.all(jnp.isfinite(y0))
    # A solver fed with NaN would try until its bound; it gets something harmless instead.
    fixed = from_row(jnp.where(sane, x, 1.0))
    settled = model.settle(fixed, jnp.where(sane, y0, 0.0))
    settled = eqx.tree_at(lambda s: s.status, settled, Status.where(sane, settled.status, Status.failed))
    answer, slopes = _judged(fixed, model, settled)
    return _compared(answer, model.settle_exactly(fixed, jnp.where(sane, y0, 0.0))), slopes


_solved_by = jax.jit(_solve, static_argnums=1)
_solved_with = eqx.filter_jit(_solve)


def _compared(answer: _Answer, exact: Settled | None) -> _Answer:
    """The answer of a smoothed model, with its difference from the exact motion from the same start."""
    if exact is None:
        return answer
    (code,) = jax.tree.leaves(exact.status)
    amplitude = jnp.where(code == code_of(Status.overturned), jnp.inf, exact.amplitude)
    # Two that rest or overturn are alike, and one alone is not.
    error = jnp.where(answer.amplitude == amplitude, 0.0, jnp.abs(answer.amplitude / amplitude - 1.0))
    known = jnp.logical_not(is_one_of(code, Status.not_settled, *UNANSWERED))
    claimed = is_one_of(answer.status, *SETTLED, Status.overturned)
    status = jnp.where(claimed & known & (error > INEXACT), code_of(Status.inexact), answer.status)
    return answer._replace(status=status, estimate=jnp.where(known, error, jnp.nan))


def _judged(p: Parameters, model: AbstractFlow, begun: Settled) -> tuple[_Answer, Array]:
    """The answer for a motion that has been followed, and the slopes of amplitude, stroke and state in the
    parameters, NaN where there are none."""
    (code,) = jax.tree.leaves(begun.status)
    orbit = refine(p, model, begun, code)
    multiplier, to_fold = multipliers(p.mu, orbit.by_state[:4])
    neutral = is_neutral(p.k, p.velocity_ratio, p.mu, p.zeta, multiplier)
    # By its class, as the check.
    status = _verdict(code, orbit, multiplier, neutral, to_fold, model.__class__.resolution(model, p))
    # A bob that swings for ever is on no orbit; of any other under a resting block a period was followed,
    # unless it has more steps than that may take.
    endless = jnp.logical_not(jnp.isfinite(orbit.residual))
    cut_short = (code == code_of(Status.rest)) & (p.zeta > 0.0) & endless
    status = jnp.where(cut_short, code_of(Status.event_bound), status)
    # Without a finite derivative of the period map nothing can be said about stability.
    unsaid = (status == code_of(Status.unstable)) & jnp.logical_not(jnp.isfinite(multiplier))
    status = jnp.where(unsaid, code_of(Status.failed), status)
    sound = jnp.all(jnp.isfinite(orbit.y)) | (status == code_of(Status.overturned))
    status = jnp.where(sound, status, code_of(Status.failed))
    # The tilt at which friction holds a block is a state next to which it is held as well.
    multiplier = jnp.where(status == code_of(Status.held), 1.0, multiplier)
    sizes, slopes = _answers(p, begun, orbit, status, multiplier)
    periodic = is_one_of(status, *SETTLED, Status.unstable, Status.neutral)
    lyapunov = jnp.where(periodic, jnp.log(multiplier) / (begun.periods * p.period), jnp.nan)
    symmetric = periodic & (begun.periods % 2 == 1) & (orbit.asymmetry < SYMMETRIC)
    followed = periodic | is_one_of(status, Status.held, Status.near_fold, Status.grazing)
    multiplier = jnp.where(followed, multiplier, jnp.nan)
    about = status, begun.periods, multiplier, symmetric, lyapunov, orbit.y, begun.elapsed
    return _Answer(sizes[0], sizes[1], *about), slopes


def _answers(p: Any, begun: Settled, orbit: Orbit, status: Any, multiplier: Any) -> tuple[Any, Any]:
    """(amplitude, stroke), and the slopes of these and the state where they exist."""
    rests = status == code_of(Status.rest)
    # A bob that swings for ever under a resting block is on no orbit, but its reach is known.
    ringing = rests & (p.zeta == 0.0)
    isolated = (is_rocking(status) | rests) & (multiplier < 1.0) & jnp.logical_not(ringing)
    # On an isolated orbit the sizes gain one more Newton step. Elsewhere I - DP may be singular: then they
    # are those of the orbit as it was found.
    unknown = jnp.full(2, jnp.nan)
    last = jnp.where(status == code_of(Status.failed), unknown, jnp.stack([begun.amplitude, begun.swing]))
    sizes, slopes = implicit(orbit)
    followed = is_one_of(status, *NOT_ATTRACTING)
    last = jnp.where(followed, orbit.sizes, last)
    last = jnp.where(status == code_of(Status.overturned), jnp.full(2, jnp.inf), last)
    sizes, slopes = jnp.where(isolated, sizes, last), jnp.where(isolated, slopes, jnp.nan)
    still = rests & (sizes[1] == 0.0)
    # A block at rest has no amplitude, whatever moves. The stroke of a bob that hangs still is at the corner
    # of |psi|.
    none = jnp.where(rests, jnp.zeros(9), slopes[0])
    reach = jnp.where(still, jnp.full(9, jnp.nan), slopes[1])
    slopes = jnp.concatenate([jnp.stack([none, reach]), slopes[2:]])
    return jnp.stack([jnp.where(rests, 0.0, sizes[0]), sizes[1]]), slopes


def _verdict(begun: Any, orbit: Orbit, multiplier: Any, neutral: Any, to_fold: Any, resolution: Any) -> Any:
    """The number of the status of a motion, from that with which following it has ended, and from what
    Newton's method on its period map has found."""
    # From the weakest statement to the strongest: each line overrules those above it. Stability comes first,
    # because its numbers mean nothing if an event was grazed, next to a fold, or off an orbit; and a motion
    # smaller than what the model can resolve is rest, whatever its multipliers.
    moving = is_rocking(begun)
    status = jnp.where(moving & (multiplier > 1.0), code_of(Status.unstable), begun)
    status = jnp.where(moving & neutral, code_of(Status.neutral), status)
    status = jnp.where(moving & (orbit.transversality < GRAZING), code_of(Status.grazing), status)
    status = jnp.where(moving & (to_fold < 2.0 * NEAR_FOLD), code_of(Status.near_fold), status)
    open_ = jnp.logical_not(orbit.residual < RESIDUAL)
    status = jnp.where(moving & open_, code_of(Status.not_settled), status)
    return jnp.where(moving & (orbit.sizes[0] < resolution), code_of(Status.rest), status)
