"""Designs and their orbits, side by side: every evaluation is half a forcing period of each orbit.

An orbit need not be settled again for every design that a descent evaluates. Each descent keeps, beside its
design, the orbit under every condition. An evaluation integrates half a period of the smoothed equations by
diffrax, with tangents, from the orbit of the design before, see `tpd.models.half_period`: one Newton step of
the orbit, and the gradient. The exact solution gives the first orbits, and it takes over where there is none
to follow: where the block rests, and where an orbit was lost.
"""

from __future__ import annotations

import numpy as np

from tpd.core.batch import in_chunks, prepare
from tpd.design.criteria import ROCKING, Evaluation
from tpd.design.orbits import OF_PAIRS, Linearisation, Orbits, blank, margins
from tpd.models.half_period import half_period, newton
from tpd.models.smoothed import Smoothed

SMOOTHED = Smoothed(rtol=1e-7)
"""Model of a descent by default: the error control ignores derivatives, so it is tighter than for motions."""
_CHUNK = 32
"""Orbits that take a step at once, on each core: all of them wait for the slowest."""
_STEPS = 3
"""Most steps of an orbit at one design: the first is enough where the design has moved little."""
_NEAR, _ASTRAY = 0.01, 0.5
"""Residual, in units of nu, below which a step is the last, and beyond which the orbit is lost."""
_SAME = 0.01
"""Relative difference of tilts beyond which two orbits are not the same."""


class SmoothedOrbits:
    """Designs of m descents and their orbits under all conditions, from an exact evaluation of the starts."""

    def __init__(self, orbits: Orbits, model: Smoothed, e: Evaluation) -> None:
        self.orbits, self.model, self.designs = orbits, model, e.design
        self.turns, self.slopes = np.zeros((*e.kind.shape, 4)), np.zeros((*e.kind.shape, 4, 3))
        self.follows = np.zeros(e.kind.shape, bool)
        self.lost = np.zeros(len(e.design), int)
        """Orbits that each descent has lost so far."""
        self._take(e, np.arange(len(e.design)), e.kind == ROCKING)
        # A step at the same design: its derivatives predict the orbit of the next one.
        self._step(e.design)

    def at(self, unit: np.ndarray) -> Linearisation:
        """Linearisation at designs in shares of the bounds, (m, d), the next of each descent."""
        return self.orbits.linearised(self.evaluate(self.orbits.space.unscaled(unit)))

    def evaluate(self, designs: np.ndarray) -> Evaluation:
        """Next designs (m, 3) of the descents, by a step of their orbits."""
        e = self._step(designs)
        # Where no orbit is followed the exact solution takes over, and says whether there is one by now.
        rows = np.flatnonzero(~self.follows.all(axis=1))
        if len(rows):
            exact, mine = self.orbits.evaluate(designs[rows]), e.at(rows)
            # Another orbit may count by now: it attracts and is larger, or the one that is followed does not.
            other = (exact.kind != mine.kind) | (np.abs(exact.tilt - mine.tilt) > _SAME * exact.tilt)
            other |= ~self.follows[rows]
            for name in OF_PAIRS:
                where = other.reshape(*other.shape, *(1,) * (getattr(mine, name).ndim - 2))
                getattr(e, name)[rows] = np.where(where, getattr(exact, name), getattr(mine, name))
            self.follows[rows] &= ~other
            self._take(exact, rows, other & (exact.kind == ROCKING))
        return e

    def _step(self, designs: np.ndarray) -> Evaluation:
        """Half a period of every orbit that is followed; all others, and lost orbits, are left blank."""
        o, m = self.orbits, len(designs)
        own = {name: np.array(getattr(blank(m, len(o.conditions)), name)) for name in OF_PAIRS}
        e = Evaluation(**own | {"margin": margins(o, designs)}, design=designs)
        # The derivatives of the last step predict the orbit of the next design, to first order.
        self.turns = self.turns + np.einsum("mnud,md->mnu", self.slopes, designs - self.designs)
        self.designs, todo, before = designs, self.follows.copy(), self.follows.copy()
        for _ in range(_STEPS):
            rows = np.nonzero(todo)
            if not len(rows[0]):
                break
            batch = o.p, designs[rows[0]], o.conditions.factor_rows()[rows[1]], self.turns[rows]
            step = newton(batch[3], in_chunks(half_period(self.model), batch, chunk=_CHUNK))
            nu = o.geometry.slenderness[rows[1]]
            self.turns[rows], self.slopes[rows] = step.turn, step.slope
            e.tilt[rows], e.tilt_slope[rows] = step.turn[:, 0] / nu, step.slope[:, 0] / nu[:, None]
            e.stroke[rows], e.stroke_slope[rows] = step.stroke, step.stroke_slope
            e.multiplier[rows], e.reserve[rows] = step.multiplier, step.reserve
            # One step is enough where the design has moved little: its error is the square of the residual.
            lost = ~step.solved | (step.residual > _ASTRAY) | (step.turn[:, 0] <= 0.0)
            self.follows[rows] = ~lost
            todo[rows] = ~lost & (step.residual > _NEAR)
        # The exact solution decides where a step has not come near an orbit, or near one that repels by now.
        rests = (e.margin > 0.0) & o.rest_counts
        self.follows &= ~todo & ~rests & (e.multiplier < 1.0)
        self.lost += (before & ~self.follows & ~rests).sum(axis=1)
        self.turns[~self.follows], self.slopes[~self.follows] = 0.0, 0.0
        return o.with_merits(e)

    def _take(self, e: Evaluation, descents: np.ndarray, new: np.ndarray) -> None:
        """Follow the exact orbits of an evaluation of some descents from now on, where `new`."""
        rows = np.nonzero(new)
        self.turns[descents[rows[0]], rows[1]] = e.turn[rows]
        self.slopes[descents[rows[0]], rows[1]] = 0.0
        self.follows[descents[rows[0]], rows[1]] = True


def prepare_step(orbits: Orbits, model: Smoothed) -> None:
    """Begin to compile the step in a thread; the first evaluation waits for it."""
    batch = orbits.p, np.zeros((1, 3)), orbits.conditions.factor_rows()[:1], np.zeros((1, 4))
    prepare(half_period(model), batch, chunk=_CHUNK)
