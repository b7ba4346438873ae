"""Answer of an independent engine in the report of a design: a warning before the verdict, a section at the
end, and all numbers in a file of their own."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import TYPE_CHECKING

from tpd.core import files

if TYPE_CHECKING:
    from tpd.engines.comparison import EngineVerdict

_TITLE = "By an independent engine"
_MARK = "<!-- engine -->"
_ENGINES = ("MuJoCo", "Drake")


def add(directory: Path, verdict: EngineVerdict) -> list[Path]:
    """Put the answer of an engine into the files of a report, in place of a former one. Returns the files."""
    written = [files.place(directory / "engine.json", files.as_json(verdict.summary()))]
    for name, put in (("report.txt", _in_text), ("report.html", _in_page)):
        path = directory / name
        if path.exists():
            written.append(files.place(path, put(path.read_text(encoding="utf-8"), verdict)))
    return written


def _in_text(report: str, verdict: EngineVerdict) -> str:
    # A second run replaces the first: its warning and its section are found by their words.
    lines = report.split(f"\n{_TITLE}\n")[0].rstrip("\n").split("\n")
    if any(engine in lines[0] for engine in _ENGINES):
        lines = lines[1:]
    head = [verdict.warning] if verdict.warning else []
    return "\n".join([*head, *lines, "", _TITLE, "-" * len(_TITLE), str(verdict)]) + "\n"


def _in_page(page: str, verdict: EngineVerdict) -> str:
    # Marks stand around everything that a second run replaces.
    page = re.sub(f"{_MARK}.*?{_MARK}\n", "", page, flags=re.DOTALL)
    if verdict.warning:
        head = f'{_MARK}<p class="danger">{html.escape(verdict.warning)}</p>{_MARK}\n'
        page = page.replace('<p class="verdict', head + '<p class="verdict', 1)
    section = f"<section>\n<h2>{_TITLE}</h2>\n<pre>{html.escape(str(verdict))}</pre>\n</section>"
    return page.replace("</body>", f"{_MARK}{section}{_MARK}\n</body>", 1)
