"""Fragility: the share of ground motions of each intensity under which a block reaches a damage state.

Every motion is scaled to every intensity level (stripe). The fragility curve is the lognormal distribution
with the largest likelihood of the counts at all stripes: a probit regression on the logarithm of the
intensity (J. W. Baker, Earthquake Spectra 31, 2015). The cases with and without the pendulum have the same
motions. At each stripe McNemar's exact test compares them on the motions whose outcome differs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import betaincinv, erfcx, ndtr, ndtri, stdtrit

from tpd.answers.run_table import CASE_KEYS, Cases, Progress, cases_of, follow_scaled
from tpd.answers.statistics import LEVEL, ROUNDING, SIGNIFICANT, added_up, mcnemar
from tpd.answers.transient import FREE
from tpd.core import checks
from tpd.core.formatting import Printed, aligned, pair_of
from tpd.records.intensity import intensity_of, measure_of
from tpd.scene.ground_motion import (
    LEAST_EARTHQUAKES,
    STANDARD_GRAVITY,
    GroundMotion,
    earthquakes_of,
    refuse_zeros,
)
from tpd.scene.hazard import Measure
from tpd.scene.scene import Block, Pendulum
from tpd.theory.equations import Terms

STATES: Mapping[str, float] = {"rocking": 0.0, "half": 0.5, "overturned": math.inf}
"""Default damage states: the tilt divided by the slenderness that a motion must exceed. 0 is any uplift, and
infinity is overturning."""


_LABELS = ("without pendulum", "with pendulum")
"""Names of the cases in text."""
_CONVERGED = 1e-8
"""Largest derivative of the likelihood, per outcome, at its maximum. About 1e-13 is usual."""


@dataclass(frozen=True)
class Curve:
    """Fragility curve of one damage state, with or without the pendulum."""

    state: str
    """Name of the damage state."""
    shares: np.ndarray
    """Share of the motions with a result that reach the state, shape (stripes,); NaN if no motion has one."""
    counts: np.ndarray
    """Number of motions that reach the state, shape (stripes,)."""
    total: np.ndarray
    """Number of motions with an answer, shape (stripes,)."""
    undecided: np.ndarray
    """Number of motions without a result, shape (stripes,). Neither `shares` nor `fit` counts them."""
    fit: Lognormal
    """Lognormal distribution with its uncertainty."""
    medians: tuple[float, float]
    """Medians of the two extreme fits: all motions without a result reach the state, and none does."""

    @property
    def words(self) -> tuple[str, str]:
        """Median with its interval, and dispersion, as text."""
        median, dispersion = self.fit.words
        if not self.undecided.any():
            return median, dispersion
        # The median is lower if all motions without a result reach the state.
        low, high = (median_words(x) for x in self.medians)
        return f"{median}, {low} to {high} depending on the motions without a result", dispersion

    def __str__(self) -> str:
        return "median {}, dispersion {}".format(*self.words)


@dataclass(frozen=True, repr=False)
class Fragility(Printed, Cases):
    """Fragility of a block under a set of ground motions, without a pendulum and, if there is one, with it.

    Where a field has an entry for each case, the case without the pendulum comes first.

    Attributes:
        intensity: name of the intensity measure.
        stripes: intensity levels, shape (stripes,).
        unit: unit of the intensity.
        motions: names of the ground motions.
        earthquakes: number of earthquakes to which the motions belong.
        cases: fragility curves by damage state, for each case.
        p_values: p-values of the difference between the cases, by damage state, shape (stripes,).
        p_medians: p-value of the difference between the medians of the cases, by damage state.
        tilts: largest tilt divided by the slenderness, shape (cases, motions, stripes).
        quakes: number of the earthquake of each motion.
        measure: quantity of the stripes, with one of them in SI units.
        first_crossings: median of the lowest stripe that reaches a state, by damage state.
        changed: share of the outcomes that the nonlinear model changes, for each case.
        unanswered: number of runs without a result with the nonlinear model, for each case.
    """

    intensity: str
    """Name of the intensity measure."""
    stripes: np.ndarray
    """Intensity levels, shape (stripes,)."""
    unit: str
    """Unit of the intensity."""
    motions: tuple[str, ...]
    """Names of the ground motions."""
    earthquakes: int
    """Number of earthquakes to which the motions belong. Motions of one earthquake are not independent."""
    cases: tuple[dict[str, Curve], ...]
    """Fragility curves by damage state, for each case."""
    p_values: dict[str, np.ndarray] | None
    """p-values by damage state, shape (stripes,): two-sided probability of a difference at least this large
    if the pendulum had no effect (McNemar's exact test over earthquakes). If motions have no result, the
    value is the largest that their outcomes allow. None without a pendulum."""
    tilts: np.ndarray
    """Largest tilt divided by the slenderness, shape (cases, motions, stripes). Infinite if the block
    overturns, NaN without a result."""
    quakes: np.ndarray
    """Number of the earthquake of each motion, shape (motions,)."""
    measure: Measure
    """Quantity of the stripes, with a stripe of 1 in SI units."""
    first_crossings: dict[str, tuple[float, ...]]
    """Median of the lowest stripe that reaches a state, by damage state and for each case. Infinite if fewer
    than half of the motions reach it. The value depends on the stripes, and is below the median of the curve
    if a larger motion may have a smaller effect. NaN if it depends on motions without a result."""
    changed: tuple[float, ...] | None
    """Share of the runs for which the nonlinear model changes the outcome overturned or not, among the
    runs with a result in both models; NaN if there are none. None if the nonlinear model was not used."""
    unanswered: tuple[int, ...] | None = None
    """Number of runs without a result with the nonlinear model, for each case."""
    p_medians: dict[str, float] | None = None
    """p-value of the difference of the medians by damage state: the exact two-sided sign test over
    earthquakes, in each of which one case reaches the state in more runs. None without a pendulum."""

    def columns(self) -> dict[str, Any]:
        """Columns of a table with a row for each case, damage state and stripe.

        They have the numbers of motions with and without a result, and the probability on the fitted curve.
        """
        curves = [curve for case in self.cases for curve in case.values()]
        # The rows are in the order of cases, states and stripes.
        n = len(self.stripes)
        names = np.repeat(CASE_KEYS[: len(self.cases)], len(self.without_pendulum) * n)
        rows = {"case": names, "stripe": np.tile(self.stripes, len(curves))}
        rows["state"] = np.repeat([c.state for c in curves], n)
        for name in ("counts", "total", "undecided", "shares"):
            rows[name] = np.concatenate([getattr(c, name) for c in curves])
        return {**rows, "fit": np.concatenate([c.fit.probability(self.stripes) for c in curves])}

    def __str__(self) -> str:
        quakes = "one earthquake" if self.earthquakes == 1 else f"{self.earthquakes} earthquakes"
        lines = [f"fragility over {self.intensity} ({self.unit}), {len(self.motions)} motions of {quakes}"]
        is_few = self.earthquakes < LEAST_EARTHQUAKES
        # A curve through so few earthquakes would rank the cases by chance.
        rows = [("  state", "case", *(("runs in this state",) if is_few else ("median", "dispersion")))]
        for name in self.without_pendulum:
            for label, case in zip(_LABELS, self.cases, strict=False):
                counted = f"{int(case[name].counts.sum())} of {int(case[name].total.sum())}"
                rows.append((f"  {name}", label, *((counted,) if is_few else case[name].words)))
        lines += aligned(rows)
        runs = len(self.motions) * len(self.stripes)
        # The outcomes without a result are the same for all states, so one curve of each case suffices.
        if text := _listed([int(next(iter(c.values())).undecided.sum()) for c in self.cases], runs):
            lines.append(f"  without a result, and not counted: {text}")
        if self.changed is not None and self.unanswered is not None:
            shares = " and ".join(f"{100.0 * x:.1f} %" for x in self.changed)
            lines.append(f"  the nonlinear model changes the outcome of {shares} of the runs")
            if text := _listed(self.unanswered, runs):
                lines.append(f"  without a result with these equations, and not compared: {text}")
        return "\n".join([*lines, self.conclusion])

    @property
    def conclusion(self) -> str:
        """Sentence on the medians of the last damage state, and whether they differ significantly."""
        if self.earthquakes < LEAST_EARTHQUAKES:
            few = f"With fewer than {LEAST_EARTHQUAKES} earthquakes"
            return f"{few} these counts do not predict other earthquakes."
        state = list(self.without_pendulum)[-1]
        first, last = (self.cases[i][state].fit.median for i in (0, -1))
        if self.p_medians is None:
            return f"The median of the state {state} is {median_words(first)}."
        # An infinite median is one above all stripes, and has no number.
        two = " {} and {}".format(*pair_of(first, last)) if math.isfinite(first + last) else ""
        differ = "differ" if self.p_medians[state] < SIGNIFICANT else "do not differ"
        return f"The medians{two} ({state}) {differ} significantly (p = {self.p_medians[state]:.2g})."


def _listed(counts: Sequence[int], runs: int) -> str:
    """Return the numbers of runs of each case as text; empty if all are zero."""
    if not any(counts):
        return ""
    cases = zip(counts, _LABELS, strict=False)
    return ", ".join(f"{n} of {runs} runs {case}" for n, case in cases)


def fragility(
    block: Block,
    motions: Sequence[GroundMotion],
    *,
    scales: checks.Vector,
    pendulum: Pendulum | None = None,
    intensity: str = "pga_star",
    period: checks.Real | None = None,
    states: Mapping[str, float] = STATES,
    nonlinear: bool = True,
    gravity: checks.Real = STANDARD_GRAVITY,
    free: checks.Real = FREE,
    workers: checks.Whole | None = None,
    progress: Progress | None = None,
) -> Fragility:
    """Compute the fragility of a block under a set of motions, without a pendulum and with it.

    Args:
        block: block with its friction and restitution.
        motions: pulses or records. Their own sizes matter only for `intensity="scale"`.
        scales: intensity levels (stripes), increasing.
        pendulum: pendulum that is compared with the block without one, under the same motions.
        intensity: name of the intensity measure. "pga_star" is PGA/(g tan alpha), "pgv_star" is
            p PGV/(g tan alpha), where p is the rate omega0 of the block; "pga" is in g and "pgv" in m/s;
            "sa" is the spectral acceleration in g at `period` (s) with 5 % damping; "scale" is the factor on
            each motion as it is.
        period: period of the spectral acceleration, s.
        states: damage states by name: the tilt divided by the slenderness that a motion must exceed.
        nonlinear: whether the nonlinear model also follows all motions, to count the changed outcomes.
        gravity: acceleration of gravity, m/s^2.
        free: duration of the free motion after each ground motion, s.
        workers: number of threads; all cores by default.
        progress: function that is called with (number of finished motions, number of all motions).

    Raises:
        ValueError: bad input.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9595)
        >>> motions = [tpd.Pulse.one_sine(frequency=f, acceleration=1.0) for f in (0.6, 0.7, 0.8)]
        >>> curves = tpd.fragility(block, motions, scales=[1.0, 2.0, 3.0], nonlinear=False)
        >>> curves.without_pendulum["overturned"].counts
        array([0, 3, 3])
    """
    checks.instance("block", block, Block)
    checks.optional("pendulum", pendulum, Pendulum)
    checks.function("progress", progress)
    stripes = checks.positive("scales", checks.increasing("scales", scales, 1), every=True)
    checks.instance("states", states, Mapping)
    states = {n: checks.plain("states", x, single=True) for n, x in states.items()}
    named = all(isinstance(n, str) and isinstance(x, float) and x >= 0.0 for n, x in states.items())
    if not (states and named):
        raise ValueError(f"`states` must name tilts over the slenderness from 0 on, but are {dict(states)}")
    checks.flag("nonlinear", nonlinear)
    checks.instance("motions", motions, Sequence)
    measure = intensity_of(intensity, block, gravity, period)
    checks.plausible("the largest of `scales`", stripes, intensity)
    for i, motion in enumerate(motions):
        checks.instance(f"motions[{i}]", motion, GroundMotion)
    refuse_zeros(motions)
    names = tuple(getattr(m, "name", "") or f"motion {i + 1}" for i, m in enumerate(motions))
    # Every intensity measure is proportional to the motion.
    # The factor that scales a motion to a stripe is therefore a quotient.
    factors = stripes / np.array([[measure.value(m)] for m in motions])
    cases, times = cases_of(pendulum), 2 if nonlinear else 1
    # The tables need neither the swing nor the final state, so the runs can end early.
    options: dict[str, Any] = {"gravity": gravity, "free": free, "brief": True, "workers": workers}

    # The nonlinear runs follow the exact ones, so progress continues from one to the other.
    def shifted(n: int, report: Progress | None = progress) -> Progress | None:
        return None if report is None else lambda done, all_: report(n * all_ + done, times * all_)

    exact = follow_scaled(block, cases, motions, factors, progress=shifted(0), **options)
    nu, quakes = float(block.slenderness), earthquakes_of(motions)
    # 1 where a run reaches a damage state, 0 where it does not, NaN without a result.
    reached = {n: exact.is_overturned if math.isinf(x) else exact.tilt > x * nu for n, x in states.items()}
    hits = {n: np.where(exact.is_unanswered, np.nan, hit) for n, hit in reached.items()}
    # The runs have the axes cases, motions and stripes.
    curves = tuple(
        {name: _curve(name, hit[i], quakes, stripes) for name, hit in hits.items()} for i in range(len(cases))
    )
    changed, unanswered = None, None
    if nonlinear:
        nonlinear_runs = follow_scaled(
            block, cases, motions, factors, progress=shifted(1), equations=Terms.nonlinear, **options
        )
        # Only runs that both equations answer can be compared.
        unknown = exact.is_unanswered | nonlinear_runs.is_unanswered
        differs = np.where(unknown, np.nan, exact.is_overturned ^ nonlinear_runs.is_overturned)
        answered = [x[np.isfinite(x)] for x in differs]
        changed = tuple(float(np.mean(x)) if len(x) else math.nan for x in answered)
        unanswered = tuple(int(x.sum()) for x in nonlinear_runs.is_unanswered)
    # Motions of one earthquake are dependent, so the test counts earthquakes.
    p_values, p_medians = None, None
    if pendulum is not None:
        p_values = {name: mcnemar(hit[0], hit[1], quakes) for name, hit in hits.items()}
        # All stripes together: an earthquake has the smaller capacity in the case in which more of its runs
        # reach the state.
        each = np.repeat(quakes, len(stripes))
        runs = {n: hit.reshape(2, -1, 1) for n, hit in hits.items()}
        p_medians = {n: float(mcnemar(one, other, each)[0]) for n, (one, other) in runs.items()}
    crossings = {name: tuple(_first_crossing(h, stripes) for h in hit) for name, hit in hits.items()}
    return Fragility(
        intensity=measure.name,
        stripes=stripes,
        unit=measure.unit,
        motions=names,
        earthquakes=len(np.unique(quakes)),
        cases=curves,
        p_values=p_values,
        p_medians=p_medians,
        tilts=exact.tilt / nu,
        quakes=quakes,
        measure=measure_of(intensity, block, gravity, period),
        first_crossings=crossings,
        changed=changed,
        unanswered=unanswered,
    )


def _curve(name: str, hit: np.ndarray, quakes: np.ndarray, stripes: np.ndarray) -> Curve:
    counts, total = np.nansum(hit, axis=0).astype(int), np.sum(np.isfinite(hit), axis=0)
    shares = np.where(total > 0, counts / np.maximum(total, 1), np.nan)
    fit, undecided = fit_lognormal(stripes, hit, quakes), len(hit) - total
    # The two extreme outcomes of the motions without a result: all reach the state, and none does.
    ends = [fit_lognormal(stripes, np.nan_to_num(hit, nan=x)).median for x in (1.0, 0.0)]
    return Curve(name, shares, counts, total, undecided, fit, (ends[0], ends[1]))


def _first_crossing(hit: np.ndarray, stripes: np.ndarray) -> float:
    """Return the median of the lowest stripe at which each motion reaches a state.

    NaN if the median depends on motions without a result.
    """
    # The two extremes: no unknown outcome reaches the state, and all do.
    medians = []
    for unknown in (0.0, 1.0):
        reaches = np.nan_to_num(hit, nan=unknown) == 1.0
        lowest = np.where(reaches.any(axis=1), stripes[np.argmax(reaches, axis=1)], np.inf)
        medians.append(float(np.median(lowest)))
    return medians[0] if medians[0] == medians[1] else math.nan


@dataclass(frozen=True)
class Lognormal:
    """Fragility curve: the probability of a damage state at the intensity x is Phi(ln(x/median)/dispersion).

    The likelihood has a finite maximum exactly if the outcomes overlap: some motion reaches the state at an
    intensity below one at which some motion does not reach it, and the other way round (M. J. Silvapulle, J.
    R. Statist. Soc. B 43, 1981). If the outcomes are separated, the only information is that of the stripes,
    and that the probability increases with the intensity.
    """

    median: float
    """Median of the distribution. If the outcomes are separated, it is the geometric mean of the two stripes
    between which the share passes a half: 0 if the share is above a half at all stripes, infinite if it is
    below at all stripes. NaN if the share does not increase with the intensity, or if no outcome is known."""
    dispersion: float
    """Standard deviation of the logarithm; NaN if unknown."""
    covariance: np.ndarray
    """Covariance of intercept and slope of the probit in ln x, shape (2, 2). It is the sandwich estimate over
    earthquakes: all motions of one earthquake at all stripes count as one observation. NaN if it is unknown:
    for separated outcomes, fewer than three earthquakes, and earthquakes that are all alike."""
    separated: bool
    """Whether the likelihood has no finite maximum, because no motion reaches the state at an intensity below
    one at which some motion does not. The dispersion is then too small to resolve with these stripes."""
    freedom: float = math.nan
    """Degrees of freedom of Student's distribution: number of earthquakes minus the two coefficients."""
    seen: np.ndarray | None = None
    """Data of the stripes, shape (3, stripes); None unless the outcomes are separated. The rows are the
    intensities, the number of earthquakes that reach the state (the share of the motions times all
    earthquakes), and the number of earthquakes with a known outcome."""

    @property
    def words(self) -> tuple[str, str]:
        """Median with its interval, and dispersion, as text."""
        if math.isnan(self.median):
            nothing = self.seen is not None and not self.seen.size
            why = "no outcome is known" if nothing else "the share does not grow with the intensity"
            return "unknown", why
        where = median_words(self.median)
        if 0.0 < self.median < math.inf:
            where += " ({:.4g} to {:.4g})".format(*self.interval())
        if self.seen is None:
            return where, f"{self.dispersion:.3g}"
        stripes, counts, n = self.seen
        # If all outcomes are equal, the median contains all information.
        if not 0.0 < counts.sum() < n.sum():
            return where, "unknown"
        several = "too small to resolve with these stripes"
        return where, several if len(stripes) > 1 else "unknown with one stripe"

    def __str__(self) -> str:
        return "median {}, dispersion {}".format(*self.words)

    def probability(self, x: np.ndarray) -> np.ndarray:
        """Return the probability of the state at intensities x > 0.

        If the outcomes are separated, it is the share of the two stripes around x if they agree, otherwise
        NaN.
        """
        if self.seen is None:
            return ndtr(np.log(np.asarray(x, dtype=float) / self.median) / self.dispersion)
        share = self.seen[1] / self.seen[2]
        low, high = self._around(share, share, x)
        return np.where(low == high, low, np.nan)

    def band(self, x: np.ndarray, level: float = LEVEL) -> tuple[np.ndarray, np.ndarray]:
        """Return the pointwise confidence band of the probability at intensities x > 0, by the delta method.

        If the outcomes are separated, the band has the exact binomial limits of the stripes around x (C. J.
        Clopper and E. S. Pearson, Biometrika 26, 1934), since the probability increases with x. If nothing is
        known, the band is 0 to 1.
        """
        x = np.asarray(x, dtype=float)
        if self.seen is not None:
            return self._around(*self._limits(level), x)
        if not np.isfinite(self.covariance).all():
            return np.zeros_like(x), np.ones_like(x)
        middle = np.log(x / self.median) / self.dispersion
        width = self._width(np.stack([np.ones_like(x), np.log(x)], axis=-1), level)
        return ndtr(middle - width), ndtr(middle + width)

    def interval(self, level: float = LEVEL) -> tuple[float, float]:
        """Return the confidence interval of the median, by the delta method.

        If the outcomes are separated, it contains the intensities at which the band contains a half. If
        nothing is known, it is 0 to infinity.
        """
        if self.seen is not None:
            low, high = self._limits(level)
            below, above = self.seen[0][high < 0.5], self.seen[0][low > 0.5]
            return float(below.max(initial=0.0)), float(above.min(initial=math.inf))
        if not np.isfinite(self.covariance).all():
            return 0.0, math.inf
        width = float(self._width(-self.dispersion * np.array([1.0, math.log(self.median)]), level))
        return self.median * _exp(-width), self.median * _exp(width)

    def _width(self, direction: np.ndarray, level: float) -> Any:
        """Return the half widths of the intervals of linear forms of both coefficients, shape (..., 2)."""
        variance = np.einsum("...i,ij,...j->...", direction, self.covariance, direction)
        return stdtrit(self.freedom, 0.5 + 0.5 * level) * np.sqrt(np.maximum(variance, 0.0))

    def _limits(self, level: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the exact binomial limits of the probability at the stripes."""
        assert self.seen is not None
        quantile, (_, counts, n) = 0.5 * (1.0 + level), self.seen
        # The lower limit follows from the upper limit of the complement. If every outcome is a hit, the
        # function returns NaN, and the limit is 1.
        limits = [np.nan_to_num(betaincinv(k + 1.0, n - k, quantile), nan=1.0) for k in (n - counts, counts)]
        return 1.0 - limits[0], limits[1]

    def _around(self, low: np.ndarray, high: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the lower limit of all stripes up to x, and the upper limit of all stripes from x on."""
        assert self.seen is not None
        least = np.maximum.accumulate(np.concatenate([[0.0], low]))
        most = np.minimum.accumulate(np.concatenate([high, [1.0]])[::-1])[::-1]
        at = [np.searchsorted(self.seen[0], x, side=side) for side in ("right", "left")]
        return least[at[0]], most[at[1]]


def median_words(median: float) -> str:
    """Return the median of a `Lognormal` as text."""
    if math.isnan(median):
        return "unknown"
    return {0.0: "below the stripes", math.inf: "above the stripes"}.get(median, f"{median:.4g}")


def fit_lognormal(stripes: np.ndarray, hits: np.ndarray, earthquakes: np.ndarray | None = None) -> Lognormal:
    """Fit a lognormal distribution to the outcomes of motions at stripes (probit regression).

    Args:
        stripes: increasing intensities, shape (stripes,).
        hits: 1 where a motion reaches the state, 0 where it does not, NaN if unknown; shape
            (motions, stripes).
        earthquakes: number of the earthquake of each motion, shape (motions,); by default each motion has its
            own earthquake.

    Raises:
        RuntimeError: the maximum is not reached (never observed).
    """
    answered = np.isfinite(hits)
    n, counts = answered.sum(axis=0), np.where(answered, hits, 0.0).sum(axis=0)
    some, unknown = n > 0, np.full((2, 2), math.nan)
    x, counts, n = np.log(stripes[some]), counts[some], n[some].astype(float)
    # The outcomes are separated if no intensity without the state is above one with it.
    if x[counts < n].max(initial=-math.inf) <= x[counts > 0.0].min(initial=math.inf):
        independent = (added_up(answered, earthquakes) > 0).sum(axis=0)[some]
        seen = np.stack([stripes[some], counts / n * independent, independent])
        # The last stripe with a share up to a half, and the first with a share from a half on. They are the
        # same stripe if its share is exactly a half.
        below = seen[0][2.0 * seen[1] <= seen[2]].max(initial=0.0)
        above = seen[0][2.0 * seen[1] >= seen[2]].min(initial=math.inf)
        return Lognormal(math.sqrt(below * above) if x.size else math.nan, math.nan, unknown, True, seen=seen)
    middle = float(np.average(x, weights=n))
    scale = math.sqrt(float(np.average((x - middle) ** 2, weights=n)))
    # The slope of the maximum has the sign of the derivative of the likelihood at the slope zero.
    if not counts @ (x - middle) > ROUNDING * (counts @ np.abs(x - middle)):
        return Lognormal(math.nan, math.nan, unknown, False)
    beta = _most_likely((x - middle) / scale, counts, n)
    dispersion = scale / float(beta[1])
    median = _exp(middle - float(beta[0]) * dispersion)
    if not 0.0 < median < math.inf:
        # The share increases, but so slowly that the median is not a finite number.
        return Lognormal(math.nan, math.nan, unknown, False)
    covariance, groups = _sandwich((np.log(stripes) - middle) / scale, hits, beta, earthquakes)
    shift = np.array([[1.0, -middle / scale], [0.0, 1.0 / scale]])
    return Lognormal(median, dispersion, shift @ covariance @ shift.T, False, float(groups - 2))


def _most_likely(x: np.ndarray, counts: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return intercept and slope with the largest likelihood, for x with mean 0 and standard deviation 1.

    The likelihood is concave, so its derivative vanishes at the maximum.
    """
    basis = np.stack([np.ones_like(x), x])

    def score(beta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        eta = beta @ basis
        up, down = _density_over(eta), _density_over(-eta)
        curvature = counts * up * (up + eta) + (n - counts) * down * (down - eta)
        return basis @ (counts * up - (n - counts) * down), -(basis * curvature) @ basis.T

    # The import takes a third of a second, and only fragilities need it.
    from scipy.optimize import root

    solution = root(score, [float(ndtri(counts.sum() / n.sum())), 0.0], jac=True, tol=1e-14)
    # `solution.success` is false if rounding ends the iteration, so the derivative is tested instead.
    if not np.abs(solution.fun).max() <= _CONVERGED * n.sum():
        raise RuntimeError(f"the fit of a lognormal curve does not end: counts {counts} of {n}")
    return solution.x


def _sandwich(
    x: np.ndarray, hits: np.ndarray, beta: np.ndarray, earthquakes: np.ndarray | None
) -> tuple[np.ndarray, int]:
    """Return the covariance of the coefficients, and the number of earthquakes with a known outcome.

    The scores of one earthquake at all stripes are added, because they are not independent.
    """
    answered = np.isfinite(hits)
    n = int(added_up(answered, earthquakes).any(axis=1).sum())
    # The scores of all earthquakes add up to zero, so a single one shows no variance. Two earthquakes
    # leave one direction without variance, and the curve would be certain at one intensity.
    if n < 3:
        return np.full((2, 2), math.nan), n
    basis = np.stack([np.ones_like(x), x])
    eta = beta @ basis
    up, down = _density_over(eta), _density_over(-eta)
    bread = np.linalg.inv((basis * answered.sum(axis=0) * up * down) @ basis.T)
    # One row for each earthquake, because its motions and stripes are not independent observations.
    scores = added_up(np.where(answered, np.where(hits == 1.0, up, -down), 0.0) @ basis.T, earthquakes)
    # Earthquakes that are all alike show no variance either.
    if np.abs(scores).max() < ROUNDING * answered.sum():
        return np.full((2, 2), math.nan), n
    return n / (n - 1) * bread @ (scores.T @ scores) @ bread, n


def _density_over(eta: np.ndarray) -> np.ndarray:
    """Return the ratio of density and distribution function of the normal distribution."""
    return math.sqrt(2.0 / math.pi) / erfcx(-eta / math.sqrt(2.0))


def _exp(x: float) -> float:
    """Return the exponential of x; infinite if it exceeds the largest double."""
    return math.exp(x) if x < 709.0 else math.inf
