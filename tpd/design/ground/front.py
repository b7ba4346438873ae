"""Front of the bob's mass against the intensity that overturns the block: what a kilogramme pays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tpd.core import checks
from tpd.design.ground.design import GroundDesign
from tpd.design.ground.groups import Group, Role
from tpd.design.ground.judgement import Interval, judge
from tpd.design.ground.objective import GroundObjective
from tpd.design.ground.search import GroundSearch, Searcher

DEFAULT_SHARES = (0.02, 0.05, 0.1, 0.15, 0.2)


@dataclass(frozen=True)
class FrontPoint:
    """Best design with a bob of at most a mass."""

    most: float
    """Largest mass of the bob over the block's."""
    design: np.ndarray | None
    """(mu, lam, zeta); None where none keeps to the limits."""
    medians: tuple[float, float]
    """Median intensities that overturn the block by the nonlinear equations, bare and hung, on the motions
    that the design is tuned to; infinite above the stripes."""
    overturned: Interval | None
    """Change of the share of the runs that overturn, with its interval."""
    undecided: int = 0
    """Runs without an answer, which the medians and the change leave out."""


def front(
    design: GroundDesign,
    most: Sequence[float] = DEFAULT_SHARES,
    *,
    method: GroundSearch | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[FrontPoint, ...]:
    """Search the problem of a design again with bobs of limited mass.

    Args:
        design: an answer of `tpd.optimise` on ground motions.
        most: largest masses over the block's, increasing.
        method: of each search; default 16 designs over the space and 16 more.
        progress: called with the searches done and in all.

    Raises:
        ValueError: masses that do not increase, or below the least of the design space.
    """
    shares = np.asarray(most, dtype=float)
    least = design.space.mass_ratio[0]
    if shares.ndim != 1 or np.any(np.diff(shares) <= 0.0) or not np.all(shares > least):
        raise ValueError(
            f"`most` must be increasing masses above {least:g} of the block's, but is {list(most)}"
        )
    how = GroundSearch(starts=16, steps=16) if method is None else method
    points = []
    for i, share in enumerate(shares):
        points.append(_point(design, float(share), how))
        if progress is not None:
            progress(i + 1, len(shares))
    return tuple(points)


def _point(design: GroundDesign, share: float, method: GroundSearch) -> FrontPoint:
    checks.positive("most", share)
    space = replace(design.space, mass_ratio=(design.space.mass_ratio[0], share))
    objective = GroundObjective(
        design.block, design.conditions, design.limits, design.allowed, design.gravity
    )
    search = Searcher(objective, design.demand, design.risk, space, method, design.seed)
    # A smaller search than that of the design: neighbours on the front are alike.
    search.run()
    best = search.best()
    if best is None or search.found is None:
        return FrontPoint(share, None, (np.nan, np.nan), None)
    # Medians of the search's own motions: the front compares masses, and claims nothing.
    group = Group("tuned to", Role.tuned, design.conditions.motions)
    scales = tuple(np.unique(design.conditions.scales))
    found = search.found.designs[best]
    judged = judge(objective, found, group, scales, scatter=design.scatter, seed=design.seed)
    medians = judged.fits[0].median, judged.fits[1].median
    return FrontPoint(share, found, medians, judged.difference, judged.undecided)
