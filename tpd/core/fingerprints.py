"""Fingerprints of inputs: two are equal only if the inputs are."""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

_PLAIN = (str, bytes, bool, int, float, type(None), np.generic)


def fingerprint(*values: Any) -> str:
    """Hexadecimal SHA-256 of values: numbers, text, arrays, dataclasses, and containers of these.

    Raises:
        TypeError: an object of any other kind, which no words tell from another one.
    """
    digest = hashlib.sha256()
    _add(digest, values)
    return digest.hexdigest()


@lru_cache(maxsize=1)
def of_sources() -> str:
    """Fingerprint of the source of this package: another version may compute other digits."""
    root, digest = Path(__file__).parents[1], hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _add(digest: Any, value: Any) -> None:
    """Add a value, with its type and its length, so that no two values run into one another."""
    if isinstance(value, enum.Enum):
        digest.update(f"{type(value).__name__}.{value.name};".encode())
    elif isinstance(value, _PLAIN):
        digest.update(f"{type(value).__name__}:{value!r};".encode())
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(f"{type(value).__qualname__}(".encode())
        _add(digest, {f.name: getattr(value, f.name) for f in fields(value)})
    elif isinstance(value, Mapping):
        _add(digest, sorted(value.items()))
    elif isinstance(value, (list, tuple)):
        digest.update(f"[{len(value)};".encode())
        for part in value:
            _add(digest, part)
    elif hasattr(value, "__array__"):
        array = np.ascontiguousarray(value)
        digest.update(f"{array.dtype.str}{array.shape};".encode() + array.tobytes())
    else:
        raise TypeError(f"no fingerprint of a {type(value).__name__}")
