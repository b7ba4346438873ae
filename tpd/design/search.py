"""The search: many designs are screened, optax descends from the best of them, and SLSQP finishes.

Three quarters of the screened designs are spread over the space. One quarter are those of the largest uplift
margin of thousands, which is a closed form: the tilt is flat where a block rests, so that a descent would
hardly find the way there."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from tpd.core.progress import Progress, unreported
from tpd.design.criteria import NEAR, Evaluation, first_apart
from tpd.design.descend import AT_BOUND, Ends, descend, finish, merit_of, transformation
from tpd.design.orbits import BACK_OFF, Linearisation, Orbits, margins
from tpd.design.settings import Descent
from tpd.design.smoothed_orbits import SmoothedOrbits
from tpd.models.smoothed import Smoothed
from tpd.scene.conditions import latin_hypercube

_CLOSED = 4096
"""Designs screened by the closed form of the uplift margin."""
_APART = (0.1, 0.03, 0.0)
"""Distances, in shares of the bounds, that chosen designs keep from each other as long as there are
enough."""
_FINISHED_APART = 0.02
"""Least distance of the ends that are finished, in shares of the bounds."""
_PASSED, _AWAY = 48, 0.05
"""Designs of the paths that are kept, and their least distance from each other and from every end."""

_AT_LIMIT = 1e-3
"""Share of a limit that is left where the limit counts as active."""


class SearchStatus(enum.Enum):
    """How one descent ended, with its finish; the value is the sentence of a report."""

    rests = "found designs that settle at rest; the uplift margin grew as far as it goes"
    converged = "reached a minimum of the risk"
    at_bound = "reached the edge of the design space"
    at_limit = "reached a limit"
    steps_exhausted = "was still improving when the steps ran out"
    contradicted = "ended on an orbit that the exact solution does not confirm"
    infeasible = "met no design within the limits"


_no_designs, _no_values = partial(np.zeros, (0, 3)), partial(np.zeros, 0)


@dataclass(frozen=True, kw_only=True)
class Search:
    """The history of the search, for later stages, reports and pictures."""

    screened: np.ndarray = field(default_factory=_no_designs)
    """Designs (mu, lam, zeta) solved before the descents, (m, 3)."""
    screened_value: np.ndarray = field(default_factory=_no_values)
    """Their risk, plus the excess over limits, (m,)."""
    screened_feasible: np.ndarray = field(default_factory=_no_values)
    """Whether they keep the limits, (m,)."""
    paths: tuple[np.ndarray, ...] = ()
    """Designs on the way of each descent, each (steps, 3)."""
    passed: np.ndarray = field(default_factory=_no_designs)
    """Best designs of the paths that lie apart from each other and from the ends, the best first, (k, 3)."""
    ends: np.ndarray = field(default_factory=_no_designs)
    """Best design of each descent after the finish, (searches, 3)."""
    end_values: np.ndarray = field(default_factory=_no_values)
    """Their risks, infinite where a limit is broken or the exact solution contradicts the descent."""
    order: np.ndarray = field(default_factory=partial(np.zeros, 0, int))
    """Indices of all ends, the best first."""
    statuses: tuple[SearchStatus, ...] = ()
    mismatch: np.ndarray = field(default_factory=partial(np.zeros, (0, 2)))
    """Largest relative differences of merits (tilts, mostly) and of slopes between the model of the descent
    and the exact solution at its end, (searches, 2); zero where the descent used exact orbits."""
    lost: np.ndarray = field(default_factory=_no_values)
    """Orbits that this model lost on the way of each descent, (searches,): there the exact one took over."""
    evaluations: int = 0
    """Designs evaluated, screening included."""
    descended: float = np.inf
    """Least risk plus penalty of a broken limit after the descents."""
    finished: float = np.inf
    """Least risk plus penalty of a broken limit after the finish."""
    description: str = ""
    """From how many designs, in words."""

    @property
    def confirmed(self) -> np.ndarray:
        """Ends that the exact solution does not contradict, the best first, (k, 3)."""
        sound = np.array([status is not SearchStatus.contradicted for status in self.statuses], dtype=bool)
        return self.ends[self.order[sound[self.order]]]

    @property
    def told(self) -> str:
        """Sentence on the descents and on the finish; empty where there was no search."""
        if not self.statuses:
            return ""
        gained = self.descended - self.finished
        if not np.isfinite(self.descended) or gained <= 0.0:
            return f"The descents reach {self.descended:.4g}, and the finish finds nothing better."
        return f"The descents reach {self.descended:.4g}, and the finish lowers this by {gained:.2g}."


def search(orbits: Orbits, settings: Descent, seed: int, progress: Progress | None = None) -> Search:
    """Screen designs, descend from the best of them, and finish the best ends.

    Args:
        orbits: the objective under all conditions, with limits and bounds.
        settings: number of designs of each stage, and the optimiser.
        seed: of the screened designs.
        progress: called with (stage, done, of how many).

    Raises:
        ValueError: values of a user's objective that are not of the size that they must have.
    """
    report, risk, space = progress or unreported, orbits.risk, orbits.space
    cap = risk.cap(len(orbits.conditions))
    # Screening.
    designs = screened_designs(orbits, max(settings.screening, settings.searches), seed)
    e = orbits.evaluate(designs, partial(report, "screening"))
    _check_size(orbits, e)
    local = orbits.linearised(e)
    # Designs slightly beyond a limit stay in the order: a descent leads them back inside.
    excess = np.maximum(local.limit, 0.0).sum(axis=1)
    screened_value = orbits.value(e) + excess
    # There are fewer starts than searches where screened designs coincide.
    chosen = best_apart(space.scaled(designs), screened_value, settings.searches)

    # Descents.
    starts, known, evaluate, walk = space.scaled(designs[chosen]), local.at(chosen), orbits.at, None
    if isinstance(settings.model, Smoothed):
        walk = SmoothedOrbits(orbits, settings.model, e.at(chosen))
        evaluate = walk.at
    stages = settings.steps + settings.finish
    descents = descend(
        transformation(settings),
        evaluate,
        starts,
        known,
        cap,
        risk.of,
        steps=settings.steps,
        after=lambda step, _: report("searching", step, stages),
    )
    exact = orbits.at(descents.x)
    mismatch = _mismatch(descents.local, exact)
    x, merit = descents.x.copy(), merit_of(exact, risk.of)
    descended = float(merit.min())

    # Finish, from ends that are no neighbours of each other.
    best = first_apart(x, np.argsort(merit, kind="stable"), settings.finish, _FINISHED_APART)
    converged, spent = np.zeros(len(x), bool), 0
    for i, row in enumerate(best):
        done = finish(orbits.at, x[row], exact.at(slice(row, row + 1)), cap, risk.of)
        x[row], converged[row], spent = done.x, done.converged, spent + done.evaluations
        for part, new in zip(exact, done.local, strict=True):
            part[row] = new[0]
        report("searching", settings.steps + i + 1, stages)
    merit = merit_of(exact, risk.of)
    contradicted = mismatch[:, 0] > settings.tolerance
    contradicted[best] = False
    statuses = tuple(
        _status(x[i], exact.at(slice(i, i + 1)), bool(contradicted[i]), bool(converged[i]))
        for i in range(len(x))
    )
    kept = (exact.limit.max(axis=1, initial=-1.0) <= BACK_OFF) & np.isfinite(merit)
    # The values are exact: where all descents are contradicted, they are still the best that is known.
    values = np.where(kept & ~(contradicted & ~contradicted.all()), risk.of(exact.value), np.inf)
    return Search(
        screened=designs,
        screened_value=screened_value,
        screened_feasible=excess == 0.0,
        paths=tuple(space.unscaled(descents.path[:, i]) for i in range(len(x))),
        passed=space.unscaled(_passed(descents, x)),
        ends=space.unscaled(x),
        end_values=values,
        order=np.lexsort((merit, values)),
        statuses=statuses,
        mismatch=mismatch,
        lost=np.zeros(len(x), int) if walk is None else walk.lost,
        evaluations=len(designs) + settings.steps * len(x) + spent,
        descended=descended,
        finished=float(merit.min()),
        description=f"{settings.searches} designs",
    )


def screened_designs(orbits: Orbits, count: int, seed: int) -> np.ndarray:
    """Seeded designs (mu, lam, zeta), shape (count, 3): three quarters spread over the space, and one quarter
    of the largest uplift margin under all conditions."""
    space = orbits.space
    wide = space.unscaled(latin_hypercube(np.random.default_rng([seed, 2]), _CLOSED, space.bounds.shape[1]))
    still = np.argsort(-margins(orbits, wide).min(axis=1), kind="stable")[: count // 4]
    spread = latin_hypercube(np.random.default_rng(seed), count - len(still), space.bounds.shape[1])
    return np.concatenate([space.unscaled(spread), wide[still]])


def _check_size(orbits: Orbits, e: Evaluation) -> None:
    """Raise `ValueError` where an objective has values that cannot be compared with those of rest."""
    value = e.merit[e.kind <= NEAR]
    if len(value) and not np.any((value >= 0.0) & (value <= 1.0)):
        raise ValueError(
            f"`values` of the objective {orbits.objective.name} must be between 0 and 1 for most designs, "
            f"divided by a size of reference, but are between {value.min():.3g} and {value.max():.3g}"
        )


def _mismatch(model: Linearisation, exact: Linearisation) -> np.ndarray:
    """Largest relative differences of merits and of slopes between a model and the exact solution, (m, 2)."""
    apart = np.abs(model.value - exact.value) / np.maximum(np.abs(exact.value), 1e-12)
    steep = np.maximum(np.abs(exact.slope).max(axis=(1, 2), keepdims=True), 1e-12)
    turned = np.abs(model.slope - exact.slope) / steep
    return np.stack([apart.max(axis=1), turned.max(axis=(1, 2))], axis=1)


def _passed(ends: Ends, x: np.ndarray) -> np.ndarray:
    """Best designs of the paths of descents apart from the ends `x`, in shares of the bounds."""
    # The merits of the paths hold the penalty: a design beyond a limit is far down the order.
    order = len(x) + np.argsort(ends.path_merit.ravel(), kind="stable")
    every = np.concatenate([x, ends.path.reshape(-1, x.shape[1])])
    taken = first_apart(every, np.r_[np.arange(len(x)), order], len(x) + _PASSED, _AWAY, len(x))
    return every[taken[len(x) :]]


def _status(x: np.ndarray, at: Linearisation, contradicted: bool, converged: bool) -> SearchStatus:
    """How one search ended, with its best design `x` and the linearisation there."""
    most = at.limit.max(initial=-1.0) - BACK_OFF
    if contradicted:
        return SearchStatus.contradicted
    if not np.isfinite(at.value).all() or most > 0.0:
        return SearchStatus.infeasible
    if not converged:
        return SearchStatus.steps_exhausted
    if most > -_AT_LIMIT:
        return SearchStatus.at_limit
    if at.value.max() <= 0.0:
        return SearchStatus.rests
    inside = (x > AT_BOUND) & (x < 1.0 - AT_BOUND)
    return SearchStatus.converged if inside.all() else SearchStatus.at_bound


def best_apart(units: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Indices of the best designs that lie apart from each other, shape (count,) or fewer."""
    chosen: list[int] = []
    order = np.argsort(values, kind="stable")
    # First designs of different valleys; neighbours then complete the number.
    for apart in _APART:
        order = np.r_[chosen, order[~np.isin(order, chosen)]].astype(int)
        chosen = first_apart(units, order, count, apart, len(chosen))
    return np.array(chosen, dtype=int)
