"""`tpd check`: validation of a design, or of any pendulum, as in `tpd optimise`."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from tpd.answers.compare_models import MEANING, check
from tpd.answers.motion_history import sliding
from tpd.cli import common, outputs
from tpd.cli.terminal import SOUND, UNSOUND, print_answer
from tpd.core import checks
from tpd.core.formatting import number, with_and_without
from tpd.core.progress import Bar
from tpd.design.job import Job
from tpd.design.optimise import problem_of
from tpd.design.problem import Problem
from tpd.design.reasons import reduction
from tpd.design.space import DesignSpace
from tpd.design.stored_design import read_design
from tpd.design.validate import Validation, validate
from tpd.engines import mujoco
from tpd.limits import Mass, stroke_limit
from tpd.report import summary, words
from tpd.report.blocks import Code, Section, wrapped
from tpd.report.files import add_to
from tpd.scene.scene import Pendulum, Scene
from tpd.theory.no_uplift import AtRest

_OVERTURNED = (
    "THE BLOCK OVERTURNS from rest under the stated motion by a model of this table. This is one motion. The "
    "verdict below compares many runs with and without the pendulum, and can be RECOMMENDED nevertheless."
)


def run(options: argparse.Namespace, case: common.Case) -> int:
    """Check the pendulum by the models or by an engine, print the results and return the exit status."""
    job, pendulum = case
    if pendulum is None and options.design is None:
        raise ValueError("a pendulum is missing: give DESIGN, or --pendulum-mass and --pendulum-length")
    if options.runs is not None:
        checks.count("--runs", options.runs)
    if options.seed is not None:
        checks.seed("--seed", options.seed)
    if options.engine is not None:
        scene = job.single
        common.print_header(scene, pendulum, job.in_words, job.all_messages, AtRest.under(scene))
        return _check_by_engine(scene, pendulum, options)
    if options.runs is not None:
        raise ValueError("--runs has an effect only together with --engine")
    problem, crossed = _problem_of(job, options.seed), None
    # All earthquakes count for a pendulum that they did not choose.
    if options.design is None:
        problem = problem.of_all
    elif designs := read_design(options.design).crossed:
        crossed = np.array(designs) if len(problem.crossed) == len(designs) else None
    common.print_header(job.scene, pendulum, job.in_words, job.all_messages, problem.at_rest)
    with Bar() as bar:
        lines, is_sound = _check_by_models(problem, pendulum, crossed, bar)
    print_answer("", *lines)
    _write(options, "\n".join(lines))
    return SOUND if is_sound else UNSOUND


def _problem_of(job: Job, seed: int | None) -> Problem:
    """Return the design problem of a job.

    Args:
        job: job of the command.
        seed: seed of the validation runs, None for that of the job. The choice of motions for validation
            always follows the seed of the job.
    """
    # A limit on the mass narrows the design space, and may leave it empty. The pendulum of this command may
    # lie outside of the space, so the limit is added after the space was made.
    others = [limit for limit in job.limits if not isinstance(limit, Mass)]
    settings: dict[str, Any] = job.settings | {"limits": others}
    problem = replace(problem_of(job.scene, **settings), limits=job.limits)
    if seed is None:
        return problem
    return replace(problem, seed=seed, ensemble=replace(problem.ensemble, seed=seed))


def _check_by_models(
    problem: Problem, pendulum: Pendulum | None, crossed: np.ndarray | None, bar: Bar
) -> tuple[list[str], bool]:
    """Solve the motion by several models and validate the pendulum as `tpd optimise` does.

    Returns:
        Lines for the terminal, and whether the exit status is `SOUND`.
    """
    table: list[str] = []
    # Only motions under a harmonic settle.
    if not problem.has_earthquakes:
        limit = stroke_limit(problem.limits)
        checked = check(problem.scene, pendulum, swing_limit=limit, progress=bar)
        table = [*checked.lines, *wrapped(MEANING), ""]
        if any(model.status == "overturned" for model in checked.models):
            table += [*wrapped(_OVERTURNED), ""]
    # A report without a pendulum is right only if the block needs none under all conditions of the job.
    if (status := problem.needs_none) is not None:
        return [*table, *wrapped(problem.needless)], status.is_sound
    if pendulum is None:
        return [*table, "NOT RECOMMENDED: the report has no pendulum."], False
    # `thorough` simulates the validation runs also for a pendulum that exceeds a limit, which a search skips.
    how: dict[str, Any] = {"crossed": crossed, "thorough": True, "progress": bar}
    validation = validate(problem, problem.ratios(pendulum), **how)
    sentences = _ratios_outside(validation, problem.space)
    runs = validation.runs
    if runs is not None:
        friction = sliding(problem.scene, problem.stated_motions, pendulum)
        # Sliding comes first, because the runs do not describe a base that slides.
        sentences.insert(0 if friction.slides else len(sentences), friction.sentence)
        sentences += [
            f"{runs.description}: {reduction(runs, validation.measure)}.",
            f"{words.exceeding(validation.over_limit, problem.allowed)}.",
        ]
        if runs.undecided:
            sentences.append(f"{runs.undecided} runs have no solution and are not counted.")
        # Each group of ground motions has its part of the runs: those of the search, and those that were
        # kept for the validation.
        for part, _ in zip(runs.parts, problem.groups, strict=False):
            tilts = with_and_without(part.with_pendulum, part.without_pendulum)
            counted = f"  {part.label} ({part.rows.sum()} runs)"
            sentences.append(f"{counted}: mean tilt, as a share of ν, {tilts}")
        sentences += [f"  {text}" for text in summary.at_levels(problem, runs)]
        sentences += [f"{text}." for text in problem.yearly(runs.annual_rates)]
    status, reasons = validation.status, validation.refusals or problem.missing
    verdict = problem.headline(status, validation.refusals)
    before = [line for text in sentences for line in wrapped(text)]
    after = [line for text in status.other(reasons) for line in wrapped(text, "  reason      ", " " * 14)]
    return [*table, *before, "", *after, *wrapped(verdict)], status.is_sound


def _write(options: argparse.Namespace, answer: str) -> None:
    """Write the answer into the folder of `--out`, if the option is given."""
    if options.out is not None:
        outputs.write(options.out, [("check.txt", f"{answer}\n")], {}, overwrite=options.overwrite)


def _check_by_engine(scene: Scene, pendulum: Pendulum | None, options: argparse.Namespace) -> int:
    """Simulate the pendulum in a rigid-body engine, add the result to the report of the design, if any, and
    return the exit status."""
    # The engine has defaults for the number of runs and for the friction of the base.
    stated = {"runs": options.runs, "sliding": scene.block.base_friction}
    settings = {name: x for name, x in stated.items() if x is not None}
    with Bar() as bar:
        comparison = mujoco(scene, pendulum, seed=options.seed or 0, progress=bar, **settings)
    print_answer("", str(comparison), "")
    _write(options, str(comparison))
    section = Section("Independent contact engine", (Code(str(comparison)),), comparison.warning)
    for path in add_to(options.design, section):
        print(f"written: {path}")
    if pendulum is None:
        print("The report has no pendulum. The engine simulated only the block without a pendulum.")
        return UNSOUND
    # The engine must show a benefit of its own. The validation by the equations is a separate check.
    is_sound = not comparison.warning and comparison.benefit > 0.0
    if not is_sound and not comparison.warning:
        print(f"According to {comparison.engine} the pendulum does not reduce the rocking.")
    return SOUND if is_sound else UNSOUND


def _ratios_outside(validation: Validation, space: DesignSpace) -> list[str]:
    """Return a sentence for each ratio of the pendulum that lies outside of the design space."""
    sentences = []
    names = "mass", "length", "damping"
    for ratio, name, low, high in zip(validation.design, names, *space.ends, strict=True):
        # The ratio is computed from SI units and may differ from a bound by rounding.
        if not low * (1.0 - 1e-9) <= ratio <= high * (1.0 + 1e-9):
            bounds = number(low) if low == high else f"{number(low)} to {number(high)}"
            outside = f"lies outside of the design space of the job ({bounds})"
            meaning = "`tpd optimise` cannot return this pendulum"
            sentences.append(f"The {name} ratio {number(ratio)} {outside}, so {meaning}.")
    return sentences
