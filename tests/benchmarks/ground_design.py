"""Design on ground motions: times, other optimisers, benefit on motions held out, harm.

    .venv/bin/python -m tests.benchmarks.ground_design [PART ...]

Parts: times, optimisers, benefit, harm, grid; all by default. The records are those of FEMA P695
(`tpd[records]`), the other optimisers need `tpd[benchmarks]`. Tables stand in
`tests/benchmarks/results/ground_design.md`, one section a part; the numbers of the grid in
`results/worth_grid.json`, and its picture in `notebooks/pictures/worth_grid.png`; `benefit` draws
`notebooks/pictures/fragility.png`.
"""

import argparse
import contextlib
import json
import re
import sys
import time
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import jax
import numpy as np
from scipy.optimize import differential_evolution, minimize

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tpd.design.ground.judgement import (  # noqa: E402
    grouped,
    judge,
    scatter_of,
)
from tpd.design.ground.objective import GroundObjective  # noqa: E402
from tpd.design.ground.optimise import DEFAULT_LIMITS, DEFAULT_SPACE  # noqa: E402
from tpd.design.ground.search import GroundSearch, Searcher  # noqa: E402
from tpd.plot import style  # noqa: E402
from tpd.plot.compare import plot_groups  # noqa: E402

RESULT = Path(__file__).parent / "results" / "ground_design.md"
GRID = RESULT.with_name("worth_grid.json")
PICTURES = Path(__file__).parents[2] / "notebooks" / "pictures"
STRIPES = (1.5, 2.0, 3.0, 4.0)
BLOCKS = {
    "statue 1.2 m": (0.3, 1.2, 300.0),
    "statue 1.8 m": (0.45, 1.8, 900.0),
    "column 4 m": (0.7, 4.0, 4500.0),
    "column 6 m": (1.0, 6.0, 9000.0),
    "tower 10 m": (2.0, 10.0, 40_000.0),
    "tower 20 m": (4.0, 20.0, 300_000.0),
}
HEIGHTS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
SLENDERNESS = (0.12, 0.16, 0.2, 0.25, 0.3)


def block(name):
    """One of the blocks, with Housner's restitution."""
    width, height, mass = BLOCKS[name]
    # The widest cavity that there can be, so that the size of the block alone decides.
    return tpd.Block(width=width, height=height, mass=mass, restitution="housner", cavity_width=width)


def masonry(height, nu):
    """A square block of masonry."""
    mass = 1800.0 * nu**2 * height**3
    width = nu * height
    return tpd.Block(width=width, height=height, mass=mass, restitution="housner", cavity_width=width)


def table(head, rows):
    """A table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def times():
    """Design on 44 records at 4 stripes, judged on the two other sets, pictures drawn."""
    others = {
        "near-field without pulse": tpd.records.fema_p695("near-field-no-pulse"),
        "near-field with pulse": tpd.records.fema_p695("near-field-pulse"),
    }
    rows = []
    for name in ("column 6 m", "statue 1.8 m"):
        seconds = []
        for _ in range(3):
            begun = time.perf_counter()
            conditions = tpd.Conditions.records(tpd.records.fema_p695("far-field"), STRIPES)
            found = tpd.optimise(block(name), conditions=conditions, held_out=others)
            style.png(plot_groups(found)[0].figure)
            seconds.append(time.perf_counter() - begun)
        rows.append((name, f"{seconds[0]:.1f}", f"{np.median(seconds[1:]):.1f}", found.status.name))
    return table(("block", "first in its process, s", "again, s", "status"), rows)


def problems():
    """Exact functions of a design, smaller is better, and the same on motions held out."""
    far = tpd.records.fema_p695("far-field")
    tuned, held = grouped(far, 0.5, 0)
    pulses = [tpd.Pulse.ricker(acceleration=1.0, frequency=f) for f in np.geomspace(0.4, 2.0, 12)]
    between = [tpd.Pulse.ricker(acceleration=1.0, frequency=f) for f in np.geomspace(0.43, 1.9, 12)]
    stroke = (tpd.limits.Stroke(),)
    for label, name, inside, outside, limits in (
        ("column, records, walls", "column 6 m", tuned.motions, held.motions, DEFAULT_LIMITS),
        ("statue, records", "statue 1.8 m", tuned.motions, held.motions, stroke),
        ("tower, records, walls", "tower 10 m", tuned.motions, held.motions, DEFAULT_LIMITS),
        ("column, pulses", "column 6 m", pulses, between, stroke),
    ):
        both = [
            tpd.Conditions.records(m[::2] if m is not pulses else m, (2.0, 3.0)) for m in (inside, outside)
        ]
        yield label, *(GroundObjective(block(name), c, limits, 0.1) for c in both)


class Counted:
    """An objective as a function of shares of the space, with a penalty beyond the limits."""

    def __init__(self, objective, most):
        self.objective, self.most, self.seen = objective, most, []

    def __call__(self, unit):
        if len(self.seen) >= self.most:
            raise StopIteration
        unit = np.asarray(unit, dtype=float)
        inside = np.clip(unit, 0.0, 1.0)
        design = DEFAULT_SPACE.unscaled(inside[None])
        runs = self.objective.evaluate(design)
        excess = float(np.maximum(self.objective.sizes(runs, design)[1] - 1.0, 0.0).sum())
        value = float(runs.severity.mean())
        out = float(np.abs(unit - inside).sum())
        self.seen.append((value if excess == 0.0 else np.inf, design[0]))
        return value + out + (1.0 + excess if excess > 0.0 else 0.0)

    def best(self, most):
        """Lowest value within the limits among the first designs, and its design."""
        return min(self.seen[:most], key=lambda pair: pair[0])


def nelder_mead(function, seed):
    rng = np.random.default_rng(seed)
    while True:
        minimize(function, rng.random(3), method="Nelder-Mead", bounds=[(0.0, 1.0)] * 3)


def cma_es(function, seed):
    import cma

    start = np.random.default_rng(seed).random(3)
    while True:
        seed += 1
        options = {"seed": seed, "verbose": -9, "bounds": [0.0, 1.0]}
        cma.fmin2(function, start, 0.3, options, restarts=9)


def evolution(function, seed):
    differential_evolution(function, [(0.0, 1.0)] * 3, seed=seed, maxiter=10_000, polish=False, tol=0.0)


def value_of(objective, design):
    """Mean severity of a design, and of sixteen built within 2 % of it."""
    built = design * (1.0 + 0.02 * np.random.default_rng(0).uniform(-1.0, 1.0, (16, 3)))
    severity = objective.evaluate(np.concatenate([design[None], built])).severity.mean(axis=1)
    return float(severity[0]), float(severity[1:].mean())


def optimisers(seeds=10, few=64, many=400):
    """The response surface with 64 designs against others with 400, on the same exact function."""
    rows = []
    for label, objective, outside in problems():
        found = {}
        method = GroundSearch(starts=32, steps=few - 32)
        found["tpd, 64 designs"] = [_searched(objective, method, seed) for seed in range(seeds)]
        for name, method in (
            ("Nelder-Mead", nelder_mead),
            ("CMA-ES", cma_es),
            ("diff. evolution", evolution),
        ):
            ended = [_ended(objective, method, seed, many) for seed in range(seeds)]
            for most in (few, many):
                found[f"{name}, {most}"] = [function.best(most) for function in ended]
        least = min(v for runs in found.values() for v, _ in runs)
        print(f"{label} done", file=sys.stderr, flush=True)
        for name, runs in found.items():
            rows.append((label, name, *_scores(objective, outside, runs, least)))
    head = ("problem", "method", "lowest value, median", "within 1 %", "built within 2 %", "held out")
    return table(head, rows)


def _searched(objective, method, seed):
    """Lowest value within the limits, and the answer."""
    search = Searcher(objective, tpd.Risk.expected(), DEFAULT_SPACE, method, seed)
    search.run()
    e = search.found
    return float(np.min(np.where(e.feasible, e.value, np.inf))), e.designs[search.best()]


def _ended(objective, method, seed, most):
    function = Counted(objective, most)
    with contextlib.suppress(StopIteration):
        method(function, seed)
    return function


def _scores(objective, outside, runs, least):
    """Median of the lowest values, seeds within 1 % of the least of all, and how the answers do as built and
    on motions held out."""
    values = np.array([v for v, _ in runs])
    built = [value_of(objective, d)[1] for v, d in runs if np.isfinite(v)]
    held = [value_of(outside, d)[1] for v, d in runs if np.isfinite(v)]
    near = int(np.sum(values <= 1.01 * least))
    return (
        f"{np.median(values):.4f}",
        f"{near} of {len(runs)}",
        f"{np.mean(built):.4f}",
        f"{np.mean(held):.4f}",
    )


def benefit():
    """Benefit for six blocks on the far-field earthquakes that were held out, and on near fields."""
    near = tpd.records.fema_p695("near-field-no-pulse") + tpd.records.fema_p695("near-field-pulse")
    rows = []
    for name in BLOCKS:
        conditions = tpd.Conditions.records(tpd.records.fema_p695("far-field"), STRIPES)
        found = tpd.optimise(block(name), conditions=conditions)
        if found.best is None or not found.judged:
            rows.append((name, found.status.name, "-", "-", "-", "-", "-", "-"))
            continue
        seen = {getattr(m, "event", "") for m in conditions.motions}
        other = grouped(conditions.motions, {"near": [m for m in near if m.event not in seen]}, 0)[1]
        objective = GroundObjective(block(name), found.conditions, found.limits, 0.1)
        beside = judge(
            objective,
            found.best,
            other,
            STRIPES,
            scatter=scatter_of(found.scene.block, found.ensemble),
            seed=0,
        )
        held = found.judged[1]
        if name == "column 4 m":
            (PICTURES / "fragility.png").write_bytes(style.png(plot_groups(found)[0].figure))
        rows.append(
            (
                name,
                found.status.name,
                "{:.3f}, {:.3f}, {:.2f}".format(*found.best),
                f"{held.overturned[0]:.1%}, {held.overturned[1]:.1%}",
                _interval(held.difference),
                _interval(held.tilt),
                _interval(beside.difference),
                _interval(beside.tilt),
            )
        )
    head = ("block", "status", "μ, λ, ζ", "held out: without, with", "difference", "tilt/ν")
    return table((*head, "near field: difference", "near field: tilt/ν"), rows)


def _interval(x):
    return f"{x.mean:+.3f} ({x.low:+.3f} to {x.high:+.3f})"


def harm(count=200):
    """Random blocks and sets of records: is an offered design significantly worse on a third set?"""
    rng = np.random.default_rng(5)
    far = tpd.records.fema_p695("far-field")
    near = tpd.records.fema_p695("near-field-no-pulse") + tpd.records.fema_p695("near-field-pulse")
    tally, worse, better = {}, [], 0
    method = GroundSearch(starts=16, steps=8)
    for i in range(count):
        height, nu = float(np.exp(rng.uniform(np.log(1.0), np.log(20.0)))), rng.uniform(0.1, 0.3)
        column = masonry(height, nu)
        chosen = [far[j] for j in rng.permutation(len(far))[:20]]
        scales = tuple(np.sort(rng.uniform(1.2, 4.0, 3)))
        limits = DEFAULT_LIMITS if i % 2 else (tpd.limits.Stroke(),)
        conditions = tpd.Conditions.records(chosen, scales)
        found = tpd.optimise(column, conditions=conditions, method=method, limits=limits, seed=i)
        tally[found.status.name] = tally.get(found.status.name, 0) + 1
        if found.pendulum is None:
            continue
        # Motions that neither search nor verdict has seen.
        seen = {m.event for m in chosen}
        third = [m for m in (*far, *near) if m.event not in seen]
        other = grouped(chosen, {"third": third}, 0)[1]
        objective = GroundObjective(column, found.conditions, limits, 0.1)
        judged = judge(
            objective,
            found.best,
            other,
            scales,
            scatter=scatter_of(found.scene.block, found.ensemble),
            seed=i + 1,
        )
        better += judged.difference.is_below or judged.tilt.is_below
        if judged.difference.is_above:
            worse.append((f"{height:.1f} m, ν = {nu:.2f}", _interval(judged.difference)))
    rows = sorted(tally.items())
    text = table(("status of the search", "of " + str(count)), rows)
    offered = tally.get("found", 0)
    text += (
        f"\n\nOf {offered} offered designs {better} are significantly better and {len(worse)} significantly "
    )
    text += "worse on earthquakes that neither search nor verdict had seen"
    return text + (": " + "; ".join(" ".join(w) for w in worse) if worse else ".")


def grid():
    """Is a pendulum worth it: square blocks of masonry, by height and slenderness."""
    far = tpd.records.fema_p695("far-field")
    cells = []
    for height in HEIGHTS:
        for nu in SLENDERNESS:
            column = masonry(height, nu)
            scene = tpd.Scene(column, far[0])
            conditions = tpd.Conditions.records(far, STRIPES)
            space = tpd.DesignSpace(mass_ratio=(0.01, 0.1), damping_ratio=(0.05, 1.0))
            method = GroundSearch(starts=20, steps=12)
            found = tpd.optimise(column, space, conditions=conditions, method=method)
            held = found.judged[1] if len(found.judged) > 1 else None
            cells.append(
                {
                    "height": height,
                    "nu": nu,
                    "p": float(scene.rate),
                    "status": found.status.name,
                    "design": None if found.best is None else [float(x) for x in found.best],
                    "overturned": None if held is None else list(held.overturned),
                    "difference": None if held is None else list(vars(held.difference).values()),
                    "tilt": None if held is None else list(vars(held.tilt).values()),
                }
            )
    content = {"command": "python -m tests.benchmarks.ground_design grid", "stripes": STRIPES, "cells": cells}
    GRID.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    draw_grid(cells)
    tally = {}
    for cell in cells:
        tally[cell["status"]] = tally.get(cell["status"], 0) + 1
    return table(("verdict", f"of {len(cells)} blocks"), sorted(tally.items()))


def draw_grid(cells):
    """Change of the mean tilt on motions held out, over height and slenderness."""
    ax = style.new_axes(size=(7.4, 4.4))
    change = np.full((len(SLENDERNESS), len(HEIGHTS)), np.nan)
    for cell in cells:
        i, j = SLENDERNESS.index(cell["nu"]), HEIGHTS.index(cell["height"])
        if cell["tilt"] is not None:
            change[i, j] = cell["tilt"][0]
        sure = cell["status"] == "found"
        words = "none\nfits" if cell["tilt"] is None else f"{100.0 * cell['tilt'][0]:+.0f}".replace("-", "−")
        overturned = cell["overturned"]
        if overturned is not None:
            words += f"\n{overturned[0]:.0%} → {overturned[1]:.0%}"
        ink = "white" if change[i, j] < -0.12 else style.INK
        weight = "bold" if sure else "normal"
        ax.text(j, i, words, ha="center", va="center", fontsize=8, weight=weight, color=ink)
    image = ax.imshow(100.0 * change, origin="lower", aspect="auto", cmap="Blues_r", vmin=-24.0, vmax=4.0)
    ax.figure.colorbar(image, label="change of the mean tilt on motions held out (% of ν)")
    ax.set_xticks(range(len(HEIGHTS)), [f"{h:g}" for h in HEIGHTS])
    ax.set_yticks(range(len(SLENDERNESS)), [f"{nu:g}" for nu in SLENDERNESS])
    ax.set(xlabel="height of the block (m)", ylabel="slenderness width/height (-)")
    offered = all(cell["status"] == "found" for cell in cells)
    ax.set_title(
        "above: change of the mean tilt (% of ν); below: runs overturned without → with; "
        + ("a pendulum is offered in every cell" if offered else "bold: offered"),
        size=8,
    )
    (PICTURES / "worth_grid.png").write_bytes(style.png(ax.figure))


PARTS = {
    "times": ("Times", times),
    "optimisers": ("Other optimisers", optimisers),
    "benefit": ("Benefit on motions held out", benefit),
    "harm": ("Harm", harm),
    "grid": ("Is a pendulum worth it", grid),
}
ABOUT = {
    "times": "Design of (μ, λ, ζ) on 44 far-field records at 4 stripes: 32 designs over the space and 32\n"
    "more, judged on both near-field sets by both sets of equations, fragility drawn.",
    "optimisers": "Ten seeds each. Lowest value: the least mean tilt within the limits that a method met.\n"
    "Within 1 %: of the lowest of all methods. Built within 2 %: mean tilt of the answers as somebody\n"
    "builds them, each of the three numbers off by up to 2 %. Held out: the same on other motions. On\n"
    "records the lowest of many values is low by luck: it is the last two columns that a design is hung for.",
    "benefit": "Tuned to half of the far-field earthquakes at PGA/(g tan α) of 1.5, 2, 3 and 4, judged on\n"
    "the other half and on all near-field records; Housner's restitution, default limits; 95 % intervals.",
    "harm": "Heights from 1 to 20 m, slenderness 0.1 to 0.3, twenty random far-field records, three random\n"
    "stripes, walls in every second case.",
    "grid": "Square blocks of masonry (1800 kg/m³), bob of steel of at most 10 % of the mass between the\n"
    "outer faces, half of the far-field earthquakes held out.",
}


def store(part, text):
    """Put the section of a part into the file of results, in place of its former one."""
    made = datetime.now(UTC).strftime("%Y-%m-%d")
    names = ", ".join(f"{n} {version(n)}" for n in ("jax", "numba", "numpy"))
    title, _ = PARTS[part]
    command = f"`python -m tests.benchmarks.ground_design {part}`"
    head = f"{command}, {made}, tpd {tpd.__version__}, {names}; two cores."
    section = f"## {title}\n\n{head}\n{ABOUT[part]}\n\n{text}\n"
    old = RESULT.read_text(encoding="utf-8") if RESULT.exists() else "# Design on ground motions\n"
    sections = re.split(r"(?m)^(?=## )", old)
    kept = {s.split("\n")[0]: s for s in sections[1:]} | {f"## {title}": section}
    order = [f"## {t}" for t, _ in PARTS.values()]
    whole = [sections[0].rstrip() + "\n", *(kept[t].rstrip() + "\n" for t in order if t in kept)]
    RESULT.write_text("\n".join(whole), encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all by default")
    for part in parser.parse_args().parts or PARTS:
        begun = time.perf_counter()
        text = PARTS[part][1]()
        print(f"\n{part}, {time.perf_counter() - begun:.0f} s\n\n{text}", flush=True)
        store(part, text)


if __name__ == "__main__":
    main()
