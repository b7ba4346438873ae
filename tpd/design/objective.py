"""A design for everything that the block may see: the pendulum that is best in the worst of many conditions.

Every condition is answered by all symmetric period-one orbits and the uplift margin, in closed form and
with exact gradients: a hundred thousand a second. So the search is over what the block can do however it
starts, and events, the nonlinear equations and an ensemble of runs judge what it finds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from tpd.analysis.symmetric_orbits import symmetric_orbits
from tpd.closed_form.no_uplift import uplift
from tpd.core.batch import in_chunks, trace
from tpd.core.conditions import Conditions, Limits, Measure, under
from tpd.core.parameters import Parameters
from tpd.core.scene import Scene
from tpd.core.status import Status
from tpd.design.result import DesignSpace
from tpd.design.sequential import Local

_CHUNK = (64, 128)
"""Designs under one condition each that are solved at once: the more the quicker each, but the last steps of
a descent ask for few. With as many conditions as the first or more, the second."""
_BALL = 0.5
"""Largest radius of a ball of steel, in lengths of its rod: beyond it the ball is no point, whose own moment
of inertia is 2/5 of the square of that, and would touch what it hangs from."""
KINDS = ("rocking", "near_fold", "rest", "unstable", "no_orbit")
"""What a design does under a condition, see `Told.kind`."""
_ROCKING, _NEAR, _REST, _UNSTABLE, _NONE = range(5)


class Told(NamedTuple):
    """Designs under conditions: arrays (m, n), slopes (m, n, 3) in (mu, lam, zeta)."""

    merit: np.ndarray
    """tilt where the block rocks; -margin where it can only rest; above 1 where no symmetric orbit
    attracts and rest does not hold: lower is better, and all but orbits near a fold have slopes."""
    merit_slope: np.ndarray
    tilt: np.ndarray
    """Largest |phi| over nu of the largest attracting symmetric orbit; 0 at rest. Where none attracts that
    of the largest, or infinite."""
    tilt_slope: np.ndarray
    stroke: np.ndarray
    """Largest |psi| of the same, rad."""
    stroke_slope: np.ndarray
    margin: np.ndarray
    """Of `uplift`."""
    multiplier: np.ndarray
    """Largest modulus; 0 at rest."""
    reserve: np.ndarray
    """What is left until the orbit stops attracting: the least of fold, symmetry and torus in `Margins`;
    1 at rest."""
    reserve_slope: np.ndarray
    kind: np.ndarray
    """Index into `KINDS`."""
    design: np.ndarray
    """(m, 3)"""
    lost: np.ndarray | float = 0.0
    """Share of the starts that overturn, where starts are followed: tilt and stroke are of the others."""
    loose: np.ndarray | float = 0.0
    """Share of the starts whose motion has no derivative: not settled, grazing or about to vanish."""

    @property
    def attracts(self) -> np.ndarray:
        """Whether there is a motion to settle into, as far as symmetric orbits and rest can tell."""
        return self.kind <= _REST


@dataclass(frozen=True)
class Objective:
    """What is asked of a design: a measure of the tilt under conditions, and limits."""

    p: Parameters
    conditions: Conditions
    space: DesignSpace
    measure: Measure
    limits: Limits
    from_rest: bool
    """Whether rest counts where it holds, though rocking attracts as well from other starts."""
    half_height: float = 1.0
    """Of the block, m."""
    ball: float = 0.0
    """Radius of a ball of steel that weighs what the block does, m."""

    @staticmethod
    def of(
        scene: Scene,
        conditions: Conditions,
        space: DesignSpace,
        measure: Measure,
        limits: Limits,
        from_rest: bool = False,
    ) -> Objective:
        """That of a scene."""
        ball = scene.pendulum(mass_ratio=1.0, length_ratio=1.0, damping_ratio=0.0).ball_radius
        sizes = scene.block.half_height, ball
        return Objective(scene.parameters(), conditions, space, measure, limits, from_rest, *sizes)

    def fewer(self, most: int, seed: int) -> Objective:
        """The same over at most so many of the conditions, see `Conditions.some`."""
        return replace(self, conditions=self.conditions.some(most, seed))

    def told(self, designs: np.ndarray, progress: Callable[[int, int], None] | None = None) -> Told:
        """Designs (mu, lam, zeta), shape (m, 3), under all conditions."""
        m, n = len(designs), len(self.conditions)
        out = in_chunks(_one, self._batch(designs), chunk=self._chunk, progress=progress)
        return Told(*(x.reshape(m, n, *x.shape[1:]) for x in out), design=designs)

    def trace(self) -> None:
        """What `told` does in Python before anything can be compiled."""
        trace(_one, self._batch(np.zeros((1, 3))), chunk=self._chunk)

    @property
    def _chunk(self) -> int:
        return _CHUNK[int(len(self.conditions) >= _CHUNK[0])]

    def _batch(self, designs: np.ndarray) -> tuple:
        factors = np.asarray(self.conditions.rows())
        every = np.repeat(designs, len(factors), axis=0), np.tile(factors, (len(designs), 1))
        return self.p, *every, float(self.from_rest)

    def value(self, told: Told) -> np.ndarray:
        """The measure of the merits, (m,)."""
        return self.measure.of(told.merit)

    def limited(self, told: Told) -> tuple[np.ndarray, np.ndarray]:
        """Constraints (<= 0), shape (m, l), and their slopes; l is n times the number of limits."""
        rows, slopes = [], []
        for size, slope, limit in self._sizes(told):
            rows.append(size / limit - 1.0)
            slopes.append(slope / limit)
        value, slope = np.concatenate(rows, axis=1), np.concatenate(slopes, axis=1)
        # What has no size breaks its limit, and nothing says which way leads out.
        return np.where(np.isfinite(value), value, 10.0), np.where(np.isfinite(slope), slope, 0.0)

    def limit_names(self) -> list[str]:
        """Of the constraints, in the order of `limited`."""
        asked = ("relative_stroke", "tilt", "multiplier", "reserve", "offset", "walls")
        names = ["stroke", *(n for n in asked if n in self.limits.told())]
        names += ["ball"] if self.limits.walls else []
        return [name for name in names for _ in range(len(self.conditions))]

    def _sizes(self, t: Told) -> list[tuple[np.ndarray, np.ndarray, float]]:
        nu = (float(self.p.nu) * self.conditions.column("slenderness"))[None, :]
        out = [(t.stroke, t.stroke_slope, self.space.stroke)]
        limits = self.limits
        if limits.relative_stroke is not None:
            both = t.stroke_slope + t.tilt_slope * nu[..., None]
            out.append((t.stroke + t.tilt * nu, both, limits.relative_stroke))
        if limits.tilt is not None:
            out.append((t.tilt, t.tilt_slope, limits.tilt))
        if limits.multiplier is not None:
            out.append((t.multiplier, np.zeros_like(t.tilt_slope), limits.multiplier))
        if limits.reserve is not None:
            # As a size that must stay below one.
            out.append((2.0 - t.reserve / limits.reserve, -t.reserve_slope / limits.reserve, 1.0))
        if limits.offset is not None or limits.walls:
            out.extend(self._room_sizes(t))
        return out

    def room(self, designs: np.ndarray, angle: np.ndarray) -> dict[str, np.ndarray]:
        """What a bob takes of the room to either side, by the limits on that, over what they allow.

        Args:
            designs: (mu, lam, zeta), shape (m, 3).
            angle: largest angle between bob and block, rad, under every condition, shape (m, n).

        Returns:
            "offset": the middle of the bob; "walls": the outside of a ball of steel; "ball": its radius,
            against half the rod. Shapes (m, n).
        """
        rod, ball, wall = self._lengths(designs)
        reach, out = rod * np.sin(np.minimum(angle, 0.5 * np.pi)), {}
        if self.limits.offset is not None:
            out["offset"] = reach / self.limits.offset
        if self.limits.walls:
            out |= {"walls": (reach + ball) / wall, "ball": ball / (_BALL * rod)}
        return out

    def _lengths(self, designs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of the rod, a ball of steel's radius and half the width of the block, m, (m, n)."""
        of = self.conditions.column
        rod = self.half_height * designs[:, 1, None] * of("length")
        ball = self.ball * np.cbrt(designs[:, 0, None] * of("mass"))
        return rod, ball, self.half_height * float(self.p.nu) * of("slenderness")[None, :]

    def _room_sizes(self, t: Told) -> list[tuple[np.ndarray, np.ndarray, float]]:
        rod, ball, wall = self._lengths(t.design)
        nu = wall / self.half_height
        # Together never less than the angle between them.
        angle = t.stroke + t.tilt * nu
        swinging = np.where(angle < 0.5 * np.pi, rod * np.cos(np.where(np.isfinite(angle), angle, 0.0)), 0.0)
        slope = swinging[..., None] * (t.stroke_slope + t.tilt_slope * nu[..., None])
        slope[..., 1] += rod / t.design[:, 1, None] * np.sin(np.minimum(angle, 0.5 * np.pi))
        longer, growing = np.zeros_like(slope), np.zeros_like(slope)
        longer[..., 1] = rod / t.design[:, 1, None]
        # That of no bob at all would be infinite.
        growing[..., 0] = ball / np.maximum(3.0 * t.design[:, 0, None], 1e-9)
        most = _BALL * rod
        slopes = {
            "offset": slope if self.limits.offset is None else slope / self.limits.offset,
            "walls": (slope + growing) / wall[..., None],
            "ball": (growing - (ball / rod)[..., None] * longer) / most[..., None],
        }
        return [(size, slopes[name], 1.0) for name, size in self.room(t.design, angle).items()]

    def local(self, unit: np.ndarray) -> Local:
        """For the search, at designs in shares of the bounds, (m, d)."""
        low, high = self.space.bounds
        return self.scaled(self.told(self.space.full(low + unit * (high - low))))

    def scaled(self, told: Told) -> Local:
        """What the search asks of designs, its slopes along shares of the bounds."""
        low, high = self.space.bounds
        scale = (high - low)[None, None, :]
        limit, limit_slope = self.limited(told)
        d = low.size
        return Local(told.merit, told.merit_slope[..., :d] * scale, limit, limit_slope[..., :d] * scale)


def _one(args: tuple[Parameters, Array, Array, Array]) -> tuple:
    """`Told` of one design under one condition."""
    p, design, factors, from_rest = args

    def sizes(x: Array) -> tuple[Array, tuple]:
        q = under(p, x, factors)
        o, lift = symmetric_orbits(q), uplift(q)
        margins = o.margins
        reserve = jnp.minimum(jnp.minimum(margins.fold, margins.symmetry), margins.torus)
        still = jnp.stack([jnp.asarray(lift.margin), jnp.asarray(lift.stroke)])
        out = jnp.concatenate([o.amplitude / q.nu, o.stroke, still, reserve])
        return out, (out, o.status, jnp.max(jnp.abs(o.multipliers), axis=-1))

    slopes, (values, status, multipliers) = jax.jacfwd(sizes, has_aux=True)(design)
    near = (status == Status.near_fold) | (status == Status.grazing)
    kinds = jnp.where(status == Status.rocking, _ROCKING, jnp.where(near, _NEAR, _UNSTABLE))
    kinds = jnp.where(status == Status.no_orbit, _NONE, kinds)
    margin = values[6]
    rests = margin > 0.0
    best = jnp.argmin(kinds)
    kind = jnp.where(rests & ((kinds[best] > _REST) | (from_rest > 0.0)), _REST, kinds[best])
    moves = (kind != _REST) & (kind != _NONE)
    tilt = jnp.where(moves, values[best], jnp.where(kind == _REST, 0.0, jnp.inf))
    stroke = jnp.where(moves, values[3 + best], values[7])
    multiplier = jnp.where(moves, multipliers[best], jnp.where(kind == _REST, 0.0, jnp.inf))

    def sound(x: Array) -> Array:
        return jnp.where(jnp.isfinite(x), x, 0.0)

    reserve = jnp.where(moves, values[8 + best], jnp.where(kind == _REST, 1.0, 0.0))
    reserve_slope = sound(jnp.where(moves, slopes[8 + best], 0.0))
    lost = jnp.where(kind == _UNSTABLE, 1.0 + tilt, 2.0 - margin)
    merit = jnp.where(kind <= _NEAR, tilt, jnp.where(kind == _REST, -margin, lost))

    tilt_slope = sound(jnp.where(moves, slopes[best], 0.0))
    stroke_slope = sound(jnp.where(moves, slopes[3 + best], slopes[7]))
    merit_slope = jnp.where(moves, tilt_slope, -sound(slopes[6]))
    sizes_and_slopes = merit, merit_slope, tilt, tilt_slope, stroke, stroke_slope
    return *sizes_and_slopes, margin, multiplier, reserve, reserve_slope, kind


def margins(objective: Objective, designs: Any) -> np.ndarray:
    """Uplift margins of designs (m, 3) under all conditions, (m, n), in closed form."""
    return np.asarray(_margins(objective.p, jnp.asarray(designs), objective.conditions.rows()))


@jax.jit
def _margins(p: Parameters, designs: Array, factors: Array) -> Array:
    def one(design: Array, row: Array) -> Array:
        return jnp.asarray(uplift(under(p, design, row)).margin)

    return jax.vmap(jax.vmap(one, (None, 0)), (0, None))(designs, factors)
