"""Seeded samples that are spread evenly, and the description of what is uncertain."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tpd.core import checks

MOST_SCATTER = 0.5
"""Largest relative half width of an uncertain number."""


def latin_hypercube(
    rng: np.random.Generator, size: int, dimensions: int, *, axis_by_axis: bool = False
) -> np.ndarray:
    """Points in the unit cube, shape (size, dimensions): along every axis one in each of `size` strata.

    With `axis_by_axis` the generator gives strata and places of one axis before those of the next, so that
    the first axes do not depend on the number of axes. Without it, all strata come before all places.
    """
    # Both orders stay: stored results depend on the points that a seed gives.
    if axis_by_axis:
        axes = [rng.permutation(size) + rng.random(size) for _ in range(dimensions)]
        return np.stack(axes, axis=1) / size
    strata = np.stack([rng.permutation(size) for _ in range(dimensions)], axis=1)
    return (strata + rng.random((size, dimensions))) / size


def check_half_widths(half_widths: Mapping[str, float]) -> None:
    """Raise `ValueError` unless every relative half width is between 0 and 0.5."""
    for name, width in half_widths.items():
        checks.within(name, width, 0.0, MOST_SCATTER)


def factors(unit: np.ndarray, half_widths: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Factors on uncertain numbers, each uniform between 1 - w and 1 + w, by name.

    Args:
        unit: places in the unit cube, shape (size, len(half_widths)), one column for each name in order.
        half_widths: w of every uncertain number, by name.
    """
    return {n: 1.0 + w * (2.0 * unit[:, i] - 1.0) for i, (n, w) in enumerate(half_widths.items())}
