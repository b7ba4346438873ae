"""Exit statuses, output and signs of life of a command.

Nothing here imports JAX: importing it takes a second, and the first line does not wait for it.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from typing import Any

import tpd
from tpd.core.progress import EVERY, TICK, is_silent, say

SOUND, BAD_INPUT, UNSOUND = 0, 2, 3
"""Exit statuses of a command that ends of itself."""
_SOON = 0.2
"""Seconds after which a command says what it does; bad input is refused earlier where JAX is imported."""
_SHOW = warnings.showwarning
"""How Python shows the warnings of others."""
_SAID: set[str] = set()
"""Warnings that were said."""


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


def warned(message: Warning | str, category: type[Warning], *where: Any, **how: Any) -> None:
    """Say a warning of this package in one sentence, in place of `warnings.showwarning`."""
    if category is UserWarning:
        # Python says it again wherever a library has touched the filters of warnings.
        if str(message) not in _SAID:
            _SAID.add(str(message))
            say(f"tpd: {message}")
    else:
        _SHOW(message, category, *where, **how)
