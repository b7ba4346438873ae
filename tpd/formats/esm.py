"""ASCII files of the Engineering Strong Motion database (ESM): keys and values, followed by one component."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tpd.formats.channel import (
    FACTORS,
    UNCORRECTED,
    UNSTATED,
    Channel,
    agree,
    agree_on_count,
    agree_on_peak,
    agree_on_peak_time,
    factor_of,
    unit_of,
)
from tpd.formats.text import NUMBER, Cursor, Decimal, NoAcceleration, UnreadableRecord, quote

_KEYS = ("EVENT_NAME:", "SAMPLING_INTERVAL_S:", "NDATA:", "DATA_TYPE:", "STATION_CODE:")
_EVENT = ("EVENT_NAME", "EVENT_DATE_YYYYMMDD", "EVENT_TIME_HHMMSS")
_FACTOR = re.compile("SCALE|SCALING|FACTOR|GAIN|CALIB|MULTIPL|NORMALI")
"""Parts of keys that may change the size of samples."""
_KEY = re.compile(r"^([A-Z][A-Z0-9_/^]*):(.*)$")


def is_esm(lines: Sequence[str]) -> bool:
    """Return whether lines are those of an ESM file, also if it is damaged."""
    # Test several keys, because one of them may be damaged.
    return sum(line.startswith(_KEYS) for line in lines[:64]) >= 2


def read_esm(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the only channel of a file, in a list.

    Raises:
        UnreadableRecord: the file is damaged, contradicts itself, or contains no acceleration.
    """
    head = _head(cursor)
    kind = _text(head, "DATA_TYPE")
    if kind.upper() != "ACCELERATION":
        wrong = f"DATA_TYPE must be ACCELERATION, but is {quote(kind)}"
        if re.fullmatch(r"VELOCITY|DISPLACEMENT|.*SPECTR.*", kind, re.IGNORECASE):
            raise NoAcceleration(wrong, kind.lower())
        raise UnreadableRecord(wrong)
    stated = unit_of(_text(head, "UNITS"), head.get("UNITS", (0, ""))[0])
    count, step = _number(head, "NDATA"), _number(head, "SAMPLING_INTERVAL_S")
    if count is None or step is None or count.unit != 1.0:
        raise UnreadableRecord("the header must state a whole NDATA, and SAMPLING_INTERVAL_S, but does not")
    first = cursor.at
    # A line with two numbers belongs to another kind of file.
    values = cursor.free("the samples")
    if len(values) != sum(bool(line.strip()) for line in cursor.lines[first:]):
        raise UnreadableRecord(f"the lines from {first + 1} on must contain one sample each")
    cursor.require_end()
    agree_on_count(int(count.value), len(values), "NDATA")
    dt = step.value
    length, peak, time = (_number(head, key) for key in ("DURATION_S", "PGA_CM/S^2", "TIME_PGA_S"))
    # Values of keys may be missing.
    if length is not None:
        agree(len(values) * dt, length.value, "the length in s", 1.01 * dt + length.unit)
    if peak is not None and values.size:
        in_cm = np.abs(values) * (FACTORS[stated] / FACTORS["cm/s2"])
        # Some files state the peak with its sign, and others without.
        agree_on_peak(in_cm, Decimal(abs(peak.value), peak.unit), "PGA_CM/S^2", digit=peak.unit)
    if time is not None and values.size:
        agree_on_peak_time(values, dt, time, "TIME_PGA_S")
    component, event = _text(head, "STREAM"), _text(head, *_EVENT)
    name = f"{_text(head, 'NETWORK')}.{_text(head, 'STATION_CODE')}/{component}"
    # A record with its baseline removed counts as corrected.
    factor, baseline = factor_of(stated, unit), _text(head, "BASELINE_CORRECTION").upper()
    removed = "REMOVED" in baseline and "NOT" not in baseline
    notes = () if removed else (UNCORRECTED if baseline else UNSTATED,)
    return [Channel(values * factor, dt, component, name, event and f"{event} UTC", notes)]


def _head(cursor: Cursor) -> dict[str, tuple[int, str]]:
    """Return the line and the value of each key."""
    head: dict[str, tuple[int, str]] = {}
    while match := _KEY.match(cursor.peek()):
        cursor.next("a key")
        if match[1] in head:
            raise UnreadableRecord(f"line {cursor.at} states {match[1]} a second time")
        if match[2].strip() and _FACTOR.search(match[1].replace("FULL_SCALE", "")):
            raise UnreadableRecord(f"line {cursor.at} has {quote(match[0])}, which is not understood")
        head[match[1]] = (cursor.at, match[2].strip())
    return head


def _text(head: dict[str, tuple[int, str]], *keys: str) -> str:
    """Return the values of keys as one text, as far as they exist."""
    return " ".join(head[key][1] for key in keys if key in head).strip()


def _number(head: dict[str, tuple[int, str]], key: str) -> Decimal | None:
    """Return the number of a key; None if there is none."""
    line, text = head.get(key, (0, ""))
    if not text:
        return None
    if not re.fullmatch(NUMBER, text):
        raise UnreadableRecord(f"line {line} must state {key} as a number, but has {quote(text)}")
    return Decimal.of(text)
