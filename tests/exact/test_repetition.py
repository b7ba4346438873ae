"""When a motion repeats itself, and what it is then called."""

from types import SimpleNamespace

import numpy as np
import pytest

from tpd.exact import repetition as r

STATE = np.array([0.1, 0.2, -0.1, 0.3])


def after(past, *, mu=0.1, tolerance=1e-8):
    known = np.zeros((r.LONGEST, 4))
    known[: len(past)] = past
    return r.repeats_after.py_func(SimpleNamespace(mu=mu), STATE, known, len(past), np.ones(4), tolerance)


@pytest.mark.parametrize(("period", "expected"), [(1, 1), (3, 3), (8, 8), (0, 0)])
def test_the_period_is_that_after_which_the_state_returns(period, expected):
    past = [STATE + (0.0 if j + 1 == period else 0.01) for j in range(8)]
    assert after(past) == expected


def test_the_shortest_period_that_is_close_as_well_counts():
    # On its way to period one a motion may alternate.
    assert after([STATE + 5e-7, STATE + 1e-9]) == 1
    assert after([STATE + 5e-6, STATE + 1e-9]) == 2
    assert after([STATE + 5e-7]) == 0


def test_a_bob_without_mass_does_not_count():
    past = [STATE + np.array([0.0, 1.0, 0.0, 1.0])]
    assert after(past) == 0
    assert after(past, mu=0.0) == 1


def test_scales_grow_with_the_rate_of_the_shaking():
    q = SimpleNamespace(nu=0.2, f=0.3, xi=4.0)
    np.testing.assert_allclose(r.scales_of.py_func(q), [0.2, 0.5, 0.8, 2.0])
    slow = SimpleNamespace(nu=0.2, f=0.3, xi=0.1)
    np.testing.assert_allclose(r.scales_of.py_func(slow), [0.2, 0.5, 0.2, 0.5])


def test_the_last_periods_move_on_and_the_oldest_is_forgotten():
    past, last, known = np.zeros((r.LONGEST, 4)), np.zeros((r.LONGEST, 3)), 0
    for n in range(10):
        known = r.remember.py_func(past, known, last, np.full(4, n), n, 2 * n, 2.0 if n > 6 else 1.0)
    assert known == r.LONGEST
    assert past[:, 0].tolist() == [9, 8, 7, 6, 5, 4, 3, 2]
    assert last[0].tolist() == [9, 18, 2]
    assert r.stayed.py_func(last, 3)
    assert not r.stayed.py_func(last, 4)


def settled(status, repeats, held=0.0, tilt=0.0):
    last, out = np.zeros((r.LONGEST, 3)), np.zeros(11)
    last[:, 0], last[:, 1], last[:, 2] = np.arange(1, 9), np.arange(11, 19), held
    m = SimpleNamespace(y=np.array([tilt, 0.2, 0.3, 0.4]), kind=0.0, tilt=1.0, way=-1.0)
    status, periods = r.settled.py_func(status, repeats, m, last, np.array([20.0, 30.0]), out)
    return r.STATUSES[status], periods, out[4:8].tolist()


@pytest.mark.parametrize(
    ("given", "name", "periods", "sizes"),
    [
        # Of a motion that repeats itself the sizes of its own periods; of others those of all.
        ({"status": r.ROCKING, "repeats": 2}, "rocking", 2, [2.0, 12.0, 20.0, 30.0]),
        ({"status": r.ROCKING, "repeats": 2, "held": 1.0}, "sticking", 2, [2.0, 12.0, 20.0, 30.0]),
        ({"status": r.NOT_SETTLED, "repeats": 0}, "not_settled", 1, [8.0, 18.0, 20.0, 30.0]),
        ({"status": r.AT_REST, "repeats": 0}, "rest", 1, [0.0, 11.0, 20.0, 30.0]),
        ({"status": r.AT_REST, "repeats": 0, "tilt": -0.1}, "held", 1, [0.1, 11.0, 20.0, 30.0]),
        ({"status": r.OVERTURNED, "repeats": 0}, "overturned", 1, [8.0, 18.0, np.inf, np.inf]),
    ],
)
def test_a_motion_that_ends_has_a_status_and_sizes(given, name, periods, sizes):
    assert settled(**given) == (name, periods, sizes)
