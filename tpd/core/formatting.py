"""Numbers as text for reports and figures."""

from __future__ import annotations

import math


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
