"""Limits during ground motions, each of which an allowed share of the standing runs may break."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tpd.core import checks
from tpd.design.criteria import KINDS, THICKNESS, Geometry, Limit, Size, check_limits
from tpd.design.ground.runs import Runs
from tpd.design.objective import blank


def check_ground_limits(limits: tuple[Limit, ...]) -> tuple[Limit, ...]:
    """The limits in the order of a report.

    Raises:
        ValueError: a limit of settled motions, or none at all.
    """
    listed = check_limits(limits)
    for limit in listed:
        if not limit.of_motion:
            names = ", ".join(kind.__name__ for kind in KINDS if kind.of_motion)
            raise ValueError(f"`limits` of ground motions must be of {names}, but has {checks.shown(limit)}")
    return listed


def quantile_sizes(
    runs: Runs, designs: np.ndarray, limits: tuple[Limit, ...], g: Geometry, allowed: float
) -> tuple[tuple[str, ...], np.ndarray]:
    """Limited quantities over their limits, shape (m, sizes), each exceeded in the share `allowed` of the
    runs in which the block stands; see `GroundObjective.sizes`."""
    found = list(_sizes(runs, designs, limits, g))
    columns = [[_quantile(v[np.isfinite(v)], allowed) for v in size.value] for size in found]
    shape = len(found), len(designs)
    return tuple(size.name for size in found), np.array(columns, dtype=float).reshape(shape).T


def broken_share(runs: Runs, designs: np.ndarray, limits: tuple[Limit, ...], g: Geometry) -> float:
    """Share of the runs of one design, in which the block is known to stand, whose motion breaks a limit."""
    stands = ~(runs.overturned | runs.undecided)[0]
    broken = np.zeros(len(stands), dtype=bool)
    for size in _sizes(runs, designs, limits, g):
        if size.name != THICKNESS:
            broken |= size.value[0] > 1.0
    return float(np.mean(broken[stands])) if stands.any() else 0.0


def _sizes(runs: Runs, designs: np.ndarray, limits: tuple[Limit, ...], g: Geometry) -> Iterator[Size]:
    """Limited quantities over their limits, (m, n); infinite where the block overturns, NaN where nothing
    is known."""
    m, n = runs.tilt.shape
    e = blank(m, n)._replace(tilt=runs.tilt, stroke=runs.swing, relative=runs.relative, design=designs)
    for size in (size for limit in limits for size in limit.sizes(e, g)):
        # Sizes of runs that overturn must not enter a quantile of those that stand.
        fell = runs.overturned & (size.name != THICKNESS)
        yield size._replace(value=np.where(fell, np.inf, size.value))


def _quantile(values: np.ndarray, allowed: float) -> float:
    """Value that the allowed share of the runs exceed; 0 where the block stands in no run."""
    return float(np.quantile(values, 1.0 - allowed, method="higher")) if len(values) else 0.0
