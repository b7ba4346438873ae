"""Designs and their orbits, side by side: every evaluation is half a forcing period of each orbit.

An orbit need not be settled again for every design that a search tries. Each search keeps, beside its design,
the orbit under every condition. An evaluation integrates half a period of the smoothed equations by diffrax,
with tangents, from the orbit of the design before, see `tpd.models.half_period`: one Newton step of the
orbit, and the gradient. The exact solution gives the first orbits, and answers where there is none to follow:
where the block rests, and where an orbit was lost. It also validates the end of every search.
"""

from __future__ import annotations

import numpy as np

from tpd.core.batch import in_chunks, prepare
from tpd.design.ends import Book, Ends, Linearisation
from tpd.design.objective import OF_PAIRS, ROCKING, Evaluation, Orbits, blank, margins
from tpd.models.half_period import half_period, newton
from tpd.models.smoothed import Smoothed

_CHUNK = 32
"""Orbits that take a step at once, on each core: all of them wait for the slowest."""
_STEPS = 3
"""Most steps of an orbit at one design: the first serves where the design has moved little."""
_NEAR, _ASTRAY = 0.01, 0.5
"""Residual, in units of nu, below which a step is the last, and beyond which the orbit is lost."""
_SAME = 0.01
"""Relative difference of tilts beyond which two orbits are not the same."""


class OneShot:
    """Designs in m searches, under all conditions of an objective, with the orbit of each."""

    def __init__(self, objective: Orbits, model: Smoothed) -> None:
        self.objective, self.model = objective, model

    def at(self, unit: np.ndarray) -> Linearisation:
        """Linearisation at designs in shares of the bounds, (m, d), the next of each search."""
        return self.objective.linearised(self.evaluate(self.objective.space.unscaled(unit)))

    def begin(self, designs: np.ndarray) -> Evaluation:
        """Take the exact orbits of designs (m, 3), and return the exact evaluation."""
        e = self.objective.evaluate(designs)
        self.turns, self.slopes = np.zeros((*e.kind.shape, 4)), np.zeros((*e.kind.shape, 4, 3))
        self.designs, self.follows = designs, np.zeros(e.kind.shape, bool)
        # Orbits that each search loses on the way.
        self.lost = np.zeros(len(designs), int)
        self._take(e, np.arange(len(designs)), e.kind == ROCKING)
        # A step at the same design: its derivatives say where the orbit of the next one is.
        self._step(designs)
        return e

    def evaluate(self, designs: np.ndarray) -> Evaluation:
        """Next designs (m, 3) of the searches, by a step of their orbits."""
        e = self._step(designs)
        # Where no orbit is followed the exact solution answers, and says whether there is one by now.
        asked = np.flatnonzero(~self.follows.all(axis=1))
        if len(asked):
            exact, mine = self.objective.evaluate(designs[asked]), e.at(asked)
            # Another orbit may count by now: it attracts and is larger, or the one that is followed does not.
            other = (exact.kind != mine.kind) | (np.abs(exact.tilt - mine.tilt) > _SAME * exact.tilt)
            other |= ~self.follows[asked]
            for name in OF_PAIRS:
                rows = other.reshape(*other.shape, *(1,) * (getattr(mine, name).ndim - 2))
                getattr(e, name)[asked] = np.where(rows, getattr(exact, name), getattr(mine, name))
            self.follows[asked] &= ~other
            self._take(exact, asked, other & (exact.kind == ROCKING))
        return e

    def _step(self, designs: np.ndarray) -> Evaluation:
        """Half a period of every orbit that is followed; what is not, or is lost, is left blank."""
        o, m = self.objective, len(designs)
        own = {name: np.array(getattr(blank(m, len(o.conditions)), name)) for name in OF_PAIRS}
        e = Evaluation(**own | {"margin": margins(o, designs)}, design=designs)
        # The derivatives of the last step say where the orbit of the next design is, to first order.
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
            e.merit[rows], e.merit_slope[rows] = e.tilt[rows], e.tilt_slope[rows]
            e.stroke[rows], e.stroke_slope[rows] = step.stroke, step.stroke_slope
            e.multiplier[rows], e.reserve[rows] = step.multiplier, step.reserve
            # One step is enough where the design has moved little: its error is the square of the residual.
            lost = ~step.solved | (step.residual > _ASTRAY) | (step.turn[:, 0] <= 0.0)
            self.follows[rows] = ~lost
            todo[rows] = ~lost & (step.residual > _NEAR)
        # What has not come near an orbit, or repels by now, is the exact solution's to answer.
        rests = (e.margin > 0.0) & o.rest_counts
        self.follows &= ~todo & ~rests & (e.multiplier < 1.0)
        self.lost += (before & ~self.follows & ~rests).sum(axis=1)
        self.turns[~self.follows], self.slopes[~self.follows] = 0.0, 0.0
        return e

    def _take(self, e: Evaluation, lanes: np.ndarray, new: np.ndarray) -> None:
        """Follow the exact orbits of an evaluation of some searches from now on, where `new`."""
        rows = np.nonzero(new)
        if not len(rows[0]):
            return
        self.turns[lanes[rows[0]], rows[1]] = e.turn[rows]
        self.slopes[lanes[rows[0]], rows[1]] = 0.0
        self.follows[lanes[rows[0]], rows[1]] = True

    def validated(self, found: Ends) -> Ends:
        """The ends of the searches by the exact solution, and the differences of the orbits followed."""
        o = self.objective
        designs, cap, lost = o.space.unscaled(found.x), o.risk.cap(len(o.conditions)), self.lost.copy()
        exact = o.evaluate(designs)
        # Two steps at the exact orbits: the derivatives of the second are those of the smoothed orbits there.
        self.designs, self.follows = designs, np.zeros_like(self.follows)
        self._take(exact, np.arange(len(designs)), exact.kind == ROCKING)
        self._step(designs)
        own = self._step(designs)
        # What the descent took for the merit: of another orbit, or of one that is lost, it is another.
        apart = np.abs(found.local.value - exact.merit) / np.maximum(np.abs(exact.merit), 1e-12)
        steep = np.maximum(np.abs(exact.tilt_slope).max(axis=(1, 2)), 1e-12)[:, None, None]
        turned = (np.abs(own.tilt_slope - exact.tilt_slope) / steep).max(axis=2)
        turned = np.where(self.follows, turned, 0.0)
        ends = Book(o.at, o.risk.of, found.x, o.linearised(exact)).ends(cap)
        known = {name: getattr(ends, name) for name in ("local", "merit", "stationarity", "weights", "open")}
        mismatch = np.stack([apart.max(axis=1), turned.max(axis=1)], axis=1)
        return found._replace(**known, mismatch=mismatch, lost=lost)

    def prepare(self) -> None:
        """Begin to compile the step; `evaluate` waits for it."""
        o = self.objective
        batch = o.p, np.zeros((1, 3)), o.conditions.factor_rows()[:1], np.zeros((1, 4))
        prepare(half_period(self.model), batch, chunk=_CHUNK)
