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


def test_records_without_an_earthquake_count_as_one_and_stated_names_as_they_are():
    def record(i, event="", notes=()):
        return Record([0.0, 1.0, -0.1 * i, 0.3 * i**2], 0.01, event=event, notes=notes)

    assert len(set(events_of([record(1), record(2), record(3, "A"), record(4)]))) == 2
    same_day = ("A 2023-02-06", "B 2023-02-06")
    assert len(set(events_of([record(i, event) for i, event in enumerate(same_day)]))) == 1
    assert len(set(events_of([record(i, event, (STATED,)) for i, event in enumerate(same_day)]))) == 2
    pulses = [Pulse.one_sine(acceleration=1.0, frequency=f) for f in (1.0, 2.0)]
    assert len(set(events_of(pulses))) == 2
