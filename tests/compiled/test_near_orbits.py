"""The short way to an orbit: a motion near one that attracts is taken there, and not from afar."""

import numpy as np
import pytest

from tests.reference import SLOW, parameters, settled
from tpd import status_name
from tpd.answers.periodic_orbit import periodic_orbit
from tpd.theory.equations import Terms


@pytest.mark.parametrize(("share", "early"), [(0.003, True), (0.2, False)])
def test_only_a_motion_near_an_orbit_is_moved_onto_it(share, early):
    p = parameters(SLOW)
    orbit = periodic_orbit(p, settled(Terms.linear, p, np.zeros((1, 4))).state[0])
    assert status_name(orbit.status) == "rocking"
    found = settled(Terms.linear, p, np.asarray(orbit.state)[None] * (1.0 + share))
    assert (int(found.elapsed[0]) < 30) is early
    np.testing.assert_allclose(found.settled_tilt, orbit.amplitude, rtol=1e-9)
