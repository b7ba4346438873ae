"""Tables of text: two columns, time in s and acceleration, or one of accelerations.

Lines at the top that begin with no number are the header. It states the unit in brackets, after the word
"unit" or as a cell of its own, and may state the step of one column: "dt = 0.01 s".
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tpd.formats.channel import Channel
from tpd.formats.text import NUMBER, Cursor, Decimal, UnreadableRecord, number, shown
from tpd.formats.units import FACTORS, chosen, plain

_SEPARATOR = re.compile(r"\s*[,;]\s*|\s+")
_LONGEST_HEADER = 20
_FINE = 0.1
"""Greatest last digit of rounded times, in steps: coarser ones cannot show that steps are equal."""
_MARKS = ("#", "%", "!", "/")
"""Beginnings of comments."""
_SECONDS = ("s", "sec", "secs", "second", "seconds")
_OTHER_TIMES = ("ms", "msec", "min", "minutes", "milliseconds", "us")


def read_table(cursor: Cursor, dt: float | None, unit: str | None) -> list[Channel]:
    """Return the one channel of a table.

    Args:
        cursor: at the beginning of the file.
        dt: step in s of a table of one column whose header states none.
        unit: of a table whose header states none.

    Raises:
        UnreadableRecord: a table of another kind, a cell that is no number, or times at unequal steps.
    """
    head = _head(cursor)
    rows, first = _rows(cursor)
    if head and rows and _is_row(head, len(rows[0])):
        raise UnreadableRecord(
            f"line {first - 1} must be a row of numbers or a header, but is {shown(head[-1])}"
        )
    factor = FACTORS[chosen(_unit(head), unit)]
    step = _step(head)
    if rows and len(rows[0]) == 2:
        times = [Decimal.of(row[0]) for row in rows]
        return [Channel(_numbers([row[1] for row in rows], first) * factor, _equal(times, first, step))]
    if step is None:
        if dt is None:
            raise UnreadableRecord("a table of one column states no step: give `dt` in s, such as dt=0.01")
        step = float(dt)
    return [Channel(_numbers([row[0] for row in rows], first) * factor, step)]


def _numbers(cells: Sequence[str], first: int) -> np.ndarray:
    return np.array([number(cell, first + i) for i, cell in enumerate(cells)])


def _head(cursor: Cursor) -> list[str]:
    """The header."""
    head = []
    while not re.match(rf"\s*{NUMBER}(?=[\s,;]|$)", cursor.peek()):
        head.append(cursor.next("the first number"))
        if len(head) > _LONGEST_HEADER:
            raise UnreadableRecord(
                f"no known format: the first {_LONGEST_HEADER} lines hold no number, and are no header of a "
                "file of ground motion"
            )
    return head


def _is_row(head: Sequence[str], columns: int) -> bool:
    """Whether the last line of the header is a row with damage: taken for a header, the first sample would be
    lost."""
    line = head[-1].strip()
    cells = _SEPARATOR.split(line)
    if line.startswith(_MARKS) or len(cells) != columns:
        return False
    if columns == 2:
        return any(re.fullmatch(NUMBER, cell) for cell in cells)
    # One cell: the name or the unit of the column, or what is left of a number.
    name = re.fullmatch(r"[^\W\d]\w*", line) and line.lower() not in ("nan", "inf", "infinity")
    return _unit([line]) is None and (len(head) > 1 or not name)


def _rows(cursor: Cursor) -> tuple[list[list[str]], int]:
    """Cells of all rows, each as many as in the first row, and the line of the first."""
    rows, first = [], cursor.line
    while not cursor.only_blank_lines_follow():
        line = cursor.next("a row").strip()
        cells = _SEPARATOR.split(line)
        wanted = len(rows[0]) if rows else 1 + (len(cells) > 1)
        if len(cells) != wanted:
            allowed = "1 or 2 columns" if not rows else f"{wanted} as the first row"
            raise UnreadableRecord(
                f"line {cursor.at} must have {allowed}, but has {len(cells)}: {shown(line)}"
            )
        # Checked here, since the columns are taken apart only later.
        for cell in cells:
            number(cell, cursor.at)
        rows.append(cells)
    cursor.require_end()
    return rows, first


def _unit(head: Sequence[str]) -> str | None:
    """The unit of acceleration that the header states, or None."""
    found = set()
    for line in head:
        for text in _candidates(line):
            word = plain(text)
            if word in FACTORS:
                found.add(word)
            elif word in _OTHER_TIMES:
                raise UnreadableRecord(f"the times must be in s, but the header states {shown(text)}")
    if len({FACTORS[word] for word in found}) > 1:
        raise UnreadableRecord(f"the header states several units of acceleration: {', '.join(sorted(found))}")
    return min(found, default=None)


def _candidates(line: str) -> list[str]:
    """Pieces of a line of the header that can be units."""
    bare = line.strip().lstrip("".join(_MARKS)).strip()
    bracketed = re.findall(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]", bare)
    named = re.findall(r"\bunits?\b\s*(?:of\b|in\b|:|=)?\s*([^\s,;]+)", bare, flags=re.IGNORECASE)
    # Columns are named in cells of their own, such as "time, m/s2".
    cells = re.split(r"\s*[,;\t]\s*|\s{2,}", bare)
    words = bare.split()
    # "s g" and "s m/s2": nothing but units.
    alone = words if all(plain(w) in FACTORS or w.lower() in _SECONDS for w in words) else []
    return [*bracketed, *named, *cells, *alone]


def _step(head: Sequence[str]) -> float | None:
    """The step in s that the header states, or None."""
    found = [
        m
        for line in head
        if (m := re.search(r"\b(?:dt|delta ?t|time step)\s*[=:]\s*(\S+)\s*(\w*)", line, re.I))
    ]
    if not found:
        return None
    value, word = found[0][1].rstrip(",;"), found[0][2].lower()
    attached = re.fullmatch(rf"({NUMBER})([a-z]*)", value, flags=re.IGNORECASE)
    if attached is None or (attached[2] or word or "s").lower() not in _SECONDS:
        raise UnreadableRecord(f"the header must state the step in s, but has {shown(found[0][0])}")
    return float(attached[1])


def _equal(times: Sequence[Decimal], first: int, stated: float | None) -> float:
    """The step of times that are equally spaced, each rounded to the digits printed."""
    t = np.array([time.value for time in times])
    if len(t) < 2:
        return 1.0 if stated is None else stated
    # Twelve digits: 31.18/1559 is then 0.02, as it was meant.
    dt = float(f"{(t[-1] - t[0]) / (len(t) - 1):.12g}")
    # Zeros at the end may be left out: the finest digit of all is that of the table.
    digit = min(time.unit for time in times)
    steps, noise = np.diff(t), 1e-9 * float(np.max(np.abs(t)))
    off = np.abs(steps - dt) > noise
    if digit <= _FINE * dt:
        # Times such as 0.00333 and 0.00667 are rounded: they lie on a line within a digit.
        off &= np.abs(t[1:] - t[0] - dt * np.arange(1, len(t))) > 1.01 * digit + noise
    off |= steps <= 0.0
    if dt <= 0.0 or off.any():
        i = int(np.argmax(off))
        raise UnreadableRecord(
            f"the times must have equal steps, but the one after line {first + i} is {steps[i]:g} s, and the "
            f"usual one {float(np.median(steps)):g} s"
        )
    if stated is not None and abs(stated - dt) > 1e-6 * dt:
        raise UnreadableRecord(f"the header states a step of {stated:g} s, but that of the times is {dt:g} s")
    return dt
