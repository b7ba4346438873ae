"""Symmetric orbits of designs under all conditions, with exact derivatives.

`Orbits` solves all symmetric period-one orbits of a design in closed form, so that its values hold for any
initial state. It takes the objective of the orbit that counts under each condition, applies the risk measure
over the conditions, and states the limits as constraints."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from tpd.core.progress import Count, unreported
from tpd.design.criteria import (
    NEAR,
    NONE,
    REST,
    ROCKING,
    UNSTABLE,
    DesignSpace,
    Evaluation,
    Geometry,
    Limit,
    Objective,
    Risk,
    Size,
    SteadyTilt,
    Worsening,
    bob_of,
)
from tpd.exact.orbits import orbit_slopes, solve_orbits
from tpd.exact.rows import row_of
from tpd.exact.terms import LAM, MU, SIZES, ZETA, E
from tpd.scene.conditions import Conditions, under, under_all
from tpd.scene.impacts import housner
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import with_design
from tpd.scene.scene import Scene
from tpd.theory import uplift

_PAIRS = 16_384
"""Pairs of design and condition that are solved at once, about."""
BACK_OFF = 1e-5
"""Share of every limit that a search leaves unused. A descent may end so far beyond its constraints, by
rounding or where a limit has no derivative, and the design still keeps the limit itself."""
KINDS = ("rocking", "near_fold", "rest", "unstable", "no_orbit")
"""Motions of a design under a condition, see `Evaluation.kind`."""
_KIND_OF = np.array([ROCKING, UNSTABLE, UNSTABLE, NEAR, NEAR, NONE])
"""Index into `KINDS` by the number of an orbit's status, see `tpd.exact.terms`; the best
of them is the smallest."""
_DESIGN = {"mass": MU, "length": LAM, "damping": ZETA}
"""Columns of the parameters of a design, by the names of their factors in conditions."""
_RESERVE = ("fold", "symmetry", "torus")
"""Sizes of an orbit that are positive where it attracts."""
OF_PAIRS = Evaluation._fields[: Evaluation._fields.index("design")]
"""Fields of an evaluation that belong to pairs of design and condition; they come first."""


class Linearisation(NamedTuple):
    """n functions and l constraints (<= 0) at m designs, and their slopes along d scaled coordinates."""

    value: np.ndarray
    """(m, n)"""
    slope: np.ndarray
    """(m, n, d)"""
    limit: np.ndarray
    """(m, l)"""
    limit_slope: np.ndarray
    """(m, l, d)"""

    def at(self, rows: np.ndarray | slice) -> Linearisation:
        """Linearisation at some of the designs."""
        return Linearisation(*(x[rows] for x in self))


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
    objective: Objective = field(default_factory=SteadyTilt)

    def evaluate(self, designs: np.ndarray, progress: Count = unreported) -> Evaluation:
        """Designs (mu, lam, zeta), shape (m, 3), under all conditions."""
        m, n = len(designs), len(self.conditions)
        # All at once would take memory for every orbit of every pair.
        size, parts = max(1, _PAIRS // n), []
        for i in range(0, m, size):
            parts.append(_evaluated(self.p, designs[i : i + size], self.conditions, self.rest_counts))
            progress(min(i + size, m) * n, m * n)
        joined = (np.concatenate(x) for x in zip(*(part[: len(OF_PAIRS)] for part in parts), strict=True))
        return self.with_merits(Evaluation(*joined, design=designs))

    def with_merits(self, e: Evaluation) -> Evaluation:
        """The evaluation with the values of the objective as merits where the block rocks.

        Raises:
            ValueError: values or slopes of the user's objective of another shape.
        """
        with np.errstate(all="ignore"):
            # Where the block does not rock, an orbit may be infinite or none.
            size = self.objective.values(e, self.geometry)
        value, slope = np.asarray(size.value), np.asarray(size.slope)
        if value.shape != e.tilt.shape or slope.shape != e.tilt_slope.shape:
            raise ValueError(
                f"`values` of the objective {self.objective.name} must have a value of shape {e.tilt.shape} "
                f"and a slope of shape {e.tilt_slope.shape}, but has {value.shape} and {slope.shape}"
            )
        rocks = e.kind <= NEAR
        slope = np.where(rocks[..., None], _finite(slope), e.merit_slope)
        return e._replace(merit=np.where(rocks, value, e.merit), merit_slope=slope)

    def over(self, conditions: Conditions) -> Orbits:
        """This objective under other conditions of the scene."""
        p, g = self.p, self.geometry
        nominal = float(g.wall[0] / g.slenderness[0]) * float(p.nu)
        geometry = geometry_under(float(p.nu), g.half_height, g.block_mass, nominal, conditions)
        geometry = replace(geometry, bob=g.bob, gravity=g.gravity)
        return replace(self, conditions=conditions, geometry=geometry).against_bare()

    def against_bare(self) -> Orbits:
        """This objective, with the tilts of the bare block known to limits that compare with them."""
        if not any(isinstance(limit, Worsening) for limit in self.limits):
            return self
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
    kind, turn = np.zeros((m, n), int), np.full((m, n, 4), np.nan)
    sizes = one, slope, one, slope, one, slope
    return Evaluation(*sizes, one, one, one, slope, kind, turn, np.ones((m, 3)))


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


def geometry_of(scene: Scene, conditions: Conditions, limits: tuple[Limit, ...] = ()) -> Geometry:
    """Geometry of a scene's block under all conditions, with the bob of the limits."""
    block = scene.block
    found = geometry_under(block.slenderness, block.half_height, block.mass, 0.5 * block.room, conditions)
    return replace(found, bob=bob_of(limits), gravity=float(scene.gravity))


_STEP = 1e-100
"""Imaginary part of a number in whose direction a derivative is taken."""


def _evaluated(p: Parameters, designs: np.ndarray, conditions: Conditions, rest_counts: bool) -> Evaluation:
    """Designs (m, 3) under all conditions."""
    m, n = len(designs), len(conditions)
    q = under_all(p, designs, conditions)
    x, along = row_of(q), _directions(p, q, conditions, m)
    orbits = solve_orbits(x)
    kinds = _KIND_OF[orbits["status"].astype(int)]
    # Orbits come sorted by amplitude, the largest first: of equal kinds the largest counts.
    best = np.argmin(kinds, axis=1)
    one = np.take_along_axis(orbits, best[:, None], axis=1)
    slope = orbit_slopes(x, one, along, (0, SIZES["torus"] + 1))[:, 0]
    o = one[:, 0]
    sizes, slopes = ({name: of[..., at] for name, at in SIZES.items()} for of in (o["sizes"], slope))
    lift, design, still = uplift(q), np.stack([q.mu, q.lam, q.zeta]), []
    for i in range(3):
        stepped = uplift(with_design(q, design + 1j * _STEP * along[:, i, [MU, LAM, ZETA]].T))
        still.append([np.imag(x) / _STEP for x in stepped])
    margin_slope, still_slope = np.moveaxis(np.array(still), 0, -1)
    margin = np.asarray(lift.margin)
    kind = kinds[np.arange(m * n), best]
    kind = np.where((margin > 0.0) & ((kind > REST) | rest_counts), REST, kind)
    at_rest, moves = kind == REST, (kind != REST) & (kind != NONE)

    def chosen(slope: np.ndarray, other: np.ndarray | float) -> np.ndarray:
        return _finite(np.where(moves[:, None], slope, other))

    least = np.argmin([sizes[name] for name in _RESERVE], axis=0)[None]
    reserve, reserve_slope = (
        np.take_along_axis(np.array([of[name] for name in _RESERVE]), i, axis=0)[0]
        for of, i in ((sizes, least), (slopes, least[..., None]))
    )
    nu = np.asarray(q.nu)
    tilt = np.where(moves, sizes["amplitude"] / nu, np.where(at_rest, 0.0, np.inf))
    tilt_slope = chosen(slopes["amplitude"] / nu[:, None], 0.0)
    multiplier = np.max(np.abs(o["multipliers"]), axis=-1)
    turn = np.stack([sizes["amplitude"], o["bob"], sizes["phase"], o["bob_rate"]], axis=-1)
    # What does not attract is above any orbit that does, whose merit is below one: a search must leave such
    # designs, and the uplift margin says which way leads to rest.
    nothing = np.where(kind == UNSTABLE, 1.0 + tilt, 2.0 - margin)
    out = Evaluation(
        merit=np.where(kind == REST, -margin, nothing),
        merit_slope=np.where(moves[:, None], tilt_slope, -_finite(margin_slope)),
        tilt=tilt,
        tilt_slope=tilt_slope,
        stroke=np.where(moves, sizes["stroke"], lift.stroke),
        stroke_slope=chosen(slopes["stroke"], still_slope),
        margin=margin,
        multiplier=np.where(moves, multiplier, np.where(at_rest, 0.0, np.inf)),
        reserve=np.where(moves, reserve, np.where(at_rest, 1.0, 0.0)),
        reserve_slope=chosen(reserve_slope, 0.0),
        kind=kind,
        turn=turn,
        design=designs,
    )
    shaped = {name: getattr(out, name).reshape(m, n, *getattr(out, name).shape[1:]) for name in OF_PAIRS}
    return out._replace(**shaped)


def _directions(p: Parameters, q: Parameters, conditions: Conditions, m: int) -> np.ndarray:
    """Derivatives of the parameters `q` of m designs under all conditions, as rows of compiled code, with
    respect to (mu, lam, zeta) of the designs, (m n, 3, 9)."""
    along = np.zeros((m * len(conditions), 3, 9))
    for i, (name, column) in enumerate(_DESIGN.items()):
        along[:, i, column] = np.tile(conditions.column(name), m)
    if p.e is None:
        # Housner's e follows the bob's mass.
        moved = housner(np.asarray(q.nu), np.asarray(q.rho), np.asarray(q.mu) + 1j * _STEP)
        along[:, 0, E] = moved.imag / _STEP * along[:, 0, MU]
    return along


def _finite(x: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(x), x, 0.0)


def margins(objective: Orbits, designs: np.ndarray) -> np.ndarray:
    """Uplift margins of designs (m, 3) under all conditions, (m, n), in closed form."""
    rows = objective.conditions.factor_rows()
    # One condition after the other: all at once would take n times the memory.
    return np.stack([np.asarray(uplift(under(objective.p, designs.T, row)).margin) for row in rows], axis=1)
