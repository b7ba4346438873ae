"""The path of a symmetric orbit from turn to turn: does it keep to its signs, and how far does the bob reach.

A root of the scalar equation is an orbit only if the tilt falls all the way from turn to turn.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from tpd.core.parameters import Number
from tpd.exact.batch_branches import where_needed
from tpd.exact.orbit_equation import Half
from tpd.exact.propagator import exponential, identity
from tpd.exact.signal import Instant
from tpd.exact.symmetric_orbit import Orbit, instant, on_arc
from tpd.exact.trigonometry import turn

PATH_NODES = 16
"""Samples of each of the two arcs of a half period, between which its extremes are looked for."""
_COARSE = 0.8
"""Largest turn (rad) of the bob's free oscillation from one of these samples to the next. Beyond it two
extremes may lie between them, and more samples are taken."""
_FINE = 0.25
"""The turn between two samples then."""
MOST_NODES = 8192
"""Most samples of an arc. An orbit that asks for more is not followed up."""


class Peak(NamedTuple):
    """An extreme between two samples, or at the end of an arc."""

    size: Number
    share: Number
    """Share of its arc's duration at which it is met."""
    late: Bool[Array, ""]
    """Whether it is on the second arc."""


class Path(NamedTuple):
    """Extremes that an orbit meets on its way from turn to turn."""

    highest_rate: Number
    """Largest phi' between the turns: the orbit is none unless negative."""
    least_fall: Number
    """The least of -phi' where it has a dent; infinite if there is none."""
    leaving: Number
    """phi'' just after the upper turn: the block sticks there unless negative."""
    arriving: Number
    """-phi'' just before the lower turn: the block turns before it unless negative."""
    bob: Peak
    """The largest |psi|: where the bob turns, or at the impact, which may turn it."""


class _Seen(NamedTuple):
    """Extremes that the samples of a path have shown so far."""

    highest: Number
    dent: Peak
    """The least fall; infinite without one."""
    bob: tuple[Peak, Peak]
    """The two largest |psi|, the larger first."""


def path_of(half: Half, orbit: Orbit, nodes: Int[Array, ""] | int = PATH_NODES) -> Path:
    """Follow both arcs, each sampled `nodes` times with its derivatives: what peaks between two samples is
    found from these."""
    # Samples alone would miss the top of a peak, and a fine grid costs time on every orbit. Value and slope
    # at both ends of an interval tell whether an extreme lies in it (the slope changes sign) and where about.
    # Only the deepest dent of the falling rate and the two largest peaks of |psi| are kept, and refined by
    # Newton's method afterwards; two, because the estimates of nearly equal peaks may come in the wrong
    # order. Each sample follows from the last by one product with exp(A spacing): no exponential within the
    # loop.
    never = jnp.full_like(orbit.root.t, jnp.inf)
    none = Peak(-never, jnp.zeros_like(never), jnp.zeros(never.shape, bool))
    seen = _Seen(-never, none._replace(size=never), (none, none))
    start = Instant(identity(orbit.root.t), turn(orbit.root.gamma))
    first = _Samples(half, orbit, nodes, late=False)
    turned = first.look(start)
    now, old, seen = first.follow(start, turned, seen)
    corner = Peak(jnp.abs(old[2]), jnp.ones_like(never), jnp.zeros(never.shape, bool))
    seen = seen._replace(bob=_ranked(seen.bob, corner))
    second = _Samples(half, orbit, nodes, late=True)
    start = Instant(identity(orbit.root.t), now.forcing)
    _, end, seen = second.follow(start, second.look(start), seen)
    dented = jnp.isfinite(seen.dent.size)
    dent = where_needed(dented, partial(_refined, row=0), half, orbit, nodes, seen.dent, dented)
    bob = _largest(half, orbit, nodes, *seen.bob)
    # With its sign: where the rate is positive the block turns back.
    fall = jnp.where(dented, -dent.size, jnp.inf)
    return Path(jnp.maximum(seen.highest, -fall), fall, turned[1], -end[1], bob)


class _Samples:
    """The samples of one arc at equal spacing, taken one after the other."""

    def __init__(self, half: Half, orbit: Orbit, nodes: Int[Array, ""] | int, *, late: bool) -> None:
        self.rates, self.nodes, self.late = half.plant.slip, nodes, late
        self.tilt, self.bob = (x.changing() for x in (orbit.second if late else orbit.first))
        self.spacing = (half.span - orbit.root.t if late else orbit.root.t) / nodes
        self.onward = exponential(self.rates, self.spacing)
        self.turning = turn(self.rates.xi * self.spacing)

    def look(self, now: Instant) -> tuple[Number, Number, Number, Number]:
        """(phi', phi'', psi, psi') at an instant."""
        rate = now.rate(self.rates)
        return self.tilt.at(rate), self.tilt.at(rate.rate(self.rates)), self.bob.at(now), self.bob.at(rate)

    def follow(self, start: Instant, look: tuple, seen: _Seen) -> tuple[Instant, tuple, _Seen]:
        """The end of the arc, the look there, and the extremes so far; `look` is the one at `start`."""
        return jax.lax.fori_loop(0, self.nodes, self._step, (start, look, seen))

    def _step(self, i: Array, carry: tuple) -> tuple:
        now, old, seen = carry
        now = Instant(now.flow.times(self.onward, self.rates), now.forcing.then(self.turning))
        new = self.look(now)
        # At the end of the second arc the block turns: its rate is zero there up to rounding.
        last = (i == self.nodes - 1) & self.late
        highest = jnp.maximum(seen.highest, jnp.where(last, -jnp.inf, new[0]))
        fall, dented = self._extreme(i, -old[0], -old[1], -new[0], -new[1])
        way = jnp.where(old[3] < 0, 1.0, -1.0)
        top, turned = self._extreme(i, way * old[2], way * old[3], way * new[2], way * new[3])
        top = top._replace(size=jnp.where(turned, -top.size, -jnp.inf))
        nearer = dented & (fall.size < seen.dent.size)
        dent = jax.tree.map(lambda a, b: jnp.where(nearer, a, b), fall, seen.dent)
        return now, new, _Seen(highest, dent, _ranked(seen.bob, top))

    def _extreme(
        self, i: Array, x0: Number, r0: Number, x1: Number, r1: Number
    ) -> tuple[Peak, Bool[Array, ""]]:
        """The least value within interval i with these values and slopes at its ends, and whether there
        is one; linear in the slopes, and to be refined."""
        there = jnp.asarray((r0 < 0) & (r1 >= 0))
        part = r0 / jnp.where(there, r0 - r1, 1.0)
        low = jnp.minimum(x0 + 0.5 * r0 * part * self.spacing, x1 - 0.5 * r1 * (1.0 - part) * self.spacing)
        return Peak(low, (i + part) / self.nodes, jnp.full(there.shape, self.late)), there


def resolved_path(half: Half, orbit: Orbit) -> tuple[Path, Bool[Array, ""]]:
    """The path with as many samples as the bob's free oscillation asks for, and whether these were not more
    than `MOST_NODES`. Most orbits need no more than `PATH_NODES`."""
    # 16 samples of an arc are enough while the bob swings slowly. A short pendulum under slow shaking swings
    # many times on one arc: several extremes would lie between two samples, and the largest could be missed
    # (aliasing). The number of samples then follows the bob's own rate. The fine pass is compiled once, with
    # a loop of unknown length, and is computed only where some design of a batch needs it.
    rates = half.plant.slip
    swings = rates.q > 0.25 * rates.p**2
    longest = jnp.maximum(orbit.root.t, half.span - orbit.root.t)
    turned = jnp.where(swings, rates.swing_rate, 0.0) * longest
    crowded = jnp.asarray(turned > _COARSE * PATH_NODES)
    resolved = turned <= _FINE * MOST_NODES
    wanted = jnp.where(crowded & resolved, jnp.ceil(turned / _FINE), 1.0).astype(int)
    coarse, fine = path_of(half, orbit), where_needed(crowded, path_of, half, orbit, wanted)
    return jax.tree.map(lambda a, b: jnp.where(crowded, a, b), fine, coarse), resolved


def _ranked(best: tuple[Peak, Peak], new: Peak) -> tuple[Peak, Peak]:
    """The two largest of three."""

    def choose(first: Bool[Array, ""], a: Peak, b: Peak) -> Peak:
        return jax.tree.map(lambda x, y: jnp.where(first, x, y), a, b)

    ahead, behind = (jnp.asarray(new.size > old.size) for old in best)
    return choose(ahead, new, best[0]), choose(ahead, best[0], choose(behind, new, best[1]))


def _largest(half: Half, orbit: Orbit, nodes: Int[Array, ""] | int, first: Peak, second: Peak) -> Peak:
    """The larger of two peaks of |psi|; the second is looked at where it comes close."""
    refine = partial(_refined, row=1)
    first = refine(half, orbit, nodes, first, jnp.asarray(first.share < 1.0))
    close = (second.size > 0.95 * jnp.abs(first.size)) & jnp.isfinite(second.size)
    second = where_needed(close, refine, half, orbit, nodes, second, close & (second.share < 1.0))
    larger = close & (jnp.abs(second.size) > jnp.abs(first.size))
    return jax.tree.map(lambda a, b: jnp.where(larger, a, b), second, first)


@partial(jax.jit, static_argnames="row")
def _refined(
    half: Half, orbit: Orbit, nodes: Int[Array, ""] | int, peak: Peak, there: Bool[Array, ""], row: int
) -> Peak:
    """An extreme of phi' (row 0) or psi (row 1), by Newton's method if it is `there`."""
    length = jnp.where(peak.late, half.span - orbit.root.t, orbit.root.t)
    low, high = (
        jnp.maximum(peak.share - 1.0 / nodes, 0.0),
        jnp.minimum(peak.share + 1.0 / nodes, 1.0),
    )
    signal = on_arc(peak.late, orbit, row).changing()

    def value(share: Number) -> Instant:
        now = instant(half, orbit, share * length, peak.late)
        return now.rate(half.plant.slip) if row == 0 else now

    def step(_: Array, share: Number) -> Number:
        slope = value(share).rate(half.plant.slip)
        bend = signal.at(slope.rate(half.plant.slip)) * length
        onward = share - signal.at(slope) / jnp.where(bend == 0.0, 1.0, bend)
        return jnp.where(there, jnp.clip(onward, low, high), share)

    share = jax.lax.fori_loop(0, 4, step, peak.share)
    return Peak(signal.at(value(share)), share, peak.late)
