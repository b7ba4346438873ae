"""Factors on the angles of an orbit: Bayesian regression of a power law, and derivatives of the factors."""

import numpy as np
import pytest

from tpd.design.angle_factors import AngleFactors, PowerLaw

RNG = np.random.default_rng(0)
DESIGNS = np.exp(RNG.uniform(np.log([0.01, 0.1, 0.05]), np.log([0.2, 1.5, 0.6]), (12, 3)))
ROWS = np.column_stack([np.ones(12), np.log(DESIGNS)])
LAW = np.array([0.4, -0.3, 0.2, 0.1])
WIDE = PowerLaw(np.zeros(4), 1e4 * np.eye(4))


def test_a_law_without_prior_knowledge_is_the_least_squares_plane():
    values = ROWS @ LAW + 0.1 * RNG.standard_normal(12)
    found = WIDE.with_values(DESIGNS, values, 0.1)
    expected, *_ = np.linalg.lstsq(ROWS, values, rcond=None)
    np.testing.assert_allclose(found.mean, expected, atol=1e-5)
    # The covariance of least squares is s^2 (X' X)^-1.
    np.testing.assert_allclose(found.covariance, 0.01 * np.linalg.inv(ROWS.T @ ROWS), atol=2e-5)


def test_a_law_with_a_prior_minimises_the_weighted_squares():
    """The ridge solution: the prior is four further rows of the least squares problem."""
    values, spread, noise = ROWS @ LAW + 0.3, np.array([1.0, 0.5, 0.5, 0.5]), 0.2
    found = PowerLaw(np.full(4, 0.1), np.diag(spread**2)).with_values(DESIGNS, values, noise)
    rows = np.concatenate([ROWS / noise, np.diag(1.0 / spread)])
    expected, *_ = np.linalg.lstsq(rows, np.concatenate([values / noise, 0.1 / spread]), rcond=None)
    np.testing.assert_allclose(found.mean, expected, rtol=1e-10)


def test_values_one_after_the_other_give_the_same_law_as_all_at_once():
    values = ROWS @ LAW + 0.1 * RNG.standard_normal(12)
    one = law = PowerLaw(np.zeros(4), np.eye(4))
    for i in range(12):
        one = one.with_values(DESIGNS[i : i + 1], values[i : i + 1], 0.1)
    every = law.with_values(DESIGNS, values, 0.1)
    np.testing.assert_allclose(one.mean, every.mean, rtol=1e-9)
    np.testing.assert_allclose(one.covariance, every.covariance, rtol=1e-7, atol=1e-12)
    none = law.with_values(DESIGNS[:0], values[:0], 0.1)
    np.testing.assert_array_equal(none.mean, law.mean)
    np.testing.assert_array_equal(none.covariance, law.covariance)


def test_a_damping_of_zero_has_no_effect_and_the_factor_is_continuous():
    """Zero has no logarithm. The law still passes through the values."""
    undamped = DESIGNS * [1.0, 1.0, 0.0]
    values = ROWS[:, :3] @ LAW[:3]
    found = PowerLaw(np.zeros(4), np.eye(4)).with_values(undamped, values, 1e-3)
    np.testing.assert_allclose(found.at(undamped), values, atol=5e-3)
    factors = AngleFactors({"stroke": found})
    value, slope = factors.of(["stroke"], undamped)
    assert np.isfinite(slope).all()
    np.testing.assert_array_equal(slope[..., 2], 0.0)
    np.testing.assert_allclose(value[:, 0], np.exp(values), rtol=5e-3)
    np.testing.assert_array_equal(factors.of(["stroke"], undamped + np.array([0.0, 0.0, 1e-6]))[0], value)


def test_the_derivatives_of_the_factors_equal_differences():
    factors = AngleFactors({"clearance": PowerLaw(LAW, np.eye(4)), "stroke": PowerLaw(-LAW, np.eye(4))})
    names = ["stroke", "reserve", "clearance"]
    value, slope = factors.of(names, DESIGNS)
    assert (value.shape, slope.shape) == ((12, 3), (12, 3, 3))
    np.testing.assert_allclose(value[:, 2], np.exp(ROWS @ LAW), rtol=1e-12)
    # The orbit itself must keep the limits: no factor is smaller than one.
    np.testing.assert_array_equal(value[:, :2], 1.0)
    np.testing.assert_array_equal(slope[:, 0], 0.0)
    np.testing.assert_array_equal(slope[:, 1], 0.0)
    for i in range(3):
        step = 1e-6 * np.eye(3)[i]
        up, down = (factors.of(names, DESIGNS * (1.0 + s * step))[0] for s in (1, -1))
        expected = (up - down) / (2e-6 * DESIGNS[:, i, None])
        np.testing.assert_allclose(slope[..., i], expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_factor_far_from_the_runs_is_bounded_and_constant(sign):
    """Extrapolation must not give a descent a factor of a million."""
    factors = AngleFactors({"stroke": PowerLaw(np.array([sign * 9.0, 1.0, 0.0, 0.0]), np.eye(4))})
    value, slope = factors.of(["stroke"], DESIGNS)
    np.testing.assert_allclose(np.log(value), 3.0 if sign > 0.0 else 0.0)
    np.testing.assert_array_equal(slope, 0.0)


def test_an_accurate_value_corrects_its_neighbourhood_only():
    law = PowerLaw(np.array([1.0, 0.1, 0.2, 0.1]), np.eye(4))
    design = np.array([0.05, 0.4, 0.2])
    there = law.corrected(design, 1.5)
    assert there.at(design[None])[0] == pytest.approx(1.5, abs=0.02)
    far = np.array([[0.005, 0.05, 0.2]])
    np.testing.assert_allclose(there.at(far), law.at(far), atol=1e-6)
    # A new value at the same design replaces the old one.
    assert there.corrected(design, 1.2).at(design[None])[0] == pytest.approx(1.2, abs=0.02)
    near = design[None] * [[1.1, 0.8, 1.3]]
    for i in range(3):
        step = 1e-6 * np.eye(3)[i]
        quotient = (there.at(near * (1.0 + step)) - there.at(near * (1.0 - step))) / (2e-6 * near[0, i])
        np.testing.assert_allclose(there.slopes(near)[:, i], quotient, rtol=1e-5)


def test_without_laws_all_factors_are_one():
    value, slope = AngleFactors().of(["stroke", "clearance"], DESIGNS)
    np.testing.assert_array_equal(value, 1.0)
    np.testing.assert_array_equal(slope, 0.0)
    assert AngleFactors().of([], DESIGNS)[1].shape == (12, 0, 3)
