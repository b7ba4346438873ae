"""Designs and orbits side by side: what is followed, what is lost, and the validation of the ends."""

import numpy as np
import pytest
from tpd.design.ends import merit_of
from tpd.design.methods import descend, named
from tpd.design.objective import NONE, REST, ROCKING
from tpd.design.one_shot import OneShot

from tests.design.test_objective import orbits
from tpd.models.smoothed import Smoothed

DESIGNS = np.array([[0.05, 0.5, 0.1], [0.1, 0.7, 0.1], [0.15, 0.4, 0.1]])


@pytest.fixture(scope="module")
def objective():
    return orbits()


@pytest.fixture
def walk(objective):
    made = OneShot(objective, Smoothed(rtol=1e-7))
    made.begin(DESIGNS)
    return made


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


def test_a_descent_is_validated_and_what_is_another_orbit_is_contradicted(objective):
    walk, space = OneShot(objective, Smoothed(rtol=1e-7)), objective.space
    known = objective.linearised(walk.begin(DESIGNS))
    cap = objective.risk.cap(len(objective.conditions))
    units = space.scaled(DESIGNS)
    found = descend(named("adam", 15), walk.at, units, cap, objective.risk.of, known=known, steps=15)
    ends = walk.validated(found)
    exact = objective.at(ends.x)
    for mine, other in zip(ends.local, exact, strict=True):
        np.testing.assert_array_equal(mine, other)
    assert np.all(ends.mismatch[:, 0] < 1e-3)
    assert np.all(ends.mismatch[:, 1] < 0.02)
    assert np.all(ends.merit < merit_of(known, objective.risk.of))
    # An orbit a tenth larger is not the one that the exact solution knows.
    larger = found._replace(local=found.local._replace(value=1.1 * exact.value))
    assert walk.validated(larger).mismatch[:, 0] == pytest.approx(0.1)
