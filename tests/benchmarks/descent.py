"""What the descents contribute: the chimney of the README with other ways to its design.

All designs keep the limits in the same runs, and other runs evaluate them.
"""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import tpd
from tests.benchmarks.stored import columns

QUESTION = "How much worse is the answer of the chimney without the descents, or with another objective?"
MEASURES = "compiled", "design"
SEEDS, SEED = (0, 1, 2), 0
"""Seeds of the searches; the first one is that of a quick run."""
RUNS, RUNS_SEED = 4096, 987_654
"""Number and seed of the runs that evaluate a design."""
DRAWN = 400
"""Number of random designs from which those within the limits are taken."""


def problem(seed: int, **changes: Any) -> Any:
    """Return the problem of the chimney."""
    from tpd.cli.new import template
    from tpd.design.job import job_of
    from tpd.design.optimise import problem_of

    job = job_of(tomllib.loads(template("chimney")))
    return problem_of(job.scene, **job.settings | {"seed": seed} | changes)


def searched(**changes: Any) -> Callable[[int], np.ndarray | None]:
    """Return a function that finds the design of a seed with changed settings."""

    def find(seed: int) -> np.ndarray | None:
        from tpd.core.progress import unreported
        from tpd.design.first_guess import first_guess

        stated = problem(seed, **changes)
        return stated.improver(first_guess(stated), unreported).best([])

    return find


def kept(seed: int) -> tuple[Any, list[np.ndarray]]:
    """Return random designs that keep the limits in trial runs."""
    stated = problem(seed)
    drawn = stated.space.sample(np.random.default_rng([seed, 77]), DRAWN)
    run_seed = stated.run_seed(1, 0)
    inside = []
    for design in drawn[stated.possible(drawn)]:
        if stated.over_limit(design, stated.trial_runs(design, run_seed))[0] <= stated.allowed:
            inside.append(design)
    return stated, inside


def random(seed: int) -> np.ndarray | None:
    """Return the first random design that keeps the limits in trial runs."""
    return next(iter(kept(seed)[1]), None)


def best_of_random(seed: int) -> np.ndarray | None:
    """Return the random design of least objective among those that keep the limits in trial runs."""
    stated, inside = kept(seed)
    if not inside:
        return None
    designs = np.array(inside)
    return designs[np.argmin(stated.orbits.value(stated.orbits.evaluate(designs)))]


def guess(seed: int) -> np.ndarray | None:
    """Return the rule of thumb."""
    from tpd.design.first_guess import first_guess

    return first_guess(problem(seed))


WAYS: dict[str, Callable[[int], np.ndarray | None]] = {
    "descents on settling, smoothed (default)": searched(),
    "the same on exact orbits": searched(method=tpd.Descent(model="piecewise")),
    "the same, optax.adam": searched(method=tpd.Descent(optimiser="adam")),
    "without corrections by runs": searched(method=tpd.Descent(corrections=0)),
    "descents on the steady tilt": searched(objective=tpd.limits.SteadyTilt()),
    "best of random designs by the objective": best_of_random,
    "a random design": random,
    "rule of thumb": guess,
}
"""Ways to a design, by their words."""


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each way and seed."""
    stated = problem(SEED)
    ensemble = replace(stated.ensemble, size=256 if quick else RUNS, seed=RUNS_SEED)
    settings = {"ensemble": ensemble, "conditions": stated.conditions, "equations": "nonlinear", "rtol": 1e-6}
    bare = float(tpd.outcomes(stated.scene, None, **settings).share_overturned.value)
    rows = []
    for way, find in list(WAYS.items())[:: 6 if quick else 1]:
        for seed in SEEDS[: 1 if quick else None]:
            row, design = {"way": way, "seed": seed, "without": bare}, find(seed)
            if design is not None:
                runs = tpd.outcomes(stated.scene, stated.pendulum(design), **settings)
                row |= {"design": design.tolist(), "overturned": float(runs.share_overturned.value)}
                row["over"] = stated.over_limit(design, runs)[0]
            rows.append(row)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return the share that overturns, for each way."""
    out = []
    for way in dict.fromkeys(row["way"] for row in rows):
        mine = [row for row in rows if row["way"] == way and "overturned" in row]
        if not mine:
            continue
        shares = [row["overturned"] for row in mine]
        row = {"way": way, "median": float(np.median(shares)), "least": min(shares), "most": max(shares)}
        row |= {"over": max(row["over"] for row in mine), "seeds": len(mine), "without": mine[0]["without"]}
        out.append(row)
    heads = {"way": "{way}", "overturned, median": "{median:.1%}", "over seeds": "{least:.1%} to {most:.1%}"}
    heads |= {"runs over a limit": "{over:.1%}", "seeds": "{seeds}", "without pendulum": "{without:.1%}"}
    return columns(out, **heads)
