"""Building blocks of a report: typed data that text, HTML and JSON render."""

from __future__ import annotations

import enum
import re
import textwrap
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from tpd.core.formatting import number

_NUMBER = re.compile(r"[+-]?\d[\d.]*%?")
Cell = str | float | int | None
NO_VALUE = "–"
"""Text of a cell without a value."""
_WIDTH = 100
"""Columns of text; tables may be wider."""


class Severity(enum.Enum):
    """How much a note matters to somebody who would build the design; in the order of a report."""

    danger = 0
    """The block overturns more often, or the bob strikes a wall."""
    note = 1
    """Anything else that changes what one may conclude."""


@dataclass(frozen=True)
class Note:
    """A statement that must be read, one or more sentences."""

    severity: Severity
    text: str
    kind: ClassVar[str] = "note"

    @property
    def marked(self) -> str:
        """The text with the mark of its severity."""
        return f"DANGER: {self.text}" if self.severity is Severity.danger else self.text


danger, note = (partial(Note, severity) for severity in Severity)


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str
    kind: ClassVar[str] = "text"


@dataclass(frozen=True)
class Table:
    """Rows under a head. Cells of None or NaN have no value.

    Raises:
        ValueError: a row with another number of cells than the head.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    kind: ClassVar[str] = "table"

    def __post_init__(self) -> None:
        for n in {len(row) for row in self.rows} - {len(self.head)}:
            raise ValueError(f"a row must have {len(self.head)} cells as the head has, but has {n}")

    @property
    def cells(self) -> list[list[str]]:
        """All cells as text: numbers to four digits, a dash where there is no value."""
        return [
            [NO_VALUE if c is None else number(c) if isinstance(c, float) else str(c) for c in row]
            for row in self.rows
        ]

    @property
    def numeric(self) -> list[bool]:
        """Whether a column holds numbers, which stand to the right."""
        columns = [[row[i] for row in self.rows if row[i] is not None] for i in range(len(self.head))]
        return [
            bool(cells) and all(not isinstance(x, str) or _NUMBER.fullmatch(x) for x in cells)
            for cells in columns
        ]


@dataclass(frozen=True)
class Figure:
    """A picture by its file's name.

    Raises:
        ValueError: no description for readers who do not see the picture.
    """

    name: str
    alt: str
    caption: str
    kind: ClassVar[str] = "figure"

    def __post_init__(self) -> None:
        if not self.alt:
            raise ValueError("`alt` must describe the picture, but is empty")


@dataclass(frozen=True)
class Listing:
    """A list of sentences."""

    items: tuple[str, ...]
    kind: ClassVar[str] = "listing"


@dataclass(frozen=True)
class Code:
    """A command or the content of a file."""

    text: str
    kind: ClassVar[str] = "code"


Block = Note | Text | Table | Figure | Listing | Code


@dataclass(frozen=True)
class Section:
    """A titled part of a report."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Report:
    """A whole report: the first screen, and sections in the order in which an engineer asks."""

    title: str
    verdict: Note
    dangers: tuple[Note, ...]
    answer: Table
    """Rows of a name and what is said of it."""
    comparison: Table | None
    """With and without the pendulum, from one set of runs."""
    figures: tuple[Figure, ...]
    """Drawing and animation."""
    sections: tuple[Section, ...]


def wrapped(text: str, first: str = "", rest: str = "  ") -> list[str]:
    """Lines of a text, with what stands before the first of them, and before the others."""
    return textwrap.wrap(text, _WIDTH, initial_indent=first, subsequent_indent=rest)
