"""Designs that `optimise` offers for one exact shaking, against a grid of nonlinear solutions.

    .venv/bin/python -m tests.benchmarks.nonlinear [--points 40] [SCENE ...]

For every scene: the least settled amplitude from rest by the nonlinear equations on a grid over (mu, lam),
among the designs that keep the stroke limit (the bob is a point), and the nonlinear amplitude of the design
that is offered.
The table stands in `tests/benchmarks/results/nonlinear.md`.
"""

import argparse
import time
from importlib.metadata import version
from pathlib import Path

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tpd.design.followed import Followed  # noqa: E402
from tpd.design.problem import Problem  # noqa: E402

RESULT = Path(__file__).parent / "results" / "nonlinear.md"
SLIM = tpd.Scene(
    tpd.Block(width=0.08, height=0.4, mass=13.0, friction=0.05),
    tpd.Harmonic(amplitude=0.009243, frequency=2.839),
)
TOWER = tpd.Scene(
    tpd.Block(width=2.0, height=10.0, mass=40e3, friction=0.05), tpd.Harmonic(amplitude=0.3, frequency=0.5)
)
IMPACTS = tpd.Scene(
    tpd.Block(width=0.45, height=1.8, mass=900.0, friction=0.02, restitution="housner"),
    tpd.Harmonic(amplitude=0.05, frequency=1.3),
)
LIGHT = tpd.DesignSpace(mass_ratio=(0.01, 0.1))
WIDE = (tpd.limits.Stroke(1.5),)
NARROW = (tpd.limits.Stroke(0.5),)
SCENES = {
    "the paper's block": (tpd.paper_scene(), tpd.DesignSpace(), NARROW),
    "the paper's block, mu <= 0.1, stroke 1.5": (tpd.paper_scene(), LIGHT, WIDE),
    "a slimmer block, mu <= 0.1": (SLIM, LIGHT, NARROW),
    "a slimmer block, mu <= 0.1, stroke 1.5": (SLIM, LIGHT, WIDE),
    "a tower of 10 m, mu <= 0.1": (TOWER, LIGHT, NARROW),
    "a statue with impacts, mu <= 0.1": (IMPACTS, LIGHT, NARROW),
}
"""Scene, space and limits; the first four are those of `tests.benchmarks.numbers`."""


def objective(scene, space, limits):
    """The nonlinear motion from rest, with the limits."""
    method = tpd.Sequential(model=tpd.Segmented(lyapunov_periods=0))
    found = Problem.of(scene, space, None, tpd.Starts.rest(), None, limits, method, 0).objective
    assert isinstance(found, Followed)
    return found


def grid_best(of, n):
    """Least amplitude (rad) on an n x n grid among designs that settle within the limits, and the design."""
    mu = np.linspace(*of.space.mass_ratio, n)
    lam = np.linspace(*of.space.length_ratio, n)
    pairs = np.stack(np.meshgrid(mu, lam), axis=-1).reshape(-1, 2)
    designs = of.space.full(pairs)
    e = of.evaluate(designs)
    fits = (of.constraints(e)[0] <= 0.0).all(axis=1) & (np.asarray(e.kind)[:, 0] <= 2)
    amplitude = np.where(fits, e.tilt[:, 0] * of.geometry.slenderness[0], np.inf)
    best = int(np.argmin(amplitude))
    return amplitude[best], designs[best]


def row(name, n):
    """One line of the table."""
    scene, space, limits = SCENES[name]
    of = objective(scene, space, limits)
    best, where = grid_best(of, n)
    bare = of.evaluate(np.array([[0.0, 1.0, 0.1]])).tilt[0, 0] * scene.block.slenderness
    begin = time.perf_counter()
    design = tpd.optimise(scene, space, conditions=tpd.Conditions.exactly(), limits=limits)
    seconds = time.perf_counter() - begin
    if design.winner is None:
        reasons = "; ".join(sorted({r.step.value for v in design.verified for r in v.reasons}))
        found, ratio = f"none ({design.status.name}: {reasons})", "-"
    else:
        hung = of.evaluate(design.winner.design[None])
        amplitude = hung.tilt[0, 0] * scene.block.slenderness
        mu, lam, _ = design.winner.design
        found = f"{amplitude:.6f} at ({mu:.4f}, {lam:.4f})"
        ratio = "both 0" if best == amplitude == 0.0 else f"{amplitude / best - 1.0:+.2%}"
    at = f"({where[0]:.4f}, {where[1]:.4f})"
    return f"| {name} | {bare:.6f} | {best:.6f} at {at} | {found} | {ratio} | {seconds:.0f} |"


def main():
    """Print the table, and write it if it has all scenes."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("scenes", nargs="*", help=f"of {', '.join(SCENES)}")
    options.add_argument("--points", type=int, default=40, help="of the grid along each axis (40)")
    asked = options.parse_args()
    packages = ", ".join(f"{name} {version(name)}" for name in ("jax", "diffrax", "optax", "equinox"))
    lines = [
        f"`python -m tests.benchmarks.nonlinear --points {asked.points}`, {packages}, "
        f"{time.strftime('%Y-%m-%d')}",
        "",
        "| scene | bare (rad) | best of the grid (rad) at (mu, lam) | offered | over the grid | s |",
        "|---|---|---|---|---|---|",
    ]
    print("\n".join(lines), flush=True)
    for name in asked.scenes or SCENES:
        lines.append(row(name, asked.points))
        print(lines[-1], flush=True)
    if not asked.scenes:
        RESULT.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
