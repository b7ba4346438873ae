"""Whether two texts are about one earthquake, in the spellings of agencies."""

import itertools
from datetime import date, datetime

import pytest

from tpd.scene.earthquakes import is_one, parsed

VALLEY = (
    "Nowhere Valley-06, 10/15/1979",
    "NOWHERE VALLEY 10/15/79 2316",
    "NOWHERE VALLEY 10/15/79 23:16",
    "NOWHERE 19791015 231654 UTC",
    "1979/10/16 08:16:54 JST M6.5",
    "NOWHERE VALLEY EARTHQUAKE OCTOBER 15, 1979 16:16 PDT",
    "Mon Oct 15, 1979 16:16:54.0 PDT",
    "1979 October 15 23:16:54 UT",
    "1979  10  15    2316 Nowhere Valley",
    "Record of 15 Oct 1979",
    "15.10.1979 Nowhere",
    "1979-10-15",
)
"""One earthquake."""
PAIRS = (
    ("Elsewhere, 1/2/1999", "ELSEWHERE 01/02/99", True),
    ("Elsewhere, 01/02/1999", "Elsewhere, 15/1/1999", False),
    ("Nowhere 1940", "Nowhere 1979", False),
    # A year beside a date: as the set of FEMA P695 and the files of PEER write it.
    ("Nowhere Valley 1979", "Nowhere Valley-06, 10/15/1979", True),
    ("Chi-Chi 1999", "Chi-Chi, Taiwan, 9/20/1999", True),
    # A number counts only if both names have one, also without a date.
    ("Imperial Valley 1979", "Imperial Valley-06 1979", True),
    ("Northridge", "Northridge-01", True),
    ("Kobe 1995", "Kobe, Japan 1995", True),
    ("Nowhere", "Nowhere Valley", False),
    ("Kobe 1999", "Chi-Chi, Taiwan, 9/20/1999", False),
    ("Chi-Chi-03 1999", "Chi-Chi-06 1999", False),
    # Without a date only names can say it.
    ("Nowhere", "NOWHERE earthquake", True),
    ("Nowhere-01", "Nowhere-02", False),
    ("1940", "B", False),
    ("", "Nowhere", False),
    # Two earthquakes of one day are told apart by their times, and by nothing else.
    ("Nowhere, 1/2/1999", "Elsewhere, 1/2/1999", True),
    ("1999/01/02 03:04:00 JST M6.2", "1999/01/02 15:04:00 JST M5.0", False),
    ("NOWHERE 19990102 030405 UTC", "NOWHERE 19990102 154501 UTC", False),
    ("NOWHERE 01/02/99 0304", "NOWHERE 01/02/99 1520", False),
    # Of a time without its zone only the minutes count.
    ("NOWHERE 01/02/99 0304", "1999/01/02 12:05:10 JST M6.2", True),
    ("NOWHERE 01/02/99 1904", "1999/01/03 12:05:10 JST M6.2", True),
    # A date may be the local one or the universal one.
    ("Loma Prieta, 10/18/1989", "LOMA PRIETA EARTHQUAKE OCTOBER 17, 1989", True),
    ("Nowhere, 10/18/1989", "Elsewhere, 10/17/1989", False),
    ("Nowhere, 10/18/1989", "Nowhere, 10/20/1989", False),
    ("Nowhere-02, 10/18/1989", "Nowhere-03, 10/19/1989", False),
    ("Nowhere-2, 10/18/1989", "Nowhere-02, 10/19/1989", True),
    ("Nowhere-02 1989", "Nowhere-03, 10/19/1989", False),
)


def test_all_spellings_of_one_earthquake_are_equal():
    assert [pair for pair in itertools.permutations(VALLEY, 2) if not is_one(*pair)] == []


@pytest.mark.parametrize(("first", "second", "expected"), PAIRS)
def test_texts_of_equal_and_different_earthquakes_are_distinguished(first, second, expected):
    assert is_one(first, second) is expected
    assert is_one(second, first) is expected


def test_name_and_time_of_an_earthquake_are_parsed():
    found = parsed("NOWHERE VALLEY 10/15/79 2316")
    assert (found.name, found.year, found.day) == (("nowhere", "valley"), 1979, date(1979, 10, 15))
    assert found.time == datetime(1979, 10, 15, 23, 16)
    # The years of two digits, a day before a month, and what is no date.
    assert [parsed(f"A 1/2/{year}").year for year in ("33", "99", "00", "32")] == [1933, 1999, 2000, 2032]
    assert parsed("A 15/10/1979").day == date(1979, 10, 15)
    assert parsed("A 99/99/1979").day is None
    assert parsed("1/1/0001 00:00 JST").time is None
    assert parsed("RSN 19999999").day is None
