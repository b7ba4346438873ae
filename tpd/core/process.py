"""Settings of a process that belongs to this package: a command, or a worker of a cluster.

The library changes no setting of anybody else's process.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
import zlib
from importlib import import_module
from pathlib import Path

from tpd.core import files


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
    _remove_damaged(cache)
    return cache


def _remove_damaged(cache: Path) -> None:
    """Remove compiled programs that JAX cannot read: it would warn of them at every start, and never replace
    them. Programs that were in order at an earlier start are not read again."""
    checked, damaged = cache / "checked", False
    since = checked.stat().st_mtime if checked.exists() else -math.inf
    with contextlib.suppress(OSError):
        checked.touch()
    for path in cache.glob("*-cache"):
        with contextlib.suppress(OSError):
            if path.stat().st_mtime >= since and not _is_whole(path.read_bytes()):
                path.unlink()
                damaged = True
    if damaged:
        files.say_damaged("programs", cache, "compiled")


def _is_whole(content: bytes) -> bool:
    """Return whether a file of JAX's cache, which is compressed by zstd or zlib, can be decompressed."""
    try:
        if content.startswith(b"\x28\xb5\x2f\xfd"):
            import_module("compression.zstd" if sys.version_info >= (3, 14) else "zstandard").decompress(
                content
            )
        else:
            zlib.decompress(content)
    except ImportError:
        return True
    except Exception:
        return False
    return True
