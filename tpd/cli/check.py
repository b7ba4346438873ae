"""`tpd check`: a design, or a pendulum of one's own, by all models and as `tpd optimise` asks its designs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from tpd.cli import common, optimise

if TYPE_CHECKING:
    from tpd.core.scene import Pendulum
    from tpd.design.job import Job
    from tpd.design.problem import Problem
    from tpd.design.suitability import Suitability


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
    engine.add_argument(
        "--sliding", type=float, default=0.6, help="coefficient of friction on the floor (default 0.6)"
    )
    engine.add_argument("--seed", type=int, default=0, help="of the ensemble of the engine (default 0)")
    command.set_defaults(run=run, does="solving the design by every model")


def run(options: argparse.Namespace) -> int:
    """Solve the design by all models and print the results; return the exit status."""
    job, pendulum = common.case(options)
    from tpd.design.question import check_cavity

    if pendulum is None and options.design is None:
        raise ValueError("give DESIGN, or a pendulum by --pendulum-mass and --pendulum-length")
    if options.engine is None:
        check_cavity(job.block, job.limits)
    elif job.kind != "harmonic":
        raise ValueError("--engine follows harmonic motion, and the job has ground motions")
    common.say(job.scene, pendulum, *optimise.shaken(job))
    if options.engine is not None:
        return _by_engine(job, pendulum, options)
    if job.kind != "harmonic":
        return _on_motions(job, pendulum)
    if pendulum is None:
        return _bare(job, options)
    from tpd.analysis.compare_models import MODELS, QUICK
    from tpd.design.suitability import suitability

    with common.bar() as bar:
        found = suitability(
            job.scene,
            pendulum,
            asked=_asked(job),
            models=QUICK if options.quick else MODELS,
            progress=bar,
        )
    print("\n".join(["", found.check.table(), "", *_around(found, job), found.counted, ""]))
    for refusal in found.refusals:
        print(f"{refusal}.")
    if not found.refusals:
        print("Worth hanging under the stated conditions, as `tpd optimise` asks it: it helps, and it fits.")
    return common.UNSOUND if found.refusals else common.SOUND


def _asked(job: Job) -> Problem:
    """Problem that `tpd optimise` would ask of the designs of a job."""
    from dataclasses import replace

    from tpd.design.criteria import Mass
    from tpd.design.problem import Problem

    # A limit on the mass narrows the space of a search; a pendulum of one's own may lie below it.
    given: dict[str, Any] = job.settings | {"limits": [x for x in job.limits if not isinstance(x, Mass)]}
    return replace(Problem.of(job.scene, **given), limits=job.limits)


def _by_engine(job: Job, pendulum: Pendulum | None, options: argparse.Namespace) -> int:
    """Follow the design in an engine, and add the result to its report."""
    from tpd import engines
    from tpd.report import engine

    runs = {} if options.runs is None else {"runs": options.runs}
    follow = getattr(engines, options.engine)
    with common.bar() as bar:
        how = {"seed": options.seed, "sliding": options.sliding, "progress": bar}
        found = follow(job.scene, pendulum, **runs, **how)
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


def _on_motions(job: Job, hung: Pendulum | None) -> int:
    """Judge a pendulum under pulses and records as `tpd optimise` judges its best design."""
    from tpd.design.criteria import Mass, limit_of
    from tpd.design.ground.design import headline_of, lines_of
    from tpd.design.ground.optimise import ground_problem, judged

    if hung is None:
        print("does not help: the report offers no pendulum.")
        return common.UNSOUND
    # A limit on the mass narrows the space of a search; a pendulum of one's own may lie below it.
    asked: dict[str, Any] = job.settings | {"limits": [x for x in job.limits if not isinstance(x, Mass)]}
    with common.bar() as bar:
        problem = ground_problem(job.scene, **asked)
        groups, verdict = judged(problem, hung, bar)
    print("\n".join(["", *lines_of(groups), "", headline_of(verdict)]))
    most = limit_of(job.limits, Mass)
    if isinstance(most, Mass) and hung.mass > most.kg:
        print(f"does not fit: the bob exceeds the limit on mass, {most.kg:g} kg.")
        return common.UNSOUND
    return common.SOUND if verdict.status.is_sound else common.UNSOUND


def _bare(job: Job, options: argparse.Namespace) -> int:
    """Print the models of the bare block, which a report without a pendulum is about."""
    from tpd.analysis.compare_models import MODELS, QUICK, check
    from tpd.design.suitability import rests

    with common.bar() as bar:
        found = check(job.scene, models=QUICK if options.quick else MODELS, progress=bar)
    print(f"\n{found.table()}\n")
    # No pendulum is an answer only where none is needed, under all conditions of the job.
    if rests(_asked(job)):
        print("The report offers no pendulum, and under all conditions the bare block settles at rest.")
        return common.SOUND
    print("does not help: the report offers no pendulum.")
    return common.UNSOUND


def _around(found: Suitability, job: Job) -> list[str]:
    """Lines on the motions from rest, and on the space of the job."""
    from tpd.core.formatting import number

    v, space = found.verified, job.space
    said = [] if v.rest is None else [v.rest.told]
    bounds = space.mass_ratio, space.length_ratio, space.damping_ratio
    names, ends = ("mass", "length", "damping"), [b if isinstance(b, tuple) else (b, b) for b in bounds]
    for name, x, (low, high) in zip(names, v.design, ends, strict=True):
        # A ratio of a pendulum in SI units may differ by rounding.
        if not low * (1.0 - 1e-9) <= x <= high * (1.0 + 1e-9):
            searched = number(low) if low == high else f"{number(low)} to {number(high)}"
            said.append(f"`tpd optimise` would not find it: the {name} ratio is searched at {searched}.")
    return said
