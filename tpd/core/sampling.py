"""Seeded samples, spread evenly."""

from __future__ import annotations

import numpy as np


def latin_hypercube(rng: np.random.Generator, size: int, dimensions: int) -> np.ndarray:
    """Points in the unit cube, shape (size, dimensions): along every axis one in each of `size` strata."""
    strata = np.stack([rng.permutation(size) for _ in range(dimensions)], axis=1)
    return (strata + rng.random((size, dimensions))) / size
