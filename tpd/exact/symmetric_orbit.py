"""Symmetric period-one orbits: the motion that belongs to a root of the scalar equation
(`tpd.exact.orbit_equation`), and the derivative of its map over half a period.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from tpd.core.eigenvalues import Matrix, product
from tpd.core.parameters import Number, State
from tpd.exact.batch_branches import computed_once
from tpd.exact.contact import impact_jump
from tpd.exact.modes import Plant
from tpd.exact.orbit_equation import Crossing, Half, conditions, crossing
from tpd.exact.orbit_roots import Root
from tpd.exact.propagator import Factor, components, exponential, identity
from tpd.exact.signal import Harmonic, Instant, Signal
from tpd.exact.trigonometry import turn


class Orbit(NamedTuple):
    """The half period from the upper turn: two arcs of both coordinates."""

    root: Root
    first: tuple[Signal, Signal]
    second: tuple[Signal, Signal]
    impact: Number
    """V"""
    at: Crossing
    """Crossing between them."""

    @property
    def height(self) -> Number:
        """phi at the turn."""
        return self.first[0].at(Instant(identity(self.root.t), turn(self.root.gamma)))


@jax.jit
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
        first.append(Signal(balance, free, Harmonic(along, across)))
        step = half.step if row == 0 else zero
        second.append(Signal(balance - step, later, Harmonic(along, across)))
    return Orbit(root, tuple(first), tuple(second), impact, at)


@jax.jit
def instant(half: Half, orbit: Orbit, s: Number, late: Bool[Array, ""]) -> Instant:
    """The time s after the turn, or after the crossing if `late`."""
    begun = jnp.where(late, orbit.root.t, 0.0)
    phase = turn(orbit.root.gamma + half.plant.linear.xi * (begun + s))
    return Instant(exponential(half.plant.slip, s), phase)


def on_arc(late: Bool[Array, ""], orbit: Orbit, row: int) -> Signal:
    """phi (row 0) or psi (row 1) on the second arc if `late`, else on the first."""
    return jax.tree.map(lambda a, b: jnp.where(late, b, a), orbit.first[row], orbit.second[row])


def state_at(half: Half, orbit: Orbit, s: Number) -> State:
    """The state a time s in [0, 2 h) after the upper turn."""
    mirrored = s >= half.span
    s = jnp.where(mirrored, s - half.span, s)
    late = s >= orbit.root.t
    now = instant(half, orbit, jnp.where(late, s - orbit.root.t, s), late)
    rate = now.rate(half.plant.slip)
    tilt, bob = on_arc(late, orbit, 0), on_arc(late, orbit, 1)
    y = jnp.stack([tilt.at(now), bob.at(now), tilt.at(rate) - tilt.constant, bob.at(rate) - bob.constant])
    return jnp.where(mirrored, -y, y)


def half_map(half: Half, orbit: Orbit) -> Matrix:
    """The derivative G of -(the map over half a period), cut just after the turn."""
    # The orbit is its own mirror image, so that the mirrored half map has it as a fixed point and G G is the
    # derivative of the whole map: half the work, and twice the resolution of multipliers near 1. G is the
    # product of the flows of both arcs and, between them, one saltation matrix for each event: a neighbour
    # meets the event a little earlier or later and meanwhile moves by the rates of the other side.
    plant = half.plant
    at = orbit.at
    first, second = _flow_matrix(plant, at.flow), _flow_matrix(plant, at.rest)
    thrown, jump = _thrown(half, orbit, at.flow)
    pushed = _pushed(half, orbit, at.rest)
    first, second, (thrown,), (pushed,) = computed_once(first, second, (thrown,), (pushed,))
    m = product(_crossed(half.span, jump, thrown), first)
    m = product(_turned(half.span, pushed), product(second, m))
    return tuple(tuple(-x for x in row) for row in m)


def _thrown(half: Half, orbit: Orbit, flow: Factor) -> tuple[tuple[Number, ...], tuple[Number, Number]]:
    """The crossing's change of state per unit of tilt with which a neighbour arrives, and the jumps of phi'
    and psi' per unit of phi' before it."""
    plant, one = half.plant, jnp.ones_like(half.span)
    before = _rates(half, orbit, orbit.first, flow, orbit.root.t)
    after = _rates(half, orbit, orbit.second, identity(one), orbit.root.t)
    jump = impact_jump(plant.restitution - 1.0, plant.length_ratio)
    # After the impact the flow starts from R y; f_before is carried through R too.
    carried = (before[0], before[1], before[2] * (1.0 + jump[0]), before[3] + jump[1] * before[2])
    through = tuple(a - b for a, b in zip(after, carried, strict=True))
    return tuple(x / before[0] for x in through), jump


def _pushed(half: Half, orbit: Orbit, rest: Factor) -> tuple[Number, ...]:
    """The turn's change of (phi', psi') per unit of phi' with which a neighbour arrives."""
    linear = half.plant.linear
    end = _rates(half, orbit, orbit.second, rest, half.span)
    # Friction and weight enter the accelerations through the first column of M^-1.
    per_moment = (linear.m22 / linear.determinant, -linear.m21 / linear.determinant)
    return tuple(-2.0 * linear.friction * x / end[2] for x in per_moment)


def _crossed(like: Number, jump: tuple[Number, Number], thrown: tuple[Number, ...]) -> Matrix:
    """The saltation matrix of the crossing."""
    rows = [list(row) for row in _unit(like)]
    for i in range(4):
        rows[i][0] = rows[i][0] + thrown[i]
    rows[2][2], rows[3][2] = rows[2][2] + jump[0], rows[3][2] + jump[1]
    return tuple(tuple(row) for row in rows)


def _turned(like: Number, pushed: tuple[Number, ...]) -> Matrix:
    """The saltation matrix of the turn."""
    rows = [list(row) for row in _unit(like)]
    rows[2][2], rows[3][2] = rows[2][2] + pushed[0], rows[3][2] + pushed[1]
    return tuple(tuple(row) for row in rows)


def _unit(like: Number) -> Matrix:
    one, zero = jnp.ones_like(like), jnp.zeros_like(like)
    return tuple(tuple(one if i == j else zero for j in range(4)) for i in range(4))


@jax.jit
def _rates(half: Half, orbit: Orbit, arc: tuple, flow: Factor, tau: Number) -> tuple[Number, ...]:
    """d/dtau of the state at a time on an arc."""
    phase = turn(orbit.root.gamma + half.plant.linear.xi * tau)
    rate = Instant(flow, phase).rate(half.plant.slip)
    pull = rate.rate(half.plant.slip)
    free = tuple(x.changing() for x in arc)
    return free[0].at(rate), free[1].at(rate), free[0].at(pull), free[1].at(pull)


@jax.jit
def _flow_matrix(plant: Plant, flow: Factor) -> Matrix:
    columns = []
    for i in range(4):
        unit = jnp.zeros(4).at[i].set(1.0)
        columns.append([c.of(flow) for c in components(plant, unit)])
    return tuple(tuple(columns[j][i] for j in range(4)) for i in range(4))
