"""Settings of a process that belongs to this package: a command, or a worker of a cluster.

The library changes no setting of anybody else's process.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import json
import os
import sys
import time
import zlib
from functools import lru_cache
from pathlib import Path

from tpd.core import files

_YOUNG = 60.0
"""Seconds in which a file may still be written by another process."""


def use_64_bits() -> Path | None:
    """Set JAX up; call this before JAX computes anything.

    Compiled programs are kept for later runs, in the user's cache or where `JAX_COMPILATION_CACHE_DIR` says.

    Returns:
        The folder in which they are kept; None where there is none that is the user's alone.
    """
    if "equinox" not in sys.modules:
        # diffrax looks for times out of order. With this setting such a time is NaN; otherwise the program
        # calls back to Python to raise an exception, and JAX keeps no program that calls back.
        os.environ.setdefault("EQX_ON_ERROR", "nan")
    import jax

    jax.config.update("jax_enable_x64", True)
    given = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    # Never a folder that is shared: compiled programs are executed as they are found. A user without a home
    # has none: what begins with ~ stands for no folder.
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    cache = Path(caches, "tpd", "compiled") if given is None else Path(given).absolute()
    try:
        files.check_own(cache)
    except OSError as error:
        files.say_unkept(error)
        # JAX would say of each program that it cannot be stored.
        jax.config.update("jax_compilation_cache_dir", None)
        return None
    if given is None:
        jax.config.update("jax_compilation_cache_dir", str(cache))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    _make_sure(cache)
    return cache


@lru_cache
def _make_sure(cache: Path) -> None:
    """Remove what is damaged of JAX's cache, now, and seal at the end what this process adds."""
    _keep_whole(cache)
    atexit.register(_keep_whole, cache)


def _keep_whole(cache: Path) -> None:
    """Remove the files of JAX's cache that are not as they were written, and note checksums of all others.

    JAX executes what it finds. Of a file that it cannot read it says so at every start, and never writes it
    anew.
    """
    notes, checksums = cache / "checksums", {}
    noted: dict[str, str] | None = {}
    try:
        noted = json.loads(files.unsealed(notes.read_bytes()) or "null")
    except FileNotFoundError:
        pass
    except OSError:
        noted = None
    damaged = noted is None
    for path in cache.glob("*-cache"):
        with contextlib.suppress(OSError):
            content = path.read_bytes()
            checksum = hashlib.sha256(content).hexdigest()
            if not files.belongs(path):
                # What others have written before they lost the right to is not executed.
                sound = False
            elif noted and path.name in noted:
                sound = noted[path.name] == checksum
            else:
                # Of a process that was killed, or not of this package; or it is being written just now.
                sound = _unpacks(content)
                if not sound and noted is not None and abs(time.time() - path.stat().st_mtime) < _YOUNG:
                    continue
            if sound:
                checksums[path.name] = checksum
            else:
                path.unlink()
                damaged = True
    if checksums != noted:
        with contextlib.suppress(OSError):
            files.place(notes, files.sealed(files.as_json(checksums).encode()))
    if damaged:
        files.say_damaged("programs", cache, "compiled")


def _unpacks(content: bytes) -> bool:
    """Whether a file of JAX's cache is whole, as far as its compression tells."""
    if content.strip(b"\0") and not content.startswith(b"\x78"):
        # Not zlib's: of another compression nothing is known.
        return True
    with contextlib.suppress(zlib.error):
        zlib.decompress(content)
        return True
    return False
