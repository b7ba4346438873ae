"""Where symmetric period-one orbits are lost: what vanishes there, as functions of the crossing time
t, the phase gamma and the parameters, with their derivatives.

The orbits are the roots of the two conditions of `tpd.exact.orbit_equation`. Two of them merge where the
derivative determinant of these with respect to (t, gamma) vanishes, which is a multiple of det(I - G),
G the derivative of the mirrored half-period map. They lose their symmetry where det(I + G) = 0,
stick where phi''(0+) = 0, and graze where phi'(s) = phi''(s) = 0 for an s between the turns.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tpd.core.eigenvalues import felt_by_block
from tpd.core.parameters import Number, Parameters
from tpd.exact.modes import Plant
from tpd.exact.orbit_equation import Crossing, Half, conditions, crossing, per_time
from tpd.exact.orbit_roots import Root
from tpd.exact.symmetric_orbit import Orbit, half_map, instant, orbit_of
from tpd.exact.trigonometry import Turn, turn

SAMPLES = 199
"""Times between the turns at which `survey` looks."""


def vanishing(u: Float[Array, "3"], p: Parameters) -> Float[Array, "7"]:
    """phi'(0), phi(t), the derivative determinant of both, det(I + G), phi''(0+), phi'(s), phi''(s),
    for u = (t, gamma, s)."""
    half, root, phase = Half(Plant(p)), Root(u[0], u[1]), turn(u[1])
    orbit, c = orbit_of(half, root), conditions(half, crossing(half, root.t))
    both = [c.turning.at(phase), c.crossing.at(phase)]
    leaving = fall(half, orbit, jnp.zeros_like(root.t))[1]
    determinants = [_merging(half, root), _symmetry(p, half, orbit)]
    return jnp.stack([*both, *determinants, leaving, *fall(half, orbit, u[2])])


def fall(half: Half, orbit: Orbit, s: Number) -> tuple[Number, Number]:
    """phi' and phi'' a time s after the upper turn, before the next."""
    late = jnp.asarray(s > orbit.root.t)
    arc = jax.tree.map(lambda a, b: jnp.where(late, b, a), orbit.first[0], orbit.second[0])
    tilt = arc.changing()
    rate = instant(half, orbit, s - jnp.where(late, orbit.root.t, 0.0), late).rate(half.plant.slip)
    return tilt.at(rate), tilt.at(rate.rate(half.plant.slip))


class Survey(NamedTuple):
    """Extremes of a solution (t, gamma) of the conditions between its turns. It is an orbit if height > 0 and
    all the others are < 0."""

    height: Number
    """phi at the turn."""
    leaving: Number
    """phi'' just after it."""
    arriving: Number
    """-phi'' just before the next turn."""
    rates: Float[Array, "times"]
    """phi' at `SAMPLES` equal steps between them."""


def survey(u: Float[Array, "2"], p: Parameters) -> Survey:
    """The way of the solution u = (t, gamma), looked at more closely than `path_of` does."""
    half = Half(Plant(p))
    orbit = orbit_of(half, Root(u[0], u[1]))
    times = half.span * jnp.arange(1, SAMPLES + 1) / (SAMPLES + 1)
    rates = jnp.asarray(jax.vmap(lambda s: fall(half, orbit, s)[0])(times))
    begin, end = fall(half, orbit, jnp.zeros_like(u[0])), fall(half, orbit, half.span)
    return Survey(orbit.height, begin[1], -end[1], rates)


def _merging(half: Half, root: Root) -> Number:
    """The determinant of the derivatives of both conditions with respect to (t, gamma)."""
    at, phase = crossing(half, root.t), turn(root.gamma)

    def values(at: Crossing, phase: Turn) -> tuple[Number, Number]:
        c = conditions(half, at)
        return c.turning.at(phase), c.crossing.at(phase)

    # Two orbits merge where this vanishes. In terms of (t, gamma) it is smooth through the fold, while the
    # multipliers themselves have a square root there.
    quarter = Turn(-phase.sine, phase.cosine)
    a, c = jax.jvp(lambda at: values(at, phase), (at,), (per_time(half, at),))[1]
    b, d = jax.jvp(lambda phase: values(at, phase), (phase,), (quarter,))[1]
    return a * d - b * c


def _symmetry(p: Parameters, half: Half, orbit: Orbit) -> Number:
    """det(I + G), without a bob that has no mass."""
    g = felt_by_block(p, half_map(half, orbit))
    return jnp.linalg.det(jnp.eye(4) + jnp.stack([jnp.stack(row) for row in g]))
