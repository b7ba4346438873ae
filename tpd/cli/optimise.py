"""`tpd optimise`: find the pendulum for a block, validate it and write the report."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from importlib import import_module
from threading import Thread

from tpd.cli import common
from tpd.cli.terminal import SOUND, UNSOUND, print_answer
from tpd.core import files, progress
from tpd.design.as_built import details
from tpd.design.optimise import problem_of, solve_problem
from tpd.report.blocks import MOST, Report, Table
from tpd.report.content import CONDITIONS
from tpd.report.files import write
from tpd.report.render import in_rows, text


def run(options: argparse.Namespace, case: common.Case) -> int:
    """Search, validate, write the report, print the answer and return the exit status."""
    job, messages = case.job, case.job.all_messages
    problem = problem_of(job)
    # The report needs the date. An invalid `SOURCE_DATE_EPOCH` must be rejected before the search, and not
    # minutes later.
    files.today()
    if not (options.quiet or options.json):
        common.print_header(job.scene, None, job.in_words, messages, problem.at_rest, sys.stderr)
    # Matplotlib loads slowly. It loads beside the runs, which are compiled code without Python's lock.
    Thread(target=import_module, args=("tpd.plots.results",), daemon=True).start()
    with progress.bar_for(not options.quiet) as bar:
        design = solve_problem(problem, bar)
        # Details are results that only the report needs, such as responses and tolerances.
        shown = details(design, progress=bar)
    lines = sys.maxsize if options.verbose else MOST
    # The answer is printed as soon as the numbers are written. The pictures are drawn after that.
    how = {"then": partial(_show, options), "warn": lambda message: progress.say(f"tpd: {message}")}
    how |= {"overwrite": options.overwrite, "lines": lines}
    write(options.out, design, shown, **how)
    return SOUND if design.status.is_sound else UNSOUND


def _show(options: argparse.Namespace, report: Report) -> None:
    """Print the answer in the form that the options choose: by default the text of the report."""
    if options.json:
        print_answer((options.out / files.REPORT).read_text(encoding="utf-8").rstrip("\n"))
    elif options.quiet:
        print_answer(report.summary.verdict.marked, str(options.out))
    else:
        print_answer(text(report).rstrip("\n"))
        if options.verbose:
            (conditions,) = (section.blocks for section in report.sections if section.title == CONDITIONS)
            print_answer("", *(in_rows(block) for block in conditions if isinstance(block, Table)))
