"""Reductions that are quoted only because their own earthquakes passed the validation.

Many sets of earthquakes test a pendulum with a known reduction of the measure that decides. For the sets that
pass, the benchmark compares the usual interval, and the one that allows for the decision, with the truth. It
also compares two rules: all earthquakes decide and are quoted, or one half decides and the other is quoted.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from tests.benchmarks.intervals import SCALES, Pairs, holds, in_earthquakes
from tests.benchmarks.stored import columns
from tests.designs import paired
from tpd.answers.paired import LEAST, Decision, PairedRuns
from tpd.answers.statistics import Interval, fall

QUESTION = "Do reductions contain the truth that are quoted because their own earthquakes passed?"
MEASURES = "answers/statistics", "answers/paired"
SEED = 0
AT_LEAST, SHARE = 0.1, 0.5
"""Required reduction, and the part of it that must be significant."""
REDUCTIONS, QUAKES = (0.08, 0.16, 0.30), (5, 7, 11, 22)
HALVES = (22, 44, 80)
"""Numbers of earthquakes for which one half decides and the other half is quoted."""
MIDDLES = {"tilt": 0.5, "overturning": 0.9}
"""Mean tilt over the slenderness, by the measure that decides."""
SPREAD = 0.5
"""Factor on the deviations of the effect of the pendulum. The interval of a reduction of the mean tilt by 16
% in 11 earthquakes is then 26 points wide; under FEMA P695 it is 14 to 20 points."""
BLOCK = 50
"""Number of sets that are drawn together."""


def measured(measure: str, pairs: Pairs) -> Pairs:
    """Return the severities if the measure is the tilt, and whether the runs overturn otherwise."""
    both = (pairs.with_pendulum, pairs.without_pendulum)
    return pairs if measure == "tilt" else Pairs(*((x >= 1.0).astype(float) for x in both), pairs.clusters)


def reduction(measure: str, pairs: Pairs) -> Interval:
    """Return the reduction of a measure, as `PairedRuns` does for runs that did not decide."""
    return fall(*measured(measure, pairs), least=LEAST if measure == "tilt" else 0.0)


def runs_of(pairs: Pairs) -> PairedRuns:
    """Return paired runs with these severities."""
    tilts = (np.where(x >= 1.0, np.inf, x) for x in (pairs.with_pendulum, pairs.without_pendulum))
    return paired(*tilts, cluster=pairs.clusters)


class Effect(NamedTuple):
    """Pendulum with a true reduction of the measure that decides."""

    measure: str
    truth: float

    def pairs(self, rng: np.random.Generator, earthquakes: int, factor: float) -> Pairs:
        """Return runs of two records of each earthquake."""
        return in_earthquakes(rng, np.full(earthquakes, 2), MIDDLES[self.measure], factor, SPREAD)

    def factor(self) -> float:
        """Return the factor on the tilt that gives the true reduction."""

        def missing(factor: float) -> float:
            with_it, without, _ = measured(
                self.measure, self.pairs(np.random.default_rng(SEED), 30_000, factor)
            )
            return 1.0 - with_it.mean() / without.mean() - self.truth

        return brentq(missing, 0.3, 1.3, xtol=1e-4)

    def sets(self, rng: np.random.Generator, earthquakes: int, most: int) -> Iterator[Pairs]:
        """Yield sets of runs."""
        clusters, factor = np.repeat(np.arange(earthquakes), 2 * len(SCALES)), self.factor()
        for _ in range(-(-most // BLOCK)):
            many = self.pairs(rng, BLOCK * earthquakes, factor)
            for pair in zip(*(x.reshape(BLOCK, -1) for x in many[:2]), strict=True):
                yield Pairs(*pair, clusters)


def passes(of: Interval) -> bool:
    """Return whether runs with this reduction pass."""
    return of.mean >= AT_LEAST and of.low > SHARE * AT_LEAST


def covered(effect: Effect, earthquakes: int, rng: np.random.Generator, repeats: int) -> dict[str, float]:
    """Return what is quoted of sets that passed, and how often it contains the truth.

    There are results for the measure that decides and for the other one, with the decision and "alone",
    without regard to it. There are none if no set passed.
    """
    other = next(name for name in MIDDLES if name != effect.measure)
    big = measured(other, effect.pairs(np.random.default_rng(SEED), 30_000, effect.factor()))
    truths = effect.truth, float(1.0 - big.with_pendulum.mean() / big.without_pendulum.mean())
    tried, found = 0, []
    for pairs in effect.sets(rng, earthquakes, 100 * repeats):
        tried += 1
        if not passes(reduction(effect.measure, pairs)):
            continue
        runs = runs_of(pairs)
        margin = runs.excess_reduction(effect.measure, AT_LEAST, SHARE * AT_LEAST)
        if margin >= 0.0:
            both = runs, replace(runs, passed=Decision(effect.measure, margin))
            found.append([x.reduction(name)[0] for x in both for name in (effect.measure, other)])
        if len(found) == repeats:
            break
    out = {"passes": len(found) / tried, "cases": float(len(found))}
    names = " alone", " alone, other", "", " other"
    for name, own, truth in zip(
        names if found else (), zip(*found, strict=True), truths * 2, strict=bool(found)
    ):
        known = [x for x in own if np.isfinite(x.low)]
        means, low, high = (np.array([getattr(x, end) for x in known]) for end in ("mean", "low", "high"))
        out |= {
            f"covers{name}": float(np.mean([holds(x, truth) for x in known])),
            f"mean{name}": means.mean(),
        }
        out |= {
            f"above{name}": np.mean(means > truth),
            f"low{name}": np.median(low),
            f"high{name}": np.median(high),
        }
    return out


def chosen(rng: np.random.Generator, repeats: int) -> list[dict[str, Any]]:
    """Return the results of `covered` for all effects and numbers of earthquakes."""
    effects = [Effect(measure, truth) for measure in MIDDLES for truth in REDUCTIONS]
    return [
        {"what": "chosen", **effect._asdict(), "earthquakes": n, **covered(effect, n, rng, repeats)}
        for effect in effects
        for n in QUAKES
    ]


def halves(rng: np.random.Generator, repeats: int) -> list[dict[str, Any]]:
    """Return the chance to pass and the width of the quoted interval for both rules."""
    rows = []
    for effect in (Effect(measure, truth) for measure in MIDDLES for truth in REDUCTIONS[1:]):
        for n in HALVES:
            widths = [], []
            for pairs in effect.sets(rng, n, repeats):
                if passes(reduction(effect.measure, pairs)):
                    runs = runs_of(pairs)
                    margin = runs.excess_reduction(effect.measure, AT_LEAST, SHARE * AT_LEAST)
                    of = replace(runs, passed=Decision(effect.measure, margin)).reduction(effect.measure)[0]
                    widths[0].append(of.high - of.low)
                first, second = (
                    reduction(effect.measure, Pairs(*(x[pairs.clusters % 2 == i] for x in pairs)))
                    for i in (0, 1)
                )
                if passes(first) and second.low > 0.0:
                    widths[1].append(second.high - second.low)
            cells = {
                f"{name} {who}": value
                for who, x in zip(("all", "half"), widths, strict=True)
                for name, value in (("passes", len(x) / repeats), ("width", float(np.median(x))))
            }
            rows.append({"what": "halves", **effect._asdict(), "earthquakes": n, **cells})
    return rows


def run(quick: bool) -> list[dict[str, Any]]:
    """Return the rows of both parts."""
    rng = np.random.default_rng(SEED)
    return [*chosen(rng, 10 if quick else 250), *halves(rng, 50 if quick else 250)]


def table(rows: list[dict[str, Any]]) -> str:
    """Return the tables of the coverage and of the two rules."""
    of = {what: [r for r in rows if r["what"] == what] for what in ("chosen", "halves")}
    effect = {
        "measure that decides": "{measure}",
        "true reduction": "{truth:.0%}",
        "earthquakes": "{earthquakes}",
    }
    covered = columns(
        of["chosen"],
        **effect,
        passes="{passes:.1%}",
        **{
            "sets that pass": "{cases:.0f}",
            "usual mean, of those that pass": "{mean alone:.1%}",
            "usual interval contains the truth": "{covers alone:.0%}",
            "quoted interval contains the truth": "{covers:.0%}",
            "quoted mean is above the truth": "{above:.0%}",
            "median of the quoted ends": "{low:.0%} to {high:.0%}",
            "the same for the other measure: contains the truth": "{covers other:.0%}",
        },
    )
    two = columns(
        of["halves"],
        **effect,
        **{
            "passes if all decide": "{passes all:.0%}",
            "passes if half decides": "{passes half:.0%}",
            "median width if all decide": "{width all:.3f}",
            "median width if half decides": "{width half:.3f}",
        },
    )
    return f"{covered}\n\n{two}"
