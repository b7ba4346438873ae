"""AT2 files of the Pacific Earthquake Engineering Research Center: one component in g."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tpd.formats.channel import (
    TIMES,
    Channel,
    agree,
    agree_on_count,
    factor_of,
    orientation,
    unit_of,
)
from tpd.formats.text import NUMBER, WHOLE, Cursor, Decimal, NoAcceleration, UnreadableRecord, quote, real

_QUANTITY = re.compile(r"\s*(.*?)\s+TIME\s+(?:HISTORY|SERIES)\b(?:\s+IN\s+UNITS?\s+OF\b)?(.*)", re.IGNORECASE)
_FILTER = re.compile(
    rf"\bFILTER\s+POINTS?\s*:?(?:\s*[HL]P\s*=\s*(?:{NUMBER}|NULL)\s*(?:HZ)?[\s,;]*)*$", re.IGNORECASE
)
_COUNT_AND_STEP = re.compile(
    rf"\s*(?:NPTS\s*=\s*({WHOLE})\s*,?\s*DT\s*=\s*({NUMBER})\s*([A-Z]*)"
    rf"|({WHOLE})\s+({NUMBER})\s+NPTS\s*,\s*DT)\b[\s.,;]*(?:DURATION\s*=\s*({NUMBER})\s*([A-Z]*)[\s.,;]*)?"
    r"(?:\((?:corrected|processed|filtered)\))?[\s.,;]*",
    re.IGNORECASE,
)
_TITLE = re.compile(
    r"(?:ACCEL|VELOC|DISPL)\w*\s+TIME\s+(?:HISTORY|SERIES)|\w+ TIME (?:HISTORY|SERIES) IN UNIT"
)
"""Pattern of the line with the quantity. The words "time history" alone also occur above other tables."""
_NO_NAME = re.compile(
    r"\b(?:scaled|norm(?:ed|ali[sz]ed)|halved|doubled|amplified|counts?|volts?|veloc\w+|displac\w+|(?:scale|factor)\W{0,3}\d[\d.]*"
    r"|spectr\w+(?!.*(?:compatible|match)))\b|\(\s*(?:x|times|by|[*])\s*\d[\d.]*\s*\)",
    re.IGNORECASE,
)
"""Words that are more than the name of a place or an earthquake."""
_HEAD = 6


def is_peer(lines: Sequence[str]) -> bool:
    """Return whether lines are those of an AT2 file, also if it is damaged."""
    head = "\n".join(lines[:_HEAD]).upper()
    # Each mark alone also occurs above tables.
    marks = "NPTS" in head, "IN UNIT" in head, _TITLE.search(head), re.search(r"\bPEER\b", lines[0].upper())
    return sum(map(bool, marks)) >= 2


def read_peer(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the only channel of a file, in a list.

    Raises:
        UnreadableRecord: the file is damaged, contradicts itself, or contains no acceleration.
    """
    head, (line, stated) = list[str](), _unit(cursor.lines[:_HEAD])
    # The header ends with the line that states the number of samples and the step.
    while not head or "NPTS" not in head[-1].upper():
        if len(head) == _HEAD:
            raise UnreadableRecord(f"the first {_HEAD} lines must state NPTS and DT, but do not")
        head.append(cursor.next("NPTS and DT"))
    numbers = _COUNT_AND_STEP.fullmatch(head[-1])
    units = [((numbers and numbers[i]) or "s").lower() for i in (3, 7)]
    if numbers is None or not {*units} <= {*TIMES}:
        raise UnreadableRecord(f"line {len(head)} must state NPTS and DT in s, but is {quote(head[-1])}")
    count, dt = int(numbers[1] or numbers[4]), real(numbers[2] or numbers[5]) * TIMES[units[0]]
    # The numbers are usually in columns of Fortran, but some programs separate them by blanks.
    values = cursor.free("the samples")
    agree_on_count(count, len(values), f"line {len(head)}")
    if numbers[6]:
        length, scale = Decimal.of(numbers[6]), TIMES[units[1]]
        agree(count * dt, length.value * scale, "the length in s", 1.01 * dt + length.unit * scale)
    # Programs write numbers of one width, so a last number as long as the others was not cut.
    tokens = [re.sub(r"^[+-]", "", token) for line in cursor.lines[-2:] for token in line.split()]
    cursor.require_end(whole=len(tokens) > 1 and len(tokens[-1]) == len(tokens[-2]))
    # The line above the line of the unit is "event[, date], station, component".
    parts = [part.strip() for part in " ".join(head[line - 2].split() if line > 1 else []).split(",")]
    # A date after the name distinguishes events with the same name, and a name may contain commas: "Chi-Chi,
    # Taiwan".
    many = next((i for i, part in enumerate(parts[:-1], 1) if re.search(r"\d/\d", part)), 1)
    event, name = ", ".join(parts[:many]), ", ".join(parts[many:])
    # The direction is the last word of the title. A name such as UP may be followed by remarks in brackets.
    component = re.sub(r"\(.*?\)", "", name.rpartition(",")[2]).strip() if "," in name else ""
    if orientation(component) is None:
        component = ""
    return [Channel(values * factor_of(stated, unit), dt, component, name, event)]


def _unit(head: Sequence[str]) -> tuple[int, str]:
    """Return the number of the line with the quantity, from 1, and the unit that the line states.

    The lines above the number of samples may name places and earthquakes, and nothing else.
    """
    matches = [(i, match) for i, line in enumerate(head, 1) if (match := _QUANTITY.fullmatch(line))]
    if not matches:
        wanted = "ACCELERATION TIME SERIES IN UNITS OF a unit"
        raise UnreadableRecord(f"the header must state {wanted}, but does not")
    line, quantity = matches[0]
    if quantity[1].upper() != "ACCELERATION":
        wrong = f"line {line} must state an ACCELERATION, but is {quote(head[line - 1])}"
        # The database has three files of each component, and the wrong one is a common mistake.
        if other := re.search(r"VELOCITY|DISPLACEMENT", quantity[1], re.IGNORECASE):
            raise NoAcceleration(wrong, other[0].lower())
        raise UnreadableRecord(wrong)
    # The lines above the number of points are the header; the numbers follow.
    count = next((i for i, text in enumerate(head) if "NPTS" in text.upper()), len(head))
    for i, text in enumerate(head[:count], 1):
        if i != line and (word := _NO_NAME.search(text)):
            raise UnreadableRecord(f"line {i} has {quote(word[0])}, which is not understood")
    return line, unit_of(_FILTER.sub("", quantity[2]), line)
