"""Files of a command: tables of numbers first, then pictures."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import files, progress


def plot(result: Any, what: str | None = None) -> Any:
    """Draw a result with `tpd.plot`; only the call imports Matplotlib."""
    from tpd.plots.results import plot

    return plot(result, what)


def write(out: Path, tables: Iterable[tuple[str, str]], pictures: Mapping[str, Callable[[], Any]]) -> None:
    """Write files into the directory of a command and print their names. The numbers are written before the
    first picture is drawn; a picture that cannot be drawn costs one sentence.

    Args:
        out: the directory.
        tables: names and contents of the files of numbers.
        pictures: functions that draw and return axes, or the content of a file, by the names of the files.
    """
    # All tables are made before the first one is written: an interruption leaves all of them or none.
    for name, table in list(tables):
        progress.say(f"written: {files.place(out / name, table)}", sys.stdout)
    for name, draw in pictures.items():
        try:
            # Numbers do not wait for Matplotlib, which refuses some settings when it is imported.
            from tpd.plots.style import own_style, png

            with own_style():
                found = draw()
                content = found if isinstance(found, bytes) else png(np.ravel(found)[0].figure)
        # Matplotlib raises errors of every kind.
        except Exception as error:
            progress.say(f"tpd: {files.missing_picture(name, error)}")
        else:
            progress.say(f"written: {files.place(out / name, content)}", sys.stdout)
