"""Rendering of a report as the text of the terminal, and as one HTML page.

The page contains its pictures, needs neither network nor JavaScript, and can be printed."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import lru_cache
from importlib import resources

import jinja2

from tpd.report.blocks import MOST, Code, Report, Summary, glued, wrapped

_NAME = 14
"""Width of the column with the names of the rows."""
_ALONE = "block", "excitation", "uplift", "sliding"
"""Rows about the block without a pendulum, which the command prints before the search."""
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
