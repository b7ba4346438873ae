"""AT2 files of the Pacific Earthquake Engineering Research Center: one component in g."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tpd.formats.channel import FACTORS, Channel, agree_on_count, chosen, orientation, unit_of
from tpd.formats.text import NUMBER, WHOLE, Cursor, NoAcceleration, UnreadableRecord, shown

_QUANTITY = re.compile(r"(\w+)\s+TIME\s+(?:HISTORY|SERIES)(?:\s+IN\s+UNITS?\s+OF\s*(\S*))?", re.IGNORECASE)
_COUNT_AND_STEP = re.compile(
    rf"NPTS\s*=\s*({WHOLE})\s*,?\s*DT\s*=\s*({NUMBER})\s*(?:SECS?|S)?\b\.?(?=[\s,;]|$)"
    rf"|^\s*({WHOLE})\s+({NUMBER})\s+NPTS\s*,\s*DT\s*$",
    re.IGNORECASE,
)
_TITLE = re.compile(
    r"(?:ACCEL|VELOC|DISPL)\w*\s+TIME\s+(?:HISTORY|SERIES)|\w+ TIME (?:HISTORY|SERIES) IN UNIT"
)
"""The line of the quantity; the words "time history" alone stand above other tables too."""
_HEAD = 6


def is_peer(lines: Sequence[str]) -> bool:
    """Return whether lines are those of an AT2 file, sound or not."""
    head = "\n".join(lines[:_HEAD]).upper()
    return "NPTS" in head or bool(_TITLE.search(head)) or bool(re.search(r"\bPEER\b", lines[0].upper()))


def read_peer(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the one channel of a file.

    Raises:
        UnreadableRecord: the file is damaged, contradicts itself, or holds no acceleration.
    """
    head: list[str] = []
    while not head or "NPTS" not in head[-1].upper():
        if len(head) == _HEAD:
            raise UnreadableRecord(f"the first {_HEAD} lines must state NPTS and DT, but do not")
        head.append(cursor.next("NPTS and DT"))
    line, stated = _unit(head)
    numbers = _COUNT_AND_STEP.search(head[-1])
    if numbers is None:
        raise UnreadableRecord(f"line {len(head)} must state NPTS and DT in s, but is {shown(head[-1])}")
    count, dt = int(numbers[1] or numbers[3]), float(numbers[2] or numbers[4])
    # In columns of Fortran mostly, but programs that imitate the format set numbers apart by blanks.
    values = cursor.free("the samples")
    agree_on_count(count, len(values), f"line {len(head)}")
    # Programs write numbers of one width: a last line that ends as the others do was not cut.
    tokens = [re.sub(r"^[+-]", "", token) for line in cursor.lines[-2:] for token in line.split()]
    cursor.require_end(whole=len(tokens) > 1 and len(tokens[-1]) == len(tokens[-2]))
    # The line above that of the unit is "event[, date], station, component".
    parts = [part.strip() for part in " ".join(head[line - 2].split() if line > 1 else []).split(",")]
    # A date behind the name tells events of one name apart, and a name may have commas: "Chi-Chi, Taiwan".
    many = next((i for i, part in enumerate(parts[:-1], 1) if re.search(r"\d/\d", part)), 1)
    event, name = ", ".join(parts[:many]), ", ".join(parts[many:])
    # The direction is the last word of the title; a name such as UP may be followed by remarks in brackets.
    component = re.sub(r"\(.*?\)", "", name.rpartition(",")[2]).strip() if "," in name else ""
    if orientation(component) is None:
        component = ""
    return [Channel(values * FACTORS[chosen(stated, unit)], dt, component, name, event)]


def _unit(head: Sequence[str]) -> tuple[int, str]:
    """The line with the quantity, from 1, and the unit that it states."""
    found = [(i, match) for i, line in enumerate(head, 1) if (match := _QUANTITY.search(line))]
    if not found:
        raise UnreadableRecord(
            "the header must state ACCELERATION TIME SERIES IN UNITS OF a unit, but does not"
        )
    line, quantity = found[0]
    if quantity[1].upper() != "ACCELERATION":
        wrong = f"line {line} must state an ACCELERATION, but is {shown(head[line - 1])}"
        if re.fullmatch(r"VELOCITY|DISPLACEMENT", quantity[1], re.IGNORECASE):
            raise NoAcceleration(wrong, quantity[1].lower())
        raise UnreadableRecord(wrong)
    return line, unit_of(quantity[2] or "", line)
