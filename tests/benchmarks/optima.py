"""Compare optimisers of optax with derivative-free methods.

All minimise the same exact function of (mu, lam, zeta): the risk of the tilts under all conditions plus ten
times the excess over a limit. A design counts once, screening included; its slopes do not count.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import tpd
from tests.benchmarks.stored import columns

QUESTION = "Does the gradient help, against derivative-free methods on the same function?"
MEASURES = "models", "design/search", "design/newton", "design/orbits", "design/sizes", "design/settings"
SEED, SEEDS = 0, 5
"""First seed, and number of seeds."""
NEAR, BUDGET = 1e-3, 1000
"""Relative distance that counts as the best value; designs after which other methods do not restart."""
METHODS = {
    "optax, Newton": tpd.Descent(screening=32, searches=4, steps=80),
    "optax, Adam": tpd.Descent(optimiser="adam", screening=32, searches=4, steps=80),
}
"""Methods. Both descend with smoothed signs from the same four designs of the screening. The last steps are
those of Newton's method on the exact orbits."""


def problems() -> dict[str, Any]:
    """Return the problems by their names."""
    from tpd.design.optimise import problem_of

    scene = tpd.paper_scene()
    slim = replace(scene, block=replace(scene.block, width=0.08, cavity_width=None))
    less = replace(scene, excitation=replace(scene.excitation, amplitude=0.012))
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.2), length_ratio=(0.1, 1.5), damping_ratio=(0.05, 0.4))
    given = {
        "paper's block, 2 to 3.5 Hz": (scene, (2.0, 3.5), 0.5, None),
        "slimmer block, 2.2 to 2.8 Hz": (slim, (2.2, 2.8), 0.8, None),
        "shaken less, from rest": (less, (1.5, 2.8), 0.5, tpd.Starts.rest()),
    }
    out = {}
    for name, (of, band, swing, starts) in given.items():
        limits = tpd.limits.Stroke(swing), tpd.limits.Reserve()
        conditions = tpd.Conditions.band(of, *band)
        asked = {"conditions": conditions, "starts": starts, "risk": tpd.Risk.worst(), "limits": limits}
        asked["objective"] = tpd.limits.SteadyTilt()
        out[name] = problem_of(of, space, **asked)
    return out


class Ledger:
    """Values of designs (k, 3), in shares of the bounds; it records every value."""

    def __init__(self, objective: Any) -> None:
        self.objective, self.values = objective, []

    def __call__(self, unit: np.ndarray) -> np.ndarray:
        from tpd.design.search import merit_of

        values = merit_of(self.objective.at(np.clip(np.atleast_2d(unit), 0.0, 1.0)), self.objective.risk.of)
        self.values.extend(float(v) for v in values)
        return values

    def one(self, unit: np.ndarray) -> float:
        """Return the value of a single design."""
        return float(self(unit)[0])

    def path(self) -> list[float]:
        """Best value so far, after each design."""
        return np.minimum.accumulate(self.values).tolist()


def ours(problem: Any, seed: int, method: Any) -> list[float]:
    """Return the best exact value after each design of the screening and of the descents."""
    from tpd.design.search import search

    objective = problem.orbits
    found = search(objective, replace(method, model=problem.method.model), seed)
    screened = Ledger(objective)
    screened(objective.space.scaled(found.screened))
    best = screened.path()
    # A step evaluates one design of each descent. The paths have the best designs so far, the starts first.
    for designs in np.stack(found.paths, axis=1)[1:]:
        best += [best[-1]] * (len(designs) - 1) + [min(best[-1], *screened(objective.space.scaled(designs)))]
    return best


def simplex(problem: Any, seed: int) -> list[float]:
    """Return the same for the method of Nelder and Mead, restarted from random designs."""
    from scipy.optimize import minimize

    ledger, rng = Ledger(problem.orbits), np.random.default_rng([seed, 1])
    while len(ledger.values) < BUDGET:
        corner = rng.random(3)
        first = np.concatenate([corner[None], corner + np.where(corner < 0.5, 0.25, -0.25) * np.eye(3)])
        options = {"initial_simplex": first, "xatol": 1e-4, "fatol": 1e-5}
        minimize(ledger.one, corner, method="Nelder-Mead", bounds=[(0.0, 1.0)] * 3, options=options)
    return ledger.path()


def adaptation(problem: Any, seed: int) -> list[float]:
    """Return the same for CMA-ES, restarted with twice the population."""
    import cma

    ledger, rng, restarts = Ledger(problem.orbits), np.random.default_rng([seed, 2]), 0
    while len(ledger.values) < BUDGET:
        options = {"bounds": [0.0, 1.0], "seed": 1 + 100 * seed + restarts, "popsize": 7 * 2**restarts}
        strategy = cma.CMAEvolutionStrategy(rng.random(3), 0.3, options | {"tolfun": 1e-6, "verbose": -9})
        while not strategy.stop():
            asked = strategy.ask()
            strategy.tell(asked, ledger(np.array(asked)).tolist())
        restarts += 1
    return ledger.path()


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each problem, method and seed: best values, and the designs after which they fell."""
    ways: dict[str, Callable[[Any, int], list[float]]] = {
        name: lambda p, seed, m=method: ours(p, seed, m) for name, method in METHODS.items()
    }
    ways |= {"Nelder-Mead, restarted": simplex, "CMA-ES, restarted": adaptation}
    rows, found = [], problems()
    for name in list(found)[: 1 if quick else None]:
        ours(found[name], SEED, METHODS["optax, Newton"])
        for method, way in list(ways.items())[:: 2 if quick else 1]:
            for seed in range(SEED, SEED + (1 if quick else SEEDS)):
                begun = time.perf_counter()
                path = np.array(way(found[name], seed))
                row = {"problem": name, "method": method, "seed": seed, "designs": len(path)}
                row["seconds"] = time.perf_counter() - begun
                falls = np.flatnonzero(np.diff(path, prepend=np.inf) < 0.0)
                # Seven digits of the value: the gap that counts is a thousandth of it.
                rows.append(row | {"at": (falls + 1).tolist(), "best": [f"{v:.7g}" for v in path[falls]]})
    return rows


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return for each problem and method the seeds within `NEAR`, the median designs, and the largest gap."""
    out = []
    for problem, method in dict.fromkeys((r["problem"], r["method"]) for r in rows):
        best = min(float(r["best"][-1]) for r in rows if r["problem"] == problem)
        mine = [r for r in rows if (r["problem"], r["method"]) == (problem, method)]
        until = []
        for r in mine:
            met = [n for n, v in zip(r["at"], r["best"], strict=True) if float(v) <= best + NEAR * abs(best)]
            until.append(float(met[0]) if met else np.inf)
        gap = max((float(r["best"][-1]) - best) / abs(best) for r in mine)
        row = {"problem": problem, "method": method, "value": best, "gap": gap, "seeds": len(mine)}
        row |= {"hits": int(np.isfinite(until).sum()), "until": float(np.median(until))}
        row |= {k: float(np.median([r[k] for r in mine])) for k in ("designs", "seconds")}
        out.append(row)
    return out


def table(rows: list[dict[str, Any]]) -> str:
    """Return medians over the seeds; "inf" if at most half of the seeds reach the best value."""
    heads = {"problem": "{problem}", "best value": "{value:.6g}", "method": "{method}"}
    heads |= {
        "seeds that reach it": "{hits} of {seeds}",
        "designs until reached": "{until:.0f}",
        "designs in total": "{designs:.0f}",
    }
    return columns(summary(rows), **heads, **{"largest gap": "{gap:.0e}", "s": "{seconds:.2g}"})
