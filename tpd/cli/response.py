"""`tpd response`: tilt and swing of the steady motion over the frequency of the excitation."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.motion_history import sliding
from tpd.answers.response import BAND, Branches, Response, branches, frequencies, settled_response, window
from tpd.answers.run_table import cases_of
from tpd.cli import common, outputs
from tpd.cli.common import CASES, WITHOUT
from tpd.cli.terminal import SOUND, print_answer
from tpd.core import checks, files
from tpd.core.progress import Bar
from tpd.report.blocks import wrapped
from tpd.report.files import response_csv
from tpd.report.words import overturned_between
from tpd.scene.conditions import train_of
from tpd.scene.scene import Scene
from tpd.theory.no_uplift import AtRest


def run(options: argparse.Namespace, case: common.Case) -> int:
    """Compute the branches and the motions from rest, print a summary, write the results and return the exit
    status."""
    scene, pendulum = case.job.scene, case.pendulum
    name, low, high = _range(options, scene)
    if options.runs_from_rest != 0:
        checks.count("--runs-from-rest", options.runs_from_rest, least=2)
    common.print_header(scene, pendulum, at_rest=AtRest.under(scene))
    own = _own_value(scene, name)
    orbits: dict[str, Branches] = {}
    settled: dict[str, Response] = {}
    pendulums = dict(zip(CASES, cases_of(pendulum), strict=False))
    with Bar() as bar:
        bar("branches", 0, len(pendulums))
        for label, case_pendulum in pendulums.items():
            orbits[label] = branches(scene, name, low, high, pendulum=case_pendulum, samples=options.points)
            bar("branches", len(orbits), len(pendulums))
        # Motions from rest take longer than branches, so they can be turned off.
        if options.runs_from_rest:
            values = frequencies(own, low, high, options.runs_from_rest)
            settled = {
                label: settled_response(scene, name, values, pendulum=case_pendulum, progress=bar)
                for label, case_pendulum in pendulums.items()
            }
    # The motions near the base frequency are drawn in a picture of their own.
    near = {label: response.between(*window(own)) for label, response in settled.items()}
    lines = [f"{label}: {case_orbits}" for label, case_orbits in orbits.items()]
    # A tiny change of the frequency decides whether a single run overturns. Therefore shares of many runs are
    # printed: near the frequency of the excitation, and over the range that a report shows.
    for ends in (window(own), own * np.array(BAND)) if settled else ():
        first, last = np.clip(ends, low, high)
        if first < last:
            lines.append(overturned_between(tuple(settled.values()), first, last))
    if settled:
        trains = [train_of(scene.excitation, frequency=float(x)) for x in settled[WITHOUT].frequency / own]
        lines += wrapped(sliding(scene, trains, pendulum).sentence)
    else:
        lines.append(outputs.PERIODIC_ONLY.format("--runs-from-rest N"))
    print_answer("", *lines)
    content = {
        **common.json_inputs(scene, pendulum),
        "bifurcations": {label: [asdict(b) for b in x.bifurcations] for label, x in orbits.items()},
        "over": name,
    }
    sizes = "status", "amplitude_rad", "swing_rad", "phase_rad", "multiplier"
    rows = (row for label, case_orbits in orbits.items() for row in _rows(label, case_orbits))
    table = files.as_csv(("case", "branch", name, *sizes), rows)
    tables = [("response.json", files.as_json(content)), ("branches.csv", table)]

    def picture(cases: dict[str, Any], **how: Any) -> Callable[[], Any]:
        *without, last = cases.values()
        return partial(outputs.plot, last, without=without[0] if without else None, **how)

    pictures = {"branches.png": picture(orbits)}
    if settled:
        tables.append(("response.csv", response_csv(tuple(settled.values()))))
        pictures["response.png"] = picture(settled, own=own)
        # In the picture of the whole range the marks near the base frequency hide each other.
        if len(near[WITHOUT].frequency):
            pictures["response_near.png"] = picture(near, own=own)
    outputs.write(options.out, tables, pictures, overwrite=options.overwrite)
    return SOUND


def _own_value(scene: Scene, name: str) -> float:
    """Return the frequency (Hz) of the excitation, or its frequency ratio if `name` is "xi"."""
    return float(scene.parameters().xi) if name == "xi" else float(scene.excitation.frequency)


def _range(options: argparse.Namespace, scene: Scene) -> tuple[str, float, float]:
    """Return the name of the varied quantity, "frequency" or "xi", with its lowest and highest value."""
    name = "xi" if options.dimensionless else "frequency"
    own = _own_value(scene, name)
    low = 0.4 * own if options.low is None else options.low
    high = 2.0 * own if options.high is None else options.high
    checks.positive("--from", low)
    checks.positive("--to", high)
    if not low < high:
        raise ValueError(f"`--from` must be below `--to`, but they are {low:g} and {high:g}")
    checks.within("--points", options.points, 8.0, 100_000.0)
    return name, low, high


def _rows(label: str, orbits: Branches) -> Iterator[tuple]:
    """Yield the rows of branches.csv: one for each orbit, and one for each value with a stable rest."""
    s = orbits.sweep
    # An orbit is stable if its largest Floquet multiplier is below 1 in modulus.
    largest = np.abs(s.multipliers).max(axis=-1)
    for branch in range(s.branches):
        for i, j in zip(*s.line(branch), strict=True):
            sizes = (s.amplitude[i, j], s.swing[i, j], s.phase[i, j], largest[i, j])
            yield (label, branch, s.value[i], s.status[i, j], *sizes)
    for value, margin, swing in zip(s.value, orbits.margin, orbits.rest_swing, strict=True):
        # With a positive uplift margin a block at rest stays at rest.
        if margin > 0.0:
            yield (label, "rest", value, "rest", 0.0, swing, "", "")
