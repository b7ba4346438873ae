"""`tpd map`: amplitude, swing, status and uplift margin over two parameters."""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.design_map import DesignMap, design_map
from tpd.answers.fold_curve import fold_curve
from tpd.cli import common, outputs
from tpd.cli.terminal import SOUND, print_answer
from tpd.core import checks, files
from tpd.core.progress import Bar
from tpd.scene.quantities import named
from tpd.scene.scene import Pendulum, Scene
from tpd.theory.no_uplift import AtRest

_MOST_POINTS = 2000
"""Largest number of points along an axis. Four million designs take a minute and a gigabyte of memory."""


def run(options: argparse.Namespace, case: common.Case) -> int:
    """Solve the grid, print the counts of the statuses, write the results and return the exit status."""
    checks.count("--points", options.points, 2, _MOST_POINTS)
    x, y = _axis("--x", options.x), _axis("--y", options.y)
    scene, pendulum = case.job.scene, case.pendulum
    with Bar() as bar:
        # The bar appears before the first designs are solved, because a compilation may come first.
        bar("designs", 0, options.points**2)
        m = design_map(
            scene,
            (x[0], np.linspace(x[1], x[2], options.points)),
            (y[0], np.linspace(y[1], y[2], options.points)),
            pendulum=pendulum,
            start=np.zeros(4) if options.simulate else None,
            progress=partial(bar, "designs"),
        )
    # The header comes after the work, because `design_map` rejects names that cannot be varied together, and
    # nothing is printed for invalid input.
    common.print_header(scene, at_rest=AtRest.under(scene))
    counts = [f"{count:8} {status.replace('_', ' ')}" for status, count in m.counts.items()]
    print_answer("", "number of designs by the status of the motion:", *counts)
    if not options.simulate:
        print(outputs.PERIODIC_ONLY.format("--simulate"))
    # The pictures are drawn when `outputs.write` calls these functions, after the numbers are written.
    pictures = {f"{name}.png": partial(outputs.plot, m, name) for name in ("amplitude", "swing", "margin")}
    if not options.simulate:
        # A motion from rest can reach other motions, so folds belong to the map of the orbits only.
        pictures["amplitude.png"] = partial(_with_folds, m, scene, pendulum)
    axes = {"x": (m.x_name, *m.x[[0, -1]].tolist()), "y": (m.y_name, *m.y[[0, -1]].tolist())}
    # The values of the axes replace those of the scene and the pendulum in the inputs.
    inputs = {**common.json_inputs(scene, pendulum), "varied": axes, "points": len(m.x), "start": m.start}
    tables = {
        "map.csv": files.as_table(m.columns()),
        "map.json": files.as_json({**inputs, "statuses": m.counts}),
    }
    outputs.write(options.out, tables.items(), pictures, overwrite=options.overwrite)
    return SOUND


def _with_folds(m: DesignMap, scene: Scene, pendulum: Pendulum | None) -> Any:
    """Draw the amplitudes of a map with the curve on which the symmetric orbits are lost."""
    x_range, y_range = (m.x[0], m.x[-1]), (m.y[0], m.y[-1])
    folds = fold_curve(scene, m.x_name, m.y_name, x_range=x_range, y_range=y_range, pendulum=pendulum)
    return outputs.plot(folds, ax=outputs.plot(m, "amplitude"))


def _axis(flag: str, words: list[str]) -> tuple[str, float, float]:
    """Return the name of the quantity on an axis with its lowest and highest value."""
    try:
        low, high = (float(v) for v in words[1:])
    except ValueError:
        raise ValueError(f"`{flag}` must be a name and two numbers, but is {' '.join(words)}") from None
    if not low < high:
        raise ValueError(f"`{flag}` must have the lower number first, but goes from {low:g} to {high:g}")
    name = named(words[0])
    if name in common.LARGEST:
        checks.at_most(flag, high, *common.LARGEST[name])
    return name, low, high
