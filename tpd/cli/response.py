"""`tpd response`: amplitude and stroke of the settled motion over frequency."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.response import (
    BAND,
    Branches,
    Response,
    branches,
    frequencies,
    settled_response,
    window,
)
from tpd.cli import common, outputs
from tpd.cli.common import WITHOUT
from tpd.cli.interrupts import SOUND
from tpd.core import checks, files
from tpd.core.progress import Bar
from tpd.report.files import response_csv
from tpd.report.words import overturned_between
from tpd.scene.scene import Scene
from tpd.theory.no_uplift import AtRest


def run(options: argparse.Namespace, inputs: common.Case) -> int:
    """Follow the branches, write them and print where they are lost; return the exit status."""
    scene, pendulum = inputs.job.scene, inputs.pendulum
    name, low, high = _range(options, scene)
    if options.from_rest != 0:
        checks.count("--from-rest", options.from_rest, least=2)
    common.say(scene, pendulum, alone=AtRest.under(scene))
    own, cases, settled = _own(scene, name), {}, {}
    hangings = common.cases(pendulum)
    with Bar() as bar:
        bar("following branches", 0, len(hangings))
        for label, pendulum in hangings.items():
            cases[label] = branches(scene, name, low, high, pendulum=pendulum, samples=options.points)
            bar("following branches", len(cases), len(hangings))
        if options.from_rest:
            values = frequencies(own, low, high, options.from_rest)
            settled = {
                label: settled_response(scene, name, values, pendulum=pendulum, progress=bar)
                for label, pendulum in hangings.items()
            }
    near = {label: r.between(*window(own)) for label, r in settled.items()}
    print("\n".join(f"{label}: {case}" for label, case in cases.items()))
    # A single motion from rest says little: near ones are counted, and over the range that a report has.
    for ends in (window(own), own * np.array(BAND)) if settled else ():
        first, last = np.clip(ends, low, high)
        if first < last:
            print(overturned_between(tuple(settled.values()), first, last))
    if not settled:
        print("motions that repeat; whether the block reaches one, or overturns, --from-rest N says")
    content = {
        **common.inputs(scene, pendulum),
        "bifurcations": {label: [asdict(b) for b in case.bifurcations] for label, case in cases.items()},
        "over": name,
    }
    sizes = "status", "amplitude_rad", "swing_rad", "phase_rad", "multiplier"
    rows = (row for label, case in cases.items() for row in _rows(label, case))
    tables = [
        ("response.json", files.as_json(content)),
        ("branches.csv", files.as_csv(("case", "branch", name, *sizes), rows)),
    ]

    def draw(responses: dict[str, Response] | None = None) -> Any:
        from tpd.plots.response import plot_branches, plot_response

        return plot_branches(cases) if responses is None else plot_response(tuple(responses.values()), own)

    pictures: dict[str, Callable[[], Any]] = {"branches.png": draw}
    if settled:
        tables.append(("response.csv", response_csv(tuple(settled.values()))))
        pictures["response.png"] = partial(draw, settled)
        # Over the whole range the marks next to the own frequency hide each other.
        if len(near[WITHOUT].frequency):
            pictures["response_near.png"] = partial(draw, near)
    outputs.write(options.out, tables, pictures)
    return SOUND


def _own(scene: Scene, name: str) -> float:
    """Value of the scene's own frequency, Hz, or of its xi."""
    return float(scene.parameters().xi) if name == "xi" else float(scene.motion.frequency)


def _range(options: argparse.Namespace, scene: Scene) -> tuple[str, float, float]:
    """Name of the varied quantity, and its bounds."""
    name = "xi" if options.dimensionless else "frequency"
    own = _own(scene, name)
    low = 0.4 * own if options.low is None else options.low
    high = 2.0 * own if options.high is None else options.high
    checks.positive("--from", low)
    checks.positive("--to", high)
    if not low < high:
        raise ValueError(f"`--from` must be below `--to`, but they are {low:g} and {high:g}")
    checks.within("--points", options.points, 8.0, 100_000.0)
    return name, low, high


def _rows(label: str, case: Branches) -> Iterator[tuple]:
    s = case.sweep
    largest = np.abs(s.multipliers).max(axis=-1)
    for branch in range(s.branches):
        for i, j in zip(*s.line(branch), strict=True):
            sizes = (s.amplitude[i, j], s.swing[i, j], s.phase[i, j], largest[i, j])
            yield (label, branch, s.value[i], s.status[i, j], *sizes)
    for value, margin, swing in zip(s.value, case.margin, case.rest_swing, strict=True):
        if margin > 0.0:
            yield (label, "rest", value, "rest", 0.0, swing, "", "")
