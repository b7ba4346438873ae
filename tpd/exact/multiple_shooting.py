"""Periodic orbits of any sequence of events, by Newton's method on their closed-form arcs.

A periodic motion is a cycle of arcs (slip, stick or rest, each with its signs), and every arc ends in
an event: a turn (phi' = 0), a landing (phi = 0, with its impact) or a release (the moment on the held
block reaches what holds it). With the sequence given, the unknowns are the durations of the arcs, the
states at their starts, and the phase of the forcing at the first of them; the equations are the
events, the joints between the arcs, and that the durations add up to whole forcing periods. No event
is solved for by itself, so that nothing is divided by the rate at which it is met, and no error
grows over more than one arc.

Held arcs lose the tilt and its rate: the state that enters one has phi' = 0 exactly (phi = 0 as well at
rest), and the projections that see to it are part of the equations and of their derivatives.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float, Int

from tpd.core.parameters import Number, State
from tpd.exact.arc import Arc, ending, launch
from tpd.exact.contact import REST, SLIP, Mode, captured_restitution, impact_jump
from tpd.exact.modes import Plant
from tpd.exact.signal import Signal

TURN, LANDING, RELEASE = 0, 1, 2
SAMPLES = 48
"""Windows of an arc, between whose ends its extremes are looked for."""
NEWTON_STEPS = 20
_CONVERGED = 1e-9
"""Share of its scale below which a Newton step is the last but one."""
_ROUNDING = 1e-9
"""Share of its largest value by which a signal may seem to leave its arc."""
_NOISE = 1e-14
"""Largest value outside its arc that a signal may seem to have through rounding alone."""


class Leg(NamedTuple):
    """The discrete side of an arc: its mode, the event that ends it, and what follows.

    In a sequence every field has a leading axis; arcs with `real` false are padding: they take no
    time and change nothing.
    """

    kind: Int[Array, "..."]
    tilt: Float[Array, "..."]
    """Sign of phi; 0 at rest."""
    rate: Float[Array, "..."]
    """Sign of phi'; 0 on a held arc."""
    ending: Int[Array, "..."]
    onward: Int[Array, "..."]
    """Kind of the next arc."""
    way: Float[Array, "..."]
    """Sign of phi' on the next arc."""
    real: Bool[Array, "..."]

    def launch(self, plant: Plant, y: State, phase: Number) -> tuple[Arc, tuple[Signal, Signal]]:
        """The arc that leaves state `y`, the forcing being sin(phase + xi t), and the two signals that
        are positive on it."""
        mode = Mode(self.kind, self.tilt, self.rate)
        arc = launch(plant, mode, y, phase)
        return arc, ending(plant, mode, arc)


def state_on(arc: Arc, t: Number) -> State:
    """The state a time t after the start of an arc."""
    return jnp.stack(arc.state(arc.at(t), jnp.zeros_like(arc.phase)))


def arrive(plant: Plant, leg: Leg, y: State) -> State:
    """The state after the event that a leg ends with."""
    e = captured_restitution(plant.restitution, leg.onward == REST)
    block, bob = impact_jump((e - 1.0) * y[2], plant.length_ratio)
    turned = y.at[2].set(0.0)
    landed = jnp.stack([jnp.zeros_like(y[0]), y[1], y[2] + block, y[3] + bob])
    return jnp.where(leg.ending == LANDING, landed, turned)


def traverse(plant: Plant, leg: Leg, y: State, phase: Number, duration: Number) -> Float[Array, "5"]:
    """The state after an arc and the event at its end, and by how much that event is missed."""
    arc, signals = leg.launch(plant, y, phase)
    first, second = (s.at(arc.at(duration)) for s in signals)
    missed = jnp.where(jnp.where(leg.kind == SLIP, leg.ending == LANDING, leg.way < 0), second, first)
    there = jnp.append(arrive(plant, leg, state_on(arc, duration)), missed)
    return jnp.where(leg.real, there, jnp.append(y, duration))


class Cycle(NamedTuple):
    """A cycle of arcs: what Newton's method solves for."""

    states: Float[Array, "arcs 4"]
    """At the starts of the arcs."""
    durations: Float[Array, "arcs"]
    phase: Number
    """Phase of the forcing at the start of the first arc, rad."""

    def phases(self, xi: Number) -> Float[Array, "arcs"]:
        """Phases of the forcing at the starts of the arcs, rad."""
        begun = jnp.cumsum(self.durations) - self.durations
        return self.phase + xi * begun

    def moved(self, step: Float[Array, "unknowns"]) -> Cycle:
        """The cycle less a Newton step."""
        n = self.durations.size
        states = self.states - step[: 4 * n].reshape(n, 4)
        return Cycle(states, self.durations - step[4 * n : 5 * n], self.phase - step[5 * n])


def residual(plant: Plant, legs: Leg, cycle: Cycle, span: Number) -> Float[Array, "unknowns"]:
    """The residual of a cycle: joints and events, arc by arc, and the durations' sum less `span`."""
    phases = cycle.phases(plant.linear.xi)
    ends = jax.vmap(traverse, (None, 0, 0, 0, 0))(plant, legs, cycle.states, phases, cycle.durations)
    return _missed(ends, cycle, span)


def _missed(ends: Float[Array, "arcs 5"], cycle: Cycle, span: Number) -> Float[Array, "unknowns"]:
    ends = ends.at[:, :4].add(-jnp.roll(cycle.states, -1, axis=0))
    return jnp.append(ends.ravel(), jnp.sum(cycle.durations) - span)


class Blocks(NamedTuple):
    """The derivatives of `traverse`; leading axis the arcs."""

    by_state: Float[Array, "arcs 5 4"]
    by_phase: Float[Array, "arcs 5"]
    by_time: Float[Array, "arcs 5"]


def linearise(plant: Plant, legs: Leg, cycle: Cycle) -> tuple[Float[Array, "arcs 5"], Blocks]:
    """`traverse` on every arc, and its derivatives."""

    def along(leg: Leg, *start: Array) -> tuple[Array, tuple]:
        def twice(*start: Array) -> tuple[Array, Array]:
            end = traverse(plant, leg, *start)
            return end, end

        slopes, end = jax.jacfwd(twice, (0, 1, 2), has_aux=True)(*start)
        return end, slopes

    ends, slopes = jax.vmap(along)(legs, cycle.states, cycle.phases(plant.linear.xi), cycle.durations)
    return ends, Blocks(*slopes)


def jacobian(blocks: Blocks, xi: Number) -> Float[Array, "unknowns unknowns"]:
    """The derivative of `residual`."""
    # The phase at the start of an arc is that of the cycle plus xi times all earlier durations. The
    # derivative in the durations is therefore lower triangular and not diagonal, which is what `earlier`
    # stands for.
    n = blocks.by_time.shape[0]
    here, earlier = jnp.eye(n), jnp.tril(jnp.ones((n, n)), -1)
    following = jnp.roll(here, 1, axis=1)
    states = here[:, None, :, None] * blocks.by_state[:, :, None, :]
    states = states - following[:, None, :, None] * jnp.eye(5, 4)[None, :, None, :]
    times = here[:, None, :] * blocks.by_time[:, :, None]
    times = times + xi * earlier[:, None, :] * blocks.by_phase[:, :, None]
    upper = [states.reshape(5 * n, 4 * n), times.reshape(5 * n, n), blocks.by_phase.reshape(5 * n, 1)]
    last = jnp.concatenate([jnp.zeros(4 * n), jnp.ones(n), jnp.zeros(1)])
    return jnp.concatenate([jnp.concatenate(upper, axis=1), last[None]])


class Polished(NamedTuple):
    """A cycle that Newton's method has arrived at."""

    cycle: Cycle
    blocks: Blocks
    """Derivatives at the last step."""
    moved: Number
    """How far that step went, in shares of the scales."""


def polish(plant: Plant, legs: Leg, guess: Cycle, span: Number, scale: State) -> Polished:
    """Newton's method from a guess, to the last step but one."""
    # Shooting over a whole period multiplies errors by the growth of every arc and divides them by the rate
    # at which every event is met. Here durations and states of all arcs are unknowns at once, so that a step
    # needs only the linear map of each arc by itself, and stays regular where an event is met at zero rate.
    n, xi = guess.durations.size, plant.linear.xi
    sizes = jnp.concatenate([jnp.tile(scale, n), span * jnp.ones(n), jnp.ones(1)])

    def going(carry: tuple[Polished, Array]) -> Bool[Array, ""]:
        return (carry[0].moved > _CONVERGED) & (carry[1] < NEWTON_STEPS)

    def improve(carry: tuple[Polished, Array]) -> tuple[Polished, Array]:
        cycle, count = carry[0].cycle, carry[1]
        ends, blocks = linearise(plant, legs, cycle)
        step = jnp.linalg.solve(jacobian(blocks, xi), _missed(ends, cycle, span))
        return Polished(cycle.moved(step), blocks, jnp.max(jnp.abs(step) / sizes)), count + 1

    none = Blocks(jnp.zeros((n, 5, 4)), jnp.zeros((n, 5)), jnp.zeros((n, 5)))
    first = Polished(guess, none, jnp.asarray(jnp.inf))
    return jax.lax.while_loop(going, improve, (first, jnp.zeros((), int)))[0]


def polished_cycle(plant: Plant, legs: Leg, near: Polished, span: Number) -> Cycle:
    """The last step, which carries the cycle's derivative with respect to plant and span."""
    # The implicit function theorem in one line: at the root dx = -J^-1 dR, and one Newton step with J held
    # fixed has this derivative, whatever way led to the root. Newton's loop itself is never differentiated.
    late = residual(plant, legs, near.cycle, span)
    return near.cycle.moved(jnp.linalg.solve(jacobian(near.blocks, stop_gradient(plant.linear.xi)), late))


def monodromy(plant: Plant, legs: Leg, cycle: Cycle, blocks: Blocks) -> Float[Array, "4 4"]:
    """The derivative of the map over the whole cycle, cut just after the start of its first arc:
    the arcs' flows, and the saltation matrices and projections of their events."""

    def leaving(leg: Leg, y: State, phase: Number) -> State:
        arc = leg.launch(plant, y, phase)[0]
        rates = [arc.tilt.rate(arc.rates), arc.bob.rate(arc.rates)]
        rates.extend([r.rate(arc.rates) for r in rates])
        now = arc.at(jnp.zeros_like(phase))
        return jnp.stack([r.at(now) for r in rates])

    # An event met late by dt shifts the state by dt times the difference of the rates before and after it.
    # With dt = -(derivative of the event's signal)/(its rate) that is the saltation matrix of each link.
    rates = jax.vmap(leaving)(legs, cycle.states, cycle.phases(plant.linear.xi))
    # What follows the last arc in use is the first one, not the padding.
    last = legs.real & ~jnp.roll(legs.real, -1)
    after = jnp.where(last[:, None], rates[0][None], jnp.roll(rates, -1, axis=0))
    late = -blocks.by_state[:, 4] / jnp.where(legs.real, blocks.by_time[:, 4], 1.0)[:, None]
    links = blocks.by_state[:, :4] + (blocks.by_time[:, :4] - after)[:, :, None] * late[:, None, :]
    links = jnp.where(legs.real[:, None, None], links, jnp.eye(4)[None])
    return jax.lax.fori_loop(0, legs.real.size, lambda i, m: links[i] @ m, jnp.eye(4))


class Survey(NamedTuple):
    """Extremes on an arc between its events; in a sequence with a leading axis."""

    inside: Bool[Array, "..."]
    """Whether both signals stay positive."""
    dip: Float[Array, "..."]
    """The least of the signals where they have a dent, over their largest; infinite without one."""
    reach: Float[Array, "..."]
    """Largest |psi|."""
    share: Float[Array, "..."]
    """Share of the duration after which it is met: the derivative of |psi| at this share is that of
    the largest, as 0 and 1 are events and in between the bob turns."""
    last: Float[Array, "... 4"]
    """The state just before the event at the end."""


def survey(plant: Plant, leg: Leg, y: State, phase: Number, duration: Number) -> Survey:
    """Follow an arc, sampled with its derivatives: what peaks between two samples is found from these."""
    arc, signals = leg.launch(plant, y, phase)

    def look(t: Number) -> tuple[Array, Array]:
        now = arc.at(t)
        slopes = [s.rate(arc.rates).at(now) for s in signals]
        return jnp.stack([s.at(now) for s in signals]), jnp.stack(slopes)

    values, slopes = jax.vmap(look)(duration * jnp.linspace(0.0, 1.0, SAMPLES + 1))
    largest = jnp.maximum(jnp.max(jnp.abs(values), axis=0), 1e-300)[None]
    low, dented = _dents(values / largest, slopes / largest, duration / SAMPLES)
    # Signals that end an arc, or began it, vanish there up to rounding.
    slack = _ROUNDING + _NOISE / largest
    inside = jnp.all(jnp.minimum(values[:-1] / largest, low) > -slack) & (duration > 0)
    inside = inside & jnp.all(values[-1:] / largest > -slack)
    dip = jnp.min(jnp.where(dented, low, jnp.inf)[1:-1])
    reach, share = _reach(arc, duration)
    dip, reach = jnp.where(leg.real, dip, jnp.inf), jnp.where(leg.real, reach, 0.0)
    return Survey(inside | ~leg.real, dip, reach, share, state_on(arc, duration))


def _dents(values: Array, slopes: Array, width: Number) -> tuple[Array, Bool[Array, "..."]]:
    """The least value of each window where the slope changes from - to +, and where it does;
    leading axis the samples, or the windows between them."""
    # Values at the samples alone would miss a signal that dips below zero between two of them. The slope at
    # both ends tells whether there is a least value within, and the tangents say how low it can be.
    falling, rising = slopes[:-1], slopes[1:]
    dented = (falling < 0) & (rising > 0)
    share = falling / jnp.where(dented, falling - rising, 1.0)
    from_left = values[:-1] + 0.5 * falling * share * width
    from_right = values[1:] - 0.5 * rising * (1.0 - share) * width
    # A release leaves with no acceleration: seen from afar its start would look like a dent.
    return jnp.where(dented, jnp.where(share < 0.5, from_left, from_right), jnp.inf), dented


def _reach(arc: Arc, duration: Number) -> tuple[Array, Array]:
    """The largest |psi| on an arc, and at which share of its duration: at an end, or where psi' changes
    sign between two samples."""
    rate = arc.bob.rate(arc.rates)
    pull = rate.rate(arc.rates)
    shares = jnp.linspace(0.0, 1.0, SAMPLES + 1)
    rates = jnp.asarray(jax.vmap(lambda share: rate.at(arc.at(share * duration)))(shares))
    turns = rates[:-1] * rates[1:] < 0
    along = rates[:-1] / jnp.where(turns, rates[:-1] - rates[1:], 1.0)

    def nearer(_: Array, share: Number) -> Number:
        now = arc.at(share * duration)
        slope = pull.at(now) * duration
        return jnp.clip(share - rate.at(now) / jnp.where(slope == 0.0, 1.0, slope), 0.0, 1.0)

    inner = jax.vmap(lambda share: jax.lax.fori_loop(0, 3, nearer, share))(shares[:-1] + along / SAMPLES)
    met = jnp.concatenate([shares[:1], jnp.where(turns, inner, 0.0), shares[-1:]])
    sizes = jnp.abs(jax.vmap(lambda share: arc.bob.at(arc.at(share * duration)))(met))
    best = jnp.argmax(sizes)
    return sizes[best], met[best]
