"""Output files of a command: first the tables of numbers, then the pictures."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from tpd.core import files, progress

PERIODIC_ONLY = (
    "These motions are periodic. Run the command with {} to find out whether the block\n"
    "  settles to one of them from rest, or overturns."
)
"""Note on results without motions from rest; the placeholder is an option."""


def plot(result: Any, what: str | None = None, **how: Any) -> Any:
    """Draw a result with `tpd.plot`. Matplotlib is imported when the function is called, and not before."""
    from tpd.plots.results import plot

    return plot(result, what, **how)


def write(
    out: Path,
    tables: Iterable[tuple[str, str]],
    pictures: Mapping[str, Callable[[], Any]],
    *,
    overwrite: bool,
) -> None:
    """Write the files of a command and print their names.

    The numbers are written before the first picture is drawn. A message on stderr names a picture that cannot
    be drawn; the others are drawn nevertheless.

    Args:
        out: output folder.
        tables: names and contents of the files of numbers.
        pictures: drawing functions by the names of the files. Each returns axes, or the content of the file.
        overwrite: whether the folder may contain files.
    """

    def warn(sentence: str) -> None:
        progress.say(f"tpd: {sentence}")

    def drawn(draw: Callable[[], Any]) -> bytes:
        # Matplotlib is imported here, because its import may fail: it rejects some settings of users.
        from tpd.plots.style import own_style, saved

        with own_style():
            return saved(draw())

    # All tables are computed before the first one is written, so that an interruption leaves all or none.
    contents = dict(tables)
    results = files.Results(out, next(iter(contents)), overwrite=overwrite)
    for name, table in contents.items():
        progress.say(f"written: {results.place(name, table)}", sys.stdout)
    for name, draw in pictures.items():
        if results.draw(name, partial(drawn, draw), warn) is not None:
            progress.say(f"written: {out / name}", sys.stdout)
    if remaining := results.remaining:
        warn(remaining)
