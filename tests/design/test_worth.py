"""Requirements on the benefit of a design."""

import pytest

from tpd.design.criteria import Worth


def test_by_default_a_tenth_is_asked_for():
    worth = Worth()
    assert (worth.at_least, worth.worse, worth.strikes, worth.runs) == (0.1, 0.05, None, None)
    assert (worth.allowed, worth.broken) == (0.01, 0.1)
    assert Worth(strikes=0.3).allowed == Worth(strikes=0.3).broken == 0.3


@pytest.mark.parametrize("name", ["at_least", "worse", "strikes"])
def test_shares_are_between_nothing_and_all(name):
    for value in (0.0, 1.0):
        assert getattr(Worth(**{name: value}), name) == value
    for value in (-0.1, 1.1, float("nan")):
        with pytest.raises(ValueError, match=f"`{name}` must be"):
            Worth(**{name: value})


def test_runs_are_counted():
    with pytest.raises(ValueError, match="`runs` must be a whole number, 1 or more, but is 0"):
        Worth(runs=0)
