"""`tpd assess`: the block without a pendulum."""

from __future__ import annotations

import argparse

from tpd.cli import common
from tpd.cli.terminal import SOUND, print_answer
from tpd.core.progress import Bar
from tpd.design.assess import assessed, problem_alone
from tpd.report.blocks import wrapped


def run(options: argparse.Namespace, case: common.Case) -> int:
    """Simulate the block, print whether it rocks, slides or overturns, and return the exit status."""
    job = case.job
    problem = problem_alone(job.scene, **job.settings)
    common.print_header(job.scene, None, job.in_words, job.all_messages, problem.at_rest)
    with Bar() as bar:
        assessment = assessed(problem, bar)
    # `print(assessment)` would repeat the accelerations of uplift and sliding, which the header has.
    sentences = *assessment.sentences, assessment.measures, assessment.guess
    print_answer("", *(line for text in sentences for line in wrapped(text)))
    return SOUND
