"""`tpd optimise`: find the pendulum for a block, verify it and write the report."""

from __future__ import annotations

import argparse
from functools import partial

from tpd.cli import common
from tpd.cli.interrupts import SOUND, UNSOUND
from tpd.core import files
from tpd.core.progress import Bar, say
from tpd.design.as_built import Details, details
from tpd.design.design import Design
from tpd.design.optimise import front, problem_of, solve
from tpd.report import answer
from tpd.report.files import write

_LEAST = 12
"""Lines of the answer, however many there are on the records."""


def run(options: argparse.Namespace, inputs: common.Case) -> int:
    """Search, verify, write the report and print the answer; return the exit status."""
    job, told = inputs.job, inputs.job.all_messages
    problem = problem_of(job.scene, **job.settings)
    # The date of the report comes after the search; a bad setting of it must not.
    files.today()
    # Lines on the records shorten the answer, so that both fit on a terminal.
    if not (options.quiet or options.json):
        common.say(job.scene, None, job.in_words, told, problem.at_rest)
    with Bar() as bar:
        design, points = solve(problem, bar), ()
        if (
            job.full["search"]["pareto"]
            and design.pendulum is not None
            and design.status.name == "recommended"
        ):
            points = front(design, progress=bar)
        shown = details(design, front=points, progress=bar)
    lines = max(_LEAST, answer.MOST - len(told))
    how = {"then": partial(_say, options, design, shown, lines), "warn": lambda why: say(f"tpd: {why}")}
    write(options.out, design, shown, job.tables, job.toml, (*job.notes, *job.validation_notes), **how)
    return SOUND if design.status.is_sound else UNSOUND


def _say(options: argparse.Namespace, design: Design, shown: Details, lines: int) -> None:
    """Print the answer as the options ask for it, in so many lines at most."""
    if options.json:
        print((options.out / "design.json").read_text(encoding="utf-8"), end="")
    elif options.verbose:
        print("\n" + (options.out / "report.txt").read_text(encoding="utf-8"), end="")
    elif options.quiet:
        print(f"{answer.verdict(design, shown).text}\n{options.out}")
    else:
        print("\n" + answer.answer(design, shown, options.out, lines))
