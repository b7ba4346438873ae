"""Gaussian processes: a trend below noise, and which designs are worth a trial."""

import numpy as np
import pytest

from tpd.design.gaussian_process import (
    Observations,
    fit,
    improvement,
    probability_below_zero,
    proposals,
)


def bowl(x):
    return np.sum((x - [0.3, 0.7]) ** 2, axis=1)


@pytest.fixture(scope="module")
def noisy():
    """Forty places, and their values with noise."""
    rng = np.random.default_rng(1)
    at = rng.random((40, 2))
    return Observations(at, bowl(at) + 0.02 * rng.standard_normal(40))


@pytest.fixture(scope="module")
def process(noisy):
    return fit(noisy, seed=0)


def test_a_trend_below_noise_is_recovered(process):
    probe = np.random.default_rng(2).random((200, 2))
    mean, deviation = process.at(probe)
    assert np.sqrt(np.mean((mean - bowl(probe)) ** 2)) < 0.02
    assert 0.01 < process.spread * np.exp(process.numbers[-1]) < 0.04
    assert np.mean(np.abs(mean - bowl(probe)) < 2.0 * deviation) > 0.8


def test_a_trend_is_that_of_the_covariance_formulas(noisy, process):
    """Rasmussen and Williams (2.25) and (2.26), without a factorisation."""
    at, value = noisy
    lengths, (size, noise) = np.exp(process.numbers[:2]), np.exp(process.numbers[2:])

    def k(a, b):
        return size**2 * (10.0 + np.exp(-0.5 * np.sum(((a[:, None] - b) / lengths) ** 2, axis=-1)))

    probe = np.array([[0.2, 0.2], [0.9, 0.4]])
    inverse = np.linalg.inv(k(at, at) + noise**2 * np.eye(40))
    mean = k(probe, at) @ inverse @ ((value - value.mean()) / value.std())
    variance = k(probe, probe).diagonal() - np.sum(k(probe, at) @ inverse * k(probe, at), axis=1)
    found = process.at(probe)
    np.testing.assert_allclose(found[0], value.mean() + value.std() * mean, rtol=1e-6)
    np.testing.assert_allclose(found[1], value.std() * np.sqrt(variance), rtol=1e-4)


def test_a_fit_is_that_of_its_seed_and_goes_on_from_an_earlier_one(noisy, process):
    np.testing.assert_array_equal(fit(noisy, seed=0).numbers, process.numbers)
    assert fit(noisy, 0, process, 30).loss <= process.loss
    start = fit(noisy, 0, process, 0)
    np.testing.assert_array_equal(start.numbers, process.numbers)


def test_values_that_are_all_alike_have_a_trend():
    at = np.random.default_rng(0).random((8, 3))
    mean, deviation = fit(Observations(at, np.full(8, 0.4))).at(at)
    np.testing.assert_allclose(mean, 0.4, atol=1e-12)
    assert np.all(np.isfinite(deviation))


def test_the_largest_improvement_is_expected_where_the_trend_is_low_or_unknown(process):
    place = np.array([[0.3, 0.7], [0.3, 0.1], [0.95, 0.05]])
    found = improvement(process, place, float(process.at(place[:1])[0][0]))
    assert np.all(found >= 0.0)
    assert found[0] == max(found), "half of the deviation where the trend is as low as the best"
    mean, deviation = process.at(place[:1])
    assert found[0] == pytest.approx(deviation[0] / np.sqrt(2.0 * np.pi))
    # Against the mean of many random values of the trend.
    values = mean + deviation * np.random.default_rng(0).standard_normal(400_000)
    best = float(mean[0]) + 0.5 * float(deviation[0])
    sampled = np.mean(np.maximum(best - values, 0.0))
    assert improvement(process, place[:1], best)[0] == pytest.approx(sampled, rel=5e-3)


def test_limits_are_kept_with_the_product_of_their_probabilities(process, noisy):
    shifted = fit(Observations(noisy.at, noisy.value - 0.2), 0)
    x = np.array([[0.3, 0.7], [0.9, 0.1]])
    one = probability_below_zero([shifted], x)
    assert one[0] > 0.99
    assert one[1] < 0.01
    np.testing.assert_allclose(probability_below_zero([shifted, shifted], x), one**2)
    np.testing.assert_array_equal(probability_below_zero([], x), [1.0, 1.0])


def test_proposals_lie_anywhere_and_around_the_best():
    best = np.array([[0.1, 0.9, 0.5]])
    x = proposals(np.random.default_rng(3), best)
    assert x.shape == (2000, 3)
    assert np.all((x >= 0.0) & (x <= 1.0))
    near = np.linalg.norm(x - best, axis=1) < 0.1
    assert near[1500:].mean() > 0.2 > near[:1500].mean()
