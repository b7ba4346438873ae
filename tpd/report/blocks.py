"""Building blocks of a report: plain data, which JSON can store and which the terminal and the HTML page
render."""

from __future__ import annotations

import enum
import re
import textwrap
from functools import partial
from math import isfinite

from msgspec import Struct
from msgspec.structs import force_setattr

from tpd.core.formatting import number

_NUMBER = re.compile(r"[+-]?\d[\d.]*( ?%)?|infinite|–")
"""A number, a number of per cent, or the words for numbers that are infinite or unknown."""
_UNIT = re.compile(
    r"(?<=\d) (?=(?:%|k?g|k?m|mm|s|k?N|W|Hz|rad)(?:\W|$))|(?<=\d N) (?=s/m|m)|(?<=\d N m) (?=s/rad)"
)
"""Space between a number and its unit, or within the unit."""
Cell = str | float | int | None
NO_VALUE = "–"
"""Text of a cell without a value."""
MOST = 25
"""Largest number of lines of the answer on the terminal."""
_WIDTH = 100
"""Largest number of columns of a line of text. Tables may be wider."""


class Severity(enum.Enum):
    """Importance of a note for an engineer who would build the design; the report lists dangers first."""

    danger = "danger"
    """The block overturns more often with the pendulum, its base slides, or the bob touches a wall."""
    note = "note"
    """Another fact that affects the conclusions."""


class Note(Struct, frozen=True, tag=True):
    """A statement of one or more sentences that the reader must not miss."""

    severity: Severity
    text: str

    @property
    def marked(self) -> str:
        """The text, with "DANGER: " before it if it is a danger."""
        return f"DANGER: {self.text}" if self.severity is Severity.danger else self.text


danger, note = (partial(Note, severity) for severity in Severity)


class Text(Struct, frozen=True, tag=True):
    """A paragraph."""

    text: str


class Table(Struct, frozen=True, tag=True):
    """Rows of cells below a row of column headings. Cells that are None or NaN have no value.

    Infinite numbers and NaN become text, because JSON has no such numbers.

    Raises:
        ValueError: a row whose number of cells differs from the number of headings.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""

    def __post_init__(self) -> None:
        for n in {len(row) for row in self.rows} - {len(self.head)}:
            raise ValueError(f"a row must have {len(self.head)} cells as the head has, but has {n}")
        rows = ((number(x) if isinstance(x, float) and not isfinite(x) else x for x in r) for r in self.rows)
        force_setattr(self, "rows", tuple(map(tuple, rows)))

    @property
    def cells(self) -> list[list[str]]:
        """All cells as text: numbers with four significant digits, a dash for a missing value."""
        return [
            [NO_VALUE if c is None else number(c) if isinstance(c, float) else str(c) for c in row]
            for row in self.rows
        ]

    @property
    def numeric(self) -> list[bool]:
        """Whether each column contains only numbers, which are aligned to the right."""
        columns = [[row[i] for row in self.rows if row[i] is not None] for i in range(len(self.head))]
        return [
            bool(cells) and all(not isinstance(x, str) or _NUMBER.fullmatch(x) for x in cells)
            for cells in columns
        ]


class Figure(Struct, frozen=True, tag=True):
    """A picture, identified by the name of its file."""

    name: str
    alt: str
    """Description for readers who cannot see the picture."""
    caption: str


class Listing(Struct, frozen=True, tag=True):
    """A list of sentences."""

    items: tuple[str, ...]


class Code(Struct, frozen=True, tag=True):
    """A command, or the content of a file."""

    text: str


Block = Note | Text | Table | Figure | Listing | Code


class Section(Struct, frozen=True):
    """A part of a report with a title."""

    title: str
    blocks: tuple[Block, ...]
    warning: str = ""
    """Danger that precedes the verdict, if a later command reports one."""


Row = tuple[str, str]
"""Name and sentence."""


class Group(Struct, frozen=True):
    """Rows of the answer below a title."""

    title: str
    """Title; empty for rows without one."""
    rows: tuple[Row, ...]


class Summary(Struct, frozen=True):
    """Answer of the terminal, and first screen of the page."""

    verdict: Note
    notes: tuple[Note, ...]
    """All notes, the dangers first."""
    table: Table | None
    """Runs that overturn without and with the pendulum; None if there are no runs."""
    groups: tuple[Group, ...]
    """Rows under a title: what to compare, to build, and to know, in this order."""
    commands: tuple[Row, ...] = ()
    """Further questions with commands, and the files of the report."""

    @property
    def dangers(self) -> tuple[Note, ...]:
        """The notes that are dangers, such as more overturning or wall contact."""
        return tuple(n for n in self.notes if n.severity is Severity.danger)


class Report(Struct, frozen=True):
    """A whole report, which is rendered as the text of the terminal and as an HTML page."""

    title: str
    summary: Summary
    figures: tuple[Figure, ...]
    """Drawing and animation, beside the summary."""
    sections: tuple[Section, ...]
    lines: int = MOST
    """Largest number of lines of the summary in the text."""
    added: tuple[Section, ...] = ()
    """Sections of commands that ran later. Each has the answer of one command."""
    page: str = ""
    """Name of the file with the interactive page; empty without one."""

    @property
    def warnings(self) -> tuple[Note, ...]:
        """Dangers of the added sections, which precede the verdict."""
        return tuple(danger(section.warning) for section in self.added if section.warning)


def glued(text: str) -> str:
    """Return the text with no-break spaces between numbers and their units."""
    return _UNIT.sub("\u00a0", text)


def wrapped(text: str, first: str = "", rest: str = "  ") -> list[str]:
    """Break a text into lines of at most 100 columns.

    Args:
        text: the text.
        first: prefix of the first line.
        rest: prefix of all other lines.
    """
    # `textwrap` does not break a line at a no-break space, so a number stays beside its unit.
    lines = textwrap.wrap(glued(text), _WIDTH, initial_indent=first, subsequent_indent=rest)
    return [line.replace("\u00a0", " ") for line in lines]
