"""Objective of a search on ground motions: designs followed through every motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.transient import FREE, MAX_EVENTS
from tpd.core import checks
from tpd.core.progress import Count
from tpd.design.criteria import KINDS, STILL, Geometry, Limit, Size, bob_of, check_limits
from tpd.design.orbits import blank, geometry_under
from tpd.records.intensity import intensity_of
from tpd.scene.conditions import Conditions, under_all
from tpd.scene.parameters import Parameters
from tpd.scene.scene import STANDARD_GRAVITY, Block, Scene

_EVENTS = 20_000
"""Events of a motion beyond one for each piece: a bob that swings for long meets no more."""


class Runs(NamedTuple):
    """Motions of m designs under n conditions: arrays (m, n). All sizes of an undecided run are NaN."""

    tilt: np.ndarray
    """Largest |phi| over the slenderness; infinite where the block overturns."""
    swing: np.ndarray
    """Largest |psi|, rad; infinite where the block overturns."""
    relative: np.ndarray
    """Largest |psi - phi|, rad; infinite where the block overturns."""
    overturned: np.ndarray
    undecided: np.ndarray
    """Whether the bound on events or a failure of numbers ended the motion: it is neither a fall nor rest."""

    @property
    def severity(self) -> np.ndarray:
        """Largest tilt over the slenderness, at most 1, and 1 where the block overturns, (m, n); NaN where
        nothing is known of a run. A search makes its risk small."""
        # Without a cap the few runs that come close to the edge would outweigh all others.
        return np.minimum(self.tilt, 1.0)

    def at(self, rows: slice) -> Runs:
        """Runs of some of the designs."""
        return Runs(*(x[rows] for x in self))

    def ended(self, bare: bool, hung: bool) -> Runs:
        """Runs of a bare block, in the first row, and of a hung one, with an end for each that has none: an
        overturning where the argument of its row is true, else rest."""
        falls = self.undecided & np.array([[bare], [hung]])
        size = np.where(falls, np.inf, 0.0)
        tilt, swing, relative = (
            np.where(self.undecided, size, x) for x in (self.tilt, self.swing, self.relative)
        )
        none, fell = np.zeros_like(self.undecided), self.overturned | falls
        return self._replace(tilt=tilt, swing=swing, relative=relative, overturned=fell, undecided=none)


@dataclass(frozen=True)
class GroundObjective:
    """Designs of a block's pendulum under ground motions."""

    block: Block
    conditions: Conditions
    limits: tuple[Limit, ...]
    allowed: float
    """Share of the runs in which the block stands that may break a limit."""
    gravity: float = STANDARD_GRAVITY
    free: float = FREE
    """Free motion after each ground motion, s."""

    @cached_property
    def p(self) -> Parameters:
        """Parameters of the bare block under its first motion."""
        return Scene(self.block, self.conditions.motions[0], self.gravity).ground_parameters()

    @cached_property
    def pieces(self) -> list[np.ndarray]:
        """The pieces of every motion."""
        return [np.asarray(m.pieces(), dtype=float) for m in self.conditions.motions]

    @cached_property
    def factors(self) -> np.ndarray:
        """Factor on its motion of every condition, shape (n,)."""
        measure = intensity_of(self.conditions.intensity, self.block, self.gravity, None)
        # A scale counts an intensity, which is proportional to the motion.
        one = np.array([measure.value(m) for m in self.conditions.motions])
        return self.conditions.column("amplitude") / one[self._which]

    @cached_property
    def geometry(self) -> Geometry:
        """Lengths of the block under every condition, for the limits."""
        b = self.block
        found = geometry_under(
            float(b.slenderness), float(b.half_height), float(b.mass), 0.5 * float(b.room), self.conditions
        )
        return replace(found, bob=bob_of(self.limits), gravity=self.gravity)

    @property
    def _which(self) -> np.ndarray:
        return np.asarray(self.conditions.which)

    @property
    def rate(self) -> float:
        """omega0 of the block, rad/s."""
        return float(Scene(self.block, self.conditions.motions[0], self.gravity).rate)

    def over(self, conditions: Conditions) -> GroundObjective:
        """This objective under other conditions."""
        return replace(self, conditions=conditions)

    def evaluate(self, designs: np.ndarray, progress: Count | None = None) -> Runs:
        """Follow designs (mu, lam, zeta), shape (m, 3), under all n conditions by the linear equations; a
        design with mu = 0 is the bare block."""
        from tpd.models.compiled_shaken import follow_all

        return self._followed(follow_all, designs, min(_EVENTS, MAX_EVENTS), progress)

    def check(self, designs: np.ndarray, progress: Count | None = None) -> Runs:
        """As `evaluate` by the nonlinear equations."""
        from tpd.models.compiled_nonlinear import shake_nonlinear

        return self._followed(shake_nonlinear, designs, MAX_EVENTS, progress)

    def sizes(self, runs: Runs, designs: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of the limited quantities, and these over their limits, shape (m, sizes): each is exceeded in
        the allowed share of the runs in which the block stands."""
        found = list(self._sizes(runs, designs))
        # What the allowed share of the runs exceed; 0 where the block stands in no run.
        stand = [[row[np.isfinite(row)] for row in size.value] for size in found]
        how: Any = {"q": 1.0 - self.allowed, "method": "higher"}
        columns = [[np.quantile(x, **how) if x.size else 0.0 for x in rows] for rows in stand]
        shape = len(found), len(designs)
        return tuple(size.name for size in found), np.array(columns, dtype=float).reshape(shape).T

    def broken(self, runs: Runs, designs: np.ndarray) -> float:
        """Share of the runs of one design, in which the block is known to stand, whose motion breaks a
        limit."""
        stands = ~(runs.overturned | runs.undecided)[0]
        broken = np.zeros(len(stands), dtype=bool)
        for size in self._sizes(runs, designs):
            if size.name not in STILL:
                broken |= size.value[0] > 1.0
        return float(np.mean(broken[stands])) if stands.any() else 0.0

    def _sizes(self, runs: Runs, designs: np.ndarray) -> Iterator[Size]:
        """Limited quantities over their limits, (m, n); infinite where the block overturns, NaN where nothing
        is known."""
        m, n = runs.tilt.shape
        e = blank(m, n)._replace(tilt=runs.tilt, stroke=runs.swing, relative=runs.relative, design=designs)
        for size in (size for limit in self.limits for size in limit.sizes(e, self.geometry)):
            # Sizes of runs that overturn must not enter a quantile of those that stand.
            fell = runs.overturned & (size.name not in STILL)
            yield size._replace(value=np.where(fell, np.inf, size.value))

    def rows(self, designs: np.ndarray) -> np.ndarray:
        """Parameters (m n, 9) of the compiled code."""
        m, motions, which = len(designs), self.conditions.motions, self._which
        # The factor on the amplitude is in units of the intensity, and is applied motion by motion.
        factors = {**self.conditions.factors, "amplitude": np.ones(len(which))}
        # Ties of rho and e to other quantities are those of every set of conditions.
        q = under_all(self.p, designs, replace(self.conditions, factors=factors))
        f = np.array([float(x.pga) for x in motions]) / float(motions[0].pga)
        h = np.array([float(x.piece) for x in motions]) * self.rate
        size = np.tile(f[which] * self.factors, m)
        # A quicker shaking passes its pieces sooner.
        quick = np.tile(self.conditions.column("frequency"), m)
        leaves: Any = (q.nu, q.mu, q.lam, q.zeta, q.k, q.f * size, np.tile(h[which], m) / quick, q.rho, q.e)
        return np.array(np.broadcast_arrays(*leaves), dtype=float).T.copy()

    def _followed(self, follow: Any, designs: np.ndarray, most: int, progress: Count | None) -> Runs:
        """Designs by one set of equations, each motion up to `most` events."""
        from tpd.exact.terms import EVENT_BOUND, FAILED, OVERTURNED

        m, n = shape = len(designs), len(self.conditions)
        free = np.full(m * n, self.free * self.rate)
        which, options = np.tile(self._which, m), {"max_events": most, "progress": progress}
        found, _ = follow(self.rows(designs), self.pieces, which, free, **options)
        status, nu = found.status.reshape(shape).astype(int), self.geometry.slenderness[None, :]
        undecided, fell = (status == EVENT_BOUND) | (status == FAILED), status == OVERTURNED
        # What is not known must look neither like standing nor like a fall.
        tilt, swing, relative = (
            np.where(undecided, np.nan, np.where(fell, np.inf, x.reshape(shape)))
            for x in (found.tilt, found.swing, found.relative)
        )
        return Runs(tilt / nu, swing, relative, fell, undecided)


def check_ground_limits(limits: tuple[Limit, ...]) -> tuple[Limit, ...]:
    """The limits in the order of a report.

    Raises:
        ValueError: a limit of settled motions, or none at all.
    """
    listed = check_limits(limits)
    for limit in listed:
        if not limit.of_motion:
            names = ", ".join(kind.__name__ for kind in KINDS if kind.of_motion)
            raise ValueError(f"`limits` of ground motions must be of {names}, but has {checks.shown(limit)}")
    return listed
