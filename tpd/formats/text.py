"""Lines and numbers of a text file. Any error in them raises `UnreadableRecord`."""

from __future__ import annotations

import contextlib
import csv
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d{1,3})?"
"""Pattern of a number."""
WHOLE = r"\d{1,9}"
"""Pattern of a count. Python does not convert thousands of digits."""
_NUMBER = re.compile(NUMBER)
_PLAIN = re.compile(r"[\d.eE+\- ]+")
_COMMA = re.compile(r"[+-]?\d*,\d+(?:[EeDd][+-]?\d{1,3})?")
_MARKED = re.compile(r'(?<![^\s;,])"?[+-]?\d*[.,]\d[\d.,]*"?(?![^\s;,])')
"""Pattern of numbers with a comma or a point in them, possibly in quotation marks."""
_THOUSANDS = re.compile(r'"?[+-]?[1-9]\d{0,2}(?:[.,]\d{3})+"?')
_LONGEST = 50
"""Largest number of characters of a file in a message."""


class UnreadableRecord(ValueError):
    """File of a ground motion that is damaged, incomplete, contradictory, or of an unknown format.

    Args:
        message: description of the error.
        options: options of `tpd.Record.read` that may read the file, by name. A word in capitals stands for a
            value that only the user knows.
    """

    def __init__(self, message: str, **options: Any) -> None:
        super().__init__(message)
        self.options = options
        self.preview: Sequence[str] = ()
        """Lines that show what the file contains."""

    def __str__(self) -> str:
        options = ", ".join(f"{name}={value!r}" for name, value in self.options.items())
        sentence = f"{self.args[0]}; try these options: {options}" if options else str(self.args[0])
        return "\n".join([sentence, *self.preview])


class NoAcceleration(UnreadableRecord):
    """File that states no acceleration. A folder may contain such files beside those of accelerations."""

    def __init__(self, message: str, content: str = "", **options: Any) -> None:
        super().__init__(message, **options)
        self.content = content or message
        """Content of the file, such as velocity, displacement or response spectrum."""


class StatedByFile(UnreadableRecord):
    """Option of a user that contradicts what the file states."""

    def __init__(self, message: str, option: str) -> None:
        super().__init__(message)
        self.option = option
        """Name of the option."""


@dataclass(frozen=True)
class Decimal:
    """Number as printed in a file."""

    value: float
    """Value."""
    unit: float
    """Size of its last digit."""

    @staticmethod
    def of(text: str) -> Decimal:
        """Return the number from a text that matches `NUMBER`."""
        # Fortran writes exponents of double precision with a D.
        mantissa, _, exponent = text.lower().replace("d", "e").partition("e")
        decimals = len(mantissa.partition(".")[2])
        # Convert from text, because `10.0**n` raises an error for numbers beyond the largest float. Here the
        # result is infinite.
        return Decimal(real(text), float(f"1e{int(exponent or 0) - decimals}"))


def quote(text: str) -> str:
    """Return a piece of a file as a message shows it."""
    clean = " ".join(text.split())
    return repr(clean if len(clean) <= _LONGEST else clean[:_LONGEST] + "...")


def real(text: str) -> float:
    """Return the number from a text that matches `NUMBER`."""
    # Fortran writes exponents of double precision with a D.
    return float(text.lower().replace("d", "e"))


def number(text: str, line: int) -> float:
    """Return a finite number from a text. Python's `float` would also accept "nan", "1_000" and other
    texts."""
    value = real(text) if _NUMBER.fullmatch(text.strip()) else math.nan
    if not math.isfinite(value):
        raise UnreadableRecord(f"line {line} must contain numbers, but has {quote(text)}")
    return value


def numbers(cells: Sequence[tuple[int, str]]) -> np.ndarray:
    """Return finite numbers from pairs of a line number and a text."""
    texts = [text for _, text in cells]
    # NumPy converts many texts at once, but also accepts "nan" and other texts. The pattern excludes these.
    if _PLAIN.fullmatch(" ".join(texts)):
        with contextlib.suppress(ValueError):
            values = np.array(texts, dtype=float)
            if np.isfinite(values).all():
                return values
    return np.array([number(text, line) for line, text in cells])


def _stated(pattern: str, what: str, line: str, where: str) -> re.Match[str]:
    """Return the match of a pattern in a line, ignoring case, or raise `UnreadableRecord`."""
    match = re.search(pattern, line, flags=re.IGNORECASE)
    if match is None:
        raise UnreadableRecord(f"{where} must state {what}, but is {quote(line)}")
    return match


def splitter(lines: Sequence[str]) -> Callable[[str], list[str]]:
    """Return the function that splits the lines of a file into cells, with points instead of decimal
    commas."""
    last = [line for line in lines if line.strip()][-50:]
    words = [word for line in last for word in line.split()]
    separator = re.compile(r"\s*[,;]\s*|\s+")
    if any(";" in line or "\t" in line for line in last):
        separator = re.compile(r"\s*;\s*|\s+")
    elif len(words) > len(last) and all(_COMMA.fullmatch(w) or re.fullmatch(NUMBER, w) for w in words):
        # In "0,01  0,035" blanks separate the numbers, and the commas are decimal. In "0,01,0,035" this
        # cannot be decided.
        separator = re.compile(r"\s+")

    def split(line: str) -> list[str]:
        # Spreadsheets may end rows with a separator, and put cells in quotation marks.
        row = line.strip().rstrip(", ;\t")
        if '"' in row:
            mark = next((mark for mark in ";\t," if mark in row), " ")
            cells = [x.strip() for x in next(csv.reader([row], delimiter=mark, skipinitialspace=True))]
        else:
            cells = separator.split(row) if row else []
        return [x.replace(",", ".") if "," in x and _COMMA.fullmatch(x) else x for x in cells]

    return split


def no_thousands(text: str, split: Callable[[str], list[str]]) -> None:
    """Raise `UnreadableRecord` if the commas in the numbers of a text, or the points in other numbers, may
    separate thousands."""
    words = _MARKED.findall(text)
    commas = [word for word in words if "," in word and len(split(word)) == 1]
    for marked in (commas, [word for word in words if commas and "," not in word]):
        if marked and all(map(_THOUSANDS.fullmatch, marked)):
            wrong = f"{quote(marked[0])} may have a separator of thousands or a decimal one"
            remedy = "write the numbers with decimal points and without separators of thousands"
            raise UnreadableRecord(f"{wrong}: {remedy}")


def step_of(times: Sequence[tuple[int, str]], scale: float, stated: float | None, remedy: str) -> float:
    """Return the step (s) of equally spaced times, each rounded to its printed digits.

    Args:
        times: pairs of a line number and a text.
        scale: seconds per unit of the times.
        stated: step in s; None if neither the file nor the user states it.
        remedy: words for the options that help if the times have too few digits.
    """
    t = scale * numbers(times)
    i = np.arange(1, len(t))
    if len(t) < 2:
        return 1.0 if stated is None else stated
    if (back := np.flatnonzero(np.diff(t) <= 0.0)).size:
        (before, first), (line, second) = times[back[0]], times[back[0] + 1]
        equal = Decimal.of(first).value == Decimal.of(second).value
        why = "the same time as" if equal else "an earlier time than"
        remedy = "remove a repeated row, or print the times with more digits" if equal else "sort the rows"
        raise UnreadableRecord(f"line {line} has {why} line {before}, but the times must grow: {remedy}")
    # Round to twelve digits: 31.18/1559 becomes 0.02.
    noise = 1e-9 * float(np.max(np.abs(t)))
    step = low = high = float(f"{(t[-1] - t[0]) / i[-1]:.12g}")
    if (np.abs(t[1:] - t[0] - step * i) > noise).any():
        # Programs print a fixed number of decimals or, as with %g, of significant digits, and may omit zeros
        # at the end. Times in single precision have an error of two units of 24 binary digits.
        last = scale * np.array([Decimal.of(cell).unit for _, cell in times])
        ahead = np.floor(np.log10(np.maximum(np.abs(t), last.min())) + 1e-12)
        significant = np.max(ahead - np.round(np.log10(last)))
        digits = np.maximum(np.maximum(10.0 ** (ahead - significant), last.min()), 2.4e-7 * np.abs(t))
        margin = 0.51 * (digits[1:] + digits[0] * (t[0] != 0.0)) + noise
        # The range of all steps for which every time is rounded correctly.
        low, high = float(np.max((t[1:] - t[0] - margin) / i)), float(np.min((t[1:] - t[0] + margin) / i))
        if not 0.0 < low <= high:
            usual = float(f"{np.median(np.diff(t)):.12g}")
            k = int(np.argmax(np.abs(np.diff(t) - usual)))
            step_text = f"{t[k + 1] - t[k]:.9g} s, and the usual step is {usual:.9g} s"
            where = f"the step after line {times[k][0]}"
            raise UnreadableRecord(f"the times must have equal steps, but {where} is {step_text}")
        # With coarse times a missing time would not be noticed, and several rates in Hz may be possible.
        if 2.1 * float(np.max(margin)) > high or (stated is None and high - low > low * high):
            raise UnreadableRecord(f"the times have too few digits to show equal steps: {remedy}")
        # Prefer a step that is a whole rate in Hz, then the one with the fewest digits.
        rounded = [1.0 / max(1, round(1.0 / step)), *(float(f"{step:.{n}g}") for n in range(1, 12))]
        step = next((x for x in rounded if low <= x <= high), step)
    if stated is not None and not low * (1.0 - 1e-6) <= stated <= high * (1.0 + 1e-6):
        wrong = f"the stated step is {stated:g} s, but the step of the times is {step:g} s"
        raise StatedByFile(wrong, "dt")
    return step if stated is None else stated


@dataclass(frozen=True)
class Header:
    """Lines of text above the samples."""

    lines: Sequence[str]
    start: int
    """Number of lines of the file above them."""

    def match(self, line: int, pattern: str, what: str) -> re.Match[str]:
        """Return the match of a pattern, ignoring case, in a line, counted from 1."""
        return _stated(pattern, what, self.lines[line - 1], self.where(line))

    def where(self, line: int) -> str:
        """Return words for the place of a line in the file."""
        return f"line {self.start + line}"


@dataclass
class Cursor:
    """Position in the lines of a file."""

    lines: Sequence[str]
    ended: bool
    """Whether the last line ends with a line break, which shows that it was not cut."""
    at: int = 0
    """Number of lines that were read."""

    @property
    def line(self) -> int:
        """Number of the next line, from 1."""
        return self.at + 1

    def peek(self) -> str:
        """Return the next line without reading it; empty at the end of the file."""
        return self.lines[self.at] if self.at < len(self.lines) else ""

    def next(self, what: str) -> str:
        """Read the next line. At the end of the file raise an error about the missing part `what`."""
        if self.at >= len(self.lines):
            raise UnreadableRecord(f"the file ends after line {len(self.lines)}, before {what}")
        self.at += 1
        return self.lines[self.at - 1]

    def header(self, n: int) -> Header:
        """Read the next n lines as a header."""
        start = self.at
        return Header(self.skip(n, "the end of the text header"), start)

    def comments(self, n: int) -> None:
        """Read n lines of comments."""
        for _ in range(n):
            if not self.next("the end of the comments").lstrip().startswith("|"):
                raise UnreadableRecord(f"line {self.at} must be a comment with '|', since {n} are stated")

    def skip(self, n: int, what: str) -> list[str]:
        """Read the next n lines."""
        return [self.next(what) for _ in range(n)]

    @cached_property
    def last_line(self) -> int:
        """Number of the last line that is not blank. It is cached, because readers use it at every line."""
        return max((i for i, line in enumerate(self.lines, 1) if line.strip()), default=0)

    def only_blank_lines_follow(self) -> bool:
        """Return whether only blank lines remain."""
        return self.at >= self.last_line

    def require_end(self, *, whole: bool = False) -> None:
        """Raise `UnreadableRecord` unless the file ends here with a line break.

        Without a line break a number at the end of the file may have been cut.

        Args:
            whole: whether the file shows in another way that it was not cut.
        """
        if not self.only_blank_lines_follow():
            last = quote(self.peek())
            raise UnreadableRecord(f"line {self.line} must be the end of the file, but is {last}")
        if not (self.ended or whole):
            wrong = f"the last line, {len(self.lines)}, must end with a line break, but does not"
            raise UnreadableRecord(f"{wrong}: the file may be cut")

    def match(self, pattern: str, what: str) -> re.Match[str]:
        """Return the match of a pattern, ignoring case, in the next line."""
        line = self.next(what)
        return _stated(pattern, what, line, f"line {self.at}")

    def fixed(self, count: int, columns: int, width: int, what: str) -> np.ndarray:
        """Return `count` numbers in columns of a fixed width. All lines except the last are full.

        Raises:
            UnreadableRecord: lines are missing, longer or shorter, or contain something else.
        """
        values: list[tuple[int, str]] = []
        while len(values) < count:
            # In the right-aligned columns of Fortran a full line ends with the last digit of its last number.
            # A number that was cut, shifted or lost therefore changes the length of the line.
            line = self.next(f"all {count} {what} ({len(values)} were read)").rstrip()
            expected = min(columns, count - len(values))
            if len(line) != expected * width:
                wanted = f"{expected} {what} of {width} characters"
                raise UnreadableRecord(f"line {self.at} must contain {wanted}, but is {quote(line)}")
            values += [(self.at, line[i : i + width].strip()) for i in range(0, len(line), width)]
        return numbers(values)

    def free(self, what: str) -> np.ndarray:
        """Return all numbers up to the end of the file, which are separated by blanks or by their signs."""
        values: list[tuple[int, str]] = []
        while not self.only_blank_lines_follow():
            # Fortran omits the letter of an exponent of three digits: .1234500-100 is one number.
            line = re.sub(r"(\.\d*)([+-]\d{3})(?![\d.])", r"\1E\2", self.next(what))
            if odd := re.search(r"\S*\.\d*[+-]\d+(?![\d.])\S*", line):
                meaning = "one number without the letter of its exponent, or two numbers"
                raise UnreadableRecord(f"line {self.at} has {quote(odd[0])}, which may be {meaning}")
            # In columns of Fortran a negative number may follow the previous number without a blank.
            values += [(self.at, token) for token in re.sub(r"(?<=[\d.])(?=[+-])", " ", line).split()]
        return numbers(values)


def count_of(integers: np.ndarray, place: int, what: str) -> int:
    """Return a number of a header that must be a count."""
    value = integers[place]
    if value < 0 or value != int(value):
        raise UnreadableRecord(f"the header must state the number of {what}, but states {value:g}")
    return int(value)


def fortran(text: str, line: int) -> tuple[int, int, float]:
    """Return columns, width and size of the last digit of a format such as (8F10.5)."""
    # A format without a number of columns has one column.
    match = re.search(r"\(\s*(\d{0,3})\s*[FEGI]\s*(\d{1,2})(?:\.(\d{1,2}))?\s*\)", text, flags=re.IGNORECASE)
    if match is None or int(match[2]) == 0 or match[1] == "0":
        raise UnreadableRecord(f"line {line} must state the format of its numbers, but is {quote(text)}")
    return int(match[1] or 1), int(match[2]), 10.0 ** -int(match[3] or 0)
