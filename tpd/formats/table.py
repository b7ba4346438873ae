"""Tables of text: time in s and accelerations in columns, one column of accelerations, or rows of samples.

Lines at the top that are no rows of numbers are the header. It states the unit in brackets, after the word
"unit" or as a cell of its own, and may state the step of samples without times: "dt = 0.01 s". The first
lines may also hold the number of samples and the step.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tpd.formats.channel import FACTORS, STEPS, Channel, chosen, looks_like, orientation, plain
from tpd.formats.text import NUMBER, Cursor, Decimal, UnreadableRecord, number, shown

_SEPARATOR = re.compile(r"\s*[,;]\s*|\s+")
_LONGEST_HEADER = 40
_FINE = 0.25
"""Greatest last digit of rounded times, in steps: coarser ones cannot show that steps are equal."""
_MARKS = ("#", "%", "!", "/", "*")
"""Beginnings of comments."""
_STATED_STEP = (
    r"(?:\b(?:dt|delta ?t|time ?step|sampling (?:interval|step|period))(?:\s*[=:]\s*|\s+(?=\.?\d))|"
    r"\b(?:equal spacing of|equally spaced at|(?:time )?intervals? of|step(?: of)?)\s+(?=[\d.]))(\S+)\s*(\w*)"
)
_STATED_RATE = r"\b(?:fs|sampl\w* (?:rate|frequency))\s*[=:]?\s*(\d+(?:\.\d*)?)\s*(?:hz|sps)\b"
_SECONDS = ("s", "sec", "secs", "second", "seconds")
_OTHER_TIMES = ("ms", "msec", "min", "minutes", "milliseconds", "us")
_OTHER_MOTIONS = ("m/s", "cm/s", "mm/s", "in/s", "ft/s", "m", "cm", "mm", "in", "ft", "inch", "inches")
"""Units of velocities and displacements."""
_OTHER_UNITS = (*_OTHER_MOTIONS, "counts", "count", "v", "mv", "volt", "volts")


@dataclass(frozen=True)
class _Row:
    """A row of numbers."""

    cells: list[str]
    line: int


def read_table(cursor: Cursor, dt: float | None, unit: str | None) -> list[Channel]:
    """Return the channels of a table.

    Args:
        cursor: at the beginning of the file.
        dt: step in s of a table without times whose header states none.
        unit: of a table whose header states none.

    Raises:
        UnreadableRecord: a table of another kind, a cell that is no number, a unit that is not known, or
            times at unequal steps.
    """
    cursor = _with_points(cursor)
    head = _head(cursor)
    rows = _rows(cursor)
    stated = _step(head)
    rows, count, counted = _counted(rows)
    if stated is not None and counted is not None and abs(stated - counted) > 1e-6 * stated:
        raise UnreadableRecord(f"the file states a step of {stated:g} s and one of {counted:g} s")
    stated = counted if stated is None else stated
    if head and rows and _is_row(head, len(rows[0].cells)):
        raise UnreadableRecord(
            f"line {rows[0].line - 1} must be a row of numbers or a header, but is {shown(head[-1])}"
        )
    columns = len(rows[0].cells) if rows else 1
    names = _names(head, columns)
    if columns == 1:
        _require_columns(rows, columns)
    if columns == 1 or _in_rows(rows, names, count):
        values = np.array([number(cell, row.line) for row in rows for cell in row.cells])
        known = _unit(head)
        if known is None:
            _check_hints(head, unit)
        return [Channel(values * FACTORS[chosen(known, unit)], _given(stated, dt))]
    _require_columns(rows, columns)
    first, step = _times(rows, names, stated, dt)
    # The unit comes first: what a column holds decides whether it is read.
    return _columns(rows, names, head, first, step, unit)


def _columns(
    rows: Sequence[_Row], names: Sequence[str], head: Sequence[str], first: int, step: float, unit: str | None
) -> list[Channel]:
    """Channels of the columns from `first` on that hold accelerations."""
    columns = len(rows[0].cells)
    others = [bool(names) and columns > 2 and _other_motion(name) for name in names or [""] * columns]
    units = [
        _unit([n]) if n and not o else None for n, o in zip(names or [""] * columns, others, strict=True)
    ]
    # The unit of the whole table counts where a column has none of its own.
    own = all(units[i] or others[i] for i in range(first, columns)) and any(units)
    general = None if own else _unit(head)
    if general is None and not own:
        _check_hints(head, unit)
    found, left = [], []
    for i in range(first, columns):
        name = names[i] if names else ""
        if others[i]:
            left.append(name)
            continue
        values = np.array([number(row.cells[i], row.line) for row in rows])
        component = re.sub(r"\s*[(\[].*?[)\]]", "", name).strip()
        if columns - first > 1:
            component = component or f"column {i + 1}"
        elif orientation(component) is None:
            component = ""
        factor = FACTORS[chosen(units[i] or general, unit)]
        found.append(Channel(values * factor, step, component, component))
    if not found:
        raise UnreadableRecord(f"the table holds no acceleration, but {', '.join(shown(x) for x in left)}")
    return found


def _other_motion(name: str) -> bool:
    """Whether a column is named as a velocity or a displacement."""
    words = [plain(x) for x in re.findall(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]", name)]
    return any(word in _OTHER_MOTIONS for word in words) or bool(re.match(r"\W*(?:vel|dis)", name, re.I))


def _with_points(cursor: Cursor) -> Cursor:
    """The table with points for decimal commas, where all its rows have such: 0,01;0,035."""
    lines = list(cursor.lines)
    comma = re.compile(r"[+-]?\d*,\d+(?:[EeDd][+-]?\d{1,3})?|[+-]?\d+(?:[EeDd][+-]?\d{1,3})?")
    rows = []
    for i, line in enumerate(lines):
        cells = [cell for cell in re.split(r"\s*;\s*|\s+", line.strip()) if cell]
        if len(cells) > 1 and all(comma.fullmatch(cell) for cell in cells):
            rows.append(i)
        elif rows and line.strip():
            return cursor
    if not rows or not any("," in lines[i] for i in rows):
        return cursor
    for i in rows:
        lines[i] = lines[i].replace(",", ".")
    return Cursor(lines, cursor.ended, cursor.at)


def _cells(line: str) -> list[str]:
    # Spreadsheets end rows with a separator.
    return _SEPARATOR.split(re.sub(r"[\s,;]+$", "", line.strip()))


def _head(cursor: Cursor) -> list[str]:
    """The header: all lines above the first row of numbers, less the blank ones."""
    head = []
    while not re.match(rf"\s*{NUMBER}(?=[\s,;]|$)", cursor.peek()) or _is_prose(cursor.peek()):
        line = cursor.next("the first number")
        if line.strip():
            head.append(line)
        if len(head) > _LONGEST_HEADER:
            raise UnreadableRecord(
                f"no known format: the first {_LONGEST_HEADER} lines hold no number, and are no header of a "
                "file of ground motion"
            )
    return head


def _is_prose(line: str) -> bool:
    """Whether a line that begins with a number is a sentence, such as "400 points at 0.01 sec"."""
    words = [word for word in re.findall(r"[^\W\d_]{2,}", line) if word.lower() not in ("nan", "inf")]
    return len(words) >= 2 or bool(
        words and re.search(r"\b(?:points|pts|npts|samples|data|dt)\b", line, re.I)
    )


def _is_row(head: Sequence[str], columns: int) -> bool:
    """Whether the last line of the header is a row with damage: taken for a header, the first sample would be
    lost."""
    line = head[-1].strip()
    cells = _cells(line)
    if line.startswith(_MARKS) or len(cells) != columns:
        return False
    if columns >= 2:
        return any(re.fullmatch(NUMBER, cell) for cell in cells)
    # One cell: the name or the unit of the column, or what is left of a number.
    name = re.fullmatch(r"[^\W\d]\w*", line) and line.lower() not in ("nan", "inf", "infinity")
    return _unit([line]) is None and (len(head) > 1 or not name)


def _rows(cursor: Cursor) -> list[_Row]:
    """All rows of numbers; blank lines are passed over."""
    rows: list[_Row] = []
    while not cursor.only_blank_lines_follow():
        line = cursor.next("a row").strip()
        # In rows of times a blank line loses nothing; in a column it may stand for a sample.
        if not line and (not rows or len(rows[-1].cells) > 1):
            continue
        cells = _cells(line)
        # Checked here, since the columns are taken apart only later.
        for cell in cells:
            number(cell, cursor.at)
        rows.append(_Row(cells, cursor.at))
    # Decimals of one width, in a table of times, show that the last number is whole.
    cursor.require_end(whole=_is_full(rows))
    return rows


def _is_full(rows: Sequence[_Row]) -> bool:
    """Whether all rows are as wide and have as many decimals in their last cell: the last one was not cut."""
    # A column of samples shows nothing else of a cut.
    if len(rows) < 3 or len({len(row.cells) for row in rows[-3:]}) > 1 or len(rows[0].cells) == 1:
        return False
    decimals = [row.cells[-1].partition(".")[2] for row in rows]
    return bool(decimals[0]) and len({len(x) for x in decimals}) == 1


def _counted(rows: list[_Row]) -> tuple[list[_Row], int | None, float | None]:
    """Rows less those on top that state the number of samples and the step; both statements."""
    for top in (1, 2):
        if len(rows) < top + 2 or (top == 2 and any(len(row.cells) > 1 for row in rows[:2])):
            continue
        values = [float(cell.lower().replace("d", "e")) for row in rows[:top] for cell in row.cells]
        rest = rows[top:]
        total = sum(len(row.cells) for row in rest)
        if any(value in (total, len(rest)) for value in values):
            count = int(next(value for value in values if value in (total, len(rest))))
            left = [value for value in values if value != count]
            step = next((x for x in left if STEPS[0] <= x < STEPS[1]), None)
            if top == 2 and (step is None or abs(1.0 / step - round(1.0 / step)) > 1e-6 / step):
                raise UnreadableRecord(
                    f"line {rows[0].line} states {count} samples, but {total + 1} follow, or the step in "
                    f"line {rows[1].line} is {shown(rows[1].cells[0])}, which is no whole rate in Hz"
                )
            return rest, count, step
    if len(rows) > 2 and len(rows[0].cells) != len(rows[1].cells) == len(rows[2].cells):
        total = sum(len(row.cells) for row in rows[1:])
        raise UnreadableRecord(
            f"line {rows[0].line} must be a row of {len(rows[1].cells)} numbers, or state the number of "
            f"samples, {total}, but has {len(rows[0].cells)}: {shown(' '.join(rows[0].cells))}"
        )
    return rows, None, None


def _require_columns(rows: Sequence[_Row], columns: int) -> None:
    for row in rows:
        if len(row.cells) != columns:
            raise UnreadableRecord(
                f"line {row.line} must have {columns} as the first row, but has {len(row.cells)}: "
                f"{shown(' '.join(row.cells))}"
            )


def _names(head: Sequence[str], columns: int) -> list[str]:
    """Names of the columns from the last line of the header, where it has as many; else none."""
    if not head or columns < 2:
        return []
    line = re.sub(r"[\s,;]+$", "", head[-1].strip().lstrip("".join(_MARKS)).strip())
    # "Time (s)  Acc (g)": blanks set names apart as well as a bracket from its name.
    joined = re.sub(r"\s+(?=[(\[])", "", line)
    for cells in (re.split(r"\s*[,;\t]\s*", line), re.split(r"\s{2,}|\t", line), joined.split()):
        if len(cells) == columns:
            return [cell.strip(" \"'") for cell in cells]
    return []


def _in_rows(rows: Sequence[_Row], names: Sequence[str], count: int | None) -> bool:
    """Whether a table holds samples one after the other, several in a line, and no columns."""
    columns = len(rows[0].cells)
    if any(len(row.cells) != columns for row in rows[:-1]):
        return False
    if count is not None and count != len(rows):
        return True
    if names or columns < 3:
        return False
    first = np.array([float(row.cells[0].lower().replace("d", "e")) for row in rows])
    steps = np.diff(first)
    # Times and numbers of samples grow; of samples in rows the first ones go up and down.
    return len(rows) > 2 and not bool(np.all(steps > 0.0))


def _given(stated: float | None, dt: float | None) -> float:
    """The step in s that the file states or, where it states none, the user."""
    if stated is None and dt is None:
        raise UnreadableRecord("a table without times states no step: give `dt` in s, such as dt=0.01")
    return float(dt if stated is None else stated)  # type: ignore[arg-type]


def _times(
    rows: Sequence[_Row], names: Sequence[str], stated: float | None, dt: float | None
) -> tuple[int, float]:
    """Number of the first column of accelerations, and the step in s of the times or of the samples."""
    first = np.array([float(row.cells[0].lower().replace("d", "e")) for row in rows])
    numbered = len(rows) > 1 and np.all(first == np.round(first)) and np.all(np.diff(first) == 1.0)
    if numbered and not re.search(
        r"[(\[]\s*(?:s|secs?|seconds?)\s*[)\]]|^secs?$|^seconds?$|^s$", "".join(names[:1]), re.I
    ):
        # 1, 2, 3 ... are no times in s, unless the header says so: of two columns the other holds samples.
        second = [Decimal.of(row.cells[1]) for row in rows]
        if len(rows[0].cells) > 2 and re.match(
            r"\W*(?:t|time|zeit|temps|tempo|tiempo)\b", "".join(names[1:2]), re.I
        ):
            return 2, _equal(second, rows, stated)
        if stated is None and dt is None:
            raise UnreadableRecord(
                "the first column numbers the samples and states no times: give `dt` in s, such as dt=0.01"
            )
        return 1, _given(stated, dt)
    return 1, _equal([Decimal.of(row.cells[0]) for row in rows], rows, stated)


def _unit(head: Sequence[str]) -> str | None:
    """The unit of acceleration that the header states, or None.

    Raises:
        UnreadableRecord: several, one that is not known, or times that are not in s.
    """
    found = set()
    for at, line in enumerate(head):
        for text, named in _candidates(line):
            word = plain(text)
            if word in FACTORS:
                found.add(word)
            elif word in _OTHER_TIMES:
                raise UnreadableRecord(f"the times must be in s, but the header states {shown(text)}")
            elif looks_like(text) or (named and word not in _SECONDS and re.search(r"[a-zµ]", word)):
                raise UnreadableRecord(
                    f"the unit of acceleration must be one of {', '.join(FACTORS)}, but the header states "
                    f"{shown(text)}"
                )
            elif at == len(head) - 1 and len(head[-1].split()) < 3 and word in _OTHER_UNITS:
                raise UnreadableRecord(f"an acceleration is needed, but the header states {shown(text)}")
    if len({FACTORS[word] for word in found}) > 1:
        raise UnreadableRecord(f"the header states several units of acceleration: {', '.join(sorted(found))}")
    return min(found, default=None)


_HINTS = re.compile(
    r"(?<![a-z])((?:m|micro|milli)?gals?(?![a-z])|"
    r"(?:cm|mm|km|m|in|inch(?:es)?|ft|feet|foot|(?:centi|milli)?met(?:er|re)s?)\s*(?:/|_|per|p|·)?\s*\(?"
    r"s(?:ec(?:ond)?s?)?\s*(?:[\^_*]{0,2}-?2|\*\s*s|/\s*s|²|⁻²|squared)|"
    r"km\s*/\s*h\s*/\s*s|per\s+s(?:ec(?:ond)?)?\w*\s+(?:squared|per)|"
    r"[(\[]\s*(?:[mµu]g|(?:micro|milli)-?g|[\d.]+\s*g|g\s*/\s*\d+|(?:raw\s+)?counts?|lsb)\s*[)\]])",
    re.IGNORECASE,
)
"""Units of acceleration in spellings that are not read."""


def _check_hints(head: Sequence[str], unit: str | None) -> None:
    """Refuse a unit given by the user where the header seems to state another one in words not read.

    Raises:
        UnreadableRecord: another unit, or one that is not known.
    """
    for line in head:
        if (found := _HINTS.search(line)) is None or unit is None:
            continue
        seems = plain(found[1].strip("()[] ").replace("_", "/").replace("squared", "2"))
        seems = re.sub(r"/?(?:per)?/?s/?2$", "/s2", seems)
        if seems not in FACTORS or FACTORS[seems] != FACTORS[plain(unit)]:
            raise UnreadableRecord(
                f"the header seems to state the unit {shown(found[1])}, but `unit` is {unit!r}: write a unit "
                f"that is read ({', '.join(FACTORS)}) into the header, or remove it"
            )


def _candidates(line: str) -> list[tuple[str, bool]]:
    """Pieces of a line of the header that can be units, and whether they are said to be one."""
    bare = line.strip().lstrip("".join(_MARKS)).strip()
    bracketed = re.findall(r"[(\[]\s*([^()\[\]]*?)\s*[)\]]", bare)
    named = re.findall(
        r"\bunits?\b\s*(?:are\b|is\b|of\b|in\b|:|=)?\s*[(\[]?([^\s,;()\[\]]+)", bare, flags=re.I
    )
    # Columns are named in cells of their own, such as "time, m/s2".
    cells = re.split(r"\s*[,;\t]\s*|\s{2,}", bare)
    words = re.split(r"[\s,;()\[\]=:]+", bare)
    # "s g" and "s m/s2": nothing but units.
    alone = words if all(plain(w) in FACTORS or w.lower() in _SECONDS for w in words) else []
    formed = [word for word in words if looks_like(word)]
    # "a [furlong/min2]" states a unit, "a (NS)" and "acc (corrected)" do not.
    squared = [text for text in bracketed if re.search(r"/|\^|\d$", text)]
    squared = [text for text in squared if orientation(text) is None and " " not in text.strip()]
    volts = [text for text in bracketed if plain(text) in ("counts", "count", "v", "mv", "volt", "volts")]
    said = [word for word in named if word.lower() not in ("of", "in", "are", "is", "acceleration", "time")]
    return [(x, True) for x in [*said, *squared, *volts] if plain(x) not in _OTHER_MOTIONS] + [
        (x, False) for x in [*bracketed, *cells, *alone, *formed]
    ]


def _step(head: Sequence[str]) -> float | None:
    """The step in s that the header states, or None."""
    found = [m for line in head if (m := re.search(_STATED_STEP, line, re.I))]
    rates = [m for line in head if (m := re.search(_STATED_RATE, line, re.I))]
    if not found:
        return 1.0 / float(rates[0][1]) if rates and float(rates[0][1]) > 0.0 else None
    value, word = found[0][1].rstrip(",;"), found[0][2].lower()
    attached = re.fullmatch(rf"({NUMBER})([a-z]*)", value, flags=re.IGNORECASE)
    if attached is None or (attached[2] or word or "s").lower() not in _SECONDS:
        raise UnreadableRecord(f"the header must state the step in s, but has {shown(found[0][0])}")
    return float(attached[1])


def _equal(times: Sequence[Decimal], rows: Sequence[_Row], stated: float | None) -> float:
    """The step of times that are equally spaced, each rounded to the digits printed."""
    t = np.array([time.value for time in times])
    if len(t) < 2:
        return 1.0 if stated is None else stated
    # Twelve digits: 31.18/1559 is then 0.02, as it was meant.
    dt = float(f"{(t[-1] - t[0]) / (len(t) - 1):.12g}")
    # Times computed in single precision are off by two units of 24 binary digits, however many are printed.
    digits = np.maximum(_digits(times), 2.4e-7 * np.abs(t))
    steps, noise = np.diff(t), 1e-9 * float(np.max(np.abs(t)))
    off = np.abs(steps - dt) > noise
    if dt > 0.0 and off.any() and digits.max() <= _FINE * dt:
        # Times such as 0.00333 and 0.00667 are rounded: they lie on a line within a digit.
        dt = _roundest(t, digits + noise, dt)
        off = np.abs(steps - dt) > 1.01 * digits[1:] + noise
        off |= np.abs(t[1:] - t[0] - dt * np.arange(1, len(t))) > 1.01 * digits[1:] + noise
    off |= steps <= 0.0
    if dt <= 0.0 or off.any():
        i = int(np.argmax(off))
        raise UnreadableRecord(
            f"the times must have equal steps, but the one after line {rows[i].line} is {steps[i]:g} s, and "
            f"the usual one {float(np.median(steps)):g} s"
        )
    if stated is not None and abs(stated - dt) > 1e-6 * dt:
        raise UnreadableRecord(f"the header states a step of {stated:g} s, but that of the times is {dt:g} s")
    return dt


def _digits(times: Sequence[Decimal]) -> np.ndarray:
    """Size of the last digit of every time. Zeros at the end may be left out, and programs print either a
    number of decimals or one of significant digits, six for most: later times then have fewer decimals."""
    finest = min(time.unit for time in times)
    size = np.array([max(abs(time.value), finest) for time in times])
    ahead = np.floor(np.log10(size) + 1e-12)
    # Significant digits that were ever needed; less than six are the decimals of short numbers.
    most = max(a - np.round(np.log10(time.unit)) + 1.0 for a, time in zip(ahead, times, strict=True))
    coarse = 10.0 ** (ahead + 1.0 - most)
    # Later times with as many decimals as the first ones are of the first kind.
    late = times[len(times) // 2 :]
    decimal = min(time.unit for time in late) <= finest
    return np.full(len(times), finest) if decimal or most < 5.0 else np.maximum(coarse, finest)


def _roundest(t: np.ndarray, digits: np.ndarray, dt: float) -> float:
    """The step that rounded times mean: a whole rate in Hz, or the step of fewest digits that fits all."""
    i = np.arange(1, len(t))
    margin = 0.51 * (digits[1:] + digits[0] * (t[0] != 0.0))
    low, high = float(np.max((t[1:] - t[0] - margin) / i)), float(np.min((t[1:] - t[0] + margin) / i))
    if not 0.0 < low <= high:
        return dt
    rate = round(1.0 / dt)
    if rate > 0 and low <= 1.0 / rate <= high:
        return 1.0 / rate
    for places in range(1, 12):
        short = float(f"{dt:.{places}g}")
        if low <= short <= high:
            return short
    return dt
