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

from tpd.core import files


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
    root = Path(__file__).parents[1]
    return fingerprint([(p.relative_to(root).as_posix(), p.read_bytes()) for p in sorted(root.rglob("*.py"))])


@lru_cache(maxsize=1)
def of_environment() -> str:
    """Fingerprint of the source of this package and of the versions that results depend on."""
    return fingerprint(of_sources(), files.versions())


def _add(digest: Any, value: Any) -> None:
    """Add a value, with its type and its length, so that no two values run into one another."""
    kind, own, parts = f"{type(value).__module__}.{type(value).__qualname__}", b"", []
    if isinstance(value, enum.Enum):
        own = value.name.encode()
    elif isinstance(value, (str, bytes, bool, int, float, type(None), np.generic)):
        own = repr(value).encode()
    elif is_dataclass(value) and not isinstance(value, type):
        parts = [(f.name, getattr(value, f.name)) for f in fields(value)]
    elif isinstance(value, Mapping):
        parts = sorted(value.items())
    elif isinstance(value, (list, tuple)):
        parts = value
    elif hasattr(value, "__array__"):
        array = np.asarray(value)
        kind, own = f"{array.dtype.str}{array.shape}", array.tobytes()
    else:
        raise TypeError(f"no fingerprint of a {type(value).__name__}")
    digest.update(f"{kind} {len(own)} {len(parts)};".encode() + own)
    for part in parts:
        _add(digest, part)
