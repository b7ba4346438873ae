"""Does the gradient pay: sequential programming of `tpd.optimise` against its descents by optax and against
derivative-free methods, on the same exact objective, from ten seeds each. Prints a table for each problem and
draws `proof.png`. The runs are stored in `results/proof.json`; `--draw` prints and draws the stored runs, and
`--ours` runs our methods only, compares with the best values that all methods have found, and stores nothing.

.venv/bin/python -m tests.benchmarks.proof
"""

import argparse
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from threading import Condition

import jax
import numpy as np
from scipy.optimize import differential_evolution, minimize

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tests.benchmarks.proof_runs import (  # noqa: E402
    PICTURE,
    VERSIONS,
    Run,
    draw,
    formatted,
    store,
    stored,
    table,
)
from tpd.design.checkpoint import Checkpoint  # noqa: E402
from tpd.design.ends import merit_of  # noqa: E402
from tpd.design.methods import Method  # noqa: E402
from tpd.design.objective import Orbits  # noqa: E402
from tpd.design.problem import Problem  # noqa: E402
from tpd.design.search import Multistart  # noqa: E402

SEEDS = 10
OURS = {"screening": 32, "searches": 4, "steps": 16}
"""One budget for all problems."""
FIRST_ORDER_STEPS = 60
"""Steps of the descents by optax, from the same designs."""
BUDGET = 1000
"""Designs after which restarts of the peers end; a run that is going on is finished."""
GRID = 20
"""Designs on an edge of the grid."""

SCENE = tpd.paper_scene()
SLIM = replace(SCENE, block=replace(SCENE.block, width=0.08, cavity_width=None))
LESS = replace(SCENE, motion=replace(SCENE.motion, amplitude=0.012))
SPACE = tpd.DesignSpace(mass_ratio=(0.01, 0.2), length_ratio=(0.1, 1.5), damping_ratio=(0.05, 0.4))
SCATTER = tpd.Conditions.scatter(
    32, frequency=0.25, amplitude=0.1, friction=0.2, mass=0.05, length=0.05, damping=0.2
)


def problem(
    scene: tpd.Scene,
    conditions: tpd.Conditions,
    risk: tpd.Risk,
    *,
    stroke: float = 0.5,
    starts: tpd.Starts | None = None,
) -> Orbits:
    """Objective of one problem: all symmetric orbits, the risk of their tilts, and limits."""
    limits = tpd.limits.Stroke(stroke), tpd.limits.Reserve()
    method = tpd.Sequential(**OURS)
    given = {"conditions": conditions, "starts": starts, "risk": risk, "limits": limits, "method": method}
    return Problem.of(scene, SPACE, **given).objective


WORST = tpd.Risk.worst()
PROBLEMS = {
    "the paper's block, 2 to 3.5 Hz, worst of 20": problem(
        SCENE, tpd.Conditions.band(SCENE, 2.0, 3.5), WORST
    ),
    "the paper's block, 32 scattered, worst tenth": problem(SCENE, SCATTER, tpd.Risk.cvar(0.1)),
    "a slimmer block, 2.2 to 2.8 Hz, stroke 0.8, worst of 20": problem(
        SLIM, tpd.Conditions.band(SLIM, 2.2, 2.8), WORST, stroke=0.8
    ),
    "shaken less, 1.5 to 2.8 Hz, from rest, worst of 20": problem(
        LESS, tpd.Conditions.band(LESS, 1.5, 2.8), WORST, starts=tpd.Starts.rest()
    ),
}
BEST = dict(zip(PROBLEMS, (0.273001, 0.298278, 0.285809, -0.129505), strict=True))
"""Best values of all methods, peers included, on 2026-11-22."""


def merits(objective: Orbits, unit: np.ndarray) -> np.ndarray:
    """Risk plus penalty of broken limits, (k,), at designs in shares of the bounds, (k, 3)."""
    return merit_of(objective.at(np.clip(unit, 0.0, 1.0)), objective.risk.of)


class Together:
    """Answers the designs of several threads in one call, once every thread has asked for one."""

    def __init__(self, objective: Orbits, threads: int) -> None:
        self.objective, self.threads, self.asked = objective, threads, []
        self.turn = Condition()

    def __call__(self, unit: np.ndarray) -> np.ndarray:
        answer: list[np.ndarray] = []
        with self.turn:
            self.asked.append((unit, answer))
            self._answer()
            self.turn.wait_for(lambda: answer)
        return answer[0]

    def leave(self) -> None:
        """One thread less to wait for."""
        with self.turn:
            self.threads -= 1
            self._answer()

    def _answer(self) -> None:
        if self.asked and len(self.asked) == self.threads:
            values = merits(self.objective, np.concatenate([unit for unit, _ in self.asked]))
            for (_, answer), value in zip(self.asked, values, strict=True):
                answer.append(value[None])
            self.asked = []
            self.turn.notify_all()


class Ledger:
    """Values of designs in shares of the bounds, (k, 3), every one written down."""

    def __init__(self, objective: Orbits, by: Callable[[np.ndarray], np.ndarray] | None = None) -> None:
        self.by = partial(merits, objective) if by is None else by
        self.values: list[float] = []

    def __call__(self, unit: np.ndarray) -> np.ndarray:
        values = self.by(unit)
        self.values.extend(values)
        return values

    def one(self, unit: np.ndarray) -> float:
        """Of a single design, (3,)."""
        return float(self(unit[None])[0])

    def run(self, began: float, until: int | None = None) -> Run:
        """What was written down, or its beginning."""
        best = np.minimum.accumulate(np.array(self.values[:until]))
        return Run(1 + np.arange(len(best)), best, time.perf_counter() - began)


def ours(objective: Orbits, seed: int, method: Method | None = None) -> Run:
    """Screening, and searches from the best of it; by default by sequential programming."""
    began = time.perf_counter()
    search = Multistart(objective, tpd.Sequential(**OURS) if method is None else method, seed, None)
    search.run(Checkpoint.of(None, None))
    (found,) = search.groups
    seconds = time.perf_counter() - began
    screened = Ledger(objective)
    screened(objective.space.scaled(search.screened))
    counts = len(screened.values) + found.path_spent
    first = screened.run(began)
    best = np.minimum.accumulate([first.best[-1], *found.path_merit.min(axis=1)])[1:]
    return Run(np.append(first.evaluations, counts), np.append(first.best, best), seconds)


def first_order(optimiser: str) -> Method:
    """Descent by an optimiser of optax, from the same designs."""
    return tpd.Descent(optimiser, **{**OURS, "steps": FIRST_ORDER_STEPS})


def evolution(objective: Orbits, seed: int) -> dict[str, Run]:
    """SciPy's differential evolution as it comes; and what it had before it polished its result."""
    ledger, began, generations = Ledger(objective), time.perf_counter(), []
    differential_evolution(
        lambda x: ledger(x.T) if x.ndim > 1 else ledger.one(x),
        [(0.0, 1.0)] * 3,
        rng=np.random.default_rng(seed),
        vectorized=True,
        updating="deferred",
        callback=lambda intermediate_result: generations.append((len(ledger.values), time.perf_counter())),
    )
    count, ended = generations[-1]
    plain = ledger.run(began, count)._replace(seconds=ended - began)
    return {"differential evolution": plain, "the same, polished": ledger.run(began)}


def simplex(objective: Orbits, seeds: int) -> list[Run]:
    """Nelder and Mead's, from random designs again and again. It asks for one design at a time, and a call
    answers many conditions as fast as few: so all seeds go in step, each charged its share of the time."""
    together, began = Together(objective, seeds), time.perf_counter()

    def one(seed: int) -> Ledger:
        ledger, rng = Ledger(objective, together), np.random.default_rng([seed, 1])
        try:
            while len(ledger.values) < BUDGET:
                corner = rng.random(3)
                edges = np.where(corner < 0.5, 0.25, -0.25) * np.eye(3)
                first = np.concatenate([corner[None], corner + edges])
                options = {"initial_simplex": first, "xatol": 1e-4, "fatol": 1e-5}
                minimize(ledger.one, corner, method="Nelder-Mead", bounds=[(0.0, 1.0)] * 3, options=options)
        finally:
            together.leave()
        return ledger

    with ThreadPoolExecutor(seeds) as pool:
        ledgers = list(pool.map(one, range(seeds)))
    seconds = (time.perf_counter() - began) / seeds
    return [ledger.run(began)._replace(seconds=seconds) for ledger in ledgers]


def adaptation(objective: Orbits, seed: int) -> Run:
    """CMA-ES, restarted with twice the population."""
    import cma  # drawing what is stored does without this package

    ledger, began, rng = Ledger(objective), time.perf_counter(), np.random.default_rng([seed, 2])
    restarts = 0
    while len(ledger.values) < BUDGET:
        options = {
            "bounds": [0.0, 1.0],
            "seed": 1 + 100 * seed + restarts,
            "popsize": 7 * 2**restarts,
            "tolfun": 1e-6,
            "verbose": -9,
        }
        strategy = cma.CMAEvolutionStrategy(rng.random(3), 0.3, options)
        while not strategy.stop():
            designs = strategy.ask()
            strategy.tell(designs, ledger(np.array(designs)).tolist())
        restarts += 1
    return ledger.run(began)


def chance(objective: Orbits, seed: int) -> Run:
    """Random designs."""
    ledger, began = Ledger(objective), time.perf_counter()
    ledger(np.random.default_rng([seed, 3]).random((BUDGET, 3)))
    return ledger.run(began)


def grid(objective: Orbits) -> Run:
    """Every design of a grid, in random order for the sake of the picture."""
    ledger, began = Ledger(objective), time.perf_counter()
    line = np.linspace(0.0, 1.0, GRID)
    designs = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    ledger(np.random.default_rng(0).permutation(designs))
    return ledger.run(began)


OWN: dict[str, Callable[[Orbits, int], Run]] = {
    "ours": ours,
    "optax: Adam": partial(ours, method=first_order("adam")),
    "optax: RMSprop": partial(ours, method=first_order("rmsprop")),
}
PEERS: dict[str, Callable[[Orbits, int], Run | dict[str, Run]]] = {
    "differential evolution": evolution,
    "CMA-ES, restarted": adaptation,
    "random": chance,
}


def solved(objective: Orbits, seeds: int, peers: bool = True) -> dict[str, list[Run]]:
    """Runs of all methods from all seeds."""
    objective.at(np.full((8, 3), 0.5))
    ours(objective, 0)
    runs: dict[str, list[Run]] = {}
    for name, method in (OWN | PEERS if peers else OWN).items():
        for seed in range(seeds):
            out = method(objective, seed)
            for label, run in ({name: out} if isinstance(out, Run) else out).items():
                runs.setdefault(label, []).append(run)
    if peers:
        runs["Nelder-Mead, restarted"] = simplex(objective, seeds)
        runs["grid"] = [grid(objective)]
    return runs


def measured(seeds: int, peers: bool) -> dict[str, dict[str, list[Run]]]:
    """Runs on all problems; prints a table as each is done."""
    names = VERSIONS if peers else VERSIONS[:-1]
    print(", ".join(f"{name} {version(name)}" for name in names))
    print(", ".join(f"{name} {value}" for name, value in OURS.items()), flush=True)
    results = {}
    for name, objective in PROBLEMS.items():
        results[name] = solved(objective, seeds, peers)
        print(formatted(name, *table(results[name], None if peers else BEST[name])), flush=True)
    return results


def main() -> None:
    """Measure or read the runs, print the tables and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--picture", type=Path, default=PICTURE)
    parser.add_argument("--draw", action="store_true", help="print and draw the stored runs")
    parser.add_argument("--ours", action="store_true", help="our methods only; nothing is stored")
    asked = parser.parse_args()
    if asked.draw:
        results = stored()
        for name, runs in results.items():
            print(formatted(name, *table(runs)))
        draw(results, asked.picture)
        return
    results = measured(asked.seeds, peers=not asked.ours)
    if not asked.ours:
        store(results, OURS)
        draw(results, asked.picture)


if __name__ == "__main__":
    main()
