"""Annual rates of overturning without and with a pendulum, from a seismic hazard and the outcomes of runs.

The levels of the runs lie in strata of the intensity. The annual rate is the sum, over the strata, of the
share of the runs that overturn, times the annual rate at which the intensity of an earthquake lies in the
stratum. No curve is fitted. Intensities above the last stratum count with the share of the last stratum, and
intensities below the first one do not count.

The intervals come from a paired bootstrap over earthquakes. Each resample draws as many earthquakes as there
are, with replacement, and the same earthquakes in both cases.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtrit

from tpd.answers.fragility import Fragility
from tpd.answers.run_table import Cases
from tpd.answers.statistics import LEVEL, Interval, added_up, quantile_of
from tpd.core import checks
from tpd.core.formatting import Printed, number, percent
from tpd.scene.ground_motion import LEAST_EARTHQUAKES
from tpd.scene.hazard import Hazard

RESAMPLES = 1000
"""Number of resamples of the bootstrap."""
_SEED = 11
"""Seed of the resamples, the same in all commands, so that they agree in every digit."""
_LARGE_SHARE = 0.1
"""Share of a rate from beyond the levels from which the text advises other levels."""


@dataclass(frozen=True, kw_only=True, repr=False)
class AnnualRates(Printed, Cases):
    """Annual rates of overturning without a pendulum and, if there is one, with it.

    A rate counts the runs with a result, and is NaN if a stratum has none. Its interval has the rates that
    the other runs allow. With fewer than 5 earthquakes all intervals are 0 to infinity.
    """

    hazard: Hazard
    """Hazard of the site."""
    edges: np.ndarray
    """Ends of the strata of the intensity in the unit of the hazard, shape (strata + 1,)."""
    shares: np.ndarray
    """Share of the runs that overturn, shape (cases, strata), without the pendulum first."""
    cases: tuple[Interval, ...]
    """Annual rate of each case, with its 95 % interval."""
    ratio: Interval | None
    """Rate with the pendulum divided by the rate without it, with its 95 % interval; None without a
    pendulum."""
    earthquakes: int
    """Number of earthquakes."""

    @property
    def years(self) -> tuple[float, ...]:
        """Mean number of years between two earthquakes that overturn the block, for each case."""
        return tuple(1.0 / rate.mean if rate.mean else math.inf for rate in self.cases)

    @property
    def in_50_years(self) -> tuple[float, ...]:
        """Probability of overturning in 50 years, for each case."""
        return tuple(-math.expm1(-50.0 * rate.mean) for rate in self.cases)

    @property
    def beyond(self) -> tuple[float, ...]:
        """Share of each rate from intensities above the last stratum; NaN for a rate of zero."""
        above = float(self.hazard.exceeding(self.edges[-1]))
        shares = zip(self.shares[:, -1], self.cases, strict=True)
        return tuple(float(x) * above / rate.mean if rate.mean else math.nan for x, rate in shares)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Sentences on the rates, their ratio, and what they depend on, without full stops."""
        names = (" without the pendulum", " with it") if self.ratio else ("",)
        out = [f"The block overturns {' and '.join(map(self._clause, range(len(names)), names))}"]
        if self.ratio is not None and not math.isnan(self.ratio.mean):
            times = f"{number(self.ratio.mean, 2)} times that without it"
            out.append(f"The rate with the pendulum is {times} ({_words(self.ratio)})")
        beyond, unit = [x for x in self.beyond if not math.isnan(x)], self.hazard.measure.unit
        first, last = (f"{number(x, 3)} {unit}" for x in self.edges[[0, -1]])
        advice = ": state higher levels" if max(beyond, default=0.0) >= _LARGE_SHARE else ""
        if beyond:
            shares = " and ".join(percent(x) for x in beyond)
            out.append(f"{shares} of the rate comes from intensities above the last level, {last}{advice}")
        low = float(self.hazard.exceeding(0.5 * self.edges[0]) - self.hazard.exceeding(self.edges[0]))
        least, *_ = self.shares[0]
        if least * low > _LARGE_SHARE * self.cases[0].mean:
            some = f"{percent(float(least))} of the runs near the first level, {first}, overturn"
            out.append(f"Intensities below the first level do not count, but {some}: state lower levels")
        return tuple(out)

    def _clause(self, i: int, name: str) -> str:
        """Return a clause with the rate of a case: its years, interval, and probability in 50 years."""
        rate = self.cases[i]
        # A high rate means few years, so the ends change places.
        ends = (1.0 / x if x else math.inf for x in (rate.high, rate.low))
        years = Interval(self.years[i], *ends)
        if math.isnan(rate.mean):
            return f"at an unknown annual rate{name}, because a level has no result (years: {_words(years)})"
        if rate.mean == 0.0:
            return f"in no run{name} (years: {_words(years)})"
        share = f"{percent(self.in_50_years[i], 1)} in 50 years"
        return f"once in {number(years.mean, 3)} years{name} ({_words(years)}, {share})"

    def __str__(self) -> str:
        return "\n".join(f"{sentence}." for sentence in self.sentences)


def _words(of: Interval) -> str:
    """Return the interval of a number in words."""
    if (of.low, of.high) == (0.0, math.inf):
        return "interval unknown"
    return f"95 % interval {number(of.low, 2)} to {number(of.high, 2)}"


def annual_rates(fragility: Fragility, hazard: Hazard) -> AnnualRates:
    """Compute once in how many years a block overturns, without a pendulum and with it.

    The stripes of the fragility are the levels. They divide the intensities at their geometric means. The
    intervals are expanded percentiles of a paired bootstrap over earthquakes (T. C. Hesterberg, Am. Stat. 69,
    2015).

    Args:
        fragility: result of `tpd.fragility`.
        hazard: hazard of the site, over the same quantity. The units may differ, and the intensities of the
            fragility may be relative to the block.

    Raises:
        ValueError: hazard and fragility have different quantities.

    Example:
        >>> import numpy as np, tpd
        >>> block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9595)
        >>> frequencies = 0.4, 0.5, 0.6, 0.9, 1.2, 1.6
        >>> motions = [tpd.Pulse.one_sine(frequency=f, acceleration=1.0) for f in frequencies]
        >>> curves = tpd.fragility(block, motions, scales=np.geomspace(1.0, 4.0, 16), nonlinear=False)
        >>> hazard = tpd.Hazard(levels=[0.1, 1.0], rates=[0.02, 6.3e-5])
        >>> round(tpd.annual_rates(curves, hazard).years[0])
        469
    """
    checks.instance("fragility", fragility, Fragility)
    checks.instance("hazard", hazard, Hazard)
    # The tilt of a run that overturns is infinite, whatever the damage states of the curves are.
    hits = np.where(np.isnan(fragility.tilts), np.nan, np.isinf(fragility.tilts))
    s = fragility.stripes * hazard.factor(fragility.measure)
    edges = np.concatenate([s[:1], np.sqrt(s[:-1] * s[1:]), s[-1:]])
    return rates_of_outcomes(hazard, edges, hits, fragility.quakes)


def rates_of_outcomes(hazard: Hazard, edges: np.ndarray, hits: np.ndarray, quakes: np.ndarray) -> AnnualRates:
    """Return annual rates from the outcomes of motions, without a pendulum and perhaps with it.

    Args:
        hazard: hazard of the site.
        edges: increasing ends of the strata in the unit of the hazard, shape (strata + 1,).
        hits: 1 where the block overturns, 0 where it does not, NaN if unknown; shape
            (cases, motions, strata).
        quakes: number of the earthquake of each motion, shape (motions,).
    """
    # Each stratum stands for the rate between its ends, and the last one also for all larger intensities.
    exceeding = hazard.exceeding(edges)
    weights = np.append(-np.diff(exceeding)[:-1], exceeding[-2])
    answered = np.isfinite(hits)
    with np.errstate(invalid="ignore"):
        shares = np.where(answered, hits, 0.0).sum(axis=1) / answered.sum(axis=1)
    # Lowest and highest annual rate of each motion, according to the runs without a result.
    of_motions = np.concatenate([np.nan_to_num(hits, nan=x) @ weights for x in (0.0, 1.0)])
    sums, sizes = added_up(of_motions.T, quakes), added_up(np.ones(len(quakes)), quakes)
    n, rng = len(sizes), np.random.default_rng(_SEED)
    # Both cases have the same earthquakes in a resample, so their common effects cancel in the ratio.
    draws = rng.multinomial(n, np.full(n, 1.0 / n), RESAMPLES if n >= LEAST_EARTHQUAKES else 0)
    low, high = np.split((draws @ sums / (draws @ sizes)[:, None]).T, 2)
    means = shares @ weights
    # A rate of zero has an infinite ratio, and two of them have none.
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (np.concatenate([a, a[1:] / b[:1]]) for a, b in ((low, high), (high, low)))
        means = np.append(means, means[1:] / means[:1])
    intervals = [_interval(*of, n) for of in zip(means, low, high, strict=True)]
    return AnnualRates(
        hazard=hazard,
        edges=edges,
        shares=shares,
        cases=tuple(intervals[: len(hits)]),
        ratio=intervals[-1] if len(hits) > 1 else None,
        earthquakes=n,
    )


def _interval(mean: float, low: np.ndarray, high: np.ndarray, earthquakes: int) -> Interval:
    """Return a value with the interval of the lowest and highest values of its resamples."""
    if not low.size:
        return Interval(float(mean), 0.0, math.inf)
    # Percentiles of a bootstrap are too narrow with few earthquakes. These have the width of Student's
    # interval.
    quantile = stdtrit(earthquakes - 1, 0.5 + 0.5 * LEVEL)
    tail = float(ndtr(-quantile * math.sqrt(earthquakes / (earthquakes - 1))))
    return Interval(float(mean), quantile_of(low, tail), quantile_of(high, 1.0 - tail))
