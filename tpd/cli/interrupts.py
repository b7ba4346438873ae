"""Signs of life of a command: a first line at once, and an answer to Ctrl-C even where the work cannot stop.

Nothing here imports JAX: importing it takes a second, and the first line does not wait for it.
"""

from __future__ import annotations

import _thread
import contextlib
import os
import select
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import tpd

INTERRUPTED = 130
"""Exit status after Ctrl-C."""
_RECEIVED = threading.Event()
_CLEAR = "\r\x1b[K"
"""Removes a bar from the last line of a terminal."""
_SOON = 0.25
"""Seconds after which a command says what it does; bad input is refused earlier where JAX is imported."""
_SHOW = warnings.showwarning
"""How Python shows the warnings of others."""
_SAID: set[str] = set()
"""Warnings that were said."""
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
    """Answer Ctrl-C from a process of its own while this one compiles, where Python cannot.

    The first one raises `KeyboardInterrupt` as usual, as soon as Python runs; if the command has not ended by
    then, a line says when it will. The second one ends the process.
    """
    if not hasattr(os, "fork"):
        yield
        return
    with contextlib.ExitStack() as stack:
        stack.callback(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, _interrupt))
        stack.callback(setattr, sys, "unraisablehook", sys.unraisablehook)
        sys.unraisablehook = _again
        heard, told = _guarded(stack)
        before = signal.set_wakeup_fd(told, warn_on_full_buffer=False)
        stack.callback(signal.set_wakeup_fd, before)
        threading.Thread(target=_end, args=(heard,), daemon=True).start()
        yield


def _guarded(stack: contextlib.ExitStack) -> tuple[int, int]:
    """Start a process that watches for Ctrl-C: an extension that holds the interpreter stops every thread.

    Return where it asks this process to end, and where C writes a byte for each signal.
    """
    (signals, told), (heard, ask) = os.pipe(), os.pipe()
    os.set_blocking(told, False)
    parent = os.getpid()
    # Nothing runs in another thread yet, and the child calls nothing but the system.
    if os.fork() == 0:
        os.close(told)
        os.close(heard)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        with contextlib.suppress(BaseException):
            _guard(signals, ask, parent)
        os._exit(0)
    os.close(signals)
    os.close(ask)
    stack.callback(os.close, told)
    return heard, told


def _guard(signals: int, ask: int, parent: int) -> None:
    """Say when the parent will end, and end it after a second Ctrl-C. Without a writer the pipe ends."""
    if not _next(signals, None):
        return
    answered = _next(signals, _PATIENCE)
    if answered is None:
        _write(f"tpd: interrupted: {_WHEN}")
        answered = _next(signals, None)
    if answered:
        _write("tpd: interrupted")
        os.write(ask, b"x")
        # Where no thread can run, the process cannot choose its exit status any more.
        if _next(signals, 2.0 * _PATIENCE) is None:
            os.kill(parent, signal.SIGKILL)


def _next(signals: int, seconds: float | None) -> bool | None:
    """True for a further Ctrl-C, False at the end of the pipe, None after so many seconds without either."""
    end = None if seconds is None else time.monotonic() + seconds
    while True:
        left = None if end is None else max(end - time.monotonic(), 0.0)
        if not select.select([signals], [], [], left)[0]:
            return None
        byte = os.read(signals, 1)
        if not byte or byte[0] == signal.SIGINT:
            return bool(byte)


def _write(text: str) -> None:
    os.write(2, f"{_CLEAR if os.isatty(2) else ''}{text}\n".encode())


def _end(heard: int) -> None:
    """End this process when it is asked to."""
    if os.read(heard, 1):
        os._exit(INTERRUPTED)


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
        # A moment later: raised in here it would be dropped once more, with a traceback.
        later = threading.Timer(0.01, _thread.interrupt_main)
        later.daemon = True
        later.start()
    else:
        sys.__unraisablehook__(lost)


def _say(text: str) -> None:
    # A terminal may show a bar in the last line; a pipe may be closed.
    with contextlib.suppress(OSError, ValueError):
        print((_CLEAR if sys.stderr.isatty() else "") + text, file=sys.stderr, flush=True)


def warned(message: Warning | str, category: type[Warning], *where: Any, **how: Any) -> None:
    """Say a warning of this package in one sentence, in place of `warnings.showwarning`."""
    if category is UserWarning:
        # Python says it again wherever a library has touched the filters of warnings.
        if str(message) not in _SAID:
            _SAID.add(str(message))
            _say(f"tpd: {message}")
    else:
        _SHOW(message, category, *where, **how)


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
