"""`tpd assess`: the block alone, without any pendulum."""

from __future__ import annotations

import argparse

from tpd.cli import common
from tpd.cli.interrupts import SOUND
from tpd.core.progress import Bar
from tpd.design.assess import assessed, problem_alone
from tpd.report.blocks import wrapped


def run(options: argparse.Namespace, inputs: common.Case) -> int:
    """Follow the block and print whether it rocks, slides or overturns; return the exit status."""
    job = inputs.job
    problem = problem_alone(job.scene, **job.settings)
    common.say(job.scene, None, job.in_words, job.all_messages, problem.at_rest)
    with Bar() as bar:
        found = assessed(problem, bar)
    # The lines on the resting block stand above.
    said = str(found).removeprefix(f"{found.at_rest}\n").splitlines()
    print("\n".join(["", *(line for sentence in said for line in wrapped(sentence))]))
    return SOUND
