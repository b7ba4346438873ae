"""`tpd optimise`: find the pendulum for a block, verify it and write the report."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpd.cli import common, interrupts
from tpd.cli.options import Option, SetWidths, keys
from tpd.core.progress import Bar

if TYPE_CHECKING:
    from tpd.design.job import Job
    from tpd.design.result import Design
    from tpd.design.study import Study

NO_WALLS = Option("--no-walls", "limits", "room", value=False, help="do not ask for room between the walls")
HELD_OUT = Option("--held-out", "motion", "held_out", "X")
DESIGN = (
    Option("--mass-ratio", "space", "mass_ratio", ("LO", "HI")),
    Option("--length-ratio", "space", "length_ratio", ("LO", "HI")),
    Option("--damping", "space", "damping_ratio", "ZETA"),
    Option("--stroke", "limits", "stroke", "RAD"),
    Option("--bob", "bob", "shape", "WORD"),
    NO_WALLS,
)
CONDITIONS = (
    Option("--exactly", "conditions", "exactly"),
    Option("--band", "conditions", "band", ("LO", "HI")),
    Option("--amplitudes", "conditions", "amplitudes", "X"),
    Option("--measure", "risk", "measure", "WORD"),
    Option(
        "--from-rest",
        "starts",
        "kind",
        value="rest",
        help="count rest wherever it holds, though rocking attracts from other starts",
    ),
)
SEARCH = (
    Option("--method", "search", "method", "WORD"),
    Option("--optimiser", "search", "optimiser", "WORD"),
    Option("--searches", "search", "searches", "N"),
    Option("--starts", "search", "starts", "N"),
    Option("--steps", "search", "steps", "N"),
    Option("--at-least", "worth", "at_least", "X"),
    Option("--allowed", "worth", "strikes", "X"),
    Option("--seed", "search", "seed", "N"),
    Option("--pareto", "search", "pareto", help="also find three lighter ones, each verified"),
)


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    optimise = commands.add_parser(
        "optimise",
        help="find the pendulum for a block",
        description="Find the pendulum of least rocking under a harmonic (one condition or many), pulses or "
        "records. Without options: the block of Collini et al. (2016), from rest. A job file (--scene) can "
        "set all that the options set, and more: `tpd new tower` writes one to begin with, and every report "
        "has one, scene.toml, that repeats it.",
        epilog="Exit status: 0 a pendulum is offered, or the bare block needs none; 2 bad input, and one "
        "sentence says what is allowed; 3 no pendulum to rely on, and the first line of the report says why; "
        "130 interrupted, and --resume goes on.\nExample: tpd optimise --scene tower.toml --out tower",
    )
    common.add_scene(optimise, common.HARMONIC, common.PULSE, common.RECORDS, (HELD_OUT,))
    common.add_group(optimise, "design space and limits", DESIGN)
    many = common.add_group(optimise, "conditions", CONDITIONS)
    many.add_argument(
        "--scatter",
        nargs="+",
        action=SetWidths,
        default=argparse.SUPPRESS,
        metavar="NAME=WIDTH",
        help=f"uncertain quantities by their relative half widths: {', '.join(keys()['scatter'])}",
    )
    common.add_group(optimise, "search", SEARCH)
    optimise.add_argument(
        "--resume", action="store_true", help="go on with the searches that an interrupted run left in DIR"
    )
    said = optimise.add_mutually_exclusive_group()
    said.add_argument("--quiet", action="store_true", help="print the verdict and the path of the report")
    said.add_argument("--json", action="store_true", help="print design.json alone, for a pipe")
    said.add_argument("--verbose", action="store_true", help="print the whole report")
    common.add_out(optimise, "tpd-design")
    optimise.set_defaults(run=run, does="searching for the pendulum of least rocking, for {out}")


def run(options: argparse.Namespace) -> int:
    """Search, verify, write the report and print the answer; return the exit status."""
    # The job is checked as a whole before anything is written or compiled.
    job, _ = common.case(options)
    from tpd.design.many import front
    from tpd.design.optimise import optimise
    from tpd.design.problem import check_cavity
    from tpd.design.study import study
    from tpd.report.files import write

    check_cavity(job.block, job.limits)
    # Records are read here: bad files end the command before anything is claimed.
    scene, settings, unfinished = job.scene, job.settings, options.out / interrupts.UNFINISHED
    _claim(options, unfinished)
    if not (options.quiet or options.json):
        common.say(scene, None, *shaken(job))
    with Bar() as bar:
        design, points = optimise(scene, **settings, checkpoint=unfinished, progress=bar), ()
        if job.full["search"]["pareto"] and design.pendulum is not None and design.status.name == "found":
            # An interruption here leaves the design whole; only the front is missing.
            try:
                points = front(design, progress=bar)
            except KeyboardInterrupt:
                print("tpd: interrupted; the report goes without the front", file=sys.stderr)
        shown = study(design, front=points, progress=bar)
    is_interrupted = design.status.name == "interrupted"
    if is_interrupted and not unfinished.exists():
        # A report without an answer would only be in the way of the next run.
        print("tpd: interrupted before a search had ended: nothing is written", file=sys.stderr)
        return common.INTERRUPTED
    try:
        write(options.out, design, shown, job.tables, job.toml)
    except KeyboardInterrupt:
        print(f"tpd: interrupted; {options.out} goes without some of its pictures", file=sys.stderr)
        return common.INTERRUPTED
    _say(options, design, shown)
    if is_interrupted:
        return common.INTERRUPTED
    unfinished.unlink(missing_ok=True)
    return common.SOUND if design.status.is_sound else common.UNSOUND


def shaken(job: Job) -> tuple[str, tuple[str, ...]]:
    """Words for a motion that is not harmonic, and notes on its records; empty for one that is."""
    if job.conditions is None or not job.conditions.motions:
        return "", ()
    motions, stripes = job.conditions.motions, ", ".join(f"{x:g}" for x in job.conditions.scales)
    what = common.words(motions[0]) if job.kind == "pulse" else f"{len(motions)} records"
    return f"{what}, each at {job.conditions.intensity} {stripes}", job.notes


def _say(options: argparse.Namespace, design: Design, shown: Study) -> None:
    """Print the answer as the options ask for it."""
    from tpd.report import answer

    for part in shown.left_out:
        print(f"tpd: interrupted; the report goes without {part}", file=sys.stderr)
    if options.json:
        print((options.out / "design.json").read_text(encoding="utf-8"), end="")
    elif options.verbose:
        print("\n" + (options.out / "report.txt").read_text(encoding="utf-8"), end="")
    elif options.quiet:
        print(f"{answer.verdict(design).text}\n{options.out}")
    else:
        print("\n" + answer.answer(design, shown, options.out))


def _claim(options: argparse.Namespace, unfinished: Path) -> None:
    """Check, before any work, that results can be written, and that there is a search to resume."""
    from tpd.core import files

    # Without this check a mistyped directory would begin a new search in silence.
    if options.resume and not unfinished.exists():
        raise ValueError(f"there is nothing to resume: {unfinished} does not exist")
    if unfinished.exists() and not (options.resume or options.overwrite):
        raise ValueError(
            f"{options.out} already holds files of an interrupted run: go on with it by --resume, or begin "
            "again with another --out or with --overwrite"
        )
    files.claim(options.out, overwrite=options.overwrite or options.resume)
    # The date of the report comes after the search; a bad setting of it must not.
    files.today()
    # A search of another problem must not be taken for the beginning of this one.
    if not options.resume:
        unfinished.unlink(missing_ok=True)
