"""First guess of a pendulum by rules of thumb against the design of a search, and against no pendulum.

The templates are under their own harmonic. The templates and the twelve masonry blocks of the benchmark
`earthquakes` are under the far-field earthquakes of FEMA P695 (the extra `records`). All designs of a row
have the same runs of the nonlinear equations, which no search has used. Under earthquakes these are the
runs of the other half of the earthquakes.
"""

import sys
import time
import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import tpd
from tests.benchmarks.earthquakes import HEIGHTS, SLENDERNESS, designed, masonry
from tests.benchmarks.stored import columns
from tpd.core.formatting import number
from tpd.design.first_guess import first_guess

QUESTION = "How much better than a rule of thumb is the design of a search?"
MEASURES = "compiled", "design"
SEED, RUNS_SEED = 0, 424_242
"""Seed of the searches, and of the runs that compare."""
TEMPLATES = ("chimney", "tower", "column", "statue")
QUANTITIES = {"overturned": "overturned", "tilt": "mean tilt"}
"""Names of the changes of paired runs, by their names in a row."""
CASES = ("without", "guess", "searched")
HEADS = {"block": "{block}", "excitation": "{excitation}"}
HEADS |= {"first guess": "{guess_words}", "searched design": "{searched_words}"}
"""First columns of both tables."""


def cases(quick: bool) -> dict[tuple[str, str], Callable[[], Any]]:
    """Return functions that search a design, by the name of the block and the kind of excitation."""
    from tpd.cli.new import template
    from tpd.design.job import job_of

    jobs = {name: job_of(tomllib.loads(template(name))) for name in TEMPLATES}
    spaces = {name: job.space.of(job.scene.block) for name, job in jobs.items()}
    out: dict[tuple[str, str], Callable[[], Any]] = {}
    for name, job in jobs.items():
        settings = {key: x for key, x in job.settings.items() if key not in ("space", "seed")}
        out[name, "harmonic"] = partial(tpd.optimise, job.scene, spaces[name], seed=SEED, **settings)
    method = tpd.GroundSearch(designs=4, steps=2) if quick else tpd.GroundSearch(designs=16, steps=8)
    blocks = {name: (job.scene.block, spaces[name]) for name, job in jobs.items()}
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.1), damping_ratio=(0.05, 1.0))
    blocks |= {f"{h:g} m, ν = {nu:g}": (masonry(h, nu), space) for h in HEIGHTS for nu in SLENDERNESS}
    for name, (block, space) in blocks.items():
        out[name, "earthquakes"] = partial(designed, block, quick, space, method)
    return dict(list(out.items())[-1:]) if quick else out


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each block and excitation."""
    rows = []
    for (name, excitation), search in cases(quick).items():
        begun = time.perf_counter()
        row = {"block": name, "excitation": excitation, **compared(search())}
        rows.append(row | {"seconds": time.perf_counter() - begun})
        print(name, excitation, f"{rows[-1]['seconds']:.0f} s", file=sys.stderr, flush=True)
    return rows


def compared(found: Any) -> dict[str, Any]:
    """Return both pendulums, and the outcomes of the same runs without a pendulum and with each of them."""
    problem, row = found.problem, {"status": found.status.name}
    every = {"guess": first_guess(problem), "searched": found.nearest}
    designs = {key: np.asarray(x) for key, x in every.items() if x is not None}
    pairs = {key: problem.paired_runs(x, RUNS_SEED) for key, x in designs.items()}
    for key, x in designs.items():
        pendulum, pair = problem.pendulum(x), pairs[key]
        row[key] = [float(pendulum.mass), float(pendulum.length), float(pendulum.damping_ratio)]
        row[f"{key}_over"] = problem.over_limit(x, pair.with_pendulum)[0]
        for name, quantity in QUANTITIES.items():
            of = pair.change(quantity)
            row |= {f"{name}_without": of.without_pendulum, f"{name}_{key}": of.with_pendulum}
    if len(pairs) == 2:
        # The runs are the same, so that the guess can be the case with which the searched design is compared.
        against = replace(pairs["searched"], without_pendulum=pairs["guess"].with_pendulum)
        for name, quantity in QUANTITIES.items():
            of = against.change(quantity)
            row[f"{name}_difference"] = [of.difference, of.low, of.high]
    return row


def table(rows: list[dict[str, Any]]) -> str:
    """Return a row for each block: verdict of the search, both pendulums, outcomes and their differences."""
    heads = {f"overturned, {case}": f"{{overturned_{case}:.1%}}" for case in CASES}
    heads |= {"searched minus guess, overturned": _between("overturned")}
    heads |= {"guess over a limit": "{guess_over:.0%}", "searched over a limit": "{searched_over:.0%}"}
    return columns([r | _words(r) for r in rows], **HEADS, **{"verdict of the search": "{verdict}"}, **heads)


def short(rows: list[dict[str, Any]]) -> str:
    """Return a row for each block with both pendulums: mean tilts, and the difference with its interval."""
    both = [r for r in rows if "tilt_difference" in r]
    quakes = [r for r in both if r["excitation"] == "earthquakes"]
    means = {key: sum(r[key] for r in quakes) / len(quakes) for key in (f"tilt_{case}" for case in CASES)}
    heads = {f"mean tilt, {case}": f"{{tilt_{case}:.1%}}" for case in CASES}
    heads |= {"searched minus guess": _between("tilt")}
    last = {"block": f"mean of {len(quakes)} blocks", "excitation": "earthquakes", **means}
    return columns([*(r | _words(r) for r in both), last], **HEADS, **heads)


def _between(name: str) -> str:
    of = f"{name}_difference"
    return f"{{{of}[0]:+.1%}} ({{{of}[1]:+.1%}} to {{{of}[2]:+.1%}})"


def _words(row: dict[str, Any]) -> dict[str, str]:
    """Return the verdict, and bob, rod and damping ratio of both pendulums, as text."""
    pendulums = {key: row[key] for key in ("guess", "searched") if key in row}
    words = {
        f"{key}_words": f"{number(mass, 2)} kg, {number(rod, 2)} m, {number(zeta, 2)}"
        for key, (mass, rod, zeta) in pendulums.items()
    }
    return words | {"verdict": row["status"].replace("_", " ")}
