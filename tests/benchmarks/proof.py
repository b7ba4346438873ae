"""Does the gradient pay: the search of `tpd.optimise_over` against its own optax methods and against
derivative-free ones, on the same exact objective, from ten seeds each. Prints a table a problem and
draws `proof.png`. The runs are stored in `results/proof.json`; `--draw` draws and prints what is stored.

.venv/bin/python -m tests.benchmarks.proof
"""

import argparse
import datetime
import json
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from threading import Condition
from typing import Any, NamedTuple

import jax
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.optimize import differential_evolution, minimize

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tests.benchmarks.tables import compact  # noqa: E402
from tpd.core.files import place  # noqa: E402
from tpd.design.checkpoint import Kept  # noqa: E402
from tpd.design.objective import Objective  # noqa: E402
from tpd.design.search import Search  # noqa: E402
from tpd.design.sequential import merit_of  # noqa: E402

SEEDS = 10
VERSIONS = ("tpd", "jax", "numpy", "scipy", "cma")
NEAR = 1e-3
"""Distance from the best value anybody found, a share of it, that counts as found."""
OURS = {"screening": 32, "starts": 4, "steps": 16}
"""One budget for all problems."""
BUDGET = 1000
"""Designs after which restarts of the peers end; a run that is going on is finished."""
GRID = 20
"""Designs on an edge of the grid."""
PICTURE = Path(__file__).parents[2] / "notebooks" / "pictures" / "proof.png"
RESULTS = Path(__file__).with_name("results") / "proof.json"
COMMAND = "python -m tests.benchmarks.proof"

SCENE = tpd.paper_scene()
SLIM = replace(SCENE, block=replace(SCENE.block, width=0.08))
LESS = replace(SCENE, motion=replace(SCENE.motion, amplitude=0.012))
SPACE = tpd.DesignSpace(
    mass_ratio=(0.01, 0.2), length_ratio=(0.1, 1.5), damping_ratio=(0.05, 0.4), stroke=0.5
)
SCATTER = tpd.Conditions.scatter(
    32, frequency=0.25, amplitude=0.1, friction=0.2, mass=0.05, length=0.05, damping=0.2
)


def asked(
    scene: tpd.Scene,
    conditions: tpd.Conditions,
    measure: tpd.Measure,
    *,
    stroke: float = 0.5,
    from_rest: bool = False,
) -> Objective:
    """One problem."""
    space = replace(SPACE, stroke=stroke)
    return Objective(scene.parameters(), conditions, space, measure, tpd.Limits(), from_rest)


WORST = tpd.Measure.worst()
PROBLEMS = {
    "the paper's block, 2 to 3.5 Hz, worst of 20": asked(SCENE, tpd.Conditions.band(SCENE, 2.0, 3.5), WORST),
    "the paper's block, 32 scattered, worst tenth": asked(SCENE, SCATTER, tpd.Measure.cvar(0.1)),
    "a slimmer block, 2.2 to 2.8 Hz, stroke 0.8, worst of 20": asked(
        SLIM, tpd.Conditions.band(SLIM, 2.2, 2.8), WORST, stroke=0.8
    ),
    "shaken less, 1.5 to 2.8 Hz, from rest, worst of 20": asked(
        LESS, tpd.Conditions.band(LESS, 1.5, 2.8), WORST, from_rest=True
    ),
}


class Run(NamedTuple):
    """One method from one seed."""

    evaluations: np.ndarray
    """Designs evaluated by then."""
    best: np.ndarray
    """The best value so far, of the same length."""
    seconds: float


def merits(objective: Objective, unit: np.ndarray) -> np.ndarray:
    """What is minimised, at designs in shares of the bounds, (k, 3)."""
    return merit_of(objective.local(np.clip(unit, 0.0, 1.0)), objective.measure.of)


class Together:
    """Answers the designs of several threads in one call, once every thread has asked for one."""

    def __init__(self, objective: Objective, threads: int) -> None:
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

    def __init__(self, objective: Objective, by: Callable[[np.ndarray], np.ndarray] | None = None) -> None:
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


def ours(objective: Objective, seed: int, **budget: Any) -> Run:
    """Screening, and descents from the best of it."""
    began = time.perf_counter()
    search = Search(objective, **{**OURS, **budget}, seed=seed, progress=None)
    search.run(Kept.of(None, None))
    (found,) = search.groups
    seconds = time.perf_counter() - began
    screened = Ledger(objective)
    screened((search.screened - search.low) / (search.high - search.low))
    counts = len(screened.values) + found.path_spent
    first = screened.run(began)
    best = np.minimum.accumulate([first.best[-1], *found.path_merit.min(axis=1)])[1:]
    return Run(np.append(first.evaluations, counts), np.append(first.best, best), seconds)


def evolution(objective: Objective, seed: int) -> dict[str, Run]:
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


def simplex(objective: Objective, seeds: int) -> list[Run]:
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


def adaptation(objective: Objective, seed: int) -> Run:
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


def chance(objective: Objective, seed: int) -> Run:
    """Random designs."""
    ledger, began = Ledger(objective), time.perf_counter()
    ledger(np.random.default_rng([seed, 3]).random((BUDGET, 3)))
    return ledger.run(began)


def grid(objective: Objective) -> Run:
    """Every design of a grid, in random order for the sake of the picture."""
    ledger, began = Ledger(objective), time.perf_counter()
    line = np.linspace(0.0, 1.0, GRID)
    designs = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    ledger(np.random.default_rng(0).permutation(designs))
    return ledger.run(began)


METHODS: dict[str, Callable[[Objective, int], Run | dict[str, Run]]] = {
    "ours": ours,
    "optax: Adam": partial(ours, method="adam", steps=60),
    "optax: L-BFGS": partial(ours, method="lbfgs", steps=60),
    "differential evolution": evolution,
    "CMA-ES, restarted": adaptation,
    "random": chance,
}


def solved(objective: Objective, seeds: int) -> dict[str, list[Run]]:
    """All methods from all seeds."""
    objective.local(np.full((8, 3), 0.5))
    ours(objective, 0)
    runs: dict[str, list[Run]] = {}
    for name, method in METHODS.items():
        for seed in range(seeds):
            out = method(objective, seed)
            for label, run in ({name: out} if isinstance(out, Run) else out).items():
                runs.setdefault(label, []).append(run)
    runs["Nelder-Mead, restarted"] = simplex(objective, seeds)
    runs["grid"] = [grid(objective)]
    return runs


def reached(run: Run, goal: float) -> float:
    """Designs evaluated until the goal; infinite where it was not met."""
    met = np.flatnonzero(run.best <= goal)
    return float(run.evaluations[met[0]]) if len(met) else np.inf


class Row(NamedTuple):
    """What a table says of a method."""

    hits: int
    runs: int
    until: float
    """Median number of designs until it was there; infinite where no more than half were."""
    total: float
    seconds: float
    worst: float
    """The largest distance from the best at the end, a share of the best."""


def table(runs: dict[str, list[Run]]) -> tuple[float, dict[str, Row]]:
    """The best value of all, and a row a method."""
    best = min(run.best[-1] for of in runs.values() for run in of)
    goal = best + NEAR * abs(best)
    rows = {}
    for name, of in runs.items():
        until = [reached(run, goal) for run in of]
        rows[name] = Row(
            int(np.isfinite(until).sum()),
            len(of),
            float(np.median(until)),
            float(np.median([run.evaluations[-1] for run in of])),
            float(np.median([run.seconds for run in of])),
            float(max(_gap(run, best)[-1] for run in of)),
        )
    return best, rows


def told(name: str, best: float, rows: dict[str, Row]) -> str:
    """The table, and whether ours does what is asked of it."""
    head = f"{'method':26}{'within 0.1 %':>13}{'until there':>12}{'in all':>8}{'seconds':>9}{'worst gap':>10}"
    lines = [f"\n{name}: best {best:.8g}", head]
    for method, r in rows.items():
        lines.append(
            f"{method:26}{r.hits:6} of {r.runs:<3}{r.until:12.0f}{r.total:8.0f}{r.seconds:9.2f}"
            f"{r.worst:10.0e}"
        )
    peers = {m: r for m, r in rows.items() if m not in ("ours", "grid") and not m.startswith("optax")}
    sound = {m: r for m, r in peers.items() if r.hits >= 0.9 * r.runs}
    own, close = rows["ours"], min((sound or peers).items(), key=lambda item: item[1].until)
    share = own.until / close[1].until
    lines.append(
        f"best peer: {close[0]}{'' if sound else ', though not in nine of ten'}; ours needs {share:.1%} of "
        f"its designs (reach: 5 %, {'met' if share <= 0.05 else 'NOT met'}) and is there in {own.hits} of "
        f"{own.runs} (reach: nine of ten, {'met' if own.hits >= 0.9 * own.runs else 'NOT met'})"
    )
    return "\n".join(lines)


STYLES = {
    "ours": ("#000000", "-", 2.2),
    "optax: Adam": ("#000000", (0, (1, 1)), 1.4),
    "optax: L-BFGS": ("#000000", (0, (5, 2)), 1.4),
    "differential evolution": ("#0072b2", "--", 1.4),
    "the same, polished": ("#56b4e9", (0, (6, 2, 1, 2)), 1.4),
    "Nelder-Mead, restarted": ("#d55e00", "-.", 1.4),
    "CMA-ES, restarted": ("#009e73", (0, (3, 1, 1, 1, 1, 1)), 1.4),
    "random": ("#999999", ":", 1.4),
    "grid": ("#999999", "-", 1.0),
}


def draw(results: dict[str, dict[str, list[Run]]], path: Path) -> None:
    """Median gap to the best value against designs evaluated, a panel a problem."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for ax, (name, runs) in zip(panels, results.items(), strict=False):
        best = min(run.best[-1] for of in runs.values() for run in of)
        for label, of in runs.items():
            color, style, width = STYLES[label]
            at = np.geomspace(1.0, max(run.evaluations[-1] for run in of), 300)
            gaps = [_gap(run, best)[np.searchsorted(run.evaluations, at, side="right") - 1] for run in of]
            ax.plot(at, np.median(gaps, axis=0), color=color, ls=style, lw=width, label=label)
        ax.axhline(NEAR, color="#bbbbbb", lw=0.8, zorder=0)
        ax.set(xscale="log", yscale="log", ylim=(1e-7, 30.0))
        ax.set_title(name, fontsize=9)
        ax.tick_params(labelbottom=True)
    for ax in panels[len(results) :]:
        ax.set_axis_off()
    figure.supxlabel("designs evaluated", fontsize=10)
    figure.supylabel("median gap to the best value found, a share of it (line: 0.1 %)", fontsize=10)
    panels[0].legend(fontsize=8, loc="lower left", frameon=False)
    figure.savefig(path, dpi=110)


def _gap(run: Run, best: float) -> np.ndarray:
    return np.maximum((run.best - best) / abs(best), 1e-7)


def store(results: dict[str, dict[str, list[Run]]]) -> None:
    """Write the runs, one a line: the designs after which the best value improved, and the last design."""
    rows = [
        {
            "problem": problem,
            "method": method,
            "evaluations": run.evaluations[_improved(run)].tolist(),
            "best": run.best[_improved(run)].tolist(),
            "seconds": run.seconds,
        }
        for problem, methods in results.items()
        for method, runs in methods.items()
        for run in runs
    ]
    versions = {name: version(name) for name in VERSIONS}
    about = {"date": str(datetime.date.today()), **versions, **OURS}
    place(RESULTS, compact({"command": COMMAND, "about": about, "rows": rows}))


def _improved(run: Run) -> np.ndarray:
    better = np.diff(run.best, prepend=np.inf) < 0.0
    better[[0, -1]] = True
    return np.flatnonzero(better)


def stored() -> dict[str, dict[str, list[Run]]]:
    """The runs of each method on each problem, as they were stored."""
    results: dict[str, dict[str, list[Run]]] = {}
    for row in json.loads(RESULTS.read_text())["rows"]:
        run = Run(np.array(row["evaluations"]), np.array(row["best"]), row["seconds"])
        results.setdefault(row["problem"], {}).setdefault(row["method"], []).append(run)
    return results


def main() -> None:
    """Measure or read the runs, print the tables and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--picture", type=Path, default=PICTURE)
    parser.add_argument("--draw", action="store_true", help="what is stored, without measuring")
    asked = parser.parse_args()
    if asked.draw:
        results = stored()
        for name, runs in results.items():
            print(told(name, *table(runs)))
        draw(results, asked.picture)
        return
    print(", ".join(f"{name} {version(name)}" for name in VERSIONS))
    print(", ".join(f"{name} {value}" for name, value in OURS.items()), flush=True)
    results = {}
    for name, objective in PROBLEMS.items():
        results[name] = solved(objective, asked.seeds)
        print(told(name, *table(results[name])), flush=True)
    store(results)
    draw(results, asked.picture)


if __name__ == "__main__":
    main()
