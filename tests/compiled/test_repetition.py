"""When a motion repeats itself, and how its shaking grows."""

from types import SimpleNamespace

import numpy as np
import pytest

from tpd.compiled import repetition as r

STATE = np.array([0.1, 0.2, -0.1, 0.3])


class Past:
    """The last states of a motion, newest first, as rows or as records."""

    def __init__(self, states):
        self.states = states

    def __getitem__(self, key):
        return self.states[key[0]][key[1]] if isinstance(key, tuple) else SimpleNamespace(y=self.states[key])


@pytest.fixture(autouse=True)
def interpreted(monkeypatch):
    monkeypatch.setattr(r, "distance", r.distance.py_func)


def after(past, *, mu=0.1):
    return r.repeats_after.py_func(
        SimpleNamespace(mu=mu, zeta=0.1), STATE, Past(past), len(past), np.ones(4), 1e-8
    )


@pytest.mark.parametrize(("period", "expected"), [(1, 1), (3, 3), (8, 8), (0, 0)])
def test_the_period_is_the_number_of_cycles_after_which_the_state_returns(period, expected):
    assert after([STATE + (0.0 if j + 1 == period else 0.01) for j in range(8)]) == expected


def test_the_shortest_of_several_close_periods_is_chosen():
    # On its way to period one a motion may alternate.
    assert after([STATE + 5e-7, STATE + 1e-9, STATE - 5e-7]) == 1
    assert after([STATE + 5e-6, STATE + 1e-9, STATE - 5e-6]) == 2
    assert after([STATE + 5e-7]) == 0


@pytest.mark.parametrize(("before", "expected"), [(3.5e-9, 0), (4.5e-9, 1)])
def test_a_motion_that_decays_slowly_has_not_settled(before, expected):
    # If the change falls from 4e-9 to 3e-9 in a period, all further changes together are 9e-9.
    assert after([STATE + 3e-9, STATE + 3e-9 + before, STATE + 3e-9 + 2.2 * before]) == expected


def test_a_bob_without_mass_does_not_affect_the_period():
    past = [STATE + np.array([0.0, 1.0, 0.0, 1.0])]
    assert after(past) == 0
    assert after(past, mu=0.0) == 1


@pytest.mark.parametrize(("xi", "known"), [(4.0, [0.2, 0.5, 0.8, 2.0]), (0.1, [0.2, 0.5, 0.2, 0.5])])
def test_scales_of_the_state_grow_with_the_excitation_frequency(xi, known):
    np.testing.assert_allclose(r.scales_of.py_func(SimpleNamespace(nu=0.2, f=0.3, xi=xi)), known)


@pytest.mark.parametrize(
    ("elapsed", "since", "share", "until"),
    [
        # Over two and a half periods of length 3: it grows in the first two, and for a half of the third.
        (0.0, 0.0, 0.0, 7.5),
        (1.0, 0.0, 0.4, 4.5),
        (2.0, 1.0, 0.8, 1.5),
        (2.0, 1.6, 1.0, 0.0),
        (3.0, 0.0, 1.0, 0.0),
    ],
)
def test_the_excitation_grows_linearly_to_its_full_size(monkeypatch, elapsed, since, share, until):
    monkeypatch.setattr(r, "harmonic", lambda: r.Forcing(True, 1.0, 0.0, 0, np.empty((0, 4))))
    f, grown = r.excitation_in.py_func(2.5, 3.0, elapsed, since)
    assert f.share == pytest.approx(share)
    assert grown == pytest.approx(until)
    assert f.share + f.rate * grown == pytest.approx(1.0)
