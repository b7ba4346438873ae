"""SMC files of the U.S. Geological Survey: one component in cm/s^2, which the format prescribes."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tpd.formats.channel import UNCORRECTED, Channel, agree_on_peak, agree_on_peak_time, factor_of
from tpd.formats.text import Cursor, Decimal, NoAcceleration, UnreadableRecord, count_of, quote

_KINDS = re.compile(r"^\s*(\d?)\s*(UN)?CORRECTED\s+ACCELEROGRAM(.*)", re.IGNORECASE)
_OTHER = re.compile(r"^\s*\d\s+(VELOCITY|DISPLACEMENT|RESPONSE|FOURIER)", re.IGNORECASE)
_CONTENTS = {"response": "response spectrum", "fourier": "Fourier spectrum"}
_TEXT, _INTEGERS, _REALS = 11, 6, 10
_UNKNOWN_INTEGER, _UNKNOWN_REAL = -32768, 1.0e38
# Indices in the two headers of numbers.
_VERTICAL_ANGLE, _AZIMUTH, _COMMENTS, _COUNT = 12, 13, 15, 16
_RATE, _TIME_OF_MAX, _MAX, _TIME_OF_MIN, _MIN = 1, 28, 29, 30, 31
_DIGITS = 4
"""Number of decimals of a sample, which has one digit before the point and an exponent."""


def is_smc(lines: Sequence[str]) -> bool:
    """Return whether lines are those of an SMC file, also if it is damaged."""
    # Even if the title is damaged, lines 2 and 9 to 11 contain stars.
    starred = sum(line.strip() == "*" for line in lines[:_TEXT]) >= 2
    named = bool(_KINDS.match(lines[0]) or _OTHER.match(lines[0]))
    return starred or (named and lines[0].strip()[:1].isdigit())


def read_smc(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the only channel of a file, in a list.

    Raises:
        UnreadableRecord: the file is damaged, contradicts itself, or contains no acceleration.
    """
    text = cursor.skip(_TEXT, "the end of the text header")
    kind = _KINDS.match(text[0])
    if kind is None or kind[3].strip():
        wrong = f"line 1 must be an accelerogram, corrected or not, but is {quote(text[0])}"
        if other := _OTHER.match(text[0]):
            raise NoAcceleration(wrong, _CONTENTS.get(other[1].lower(), other[1].lower()))
        raise UnreadableRecord(wrong)
    if text[1].strip() != "*" or text[_TEXT - 1].strip() != "*":
        raise UnreadableRecord(f"lines 2 and {_TEXT} must be '*': the text header is damaged")
    integers = cursor.fixed(8 * _INTEGERS, 8, 10, "integers")
    start = cursor.at
    reals = cursor.fixed(5 * _REALS, 5, 15, "numbers")
    printed = [line[i : i + 15].strip() for line in cursor.lines[start : cursor.at] for i in range(0, 75, 15)]
    # Check the rate before the samples, because the samples of a film are pairs of time and acceleration.
    rate = float(reals[_RATE])
    if rate > _UNKNOWN_REAL:
        why = "the samples are at unequal times, read from a film"
        raise UnreadableRecord(f"the header states no rate: {why}")
    if not 1.0 <= rate <= 1e5:
        raise UnreadableRecord(f"the header must state a rate of 1 to 1e5 samples/s, but states {rate:g}")
    dt = 1.0 / rate
    cursor.comments(count_of(integers, _COMMENTS, "comment lines"))
    values = cursor.fixed(count_of(integers, _COUNT, "samples"), 8, 10, "samples")
    cursor.require_end()
    _agree(values, dt, reals, printed)
    # The line of the station may also contain the component: "component= UP".
    named = re.search(r"component\s*=\s*(\S.*?)\s*$", text[5], flags=re.IGNORECASE)
    azimuth = integers[_AZIMUTH]
    level = "" if azimuth == _UNKNOWN_INTEGER else f"{azimuth:.0f} DEG"
    component = {0.0: "UP", 180.0: "DOWN"}.get(float(integers[_VERTICAL_ANGLE]), level)
    component, event = component or (named[1] if named else ""), " ".join(text[3].split())
    match = re.search(r"station\s*=\s*(.*?)\s*(?:component\s*=.*)?$", text[5], flags=re.IGNORECASE)
    station = " ".join(match[1].split()) if match else ""
    notes, factor = ((UNCORRECTED,) if kind[2] else ()), factor_of("cm/s2", unit)
    return [Channel(values * factor, dt, component, f"{station}/{component}", event, notes)]


def _agree(values: np.ndarray, dt: float, reals: np.ndarray, printed: list[str]) -> None:
    """Check the largest and the smallest sample against the header, if the header states them."""
    for place, time, sign in ((_MAX, _TIME_OF_MAX, 1.0), (_MIN, _TIME_OF_MIN, -1.0)):
        if abs(reals[place]) >= _UNKNOWN_REAL or not values.size:
            continue
        # Keep only the samples of one sign, to find the extreme of this sign.
        half = np.maximum(sign * values, 0.0)
        stated = Decimal.of(printed[place])
        # Samples have one digit before the point, so the size of their last digit depends on the
        # exponent.
        digit = 10.0 ** (np.floor(np.log10(max(abs(stated.value), 1e-30))) - _DIGITS)
        agree_on_peak(sign * half, stated, "the header", digit=float(digit))
        if abs(reals[time]) < _UNKNOWN_REAL:
            agree_on_peak_time(half, dt, Decimal.of(printed[time]), "the header")
