"""`tpd shake`: one block under a pulse or a record, with and without a pendulum."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from tpd.answers.motion_history import STRONG, MotionHistory, motion_history
from tpd.answers.transient import Transient, transient
from tpd.cli import common, outputs
from tpd.cli.interrupts import SOUND, UNSOUND
from tpd.core import files
from tpd.core.formatting import number
from tpd.design.as_built import TimeHistory
from tpd.models.compiled import Nonlinear
from tpd.scene.status import STANDING, UNANSWERED, Status, is_one_of, status_name
from tpd.theory.no_uplift import AtRest

_SIZES = {
    "tilt": "largest tilt, rad",
    "tilt_time": "  at, s",
    "swing": "largest swing of the rod, rad",
    "swing_time": "  at, s",
    "relative": "largest angle between rod and block, rad",
    "relative_time": "  at, s",
    "uplift_time": "lifts at, s",
    "overturning_time": "overturns at, s",
}
"""Numbers of a motion, and what they are called in the table."""
_OF_A_PENDULUM = ("swing", "swing_time", "relative", "relative_time")


def run(options: argparse.Namespace, inputs: common.Case) -> int:
    """Follow the block, write histories and pictures, and print what happened; return the exit status."""
    job, pendulum = inputs
    scene = job.under(job.shaking)
    common.say(scene, pendulum, notes=job.messages, alone=AtRest.under(scene))
    cases = common.cases(pendulum)
    free = options.free
    # The first of a pair decides: the linear equations are meant for small angles.
    found = {
        name: (transient(scene, h, model=Nonlinear(), free=free), transient(scene, h, free=free))
        for name, h in cases.items()
    }
    histories = {name: motion_history(scene, h, free=free) for name, h in cases.items()}
    # Rate in rad/s above which an impact is counted.
    strong = STRONG * float(scene.block.slenderness) * float(scene.rate)
    for name, pair in found.items():
        print("\n".join(_table(name, pair, histories[name], strong)))
    results: dict[str, Any] = {}
    for name, (counts, linear) in found.items():
        more = {
            "impacts": histories[name].impacts_above(strong),
            "impacts_faster_than_rad_s": strong,
            "needed_friction": histories[name].needed_friction,
        }
        results[name] = {**_numbers(counts), "equations": "nonlinear", "linear": _numbers(linear) | more}
    content = files.as_json({**common.inputs(scene, pendulum, job), "results": results})
    # The film is about the largest tilt, or about the fall, of the bare block by the linear equations.
    first = found[common.WITHOUT][-1]
    middle = min(float(first.tilt_time), float(first.overturning_time))
    films = _films(histories)
    tables = ("shake.json", content), *_tables(histories, films)

    def draw() -> Any:
        from tpd.plots.response import plot_motions

        axes = plot_motions(list(histories.values()), float(scene.block.slenderness))
        axes[0].set_title("linear equations, exact between the samples", fontsize=9)
        return axes

    def film() -> bytes:
        from tpd.plots.animation import animate

        # Six seconds before it and four after it.
        return animate(scene, pendulum, list(films.values()), start=max(0.0, middle - 6.0))

    outputs.write(options.out, tables, {"histories.png": draw, "animation.gif": film})
    # With a pendulum it is the pendulum's outcome that counts.
    last = list(found.values())[-1][0].status
    return SOUND if is_one_of(last, *STANDING) else UNSOUND


def _table(name: str, pair: tuple[Transient, ...], history: MotionHistory, strong: float) -> Iterator[str]:
    """Lines of what happened by both sets of equations."""
    statuses = [status_name(x.status) for x in pair]
    yield f"{name + ':':42}{'nonlinear equations':>20}{'linear equations':>20}"
    yield f"  {'outcome':40}{statuses[0]:>20}{statuses[1]:>20}"
    for key, label in _SIZES.items():
        values = [float(getattr(x, key)) for x in pair]
        # A time that never comes is no line of its own.
        absent = key.endswith("_time") and not any(map(math.isfinite, values))
        if absent or (key in _OF_A_PENDULUM and history.swing is None):
            continue
        cells = (number(x) if math.isfinite(x) else "-" for x in values)
        yield f"  {label:40}" + "".join(f"{cell:>20}" for cell in cells)
    counted = history.impacts_above(strong)
    yield f"  {f'impacts faster than {number(strong)} rad/s':40}{'':20}{counted:>20}"
    yield f"  {'friction that keeps the base from sliding':40}{'':19}{number(history.needed_friction):>20}"
    for which, answer in zip(("nonlinear", "linear"), pair, strict=True):
        if is_one_of(answer.status, *UNANSWERED):
            yield f"  There is no answer by the {which} equations: {Status[answer.status]}"
    if pair[0].status != pair[1].status and any(x.status == Status.overturned for x in pair):
        yield "  The two sets of equations differ on overturning: the nonlinear ones count."


def _films(histories: dict[str, MotionHistory]) -> dict[str, TimeHistory]:
    """Motions of the film by the names of their cases."""
    return {
        name: TimeHistory(
            with_pendulum=h.swing is not None,
            time=h.times,
            tilt=h.tilt,
            bob=np.zeros_like(h.tilt) if h.swing is None else h.swing,
            overturned=h.overturned,
        )
        for name, h in histories.items()
    }


def _tables(histories: dict[str, MotionHistory], films: dict[str, TimeHistory]) -> Iterator[tuple[str, str]]:
    """Histories and impacts by the linear equations."""
    header = ("case", "time_s", "base_m_s2", "tilt_rad", "swing_rad", "horizontal_N", "vertical_N")
    rows = (
        (name, *row)
        for name, h in histories.items()
        for row in zip(h.times, h.base, h.tilt, films[name].bob, h.horizontal, h.vertical, strict=True)
    )
    yield "histories.csv", files.as_csv(header, rows)
    hits = ((name, *hit) for name, h in histories.items() for hit in h.impacts)
    yield "impacts.csv", files.as_csv(("case", "time_s", "rate_after_rad_s"), hits)


def _numbers(answer: Transient) -> dict[str, Any]:
    """Numbers of one motion, for JSON."""
    return {key: float(getattr(answer, key)) for key in _SIZES} | {"status": status_name(answer.status)}
