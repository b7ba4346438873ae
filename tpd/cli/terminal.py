"""Exit statuses, standard streams, progress messages and warnings of a command.

Nothing here imports JAX, which takes a second: the first message appears before that.
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
"""Exit statuses of a command that was not interrupted."""
_FIRST_MESSAGE = 0.2
"""Time (s) before a command prints its first message. Most invalid input is rejected earlier than that."""
_SHOW = warnings.showwarning
"""Function of Python that shows warnings; it remains in use for warnings of other packages."""
_SHOWN: set[str] = set()
"""Warnings of this package that were printed."""
_answered = threading.Event()
"""Set when the command prints its answer: progress messages end there."""


class _Output(io.FileIO):
    """Standard output or error of a command. Text that cannot be written is dropped, so that the command goes
    on and writes its files even if the program that reads the output has ended."""

    failure: OSError | None = None
    """Last error of writing."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            self.failure = error
            # The caller would write again whatever does not count as written.
            return memoryview(data).nbytes


@contextlib.contextmanager
def lasting_output() -> Iterator[None]:
    """Keep standard output and error usable, whatever happens to the terminal, pipe or file behind them.

    A closed pipe does not end the command. Letters that the encoding lacks are printed as question marks.
    After a full disk the process exits with a message.
    """
    outputs = {}
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # The stream was closed before the start. Without a substitute the next file that is opened would
            # get its file descriptor, and messages would be written into that file.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif os.name == "posix":
            outputs[name] = _Output(stream.fileno(), "w", closefd=False)
            lines = stream.line_buffering or stream.write_through
            how = {"encoding": stream.encoding, "errors": "replace", "line_buffering": lines}
            setattr(sys, name, io.TextIOWrapper(io.BufferedWriter(outputs[name]), **how))
        else:
            stream.reconfigure(errors="replace")
    try:
        yield
    finally:
        sys.stdout.flush()
        failure = outputs["stdout"].failure if "stdout" in outputs else None
        # A reader that stopped early, such as `head`, is no failure; a full disk is.
        if failure is not None and not isinstance(failure, BrokenPipeError):
            say(f"tpd: cannot write to the standard output: {failure.strerror}")
            raise SystemExit(BAD_INPUT)


@contextlib.contextmanager
def announced(activity: str) -> Iterator[None]:
    """Print on stderr what the command does, and later that it still works if nothing else is printed.

    A command that ends at once prints nothing, and no message follows the answer, see `print_answer`.

    Args:
        activity: description of the work; an empty text turns the messages off.
    """
    _answered.clear()
    reporter = threading.Thread(target=_report, args=(activity,), daemon=True)
    if activity:
        reporter.start()
    try:
        yield
    finally:
        _answered.set()
        if activity:
            reporter.join()


def print_answer(*lines: str) -> None:
    """Print the answer of the command on stdout. `announced` prints no message after it.

    Args:
        lines: lines or paragraphs; an empty text gives an empty line.
    """
    _answered.set()
    say("\n".join(lines), sys.stdout)


def _report(activity: str) -> None:
    """Print the messages of `announced`, in a thread of its own."""
    begin = time.monotonic()
    if not _answered.wait(_FIRST_MESSAGE):
        say(f"tpd {tpd.__version__}: {activity}")
    # On a terminal the message stays in the last line, and the next line of the command replaces it.
    text, end, every = ("at work", "\r", 1.0) if sys.stderr.isatty() else (activity, "\n", EVERY + TICK)
    while not _answered.wait(0.5 * TICK):
        if is_silent(every):
            say(f"tpd: {text}, {time.monotonic() - begin:.0f} s", end=end)
    if end == "\r":
        # Clear the line: the shell prints its prompt there.
        say("", end="")


def show_warning(message: Warning | str, category: type[Warning], *where: Any, **how: Any) -> None:
    """Print a warning of this package as one sentence. It replaces `warnings.showwarning`."""
    if category is UserWarning:
        # Python repeats a warning after any library has changed the filters of warnings.
        if str(message) not in _SHOWN:
            _SHOWN.add(str(message))
            say(f"tpd: {message}")
    else:
        _SHOW(message, category, *where, **how)
