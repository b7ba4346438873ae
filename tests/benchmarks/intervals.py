"""Coverage of the 95 % intervals of benefits and curves, and properties of rules for a recommendation.

Severities are tilts clipped to 0 (at rest) and 1 (overturned). Earthquakes have 1 to 12 records, three scales
each, and effects of their own. "Before" is the cluster-robust variance with the number of clusters minus one
as degrees of freedom and, for a fall, the linearised ratio.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtrit

from tests.benchmarks.stored import columns, markdown
from tpd.answers.statistics import Interval, added_up, change, fall, fit_lognormal

QUESTION = "Do 95 % intervals contain the true value, and which rule gives an unbiased benefit?"
SEED = 0
EARTHQUAKES = (4, 5, 7, 11, 22)
TILTS = {"usual": 0.3, "mostly at rest": -0.2, "mostly overturned": 0.8}
"""Mean tilt over the slenderness, before clipping."""
SCALES = np.array([-0.35, 0.0, 0.35])
RUNS, SHARES = (256, 512, 1024, 2048), (0.005, 0.01, 0.02, 0.05)
EVENTS = ((0.0, 0.0), (0.5, 0.5), (1.0, 0.0))
"""Reduction of the share that overturns, and the share of the runs overturned with the pendulum that also
overturn without it."""
TRUTHS = (0.0, 0.02, 0.04, 0.056, 0.08, 0.10, 0.12, 0.15, 0.20)
AT_LEAST, SHARE = 0.1, 0.5
SEVERITY = {"middle": 0.5, "spread": 0.35, "noise": 0.3}
"""Scatter of the runs of the rules; the standard error of the reduction is 3 points with 512 runs."""
CANDIDATES = 3


class Pairs(NamedTuple):
    """Severities of runs with and without the pendulum, and the earthquakes of the runs."""

    with_pendulum: np.ndarray
    without_pendulum: np.ndarray
    clusters: np.ndarray


def in_earthquakes(
    rng: np.random.Generator, records: np.ndarray, middle: float, factor: float = 0.75, spread: float = 1.0
) -> Pairs:
    """Return severities of `records` records of each earthquake at three scales.

    Args:
        rng: random numbers.
        records: number of records of each earthquake.
        middle: mean tilt over the slenderness, before clipping.
        factor: factor of the pendulum on the tilt.
        spread: factor on the deviations from this factor.
    """
    quake = np.repeat(np.arange(len(records)), records)
    tilt = middle + 0.35 * rng.standard_normal(len(records))[quake] + 0.35 * rng.standard_normal(len(quake))
    moved = 0.15 * rng.standard_normal(len(records))[quake] + 0.2 * rng.standard_normal(len(quake))
    moved *= spread
    tilts = tilt[:, None] + SCALES
    noise = 0.1 * rng.standard_normal((2, *tilts.shape))
    severities = np.clip([factor * tilts + moved[:, None] + noise[0], tilts + noise[1]], 0.0, 1.0)
    with_pendulum, without_pendulum = severities.reshape(2, -1)
    return Pairs(with_pendulum, without_pendulum, np.repeat(quake, len(SCALES)))


def before(tops: np.ndarray, bottoms: np.ndarray, clusters: np.ndarray | None = None) -> Interval:
    """Return the interval of a ratio of sums, by the method of earlier versions."""
    ratio = float(tops.sum() / bottoms.sum())
    sums = added_up(tops - ratio * bottoms, clusters)
    error = np.sqrt(len(sums) / (len(sums) - 1) * np.sum(sums**2)) / bottoms.sum()
    width = float(stdtrit(len(sums) - 1, 0.975) * error)
    return Interval(ratio, ratio - width, ratio + width)


def holds(interval: Interval, truth: float) -> bool:
    """Return whether an interval contains a number, up to rounding."""
    return interval.low - 1e-9 <= truth <= interval.high + 1e-9


def _covered(of: Callable[[], Pairs], truth: tuple[float, float], repeats: int) -> dict[str, float]:
    """Return the coverage of both methods, and the median width, for the difference and the reduction."""
    cells = {name: [] for name in ("change", "fall", "change before", "fall before", "width", "fall width")}
    for _ in range(repeats):
        pendulum, without_it, clusters = of()
        new = change(pendulum, without_it, clusters), fall(pendulum, without_it, clusters)
        for name, interval, value in zip(("change", "fall"), new, truth, strict=True):
            cells[name].append(holds(interval, value))
        cells["width"].append(new[0].high - new[0].low)
        cells["fall width"].append(new[1].high - new[1].low)
        differences = pendulum - without_it
        old = before(differences, np.ones_like(without_it), clusters)
        cells["change before"].append(holds(old, truth[0]))
        # A ratio to zero had no interval.
        cells["fall before"].append(
            bool(without_it.any()) and holds(before(-differences, without_it, clusters), truth[1])
        )
    middles = ("width", "fall width")
    return {k: float(np.median(v) if k in middles else np.mean(v)) for k, v in cells.items()}


def few(rng: np.random.Generator, repeats: int) -> list[dict[str, Any]]:
    """Return the coverage with few earthquakes."""
    rows = []
    for name, middle in TILTS.items():
        all_runs = in_earthquakes(rng, np.full(100_000, 3), middle)
        pendulum, without_it = all_runs.with_pendulum.mean(), all_runs.without_pendulum.mean()
        for n in EARTHQUAKES:

            def sample(n: int = n, middle: float = middle) -> Pairs:
                return in_earthquakes(rng, np.minimum(rng.geometric(0.3, n), 12), middle)

            covered = _covered(
                sample, (float(pendulum - without_it), float(1.0 - pendulum / without_it)), repeats
            )
            rows.append({"what": "few", "tilts": name, "earthquakes": n, **covered})
    return rows


def rare(rng: np.random.Generator, repeats: int) -> list[dict[str, Any]]:
    """Return the coverage with few runs that overturn, and all others at rest."""
    rows = []
    for share in SHARES:
        for n in RUNS:
            for gain, both in EVENTS:
                pendulum = share * (1.0 - gain)
                chances = (both * pendulum, share - both * pendulum, (1.0 - both) * pendulum)

                def sample(n: int = n, chances: tuple[float, ...] = chances) -> Pairs:
                    either, only_without, only_with = rng.multinomial(n, [*chances, 1.0 - sum(chances)])[:3]
                    runs = np.arange(n)
                    without = runs < either + only_without
                    with_it = (runs < either) | (
                        (runs >= either + only_without) & (runs < either + only_without + only_with)
                    )
                    return Pairs(with_it.astype(float), without.astype(float), runs)

                covered = _covered(sample, (pendulum - share, gain), repeats)
                rows.append({"what": "rare", "share": share, "runs": n, "gain": gain, **covered})
    return rows


def curves(rng: np.random.Generator, repeats: int) -> list[dict[str, Any]]:
    """Return the coverage of the median of a lognormal curve; records of one earthquake are correlated."""
    rows, stripes = [], np.geomspace(0.5, 6.0, 8)
    for n in EARTHQUAKES:
        covered, known = [], []
        for _ in range(repeats):
            quake = np.repeat(np.arange(n), np.minimum(rng.geometric(0.3, n), 12))
            of_quake, of_record = rng.standard_normal(n)[quake], rng.standard_normal(len(quake))
            capacity = 2.0 * np.exp(0.35 * of_quake + 0.35 * of_record)
            low, high = fit_lognormal(stripes, (stripes >= capacity[:, None]).astype(float), quake).interval()
            covered.append(low <= 2.0 <= high)
            known.append(low > 0.0 and np.isfinite(high))
        rows.append(
            {
                "what": "curve",
                "earthquakes": n,
                "median": float(np.mean(covered)),
                "known": float(np.mean(known)),
            }
        )
    return rows


class Sets(NamedTuple):
    """Results of sets of runs: the reduction, its lower end, and the upper end of the difference."""

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def pass_all(self) -> np.ndarray:
        """Return whether the sets pass: a reduction of `AT_LEAST`, significantly above a part of it."""
        return (self.value >= AT_LEAST) & (self.low > SHARE * AT_LEAST) & (self.high < 0.0)


def population(rng: np.random.Generator, truth: float, runs: int = 200_000) -> np.ndarray:
    """Severities without a pendulum and with each of the candidates, of which all have one true fall; shape
    (1 + `CANDIDATES`, runs)."""
    tilt = SEVERITY["middle"] + SEVERITY["spread"] * rng.standard_normal(runs)
    noise = SEVERITY["noise"] * rng.standard_normal((1 + CANDIDATES, runs))
    without_it = np.clip(tilt + noise[0], 0.0, 1.0)

    def pendulum(factor: Any) -> np.ndarray:
        return np.clip(factor * tilt + noise[1:], 0.0, 1.0)

    factor = brentq(lambda x: 1.0 - pendulum(x).mean() / without_it.mean() - truth, 0.1, 1.5)
    return np.concatenate([without_it[None], pendulum(factor)])


def judged(rng: np.random.Generator, runs: np.ndarray, size: int, sets: int) -> Sets:
    """What sets of so many runs show of the candidates, each set of every candidate with the same runs; shape
    (sets, candidates)."""
    found = np.empty((3, sets, len(runs) - 1))
    for i in range(sets):
        without_it, *pendulum = runs[:, rng.integers(0, runs.shape[1], size)]
        for j, severity in enumerate(pendulum):
            benefit = fall(severity, without_it)
            found[:, i, j] = benefit.mean, benefit.low, change(severity, without_it).high
    return Sets(*found)


def rules(rng: np.random.Generator, sets: int) -> list[dict[str, Any]]:
    """Chance to pass and bias of the quoted benefit, by rule, for one candidate and for several that are
    tried one after the other until one passes."""
    rows = []
    for truth in TRUTHS:
        runs = population(rng, truth)
        same = judged(rng, runs, 512, sets)
        # Sets of their own need one candidate: all have the same truth.
        one = {n: judged(rng, runs[:2], n, sets) for n in (512, 1024, 1536, 2048)}
        error = float(np.std(one[512].value))
        repeats = 20 * sets

        def own(n: int, one: dict[int, Sets] = one, repeats: int = repeats) -> Sets:
            chosen = rng.integers(0, sets, (repeats, CANDIDATES))
            return Sets(*(x[:, 0][chosen] for x in one[n]))

        def two(
            first: int, second: int, share: float, own: Callable[[int], Sets] = own
        ) -> tuple[np.ndarray, np.ndarray]:
            decides, quoted = own(first), own(second)
            passed = (decides.value >= AT_LEAST) & (decides.low > share * AT_LEAST) & (decides.high < 0.0)
            return passed & (quoted.low > 0.0), quoted.value

        at_once = own(2048)
        by_rule = {
            "512 decide and are quoted, the same for all": (
                (same.value >= AT_LEAST) & (same.low > 0.0),
                same.value,
            ),
            "2048 decide and are quoted": (at_once.pass_all(), at_once.value),
            "1024 decide, 1024 are quoted": two(1024, 1024, SHARE),
            "512 decide, 1536 are quoted": two(512, 1536, SHARE),
            "1024 decide without the bound on the interval, 1024 are quoted": two(1024, 1024, 0.0),
        }
        for rule, (passed, value) in by_rule.items():
            for n in (1, CANDIDATES):
                any_passed = passed[:, :n].any(axis=1)
                first = passed[:, :n].argmax(axis=1)
                quoted = value[np.arange(len(value)), first][any_passed]
                bias = float(quoted.mean() - truth) if len(quoted) >= 20 else np.nan
                row = {"what": "rule", "rule": rule, "truth": truth, "candidates": n, "error": error}
                rows.append(row | {"passes": float(any_passed.mean()), "bias": bias})
    return rows


def run(quick: bool) -> list[dict[str, Any]]:
    """Return the rows of all four parts."""
    rng = np.random.default_rng(SEED)
    size = 20 if quick else 1
    parts = ((few, 2000), (rare, 1500), (curves, 1000), (rules, 1000))
    return [row for part, repeats in parts for row in part(rng, repeats // size)]


def rules_table(rows: list[dict[str, Any]]) -> str:
    """Return the table of the probability to pass and of the bias in points, for one / three candidates."""
    there = [r for r in rows if r["what"] == "rule"]
    cells = []
    for rule in dict.fromkeys(r["rule"] for r in there):
        for key, form in (("passes", "{:.1%}"), ("bias", "{:+.1f}")):
            line = [rule, {"passes": "passes", "bias": "bias (points)"}[key]]
            for truth in TRUTHS:
                of = [r[key] for r in there if r["rule"] == rule and r["truth"] == truth]
                scale = 1.0 if key == "passes" else 100.0
                line.append(" / ".join("" if x is None else form.format(scale * x) for x in of))
            cells.append(line)
    return markdown(("rule", "one / three candidates, true benefit:", *(f"{t:.1%}" for t in TRUTHS)), cells)


def table(rows: list[dict[str, Any]]) -> str:
    """Return the tables of coverage with few earthquakes, rare overturning and curves, and of the rules."""
    parts = {what: [r for r in rows if r["what"] == what] for what in ("few", "rare", "curve")}
    both = {"difference": "{change:.1%}", "difference, old method": "{change before:.1%}"}
    both |= {"reduction": "{fall:.1%}", "reduction, old method": "{fall before:.1%}"}
    few_heads = {
        "tilts": "{tilts}",
        "earthquakes": "{earthquakes}",
        **both,
        "median width, difference": "{width:.3f}",
    }
    rare_heads = {
        "overturned without pendulum": "{share:.1%}",
        "runs": "{runs}",
        "true reduction": "{gain:.0%}",
        **both,
    }
    curve_heads = {
        "earthquakes": "{earthquakes}",
        "median": "{median:.1%}",
        "interval is finite": "{known:.0%}",
    }
    return "\n\n".join(
        (
            columns(parts["few"], **few_heads),
            columns(parts["rare"], **rare_heads),
            columns(parts["curve"], **curve_heads),
            rules_table(rows),
        )
    )
