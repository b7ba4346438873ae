"""Intervals of means over clusters: against closed forms, and how often they cover the truth."""

import math

import numpy as np
import pytest
from scipy import stats

from tpd.answers.intervals import change, fall


def changed(values, clusters=None):
    """Interval of given differences."""
    return change(np.asarray(values), np.zeros(len(values)), clusters)


def test_a_change_of_shares_ends_at_one():
    few = changed([0.0, -1.0, 0.0, 0.0], np.array([0, 0, 1, 1]))
    assert (few.low, few.high) == (-1.0, 1.0)
    assert few.mean == pytest.approx(-0.25)


def test_intervals_are_those_of_clusters_and_student():
    one = np.array([-0.1, 0.0, 0.1])
    assert changed(one).high == pytest.approx(0.1 * stats.t.ppf(0.975, 2) / np.sqrt(3.0))
    rng = np.random.default_rng(3)
    covered, clusters = 0, np.repeat(np.arange(8), 6)
    for _ in range(400):
        values = 0.1 * (np.repeat(rng.standard_normal(8), 6) + rng.standard_normal(48))
        interval = changed(values, clusters)
        covered += interval.low <= 0.0 <= interval.high
    assert 0.92 < covered / 400 < 0.98


def test_of_a_single_cluster_nothing_is_known():
    for found in (changed(np.ones(3), np.zeros(3, int)), fall(np.ones(2), np.ones(2), np.zeros(2, int))):
        assert math.isinf(found.low)
        assert "(unknown)" in found.words()
    same = changed(np.full(4, -0.5), np.array([0, 0, 1, 1]))
    assert same.is_below
    assert not same.is_above


def test_a_fall_is_a_ratio_of_means_whose_interval_covers_the_truth():
    """Bare tilts about a mean of each of ten earthquakes, hung ones at 0.7 of these with a scatter."""
    rng, hits, clusters = np.random.default_rng(0), 0, np.repeat(np.arange(20), 3)
    for _ in range(300):
        bare = np.repeat(rng.uniform(0.2, 0.8, 20), 3) + rng.uniform(-0.1, 0.1, 60)
        hung = bare * (0.7 + np.repeat(rng.uniform(-0.3, 0.3, 20), 3))
        found = fall(hung, bare, clusters)
        assert found.mean == pytest.approx(1.0 - hung.mean() / bare.mean())
        hits += found.low <= 0.3 <= found.high
    assert 0.91 < hits / 300 < 0.99


def test_a_fall_from_next_to_nothing_is_counted_in_units_of_the_least_mean():
    found = fall(np.array([0.01, 0.03]), np.array([0.0, 0.01]), least=0.02)
    assert found.mean == pytest.approx((0.005 - 0.02) / 0.02)
    assert found.low < found.mean < found.high
    assert fall(np.zeros(3), np.zeros(3)).mean == 0.0
    assert math.isnan(fall(np.zeros(0), np.zeros(0)).mean)
