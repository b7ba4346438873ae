"""The exact piecewise solution of the linear equations, with true signs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from tpd.core import checks
from tpd.core.parameters import Number, Parameters, State
from tpd.core.status import Status
from tpd.exact.arc import classify
from tpd.exact.contact import REST, STICK, Mode
from tpd.exact.flow import (
    Motion,
    advance,
    arrived,
    held_at_rest,
    held_leaning,
    leap,
    settled_at_rest,
    start,
    state_at,
)
from tpd.exact.modes import Plant
from tpd.exact.signal import Growth
from tpd.exact.trigonometry import kept
from tpd.models import compiled_linear
from tpd.models.base import AbstractModel, Cycle, Settled
from tpd.models.clock import split, through
from tpd.models.settling import Period, Record, blank, cycle_by_events, scale_of

_LEAPS = 6
"""Leaps between two looks at whether a period has ended; most periods take about as many."""
_ROUNDING = 1e-12
"""Differences of times below this share of a period are rounding."""


class Lane(eqx.Module):
    """A motion being followed, and what its last periods did."""

    motion: Motion
    record: Record
    grown: Number | None = None
    """Time at which the shaking reaches its full size, counted from the start of the running period;
    None if it was sudden for all motions of a batch, which then costs nothing."""


def _growing(p: Parameters, begin: Number, ramp: Number) -> tuple[Number, Growth]:
    """When shaking that grows over `ramp` periods from tau = 0 has its full size, and its growth from
    `begin` on."""
    grown = jnp.asarray(ramp, dtype=jnp.float64) * p.period
    rate = 1.0 / jnp.where(grown > 0.0, grown, 1.0)
    return grown, _levelling(Growth(begin * rate, rate), jnp.asarray(grown <= begin))


def _levelling(growth: Growth, over: Bool[Array, ""]) -> Growth:
    """The growth, or full size where it is over."""
    return Growth(jnp.where(over, 1.0, growth.share), jnp.where(over, 0.0, growth.rate))


def _grows(m: Motion) -> Bool[Array, ""]:
    """Whether a motion is on an arc under growing shaking."""
    return jnp.zeros((), bool) if m.arc.growth is None else jnp.asarray(m.arc.growth.rate > 0.0)


def _next_stop(p: Parameters, lane: Lane) -> tuple[Number, Bool[Array, ""]]:
    """Until when to follow a motion at most: the end of its period or, before that, of the growth; and
    whether it is that of the growth."""
    if lane.grown is None:
        return p.period, jnp.zeros((), bool)
    knee = _grows(lane.motion) & (lane.grown < (1.0 - _ROUNDING) * p.period)
    return jnp.where(knee, lane.grown, p.period), knee


def _forgetful(record: Record, grew: Bool[Array, ""]) -> Record:
    """A record for which nothing repeats itself that was met before the shaking became steady."""
    past = record.past.at[1:].set(jnp.where(grew, jnp.inf, record.past[1:]))
    return record._replace(past=past, repeats=jnp.where(grew, 0, record.repeats))


class Piecewise(AbstractModel):
    """Closed-form arcs joined at their events: no smoothing and no time-step error.

    Arcs slip in all four sign combinations, stick off the base, or rest on it. An impact slower
    than `rest_rate` (phi' in units of nu) that the block can be held after counts as rest, which
    ends rattling; the error is of the order of its square.
    """

    max_periods: int = eqx.field(default=500, static=True, kw_only=True)
    """Forcing periods to follow before giving up on a repetition."""
    max_events: int = eqx.field(default=2000, static=True, kw_only=True)
    """Bound on the steps and events of one forcing period."""
    tolerance: float = eqx.field(default=1e-6, static=True, kw_only=True)
    """Repetition error at which following ends and Newton's method takes over."""
    rest_rate: float = eqx.field(default=2e-7, static=True, kw_only=True)
    lyapunov_periods: int = eqx.field(default=100, static=True, kw_only=True)
    """Periods over which the separation of neighbours is measured, should a motion not repeat."""
    kernel: bool = eqx.field(default=True, static=True, kw_only=True)
    """Whether compiled scalar code is used on a processor, where it can be; else a program of JAX."""

    def __check_init__(self) -> None:
        checks.count("max_periods", self.max_periods)
        checks.count("max_events", self.max_events)
        checks.count("lyapunov_periods", self.lyapunov_periods, least=0)
        checks.positive("tolerance", self.tolerance)
        checks.positive("rest_rate", self.rest_rate)

    def check(self, p: Parameters) -> None:
        """Every valid set of parameters is representable."""

    @property
    def round_off(self) -> float:
        """Residual of the period map that counts as round-off."""
        return 1e-14

    def resolution(self, p: Parameters) -> Number:
        """Rest is exact here."""
        return jnp.zeros_like(jnp.asarray(p.nu))

    def _settings(self, p: Parameters) -> dict:
        return {"capture_speed": self.rest_rate * p.nu, "max_steps": self.max_events}

    def settle(self, p: Parameters, y0: State) -> Settled:
        """Follow the motion from `y0` at tau = 0 until it repeats or rests for good."""
        limits = self.max_periods, self.max_events, self.tolerance, self.rest_rate
        return self._choose(lambda p, y: compiled_linear.settle(p, y, *limits), self.program_settle, p, y0)

    def _choose(self, kernel: Callable[..., Any], program: Callable[..., Any], *operands: Any) -> Any:
        return compiled_linear.on_platform(kernel, program, *operands) if self.kernel else program(*operands)

    def program_settle(self, p: Parameters, y0: State) -> Settled:
        """`settle` as a program of JAX."""
        return self.follow(p, self.lane(p, y0), self.max_periods).record.settled()

    def lane(self, p: Parameters, y0: State, begin: Number = 0.0, ramp: Number | None = None) -> Lane:
        """A motion that is about to begin at tau = `begin`, within the first forcing period, under shaking
        that is sudden or grows over `ramp` forcing periods; one that can never lift is done already."""
        full, begin = Plant(p), jnp.asarray(begin)
        phase, sine = p.xi * begin, jnp.sin(p.xi * begin)
        grown, growth = (None, None) if ramp is None else _growing(p, begin, ramp)
        mode = classify(full, y0, sine if growth is None else growth.share * sine)
        motion, record = start(full, mode, y0, phase, growth), blank(y0, mode)
        motion = eqx.tree_at(lambda m: m.begun, motion, jnp.zeros_like(motion.begun) + begin)
        rests, reach = settled_at_rest(full, motion)
        rests = rests & ~_grows(motion)
        still = record._replace(
            y=self._at_rest(full, p, y0),
            strokes=jnp.full_like(record.strokes, reach),
            rests=rests,
            peak_stroke=jnp.maximum(record.peak_stroke, reach),
        )
        record = jax.tree.map(lambda a, b: jnp.where(rests, a, b), still, record)
        return Lane(motion, record, grown)

    def follow(
        self, p: Parameters, lane: Lane, periods: Int[Array, ""] | int, leaps: int | None = None
    ) -> Lane:
        """Go on until the motion is done, `periods` have elapsed or, if given, after so many leaps.

        One loop over events, whatever the period they are in: in a batch no motion waits for the
        others at the end of its period.
        """
        full, scale = Plant(p), scale_of(p)

        def going(carry: tuple[Lane, Int[Array, ""]]) -> Bool[Array, ""]:
            lane, count = carry
            more = ~lane.record.done & (lane.record.elapsed < periods)
            return more if leaps is None else more & (count < leaps)

        def step(carry: tuple[Lane, Int[Array, ""]]) -> tuple[Lane, Int[Array, ""]]:
            lane, count = carry
            horizon, knee = _next_stop(p, lane)

            # A look at the end of a period computes its summary, in a batch also for motions that are not
            # there yet: a few leaps share one.
            def short(carry: tuple[Motion, Int[Array, ""]]) -> Bool[Array, ""]:
                m, leaps = carry
                return ~arrived(m, horizon) & ~m.lost & (leaps < _LEAPS)

            def onward(carry: tuple[Motion, Int[Array, ""]]) -> tuple[Motion, Int[Array, ""]]:
                m, leaps = carry
                return leap(full, m, horizon, watch_bob=True, capture_speed=self.rest_rate * p.nu), leaps + 1

            m = jax.lax.while_loop(short, onward, (lane.motion, jnp.zeros((), int)))[0]
            over = m.lost | (m.steps >= self.max_events)
            ended = (arrived(m, horizon) & ~knee) | over
            period = self._summary(full, p, m)
            record = lane.record.add(period, scale, self.tolerance)
            if lane.grown is not None:
                record = _forgetful(record, _grows(m) | _grows(lane.motion))
            fresh, stale = self._next_period(full, p, lane, m, record), replace(lane, motion=m)
            if lane.grown is not None:
                levelled = self._levelled(full, p, m, horizon)
                reached = arrived(m, horizon) & knee & ~over
                motion = jax.tree.map(lambda a, b: jnp.where(reached, a, b), levelled, m)
                stale = replace(lane, motion=motion)
            return jax.tree.map(lambda a, b: jnp.where(ended, a, b), fresh, stale), count + 1

        return jax.lax.while_loop(going, step, (lane, jnp.zeros((), int)))[0]

    def _next_period(self, full: Plant, p: Parameters, lane: Lane, m: Motion, record: Record) -> Lane:
        """The lane at the beginning of its next period."""
        zero = jnp.zeros_like(p.xi)
        if lane.grown is None or m.arc.growth is None:
            return replace(lane, motion=start(full, m.mode, record.y, zero), record=record)
        grown = lane.grown - p.period
        growth = _levelling(
            m.arc.growth.after(p.period - m.begun), jnp.asarray(grown <= _ROUNDING * p.period)
        )
        return Lane(start(full, m.mode, record.y, zero, growth), record, grown)

    def _levelled(self, full: Plant, p: Parameters, m: Motion, at: Number) -> Motion:
        """The motion going on under steady shaking from `at`, where the shaking has its full size."""
        # The end of the growth is not an event of the block: mode, peaks and counters go on, only the arc's
        # forcing is another one.
        now = jnp.stack([kept(x) for x in state_at(m, at)])
        growth = Growth(jnp.ones_like(at), jnp.zeros_like(at))
        again = start(full, m.mode, now, p.xi * at, growth)
        sizes = [jnp.maximum(getattr(again, n), getattr(m, n)) for n in ("up", "down", "stroke")]
        so_far = (at, *sizes, m.steps, m.held, m.bob_sign, m.transversality)

        def changed(n: Motion) -> tuple:
            return n.begun, n.up, n.down, n.stroke, n.steps, n.held, n.bob_sign, n.transversality

        return eqx.tree_at(changed, again, so_far)

    def _summary(self, plant: Plant, p: Parameters, m: Motion) -> Period:
        """The period that a motion has just completed; rest is for good only under steady shaking."""
        y = jnp.stack([kept(x) for x in state_at(m, p.period)])
        rests, reach = settled_at_rest(plant, m)
        leans, settled_reach = held_leaning(plant, m)
        peak = jnp.maximum(jnp.maximum(m.up, m.down), jnp.abs(y[0]))
        rattles_out = self._rattles_out(plant, p, m, peak)
        reach = jnp.where(leans & ~rattles_out, settled_reach, reach)
        rests = (rests | leans | rattles_out) & ~_grows(m) & jnp.all(jnp.isfinite(y))
        mode = eqx.tree_at(lambda n: n.kind, m.mode, jnp.where(rattles_out & rests, REST, m.mode.kind))
        y = jnp.where(rattles_out, y.at[0].set(0.0), y)
        y = jnp.where(rests, self._at_rest(plant, p, y), y)
        peak_stroke = jnp.where(rests, jnp.maximum(reach, m.stroke), m.stroke)
        amplitude, stroke = jnp.where(rests, jnp.abs(y[0]), peak), jnp.where(rests, reach, m.stroke)
        exhausted = m.steps >= self.max_events
        return Period(y, mode, amplitude, stroke, rests, m.lost, exhausted, m.held, peak, peak_stroke)

    def _rattles_out(self, plant: Plant, p: Parameters, m: Motion, peak: Number) -> Bool[Array, ""]:
        """Whether friction holds the block all but on its base, under a bob that cannot lift it from there.
        Where friction outweighs the block, it stops and holds each hop: there are a few in each period, each
        smaller than the last, and no number of them ends in rest."""
        # A rattle with e < 1 comes to rest within finite time, and each impact below `rest_rate` is captured
        # at once. Hops under strong friction lack that limit: friction holds the block a little above its
        # base until the moment has turned, so that one hop takes a good part of a period. Below the tolerance
        # of a repetition they change nothing any more, and the block counts as at rest if the bob cannot lift
        # it from its base.
        low = (m.mode.kind == STICK) & (peak < self.tolerance * p.nu)
        dissipates = (p.k > 0.0) | (p.velocity_ratio < 1.0)
        return low & dissipates & (held_at_rest(plant, m)[0] > 0.0)

    def _at_rest(self, plant: Plant, p: Parameters, y: State) -> State:
        """The state at tau = 0 that a block at rest, or held leaning, for good comes to, from `y` there."""
        # Under a block that does not move the bob is a damped oscillator with one steady swing, which needs
        # no simulation: psi = s sin(xi tau) + c cos(xi tau), here at tau = 0. An undamped bob keeps its own
        # swing for ever.
        zero = jnp.zeros_like(p.xi)
        steady = jnp.stack([y[0], plant.swing[1], zero, p.xi * plant.swing[0]])
        return jnp.where(p.zeta > 0, steady, y)

    def cycle(self, p: Parameters, settled: Settled, y: State) -> Cycle:
        """Run the orbit's periods from `y`; derivatives pass through every event."""

        def kernel(p: Parameters, settled: Settled, y: State) -> Cycle:
            return compiled_linear.cycle(p, settled, y, self.max_events, self.rest_rate)

        return self._choose(kernel, self.program_cycle, p, settled, y)

    def program_cycle(self, p: Parameters, settled: Settled, y: State) -> Cycle:
        """`cycle` as a program of JAX."""
        plant, phase = Plant(p), jnp.zeros_like(p.xi)

        def one_period(y: State, mode: Mode) -> tuple:
            m, y = advance(plant, start(plant, mode, y, phase), p.period, watch_bob=True, **self._settings(p))
            # What ended before its period, for want of steps, is no orbit, though it may end where it began.
            y = jnp.where(m.steps < self.max_events, y, jnp.nan)
            return y, m.mode, (m.up, m.down, m.stroke), m.transversality

        return cycle_by_events(settled, y, one_period)

    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """The exact states at `times`, from `y0` at `times[0]`."""

        def kernel(p: Parameters, y0: State, times: Array) -> tuple[Array, Status]:
            return compiled_linear.trajectory(p, y0, times, self.max_events, self.rest_rate)

        return self._choose(kernel, self.program_trajectory, p, y0, times)

    def program_trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """`trajectory` as a program of JAX."""
        plant = Plant(p)

        def leg(y: State, mode: Mode, begin: Number, end: Number) -> tuple[State, Mode, Status]:
            m = start(plant, mode, y, p.xi * begin)
            m, y = advance(plant, m, end - begin, **self._settings(p))
            status = Status.where(m.steps >= self.max_events, Status.event_bound, Status.rocking)
            return y, m.mode, Status.where(m.lost, Status.overturned, status)

        since = split(p, times)[1][0]
        return through(p, y0, classify(plant, y0, jnp.sin(p.xi * since)), times, leg)
