"""Text tables: times and accelerations in columns, or samples one after the other.

The reader does not guess. A table is read if one line above the numbers names all columns in the words of
`NAMES`, or if the options state the columns. Any other table is rejected, and the message shows what the file
contains.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import mode
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.core.formatting import aligned, called
from tpd.core.formatting import number as in_digits
from tpd.formats.channel import (
    BASELINES,
    FACTORS,
    TIMES,
    Channel,
    check_unit,
    factor_of,
    is_component,
    orientation,
    unit_spelling,
)
from tpd.formats.text import (
    NUMBER,
    Cursor,
    NoAcceleration,
    UnreadableRecord,
    no_thousands,
    number,
    numbers,
    quote,
    real,
    splitter,
    step_of,
)

ROWS = "rows"
"""Value of the option `columns` if the samples continue row by row."""
NAMES = {
    "time": "t time",
    "acceleration": "a acc accel acceleration",
    "north": "n north ns sn s south northsouth",
    "east": "e east ew we w west eastwest",
    "longitudinal": "l long longitudinal",
    "transverse": "tran trans transverse",
    "vertical": "z v u ud up ver vert vertical updown",
    "x": "x",
    "y": "y",
}
"""Names of columns, by their meaning. T in capitals is transverse."""
_HORIZONTAL = {"north", "east"}, {"longitudinal", "transverse"}, {"x", "y"}
"""Horizontal directions of one sensor."""
_MEANINGS = {name: meaning for meaning, names in NAMES.items() for name in names.split()}
# Other letters after the word for an acceleration can be a total, a velocity or a unit.
_DIRECTIONS = [*"nexyz", "ns", "ew", "ud", "up", "north", "east", "vertical"]
_MEANINGS |= {f"{a}{x}": _MEANINGS[x] for x in _DIRECTIONS for a in NAMES["acceleration"].split()[1:]}
_MEANINGS |= {f"{a}{x}": _MEANINGS[x] for a, names in (("a", "xyz"), ("hn", "nez")) for x in names}
_SCALES = FACTORS | TIMES
_CELL = re.compile(r"([^()\[\]]+?)\s*(?:[(\[]([^()\[\]]*)[)\]])?")
"""Pattern of the name of a column with its unit."""
_UNIT = re.compile(r"(?i)units?\s*[:=]\s*[(\[]?(.+?)[)\]]?")
_RATE = re.compile(rf"(?i)(?:fs|(?:sampling )?rate)\s*[:=]?\s*({NUMBER})\s*hz")
_STEP = re.compile(
    r"(?i)(?:dt|(?:time )?step|sampling interval)\s*(?:[(\[](\w+)[)\]])?\s*[:=]?\s*"
    rf"({NUMBER})\s*([a-z]*)"
)
_OTHER = re.compile(r"(?i)[(\[](?:m|cm|mm|in|ft)(?:/s)?[)\]]")
"""Pattern of a unit of displacement or velocity."""
_LONGEST_STEP = 0.1
"""Longest step that is assumed to be in s if no unit is stated. A longer step may be in ms."""
_MARK = re.compile(r"^(?:[#%!*]+|/+)\s*")
_RULE = re.compile(r"[\s\-=_+|~.*#]*")
_DECIMAL = re.compile(r"[+-]?\d*(?:,\d+(?:[EeDd][+-]?\d{1,3})?)?")
"""Pattern of a number that may have a decimal comma."""
_MOST_LINES = 12
"""Largest number of lines of a file that a message shows."""
_FILL_IN = (
    f"  NAME can be {', '.join(NAMES)}, or a direction such as 090.",
    f"  UNIT can be s or ms, or {', '.join(FACTORS)}. Columns without a name are not read.",
    f"  If the samples continue row by row, `columns` is {ROWS}.",
)
"""Explanation of the example of options in a message."""


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
            raise ValueError(f"{called('skip')} must be a number of lines, 0 or more, but is {self.skip!r}")
        checks.set_checked(self, checks.number, "factor")
        # A record of zeros would pass every later check.
        if self.factor == 0.0:
            raise ValueError(f"{called('factor')} must be a finite number other than 0, but is 0")
        if self.dt is not None:
            checks.set_checked(self, checks.positive, "dt")
        if self.unit is not None:
            check_unit(self.unit)
        if self.baseline is not None:
            checks.one_of("baseline", self.baseline, BASELINES)
        if self.columns is None or self.columns == ROWS:
            return
        # A wrong type has no columns, so that one sentence names what is allowed.
        columns = self.columns if isinstance(self.columns, Mapping) else {}
        are_numbers = all(type(at) is int and at >= 1 for at in columns.values())
        if not columns or not (are_numbers and all(isinstance(name, str) for name in columns)):
            allowed = f"map names to column numbers, from 1, such as {{'time': 1, 'N': 2}}, or be {ROWS!r}"
            raise ValueError(f"{called('columns')} must {allowed}, but is {self.columns!r}")
        if len(set(columns.values())) < len(columns):
            raise ValueError(f"{called('columns')} must contain each column once, but is {columns!r}")


@dataclass(frozen=True)
class _Column:
    """Meaning of the name of a column."""

    meaning: str
    """Key of `NAMES`, or a direction that the user states."""
    component: str = ""
    """Direction."""
    unit: str | None = None


_Row = tuple[int, list[str]]
"""Number of a line in the file, and its cells."""


class _Table:
    """Lines of a text that are not blank: the header, with its statements, and the rows of numbers."""

    def __init__(self, lines: Sequence[str], skip: int, used: Sequence[int] = ()) -> None:
        self.split: Callable[[str], list[str]] = splitter(lines[skip:])
        printed = [(i, line.strip()) for i, line in enumerate(lines, 1) if i > skip and line.strip()]
        cells = [self.split(line) for _, line in printed]
        # A line of numbers above a line without them, such as the numbers of the columns above their names,
        # belongs to the header.
        has_number = [any(re.fullmatch(NUMBER, cell) for cell in row) for row in cells[1:]] + [True]
        pairs = zip(cells, has_number, strict=False)
        first = next((k for k, (row, x) in enumerate(pairs) if x and _is_row(row, used)), len(printed))
        self.head, self.rows = printed[:first], printed[first:]
        # The first row may be damaged.
        self.width = mode(map(len, cells[first : first + 9])) if self.rows else 0
        self.state(self.head)

    def state(self, head: Sequence[tuple[int, str]]) -> None:
        """Read the statements of lines of the header."""
        self.stated, self.unknown = dict[str, Any](), list[tuple[int, str]]()
        named: tuple[int, list[str], list[_Column | None]] = 0, [], []
        for i, line in head:
            # Statements may be in the line of the names.
            parts = [part.strip(" \"'") for part in re.split(r"[,;\t]", _MARK.sub("", line)) if part.strip()]
            others = [part for part in parts if not self._understand(part) and not _RULE.fullmatch(part)]
            # A bracket belongs to the name before it.
            joined = re.sub(r"(?<=[^\s)\]])\s+(?=[(\[])", "", others[0] if others else "")
            cells = joined.split() if len(others) == 1 < self.width else others
            columns = [_column(cell) for cell in cells]
            # The line that names most columns is the line of names, and the line before it is none.
            if len(cells) == self.width and sum(map(bool, columns)) > sum(map(bool, named[2])):
                named, (i, cells, _) = (i, cells, columns), named
            # What is neither a statement nor the line of names is not understood.
            if cells:
                self.unknown.append((i, " ".join(cells)))
        line, self.cells, self.columns = named
        if not all(self.columns):
            self.unknown.append((line, self.cells[self.columns.index(None)]))
        self.unknown.sort()

    def _understand(self, text: str) -> bool:
        """Return whether a text states the unit or the time step (s), as all texts before it."""
        kind, value, match = "step", None, _STEP.fullmatch(text)
        # Without a unit a short step is in s, and a long one is not understood.
        if match and (match[1] or match[3] or real(match[2]) <= _LONGEST_STEP):
            value = real(match[2]) * TIMES.get((match[1] or match[3] or "s").lower(), 0.0)
        elif match := _RATE.fullmatch(text):
            value = 1.0 / max(real(match[1]), 1e-9)
        elif (match := _UNIT.fullmatch(text)) and (unit := unit_spelling(match[1])) in FACTORS:
            kind, value = "unit", unit
        return bool(value) and self.stated.setdefault(kind, value) == value


def overview(lines: Sequence[str], skip: int = 0) -> list[str]:
    """Return the first lines of a text with their numbers, and a table of its columns of numbers."""
    table = _Table(lines, skip)
    top = [*table.head, *table.rows][: len(table.head) + 1]
    # The last lines above the numbers, and the first row, are the most helpful ones.
    top = top if len(top) <= _MOST_LINES else [*top[:4], *top[4 - _MOST_LINES :]]
    rows = [cells for _, line in table.rows if len(cells := table.split(line)) == table.width]
    columns = [[real(x) for x in cells if re.fullmatch(NUMBER, x)] for cells in zip(*rows, strict=True)]
    values = {str(k): np.array(x) for k, x in enumerate(columns, 1) if x}
    return [f"  line {i:<4d} {line[:90]}" for i, line in top] + (columns_in_words(values) if values else [])


def columns_in_words(columns: Mapping[str, np.ndarray]) -> list[str]:
    """Return a table of the smallest, largest and mean number of columns, and of what each of them can be."""
    rows, last = [["  column", "smallest", "largest", "mean", "step"]], ["it can be"]
    for name, x in columns.items():
        # Times may be rounded, so that their steps differ a little.
        steps = np.diff(x) if len(x) > 1 else np.zeros(1)
        usual = float(np.median(steps))
        is_even = usual > 0.0 and float(np.ptp(steps)) <= 0.3 * usual
        kinds = {
            "times, numbers of rows, or periods": is_even,
            "times or periods of unequal steps": bool((steps > 0.0).all()),
            "a constant": float(np.ptp(x)) == 0.0,
            "a total, a spectrum or another size without a sign": float(x.min()) >= 0.0,
            "a motion with an offset": abs(float(x.mean())) > 0.05 * float(np.abs(x).max()),
        }
        # The first kind that holds is the most specific one.
        sizes = [in_digits(float(y)) for y in (x.min(), x.max(), x.mean())]
        rows.append([f"  {name}", *sizes, in_digits(usual) if is_even else ""])
        last.append(next((kind for kind, holds in kinds.items() if holds), "a motion"))
    # The last column is a text, and `aligned` would align it to the right.
    width = max(len(line) for line in aligned(rows))
    return [f"{line:{width}}  {end}" for line, end in zip(aligned(rows), last, strict=True)]


def read_table(cursor: Cursor, how: Options) -> list[Channel]:
    """Return the channels of a table.

    Raises:
        NoAcceleration: there are no numbers, the names of the columns are missing or not understood, or
            there is no time step.
        UnreadableRecord: the table contradicts itself or the options, a cell is not a number, or the times
            have unequal steps.
    """
    # Columns are numbered from 1 for users.
    used = [i - 1 for i in how.columns.values()] if isinstance(how.columns, Mapping) else []
    table = _Table(cursor.lines, how.skip, used)
    try:
        columns = _columns(table, how)
    except NoAcceleration as error:
        if error.options or not table.rows:
            error.preview = (*overview(cursor.lines, how.skip), *(_FILL_IN if error.options else ()))
        raise
    return _channels(table, columns, _rows(cursor, table, len(table.columns or used) > 1), how)


def _is_row(cells: Sequence[str], used: Sequence[int]) -> bool:
    """Return whether all cells of a line, or those of the used columns, are numbers."""
    wanted = [cells[i] for i in used if i < len(cells)] if used else cells
    return len(wanted) >= max(1, len(used)) and all(re.fullmatch(NUMBER, cell) for cell in wanted)


def _rows(cursor: Cursor, table: _Table, is_table: bool) -> list[_Row]:
    """Return the rows from the first one to the end of the file.

    `is_table` states that the header or the user names several columns.
    """
    first, (line, text), split = table.rows[0][0], table.rows[-1], table.split
    # One comma in every row separates two columns only if there are several.
    if not is_table and "," in text and all(_DECIMAL.fullmatch(x) for _, x in table.rows):
        meaning = "one number with a decimal comma: write the numbers with decimal points"
        raise UnreadableRecord(f"line {line} has {quote(text)}, which may be {meaning}")
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


def _column(cell: str, *, is_stated: bool = False) -> _Column | None:
    """Return the meaning of a name of a column; None if it is not understood.

    Args:
        cell: name, with a unit in brackets.
        is_stated: whether the user states the name, which may then be any direction.
    """
    if (match := _CELL.fullmatch(cell.strip())) is None:
        return None
    name, unit = match[1], None if match[2] is None else unit_spelling(match[2])
    word = re.sub(r"[\s_.-]+", "", name.lower())
    meaning = "transverse" if name == "T" else _MEANINGS.get(word, "")
    if is_stated and not meaning:
        meaning = name if is_component(name) else "acceleration" * bool(re.fullmatch(r"acc\d+", word))
    if not meaning or unit not in (None, *(TIMES if meaning == "time" else FACTORS)):
        return None
    component = name if orientation(name) is not None else meaning
    return _Column(meaning, "" if meaning in ("time", "acceleration") else component, unit)


def _columns(table: _Table, how: Options) -> dict[int, _Column]:
    """Return the columns that are read, by their index.

    Raises:
        NoAcceleration: there are no rows, the header does not name all columns, or there is no time step.
    """
    if not table.rows:
        columns = f"in the columns {how.columns} " if how.columns else ""
        wrong = f"the file has no known format and no row of numbers {columns}after line {how.skip}"
        raise NoAcceleration(f"{wrong}: commas, semicolons, tabs or blanks must separate them", "no motion")
    if isinstance(how.columns, Mapping):
        return dict(_chosen_column(table, name, at) for name, at in how.columns.items())
    if how.columns == ROWS:
        return {0: _Column("acceleration")}
    # Without names all numbers are samples. Several columns without names are rejected below.
    columns = [column for column in table.columns if column] or [_Column("acceleration")]
    reason = _conflict(columns)
    if table.unknown:
        line, part = table.unknown[-1]
        reason = f"line {line} has {quote(part)}, which is not understood"
    elif not table.columns and table.width > 1:
        reason = f"line {table.rows[0][0]} has {table.width} numbers, but no line above names the columns"
    if reason:
        options = _example(table, how)
        # A word such as "normalised" changes the meaning of the numbers.
        reason += ": skip it only if it does not change the numbers" if "skip" in options else ""
        raise NoAcceleration(reason, **options)
    if not (how.dt or "step" in table.stated or any(column.meaning == "time" for column in columns)):
        raise NoAcceleration(_no_step())
    return dict(enumerate(columns))


def _no_step() -> str:
    return f"the table states no times and no step: give {called('dt')} in s, such as 0.01"


def _conflict(columns: Sequence[_Column]) -> str:
    """Return words for why columns are not a time and the directions of one sensor."""
    meanings = [column.meaning for column in columns]
    motions = [meaning for meaning in meanings if meaning != "time"]
    level = {*motions} - {"vertical"}
    is_sensor = len({*motions}) == len(motions) and any(level <= pair for pair in _HORIZONTAL)
    if len(meanings) - len(motions) <= 1 and (is_sensor or motions == ["acceleration"]):
        return ""
    return f"the columns {', '.join(meanings)} are not a time and the directions of one sensor"


def _example(table: _Table, how: Options) -> dict[str, Any]:
    """Return options that can read a table, with places to fill in."""
    at, named = table.unknown[-1][0] if table.unknown else 0, [*zip(table.cells, table.columns, strict=True)]
    unit = how.unit or table.stated.get("unit")
    # If the header below a line is understood, it is enough to skip this line and all lines above it.
    table.state([row for row in table.head if row[0] > at])
    columns = [column for column in table.columns if column] or [_Column("acceleration")]
    if at and not table.unknown and len(columns) == table.width and not _conflict(columns):
        options: dict[str, Any] = {"skip": at}
        if not (how.unit or "unit" in table.stated or any(c.unit and c.meaning != "time" for c in columns)):
            options["unit"] = "UNIT"
    else:
        # A place to fill in replaces a name that is not understood, or that contradicts the other names.
        columns, names = [column for _, column in named if column], dict[str, int]()
        for k, (cell, column) in enumerate(named or [("", None)] * table.width, 1):
            is_time = bool(column and column.meaning == "time")
            name = cell if column and (at or is_time) else f"NAME{k}"
            has_unit = name == cell and (is_time or unit or (column and column.unit))
            names[name if has_unit else f"{name} (UNIT)"] = k
        options = {"columns": names}
    has_step = how.dt or "step" in table.stated or any(column.meaning == "time" for column in columns)
    return options if has_step or len(columns) < table.width else options | {"dt": "STEP"}


def _chosen_column(table: _Table, name: str, at: int) -> tuple[int, _Column]:
    """Return the index of a column, and what the user states about it, which must agree with the header."""
    if (column := _column(name, is_stated=True)) is None:
        allowed = "names of times, accelerations or directions, such as 'time (ms)', N and 'E (gal)'"
        raise ValueError(f"{called('columns')} must contain {allowed}, but has {quote(name)}")
    cell, says = next(iter(zip(table.cells[at - 1 :], table.columns[at - 1 :], strict=True)), ("", None))
    says = says or column
    # An acceleration without a direction agrees with any direction.
    units = {_SCALES[unit] for unit in (column.unit, says.unit) if unit}
    meanings = {column.meaning, says.meaning} - {"acceleration"}
    # A user may know that x is north, but not that east is north.
    is_other = "time" in meanings or "vertical" in meanings or any(meanings <= pair for pair in _HORIZONTAL)
    differ = len(meanings) > 1 and is_other
    if _OTHER.search(cell) or len(units) > 1 or differ:
        other = f"{called('columns')} names it {name!r}"
        raise UnreadableRecord(f"the header names column {at} {quote(cell)}, but {other}")
    return at - 1, replace(column, unit=column.unit or says.unit)


def _channels(
    table: _Table, columns: Mapping[int, _Column], rows: Sequence[_Row], how: Options
) -> list[Channel]:
    """Return the accelerations of the columns of a table."""
    step, in_rows = table.stated.get("step", how.dt), how.columns == ROWS
    _check_shape(rows, step, 0 if in_rows else max(columns) + 1)
    motions = {i: column for i, column in columns.items() if column.meaning != "time"}
    times = [i for i in columns if i not in motions]
    if not motions or len(times) > 1:
        wrong = f"{called('columns')} must have at most one time, and accelerations: {how.columns}"
        raise UnreadableRecord(wrong)
    for i in times:
        unit = columns[i].unit
        remedy = f"leave them out of {called('columns')} and give {called('dt')}"
        step = step_of([(line, cells[i]) for line, cells in rows], TIMES[unit or "s"], step, remedy)
        if unit is None and step > _LONGEST_STEP:
            remedy = f"name them 'time (s)' or 'time (ms)' in {called('columns')}"
            raise UnreadableRecord(f"times with steps of {step:g} need a unit: {remedy}")
    if step is None:
        raise UnreadableRecord(_no_step())
    channels = []
    for i, column in motions.items():
        # A unit above the table and a unit of a column must be the same.
        units = [unit for unit in (column.unit, table.stated.get("unit")) if unit]
        if len({FACTORS[unit] for unit in units}) > 1:
            raise UnreadableRecord(f"the header states several units of acceleration: {', '.join(units)}")
        read = [(line, cell) for line, cells in rows for cell in (cells if in_rows else cells[i : i + 1])]
        name = column.component or ("" if len(motions) == 1 else f"column {i + 1}")
        factor = factor_of(next(iter(units), None), how.unit)
        channels.append(Channel(numbers(read) * factor, step, name, name))
    return channels


def _check_shape(rows: Sequence[_Row], step: float | None, width: int) -> None:
    """Raise `UnreadableRecord` for rows of unequal length, and for a count or a step above one column.

    The `width` is the least number of columns, or 0 if the samples continue row by row.
    """
    # The first row may be a count with a step, so the usual length counts.
    full = max(width, mode(len(cells) for _, cells in rows[:9]))
    for k, (line, cells) in enumerate(rows if width else rows[:-1]):
        if len(cells) != full:
            options = {"skip": line} if k == 0 and len(rows) > 2 else {}
            wrong = f"line {line} must have {full} numbers, but has {quote(' '.join(cells))}"
            raise UnreadableRecord(wrong, **options)
    decimals = 2 * sum("." in row[0] for _, row in rows) > len(rows)
    for k in (1, 0) if len(rows) > 3 and full == width == 1 else ():
        line, (cell, *_) = rows[k]
        value, count = number(cell, line), len(rows) - k - 1
        # A whole number above decimals is not a sample.
        if value in (count, count - 1, step) or (decimals and value and "." not in cell):
            meaning = f"the step or the number of samples: columns={ROWS!r} reads it as a sample"
            raise UnreadableRecord(f"line {line} has {quote(cell)}, which can be {meaning}", skip=line)
