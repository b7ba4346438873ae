"""Numba's store of machine code: what is there is loaded only as it was written.

Numba unpickles and executes what it finds. A file that a loss of power has cut or emptied would stop every
later process, and one with other bits would end it. So the files of a function have a checksum beside them.

Numba takes 0.3 s to load: no module imports this one before it is needed.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba.core import caching, config

from tpd.core import files

_STORED = (".nbi", ".nbc")
"""Ends of the names of Numba's files: an index, and the machine code."""


@contextlib.contextmanager
def whole(function: Callable[..., Any]) -> Iterator[None]:
    """Remove damaged machine code of a function before it is loaded, and seal what is stored at the end.

    Of several processes that ask for the same function at once, one compiles it. What belongs to another
    user is removed as well: it would be executed.

    Raises:
        RuntimeError: there is no folder that can be written to.
        OSError: what is damaged cannot be removed.
    """
    folder, stem = _place(function)
    seal = folder / f"{stem}.sum"
    for path in _stored(folder, stem, *_STORED, seal.suffix):
        if not files.belongs(path):
            path.unlink()
    was_sealed = seal.exists()
    with files.held(seal) as file:
        file.seek(0)
        checksum = file.read()
        if (found := _stored(folder, stem, *_STORED)) and _checksum(found) != checksum:
            for path in found:
                path.unlink()
            # Without a seal it is of an earlier version, or of a process that was killed.
            if was_sealed:
                files.say_damaged("files of machine code", folder, "compiled")
        yield
        if (found := _stored(folder, stem, *_STORED)) and (now := _checksum(found)) not in (None, checksum):
            file.truncate(0)
            file.write(now)


def _place(function: Callable[..., Any]) -> tuple[Path, str]:
    """Folder in which Numba stores a function, and how the names of its files begin."""
    beside = caching.InTreeCacheLocator.from_function(function, function.__code__.co_filename)
    chosen = config.CACHE_DIR  # type: ignore[attr-defined]
    if not chosen and beside is None and not _has_home():
        # Numba would make a folder with the name ~ where the command is given.
        raise RuntimeError("no folder can be written to")
    cache = caching.FunctionCache(function)
    return Path(cache.cache_path), cache._impl.filename_base


def _has_home() -> bool:
    return "XDG_CACHE_HOME" in os.environ or not os.path.expanduser("~").startswith("~")


def _stored(folder: Path, stem: str, *ends: str) -> list[Path]:
    return sorted(p for p in folder.iterdir() if p.name.startswith(f"{stem}.") and p.suffix in ends)


def _checksum(paths: list[Path]) -> bytes | None:
    """Checksum of files with their names; None where one of them cannot be read."""
    digest = hashlib.sha256()
    for path in paths:
        try:
            data = path.read_bytes()
        except OSError:
            return None
        digest.update(f"{path.name}\0{len(data)}\0".encode() + data)
    return digest.hexdigest().encode()
