"""The events of a motion, found one after the other by `tpd.exact.flow`, and one period cut out of them."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from tpd.core.parameters import Number, State
from tpd.exact.arc import classify, ending
from tpd.exact.contact import REST, SLIP, Mode
from tpd.exact.flow import Motion, arrived, leap, start
from tpd.exact.modes import Plant
from tpd.exact.multiple_shooting import LANDING, RELEASE, TURN, Cycle, Leg, state_on

_LEAPS = 32
"""Leaps of the flow allowed for each event; most take one or two."""


class Recording(NamedTuple):
    """Events in order; leading axis `room`."""

    mode: Mode
    """After the event."""
    state: Float[Array, "room 4"]
    """After the event."""
    time: Float[Array, "room"]
    ending: Int[Array, "room"]
    """Which kind of event it is."""
    met: Int[Array, ""]
    """How many."""
    last: Mode
    """At the end of the recording."""
    lost: Bool[Array, ""]
    """Whether the tilt grew beyond return."""
    overflow: Bool[Array, ""]
    """Whether the recording ended for want of room."""


def record(plant: Plant, y0: State, span: Number, *, room: int, capture_speed: Number) -> Recording:
    """The events of the motion from `y0` at tau = 0, up to tau = `span`; no more than `room`.

    An impact slower than `capture_speed` that the block can be held after counts as rest.
    """

    def going(carry: tuple[Motion, Recording]) -> Bool[Array, ""]:
        m, log = carry
        return ~arrived(m, span) & ~m.lost & (log.met < room) & (m.steps < _LEAPS * room)

    def step(carry: tuple[Motion, Recording]) -> tuple[Motion, Recording]:
        m, log = carry
        after = leap(plant, m, span, capture_speed=capture_speed, watch_bob=False)
        # A leap that meets no event moves on along its arc; an event begins a new one.
        met = after.local == 0.0
        i = jnp.where(met, log.met, room)
        new = (_plain(after.mode), state_on(after.arc, after.local), after.begun, _event(plant, m, after))
        old = (log.mode, log.state, log.time, log.ending)
        buffers = jax.tree.map(lambda a, b: a.at[i].set(b, mode="drop"), old, new)
        return after, log._replace(
            **dict(zip(("mode", "state", "time", "ending"), buffers, strict=True)), met=log.met + met
        )

    ints, floats, no = jnp.zeros(room, int), jnp.zeros(room), jnp.zeros((), bool)
    zero = jnp.zeros_like(plant.linear.xi)
    mode = classify(plant, y0, zero)
    motion = start(plant, mode, y0, zero)
    none = jax.tree.map(lambda x: jnp.zeros(room, x.dtype), mode)
    empty = Recording(none, jnp.zeros((room, 4)), floats, ints, jnp.zeros((), int), mode, no, no)
    motion, log = jax.lax.while_loop(going, step, (motion, empty))
    cut_short = ~arrived(motion, span) & ~motion.lost
    return log._replace(last=_plain(motion.mode), lost=motion.lost, overflow=cut_short)


def _plain(mode: Mode) -> Mode:
    """A mode without the signs that mean nothing in it."""
    tilt = jnp.where(mode.kind == REST, 0.0, mode.tilt_sign)
    return Mode(mode.kind, tilt, jnp.where(mode.kind == SLIP, mode.rate_sign, 0.0))


def _event(plant: Plant, m: Motion, after: Motion) -> Int[Array, ""]:
    """The kind of the event between two arcs: of the signals, the smaller one vanished there."""
    now = m.arc.at(after.begun - m.begun)
    first, second = (jnp.abs(s.at(now)) for s in ending(plant, m.mode, m.arc))
    return jnp.where(m.mode.kind == SLIP, jnp.where(first <= second, TURN, LANDING), RELEASE)


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
    # Two periods are recorded so that one whole period lies around any cut. An event at the cut itself would
    # belong to both sides or to none by rounding; the middle of the longest arc is as far from all events as
    # can be.
    r, room = recording, recording.time.size
    index = jnp.arange(room)
    known = index < r.met
    gaps = jnp.where(known & (index + 1 < r.met) & (r.time <= span), jnp.roll(r.time, -1) - r.time, -1.0)
    before = jnp.argmax(gaps)
    middle = r.time[before] + 0.5 * gaps[before]
    count = jnp.sum(known & (r.time > middle) & (r.time <= middle + span))
    place = jnp.arange(size)
    real = place < count
    here = jnp.where(real, before + 1 + place, before + 1) % room
    following = jnp.where(place + 1 < count, here + 1, before + 1) % room
    mode = jax.tree.map(lambda x: x[here], r.mode)
    onward = jax.tree.map(lambda x: x[following], r.mode)
    signs = (mode.kind, mode.tilt_sign, mode.rate_sign)
    legs = Leg(*signs, r.ending[following], onward.kind, onward.rate_sign, real)
    lasted = r.time[following] - r.time[here] + jnp.where(place + 1 == count, span, 0.0)
    cycle = Cycle(r.state[here], jnp.where(real, lasted, 0.0), xi * r.time[before + 1])
    same = jax.tree.map(lambda x: x[before] == x[(before + count) % room], r.mode)
    closed = jnp.all(jnp.stack(jax.tree.leaves(same))) & (count > 0) & (gaps[before] > 0)
    return Found(legs, cycle, closed & ~r.lost, r.overflow | (count > size))
