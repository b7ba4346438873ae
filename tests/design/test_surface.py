"""The response surface through noisy values."""

import numpy as np

from tpd.design.surface import Observations, fit


def test_a_surface_finds_a_trend_below_noise():
    rng = np.random.default_rng(1)
    at = rng.random((40, 2))

    def bowl(x):
        return np.sum((x - [0.3, 0.7]) ** 2, axis=1)

    noisy = bowl(at) + 0.02 * rng.standard_normal(40)
    probe = rng.random((200, 2))
    without = fit(Observations(at, noisy), seed=0)
    mean, deviation = without.at(probe)
    assert np.sqrt(np.mean((mean - bowl(probe)) ** 2)) < 0.02
    assert 0.01 < without.spread * np.exp(without.numbers[-1]) < 0.04
    assert np.mean(np.abs(mean - bowl(probe)) < 2.0 * deviation) > 0.8
