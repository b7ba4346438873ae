"""Screening: seeded designs, half of which cannot lift, and the choice of those that lie apart."""

import jax.numpy as jnp
import numpy as np
from tpd.design.objective import margins
from tpd.design.screening import best_apart, first_apart, screened_designs, starting_designs, with_design

import tpd
from tests.design.conftest import SCENE
from tests.design.test_objective import orbits
from tpd.scene.parameters import as_arrays
from tpd.theory import uplift


def test_starting_designs_are_seeded_and_inside_and_half_of_them_cannot_lift():
    p, space = as_arrays(SCENE.parameters()), tpd.DesignSpace()
    points = starting_designs(p, space, 0.5, 64, seed=3)
    assert points.shape == (64, 3)
    assert np.array_equal(points, starting_designs(p, space, 0.5, 64, seed=3))
    assert not np.array_equal(points, starting_designs(p, space, 0.5, 64, seed=4))
    low, high = space.bounds
    assert np.all((points[:, :2] >= low) & (points[:, :2] <= high))
    assert np.all(points[:, 2] == 0.1)
    lifts = [uplift(with_design(p, jnp.asarray(x))) for x in points[32:]]
    still = [float(u.margin) > -1e-3 and float(u.stroke) <= 0.5 for u in lifts]
    assert np.mean(still) > 0.8, "the closed forms lead to designs that never lift"


def test_a_quarter_of_the_screened_designs_has_the_largest_margins():
    objective = orbits()
    designs = screened_designs(objective, 40, seed=2)
    assert designs.shape == (40, 3)
    np.testing.assert_array_equal(designs, screened_designs(objective, 40, seed=2))
    least = margins(objective, designs).min(axis=1)
    assert least[30:].min() > np.median(least[:30])
    assert screened_designs(objective, 1, seed=2).shape == (1, 3)


def test_the_best_designs_that_lie_apart_come_first():
    units = np.array([[0.5, 0.5], [0.51, 0.5], [0.9, 0.9], [0.1, 0.1], [0.505, 0.5]])
    values = np.array([1.0, 2.0, 4.0, 3.0, 1.5])
    np.testing.assert_array_equal(best_apart(units, values, 3), [0, 3, 2])
    np.testing.assert_array_equal(best_apart(units, values, 5), [0, 3, 2, 4, 1])
    # Designs that coincide count once.
    np.testing.assert_array_equal(best_apart(units[[0, 0, 2]], values[[0, 0, 2]], 3), [0, 2])


def test_the_first_of_an_order_that_are_no_neighbours():
    units = np.array([[0.5, 0.5], [0.51, 0.5], [0.9, 0.9], [0.1, 0.1]])
    order = np.array([1, 0, 3, 2])
    assert first_apart(units, order, 4) == [1, 3, 2]
    assert first_apart(units, order, 2) == [1, 3]
    assert first_apart(units, order, 4, fixed=2) == [1, 0, 3, 2]
    assert first_apart(units, order[:0], 4) == []
