"""The search at the scene's own shaking: the first candidates of a search over its neighbourhood."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tpd.analysis.ensemble import Ensemble
from tpd.core.progress import Progress
from tpd.design.checkpoint import Checkpoint
from tpd.design.problem import Problem
from tpd.design.search import Multistart
from tpd.design.steps import pendulum_of
from tpd.design.verified import AtPoint, Bare, Verified
from tpd.design.verify import Verification

_GROUPS = 1000
"""First number of this search's groups in a checkpoint, beyond those of the search that follows."""
_PATHS = 48
"""Designs of the paths that are followed from rest."""


class PointSearch(NamedTuple):
    """The search at the shaking itself, and its best design."""

    search: Multistart
    bare: Bare
    best: Verified | None
    """None where the exact solution confirms no end."""


def search_at_point(
    problem: Problem, ensemble: Ensemble, store: Checkpoint, progress: Progress | None
) -> PointSearch:
    """Search at the scene's own shaking by the method of the problem, validated by the exact solution.

    Raises:
        KeyboardInterrupt: the search was interrupted; the groups that had ended are in the store.
    """
    search = Multistart(problem.objective, problem.method, problem.seed, progress)
    search.run(store.shifted(_GROUPS))
    if search.interrupted:
        raise KeyboardInterrupt
    inputs = problem.scene, problem.objective, problem.method, ensemble, problem.worth
    check = Verification(*inputs, False, progress)
    return PointSearch(search, check.bare, check.confirmed(search))


def at_point_of(point: PointSearch, verification: Verification, search: Multistart) -> AtPoint | None:
    """The best design at the shaking itself, verified under all conditions."""
    best = point.best
    if best is None:
        return None
    exact, searched = best.exact, best.searched
    # Judged as the best around the shaking is.
    around = verification.at_once(search, best.design)
    return AtPoint(
        pendulum=pendulum_of(verification.scene, best),
        amplitude=float(exact.amplitude[0]),
        amplitude_without=float(point.bare.exact.amplitude[0]),
        model="exact" if searched is None else searched.model,
        model_amplitude=float((exact if searched is None else searched).amplitude[0]),
        verified=around if around.reasons else verification.by_fresh_runs(around),
    )


def designs_met(search: Multistart, point: PointSearch | None) -> np.ndarray:
    """Designs that the searches met, (m, 3): ends, the best designs on paths, and the ends at the shaking
    itself."""
    order = search.order(feasible=False)
    wider = search.with_paths(np.inf, _PATHS)
    out = [search.designs[order], wider.designs[search.ended :]]
    if point is not None:
        out += [point.search.designs[point.search.order(feasible=False)]]
    return np.concatenate(out)
