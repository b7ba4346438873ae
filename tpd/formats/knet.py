"""Files of K-NET and KiK-net (NIED, Japan).

A file in ASCII contains one component as integers with a factor. A file in CSV contains three components in
gal after comments.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tpd.formats.channel import (
    BOREHOLE,
    FACTORS,
    UNCORRECTED,
    Channel,
    agree,
    agree_on_count,
    agree_on_peak,
    factor_of,
    unit_of,
)
from tpd.formats.text import NUMBER, WHOLE, Cursor, Decimal, UnreadableRecord, number, quote, real

_KEYS = (
    *("Origin Time", "Lat.", "Long.", "Depth. (km)", "Mag.", "Station Code", "Station Lat."),
    *("Station Long.", "Station Height(m)", "Record Time", "Sampling Freq(Hz)", "Duration Time(s)", "Dir."),
    *("Scale Factor", "Max. Acc. (gal)", "Last Correction", "Memo."),
)
_WIDTH = 18
"""Number of characters of a key."""
_COLUMN = 9
"""Number of characters of a sample, including a blank at its end."""
_BOREHOLE = {"1": "N-S", "2": "E-W", "3": "U-D"}
_SURFACE = {"4": "N-S", "5": "E-W", "6": "U-D"}
"""Directions of KiK-net at the surface; `_BOREHOLE` are those of a second instrument in a borehole."""


def is_knet(lines: Sequence[str]) -> bool:
    """Return whether lines are those of a K-NET or KiK-net file, also if it is damaged."""
    return sum(_key(line).startswith(_KEYS) for line in lines[: len(_KEYS)]) >= 4


def _key(line: str) -> str:
    """Return a line with its key in the spelling of the files. The manual of the agency has Lon. and Max
    Acc."""
    line = re.sub(r"^(Station )?Lon\. ", r"\1Long.", line)
    return re.sub(r"^Max Acc\. \(gal\)( ?)", r"Max. Acc. (gal)", line)


def read_knet(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the only channel of a file, in a list.

    Raises:
        UnreadableRecord: the file is damaged or contradicts itself.
    """
    head = _head(cursor)
    rate = int(_stated(head, "Sampling Freq(Hz)", rf"({WHOLE})\s*Hz")[1])
    length = real(_stated(head, "Duration Time(s)", rf"({NUMBER})")[1])
    scale = _stated(head, "Scale Factor", rf"({NUMBER})\((\w+)\)/({NUMBER})")
    if rate == 0 or real(scale[3]) == 0.0 or length > 1e6:
        raise UnreadableRecord("sampling frequency, duration and scale factor must be those of a record")
    # The file states no number of samples, but a duration in whole seconds.
    numbers: list[float] = []
    while not cursor.only_blank_lines_follow():
        line = cursor.next("the samples").rstrip()
        row = [line[i : i + _COLUMN] for i in range(0, len(line), _COLUMN)]
        # A number that was cut is too short. The blank at the end of a line may be missing.
        short = len(line) % _COLUMN not in (0, _COLUMN - 1)
        if short or any(not re.fullmatch(r"\s*-?\d+\s?", cell) for cell in row):
            wanted = f"whole numbers of {_COLUMN} characters"
            raise UnreadableRecord(f"line {cursor.at} must contain {wanted}, but is {quote(line)}")
        numbers += [number(cell, cursor.at) for cell in row]
    cursor.require_end()
    counts = np.array(numbers)
    agree_on_count(round(length * rate), len(counts), "the header (frequency and duration)")
    # Samples are integers: the scale factor converts them to the unit of acceleration.
    values = counts * (real(scale[1]) / real(scale[3]))
    stated = unit_of(scale[2], _KEYS.index("Scale Factor") + 1)
    # The stated peak is that of the samples without their mean.
    gal = (values - values.mean()) * (FACTORS[stated] / FACTORS["gal"])
    peak = Decimal.of(_stated(head, "Max. Acc. (gal)", rf"({NUMBER})")[1])
    agree_on_peak(np.abs(gal), peak, "Max. Acc. (gal)", digit=peak.unit)
    notes = (UNCORRECTED, BOREHOLE) if head["Dir."] in _BOREHOLE else (UNCORRECTED,)
    component = (_BOREHOLE | _SURFACE).get(head["Dir."], head["Dir."])
    name, event = f"{head['Station Code']}/{component}", head["Origin Time"]
    return [Channel(values * factor_of(stated, unit), 1.0 / rate, component, name, event, notes)]


def _head(cursor: Cursor) -> dict[str, str]:
    """Return the values of all keys, which have a fixed order."""
    head: dict[str, str] = {}
    for key in _KEYS:
        line = _key(cursor.next(key))
        if not line.startswith(key):
            raise UnreadableRecord(f"line {cursor.at} must state {key!r}, but is {quote(line)}")
        head[key] = line[max(len(key), _WIDTH if line[len(key) : _WIDTH].isspace() else 0) :].strip()
    return head


def _stated(head: dict[str, str], key: str, pattern: str) -> re.Match[str]:
    """Return the match of a pattern in the value of a key, or raise `UnreadableRecord`."""
    match = re.fullmatch(pattern, head[key], flags=re.IGNORECASE)
    if match is None:
        raise UnreadableRecord(f"line {_KEYS.index(key) + 1} must state {key!r}, but has {quote(head[key])}")
    return match


_COLUMNS = re.compile(r"^#\s*Time\s*,\s*RelativeTime", re.IGNORECASE)


def is_knet_csv(lines: Sequence[str]) -> bool:
    """Return whether lines are those of a CSV file of K-NET or KiK-net, also if it is damaged."""
    head = [line.lower().replace(" ", "") for line in lines[:40]]
    marks = ("#samplingfrequency", "#time,relativetime", "#origintime,", "#durationtime")
    return sum(line.startswith(marks) for line in head) >= 2


def read_knet_csv(cursor: Cursor, unit: str | None) -> list[Channel]:
    """Return the channels of a file.

    Raises:
        UnreadableRecord: the file is damaged or contradicts itself.
    """
    head: list[str] = []
    while cursor.peek().startswith("#"):
        head.append(cursor.next("the columns").lstrip("# ").strip())
    if not head or not _COLUMNS.match("#" + head[-1]):
        last = quote(head[-1] if head else "")
        raise UnreadableRecord(f"line {cursor.at} must name the columns, but is {last}")
    names = [name.strip() for name in head[-1].split(",")][2:]
    rows, first = [], cursor.line
    while not cursor.only_blank_lines_follow():
        cells = cursor.next("a row").split(",")
        if len(cells) != len(names) + 2:
            raise UnreadableRecord(f"line {cursor.at} must have {len(names) + 2} cells, but has {len(cells)}")
        rows.append([number(cell.strip(), cursor.at) for cell in cells[1:]])
    cursor.require_end(whole=True)
    times, *columns = np.array(rows).reshape(-1, len(names) + 1).T
    steps = np.diff(times)
    rate, length = _number_of(head, "SamplingFrequency"), _number_of(head, "DurationTime")
    if rate.value <= 0.0:
        raise UnreadableRecord(f"the sampling frequency must be positive, but is {rate.value:g} Hz")
    dt = 1.0 / rate.value
    # Times have two decimals, and may therefore be equal at rates above 100 Hz.
    equal = np.flatnonzero(steps == 0.0)
    if equal.size and dt > 0.0099:
        raise UnreadableRecord(f"line {first + equal[0] + 1} has the same time as line {first + equal[0]}")
    agree_on_count(round(length.value * rate.value), len(times), "the header (frequency and duration)")
    # Times have two decimals, so they may differ from the step by rounding.
    wrong = np.flatnonzero(np.abs(steps - dt) > 0.011)
    if wrong.size:
        raise UnreadableRecord(f"line {first + int(wrong[0]) + 1} must be {dt:g} s after the line before")
    agree((len(times) - 1) * dt, float(times[-1] - times[0]), "the length in s", 0.011)
    event, station = (_below(head, key).split(",")[0] for key in ("OriginTime", "Code"))
    channels = []
    for name, column in zip(names, columns, strict=True):
        component, _, own = name.rstrip(")").partition("(")
        factor = factor_of(unit_of(own, cursor.at), unit)
        # KiK-net uses the number 1 for the instrument in the borehole, and 2 for that at the surface.
        is_deep = component.endswith("1") and any(name.startswith(f"{component[:-1]}2") for name in names)
        notes = (UNCORRECTED, BOREHOLE) if is_deep else (UNCORRECTED,)
        channels.append(Channel(column * factor, dt, component, f"{station}/{component}", event, notes))
    return channels


def _below(head: Sequence[str], key: str) -> str:
    """Return the line after the line that begins with a key."""
    rows = [i for i, line in enumerate(head[:-1]) if line.replace(" ", "").startswith(key)]
    return head[rows[0] + 1] if rows else ""


def _number_of(head: Sequence[str], key: str) -> Decimal:
    """Return the number in the line after the line that begins with a key."""
    text = re.sub(r"\s*(?:Hz|s)$", "", _below(head, key), flags=re.IGNORECASE)
    if not re.fullmatch(NUMBER, text):
        raise UnreadableRecord(f"the header must state {key} as a number, but has {quote(text)}")
    return Decimal.of(text)
