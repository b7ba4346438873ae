"""Report as one HTML page with its pictures inside: it needs no network and no JavaScript, and prints."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import lru_cache
from importlib import resources

import jinja2

from tpd.report.blocks import Report

_KINDS = {b"\x89PNG": "image/png", b"GIF8": "image/gif", b"<?xml": "image/svg+xml", b"<svg": "image/svg+xml"}


def html(report: Report, pictures: Mapping[str, bytes]) -> str:
    """Return the page: on its first screen verdict, drawing, answer and comparison, and all else folded.

    Args:
        report: from `tpd.report.content.content`; everything in it is escaped.
        pictures: contents of SVG, PNG or GIF files by name; figures without one are left out.

    Raises:
        ValueError: a picture of another kind.
    """
    return _template().render(report=report, pictures={name: _uri(x) for name, x in pictures.items()})


@lru_cache(maxsize=1)
def _template() -> jinja2.Template:
    source = resources.files("tpd.report").joinpath("page.html.j2").read_text(encoding="utf-8")
    # Names come from the user's files: everything is escaped. A name that is missing in the template is an
    # error, not an empty place in a report.
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    return environment.from_string(source)


def _uri(image: bytes) -> str:
    kind = next((mime for start, mime in _KINDS.items() if image.startswith(start)), None)
    if kind is None:
        raise ValueError("`pictures` must hold SVG, PNG or GIF files only")
    return f"data:{kind};base64,{base64.b64encode(image).decode()}"
