"""Tasks for tests of clusters, in a module that workers import."""

import time

import numpy as np

STEP = 0.05
"""Seconds of a chunk."""


def batch(size):
    """A batch of so many elements."""
    return {"x": np.arange(size, dtype=float), "y": np.linspace(0.0, 1.0, size), "z": 3.0}


def slowly_squared(part, seconds):
    """Squares, and a vector for each element, after a while."""
    if seconds is None:
        raise ZeroDivisionError
    time.sleep(seconds)
    x, y = part["x"], part["y"]
    return {"square": x**2 * part["z"], "pair": np.stack([np.sqrt(x), y], axis=1), "even": x % 2 == 0}
