"""Groups of ground motions: an earthquake is on one side only, and copies of one motion are of one."""

import numpy as np
import pytest

import tpd
from tpd.design.ground.judgement import Role, events_of, grouped


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=300)


@pytest.mark.mends("two copies of one motion counted as two earthquakes")
def test_copies_of_a_motion_are_one_earthquake():
    first = tpd.Record(noise(1), 0.01)
    copy = tpd.Record(np.round(-2.0 * noise(1), 2), 0.01, event="B")
    third = tpd.Record(noise(2), 0.01, event="B")
    other, slower = tpd.Record(noise(3), 0.01, event="C"), tpd.Record(noise(1), 0.02)
    names = events_of([first, copy, third, other, slower])
    assert names[0] == names[1] == names[2]
    assert len({names[0], names[3], names[4]}) == 3


@pytest.mark.mends("a copy of a motion that was tuned to was held out")
def test_a_copy_is_not_held_out():
    first, other = tpd.Record(noise(1), 0.01), tpd.Record(noise(2), 0.01)
    groups = grouped([first], {"others": [first.scaled(2.0), other]}, 0)
    assert groups[1].motions == (other,)


@pytest.mark.mends("a copy with zeros before it or after it was another earthquake")
@pytest.mark.parametrize("zeros", [(1, 0), (0, 40), (100, 3)])
def test_zeros_make_no_other_earthquake(zeros):
    first, second = tpd.Record(noise(1), 0.01), tpd.Record(np.pad(noise(1), zeros), 0.01)
    assert len(set(events_of([first, second]))) == 1


@pytest.mark.mends("an earthquake in two held-out groups counted twice")
def test_an_earthquake_has_one_number_in_all_groups():
    tuned, a, b, c = (tpd.Record(noise(i), 0.01) for i in range(4))
    groups = grouped([tuned], {"x": [a, b], "y": [b.scaled(3.0), c]}, 0)
    assert groups[1].events[1] == groups[2].events[0]
    assert len({*groups[0].events, *groups[1].events, *groups[2].events}) == 4


def test_an_earthquake_is_on_one_side_only(records):
    for seed in range(5):
        tuned, held = grouped(records, 0.5, seed)
        assert tuned.role is Role.tuned
        assert held.role is Role.held_out
        assert not set(events_of(tuned.motions)) & set(events_of(held.motions))
        assert len(tuned.motions) + len(held.motions) == len(records)
        assert len(held.motions) == 10
    assert len(grouped(records, 0.0, 0)) == 1
    others = grouped(records[:4], {"others": records[2:8]}, 0)
    assert [m.name for m in others[1].motions] == [m.name for m in records[4:8]]
    with pytest.raises(ValueError, match="all are held out"):
        grouped(records[:2], 0.5, 0)
    with pytest.raises(ValueError, match="other earthquakes"):
        grouped(records[:2], {"same": records[:2]}, 0)
