"""Symmetric period-one orbits, every one of them: the motion that belongs to a root of the scalar
equation (`tpd.exact.orbit_equation`), its path from turn to turn, and the derivative of its map.

A root is an orbit only if the tilt falls all the way from turn to turn, which is checked along its
path.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from tpd.core.eigenvalues import Matrix, product
from tpd.core.parameters import Number, State
from tpd.exact.batch_branches import computed_once, where_needed
from tpd.exact.modes import Plant
from tpd.exact.orbit_equation import Half, conditions, crossing
from tpd.exact.orbit_roots import NODES, ROOTS, Bracket, Root, brackets, converge, refine
from tpd.exact.propagator import Factor, Functional, components, exponential, identity
from tpd.exact.trigonometry import Turn, turn

ORBITS = 3
"""Most orbits per design."""
PATH_NODES = 16
"""Samples of each of the two arcs of a half period, between which its extremes are looked for."""
_COARSE = 0.8
"""Largest turn (rad) of the bob's free oscillation from one of these samples to the next. Beyond it two
extremes may lie between them, and more samples are taken."""
_FINE = 0.25
"""The turn between two samples then."""
MOST_NODES = 8192
"""Most samples of an arc. An orbit that asks for more is not followed up."""


class Coordinate(NamedTuple):
    """phi or psi along one arc: constant + functional of exp(A s) + harmonic, s from the arc's start."""

    constant: Number
    free: Functional
    along: Number
    across: Number

    def at(self, flow: Factor, phase: Turn) -> Number:
        """The angle, after exp(A s) and with the forcing at `phase`."""
        return self.constant + self.free.of(flow) + self.along * phase.sine + self.across * phase.cosine


class Instant(NamedTuple):
    """A time on an arc: exp(A s) and the phase of the forcing there."""

    flow: Factor
    phase: Turn

    def rate(self, plant: Plant) -> Instant:
        """Its derivative in time: `Coordinate.at` less its constant is linear in it."""
        xi = plant.linear.xi
        return Instant(self.flow.rate(plant.slip), Turn(-xi * self.phase.sine, xi * self.phase.cosine))


class Orbit(NamedTuple):
    """The half period from the upper turn: two arcs of both coordinates."""

    root: Root
    first: tuple[Coordinate, Coordinate]
    second: tuple[Coordinate, Coordinate]
    impact: Number
    """V"""

    @property
    def height(self) -> Number:
        """phi at the turn."""
        return self.first[0].at(identity(self.root.t), turn(self.root.gamma))


def orbit_of(half: Half, root: Root) -> Orbit:
    """The orbit of a root."""
    rates, plant = half.plant.slip, half.plant
    at, phase = crossing(half, root.t), turn(root.gamma)
    at, phase = computed_once(at, phase)
    (impact,) = computed_once(conditions(half, at).impact.at(phase))
    zero = jnp.zeros_like(root.t)
    one = identity(root.t)
    both = one.plus(half.whole)
    first, second = [], []
    for row, balance in ((0, 0.5 * (half.step - half.slack)), (1, zero)):
        unit, kick = half.unit[row], half.kick[row]
        free = unit.after(one.scaled(half.slack).plus(at.rest.scaled(-half.step)), rates)
        free = free.minus(impact, kick.after(at.rest, rates))
        later = free.after(at.flow, rates).minus(-half.step, unit.after(both, rates))
        later = later.minus(-impact, kick.after(both, rates))
        along, across = plant.response[row, 0], plant.response[row, 1]
        first.append(Coordinate(balance, free, along, across))
        step = half.step if row == 0 else zero
        second.append(Coordinate(balance - step, later, along, across))
    return Orbit(root, tuple(first), tuple(second), impact)


class Peak(NamedTuple):
    """An extreme between two samples, or at the end of an arc."""

    size: Number
    share: Number
    """Of its arc's duration until then."""
    late: Bool[Array, ""]
    """Whether it is on the second arc."""


class Path(NamedTuple):
    """What an orbit meets on its way from turn to turn."""

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
    """What the samples of a path have shown so far."""

    highest: Number
    dent: Peak
    """The least fall; infinite without one."""
    bob: tuple[Peak, Peak]
    """The two largest |psi|, the larger first."""


def path_of(half: Half, orbit: Orbit, nodes: Int[Array, ""] | int = PATH_NODES) -> Path:
    """Follow both arcs, each sampled `nodes` times with its derivatives: what peaks between two samples is
    found from these."""
    plant, xi = half.plant, half.plant.linear.xi
    start, never = turn(orbit.root.gamma), jnp.full_like(orbit.root.t, jnp.inf)
    none = Peak(-never, jnp.zeros_like(never), jnp.zeros(never.shape, bool))
    seen = _Seen(-never, none._replace(size=never), (none, none))
    ends = []

    def share_of(i: Array) -> Callable[[Number], Number]:
        return lambda part: (i + part) / nodes

    for late, arc in enumerate((orbit.first, orbit.second)):
        length = half.span - orbit.root.t if late else orbit.root.t
        spacing = length / nodes
        onward, turning = exponential(plant.slip, spacing), turn(xi * spacing)
        tilt, swing = (x._replace(constant=jnp.zeros_like(xi)) for x in arc)

        def look(now: Instant, tilt: Coordinate = tilt, swing: Coordinate = swing) -> tuple[Number, ...]:
            rate = now.rate(plant)
            return tilt.at(*rate), tilt.at(*rate.rate(plant)), swing.at(*now), swing.at(*rate)

        def step(
            i: Array,
            carry: tuple,
            late: int = late,
            spacing: Number = spacing,
            ahead: tuple[Factor, Turn] = (onward, turning),
            look: Callable[[Instant], tuple[Number, ...]] = look,
        ) -> tuple:
            now, old, seen = carry
            now = Instant(now.flow.times(ahead[0], plant.slip), now.phase.then(ahead[1]))
            new = look(now)
            last = (i == nodes - 1) & (late == 1)
            highest = jnp.maximum(seen.highest, jnp.where(last, -jnp.inf, new[0]))
            fall, dented = _extreme(-old[0], -old[1], -new[0], -new[1], spacing, share_of(i), late)
            way = jnp.where(old[3] < 0, 1.0, -1.0)
            top, turned = _extreme(
                way * old[2], way * old[3], way * new[2], way * new[3], spacing, share_of(i), late
            )
            top = top._replace(size=jnp.where(turned, -top.size, -jnp.inf))
            nearer = dented & (fall.size < seen.dent.size)
            dent = jax.tree.map(lambda a, b: jnp.where(nearer, a, b), fall, seen.dent)
            return now, new, _Seen(highest, dent, _ranked(seen.bob, top))

        now = Instant(identity(orbit.root.t), start)
        old = look(now)
        ends.append(old[1])
        now, old, seen = jax.lax.fori_loop(0, nodes, step, (now, old, seen))
        ends.append(old[1])
        start = now.phase
        if not late:
            corner = Peak(jnp.abs(old[2]), jnp.ones_like(never), jnp.zeros(never.shape, bool))
            seen = seen._replace(bob=_ranked(seen.bob, corner))
    dented = jnp.isfinite(seen.dent.size)
    dent = where_needed(dented, partial(_refined, row=0), half, orbit, nodes, seen.dent, dented)
    bob = _largest(half, orbit, nodes, *seen.bob)
    # With its sign: where the rate is positive the block turns back.
    fall = jnp.where(dented, -dent.size, jnp.inf)
    return Path(jnp.maximum(seen.highest, -fall), fall, ends[0], -ends[3], bob)


def resolved_path(half: Half, orbit: Orbit) -> tuple[Path, Bool[Array, ""]]:
    """The path with as many samples as the bob's free oscillation asks for, and whether these were not more
    than `MOST_NODES`. Most orbits need no more than `PATH_NODES`."""
    rates = half.plant.slip
    swings = rates.q > 0.25 * rates.p**2
    longest = jnp.maximum(orbit.root.t, half.span - orbit.root.t)
    turned = jnp.where(swings, rates.swing_rate, 0.0) * longest
    crowded = jnp.asarray(turned > _COARSE * PATH_NODES)
    resolved = turned <= _FINE * MOST_NODES
    wanted = jnp.where(crowded & resolved, jnp.ceil(turned / _FINE), 1.0).astype(int)
    coarse, fine = path_of(half, orbit), where_needed(crowded, path_of, half, orbit, wanted)
    return jax.tree.map(lambda a, b: jnp.where(crowded, a, b), fine, coarse), resolved


def _extreme(
    x0: Number, r0: Number, x1: Number, r1: Number, spacing: Number, at: Callable[[Number], Number], late: int
) -> tuple[Peak, Bool[Array, ""]]:
    """The least value within an interval with these values and slopes at its ends, and whether there
    is one; linear in the slopes, and to be refined."""
    there = jnp.asarray((r0 < 0) & (r1 >= 0))
    share = r0 / jnp.where(there, r0 - r1, 1.0)
    low = jnp.minimum(x0 + 0.5 * r0 * share * spacing, x1 - 0.5 * r1 * (1.0 - share) * spacing)
    return Peak(low, at(share), jnp.full(there.shape, late == 1)), there


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


def _refined(
    half: Half, orbit: Orbit, nodes: Int[Array, ""] | int, peak: Peak, there: Bool[Array, ""], row: int
) -> Peak:
    """An extreme of phi' (row 0) or psi (row 1), by Newton's method if it is `there`."""
    length = jnp.where(peak.late, half.span - orbit.root.t, orbit.root.t)
    low, high = (
        jnp.maximum(peak.share - 1.0 / nodes, 0.0),
        jnp.minimum(peak.share + 1.0 / nodes, 1.0),
    )
    signal = _choose(peak.late, orbit, row)._replace(constant=jnp.zeros_like(length))

    def value(share: Number) -> Instant:
        now = instant(half, orbit, share * length, peak.late)
        return now.rate(half.plant) if row == 0 else now

    def step(_: Array, share: Number) -> Number:
        slope = value(share).rate(half.plant)
        bend = signal.at(*slope.rate(half.plant)) * length
        onward = share - signal.at(*slope) / jnp.where(bend == 0.0, 1.0, bend)
        return jnp.where(there, jnp.clip(onward, low, high), share)

    share = jax.lax.fori_loop(0, 4, step, peak.share)
    return Peak(signal.at(*value(share)), share, peak.late)


def instant(half: Half, orbit: Orbit, s: Number, late: Bool[Array, ""]) -> Instant:
    """The time s after the turn, or after the crossing if `late`."""
    begun = jnp.where(late, orbit.root.t, 0.0)
    phase = turn(orbit.root.gamma + half.plant.linear.xi * (begun + s))
    return Instant(exponential(half.plant.slip, s), phase)


def _choose(late: Bool[Array, ""], orbit: Orbit, row: int) -> Coordinate:
    return jax.tree.map(lambda a, b: jnp.where(late, b, a), orbit.first[row], orbit.second[row])


def state_at(half: Half, orbit: Orbit, s: Number) -> State:
    """The state a time s in [0, 2 h) after the upper turn."""
    mirrored = s >= half.span
    s = jnp.where(mirrored, s - half.span, s)
    late = s >= orbit.root.t
    now = instant(half, orbit, jnp.where(late, s - orbit.root.t, s), late)
    rate = now.rate(half.plant)
    tilt, bob = _choose(late, orbit, 0), _choose(late, orbit, 1)
    y = jnp.stack([tilt.at(*now), bob.at(*now), tilt.at(*rate) - tilt.constant, bob.at(*rate) - bob.constant])
    return jnp.where(mirrored, -y, y)


def half_map(half: Half, orbit: Orbit) -> Matrix:
    """The derivative of -(the map over half a period), cut just after the turn: the flow of both
    arcs, and at its ends the saltation matrices of crossing and turning."""
    plant = half.plant
    (at,) = computed_once(crossing(half, orbit.root.t))
    first, second = _flow_matrix(plant, at.flow), _flow_matrix(plant, at.rest)
    linear, lost = plant.linear, plant.restitution - 1.0
    zero, one = jnp.zeros_like(half.span), jnp.ones_like(half.span)
    # Friction and weight enter the accelerations through the first column of M^-1.
    per_moment = (linear.m22 / linear.determinant, -linear.m21 / linear.determinant)
    before = _rates(half, orbit, orbit.first, at.flow, orbit.root.t)
    after = _rates(half, orbit, orbit.second, identity(one), orbit.root.t)
    jump = (lost, lost * 2.0 / plant.length_ratio)
    # After the impact the flow starts from R y; f_before is carried through R too.
    carried = (
        before[0],
        before[1],
        before[2] * (1.0 + lost),
        before[3] + jump[1] * before[2],
    )
    through = tuple(a - b for a, b in zip(after, carried, strict=True))
    end = _rates(half, orbit, orbit.second, at.rest, half.span)
    slack = 2.0 * linear.friction
    thrown = tuple(x / before[0] for x in through)
    pushed = tuple(-slack * x / end[2] for x in per_moment)
    first, second, (thrown,), (pushed,) = computed_once(first, second, (thrown,), (pushed,))
    crossing_jump = tuple(
        tuple(
            (one if i == j else zero)
            + (jump[i - 2] if j == 2 and i >= 2 else 0.0)
            + (thrown[i] if j == 0 else 0.0)
            for j in range(4)
        )
        for i in range(4)
    )
    turning_jump = tuple(
        tuple((one if i == j else zero) + (pushed[i - 2] if j == 2 and i >= 2 else 0.0) for j in range(4))
        for i in range(4)
    )
    m = product(turning_jump, product(second, product(crossing_jump, first)))
    return tuple(tuple(-x for x in row) for row in m)


def _rates(half: Half, orbit: Orbit, arc: tuple, flow: Factor, tau: Number) -> tuple[Number, ...]:
    """d/dtau of the state at a time on an arc."""
    phase = turn(orbit.root.gamma + half.plant.linear.xi * tau)
    rate = Instant(flow, phase).rate(half.plant)
    pull = rate.rate(half.plant)
    free = tuple(x._replace(constant=jnp.zeros_like(tau)) for x in arc)
    return free[0].at(*rate), free[1].at(*rate), free[0].at(*pull), free[1].at(*pull)


def _flow_matrix(plant: Plant, flow: Factor) -> Matrix:
    columns = []
    for i in range(4):
        unit = jnp.zeros(4).at[i].set(1.0)
        columns.append([c.of(flow) for c in components(plant, unit)])
    return tuple(tuple(columns[j][i] for j in range(4)) for i in range(4))


class Candidates(NamedTuple):
    """The orbits of one design, largest first; leading axis `ORBITS`. Not differentiated."""

    root: Root
    path: Path
    exists: Bool[Array, "orbits"]
    overflow: Bool[Array, ""]
    """Whether there were more roots than places for them, or one whose path needs more than `MOST_NODES`
    samples: such a root is not among the orbits."""


def candidates(half: Half) -> Candidates:
    """All orbits whose path keeps to its signs."""
    found = brackets(half)
    stacked = Bracket(*(jnp.stack(x) for x in zip(*found.brackets, strict=True)))

    def follow(bracket: Bracket, there: Array) -> tuple[Root, Path, Number, Bool[Array, ""], Bool[Array, ""]]:
        root, reached = converge(half, refine(half, bracket), there)
        orbit = orbit_of(half, root)
        (path, resolved), height = resolved_path(half, orbit), orbit.height
        good = (path.highest_rate < 0) & (path.leaving < 0) & (path.arriving < 0) & (height > 0)
        inside = (root.t > bracket.low - 0.5 * width) & (root.t < bracket.high + 0.5 * width)
        found = reached & inside & there & (height > 0)
        return root, path, height, good & found & resolved, found & ~resolved

    def step(_: None, slot: tuple[Bracket, Array]) -> tuple[None, tuple]:
        return None, where_needed(slot[1], follow, *slot)

    width = half.span / NODES
    _, (root, path, tops, good, unresolved) = jax.lax.scan(
        step, None, (stacked, jnp.arange(ROOTS) < found.number)
    )
    height = jnp.asarray(tops)
    ahead = height[None, :] > height[:, None]
    rank = jnp.where(good, jnp.sum(ahead & good[None, :], axis=1), ROOTS)

    def pick(x: Array) -> Array:
        return jnp.stack([jnp.sum(jnp.where(rank == i, x, 0), axis=0, dtype=x.dtype) for i in range(ORBITS)])

    root, path = jax.tree.map(pick, (root, path))
    exists = jnp.arange(ORBITS) < jnp.sum(good)
    overflow = (found.number > ROOTS) | (jnp.sum(good) > ORBITS) | jnp.any(unresolved)
    return Candidates(root, path, exists, overflow)
