"""All symmetric period-one orbits of one design: the roots of the scalar equation whose paths keep to their
signs.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from tpd.core.parameters import Number
from tpd.exact.batch_branches import where_needed
from tpd.exact.orbit_equation import Half
from tpd.exact.orbit_path import Path, resolved_path
from tpd.exact.orbit_roots import NODES, ROOTS, Bracket, Root, brackets, converge, refine
from tpd.exact.symmetric_orbit import orbit_of

ORBITS = 3
"""Most orbits per design."""


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
    # Roots in order of the crossing time say nothing about size, and some are no orbits. All that have a
    # place are followed, then ranked by height. Sums over masks pick the ranks, because a batch fuses them,
    # and a sort and a gather it does not.
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
