"""Periodic orbits of the exact model near a state: period n, asymmetric, sticking, resting, with impacts.

Newton's method on the map of the orbit's periods finds an orbit whether it attracts or repels
(`tpd.exact.period_map`). So an orbit can be followed where no simulation stays near it, and its derivatives
follow from the implicit function theorem.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, Int

from tpd.core import checks
from tpd.exact.calling import LINEAR, numbers_in, parts, shape
from tpd.exact.derivatives import with_slopes
from tpd.exact.rows import packed, row_of
from tpd.exact.runs import EVENTS, REST_RATES
from tpd.exact.terms import STEADY_STATUSES
from tpd.scene.parameters import Parameters, as_arrays, check_parameters
from tpd.scene.pytrees import single
from tpd.scene.status import Status, index_of
from tpd.theory.equations import Terms

REST_RATE = REST_RATES[Terms.linear]
"""Slowest impact that is followed, phi' in units of nu, by default."""
_MOST_PERIODS = 1000
_SIZES = 6
"""How many numbers of an orbit have derivatives: amplitude, stroke and state come first."""


class PeriodicOrbit(eqx.Module):
    """A periodic orbit; angles in rad.

    `amplitude`, `swing` and `state` are differentiable in every parameter, also on unstable and neutral
    orbits; elsewhere, as those of `multipliers` and `fold`, their derivatives are NaN. Where the status is
    no_orbit, event_bound or failed all numbers are NaN, and where it is overturned all but amplitude and
    stroke, which are infinite.
    """

    status: Status
    """rocking or sticking (attracting), rest, held, unstable, neutral, near_fold, grazing, no_orbit, or, of
    the motion in its first period, overturned, event_bound or failed (a number that is not finite)."""
    amplitude: Float[Array, "*batch"]
    """Largest |phi|."""
    swing: Float[Array, "*batch"]
    """Largest |psi|."""
    state: Float[Array, "*batch 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the orbit's period."""
    periods: Int[Array, "*batch"]
    """Forcing periods in one period of the orbit: the fewest after which it closes."""
    symmetric: Bool[Array, "*batch"]
    """Whether the orbit is its own mirror image half a period later."""
    multipliers: Complex[Array, "*batch 4"]
    """Floquet multipliers over one period of the orbit; attracting if all are below 1 in size."""
    fold: Float[Array, "*batch"]
    """det(I - M), M the derivative of the map over one period of the orbit: it vanishes where two orbits
    merge, or a symmetric one gives way to a pair."""


def periodic_orbit(
    p: Parameters,
    y0: checks.Vector,
    *,
    periods: checks.Whole = 1,
    max_events: checks.Whole = EVENTS,
    rest_rate: checks.Real = REST_RATE,
) -> PeriodicOrbit:
    """Return the periodic orbit near a state, which need not attract.

    Newton's method starts from `y0` and follows so many `periods` at each step. `steady_state(p).state` and
    its `periods` are a good start.

    Args:
        p: dimensionless parameters; gradients with respect to them are exact.
        y0: (phi, psi, phi', psi') near the orbit at tau = 0, in rad and rad per unit tau.
        periods: forcing periods in one period of the orbit.
        max_events: most events in one forcing period.
        rest_rate: an impact slower than this (phi' in units of nu) that the block can be held after
            counts as rest, which ends a rattle; the error is of the order of its square.

    Works under `jit`, `vmap`, `grad` and `jacfwd`.

    Raises:
        ValueError: `y0` has not four components, or a bound is not positive.
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    periods = checks.count("periods", periods, most=_MOST_PERIODS)
    max_events = checks.count("max_events", max_events, most=100_000)
    rest_rate = checks.tolerance("rest_rate", rest_rate)
    return _near(p, checks.state(y0), periods, max_events, rest_rate)


def continue_orbit(p: Parameters, orbit: PeriodicOrbit) -> PeriodicOrbit:
    """Return the orbit near another one, at other parameters near by.

    Nothing is simulated for longer than a period: unstable orbits, and stable ones near a fold or a grazing,
    are followed just as well. Take steps in which the orbit changes little: from afar Newton's method may
    come to another orbit.

    Works under `jit`, `vmap`, `grad` and `jacfwd`; `orbit` is a guess and is not differentiated.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    return _near(p, orbit.state, orbit.periods, EVENTS, REST_RATE)


def _near(p: Parameters, y0: ArrayLike, periods: ArrayLike, events: int, rest_rate: float) -> PeriodicOrbit:
    entry, x = LINEAR.entry(), row_of(as_arrays(single(p)))
    settings = LINEAR.settings("ORBIT", periods=periods, events=events, rest_rate=rest_rate)
    given = [v if checks.is_concrete(v) else stop_gradient(v) for v in (x, y0, periods)]
    size = numbers_in(entry.STEADY)
    # What is known, outside of programs and under `grad` there, needs no program of JAX.
    if all(map(checks.is_concrete, given)):
        found = np.empty(size)
        row, known, start = (np.ascontiguousarray(v, dtype=float) for v in (settings, *given[:2]))
        entry.run(0, 1, row, known, start, found)
    else:
        (found,) = LINEAR((shape(size),), packed(map(stop_gradient, settings)), *given[:2])
    of = parts(found, entry.STEADY)
    # Complex numbers are split in two, because slopes are real.
    numbers = jnp.concatenate([found[:_SIZES], of.multipliers.reshape(-1), of.fold[None]])
    # Of known parameters JAX asks for no derivative.
    if not isinstance(x, np.ndarray):
        unknown = jnp.full((len(numbers) - _SIZES, len(x)), jnp.nan)
        numbers = with_slopes(x, numbers, jnp.concatenate([of.by, unknown]))
    amplitude, swing, *state = numbers[:_SIZES]
    *both, fold = numbers[_SIZES:]
    # A motion whose period does not close is no orbit: it was not followed until it settled.
    names = ("no_orbit" if name == "not_settled" else name for name in STEADY_STATUSES)
    status = jnp.asarray([index_of(name) for name in names], dtype=jnp.int32)[of.status.astype(int)]
    return PeriodicOrbit(
        status=jax.tree.unflatten(jax.tree.structure(Status.rocking), [status]),
        amplitude=amplitude,
        swing=swing,
        state=jnp.stack(state),
        periods=jnp.asarray(of.periods, dtype=int),
        symmetric=jnp.asarray(of.symmetric != 0.0),
        multipliers=jnp.stack(both[::2]) + 1j * jnp.stack(both[1::2]),
        fold=fold,
    )
