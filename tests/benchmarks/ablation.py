"""What each part of the search brings: benefit on fresh runs with other methods in its place.

    .venv/bin/python -m tests.benchmarks.ablation [--scenes NAME ...] [--seeds 0 1 2] [--methods NAME ...]

The scenes are those of `tests.benchmarks.worth`, and the chimney of the README. Every answer is judged by
4096 paired runs of the nonlinear equations that no choice has seen. The table stands in
`tests/benchmarks/results/ablation.md`, the numbers in `ablation.json` beside it.
"""

import argparse
import contextlib
import json
import time
import tomllib
from importlib.metadata import version
from pathlib import Path
from unittest import mock

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tests.benchmarks.worth import SCENES, grid_of, judge, problem_of, record, within  # noqa: E402
from tpd.cli.new import template  # noqa: E402
from tpd.design.by_runs import PairedRuns, strikes_of  # noqa: E402
from tpd.design.criteria import (  # noqa: E402
    Room,
    Worth,
    limit_of,
)
from tpd.design.job import job_of  # noqa: E402
from tpd.design.problem import Problem  # noqa: E402
from tpd.design.verify import Verification  # noqa: E402

RESULTS = Path(__file__).parent / "results"
RUNS, SEED = 4096, 9000
"""Fresh paired runs, and their seed."""
README = "chimney of the README"
METHODS = {
    "smoothed": tpd.Descent(),
    "exact": tpd.Descent(model=tpd.Piecewise()),
    "rmsprop": tpd.Descent("rmsprop"),
    "sequential": tpd.Sequential(),
    "no search": tpd.Sequential(searches=1, screening=1, steps=1),
    "no refinement": tpd.Descent(),
}
"""Methods in the order of the table; the first is the default. "No search" leaves the rest alone;
without refinement the designs of the survey are verified in their order from rest."""
GRID, CHOSEN, CHOOSING = (40, 40, 10), 24, 77
"""Points of the grid along mass, length and damping, how many of its designs are judged, and the seed of the
256 runs of each that choose them."""


def scene_of(name):
    """Scene and design space."""
    if name != README:
        return problem_of(*SCENES[name])
    job = job_of(tomllib.loads(template("chimney")))
    return job.scene, job.space


def judged(design):
    """Benefit over fresh runs with its interval, and the share that strikes."""
    runs = PairedRuns(design.scene, design.conditions, tpd.Ensemble(size=RUNS, seed=SEED), Worth(), None)
    found, benefit = runs.of(design.pendulum)
    room = limit_of(design.limits, Room)
    strikes = strikes_of(found, design.pendulum, design.scene.block, room.bob)
    return {
        "benefit": round(benefit.value, 4),
        "interval": [round(benefit.low, 4), round(benefit.high, 4)],
        "strikes": round(strikes, 4),
    }


def answer(name, seed, method):
    """One row."""
    scene, space = scene_of(name)
    began = time.perf_counter()
    as_surveyed = mock.patch.object(Verification, "refined", lambda self, found, *_: found)
    with as_surveyed if method == "no refinement" else contextlib.nullcontext():
        design = tpd.optimise(scene, space, seed=seed, method=METHODS[method])
    row = {"scene": name, "seed": seed, "method": method, "seconds": round(time.perf_counter() - began, 1)}
    row |= {"status": design.status.name, "designs": design.search.evaluations}
    if design.pendulum is None:
        return row
    p, quoted = design.pendulum, design.winner.benefit
    row |= {"kg": round(p.mass, 2), "m": round(p.length, 4), "zeta": round(p.damping_ratio, 4)}
    row |= {"quoted": [round(x, 4) for x in (quoted.value, quoted.low, quoted.high)]}
    return row | judged(design)


def grid(name):
    """The best of a grid: of its designs that keep to the limits from rest, by 256 runs of each, and of the
    best of these by the fresh runs."""
    scene, space = scene_of(name)
    began = time.perf_counter()
    objective = Problem.of(scene, space).objective
    room = limit_of(objective.limits, Room)
    found = within(objective, grid_of(space, GRID), 100)
    kept = found.designs[found.keeps]
    choosing, fresh = (
        PairedRuns(scene, objective.conditions, tpd.Ensemble(size=n, seed=s), Worth(), None)
        for n, s in ((256, CHOOSING), (RUNS, SEED))
    )

    def by(runs, design):
        hung, v, reasons = judge(runs, scene, room.bob, design)
        return (v.benefit.value if v.strikes <= 0.01 else -1.0), hung, v, reasons

    first = np.argsort([-by(choosing, design)[0] for design in kept], kind="stable")[:CHOSEN]
    judged = [by(fresh, kept[i]) for i in first]
    row = {"scene": name, "seed": 0, "method": "grid", "seconds": round(time.perf_counter() - began, 1)}
    row |= {"status": "none_feasible", "designs": len(kept)}
    if not judged:
        return row
    # What nothing speaks against comes first.
    _, hung, v, reasons = max(judged, key=lambda found: (not found[3], found[0]))
    return row | {"status": "refused" if reasons else "found"} | record(hung, v, reasons)


def table(rows):
    """The rows as a table of Markdown."""
    seeds = sorted({r["seed"] for r in rows})
    out = ["| scene | method | " + " | ".join(f"seed {s}" for s in seeds) + " |"]
    out.append("|---" * (out[0].count("|") - 1) + "|")
    for name, method in dict.fromkeys((r["scene"], r["method"]) for r in rows):
        cells = dict.fromkeys(seeds, "not asked")
        for r in (r for r in rows if (r["scene"], r["method"]) == (name, method)):
            said = (
                r["status"] if r["status"] != "found" else f"{r['benefit']:.1%}, strikes {r['strikes']:.2%}"
            )
            cells[r["seed"]] = f"{said}, {r['seconds']:.0f} s"
        out.append(f"| {name} | {method} | " + " | ".join(cells.values()) + " |")
    return "\n".join(out)


def main():
    """Measure, print and store."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=[README, *SCENES])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=[*METHODS, "grid"])
    parser.add_argument("--add", action="store_true", help="keep the stored rows of other calls")
    options = parser.parse_args()
    # What other calls have measured stays.
    asked = {(n, s, m) for n in options.scenes for s in options.seeds for m in options.methods}
    stored = RESULTS / "ablation.json"
    rows = json.loads(stored.read_text())["rows"] if options.add and stored.exists() else []
    rows = [r for r in rows if (r["scene"], r["seed"], r["method"]) not in asked]
    for name in options.scenes:
        for seed in options.seeds:
            for method in options.methods:
                rows.append(grid(name) if method == "grid" else answer(name, seed, method))
                print(json.dumps(rows[-1]), flush=True)
    made = f"tpd {version('tpd')}, jax {version('jax')}, {RUNS} fresh paired runs of seed {SEED}."
    stored.write_text(json.dumps({"made": made, "rows": rows}, indent=1) + "\n")
    (RESULTS / "ablation.md").write_text(
        f"# What each part of the search brings\n\n{made}\n\n{table(rows)}\n"
    )
    print(table(rows))


if __name__ == "__main__":
    main()
