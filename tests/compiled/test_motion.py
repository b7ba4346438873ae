"""The numbers of a followed motion: its largest angles, where they occurred, and its legs."""

import numba
import numpy as np

from tpd.compiled import motion
from tpd.compiled.columns import SLIP
from tpd.compiled.motion import LEG, MOTION


@numba.njit
def tally(motions, path):
    """Count the angles of a path (phi, psi, tau)."""
    m = motions[0]
    motion.reset_counts(m)
    m.y[0], m.y[1] = path[0, 0], path[0, 1]
    motion.reset_angles(m)
    for i in range(1, len(path)):
        motion.update_angles(m, path[i, 0], path[i, 1], path[i, 2], 0.5)
        m.n_legs += 1
    return motion.larger_side(m, 0), motion.larger_side(m, 1), motion.larger_side(m, 2)


@numba.njit
def record(motions, legs):
    for n in range(3):
        motion.record_leg(motions[0], legs, n, 0.1 * n, 0.2, 7, motion.TURN)
        motions[0].n_legs += 1


def test_the_largest_angles_are_stored_with_the_leg_that_reached_them():
    motions = np.zeros(1, MOTION)
    path = np.array([[0.1, 0.0, 0.0], [-0.2, 0.3, 1.0], [-0.2, 0.1, 2.0], [0.05, -0.5, 3.0]])
    assert tally(motions, path) == (1, 3, 5)
    m = motions[0]
    np.testing.assert_allclose(m["peaks"], [0.1, 0.2, 0.3, 0.5, 0.5, 0.55])
    assert m["peak_legs"].tolist() == [-1, 0, 0, 2, 0, 2]
    assert m["peak_times"].tolist() == [0.0, 1.5, 1.5, 3.5, 1.5, 3.5]
    assert m["peak_offsets"].tolist() == [0.0, 0.5, 0.5, 0.5, 0.5, 0.5]


def test_legs_beyond_the_capacity_are_counted_and_not_written():
    motions, legs = np.zeros(1, MOTION), np.zeros(2, LEG)
    motions["kind"], motions["direction"], motions["y"] = SLIP, -1.0, np.arange(4.0)
    record(motions, legs)
    assert motions["n_legs"][0] == 3
    assert legs["piece"].tolist() == [0, 1]
    assert legs["direction"].tolist() == [-1.0, -1.0]
    np.testing.assert_array_equal(legs["y"][1], np.arange(4.0))
