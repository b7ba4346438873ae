"""Earthquakes of records: decide whether two texts state the same earthquake.

A text is a name with the date in the form 1979-10-15, or the year, at its end. The readers of files write the
date in this form.
"""

from __future__ import annotations

import re
from datetime import date, timedelta

UNSTATED = "an earthquake that no file states"
"""Name of the only earthquake to which all records without a stated earthquake belong."""
STATED = "earthquake stated by the user"
"""Note on a record whose earthquake the user states."""
_DATE = re.compile(r"(?<!\d)(\d{4})(-\d\d-\d\d)?\s*$")


def _parts(text: str) -> tuple[list[str], str, date | None]:
    """Return the words of a name without a number such as -06 at its end, the year, and the date."""
    match = _DATE.search(text)
    name = text[: match.start()] if match else text
    day = None
    # A text such as 1999-99-99 is no date.
    if match and match[2]:
        try:
            day = date.fromisoformat(match[0].strip())
        except ValueError:
            name = text
    words = re.findall(r"[^\W_]+", re.sub(r"-\d+\W*$", "", name.lower()))
    return words, match[1] if match else "", day


def is_one(first: str, second: str) -> bool:
    """Return whether two texts state the same earthquake.

    Dates decide if both texts have one. They may differ by one day, because local dates and universal ones
    do. Otherwise the names and the years must agree. A number such as -06 at the end of a name, with which
    agencies count the earthquakes of one region, does not count.

    >>> is_one("Nowhere Valley-06 1979-10-15", "NOWHERE VALLEY 1979-10-16")
    True
    >>> is_one("Nowhere Valley 1940", "Nowhere Valley-06 1979")
    False
    """
    (words, year, day), (others, other_year, other_day) = _parts(first), _parts(second)
    if day and other_day:
        return abs(day - other_day) <= timedelta(days=1)
    # A name without a year can be that of any year.
    return words == others != [] and (not (year and other_year) or year == other_year)
