"""Lines and numbers of a text file. Whatever is not as it should be is an `UnreadableRecord`."""

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
WHOLE = r"\d{1,9}"
"""A count. Python refuses to convert thousands of digits."""
_NUMBER = re.compile(NUMBER)
_PLAIN = re.compile(r"[\d.eE+\- ]+")
_COMMA = re.compile(r"[+-]?\d*,\d+(?:[EeDd][+-]?\d{1,3})?")
_MARKED = re.compile(r'(?<![^\s;,])"?[+-]?\d*[.,]\d[\d.,]*"?(?![^\s;,])')
"""Numbers with a mark in them, perhaps between quotation marks."""
_THOUSANDS = re.compile(r'"?[+-]?[1-9]\d{0,2}(?:[.,]\d{3})+"?')
_LONGEST = 50
"""Most characters of a file in a message."""


class UnreadableRecord(ValueError):
    """A file of ground motion that is damaged, incomplete, contradicts itself, or of no known format.

    Args:
        message: what is wrong.
        options: those of `tpd.Record.read` that read the file, by name; capitals stand for what only the user
            knows.
    """

    def __init__(self, message: str, **options: Any) -> None:
        super().__init__(message)
        self.options = options

    def __str__(self) -> str:
        said = ", ".join(f"{name}={value!r}" for name, value in self.options.items())
        return f"{self.args[0]}; options that read the file: {said}" if said else str(self.args[0])


class NoAcceleration(UnreadableRecord):
    """A file of something else than acceleration, which agencies put beside the files of acceleration."""

    def __init__(self, message: str, content: str) -> None:
        super().__init__(message)
        self.content = content
        """The content of the file, such as velocity, displacement, response spectrum."""


@dataclass(frozen=True)
class Decimal:
    """A number as printed."""

    value: float
    unit: float
    """Size of its last digit."""

    @staticmethod
    def of(text: str) -> Decimal:
        """Return the number of a text that `NUMBER` matches."""
        # Fortran writes exponents of double precision with a D.
        mantissa, _, exponent = text.lower().replace("d", "e").partition("e")
        decimals = len(mantissa.partition(".")[2])
        # As text: a power of 10.0 fails beyond the greatest float, where this is infinite.
        return Decimal(float(text.lower().replace("d", "e")), float(f"1e{int(exponent or 0) - decimals}"))


def shown(text: str) -> str:
    """Return a piece of a file as it stands in a message."""
    clean = " ".join(text.split())
    return repr(clean if len(clean) <= _LONGEST else clean[:_LONGEST] + "...")


def number(text: str, line: int) -> float:
    """Return a finite number. Python would take "nan", "1_000" and others as well."""
    # Fortran writes exponents of double precision with a D.
    value = float(text.lower().replace("d", "e")) if _NUMBER.fullmatch(text.strip()) else math.nan
    if not math.isfinite(value):
        raise UnreadableRecord(f"line {line} must hold numbers, but has {shown(text)}")
    return value


def numbers(found: Sequence[tuple[int, str]]) -> np.ndarray:
    """Return finite numbers, of which the lines and the texts are given."""
    texts = [text for _, text in found]
    # NumPy converts many texts at once, but would also take "nan" and others.
    if _PLAIN.fullmatch(" ".join(texts)):
        with contextlib.suppress(ValueError):
            values = np.array(texts, dtype=float)
            if np.isfinite(values).all():
                return values
    return np.array([number(text, line) for line, text in found])


def _stated(pattern: str, what: str, line: str, where: str) -> re.Match[str]:
    """Return the match of a pattern in a line, whatever the case, or raise `UnreadableRecord`."""
    found = re.search(pattern, line, flags=re.IGNORECASE)
    if found is None:
        raise UnreadableRecord(f"{where} must state {what}, but is {shown(line)}")
    return found


def splitter(lines: Sequence[str]) -> Callable[[str], list[str]]:
    """Return how the lines of a file are split into cells, with points in place of decimal commas."""
    last = [line for line in lines if line.strip()][-50:]
    words = [word for line in last for word in line.split()]
    separator = re.compile(r"\s*[,;]\s*|\s+")
    if any(";" in line or "\t" in line for line in last):
        separator = re.compile(r"\s*;\s*|\s+")
    elif len(words) > len(last) and all(_COMMA.fullmatch(w) or re.fullmatch(NUMBER, w) for w in words):
        # In "0,01  0,035" blanks separate the numbers; in "0,01,0,035" nothing tells.
        separator = re.compile(r"\s+")

    def split(line: str) -> list[str]:
        # Spreadsheets end rows with a separator and put cells between quotation marks.
        bare = line.strip().rstrip(", ;\t")
        if '"' in bare:
            mark = next((mark for mark in ";\t," if mark in bare), " ")
            cells = [x.strip() for x in next(csv.reader([bare], delimiter=mark, skipinitialspace=True))]
        else:
            cells = separator.split(bare) if bare else []
        return [x.replace(",", ".") if "," in x and _COMMA.fullmatch(x) else x for x in cells]

    return split


def no_thousands(text: str, split: Callable[[str], list[str]]) -> None:
    """Raise `UnreadableRecord` if all commas within the numbers of a text, or all points beside such commas,
    may separate thousands."""
    words = _MARKED.findall(text)
    commas = [word for word in words if "," in word and len(split(word)) == 1]
    for marked in (commas, [word for word in words if commas and "," not in word]):
        if marked and all(map(_THOUSANDS.fullmatch, marked)):
            raise UnreadableRecord(
                f"{shown(marked[0])} may have a separator of thousands or a decimal one: write the numbers "
                "with decimal points and without separators of thousands"
            )


def step_of(times: Sequence[tuple[int, str]], scale: float, stated: float | None) -> float:
    """Return the step (s) of times that are equally spaced, each rounded to the digits printed.

    Args:
        times: lines and texts.
        scale: seconds of their unit.
        stated: a step in s, None where neither the file nor the user gives one.
    """
    t = scale * numbers(times)
    i = np.arange(1, len(t))
    if len(t) < 2:
        return 1.0 if stated is None else stated
    # Twelve digits: 31.18/1559 is then 0.02, as it was meant.
    noise = 1e-9 * float(np.max(np.abs(t)))
    step = low = high = float(f"{(t[-1] - t[0]) / i[-1]:.12g}")
    if step <= 0.0 or (np.abs(t[1:] - t[0] - step * i) > noise).any():
        # Programs print a number of decimals or, as with %g, of significant digits, and may leave out zeros
        # at the end. Times of single precision are off by two units of 24 binary digits.
        last = scale * np.array([Decimal.of(cell).unit for _, cell in times])
        ahead = np.floor(np.log10(np.maximum(np.abs(t), last.min())) + 1e-12)
        significant = np.max(ahead - np.round(np.log10(last)))
        digits = np.maximum(np.maximum(10.0 ** (ahead - significant), last.min()), 2.4e-7 * np.abs(t))
        margin = 0.51 * (digits[1:] + digits[0] * (t[0] != 0.0)) + noise
        # All steps for which every time is rounded correctly.
        low, high = float(np.max((t[1:] - t[0] - margin) / i)), float(np.min((t[1:] - t[0] + margin) / i))
        if not 0.0 < low <= high:
            usual = float(f"{np.median(np.diff(t)):.12g}")
            k = int(np.argmax(np.abs(np.diff(t) - usual)))
            said = (
                f"that after line {times[k][0]} is {t[k + 1] - t[k]:.9g} s, and the usual one {usual:.9g} s"
            )
            raise UnreadableRecord(f"the times must have equal steps, but {said}")
        # Of coarser times one may be missing, and several whole rates in Hz may fit.
        if 2.1 * float(np.max(margin)) > high or (stated is None and high - low > low * high):
            raise UnreadableRecord(
                "the times have too few digits to show equal steps: leave them out of `columns` and give `dt`"
            )
        # Probably meant is a whole rate in Hz, or the step of fewest digits.
        rounded = [1.0 / max(1, round(1.0 / step)), *(float(f"{step:.{n}g}") for n in range(1, 12))]
        step = next((x for x in rounded if low <= x <= high), step)
    if stated is not None and not low * (1.0 - 1e-6) <= stated <= high * (1.0 + 1e-6):
        raise UnreadableRecord(f"a step of {stated:g} s is stated, but that of the times is {step:g} s")
    return step if stated is None else stated


@dataclass(frozen=True)
class Header:
    """Lines of text above samples."""

    lines: Sequence[str]
    start: int
    """Lines of the file above them."""

    def match(self, line: int, pattern: str, what: str) -> re.Match[str]:
        """Return the match of a pattern, whatever the case, in a line, counted from 1."""
        return _stated(pattern, what, self.lines[line - 1], self.where(line))

    def where(self, line: int) -> str:
        """Return the place of a line in the file, in words."""
        return f"line {self.start + line}"


@dataclass
class Cursor:
    """A place in the lines of a file."""

    lines: Sequence[str]
    ended: bool
    """Whether the last line has its end, so that it was not cut."""
    at: int = 0

    @property
    def line(self) -> int:
        """Number of the line that comes next, from 1."""
        return self.at + 1

    def peek(self) -> str:
        """Return the line that comes next; an empty one at the end."""
        return self.lines[self.at] if self.at < len(self.lines) else ""

    def next(self, what: str) -> str:
        """Return the next line and go on, or say what is missing."""
        if self.at >= len(self.lines):
            raise UnreadableRecord(f"the file ends after line {len(self.lines)}, before {what}")
        self.at += 1
        return self.lines[self.at - 1]

    def header(self, n: int) -> Header:
        """Return the next n lines as a header."""
        start = self.at
        return Header(self.skip(n, "the end of the text header"), start)

    def comments(self, n: int) -> None:
        """Pass n comments, of a line each."""
        for _ in range(n):
            if not self.next("the end of the comments").lstrip().startswith("|"):
                raise UnreadableRecord(f"line {self.at} must be a comment with '|', of {n} stated")

    def skip(self, n: int, what: str) -> list[str]:
        """Return the next n lines."""
        return [self.next(what) for _ in range(n)]

    @cached_property
    def last_line(self) -> int:
        """Number of the last line that is not blank. It is found once, since readers ask at every
        line whether blank lines follow."""
        return max((i for i, line in enumerate(self.lines, 1) if line.strip()), default=0)

    def only_blank_lines_follow(self) -> bool:
        """Return whether nothing but blank lines is left."""
        return self.at >= self.last_line

    def require_end(self, *, whole: bool = False) -> None:
        """Raise `UnreadableRecord` unless the file ends here, with the end of a line: a number at the end of
        a file may have been cut.

        Args:
            whole: whether something else shows that it was not.
        """
        if not self.only_blank_lines_follow():
            raise UnreadableRecord(
                f"line {self.line} must be the end of the file, but is {shown(self.peek())}"
            )
        if not (self.ended or whole):
            raise UnreadableRecord(
                f"the last line, {len(self.lines)}, must end with a line break, but does not: the file may "
                "be cut"
            )

    def match(self, pattern: str, what: str) -> re.Match[str]:
        """Return the match of a pattern, whatever the case, in the next line."""
        line = self.next(what)
        return _stated(pattern, what, line, f"line {self.at}")

    def fixed(self, count: int, columns: int, width: int, what: str) -> np.ndarray:
        """Return `count` numbers in columns of a width, all lines full but the last.

        Raises:
            UnreadableRecord: lines that are missing, longer or shorter, or hold something else.
        """
        values: list[tuple[int, str]] = []
        while len(values) < count:
            # Right-aligned columns of Fortran: a full line ends with the last digit of its last number,
            # so that a number that was cut, shifted or lost shows in the length.
            line = self.next(f"all {count} {what} ({len(values)} found)").rstrip()
            expected = min(columns, count - len(values))
            if len(line) != expected * width:
                raise UnreadableRecord(
                    f"line {self.at} must hold {expected} {what} of {width} characters, but is {shown(line)}"
                )
            values += [(self.at, line[i : i + width].strip()) for i in range(0, len(line), width)]
        return numbers(values)

    def free(self, what: str) -> np.ndarray:
        """Return all numbers up to the end of the file, set apart by blanks or by their signs."""
        values: list[tuple[int, str]] = []
        while not self.only_blank_lines_follow():
            # In columns of Fortran a negative number may touch the one before it.
            line = re.sub(r"(?<=[\d.])(?=[+-])", " ", self.next(what))
            values += [(self.at, token) for token in line.split()]
        return numbers(values)


def fortran(text: str, line: int) -> tuple[int, int, int]:
    """Return the columns, the width and the digits after the point of a format such as (8F10.5)."""
    # Without a number of columns there is one.
    found = re.search(r"\(\s*(\d{0,3})\s*[FEGI]\s*(\d{1,2})(?:\.(\d{1,2}))?\s*\)", text, flags=re.IGNORECASE)
    if found is None or int(found[2]) == 0 or found[1] == "0":
        raise UnreadableRecord(f"line {line} must state the format of its numbers, but is {shown(text)}")
    return int(found[1] or 1), int(found[2]), int(found[3] or 0)
