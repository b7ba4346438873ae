"""`tpd optimise`: find the pendulum for a block, verify it and write the report."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpd.cli import common, ground, optimise_records
from tpd.cli.options import Option, SetWidths
from tpd.cli.schema import keys

if TYPE_CHECKING:
    from tpd.cli.config import Job
    from tpd.core.progress import Bar
    from tpd.design.front import FrontPoint
    from tpd.design.result import Design

_UNFINISHED = "unfinished.npz"
"""File of the output directory with the searches that have ended, while others have not."""

DESIGN = (
    Option("--mass-ratio", "space", "mass_ratio", ("LO", "HI")),
    Option("--length-ratio", "space", "length_ratio", ("LO", "HI")),
    Option("--damping", "space", "damping_ratio", "ZETA"),
    Option("--stroke", "limits", "stroke", "RAD"),
    Option("--bob", "bob", "shape", "WORD"),
    Option("--no-walls", "limits", "room", value=False, help="do not ask for room between the walls"),
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
    Option("--at-least", "worth", "at_least", "X"),
    Option("--allowed", "worth", "strikes", "X"),
    Option("--seed", "search", "seed", "N"),
)


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    optimise = commands.add_parser(
        "optimise",
        help="find the pendulum for a block",
        description="Find the pendulum of least settled rocking, under one condition or many. Without "
        "options: the block of Collini et al. (2016), from rest. A job file (--scene) can set everything "
        "that the options set, and more: `tpd new tower` writes one to begin with.",
        epilog="Exit status: 0 a pendulum is offered, or the bare block needs none; 2 bad input, and one "
        "sentence says what is allowed; 3 no pendulum to rely on, and the first line of the report says why; "
        "130 interrupted, and --resume goes on.",
    )
    common.add_scene(optimise)
    _add_group(optimise, "design space and limits", DESIGN)
    many = _add_group(optimise, "conditions", CONDITIONS)
    many.add_argument(
        "--scatter",
        nargs="+",
        action=SetWidths,
        default=argparse.SUPPRESS,
        metavar="NAME=WIDTH",
        help=f"uncertain quantities by their relative half widths: {', '.join(keys()['scatter'])}",
    )
    _add_group(optimise, "search", SEARCH)
    optimise.add_argument("--pareto", action="store_true", help="also find three lighter ones, each verified")
    optimise.add_argument(
        "--resume", action="store_true", help="go on with the searches that an interrupted run left in DIR"
    )
    shaken = optimise.add_argument_group("ground motions")
    shaken.add_argument(
        "--records",
        nargs="+",
        default=(),
        metavar="FILE",
        help="shake the design by records as well: files, folders, "
        f"{', '.join((*ground.BUILT_IN, *ground.SETS))}",
    )
    ground.add_reading(shaken, baseline=False)
    optimise_records.add(shaken)
    common.add_out(optimise, "tpd-design")
    optimise.set_defaults(run=run, does="searching for the pendulum of least rocking, for {out}")


def _add_group(
    command: argparse.ArgumentParser, title: str, options: tuple[Option, ...]
) -> argparse._ArgumentGroup:
    group = command.add_argument_group(title)
    for option in options:
        option.add(group)
    return group


def run(options: argparse.Namespace) -> int:
    """Search, verify, write the report and print it; return the exit status."""
    if options.scales is not None:
        return optimise_records.run(options)
    common.use_64_bits()
    from tpd.cli import config
    from tpd.design.question import check_cavity

    # The job is checked as a whole before anything is written or compiled.
    job = config.job_of(common.tables(options))
    check_cavity(job.scene.block, job.limits)
    records = ground.motions(options.records, **ground.reading(options)) if options.records else ()
    unfinished = options.out / _UNFINISHED
    claim(options, unfinished)
    common.say(job.scene)
    from tpd.design.study import study
    from tpd.report.files import write

    with common.bar() as bar, hinting(unfinished):
        design = _design(job, unfinished, bar)
        points = front_of(design, bar) if options.pareto else ()
        shown = study(design, front=points, records=records, sources=options.records, progress=bar)
    for part in shown.left_out:
        print(f"tpd: interrupted; the report goes without {part}", file=sys.stderr)
    if design.status.name == "interrupted" and not unfinished.exists():
        # A report without an answer would only be in the way of the next run.
        print("tpd: interrupted before a search had ended: nothing is written", file=sys.stderr)
        return common.INTERRUPTED
    try:
        written = write(options.out, design, shown, config.tables(job), config.dump(job))
    except KeyboardInterrupt:
        print(f"tpd: interrupted; {options.out} goes without some of its pictures", file=sys.stderr)
        return common.INTERRUPTED
    print("\n" + (options.out / "report.txt").read_text(encoding="utf-8"))
    print("\n".join(f"written: {path}" for path in written))
    return _exit_status(design, unfinished)


def claim(options: argparse.Namespace, unfinished: Path) -> None:
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


def _design(job: Job, unfinished: Path, bar: Bar) -> Any:
    from tpd.design.optimise import optimise

    return optimise(job.scene, **job.settings, checkpoint=unfinished, progress=bar)


def front_of(design: Design, bar: Bar) -> tuple[FrontPoint, ...]:
    """Answers with lighter bobs, if a pendulum is offered."""
    if design.pendulum is None or design.status.name != "found":
        return ()
    from tpd.design.front import front

    # An interruption here leaves the design whole; only the front is missing.
    with common.left_out("the front"):
        return front(design, progress=bar)
    return ()


def _exit_status(design: Design, unfinished: Path) -> int:
    if design.status.name == "interrupted":
        print(hint(unfinished))
        return common.INTERRUPTED
    unfinished.unlink(missing_ok=True)
    return common.SOUND if design.status.is_sound else common.UNSOUND


def hint(unfinished: Path) -> str:
    """Sentence that says how to go on."""
    return f"go on with the same command and --resume (finished searches are in {unfinished})"


@contextlib.contextmanager
def hinting(unfinished: Path) -> Iterator[None]:
    """Say after Ctrl-C how to go on: searches that have ended need not be repeated."""
    try:
        yield
    except KeyboardInterrupt:
        if unfinished.exists():
            print(hint(unfinished))
        raise
