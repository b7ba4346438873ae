"""Checkpoint: searches that have ended, in a file, so that an interrupted run goes on where it was."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import files
from tpd.design.objective import BACK_OFF
from tpd.design.sequential import Ends
from tpd.design.subproblem import Linearisation

_ARRAYS = b"PK\3\4"
"""How a file of NumPy's begins: an earlier version stored one without a checksum."""


class Checkpoint:
    """Ends of searches by the number of their group, in a file if there is one."""

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

    def get(self, group: int) -> Ends | None:
        """Ends of a group of searches, or None."""
        values = {n.split("/")[1]: v for n, v in self.stored.items() if n.split("/")[0] == str(group)}
        if not values:
            return None
        local = Linearisation(*(values[f"local_{name}"] for name in Linearisation._fields))
        rest = {n: values[n] for n in Ends._fields if n not in ("local", "weights")}
        weights = values["weights_0"], values["weights_1"]
        return Ends(local=local, weights=weights, **rest)

    def put(self, group: int, ends: Ends) -> None:
        """Store the ends of a group; the file is complete at any moment."""
        if self.path is None:
            return
        values: dict[str, Any] = {f"local_{n}": v for n, v in ends.local._asdict().items()}
        values |= {f"weights_{i}": v for i, v in enumerate(ends.weights)}
        values |= {n: v for n, v in ends._asdict().items() if n not in ("local", "weights")}
        self.stored |= {f"{group}/{name}": np.asarray(value) for name, value in values.items()}
        save(self.path, self.fingerprint, self.stored)


def save(path: Path, fingerprint: str, stored: dict[str, np.ndarray]) -> None:
    """Write a file that `Checkpoint.of` reads."""
    # Made in memory and placed as a whole: a crash leaves the former file.
    content = io.BytesIO()
    whole: dict[str, Any] = {"problem": np.array(fingerprint), **stored}
    np.savez_compressed(content, **whole)
    files.place(path, files.sealed(content.getvalue()))


def fingerprint_of(problem: Any) -> str:
    """Fingerprint of everything on which the ends of searches depend."""
    # Fields and back-off are part of it: another version may have meant other searches.
    version = Ends._fields, Linearisation._fields, BACK_OFF
    return hashlib.sha256(_plain((problem, *version)).encode()).hexdigest()


def _plain(value: Any) -> str:
    """Text that two problems share only if they are equal."""
    if is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}{_plain(asdict(value))}"
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{k}:{_plain(value[k])}" for k in sorted(value)) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ",".join(map(_plain, value)) + "]"
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    return repr(value)
