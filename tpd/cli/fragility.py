"""`tpd fragility`: share of the ground motions of each intensity that overturn a block."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.fragility import Fragility, fragility
from tpd.answers.runs import CASE_KEYS
from tpd.cli import common, outputs
from tpd.cli.interrupts import SOUND
from tpd.core import files
from tpd.core.progress import Bar
from tpd.design.job import Job
from tpd.records.intensity import intensity_of
from tpd.records.read import in_words
from tpd.scene.scene import Pendulum
from tpd.theory.no_uplift import AtRest


def run(options: argparse.Namespace, inputs: common.Case) -> int:
    """Follow all motions, write tables and pictures, and print the medians; return the exit status."""
    job, pendulum = inputs
    asked, scene, motions = job.full["motion"], job.scene, job.ground_motions
    stripes = np.linspace(0.5, 8.0, 20) if asked["scales"] is None else np.array(asked["scales"])
    measure = intensity_of(job.intensity, scene.block, float(scene.gravity), options.period)
    factors = [stripes[-1] / measure.value(m) for m in motions]
    strongest = max(factor * float(m.pga) for factor, m in zip(factors, motions, strict=True))
    block = scene.block
    alone = AtRest.of(block.slenderness, block.friction, strongest / scene.gravity, block.base_friction)
    common.say(scene, pendulum, in_words(motions), job.messages, alone)
    with Bar() as bar, common.cluster(options) as cluster:
        found = fragility(
            scene.block,
            motions,
            scales=stripes,
            pendulum=pendulum,
            intensity=job.intensity,
            period=options.period,
            gravity=float(scene.gravity),
            cluster=cluster,
            progress=lambda done, total: bar("following motions", done, total),
        )
    print(found)
    pictures = {
        f"fragility_{name}.png": partial(outputs.plot, found, name) for name in found.without_pendulum
    }
    outputs.write(options.out, _tables(job, pendulum, found), pictures)
    return SOUND


def _tables(job: Job, pendulum: Pendulum | None, found: Fragility) -> Iterator[tuple[str, str]]:
    yield "fragility.csv", files.as_table(found.columns())
    content = {
        **common.inputs(job.scene, pendulum, job),
        "intensity": found.intensity,
        "unit": found.unit,
        "motions": list(found.motions),
        "earthquakes": found.earthquakes,
        "p_values": found.p_values and {name: p.tolist() for name, p in found.p_values.items()},
        "fits": {name: _fits(found, name) for name in found.without_pendulum},
        "first_crossings": {k: list(v) for k, v in found.first_crossings.items()},
        "changed_by_nonlinear_equations": None if found.changed is None else list(found.changed),
        "undecided_by_nonlinear_equations": None if found.unanswered is None else list(found.unanswered),
    }
    yield "fragility.json", files.as_json(content)


def _fits(found: Fragility, name: str) -> dict[str, Any]:
    """Median with its interval, and dispersion, of the curves of one state, and what motions without an
    answer leave open."""
    return {
        case: {
            "median": c.fit.median,
            "dispersion": c.fit.dispersion,
            "interval": list(c.fit.interval()) if 0.0 < c.fit.median < math.inf else None,
            "separated": c.fit.separated,
            "undecided": int(c.undecided.sum()),
            "medians_whatever_the_undecided_do": list(c.medians),
        }
        for case, c in zip(CASE_KEYS, (case[name] for case in found.cases), strict=False)
    }
