"""The answer of `optimise` in a few lines for the terminal, from the summary of a design."""

from __future__ import annotations

from pathlib import Path

from tpd.design.as_built import Details, build_of
from tpd.design.design import Design
from tpd.report.blocks import MOST, Summary, wrapped
from tpd.report.summary import summary

_NAME = 14
"""Width of the column with the names of the rows."""
_ALONE = "block", "excitation", "uplift", "sliding"
"""Rows about the block without a pendulum, which the command prints before the search."""


def answer(
    design: Design, details: Details | None = None, directory: Path | None = None, most: int = MOST
) -> str:
    """Return the answer for the terminal: verdict, pendulum, benefit and active limits.

    Args:
        design: the answer of `optimise`.
        details: the answer of `tpd.details`. Without this argument, rows that need further runs are left out.
        directory: folder of the report, for the commands at the end.
        most: largest number of lines.
    """
    # The pendulum as built needs only a few motions, so it is always shown.
    details = Details(build=build_of(design)) if details is None else details
    return in_lines(summary(design, details, directory), most)


def in_lines(of: Summary, most: int = MOST) -> str:
    """Return a summary as at most `most` lines, without the rows that the command prints before.

    The table that compares both cases stands in the report only: the verdict has its main numbers.
    """
    # Verdict and dangers come first, because the last lines are the first to be left out.
    parts = [wrapped(entry.marked) for entry in (of.verdict, *of.dangers)]
    parts += [_row(name, text) for name, text in of.rows if name not in _ALONE]
    last = [line for row in of.commands for line in _row(*row)]
    # A long list of reasons must not hide the last lines, which say where the report is. Only whole rows are
    # left out, because half of a sentence can mean the opposite of the whole.
    if sum(map(len, parts)) + len(last) > most:
        while len(parts) > 1 and sum(map(len, parts)) + len(last) >= most:
            parts.pop()
        last = [" " * _NAME + "(more in the report)", *last]
    return "\n".join([line for part in parts for line in part] + last)


def _row(name: str, text: str) -> list[str]:
    """Return the lines of a row: its name, and its text beside it."""
    return wrapped(text, f"  {name:<{_NAME - 2}}", " " * _NAME)
