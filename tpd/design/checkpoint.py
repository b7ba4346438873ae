"""Checkpoint: searches that have ended, in a file, so that an interrupted run goes on where it was."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np

from tpd.core import files

_ARRAYS = b"PK\3\4"
"""How a file of NumPy's begins: an earlier version stored one without a checksum."""

Same = TypeVar("Same")
"""Type of what is stored."""


class Checkpoint:
    """Ends of searches, or designs that were followed, by their number; in a file if there is one."""

    def __init__(self, path: Path | None, fingerprint: str, stored: dict[str, np.ndarray]) -> None:
        self.path, self.fingerprint, self.stored = path, fingerprint, stored

    @staticmethod
    def of(path: Path | None, fingerprint: str) -> Checkpoint:
        """Checkpoint of the problem with a fingerprint in the file `path`; empty if there is no such file.

        A file that is damaged, or no checkpoint, gets another name, and all its searches are done again.

        Raises:
            ValueError: the file is of another problem, or cannot be read.
        """
        if path is None or not path.exists():
            return Checkpoint(path, fingerprint, {})
        try:
            content = path.read_bytes()
            data = files.unsealed(content)
            if data is None and not content.startswith(_ARRAYS):
                files.put_aside(path, "finished searches", "done")
                return Checkpoint(path, fingerprint, {})
        except OSError as error:
            raise ValueError(f"cannot read {path}: {error.strerror or error}") from None
        stored: dict[str, np.ndarray] = {}
        if data is not None:
            with np.load(io.BytesIO(data), allow_pickle=False) as file:
                stored = {name: file[name] for name in file.files}
        # Ends of another problem look like ends of this one; only the fingerprint tells them apart.
        if str(stored.pop("problem", "")) != fingerprint:
            raise ValueError(
                f"{path} holds searches of another problem, or of another version of tpd: delete it, or take "
                "the inputs it was made with"
            )
        return Checkpoint(path, fingerprint, stored)

    def get(self, i: int, like: Same) -> Same | None:
        """Values stored under the number i, in the form of `like`, whose numbers do not matter; or None."""
        leaves, form = jax.tree.flatten(like)
        found = [self.stored.get(f"{i}/{k}") for k in range(len(leaves))]
        return None if any(x is None for x in found) else jax.tree.unflatten(form, found)

    def put(self, i: int, value: Any) -> None:
        """Store named tuples of arrays under the number i; the file is complete at any moment."""
        if self.path is None:
            return
        self.stored |= {f"{i}/{k}": np.asarray(x) for k, x in enumerate(jax.tree.leaves(value))}
        # Made in memory and placed as a whole: a crash leaves the former file.
        content = io.BytesIO()
        whole: dict[str, Any] = {"problem": np.array(self.fingerprint), **self.stored}
        np.savez_compressed(content, **whole)
        files.place(self.path, files.sealed(content.getvalue()))
