"""Designs in an independent engine: does it agree about the sign of the benefit?

    .venv/bin/python -m tests.benchmarks.engines [mujoco] [drake]

The paper's block, the chimney of the main job, a statue and a column under a pulse, with paired runs in
MuJoCo (`tpd[engines]`, 64 runs of 100 periods) and in Drake (`tpd[drake]`, 16 runs of 40 periods), each
beside the equations (4). The table stands in results/engines.md; each engine replaces its own section.
"""

import re
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tpd import engines  # noqa: E402

RESULT = Path(__file__).parent / "results" / "engines.md"


def cases():
    """Name, scene and pendulum. All blocks lose energy by Housner's impacts."""
    own = tpd.paper_scene()
    small = replace(own.block, restitution="housner", friction=0.0)
    hung = tpd.Pendulum(mass=0.4 * float(small.mass), length=0.08, damping_ratio=0.3)
    yield "paper's block", replace(own, block=small), hung
    chimney = tpd.Block(
        width=1.3,
        height=10.0,
        mass=16_280.0,
        restitution="housner",
        cavity_width=0.9,
        radius_of_gyration=2.92,
    )
    sway = tpd.Harmonic(frequency=0.85, amplitude=0.081)
    yield "chimney", tpd.Scene(chimney, sway), tpd.Pendulum(mass=563.0, length=0.521, damping_ratio=0.2)
    statue = tpd.Block(width=0.45, height=1.8, mass=900.0, restitution="housner")
    yield (
        "statue",
        tpd.Scene(statue, tpd.Harmonic(frequency=1.5, amplitude=0.04)),
        tpd.Pendulum(mass=103.0, length=0.294, damping_ratio=0.7),
    )
    column = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution="housner")
    pulse = tpd.Pulse.one_sine(acceleration=3.0 * 9.80665 / 6.0, frequency=1.2375)
    yield "column, pulse", tpd.Scene(column, pulse), tpd.Pendulum(mass=900.0, length=2.1, damping_ratio=0.2)


ABOUT = {
    "mujoco": "64 paired runs, 100 periods or the pulse",
    "drake": "16 paired runs, 40 periods or the pulse",
}


def measured(engine):
    """Lines of the table of an engine."""
    head = "| scene | engine: overturned with, without | a fifth of its step | equations (4) | "
    lines = [head + "mean tilt, engine | equations (4) | warning | s |", "|---" * 8 + "|"]
    for name, scene, hung in cases():
        begun = time.perf_counter()
        found = getattr(engines, engine)(scene, hung)
        seconds = time.perf_counter() - begun
        print(f"{name}\n{found}\n", flush=True)
        shares = (
            ", ".join(f"{runs.overturned.mean():.1%}" for runs in pair)
            for pair in (found.with_engine, found.finer, found.with_equations)
        )
        change = f"{-found.benefit:+.3f} | {-found.expected_benefit:+.3f}"
        word = found.warning.split(":")[0] if found.warning else "none"
        lines.append(f"| {name} | {' | '.join(shares)} | {change} | {word} | {seconds:.0f} |")
    return lines


def main():
    for engine in sys.argv[1:] or ABOUT:
        lines = measured(engine)
        made = datetime.now(UTC).strftime("%Y-%m-%d")
        about = f"`python -m tests.benchmarks.engines {engine}`, {made}, tpd {tpd.__version__}, {engine} "
        about += f"{version(engine)}; {ABOUT[engine]}; mean tilt: change in units of that of toppling."
        text = RESULT.read_text() if RESULT.exists() else "# Designs in an independent engine\n"
        text = re.sub(rf"\n## {engine}\n.*?(?=\n## |\Z)", "", text, flags=re.DOTALL)
        RESULT.write_text("\n".join([text.rstrip("\n"), "", f"## {engine}", "", about, "", *lines]) + "\n")


if __name__ == "__main__":
    main()
