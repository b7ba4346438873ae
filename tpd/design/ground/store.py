"""Designs that have been followed, in a file, so that an interrupted search goes on where it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tpd.core import checks
from tpd.design.checkpoint import Checkpoint, save
from tpd.design.ground.search import Evaluated


class Store:
    """Followed designs by their number, in a file if there is one."""

    def __init__(self, path: Path | None, fingerprint: str, stored: dict[str, np.ndarray]) -> None:
        self.path, self.fingerprint, self.stored = path, fingerprint, stored

    @staticmethod
    def of(path: Path | str | None, fingerprint: str) -> Store:
        """Designs of the problem with a fingerprint in a file; none if there is no such file.

        Raises:
            ValueError: as `Checkpoint.of`.
        """
        if path is not None:
            checks.instance("checkpoint", path, (Path, str))
        there = Checkpoint.of(None if path is None else Path(path), fingerprint)
        return Store(there.path, fingerprint, dict(there.stored))

    def get(self, i: int) -> Evaluated | None:
        """The i-th design, or None."""
        found = [self.stored.get(f"{i}/{name}") for name in Evaluated._fields]
        return None if any(x is None for x in found) else Evaluated(*found)  # type: ignore[arg-type]

    def put(self, i: int, one: Evaluated) -> None:
        """Store the i-th design; the file is complete at any moment."""
        if self.path is None:
            return
        self.stored |= {f"{i}/{name}": np.asarray(value) for name, value in one._asdict().items()}
        save(self.path, self.fingerprint, self.stored)
