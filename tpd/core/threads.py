"""Threads that compute as the one that begins them: what a context manager of JAX sets holds in its own
thread alone, and 32-bit floats elsewhere would be wrong numbers without a word."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import jax


def cores(count: int) -> ThreadPoolExecutor:
    """So many threads to share work among."""
    return ThreadPoolExecutor(count, initializer=_alike())


def aside(work: Callable[[], object]) -> threading.Thread:
    """Do something that has to be compiled while the other core is busy; what fails, fails again later.
    The interpreter waits for it before it ends: a thread that is stopped while it compiles aborts all."""
    begin = _alike()

    def run() -> None:
        begin()
        with contextlib.suppress(Exception):
            work()

    thread = threading.Thread(target=run)
    thread.start()
    return thread


def _alike() -> Callable[[], None]:
    """What another thread has to do first to have this one's floats, until it ends."""
    wide = bool(jax.config.jax_enable_x64)  # type: ignore[attr-defined]

    def begin() -> None:
        if bool(jax.config.jax_enable_x64) != wide:  # type: ignore[attr-defined]
            jax.enable_x64(wide).__enter__()

    return begin
