"""Multistart: screening, then searches in groups, with a checkpoint after every group."""

from __future__ import annotations

from collections.abc import Callable

import jax
import numpy as np

from tpd.analysis.outcomes import LOST, UNANSWERED
from tpd.core.conditions import under_all
from tpd.core.progress import Progress
from tpd.core.status import names_of
from tpd.design.checkpoint import Checkpoint
from tpd.design.criteria import stroke_limit
from tpd.design.ends import BLANK, Book, Ends, Linearisation
from tpd.design.followed import Followed
from tpd.design.methods import Descent, Method
from tpd.design.objective import BACK_OFF, REST, AbstractObjective, Count, Evaluation, margins
from tpd.design.result import Search, SearchStatus
from tpd.design.screening import best_apart, first_apart, screened_designs
from tpd.models.batches import settle_all
from tpd.models.piecewise import Piecewise

GROUP = 16
"""Searches run at once: the work that an interruption may lose."""
_CARRIED = 8
"""Designs that a search goes on from on another objective."""
_AWAY = 0.05
"""Least distance, in shares of the bounds, of a design on a path from every end."""
AT_BOUND = 1e-4
"""Distance from a bound, in shares of the bounds, that counts as none."""
_SCREENED_PERIODS = 100
"""Forcing periods that a screened design is followed."""


class Multistart:
    """Searches of one method on one objective, group after group."""

    def __init__(
        self, objective: AbstractObjective, method: Method, seed: int, progress: Progress | None
    ) -> None:
        self.objective, self.method, self.seed, self.progress = objective, method, seed, progress
        self.count, self.groups, self.interrupted = method.searches, list[Ends](), False
        self.description = f"{method.searches} designs"
        self.before, self.first = 0, 0
        self.screened, self.screened_value = np.zeros((0, 3)), np.zeros(0)
        self.feasible, self.overturned = np.zeros(0, bool), np.zeros(0, bool)
        self.pending = np.zeros((0, objective.space.bounds.shape[1]))

    def run(self, checkpoint: Checkpoint) -> None:
        """Screen and search; Ctrl-C keeps the groups that had ended."""
        try:
            units, known = self.screen()
            groups = range(0, len(units), GROUP)
            for i, begin in enumerate(groups):
                rows, ended = slice(begin, begin + GROUP), checkpoint.get(i, BLANK)
                if ended is None:
                    part = None if known is None else known.at(rows)
                    ended = self._search(units[rows], part, i, len(groups))
                self.groups.append(ended)
                # Stored at once: an interruption or a crash loses one group at most.
                checkpoint.put(i, ended)
        except KeyboardInterrupt:
            self.interrupted = True

    def screen(self) -> tuple[np.ndarray, Linearisation | None]:
        """Designs for the searches, in shares of the bounds, and their linearisation where it is known: the
        best of those screened that lie apart."""
        objective = self.objective
        planned = max(self.method.screening, self.method.searches)
        designs = screened_designs(objective, planned, self.seed)
        after = None if self.progress is None else stage(self.progress, "screening")
        followed = isinstance(objective, Followed)
        # Smoothed or nonlinear motions cost a hundred times as much as exact ones; screening needs no
        # derivative.
        e = _exact(objective, designs, after) if followed else objective.evaluate(designs, after)
        local = objective.linearised(e)
        # Designs slightly beyond a limit stay in the order: a search leads them back inside.
        excess = np.maximum(local.limit, 0.0).sum(axis=1)
        self.screened, self.screened_value = designs, objective.value(e) + excess
        self.feasible, self.overturned = excess == 0.0, np.any(~e.attracts, axis=1)
        units = objective.space.scaled(designs)
        chosen = best_apart(units, self.screened_value, self.count)
        # Fewer than asked for, where screened designs coincide.
        self.count = len(chosen)
        return units[chosen], None if followed else local.at(chosen)

    def _search(self, units: np.ndarray, known: Linearisation | None, group: int, groups: int) -> Ends:
        def after(step: int, steps: int) -> None:
            if self.progress is not None:
                self.progress("searching", group * steps + step, groups * steps)

        return self.method.search(self.objective, units, known=known, after=after)

    def carry_on(
        self, objective: AbstractObjective, checkpoint: Checkpoint, words: str, method: Method, together: int
    ) -> Multistart:
        """Searches on another objective from the best ends of this one that lie apart, `together` at once;
        none if this one was interrupted."""
        on = Multistart(objective, method, self.seed, self.progress)
        on.before, on.first = self.evaluations, self.first + len(self.groups)
        on._inherit(self)
        best = first_apart(self.units, self.order(feasible=False), min(_CARRIED, self.count))
        # Ends that a later stage has not reached when it is interrupted are still answers of the former one.
        on.pending = self.units[best]
        on.count, on.description = len(best), f"{self.description}, {len(best)} finished {words}"
        groups = range(0, len(best), together)
        try:
            if self.interrupted:
                on.count = self.count
                raise KeyboardInterrupt
            for i, begin in enumerate(groups):
                ended = checkpoint.get(on.first + i, BLANK)
                if ended is None:
                    ended = on._search(self.units[best][begin : begin + together], None, i, len(groups))
                on.groups.append(ended)
                on.pending = self.units[best][begin + together :]
                checkpoint.put(on.first + i, ended)
        except KeyboardInterrupt:
            on.interrupted, on.description = True, f"{self.description}, not all finished {words}"
        return on

    def _inherit(self, other: Multistart) -> None:
        """Take over the screening of another search."""
        self.screened, self.screened_value = other.screened, other.screened_value
        self.feasible, self.overturned = other.feasible, other.overturned

    def evaluate_pending(self) -> None:
        """After an interruption: evaluate the designs from which a search had not begun."""
        if len(self.pending):
            objective = self.objective
            cap = objective.risk.cap(len(objective.conditions))
            ends = Book(objective.at, objective.risk.of, self.pending).ends(cap)
            self.groups.append(ends._replace(open=np.ones(len(self.pending), dtype=bool)))

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
        return (self.before or len(self.screened)) + sum(g.evaluations for g in self.groups)

    @property
    def units(self) -> np.ndarray:
        """Best design of every search that has ended, in shares of the bounds."""
        return np.concatenate([self.pending[:0], *(g.x for g in self.groups)])

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
            screened_overturned=self.overturned,
            paths=paths,
            ends=self.designs,
            end_values=self.values,
            statuses=self.statuses(),
            mismatch=np.concatenate([np.zeros((0, 2)), *(g.mismatch for g in self.groups)]),
            lost=np.concatenate([np.zeros(0, int), *(g.lost for g in self.groups)]),
            evaluations=self.evaluations,
            description=self.description,
        )

    def statuses(self) -> tuple[SearchStatus, ...]:
        """How every search ended."""
        out = [self._status(g, i) for g in self.groups for i in range(len(g.x))]
        return (*out, *(SearchStatus.interrupted,) * (self.count - len(out)))

    def _status(self, g: Ends, i: int) -> SearchStatus:
        n, limit = len(self.objective.conditions), g.local.limit[i] - BACK_OFF
        inside = (g.x[i] > AT_BOUND) & (g.x[i] < 1.0 - AT_BOUND)
        limited = np.isfinite(stroke_limit(self.objective.limits))
        if not np.isfinite(g.merit[i]):
            return SearchStatus.infeasible
        if g.open[i] and not g.steps[i]:
            return SearchStatus.interrupted
        if self._contradicts(g)[i]:
            return SearchStatus.contradicted
        if limit.max(initial=0.0) > 0.0:
            return SearchStatus.infeasible
        if g.open[i]:
            return SearchStatus.steps_exhausted
        if limited and limit[:n].max() > -1e-3:
            return SearchStatus.stroke_limited
        if g.local.value[i].max() <= 0.0:
            return SearchStatus.rests
        return SearchStatus.converged if inside.all() else SearchStatus.at_bound


def stage(progress: Progress, name: str) -> Count:
    """Progress of one stage."""
    return lambda done, total: progress(name, done, total)


def _exact(objective: Followed, designs: np.ndarray, after: Count | None) -> Evaluation:
    """Evaluation of designs by the exact solution from the objective's starts, without derivatives: a model
    that is integrated would take a hundred times as long."""
    m, n = len(designs), len(objective.conditions)
    names, tilt, stroke = (x.reshape(m, n, -1) for x in _motions(objective, designs, after))
    margin = margins(objective, designs)
    # A motion without an answer speaks against a design.
    lost, rests = np.isin(names, (*LOST, *UNANSWERED)), names == "rest"
    merit = np.where(lost, 2.0 - margin[..., None], np.where(rests, -margin[..., None], tilt))
    merit = merit.max(axis=-1) if objective.starts.worst else merit.mean(axis=-1)
    stroke = np.where(lost, 0.0, stroke).max(axis=-1)
    kind = np.where(lost.any(axis=-1), REST + 1, np.where(rests.all(axis=-1), REST, 0))
    tallest = np.where(lost, -np.inf, tilt).max(axis=-1)
    tallest = np.where(lost.all(axis=-1), np.inf, tallest)
    blank = objective.blank(m)
    return blank._replace(
        merit=merit,
        tilt=tallest,
        stroke=stroke,
        margin=margin,
        multiplier=np.zeros((m, n)),
        kind=kind,
        design=designs,
        lost=lost.mean(axis=-1),
    )


def _motions(objective: Followed, designs: np.ndarray, after: Count | None) -> tuple[np.ndarray, ...]:
    """Names of statuses, tilts over nu and strokes (rad) of every start of every design under every
    condition, each in one row, by events."""
    pairs, s = len(designs) * len(objective.conditions), objective.starts.size
    p = under_all(objective.p, designs, objective.conditions)
    every = jax.tree.map(lambda x: np.repeat(np.asarray(x), s), p)
    y0 = np.tile(objective.starts.states(float(objective.p.nu)), (pairs, 1))
    settled = settle_all(every, y0, model=Piecewise(max_periods=_SCREENED_PERIODS), progress=after)
    tilt = np.asarray(settled.amplitude) / np.asarray(every.nu)
    return names_of(settled.status), tilt, np.asarray(settled.stroke)
