"""Initial states."""

import numpy as np
import pytest

from tpd.scene.starts import Starts


def test_starts_are_seeded_spread_and_begin_at_rest():
    starts = Starts(size=16, seed=5, tilt=0.5, tilt_rate=0.4, swing=0.3, swing_rate=0.2)
    states = starts.states(0.2)
    np.testing.assert_array_equal(states[0], 0.0)
    np.testing.assert_array_equal(states, starts.states(0.2))
    # One in each sixteenth of every range, but for the one at rest.
    cells = np.floor((states[1:] / [0.1, 0.3, 0.08, 0.2] + 1.0) * 8.0)
    assert all(len(set(column)) == 15 and {0, *column} <= set(range(16)) for column in cells.T)
    with pytest.raises(ValueError, match=r"`tilt` must be zero or positive, and finite, but is -0\.1"):
        Starts(tilt=-0.1)
