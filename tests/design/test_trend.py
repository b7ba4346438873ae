"""Smoothing spline: a trend below noise, its standard deviation, and its plane far from the values."""

import numpy as np
import pytest

from tpd.design.trend import fit, least_values


def bowl(x):
    return np.sum((x - [0.3, 0.7]) ** 2, axis=1)


@pytest.fixture(scope="module")
def noisy():
    """Sixty places, and their values with noise."""
    rng = np.random.default_rng(1)
    at = rng.random((60, 2))
    return at, bowl(at) + 0.02 * rng.standard_normal(60)


def test_a_trend_below_noise_is_recovered_with_its_deviation(noisy):
    trend, probe = fit(*noisy), 0.05 + 0.9 * np.random.default_rng(2).random((200, 2))
    mean, deviation = trend.at(probe)
    assert np.sqrt(np.mean((mean - bowl(probe)) ** 2)) < 0.015
    assert 0.01 < trend.noise < 0.04
    assert np.mean(np.abs(mean - bowl(probe)) < 2.0 * deviation) > 0.8


def test_values_without_noise_are_smoothed_little_and_a_plane_is_exact(noisy):
    at, _ = noisy
    assert np.abs(fit(at, bowl(at)).at(at)[0] - bowl(at)).max() < 2e-3
    # A plane has no curvature: it is also exact far from all values.
    far = np.array([[5.0, -3.0]])
    mean, deviation = fit(at, at @ [2.0, -1.0] + 3.0).at(far)
    np.testing.assert_allclose(mean, 16.0, rtol=1e-6)
    assert deviation[0] < 1e-6


def test_the_deviation_grows_away_from_the_values(noisy):
    _, deviation = fit(*noisy).at(np.array([[0.5, 0.5], [1.5, 0.5], [3.0, 0.5]]))
    assert np.all(np.diff(deviation) > 0.0)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_smallest_allowed_number_of_values_determines_a_trend(d):
    at = np.random.default_rng(0).random((least_values(d), d))
    assert np.isfinite(fit(at, at.sum(axis=1)).at(at)[0]).all()
    assert np.isfinite(fit(at, np.ones(len(at))).at(at)[0]).all()
