"""Coverage of the 95 % intervals of benefits and curves.

Severities are tilts clipped to 0 (at rest) and 1 (overturned). Earthquakes have 1 to 12 records, three scales
each, and an effect that their records share.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tests.benchmarks.stored import columns
from tpd.answers.fragility import fit_lognormal
from tpd.answers.statistics import Interval, change, fall

QUESTION = "Do 95 % intervals contain the true value?"
MEASURES = "answers/statistics", "answers/fragility"
SEED = 0
EARTHQUAKES = (4, 5, 7, 11, 22)
TILTS = {"usual": 0.3, "mostly at rest": -0.2, "mostly overturned": 0.8}
"""Mean tilt over the slenderness, before clipping."""
SCALES = np.array([-0.35, 0.0, 0.35])
RUNS, SHARES = (256, 512, 1024, 2048), (0.005, 0.01, 0.02, 0.05)
EVENTS = ((0.0, 0.0), (0.5, 0.5), (1.0, 0.0))
"""Reduction of the share that overturns, and the share of the runs overturned with the pendulum that also
overturn without it."""


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


def holds(interval: Interval, truth: float) -> bool:
    """Return whether an interval contains a number, up to rounding."""
    return interval.low - 1e-9 <= truth <= interval.high + 1e-9


def _covered(of: Callable[[], Pairs], truth: tuple[float, float], repeats: int) -> dict[str, float]:
    """Return the coverage and the median width of the difference and of the reduction."""
    cells = {name: [] for name in ("change", "fall", "width", "fall width")}
    for _ in range(repeats):
        pendulum, without_it, clusters = of()
        new = change(pendulum, without_it, clusters), fall(pendulum, without_it, clusters)
        for name, interval, value in zip(("change", "fall"), new, truth, strict=True):
            cells[name].append(holds(interval, value))
        cells["width"].append(new[0].high - new[0].low)
        cells["fall width"].append(new[1].high - new[1].low)
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


def run(quick: bool) -> list[dict[str, Any]]:
    """Return the rows of all three parts."""
    rng = np.random.default_rng(SEED)
    size = 20 if quick else 1
    parts = ((few, 2000), (rare, 1500), (curves, 1000))
    return [row for part, repeats in parts for row in part(rng, repeats // size)]


def table(rows: list[dict[str, Any]]) -> str:
    """Return the tables of coverage with few earthquakes, rare overturning and curves."""
    parts = {what: [r for r in rows if r["what"] == what] for what in ("few", "rare", "curve")}
    both = {"difference": "{change:.1%}", "reduction": "{fall:.1%}"}
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
        )
    )
