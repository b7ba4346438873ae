"""Designs and orbits side by side: what is followed, and what is lost."""

import numpy as np
import pytest

from tests.design.test_orbits import orbits
from tpd.design.criteria import NONE, REST, ROCKING
from tpd.design.smoothed_orbits import SMOOTHED, SmoothedOrbits

DESIGNS = np.array([[0.05, 0.5, 0.1], [0.1, 0.7, 0.1], [0.15, 0.4, 0.1]])


@pytest.fixture(scope="module")
def objective():
    return orbits()


@pytest.fixture
def walk(objective):
    return SmoothedOrbits(objective, SMOOTHED, objective.evaluate(DESIGNS))


def test_steps_follow_the_exact_orbits_as_designs_move(walk, objective):
    for share in (1.0, 1.01, 1.02, 1.02, 1.02):
        e = walk.evaluate(DESIGNS * [share, share, 1.0])
    exact = objective.evaluate(DESIGNS * [1.02, 1.02, 1.0])
    np.testing.assert_array_equal(e.kind, exact.kind)
    rocks = e.kind == ROCKING
    assert rocks.any()
    np.testing.assert_allclose(e.tilt[rocks], exact.tilt[rocks], rtol=1e-4)
    np.testing.assert_allclose(e.stroke[rocks], exact.stroke[rocks], rtol=2e-3)
    steep = np.abs(exact.tilt_slope[rocks]).max(axis=-1, keepdims=True)
    assert np.max(np.abs(e.tilt_slope[rocks] - exact.tilt_slope[rocks]) / steep) < 0.02
    assert walk.lost.sum() == 0


def test_what_is_not_followed_is_the_exact_answer(walk, objective):
    """A jump over half of the space loses orbits; the exact solution answers there and goes on."""
    far = np.array([[0.19, 1.9, 0.1], [0.02, 0.15, 0.1], [0.05, 1.2, 0.1]])
    e, exact = walk.evaluate(far), objective.evaluate(far)
    assert walk.lost.sum() > 0
    np.testing.assert_array_equal(e.kind, exact.kind)
    again = walk.evaluate(far)
    rocks = exact.kind == ROCKING
    np.testing.assert_allclose(again.tilt[rocks], exact.tilt[rocks], rtol=1e-4)
    others = (exact.kind == REST) | (exact.kind == NONE)
    np.testing.assert_array_equal(again.merit[others], exact.merit[others])
