"""`tpd optimise` over many conditions."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from tpd.cli import common

if TYPE_CHECKING:
    from tpd.analysis.compare_models import Check
    from tpd.design.job import Job
    from tpd.design.many_result import DesignOver
    from tpd.design.pareto import Front

_UNFINISHED = "unfinished.npz"
"""Searches that have ended, while others have not."""


def run_over(options: argparse.Namespace, work: Job) -> int:
    """Search, judge, write the report, and say what it is worth."""
    from tpd.core import files
    from tpd.design.job import dump, tables
    from tpd.design.many import optimise_over
    from tpd.report import many as report
    from tpd.report.many_page import Shown, over_page

    asked, search, out = work.asked, work.search, options.out
    assert asked is not None
    assert search.method is not None
    conditions = asked.conditions(work.scene, search.seed)
    unfinished = out / _UNFINISHED
    if options.resume and not unfinished.exists():
        raise ValueError(f"there is nothing to resume: {unfinished} does not exist")
    files.claim(out, overwrite=options.overwrite or options.resume)
    if not options.resume:
        unfinished.unlink(missing_ok=True)
    hint = f"go on with the same command and --resume (finished searches are in {unfinished})"
    with common.Bar() as bar, _hinting(unfinished, hint):
        design = optimise_over(
            work.scene,
            conditions,
            work.space,
            measure=asked.measure,
            limits=asked.limits,
            from_rest=asked.wanted.from_rest,
            reached=asked.reached(search.seed),
            by_share=asked.wanted.by_share,
            by_overturning=asked.wanted.by_overturning,
            ensemble=work.ensemble,
            starts=search.starts,
            steps=search.steps,
            screening=search.screening,
            method=search.method,
            seed=search.seed,
            checkpoint=unfinished,
            progress=bar,
        )
        front = _front(options, work, design, bar)
        ladder = _ladder(design, bar)
    print(report.text(design, front))
    if ladder is not None:
        print(ladder.table() + "\n")
    pictures = dict(report.pictures(design, front))
    contents = {
        "report.txt": report.text(design, front),
        "design.json": report.as_json(design, tables(work), front),
        "scene.toml": dump(work),
        **pictures,
    }
    if design.status.name != "interrupted":
        contents["report.html"] = over_page(Shown(design, work, front, pictures, ladder, out))
    print("\n".join(f"written: {files.place(out / name, content)}" for name, content in contents.items()))
    if design.status.name == "interrupted":
        print(hint if unfinished.exists() else "no group of searches had ended: begin again with --overwrite")
        return common.INTERRUPTED
    unfinished.unlink(missing_ok=True)
    return common.SOUND if report.is_sound(design) else common.UNSOUND


def _ladder(design: DesignOver, bar: common.Bar) -> Check | None:
    """The design by the models that do not take long to compile, under the scene's own shaking."""
    if design.pendulum is None or design.status.name == "interrupted":
        return None
    from tpd.analysis.compare_models import QUICK, check

    with common.left_out("what the models say"):
        return check(design.scene, design.pendulum, stroke=design.space.stroke, rungs=QUICK, progress=bar)
    return None


def _front(options: argparse.Namespace, work: Job, design: DesignOver, bar: common.Bar) -> Front | None:
    """The front of mass against rocking, if asked for and there is something to be had."""
    if not options.pareto or design.pendulum is None or design.status.name == "interrupted":
        return None
    from tpd.design.pareto import pareto

    with common.left_out("the front"):
        return pareto(
            work.scene,
            design.conditions,
            design.space,
            measure=design.measure,
            limits=design.limits,
            seed=work.search.seed,
            progress=bar,
        )
    return None


@contextlib.contextmanager
def _hinting(unfinished: Path, hint: str) -> Iterator[None]:
    """Ctrl-C while designs are judged: the searches have ended, and need not be done again."""
    try:
        yield
    except KeyboardInterrupt:
        if unfinished.exists():
            print(hint)
        raise
