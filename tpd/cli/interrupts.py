"""Exit statuses and signs of life of a command: a first line at once, and an answer to Ctrl-C even where the
work cannot stop.

Nothing here imports JAX: importing it takes a second, and the first line does not wait for it.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import tpd
from tpd.core.progress import EVERY, TICK, is_silent, say

SOUND, BAD_INPUT, UNSOUND, INTERRUPTED = 0, 2, 3, 130
"""Exit statuses; the last one is that after Ctrl-C."""
UNFINISHED = "unfinished.npz"
"""Name of the file in which an interrupted search leaves what had ended."""
_RECEIVED, _RAISED = threading.Event(), threading.Event()
"""Whether Ctrl-C came, and whether it has become an exception."""
_SOON = 0.2
"""Seconds after which a command says what it does; bad input is refused earlier where JAX is imported."""
_SHOW = warnings.showwarning
"""How Python shows the warnings of others."""
_SAID: set[str] = set()
"""Warnings that were said."""
_PATIENCE = 1.5
"""Seconds after Ctrl-C in which a command may end of itself."""


class _Output(io.FileIO):
    """Standard output or error of a command. What cannot be written there is dropped: a reader that has gone
    does not end the work, whose files are still to be written."""

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            self.failure = error
            return memoryview(data).nbytes


@contextlib.contextmanager
def lasting_output() -> Iterator[None]:
    """Print on the standard output and error whatever happens to them, and in any alphabet: letters that it
    does not have become question marks. A full disk ends the process with one sentence."""
    made = {}
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # It was closed before the start: its number is that of the next file that is opened.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif os.name == "posix":
            made[name] = _Output(stream.fileno(), "w", closefd=False)
            lines = stream.line_buffering or stream.write_through
            how = {"encoding": stream.encoding, "errors": "replace", "line_buffering": lines}
            setattr(sys, name, io.TextIOWrapper(io.BufferedWriter(made[name]), **how))
        else:
            stream.reconfigure(errors="replace")
    try:
        yield
    finally:
        sys.stdout.flush()
        failure = made["stdout"].failure if "stdout" in made else None
        if failure is not None and not isinstance(failure, BrokenPipeError):
            say(f"tpd: cannot write to the standard output: {failure.strerror}")
            raise SystemExit(BAD_INPUT)


@contextlib.contextmanager
def announced(does: str) -> Iterator[None]:
    """Say on stderr what a command does, unless it ends before that, and then that it is at work where
    nothing else says so; nothing without words for it."""
    ended = threading.Event()
    teller = threading.Thread(target=_tell, args=(does, ended), daemon=True)
    if does:
        teller.start()
    try:
        yield
    finally:
        ended.set()
        if does:
            teller.join()


def _tell(does: str, ended: threading.Event) -> None:
    begin = time.monotonic()
    if not ended.wait(_SOON):
        say(f"tpd {tpd.__version__}: {does}")
    # On a terminal the next line of the command takes the place of this one.
    text, end, every = ("at work", "\r", 1.0) if sys.stderr.isatty() else (does, "\n", EVERY + TICK)
    while not ended.wait(0.5 * TICK):
        if is_silent(every):
            say(f"tpd: {text}, {time.monotonic() - begin:.0f} s", end=end)
    if end == "\r":
        # The prompt of the terminal does not stand in a line of ours.
        say("", end="")


@contextlib.contextmanager
def watched(out: Path | None, does: str = "") -> Iterator[None]:
    """Go on in a process of its own, and end this one with its status; Ctrl-C ends both soon in any case.
    This one says what the command does, see `announced`: the other one may be held up by imports.

    An extension that compiles holds up all threads of its process, so that another process has to end it.
    Ctrl-C raises `KeyboardInterrupt` in the command as usual; one that has not ended `_PATIENCE` seconds
    later, or when Ctrl-C comes again, is killed. Files of `out` appear complete or not at all, and a search
    that has ended is on disk already: nothing else is lost.
    """
    if not hasattr(os, "fork"):
        with announced(does):
            yield
        return
    existed, (here, there) = exists(out), os.pipe()
    # Nothing runs in another thread yet.
    child = os.fork()
    if child == 0:
        os.close(there)
        for number in (signal.SIGINT, signal.SIGALRM):
            signal.signal(number, _interrupt)
        sys.unraisablehook = _again
        threading.Thread(target=_end_with, args=(here,), daemon=True).start()
        yield
        return
    os.close(here)
    with _forwarding(child) as pressed, announced(does):
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if pressed and status < 0:
        say("\n".join(filter(None, ("tpd: interrupted", leave(out, existed)))))
        status = INTERRUPTED
    raise SystemExit(status if status >= 0 else 128 - status)


@contextlib.contextmanager
def _forwarding(child: int) -> Iterator[list[int]]:
    """Answer signals for a child process meanwhile; the list has one entry for each Ctrl-C."""
    pressed: list[int] = []

    def kill(number: int, _: Any) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        if number == signal.SIGTERM:
            os._exit(128 + number)

    def press(number: int, frame: Any) -> None:
        pressed.append(number)
        if len(pressed) > 1:
            kill(number, frame)
        with contextlib.suppress(ProcessLookupError):
            # A terminal has told the child as well: it hears the first one only.
            os.kill(child, signal.SIGINT)
        signal.setitimer(signal.ITIMER_REAL, _PATIENCE)

    answers = {signal.SIGINT: press, signal.SIGALRM: kill, signal.SIGTERM: kill}
    before = {number: signal.signal(number, answer) for number, answer in answers.items()}
    try:
        yield pressed
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, answer in before.items():
            signal.signal(number, answer)


def _end_with(pipe: int) -> None:
    """End this process with the one that waits for it, which never writes."""
    os.read(pipe, 1)
    os._exit(INTERRUPTED)


def _interrupt(_: Any, frame: Any) -> None:
    """Note the signal before it becomes an exception: a compiler turns that into another one. Within an
    import it becomes one later, since extensions print what is raised while they load."""
    _RECEIVED.set()
    if _RAISED.is_set():
        return
    while frame is not None and "importlib" not in frame.f_code.co_filename:
        frame = frame.f_back
    if frame is not None:
        _later()
        return
    _RAISED.set()
    raise KeyboardInterrupt


def received() -> bool:
    """Return True after Ctrl-C, if it is watched."""
    return _RECEIVED.is_set()


def _again(lost: Any) -> None:
    """Raise the exception again that Python dropped in a destructor."""
    if lost.exc_type is KeyboardInterrupt:
        # A moment later: raised in here it would be dropped once more, with a traceback.
        _RAISED.clear()
        _later()
    else:
        sys.__unraisablehook__(lost)


def _later() -> None:
    """Interrupt the main thread in a moment; no thread is begun within the handler of a signal."""
    signal.setitimer(signal.ITIMER_REAL, 0.01)


def warned(message: Warning | str, category: type[Warning], *where: Any, **how: Any) -> None:
    """Say a warning of this package in one sentence, in place of `warnings.showwarning`."""
    if category is UserWarning:
        # Python says it again wherever a library has touched the filters of warnings.
        if str(message) not in _SAID:
            _SAID.add(str(message))
            say(f"tpd: {message}")
    else:
        _SHOW(message, category, *where, **how)


def exists(path: Path | None) -> bool:
    """Whether there is such a path; False for one that no system can have."""
    try:
        return path is not None and path.exists()
    except (OSError, ValueError):
        return False


def leave(directory: Path | None, existed: bool) -> str | None:
    """Remove what a command that was interrupted has half written, and the directory where it made that and
    left it empty. Return how to go on, if there is something to go on from."""
    if directory is None:
        return None
    with contextlib.suppress(OSError):
        for path in directory.glob(".tpd-part-*"):
            path.unlink(missing_ok=True)
        if not existed:
            directory.rmdir()
    left = directory / UNFINISHED
    hint = f"go on with the same command and --resume (finished searches are in {left})"
    return hint if exists(left) else None


def exit_now(status: int) -> Any:
    """End the process without a wait for threads that compile, whose work nobody needs."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)
