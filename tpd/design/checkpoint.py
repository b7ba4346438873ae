"""Searches that have ended, kept in a file so that an interrupted run goes on where it was."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import files
from tpd.design.sequential import Descent, Local


class Kept:
    """Descents by the number of their group, in a file if there is one."""

    def __init__(self, path: Path | None, fingerprint: str, held: dict[str, np.ndarray]) -> None:
        self.path, self.fingerprint, self.held = path, fingerprint, held

    @staticmethod
    def of(path: Path | None, problem: Any) -> Kept:
        """What `path` holds of a problem, nothing if there is no such file.

        Raises:
            ValueError: the file is of another problem, or cannot be read.
        """
        # What an older version kept is of another make.
        fingerprint = hashlib.sha256(_plain((problem, Descent._fields, Local._fields)).encode()).hexdigest()
        if path is None or not path.exists():
            return Kept(path, fingerprint, {})
        try:
            with np.load(path, allow_pickle=False) as file:
                held = {name: file[name] for name in file.files}
        except (OSError, ValueError, zipfile.BadZipFile, EOFError):
            raise ValueError(f"cannot read {path}: it holds no finished searches") from None
        if str(held.pop("problem", "")) != fingerprint:
            raise ValueError(
                f"{path} holds searches of another problem, or of another version of tpd: delete it, or take "
                "the inputs it was made with"
            )
        return Kept(path, fingerprint, held)

    def get(self, group: int) -> Descent | None:
        """A group's descents, if it has ended."""
        values = {n.split("/")[1]: v for n, v in self.held.items() if n.split("/")[0] == str(group)}
        if not values:
            return None
        local = Local(*(values[f"local_{name}"] for name in Local._fields))
        rest = {n: values[n] for n in Descent._fields if n not in ("local", "weights")}
        weights = values["weights_0"], values["weights_1"]
        return Descent(local=local, weights=weights, **rest)

    def put(self, group: int, descent: Descent) -> None:
        """Keep a group's descents; what is in the file stays whole whatever happens."""
        if self.path is None:
            return
        values: dict[str, Any] = {f"local_{n}": v for n, v in descent.local._asdict().items()}
        values |= {f"weights_{i}": v for i, v in enumerate(descent.weights)}
        values |= {n: v for n, v in descent._asdict().items() if n not in ("local", "weights")}
        self.held |= {f"{group}/{name}": np.asarray(value) for name, value in values.items()}
        content = io.BytesIO()
        whole: dict[str, Any] = {"problem": np.array(self.fingerprint), **self.held}
        np.savez_compressed(content, **whole)
        files.place(self.path, content.getvalue())


def _plain(value: Any) -> str:
    """A text that two problems share only if they are the same."""
    if is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}{_plain(asdict(value))}"
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{k}:{_plain(value[k])}" for k in sorted(value)) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ",".join(map(_plain, value)) + "]"
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    return repr(value)
