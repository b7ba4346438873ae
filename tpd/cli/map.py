"""`tpd map`: amplitude, stroke, status and uplift margin over two parameters."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.design_map import DesignMap, design_map
from tpd.cli import common, outputs
from tpd.cli.interrupts import SOUND
from tpd.core import checks, files
from tpd.core.progress import Bar
from tpd.theory.no_uplift import AtRest

_MOST_POINTS = 2000.0
"""Along each axis: four million designs take a minute and a gigabyte of memory."""


def run(options: argparse.Namespace, inputs: common.Case) -> int:
    """Solve the grid, write it and print the counts of the statuses; return the exit status."""
    checks.count("--points", options.points, least=2)
    checks.within("--points", options.points, 2.0, _MOST_POINTS)
    x, y = (_axis(flag, given) for flag, given in (("--x", options.x), ("--y", options.y)))
    scene, pendulum = inputs.job.scene, inputs.pendulum
    with Bar() as bar, common.cluster(options) as cluster:
        bar("mapping", 0, options.points**2)
        m = design_map(
            scene,
            (x[0], np.linspace(x[1], x[2], options.points)),
            (y[0], np.linspace(y[1], y[2], options.points)),
            pendulum=pendulum,
            start=np.zeros(4) if options.from_rest else None,
            cluster=cluster,
            progress=partial(bar, "mapping"),
        )
    # Not before: `design_map` refuses names that cannot be varied together.
    common.say(scene, alone=AtRest.under(scene))
    print("\n".join(f"{count:8} {status.replace('_', ' ')}" for status, count in m.counts.items()))
    if not options.from_rest:
        print("motions that repeat; whether the block reaches one, or overturns, --from-rest says")
    pictures = {f"{name}.png": partial(outputs.plot, m, name) for name in ("amplitude", "swing", "margin")}
    outputs.write(options.out, _tables(m, common.inputs(scene, pendulum)), pictures)
    return SOUND


def _axis(flag: str, given: list[str]) -> tuple[str, float, float]:
    """Name and bounds of an axis."""
    try:
        low, high = (float(v) for v in given[1:])
    except ValueError:
        raise ValueError(f"`{flag}` must be a name and two numbers, but is {' '.join(given)}") from None
    if not low < high:
        raise ValueError(f"`{flag}` must go up, but goes from {low:g} to {high:g}")
    name = given[0].replace("-", "_")
    if name in common.MOST:
        checks.at_most(flag, high, *common.MOST[name])
    return name, low, high


def _tables(m: DesignMap, inputs: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield "map.csv", files.as_table(m.columns())
    axes = {"x": (m.x_name, *m.x[[0, -1]].tolist()), "y": (m.y_name, *m.y[[0, -1]].tolist())}
    # Along an axis its values replace those of the scene and the pendulum.
    content = {**inputs, "varied": axes, "points": len(m.x), "start": m.start, "statuses": m.counts}
    yield "map.json", files.as_json(content)
