"""Settings of a process that belongs to this package: a command, or a worker of a cluster.

The library never changes settings of a user's own process.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from tpd.core import files


def use_64_bits() -> Path | None:
    """Configure JAX for 64 bits and for a cache of compiled programs. Call this before JAX computes anything.

    The cache is in the user's cache folder, or in the folder that `JAX_COMPILATION_CACHE_DIR` names.

    Raises:
        ValueError: see `cpu`.

    Returns:
        The folder of the cache; None if there is no folder that only the user can write to.
    """
    if "equinox" not in sys.modules:
        # diffrax checks that times are in order. With this setting a time out of order becomes NaN. Otherwise
        # the program would call Python to raise an exception, and JAX does not cache programs that call
        # Python.
        os.environ.setdefault("EQX_ON_ERROR", "nan")
    import jax

    jax.config.update("jax_enable_x64", True)
    # Without this setting JAX finds the devices, always with the CPU, and need not do so yet.
    if jax.config.jax_platforms:  # type: ignore[attr-defined]
        cpu()
    folder = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    # The folder must not be shared, because compiled programs are executed without a check. A user without a
    # home directory has no cache: a path that still begins with ~ is not absolute.
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    cache = Path(caches, "tpd", "compiled") if folder is None else Path(folder).absolute()
    try:
        files.check_own(cache)
    except OSError as error:
        files.say_unkept(error)
        # Without this setting JAX would warn about every program that it cannot store.
        jax.config.update("jax_compilation_cache_dir", None)
        return None
    if folder is None:
        jax.config.update("jax_compilation_cache_dir", str(cache))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    _remove_damaged(cache)
    return cache


def cpu() -> Any:
    """Return the device of JAX on which the compiled code of this package runs.

    Raises:
        ValueError: the platforms that the user chose do not include the CPU, or this machine lacks one.
    """
    import jax

    try:
        return jax.local_devices(backend="cpu")[0]
    # JAX does not explain itself if the only platform is cuda and there is no such device.
    except (RuntimeError, AssertionError):
        chosen = jax.config.jax_platforms  # type: ignore[attr-defined]
        allowed = "must name devices of this machine and include cpu, such as cuda,cpu on one with a GPU"
        raise ValueError(f"`JAX_PLATFORMS` {allowed}, but is {chosen!r}: change or unset it") from None


def _remove_damaged(cache: Path) -> None:
    """Remove compiled programs that JAX cannot read.

    JAX would warn about them at every start and never replace them. Programs that were checked at an earlier
    start are not read again.
    """
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
    """Return whether a file of the cache of JAX, compressed by zstd or zlib, can be decompressed."""
    try:
        zstd = "compression.zstd" if sys.version_info >= (3, 14) else "zstandard"
        is_zstd = content.startswith(b"\x28\xb5\x2f\xfd")
        import_module(zstd if is_zstd else "zlib").decompress(content)
    except ImportError:
        return True
    except Exception:
        return False
    return True
