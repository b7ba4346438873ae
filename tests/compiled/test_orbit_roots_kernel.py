"""No symmetric orbit is lost, and none is invented: all orbits of many scenes by a dense scan."""

import numpy as np
import pytest

from tests.compiled.orbit_cases import ROWS, scanned


@pytest.mark.parametrize("count", [0, 1, 2])
def test_the_roots_contain_every_orbit_of_a_dense_scan_and_no_other(count):
    o = scanned()[1]
    assert not np.any(o.overflow)
    for i, row in enumerate(ROWS):
        if len(row["states"]) == count:
            assert np.sum(o.exists[i]) == count, row["name"]
            np.testing.assert_allclose(o.amplitude[i, :count], row["amplitudes"], rtol=1e-11)
            for j, state in enumerate(row["states"]):
                np.testing.assert_allclose(o.state[i, j], state, rtol=0, atol=1e-9 * np.abs(state).max())
