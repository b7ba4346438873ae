"""Reports of progress to whoever waits for a long piece of work, and a bar that shows them."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from tpd.core import checks

Progress = Callable[[str, int, int], None]
"""Called after every unit of work with the stage's name, the units done and the units in all."""
Count = Callable[[int, int], None]
"""Called with the units done and the units in all, where there is one stage."""

COMPILING = "compiling (a minute or more the first time)"
"""Stage before the first report, and note on a stage of which nothing is done: a program is compiled before
it runs."""
_EVERY = 10.0
"""Seconds between two lines where stderr is no terminal."""
_TICK = 0.5
"""Seconds between two looks at the clock."""


class Bar:
    """Progress on stderr from `with Bar() as bar: ...`: on a terminal one bar for each stage, with the
    elapsed time; else a plain line every 10 s."""

    def __init__(self, out: Any = None, every: float = _EVERY) -> None:
        self._out, self._every = sys.stderr if out is None else out, every
        self._stage, self._done, self._total = COMPILING, 0, 0
        self._bar: Any = None
        self._begin = self._last = time.monotonic()
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
        """Show how much of a stage is done."""
        with self._lock:
            # A stage that begins again, as for a second model, gets a bar of its own.
            again = stage != self._stage or done == 1
            self._stage, self._done, self._total = stage, done, total
            if again:
                self._close()
                self._open()
            if self._bar is not None:
                self._bar.set_description(self._name(), refresh=False)
                self._bar.update(done - self._bar.n)

    def _tick(self) -> None:
        """Move the clock while the work does not report: a compilation may take half a minute."""
        while not self._end.wait(_TICK):
            with self._lock:
                if self._bar is not None:
                    self._bar.refresh()
                elif time.monotonic() - self._last >= self._every:
                    self._last = time.monotonic()
                    # A closed pipe must not end the work.
                    with contextlib.suppress(OSError, ValueError):
                        print(f"tpd: {self._line()}", file=self._out, flush=True)

    def _line(self) -> str:
        count = f" {self._done} of {self._total}" if self._total else ""
        return f"{self._name()}{count}, {time.monotonic() - self._begin:.0f} s"

    def _name(self) -> str:
        is_begun = self._done > 0 or self._stage == COMPILING
        return self._stage if is_begun else f"{self._stage}, {COMPILING}"

    def _open(self) -> None:
        if not self._out.isatty():
            return
        from tqdm import tqdm

        # Without a number of units there is only a clock to show.
        shape = None if self._total else "{desc}, {elapsed}"
        total = self._total or None
        self._bar = tqdm(total=total, desc=self._name(), leave=False, file=self._out, bar_format=shape)

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


@contextlib.contextmanager
def shown(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """Give the function that an argument `progress` stands for: True is a `Bar`, False or None nothing.

    Raises:
        ValueError: neither a truth value nor a function.
    """
    if progress is True:
        with Bar() as bar:
            yield bar
    elif progress is None or progress is False:
        yield None
    elif callable(progress):
        yield progress
    else:
        raise ValueError(f"`progress` must be True or a function, but is {checks.shown(progress)}")


@contextlib.contextmanager
def shown_count(progress: Count | bool | None, stage: str) -> Iterator[Count | None]:
    """As `shown`, for work of one stage, which reports the units done and the units in all."""
    if isinstance(progress, bool):
        with shown(progress) as bar:
            yield None if bar is None else partial(bar, stage)
    else:
        with shown(progress) as function:  # type: ignore[arg-type]
            yield function  # type: ignore[misc]
