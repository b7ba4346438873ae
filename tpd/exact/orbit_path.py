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
_FINE = 0.2
"""Spacing of the samples, over the quickest time scale of the motion, where these do not prove the largest
|psi|."""
MOST_NODES = 8192
"""Most samples of an arc. An orbit that asks for more is not followed up."""
_AWAY, _FROM_END, _CURVED = 1.0 / 384.0, 1.0 / 162.0, 3.0**0.5 / 216.0
"""A cubic through values and slopes at both ends of a window d differs from its signal by at most
_AWAY B d^4, by _FROM_END B d^4 s at the share s of the window from either end, and its slope by
_CURVED B d^3, if B bounds the signal's fourth derivative."""
_ROUNDING = 1e-9
"""Share of its change in a window by which a rate that begins or ends at zero may have the wrong sign."""


class Peak(NamedTuple):
    """An extreme between two samples, or at the end of an arc."""

    size: Number
    share: Number
    """Share of its arc's duration at which it is met."""
    late: Bool[Array, ""]
    """Whether it is on the second arc."""
    most: Number
    """Bound on its size."""


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
    sure: Bool[Array, ""]
    """Whether it is proved that |psi| is nowhere larger."""


class _Seen(NamedTuple):
    """Extremes that the samples of a path have shown so far."""

    highest: Number
    dent: Peak
    """The least fall; infinite without one."""
    bob: tuple[Peak, Peak]
    """The two largest |psi|, the larger first."""
    doubt: Number
    """Bound on |psi| wherever the samples do not prove that it has no other extreme than theirs, and in
    extremes that are not among the two largest."""


def path_of(
    half: Half, orbit: Orbit, nodes: Int[Array, ""] | int = PATH_NODES, *, exactly: bool = False
) -> Path:
    """Follow both arcs, each sampled `nodes` times with its derivatives: what peaks between two samples is
    found from these, and where many peaks may be equal, `exactly` before they are compared."""
    # Samples alone would miss the top of a peak, and a fine grid costs time on every orbit. Value and slope
    # at both ends of an interval tell whether an extreme lies in it (the slope changes sign) and where about.
    # Only the deepest dent of the falling rate and the two largest peaks of |psi| are kept, and refined by
    # Newton's method afterwards; two, because the estimates of nearly equal peaks may come in the wrong
    # order. Each sample follows from the last by one product with exp(A spacing): no exponential within the
    # loop.
    never = jnp.full_like(orbit.root.t, jnp.inf)
    none = Peak(-never, jnp.zeros_like(never), jnp.zeros(never.shape, bool), -never)
    seen = _Seen(-never, none._replace(size=never), (none, none), -never)
    start = Instant(identity(orbit.root.t), turn(orbit.root.gamma))
    first = _Samples(half, orbit, nodes, late=False, exactly=exactly)
    turned = first.look(start)
    now, old, seen = first.follow(start, turned, seen)
    seen = _with_peak(seen, jnp.abs(old[2]), late=False)
    second = _Samples(half, orbit, nodes, late=True, exactly=exactly)
    start = Instant(identity(orbit.root.t), now.forcing)
    _, end, seen = second.follow(start, second.look(start), seen)
    # An undamped bob may turn with the block, where rounding hides the change of its rate's sign.
    seen = _with_peak(seen, jnp.abs(turned[2]), late=True)
    dented = jnp.isfinite(seen.dent.size)
    dent = where_needed(dented, partial(_refined, row=0), half, orbit, nodes, seen.dent, dented)
    bob, left = _largest(half, orbit, nodes, *seen.bob)
    # With its sign: where the rate is positive the block turns back.
    fall = jnp.where(dented, -dent.size, jnp.inf)
    sure = jnp.maximum(seen.doubt, left) <= jnp.abs(bob.size)
    return Path(jnp.maximum(seen.highest, -fall), fall, turned[1], -end[1], bob, sure)


class _Samples:
    """The samples of one arc at equal spacing, taken one after the other."""

    def __init__(
        self, half: Half, orbit: Orbit, nodes: Int[Array, ""] | int, *, late: bool, exactly: bool
    ) -> None:
        self.rates, self.nodes, self.late = half.plant.slip, nodes, late
        self.refined = partial(_refined, half, orbit, nodes, row=1) if exactly else None
        self.tilt, self.bob = (x.changing() for x in (orbit.second if late else orbit.first))
        self.spacing = (half.span - orbit.root.t if late else orbit.root.t) / nodes
        self.onward = exponential(self.rates, self.spacing)
        self.turning = turn(self.rates.xi * self.spacing)
        fifth = self.bob
        for _ in range(5):
            fifth = fifth.rate(self.rates)
        # The energy x^2 + x'^2/q of the pair only decreases, and e^(s1 t) is largest at the end of the arc.
        pair = jnp.sqrt(fifth.free.on_a**2 + fifth.free.on_b**2 / self.rates.q)
        forced = jnp.sqrt(fifth.harmonic.along**2 + fifth.harmonic.across**2)
        rising = jnp.abs(fifth.free.on_s1) * jnp.exp(self.rates.s1 * self.spacing * nodes)
        self.fifth, self.falling = pair + forced + rising, jnp.abs(fifth.free.on_s2)

    def look(self, now: Instant) -> tuple[Number, Number, Number, Number, Number]:
        """(phi', phi'', psi, psi', psi'') at an instant."""
        rate = now.rate(self.rates)
        onward = rate.rate(self.rates)
        return (
            self.tilt.at(rate),
            self.tilt.at(onward),
            self.bob.at(now),
            self.bob.at(rate),
            self.bob.at(onward),
        )

    def follow(self, start: Instant, look: tuple, seen: _Seen) -> tuple[Instant, tuple, _Seen]:
        """The end of the arc, the look there, and the extremes so far; `look` is the one at `start`."""
        return jax.lax.fori_loop(0, self.nodes, self._step, (start, look, seen))

    def _step(self, i: Array, carry: tuple) -> tuple:
        now, old, seen = carry
        falling = now.flow.at_s2
        now = Instant(now.flow.times(self.onward, self.rates), now.forcing.then(self.turning))
        new = self.look(now)
        # At the end of the second arc the block turns: its rate is zero there up to rounding.
        last = (i == self.nodes - 1) & self.late
        highest = jnp.maximum(seen.highest, jnp.where(last, -jnp.inf, new[0]))
        fall, dented = self._extreme(i, -old[0], -old[1], -new[0], -new[1])
        way = jnp.where(old[3] < 0, 1.0, -1.0)
        top, turned = self._extreme(i, way * old[2], way * old[3], way * new[2], way * new[3])
        top = top._replace(size=jnp.where(turned, -top.size, -jnp.inf), most=-top.most)
        if self.refined is not None:
            exact = jnp.abs(self.refined(top, turned).size)
            top = top._replace(size=jnp.where(turned, exact, -jnp.inf), most=exact)
        nearer = dented & (fall.size < seen.dent.size)
        dent = jax.tree.map(lambda a, b: jnp.where(nearer, a, b), fall, seen.dent)
        bob, left = _ranked(seen.bob, top)
        left = jnp.where(jnp.isfinite(left.size), left.most, -jnp.inf)
        doubt = jnp.maximum(jnp.maximum(seen.doubt, left), self._doubt(old, new, falling))
        return now, new, _Seen(highest, dent, bob, doubt)

    def _doubt(self, old: tuple, new: tuple, falling: Number) -> Number:
        """Bound on |psi| in an interval, minus infinity where it is proved that it has no extreme there, or
        one at most, which shows; `falling` is e^(s2 t) at its start."""
        d, r0, r1 = self.spacing, old[3], new[3]
        left = (self.fifth + self.falling * falling) * d**4
        # Bernstein coefficients of the cubic through the rates, and their differences: those of its slope.
        b1, b2 = r0 + d * old[4] / 3.0, r1 - d * new[4] / 3.0
        changes = b1 - r0, b2 - b1, r1 - b2
        way = jnp.where(b1 + b2 < 0.0, -1.0, 1.0)
        r0, b1, b2, r1 = way * r0, way * b1, way * b2, way * r1
        still = _ROUNDING * d * jnp.maximum(jnp.abs(old[4]), jnp.abs(new[4]))
        least = jnp.minimum(b1, b2)
        keeps = jnp.minimum(jnp.minimum(r0, r1), least) > _AWAY * left
        keeps |= (r0 > -still) & (jnp.minimum(jnp.minimum(3.0 * b1, 1.5 * b2), r1) > _FROM_END * left)
        keeps |= (r1 > -still) & (jnp.minimum(jnp.minimum(1.5 * b1, 3.0 * b2), r0) > _FROM_END * left)
        low, high = (f(f(changes[0], changes[1]), changes[2]) for f in (jnp.minimum, jnp.maximum))
        once = (3.0 * low > _CURVED * left) | (3.0 * high < -_CURVED * left)
        # Between its ends a signal is above both by d^2/8 of its largest second derivative at most.
        steep = 3.0 * jnp.maximum(-low, high) + _CURVED * left
        bound = jnp.maximum(jnp.abs(old[2]), jnp.abs(new[2])) + d / 8.0 * steep
        return jnp.where(keeps | once, -jnp.inf, bound)

    def _extreme(
        self, i: Array, x0: Number, r0: Number, x1: Number, r1: Number
    ) -> tuple[Peak, Bool[Array, ""]]:
        """The least value within interval i with these values and slopes at its ends, and whether there
        is one; linear in the slopes, and to be refined."""
        there = jnp.asarray((r0 < 0) & (r1 >= 0))
        part = r0 / jnp.where(there, r0 - r1, 1.0)
        low = jnp.minimum(x0 + 0.5 * r0 * part * self.spacing, x1 - 0.5 * r1 * (1.0 - part) * self.spacing)
        # The tangents at both ends meet beyond the extreme, if there is but one.
        meet = (x1 - x0 - r1 * self.spacing) / jnp.where(there, r0 - r1, 1.0)
        return Peak(low, (i + part) / self.nodes, jnp.full(there.shape, self.late), x0 + r0 * meet), there


def resolved_path(half: Half, orbit: Orbit) -> tuple[Path, Bool[Array, ""]]:
    """The path, and whether its largest |psi| is proved, with no more than `MOST_NODES` samples of an arc.
    Most orbits need no more than `PATH_NODES`."""
    # 16 samples of an arc prove the extremes of most orbits. A short pendulum under slow shaking swings many
    # times on one arc, and a strongly damped one follows an impact within a small part of it: several
    # extremes could lie between two samples. The number of samples then follows the quickest rate. The fine
    # pass is compiled once, with a loop of unknown length, and is computed only where some design of a batch
    # needs it.
    rates = half.plant.slip
    longest = jnp.maximum(orbit.root.t, half.span - orbit.root.t)
    quickest = jnp.maximum(jnp.maximum(rates.p, jnp.sqrt(rates.q)), jnp.maximum(-rates.s2, rates.xi))
    samples = jnp.ceil(quickest * longest / _FINE)
    coarse = path_of(half, orbit)
    unsure = ~coarse.sure
    wanted = jnp.where(unsure & (samples <= MOST_NODES), jnp.maximum(samples, 4.0 * PATH_NODES), 1.0)
    fine = where_needed(unsure, partial(path_of, exactly=True), half, orbit, wanted.astype(int))
    path = jax.tree.map(lambda a, b: jnp.where(unsure, a, b), fine, coarse)
    return path, path.sure


def _with_peak(seen: _Seen, size: Number, *, late: bool) -> _Seen:
    """Extremes seen so far, and |psi| at the end of an arc."""
    corner = Peak(size, jnp.ones_like(size), jnp.full(jnp.shape(size), late), size)
    bob, left = _ranked(seen.bob, corner)
    left = jnp.where(jnp.isfinite(left.size), left.most, -jnp.inf)
    return seen._replace(bob=bob, doubt=jnp.maximum(seen.doubt, left))


def _ranked(best: tuple[Peak, Peak], new: Peak) -> tuple[tuple[Peak, Peak], Peak]:
    """The two largest of three, and the third."""

    def choose(first: Bool[Array, ""], a: Peak, b: Peak) -> Peak:
        return jax.tree.map(lambda x, y: jnp.where(first, x, y), a, b)

    ahead, behind = (jnp.asarray(new.size > old.size) for old in best)
    largest = choose(ahead, new, best[0]), choose(ahead, best[0], choose(behind, new, best[1]))
    return largest, choose(ahead | behind, best[1], new)


def _largest(
    half: Half, orbit: Orbit, nodes: Int[Array, ""] | int, first: Peak, second: Peak
) -> tuple[Peak, Number]:
    """The larger of two peaks of |psi|; the second is looked at where it comes close. And a bound on the
    second where it is not."""
    refine = partial(_refined, row=1)
    first = refine(half, orbit, nodes, first, jnp.asarray(first.share < 1.0))
    close = (second.size > 0.95 * jnp.abs(first.size)) & jnp.isfinite(second.size)
    second = where_needed(close, refine, half, orbit, nodes, second, close & (second.share < 1.0))
    larger = close & (jnp.abs(second.size) > jnp.abs(first.size))
    left = jnp.where(close | ~jnp.isfinite(second.size), -jnp.inf, second.most)
    return jax.tree.map(lambda a, b: jnp.where(larger, a, b), second, first), left


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
    return Peak(signal.at(value(share)), share, peak.late, peak.most)
