"""`tpd check`: a design, or a pendulum of one's own, by all models and as `tpd optimise` asks its designs."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from tpd.answers.compare_models import MODELS, QUICK, check
from tpd.cli import common
from tpd.cli.interrupts import SOUND, UNSOUND
from tpd.core import checks
from tpd.core.formatting import number
from tpd.core.progress import Bar
from tpd.design.criteria import Mass
from tpd.design.ground.optimise import ground_problem, judged
from tpd.design.job import Job
from tpd.design.problem import Problem, check_cavity
from tpd.design.suitability import Suitability, rests, suitability
from tpd.engines import mujoco
from tpd.report import answer, files, words
from tpd.scene.scene import Pendulum

_WORTH = "Worth hanging under the stated conditions, as `tpd optimise` asks it: it helps, and it fits."
_RESTS = "The report offers no pendulum, and under all conditions the bare block settles at rest."


def run(options: argparse.Namespace) -> int:
    """Solve the design by all models and print the results; return the exit status."""
    job, pendulum = common.case(options)
    if pendulum is None and options.design is None:
        raise ValueError("give DESIGN, or a pendulum by --pendulum-mass and --pendulum-length")
    given = {name: x for name in ("runs", "sliding") if (x := getattr(options, name)) is not None}
    if "runs" in given:
        checks.count("--runs", options.runs)
    if options.seed is not None:
        checks.seed("--seed", options.seed)
    if options.engine is None:
        if given:
            raise ValueError(f"--{next(iter(given))} is of --engine, which is not given")
        check_cavity(job.block, job.limits)
    elif job.kind != "harmonic":
        raise ValueError("--engine follows harmonic motion, and the job has ground motions")
    common.say(job.scene, pendulum, *common.motions(job))
    if options.engine is not None:
        return _by_engine(job, pendulum, options, given)
    models = QUICK if options.quick else MODELS
    with Bar() as bar:
        if pendulum is None:
            said, is_sound = _bare(job, options.seed, models, bar)
        elif job.kind == "harmonic":
            # What `tpd optimise` asks of its designs.
            found = suitability(
                job.scene, pendulum, asked=_asked(job, options.seed), models=models, progress=bar
            )
            last = [f"{refusal}." for refusal in found.refusals] or [_WORTH]
            said = [found.check.table(), "", *_around(found, job), found.counted, "", *last]
            is_sound = not found.refusals
        else:
            # As `tpd optimise` judges its best design.
            problem = replace(ground_problem(job.scene, **_settings(job)), limits=job.limits)
            if options.seed is not None:
                # The motions that are held out stay those of the job.
                problem = replace(problem, seed=options.seed)
            groups, verdict = judged(problem, pendulum, bar)
            said = [*map(words.group, groups), "", *answer.judgement(verdict.status, verdict.reasons)]
            is_sound = verdict.status.is_sound
    print("\n".join(["", *said]))
    return SOUND if is_sound else UNSOUND


def _settings(job: Job) -> dict[str, Any]:
    """Arguments of `tpd.optimise`, without a limit on the mass: it narrows the space of a search, and a
    pendulum of one's own may lie below it."""
    return job.settings | {"limits": [limit for limit in job.limits if not isinstance(limit, Mass)]}


def _asked(job: Job, seed: int | None) -> Problem:
    """Problem that `tpd optimise` would ask of the designs of a job, on runs of another seed if there is
    one."""
    asked = replace(Problem.of(job.scene, **_settings(job)), limits=job.limits)
    return asked if seed is None else replace(asked, seed=seed, ensemble=replace(asked.ensemble, seed=seed))


def _by_engine(job: Job, pendulum: Pendulum | None, options: argparse.Namespace, how: dict[str, Any]) -> int:
    """Follow the design in an engine, and add the result to its report."""
    with Bar() as bar:
        found = mujoco(job.scene, pendulum, seed=options.seed or 0, progress=bar, **how)
    print(f"\n{found}\n")
    # A design of one's own has no report that the result could be put into.
    if options.design is not None:
        directory = options.design if options.design.is_dir() else options.design.parent
        print("\n".join(f"written: {path}" for path in files.add_engine(directory, found)))
    if pendulum is None:
        print("The report offers no pendulum: only the bare block was followed.")
        return UNSOUND
    # The engine must show the benefit itself; that the equations show it was asked before.
    sound = not found.warning and found.benefit > 0.0
    if not sound and not found.warning:
        print(f"By {found.engine} the pendulum does not help.")
    return SOUND if sound else UNSOUND


def _bare(job: Job, seed: int | None, models: tuple[str, ...], bar: Bar) -> tuple[list[str], bool]:
    """Models of the bare block, which a report without a pendulum is about."""
    said: list[str] = []
    if job.kind == "harmonic":
        said = [check(job.scene, models=models, progress=bar).table(), ""]
        # No pendulum is an answer only where none is needed, under all conditions of the job.
        if rests(_asked(job, seed)):
            return [*said, _RESTS], True
    return [*said, "does not help: the report offers no pendulum."], False


def _around(found: Suitability, job: Job) -> list[str]:
    """Lines on the motions from rest, and on the space of the job."""
    v, space = found.verified, job.space
    said = [] if v.rest is None else [v.rest.told]
    bounds = {"mass": space.mass_ratio, "length": space.length_ratio, "damping": space.damping_ratio}
    for x, (name, ends) in zip(v.design, bounds.items(), strict=True):
        low, high = ends if isinstance(ends, tuple) else (ends, ends)
        # A ratio of a pendulum in SI units may differ by rounding.
        if not low * (1.0 - 1e-9) <= x <= high * (1.0 + 1e-9):
            searched = number(low) if low == high else f"{number(low)} to {number(high)}"
            said.append(f"`tpd optimise` would not find it: the {name} ratio is searched at {searched}.")
    return said
