"""Rendering of a report as the text of the terminal, and as one HTML page.

The page contains its pictures, needs neither network nor JavaScript, and can be printed."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import lru_cache
from importlib import resources

import jinja2

from tpd.report.answer import in_lines
from tpd.report.blocks import Code, Report, glued, wrapped

_KINDS = {b"\x89PNG": "image/png", b"GIF8": "image/gif", b"<?xml": "image/svg+xml", b"<svg": "image/svg+xml"}


def text(report: Report) -> str:
    """Return the text that the terminal prints: the summary, and the answers of commands that ran later.

    The sections and pictures are in the page only.
    """
    lines = [line for warning in report.warnings for line in wrapped(warning.marked)]
    lines.append(in_lines(report.summary, report.lines))
    for section in report.added:
        answers = (block.text for block in section.blocks if isinstance(block, Code))
        lines += ["", section.title, "-" * len(section.title), *answers]
    return "\n".join(lines) + "\n"


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
