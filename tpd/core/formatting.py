"""Numbers as text for reports and figures; what results show of themselves: text and tables."""

from __future__ import annotations

import html
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


def number(x: float, digits: int = 4) -> str:
    """Format a number to `digits` significant digits: without an exponent from 1e-4 to 1e7, NaN as a dash."""
    if math.isnan(x):
        return "–"
    if math.isinf(x):
        return "infinite"
    if x == 0.0 or not 1e-4 <= abs(x) < 1e7:
        return f"{x:.{digits}g}"
    places = max(0, digits - 1 - math.floor(math.log10(abs(x))))
    text = f"{round(x, digits - 1 - math.floor(math.log10(abs(x)))):.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


class Printed:
    """Base of results that print themselves: a subclass defines `__str__`, a few lines with units.

    Arrays make the generated repr of a dataclass unreadable, so that notebooks and prompts show the same
    lines as `print`. Such dataclasses are declared with `repr=False`.
    """

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self), quote=False)}</pre>"


class Tabular:
    """Base of results that are tables: a subclass defines `columns`."""

    def columns(self) -> dict[str, Any]:
        """Columns of the table by their names, each of shape (n,)."""
        raise NotImplementedError

    def to_dataframe(self) -> pd.DataFrame:
        """The columns as a data frame of pandas.

        Raises:
            ImportError: without pandas.
        """
        try:
            import pandas as pd
        except ModuleNotFoundError:
            raise ImportError(
                "`to_dataframe` needs pandas, which is not installed: `pip install tpd[pandas]`"
            ) from None
        return pd.DataFrame(self.columns())


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Format the rows of a table as lines: the first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
        lines.append("  ".join([first.ljust(widths[0]), *cells]).rstrip())
    return lines


def counted(names: np.ndarray) -> str:
    """Numbers of equal names in an array, the most frequent first: "20 rocking, 3 no orbit"."""
    each = ((str(name).replace("_", " "), count) for name, count in Counter(names.ravel().tolist()).items())
    return ", ".join(f"{count} {name}" for name, count in sorted(each, key=lambda pair: -pair[1]))


def counted_periods(n: int) -> str:
    """Length of a motion in forcing periods: "1 period", "3 periods"."""
    return f"{n} period{'s' * (n != 1)}"


def span(values: np.ndarray, unit: str = "") -> str:
    """Range of the finite numbers in an array, such as "0.01 to 0.2 rad"; a dash where there are none."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "–"
    return f"{number(float(finite.min()))} to {number(float(finite.max()))} {unit}".rstrip()


def decimal_comma(text: str) -> str:
    """Return the end of a message about a text with a decimal comma; empty where the text has none."""
    found = re.search(r"(?<![\w.,-])-?\d+,\d+(?!\w|,\d)", text)
    return (
        "" if found is None else f"; write {found[0].replace(',', '.')} with a decimal point, not {found[0]}"
    )


def meant(word: object, allowed: Iterable[str], *, listing: bool = True) -> str:
    """Return the end of a message about an unknown word: the one that is close, or those that are allowed."""
    known = list(allowed)
    close = get_close_matches(word, known, 1) if isinstance(word, str) else []
    if close:
        return f"; did you mean `{close[0]}`?"
    return f"; allowed are {', '.join(known)}" if listing else ""
