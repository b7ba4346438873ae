"""Report as plain text, for report.txt and a terminal that asks for all of it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from tpd.report.blocks import NO_VALUE, Block, Code, Figure, Listing, Note, Report, Severity, Table, Text

_WIDTH = 100
"""Columns of text; tables may be wider."""
_LONG = 48
"""Characters of a cell in a last column that move to a line of their own."""


def text(report: Report) -> str:
    """The report in words; its first line is the verdict. Pictures are left out."""
    # The verdict opens the text: whoever reads one line reads this one.
    lines = [*_lines(report.verdict), *(line for n in report.dangers for line in _lines(n)), ""]
    for name, said in report.answer.cells:
        lines += textwrap.wrap(said, _WIDTH, initial_indent=f"{name:<13}", subsequent_indent=" " * 13)
    if report.comparison is not None:
        lines += ["", *_table(report.comparison)]
    for section in report.sections:
        body = [line for block in section.blocks for line in _lines(block)]
        lines += ["", section.title, "-" * len(section.title), *body] if body else []
    return "\n".join(lines) + "\n"


def _lines(block: Block) -> Iterator[str]:
    match block:
        case Note():
            yield from _wrapped(("DANGER: " if block.severity is Severity.danger else "") + block.text)
        case Text():
            yield from _wrapped(block.text)
        case Table():
            yield from _table(block)
        case Listing():
            for item in block.items:
                yield from textwrap.wrap(item, _WIDTH, initial_indent="- ", subsequent_indent="  ")
        case Code():
            yield from ("  " + line for line in block.text.splitlines())
        case Figure():
            return


def _wrapped(words: str) -> list[str]:
    return textwrap.wrap(words, _WIDTH, subsequent_indent="  ")


def _table(table: Table) -> Iterator[str]:
    rows = [list(table.head), *table.cells]
    # Long sentences would push all other columns apart.
    below = len(rows[0]) > 1 and max(len(row[-1]) for row in rows) > _LONG
    short = [row[:-1] if below else row for row in rows]
    widths = [max(map(len, column)) for column in zip(*short, strict=True)]
    for row, whole in zip(short, rows, strict=True):
        cells = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, table.numeric, strict=False)
        )
        if (line := "  ".join(cells).rstrip()) or not below:
            yield line
        # A dash on a line of its own says nothing.
        if below and whole is not rows[0] and whole[-1] != NO_VALUE:
            yield from textwrap.wrap(whole[-1], _WIDTH, initial_indent="    ", subsequent_indent="    ")
    if table.caption:
        yield from _wrapped(f"({table.caption})")
