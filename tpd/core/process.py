"""Settings of a process that belongs to this package: a command, or a worker of a cluster.

The library changes no setting of anybody else's process.
"""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path


def use_64_bits() -> Path | None:
    """Set JAX up; call this before JAX computes anything.

    Compiled programs are kept for later runs, in the user's cache or where `JAX_COMPILATION_CACHE_DIR` says.

    Returns:
        The folder in which they are kept; None where no folder can be written to.
    """
    if "equinox" not in sys.modules:
        # diffrax looks for times out of order. With this setting such a time is NaN; otherwise the program
        # calls back to Python to raise an exception, and JAX keeps no program that calls back.
        os.environ.setdefault("EQX_ON_ERROR", "nan")
    import jax

    jax.config.update("jax_enable_x64", True)
    if jax.config.jax_compilation_cache_dir is None:  # type: ignore[attr-defined]
        # A cache of the user, never one that is shared: compiled programs are executed as they are found.
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tpd" / "compiled"
        with contextlib.suppress(OSError):
            cache.mkdir(parents=True, exist_ok=True)
            jax.config.update("jax_compilation_cache_dir", str(cache))
            jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)
    from tpd.core import programs

    cache_dir = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    if cache_dir is None:
        # No folder can be written to: what is compiled serves this process alone.
        return None
    folder = Path(cache_dir) / "programs"
    with contextlib.suppress(OSError):
        programs.keep_in(folder)
        return folder
    return None
