"""The event-driven flow: arc after arc, with no event missed and no time-step error.

Within an arc every signal g is a closed form, and so is a bound b3 on |g'''| over a window d.
Hence g >= g0 + g1 t + (g2 - b3 d/3) t^2/2 for 0 <= t <= d, and the first root of that parabola
is a step that cannot pass an event. Such steps shrink quadratically onto the first root of the
first signal, however close the next one lies. Only phi' = 0 and phi = 0 end a slip arc, and a
tilt is monotone between zeros of its rate, so nothing lies hidden between two samples.

Derivatives (forward mode) pass through an event by one Newton step on its time, which leaves the
value alone and carries the saltation matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Int

from tpd.core.parameters import Number, Numbers, State
from tpd.exact.arc import Arc, ending, ends, held_on_base, launch
from tpd.exact.contact import REST, SLIP, STICK, Mode, transversality_of
from tpd.exact.modes import Plant, Rates
from tpd.exact.signal import Growth, Instant, Signal
from tpd.exact.trigonometry import kept, turn

_NEAR = 1e-8
"""A safe step below this share of the horizon (at most a forcing period) has all but reached the event: one
Newton step, whose error is of its square, then does the rest."""
_STRAIGHT = 1e-3
"""A signal that bends less than this share on its way to zero is left to Newton's method."""
_REACHED = 1e-15
"""Share of the horizon below which a remaining time is rounding."""
_INNER = 3
"""Safe steps taken before an event is looked at."""


class Motion(eqx.Module):
    """A running motion: the arc it is on, where on it, and what it has met so far."""

    mode: Mode
    arc: Arc
    begun: Number
    """Time at which the arc began, counted from the start of the period."""
    local: Number
    """Time on the arc."""
    bob_sign: Number
    up: Number
    """Largest phi met at a turning point, not below zero."""
    down: Number
    """Largest -phi met at a turning point, not below zero."""
    stroke: Number
    """Largest |psi| met at a turning point of the bob."""
    steps: Int[Array, ""]
    lost: Bool[Array, ""]
    """Whether the tilt has grown beyond return."""
    held: Bool[Array, ""]
    """Whether the block was stuck or at rest for a while."""
    transversality: Number
    """The least rate at which the block's turns and free crossings were met, over xi^2 nu or xi nu."""


def start(
    plant: Plant, mode: Mode, y: State | Numbers, phase: Number, growth: Growth | None = None
) -> Motion:
    """A motion at the beginning of a period, or anywhere else, from a state and its mode, under shaking
    that is steady or grows."""
    state = jnp.asarray(y[0]), jnp.asarray(y[1]), jnp.asarray(y[2]), jnp.asarray(y[3])
    arc = launch(plant, mode, state, phase, growth)
    zero = jnp.zeros_like(state[0])
    # From rest the bob's first and second derivatives vanish: look a little ahead instead.
    ahead = arc.bob.rate(arc.rates).at(arc.at(1e-3 / plant.linear.xi))
    bob_rate = jnp.where(jnp.abs(state[3]) > 1e-12, state[3], ahead)
    bob_sign = jnp.where(bob_rate < 0.0, -1.0, 1.0)
    return Motion(
        mode,
        arc,
        zero,
        zero,
        stop_gradient(bob_sign),
        jnp.maximum(state[0], 0.0),
        jnp.maximum(-state[0], 0.0),
        jnp.abs(state[1]),
        jnp.zeros((), jnp.int32),
        jnp.zeros((), bool),
        mode.kind != SLIP,
        jnp.full_like(zero, jnp.inf),
    )


def advance(
    plant: Plant,
    motion: Motion,
    horizon: Number,
    *,
    capture_speed: Number,
    max_steps: int | Int[Array, ""],
    watch_bob: bool = False,
) -> tuple[Motion, State]:
    """Run a motion up to `horizon` (same clock as `begun`): the motion there, and its state.

    The work is bounded by `max_steps` leaps; `steps` of the result tells.
    """

    def going(m: Motion) -> Bool[Array, ""]:
        return ~arrived(m, horizon) & (m.steps < max_steps) & ~m.lost

    def step(m: Motion) -> Motion:
        return leap(plant, m, horizon, capture_speed=capture_speed, watch_bob=watch_bob)

    motion = jax.lax.while_loop(going, step, motion)
    y = jnp.stack(state_at(motion, horizon))
    sides = jnp.maximum(motion.up, y[0]), jnp.maximum(motion.down, -y[0])
    return eqx.tree_at(lambda n: (n.up, n.down), motion, sides), y


def arrived(m: Motion, horizon: Number) -> Bool[Array, ""]:
    """Whether a motion is at the horizon."""
    # t + (horizon - t) may round below the horizon: a difference of rounding is no distance.
    horizon = stop_gradient(horizon)
    return jnp.asarray(horizon - stop_gradient(m.begun) - m.local <= _REACHED * horizon)


def _bob_signal(m: Motion) -> Signal:
    """Positive until the bob turns; a bob that does not move at all does not."""
    rate = m.arc.bob.rate(m.arc.rates).scaled(m.bob_sign)
    size = sum(jnp.abs(stop_gradient(x)) for x in (*rate.free, *jax.tree.leaves(rate.harmonic)))
    return rate._replace(constant=jnp.where(size > 1e-100, 0.0, 1.0))


class _Watched(NamedTuple):
    """A signal, and its derivatives in time."""

    value: Signal
    first: Signal
    second: Signal
    third: Signal
    fourth: Signal


def _watched(signal: Signal, rates: Rates) -> _Watched:
    orders = [jax.tree.map(stop_gradient, signal)]
    for _ in range(4):
        orders.append(jax.tree.map(kept, orders[-1].rate(rates)))
    return _Watched(*orders)


def leap(plant: Plant, m: Motion, horizon: Number, *, capture_speed: Number, watch_bob: bool) -> Motion:
    """A few safe steps, and the event they have reached, if any."""
    fixed = stop_gradient(horizon)
    limit = stop_gradient(plant.linear.beyond_return)
    signals = jax.tree.map(kept, ending(plant, m.mode, m.arc))
    if watch_bob:
        signals = (*signals, _bob_signal(m))
    arc = jax.tree.map(stop_gradient, m.arc)
    watched = [_watched(s, arc.rates) for s in signals]

    def step(_: Array, carry: tuple) -> tuple:
        local, met, which = carry
        now = arc.at(local)
        left = fixed - stop_gradient(m.begun) - local
        fresh = local == 0.0
        born = fresh & (m.begun > 0.0)
        window = jnp.minimum(left, jnp.minimum(1.0 / arc.rates.xi, 1.0 / (arc.rates.s1 + 0.1)))
        growth = jnp.exp(arc.rates.s1 * window)
        shortest, first, close, next_best = left, jnp.full_like(which, -1), jnp.full_like(left, jnp.inf), left
        for i, w in enumerate(watched):
            safe, root = _safe_step(w, now, arc.rates, window, growth, born)
            sooner = safe < shortest
            next_best = jnp.where(sooner, shortest, jnp.minimum(safe, next_best))
            shortest, first = jnp.where(sooner, safe, shortest), jnp.where(sooner, i, first)
            close = jnp.where(sooner, root, close)
        # Newton's method from here: the root it finds comes before anything else can happen. `next_best` is
        # the shortest safe step of the other signals, so that no event of theirs can come first.
        alone = (close < left) & (1.01 * close < next_best)
        met_now = ((shortest < _NEAR * fixed) | alone) & ~fresh & (first >= 0)
        onward = jnp.minimum(jnp.maximum(shortest, jnp.where(fresh, 1e-10 * fixed, 0.0)), left)
        local = jnp.where(met | met_now, local, local + onward)
        return local, met | met_now, jnp.where(met, which, first)

    none = (m.local, jnp.zeros((), bool), jnp.zeros((), int))
    local, met, which = jax.lax.fori_loop(0, _INNER, step, none)

    # Two Newton steps take what is left to rounding; they run without derivatives. The derivative of the
    # event's time comes from one more step in `_meet`, which leaves the value alone: implicit function
    # theorem.
    def nearer(_: Array, local: Number) -> Number:
        late = _late(arc, [w.value for w in watched], arc.at(local), which)
        return jnp.where(met, local + late, local)

    local = jax.lax.fori_loop(0, 2, nearer, local)
    moved = eqx.tree_at(lambda n: n.local, m, local)
    now = m.arc.at(local)
    after = _meet(plant, moved, signals, now, which, capture_speed)
    after = jax.tree.map(lambda a, b: jnp.where(met, a, b), after, moved)
    tilt = jnp.abs(stop_gradient(m.arc.tilt.at(now)))
    return eqx.tree_at(lambda n: (n.steps, n.lost), after, (m.steps + 1, ~(tilt < limit)))


def state_at(m: Motion, horizon: Number) -> Numbers:
    """The state at the horizon, with the horizon's and the arc's start's own derivatives."""
    late = horizon - m.begun - m.local
    # A motion stopped short of the horizon (lost, or out of steps) stays where it is.
    late = jnp.where(jnp.abs(stop_gradient(late)) < 1e-6, late, 0.0)
    y = m.arc.state(m.arc.at(m.local), late)
    return y[0], y[1], jnp.where(m.mode.kind == SLIP, y[2], 0.0), y[3]


def _safe_step(
    w: _Watched, now: Instant, rates: Rates, window: Number, growth: Number, born: Bool[Array, ""]
) -> tuple[Number, Number]:
    """A step within which a signal cannot vanish (at most `window`), and how far its root is if
    Newton's method is sure to find it from here (else infinite). An arc just `born` of an event
    begins inside: what rounding says to the contrary is noise."""
    # On the window d the third derivative of the signal is at least -b3: each part of it (the growing and the
    # decaying exponential, the pair's swing with its invariant amplitude, the harmonic) is bounded by its
    # amplitude there. Taylor's formula then gives g(t) >= g0 + g1 t + g2 t^2/2 - b3 t^3/6, and because t <= d
    # the cubic term is at least -(b3 d/3) t^2/2: a parabola that lies below the signal. Up to the parabola's
    # first root the signal is positive, so that no event can be passed, whatever the signal does later. A
    # long window has a weak bound and a short one ends early: three windows are tried, and the longest step
    # wins. Close to a simple root d shrinks with the distance, and so does the error: quadratic convergence.
    value, g1, g2 = kept(w.value.at(now)), kept(w.first.at(now)), kept(w.second.at(now))
    g0 = jnp.maximum(value, 0.0)
    g1 = jnp.where(born & (value < 1e-12), jnp.maximum(g1, 0.0), g1)
    _, e2, u, v = now.flow
    pair = w.third.free.on_a * u + w.third.free.on_b * v
    pair_rate = w.fourth.free.on_a * u + w.fourth.free.on_b * v
    bound = (
        jnp.abs(w.third.free.on_s1) * now.flow.at_s1 * growth
        + jnp.abs(w.third.free.on_s2) * e2
        + jnp.sqrt(pair**2 + pair_rate**2 / rates.q)
        + w.third.harmonic.bound(now.time, window)
        + 1e-300
    )
    bound = kept(bound)
    trials = (window, window / 4.0, jnp.clip(3.0 * g2 / bound, 0.0, window))
    steps = [_first_root(g0, g1, g2 - bound * d / 3.0, d) for d in trials]
    falling = jnp.where(g1 < 0.0, -g1, 1.0)
    root = kept(g0 / falling)
    # The slope changes by less than this share of itself until twice there: Newton's error shrinks
    # to its square, its third power's square, and is gone.
    bend = 2.0 * (jnp.abs(g2) + 2.0 * bound * root) * root / falling
    sure = (g1 < 0.0) & (bend < _STRAIGHT) & (2.0 * root < window)
    safe = jnp.maximum(jnp.maximum(steps[0], steps[1]), steps[2])
    return kept(safe), jnp.where(sure, root, jnp.inf)


def _first_root(g0: Number, g1: Number, m: Number, longest: Number) -> Number:
    """The first positive root of g0 + g1 t + m t^2/2 with g0 >= 0, at most `longest`."""
    # The form 2 g0/(root - g1) has no cancellation for g1 < 0, and (g1 + root)/(-m) none for g1 > 0.
    discriminant = g1**2 - 2.0 * m * g0
    root = jnp.sqrt(jnp.maximum(discriminant, 0.0))
    falling = g1 <= 0.0
    never = ((m >= 0.0) & ~falling) | (discriminant < 0.0)
    down = 2.0 * g0 / jnp.where(root - g1 > 0.0, root - g1, 1.0)
    over = (g1 + root) / jnp.where(m < 0.0, -m, 1.0)
    still = falling & (root - g1 <= 0.0)
    found = jnp.where(falling, jnp.where(still, jnp.where(m >= 0, longest, 0.0), down), over)
    return jnp.where(never, longest, jnp.minimum(found, longest))


def _late(arc: Arc, signals: Sequence[Signal], now: Instant, which: Int[Array, ""]) -> Number:
    """How far off the event is: one Newton step, which carries the derivative of its time."""
    values = [s.at(now) for s in signals]
    slopes = [stop_gradient(s.rate(arc.rates).at(now)) for s in signals]
    value, slope = values[0], slopes[0]
    for i in range(1, len(signals)):
        value, slope = jnp.where(which == i, values[i], value), jnp.where(which == i, slopes[i], slope)
    return jnp.where(slope == 0.0, 0.0, -value / jnp.where(slope == 0.0, 1.0, slope))


def _meet(
    plant: Plant,
    m: Motion,
    signals: tuple[Signal, ...],
    now: Instant,
    which: Int[Array, ""],
    capture_speed: Number,
) -> Motion:
    """The motion just after the event it has arrived at."""
    # The value of `late` is rounding. Its derivative -dg/g' is that of the event's time, and through the
    # state and the phase after the event it becomes the saltation matrix: no event needs a rule of its own.
    late = kept(_late(m.arc, signals, now, which))
    y = jax.tree.map(kept, m.arc.state(now, late))
    time = m.begun + m.local + late
    elapsed = m.local + late
    phase = m.arc.phase + plant.linear.xi * elapsed
    growth = None if m.arc.growth is None else m.arc.growth.after(elapsed)
    mode, after = ends(plant, m.mode, y, m.arc.shaken(turn(phase).sine, elapsed), which, capture_speed)
    bob_turned = which == 2
    mode, after = jax.tree.map(lambda a, b: jnp.where(bob_turned, a, b), (m.mode, y), (mode, after))
    after = jax.tree.map(kept, after)
    bob_sign = jnp.where(bob_turned | (after[3] * y[3] < 0), -m.bob_sign, m.bob_sign)
    return Motion(
        mode,
        jax.tree.map(kept, launch(plant, mode, after, phase, growth)),
        time,
        jnp.zeros_like(m.local),
        bob_sign,
        jnp.maximum(m.up, y[0]),
        jnp.maximum(m.down, -y[0]),
        jnp.maximum(m.stroke, jnp.abs(y[1])),
        m.steps,
        m.lost,
        m.held | (mode.kind != SLIP),
        jnp.minimum(m.transversality, _transversality(plant, m, now, which, mode)),
    )


def _transversality(plant: Plant, m: Motion, now: Instant, which: Int[Array, ""], after: Mode) -> Number:
    """See `contact.transversality_of`."""
    linear, slope = plant.linear, m.arc.tilt.rate(m.arc.rates)
    usual = linear.xi * linear.weight
    bend = jnp.where(which == 0, slope.rate(m.arc.rates).at(now), jnp.inf)
    speed = jnp.where(which == 1, slope.at(now), jnp.inf)
    still = (jnp.zeros_like(m.local), m.arc.bob.at(now), m.local, m.arc.bob.rate(m.arc.rates).at(now))
    free = ~held_on_base(plant, still, m.arc.shaken(now.forcing.sine, now.time))
    return transversality_of(m.mode, after, bend, speed, free, (linear.xi * usual, usual))


def settled_at_rest(plant: Plant, m: Motion) -> tuple[Bool[Array, ""], Number]:
    """Whether a resting block can never lift again under steady shaking, because the pendulum's decaying
    swing and its steady one together stay within what weight and friction hold; and how far they reach
    (rad). On an arc under growing shaking the answer means nothing."""
    reserve, reach = held_at_rest(plant, m)
    return (m.mode.kind == REST) & (reserve >= 0.0), reach


def held_at_rest(plant: Plant, m: Motion) -> tuple[Number, Number]:
    """Reserve of a block at rest, and the bob's reach (rad). The reserve is the share of what weight and
    friction hold that the bob's decaying and steady swing leave over at their largest."""
    moment, reach = _moment_of_bob(plant, m)
    return 1.0 - moment / (plant.linear.weight + plant.linear.friction), reach


def held_leaning(plant: Plant, m: Motion) -> tuple[Bool[Array, ""], Number]:
    """Whether friction holds a leaning block for good, because forcing and bob at their largest stay within
    what friction balances there; and how far the settled bob reaches (rad; undamped: as far as it may)."""
    linear, (moment, reach) = plant.linear, _moment_of_bob(plant, m)
    tilt = m.arc.tilt.constant
    lever = jnp.abs(linear.tilt * tilt - m.mode.tilt_sign * linear.weight)
    holds = (m.mode.kind == STICK) & (tilt != 0.0) & (moment + lever < linear.friction)
    decays = plant.held.p > 0.0
    return holds, jnp.where(decays, jnp.hypot(plant.swing[0], plant.swing[1]), reach)


def _moment_of_bob(plant: Plant, m: Motion) -> tuple[Number, Number]:
    """The largest moment of forcing, decaying and steady swing on a held block, and the bob's reach (rad)."""
    linear, s, c = plant.linear, plant.swing[0], plant.swing[1]
    # R = -f sin - 2 mu psi + bias psi' for the steady swing, whose rate is xi (s cos - c sin).
    two_mu, bias, xi = linear.tilt - 1.0, linear.bias, linear.xi
    steady = jnp.hypot(-linear.f - two_mu * s - bias * xi * c, -two_mu * c + bias * xi * s)
    flow = m.arc.at(m.local).flow
    psi, rate = m.arc.bob.free.of(flow), m.arc.bob.free.rate(m.arc.rates).of(flow)
    stiffness = plant.held.q
    swing = jnp.sqrt(psi**2 + rate**2 / stiffness)
    decaying = two_mu * swing + jnp.abs(bias) * swing * jnp.sqrt(stiffness)
    return steady + decaying, jnp.sqrt(s**2 + c**2) + swing
