"""Symmetric period-one orbits, every one of them: the motion that belongs to a root of the scalar
equation (`tpd.exact.conditions`), its path from turn to turn, and the derivative of its map.

A root is an orbit only if the tilt falls all the way from turn to turn, which is checked along its
path.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from tpd.exact.conditions import Half, conditions, crossing
from tpd.exact.matrix import Factor, Functional, components, exponential, identity
from tpd.exact.multipliers import Matrix, product
from tpd.exact.roots import NODES, ROOTS, Bracket, Root, brackets, converge, refine
from tpd.exact.spectrum import Plant
from tpd.exact.trigonometry import Turn, turn
from tpd.parameters import Number, State

ORBITS = 3
"""Most orbits per design."""
PATH_NODES = 16
"""Samples of each of the two arcs of a half period, between which its extremes are looked for."""


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
    c = conditions(half, at)
    impact = c.impact.at(phase)
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
    bob_time: Number
    """Time on its arc at which |psi| is largest."""
    bob_late: Bool[Array, ""]
    """Whether that is on the second arc."""


def path_of(half: Half, orbit: Orbit) -> Path:
    """Follow both arcs, sampled with their accelerations: what peaks between two samples is found
    from these."""
    plant, xi = half.plant, half.plant.linear.xi
    start = turn(orbit.root.gamma)
    met, dent = jnp.full_like(orbit.root.t, -jnp.inf), jnp.full_like(orbit.root.t, jnp.inf)
    bob = (-jnp.ones_like(met), jnp.zeros_like(met), jnp.zeros(met.shape, bool))
    ends = []
    for late, arc in enumerate((orbit.first, orbit.second)):
        length = half.span - orbit.root.t if late else orbit.root.t
        spacing = length / PATH_NODES
        onward, turning = exponential(plant.slip, spacing), turn(xi * spacing)

        def look(now: Instant, arc: tuple = arc) -> tuple[Number, Number, Number]:
            rate = now.rate(plant)
            tilt = arc[0]._replace(constant=jnp.zeros_like(xi))
            return tilt.at(*rate), tilt.at(*rate.rate(plant)), jnp.abs(arc[1].at(*now))

        def step(
            i: Array,
            carry: tuple,
            late: int = late,
            spacing: Number = spacing,
            ahead: tuple[Factor, Turn] = (onward, turning),
        ) -> tuple:
            now, (rate0, pull0, _), met, dent, bob = carry
            now = Instant(now.flow.times(ahead[0], plant.slip), now.phase.then(ahead[1]))
            rate, pull, angle = seen = look(now)
            peaked = (pull0 > 0) & (pull <= 0)
            share = pull0 / jnp.where(peaked, pull0 - pull, 1.0)
            from_left = rate0 + 0.5 * pull0 * share * spacing
            from_right = rate - 0.5 * pull * (1.0 - share) * spacing
            last = (i == PATH_NODES - 1) & (late == 1)
            met = jnp.maximum(met, jnp.where(last, -jnp.inf, rate))
            dent = jnp.minimum(dent, jnp.where(peaked, -jnp.maximum(from_left, from_right), jnp.inf))
            larger = angle > bob[0]
            bob = (
                jnp.where(larger, angle, bob[0]),
                jnp.where(larger, spacing * (i + 1.0), bob[1]),
                jnp.where(larger, late == 1, bob[2]),
            )
            return now, seen, met, dent, bob

        now = Instant(identity(orbit.root.t), start)
        seen = look(now)
        ends.append(seen[1])
        now, seen, met, dent, bob = jax.lax.fori_loop(0, PATH_NODES, step, (now, seen, met, dent, bob))
        ends.append(seen[1])
        start = now.phase
    time = _bob_peak(half, orbit, bob[1], bob[2])
    return Path(jnp.maximum(met, -dent), dent, ends[0], -ends[3], time, bob[2])


def instant(half: Half, orbit: Orbit, s: Number, late: Bool[Array, ""]) -> Instant:
    """The time s after the turn, or after the crossing if `late`."""
    begun = jnp.where(late, orbit.root.t, 0.0)
    phase = turn(orbit.root.gamma + half.plant.linear.xi * (begun + s))
    return Instant(exponential(half.plant.slip, s), phase)


def _choose(late: Bool[Array, ""], orbit: Orbit, row: int) -> Coordinate:
    return jax.tree.map(lambda a, b: jnp.where(late, b, a), orbit.first[row], orbit.second[row])


def _bob_peak(half: Half, orbit: Orbit, s: Number, late: Bool[Array, ""]) -> Number:
    """The turning point of the bob next to a sample, unless the sample is at the end of its arc."""
    length = jnp.where(late, half.span - orbit.root.t, orbit.root.t)
    low = jnp.maximum(s - length / PATH_NODES, 0.0)
    high = jnp.minimum(s + length / PATH_NODES, length)
    bob = _choose(late, orbit, 1)._replace(constant=jnp.zeros_like(s))

    def step(_: Array, s: Number) -> Number:
        rate = instant(half, orbit, s, late).rate(half.plant)
        slope = bob.at(*rate.rate(half.plant))
        return jnp.clip(s - bob.at(*rate) / jnp.where(slope == 0.0, 1.0, slope), low, high)

    return jax.lax.fori_loop(0, 4, step, s)


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
    plant, at = half.plant, crossing(half, orbit.root.t)
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
    crossing_jump = tuple(
        tuple(
            (one if i == j else zero)
            + (jump[i - 2] if j == 2 and i >= 2 else 0.0)
            + (through[i] / before[0] if j == 0 else 0.0)
            for j in range(4)
        )
        for i in range(4)
    )
    end = _rates(half, orbit, orbit.second, at.rest, half.span)
    slack = 2.0 * linear.friction
    push = (zero, zero, -slack * per_moment[0], -slack * per_moment[1])
    turning_jump = tuple(
        tuple((one if i == j else zero) + (push[i] / end[2] if j == 2 else 0.0) for j in range(4))
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
    """Whether there were more roots than places for them."""


def candidates(half: Half) -> Candidates:
    """All orbits whose path keeps to its signs."""
    found = brackets(half)
    stacked = Bracket(*(jnp.stack(x) for x in zip(*found.brackets, strict=True)))

    def follow(bracket: Bracket, there: Array) -> tuple[Root, Path, Number, Bool[Array, ""]]:
        root, reached = converge(half, refine(half, bracket), there)
        orbit = orbit_of(half, root)
        path, height = path_of(half, orbit), orbit.height
        good = (path.highest_rate < 0) & (path.leaving < 0) & (path.arriving < 0) & (height > 0)
        inside = (root.t > bracket.low - 0.5 * width) & (root.t < bracket.high + 0.5 * width)
        return root, path, height, good & reached & inside & there

    width = half.span / NODES
    root, path, tops, good = jax.vmap(follow)(stacked, jnp.arange(ROOTS) < found.number)
    height = jnp.asarray(tops)
    ahead = height[None, :] > height[:, None]
    rank = jnp.where(good, jnp.sum(ahead & good[None, :], axis=1), ROOTS)

    def pick(x: Array) -> Array:
        return jnp.stack([jnp.sum(jnp.where(rank == i, x, 0), axis=0, dtype=x.dtype) for i in range(ORBITS)])

    root, path = jax.tree.map(pick, (root, path))
    exists = jnp.arange(ORBITS) < jnp.sum(good)
    return Candidates(root, path, exists, (found.number > ROOTS) | (jnp.sum(good) > ORBITS))
