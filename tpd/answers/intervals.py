"""Means of paired runs with their intervals of 95 % confidence.

Runs of one cluster, such as an earthquake, are no independent observations: the variance is that between
clusters (a cluster-robust variance), and the quantile is Student's. Runs that are independent are clusters of
their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

_LEVEL = 0.95


@dataclass(frozen=True)
class Interval:
    """A mean with its interval of 95 % confidence."""

    mean: float
    low: float
    high: float

    def words(self, share: bool = True) -> str:
        """The mean and its interval, in per cent if it is a share."""
        form = "{:+.1%}" if share else "{:+.3f}"
        # Of a single earthquake nothing is known but the mean.
        if math.isinf(self.low):
            return f"{form.format(self.mean)} (unknown)"
        return f"{form.format(self.mean)} ({form.format(self.low)} to {form.format(self.high)})"

    @property
    def is_below(self) -> bool:
        """Whether the whole interval is below zero."""
        return self.high < 0.0

    @property
    def is_above(self) -> bool:
        """Whether the whole interval is above zero."""
        return self.low > 0.0


def change(hung: np.ndarray, bare: np.ndarray, clusters: np.ndarray | None = None) -> Interval:
    """Mean of what each run has with the pendulum less what it has without, numbers from 0 to 1. Of a single
    cluster nothing is known: the interval is infinite; and without any run the mean is NaN.

    Args:
        hung, bare: shape (runs,).
        clusters: a number for each run, the same for runs that are alike; default each run its own.
    """
    found = _mean(hung.astype(float) - bare, clusters)
    if math.isinf(found.low):
        return found
    # Shares and tilts over that of toppling lie between nought and one, so that changes end at one.
    return Interval(found.mean, max(-1.0, found.low), min(1.0, found.high))


def fall(
    hung: np.ndarray, bare: np.ndarray, clusters: np.ndarray | None = None, least: float = 0.0
) -> Interval:
    """Share by which the mean of runs falls, a ratio of means, with the interval of its linearisation; 0
    where both means are 0. A mean without the pendulum below `least` counts as that."""
    if not bare.size:
        return Interval(math.nan, math.nan, math.nan)
    size = max(float(bare.mean()), least) or 1.0
    ratio = float(bare.mean() - hung.mean()) / size
    # A mean that counts as another number does not vary.
    varies = ratio * bare if bare.mean() > least else np.full_like(bare, ratio * size)
    around = _mean((bare - hung - varies) / size, clusters)
    if math.isinf(around.low):
        return Interval(ratio, around.low, around.high)
    return Interval(ratio, ratio + around.low, min(1.0, ratio + around.high))


def _mean(values: np.ndarray, clusters: np.ndarray | None) -> Interval:
    """Mean of values, (runs,), with its interval."""
    n = len(values)
    each = np.arange(n) if clusters is None else np.unique(clusters, return_inverse=True)[1]
    groups, mean = int(each.max(initial=-1)) + 1, float(np.mean(values)) if n else math.nan
    # One cluster has no spread between clusters.
    if groups < 2:
        return Interval(mean, -math.inf, math.inf)
    # Within a cluster the deviations add up, and only their sums are independent.
    sums = np.bincount(each, values - mean)
    error = math.sqrt(groups / (groups - 1) * float(np.sum(sums**2))) / n
    width = float(stdtrit(groups - 1, 0.5 * (1.0 + _LEVEL))) * error
    return Interval(mean, mean - width, mean + width)
