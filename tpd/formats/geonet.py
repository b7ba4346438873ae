"""V1A (uncorrected) and V2A (corrected) files of GeoNet, New Zealand, with one block per component."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tpd.formats.channel import (
    FACTORS,
    UNCORRECTED,
    Channel,
    agree,
    agree_on_count,
    agree_on_peak,
    agree_on_peak_time,
    factor_of,
    unit_of,
)
from tpd.formats.text import NUMBER, WHOLE, Cursor, Decimal, count_of, real

_FIRST = re.compile(r"^\s*(un)?corrected accelerogram\b.*\b(GNS|GeoNet)\b", re.IGNORECASE)
_POINTS = rf"number of points\s+({WHOLE})\s+duration\s+({NUMBER})\s*s"
_PEAK = rf"^\s*acceleration\W+peak\s+({NUMBER})\s+(\S+)\s+at\s+({NUMBER})\s+s"
_TEXT, _COLUMNS, _WIDTH = 16, 10, 8
# Indices in the header of integers (4 lines) and in that of reals (6 lines).
_COUNT_V1, _COUNT, _VELOCITIES, _DISPLACEMENTS = 30, 33, 34, 35
_STEP, _PADDING = 25, 21


def is_geonet(lines: Sequence[str]) -> bool:
    """Return whether lines are those of a GeoNet file, also if it is damaged."""
    head = "\n".join(lines[:_TEXT])
    has_component = re.search(r"^Component\b", head, re.MULTILINE) and "mm/s" in head
    return bool(_FIRST.match(lines[0]) or has_component)


def read_geonet(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the channels of a file.

    Raises:
        UnreadableRecord: the file is damaged or contradicts itself.
    """
    channels = []
    while not cursor.only_blank_lines_follow():
        channels.append(_block(cursor, unit))
    cursor.require_end()
    return channels


def _block(cursor: Cursor, unit: str | None) -> Channel:
    """Return the channel of the next block."""
    text = cursor.header(_TEXT)
    corrected = not text.match(1, _FIRST.pattern, "the title of an accelerogram")[1]
    component = text.match(13, r"^component\s+(\S+)", "the component")[1]
    integers = cursor.fixed(40, _COLUMNS, _WIDTH, "integers of the header")
    reals = cursor.fixed(60, _COLUMNS, _WIDTH, "reals of the header")
    # Velocities and displacements follow the accelerations. They are read only to skip them.
    places = {"samples": _COUNT if corrected else _COUNT_V1}
    places |= {"velocities": _VELOCITIES, "displacements": _DISPLACEMENTS}
    counts = {of: count_of(integers, place, of) for of, place in places.items()}
    values, *_ = [cursor.fixed(count, _COLUMNS, _WIDTH, of) for of, count in counts.items()]
    number = text.match(10, _POINTS, "points and duration")
    agree_on_count(int(number[1]), len(values), text.where(10))
    dt = real(text.match(11, rf"at\s+(?:intervals of\s+)?({NUMBER})\s+s(?:ec)?\b", "the step")[1])
    agree(dt, float(reals[_STEP]), "the step in s")
    length = Decimal.of(number[2])
    # For n samples some files state the time from the first to the last sample, and others n steps.
    agree(len(values) * dt, length.value, "the length in s", 1.01 * dt + length.unit)
    peak = text.match(14, _PEAK, "the peak and its time")
    size, time, own = Decimal.of(peak[1]), Decimal.of(peak[3]), unit_of(peak[2], text.start + 14)
    agree_on_peak(values, size, text.where(14), digit=size.unit)
    # Times are relative to the first recorded sample, before which zeros may be inserted.
    agree_on_peak_time(values, dt, time, text.where(14), start=-float(reals[_PADDING]))
    if not corrected:
        # Uncorrected files also state the unit of the samples, as a number and a unit.
        raw = text.match(11, rf"in units of\s+({NUMBER})\s+(\S+)\s+at", "the unit of the samples")
        agree(real(raw[1]) * FACTORS[unit_of(raw[2], text.start + 11)], FACTORS[own], "the unit in m/s^2")
    notes = () if corrected else (UNCORRECTED,)
    name, event = " ".join(text.lines[1].split()[1:2]), " ".join(text.lines[7].split())
    return Channel(values * factor_of(own, unit), dt, component, f"{name}/{component}", event, notes)
