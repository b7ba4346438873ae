"""Designs and their orbits, side by side: every evaluation is half a forcing period of each orbit.

An orbit need not be settled again for every design that a search tries. Each search keeps, beside its design,
the orbit under every condition. An evaluation integrates half a period of the smoothed equations by diffrax,
with tangents, from the orbit of the design before, see `tpd.models.half_period`: one Newton step of the
orbit, and the gradient. The exact solution gives the first orbits, and answers where there is none to follow:
where the block rests, and where an orbit was lost. It also validates the end of every search.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from tpd.core.batch import in_chunks, prepare
from tpd.core.conditions import under
from tpd.core.parameters import Parameters, as_arrays
from tpd.design.objective import ROCKING, UNSTABLE, Evaluation, Orbits
from tpd.design.sequential import Ends, minimise
from tpd.design.subproblem import Linearisation
from tpd.exact.modes import Plant
from tpd.exact.orbit_equation import Half
from tpd.exact.orbit_roots import Root
from tpd.exact.symmetric_orbit import orbit_of, state_at
from tpd.models.half_period import half_period
from tpd.models.smoothed import Smoothed

_CHUNK = 32
"""Orbits that take a step at once, on each core: all of them wait for the slowest."""
_OF_PAIRS = Evaluation._fields[: Evaluation._fields.index("design")]
"""Fields of an evaluation that belong to pairs of design and condition; they come first."""
_ASTRAY = 0.3
"""Residual, in units of nu, beyond which one Newton step says nothing: the orbit is lost."""


class OneShot:
    """Designs in m searches, under all conditions of an objective, with the orbit of each."""

    def __init__(self, objective: Orbits, model: Smoothed) -> None:
        self.objective, self.model = objective, model
        self.turns = np.zeros((0, len(objective.conditions), 4))
        self.slopes = np.zeros((*self.turns.shape, 3))
        self.designs = np.zeros((0, 3))
        self.follows = np.zeros((0, len(objective.conditions)), bool)
        self.lost = np.zeros(0, int)
        """Orbits that each search lost on the way."""

    def at(self, unit: np.ndarray) -> Linearisation:
        """Linearisation at designs in shares of the bounds, (m, d), the next of each search."""
        return self.objective.linearised(self.evaluate(self.objective.space.unscaled(unit)))

    def begin(self, designs: np.ndarray) -> Evaluation:
        """Take the exact orbits of designs (m, 3), and return the exact evaluation."""
        e = self.objective.evaluate(designs)
        self.turns, self.slopes = np.zeros((*e.kind.shape, 4)), np.zeros((*e.kind.shape, 4, 3))
        self.designs, self.follows = designs, e.kind == ROCKING
        self.lost = np.zeros(len(designs), int)
        self._take(e, np.arange(len(designs)), self.follows)
        return e

    def evaluate(self, designs: np.ndarray) -> Evaluation:
        """Next designs (m, 3) of the searches, by one step of their orbits."""
        e = self._step(designs)
        # Where no orbit is followed the exact solution says whether there is one by now.
        asked = np.flatnonzero(~self.follows.all(axis=1))
        if len(asked):
            exact, alone = self.objective.evaluate(designs[asked]), ~self.follows[asked]
            for name in _OF_PAIRS:
                mine, other = getattr(e, name), getattr(exact, name)
                rows = alone.reshape(*alone.shape, *(1,) * (mine.ndim - 2))
                mine[asked] = np.where(rows, other, mine[asked])
            self._take(exact, asked, alone & (exact.kind == ROCKING))
        return e

    def _step(self, designs: np.ndarray) -> Evaluation:
        """Half a period of every orbit that is followed; what is not is left blank."""
        o, m = self.objective, len(designs)
        rows = np.nonzero(self.follows)
        e = Evaluation(*map(np.array, o.blank(m)))._replace(design=designs)
        if not len(rows[0]):
            return e
        factors = o.conditions.factor_rows()
        # The derivatives of the last step say where the orbit of the next design is, to first order.
        moved = (designs - self.designs)[rows[0]]
        turns = self.turns[rows] + np.einsum("iud,id->iu", self.slopes[rows], moved)
        batch = o.p, designs[rows[0]], factors[rows[1]], turns
        step = in_chunks(half_period(self.model), batch, chunk=_CHUNK)
        keeps = step.solved & (step.residual < _ASTRAY) & (step.turn[:, 0] > 0.0)
        np.add.at(self.lost, rows[0], ~keeps)
        self.turns[rows], self.slopes[rows], self.designs = step.turn, step.slope, designs
        self.follows[rows] = keeps
        nu = o.geometry.slenderness[rows[1]]
        tilt, slope = step.turn[:, 0] / nu, step.slope[:, 0] / nu[:, None]
        attracts = step.multiplier < 1.0
        e.kind[rows] = np.where(attracts, ROCKING, UNSTABLE)
        e.merit[rows] = np.where(attracts, tilt, 1.0 + tilt)
        e.merit_slope[rows], e.tilt[rows], e.tilt_slope[rows] = slope, tilt, slope
        e.stroke[rows], e.stroke_slope[rows] = step.stroke, step.stroke_slope
        e.multiplier[rows], e.reserve[rows] = step.multiplier, step.reserve
        return e

    def _take(self, e: Evaluation, lanes: np.ndarray, new: np.ndarray) -> None:
        """Follow the exact orbits of an evaluation of some searches from now on, where `new`."""
        rows = np.nonzero(new)
        if not len(rows[0]):
            return
        o = self.objective
        batch = o.p, e.design[rows[0]], o.conditions.factor_rows()[rows[1]], e.root[rows]
        self.turns[lanes[rows[0]], rows[1]] = in_chunks(_turn, batch, chunk=_CHUNK)
        # The first step is at the same design: it needs no derivatives.
        self.slopes[lanes[rows[0]], rows[1]] = 0.0
        self.follows[lanes[rows[0]], rows[1]] = True

    def validated(self, found: Ends) -> Ends:
        """The ends of the searches by the exact solution, and the differences of the orbits followed."""
        o = self.objective
        designs, cap = o.space.unscaled(found.x), o.risk.cap(len(o.conditions))
        exact = o.evaluate(designs)
        # Two steps at the same design: the derivatives of the second are those of a converged orbit.
        self.evaluate(designs)
        own = self.evaluate(designs)
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.abs(own.tilt - exact.tilt) / exact.tilt
            steep = np.abs(exact.tilt_slope).max(axis=(1, 2))
            turned = np.abs(own.tilt_slope - exact.tilt_slope).max(axis=(1, 2)) / steep
        # Where none is followed both are the exact answer. An orbit of another kind is another orbit.
        apart = np.where(own.kind == exact.kind, np.nan_to_num(apart), np.inf).max(axis=1)
        ends = minimise(o.at, found.x, cap, o.risk.of, known=o.linearised(exact), steps=0)
        return found._replace(
            local=ends.local,
            merit=ends.merit,
            stationarity=ends.stationarity,
            weights=ends.weights,
            mismatch=np.stack([apart, np.nan_to_num(turned)], axis=1),
            lost=self.lost.copy(),
        )

    def prepare(self) -> None:
        """Begin to compile the step; `evaluate` waits for it."""
        o = self.objective
        batch = o.p, np.zeros((1, 3)), o.conditions.factor_rows()[:1], np.zeros((1, 4))
        prepare(half_period(self.model), batch, chunk=_CHUNK, wait=False)


def _turn(args: tuple[Parameters, Array, Array, Array]) -> Array:
    """phi, psi, phase of the forcing and psi' at the upper turn of an exact orbit, see `HalfPeriod.turn`."""
    p, design, factors, (crossing, phase) = args
    half = Half(Plant(as_arrays(under(p, design, factors))))
    y = state_at(half, orbit_of(half, Root(crossing, phase)), jnp.zeros_like(phase))
    return jnp.stack([y[0], y[1], phase, y[3]])
