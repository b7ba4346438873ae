"""Rendering of a report as the text of the terminal, and as one HTML page.

The page contains its pictures, needs neither network nor JavaScript, and can be printed."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import lru_cache
from importlib import resources

import jinja2

from tpd.core.formatting import aligned
from tpd.report.blocks import MOST, Code, Report, Summary, Table, glued, wrapped

_NAME = 17
"""Width of the column with the names of the rows."""
_KINDS = {b"\x89PNG": "image/png", b"GIF8": "image/gif", b"<?xml": "image/svg+xml", b"<svg": "image/svg+xml"}


def text(report: Report) -> str:
    """Return the text that the terminal prints: the summary, and the answers of commands that ran later.

    The sections and pictures are in the page only.
    """
    lines = [line for warning in report.warnings for line in wrapped(warning.marked)]
    lines.append(in_lines(report.summary, report.lines))
    for section in report.added:
        # The answer of a command is the text that it printed.
        answers = (block.text for block in section.blocks if isinstance(block, Code))
        lines += ["", section.title, "-" * len(section.title), *answers]
    return "\n".join(lines) + "\n"


def in_lines(of: Summary, most: int = MOST) -> str:
    """Return a summary as at most `most` lines."""
    # Verdict and dangers come first, because the last lines are the first to be left out.
    parts = [wrapped(entry.marked) for entry in (of.verdict, *of.dangers)]
    if of.table is not None:
        # Numbers are aligned to the right, and the last column to the left.
        rows = [list(of.table.head), *([cell or "" for cell in row] for row in of.table.cells)]
        numbers = aligned([row[:-1] for row in rows])
        parts.append([f"  {x}   {row[-1]}".rstrip() for x, row in zip(numbers, rows, strict=True)])
    for group in of.groups:
        first, *others = (_row(name, text) for name, text in group.rows)
        # A title never stands alone.
        parts += [([group.title] if group.title else []) + first, *others]
    last = [line for row in of.commands for line in _row(*row)]
    # A long list of reasons must not hide the last lines, which say where the report is. Only whole rows are
    # left out, because half of a sentence can mean the opposite of the whole.
    if sum(map(len, parts)) + len(last) > most:
        while len(parts) > 1 and sum(map(len, parts)) + len(last) >= most:
            parts.pop()
        last = [" " * _NAME + "(more in the report)", *last]
    return "\n".join([line for part in parts for line in part] + last)


def in_rows(of: Table) -> str:
    """Return a table of names and sentences as lines."""
    return "\n".join(line for name, sentence in of.cells for line in _row(name, sentence))


def _row(name: str, text: str) -> list[str]:
    """Return the lines of a row: its name, and its text beside it."""
    return wrapped(text, f"  {name:<{_NAME - 2}}", " " * _NAME)


def html(report: Report, pictures: Mapping[str, bytes]) -> str:
    """Return the HTML page of a report.

    The first screen shows verdict, answer and the picture of the benefit. All sections are folded.

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
