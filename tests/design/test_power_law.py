"""Factors on limited quantities of an orbit: Bayesian regression of a power law, and derivatives."""

import numpy as np
import pytest

from tpd.design.power_law import PowerLaw

RNG = np.random.default_rng(0)
DESIGNS = np.exp(RNG.uniform(np.log([0.01, 0.1, 0.05]), np.log([0.2, 1.5, 0.6]), (12, 3)))
ROWS = np.column_stack([np.ones(12), np.log(DESIGNS)])
LAW = np.array([0.4, -0.3, 0.2, 0.1])
NOISE = np.full(12, 0.1)


def test_a_law_with_a_prior_minimises_the_weighted_squares():
    """The ridge solution: the prior is four further rows of the least squares problem."""
    values, spread, noise = ROWS @ LAW + 0.3, np.array([1.0, 0.5, 0.5, 0.5]), np.geomspace(0.01, 0.3, 12)
    found = PowerLaw(np.full(4, 0.1), np.diag(spread**2)).with_values(DESIGNS, values, noise)
    rows = np.concatenate([ROWS / noise[:, None], np.diag(1.0 / spread)])
    expected, *_ = np.linalg.lstsq(rows, np.concatenate([values / noise, 0.1 / spread]), rcond=None)
    np.testing.assert_allclose(found.mean, expected, rtol=1e-8)


def test_values_one_after_the_other_give_the_same_law_as_all_at_once():
    values = ROWS @ LAW + 0.1 * RNG.standard_normal(12)
    one = law = PowerLaw(np.zeros(4), np.eye(4))
    for i in range(12):
        one = one.with_values(DESIGNS[i : i + 1], values[i : i + 1], NOISE[:1])
    every = law.with_values(DESIGNS, values, NOISE)
    np.testing.assert_allclose(one.mean, every.mean, rtol=1e-9)
    np.testing.assert_allclose(one.covariance, every.covariance, rtol=1e-7, atol=1e-12)
    none = law.with_values(DESIGNS[:0], values[:0], NOISE[:0])
    np.testing.assert_array_equal(none.mean, law.mean)
    np.testing.assert_array_equal(none.covariance, law.covariance)


def test_a_damping_of_zero_has_no_effect_and_the_factor_is_continuous():
    """Zero has no logarithm. The law still passes through the values."""
    undamped = DESIGNS * [1.0, 1.0, 0.0]
    values = ROWS[:, :3] @ LAW[:3]
    found = PowerLaw(np.zeros(4), np.eye(4)).with_values(undamped, values, 0.01 * NOISE)
    value, slope = found.at(undamped)
    np.testing.assert_allclose(value, np.exp(values), rtol=5e-3)
    np.testing.assert_array_equal(slope[:, 2], 0.0)
    assert np.isfinite(slope).all()
    np.testing.assert_array_equal(found.at(undamped + np.array([0.0, 0.0, 1e-6]))[0], value)


def test_the_derivatives_of_the_factors_equal_differences():
    value, slope = PowerLaw(LAW, np.eye(4)).at(DESIGNS)
    np.testing.assert_allclose(value, np.exp(ROWS @ LAW), rtol=1e-12)
    for i in range(3):
        step = 1e-6 * np.eye(3)[i]
        up, down = (PowerLaw(LAW, np.eye(4)).at(DESIGNS * (1.0 + s * step))[0] for s in (1, -1))
        np.testing.assert_allclose(slope[:, i], (up - down) / (2e-6 * DESIGNS[:, i]), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_factor_far_from_the_runs_is_bounded_and_constant(sign):
    """Extrapolation must not give a descent a factor of a million, and the orbit itself must keep the
    limits."""
    value, slope = PowerLaw(np.array([sign * 9.0, 1.0, 0.0, 0.0]), np.eye(4)).at(DESIGNS)
    np.testing.assert_allclose(np.log(value), 3.0 if sign > 0.0 else 0.0)
    np.testing.assert_array_equal(slope, 0.0)
