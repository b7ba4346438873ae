"""The search over many conditions: closed forms, exact screening, descents in groups."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import partial

import numpy as np

from tpd.core.parameters import as_arrays
from tpd.core.progress import Progress
from tpd.core.sampling import latin_hypercube
from tpd.design.checkpoint import Kept
from tpd.design.first_order import descend
from tpd.design.objective import Objective, margins
from tpd.design.result import StartStatus
from tpd.design.sequential import Descent, Local, minimise
from tpd.design.single_search import starting_points

GROUP = 16
"""Starts searched from at once: what an interruption may lose."""
_CLOSED = 4096
"""Designs screened by the closed form."""
_CARRIED = 8
"""Designs that a search goes on from on another objective."""
_AWAY = 0.05
"""Least distance, in shares of the bounds, of a design on the way from every end."""
AT_BOUND = 1e-4
"""Distance, in shares of the bounds, that counts as none."""
FEASIBLE = 1e-5
"""Largest relative excess of a limit that is rounding."""


class Search:
    """Screening and descents, group after group of starts."""

    def __init__(
        self,
        objective: Objective,
        starts: int,
        screening: int,
        steps: int,
        seed: int,
        progress: Progress | None,
        method: str = "sequential",
    ) -> None:
        self.objective, self.progress, self.method = objective, progress, method
        self.settings: dict[str, object] = {
            "starts": starts,
            "screening": screening,
            "steps": steps,
            "seed": seed,
            "method": method,
        }
        self.count, self.planned, self.bound, self.seed = starts, max(screening, starts), steps, seed
        self.groups: list[Descent] = []
        self.words = f"{starts} starts"
        self.before, self.first, self.met = 0, 0, 0
        self.interrupted = False
        self.screened, self.screened_value = np.zeros((0, 3)), np.zeros(0)
        self.low, self.high = objective.space.bounds
        self.pending = np.zeros((0, self.low.size))

    def run(self, kept: Kept) -> None:
        """Everything; Ctrl-C keeps the groups that had ended."""
        try:
            chosen, known = self.screen()
            groups = range(0, len(chosen), GROUP)
            for i, begin in enumerate(groups):
                rows, ended = slice(begin, begin + GROUP), kept.get(i)
                self.groups.append(
                    self._descend(chosen[rows], known.at(rows), i, len(groups)) if ended is None else ended
                )
                kept.put(i, self.groups[-1])
        except KeyboardInterrupt:
            self.interrupted = True

    def screen(self) -> tuple[np.ndarray, Local]:
        """Starts for the descents, in shares of the bounds, and what is known of them: the best under all
        conditions that lie apart."""
        objective, space = self.objective, self.objective.space
        p = as_arrays(objective.p)
        wide = space.full(self._spread(_CLOSED))
        still = np.argsort(-margins(objective, wide).min(axis=1), kind="stable")[: self.planned // 4]
        spread = starting_points(p, space, self.planned - len(still), self.seed)
        designs = np.concatenate([spread, wide[still]])
        told = objective.told(designs, None if self.progress is None else stage(self.progress, "screening"))
        local = objective.scaled(told)
        value = objective.value(told) + np.maximum(local.limit, 0.0).sum(axis=1)
        self.screened, self.screened_value = designs, value
        unit = self._unit(designs)
        chosen: list[int] = []
        for apart in (0.1, 0.03, 0.0):
            for i in np.argsort(value, kind="stable"):
                far = all(np.linalg.norm(unit[i] - unit[j]) > apart for j in chosen)
                if len(chosen) < self.count and far and i not in chosen:
                    chosen.append(int(i))
        return unit[chosen], local.at(np.array(chosen))

    def _spread(self, size: int) -> np.ndarray:
        rng = np.random.default_rng([self.seed, 2])
        return self.low + latin_hypercube(rng, size, self.low.size) * (self.high - self.low)

    def _unit(self, designs: np.ndarray) -> np.ndarray:
        return (designs[:, : self.low.size] - self.low) / (self.high - self.low)

    def _descend(self, starts: np.ndarray, known: Local | None, group: int, groups: int) -> Descent:
        def after(step: int, steps: int) -> None:
            if self.progress is not None:
                self.progress("searching", group * steps + step, groups * steps)

        objective = self.objective
        search = minimise if self.method == "sequential" else partial(descend, self.method)
        return search(
            objective.local,
            starts,
            objective.measure.cap(len(objective.conditions)),
            objective.measure.of,
            known=known,
            steps=self.bound,
            after=after,
        )

    def carry_on(self, objective: Objective, kept: Kept, words: str, steps: int, together: int) -> Search:
        """The search that goes on from the best designs of this one that lie apart, on another objective, so
        many of them at once; none if this one was interrupted. See `look_at_the_rest`."""
        on = Search(objective, min(_CARRIED, self.count), 0, steps, self.seed, self.progress, self.method)
        on.settings, on.before, on.first = self.settings, self.evaluations, self.first + len(self.groups)
        on.screened, on.screened_value = self.screened, self.screened_value
        units = self.units[spread_out(self.units, self.order(feasible=False), on.count)]
        on.count, on.words, on.pending = len(units), f"{self.words}, {len(units)} finished {words}", units
        groups = range(0, len(units), together)
        try:
            if self.interrupted:
                on.count = self.count
                raise KeyboardInterrupt
            for i, begin in enumerate(groups):
                ended = kept.get(on.first + i)
                if ended is None:
                    ended = on._descend(units[begin : begin + together], None, i, len(groups))
                on.groups.append(ended)
                on.pending = units[begin + together :]
                kept.put(on.first + i, ended)
        except KeyboardInterrupt:
            on.interrupted, on.words = True, f"{self.words}, not all finished {words}"
        return on

    def look_at_the_rest(self) -> None:
        """After an interruption: what the designs are that were to be gone on from."""
        if len(self.pending):
            self.groups.append(self._seen(self.pending))

    def with_the_way(self, most: float) -> Search:
        """This one, and after its ends the best designs, of a merit below `most`, that the descents came
        through apart from them, as if they had ended there as well."""
        on = copy(self)
        units = np.concatenate([g.path.reshape(-1, self.low.size) for g in self.groups])
        merit = np.concatenate([g.path_merit.ravel() for g in self.groups])
        order = np.argsort(merit, kind="stable")
        ends = len(self.units)
        first = np.concatenate([np.arange(ends), ends + order[merit[order] < most]])
        every = np.concatenate([self.units, units])
        taken = spread_out(every, first, ends + _CARRIED, _AWAY, ends)[ends:]
        if taken:
            on.groups, on.met = [*self.groups, self._seen(every[taken])], len(taken)
        return on

    def _seen(self, units: np.ndarray) -> Descent:
        """Descents of no step."""
        objective = self.objective
        cap = objective.measure.cap(len(objective.conditions))
        return minimise(objective.local, units, cap, objective.measure.of, steps=0)

    @property
    def ended(self) -> int:
        """How many starts have ended; what is listed after them are designs on the way."""
        return len(self.units) - self.met

    @property
    def evaluations(self) -> int:
        """Designs evaluated, screening included."""
        return (self.before or len(self.screened)) + sum(g.evaluations for g in self.groups)

    @property
    def units(self) -> np.ndarray:
        """The best design of every start that has ended, in shares of the bounds."""
        return np.concatenate([np.zeros((0, self.low.size)), *(g.x for g in self.groups)])

    @property
    def designs(self) -> np.ndarray:
        """The same as (mu, lam, zeta), (starts, 3)."""
        return self.objective.space.full(self.low + self.units * (self.high - self.low))

    def order(self, feasible: bool = True) -> np.ndarray:
        """Those that keep to the limits, the best first; then, if wanted, those that do not."""
        if not self.groups:
            return np.zeros(0, int)
        order = np.lexsort((self.column(lambda g: g.merit), self.values))
        return order[np.isfinite(self.values[order])] if feasible else order

    @property
    def values(self) -> np.ndarray:
        """Their measures, infinite where a limit is broken."""
        if not self.groups:
            return np.zeros(0)
        value = np.concatenate([self.objective.measure.of(g.local.value) for g in self.groups])
        excess = np.concatenate([g.local.limit.max(axis=1) for g in self.groups])
        return np.where(excess <= FEASIBLE, value, np.inf)

    @property
    def paths(self) -> list[np.ndarray]:
        """Designs on the way from every start."""
        space, width = self.objective.space, self.high - self.low
        return [space.full(self.low + g.path[:, i] * width) for g in self.groups for i in range(len(g.x))]

    def column(self, get: Callable[[Descent], np.ndarray]) -> np.ndarray:
        """Something of all starts."""
        return np.concatenate([get(g) for g in self.groups])

    def statuses(self) -> tuple[StartStatus, ...]:
        """How every start ended."""
        out, n = [], len(self.objective.conditions)
        for g in self.groups:
            for i in range(len(g.x)):
                inside = (g.x[i] > AT_BOUND) & (g.x[i] < 1.0 - AT_BOUND)
                if g.open[i] and not g.steps[i]:
                    out.append(StartStatus.interrupted)
                elif g.local.limit[i].max() > FEASIBLE:
                    out.append(StartStatus.infeasible)
                elif g.open[i]:
                    out.append(StartStatus.steps_exhausted)
                elif g.local.limit[i, :n].max() > -1e-3:
                    out.append(StartStatus.stroke_limited)
                elif g.local.value[i].max() <= 0.0:
                    out.append(StartStatus.rests)
                else:
                    out.append(StartStatus.converged if inside.all() else StartStatus.at_bound)
        return tuple(out) + (StartStatus.interrupted,) * (self.count - len(out))


def spread_out(
    units: np.ndarray, order: np.ndarray, most: int, apart: float = 0.02, kept: int = 0
) -> list[int]:
    """The first of an order of designs that are no neighbours: at least so far apart in shares of the
    bounds. Of the order the first `kept` are taken whatever they are."""
    taken = [int(i) for i in order[:kept]]
    for i in map(int, order[kept:]):
        if len(taken) < most and all(np.linalg.norm(units[i] - units[j]) > apart for j in taken):
            taken.append(i)
    return taken


def stage(progress: Progress, name: str) -> Callable[[int, int], None]:
    """Progress of one stage of that name."""
    return lambda done, total: progress(name, done, total)
