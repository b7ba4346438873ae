"""No symmetric orbit is lost, and none is invented: all orbits of many scenes by a dense scan."""

import numpy as np
import pytest

from tests.exact.orbits import ROWS, scanned, solve
from tpd.exact.orbit_roots_kernel import NODES


def test_the_scenes_have_many_orbits_and_every_special_case():
    counts = [len(row["states"]) for row in ROWS]
    assert sum(counts) > 100
    assert set(counts) == {0, 1, 2}
    assert not np.any(scanned()[1].overflow)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_every_orbit_of_the_scan_is_found_and_no_other(count):
    o = scanned()[1]
    for i, row in enumerate(ROWS):
        if len(row["states"]) == count:
            assert np.sum(o.exists[i]) == count, row["name"]
            np.testing.assert_allclose(o.amplitude[i, :count], row["amplitudes"], rtol=1e-11)
            for j, state in enumerate(row["states"]):
                np.testing.assert_allclose(o.state[i, j], state, rtol=0, atol=1e-9 * np.abs(state).max())


@pytest.mark.parametrize("row", [r for r in ROWS if r["name"].startswith("cross")], ids=lambda r: r["name"])
def test_orbits_that_cross_zero_within_one_sample_are_both_found(row):
    x = np.array(row["parameters"])
    o = solve([x])
    assert o.amplitude[0, 0] > 1.1 * o.amplitude[0, 1]
    assert abs(o.crossing[0, 0] - o.crossing[0, 1]) < np.pi / x[6] / NODES
