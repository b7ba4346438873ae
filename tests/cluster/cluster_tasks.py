"""Tasks for tests of clusters, in a module that workers import; as a command, a sweep to be killed."""

import sys
import time

import numpy as np

from tpd.cluster.cluster import Cluster

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


if __name__ == "__main__":
    with Cluster(sys.argv[1], workers=2) as cluster:
        cluster.map(
            "squares",
            # By the name that other processes know it by.
            __import__("tests.cluster.cluster_tasks", fromlist=["x"]).slowly_squared,
            batch(4000),
            (STEP,),
            chunk=128,
            progress=lambda done, _: print(done, flush=True),
        )
