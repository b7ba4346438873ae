"""Worker threads with the x64 setting of the thread that starts them.

`jax.enable_x64(True)` as a context manager holds in its own thread only. Without the initialiser here, a
worker would compute in 32 bits and return wrong numbers without an error.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import jax


def cores(count: int) -> ThreadPoolExecutor:
    """Return an executor with `count` worker threads."""
    return ThreadPoolExecutor(count, initializer=_x64_initializer())


def aside(work: Callable[[], object]) -> threading.Thread:
    """Start `work` in a thread of its own, to compile something while the other core is busy.

    An error in it is dropped: the same work fails again, visibly, when its result is needed. The thread is no
    daemon, so the interpreter waits for it: one that is stopped while XLA compiles aborts the process.
    """
    begin = _x64_initializer()

    def run() -> None:
        begin()
        with contextlib.suppress(Exception):
            work()

    thread = threading.Thread(target=run)
    thread.start()
    return thread


def _x64_initializer() -> Callable[[], None]:
    """Initialiser that gives a worker thread this thread's x64 setting."""
    wide = bool(jax.config.jax_enable_x64)  # type: ignore[attr-defined]

    def begin() -> None:
        if bool(jax.config.jax_enable_x64) != wide:  # type: ignore[attr-defined]
            # Entered and never left: the setting ends with the thread.
            jax.enable_x64(wide).__enter__()

    return begin
