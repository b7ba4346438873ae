"""A second opinion on the nonlinear equations: true signs, integrated by diffrax from event to event.

Between two events the vector field is smooth, which an ODE solver asks for; at an event the segment
ends, what happens there is decided as in the exact solution, and the next one begins. This is how the
nonlinear equations (4), which have no closed form, are solved without smoothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Float, Int

from tests.contact import REST, SLIP, STICK, Mode, decide, excess, held_rates, released, transversality_of
from tpd.core import checks
from tpd.exact.runs import Settled
from tpd.exact.terms import SWING, SWING_RATE, TILT, TILT_RATE
from tpd.models.base import MOST_PERIODS, AbstractFlow, Cycle, setting
from tpd.models.settling import Period, settle
from tpd.scene.impacts import bob_change, velocity_ratio
from tpd.scene.parameters import Parameters
from tpd.scene.pytrees import Number, State
from tpd.scene.status import Status
from tpd.theory.equations import Equations, Terms

_LANDING, _TURN, _BOB, _LOST = 0, 1, 2, 3
"""Events of a slipping block; of a held one the first two are its releases to either side."""

_Leg = Callable[[State, Any, Number, Number], tuple[State, Any, Status]]
"""(state, mode, begin, end) to (state, mode, status) at `end`: times since the beginning of a period, at most
one period; the status is rocking if all went well."""
_ROUNDING = 1e-10
"""Share of a period by which a time may lie before the beginning of the period that it counts to, so that
a time that rounding has put just before a period's end needs no leg of its own."""
_STILL = 1e-3
"""Share of its scale by which the bob's swing may change in a period under a block called at rest."""

_GRACE = 1e-13
"""How far below zero a signal goes before it counts: what begins at zero is not over at once, and an
event within the first step after it is seen."""

_ROOT = optimistix.Bisection(rtol=1e-14, atol=1e-14)
"""Finds an event within a step. A signal may begin the step at zero, where Newton's method would end
after a short hop; between the signs at both ends there is the event."""


class _Run(NamedTuple):
    """A motion on its way through a period."""

    time: Number
    y: State
    mode: Mode
    way: Number
    """Sign of psi'."""
    up: Number
    """Largest phi met at a turn, not below zero."""
    down: Number
    swing: Number
    segments: Int[Array, ""]
    lost: Bool[Array, ""]
    held: Bool[Array, ""]
    transversality: Number
    """See `Cycle`."""


class Segmented(AbstractFlow):
    """True signs, by default of the nonlinear equations (4); the bound on the solver's step is a
    sixteenth of a forcing period, so that an event that undoes itself within less may go unseen.

    As in the paper, a crossing of phi = 0 without loss leaves both rates as they are. At an impact with loss
    (e < 1) the rod pulls block and bob along itself; in the nonlinear equations this takes the bob's angle
    into account: see `tpd.scene.impacts`. With Housner's e it conserves the
    angular momentum of block and bob about the new corner.
    Of grazing this model sees only an event that it meets, so that in practice derivatives next to one are
    not refused as those of the exact model are.
    """

    terms: Terms = setting("terms", checks.instance, Terms.nonlinear, Terms)
    """Linear (25), with its parametric term, or nonlinear (4)."""
    solver: diffrax.AbstractSolver = eqx.field(default_factory=diffrax.Tsit5, kw_only=True)
    """Integrates transients and trajectories; the settled period uses `Dopri8`."""
    rtol: checks.Real = setting("rtol", checks.tolerance, 1e-7)
    """Relative tolerance of transients and trajectories; absolute is a hundredth of it."""
    cycle_rtol: checks.Real = setting("cycle_rtol", checks.tolerance, 1e-11)
    """Relative tolerance of the settled period, whose derivatives are used."""
    tolerance: checks.Real = setting("tolerance", checks.tolerance, 1e-5)
    """Repetition error at which following ends and Newton's method takes over."""
    rest_rate: checks.Real = setting("rest_rate", checks.tolerance, 1e-4)
    """An impact slower than this (phi' in units of nu) that the block can be held after is rest;
    the error is of the order of its square."""
    max_periods: checks.Whole = setting("max_periods", checks.count, 400, 1, MOST_PERIODS)
    max_events: checks.Whole = setting("max_events", checks.count, 2000, 1, 100_000)
    """Bound on the segments of one forcing period."""
    max_steps: checks.Whole = setting("max_steps", checks.count, 4096, 1, 100_000)
    """Bound on the solver steps of one segment."""

    @property
    def round_off(self) -> float:
        """Residual of the period map that counts as round-off."""
        return 10.0 * self.cycle_rtol

    def resolution(self, p: Parameters) -> Number:
        """Rest is exact here."""
        return jnp.zeros_like(jnp.asarray(p.nu))

    def check(self, p: Parameters) -> None:
        """Every valid set of parameters is representable."""

    def settle(self, p: Parameters, y0: State) -> Settled:
        """Integrate from `y0` at tau = 0, one forcing period after another, until they repeat."""
        equations = Equations(p, self.terms)

        def one_period(y: State, mode: Mode) -> Period:
            r = self._advance(equations, _begin(equations, y, mode, jnp.zeros(())), p.period)
            exhausted = r.segments >= self.max_events
            rests = _stays(p, r, y) & ~exhausted
            peak = jnp.maximum(r.up, r.down)
            amplitude = jnp.where(rests, jnp.abs(r.y[TILT]), peak)
            return Period(r.y, r.mode, amplitude, r.swing, rests, r.lost, exhausted, r.held, peak, r.swing)

        mode = _classify(equations, y0, jnp.zeros(()))
        return settle(one_period, p, y0, mode, tolerance=self.tolerance, max_periods=self.max_periods)

    def cycle(self, p: Parameters, settled: Settled, y: State) -> Cycle:
        """Integrate the settled periods from `y` with tight tolerance and forward sensitivities."""
        equations = Equations(p, self.terms)

        def one_period(y: State, mode: Mode) -> tuple:
            run = _begin(equations, y, mode, jnp.zeros_like(p.xi))
            r = self._advance(equations, run, p.period, precise=True)
            # Cut short, the motion stands where it stood: that is not to pass for an orbit.
            end = jnp.where(r.segments < self.max_events, r.y, jnp.nan)
            return end, r.mode, (r.up, r.down, r.swing), r.transversality

        return cycle_by_events(settled, y, one_period)

    def trajectory(
        self, p: Parameters, y0: State, times: Float[Array, "times"]
    ) -> tuple[Float[Array, "times 4"], Status]:
        """The states at `times`, from `y0` at `times[0]`; NaN once the block is lost."""
        equations = Equations(p, self.terms)

        def leg(y: State, mode: Mode, begin: Number, end: Number) -> tuple[State, Mode, Status]:
            r = _hurried(equations, self._advance(equations, _begin(equations, y, mode, begin), end), end)
            status = Status.where(r.lost, Status.overturned, Status.rocking)
            status = Status.where(r.segments >= self.max_events, Status.event_bound, status)
            # Numbers that are not finite: an overturning block is far, but somewhere.
            finite = jnp.all(jnp.isfinite(r.y))
            return r.y, r.mode, Status.where(finite, status, Status.failed)

        mode = _classify(equations, y0, _split(p, times)[1][0])
        return _through(p, y0, mode, times, leg)

    def _advance(self, equations: Equations, run: _Run, end: Number, *, precise: bool = False) -> _Run:
        """Segment after segment up to the time `end`."""

        def going(r: _Run) -> Bool[Array, ""]:
            left = stop_gradient(end) - stop_gradient(r.time)
            return (left > 1e-14 * equations.p.period) & ~r.lost & (r.segments < self.max_events)

        def step(r: _Run) -> _Run:
            time, y, met, failed = self._segment(equations, r, end, precise)
            # Two events at once: the second is over before its segment begins.
            over = jnp.min(stop_gradient(_signals(equations, r, r.time, r.y))) <= 0.0
            time, y, met = jnp.where(over, r.time, time), jnp.where(over, r.y, y), met | over
            arrived = _meet(equations, r, time, y, self.rest_rate)
            onward = r._replace(time=time, y=y)
            r = jax.tree.map(lambda a, b: jnp.where(met, a, b), arrived, onward)
            lost = r.lost | ~(jnp.abs(r.y[TILT]) < equations.beyond_return)
            return r._replace(segments=jnp.where(failed, self.max_events, r.segments + 1), lost=lost)

        r = jax.lax.while_loop(going, step, run)
        up, down = jnp.maximum(r.up, r.y[TILT]), jnp.maximum(r.down, -r.y[TILT])
        return r._replace(up=up, down=down, swing=jnp.maximum(r.swing, jnp.abs(r.y[SWING])))

    def _segment(
        self, equations: Equations, r: _Run, end: Number, precise: bool
    ) -> tuple[Number, State, Bool[Array, ""], Bool[Array, ""]]:
        """Time and state at the next event, or at `end`, whether there was one, and whether the solver ran
        out of steps."""
        p, slips = equations.p, r.mode.kind == SLIP

        def field(tau: Any, y: State, args: None) -> State:
            del args
            sine = jnp.sin(p.xi * tau)
            slip = equations.rates(y, r.mode.tilt_sign, r.mode.rate_sign, sine)
            return jnp.where(slips, slip, held_rates(equations, y, sine))

        def first(t: Number, y: State, args: None, **_: object) -> Number:
            del args
            return jnp.min(_signals(equations, r, t, y))

        rtol = self.cycle_rtol if precise else self.rtol
        # One function of all signals, their least, ends the segment: diffrax bisects one root at a time, and
        # which signal it was is asked afterwards. The bound dtmax keeps a step from passing two roots of one
        # signal; only between steps does the solver look at signs. `ForwardMode` carries the derivative of
        # the event's time along, because diffrax differentiates its root by the implicit function theorem.
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Dopri8() if precise else self.solver,
            r.time,
            end,
            1e-3 * p.period,
            r.y,
            saveat=diffrax.SaveAt(t1=True),
            stepsize_controller=diffrax.PIDController(rtol=rtol, atol=0.01 * rtol, dtmax=p.period / 16.0),
            adjoint=diffrax.ForwardMode(),
            event=diffrax.Event(first, _ROOT, direction=False),
            max_steps=self.max_steps,
            throw=False,
        )
        assert solution.ts is not None
        ys: Array = solution.ys  # type: ignore[assignment]
        failed = solution.result == diffrax.RESULTS.max_steps_reached
        # Out of steps: the motion stays where it was, and its period counts as having too many segments.
        time, y = jnp.where(failed, r.time, solution.ts[-1]), jnp.where(failed, r.y, ys[-1])
        return time, y, solution.result == diffrax.RESULTS.event_occurred, failed


def _signals(equations: Equations, r: _Run, tau: Number, y: State) -> Float[Array, "4"]:
    """Signals that stay positive until the next event, in sizes that compare."""
    p, linear = equations.p, equations.linear
    sine = jnp.sin(p.xi * tau)
    slip = jnp.stack([r.mode.tilt_sign * y[TILT], r.mode.rate_sign * y[TILT_RATE] / p.xi]) / p.nu
    rests = r.mode.kind == REST
    up = excess(equations, y, jnp.where(rests, 1.0, r.mode.tilt_sign), sine)
    low = excess(equations, y, jnp.where(rests, -1.0, r.mode.tilt_sign), sine)
    held = jnp.stack([linear.friction - up, linear.friction + low]) / linear.weight
    others = jnp.stack([r.way * y[SWING_RATE] / p.xi, equations.beyond_return - jnp.abs(y[TILT])])
    return jnp.concatenate([jnp.where(r.mode.kind == SLIP, slip, held), others]) + _GRACE


def _begin(equations: Equations, y: State, mode: Mode, time: Number) -> _Run:
    """A motion at its start."""
    xi = equations.p.xi
    # From rest the bob's first and second derivatives vanish: look a little ahead instead.
    ahead = held_rates(equations, y, jnp.sin(xi * time + 1e-3))[SWING_RATE]
    rate = stop_gradient(jnp.where(jnp.abs(y[SWING_RATE]) > 1e-12, y[SWING_RATE], ahead))
    way = jnp.where(rate < 0.0, -1.0, 1.0)
    none, zero = jnp.zeros((), bool), jnp.zeros_like(y[TILT])
    sizes = jnp.maximum(y[TILT], zero), jnp.maximum(-y[TILT], zero), jnp.abs(y[SWING])
    transversality = jnp.full_like(zero, jnp.inf)
    return _Run(time, y, mode, way, *sizes, jnp.zeros((), int), none, mode.kind != SLIP, transversality)


def _hurried(equations: Equations, r: _Run, end: Number) -> _Run:
    """A run that stopped within rounding of `end`, there: a leg without length too has derivatives."""
    # The loop stops short of `end` by rounding. This one Euler step over a length of rounding has the right
    # value and the right derivative in `end` and in the time of the last event.
    late = end - r.time
    late = jnp.where(jnp.abs(stop_gradient(late)) < 1e-9 * equations.p.period, late, 0.0)
    sine = jnp.sin(equations.p.xi * r.time)
    slip = equations.rates(r.y, r.mode.tilt_sign, r.mode.rate_sign, sine)
    rates = jnp.where(r.mode.kind == SLIP, slip, held_rates(equations, r.y, sine))
    return r._replace(y=r.y + late * rates)


def _classify(equations: Equations, y: State, time: Number) -> Mode:
    """The mode of a state."""
    return _decide(equations, y, jnp.sign(y[TILT]), jnp.sign(y[TILT_RATE]), jnp.sin(equations.p.xi * time))


def _decide(equations: Equations, y: State, tilt: Number, rate: Number, sine: Number) -> Mode:
    """The mode of a state of which the signs of phi and phi' are known, zero included."""
    up, down = (excess(equations, y, jnp.where(tilt == 0, s, tilt), sine) for s in (1.0, -1.0))
    return decide(up, down, equations.linear.friction, tilt, rate)


def _held_on_base(equations: Equations, y: State, sine: Number) -> Bool[Array, ""]:
    """Whether weight and friction would hold the block at phi = 0 if it did not move."""
    zero = jnp.zeros_like(y[TILT])
    return _decide(equations, y.at[TILT].set(0.0).at[TILT_RATE].set(0.0), zero, zero, sine).kind == REST


def _struck(equations: Equations, side: Number, y: State, sine: Number, rest_rate: float) -> State:
    """The state after an impact of a block that comes down from the tilt of sign `side`."""
    p, e = equations.p, equations.p.velocity_ratio
    nonlinear = equations.terms is Terms.nonlinear
    angle = (side, jnp.sin(y[SWING]), jnp.cos(y[SWING])) if nonlinear else (1.0, 0.0, 1.0)
    law = e, p.nu, p.mu, p.lam, equations.rho, *angle
    ratio = velocity_ratio(*law)
    rests = _held_on_base(equations, y, sine) & (ratio * jnp.abs(y[TILT_RATE]) <= rest_rate * p.nu)
    # All the impacts that are left: see `tpd.exact.contact_kernel.rates_after_impact`.
    ratio = jnp.where(rests, 0.0, ratio)
    bob = y[SWING_RATE] + bob_change(ratio, *law) * y[TILT_RATE]
    return jnp.stack([jnp.zeros_like(bob), y[SWING], ratio * y[TILT_RATE], bob])


def _meet(equations: Equations, r: _Run, time: Number, y: State, rest_rate: float) -> _Run:
    """The motion just after the event that it has arrived at."""
    p, before, which = equations.p, y, jnp.argmin(stop_gradient(_signals(equations, r, time, y)))
    sine, slips = jnp.sin(p.xi * time), r.mode.kind == SLIP
    landed, turned, bob = (slips & (which == i) for i in (_LANDING, _TURN, _BOB))
    bob = bob | (~slips & (which == _BOB))
    after = _struck(equations, r.mode.tilt_sign, y, sine, rest_rate)
    y = jnp.where(turned, y.at[TILT_RATE].set(0.0), jnp.where(bob, y.at[SWING_RATE].set(0.0), y))
    y = jnp.where(landed, after, y)
    tilt = jnp.where(landed | (r.mode.kind == REST), 0.0, r.mode.tilt_sign)
    onward = _decide(equations, y, tilt, jnp.where(landed, jnp.sign(y[TILT_RATE]), 0.0), sine)
    freed = released(r.mode, jnp.where(which == 0, 1.0, -1.0))
    mode = jax.tree.map(lambda a, b: jnp.where(slips, a, b), onward, freed)
    mode = jax.tree.map(lambda a, b: jnp.where(bob | (which == _LOST), a, b), r.mode, mode)
    flipped = bob | (landed & (y[SWING_RATE] * r.way < 0))
    met = _transversality(equations, r, before, which, mode, sine)
    return r._replace(
        time=time,
        y=y,
        mode=mode,
        way=jnp.where(flipped, -r.way, r.way),
        up=jnp.maximum(r.up, y[TILT]),
        down=jnp.maximum(r.down, -y[TILT]),
        swing=jnp.maximum(r.swing, jnp.abs(y[SWING])),
        lost=r.lost | (which == _LOST),
        held=r.held | (mode.kind != SLIP),
        transversality=jnp.minimum(r.transversality, met),
    )


def _transversality(
    equations: Equations, r: _Run, y: State, which: Int[Array, ""], after: Mode, sine: Number
) -> Number:
    """See `contact.transversality_of`."""
    xi = equations.p.xi
    usual = xi * equations.linear.weight
    bend = equations.rates(y, r.mode.tilt_sign, r.mode.rate_sign, sine)[TILT_RATE]
    turn = jnp.where(which == _TURN, bend, jnp.inf)
    crossing = jnp.where(which == _LANDING, y[TILT_RATE], jnp.inf)
    free = ~_held_on_base(equations, y, sine)
    return transversality_of(r.mode, after, turn, crossing, free, (xi * usual, usual))


def _stays(p: Parameters, r: _Run, before: State) -> Bool[Array, ""]:
    """Whether the block has rested, or been held leaning, for a whole period in which the bob's swing hardly
    changed. A bob that nothing damps beats for ever, and may move the block yet."""
    # There is no closed form of the bob's future here. If its swing changes by less than a thousandth in a
    # period that the block has spent at rest, what it may still gain cannot lift the block.
    change = jnp.max(jnp.abs(r.y - before) / ((p.nu + p.f) * jnp.array([1.0, 1.0, p.xi, p.xi])))
    rests = (r.mode.kind == REST) & (jnp.maximum(r.up, r.down) == 0.0)
    leans = (r.mode.kind == STICK) & (r.y[TILT] == before[TILT])
    return (rests | leans) & ((change < _STILL) | (p.mu == 0.0))


def _split(
    p: Parameters, times: Float[Array, "times"]
) -> tuple[Float[Array, "times"], Float[Array, "times"]]:
    """Whole forcing periods before `times`, and the times since, with all derivatives of the times and of
    the period."""
    # The phase xi tau itself loses a digit with every tenfold tau, and thresholds on event signals that are
    # exact at tau = 0 would meet that loss. Reduced by an integer number of periods, a late time has the
    # phase of an early one. The integer has no derivative; times and period keep theirs through the product.
    whole = stop_gradient(jnp.floor(times / p.period + _ROUNDING))
    return whole, times - whole * p.period


def _through(
    p: Parameters, y0: State, memory: Any, times: Float[Array, "times"], leg: _Leg
) -> tuple[Float[Array, "times 4"], Status]:
    """States at `times`, from `y0` at `times[0]`, in legs that end at each of these and at the end of each
    forcing period. After a leg that did not go well the states are NaN, and its status is returned."""
    whole, since = _split(p, times)

    def onward(carry: tuple, target: tuple[Number, Number]) -> tuple[tuple, State]:
        last, end = target

        def going(carry: tuple) -> Array:
            status, arrived = carry[-2:]
            return ~arrived & (status == Status.rocking)

        def piece(carry: tuple) -> tuple:
            count, begin, y, memory, *_ = carry
            arrives = count >= last
            y, memory, status = leg(y, memory, begin, jnp.where(arrives, end, p.period))
            begin = jnp.where(arrives, end, 0.0)
            return jnp.where(arrives, count, count + 1.0), begin, y, memory, status, arrives

        *motion, status, _ = jax.lax.while_loop(going, piece, (*carry, jnp.zeros((), bool)))
        carry = (*motion, status)
        return carry, jnp.where(status == Status.rocking, carry[2], jnp.nan)

    first = (whole[0], since[0], y0, memory, Status.rocking)
    carry, ys = jax.lax.scan(onward, first, (whole[1:], since[1:]))
    return jnp.concatenate([y0[None], ys]), carry[-1]


def cycle_by_events(
    settled: Settled,
    y: State,
    one_period: Callable[[State, Any], tuple[State, Any, tuple[Number, Number, Number], Number]],
) -> Cycle:
    """The settled periods from `y`, of a model that meets events: `one_period` of a state and a mode gives
    these at its end, the largest phi, -phi and |psi|, and the transversality."""

    def onward(_: Array, carry: tuple) -> tuple:
        y, mode, sizes, transversality = carry
        y, mode, now, met = one_period(y, mode)
        sizes = tuple(jnp.maximum(a, b) for a, b in zip(sizes, now, strict=True))
        return y, mode, sizes, jnp.minimum(transversality, met)

    zero = jnp.zeros_like(y[TILT])
    first = (y, settled.memory, (zero, zero, zero), jnp.full_like(zero, jnp.inf))
    y, mode, (up, down, swing), transversality = jax.lax.fori_loop(0, settled.periods, onward, first)
    amplitude = jnp.maximum(up, down)
    asymmetry = jax.lax.stop_gradient(jnp.abs(up - down) / jnp.where(amplitude > 0, amplitude, 1.0))
    return Cycle(y, amplitude, swing, mode, transversality, asymmetry, mode.equals(settled.memory))
