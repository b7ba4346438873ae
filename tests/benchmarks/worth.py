"""Default answers of `optimise` against brute force under the same rules, on twelve scenes.

    .venv/bin/python -m tests.benchmarks.worth [--grid 40 40 5] [--scenes NAME ...]

Brute force follows every design of a grid over (mu, lam, zeta) from rest by the nonlinear equations, under
all conditions of the default neighbourhood. Of the designs that keep to all limits, the best that lie apart
are judged by the paired runs by which `optimise` judges its own, and those that pass once more by runs of
another seed. The table stands in
`tests/benchmarks/results/worth.md`, the numbers in `worth.json` beside it.
"""

import argparse
import json
import time
import tomllib
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tests.benchmarks.tables import compact  # noqa: E402
from tpd import Conditions  # noqa: E402
from tpd.cli.new import template  # noqa: E402
from tpd.design.by_runs import PairedRuns, reasons_by_runs, strikes_of  # noqa: E402
from tpd.design.criteria import (  # noqa: E402
    Room,
    Worth,
    limit_of,
)
from tpd.design.job import job_of  # noqa: E402
from tpd.design.problem import Problem  # noqa: E402
from tpd.design.screening import first_apart  # noqa: E402
from tpd.design.survey import ON_THE_WAY, followed  # noqa: E402

RESULTS = Path(__file__).parent / "results"
JUDGED, APART = 12, 0.05
"""Designs of the grid that are judged in each of two rounds, and how far apart they lie, in shares of the
bounds."""
OTHER = 1
"""Seed of the runs that judge once more."""
MARGIN = 0.1
"""Share of the room that the designs of the second round leave free on the way from rest."""
FRICTION = 0.02
"""Friction of a scene whose template has none."""
FLAT = {
    "block": {"width": 0.9, "height": 2.0, "mass": 1200.0, "friction": 0.05, "cavity_width": 0.9},
    "motion": {"amplitude": 0.104, "frequency": 1.5},
    "space": {"mass_ratio": [0.01, 0.2], "length_ratio": [0.1, 0.8], "damping_ratio": [0.05, 0.6]},
}
"""A machine on a wide base, width/height 0.45."""
CAVITIES = {"column": 1.0}
"""Widths of cavities (m) in place of those of the templates."""
STRONGER = {"column": tpd.Harmonic(amplitude=0.097, frequency=0.7)}
"""Motions in place of those of the templates, so that the bare block overturns in some of the runs."""
KINDS = ("paper", "statue", "column", "chimney", "tower", "flat")
LOSSES = ("friction", "Housner")
SCENES = {f"{kind}, {loss}": (kind, loss) for kind in KINDS for loss in LOSSES}


def problem_of(kind, loss):
    """Scene and design space of a template, with losses by friction alone or by Housner's impacts alone."""
    job = job_of(FLAT if kind == "flat" else tomllib.loads(template(kind)))
    block = job.scene.block
    block = replace(block, cavity_width=CAVITIES.get(kind, block.cavity_width))
    if loss == "friction":
        block = replace(block, friction=block.friction or FRICTION, restitution=None)
    else:
        block = replace(block, friction=0.0, restitution="housner")
    return tpd.Scene(block, STRONGER.get(kind, job.scene.motion), job.scene.gravity), job.space


def grid_of(space, sizes):
    """Designs (m, 3) of a grid that has the bounds of the space at its edges."""
    axes = [np.linspace(0.0, 1.0, n) for n in sizes[: space.bounds.shape[1]]]
    units = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return space.unscaled(units.reshape(-1, len(axes)))


def judge(runs, scene, bob, design):
    """Pendulum, benefit, strikes and reasons of one design by the paired runs."""
    mu, lam, zeta = design
    pendulum = scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
    found, benefit = runs.of(pendulum)
    v = SimpleNamespace(paired=found, benefit=benefit, strikes=strikes_of(found, pendulum, scene.block, bob))
    return pendulum, v, reasons_by_runs(v, runs.worth, runs.conditions)


def record(pendulum, v, reasons=()):
    """Numbers of a judged design."""
    return {
        "kg": round(float(pendulum.mass), 4),
        "m": round(float(pendulum.length), 4),
        "zeta": round(float(pendulum.damping_ratio), 4),
        "benefit": round(v.benefit.value, 4),
        "low": round(v.benefit.low, 4),
        "high": round(v.benefit.high, 4),
        "strikes": round(v.strikes, 4),
        "overturned": round(v.paired.hung.overturned.value, 4),
        "reasons": sorted({r.kind.name for r in reasons}),
    }


def under_one(objective, i):
    """The objective under one of its conditions."""
    g, rows = objective.geometry, slice(i, i + 1)
    names = "wall", "slenderness", "mass_factor", "length_factor"
    alone = Conditions({k: x[rows] for k, x in objective.conditions.factors.items()})
    geometry = replace(g, **{name: getattr(g, name)[rows] for name in names}, bare_tilt=np.nan)
    return replace(objective, conditions=alone, geometry=geometry)


def within(objective, designs, periods):
    """Survey under all conditions of the designs that break no limit under the middle ones."""
    # A limit that is broken under one condition is broken: most designs need not be followed under all.
    n = len(objective.conditions)
    for i in (n // 2, n - 1):
        found = followed(under_one(objective, i), designs, periods, "nonlinear", None)
        # One design remains where all are refused, so that there is a survey.
        designs = designs[found.broken == 0] if np.any(found.broken == 0) else designs[:1]
    return followed(objective, designs, periods, "nonlinear", None)


def again(runs, scene, bob, design):
    """Benefit, strikes and reasons of a design by as many runs of another seed."""
    others = PairedRuns(scene, runs.conditions, replace(runs.ensemble, seed=OTHER), runs.worth, None)
    _, v, reasons = judge(others, scene, bob, design)
    return {
        "benefit": round(v.benefit.value, 4),
        "strikes": round(v.strikes, 4),
        "reasons": sorted({r.kind.name for r in reasons}),
    }


def brute_force(objective, scene, runs, sizes, bob):
    """Follow the grid, and judge its best designs that lie apart."""
    begin = time.perf_counter()
    designs = grid_of(objective.space, sizes)
    count, found = len(designs), within(objective, designs, runs.ensemble.periods)
    keeps = np.flatnonzero(found.keeps)
    order = keeps[np.argsort(found.score[keeps], kind="stable")]
    designs, way = found.designs, found.excess[ON_THE_WAY]
    units = objective.space.scaled(designs)
    first = first_apart(units, order, JUDGED, APART)
    free = [i for i in order if way[i] <= -MARGIN and i not in first]
    chosen = first + first_apart(units, np.array(free, int), JUDGED, APART)
    judged = [(i, *judge(runs, scene, bob, designs[i])) for i in chosen]
    passing = [
        record(pendulum, v) | {"again": again(runs, scene, bob, designs[i])}
        for i, pendulum, v, reasons in judged
        if not reasons
    ]
    # Of many designs that are judged by the same runs, some pass by chance.
    twice = [r for r in passing if not r["again"]["reasons"]]
    refused = [record(pendulum, v, reasons) for _, pendulum, v, reasons in judged if reasons]
    return {
        "designs": count,
        "keep": len(keeps),
        "help": found.better,
        "judged": len(judged),
        "pass": len(passing),
        "pass twice": len(twice),
        "best": max(twice or passing, key=lambda r: r["benefit"], default=None),
        "best refused": max(refused, key=lambda r: r["benefit"], default=None),
        "seconds": round(time.perf_counter() - begin, 1),
    }


def answer(scene, space):
    """The default answer of `optimise`."""
    begin = time.perf_counter()
    design = tpd.optimise(scene, space)
    out = {"status": design.status.name, "seconds": round(time.perf_counter() - begin, 1)}
    out["verified"] = len(design.verified)
    out["surveys"] = [[x.equations, len(x.designs), int(np.sum(x.keeps))] for x in design.surveys]
    out["reasons"] = sorted({f"{r.step.name}: {r.kind.name}" for v in design.verified for r in v.reasons})
    if design.winner is not None:
        out |= {"offered": record(design.pendulum, design.winner)}
    return out, design.winner


def measured(kind, loss, sizes):
    """Record of one scene."""
    scene, space = problem_of(kind, loss)
    problem = Problem.of(scene, space)
    objective, bob = problem.objective, limit_of(problem.objective.limits, Room).bob
    runs = PairedRuns(scene, objective.conditions, tpd.Ensemble(), Worth(), None)
    grid = brute_force(objective, scene, runs, sizes, bob)
    ours, winner = answer(scene, space)
    if winner is not None:
        ours["offered"]["again"] = again(runs, scene, bob, winner.design)
    return {"bare": round(float(np.mean(runs.bare.lost)), 4), "ours": ours, "grid": grid}


def agreement(ours, grid):
    """Whether both say that there is, or is not, a design worth hanging, and by how much they differ."""
    offered, best = ours.get("offered"), grid["best"]
    if offered is None:
        if grid["pass twice"]:
            return "**false none**"
        return "yes" if best is None else "yes: that design fails by other runs"
    if best is None:
        return "yes: the grid misses it"
    first, second = (100 * (a["benefit"] - b["benefit"]) for a, b in pairs(offered, best))
    return f"yes: {first:+.1f} and {second:+.1f} points"


def pairs(a, b):
    """Two designs by the runs that chose them, and by others."""
    return (a, b), (a["again"], b["again"])


def of_design(r):
    """Words for a judged design."""
    share = f"{r['benefit']:.1%} ({r['low']:.1%} to {r['high']:.1%})"
    where, other = f"{r['kg']:.4g} kg on {r['m']:.3g} m, ζ {r['zeta']:.2g}", r["again"]
    failed = f" (fails: {', '.join(other['reasons'])})" if other["reasons"] else ""
    strikes = f"strikes {r['strikes']:.1%}; by other runs {other['benefit']:.1%}, {other['strikes']:.1%}"
    return f"{where}: {share}, {strikes}{failed}"


def row(name, r):
    """One line of the table."""
    ours, grid = r["ours"], r["grid"]
    said = of_design(ours["offered"]) if "offered" in ours else f"none ({ours['status']})"
    best = "none" if grid["best"] is None else of_design(grid["best"])
    passed = f"{grid['pass']} of {grid['judged']}, {grid['pass twice']} twice"
    counts = f"{grid['keep']} / {grid['help']} / {passed}"
    cells = name, f"{r['bare']:.0%}", said, counts, best, agreement(ours, grid)
    return "| " + " | ".join(cells) + f" | {ours['seconds']:.0f} |"


HEAD = (
    "| scene | bare overturned | default answer: benefit (95 %) | grid: keep to the limits / help / pass "
    "| best of the grid that passes | agrees? | s |\n|---|---|---|---|---|---|---|"
)


def main():
    """Print the table, and write it."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scenes", nargs="*", default=list(SCENES), help=f"of {', '.join(SCENES)}")
    options.add_argument("--grid", nargs=3, type=int, default=[40, 40, 5], help="points along mu, lam, zeta")
    options.add_argument("--out", type=Path, default=RESULTS, help="folder of the results")
    asked = options.parse_args()
    packages = ", ".join(f"{name} {version(name)}" for name in ("tpd", "jax", "numba", "numpy"))
    sizes = " ".join(map(str, asked.grid))
    about = f"`python -m tests.benchmarks.worth --grid {sizes}`, {packages}, {time.strftime('%Y-%m-%d')}"
    print(f"{about}\n\n{HEAD}", flush=True)
    records = stored(asked.out)
    for name in asked.scenes:
        records[name] = measured(*SCENES[name], asked.grid)
        print(row(name, records[name]), flush=True)
        write(asked.out, about, records)


def stored(folder):
    """Records of an earlier run, which a run of some scenes leaves as they are."""
    path = folder / "worth.json"
    return json.loads(path.read_text())["scenes"] if path.exists() else {}


def write(folder, about, records):
    """Write table and numbers."""
    records = {name: records[name] for name in SCENES if name in records}
    lines = [about, "", HEAD, *(row(name, r) for name, r in records.items())]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "worth.md").write_text("\n".join(lines) + "\n")
    (folder / "worth.json").write_text(compact({"about": about, "scenes": records}))


if __name__ == "__main__":
    main()
