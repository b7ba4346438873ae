"""Compare the default job with a grid of designs, by paired runs that neither of them has used.

Every design of a grid over (mu, lam, zeta) is evaluated by paired runs of the nonlinear equations. Designs
that exceed a limit of the motion in more than 1 % of the runs are left out. The best of the others are
evaluated again, by the runs that evaluate the default design.
"""

import time
import tomllib
from typing import Any

import numpy as np

import tpd
from tests.benchmarks.stored import columns

QUESTION = "Is the default design as good as the best of a grid, and how long does the search take?"
SEED, RUNS = 9000, 2048
"""Seed and number of the runs that evaluate."""
GRID, TRIED, CHOSEN = (9, 9, 4), 96, 6
"""Points along mass, length and damping; runs for each; best designs that are evaluated again."""
OVER = 0.01
"""Largest share of the runs in which the block stands that may exceed a limit."""
BAND = "20 frequencies, worst case"


def scenes() -> dict[str, tuple[tpd.Scene, tpd.DesignSpace]]:
    """Return the chimney of the README, with impact loss, and a wide machine with friction."""
    from tpd.cli.new import template
    from tpd.design.job import job_of

    chimney = job_of(tomllib.loads(template("chimney")))
    flat = tpd.Block(width=0.9, height=2.0, mass=1200.0, friction=0.05, restitution=1.0, cavity_width=0.8)
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.2), length_ratio=(0.1, 0.8), damping_ratio=(0.05, 0.6))
    return {
        "chimney": (chimney.scene, chimney.space),
        "flat machine, friction": (tpd.Scene(flat, tpd.Harmonic(amplitude=0.104, frequency=1.5)), space),
    }


class Evaluator:
    """Benefit, its interval, and the share of runs that exceed a limit, by paired runs of a problem."""

    def __init__(self, scene: tpd.Scene, space: tpd.DesignSpace, size: int, seed: int) -> None:
        from tpd.design.harmonic import HarmonicProblem

        # Of the validation runs, paired runs of a problem take one half.
        self.problem = HarmonicProblem.of(scene, space, ensemble=tpd.Ensemble(size=2 * size))
        self.seed = seed

    def __call__(self, design: np.ndarray) -> dict[str, Any]:
        runs = self.problem.paired_runs(design, self.seed)
        over, _ = self.problem.over_limit(design, runs.with_pendulum)
        benefit = runs.benefit
        return {"benefit": benefit.mean, "interval": [benefit.low, benefit.high], "wall_contacts": over}


def brute_force(
    scene: tpd.Scene, space: tpd.DesignSpace, evaluate: Evaluator, sizes: tuple, tried: int
) -> dict[str, Any]:
    """Return the best design of a grid whose edges are the bounds of the space."""
    begun, choosing = time.perf_counter(), Evaluator(scene, space, tried, SEED + 1)
    axes = [np.linspace(0.0, 1.0, n) for n in sizes[: space.bounds.shape[1]]]
    units = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    designs = space.unscaled(units)
    first = [choosing(design) for design in designs]
    kept = [i for i, found in enumerate(first) if found["wall_contacts"] <= OVER]
    best = sorted(kept, key=lambda i: -first[i]["benefit"])[:CHOSEN]
    again = [evaluate(designs[i]) for i in best]
    keeps = [found for found in again if found["wall_contacts"] <= OVER]
    out = {"designs": len(designs), "keep": len(kept), "seconds": time.perf_counter() - begun}
    return out | max(keeps, key=lambda found: found["benefit"], default={})


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each scene, and one for a design over a band of frequencies."""
    rows = []
    for name, (scene, space) in list(scenes().items())[: 1 if quick else None]:
        begun = time.perf_counter()
        design = tpd.optimise(scene, space)
        row = {"scene": name, "seconds": time.perf_counter() - begun, "status": design.status.name}
        evaluate = Evaluator(scene, space, 64 if quick else RUNS, SEED)
        if design.benefit is not None:
            row["ours"] = evaluate(design.nearest)
            row["quoted"] = [design.benefit.low, design.benefit.high]
        grid = ((2, 2, 2), 16) if quick else (GRID, TRIED)
        rows.append(row | {"grid": brute_force(scene, space, evaluate, *grid)})
    scene, seconds = tpd.paper_scene(), []
    limits = (tpd.limits.Stroke(), tpd.limits.Reserve(), tpd.limits.Mass(3.0))
    given = {"conditions": tpd.Conditions.band(scene, 2.0, 3.5, 20), "limits": limits}
    method = tpd.Descent(searches=4, screening=32, steps=16) if quick else tpd.Descent(searches=64)
    space = tpd.DesignSpace(damping_ratio=(0.05, 0.4))
    for seed in range(2):
        begun = time.perf_counter()
        design = tpd.optimise(scene, space, method=method, seed=seed, **given)
        seconds.append(time.perf_counter() - begun)
    return [*rows, {"scene": BAND, "seconds": seconds[-1], "first": seconds[0], "status": design.status.name}]


def behind(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Return by how many points the benefit of the default design is below the best of the grid."""
    out = {}
    for r in rows:
        best = r.get("grid", {}).get("benefit")
        if best is not None:
            out[r["scene"]] = 100.0 * (best - r.get("ours", {"benefit": 0.0})["benefit"])
    return out


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of the benefits, by runs that were not used to choose a design."""
    said = "{{{0}[benefit]:.1%}} ({{{0}[interval][0]:.1%}} to {{{0}[interval][1]:.1%}})"
    said += ", {{{0}[wall_contacts]:.2%}} exceed a limit"
    heads = {"job": "{scene}", "status": "{status}", "s": "{seconds:.1f}"}
    heads |= {"default: benefit (95 %)": said.format("ours"), "best of the grid": said.format("grid")}
    size = "{grid[designs]}, {grid[keep]} keep to the limits, {grid[seconds]:.0f} s"
    return columns(rows, **heads, **{"designs of the grid": size})
