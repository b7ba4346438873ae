"""Cycles of events from a followed motion, and Newton's method on all their arcs at once."""

import numpy as np
import pytest

from tests.reference import HUNG, along
from tpd.exact.multiple_shooting import Cycle, polish, recorded

X = np.array([*HUNG[1].x, 0.75 / (1.0 + HUNG[1].x[0] ** 2), 1.0])
NEAR = np.array([0.02341, 0.37348, 0.18303, -1.33012])
PERIOD = 2.0 * np.pi / X[6]
SCALE = np.ones(4)


@pytest.mark.parametrize(
    ("x", "y0", "most", "status"),
    [
        ((0.2, 0.1, 0.4, 0.2, 0.03, 0.05, 4.0, 0.72, 1.0), np.zeros(4), 32, "rest"),
        ((0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0, 0.72, 1.0), np.array([0.8, 0.0, 0.0, 0.0]), 32, "overturned"),
        ((0.2, 0.0, 0.4, 0.2, 0.0, 0.05, 4.0, 0.72, 1.0), np.array([1e-5, 0.0, 0.0, 0.0]), 32, "event_bound"),
        ((0.2, 0.1, 0.4, 0.2, np.nan, 0.25, 4.0, 0.72, 1.0), np.zeros(4), 32, "failed"),
        (X, NEAR, 2, "event_bound"),
    ],
)
def test_a_motion_without_a_cycle_says_why(x, y0, most, status):
    assert recorded(np.array(x), y0, 1, most, 2e-7) == status


def test_newton_s_method_closes_the_cycle_and_has_its_monodromy():
    cycle = recorded(X, NEAR, 1, 32, 2e-7)
    assert isinstance(cycle, Cycle)
    assert np.sum(cycle.arcs[:, 5]) == pytest.approx(PERIOD, rel=1e-12)
    orbit = polish(X, cycle, 1, SCALE)
    # Cut in the middle of an arc: at its start an event may fall on either side.
    half, begin = 0.5 * orbit.arcs[0, 5], orbit.arcs[0, 4] / X[6]
    start = np.where(np.abs(orbit.arcs[0, :4]) < 1e-13, 0.0, orbit.arcs[0, :4])
    middle = along(HUNG[1].x, start, begin + np.array([0.0, half]))[0][-1]
    ys, by, _ = along(HUNG[1].x, middle, begin + half + np.array([0.0, PERIOD]))
    np.testing.assert_allclose(ys[-1], middle, rtol=0, atol=1e-10)
    found, expected = (np.sort(np.abs(np.linalg.eigvals(m))) for m in (orbit.monodromy, by[-1]))
    np.testing.assert_allclose(found[-1], expected[-1], rtol=1e-8)


def test_a_cycle_that_leads_to_no_motion_is_refused():
    cycle = recorded(X, NEAR, 1, 32, 2e-7)
    modes = cycle.modes.copy()
    # All landings are said to be turns.
    modes[3] = 0.0
    assert polish(X, Cycle(modes, cycle.arcs), 1, SCALE) is None
    assert polish(np.array([*X[:5], 0.0, *X[6:]]), cycle, 1, SCALE) is None
