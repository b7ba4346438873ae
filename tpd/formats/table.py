"""Text tables: times and accelerations in columns, or samples one after the other.

A table is read without options only if its whole header follows a small grammar: lines with the names of the
columns or their units, and statements of the unit, the step, the number of samples or the source. The guide
describes the grammar (records.md). A file with any other word is rejected, and the message contains the
options that read it.
"""

from __future__ import annotations

import contextlib
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from statistics import mode
from typing import Any

from tpd.core import checks
from tpd.formats.channel import (
    BASELINES,
    FACTORS,
    STEPS,
    TIMES,
    Channel,
    agree,
    agree_on_count,
    check_unit,
    factor_of,
    is_component,
    orientation,
    unit_spelling,
)
from tpd.formats.text import (
    NUMBER,
    Cursor,
    Decimal,
    NoAcceleration,
    UnreadableRecord,
    no_thousands,
    number,
    numbers,
    real,
    shown,
    splitter,
    step_of,
)

ROWS = "rows"
"""Value of the option `columns` if the samples continue row by row."""
_LONGEST_STEP = 0.1
"""Longest step that is assumed to be in s if no unit is stated. A longer step may be in ms."""
_MARK = re.compile(r"^(?:[#%!*]+|/+)(?!\s*[,;])\s*")
_RULE = re.compile(r"[\s\-=_+|~.*#]*")
_CLOCK = re.compile(r"\D?\d{1,2}:\d{2}|\D?\d{4}[-/]\d{1,2}[-/]\d{1,2}")
_TWO_WORDS = re.compile(r"(?<=[a-z])(?=[A-Z](?:[^a-z]|$))|(?<=^a)(?=[xyz]$)")
_DECIMAL = re.compile(r"[+-]?\d*(?:,\d+(?:[EeDd][+-]?\d{1,3})?)?")
"""Pattern of a number that may have a decimal comma."""
_PAIR = r"[^=:,]+,[^=:,]+"
"""Pattern of the names of two columns."""
_BRACKET = re.compile(r"[(\[]([^()\[\]]*)[)\]]")
_QUANTITIES = dict.fromkeys(TIMES, "time") | dict.fromkeys(FACTORS, "acceleration")
for _length in ("m", "cm", "mm", "in", "ft"):
    _QUANTITIES |= {_length: "displacement", f"{_length}/s": "velocity"}
"""The quantity that a unit measures."""
_NAMES = {
    "time": r"t|times?|elapsed|zeit|temps|tempo|tiempo|tijd|tid|czas",
    "number": r"no|nr|num|number|index|i|n|id|samples?|points?|#",
    "acceleration": r"a|acc(?:el)?\d?|acceler\w+|beschleunigung|aceleraci[oó]n|ch(?:annel)?\d{0,3}|ground",
    "velocity": r"vel|velocit\w+|velocidad|vitesse|geschwindigkeit",
    "displacement": r"d|dis|displ?|displacements?|d[ée]placement|desplazamiento|spostamento|verschiebung",
    "spectrum": r"periods?|periode|periodo|p?s[adv]|freq|frequency|hz",
}
"""Words for the quantity of a column."""
_NAMED = re.compile("|".join(_NAMES.values()), re.IGNORECASE).fullmatch
_PROCESSING = r"raw|(?:un)?(?:corrected|processed|filtered)|v[123]"
_PER_SECOND = r"(?:sps|samples\s*(?:/|per)\s*s(?:ec(?:ond)?)?)"
_STATEMENTS = {
    "rate": rf"(?:fs|sampl\w* (?:rate|freq\w*))\s*[:=]?\s*({NUMBER})\s*(?:hz|{_PER_SECOND})"
    rf"|({NUMBER})\s*{_PER_SECOND}",
    "count": r"(?:(?:number|no\.?) of )?(?:samples|points|pts|data|npts|n)\s*[:=]?\s*(\d{1,9})"
    r"|(\d{1,9})\s*(?:samples|points|pts|data)",
    "step": r"(?:dt|delta ?t|time ?step|time interval|sampl\w* (?:interval|step|period)|step|equally spaced"
    r"|(?:equal )?(?:spacing|intervals?)(?: of)?)\s*(?:[(\[]\s*(\w+)\s*[)\]])?\s*[:=]?\s*"
    rf"({NUMBER})\s*([a-z]*)",
    "unit": r"(?:acc\w*\s+)?units?(?:\s+of\s+acc\w*)?\s*(?:[:=]|\b(?:in|is|are|of)\b)?\s*(.+)"
    r"|acc\w* in (.+)|(.+)",
    "source": r"(?:station|site|event|earthquake|record|date|network|location|file)\b\s*[:=]?((?:\s*"
    r"(?:\d{1,4}[-/]\d{1,2}[-/]\d{1,4}|[^\W_][\w.\-]*))*)",
}
"""Forms of statements. The value is in the first group that matches."""
_OPPOSITE = str.maketrans("swovdu", "neezzz")
_GAPS = re.compile(r"[\s,;:()\[\]]+")
_FACTOR = re.compile(rf"\(10\s*(?:\^|\*\*)\s*([+-]?\d+)\s*(\D.*)\)|\((.+?)\s*[x*×]\s*({NUMBER})\)")
"""Pattern of a power of ten before a unit, or of a factor after it."""
_SCALED = r"factor|scal|multipl|divi|gain|[%‰µ]|pct|milli|micro|per ?cent|tenth|hundred|thousand"
_SCALED += r"|\bcounts?\b|\bvolts?\b"
"""Words that may change the size of samples."""
_NO_SOURCE = re.compile(
    rf"x[\d.]*|(?i:.*(?:{_SCALED}|spectr).*|dt|fs|step|rate|interval|[\d.]*(?:hz|sps)"
    rf"|{'|'.join(TIMES)}|{_NAMES['velocity']}|{_NAMES['displacement']}|{_NAMES['spectrum']})"
)
"""Words that are more than a description of the source of a record."""


@dataclass(frozen=True)
class Options:
    """Options of a user; see `tpd.Record.read`."""

    dt: float | None = None
    baseline: str | None = None
    unit: str | None = None
    columns: Mapping[str, int] | str | None = None
    """Numbers of columns, from 1, by their names; or `ROWS`."""
    skip: int = 0
    """Number of lines at the top that are skipped."""
    factor: float = 1.0

    def __post_init__(self) -> None:
        if type(self.skip) is not int or self.skip < 0:
            raise ValueError(f"`skip` must be a number of lines, 0 or more, but is {self.skip!r}")
        checks.set_checked(self, checks.number, "factor")
        if self.factor == 0.0:
            raise ValueError("`factor` must be a finite number other than 0, but is 0")
        if self.dt is not None:
            checks.set_checked(self, checks.positive, "dt")
        if self.unit is not None:
            check_unit(self.unit)
        if self.baseline is not None:
            checks.one_of("baseline", self.baseline, BASELINES)
        if self.columns is None or self.columns == ROWS:
            return
        columns = self.columns if isinstance(self.columns, Mapping) else {}
        are_numbers = all(type(at) is int and at >= 1 for at in columns.values())
        if not columns or not (are_numbers and all(isinstance(name, str) for name in columns)):
            allowed = f"map names to column numbers, from 1, such as {{'time': 1, 'N': 2}}, or be {ROWS!r}"
            raise ValueError(f"`columns` must {allowed}, but is {self.columns!r}")
        if len(set(columns.values())) < len(columns):
            raise ValueError(f"`columns` must contain each column once, but is {columns!r}")


@dataclass(frozen=True)
class _Column:
    """Meaning of the name of a column."""

    quantity: str
    component: str
    unit: str | None
    number: str = ""
    """Digits in the name of an acceleration."""


@dataclass
class _Header:
    """Statements of the lines above the samples."""

    cells: list[str] = field(default_factory=list)
    """Names of the columns with their units."""
    stated: dict[str, list[Any]] = field(default_factory=lambda: defaultdict(list))
    """Values of the statements, by kind: unit, step (s), count, source."""

    @property
    def is_motion(self) -> bool:
        """Whether the lines state a unit, a step or times."""
        columns = [_column(cell, first=i == 0) for i, cell in enumerate(self.cells)]
        own = any(column.unit or column.quantity == "time" for column in columns)
        return own or bool(self.stated["unit"] or self.stated["step"])


_Row = tuple[int, list[str]]
"""Number of a line in the file, and its cells."""
_Line = tuple[int, str]
"""Number of a line in the file, and its text."""


class _Unknown(Exception):
    """Part of a header that the grammar does not explain."""


def read_table(cursor: Cursor, how: Options) -> list[Channel]:
    """Return the channels of a table. Columns of velocities and displacements are left out.

    Raises:
        NoAcceleration: no line above the numbers states that they are a motion.
        UnreadableRecord: the table contradicts itself, a cell is not a number, or the times have unequal
            steps.
    """
    split = splitter(cursor.lines[how.skip :])
    # Columns are numbered from 1 for users.
    used = [i - 1 for i in how.columns.values()] if isinstance(how.columns, Mapping) else []
    lines = [(i, line.strip()) for i, line in enumerate(cursor.lines, 1) if i > how.skip and line.strip()]
    # A line of numbers above a line of names, such as the numbers of the columns, belongs to the header.
    pairs = enumerate(zip(lines, [*lines[1:], (0, "")], strict=False))
    starts = (k for k, (a, b) in pairs if _is_row(split(a[1]), used) and not any(map(_NAMED, split(b[1]))))
    first = next(starts, len(lines))
    head = lines[:first]
    if first == len(lines):
        why = f"commas, semicolons, tabs or blanks must separate numbers after line {how.skip}"
        why = f"no line has numbers in the columns {how.columns}" if used else why
        clock = (f"line {i} has a time of day, {shown(x)}" for i, x in lines if _CLOCK.match(x))
        wrong = f"the file has no known format and no row of numbers: {next(clock, why)}"
        raise NoAcceleration(wrong, "no motion")
    header, below, problem = _Header(), _Header(), None
    # The first row may state the number of samples, and a row may be damaged.
    width = mode(len(split(line)) for _, line in lines[first : first + 9])
    for i, line in head:
        try:
            _understand(header, line, width)
        except _Unknown as error:
            problem = i, str(error)
            break
    is_table = len(used) > 1 or len(header.cells) > 1 or any(re.fullmatch(_PAIR, x) for _, x in head)
    try:
        rows = _read_count(below, _rows(cursor, lines[first:], split, is_table), used)
        if problem is not None:
            where = "" if _unknown_word([problem[1]]) else f" above rows of {width} numbers"
            message = f"line {problem[0]} has {shown(problem[1])}, which is not understood{where}"
            raise UnreadableRecord(message, **_remedy(head, rows, how, problem, below))
        for kind, values in below.stated.items():
            header.stated[kind] += values
        # If the stated number of samples is not the number of rows, it must be the number of all cells.
        size = sum(len(cells) for _, cells in rows)
        if not (size == len(rows) or size in header.stated["count"] or header.cells or how.columns):
            message = f"line {rows[0][0]} has {len(rows[0][1])} numbers, but no line above names the columns"
            raise UnreadableRecord(message, **_remedy(head, rows, how, (rows[0][0] - 1, ""), below))
        return _channels(header, rows, how)
    except UnreadableRecord as error:
        if how.columns or (header.is_motion and problem is None):
            raise
        # Numbers without a word may be anything.
        raise NoAcceleration(error.args[0], **error.options) from None


def _is_row(cells: Sequence[str], used: Sequence[int]) -> bool:
    """Return whether all cells of a line, or those of the used columns, are numbers."""
    wanted = [cells[i] for i in used if i < len(cells)] if used else cells
    return len(wanted) >= max(1, len(used)) and all(re.fullmatch(NUMBER, cell) for cell in wanted)


def _rows(
    cursor: Cursor, printed: Sequence[_Line], split: Callable[[str], list[str]], is_table: bool
) -> list[_Row]:
    """Return the rows from the first line of `printed` to the end of the file.

    `is_table` states that the header or the user names several columns.
    """
    first, (line, text) = printed[0][0], printed[-1]
    # One comma in every row separates two columns only if there are several.
    if not is_table and "," in text and all(_DECIMAL.fullmatch(x) for _, x in printed):
        meaning = "one number with a decimal comma: write the numbers with decimal points"
        raise UnreadableRecord(f"line {line} has {shown(text)}, which may be {meaning}")
    no_thousands("\n".join(cursor.lines[first - 1 :]), split)
    lines = [(i, split(line)) for i, line in enumerate(cursor.lines[first - 1 :], first)]
    while not lines[-1][1]:
        lines.pop()
    # If a table has several columns and all last numbers have the same number of decimals, the last number
    # was not cut.
    ends = [cells[-1].partition(".")[2] for _, cells in lines if len(cells) > 1]
    even = len(ends) > 2 and len({len(end) for end in ends}) == 1 and len(lines[-1][1]) == len(lines[-2][1])
    cursor.at = len(cursor.lines)
    cursor.require_end(whole=bool(even and ends[0]))
    # In a single column a blank line may stand for a sample, and is an error below.
    return [(i, cells or [""]) for i, cells in lines if cells or len(lines[0][1]) == 1]


def _read_count(header: _Header, rows: list[_Row], used: Sequence[int]) -> list[_Row]:
    """Return the rows of samples, and add the statements of a first row of numbers to a header."""
    (line, cells), rest = rows[0], rows[1:]
    if used or len(rest) < 2:
        return rows
    values, total = [number(cell, line) for cell in cells], sum(len(row) for _, row in rest)
    wide = len(cells) != len(rest[0][1]) == len(rest[1][1])
    is_step = len(cells) == 1 or (len(cells) == 2 and STEPS[0] <= values[1] <= STEPS[1])
    if values[0] in (len(rest), total) and is_step:
        header.stated |= {"count": values[:1], "step": values[1:]}
        return rest
    # The count and the step may be in two lines, but the second number may also be a sample.
    step, count = sorted([values[0], number(rest[0][1][0], rest[0][0])])
    if len(cells) == 1 and count in (len(rest) - 1, total - 1) and STEPS[0] <= step <= _LONGEST_STEP:
        pair = f"the number of samples, {count:g}, and the step, {step:g} s"
        raise UnreadableRecord(f"lines {line} and {rest[0][0]} may be {pair}", skip=rest[0][0], dt=step)
    # A whole number above decimals is not a sample.
    decimals = sum("." in row[0] for _, row in rest)
    odd = len(cells) == 1 and values[0] and "." not in cells[0] and 2 * decimals > len(rest)
    if wide or odd:
        statement = f"the number of samples ({total} samples in {len(rest)} rows) with the step in s"
        # The next line may be a step in another unit, or a sample.
        remedy = {} if values[0] in (len(rest) - 1, total - 1) else {"skip": line}
        neither = f"which is neither a row like the others nor {statement}"
        raise UnreadableRecord(f"line {line} has {shown(' '.join(cells))}, {neither}", **remedy)
    return rows


def _understand(header: _Header, line: str, width: int) -> None:
    """Add the statements of a line to a header, or raise `_Unknown`."""
    text = re.sub(r"[\s,;]+$", "", _MARK.sub("", line, count=1))
    if _RULE.fullmatch(text):
        return
    # A line may contain several statements, separated by commas or words.
    parts = [part.strip() for part in re.split(r"[,;\t]|\b(?:at|with)\b", text) if part.strip()]
    statements = [_statement(part) for part in parts]
    if names := [part for part, statement in zip(parts, statements, strict=True) if statement is None]:
        columns = _cells(text, width, header)
        header.cells = columns or _cells("  ".join(names), width, header)
        if not header.cells:
            # The smallest piece that is not understood is the most helpful in a message.
            raise _Unknown(next(filter(None, (_unknown_word([part]) for part in names)), text))
        if columns:
            return
    for what, value in filter(None, statements):
        header.stated[what].append(value)


def _cells(text: str, width: int, header: _Header) -> list[str]:
    """Return names of columns, or names with the units that a line of units adds; empty if the line is
    neither."""
    for cells in _split_names(text):
        merged = [f"{x} ({y.strip('()[] ')})" for x, y in zip(header.cells, cells, strict=False)]
        # A line of units below the names of the columns is merged with them.
        named = merged or cells
        fits = len(cells) == width and not _unknown_word(named)
        if fits and (not merged or all(_column(x, first=True).unit for x in merged)):
            return named
    return []


def _split_names(text: str) -> list[list[str]]:
    """Return the possible ways to split a line of columns into cells."""
    row = re.sub(r"[\s,;]+$", "", _MARK.sub("", text.strip(), count=1))
    # A bracket belongs to the name before it, even if there are blanks between them.
    joined = re.sub(r"(?<=[^\s)\]])\s+(?=[(\[])", "", row)
    ways = re.split(r"\s*[,;\t]\s*", row), re.split(r"\s{2,}|\t", row), joined.split()
    return [[cell.strip(" \"'") for cell in cells] for cells in ways]


def _unknown_word(cells: Sequence[str], start: int = 0) -> str:
    """Return the first part of cells, from column `start` on, that is not understood, or an empty text."""
    try:
        for i, cell in enumerate(cells, start):
            _column(cell, first=i == 0)
    except _Unknown as error:
        return str(error)
    return ""


def _statement(part: str) -> tuple[str, Any] | None:
    """Return the kind and the value of a statement; None if the part of a line is not a statement."""
    for what, form in _STATEMENTS.items():
        if (match := re.fullmatch(form, part, re.I)) is None:
            continue
        value = next((group for group in match.groups() if group), "").strip("()[] ")
        if what == "unit" and unit_spelling(value) in FACTORS:
            return what, unit_spelling(value)
        if what in ("count", "rate") and (size := Decimal.of(value).value) > 0.0:
            return (what, size) if what == "count" else ("step", 1.0 / size)
        if what == "step":
            units, step = {word.lower() for word in (match[1], match[3]) if word}, Decimal.of(match[2]).value
            # Without a unit a short step is assumed to be in s.
            has_unit = units <= {*TIMES} and len(units) == 1 if units else step <= _LONGEST_STEP
            return (what, step * TIMES[units.pop() if units else "s"]) if has_unit and step > 0.0 else None
        if what == "source":
            for word in value.split():
                is_up = orientation(word.replace("up", ""))
                if is_up or unit_spelling(word) in FACTORS or _NO_SOURCE.fullmatch(word):
                    raise _Unknown(word)
            return what, value
    return None


def _column(cell: str, *, first: bool) -> _Column:
    """Return the meaning of a name, or raise `_Unknown`. T is a time only in the first column."""
    # AccZ and acc-NS consist of two words, but N-S is one word.
    title = _TWO_WORDS.sub(" ", _BRACKET.sub(" ", cell).strip(" :\"'"))
    words = [w for x in re.findall(r"[^\s_]+", title) for w in ([x] if is_component(x) else x.split("-"))]
    quantities, units, names, digits = set(), [], [], ""
    pieces = [*words, *_BRACKET.findall(cell)]
    if not pieces:
        raise _Unknown("an empty name")
    # A title with more words, or with numbers, may describe a filter instead.
    # A period or a frequency instead of a time shows a response spectrum.
    spectral = any(re.fullmatch(_NAMES["spectrum"], word.lower()) for word in pieces)
    if spectral and len(words) < 2 + (len(pieces) > len(words)) and not re.search(r"\d", title):
        message = f"{shown(cell)} belongs to a response spectrum and not to a ground motion"
        raise NoAcceleration(message, "response spectrum")
    for i, word in enumerate(pieces):
        low, unit, bracketed = word.strip(" .").lower(), unit_spelling(word), i >= len(words)
        named = next((quantity for quantity, form in _NAMES.items() if re.fullmatch(form, low)), "")
        # A lone V in brackets may be volts.
        is_name = is_component(word.strip(" .")) and not (bracketed and low == "v")
        if low in TIMES and (bracketed or first or "time" in quantities):
            units.append(low)
        elif unit in FACTORS or (unit in _QUANTITIES and unit not in TIMES and (bracketed or "/" in unit)):
            units.append(unit)
        elif re.fullmatch(_PROCESSING, low) and "acceleration" in quantities:
            continue
        elif named and not bracketed and (not is_component(word) or word == "t" or (first and word in "Tn")):
            quantities.add(named)
            digits += re.sub(r"\D", "", word)
        elif is_name or (len(words) == 1 and re.fullmatch(r"(?!100)[0-3]\d\d", word)):
            names.append(word.strip())
        elif low != "in" or unit_spelling("".join(pieces[i + 1 : i + 2])) not in FACTORS:
            raise _Unknown(f"({word})" if bracketed else next(w for w in cell.split() if word in w))
    # V next to accelerations is the vertical component, but v in m/s is a velocity.
    quantities |= {_QUANTITIES[unit] for unit in units}
    quantity = next(iter(quantities), "acceleration")
    if len(units) > 1 or len(quantities) > 1 or (names and quantity in ("time", "number")):
        raise _Unknown(cell)
    return _Column(quantity, " ".join(names), units[0] if units else None, digits)


def _channels(header: _Header, rows: Sequence[_Row], how: Options) -> list[Channel]:
    """Return the accelerations of a table whose header is understood."""
    # A header may state the step several times, in different forms.
    for first, second in pairwise(header.stated["step"]):
        agree(first, second, "the step in s", 1e-6 * first)
    total = sum(len(row) for _, row in rows)
    for count in header.stated["count"]:
        agree_on_count(int(count), len(rows) if count == len(rows) else total, "the header")
    step, columns = next(iter(header.stated["step"]), how.dt), {0: _Column("acceleration", "", None)}
    if isinstance(how.columns, Mapping):
        columns = _chosen_columns(header, how.columns)
    elif header.cells and how.columns is None:
        columns = {i: _column(cell, first=i == 0) for i, cell in enumerate(header.cells)}
    # Without names of columns all numbers are samples, row by row.
    in_rows = how.columns == ROWS or (how.columns is None and not header.cells)
    # Rows may have more columns than are used only if the user names the columns.
    width = max(columns) + 1
    for line, cells in () if in_rows else rows:
        if len(cells) < width or (how.columns is None and len(cells) > width):
            raise UnreadableRecord(f"line {line} must have {width} numbers, but has {shown(' '.join(cells))}")
    line, (cell, *more) = rows[0]
    if not (more or header.stated["count"] or how.columns == ROWS) and number(cell, line) == step:
        wrong = f"line {line} has {shown(cell)}, which is the step: columns={ROWS!r} reads it as a sample"
        raise UnreadableRecord(wrong, skip=line)
    times = [i for i, column in columns.items() if column.quantity == "time"]
    for i in times[:1]:
        unit = columns[i].unit
        step = step_of([(line, cells[i]) for line, cells in rows], TIMES[unit or "s"], step)
        if unit is None and step > _LONGEST_STEP:
            remedy = "name them 'time (s)' or 'time (ms)' in `columns`"
            raise UnreadableRecord(f"times with steps of {step:g} need a unit: {remedy}")
    if step is None:
        raise UnreadableRecord("the table states no times and no step: give `dt` in s, such as dt=0.01")
    accelerations = {i: column for i, column in columns.items() if column.quantity == "acceleration"}
    if not accelerations or len(times) > 1:
        content = ", ".join(column.quantity for column in columns.values())
        raise NoAcceleration(f"the table must have one time and accelerations, but has {content}", content)
    last = {(_axis(column.component), column.number): i for i, column in accelerations.items()}
    if len(last) < len(accelerations) and how.columns is None:
        names = ", ".join(shown(header.cells[i]) for i in accelerations)
        chosen = {header.cells[i]: i + 1 for i in (*times, *last.values())}
        wrong = f"some of the columns {names} may be one channel: `columns` must choose"
        raise UnreadableRecord(wrong, columns=chosen)
    lone = [cell for cell in header.cells if re.fullmatch(r"(?i)[vxyz]", cell)]
    if lone and how.columns is None and not all(column.component for column in accelerations.values()):
        raise UnreadableRecord(f"{shown(lone[0])} next to an acceleration may be a velocity: give `columns`")
    others = [cell for i, cell in enumerate(header.cells) if i in {*columns} - {*accelerations, *times}]
    notes = (f"left out of the table: {', '.join(others)}",) if others else ()
    channels = []
    for i, column in accelerations.items():
        units = [unit for unit in (column.unit, *header.stated["unit"]) if unit]
        if len({FACTORS[unit] for unit in units}) > 1:
            raise UnreadableRecord(f"the header states several units of acceleration: {', '.join(units)}")
        read = [(line, cell) for line, cells in rows for cell in (cells if in_rows else cells[i : i + 1])]
        name = column.component or ("" if len(accelerations) == 1 else f"column {i + 1}")
        factor = factor_of(next(iter(units), None), how.unit)
        channels.append(Channel(numbers(read) * factor, step, name, name, notes=notes))
    return channels


def _axis(component: str) -> str:
    """Return the first letter of an axis, which is the third one of a SEED code; a name with digits as it is.

    North and south are the same axis, and so are east and west.
    """
    name = component.lower()
    letter = name[2:] if re.fullmatch(r"[a-z][hlgn][zne]", name) else name[:1]
    return name if re.search(r"\d", name) else letter.translate(_OPPOSITE)


def _chosen_columns(header: _Header, wanted: Mapping[str, int]) -> dict[int, _Column]:
    """Return the columns that the user names. They must agree with the header."""
    columns: dict[int, _Column] = {}
    for name, at in wanted.items():
        if piece := _unknown_word([name], at - 1):
            allowed = "names of times, accelerations or components, such as 'time (ms)', N and E"
            wrong = f"{shown(name)}, in which {shown(piece)} is not understood"
            raise ValueError(f"`columns` must contain {allowed}, but has {wrong}")
        column = _column(name, first=at == 1)
        says = _column(header.cells[at - 1], first=at == 1) if at <= len(header.cells) else column
        units = {FACTORS.get(u) or TIMES.get(u, u) for u in (column.unit, says.unit) if u}
        axes = {_axis(c.component) for c in (column, says) if c.component}
        if column.quantity != says.quantity or len(units) > 1 or len(axes) > 1:
            stated = f"the header names column {at} {shown(header.cells[at - 1])}"
            raise UnreadableRecord(f"{stated}, but `columns` names it {name!r}")
        columns[at - 1] = replace(column, unit=column.unit or says.unit)
    return columns


def _remedy(
    head: Sequence[_Line], rows: Sequence[_Row], how: Options, problem: _Line, below: _Header
) -> dict[str, Any]:
    """Return the options that may read a table in which a part of a line, `problem`, is not understood.

    The header `below` has the statements of a first row of numbers.
    """
    line, piece = problem
    width, above = len(rows[0][1]), dict(head).get(line, "")
    ways = ((text, cells) for _, text in head[::-1] for cells in _split_names(text) if len(cells) == width)
    named, names = next(ways, ("", [""] * width))
    # A line above the names may state that all columns are vertical.
    is_up = any(orientation(re.sub(r"\bup\b", "", x)) for _, x in head if x != named or width == 1)
    # Collect the names that are understood, and place holders in capitals for the others.
    columns, meanings, options = dict[str, int](), list[_Column](), dict[str, Any]()
    for k, cell in enumerate(names):
        name = _BRACKET.sub(" ", cell).strip() if _unknown_word([cell], k) else cell
        says = None if _unknown_word([name], k) else _column(name, first=k == 0)
        # Units in a bracket that was removed from the name: the column may be another quantity.
        units = {unit_spelling(unit) for unit in _BRACKET.findall(cell) if name != cell}
        if says is None or units & {*_QUANTITIES} or (units and says.quantity == "time"):
            continue
        if name in columns or (is_up and says.quantity == "acceleration" and not says.component):
            name, says = f"NAME{k + 1}", replace(says, unit=None)
        columns[name] = k + 1
        meanings.append(says)
    first = [real(row[0]) for _, row in rows if re.fullmatch(NUMBER, row[0])]
    # Whole numbers may be the numbers of the samples, and times in another unit are left out.
    is_time = width > 1 and len(first) > 2 and first == sorted({*first}) and first[1] - first[0] != 1.0
    if is_time and 1 not in columns.values() and not _BRACKET.search(names[0]):
        columns = {"time (UNIT)": 1} | columns
        meanings.append(_Column("time", "", None))
    units = [column.unit for column in meanings if column.quantity == "acceleration"]
    if not units and (named or width < 5 or is_time):
        others = "|".join(_NAMES[kind] for kind in ("velocity", "displacement", "spectrum"))
        unnamed = {*range(2 if is_time else 1, width + 1)} - {*columns.values()}
        unnamed -= {k for k in unnamed for x in _GAPS.split(names[k - 1].lower()) if re.fullmatch(others, x)}
        if not unnamed:
            return {}
        columns |= {f"NAME{k}" if len(unnamed) > 1 or is_up else "acceleration": k for k in unnamed}
    # Look for a unit and a factor in the names of the used columns, or in the line.
    used = " ".join(cell for k, cell in enumerate(names, 1) if k in columns.values()).strip() or above
    stated = [text for _, text in head if re.match(r"\W*units?\b", text.lower())]
    stated_units = {unit_spelling(word) for word in _GAPS.split(" ".join([used, *stated]))} & {*FACTORS}
    rest = [
        word for word in _GAPS.split(used if above == named else above) if unit_spelling(word) not in FACTORS
    ]
    match = _FACTOR.fullmatch(piece)
    if match and unit_spelling(match[2] or match[3]) in FACTORS:
        options["factor"] = 10.0 ** int(match[1] or 0) * real(match[4] or "1")
    elif (piece[:1] == "(" and not stated_units) or re.search(rf"(?i)\d|{_SCALED}", " ".join(rest)):
        options["factor"] = "FACTOR"
    with contextlib.suppress(_Unknown, UnreadableRecord):
        for _, text in (x for x in head if x[0] > line):
            _understand(below, text, width)
        # If the lines below are sufficient, except for a unit, it is enough to skip this line and all lines
        # above it.
        size = sum(len(cells) for _, cells in rows)
        fits = width == 1 or below.cells or size in below.stated["count"]
        for unit in (how.unit, "g") if fits and not is_up else ():
            with contextlib.suppress(UnreadableRecord):
                if _channels(below, rows, replace(how, unit=unit)):
                    return {"skip": line} | options | ({} if unit == how.unit else {"unit": "UNIT"})
    options = ({"skip": rows[0][0] - 1} if head else {}) | {"columns": columns or ROWS} | options
    if not units or not all(units):
        options["unit"] = how.unit or (stated_units.pop() if len(stated_units) == 1 else "UNIT")
    if "time" not in {column.quantity for column in meanings}:
        options["dt"] = how.dt or "STEP"
    return options
