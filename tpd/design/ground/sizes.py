"""Limits during ground motions, each of which an allowed share of the standing runs may break."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tpd.core import checks
from tpd.core.bob import THICKEST
from tpd.design.criteria import (
    Geometry,
    Limit,
    Mass,
    Offset,
    RelativeStroke,
    Room,
    Stroke,
    Tilt,
    check_limits,
)
from tpd.design.ground.runs import Runs

KINDS = (Stroke, RelativeStroke, Tilt, Mass, Offset, Room)
"""Limits that ground motions can be asked for; the others are of settled motions."""
THICKNESS = "thickness"
"""Name of a size that no motion changes."""


def check_ground_limits(limits: tuple[Limit, ...]) -> tuple[Limit, ...]:
    """The limits in the order of a report.

    Raises:
        ValueError: a limit of settled motions, or none at all.
    """
    listed = check_limits(limits)
    for limit in listed:
        if not isinstance(limit, KINDS):
            names = ", ".join(kind.__name__ for kind in KINDS)
            raise ValueError(f"`limits` of ground motions must be of {names}, but has {checks.shown(limit)}")
    return listed


def quantile_sizes(
    runs: Runs, designs: np.ndarray, limits: tuple[Limit, ...], g: Geometry, allowed: float
) -> tuple[tuple[str, ...], np.ndarray]:
    """Limited quantities over their limits, shape (m, sizes), each exceeded in the share `allowed` of the
    runs in which the block stands; see `GroundObjective.sizes`."""
    names, columns = [], []
    for limit in limits:
        for name, values in _sizes(limit, runs, designs, g):
            names.append(name)
            columns.append([_quantile(v[np.isfinite(v)], allowed) for v in values])
    return tuple(names), np.array(columns, dtype=float).reshape(len(names), len(designs)).T


def broken_share(runs: Runs, designs: np.ndarray, limits: tuple[Limit, ...], g: Geometry) -> float:
    """Share of the runs of one design, in which the block is known to stand, whose motion breaks a limit."""
    stands = ~(runs.overturned | runs.undecided)[0]
    broken = np.zeros(len(stands), dtype=bool)
    for limit in limits:
        for name, values in _sizes(limit, runs, designs, g):
            if name != THICKNESS:
                broken |= values[0] > 1.0
    return float(np.mean(broken[stands])) if stands.any() else 0.0


def _sizes(limit: Limit, runs: Runs, designs: np.ndarray, g: Geometry) -> Iterator[tuple[str, np.ndarray]]:
    """Names and values (m, n) of what a limit bounds, over the limit; infinite where the block overturns, NaN
    where nothing is known."""
    rod, mass = g.rod(designs), g.mass(designs)
    # A bob beyond a right angle has passed there on its way.
    angle = np.minimum(runs.relative, 0.5 * np.pi)
    # Sizes of runs that overturn must not enter a quantile of those that stand.
    fell = np.where(runs.overturned, np.inf, 0.0)
    match limit:
        case Stroke():
            yield limit.name, runs.swing / limit.angle
        case RelativeStroke():
            yield limit.name, runs.relative / limit.angle
        case Tilt():
            yield limit.name, runs.tilt / limit.share
        case Offset():
            yield limit.name, rod * np.sin(angle) / limit.distance + fell
        case Room():
            yield limit.name, limit.bob.reach(mass, rod, angle) / g.wall[None, :] + fell
            # The body's own size does not depend on the motion.
            yield THICKNESS, limit.bob.half_height(mass) / (THICKEST * rod)


def _quantile(values: np.ndarray, allowed: float) -> float:
    """Value that the allowed share of the runs exceed; 0 where the block stands in no run."""
    return float(np.quantile(values, 1.0 - allowed, method="higher")) if len(values) else 0.0
