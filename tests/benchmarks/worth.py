"""The default job against brute force, both judged by fresh paired runs of the nonlinear equations.

Brute force follows every design of a grid over (mu, lam, zeta) by paired runs, takes the best of those in
which the bob strikes a wall in at most 1 % of the runs, and judges these by the runs that judge the default
answer.
"""

import time
import tomllib
from typing import Any

import numpy as np

import tpd
from tests.benchmarks.stored import columns

QUESTION = "Is the default answer as good as brute force, and how long does it take?"
SEED, RUNS = 9000, 2048
"""Of the fresh runs, and how many."""
GRID, TRIED, CHOSEN = (9, 9, 4), 96, 6
"""Points along mass, length and damping; runs of each that choose; designs of the grid that are judged."""
STRIKES = 0.01
BAND = "20 frequencies, worst case"


def scenes() -> dict[str, tuple[tpd.Scene, tpd.DesignSpace]]:
    """The chimney of the README, which impacts damp, and a wide machine with friction."""
    from tpd.cli.new import template
    from tpd.design.job import job_of

    chimney = job_of(tomllib.loads(template("chimney")))
    flat = tpd.Block(width=0.9, height=2.0, mass=1200.0, friction=0.05, cavity_width=0.9)
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.2), length_ratio=(0.1, 0.8), damping_ratio=(0.05, 0.6))
    return {
        "chimney": (chimney.scene, chimney.space),
        "flat machine, friction": (tpd.Scene(flat, tpd.Harmonic(amplitude=0.104, frequency=1.5)), space),
    }


class Judge:
    """Benefit, its interval, and the share of runs that strike, by paired runs of a problem."""

    def __init__(self, scene: tpd.Scene, space: tpd.DesignSpace, size: int, seed: int) -> None:
        from tpd.design.by_runs import PairedRuns

        from tpd.design.criteria import Room, Worth, limit_of
        from tpd.design.problem import Problem

        objective = Problem.of(scene, space).objective
        self.bob = limit_of(objective.limits, Room).bob
        self.runs = PairedRuns(scene, objective.conditions, tpd.Ensemble(size=size, seed=seed), Worth(), None)

    def __call__(self, pendulum: tpd.Pendulum) -> dict[str, Any]:
        from tpd.design.by_runs import strikes_of

        found, benefit = self.runs.of(pendulum)
        strikes = strikes_of(found, pendulum, self.runs.scene.block, self.bob)
        return {"benefit": benefit.value, "interval": [benefit.low, benefit.high], "strikes": strikes}


def brute_force(
    scene: tpd.Scene, space: tpd.DesignSpace, fresh: Judge, sizes: tuple, tried: int
) -> dict[str, Any]:
    """The best of a grid that has the bounds of the space at its edges."""
    begun, choosing = time.perf_counter(), Judge(scene, space, tried, SEED + 1)
    axes = [np.linspace(0.0, 1.0, n) for n in sizes[: space.bounds.shape[1]]]
    units = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    names, designs = ("mass_ratio", "length_ratio", "damping_ratio"), space.full(space.unscaled(units))
    hung = [scene.pendulum(**dict(zip(names, x, strict=True))) for x in designs]
    first = [choosing(p) for p in hung]
    kept = [i for i, found in enumerate(first) if found["strikes"] <= STRIKES]
    best = sorted(kept, key=lambda i: -first[i]["benefit"])[:CHOSEN]
    judged = [fresh(hung[i]) for i in best]
    keeps = [found for found in judged if found["strikes"] <= STRIKES]
    out = {"designs": len(hung), "keep": len(kept), "seconds": time.perf_counter() - begun}
    return out | max(keeps, key=lambda found: found["benefit"], default={})


def run(quick: bool) -> list[dict[str, Any]]:
    """A row a scene, and one of a design over a band."""
    rows = []
    for name, (scene, space) in list(scenes().items())[: 1 if quick else None]:
        begun = time.perf_counter()
        design = tpd.optimise(scene, space)
        row = {"scene": name, "seconds": time.perf_counter() - begun, "status": design.status.name}
        fresh = Judge(scene, space, 64 if quick else RUNS, SEED)
        if design.pendulum is not None:
            row["ours"] = fresh(design.pendulum)
            row["quoted"] = [design.winner.benefit.low, design.winner.benefit.high]
        grid = ((2, 2, 2), 16) if quick else (GRID, TRIED)
        rows.append(row | {"grid": brute_force(scene, space, fresh, *grid)})
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
    """Points of benefit by which the default answer is below the best of the grid; if none, all of it."""
    out = {}
    for r in rows:
        best = r.get("grid", {}).get("benefit")
        if best is not None:
            out[r["scene"]] = 100.0 * (best - r.get("ours", {"benefit": 0.0})["benefit"])
    return out


def table(rows: list[dict[str, Any]]) -> str:
    """Less mean tilt on fresh runs."""
    said = "{{{0}[benefit]:.1%}} ({{{0}[interval][0]:.1%}} to {{{0}[interval][1]:.1%}})"
    said += ", strikes {{{0}[strikes]:.2%}}"
    heads = {"job": "{scene}", "status": "{status}", "s": "{seconds:.1f}"}
    heads |= {"default: less tilt (95 %)": said.format("ours"), "best of the grid": said.format("grid")}
    size = "{grid[designs]}, {grid[keep]} keep off the walls, {grid[seconds]:.0f} s"
    return columns(rows, **heads, **{"designs of the grid": size})
