"""Workers of a cluster: they are prepared for a batch, and compute its chunks."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable
from typing import Any

import numpy as np
from distributed import WorkerPlugin

from tpd.cluster.cluster import ClusterError
from tpd.core.fingerprints import of_environment

_shared: dict[str, tuple[Any, ...]] = {}
"""Arguments that all chunks of a batch share, by batch."""


class Prepared(WorkerPlugin):
    """Preparation of every worker for a batch, also of one that joins later."""

    def __init__(self, key: str, version: str, shared: tuple[Any, ...], *, local: bool) -> None:
        """`version` is the fingerprint of the caller's environment; `local` processes are the caller's."""
        self.key, self.version, self.shared, self.local = key, version, shared, local

    def setup(self, worker: Any) -> None:
        """Prepare a worker; Dask calls this.

        Raises:
            ClusterError: the worker has another version: its results would not be those of the caller.
        """
        from tpd.core import process

        if self.local:
            # A terminal sends Ctrl-C to all its processes; the caller answers it and ends these.
            with contextlib.suppress(ValueError):
                signal.signal(signal.SIGINT, signal.SIG_IGN)
        process.use_64_bits()
        _check(self.version)
        _shared[self.key] = self.shared

    def teardown(self, worker: Any) -> None:
        """Drop what the chunks share."""
        _shared.pop(self.key, None)


def compute(
    key: str, version: str, task: Callable[..., dict[str, np.ndarray]], part: Any, number: int
) -> tuple[int, dict[str, np.ndarray]]:
    """Compute the chunk of a number.

    Raises:
        ClusterError: the worker has another version.
    """
    # Dask only logs that a worker which joined late could not be prepared, and gives it chunks all the same.
    _check(version)
    found = task(part, *_shared[key])
    return number, {name: np.asarray(values) for name, values in found.items()}


def _check(version: str) -> None:
    """Raise `ClusterError` where this process is not of a version."""
    if of_environment() != version:
        raise ClusterError(
            "a worker of the cluster has another version of Python, tpd or its packages: install the same"
        )
