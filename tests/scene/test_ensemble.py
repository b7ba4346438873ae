"""Settings of a set of runs."""

import numpy as np
import pytest

from tpd.scene.ensemble import Ensemble, Starts


def test_invalid_ensembles_are_rejected():
    for wrong, message in (
        ({"periods": 0}, "`periods` must be a whole number, 1 or more, but is 0"),
        ({"seed": -1}, "`seed` must be a whole number, 0 or more, but is -1"),
        ({"tilt": -0.1}, r"`tilt` must be zero or positive, and finite, but is -0\.1"),
        ({"frequency": 0.6}, r"`frequency` must be between 0 and 0\.5, but is 0\.6"),
        ({"growth": (1.0, -2.0)}, "`growth` must be zero or positive, and finite, but is -2"),
        ({"growth": (1.0, 1e300)}, r"`growth` must be at most 100, the periods of a run, but is 1e\+300"),
        ({"disturbed": 1.5}, "`disturbed` must be between 0 and 1, but is 1.5"),
    ):
        with pytest.raises(ValueError, match=message):
            Ensemble(**wrong)


def test_initial_states_fill_their_ranges_and_the_first_is_at_rest():
    starts = Starts(size=16, seed=5, tilt=0.5, tilt_rate=0.4, swing=0.3, swing_rate=0.2)
    states = starts.states(0.2)
    np.testing.assert_array_equal(states[0], 0.0)
    np.testing.assert_array_equal(states, starts.states(0.2))
    # One in each sixteenth of every range, but for the one at rest.
    cells = np.floor((states[1:] / [0.1, 0.3, 0.08, 0.2] + 1.0) * 8.0)
    assert all(len(set(column)) == 15 and {0, *column} <= set(range(16)) for column in cells.T)
    draws = Ensemble(size=16, seed=5).draws()
    # The first run is the nominal one; the others are of a Latin hypercube: one in a row of every column.
    assert np.all(draws[0, [0, 1, 2, 3, 6, 13]] == 0.5)
    assert np.all(np.diff(np.sort(np.floor(draws[1:] * 16), axis=0), axis=0) > 0.0)


def test_the_first_run_has_no_scatter():
    draws = Ensemble(size=16, seed=5).draws()
    assert draws.shape == (16, 14)
    assert np.all(np.delete(draws[0], [4, 5]) == 0.5)
