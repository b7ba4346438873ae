"""Refinement: which designs are the best by runs of the nonlinear equations from many starts.

From rest many designs are alike; what tells them apart is how they serve from other starts. A few hundred
runs of one design leave its mean tilt unknown by several points, so that the best of many by such a mean is
the luckiest. Here every design has runs of its own, and a surface through all of them averages the luck out:
it says which designs to try next, and which is the best. Runs that all designs share would leave their own
luck in every mean, and no surface could average it out. How far the bob swings differs little from run to
run: a surface through a quantile of it, and the tail that all designs near the wall share, say which designs
strike a wall in too many runs, long before a design has runs enough to count its strikes. The runs by which
the verification has refused a design are added, though designs share them: they are few beside the trials.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tpd.core.progress import Count, unreported
from tpd.design.criteria import DesignSpace
from tpd.design.search import first_apart
from tpd.design.surface import Observations, Surface, candidates, fit, likely, promise
from tpd.design.survey import ON_THE_WAY, Survey

RUNS = 256
"""Runs of each design."""
_TRIED, _SPARE = 16, (0.0, 0.04, 0.08)
"""Designs of a survey that are tried first, as many for each of some shares of the room that they spare: runs
that begin elsewhere swing further than those from rest."""
_ROUNDS, _BATCH, _ASKED, _WEIGHED = 5, 8, 24, 600
"""Rounds of further designs, how many each has, how many are followed from rest to choose them, and how many
are asked for the limits that need no run before."""
_APART, _WIDER, _NARROW = 0.03, 0.2, 0.02
"""Least distance of designs of a round, in shares of the part of the space that is searched: that of the
designs that help, wider by a share on each side, at least by a share of the bounds."""
_BULK, _ENOUGH = 0.9, 20
"""Share of the runs below the quantile whose surface is fitted, and runs that must stand for one."""
_SHARED = 16
"""Designs that share a tail: those of which this quantile is nearest to the wall."""
_SAFE = 0.6
"""Share of the allowed strikes that a design may have: it leaves room for luck in the runs that judge."""
_FIRST, _LATER = 150, 40
"""Steps of the fit of a surface in the first round, and later."""
_SURE = 0.5
"""Least probability of keeping to the limits of a design that counts as keeping to them."""
_LEAST, _ALL = 1e-3, slice(None)


class Tried(NamedTuple):
    """Runs of one design from many starts."""

    severity: float
    """Mean of the settled tilts over nu, 1 where the block overturns."""
    rests: float
    """Share of the runs that end at rest."""
    reach: np.ndarray
    """How far the bob comes in each run that stands, over the distance of the wall; empty without walls."""


class Refinement:
    """Designs tried so far, and the surfaces through them."""

    def __init__(
        self,
        space: DesignSpace,
        around: np.ndarray,
        still: Callable[[np.ndarray], np.ndarray],
        *,
        strikes: float,
        rests: float,
        seed: int,
    ) -> None:
        self.space, self.level, self.rests, self.seed = space, 1.0 - _SAFE * strikes, rests, seed
        self.still = still
        # Where designs help is a small part of the space; the surfaces are for this part.
        units = space.scaled(around)
        low, high = units.min(axis=0), units.max(axis=0)
        wider = np.maximum(_WIDER * (high - low), _NARROW)
        self.low = np.maximum(low - wider, 0.0)
        self.width = np.minimum(high + wider, 1.0) - self.low
        self.at, self.excess, self.tried = np.zeros((0, len(low))), np.zeros(0), list[Tried]()
        self.surface: Surface | None = None
        self.limits, self.sure = dict[str, Surface](), _SURE

    def scaled(self, designs: np.ndarray) -> np.ndarray:
        """Places of designs (m, 3) in the part of the space that is searched, (m, d)."""
        return (self.space.scaled(designs) - self.low) / self.width

    def unscaled(self, x: np.ndarray) -> np.ndarray:
        """Designs (m, 3) of places (m, d)."""
        return self.space.unscaled(np.clip(self.low + x * self.width, 0.0, 1.0))

    def add(self, some: Survey, tried: list[Tried]) -> None:
        """Add designs that were followed from rest and their runs, and fit the surfaces again."""
        known = np.array([np.isfinite(t.severity) for t in tried])
        worst = np.max([np.full(len(tried), -1.0), *some.excess.values()], axis=0)
        self.at = np.concatenate([self.at, self.scaled(some.designs)[known]])
        self.excess = np.concatenate([self.excess, np.minimum(worst, 1.0)[known]])
        self.tried += [t for t, good in zip(tried, known, strict=True) if good]
        if not self.tried:
            return

        def fitted(values: np.ndarray, before: Surface | None, rows: np.ndarray | slice = _ALL) -> Surface:
            # The numbers of a surface change little from one round to the next.
            steps = _FIRST if before is None else _LATER
            return fit(Observations(self.at[rows], values[rows]), self.seed, before, steps)

        self.surface = fitted(np.array([t.severity for t in self.tried]), self.surface)
        # Of a design with which hardly a run stands little is known of the bob, and the tilt says enough.
        stands = np.flatnonzero([len(t.reach) >= _ENOUGH for t in self.tried])
        if len(stands):
            self.limits["walls"] = fitted(self._beyond(stands), self.limits.get("walls"), stands)
        if self.rests > 0.0:
            fewer = self.rests - np.array([t.rests for t in self.tried])
            self.limits["rests"] = fitted(fewer, self.limits.get("rests"))
        if np.any(self.excess > 0.0):
            self.limits["from rest"] = fitted(self.excess, self.limits.get("from rest"))

    def _beyond(self, stands: np.ndarray) -> np.ndarray:
        """Logarithm of the reach that all but the allowed runs keep within, over that of the wall, (m,)."""
        reach = {i: np.log(np.maximum(self.tried[i].reach, _LEAST)) for i in stands}
        bulk = np.zeros(len(self.tried))
        bulk[stands] = [np.quantile(reach[i], _BULK) for i in stands]
        # The tail beyond the bulk is the same for designs alike, and one design has few runs in it.
        shared = stands[np.argsort(np.abs(bulk[stands]))][:_SHARED]
        tails = [reach[i] - bulk[i] for i in shared]
        return bulk + np.quantile(np.concatenate(tails), self.level)

    def order(self, found: Survey) -> np.ndarray:
        """Order of the designs of a survey, the best first: those that help and had runs before those that
        had none, of which the surfaces only guess."""
        at = self.scaled(found.designs)
        known = np.array([np.any(np.all(np.abs(self.at - x) < 1e-12, axis=1)) for x in at], dtype=bool)
        ranked = self.rank(at)
        return ranked[np.lexsort((~known[ranked], ~found.helps[ranked]))]

    def keeps(self, x: np.ndarray) -> np.ndarray:
        """Probability that designs at places (m, d) keep to what is asked for, as far as their trends say."""
        return likely(list(self.limits.values()), x)

    def rank(self, x: np.ndarray) -> np.ndarray:
        """Order of designs at places (m, d): those that keep to the limits first, then by the trend of their
        tilt."""
        if self.surface is None:
            return np.arange(len(x))
        keeps = self.keeps(x)
        return np.lexsort((self.surface.at(x)[0], np.where(keeps >= self.sure, 0.0, 1.0 - keeps)))

    def alike(self, design: np.ndarray) -> np.ndarray | None:
        """Least and largest designs, shape (2, 3), that the runs cannot tell from one of them: the trend of
        their tilt is above its trend by at most two deviations, and they keep to the limits."""
        if self.surface is None:
            return None
        here = self.scaled(design[None])
        x = np.clip(candidates(np.random.default_rng([self.seed, 14]), here), 0.0, 1.0)
        trend, deviation = (float(v[0]) for v in self.surface.at(here))
        good = (self.surface.at(x)[0] <= trend + 2.0 * deviation) & (self.keeps(x) >= self.sure)
        # Among those that need no run to break a limit the range is the same, or narrower.
        found = np.concatenate([design[None], self.unscaled(x[good])])
        found = found[np.r_[True, self.still(found[1:])]] if len(found) > 1 else found
        return np.stack([found.min(axis=0), found.max(axis=0)])

    def next(self, turn: int, last: bool) -> np.ndarray:
        """Designs (m, 3) worth trying, the best first, that keep to the limits that need no run."""
        ranked = self.rank(self.at)
        best = self.at[ranked[self.excess[ranked] <= 0.0][:4]]
        if not len(best) or self.surface is None:
            # No run has an answer.
            return self.unscaled(best)
        x = candidates(np.random.default_rng([self.seed, 12, turn]), best)
        least = float(self.surface.at(best)[0][0]) if self.keeps(best[:1])[0] >= self.sure else None
        promised = promise(self.surface, list(self.limits.values()), x, least, last)
        order = np.argsort(-promised, kind="stable")[:_WEIGHED]
        order = order[self.still(self.unscaled(x[order]))]
        return self.unscaled(x[first_apart(x, order, _ASKED, _APART)])


def refine(
    found: Survey,
    space: DesignSpace,
    run: Callable[[np.ndarray, int], Tried],
    still: Callable[[np.ndarray], np.ndarray],
    follow: Callable[[np.ndarray], Survey],
    strikes: float,
    rests: float,
    seed: int,
    progress: Count = unreported,
) -> tuple[Survey, Refinement | None]:
    """A survey with further designs, the best by runs from many starts first; and the surfaces through these
    runs, None where no design helps.

    Args:
        found: designs followed from rest.
        space: bounds of the search.
        run: runs of one design (3,), the i-th that is tried.
        still: which of some designs (m, 3) keep to the limits that need no run.
        follow: survey of further designs (m, 3), from rest.
        strikes: share of the runs in which the bob may strike a wall.
        rests: share of the runs that must end at rest.
        seed: of the designs that are compared.
        progress: called with (designs tried, of how many at most).
    """
    helps, units = np.flatnonzero(found.helps), space.scaled(found.designs)
    way = found.excess.get(ON_THE_WAY, np.full(len(units), -np.inf))
    first = list[int]()
    for spare in _SPARE:
        first += first_apart(units, helps[way[helps] <= -spare], _TRIED)
    if not first:
        return found, None
    first, count = list(dict.fromkeys(first)), 0
    here = Refinement(space, found.designs[helps], still, strikes=strikes, rests=rests, seed=seed)
    total = len(first) + _ROUNDS * _BATCH

    def attempt(some: Survey) -> None:
        nonlocal count
        tried = []
        for design in some.designs:
            progress(count + 1, total)
            tried.append(run(design, count))
            count += 1
        here.add(some, tried)

    attempt(found.at(np.array(first)))
    for turn in range(_ROUNDS):
        designs = here.next(turn, turn == _ROUNDS - 1)
        if len(designs):
            # Limits on a motion from rest are asked of that motion.
            more = follow(designs)
            found = found.joined(more)
            # Designs that help come first; one that breaks a limit from rest says where to try no more.
            attempt(more.at(np.argsort(~more.helps, kind="stable")[:_BATCH]))
    progress(total, total)
    return found.at(here.order(found)), here
