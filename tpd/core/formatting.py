"""Text of numbers for reports and figures, and base classes of results that print themselves."""

from __future__ import annotations

import html
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


_NAMES: ContextVar[Mapping[str, str]] = ContextVar("names", default=MappingProxyType({}))
"""Names of arguments in messages, by the names that Python uses, where these differ."""


def called(name: str) -> str:
    """Return an argument as a message names it: in Python by its name, in a job file by its key."""
    return _NAMES.get().get(name, f"`{name}`")


@contextmanager
def argument_names(by_argument: Mapping[str, str]) -> Iterator[None]:
    """Let messages use other names of arguments, which a user of a job file knows."""
    token = _NAMES.set(by_argument)
    try:
        yield
    finally:
        _NAMES.reset(token)


def number(x: float, digits: int = 4) -> str:
    """Format a number with `digits` significant digits, without an exponent from 1e-4 to 1e7. NaN is a
    dash."""
    if math.isnan(x):
        return "–"
    if math.isinf(x):
        return "infinite"
    if x == 0.0 or not 1e-4 <= abs(x) < 1e7:
        return f"{x:.{digits}g}"
    # Digits after the decimal point, so that the number has the requested significant digits in all.
    places = max(0, digits - 1 - math.floor(math.log10(abs(x))))
    text = f"{round(x, digits - 1 - math.floor(math.log10(abs(x)))):.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def percent(share: float, digits: int = 0) -> str:
    """Format a share in per cent, by default without decimals: 0.25 is "25 %"."""
    return f"{per_cent(share, digits)} %"


def per_cent(share: float, digits: int = 0) -> str:
    """Format a share as a number of per cent without the sign: 0.25 is "25"."""
    # Rounding first and adding zero turns "-0" into "0".
    return f"{round(100.0 * share, digits) + 0.0:.{digits}f}"


def ends(low: float, high: float, digits: int = 0) -> str:
    """Format the ends of an interval of shares in per cent, such as "22 to 28 %"."""
    return f"{per_cent(low, digits)} to {percent(high, digits)}"


def interval(value: float, low: float, high: float, digits: int = 0) -> str:
    """Format a share with the ends of its interval in per cent, such as "25 % (22 to 28 %)".

    The interval is left out if it is unknown.
    """
    around = f" ({ends(low, high, digits)})" if math.isfinite(low) else ""
    return percent(value, digits) + around


def confidence(low: float, high: float) -> str:
    """Format the interval of 95 % confidence of a share, such as "(95 % interval 22 to 28 %)"."""
    return f"(95 % interval {ends(low, high) if math.isfinite(low) else 'unknown'})"


def with_and_without(pendulum: float, without: float) -> str:
    """Format the shares of the same quantity in both cases, such as "1.5 % with the pendulum, 3.0 % without
    it"."""
    return f"{percent(pendulum, 1)} with the pendulum, {percent(without, 1)} without it"


def pair_of(
    value: float, limit: float, digits: int = 2, form: Callable[[float, int], str] = number
) -> tuple[str, str]:
    """Format a value and a limit with as many digits as show on which side of the limit the value is.

    Args:
        value: value.
        limit: limit, or any other number that the value is compared with.
        digits: smallest number of digits.
        form: function of (number, digits), such as `number` or `percent`.

    Example:
        >>> pair_of(0.3304, 0.33), pair_of(0.0104, 0.01, 1, percent)
        (('0.3304', '0.33'), ('1.04 %', '1.00 %'))
    """
    pairs = [(form(value, n), form(limit, n)) for n in range(digits, 10)]
    # Numbers that are equal up to rounding keep the smallest number of digits.
    return next((pair for pair in pairs if pair[0] != pair[1]), pairs[0])


def install(extra: str) -> str:
    """Return the command that installs an extra of this package."""
    return f"pip install '.[{extra}]' in the folder of the source of tpd"


class Printed:
    """Base class of results that print themselves. A subclass defines `__str__`, a few lines with units.

    The generated repr of a dataclass with arrays is unreadable. Notebooks and prompts therefore show the same
    lines as `print`. Such dataclasses are declared with `repr=False`.
    """

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self), quote=False)}</pre>"


class Tabular:
    """Base class of results that are tables."""

    def columns(self) -> dict[str, Any]:
        """Return the columns of the table by their names, each of shape (n,); by default the fields."""
        return dict(vars(self))

    def to_dataframe(self) -> pd.DataFrame:
        """Return the columns as a data frame of pandas.

        Raises:
            ImportError: pandas is not installed.
        """
        try:
            import pandas as pd
        except ModuleNotFoundError:
            wrong = "`to_dataframe` needs pandas, which is not installed"
            raise ImportError(f"{wrong}: {install('pandas')}") from None
        return pd.DataFrame(self.columns())


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Format the rows of a table as lines: the first column is aligned to the left, the others to the
    right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
        lines.append("  ".join([first.ljust(widths[0]), *cells]).rstrip())
    return lines


def counted(names: np.ndarray) -> str:
    """Return the numbers of equal names in an array, most frequent first: "20 rocking, 3 no orbit"."""
    # Names of statuses have underscores, and their words have none.
    each = ((str(name).replace("_", " "), count) for name, count in Counter(names.ravel().tolist()).items())
    return ", ".join(f"{count} {name}" for name, count in sorted(each, key=lambda pair: -pair[1]))


def unanswered(count: int) -> str:
    """Return the last sentence of a caption on runs without a result; empty if there are none."""
    return f" {count} runs without a result are left out." if count else ""


def counted_periods(n: int) -> str:
    """Return the length of a motion in forcing periods: "1 period", "3 periods"."""
    return f"{n} period{'s' * (n != 1)}"


def span(values: np.ndarray, unit: str = "") -> str:
    """Return the range of the finite numbers in an array, such as "0.01 to 0.2 rad"; a dash if there are
    none."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "–"
    return f"{number(float(finite.min()))} to {number(float(finite.max()))} {unit}".rstrip()


def number_hint(text: str) -> str:
    """Return the end of a message about a text with a decimal comma or a percentage; empty if it has
    neither."""
    # A single comma between digits: two commas would be a list of numbers.
    if match := re.search(r"(?<![\w.,-])-?\d+,\d+(?!\w|,\d)", text):
        return f"; write {match[0].replace(',', '.')} with a decimal point, not {match[0]}"
    share = re.search(r"(?<![\w.,-])(\d+\.?\d*) ?%", text)
    return "" if share is None else f"; write {float(share[1]) / 100:g} for {share[0]}"


_RENAMED = (
    "worth=requirements strikes=wall_contacts held_out=validation_share room=clearance file=out "
    "demand=risk measure=risk,reduce,search.risk risk=search.risk allowed=wall_contacts "
    "starts=designs,searches from_rest=simulate,runs_from_rest,starts.kind "
    "simulate=runs_from_rest scale=factor sliding=base_friction "
    "method=finish study=details ramps=growth ramp=growth "
    "Worth=Requirements Room=Clearance Study=Details verdict=paired_runs Verdict=PairedRuns "
    "Segmented=Nonlinear Sequential=Descent HarmonicDesign=Design GroundDesign=Design "
    "pga_g=pga sa_g=sa analysis=answers closed_form=theory stroke=swing_limit,limits.stroke motion=excitation"
)
RENAMED = dict(re.findall(r"(\w+)=(\S+)", _RENAMED))
"""New names by the old names of tables, keys, options, arguments and classes, see `changes.md` in the guide.
The first of several that is allowed counts. A new name with a dot is a key in another table of a job file."""


def meant(word: object, allowed: Iterable[str], *, listing: bool = True) -> str:
    """Return the end of a message about an unknown word: its new name, a similar word, or all allowed words.

    Capitals do not matter, and hyphens and underscores are equal.
    """
    listed = list(allowed)
    words = {w.lstrip("-").replace("-", "_").lower(): w for w in listed}
    plain = word.lstrip("-").replace("-", "_") if isinstance(word, str) else ""
    for new in RENAMED.get(plain, "").split(","):
        if new and (new.lower() in words or ("." in new and plain == word)):
            table, _, key = new.rpartition(".")
            name = f"called `{new if new in listed else words.get(new.lower(), new)}`"
            return f"; it is now {f'the key `{key}` of [{table}]' if table else name}"
    # A similar word is more helpful than the list of all words.
    close = get_close_matches(plain.lower(), words, 1)
    if close:
        return f"; did you mean `{words[close[0]]}`?"
    return f"; allowed are {', '.join(listed)}" if listing else ""
