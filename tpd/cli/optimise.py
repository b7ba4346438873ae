"""`tpd optimise`: find the pendulum for a block, verify it and write the report."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path

from tpd.cli import common
from tpd.cli.interrupts import INTERRUPTED, SOUND, UNFINISHED, UNSOUND
from tpd.core import files
from tpd.core.progress import Bar, say
from tpd.design.many import front
from tpd.design.optimise import optimise
from tpd.design.problem import check_cavity
from tpd.design.result import Design
from tpd.design.study import Study, study
from tpd.report import answer
from tpd.report.files import write

_LEAST = 12
"""Lines of the answer, however many there are on the records."""


def run(options: argparse.Namespace) -> int:
    """Search, verify, write the report and print the answer; return the exit status."""
    # The job is checked as a whole before anything is written or compiled.
    job, _ = common.case(options)
    check_cavity(job.block, job.limits)
    # Records are read here: bad files end the command before anything is claimed.
    scene, settings, unfinished = job.scene, job.settings, options.out / UNFINISHED
    _claim(options, unfinished)
    # Lines on the records shorten the answer, so that both fit on a terminal.
    motion, told = common.motions(job)
    if not (options.quiet or options.json):
        common.say(scene, None, motion, told)
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
        return INTERRUPTED
    try:
        lines = max(_LEAST, answer.MOST - len(told))
        how = {"then": partial(_say, options, design, shown, lines), "warn": lambda why: say(f"tpd: {why}")}
        said = (*job.notes, *job.held_notes)
        write(options.out, design, shown, job.tables, job.toml, said, **how)
    except KeyboardInterrupt:
        print(f"tpd: interrupted; {options.out} goes without some of its files", file=sys.stderr)
        return INTERRUPTED
    if is_interrupted:
        return INTERRUPTED
    unfinished.unlink(missing_ok=True)
    return SOUND if design.status.is_sound else UNSOUND


def _say(options: argparse.Namespace, design: Design, shown: Study, lines: int) -> None:
    """Print the answer as the options ask for it, in so many lines at most."""
    for part in shown.left_out:
        print(f"tpd: interrupted; the report goes without {part}", file=sys.stderr)
    if options.json:
        print((options.out / "design.json").read_text(encoding="utf-8"), end="")
    elif options.verbose:
        print("\n" + (options.out / "report.txt").read_text(encoding="utf-8"), end="")
    elif options.quiet:
        print(f"{answer.verdict(design).text}\n{options.out}")
    else:
        print("\n" + answer.answer(design, shown, options.out, lines))


def _claim(options: argparse.Namespace, unfinished: Path) -> None:
    """Check, before any work, that results can be written, and that there is a search to resume."""
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
