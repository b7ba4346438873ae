"""A report as plain text and as one HTML page with its pictures inside, which needs no network and no
JavaScript, and prints."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib import resources

import jinja2

from tpd.report.blocks import NO_VALUE, Block, Code, Figure, Listing, Note, Report, Table, Text, wrapped

_LONG = 48
"""Characters of a cell in a last column that move to a line of their own."""
_KINDS = {b"\x89PNG": "image/png", b"GIF8": "image/gif", b"<?xml": "image/svg+xml", b"<svg": "image/svg+xml"}


def text(report: Report) -> str:
    """The report in words; its first line is the verdict. Pictures are left out."""
    # The verdict opens the text: whoever reads one line reads this one.
    lines = [*_lines(report.verdict), *(line for n in report.dangers for line in _lines(n)), ""]
    for name, said in report.answer.cells:
        lines += wrapped(said, f"{name:<13}", " " * 13)
    if report.comparison is not None:
        lines += ["", *_table(report.comparison)]
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
            yield from wrapped(whole[-1], "    ", "    ")
    if table.caption:
        yield from wrapped(f"({table.caption})")


def html(report: Report, pictures: Mapping[str, bytes]) -> str:
    """Return the page: on its first screen verdict, drawing, answer and comparison, and all else folded.

    Args:
        report: from `tpd.report.content.content`; everything in it is escaped.
        pictures: contents of SVG, PNG or GIF files by name; figures without one are left out.

    Raises:
        ValueError: a picture of another kind.
    """
    uris = {}
    for name, image in pictures.items():
        kind = next((mime for start, mime in _KINDS.items() if image.startswith(start)), None)
        if kind is None:
            raise ValueError("`pictures` must hold SVG, PNG or GIF files only")
        uris[name] = f"data:{kind};base64,{base64.b64encode(image).decode()}"
    return _template().render(report=report, pictures=uris)


@lru_cache(maxsize=1)
def _template() -> jinja2.Template:
    source = resources.files("tpd.report").joinpath("page.html.j2").read_text(encoding="utf-8")
    # Names come from the user's files: everything is escaped. A name that is missing in the template is an
    # error, not an empty place in a report.
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    return environment.from_string(source)
