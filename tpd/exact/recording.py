"""The events of a motion, found one after the other on its closed-form arcs.

A signal that ends an arc is sampled with its slope, on windows that begin as short as a billionth of
the period and grow: the hops of a rattle fall between no two samples. Where the slope shows a dent
between two samples, its lowest point is looked at as well.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from tpd.exact.sequence import (
    LANDING,
    RELEASE,
    REST,
    SLIP,
    STICK,
    TURN,
    Arc,
    Cycle,
    Leg,
    Signals,
    arrive,
    launch,
    signals,
)
from tpd.exact.spectrum import Plant
from tpd.parameters import Number, State

_SHARES = np.concatenate([[0.0], np.geomspace(1e-9, 1.0 / 64.0, 20), np.arange(2, 65) / 64.0])
_ROOT_STEPS = 30


class Mode(NamedTuple):
    """Slip, stick or rest, and the signs of the tilt and of its rate."""

    kind: Int[Array, "..."]
    tilt: Float[Array, "..."]
    rate: Float[Array, "..."]

    def leg(self) -> Leg:
        """As an arc of which it is not known how it ends."""
        none, yes = jnp.zeros_like(self.kind), jnp.ones_like(self.kind, bool)
        return Leg(self.kind, self.tilt, self.rate, none, none, self.rate, yes)


def mode_of(plant: Plant, y: State, sine: Number, tilt: Number = 0.0) -> Mode:
    """The mode that a state starts in; `tilt` is the sign of phi where that is known although phi
    vanishes."""
    linear, still = plant.linear, y[2] == 0.0
    moment = linear.holding_moment(y, sine)
    sign = jnp.where(y[0] == 0.0, tilt, jnp.sign(y[0]))
    excess = moment - sign * linear.weight
    held = still & (jnp.abs(excess) <= linear.friction + jnp.where(sign == 0.0, linear.weight, 0.0))
    rate = jnp.where(still, jnp.sign(excess), jnp.sign(y[2]))
    kind = jnp.where(held, jnp.where(sign == 0.0, REST, STICK), SLIP)
    return Mode(kind, jnp.where(sign == 0.0, jnp.where(held, 0.0, rate), sign), jnp.where(held, 0.0, rate))


class Met(NamedTuple):
    """The next event: whether there is one before the horizon, when, and which signal vanished."""

    found: Bool[Array, ""]
    time: Number
    which: Int[Array, ""]


def next_event(plant: Plant, mode: Mode, y: State, phase: Number, horizon: Number) -> Met:
    """The first event on the arc that leaves `y`, at most `horizon` later."""
    leg = mode.leg()
    arc = launch(plant, leg, y, phase)
    watched = signals(plant, leg, arc)
    rates = plant.slip
    fastest = jnp.maximum(jnp.maximum(rates.xi, jnp.sqrt(jnp.abs(rates.q))), jnp.sqrt(plant.held.q))
    stretch = 2.0 * jnp.pi / fastest

    def going(carry: tuple[Number, Met]) -> Bool[Array, ""]:
        begun, met = carry
        return ~met.found & (begun < horizon)

    def look(carry: tuple[Number, Met]) -> tuple[Number, Met]:
        begun, _ = carry
        return begun + stretch, _first(watched, arc, begun + stretch * jnp.asarray(_SHARES))

    nothing = Met(jnp.zeros((), bool), jnp.zeros_like(stretch), jnp.zeros((), int))
    _, met = jax.lax.while_loop(going, look, (jnp.zeros_like(stretch), nothing))
    return met._replace(found=met.found & (met.time <= horizon))


def _first(watched: Signals, arc: Arc, times: Float[Array, "samples"]) -> Met:
    """The first zero of either signal among sampled times."""

    def look(t: Number) -> tuple[Array, Array]:
        return watched.at(arc, t), watched.slopes(arc, t)[0]

    values, slopes = jax.vmap(look)(times)
    low, high = times[:-1, None] * jnp.ones((1, 2)), times[1:, None] * jnp.ones((1, 2))
    dented = (slopes[:-1] < 0) & (slopes[1:] > 0) & (values[1:] >= 0)
    # A release leaves with no acceleration but rounding, whose sign means nothing.
    dented = dented.at[0].set(False)
    share = slopes[:-1] / jnp.where(dented, slopes[:-1] - slopes[1:], 1.0)
    signal = jnp.arange(2)
    bottoms = jax.vmap(jax.vmap(functools.partial(_bottom, watched, arc)), (0, 0, 0, None))
    bottom, lowest = bottoms(low, high, low + share * (high - low), signal)
    below = values[1:] < 0
    ended = below | (dented & (lowest < 0))
    index, found = jnp.argmax(ended, axis=0), jnp.any(ended, axis=0)
    end = jnp.where(below, high, bottom)[index, signal]
    root = jax.vmap(functools.partial(_root, watched, arc))(low[index, signal], end, signal)
    root = jnp.where(found, root, jnp.inf)
    return Met(jnp.any(found), jnp.min(root), jnp.argmin(root))


def _bottom(
    watched: Signals, arc: Arc, low: Number, high: Number, t: Number, which: Int[Array, ""]
) -> tuple[Number, Number]:
    """Where a signal's slope vanishes between two times, and its value there."""

    def step(_: Array, t: Number) -> Number:
        once, twice = watched.slopes(arc, t)
        return jnp.clip(t - once[which] / jnp.where(twice[which] == 0.0, 1.0, twice[which]), low, high)

    t = jax.lax.fori_loop(0, 3, step, t)
    return t, watched.at(arc, t)[which]


def _root(watched: Signals, arc: Arc, low: Number, high: Number, which: Int[Array, ""]) -> Number:
    """The zero between two times: Newton's method, kept inside by bisection."""

    def step(_: Array, carry: tuple[Number, Number, Number]) -> tuple[Number, Number, Number]:
        low, high, t = carry
        value, slope = watched.at(arc, t)[which], watched.slopes(arc, t)[0][which]
        low, high = jnp.where(value > 0, t, low), jnp.where(value > 0, high, t)
        onward = t - value / jnp.where(slope == 0.0, 1.0, slope)
        inside = (onward >= low) & (onward <= high)
        return low, high, jnp.where(inside, onward, 0.5 * (low + high))

    return jax.lax.fori_loop(0, _ROOT_STEPS, step, (low, high, high))[2]


class Recording(NamedTuple):
    """Events in order; leading axis `room`."""

    mode: Mode
    """After the event."""
    state: Float[Array, "room 4"]
    """After the event."""
    time: Float[Array, "room"]
    ending: Int[Array, "room"]
    """Which kind of event it is."""
    count: Int[Array, ""]
    last: Mode
    """At the end of the recording."""
    lost: Bool[Array, ""]
    """Whether the tilt grew beyond return."""


class _Now(NamedTuple):
    log: Recording
    y: State
    time: Number
    done: Bool[Array, ""]


def record(plant: Plant, y0: State, span: Number, *, room: int, quiet: Number) -> Recording:
    """The events of the motion from `y0` at tau = 0, up to tau = `span`; no more than `room`.

    An impact slower than `quiet` that the block can be held after counts as rest.
    """
    xi, limit = plant.linear.xi, plant.linear.beyond_return

    def going(now: _Now) -> Bool[Array, ""]:
        return ~now.done & (now.log.count < room)

    def step(now: _Now) -> _Now:
        log, phase = now.log, xi * now.time
        met = next_event(plant, log.last, now.y, phase, span - now.time)
        leg = log.last.leg()
        y = launch(plant, leg, now.y, phase).at(jnp.where(met.found, met.time, span - now.time))
        time = now.time + met.time
        ending, mode, after = _meet(plant, log.last, y, jnp.sin(xi * time), met.which, quiet)
        lost = ~(jnp.abs(y[0]) < limit)
        i = jnp.where(met.found, log.count, room)
        buffers = jax.tree.map(
            lambda old, new: old.at[i].set(new, mode="drop"),
            (log.mode, log.state, log.time, log.ending),
            (mode, after, time, ending),
        )
        last = jax.tree.map(lambda a, b: jnp.where(met.found, a, b), mode, log.last)
        log = Recording(*buffers, log.count + met.found, last, lost)
        return _Now(log, after, time, ~met.found | lost)

    ints, floats, no = jnp.zeros(room, int), jnp.zeros(room), jnp.zeros((), bool)
    first = mode_of(plant, y0, jnp.zeros_like(xi))
    empty = Recording(
        Mode(ints, floats, floats), jnp.zeros((room, 4)), floats, ints, jnp.zeros((), int), first, no
    )
    return jax.lax.while_loop(going, step, _Now(empty, y0, jnp.zeros_like(xi), no)).log


def _meet(
    plant: Plant, mode: Mode, y: State, sine: Number, which: Int[Array, ""], quiet: Number
) -> tuple[Int[Array, ""], Mode, State]:
    """The kind of an event, and mode and state after it."""
    linear = plant.linear
    slipping = mode.kind == SLIP
    ending = jnp.where(slipping, jnp.where(which == 0, TURN, LANDING), RELEASE)
    still = y.at[2].set(0.0).at[0].multiply(jnp.where(ending == LANDING, 0.0, 1.0))
    holds = jnp.abs(linear.holding_moment(still, sine)) <= linear.weight + linear.friction
    slow = plant.restitution * jnp.abs(y[2]) <= quiet
    rests = (ending == LANDING) & slow & holds
    leg = mode.leg()._replace(ending=ending, onward=jnp.where(rests, REST, SLIP))
    after = arrive(plant, leg, y)
    turned = mode_of(plant, after, sine, mode.tilt)
    landed = mode_of(plant, after, sine)
    way = jnp.where(which == 0, 1.0, -1.0)
    freed = Mode(jnp.full_like(mode.kind, SLIP), jnp.where(mode.kind == REST, way, mode.tilt), way)
    nothing = jnp.zeros_like(mode.tilt)
    resting = Mode(jnp.full_like(mode.kind, REST), nothing, nothing)
    landed = jax.tree.map(lambda a, b: jnp.where(rests, a, b), resting, landed)
    mode = jax.tree.map(
        lambda a, b, c: jnp.where(ending == TURN, a, jnp.where(ending == LANDING, b, c)),
        turned,
        landed,
        freed,
    )
    return ending, mode, after


class Found(NamedTuple):
    """One period of a recorded motion, as a guess for Newton's method."""

    legs: Leg
    cycle: Cycle
    closed: Bool[Array, ""]
    """Whether the sequence ends in the mode that it began with."""
    overflow: Bool[Array, ""]
    """Whether there were more events than places."""


def cut(recording: Recording, span: Number, xi: Number, size: int) -> Found:
    """The events of one period `span` out of a recording of two, in `size` places.

    The cut lies in the middle of the longest arc, where no event can fall on the wrong side of it.
    """
    r, room = recording, recording.time.size
    index = jnp.arange(room)
    known = index < r.count
    gaps = jnp.where(known & (index + 1 < r.count) & (r.time <= span), jnp.roll(r.time, -1) - r.time, -1.0)
    before = jnp.argmax(gaps)
    middle = r.time[before] + 0.5 * gaps[before]
    count = jnp.sum(known & (r.time > middle) & (r.time <= middle + span))
    place = jnp.arange(size)
    real = place < count
    here = jnp.where(real, before + 1 + place, before + 1) % room
    following = jnp.where(place + 1 < count, here + 1, before + 1) % room
    mode = jax.tree.map(lambda x: x[here], r.mode)
    onward = jax.tree.map(lambda x: x[following], r.mode)
    legs = Leg(*mode, r.ending[following], onward.kind, onward.rate, real)
    lasted = r.time[following] - r.time[here] + jnp.where(place + 1 == count, span, 0.0)
    cycle = Cycle(r.state[here], jnp.where(real, lasted, 0.0), xi * r.time[before + 1])
    a, b = (jax.tree.map(lambda x, i=i: x[i], r.mode) for i in (before, (before + count) % room))
    closed = (
        jnp.all(jnp.stack([x == y for x, y in zip(a, b, strict=True)])) & (count > 0) & (gaps[before] > 0)
    )
    return Found(legs, cycle, closed & ~r.lost, (r.count >= room) | (count > size))
