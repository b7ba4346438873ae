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

from tpd.answers.run_table import CASE_KEYS, Cases, Progress, follow_scaled
from tpd.answers.statistics import (
    SIGNIFICANT,
    Lognormal,
    fit_lognormal,
    mcnemar,
    median_words,
)
from tpd.answers.transient import FREE
from tpd.cluster.cluster import Cluster
from tpd.core import checks
from tpd.core.formatting import Printed, aligned, compared
from tpd.records.intensity import intensity_of
from tpd.scene.ground_motion import (
    LEAST_EARTHQUAKES,
    STANDARD_GRAVITY,
    GroundMotion,
    earthquakes_of,
    refuse_zeros,
)
from tpd.scene.scene import Block, Pendulum
from tpd.theory.equations import Terms

STATES: Mapping[str, float] = {"rocking": 0.0, "half": 0.5, "overturned": math.inf}
"""Default damage states: the tilt divided by the slenderness that a motion must exceed. 0 is any uplift, and
infinity is overturning."""


_LABELS = ("without pendulum", "with pendulum")
"""Names of the cases in text."""


@dataclass(frozen=True)
class Curve:
    """Fragility curve of one damage state, with or without the pendulum."""

    state: str
    """Name of the damage state."""
    shares: np.ndarray
    """Share of the answered motions that reach the state, shape (stripes,); NaN if no motion is answered."""
    counts: np.ndarray
    """Number of motions that reach the state, shape (stripes,)."""
    total: np.ndarray
    """Number of motions with an answer, shape (stripes,)."""
    undecided: np.ndarray
    """Number of motions without an answer, shape (stripes,). Neither `shares` nor `fit` counts them."""
    fit: Lognormal
    """Lognormal distribution with its uncertainty."""
    medians: tuple[float, float]
    """Medians of the two extreme fits: all motions without an answer reach the state, and none does."""

    @property
    def words(self) -> tuple[str, str]:
        """Median with its interval, and dispersion, as text."""
        median, dispersion = self.fit.words
        if not self.undecided.any():
            return median, dispersion
        # The median is lower if all motions without an answer reach the state.
        low, high = (median_words(x) for x in self.medians)
        return f"{median}, {low} to {high} depending on the motions without an answer", dispersion

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
        first_crossings: median of the lowest stripe that reaches a state, by damage state.
        changed: share of the outcomes that the nonlinear equations change, for each case.
        unanswered: number of runs without an answer with the nonlinear equations, for each case.
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
    if the pendulum had no effect (McNemar's exact test over earthquakes). If motions have no answer, the
    value is the largest that their outcomes allow. None without a pendulum."""
    tilts: np.ndarray
    """Largest tilt divided by the slenderness, shape (cases, motions, stripes). Infinite if the block
    overturns, NaN without an answer."""
    first_crossings: dict[str, tuple[float, ...]]
    """Median of the lowest stripe that reaches a state, by damage state and for each case. Infinite if fewer
    than half of the motions reach it. The value depends on the stripes, and is below the median of the curve
    if a larger motion may have a smaller effect. NaN if it depends on motions without an answer."""
    changed: tuple[float, ...] | None
    """Share of the runs for which the nonlinear equations change the outcome overturned or not, among the
    runs that both equations answer; NaN if there are none. None if the nonlinear equations were not used."""
    unanswered: tuple[int, ...] | None = None
    """Number of runs without an answer with the nonlinear equations, for each case."""
    p_medians: dict[str, float] | None = None
    """p-value of the difference of the medians by damage state: the exact two-sided sign test over
    earthquakes, in each of which one case reaches the state in more runs. None without a pendulum."""

    def columns(self) -> dict[str, Any]:
        """Columns of a table with a row for each case, damage state and stripe.

        They have the numbers of motions with and without an answer, and the probability on the fitted curve.
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
        # The outcomes without an answer are the same for all states, so that one curve of each case suffices.
        if text := _listed([int(next(iter(c.values())).undecided.sum()) for c in self.cases], runs):
            lines.append(f"  without an answer, and not counted: {text}")
        if self.changed is not None and self.unanswered is not None:
            shares = " and ".join(f"{100.0 * x:.1f} %" for x in self.changed)
            lines.append(f"  the nonlinear equations change the outcome of {shares} of the runs")
            if text := _listed(self.unanswered, runs):
                lines.append(f"  without an answer with these equations, and not compared: {text}")
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
        two = " {} and {}".format(*compared(first, last)) if math.isfinite(first + last) else ""
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
    cluster: Cluster | None = None,
    progress: Progress | None = None,
) -> Fragility:
    """Compute the fragility of a block under a set of motions, without a pendulum and with it.

    Args:
        block: block with its friction and restitution.
        motions: pulses or records. Their own sizes matter only for `intensity="scale"`.
        scales: intensity levels (stripes), increasing.
        pendulum: pendulum that is compared with the block without one, under the same motions.
        intensity: name of the intensity measure. "pga_star" is PGA/(g tan alpha), "pgv_star" is
            p PGV/(g tan alpha), where p is the rate omega0 of the block; "pga" and "pgv" are in m/s^2 and
            m/s; "sa" is the spectral acceleration in m/s^2 at `period` (s) with 5 % damping; "pga_g" and
            "sa_g" are in g; "scale" is the factor on each motion as it is.
        period: period of the spectral acceleration, s.
        states: damage states by name: the tilt divided by the slenderness that a motion must exceed.
        nonlinear: whether the nonlinear equations also follow all motions, to count the changed outcomes.
        gravity: acceleration of gravity, m/s^2.
        free: duration of the free motion after each ground motion, s.
        workers: number of threads; all cores by default.
        cluster: processes or machines in place of threads.
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
    for i, motion in enumerate(motions):
        checks.instance(f"motions[{i}]", motion, GroundMotion)
    refuse_zeros(motions)
    names = tuple(getattr(m, "name", "") or f"motion {i + 1}" for i, m in enumerate(motions))
    # Every intensity measure is proportional to the motion.
    # The factor that scales a motion to a stripe is therefore a quotient.
    factors = stripes / np.array([[measure.value(m)] for m in motions])
    cases, times = (None,) if pendulum is None else (None, pendulum), 2 if nonlinear else 1
    # The tables need neither the swing nor the final state, so that the runs can end early.
    options: dict[str, Any] = {"gravity": gravity, "free": free, "brief": True}
    options |= {"workers": workers, "cluster": cluster}

    # The nonlinear runs follow the exact ones, so that progress continues from one to the other.
    def shifted(n: int, report: Progress | None = progress) -> Progress | None:
        return None if report is None else lambda done, all_: report(n * all_ + done, times * all_)

    exact = follow_scaled(block, cases, motions, factors, progress=shifted(0), **options)
    nu, quakes = float(block.slenderness), earthquakes_of(motions)
    # 1 where a run reaches a damage state, 0 where it does not, NaN without an answer.
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
    # Motions of one earthquake are dependent, so that the test counts earthquakes.
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
        first_crossings=crossings,
        changed=changed,
        unanswered=unanswered,
    )


def _curve(name: str, hit: np.ndarray, quakes: np.ndarray, stripes: np.ndarray) -> Curve:
    counts, total = np.nansum(hit, axis=0).astype(int), np.sum(np.isfinite(hit), axis=0)
    shares = np.where(total > 0, counts / np.maximum(total, 1), np.nan)
    fit, undecided = fit_lognormal(stripes, hit, quakes), len(hit) - total
    # The two extreme outcomes of the motions without an answer: all reach the state, and none does.
    ends = [fit_lognormal(stripes, np.nan_to_num(hit, nan=x)).median for x in (1.0, 0.0)]
    return Curve(name, shares, counts, total, undecided, fit, (ends[0], ends[1]))


def _first_crossing(hit: np.ndarray, stripes: np.ndarray) -> float:
    """Return the median of the lowest stripe at which each motion reaches a state.

    NaN if the median depends on motions without an answer.
    """
    # The two extremes: no unknown outcome reaches the state, and all do.
    medians = []
    for unknown in (0.0, 1.0):
        reaches = np.nan_to_num(hit, nan=unknown) == 1.0
        lowest = np.where(reaches.any(axis=1), stripes[np.argmax(reaches, axis=1)], np.inf)
        medians.append(float(np.median(lowest)))
    return medians[0] if medians[0] == medians[1] else math.nan
