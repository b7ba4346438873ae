"""Rendering of a report as plain text, and as one HTML page.

The page contains its pictures, needs neither network nor JavaScript, and can be printed."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib import resources

import jinja2

from tpd.report.blocks import (
    NO_VALUE,
    Block,
    Code,
    Figure,
    Listing,
    Note,
    Report,
    Table,
    Text,
    glued,
    wrapped,
)

_LONG = 48
"""Number of characters above which the text renders the cells of the last column on lines of their own."""
_KINDS = {b"\x89PNG": "image/png", b"GIF8": "image/gif", b"<?xml": "image/svg+xml", b"<svg": "image/svg+xml"}


def text(report: Report) -> str:
    """Return the report as plain text without pictures. The first line is the verdict."""
    first = report.summary
    lines = [*(line for n in (first.verdict, *first.dangers) for line in _lines(n)), ""]
    for name, sentence in first.rows:
        lines += wrapped(sentence, f"{name:<13}", " " * 13)
    if first.comparison is not None:
        lines += ["", *_table(first.comparison)]
    # A section of pictures only has no text and is left out.
    for section in report.sections:
        body = [line for block in section.blocks for line in _lines(block)]
        lines += ["", section.title, "-" * len(section.title), *body] if body else []
    return "\n".join(lines) + "\n"


def _lines(block: Block) -> Iterator[str]:
    match block:
        case Note():
            yield from wrapped(block.marked)
        case Text():
            yield from wrapped(block.text)
        case Table():
            yield from _table(block)
        case Listing():
            for item in block.items:
                yield from wrapped(item, "- ")
        case Code():
            yield from ("  " + line for line in block.text.splitlines())
        case Figure():
            return


def _table(table: Table) -> Iterator[str]:
    # Columns are as wide as their longest cell.
    rows = [list(table.head), *table.cells]
    # A column of long sentences would make the table wider than the page: it goes below each row.
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
        # A dash on a line of its own has no information.
        if below and whole is not rows[0] and whole[-1] != NO_VALUE:
            yield from wrapped(whole[-1], "    ", "    ")
    if table.caption:
        yield from wrapped(f"({table.caption})")


def html(report: Report, pictures: Mapping[str, bytes]) -> str:
    """Return the HTML page of a report.

    The first screen shows verdict, comparison, answer and drawing. All sections are folded.

    Args:
        report: from `tpd.report.content.content`. All texts in it are escaped.
        pictures: contents of SVG, PNG or GIF files by name. A figure whose file is missing is left out.

    Raises:
        ValueError: a picture in another format.
    """
    uris = {}
    for name, image in pictures.items():
        # The first bytes tell the format, independent of the name of the file.
        kind = next((mime for start, mime in _KINDS.items() if image.startswith(start)), None)
        if kind is None:
            raise ValueError("`pictures` must hold SVG, PNG or GIF files only")
        # Data URIs keep the page in one file.
        uris[name] = f"data:{kind};base64,{base64.b64encode(image).decode()}"
    return _template().render(report=report, pictures=uris)


@lru_cache(maxsize=1)
def _template() -> jinja2.Template:
    source = resources.files("tpd.report").joinpath("page.html.j2").read_text(encoding="utf-8")
    # Texts can contain names from the user's files, so everything is escaped. A misspelt name in the template
    # must raise an error and not leave an empty place in the report.
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["glued"] = glued
    return environment.from_string(source)
