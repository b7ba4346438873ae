"""Volume 1 (uncorrected) and Volume 2 (corrected) of the California Strong Motion Instrumentation Program.

A file contains one block per channel: text, a header of integers, a header of reals, the samples after a line
that describes them, and a line that ends the channel. All quantities that are stated twice must agree.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

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
from tpd.formats.text import NUMBER, WHOLE, Cursor, Decimal, Header, UnreadableRecord, fortran, quote, real

_FIRST = re.compile(r"^\s*(un)?corrected accelerogram\b(?!.*GNS)", re.IGNORECASE)
_V2_TEXT, _V2_INTEGERS, _V2_REALS = 25, 7, 13
_V1_TEXT, _V1_INTEGERS, _V1_REALS = 13, 7, 7
_END = r"^/&.*end of data"
_CHANNEL = r"\bchan\w*\s+\d+\s*:\s*(\S.*?)\s*$"
# Statements in the text of a Volume 2, and the last two in that of a Volume 1.
_PEAK = rf"peak\s+acceleration\s*=\s*({NUMBER})\s+(\S+)\s+at\s+({NUMBER})"
_POINTS = rf"points\s*=\s*({WHOLE})\s+record length\s*=\s*({NUMBER})\s*sec"
_UNIT_AND_PEAK = (
    rf"units of.* (?:sec and|is)\s+(.+?)\s*\.?\s+max\s*=\s*({NUMBER})\s*(\S+?)\s*,?\s+at\s+({NUMBER})"
)


def is_csmip(lines: Sequence[str]) -> bool:
    """Return whether lines are those of a CSMIP file, also if it is damaged."""
    head = "\n".join(lines[:13]).lower()
    # The titles of GeoNet begin in the same way. Several marks are tested, because a line of the header may
    # be damaged.
    if " gns " in head or "accelerogram" not in head:
        return False
    marks = "csmip", "cdmg", "uncorrected accelerogram"
    return bool(_FIRST.match(lines[0])) or any(mark in head for mark in marks)


def read_csmip(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the channels of a file.

    Raises:
        UnreadableRecord: the file is damaged or contradicts itself.
    """
    channels = []
    while not channels or not cursor.only_blank_lines_follow():
        first = _FIRST.match(cursor.peek())
        if first is None:
            cursor.match(_FIRST.pattern, "the volume ('corrected' or 'uncorrected accelerogram')")
        channels.append(_volume_1(cursor, unit) if first and first[1] else _volume_2(cursor, unit))
    cursor.require_end()
    return channels


def _volume_2(cursor: Cursor, unit: str | None) -> Channel:
    """Return the channel of the next block of a Volume 2."""
    text = cursor.header(_V2_TEXT)
    component, event, name = _words(text, at=8)
    count = int(text.match(16, rf"^\s*({WHOLE})\s+points of", "the number of points")[1])
    dt = real(text.match(17, rf"intervals? of\s+({NUMBER})\s+sec", "the step")[1])
    peak = text.match(18, _PEAK, "the peak acceleration")
    _headers(cursor, _V2_INTEGERS, _V2_REALS)
    values, own, digit = _block(cursor, "accel", count, dt)
    agree(FACTORS[unit_of(peak[2], text.start + 18)], FACTORS[own], "the unit in m/s^2")
    agree_on_peak(values, Decimal.of(peak[1]), text.where(18), digit=digit)
    agree_on_peak_time(values, dt, Decimal.of(peak[3]), text.where(18))
    for kind in ("veloc", "displ"):
        # Velocities and displacements are not used, but a file that is damaged here is not reliable.
        _block(cursor, kind, count, dt)
    cursor.match(_END, "the end of the channel")
    return Channel(values * factor_of(own, unit), dt, component, f"{name}/{component}", event)


def _volume_1(cursor: Cursor, unit: str | None) -> Channel:
    """Return the channel of the next block of a Volume 1."""
    text = cursor.header(_V1_TEXT)
    component, event, name = _words(text, at=7)
    stated = text.match(11, _POINTS, "points and length")
    _headers(cursor, _V1_INTEGERS, _V1_REALS)
    count, dt, own, (columns, width, digit) = _read_description(cursor)
    agree_on_count(int(stated[1]), count, text.where(11))
    length = Decimal.of(stated[2])
    # For n samples some files state n steps, and others n - 1 steps.
    agree(count * dt, length.value, "the length in s", 0.51 * length.unit + 1.01 * dt)
    values = cursor.fixed(count, columns, width, "samples")
    peak = text.match(12, _UNIT_AND_PEAK, "the unit, the peak and its time")
    for stated_unit in (peak[1], peak[3]):
        agree(FACTORS[unit_of(stated_unit, text.start + 12)], FACTORS[own], "the unit in m/s^2")
    agree_on_peak(values, Decimal.of(peak[2]), text.where(12), digit=digit)
    agree_on_peak_time(values, dt, Decimal.of(peak[4]), text.where(12))
    cursor.match(_END, "the end of the channel")
    factor, notes = factor_of(own, unit), (UNCORRECTED,)
    return Channel(values * factor, dt, component, f"{name}/{component}", event, notes)


def _read_description(cursor: Cursor) -> tuple[int, float, str, tuple[int, int, float]]:
    """Return number, step, unit and format (as `fortran`) of the samples of a Volume 1 from the line above
    them."""
    if "points" not in cursor.peek().lower():
        film = "A film that was digitised at unequal times has no such line: use its Volume 2"
        raise UnreadableRecord(f"line {cursor.line} must describe the samples. {film}")
    line = cursor.peek()
    # Digital instruments have a sampling rate, and digitised films have a step.
    by_rate = rf"accelerogram points at\s+({NUMBER})\s+pts/sec,? in units of\s+(.+?)\s*\.?\s+format:?\s*"
    by_step = rf"points of accel data equally spaced at\s+({NUMBER})\s+sec\.?\s+\(units:\s*([^)]*)\)"
    form = rf"^\s*({WHOLE})\s+(?:{by_rate}\([^()]*\)|{by_step})\W*$"
    match = cursor.match(form, "number, step and unit of the samples")
    rate_or_step = real(match[2] or match[4])
    if rate_or_step <= 0.0:
        raise UnreadableRecord(f"line {cursor.at} must state a rate or a step above zero")
    # Digitised films have a fixed format of columns, which the line does not state.
    shape = fortran(line, cursor.at) if match[2] else (8, 9, 1e-6)
    step = 1.0 / rate_or_step if match[2] else rate_or_step
    return int(match[1]), step, unit_of(match[3] or match[5], cursor.at), shape


def _words(text: Header, at: int) -> tuple[str, str, str]:
    """Return component, event and station of a header whose line `at` (from 1) contains the channel."""
    component = text.match(at, _CHANNEL, "the channel")[1]
    # Several blanks separate names from further remarks. New files state the time of the record twice.
    parts = re.split(r"\s{2,}", text.lines[at].strip())
    event = dict.fromkeys(re.sub(r"^r(?:ecord|crd) of ", "", part, flags=re.IGNORECASE) for part in parts)
    return component, " ".join(event), re.split(r"\s{3,}", text.lines[at - 2].strip())[0]


def _headers(cursor: Cursor, integers: int, reals: int) -> None:
    """Read the headers of numbers. Their content is not used, but they must exist."""
    # There may be no blanks between fields, so only the length of a line can be checked.
    for rows, width, what in ((integers, 5, "integer"), (reals, 10, "real")):
        for _ in range(rows):
            line = cursor.next(f"the end of the {what} header").rstrip()
            if len(line) % width or re.search(r"[A-Za-z]{2}", line):
                wrong = f"line {cursor.at} must belong to the {what} header"
                raise UnreadableRecord(f"{wrong}, but is {quote(line)}")


def _block(cursor: Cursor, kind: str, count: int, dt: float) -> tuple[np.ndarray, str, float]:
    """Return the numbers of one block of a Volume 2, their unit (as it is written, except for accelerations),
    and the size of their last digit."""
    match = cursor.match(
        rf"^\s*({WHOLE})\s+points of {kind} data equally spaced at\s+({NUMBER})\s+sec\W*?"
        r"(?:\(units:\s*([^)]*)\)|\bin\s+(\S+))[\s.]*(\(\s*\d+\s*f\d+\.\d+\s*\))?\W*$",
        f"the {kind} data, their step and their unit",
    )
    at = cursor.at
    agree_on_count(count, int(match[1]), f"line {at}")
    agree(dt, real(match[2]), "the step in s")
    # Old files state no format. All of them have the same one.
    columns, width, digit = fortran(match[5], at) if match[5] else (8, 10, 1e-3)
    stated = match[3] or match[4] or ""
    unit = unit_of(stated, at) if kind == "accel" else stated
    return cursor.fixed(count, columns, width, "samples"), unit, digit
