"""V1A (uncorrected) and V2A (corrected) files of GeoNet, New Zealand: one block a component."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tpd.formats.channel import Channel, agree, agree_on_count, agree_on_peak, agree_on_peak_time
from tpd.formats.text import NUMBER, Cursor, Decimal, UnreadableRecord, shown
from tpd.formats.units import FACTORS, chosen, unit_of

_FIRST = re.compile(r"^\s*(un)?corrected accelerogram\b.*\b(GNS|GeoNet)\b", re.IGNORECASE)
_TEXT, _COLUMNS, _WIDTH = 16, 10, 8
# Places in the header of integers (4 lines) and in that of reals (6 lines), from 0.
_COUNT_V1, _COUNT, _VELOCITIES, _DISPLACEMENTS = 30, 33, 34, 35
_STEP, _PADDING = 25, 21


def is_geonet(lines: Sequence[str]) -> bool:
    """Return whether lines are those of a GeoNet file, sound or not."""
    head = "\n".join(lines[:_TEXT])
    return bool(_FIRST.match(lines[0])) or bool(
        re.search(r"^Component\b.*", head, re.MULTILINE) and "mm/s" in head
    )


def read_geonet(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the channels of a file.

    Raises:
        UnreadableRecord: the file is damaged or contradicts itself.
    """
    channels = []
    while cursor.at == 0 or not cursor.only_blank_lines_follow():
        channels.append(_block(cursor, unit))
    cursor.require_end()
    return channels


def _block(cursor: Cursor, unit: str | None) -> Channel:
    start = cursor.at
    text = cursor.skip(_TEXT, "the end of the text header")
    first = _FIRST.match(text[0])
    if first is None:
        raise UnreadableRecord(
            f"line {start + 1} must be the title of an accelerogram, but is {shown(text[0])}"
        )

    def stated(line: int, pattern: str, what: str) -> re.Match[str]:
        found = re.search(pattern, text[line - 1], flags=re.IGNORECASE)
        if found is None:
            raise UnreadableRecord(f"line {start + line} must state {what}, but is {shown(text[line - 1])}")
        return found

    number = stated(10, rf"number of points\s+(\d+)\s+duration\s+({NUMBER})\s*s", "points and duration")
    step = stated(11, rf"at\s+(?:intervals of\s+)?({NUMBER})\s+s(?:ec)?\b", "the step")
    component = stated(13, r"^component\s+(\S+)", "the component")[1]
    peak = stated(14, rf"peak\s+({NUMBER})\s+(\S+)\s+at\s+({NUMBER})\s+s", "the peak and its time")
    integers = cursor.fixed(40, _COLUMNS, _WIDTH, "integers of the header")
    reals = cursor.fixed(60, _COLUMNS, _WIDTH, "reals of the header")
    own = unit_of(peak[2], start + 14)
    factor = FACTORS[chosen(own, unit)]
    if first[1]:
        raw = stated(11, rf"in units of\s+({NUMBER})\s+(\S+)\s+at", "the unit of the samples")
        factor *= float(raw[1])
        agree(FACTORS[unit_of(raw[2], start + 11)], FACTORS[own], "the unit in m/s^2")
    count, dt = int(number[1]), float(step[1])
    values = _samples(cursor, integers, count, corrected=not first[1])
    agree(dt, float(reals[_STEP]), "the step in s")
    length = Decimal.of(number[2])
    agree(count * dt, length.value, "the length in s", 1.01 * dt + length.unit)
    scaled = values * (factor / FACTORS[chosen(own, unit)])
    agree_on_peak(scaled, Decimal.of(peak[1]), f"line {start + 14}", digit=Decimal.of(peak[1]).unit)
    # Times count from the first sample recorded, before which zeros may be padded (s).
    agree_on_peak_time(scaled, dt, Decimal.of(peak[3]), f"line {start + 14}", start=-float(reals[_PADDING]))
    notes = ("uncorrected: an offset and a drift are left in it",) if first[1] else ()
    name = " ".join(text[1].split()[1:2])
    event = " ".join(text[7].split())
    return Channel(values * factor, dt, component, f"{name}/{component}", event, notes)


def _samples(cursor: Cursor, integers: np.ndarray, count: int, *, corrected: bool) -> np.ndarray:
    """The accelerations; velocities and displacements, which follow, are passed over."""
    place = _COUNT if corrected else _COUNT_V1
    agree_on_count(int(integers[place]), count, "the header of integers")
    values = cursor.fixed(count, _COLUMNS, _WIDTH, "samples")
    for what, of in ((_VELOCITIES, "velocities"), (_DISPLACEMENTS, "displacements")):
        if integers[what] < 0:
            raise UnreadableRecord(f"the header must state the number of {of}, but states {integers[what]:g}")
        cursor.fixed(int(integers[what]), _COLUMNS, _WIDTH, of)
    return values
