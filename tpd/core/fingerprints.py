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


@lru_cache(maxsize=1)
def of_environment() -> str:
    """Fingerprint of the source of this package and of the versions that results depend on."""
    return fingerprint(of_sources(), files.versions())


def _kind(value: Any) -> str:
    """Type of a value by its full name."""
    return f"{type(value).__module__}.{type(value).__qualname__}"


def _add(digest: Any, value: Any) -> None:
    """Add a value, with its type and its length, so that no two values run into one another."""
    if isinstance(value, enum.Enum):
        digest.update(f"{_kind(value)}.{value.name};".encode())
    elif isinstance(value, _PLAIN):
        digest.update(f"{type(value).__name__}:{value!r};".encode())
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(f"{_kind(value)}(".encode())
        _add(digest, {f.name: getattr(value, f.name) for f in fields(value)})
    elif isinstance(value, Mapping):
        digest.update(b"mapping;")
        _add(digest, sorted(value.items()))
    elif isinstance(value, (list, tuple)):
        # A named tuple is more than its values.
        name = _kind(value) if hasattr(value, "_fields") else ""
        digest.update(f"{name}[{len(value)};".encode())
        for part in value:
            _add(digest, part)
    elif hasattr(value, "__array__"):
        array = np.asarray(value)
        digest.update(f"{array.dtype.str}{array.shape};".encode() + array.tobytes())
    else:
        raise TypeError(f"no fingerprint of a {type(value).__name__}")
