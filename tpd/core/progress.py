"""Progress of long computations: functions that report it, and a bar that shows it.

This module does not import JAX, so that a command can print a message before JAX is imported.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from shutil import get_terminal_size
from typing import Any

Progress = Callable[[str, int, int], None]
"""Function that is called after every unit of work with the name of the stage, the units done, and their
total."""
Count = Callable[[int, int], None]
"""Function that is called with the units done and their total, for work with a single stage."""


def unreported(*_: object) -> None:
    """Do nothing: the progress is not reported."""


COMPILING = "compiling (a minute or more the first time)"
"""Name of the stage before the first report, and note on a stage without progress. Programs are compiled
before they run."""
EVERY = 4.5
"""Seconds between two lines if stderr is not a terminal."""
TICK = 0.2
"""Seconds between two updates of the clock."""
_CLEAR = "\r\x1b[K"
"""Text that removes a bar from the last line of a terminal."""
_last = [time.monotonic()]
"""Time at which this process last printed a message."""


def say(text: str, out: Any = None, end: str = "\n") -> None:
    """Print a line, by default on stderr."""
    _last[0], out = time.monotonic(), sys.stderr if out is None else out
    # A terminal may show a bar in its last line. A closed pipe must not stop the work.
    with contextlib.suppress(OSError, ValueError):
        print((_CLEAR if out.isatty() else "") + text, file=out, flush=True, end=end)


def is_silent(seconds: float) -> bool:
    """Whether no message was printed for this number of seconds."""
    return time.monotonic() - _last[0] >= seconds


class Bar:
    """Progress on stderr, used as `with Bar() as bar: ...`.

    On a terminal it shows one bar for each stage, with the elapsed time. Otherwise it prints a line every 5
    s.
    """

    def __init__(self, out: Any = None, every: float = EVERY) -> None:
        self._out, self._every = sys.stderr if out is None else out, every
        self._stage, self._done, self._total = COMPILING, 0, 0
        self._bar: Any = None
        self._begin = time.monotonic()
        self._lock, self._end = threading.RLock(), threading.Event()
        self._ticker = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Bar:
        self._open()
        self._ticker.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._ticker.join()
        self._close()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show the progress of a stage."""
        with self._lock:
            # A stage may begin again, for example for a second model. It then gets a new bar.
            again = stage != self._stage or done == 1
            self._stage, self._done, self._total = stage, done, total
            if again:
                self._close()
                self._open()
            if self._bar is not None:
                self._bar.set_description(self._name(), refresh=False)
                self._bar.update(done - self._bar.n)

    def _tick(self) -> None:
        """Update the clock while the work reports nothing, because a compilation may take half a minute."""
        while not self._end.wait(TICK):
            with self._lock:
                if self._bar is not None:
                    self._bar.refresh()
                    _last[0] = time.monotonic()
                elif is_silent(self._every):
                    count = f" {self._done} of {self._total}" if self._total else ""
                    elapsed = f"{time.monotonic() - self._begin:.0f} s"
                    say(f"tpd: {self._name()}{count}, {elapsed}", self._out)

    def _name(self) -> str:
        """Name of the stage, with a note if a program is still being compiled."""
        is_begun = self._done > 0 or self._stage == COMPILING
        return self._stage if is_begun else f"{self._stage}, {COMPILING}"

    def _open(self) -> None:
        """Open a bar on a terminal."""
        if not self._out.isatty():
            return
        from tqdm import tqdm

        # Without a total only the elapsed time can be shown.
        shape = None if self._total else "{desc}, {elapsed}"
        # Some terminals do not report their size. With zero lines nothing would be shown.
        columns, lines = get_terminal_size()
        how = {"file": self._out, "bar_format": shape, "ncols": columns, "nrows": lines}
        self._bar = tqdm(total=self._total or None, desc=self._name(), leave=False, **how)

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


@contextlib.contextmanager
def bar_for(progress: Progress | bool | None) -> Iterator[Progress]:
    """Return the function for an argument `progress`: True is a `Bar`, False or None is `unreported`.

    Raises:
        ValueError: the argument is neither a boolean nor a function.
    """
    if progress is True:
        with Bar() as bar:
            yield bar
    elif progress is None or progress is False:
        yield unreported
    elif callable(progress):
        yield progress
    else:
        from tpd.core import checks

        raise ValueError(f"`progress` must be True or a function, but is {checks.quote(progress)}")


@contextlib.contextmanager
def count_for(progress: Count | bool | None, stage: str) -> Iterator[Count]:
    """Return the function for an argument `progress`, as `bar_for`, for work with a single stage."""
    if isinstance(progress, bool):
        with bar_for(progress) as bar:
            yield partial(bar, stage)
    else:
        with bar_for(progress) as function:  # type: ignore[arg-type]
            yield function  # type: ignore[misc]
