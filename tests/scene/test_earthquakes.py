"""Whether two texts state one earthquake."""

import itertools

from tpd import Record
from tpd.scene.earthquakes import STATED, is_one
from tpd.scene.ground_motion import Pulse, events_of

VALLEY = (
    "Nowhere Valley-06 1979-10-15",
    "NOWHERE VALLEY 1979-10-15",
    "NOWHERE EARTHQUAKE 1979-10-16",
    "1979-10-15",
)
"""One earthquake."""
PAIRS = (
    ("Elsewhere 1999-01-02", "Elsewhere 1999-01-15", False),
    ("Nowhere 1989-10-18", "Nowhere 1989-10-20", False),
    # Two earthquakes of one day count as one, so that one earthquake is never on both sides.
    ("Nowhere 1999-01-02", "Elsewhere 1999-01-02", True),
    ("Nowhere 1940", "Nowhere 1979", False),
    ("Nowhere Valley 1979", "Nowhere Valley-06 1979-10-15", True),
    # Numbers of agencies at the end of a name do not count.
    ("Northridge", "Northridge-01", True),
    ("Chi-Chi-03 1999", "Chi-Chi-06 1999", True),
    ("Nowhere", "Nowhere Valley", False),
    ("quake 1", "quake 2", False),
    ("1940", "B", False),
    ("", "Nowhere", False),
    ("", "", False),
    ("Nowhere 1999-99-99", "NOWHERE 1999-99-99", True),
)


def test_texts_of_equal_and_different_earthquakes_are_distinguished():
    pairs = {pair[:2]: pair[2] for pair in PAIRS} | dict.fromkeys(itertools.permutations(VALLEY, 2), True)
    for (first, second), expected in pairs.items():
        assert is_one(first, second) is is_one(second, first) is expected


def test_stated_names_of_one_day_and_pulses_count_separately():
    for notes, count in (((), 1), ((STATED,), 2)):
        records = [Record([0.0, 1.0, i], 0.01, event=f"{i} 2023-02-06", notes=notes) for i in (2, 3)]
        assert len({*events_of(records)}) == count
    assert len({*events_of([Pulse.one_sine(acceleration=1.0, frequency=f) for f in (1.0, 2.0)])}) == 2


def test_records_without_an_earthquake_count_as_one():
    records = [
        Record([0.0, 1.0, -0.1 * i, 0.3 * i**2], 0.01, event=x) for i, x in enumerate(("", "", "A", ""), 1)
    ]
    assert len({*events_of(records)}) == 2
