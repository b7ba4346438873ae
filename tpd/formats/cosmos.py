"""Files of the Consortium of Organizations for Strong Motion Observation Systems (COSMOS), format 1.20.

The file contains blocks of acceleration, velocity and displacement. Only the accelerations are returned.
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
    agree_on_peak,
    agree_on_peak_time,
    factor_of,
    unit_of,
)
from tpd.formats.text import NUMBER, WHOLE, Cursor, Decimal, NoAcceleration, UnreadableRecord, fortran, number

_FIRST = r"^\s*(corrected|uncorrected|raw)\s+(\w+)\s*(?:counts)?\s*\(format v\S+ with (\d{1,3}) text lines\)"
_DATA = (
    rf"^\s*({WHOLE})\s+(accel\w*|veloc\w*|displ\w*|raw accel\w*)\.?\s+pts,\s*approx\s+({NUMBER})\s+secs?,"
    r"\s*units\s*=\s*(.*?)\s*\(\s*(\d+)\s*\),\s*format\s*=\s*\([^()]*\)[\s.]*$"
)
_CODES = {2: "g", 4: "cm/s2", 7: "in/s2", 10: "gal", 11: "mg"}
"""Units of acceleration by their code. Other codes are those of other quantities."""
_PEAK = rf"\bmax\s*=\s*({NUMBER})\s+(\S+?),?\s+at\s+({NUMBER})\s*sec"
# Indices in the header of reals.
_STEP, _LENGTH, _PEAK_VALUE, _PEAK_TIME = 61, 62, 63, 64
_TEXT = 13


def is_cosmos(lines: Sequence[str]) -> bool:
    """Return whether lines are those of a COSMOS file, also if it is damaged."""
    head = "\n".join(lines[:60]).lower()
    return "(format v" in lines[0].lower() or "integer-header values" in head or "real-header values" in head


def read_cosmos(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the channels of a file.

    Raises:
        UnreadableRecord: the file is damaged, contradicts itself, or contains counts of the instrument.
    """
    blocks: list[Channel | str] = []
    while not cursor.only_blank_lines_follow():
        blocks.append(_block(cursor, unit))
    cursor.require_end()
    channels = [block for block in blocks if isinstance(block, Channel)]
    if not channels:
        others = " and ".join(dict.fromkeys(map(str, blocks)))
        raise NoAcceleration(f"the file must contain an acceleration, but has only {others}", others)
    return channels


def _block(cursor: Cursor, unit: str | None) -> Channel | str:
    """Return the channel of the next block, or the word for its quantity if this is not an acceleration."""
    text = cursor.header(_TEXT)
    first = text.match(1, _FIRST, "the quantity and the format")
    if int(first[3]) != _TEXT:
        raise UnreadableRecord(f"{text.where(1)} must state {_TEXT} text lines, but states {first[3]}")
    _header(cursor, "integer")
    reals = _header(cursor, "real")
    cursor.comments(int(cursor.match(rf"^\s*({WHOLE})\s+comment line", "the number of comment lines")[1]))
    quantity, own, code, values = _samples(cursor)
    # Velocities and displacements are read as well, because a file that is damaged there is rejected.
    if not quantity.lower().startswith("accel"):
        return "velocity" if quantity.lower().startswith("veloc") else "displacement"
    if not first[2].lower().startswith("accel"):
        raise UnreadableRecord(f"{text.where(1)} states {first[2]}, but the samples are {quantity}")
    if not _is_stated(reals[_STEP]) or reals[_STEP] <= 0.0:
        raise UnreadableRecord(f"real number {_STEP + 1} must be the step in ms, but is {reals[_STEP]:g}")
    dt = float(reals[_STEP]) / 1000.0
    # Some agencies state n steps for n samples, and others n - 1.
    if _is_stated(reals[_LENGTH]):
        agree(len(values) * dt, float(reals[_LENGTH]), "the length in s", tolerance=1.5 * dt)
    stated = text.match(11, _PEAK, "the peak and its time")
    for unit_stated in (stated[2], _CODES.get(code, f"of code {code}")):
        factor = FACTORS[unit_of(unit_stated, text.start + 11)]
        agree(factor, FACTORS[unit_of(own, text.start + 11)], "the unit in m/s^2")
    peak, time = Decimal.of(stated[1]), Decimal.of(stated[3])
    # Samples have more digits than the statement.
    agree_on_peak(values, peak, text.where(11), digit=0.0)
    agree_on_peak_time(values, dt, time, text.where(11))
    if _is_stated(reals[_PEAK_VALUE]):
        agree(peak.value, float(reals[_PEAK_VALUE]), "the peak", 1.01 * peak.unit)
    if _is_stated(reals[_PEAK_TIME]):
        agree(time.value, float(reals[_PEAK_TIME]), "the time of the peak", 1.01 * time.unit)
    # Files contain "Sta Chan 1: 90 deg (" or "Sta Cha: 1: 340 deg (".
    match = re.search(r"^Sta\s+Cha(?:\w*\s+\S+:|\w*:\s*\S+\s)\s*(.*?)\s*\(", text.lines[8], re.IGNORECASE)
    component = match[1] if match else ""
    station = re.search(r"Code:\s*(\S.*?)\s*$", text.lines[4], re.IGNORECASE)
    name = " ".join(station[1].split()) if station else ""
    notes = () if first[1].lower() == "corrected" else (UNCORRECTED,)
    event = re.sub(r"^r(?:ecord|crd) of\s+", "", " ".join(text.lines[1].split()), flags=re.IGNORECASE)
    factor = factor_of(unit_of(own, cursor.at), unit)
    return Channel(values * factor, dt, component, f"{name}/{component}".strip("/"), event, notes)


def _samples(cursor: Cursor) -> tuple[str, str, int, np.ndarray]:
    """Return quantity, unit, code of the unit, and numbers of a block."""
    line = cursor.peek()
    data = cursor.match(_DATA, "number, length, unit and format of the samples")
    if "count" in data[4].lower() or data[2].lower().startswith("raw"):
        content, remedy = "counts of the instrument", "a file in a unit of acceleration is needed"
        raise NoAcceleration(f"line {cursor.at} states {content}: {remedy}", content)
    columns, width, _ = fortran(line, cursor.at)
    values = cursor.fixed(int(data[1]), columns, width, "samples")
    cursor.match(r"^\W*end-?\s?of-?\s?data", "the end of the data")
    return data[2], data[4], int(data[5]), values


def _header(cursor: Cursor, what: str) -> np.ndarray:
    """Return one of the two headers of numbers. There may be no blank between two fields."""
    line = cursor.peek()
    form = rf"^\s*({WHOLE})\s+{what}-header values follow on\s+({WHOLE})\s+lines"
    stated = cursor.match(form, f"the {what} header")
    _, width, _ = fortran(line, cursor.at)
    values: list[float] = []
    for _ in range(int(stated[2])):
        row = cursor.next(f"the end of the {what} header").rstrip()
        values += [number(row[i : i + width], cursor.at) for i in range(0, len(row), width)]
    if len(values) != int(stated[1]) or len(values) != 100:
        raise UnreadableRecord(f"the {what} header must contain 100 numbers, but contains {len(values)}")
    return np.array(values)


def _is_stated(value: float) -> bool:
    """Whether the file states a number. The value -999 means that it does not."""
    return round(value) != -999
