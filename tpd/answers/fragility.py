"""Fragility: the share of ground motions of each intensity that bring a block to a damage state.

Every motion is scaled to every stripe of the intensity. The fragility curve is the lognormal distribution
that makes the counts of all stripes most likely (probit regression on the logarithm of the intensity;
J. W. Baker, Earthquake Spectra 31, 2015). The pendulum is judged on the same motions: at each stripe by
McNemar's exact test on the motions whose outcome differs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tpd.answers.runs import CASE_KEYS, Cases, Progress, follow_scaled
from tpd.answers.statistics import Lognormal, fit_lognormal, mcnemar, median_words
from tpd.answers.transient import FREE
from tpd.cluster.cluster import Cluster
from tpd.core import checks
from tpd.records.intensity import intensity_of
from tpd.scene.ground_motion import STANDARD_GRAVITY, GroundMotion, events_of, refuse_zeros
from tpd.scene.scene import Block, Pendulum
from tpd.theory.equations import Terms

STATES: Mapping[str, float] = {"rocking": 0.0, "half": 0.5, "overturned": math.inf}
"""Damage states by default: the tilt over the slenderness that a motion exceeds. 0 is any uplift, infinity an
overturning."""


_LABELS = ("bare", "with the pendulum")
"""Names of the cases in text."""


@dataclass(frozen=True)
class Curve:
    """Fragility of one damage state, with or without the pendulum."""

    state: str
    shares: np.ndarray
    """Share of the motions whose outcome is known that reach the state, shape (stripes,); NaN where none is
    known."""
    counts: np.ndarray
    """Motions that reach the state."""
    total: np.ndarray
    """Motions whose outcome is known."""
    undecided: np.ndarray
    """Motions without an answer: they count neither in `shares` nor in `fit`."""
    fit: Lognormal
    """Lognormal distribution, with its uncertainty."""
    medians: tuple[float, float]
    """Medians of the fits in which all motions without an answer reach the state, and in which none does."""

    def __str__(self) -> str:
        if not self.undecided.any():
            return str(self.fit)
        # All of them reaching the state makes the lower median.
        low, high = (median_words(x) for x in self.medians)
        return f"{self.fit} (between {low} and {high}, whatever the motions without an answer do)"


@dataclass(frozen=True)
class Fragility(Cases):
    """Fragility of a block under a set of ground motions, without a pendulum and, if there is one, with it.

    What has a number or an array for each case has that without the pendulum first.
    """

    intensity: str
    stripes: np.ndarray
    """Values of the intensity, shape (stripes,)."""
    unit: str
    motions: tuple[str, ...]
    """Names of the ground motions."""
    earthquakes: int
    """Earthquakes that they are of: motions of one are no independent observations."""
    cases: tuple[dict[str, Curve], ...]
    """Curves by damage state."""
    p_values: dict[str, np.ndarray] | None
    """By damage state: two-sided probability, at each stripe, of a difference between the cases at least
    this large if the pendulum changed nothing (McNemar, exact, over earthquakes). Where motions have no
    answer, the largest that their outcomes allow."""
    tilts: np.ndarray
    """Largest tilt over the slenderness of every motion, shape (cases, motions, stripes); infinite after an
    overturning, NaN where nothing is known."""
    first_crossings: dict[str, tuple[float, ...]]
    """By damage state: median of the lowest stripes that reach it (infinite if fewer than half of the motions
    do). It depends on the stripes, and lies below the median of the curve where a larger motion may do less.
    NaN where it depends on motions without an answer."""
    changed: tuple[float, ...] | None
    """Share of the runs whose verdict on overturning the nonlinear equations change, among those that both
    equations answer; NaN if there are none."""
    unanswered: tuple[int, ...] | None = None
    """Runs that the nonlinear equations do not answer."""

    def columns(self) -> dict[str, Any]:
        """A row for every case, damage state and stripe: motions that reach it, with an answer and without,
        and the share on the fitted curve."""
        curves = [curve for case in self.cases for curve in case.values()]
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
        for name in self.without_pendulum:
            heads = f"{name}: {_LABELS[0]}", f"{' ' * len(name)}  {_LABELS[1]}"
            for head, case in zip(heads, self.cases, strict=False):
                lines.append(f"  {head} {case[name]}")
        runs = len(self.motions) * len(self.stripes)
        if lost := _listed([int(next(iter(c.values())).undecided.sum()) for c in self.cases], runs):
            lines.append(f"  without an answer, and not counted: {lost}")
        if self.changed is not None and self.unanswered is not None:
            shares = " and ".join(f"{x:.1%}" for x in self.changed)
            lines.append(f"  the nonlinear equations change the verdict of {shares} of the runs")
            if lost := _listed(self.unanswered, runs):
                lines.append(f"  without an answer by these equations, and not compared: {lost}")
        return "\n".join(lines)


def _listed(counts: Sequence[int], runs: int) -> str:
    """Numbers of runs of each case; nothing if they are all zero."""
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
    """Follow a block through every motion at every intensity, bare and with a pendulum.

    Args:
        block: with its friction and restitution.
        motions: pulses or records; their own sizes do not matter but for `intensity="scale"`.
        scales: stripes: values of the intensity, increasing.
        pendulum: compared with the bare block on the same motions.
        intensity: "pga_star" is PGA/(g tan alpha), "pgv_star" is p PGV/(g tan alpha) with p the block's rate
            omega0; "pga" and "pgv" are in m/s^2 and m/s; "sa" is the spectral acceleration in m/s^2 at
            `period` (s) and 5 % damping; "pga_g" and "sa_g" are in g; "scale" is the factor on each motion as
            it is.
        states: damage states: tilt over the slenderness that a motion exceeds.
        nonlinear: whether the nonlinear equations follow all motions too, to say how many verdicts change.
        gravity: m/s^2.
        free: free motion after each ground motion, s.
        workers: threads; all cores by default.
        cluster: processes or machines in place of threads.
        progress: called with the motions done and in all.

    Raises:
        ValueError: bad input.
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
    # Intensities are proportional to the motion.
    factors = stripes / np.array([[measure.value(m)] for m in motions])
    cases, times = (None,) if pendulum is None else (None, pendulum), 2 if nonlinear else 1
    options: dict[str, Any] = {"gravity": gravity, "free": free, "brief": True}
    options |= {"workers": workers, "cluster": cluster}

    def shifted(n: int, report: Progress | None = progress) -> Progress | None:
        return None if report is None else lambda done, all_: report(n * all_ + done, times * all_)

    exact = follow_scaled(block, cases, motions, factors, progress=shifted(0), **options)
    nu, quakes = float(block.slenderness), np.unique(events_of(motions), return_inverse=True)[1]
    # Whether every run reaches each of the damage states, as a number; NaN where nothing is known.
    reached = {n: exact.is_overturned if math.isinf(x) else exact.tilt > x * nu for n, x in states.items()}
    hits = {n: np.where(exact.is_unanswered, np.nan, hit) for n, hit in reached.items()}
    curves = tuple(
        {name: _curve(name, hit[i], quakes, stripes) for name, hit in hits.items()} for i in range(len(cases))
    )
    changed, unanswered = None, None
    if nonlinear:
        checked = follow_scaled(
            block, cases, motions, factors, progress=shifted(1), equations=Terms.nonlinear, **options
        )
        unknown = exact.is_unanswered | checked.is_unanswered
        differs = np.where(unknown, np.nan, exact.is_overturned ^ checked.is_overturned)
        known = [x[np.isfinite(x)] for x in differs]
        changed = tuple(float(np.mean(x)) if len(x) else math.nan for x in known)
        unanswered = tuple(int(x.sum()) for x in checked.is_unanswered)
    p_values = None
    if pendulum is not None:
        p_values = {name: mcnemar(hit[0], hit[1], quakes) for name, hit in hits.items()}
    crossings = {name: tuple(_first_crossing(h, stripes) for h in hit) for name, hit in hits.items()}
    return Fragility(
        intensity=measure.name,
        stripes=stripes,
        unit=measure.unit,
        motions=names,
        earthquakes=len(np.unique(quakes)),
        cases=curves,
        p_values=p_values,
        tilts=exact.tilt / nu,
        first_crossings=crossings,
        changed=changed,
        unanswered=unanswered,
    )


def _curve(name: str, hit: np.ndarray, quakes: np.ndarray, stripes: np.ndarray) -> Curve:
    counts, total = np.nansum(hit, axis=0).astype(int), np.sum(np.isfinite(hit), axis=0)
    shares = np.where(total > 0, counts / np.maximum(total, 1), np.nan)
    fit, undecided = fit_lognormal(stripes, hit, quakes), len(hit) - total
    # The two extremes of what the motions without an answer may do.
    ends = [fit_lognormal(stripes, np.nan_to_num(hit, nan=x)).median for x in (1.0, 0.0)]
    return Curve(name, shares, counts, total, undecided, fit, (ends[0], ends[1]))


def _first_crossing(hit: np.ndarray, stripes: np.ndarray) -> float:
    """Median of the lowest stripes at which the motions reach a state; NaN where it depends on outcomes that
    are not known."""
    medians = []
    for unknown in (0.0, 1.0):
        known = np.nan_to_num(hit, nan=unknown) == 1.0
        lowest = np.where(known.any(axis=1), stripes[np.argmax(known, axis=1)], np.inf)
        medians.append(float(np.median(lowest)))
    return medians[0] if medians[0] == medians[1] else math.nan
