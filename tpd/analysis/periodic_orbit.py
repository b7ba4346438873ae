"""Any periodic orbit of the exact model: period n, asymmetric, sticking, resting, with impacts.

A simulation says in which order the events of one period come; the orbit with that order is then the
solution of closed-form equations (`tpd.exact.multiple_shooting`), whether it attracts or repels. So an
orbit can be followed where no simulation stays near it, and its derivatives follow from the implicit function
theorem.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jax.lax import stop_gradient
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, Int

from tpd.core import checks
from tpd.core.eigenvalues import characteristic, felt_by_block, is_neutral, quartic_roots, rows_of
from tpd.core.orbit_terms import GRAZING, NEAR_FOLD
from tpd.core.parameters import Number, Parameters, State, as_arrays, check_parameters
from tpd.core.status import Status, is_moving
from tpd.exact.contact import REST, SLIP
from tpd.exact.derivatives import refused_in, with_slopes
from tpd.exact.event_log import cut, record
from tpd.exact.modes import Plant
from tpd.exact.multiple_shooting import (
    LANDING,
    TURN,
    Blocks,
    Cycle,
    Leg,
    Polished,
    Survey,
    monodromy,
    polish,
    polished_cycle,
    state_on,
    survey,
)

MAX_EVENTS = 64
"""Most events in one period of an orbit, by default."""
REST_RATE = 1e-6
"""Slowest impact that is followed, phi' in units of nu: a slower one ends a rattle."""
_CONVERGED = 1e-6
"""Share of its scale that the last Newton step may have gone."""
_MIRRORED = 1e-8
"""Largest deviation from its mirror image, in shares of the scales, of a symmetric orbit."""
_RATTLED = 1e-5
"""Fastest impact that may end a rattle on a followed orbit, in units of nu."""


class Sequence(eqx.Module):
    """The arcs of one period in order; leading axis `max_events`, of which `count` are in use."""

    kinds: Int[Array, "*batch arcs"]
    """0 slip, 1 stick, 2 rest."""
    tilt_signs: Float[Array, "*batch arcs"]
    """Sign of phi; 0 at rest."""
    rate_signs: Float[Array, "*batch arcs"]
    """Sign of phi'; 0 on a held arc."""
    endings: Int[Array, "*batch arcs"]
    """The event at the end: 0 turn, 1 landing, 2 release."""
    durations: Float[Array, "*batch arcs"]
    """Dimensionless time; 0 where not in use."""
    phases: Float[Array, "*batch arcs"]
    """xi tau at the start of the arc, rad; 0 at tau = 0 of the recording."""
    states: Float[Array, "*batch arcs 4"]
    """(phi, psi, phi', psi') at the start of the arc, after the event there."""
    count: Int[Array, "*batch"]


class CycleMargins(eqx.Module):
    """Distances from the loss of an orbit, as functions that vanish where it happens. Their derivatives
    are NaN."""

    fold: Float[Array, "*batch"]
    """det(I - M), M the derivative of the map over one period of the orbit: two orbits merge, or a
    symmetric one gives way to a pair."""
    grazing: Float[Array, "*batch"]
    """The least dent of a signal that keeps an arc going (the rate of a slipping block, the slack of a
    held one) over its largest value, infinite without one: at zero there is one more event."""
    sticking: Float[Array, "*batch"]
    """||R| - k|/(|R| + k) at the nearest of the turns, R the moment there less the weight's: at zero
    the block begins or ceases to stick at that turn. Infinite without a turn."""


class PeriodicOrbit(eqx.Module):
    """A periodic orbit; angles in rad.

    `amplitude`, `stroke`, `state` and the numbers of `sequence` are differentiable in every parameter,
    also on unstable orbits; those of `multipliers` and `margins` are NaN. Where the status is not rocking,
    sticking or unstable the derivatives of the first three are NaN, and so are they themselves where it is
    no_orbit, event_bound, failed, overturned or rest (but amplitude 0 for rest): of an overturning motion
    there is no orbit, whereas `steady_state` calls its amplitude infinite. An orbit has at least one event:
    a block that is held at a tilt for ever is no_orbit.
    """

    status: Status
    """rocking or sticking (attracting), unstable, near_fold, grazing, no_orbit, event_bound, failed
    (a number that is not finite), or, of the recorded motion, overturned or rest."""
    amplitude: Float[Array, "*batch"]
    """Largest |phi|."""
    stroke: Float[Array, "*batch"]
    """Largest |psi|."""
    state: Float[Array, "*batch 4"]
    """(phi, psi, phi', psi') at tau = 0 modulo the orbit's period."""
    periods: Int[Array, "*batch"]
    """Forcing periods in one period of the orbit."""
    symmetric: Bool[Array, "*batch"]
    """Whether the orbit is its own mirror image half a period later."""
    sequence: Sequence
    multipliers: Complex[Array, "*batch 4"]
    """Floquet multipliers over one period of the orbit; attracting if all are below 1 in size."""
    margins: CycleMargins


def periodic_orbit(
    p: Parameters,
    y0: ArrayLike,
    *,
    periods: Int[Array, ""] | int = 1,
    max_events: int = MAX_EVENTS,
    rest_rate: float = REST_RATE,
) -> PeriodicOrbit:
    """The periodic orbit near a state, which need not attract.

    The motion from `y0` is followed over twice `periods`, and the events of one of them become the
    sequence of the orbit. `steady_state(p).state` and its `periods` are a good start.

    Args:
        p: dimensionless parameters; gradients with respect to them are exact.
        y0: (phi, psi, phi', psi') near the orbit at tau = 0, in rad and rad per unit tau.
        periods: forcing periods in one period of the orbit.
        max_events: most events in one period; the cost grows with its cube.
        rest_rate: an impact slower than this (phi' in units of nu) that the block can be held after
            counts as rest, which ends a rattle; the error is of the order of its square.

    Works under `jit`, `vmap`, `grad` and `jacfwd`.

    Raises:
        ValueError: `y0` has not four components, or a bound is not positive.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    check_parameters(p)
    checks.count("periods", periods)
    checks.count("max_events", max_events)
    checks.positive("rest_rate", rest_rate)
    checks.numbers("y0", y0, (4,), "(phi, psi, phi', psi')")
    y = jnp.asarray(y0, dtype=jnp.float64)
    p, count = as_arrays(p), jnp.asarray(periods)
    start = _recorded(p, y, count, max_events, rest_rate)
    return _solve(p, start.legs, start.guess, count, start.outcome)


def continue_orbit(p: Parameters, orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit with the same sequence of events as `orbit`, at other parameters near by.

    Nothing is simulated: unstable orbits, and stable ones near a fold or a grazing, are followed just
    as well. Where the sequence is no longer a motion the status is no_orbit.

    Works under `jit`, `vmap`, `grad` and `jacfwd`; `orbit` is a guess and is not differentiated.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    p = as_arrays(p)
    start = _carried_over(p, orbit)
    return _solve(p, start.legs, start.guess, orbit.periods, start.outcome)


class _Start(eqx.Module):
    """Sequence and guess that Newton's method starts from."""

    legs: Leg
    guess: Cycle
    outcome: Status
    """rocking, or why there is nothing to start from."""


@eqx.filter_jit
def _recorded(p: Parameters, y0: State, periods: Int[Array, ""], max_events: int, rest_rate: float) -> _Start:
    """The events of one period of the motion from `y0`."""
    p, y0 = stop_gradient(p), stop_gradient(y0)
    span = periods * p.period
    log = record(Plant(p), y0, 2.0 * span, room=2 * max_events + 2, capture_speed=rest_rate * p.nu)
    found = cut(log, span, p.xi, max_events)
    rests = (log.last.kind == REST) & ~jnp.any((log.time > span) & (jnp.arange(log.time.size) < log.met))
    sound = jnp.all(jnp.isfinite(jnp.stack([*jax.tree.leaves(p), *y0])))
    outcome = Status.where(found.closed, Status.rocking, Status.no_orbit)
    outcome = Status.where(rests, Status.rest, Status.where(found.overflow, Status.event_bound, outcome))
    outcome = Status.where(log.lost, Status.overturned, outcome)
    return _Start(found.legs, found.cycle, Status.where(sound, outcome, Status.failed))


@eqx.filter_jit
def _carried_over(p: Parameters, orbit: PeriodicOrbit) -> _Start:
    """The events of another orbit."""
    s, xi = stop_gradient(orbit.sequence), stop_gradient(p.xi)
    place = jnp.arange(s.kinds.size)
    following = jnp.where(place + 1 < s.count, place + 1, 0)
    signs = (s.kinds, s.tilt_signs, s.rate_signs, s.endings)
    legs = Leg(*signs, s.kinds[following], s.rate_signs[following], place < s.count)
    # At another frequency the events keep their phases rather than their times.
    old = jnp.sum(s.durations)
    stretch = 2.0 * jnp.pi * orbit.periods / (xi * jnp.where(old > 0, old, 1.0))
    there = jnp.all(jnp.isfinite(s.states)) & (s.count > 0)
    outcome = Status.where(there, Status.rocking, Status.no_orbit)
    return _Start(legs, Cycle(s.states, s.durations * stretch, s.phases[0]), outcome)


@eqx.filter_jit
def _solve(p: Parameters, legs: Leg, guess: Cycle, periods: Int[Array, ""], outcome: Status) -> PeriodicOrbit:
    """Polish a guess, and describe what it comes to."""
    fixed = stop_gradient(p)
    plant, span, scale = Plant(fixed), periods * fixed.period, _scale(fixed)
    near = polish(plant, legs, guess, span, scale)
    cycle = polished_cycle(plant, legs, near, span)
    met, multipliers, margins = _inspect(fixed, plant, legs, cycle, near.blocks)
    valid = (outcome == Status.rocking) & _holds(fixed, legs, met) & (near.moved < _CONVERGED)
    status = Status.where(
        outcome == Status.rocking, _verdict(fixed, legs, multipliers, margins, valid), outcome
    )
    usable = is_moving(status) | (status == Status.unstable) | (status == Status.neutral)
    sizes, cycle = _differentiable(p, legs, near, met, periods, valid, usable)
    count = jnp.where(valid, jnp.sum(legs.real), 0)
    multipliers, margins = jax.tree.map(lambda x: jnp.where(valid, x, jnp.nan), (multipliers, margins))
    real, imag = refused_in(p, jnp.real(multipliers)), refused_in(p, jnp.imag(multipliers))
    return PeriodicOrbit(
        status,
        jnp.where(status == Status.rest, 0.0, sizes[0]),
        sizes[1],
        sizes[2:],
        periods,
        valid & _mirrored(cycle, count, scale, span) & (periods % 2 == 1),
        Sequence(*legs[:4], cycle.durations, cycle.phases(p.xi), cycle.states, count),
        real + 1j * imag,
        jax.tree.map(lambda x: refused_in(p, x), margins),
    )


def _differentiable(
    p: Parameters,
    legs: Leg,
    near: Polished,
    met: Survey,
    periods: Int[Array, ""],
    valid: Bool[Array, ""],
    usable: Bool[Array, ""],
) -> tuple[Float[Array, "6"], Cycle]:
    """(amplitude, stroke, state) and the cycle, with their derivatives: nine directions in forward mode,
    which forward and reverse mode combine."""
    flat, unflatten = ravel_pytree(p)
    unpack = ravel_pytree((jnp.zeros(6), near.cycle))[1]

    def answer(x: Float[Array, "n"]) -> Float[Array, "m"]:
        q = unflatten(x)
        plant, span = Plant(q), periods * q.period
        cycle = polished_cycle(plant, legs, near, span)
        state, reach = _looked_up(plant, legs, cycle, met, span)
        sizes = jnp.concatenate([jnp.stack([_largest(cycle, legs), reach]), state])
        return ravel_pytree((sizes, cycle))[0]

    def push(direction: Float[Array, "n"]) -> tuple[Array, Array]:
        return jax.jvp(answer, (stop_gradient(flat),), (direction,))

    values, slopes = jax.vmap(push, out_axes=(None, 1))(jnp.eye(flat.size))
    first = jnp.arange(values.size) < 6
    values = jnp.where(first & ~valid, jnp.nan, values)
    slopes = jnp.where(usable, slopes, jnp.nan)
    return unpack(with_slopes(flat, values, slopes))


def _inspect(
    p: Parameters, plant: Plant, legs: Leg, cycle: Cycle, blocks: Blocks
) -> tuple[Survey, Array, CycleMargins]:
    """Extremes, multipliers and margins of the orbit."""
    phases = cycle.phases(plant.linear.xi)
    met = jax.vmap(survey, (None, 0, 0, 0, 0))(plant, legs, cycle.states, phases, cycle.durations)
    multipliers, fold = _stability(p, monodromy(plant, legs, cycle, blocks))
    sines = jnp.sin(phases + plant.linear.xi * cycle.durations)
    sticking = jnp.min(jax.vmap(_sticking, (None, 0, 0, 0))(plant, legs, met.last, sines))
    return met, multipliers, CycleMargins(fold, jnp.min(met.dip), sticking)


def _holds(p: Parameters, legs: Leg, met: Survey) -> Bool[Array, ""]:
    """Whether all arcs keep to their signs, and what is said to end in rest is slow and low."""
    rests, least = legs.real & (legs.onward == REST), _RATTLED * p.nu
    fast = (legs.ending == LANDING) & (p.velocity_ratio * jnp.abs(met.last[:, 2]) > least)
    return jnp.all(met.inside) & ~jnp.any(rests & (fast | (jnp.abs(met.last[:, 0]) > least**2)))


def _scale(p: Parameters) -> State:
    """Sizes of the state's components."""
    rate = jnp.maximum(p.xi, 1.0)
    return jnp.stack([p.nu, p.nu + p.f, p.nu * rate, (p.nu + p.f) * rate])


def _largest(cycle: Cycle, legs: Leg) -> Array:
    """The largest |phi|: a tilt is monotone on its arcs, hence largest where one begins."""
    return jnp.max(jnp.where(legs.real, jnp.abs(cycle.states[:, 0]), 0.0))


def _stability(p: Parameters, matrix: Float[Array, "4 4"]) -> tuple[Array, Array]:
    """The multipliers and det(I - M). A bob without mass (mu = 0) cannot be felt and is left out: two
    multipliers are zero then."""
    matrix = jnp.where(jnp.all(jnp.isfinite(matrix)), matrix, jnp.zeros((4, 4)))
    c1, c2, c3, c4 = characteristic(felt_by_block(p, rows_of(matrix)))
    real, imag = quartic_roots((c1, c2, c3, c4))
    return real + 1j * imag, jnp.asarray(1.0 + c1 + c2 + c3 + c4)


def _sticking(plant: Plant, leg: Leg, end: State, sine: Number) -> Number:
    """See `CycleMargins`."""
    linear = plant.linear
    moment = linear.holding_moment(end.at[2].set(0.0), sine)
    excess = jnp.abs(moment - leg.tilt * linear.weight)
    share = jnp.abs(excess - linear.friction) / jnp.maximum(excess + linear.friction, 1e-300)
    return jnp.where(leg.real & (leg.ending == TURN), share, jnp.inf)


def _verdict(
    p: Parameters, legs: Leg, multipliers: Array, margins: CycleMargins, valid: Bool[Array, ""]
) -> Status:
    held = jnp.any(legs.real & (legs.kind != SLIP))
    status = Status.where(held, Status.sticking, Status.rocking)
    largest = jnp.max(jnp.abs(multipliers))
    status = Status.where(largest < 1.0, status, Status.unstable)
    status = Status.where(is_neutral(p, largest), Status.neutral, status)
    status = Status.where(margins.grazing < GRAZING, Status.grazing, status)
    near = jnp.min(jnp.abs(1.0 - multipliers)) < 2.0 * NEAR_FOLD
    return Status.where(valid, Status.where(near, Status.near_fold, status), Status.no_orbit)


def _looked_up(plant: Plant, legs: Leg, cycle: Cycle, met: Survey, span: Number) -> tuple[State, Array]:
    """The state at tau = 0 modulo the period, and the largest |psi|."""
    phases = cycle.phases(plant.linear.xi)
    begun = phases / plant.linear.xi
    late = stop_gradient(jnp.ceil(begun / span)) * span - begun
    i, j = jnp.argmin(jnp.where(legs.real, late, jnp.inf)), jnp.argmax(met.reach)
    times = jnp.stack([late[i], met.share[j] * cycle.durations[j]])
    at = jnp.stack([i, j])

    def state(leg: Leg, y: State, phase: Number, time: Number) -> State:
        return state_on(leg.launch(plant, y, phase)[0], time)

    ys = jax.vmap(state)(jax.tree.map(lambda x: x[at], legs), cycle.states[at], phases[at], times)
    return ys[0], jnp.abs(ys[1, 1])


def _mirrored(cycle: Cycle, count: Int[Array, ""], scale: State, span: Number) -> Bool[Array, ""]:
    """Whether the second half of the arcs is the mirror image of the first."""
    place = jnp.arange(cycle.durations.size)
    half = count // 2
    real = place < half
    other = jnp.where(real, place + half, place)
    apart = jnp.max(jnp.abs(cycle.states + cycle.states[other]) / scale[None], axis=1)
    longer = jnp.abs(cycle.durations - cycle.durations[other]) / span
    same = jnp.maximum(apart, longer) < _MIRRORED
    return (count % 2 == 0) & jnp.all(same | ~real)
