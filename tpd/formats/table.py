"""Text tables: times and accelerations in columns, or samples one after the other.

The reader does not guess. A table is read if one line above the numbers names all columns in the words of
`NAMES`, or if the options state the columns. Any other table is rejected, and the message shows what the file
contains.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import mode
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.core.formatting import aligned
from tpd.core.formatting import number as in_digits
from tpd.formats.channel import (
    BASELINES,
    FACTORS,
    TIMES,
    Channel,
    check_unit,
    factor_of,
    is_component,
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
    real,
    shown,
    splitter,
    step_of,
)

ROWS = "rows"
"""Value of the option `columns` if the samples continue row by row."""
NAMES = {
    "time": "t time",
    "acceleration": "a acc accel acceleration",
    "north": "n north ns sn s south",
    "east": "e east ew we w west",
    "longitudinal": "l long longitudinal",
    "transverse": "tran trans transverse",
    "vertical": "z v u ud up ver vert vertical",
    "x": "x",
    "y": "y",
}
"""Names of columns, by their meaning. T in capitals is transverse."""
_HORIZONTAL = {"north", "east"}, {"longitudinal", "transverse"}, {"x", "y"}
"""Horizontal directions of one sensor."""
_MEANINGS = {name: meaning for meaning, names in NAMES.items() for name in names.split()}
_BEFORE = re.compile(r"^(?:acc(?:el(?:eration)?)?|a(?=[xyz]$))(?=.)")
"""Pattern of an acceleration before a direction, as in ax and acc N."""
_AMBIGUOUS = ("t", "v", "l", "s", "a", "acc")
"""Names that are no direction after the word for an acceleration: a total, a velocity, or another unit."""
_CELL = re.compile(r"([^()\[\]]*?)\s*(?:[(\[]([^()\[\]]*)[)\]])?")
"""Pattern of the name of a column with its unit."""
_STATEMENT = re.compile(
    rf"(?:units?\s*[:=]\s*(?P<unit>.+)|(?:dt|(?:time )?step|sampling interval|fs|(?:sampling )?rate)\s*[:=]?"
    rf"\s*(?P<value>{NUMBER})\s*(?P<of>[a-z]*))",
    re.IGNORECASE,
)
"""Pattern of a line that states the unit, the time step or the sampling rate."""
_OTHER = re.compile(r"(?:m|cm|mm|in|ft)(?:/s)?")
"""Pattern of units of displacement and velocity."""
_SPECTRUM = re.compile(r"\b(?:periods?|freq\w*|p?s[adv]|hz|\w*spectr\w*)\b", re.IGNORECASE)
_LONGEST_STEP = 0.1
"""Longest step that is assumed to be in s if no unit is stated. A longer step may be in ms."""
_MARK = re.compile(r"^(?:[#%!*]+|/+)\s*|[\s,;]+$")
_RULE = re.compile(r"[\s\-=_+|~.*#]*")
_CLOCK = re.compile(r"\D?\d{1,2}:\d{2}|\D?\d{4}[-/]\d{1,2}[-/]\d{1,2}")
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

    meaning: str
    """Key of `NAMES`, or a direction that the user states."""
    component: str
    """Direction as it is written."""
    unit: str | None


_Row = tuple[int, list[str]]
"""Number of a line in the file, and its cells."""


@dataclass
class _Header:
    """Statements of the lines above the samples."""

    cells: list[str] = field(default_factory=list)
    """Names of the columns with their units, if one line names all of them."""
    columns: list[_Column | None] = field(default_factory=list)
    """Meanings of the names; None for a name that is not understood."""
    unit: str | None = None
    step: float | None = None
    unknown: tuple[int, str] | None = None
    """Number of the last line that is not understood, and the part of it that is the reason."""


@dataclass(frozen=True)
class _Layout:
    """Lines of a text that are not blank: the header and the rows of numbers."""

    head: list[tuple[int, str]]
    rows: list[tuple[int, str]]
    split: Callable[[str], list[str]]

    @property
    def width(self) -> int:
        """Number of columns. The first row may be damaged."""
        return mode(len(self.split(line)) for _, line in self.rows[:9])


def _layout(lines: Sequence[str], skip: int, used: Sequence[int] = ()) -> _Layout:
    """Return the parts of a text. The first row has numbers in the columns `used`, or only numbers."""
    split = splitter(lines[skip:])
    printed = [(i, line.strip()) for i, line in enumerate(lines, 1) if i > skip and line.strip()]
    # A line of numbers above a line of names, such as the numbers of the columns, belongs to the header.
    pairs = enumerate(zip(printed, [*printed[1:], (0, "")], strict=False))
    starts = (k for k, (a, b) in pairs if _is_row(split(a[1]), used) and not any(map(_column, split(b[1]))))
    first = next(starts, len(printed))
    return _Layout(printed[:first], printed[first:], split)


def overview(lines: Sequence[str], skip: int = 0) -> list[str]:
    """Return the first lines of a text with their numbers, and a table of its columns of numbers."""
    layout = _layout(lines, skip)
    printed = [*layout.head, *layout.rows]
    # The last lines above the numbers, and the first row, are the most helpful ones.
    end = min(len(layout.head) + 1, len(printed))
    chosen = printed[:end] if end <= _MOST_LINES else [*printed[:4], *printed[end - _MOST_LINES + 4 : end]]
    out = [f"  line {i:<4d} {line[:90]}" for i, line in chosen]
    if not layout.rows:
        return out
    cells = [row for _, line in layout.rows if len(row := layout.split(line)) == layout.width]
    values = [[real(x) for x in column if re.fullmatch(NUMBER, x)] for column in zip(*cells, strict=True)]
    return out + columns_in_words({str(k): np.array(x) for k, x in enumerate(values, 1)})


def columns_in_words(columns: Mapping[str, np.ndarray]) -> list[str]:
    """Return a table of the smallest, largest and mean number of columns, and of what each of them can be."""
    rows = [["  column", "smallest", "largest", "mean", "step", "", "it can be"]]
    for name, x in columns.items():
        if not x.size:
            rows.append([f"  {name}", *[""] * 5, "no numbers"])
            continue
        steps, mean, peak = np.diff(x), float(x.mean()), float(np.abs(x).max())
        rises = steps.size > 0 and bool((steps > 0.0).all())
        is_even = rises and float(np.ptp(steps)) <= 0.3 * float(np.median(steps))
        meaning = "a motion"
        if rises:
            meaning = "times, numbers of rows, or periods" if is_even else "times or periods of unequal steps"
        elif float(np.ptp(x)) == 0.0:
            meaning = "a constant"
        elif x.min() >= 0.0:
            meaning = "a total, a spectrum or another size, which has no sign"
        elif abs(mean) > 0.05 * peak:
            meaning = "a motion with an offset"
        sizes = (float(x.min()), float(x.max()), mean)
        step = in_digits(float(np.median(steps))) if is_even else ""
        rows.append([f"  {name}", *map(in_digits, sizes), step, "", meaning])
    # The last column is a text, which is aligned to the left.
    return [f"{line}  {row[-1]}" for line, row in zip(aligned([x[:-2] for x in rows]), rows, strict=True)]


def read_table(cursor: Cursor, how: Options) -> list[Channel]:
    """Return the channels of a table.

    Raises:
        NoAcceleration: no line above the numbers names an acceleration.
        UnreadableRecord: the names of the columns are missing or not understood, the table contradicts
            itself, a cell is not a number, or the times have unequal steps.
    """
    # Columns are numbered from 1 for users.
    used = [i - 1 for i in how.columns.values()] if isinstance(how.columns, Mapping) else []
    layout = _layout(cursor.lines, how.skip, used)
    if not layout.rows:
        why = f"commas, semicolons, tabs or blanks must separate numbers after line {how.skip}"
        why = f"no line has numbers in the columns {how.columns}" if used else why
        clock = (f"line {i} has a time of day, {shown(x)}" for i, x in layout.head if _CLOCK.match(x))
        wrong = f"the file has no known format and no row of numbers: {next(clock, why)}"
        raise NoAcceleration(wrong, "no motion")
    header = _header(layout.head, layout.width)
    try:
        rows = _rows(cursor, layout, len(used) > 1 or len(header.cells) > 1)
        try:
            columns = _columns(header, how, layout)
        except UnreadableRecord as error:
            error.preview = (*overview(cursor.lines, how.skip), *_FILL_IN)
            raise
        return _channels(header, columns, rows, how)
    except UnreadableRecord as error:
        above = " ".join(line for _, line in layout.head)
        units = (unit_spelling(unit) for unit in re.findall(r"[(\[]([^()\[\]]*)[)\]]", above))
        states = header.unit or any(header.columns) or {*units} & {*FACTORS} or re.search(r"(?i)\bacc", above)
        if how.columns or (states and not _SPECTRUM.search(above)):
            raise
        # Numbers without a word may be anything.
        content = "response spectrum" if _SPECTRUM.search(above) else ""
        other = NoAcceleration(error.args[0], content, **error.options)
        other.preview = error.preview
        raise other from None


def _is_row(cells: Sequence[str], used: Sequence[int]) -> bool:
    """Return whether all cells of a line, or those of the used columns, are numbers."""
    wanted = [cells[i] for i in used if i < len(cells)] if used else cells
    return len(wanted) >= max(1, len(used)) and all(re.fullmatch(NUMBER, cell) for cell in wanted)


def _rows(cursor: Cursor, layout: _Layout, is_table: bool) -> list[_Row]:
    """Return the rows from the first one to the end of the file.

    `is_table` states that the header or the user names several columns.
    """
    first, (line, text), split = layout.rows[0][0], layout.rows[-1], layout.split
    # One comma in every row separates two columns only if there are several.
    if not is_table and "," in text and all(_DECIMAL.fullmatch(x) for _, x in layout.rows):
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


def _header(head: Sequence[tuple[int, str]], width: int) -> _Header:
    """Return the statements of the lines above rows of `width` numbers."""
    header, others = _Header(), []
    for i, line in head:
        text = _MARK.sub("", _MARK.sub("", line, count=1))
        match, unit, step = _STATEMENT.fullmatch(text), "", None
        if match and match["unit"]:
            unit = unit_spelling(match["unit"].strip("()[] "))
        elif match:
            step = _step_of_statement(match)
        if unit in FACTORS and header.unit in (None, unit):
            header.unit = unit
        elif step and header.step in (None, step):
            header.step = step
        elif not _RULE.fullmatch(text):
            ways = (re.split(r"\s*[,;\t]\s*", text), re.split(r"\s{2,}|\t", text), _joined(text).split())
            fits = [[cell.strip(" \"'") for cell in cells] for cells in ways if len(cells) == width]
            columns = [([*map(_column, cells)], cells) for cells in fits]
            others.append((i, text, *max(columns, key=_understood, default=([], []))))
    # The line that names most columns is the line of names. Any other line is not understood.
    names = max(others, key=lambda x: _understood(x[2:]), default=None)
    if names and any(names[2]):
        header.columns, header.cells = names[2:]
        others = [x for x in others if x is not names or not all(names[2])]
    for i, text, columns, cells in others:
        is_named = columns is header.columns and columns
        header.unknown = i, cells[columns.index(None)] if is_named else text
    return header


def _understood(way: tuple[list[_Column | None], list[str]]) -> float:
    """Return the share of the names of columns that are understood."""
    return sum(column is not None for column in way[0]) / max(1, len(way[0]))


def _joined(text: str) -> str:
    """Return a line without blanks before brackets, which belong to the name before them."""
    return re.sub(r"(?<=[^\s)\]])\s+(?=[(\[])", "", text)


def _step_of_statement(match: re.Match[str]) -> float | None:
    """Return the time step (s) that a line states; None if its unit is unknown."""
    value, unit, is_rate = real(match["value"]), match["of"].lower(), match[0].lower().startswith(("fs", "r"))
    is_rate |= "rate" in match[0].lower()
    if value > 0.0 and is_rate:
        return 1.0 / value if unit == "hz" else None
    # Without a unit a short step is assumed to be in s.
    scale = TIMES.get(unit, 1.0 if not unit and value <= _LONGEST_STEP else 0.0)
    return value * scale or None


def _column(cell: str, *, is_stated: bool = False) -> _Column | None:
    """Return the meaning of a name of a column; None if it is not understood.

    Args:
        cell: name, with a unit in brackets.
        is_stated: whether the user states the name, which may then be any direction.
    """
    match = _CELL.fullmatch(cell.strip())
    if match is None or not match[1]:
        return None
    name, unit = match[1], None if match[2] is None else unit_spelling(match[2])
    word = re.sub(r"[\s_-]+", "", name.lower())
    short = _BEFORE.sub("", word)
    meaning = "transverse" if name == "T" else _MEANINGS.get(word, "")
    if not meaning and short not in _AMBIGUOUS:
        meaning = _MEANINGS.get(short, "")
    if is_stated and not meaning and (is_component(name) or re.fullmatch(r"acc\d+", word)):
        meaning = name if is_component(name) else "acceleration"
    if not meaning or (unit is not None and unit not in (TIMES if meaning == "time" else FACTORS)):
        return None
    component = name[len(name) - len(short) :] if short != word and meaning != "acceleration" else name
    return _Column(meaning, "" if meaning in ("time", "acceleration") else component, unit)


def _columns(header: _Header, how: Options, layout: _Layout) -> dict[int, _Column]:
    """Return the columns that are read, by their index.

    Raises:
        UnreadableRecord: the header does not name all columns, or `columns` contradicts it.
    """
    lone, width = _Column("acceleration", "", None), layout.width
    if isinstance(how.columns, Mapping):
        return _chosen_columns(header, how.columns)
    if how.columns == ROWS:
        return {0: lone}
    if header.unknown:
        line, part = header.unknown
        reason = f"line {line} has {shown(part)}, which is not understood"
        raise UnreadableRecord(reason, **_example(header, how, layout))
    if not header.columns and width > 1:
        reason = f"line {layout.rows[0][0]} has {width} numbers, but no line above names the columns"
        raise UnreadableRecord(reason, **_example(header, how, layout))
    columns = dict(enumerate(filter(None, header.columns or [lone])))
    if reason := _conflict([column.meaning for column in columns.values()]):
        raise UnreadableRecord(reason, **_example(header, how, layout))
    return columns


def _conflict(meanings: Sequence[str]) -> str:
    """Return words for why the columns of a table are not a time and the directions of one sensor."""
    motions = [meaning for meaning in meanings if meaning != "time"]
    level = {*motions} - {"vertical", "acceleration"}
    if len(meanings) - len(motions) > 1 or not motions:
        return f"the table must have one time and accelerations, but has {', '.join(meanings)}"
    if len({*motions}) < len(motions) or not any(level <= pair for pair in _HORIZONTAL):
        return f"the columns {', '.join(motions)} are not the directions of one sensor"
    if "acceleration" in motions and len(motions) > 1:
        return f"an acceleration without a direction is beside {', '.join({*motions} - {'acceleration'})}"
    return ""


def _example(header: _Header, how: Options, layout: _Layout) -> dict[str, Any]:
    """Return options that can read a table, with places to fill in."""
    at, options = header.unknown[0] if header.unknown else 0, dict[str, Any]()
    below = _header([row for row in layout.head if row[0] > at], layout.width)
    # If the header below a line is understood, it is enough to skip this line and all lines above it.
    is_enough = at > 0 and (all(below.columns) if below.columns else layout.width == 1)
    if is_enough and not _conflict([c.meaning for c in below.columns if c] or ["acceleration"]):
        options["skip"], header = at, below
    else:
        pairs = zip(header.columns, header.cells, strict=True)
        names = [cell if column else "" for column, cell in pairs] or [""] * layout.width
        options["columns"] = {name or f"NAME{k} (UNIT)": k for k, name in enumerate(names, 1)}
    columns = [column for column in header.columns if column]
    has_place = any("UNIT" in name for name in options.get("columns", ()))
    if not (has_place or header.unit or how.unit or any(c.unit for c in columns if c.meaning != "time")):
        options["unit"] = "UNIT"
    if not (has_place or header.step or how.dt or any(c.meaning == "time" for c in columns)):
        options["dt"] = "STEP"
    return options


def _chosen_columns(header: _Header, wanted: Mapping[str, int]) -> dict[int, _Column]:
    """Return the columns that the user names. They must agree with the header."""
    columns: dict[int, _Column] = {}
    for name, at in wanted.items():
        if (column := _column(name, is_stated=True)) is None:
            allowed = "names of times, accelerations or directions, such as 'time (ms)', N and 'E (gal)'"
            raise ValueError(f"`columns` must contain {allowed}, but has {shown(name)}")
        cell, says = "", None
        if at <= len(header.cells):
            cell, says = header.cells[at - 1], header.columns[at - 1]
        bracket = _CELL.fullmatch(cell)
        is_other = bool(bracket and bracket[2] and _OTHER.fullmatch(unit_spelling(bracket[2])))
        units = {FACTORS.get(u) or TIMES.get(u, u) for u in (column.unit, says and says.unit) if u}
        directions = {c.meaning for c in (column, says) if c and c.meaning != "acceleration"}
        if is_other or len(units) > 1 or (len(directions) > 1 and {*directions} & {*NAMES} == directions):
            stated = f"the header names column {at} {shown(cell)}"
            raise UnreadableRecord(f"{stated}, but `columns` names it {name!r}")
        columns[at - 1] = replace(column, unit=column.unit or (says.unit if says else None))
    if (meanings := [c.meaning for c in columns.values()]).count("time") > 1 or {*meanings} == {"time"}:
        raise ValueError(f"`columns` must contain at most one time, and accelerations, but is {dict(wanted)}")
    return columns


def _channels(
    header: _Header, columns: Mapping[int, _Column], rows: Sequence[_Row], how: Options
) -> list[Channel]:
    """Return the accelerations of the columns of a table."""
    _check_shape(rows, how, header.step or how.dt, max(columns) + 1)
    step = header.step or how.dt
    for i, column in columns.items():
        if column.meaning != "time":
            continue
        step = step_of([(line, cells[i]) for line, cells in rows], TIMES[column.unit or "s"], step)
        if column.unit is None and step > _LONGEST_STEP:
            remedy = "name them 'time (s)' or 'time (ms)' in `columns`"
            raise UnreadableRecord(f"times with steps of {step:g} need a unit: {remedy}")
    if step is None:
        raise UnreadableRecord("the table states no times and no step: give `dt` in s, such as dt=0.01")
    motions, channels = {i: c for i, c in columns.items() if c.meaning != "time"}, []
    for i, column in motions.items():
        if column.unit and header.unit and FACTORS[column.unit] != FACTORS[header.unit]:
            several = f"the header states several units of acceleration: {column.unit}, {header.unit}"
            raise UnreadableRecord(several)
        in_rows = how.columns == ROWS
        read = [(line, cell) for line, cells in rows for cell in (cells if in_rows else cells[i : i + 1])]
        name = column.component or ("" if len(motions) == 1 else f"column {i + 1}")
        factor = factor_of(column.unit or header.unit, how.unit)
        channels.append(Channel(numbers(read) * factor, step, name, name))
    return channels


def _check_shape(rows: Sequence[_Row], how: Options, step: float | None, width: int) -> None:
    """Raise `UnreadableRecord` for rows of unequal length, and for a count or a step above a single column."""
    full = mode(len(cells) for _, cells in rows[:9])
    for line, cells in rows[:-1] if how.columns == ROWS else rows:
        if len(cells) != full or (how.columns != ROWS and len(cells) < width):
            options = {"skip": line} if line == rows[0][0] and len(rows) > 2 else {}
            wrong = f"line {line} must have {max(full, width)} numbers, but has {shown(' '.join(cells))}"
            raise UnreadableRecord(wrong, **options)
    if full > 1 or how.columns == ROWS:
        return
    cells = [cell for _, (cell, *_) in rows]
    decimals = 2 * sum("." in cell for cell in cells) > len(cells)
    for k, (line, (cell, *_)) in enumerate(rows[:2]):
        value, left = number(cell, line), len(rows) - k - 1
        # A whole number above decimals is not a sample.
        is_whole = decimals and k == 0 and value != 0.0 and "." not in cell
        if len(rows) > 3 and (is_whole or value in (left, left - 1, step)):
            meaning = f"the step or the number of samples: columns={ROWS!r} reads it as a sample"
            raise UnreadableRecord(f"line {line} has {shown(cell)}, which can be {meaning}", skip=line)
