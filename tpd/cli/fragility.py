"""`tpd fragility`: share of ground motions that overturn a block, as a function of their intensity."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.annual_rates import AnnualRates, annual_rates
from tpd.answers.fragility import Fragility, fragility
from tpd.answers.motion_history import sliding
from tpd.answers.run_table import CASE_KEYS
from tpd.cli import common, outputs
from tpd.cli.terminal import SOUND, print_answer
from tpd.core import files
from tpd.core.checks import PLAUSIBLE
from tpd.core.formatting import number
from tpd.core.progress import Bar, Progress
from tpd.design.assess import problem_alone
from tpd.design.job import Job
from tpd.design.validate import run_seed
from tpd.records.intensity import intensity_of, measure_of
from tpd.records.read import in_words
from tpd.report.blocks import Code, Section, wrapped
from tpd.report.files import add_to
from tpd.report.json import json_of
from tpd.scene.conditions import Conditions
from tpd.scene.hazard import HOW_TO, MOST_DISPERSION, Hazard
from tpd.scene.scene import Pendulum
from tpd.theory.no_uplift import AtRest


def run(options: argparse.Namespace, case: common.Case) -> int:
    """Simulate all motions, print the medians, write tables and pictures, and return the exit status."""
    job, pendulum = case
    scene, motions, scales = job.scene, job.ground_motions, job.full["excitation"]["scales"]
    most, _ = PLAUSIBLE.get(job.intensity, (8.0, ""))
    intensities = np.linspace(most / 16.0, most, 20) if scales is None else np.array(scales)
    # The header compares the strongest motion with the acceleration that lifts the block.
    measure = intensity_of(job.intensity, scene.block, float(scene.gravity), options.period)
    if (hazard := job.hazard) is not None:
        # A hazard over another intensity must not be noticed only after all runs.
        hazard.factor(measure_of(job.intensity, scene.block, scene.gravity, options.period))
    strongest = max(float(m.pga / measure.value(m)) for m in motions) * float(max(intensities))
    block = scene.block
    # `AtRest.under` would use the motion of the scene, which is not scaled.
    at_rest = AtRest.of(block.slenderness, block.friction, strongest / scene.gravity, block.base_friction)
    common.print_header(scene, pendulum, in_words(motions), job.messages, at_rest)
    with Bar() as bar:
        curves = fragility(
            scene.block,
            motions,
            scales=intensities,
            pendulum=pendulum,
            intensity=job.intensity,
            period=options.period,
            gravity=float(scene.gravity),
            progress=lambda done, total: bar("ground motions", done, total),
        )
        rates = None if hazard is None else _rates(job, pendulum, curves, options.period, bar)
    scaled = [m.scaled(x / measure.value(m)) for m in motions for x in intensities]
    friction = wrapped(sliding(scene, scaled, pendulum).sentence)
    yearly = (HOW_TO,) if rates is None else rates.sentences
    if hazard is not None:
        yearly = *yearly, *_by_curve(curves, hazard)
    lines = [str(curves), *(line for text in yearly for line in wrapped(f"{text}.")), *friction]
    print_answer("", *lines)
    # There is one picture for each damage state. It is drawn when `outputs.write` calls the function.
    states = curves.without_pendulum
    pictures = {f"fragility_{name}.png": partial(outputs.plot, curves, name) for name in states}
    # The keys of the JSON file are part of the interface; `None` marks results that this run does not have.
    content = {
        **common.json_inputs(scene, pendulum, job),
        "intensity": curves.intensity,
        "unit": curves.unit,
        "motions": list(curves.motions),
        "earthquakes": curves.earthquakes,
        "p_values": curves.p_values and {name: p.tolist() for name, p in curves.p_values.items()},
        "fits": {name: _fits(curves, name) for name in states},
        "annual_rates": json_of(rates),
        "first_crossings": {k: list(v) for k, v in curves.first_crossings.items()},
        "changed_by_nonlinear_equations": None if curves.changed is None else list(curves.changed),
        "undecided_by_nonlinear_equations": None if curves.unanswered is None else list(curves.unanswered),
    }
    tables = ("fragility.csv", files.as_table(curves.columns())), ("fragility.json", files.as_json(content))
    outputs.write(options.out, tables, pictures, overwrite=options.overwrite)
    # The results are in their own folder now, so a damaged report does not lose them.
    answer = Code("\n".join([in_words(motions), *lines]))
    for path in add_to(options.design, Section("Fragility under earthquakes", (answer,))):
        print(f"written: {path}")
    return SOUND


def _rates(
    job: Job, pendulum: Pendulum | None, curves: Fragility, period: float | None, progress: Progress
) -> AnnualRates:
    """Return the annual rates of the validation runs, as in the other commands.

    They have levels between the first and the last stripe. Runs at the stripes give the rates if there is one
    stripe, or if the intensity is a spectral acceleration.
    """
    hazard = job.hazard
    assert hazard is not None
    if period is not None or len(curves.stripes) == 1:
        return annual_rates(curves, hazard)
    conditions = Conditions.records(job.motions, curves.stripes, intensity=job.intensity, hazard=hazard)
    problem = problem_alone(job.scene, **(job.settings | {"conditions": conditions}))
    designs = [None, *([] if pendulum is None else [problem.ratios(pendulum)])]
    how = {"seed": run_seed(problem, 0, 0), "progress": partial(progress, "runs for the annual rate")}
    return problem.annual_rates([problem.validation_runs(x, **how) for x in designs])


def _by_curve(curves: Fragility, hazard: Hazard) -> Iterator[str]:
    """Yield a sentence on the return periods by the fitted curves, and on the misfit of the curves."""
    fits = [case["overturned"] for case in curves.cases if "overturned" in case]
    if fits and all(
        0.0 < c.fit.median < math.inf and 0.0 < c.fit.dispersion <= MOST_DISPERSION for c in fits
    ):
        factor = hazard.factor(curves.measure)
        years = (1.0 / hazard.annual_rate(factor * c.fit.median, c.fit.dispersion) for c in fits)
        listed = " and ".join(number(x, 3) for x in years)
        misfit = max(float(np.nanmax(np.abs(c.shares - c.fit.probability(curves.stripes)))) for c in fits)
        points = f"differ from the shares of the runs by at most {number(100.0 * misfit, 2)} points"
        yield f"By the fitted curves the return period is {listed} years; the curves {points}"


def _fits(curves: Fragility, name: str) -> dict[str, Any]:
    """Return the fitted curves of one state: median with its interval, and dispersion.

    The medians are also given for both extreme outcomes of the motions that have no solution.
    """
    # A median of zero or infinity has no interval: all motions, or none, cause the state.
    return {
        case: {
            "median": c.fit.median,
            "dispersion": c.fit.dispersion,
            "interval": list(c.fit.interval()) if 0.0 < c.fit.median < math.inf else None,
            "separated": c.fit.separated,
            "undecided": int(c.undecided.sum()),
            "medians_whatever_the_undecided_do": list(c.medians),
        }
        for case, c in zip(CASE_KEYS, (case[name] for case in curves.cases), strict=False)
    }
