"""Share of pendulums that are recommended, by their true reduction, with outcomes of real earthquakes.

A column and six pendulums of each of several masses are simulated once by the nonlinear model, under all
records of FEMA P695 (the extra `records`) at sixteen levels. The truth is the reduction in all these runs.
Sets of earthquakes are then drawn from them again and again, with replacement, each with all its records. For
each set the benchmark applies several rules of validation. A search chooses the best of the six pendulums.
"""

from typing import Any, NamedTuple

import numpy as np

import tpd
from tests.benchmarks.stored import columns
from tpd.answers.paired import LEAST
from tpd.answers.statistics import change, fall
from tpd.design.ground_motion import LEVELS, GroundMotionProblem

QUESTION = "Which share of pendulums is recommended, by their true reduction and by the rule of validation?"
MEASURES = "answers/statistics", "answers/paired"
SEED = 0
MASSES = (15.0, 35.0, 60.0, 90.0, 140.0, 220.0)
"""Masses of the pendulums, kg."""
LENGTHS, DAMPINGS = (0.2, 0.3, 0.8), (0.3, 0.6)
"""Rods (m) and damping ratios, between which a search chooses."""
RULE = 3
"""Number of the pendulum that stands for the rule of thumb: 0.3 m and 0.6."""
AT_LEAST, SHARE = 0.1, 0.5
"""Required reduction, and the part of it that must be below its interval."""
FEW = slice(1, LEVELS, 4)
"""Four of the sixteen levels."""
QUAKES = 14
"""Number of earthquakes of a set, as in the far-field set of FEMA P695."""
HEADS = {
    "half": "search on 7, validation on 7, 4 levels",
    "cross": "cross-fitting",
    "few": "rule of thumb, 4 levels",
    "rule": "rule of thumb",
    "more": "rule of thumb, 19 earthquakes",
    "same": "search and validation on the same 14",
}
"""Rules of validation, with 14 earthquakes and 16 levels unless they say so."""


class Outcomes(NamedTuple):
    """Measure of all runs."""

    without: np.ndarray
    """Without a pendulum, shape (records, levels)."""
    pendulums: np.ndarray
    """With each pendulum, shape (pendulums, records, levels)."""
    quakes: np.ndarray
    """Number of the earthquake of each record."""

    def reductions(self) -> np.ndarray:
        """Return the reduction by each pendulum."""
        return 1.0 - self.pendulums.mean(axis=(1, 2)) / self.without.mean()

    def of(self, earthquakes: np.ndarray, levels: slice = slice(None)) -> "Outcomes":
        """Return the runs of some earthquakes, which count as different ones even if one is drawn twice."""
        rows = [np.flatnonzero(self.quakes == quake) for quake in earthquakes]
        quakes = np.repeat(np.arange(len(rows)), [len(x) for x in rows])
        rows = np.concatenate(rows)
        return Outcomes(self.without[rows, levels], self.pendulums[:, rows, levels], quakes)

    def passes(self, pendulum: int | np.ndarray, least: float) -> bool:
        """Return whether a pendulum, or one for each record, has the required reduction."""
        which = np.broadcast_to(pendulum, len(self.quakes))
        runs = self.pendulums[which, np.arange(len(which))].ravel(), self.without.ravel()
        clusters = np.repeat(self.quakes, self.without.shape[1])
        of = fall(*runs, clusters, least=least)
        return of.mean >= AT_LEAST and of.low > SHARE * AT_LEAST and change(*runs, clusters).high < 0.0


def simulated(quick: bool) -> dict[str, list[Outcomes]]:
    """Return the outcomes of each mass by the measure, from nonlinear runs."""
    block = tpd.Block(width=0.7, height=4.0, mass=2210.0, radius_of_gyration=1.18)
    records = [r for name in tpd.records.sets.SETS for r in tpd.records.fema_p695(name)][
        :: 10 if quick else 1
    ]
    problem = GroundMotionProblem.of(block, tpd.Conditions.records(records, (1.5, 4.0)), limits=())
    quakes = problem.earthquakes[::LEVELS]
    designs = [(length / 2.0, zeta) for length in LENGTHS for zeta in DAMPINGS]
    masses = MASSES[::3] if quick else MASSES
    out: dict[str, list[Outcomes]] = {"tilt": [], "overturning": []}
    alone = problem.validation_runs(None, 0)
    for mass in masses:
        runs = [problem.validation_runs(np.array([mass / 2210.0, *x]), 0) for x in designs]
        for measure, results in out.items():
            values = [r.severity if measure == "tilt" else 1.0 * r.is_overturned for r in (alone, *runs)]
            first, *others = (np.nan_to_num(x).reshape(-1, LEVELS) for x in values)
            results.append(Outcomes(first, np.array(others), quakes))
    return out


def verdicts(of: Outcomes, rng: np.random.Generator, least: float) -> dict[str, tuple[bool, int]]:
    """Return whether each rule recommends its pendulum for one set of earthquakes, and the pendulum."""
    every = rng.choice(np.unique(of.quakes), len(np.unique(of.quakes)))
    some = every[:QUAKES]
    drawn, best = of.of(some), int(np.argmax(of.of(some).reductions()))
    # The two groups of cross-fitting, and the design that is found on the other group.
    found = [int(np.argmax(of.of(some[k::2]).reductions())) for k in (1, 0)]
    half = found[0]
    return {
        "half": (of.of(some[::2], FEW).passes(half, least), half),
        "cross": (drawn.passes(np.array(found)[drawn.quakes % 2], least), best),
        "few": (of.of(some, FEW).passes(RULE, least), RULE),
        "rule": (drawn.passes(RULE, least), RULE),
        "more": (of.of(every).passes(RULE, least), RULE),
        "same": (drawn.passes(best, least), best),
    }


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each measure and mass."""
    repeats, rng, rows = 20 if quick else 400, np.random.default_rng(SEED), []
    for measure, results in simulated(quick).items():
        for mass, of in zip(MASSES[::3] if quick else MASSES, results, strict=True):
            truth, least = of.reductions(), LEAST if measure == "tilt" else 0.0
            drawn = [verdicts(of, rng, least) for _ in range(repeats)]
            row = {"measure": measure, "mass": mass, "truth": float(truth[RULE])}
            row["searched"] = float(np.mean([truth[x["cross"][1]] for x in drawn]))
            for rule in HEADS:
                row[rule] = float(np.mean([x[rule][0] for x in drawn]))
                false = [x[rule][0] and truth[x[rule][1]] < SHARE * AT_LEAST for x in drawn]
                row[f"{rule} false"] = float(np.mean(false))
            rows.append(row)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of the shares, with the largest share of pendulums without a benefit."""
    heads = {
        "measure": "{measure}",
        "mass of the bob, kg": "{mass:.0f}",
        "true reduction, rule of thumb": "{truth:.1%}",
        "true reduction, search": "{searched:.1%}",
    }
    shares = columns(rows, **heads, **{head: f"{{{rule}:.0%}}" for rule, head in HEADS.items()})
    worst = {head: max(row[f"{rule} false"] for row in rows) for rule, head in HEADS.items()}
    listed = "; ".join(f"{head}: {share:.1%}" for head, share in worst.items())
    return f"{shares}\n\nLargest share of sets that recommend a true reduction below 5 %: {listed}."
