"""`tpd check`: a design, or any pendulum, by all models and by the validation of `tpd optimise`."""

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
from tpd.design.assess import needless
from tpd.design.criteria import DesignSpace, Mass, check_cavity, stroke_limit
from tpd.design.harmonic import HarmonicProblem
from tpd.design.job import Job
from tpd.design.optimise import problem_of
from tpd.design.problem import Problem
from tpd.design.validate import Validated, validate
from tpd.engines import mujoco
from tpd.report import answer, files, words
from tpd.scene.scene import Pendulum
from tpd.theory.no_uplift import AtRest


def run(options: argparse.Namespace, inputs: common.Case) -> int:
    """Solve the design by all models and print the results; return the exit status."""
    job, pendulum = inputs
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
    if options.engine is not None:
        common.say(job.scene, pendulum, job.in_words, job.all_messages, AtRest.under(job.scene))
        return _by_engine(job, pendulum, options, given)
    problem = _problem(job, options.seed)
    common.say(job.scene, pendulum, job.in_words, job.all_messages, problem.at_rest)
    models = MODELS if options.full else QUICK
    with Bar() as bar:
        said, is_sound = _validated(job, problem, pendulum, models, bar)
    print("\n".join(["", *said]))
    return SOUND if is_sound else UNSOUND


def _problem(job: Job, seed: int | None) -> Problem:
    """Problem of a job, on runs of another seed if there is one. The motions that are held out stay those of
    the job. A limit on the mass does not narrow the space: the pendulum may lie below it."""
    some = [limit for limit in job.limits if not isinstance(limit, Mass)]
    settings: dict[str, Any] = job.settings | {"limits": some}
    found = replace(problem_of(job.scene, **settings), limits=job.limits)
    if seed is None:
        return found
    return replace(found, seed=seed, ensemble=replace(found.ensemble, seed=seed))


def _validated(
    job: Job, problem: Problem, pendulum: Pendulum | None, models: tuple[str, ...], bar: Bar
) -> tuple[list[str], bool]:
    """Lines on a pendulum, or on the block alone where a report has none: all models, and the validation that
    `tpd optimise` requires of its designs."""
    said = list[str]()
    if isinstance(problem, HarmonicProblem):
        limit = stroke_limit(job.limits)
        said = [check(job.scene, pendulum, swing_limit=limit, models=models, progress=bar).table(), ""]
    # No pendulum is an answer only where none is needed, under all conditions of the job.
    if (status := problem.needs_none) is not None:
        return [*said, needless(problem)], status.is_sound
    if pendulum is None:
        return [*said, "NOT RECOMMENDED: the report has no pendulum."], False
    found = validate(problem, problem.ratios(pendulum), thorough=True, progress=bar)
    said += _outside(found, problem.space)
    runs = found.runs
    if runs is not None:
        said.append(
            f"{runs.description}: {words.reduction(runs, found.measure)}. A limit is exceeded in "
            f"{found.over_limit:.1%} of the runs in which the block stands "
            f"(at most {problem.allowed:.1%} allowed)."
        )
        if runs.undecided:
            said.append(f"{runs.undecided} runs have no answer and are left out.")
        if runs.cluster is not None:
            said += [words.group(part) for part in runs.parts]
    status = found.status if found.reasons else problem.evidence
    return [*said, "", *answer.verdict_lines(status, found.refusals)], status.is_sound


def _by_engine(job: Job, pendulum: Pendulum | None, options: argparse.Namespace, how: dict[str, Any]) -> int:
    """Follow the design in an engine, and add the result to its report."""
    if (own := job.block.base_friction) is not None:
        how.setdefault("sliding", own)
    with Bar() as bar:
        found = mujoco(job.scene, pendulum, seed=options.seed or 0, progress=bar, **how)
    print(f"\n{found}\n")
    # A design of one's own has no report that the result could be put into.
    if options.design is not None:
        directory = options.design if options.design.is_dir() else options.design.parent
        for path in files.add_engine(directory, found):
            print(f"written: {path}")
    if pendulum is None:
        print("The report has no pendulum: only the block alone was simulated.")
        return UNSOUND
    # The engine must show the benefit itself; that the equations show it was asked before.
    sound = not found.warning and found.benefit > 0.0
    if not sound and not found.warning:
        print(f"By {found.engine} the pendulum does not help.")
    return SOUND if sound else UNSOUND


def _outside(found: Validated, space: DesignSpace) -> list[str]:
    """Lines on ratios that the space does not contain."""
    said = []
    for x, name, low, high in zip(found.design, ("mass", "length", "damping"), *space.ends, strict=True):
        # A ratio of a pendulum in SI units may differ by rounding.
        if not low * (1.0 - 1e-9) <= x <= high * (1.0 + 1e-9):
            searched = number(low) if low == high else f"{number(low)} to {number(high)}"
            said.append(f"`tpd optimise` would not find it: the {name} ratio is searched at {searched}.")
    return said
