"""`tpd check`: a design, or a pendulum of one's own, by all models and as `tpd optimise` asks its designs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from tpd.cli import common, optimise
from tpd.core.progress import Bar

if TYPE_CHECKING:
    from tpd.design.job import Job
    from tpd.design.problem import Problem
    from tpd.design.suitability import Suitability
    from tpd.scene.scene import Pendulum


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    command = commands.add_parser(
        "check",
        help="say whether a design, or a pendulum of your own, can be hung",
        description="Solve a design by every model, from the closed forms to the nonlinear equations, and "
        "ask of it what `tpd optimise` asks of its designs: the same conditions, starts, limits and runs. "
        "Exit status: 0 it helps and it fits; 2 bad input; 3 one of these fails, and the last line says "
        "which; 130 interrupted.",
        epilog="\nExample: tpd check --scene tower.toml --mass-ratio 0.03 --length-ratio 0.2 --quick",
    )
    common.add_case(command, common.HARMONIC, common.PULSE, common.RECORDS)
    optimise.NO_WALLS.add(command)
    command.add_argument(
        "--quick", action="store_true", help="leave out the smoothed models, which take long to compile"
    )
    engine = command.add_argument_group("an independent engine (extras: tpd[engines], tpd[drake])")
    engine.add_argument(
        "--engine",
        choices=("mujoco", "drake"),
        help="follow paired runs in a rigid-body engine with contact and sliding in place of the models, and "
        "put the result into the report",
    )
    engine.add_argument(
        "--runs", type=int, help="of the ensemble of the engine (default 64; 16 of drake, which is slower)"
    )
    engine.add_argument("--sliding", type=float, help="coefficient of friction on the floor (default 0.6)")
    engine.add_argument("--seed", type=int, help="of the ensemble of the engine (default 0)")
    command.set_defaults(run=run, does="solving the design by every model")


def run(options: argparse.Namespace) -> int:
    """Solve the design by all models and print the results; return the exit status."""
    job, pendulum = common.case(options)
    from tpd.answers.compare_models import MODELS, QUICK
    from tpd.core import checks
    from tpd.design.problem import check_cavity

    if pendulum is None and options.design is None:
        raise ValueError("give DESIGN, or a pendulum by --pendulum-mass and --pendulum-length")
    given = {name: x for name in ("runs", "sliding", "seed") if (x := getattr(options, name)) is not None}
    if "runs" in given:
        checks.count("--runs", options.runs)
    if options.engine is None:
        if given:
            raise ValueError(f"--{next(iter(given))} is of --engine, which is not given")
        check_cavity(job.block, job.limits)
    elif job.kind != "harmonic":
        raise ValueError("--engine follows harmonic motion, and the job has ground motions")
    common.say(job.scene, pendulum, *optimise.shaken(job))
    if options.engine is not None:
        return _by_engine(job, pendulum, options, given)
    models = QUICK if options.quick else MODELS
    with Bar() as bar:
        if pendulum is None:
            said, is_sound = _bare(job, models, bar)
        elif job.kind == "harmonic":
            said, is_sound = _settled(job, pendulum, models, bar)
        else:
            said, is_sound = _on_motions(job, pendulum, bar)
    print("\n".join(["", *said]))
    return common.SOUND if is_sound else common.UNSOUND


def _settings(job: Job) -> dict[str, Any]:
    """Arguments of `tpd.optimise`, without a limit on the mass: it narrows the space of a search, and a
    pendulum of one's own may lie below it."""
    from tpd.design.criteria import Mass

    return job.settings | {"limits": [limit for limit in job.limits if not isinstance(limit, Mass)]}


def _asked(job: Job) -> Problem:
    """Problem that `tpd optimise` would ask of the designs of a job."""
    from dataclasses import replace

    from tpd.design.problem import Problem

    return replace(Problem.of(job.scene, **_settings(job)), limits=job.limits)


def _by_engine(job: Job, pendulum: Pendulum | None, options: argparse.Namespace, how: dict[str, Any]) -> int:
    """Follow the design in an engine, and add the result to its report."""
    from tpd import engines
    from tpd.report import engine

    with Bar() as bar:
        found = getattr(engines, options.engine)(job.scene, pendulum, progress=bar, **how)
    print(f"\n{found}\n")
    # A design of one's own has no report that the result could be put into.
    if options.design is not None:
        directory = options.design if options.design.is_dir() else options.design.parent
        print("\n".join(f"written: {path}" for path in engine.add(directory, found)))
    if pendulum is None:
        print("The report offers no pendulum: only the bare block was followed.")
        return common.UNSOUND
    # The engine must show the benefit itself; that the equations show it was asked before.
    sound = not found.warning and found.benefit > 0.0
    if not sound and not found.warning:
        print(f"By {found.engine} the pendulum does not help.")
    return common.SOUND if sound else common.UNSOUND


def _on_motions(job: Job, hung: Pendulum, bar: Bar) -> tuple[list[str], bool]:
    """Judge a pendulum under pulses and records as `tpd optimise` judges its best design."""
    from tpd.design.criteria import Mass, limit_of
    from tpd.design.ground.design import headline_of, lines_of
    from tpd.design.ground.optimise import ground_problem, judged

    groups, verdict = judged(ground_problem(job.scene, **_settings(job)), hung, bar)
    said, most = [*lines_of(groups), "", headline_of(verdict)], limit_of(job.limits, Mass)
    if isinstance(most, Mass) and hung.mass > most.kg:
        return [*said, f"does not fit: the bob exceeds the limit on mass, {most.kg:g} kg."], False
    return said, verdict.status.is_sound


def _bare(job: Job, models: tuple[str, ...], bar: Bar) -> tuple[list[str], bool]:
    """Models of the bare block, which a report without a pendulum is about."""
    from tpd.answers.compare_models import check
    from tpd.design.suitability import rests

    said: list[str] = []
    if job.kind == "harmonic":
        said = [check(job.scene, models=models, progress=bar).table(), ""]
        # No pendulum is an answer only where none is needed, under all conditions of the job.
        if rests(_asked(job)):
            return [
                *said,
                "The report offers no pendulum, and under all conditions the bare block settles at rest.",
            ], True
    return [*said, "does not help: the report offers no pendulum."], False


def _settled(job: Job, hung: Pendulum, models: tuple[str, ...], bar: Bar) -> tuple[list[str], bool]:
    """Ask of a pendulum under harmonic motion what `tpd optimise` asks of its designs."""
    from tpd.design.suitability import suitability

    found = suitability(job.scene, hung, asked=_asked(job), models=models, progress=bar)
    worth = "Worth hanging under the stated conditions, as `tpd optimise` asks it: it helps, and it fits."
    last = [f"{refusal}." for refusal in found.refusals] or [worth]
    return [found.check.table(), "", *_around(found, job), found.counted, "", *last], not found.refusals


def _around(found: Suitability, job: Job) -> list[str]:
    """Lines on the motions from rest, and on the space of the job."""
    from tpd.core.formatting import number

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
