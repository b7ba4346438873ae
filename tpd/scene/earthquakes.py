"""Earthquakes as files name them: decide whether two texts describe the same earthquake.

Agencies describe one earthquake as "Imperial Valley-06, 10/15/1979", "IMPERIAL VALLEY 10/15/79 2316" or
"1979/10/15 23:16:00 M6.5". Dates and times are compared first. Names are compared only if the dates do not
decide.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from functools import lru_cache

_MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_WORD = rf"({'|'.join(_MONTHS)})[a-z]*\.?"
_DAY = r"(\d{1,2})(?:st|nd|rd|th)?"
_DATES = (
    # Year first: 1979/10/15, 1979-10-15, 19791015, and 1979 10 15 of SMC files.
    (r"(?<!\d)((?:19|20)\d\d)([-/. ]\s*)(\d{1,2})\2\s*(\d{1,2})(?!\d)", (1, 3, 4)),
    (r"(?<!\d)((?:19|20)\d\d)(0[1-9]|1[0-2])([0-3]\d)(?!\d)", (1, 2, 3)),
    # American dates are month/day/year. Dates with points are European: day.month.year.
    (r"(?<!\d)(\d{1,2})([-/])(\d{1,2})\2(\d{4}|\d{2})(?!\d)", (4, 1, 3)),
    (r"(?<!\d)(\d{1,2})\.(\d{1,2})\.(\d{4})(?!\d)", (3, 2, 1)),
    (rf"\b{_WORD}\s+{_DAY},?\s+(\d{{4}})(?!\d)", (3, 1, 2)),
    (rf"(?<!\d){_DAY}\s+{_WORD},?\s+(\d{{4}})(?!\d)", (3, 2, 1)),
    (rf"(?<!\d)(\d{{4}})\s+{_WORD}\s+{_DAY}(?!\d)", (1, 2, 3)),
)
"""Patterns of dates, each with the numbers of the groups for year, month and day."""
_TIME = re.compile(r"[\s,t_-]*([01]?\d|2[0-3]):?([0-5]\d)(?::?[0-5]\d(?:\.\d*)?)?(?![\d:])")
_ZONES = {"utc": 0, "ut": 0, "gmt": 0, "jst": 9, "pst": -8, "pdt": -7}
"""Hours ahead of universal time, by time zone."""
_IDLE = ("earthquake", "eq", "record", "rcrd", "of", "the", "mon", "tue", "wed", "thu", "fri", "sat", "sun")
"""Words that do not distinguish earthquakes."""
_EARLIEST_SHORT = 33
"""First year of the century to which years of two digits belong: 1933, the year of the first strong-motion
record, to 2032."""
_SAME = timedelta(minutes=5)
"""Largest difference between two times of one earthquake. Some files contain the time of a record that was
triggered later."""
_ZONE_SPAN = timedelta(hours=14)
"""Largest difference between two times of one earthquake if a time zone is not stated."""


@dataclass(frozen=True)
class Earthquake:
    """Name and time of an earthquake, as far as a text states them, else None."""

    name: tuple[str, ...]
    """Words of the name in lower case, including numbers."""
    year: int | None
    """Year."""
    day: date | None
    """Date."""
    time: datetime | None
    """Date and time, in universal time if the time zone is stated."""
    zone: str | None
    """Name of the time zone."""


@lru_cache(maxsize=4096)
def parsed(text: str) -> Earthquake:
    """Return the name and the time of an earthquake from a text.

    >>> parsed("NOWHERE VALLEY 10/15/79 2316").time
    datetime.datetime(1979, 10, 15, 23, 16)
    """
    lower = text.lower()
    # A match may not be a date, but for example the number of a record. Then try the next match.
    for pattern, places in _DATES:
        for match in re.finditer(pattern, lower):
            day = _date(*(match[place] for place in places))
            if day is not None:
                return _dated(lower[: match.start()], day, lower[match.end() :])
    # Without a date look for a year, as in "Loma Prieta 1989".
    years = re.findall(r"(?<!\d)(?:19|20)\d\d(?!\d)", lower)
    return Earthquake(_name(lower, years[-1:]), int(years[-1]) if years else None, None, None, None)


def _dated(before: str, day: date, after: str) -> Earthquake:
    """Return the earthquake from a date and from the texts before and after it."""
    clock, zone, time = _TIME.match(after), None, None
    # The time is followed by its zone, and by the name or the magnitude.
    if clock is not None:
        after = after[clock.end() :]
        zone = next((word for word in re.findall(r"[a-z]+", after) if word in _ZONES), None)
        time = datetime(day.year, day.month, day.day, int(clock[1]), int(clock[2]))
        time -= timedelta(hours=_ZONES[zone] if zone else 0)
    # In K-NET files the magnitude follows the time. It is not part of the name.
    name = _name(f"{before} {re.sub(r'm[lws]?[ =]*[0-9.]+', ' ', after)}", ())
    return Earthquake(name, day.year, day, time, zone)


def _date(year: str, month: str, day: str) -> date | None:
    """Return a date from its texts; None if there is no such date."""
    # The month may be a word, and the year may have two digits.
    number = _MONTHS.index(month[:3]) + 1 if month[:3] in _MONTHS else int(month)
    whole = int(year) if len(year) == 4 else int(year) + (1900 if int(year) >= _EARLIEST_SHORT else 2000)
    # If the month is larger than 12, the date is European, such as 15/10/1979.
    first, second = (int(day), number) if number > 12 else (number, int(day))
    try:
        return date(whole, first, second) if 1800 < whole < 2100 else None
    except ValueError:
        return None


def _name(text: str, years: tuple[str, ...] | list[str]) -> tuple[str, ...]:
    """Return the words of a name, without words that do not distinguish earthquakes."""
    idle = {*_IDLE, *_ZONES, *years}
    return tuple(word for word in re.findall(r"[^\W_]+", text) if word not in idle)


def is_one(first: str, second: str) -> bool:
    """Return whether two texts describe the same earthquake, as far as they state it.

    Two earthquakes of one day count as the same unless their times differ, so that one earthquake is never in
    two groups.

    >>> is_one("Nowhere Valley-06, 10/15/1979", "NOWHERE VALLEY 10/15/79 2316")
    True
    >>> is_one("1999/01/02 03:04:00 M6.2", "1999/01/02 15:20:00 M5.0")
    False
    """
    a, b = parsed(first), parsed(second)
    if a.time and b.time:
        apart = abs(a.time - b.time)
        # If a time zone is not stated, the times may differ by whole hours.
        shift = timedelta() if a.zone and b.zone else timedelta(hours=round(apart / timedelta(hours=1)))
        return shift <= _ZONE_SPAN and abs(apart - shift) <= _SAME
    if a.day and b.day:
        # The local date and the universal date can differ by one day.
        days = [{e.day, e.time.date() if e.time else e.day} for e in (a, b)]
        near = abs(a.day - b.day) <= timedelta(days=1)
        return bool(days[0] & days[1]) or (near and _is_one_name(a, b))
    if a.year and b.year:
        return a.year == b.year and _is_one_name(a, b)
    # Without the years the names must have the same words.
    return _is_one_name(a, b) and len(_words(a)) == len(_words(b))


def _words(of: Earthquake) -> list[str]:
    """Return the words of the name without numbers."""
    return [word for word in of.name if not word.isdigit()]


def _is_one_name(a: Earthquake, b: Earthquake) -> bool:
    """Return whether one name begins the other name, such as Chi-Chi and Chi-Chi, Taiwan.

    The number of an earthquake of one region, such as Chi-Chi-03, counts only if both names contain one.
    """
    names = _words(a), _words(b)
    numbers = [[int(word) for word in e.name if word.isdigit()] for e in (a, b)]
    n = min(map(len, names))
    return n > 0 and names[0][:n] == names[1][:n] and (numbers[0] == numbers[1] or not all(numbers))
