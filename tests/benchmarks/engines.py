"""Simulate designs in an independent engine, and compare the sign of the benefit.

Paired runs in MuJoCo (the extra `engines`) beside the equations (4). All blocks lose energy by
Housner's impacts.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import tpd
from tests.benchmarks.stored import columns

QUESTION = "Does a rigid-body engine agree about the benefit of a design?"
MEASURES = "engines", "compiled"
SEED = None


def cases() -> Iterator[tuple[str, tpd.Scene, tpd.Pendulum]]:
    """Return the paper's block, a chimney, and a column under a pulse."""
    own = tpd.paper_scene()
    small = replace(own.block, restitution="housner", friction=0.0)
    pendulum = tpd.Pendulum(mass=0.4 * float(small.mass), length=0.08, damping_ratio=0.3)
    yield "paper's block", replace(own, block=small), pendulum
    size = {"width": 1.3, "height": 10.0, "mass": 16_280.0, "cavity_width": 0.9, "radius_of_gyration": 2.92}
    sway = tpd.Harmonic(frequency=0.85, amplitude=0.081)
    bob = tpd.Pendulum(mass=563.0, length=0.521, damping_ratio=0.2)
    yield "chimney", tpd.Scene(tpd.Block(**size, restitution="housner"), sway), bob
    column = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution="housner")
    pulse = tpd.Pulse.one_sine(acceleration=3.0 * 9.80665 / 6.0, frequency=1.2375)
    yield "column, pulse", tpd.Scene(column, pulse), tpd.Pendulum(mass=900.0, length=2.1, damping_ratio=0.2)


def run(quick: bool) -> list[dict[str, Any]]:
    """Return one row for each scene."""
    rows = []
    for name, scene, pendulum in list(cases())[2 if quick else 0 :]:
        found = tpd.engines.mujoco(scene, pendulum)
        row = {"engine": "mujoco", "scene": name, "runs": len(found.with_engine[0].overturned)}
        for key in ("with_engine", "finer", "with_equations"):
            row[key] = [float(runs.overturned.mean()) for runs in getattr(found, key)]
        row |= {"change": -found.benefit, "change by the equations": -found.expected_benefit}
        rows.append(row | {"warning": (found.warning or "none").partition(":")[0]})
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of shares that overturn, and of the change of the mean tilt over the toppling tilt."""
    heads = {"engine": "{engine}", "scene": "{scene}", "runs": "{runs}"}
    of = {"overturned with, without pendulum": "with_engine", "with a fifth of the time step": "finer"}
    of |= {"by equations (4)": "with_equations"}
    heads |= {head: f"{{{k}[0]:.1%}}, {{{k}[1]:.1%}}" for head, k in of.items()}
    heads |= {
        "change of the mean tilt": "{change:+.3f}",
        "by equations (4) ": "{change by the equations:+.3f}",
    }
    return columns(rows, **heads, warning="{warning}")
