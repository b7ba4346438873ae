"""Workers of a cluster: they are prepared for a batch, and compute its chunks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from distributed import WorkerPlugin

from tpd.core.fingerprints import of_sources

_shared: dict[str, tuple[Any, ...]] = {}
"""Arguments that all chunks of a batch share, by batch."""


class Prepared(WorkerPlugin):
    """Preparation of every worker for a batch, also of one that joins later."""

    def __init__(self, key: str, version: str, shared: tuple[Any, ...]) -> None:
        """`version` is that of the caller's sources."""
        self.key, self.version, self.shared = key, version, shared

    def setup(self, worker: Any) -> None:
        """Prepare a worker; Dask calls this.

        Raises:
            RuntimeError: the worker has other sources: its results would not be those of the caller.
        """
        from tpd.core import process

        process.use_64_bits()
        if of_sources() != self.version:
            raise RuntimeError("the workers of the cluster have another version of tpd: install the same one")
        _shared[self.key] = self.shared

    def teardown(self, worker: Any) -> None:
        """Drop what the chunks share."""
        _shared.pop(self.key, None)


def compute(
    key: str, task: Callable[..., dict[str, np.ndarray]], part: Any, number: int
) -> tuple[int, dict[str, np.ndarray]]:
    """Compute the chunk of a number."""
    found = task(part, *_shared[key])
    return number, {name: np.asarray(values) for name, values in found.items()}
