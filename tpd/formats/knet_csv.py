"""CSV files of K-NET and KiK-net (NIED, Japan): three components in gal below comments."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tpd.formats.channel import Channel, agree, agree_on_count
from tpd.formats.text import NUMBER, Cursor, Decimal, UnreadableRecord, number, shown
from tpd.formats.units import FACTORS, chosen, unit_of

_COLUMNS = re.compile(r"^#\s*Time\s*,\s*RelativeTime", re.IGNORECASE)


def is_knet_csv(lines: Sequence[str]) -> bool:
    """Return whether lines are those of a CSV file of K-NET or KiK-net, sound or not."""
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
        raise UnreadableRecord(
            f"line {cursor.at} must name the columns, but is {shown(head[-1] if head else '')}"
        )
    names = [name.strip() for name in head[-1].split(",")][2:]
    rows, first = [], cursor.line
    while not cursor.only_blank_lines_follow():
        cells = cursor.next("a row").split(",")
        if len(cells) != len(names) + 2:
            raise UnreadableRecord(f"line {cursor.at} must have {len(names) + 2} cells, but has {len(cells)}")
        rows.append([number(cell.strip(), cursor.at) for cell in cells[1:]])
    cursor.require_end(whole=True)
    values = np.array(rows).reshape(-1, len(names) + 1)
    rate, length = _stated(head, "SamplingFrequency"), _stated(head, "DurationTime")
    if rate.value <= 0.0:
        raise UnreadableRecord(f"the sampling frequency must be positive, but is {rate.value:g} Hz")
    dt = 1.0 / rate.value
    agree_on_count(round(length.value * rate.value), len(values), "the header (frequency and duration)")
    wrong = np.flatnonzero(np.abs(np.diff(values[:, 0]) - dt) > 0.011)
    if wrong.size:
        raise UnreadableRecord(f"line {first + int(wrong[0]) + 1} must be {dt:g} s after the line before")
    agree((len(values) - 1) * dt, float(values[-1, 0] - values[0, 0]), "the length in s", 0.011)
    return [_channel(head, name, values[:, i + 1], dt, cursor.at, unit) for i, name in enumerate(names)]


def _channel(
    head: Sequence[str], name: str, values: np.ndarray, dt: float, line: int, unit: str | None
) -> Channel:
    component, _, stated = name.rstrip(")").partition("(")
    factor = FACTORS[chosen(unit_of(stated, line), unit)]
    event, station = _below(head, "OriginTime").split(","), _below(head, "Code").split(",")[0]
    words = f"{event[0]} M{event[-1]}" if len(event) > 1 else ""
    return Channel(values * factor, dt, component, f"{station}/{component}", words)


def _below(head: Sequence[str], key: str) -> str:
    """The line below the one that begins with a key."""
    found = [i for i, line in enumerate(head[:-1]) if line.replace(" ", "").startswith(key)]
    return head[found[0] + 1] if found else ""


def _stated(head: Sequence[str], key: str) -> Decimal:
    text = re.sub(r"\s*(?:Hz|s)$", "", _below(head, key), flags=re.IGNORECASE)
    if not re.fullmatch(NUMBER, text):
        raise UnreadableRecord(f"the header must state {key} as a number, but has {shown(text)}")
    return Decimal.of(text)
