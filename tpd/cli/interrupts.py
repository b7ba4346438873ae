"""Signs of life of a command: a first line at once, and an answer to Ctrl-C even where the work cannot stop.

Nothing here imports JAX: importing it takes a second, and the first line does not wait for it.
"""

from __future__ import annotations

import _thread
import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import tpd

INTERRUPTED = 130
"""Exit status after Ctrl-C."""
_RECEIVED = threading.Event()
_SOON = 0.25
"""Seconds after which a command says what it does; bad input is refused earlier where JAX is imported."""
_PATIENCE = 0.7
"""Seconds after Ctrl-C in which a command ends without a word about when it will."""
_WHEN = "ends when the step in progress ends: a compilation takes some seconds; Ctrl-C again ends it at once"


@contextlib.contextmanager
def announced(does: str | None) -> Iterator[None]:
    """Say on stderr what a command does, unless it ends before that."""
    if does is None:
        yield
        return
    timer = threading.Timer(_SOON, _say, (f"tpd {tpd.__version__}: {does}",))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextlib.contextmanager
def watched() -> Iterator[None]:
    """Answer Ctrl-C from a thread of its own while the main thread compiles, where Python cannot.

    The first one raises `KeyboardInterrupt` as usual, as soon as Python runs; if the command has not ended by
    then, a line says when it will. The second one ends the process.
    """
    with contextlib.ExitStack() as stack:
        stack.callback(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, _interrupt))
        stack.callback(setattr, sys, "unraisablehook", sys.unraisablehook)
        sys.unraisablehook = _again
        ours, theirs = (stack.enter_context(end) for end in socket.socketpair())
        theirs.setblocking(False)
        before = signal.set_wakeup_fd(theirs.fileno(), warn_on_full_buffer=False)
        stack.callback(signal.set_wakeup_fd, before)
        threading.Thread(target=_watch, args=(ours,), daemon=True).start()
        yield


def _interrupt(*_: Any) -> None:
    """Note the signal before it becomes an exception: an import or a compiler turns that into another one."""
    _RECEIVED.set()
    raise KeyboardInterrupt


def received() -> bool:
    """Return True after Ctrl-C, if it is watched."""
    return _RECEIVED.is_set()


def _again(lost: Any) -> None:
    """Raise the exception again that Python dropped in a destructor."""
    if lost.exc_type is KeyboardInterrupt:
        _thread.interrupt_main()
    else:
        sys.__unraisablehook__(lost)


def _watch(ours: socket.socket) -> None:
    """Read one byte for each signal, which C writes whatever Python does."""
    interruptions = 0
    with contextlib.suppress(OSError):
        while byte := ours.recv(1):
            if byte[0] != signal.SIGINT:
                continue
            interruptions += 1
            if interruptions > 1:
                _say("tpd: interrupted")
                os._exit(INTERRUPTED)
            timer = threading.Timer(_PATIENCE, _say, (f"tpd: interrupted: {_WHEN}",))
            timer.daemon = True
            timer.start()


def _say(text: str) -> None:
    # A terminal may show a bar in the last line; a pipe may be closed.
    with contextlib.suppress(OSError, ValueError):
        print(("\r\x1b[K" if sys.stderr.isatty() else "") + text, file=sys.stderr, flush=True)


def leave(directory: Path | None, existed: bool) -> None:
    """Remove an output directory that the command made and left empty."""
    if directory is None or existed:
        return
    with contextlib.suppress(OSError):
        for path in directory.glob(".tpd-part-*"):
            path.unlink(missing_ok=True)
        directory.rmdir()


def exit_now(status: int) -> Any:
    """End the process without a wait for threads that compile, whose work nobody needs."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)
