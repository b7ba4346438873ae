"""Multistart: screening, then searches in groups."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from tpd.core.progress import Progress, unreported
from tpd.design.criteria import stroke_limit
from tpd.design.ends import Ends, Linearisation
from tpd.design.methods import Descent, Method
from tpd.design.objective import BACK_OFF, Orbits
from tpd.design.screening import best_apart, first_apart, screened_designs
from tpd.design.verified import DesignStatus

GROUP = 16
"""Searches run at once."""
_AWAY = 0.05
"""Least distance, in shares of the bounds, of a design on a path from every end."""
AT_BOUND = 1e-4
"""Distance from a bound, in shares of the bounds, that counts as none."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """The history of the search, for reports and pictures."""

    screened: np.ndarray
    """Designs (mu, lam, zeta) solved before the searches, (m, 3)."""
    screened_value: np.ndarray
    """Their risk, plus the excess over limits, (m,)."""
    screened_feasible: np.ndarray
    """Whether they keep to the limits, (m,)."""
    paths: tuple[np.ndarray, ...]
    """Designs on the way of each search, each (steps, 3)."""
    ends: np.ndarray
    """Best design of each search, (searches, 3)."""
    end_values: np.ndarray
    """Their risks, infinite where a limit is broken."""
    statuses: tuple[DesignStatus, ...]
    mismatch: np.ndarray
    """Largest relative differences of merits (tilts, mostly) and of slopes between the model of the search
    and the exact solution at the ends, (searches, 2); zero where the search was on the exact one."""
    lost: np.ndarray
    """Orbits that this model lost on the way of each search, (searches,): the exact one went on there."""
    evaluations: int
    """Designs evaluated, screening included."""
    description: str
    """From how many designs, in words."""


class Multistart:
    """Searches of one method on one objective, group after group."""

    def __init__(self, objective: Orbits, method: Method, seed: int, progress: Progress | None) -> None:
        self.objective, self.method, self.seed = objective, method, seed
        self.progress = progress or unreported
        self.groups: list[Ends] = []
        self.description = f"{method.searches} designs"
        self.screened, self.screened_value = np.zeros((0, 3)), np.zeros(0)
        self.feasible = np.zeros(0, bool)

    def run(self) -> None:
        """Screen and search."""
        units, known = self.screen()
        groups = range(0, len(units), GROUP)
        for i, begin in enumerate(groups):
            rows = slice(begin, begin + GROUP)
            self.groups.append(self._search(units[rows], known.at(rows), i, len(groups)))

    def screen(self) -> tuple[np.ndarray, Linearisation]:
        """Designs for the searches, in shares of the bounds, and their linearisation: the best of those
        screened that lie apart."""
        objective = self.objective
        planned = max(self.method.screening, self.method.searches)
        designs = screened_designs(objective, planned, self.seed)
        e = objective.evaluate(designs, partial(self.progress, "screening"))
        local = objective.linearised(e)
        # Designs slightly beyond a limit stay in the order: a search leads them back inside.
        excess = np.maximum(local.limit, 0.0).sum(axis=1)
        self.screened, self.screened_value = designs, objective.value(e) + excess
        self.feasible = excess == 0.0
        units = objective.space.scaled(designs)
        # Fewer than asked for, where screened designs coincide.
        chosen = best_apart(units, self.screened_value, self.method.searches)
        return units[chosen], local.at(chosen)

    def _search(self, units: np.ndarray, known: Linearisation, group: int, groups: int) -> Ends:
        def after(step: int, steps: int) -> None:
            self.progress("searching", group * steps + step, groups * steps)

        return self.method.search(self.objective, units, known=known, after=after)

    def on_the_way(self, count: int) -> np.ndarray:
        """Best designs (mu, lam, zeta), (count, 3) or fewer, that the paths passed apart from the ends."""
        passed = np.concatenate(
            [self.units[:0], *(g.path.reshape(-1, g.path.shape[-1]) for g in self.groups)]
        )
        # The paths' merits hold the penalty: a design beyond a limit is far down the order.
        merit = np.concatenate([np.zeros(0), *(g.path_merit.ravel() for g in self.groups)])
        ends = len(self.units)
        first = np.concatenate([np.arange(ends), ends + np.argsort(merit, kind="stable")])
        every = np.concatenate([self.units, passed])
        taken = first_apart(every, first, ends + count, _AWAY, ends)[ends:]
        return self.objective.space.unscaled(every[taken])

    @property
    def evaluations(self) -> int:
        """Designs evaluated, screening included."""
        return len(self.screened) + sum(g.evaluations for g in self.groups)

    @property
    def units(self) -> np.ndarray:
        """Best design of every search that has ended, in shares of the bounds."""
        none = np.zeros((0, self.objective.space.bounds.shape[1]))
        return np.concatenate([none, *(g.x for g in self.groups)])

    @property
    def designs(self) -> np.ndarray:
        """Best designs as (mu, lam, zeta), (searches, 3)."""
        return self.objective.space.unscaled(self.units)

    def order(self, feasible: bool = True) -> np.ndarray:
        """Indices of the ends that keep the limits, the best first; if asked for, then the others."""
        if not self.groups:
            return np.zeros(0, int)
        order = np.lexsort((self.column(lambda g: g.merit), self.values))
        return order[np.isfinite(self.values[order])] if feasible else order

    @property
    def values(self) -> np.ndarray:
        """Risks of the ends, infinite where a limit is broken."""
        if not self.groups:
            return np.zeros(0)
        value = np.concatenate([self.objective.risk.of(g.local.value) for g in self.groups])
        # Their values are exact: where all are contradicted, they are still the best that is known.
        bad = self.contradicted & ~self.contradicted.all()
        return np.where((self.excess.max(axis=1, initial=0.0) <= 0.0) & ~bad, value, np.inf)

    @property
    def contradicted(self) -> np.ndarray:
        """Whether the exact solution contradicts the model that was searched with, at each end."""
        return self.column(self._contradicts)

    def _contradicts(self, g: Ends) -> np.ndarray:
        most = self.method.tolerance if isinstance(self.method, Descent) else np.inf
        return g.mismatch[:, 0] > most

    @property
    def excess(self) -> np.ndarray:
        """Excess of every limit at the ends, (searches, l): at most 0 where it is kept. The search itself
        works with tightened constraints."""
        return self.column(lambda g: g.local.limit) - BACK_OFF

    def column(self, get: Callable[[Ends], np.ndarray]) -> np.ndarray:
        """One quantity of all searches."""
        return np.concatenate([get(g) for g in self.groups])

    @property
    def history(self) -> Search:
        """History for reports and pictures."""
        unscaled = self.objective.space.unscaled
        paths = tuple(unscaled(g.path[:, i]) for g in self.groups for i in range(len(g.x)))
        return Search(
            screened=self.screened,
            screened_value=self.screened_value,
            screened_feasible=self.feasible,
            paths=paths,
            ends=self.designs,
            end_values=self.values,
            statuses=self.statuses(),
            mismatch=np.concatenate([np.zeros((0, 2)), *(g.mismatch for g in self.groups)]),
            lost=np.concatenate([np.zeros(0, int), *(g.lost for g in self.groups)]),
            evaluations=self.evaluations,
            description=self.description,
        )

    def statuses(self) -> tuple[DesignStatus, ...]:
        """How every search ended."""
        out = [self._status(g, i) for g in self.groups for i in range(len(g.x))]
        return tuple(out)

    def _status(self, g: Ends, i: int) -> DesignStatus:
        n, limit = len(self.objective.conditions), g.local.limit[i] - BACK_OFF
        inside = (g.x[i] > AT_BOUND) & (g.x[i] < 1.0 - AT_BOUND)
        limited = np.isfinite(stroke_limit(self.objective.limits))
        if not np.isfinite(g.merit[i]):
            return DesignStatus.infeasible
        if self._contradicts(g)[i]:
            return DesignStatus.contradicted
        if limit.max(initial=0.0) > 0.0:
            return DesignStatus.infeasible
        if g.open[i]:
            return DesignStatus.steps_exhausted
        if limited and limit[:n].max() > -1e-3:
            return DesignStatus.stroke_limited
        if g.local.value[i].max() <= 0.0:
            return DesignStatus.rests
        return DesignStatus.converged if inside.all() else DesignStatus.at_bound
