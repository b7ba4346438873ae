"""Objective of a search: the merit of a design under every condition, with exact derivatives.

The objective evaluates designs under all conditions, applies the risk measure, and states the limits as
constraints. It asks for all symmetric period-one orbits in closed form, a hundred thousand designs a second,
so that its answer holds whatever the start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from tpd.analysis.symmetric_orbits import symmetric_orbits
from tpd.closed_form import uplift
from tpd.core.batch import in_chunks, prepare
from tpd.core.conditions import Conditions, under
from tpd.core.parameters import Parameters
from tpd.core.scene import Scene
from tpd.core.status import Status
from tpd.design.criteria import DesignSpace, Geometry, Limit, Risk, Size, Worsening
from tpd.design.ends import Linearisation

Count = Callable[[int, int], None]
"""Called with (units done, of how many)."""

_CHUNK = (64, 128)
"""Pairs of design and condition that are solved at once. Large chunks are quicker for each pair, but the last
steps of a descent ask for few: with fewer conditions than the first number, the first, else the second."""
BACK_OFF = 1e-5
"""Share of every limit that a search leaves unused. A descent may end so far beyond its constraints, by
rounding or where a limit has no derivative, and the design still keeps the limit itself."""
KINDS = ("rocking", "near_fold", "rest", "unstable", "no_orbit")
"""Motions of a design under a condition, see `Evaluation.kind`."""
ROCKING, NEAR, REST, UNSTABLE, NONE = range(5)


class Evaluation(NamedTuple):
    """Designs under conditions: arrays (m, n), derivatives (m, n, 3) with respect to (mu, lam, zeta)."""

    merit: np.ndarray
    """Tilt over nu where the block rocks; minus the uplift margin where it rests; above 1 where it does not
    settle. Lower is better, and a resting design is better than any rocking one. All have derivatives but
    orbits near a fold."""
    merit_slope: np.ndarray
    tilt: np.ndarray
    """Largest |phi| over nu; 0 at rest. Where no motion attracts, that of the largest orbit, or infinite."""
    tilt_slope: np.ndarray
    stroke: np.ndarray
    """Largest |psi| of the same motion, rad."""
    stroke_slope: np.ndarray
    margin: np.ndarray
    """Uplift margin."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers; 0 at rest."""
    reserve: np.ndarray
    """Distance of the orbit from where it stops attracting: the least of fold, symmetry and torus in
    `Margins`; 1 at rest."""
    reserve_slope: np.ndarray
    kind: np.ndarray
    """Index into `KINDS`."""
    root: np.ndarray
    """Time from the upper turn to the crossing, and phase of the turn, of the orbit that counts,
    (m, n, 2)."""
    design: np.ndarray
    """(m, 3)"""
    relative: np.ndarray | None = None
    """Largest |psi - phi|, rad, where it is known by itself."""

    @property
    def attracts(self) -> np.ndarray:
        """Whether there is a motion to settle into, as far as the objective can tell."""
        return self.kind <= REST

    def at(self, rows: np.ndarray | list[int]) -> Evaluation:
        """Evaluation of some of the designs."""
        return Evaluation(*(None if x is None else x[rows] for x in self))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Orbits:
    """Risk of the merits under all conditions, and limits: of the largest attracting symmetric period-one
    orbit under every condition, or of rest."""

    p: Parameters
    """Parameters of the bare block."""
    conditions: Conditions
    space: DesignSpace
    risk: Risk
    limits: tuple[Limit, ...]
    geometry: Geometry
    rest_counts: bool = False
    """Whether rest counts wherever it holds, though rocking attracts as well from other starts."""

    def evaluate(self, designs: np.ndarray, progress: Count | None = None) -> Evaluation:
        """Designs (mu, lam, zeta), shape (m, 3), under all conditions."""
        m, n = len(designs), len(self.conditions)
        # Designs and conditions are pairs of one long batch: chunks stay full whatever the shape.
        out = in_chunks(_orbits, self._batch(designs), chunk=self._chunk, progress=progress)
        return Evaluation(*(x.reshape(m, n, *x.shape[1:]) for x in out), design=designs)

    def prepare(self) -> None:
        """Begin to compile beside other work; `evaluate` waits for it."""
        prepare(_orbits, self._batch(np.zeros((1, 3))), chunk=self._chunk, wait=False)

    @property
    def _chunk(self) -> int:
        return _CHUNK[int(len(self.conditions) >= _CHUNK[0])]

    def _batch(self, designs: np.ndarray) -> tuple:
        factors = self.conditions.factor_rows()
        pairs = np.repeat(designs, len(factors), axis=0), np.tile(factors, (len(designs), 1))
        return self.p, *pairs, float(self.rest_counts)

    def over(self, conditions: Conditions) -> Orbits:
        """This objective under other conditions of the scene."""
        p, g = self.p, self.geometry
        nominal = float(g.wall[0] / g.slenderness[0]) * float(p.nu)
        geometry = geometry_under(float(p.nu), g.half_height, g.block_mass, nominal, conditions)
        return replace(self, conditions=conditions, geometry=geometry).against_bare()

    def against_bare(self) -> Orbits:
        """This objective, with the tilts of the bare block known to limits that compare with them."""
        if not any(isinstance(limit, Worsening) for limit in self.limits):
            return self
        # A bob without mass: the same program answers for the bare block.
        none = np.array([[0.0, float(self.p.lam), float(self.p.zeta)]])
        e = self.evaluate(none)
        tilt = np.where(e.attracts[0], e.tilt[0], np.nan)
        return replace(self, geometry=replace(self.geometry, bare_tilt=tilt))

    def value(self, e: Evaluation) -> np.ndarray:
        """Risk of the merits, (m,)."""
        return self.risk.of(e.merit)

    def sizes(self, e: Evaluation) -> list[Size]:
        """Limited quantities over their limits."""
        return [size for limit in self.limits for size in limit.sizes(e, self.geometry)]

    def constraints(self, e: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """Constraints (<= 0), shape (m, l), and their derivatives; l is n times the number of sizes."""
        m = len(e.kind)
        sizes = self.sizes(e)
        value = np.concatenate([np.zeros((m, 0)), *(s.value - 1.0 for s in sizes)], axis=1)
        slope = np.concatenate([np.zeros((m, 0, 3)), *(s.slope for s in sizes)], axis=1)
        # A quantity that is not finite breaks its limit, and no derivative says which way leads out.
        return np.where(np.isfinite(value), value, 10.0), np.where(np.isfinite(slope), slope, 0.0)

    def constraint_names(self) -> list[str]:
        """Names of the limited quantities, each the name of n constraints, in the order of `constraints`."""
        return [size.name for size in self.sizes(blank(1, len(self.conditions)))]

    def linearised(self, e: Evaluation) -> Linearisation:
        """Merits, tightened constraints and their derivatives along the searched shares of the bounds."""
        # Shares of the bounds: a step is as long along every coordinate.
        low, high = self.space.bounds
        scale, d = (high - low)[None, None, :], low.size
        limit, limit_slope = self.constraints(e)
        merit_slope, limit_slope = e.merit_slope[..., :d] * scale, limit_slope[..., :d] * scale
        return Linearisation(e.merit, merit_slope, limit + BACK_OFF, limit_slope)

    def at(self, unit: np.ndarray) -> Linearisation:
        """Linearisation at designs in shares of the bounds, (m, d)."""
        return self.linearised(self.evaluate(self.space.unscaled(unit)))


def blank(m: int, n: int) -> Evaluation:
    """Evaluation of `m` designs under `n` conditions with ones in place of sizes."""
    one, slope = np.ones((m, n)), np.zeros((m, n, 3))
    kind, root = np.zeros((m, n), int), np.full((m, n, 2), np.nan)
    sizes = one, slope, one, slope, one, slope
    return Evaluation(*sizes, one, one, one, slope, kind, root, np.ones((m, 3)))


def geometry_under(
    nu: float, half_height: float, block_mass: float, wall: float, conditions: Conditions
) -> Geometry:
    """Geometry under all conditions of a block of slenderness `nu`, `wall` half the width inside (m)."""
    slenderness = conditions.column("slenderness")
    return Geometry(
        half_height=half_height,
        block_mass=block_mass,
        wall=wall * slenderness,
        slenderness=nu * slenderness,
        mass_factor=conditions.column("mass"),
        length_factor=conditions.column("length"),
    )


def geometry_of(scene: Scene, conditions: Conditions) -> Geometry:
    """Geometry of a scene's block under all conditions."""
    block = scene.block
    return geometry_under(block.slenderness, block.half_height, block.mass, 0.5 * block.room, conditions)


def _orbits(args: tuple[Parameters, Array, Array, Array]) -> tuple:
    """`Evaluation` of one design under one condition."""
    p, design, factors, rest_counts = args

    def sizes(x: Array) -> tuple[tuple, tuple]:
        q = under(p, x, factors)
        o, lift = symmetric_orbits(q), uplift(q)
        reserve = jnp.minimum(jnp.minimum(o.margins.fold, o.margins.symmetry), o.margins.torus)
        out = o.amplitude / q.nu, o.stroke, reserve, jnp.asarray(lift.margin), jnp.asarray(lift.stroke)
        root = jnp.stack([o.crossing, o.phase], axis=-1)
        return out, (out, o.status, jnp.max(jnp.abs(o.multipliers), axis=-1), root)

    # Forward mode: three directions against some ten answers, and a derivative that is missing in one answer
    # stays out of the others.
    slopes, (values, status, multipliers, root) = jax.jacfwd(sizes, has_aux=True)(design)
    kinds = _kinds(status)
    # Orbits come sorted by amplitude, the largest first: of equal kinds the largest counts.
    best = jnp.argmin(kinds)
    margin, still = values[3], values[4]
    rests = (margin > 0.0) & ((kinds[best] > REST) | (rest_counts > 0.0))
    kind = jnp.where(rests, REST, kinds[best])
    at_rest, moves = kind == REST, (kind != REST) & (kind != NONE)

    def chosen(i: int, other: Array) -> Array:
        return _finite(jnp.where(moves, slopes[i][best], other))

    tilt = jnp.where(moves, values[0][best], jnp.where(at_rest, 0.0, jnp.inf))
    tilt_slope, margin_slope = chosen(0, jnp.zeros(3)), _finite(slopes[3])
    stroke = jnp.where(moves, values[1][best], still)
    multiplier = jnp.where(moves, multipliers[best], jnp.where(at_rest, 0.0, jnp.inf))
    reserve = jnp.where(moves, values[2][best], jnp.where(at_rest, 1.0, 0.0))
    merit = _merit(kind, tilt, margin)
    merit_slope = jnp.where(moves, tilt_slope, -margin_slope)
    both = merit, merit_slope, tilt, tilt_slope, stroke, chosen(1, slopes[4])
    return *both, margin, multiplier, reserve, chosen(2, jnp.zeros(3)), kind, root[best]


def _kinds(status: Status) -> Array:
    """Index into `KINDS` of each orbit, the best of them the smallest."""
    near = (status == Status.near_fold) | (status == Status.grazing)
    kinds = jnp.where(status == Status.rocking, ROCKING, jnp.where(near, NEAR, UNSTABLE))
    return jnp.where(status == Status.no_orbit, NONE, kinds)


def _merit(kind: Array, tilt: Array, margin: Array) -> Array:
    """Merit of an orbit, of rest, or of nothing that attracts: the worse, the larger."""
    # Above any attracting orbit, whose tilt is below one: a search must leave such designs, and the uplift
    # margin says which way leads to rest.
    nothing = jnp.where(kind == UNSTABLE, 1.0 + tilt, 2.0 - margin)
    return jnp.where(kind <= NEAR, tilt, jnp.where(kind == REST, -margin, nothing))


def _finite(x: Array) -> Array:
    return jnp.where(jnp.isfinite(x), x, 0.0)


def margins(objective: Orbits, designs: np.ndarray) -> np.ndarray:
    """Uplift margins of designs (m, 3) under all conditions, (m, n), in closed form."""
    rows = objective.conditions.factor_rows()
    # One condition after the other: all at once would take n times the memory.
    return np.stack([np.asarray(uplift(under(objective.p, designs.T, row)).margin) for row in rows], axis=1)
