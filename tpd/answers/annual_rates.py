"""Annual rates of overturning without and with a pendulum, from a seismic hazard and fragility curves.

The intervals come from a paired bootstrap over earthquakes. Each resample draws as many earthquakes as there
are, with replacement, and fits the curves of both cases to the same earthquakes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtrit

from tpd.answers.fragility import Fragility, Lognormal, fit_lognormal
from tpd.answers.run_table import Cases
from tpd.answers.statistics import LEVEL, Interval, quantile_of
from tpd.core import checks
from tpd.core.formatting import Printed, number, percent
from tpd.scene.ground_motion import LEAST_EARTHQUAKES
from tpd.scene.hazard import MOST_DISPERSION, Hazard

RESAMPLES = 1000
"""Number of resamples of the bootstrap."""
_LEVEL_RATIO = 2.0
"""Ratio of a simulated level to the last level of the hazard from which the text mentions the level."""
_LARGE_SHARE = 0.1
"""Extrapolated share of a rate from which the text mentions it."""


@dataclass(frozen=True, kw_only=True, repr=False)
class AnnualRates(Printed, Cases):
    """Annual rates of overturning without a pendulum and, if there is one, with it.

    A rate or a ratio has the mean NaN if the outcomes determine no curve. Its interval has the rates that the
    outcomes allow. With fewer than 5 earthquakes all intervals are 0 to infinity.
    """

    hazard: Hazard
    """Hazard of the site."""
    stripes: np.ndarray
    """Intensity levels of the runs in the unit of the hazard, shape (stripes,)."""
    fits: tuple[Lognormal, ...]
    """Fragility curve of each case, without the pendulum first."""
    cases: tuple[Interval, ...]
    """Annual rate of each case, with its 95 % interval."""
    ratio: Interval | None
    """Rate with the pendulum divided by the rate without it, with its 95 % interval; None without a
    pendulum."""
    earthquakes: int
    """Number of earthquakes."""
    without_fit: int
    """Number of resamples in which the outcomes of a case determine no curve. They count with the lowest and
    the highest rate that the outcomes allow."""
    seed: int
    """Seed of the resamples."""

    @property
    def years(self) -> tuple[float, ...]:
        """Mean number of years between two earthquakes that overturn the block, for each case."""
        return tuple(1.0 / rate.mean for rate in self.cases)

    @property
    def in_50_years(self) -> tuple[float, ...]:
        """Probability of overturning in 50 years, for each case."""
        return tuple(-math.expm1(-50.0 * rate.mean) for rate in self.cases)

    @property
    def extrapolated(self) -> tuple[float, ...]:
        """Share of each rate from intensities beyond the stripes, where the curve is extrapolated, or beyond
        the levels of the hazard; NaN without a curve."""
        levels = self.hazard.levels
        low = max(self.stripes[0], levels[0])
        # The intensities at which both the curve and the hazard are known; none if they do not overlap.
        s = np.geomspace(low, max(low, min(self.stripes[-1], levels[-1])), 1000)
        inside = (-np.trapezoid(fit.probability(s), self.hazard.exceeding(s)) for fit in self.fits)
        return tuple(1.0 - float(x) / rate.mean for x, rate in zip(inside, self.cases, strict=True))

    @property
    def sentences(self) -> tuple[str, ...]:
        """Sentences on the rates, their ratio, and what they depend on, without full stops."""
        names = (" without the pendulum", " with it") if self.ratio else ("",)
        out = [f"The block overturns {' and '.join(map(self._clause, range(len(names)), names))}"]
        if self.ratio is not None and not math.isnan(self.ratio.mean):
            times = f"{number(self.ratio.mean, 2)} times that without it"
            out.append(f"The rate with the pendulum is {times} ({_words(self.ratio)})")
        if self.earthquakes >= LEAST_EARTHQUAKES:
            kind = f"{RESAMPLES} resamples of {self.earthquakes} earthquakes, seed {self.seed}"
            none = f"; {self.without_fit} of them determine no curve" if self.without_fit else ""
            out.append(f"The intervals are those of a {'paired ' * bool(self.ratio)}bootstrap ({kind}{none})")
        (quantity, _, unit), last = self.hazard.measure, self.hazard.levels[-1]
        if shares := [percent(x) for x in self.extrapolated if x >= _LARGE_SHARE]:
            where = f"a {quantity} beyond the levels of the runs or of the hazard"
            out.append(f"{' and '.join(shares)} of the rate is extrapolated: it comes from {where}")
        # A curve that is known only far above the hazard says little on the intensities that occur.
        if far := [number(x, 3) for x in self.stripes if x > _LEVEL_RATIO * last]:
            most = f"the last level of the hazard, {number(last, 3)} {unit}"
            out.append(f"Levels of the runs far above {most}: {', '.join(far)} {unit}")
        return tuple(out)

    def _clause(self, i: int, name: str) -> str:
        """Return a clause with the rate of a case: its years, interval, and probability in 50 years."""
        rate = self.cases[i]
        # A high rate means few years, so the ends change places.
        years = Interval(self.years[i], 1.0 / rate.high, 1.0 / rate.low if rate.low else math.inf)
        if math.isnan(rate.mean):
            why = f"dispersion of the curve: {self.fits[i].words[1]}"
            allowed = _words(years, "years that the outcomes allow:")
            return f"at an unknown annual rate{name} ({allowed}; {why})"
        share = f"{percent(self.in_50_years[i], 1)} in 50 years"
        return f"once in {number(years.mean, 3)} years{name} ({_words(years)}, {share})"

    def __str__(self) -> str:
        return "\n".join(f"{sentence}." for sentence in self.sentences)


def _words(of: Interval, begin: str = "95 % interval") -> str:
    """Return the interval of a number in words."""
    if (of.low, of.high) == (0.0, math.inf):
        return "interval unknown"
    return f"{begin} {number(of.low, 2)} to {number(of.high, 2)}"


def annual_rates(fragility: Fragility, hazard: Hazard, *, seed: checks.Whole = 0) -> AnnualRates:
    """Compute once in how many years a block overturns, without a pendulum and with it.

    The fragility curve of overturning is combined with the hazard, see `Hazard.annual_rate`. The intervals
    are expanded percentiles of a paired bootstrap over earthquakes (T. C. Hesterberg, Am. Stat. 69, 2015).

    Args:
        fragility: result of `tpd.fragility`.
        hazard: hazard of the site, over the same quantity. The units may differ, and the intensities of the
            fragility may be relative to the block.
        seed: seed of the bootstrap.

    Raises:
        ValueError: hazard and fragility have different quantities.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9595)
        >>> frequencies = 0.4, 0.5, 0.6, 0.9, 1.2, 1.6
        >>> motions = [tpd.Pulse.one_sine(frequency=f, acceleration=1.0) for f in frequencies]
        >>> curves = tpd.fragility(block, motions, scales=[1.2, 1.5, 2.0, 3.0, 4.0], nonlinear=False)
        >>> hazard = tpd.Hazard(levels=[0.1, 1.0], rates=[0.02, 6.3e-5])
        >>> round(tpd.annual_rates(curves, hazard).years[0])
        184
    """
    checks.instance("fragility", fragility, Fragility)
    checks.instance("hazard", hazard, Hazard)
    # The tilt of a run that overturns is infinite, whatever the damage states of the curves are.
    hits = np.where(np.isnan(fragility.tilts), np.nan, np.isinf(fragility.tilts))
    stripes = fragility.stripes * hazard.factor(fragility.measure)
    return rates_of_outcomes(hazard, stripes, hits, fragility.quakes, checks.seed("seed", seed))


def rates_of_outcomes(
    hazard: Hazard, stripes: np.ndarray, hits: np.ndarray, quakes: np.ndarray, seed: int
) -> AnnualRates:
    """Return annual rates from the outcomes of motions, without a pendulum and perhaps with it.

    Args:
        hazard: hazard of the site.
        stripes: increasing intensities in the unit of the hazard, shape (stripes,).
        hits: 1 where the block overturns, 0 where it does not, NaN if unknown; shape
            (cases, motions, stripes).
        quakes: number of the earthquake of each motion, shape (motions,).
        seed: seed of the bootstrap.
    """
    members = [np.flatnonzero(quakes == quake) for quake in np.unique(quakes)]
    n, rng = len(members), np.random.default_rng([seed, 11])
    draws = [rng.integers(n, size=n) for _ in range(RESAMPLES if n >= LEAST_EARTHQUAKES else 0)]
    # The first row has the motions themselves, the others those of the resamples.
    rows = [np.arange(len(quakes)), *(np.concatenate([members[i] for i in draw]) for draw in draws)]
    # Both cases have the same earthquakes in a resample, so their common effects cancel in the ratio.
    fits = [[fit_lognormal(stripes, hit[of]) for hit in hits] for of in rows]
    # Lowest and highest rates, and their ratios, each with a row for each resample.
    low, high = np.array([[_allowed(hazard, fit) for fit in row] for row in fits]).T
    # The two ends differ if the outcomes of a resample determine no curve.
    is_open = np.any(low != high, axis=0)
    # A lowest rate of zero has an infinite ratio.
    with np.errstate(divide="ignore"):
        low, high = (np.concatenate([a, a[1:] / b[:1]]) for a, b in ((low, high), (high, low)))
    intervals = [_interval(a, b, n) for a, b in zip(low, high, strict=True)]
    return AnnualRates(
        hazard=hazard,
        stripes=stripes,
        fits=tuple(fits[0]),
        cases=tuple(intervals[: len(hits)]),
        ratio=intervals[-1] if len(hits) > 1 else None,
        earthquakes=n,
        without_fit=int(is_open[1:].sum()),
        seed=seed,
    )


def _allowed(hazard: Hazard, fit: Lognormal) -> tuple[float, float]:
    """Return the lowest and the highest annual rate that a curve allows; equal if it has a dispersion."""
    if fit.seen is None:
        is_narrow = fit.median > 0.0 and fit.dispersion <= MOST_DISPERSION
        rate = float(hazard.annual_rate(fit.median, fit.dispersion)) if is_narrow else math.nan
        return (rate, rate) if 0.0 < rate < math.inf else (0.0, math.inf)
    # The probability grows with the intensity: it is 0 up to the last stripe at which no motion overturns the
    # block, and 1 from the first stripe on at which all do.
    stripes, counts, total = fit.seen
    low, high = (stripes[counts == x] for x in (total, 0.0))
    least = hazard.exceeding(low[0]) if low.size else 0.0
    return least, hazard.exceeding(high[-1]) if high.size else math.inf


def _interval(low: np.ndarray, high: np.ndarray, earthquakes: int) -> Interval:
    """Return the value of the first row, and the interval of the other rows, which are resamples."""
    mean = float(low[0]) if low[0] == high[0] else math.nan
    if not low[1:].size:
        return Interval(mean, 0.0, math.inf)
    # Percentiles of a bootstrap are too narrow with few earthquakes. These have the width of Student's
    # interval.
    quantile = stdtrit(earthquakes - 1, 0.5 + 0.5 * LEVEL)
    tail = float(ndtr(-quantile * math.sqrt(earthquakes / (earthquakes - 1))))
    return Interval(mean, quantile_of(low[1:], tail), quantile_of(high[1:], 1.0 - tail))
