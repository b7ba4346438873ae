"""The interactive page: one HTML file that needs no network, made of the content and the modules here."""

from __future__ import annotations

import html
import json
import re
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path

from tpd.core import files
from tpd.explore.content import Subject, content

_MODULES = "rocking", "pendulum", "orbits", "figures", "app"
"""Modules of the page; each imports only from those before it."""
_HEIGHT = 900
"""Height of the page in a notebook, pixels."""


@dataclass(frozen=True, repr=False)
class Page:
    """An interactive page of a design, one self-contained HTML text. A notebook shows it."""

    html: str
    """The whole page."""

    def write(self, path: str | Path) -> Path:
        """Write the page as a file, which appears complete or not at all; return its path.

        Raises:
            ValueError: a name that is not a path.
            OSError: the file cannot be written.
        """
        return files.place(files.path_of(path), self.html, files.REPORT)

    def __repr__(self) -> str:
        return f"Page of {len(self.html) / 1e6:.1f} MB: `write(path)` writes it as a file"

    def _repr_html_(self) -> str:
        # A frame keeps the styles of the page apart from those of the notebook.
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" title="Explore the design" '
            f'style="width: 100%; height: {_HEIGHT}px; border: 1px solid #bbb"></iframe>'
        )


def explore(design: Subject) -> Page:
    """Return an interactive page of a design: sliders, the response to them, and a block that rocks.

    The page has number fields and sliders for mass, length and damping of the pendulum and for frequency and
    amplitude of the excitation. It shows the steady tilt over frequency and over mass and length, the
    limits, the pendulum to scale, and the motion of the block with and without the pendulum by the nonlinear
    equations (4). Each value on the page names its source.

    Args:
        design: the answer of `optimise` or of `read_design`; or a `Job` or a `Scene`, for which no pendulum
            is recommended and no runs are stored.

    Raises:
        ValueError: another object, or a scene or job that `optimise` would reject.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> page = tpd.explore(tpd.paper_scene())
        >>> page.html.startswith("<!DOCTYPE html>")
        True
    """
    data = json.dumps(_finite(content(design)), allow_nan=False, separators=(",", ":"))
    # A text of the user, such as the name of a project, must not end the script that holds it.
    data = data.replace("<", "\\u003c")
    return Page(template().replace("@DATA@", data))


def _finite(value: object) -> object:
    """Return lists and dictionaries with None instead of numbers that JSON does not have."""
    match value:
        case dict():
            return {key: _finite(x) for key, x in value.items()}
        case list() | tuple():
            return [_finite(x) for x in value]
        case float() if value != value or value in (float("inf"), float("-inf")):
            return None
    return value


@lru_cache(maxsize=1)
def template() -> str:
    """Return the page without its data, with all modules joined to one script."""
    folder = resources.files("tpd.explore")
    modules = [folder.joinpath(f"{name}.mjs").read_text(encoding="utf-8") for name in _MODULES]
    # A page that is opened as a file cannot import modules: they become one, without imports and exports.
    script = re.sub(r"^(import .*;|export (?=\w))", "", "\n".join(modules), flags=re.MULTILINE)
    page = folder.joinpath("page.html").read_text(encoding="utf-8")
    return page.replace("@SCRIPT@", script)
