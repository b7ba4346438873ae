"""`tpd shake`: a block under one pulse or record, without and with a pendulum."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from tpd.answers.motion_history import STRONG, MotionHistory, motion_history
from tpd.answers.run_table import cases_of
from tpd.answers.transient import Transient, transient
from tpd.cli import common, outputs
from tpd.cli.common import CASES
from tpd.cli.terminal import SOUND, UNSOUND, print_answer
from tpd.core import files
from tpd.core.formatting import number
from tpd.models.piecewise import Nonlinear
from tpd.report.blocks import wrapped
from tpd.scene.status import STANDING, UNANSWERED, Status, is_one_of, status_name
from tpd.theory.no_uplift import AtRest, sliding_in_runs

_QUANTITIES = {
    "tilt": "largest tilt of the block, rad",
    "tilt_time": "  at time, s",
    "swing": "largest swing of the rod, rad",
    "swing_time": "  at time, s",
    "rod_angle": "largest angle between rod and block, rad",
    "rod_angle_time": "  at time, s",
    "uplift_time": "time of the first uplift, s",
    "overturning_time": "time of overturning, s",
}
"""Attributes of a motion that are printed, with their labels in the table."""
_TIMES = "tilt_time", "swing_time", "rod_angle_time", "uplift_time", "overturning_time"
_OF_A_PENDULUM = ("swing", "swing_time", "rod_angle", "rod_angle_time")


def run(options: argparse.Namespace, case: common.Case) -> int:
    """Simulate the block, print the results, write histories and pictures, and return the exit status."""
    job, pendulum = case
    scene = job.under(job.shaking)
    common.print_header(scene, pendulum, notes=job.messages, at_rest=AtRest.under(scene))
    cases = dict(zip(CASES, cases_of(pendulum), strict=False))
    free = options.free
    # The nonlinear motion of each pair decides, because the linear model is meant for small angles.
    motions = {
        name: (transient(scene, h, model=Nonlinear(), free=free), transient(scene, h, free=free))
        for name, h in cases.items()
    }
    histories = {name: motion_history(scene, h, free=free) for name, h in cases.items()}
    # A block that comes to rest makes very many weak impacts. Only those above this rate (rad/s) are counted.
    strong = STRONG * float(scene.block.slenderness) * float(scene.rate)
    tables = (_table(name, pair, histories[name], strong) for name, pair in motions.items())
    needed = {name: history.needed_friction for name, history in histories.items()}
    tilts = (float(motions[x][0].tilt) if x in motions else math.nan for x in CASES)
    sentences = sliding_in_runs(needed, scene.block.base_friction).sentence, difference(*tilts)
    closing = (line for text in sentences for line in wrapped(text))
    print_answer(*(line for table in tables for line in ("", *table)), "", *closing)
    results: dict[str, Any] = {}
    for name, (nonlinear, linear) in motions.items():
        counts = {
            "impacts": histories[name].impacts_above(strong),
            "impacts_faster_than_rad_s": strong,
            "needed_friction": needed[name],
        }
        results[name] = {**_numbers(nonlinear), "equations": "nonlinear", "linear": _numbers(linear) | counts}
    content = files.as_json({**common.json_inputs(scene, pendulum, job), "results": results})
    numbers = ("shake.json", content), *_tables(histories)

    def draw() -> Any:
        from tpd.plots.response import plot_motions

        axes = plot_motions(list(histories.values()), float(scene.block.slenderness))
        # The title says why the picture differs from the nonlinear results in the table.
        axes[0].set_title("linear model, exact between the samples", fontsize=9)
        return axes

    outputs.write(options.out, numbers, {"histories.png": draw}, overwrite=options.overwrite)
    # The last case is the one with the pendulum, if there is one. Its outcome decides the exit status.
    last = list(motions.values())[-1][0].status
    return SOUND if is_one_of(last, *STANDING) else UNSOUND


def _table(name: str, pair: tuple[Transient, ...], history: MotionHistory, strong: float) -> Iterator[str]:
    """Yield the lines of the table with the results of both sets of equations.

    Args:
        name: name of the case.
        pair: motion by the nonlinear and by the linear model.
        history: history by the linear model.
        strong: rate (rad/s) above which impacts are counted.
    """
    statuses = [status_name(x.status) for x in pair]
    yield f"{name + ':':42}{'nonlinear model':>20}{'linear model':>20}"
    yield f"  {'outcome':40}{statuses[0]:>20}{statuses[1]:>20}"
    for key, label in _QUANTITIES.items():
        values = [float(getattr(x, key)) for x in pair]
        # The time of an event that does not occur is infinite by both equations; its line is left out.
        is_absent = key in _TIMES and not any(map(math.isfinite, values))
        if is_absent or (key in _OF_A_PENDULUM and history.swing is None):
            continue
        cells = (number(x) if math.isfinite(x) else "-" for x in values)
        yield f"  {label:40}" + "".join(f"{cell:>20}" for cell in cells)
    # Impacts and forces are known for the linear model only: their column is the last one.
    impacts = history.impacts_above(strong)
    yield f"  {f'impacts faster than {number(strong)} rad/s':40}{'':20}{impacts:>20}"
    yield f"  {'friction coefficient to prevent sliding':40}{'':20}{number(history.needed_friction):>20}"
    for which, motion in zip(("nonlinear", "linear"), pair, strict=True):
        if is_one_of(motion.status, *UNANSWERED):
            yield f"  The {which} model has no result: {Status[motion.status]}"
    if pair[0].status != pair[1].status and any(x.status == Status.overturned for x in pair):
        yield "  The two models differ on overturning. The nonlinear model decides."


def difference(without: float, pendulum: float) -> str:
    """Return a sentence that compares the largest tilts without and with the pendulum; empty if one is NaN.

    A tilt is infinite if the block overturns, and zero if it does not lift.
    """
    if math.isnan(without + pendulum):
        return ""
    does = "overturns" if math.inf in (without, pendulum) else "lifts"
    if without == pendulum and without in (0.0, math.inf):
        return f"The block {'overturns in both cases' if without else 'does not lift in either case'}."
    if without in (0.0, math.inf) or pendulum == math.inf:
        return f"The block {does} only {'without' if without > pendulum else 'with'} the pendulum."
    change = 100.0 * (pendulum / without - 1.0)
    size = f"{number(abs(change), 2)} % {'larger' if change > 0.0 else 'smaller'}"
    return f"With the pendulum the largest tilt is {size} (nonlinear model)."


def _tables(histories: dict[str, MotionHistory]) -> Iterator[tuple[str, str]]:
    """Yield the tables of histories and impacts by the linear model: names and contents of the files."""
    header = ("case", "time_s", "base_m_s2", "tilt_rad", "swing_rad", "horizontal_N", "vertical_N")
    rows = list[tuple[Any, ...]]()
    for name, h in histories.items():
        # Without a pendulum the angle of the bob has no meaning.
        swing = np.zeros_like(h.tilt) if h.swing is None else h.swing
        columns = h.times, h.base, h.tilt, swing, h.horizontal, h.vertical
        rows += [(name, *row) for row in zip(*columns, strict=True)]
    yield "histories.csv", files.as_csv(header, rows)
    hits = ((name, *hit) for name, h in histories.items() for hit in h.impacts)
    yield "impacts.csv", files.as_csv(("case", "time_s", "rate_after_rad_s"), hits)


def _numbers(motion: Transient) -> dict[str, Any]:
    """Return the numbers of one motion for the JSON file."""
    return {key: float(getattr(motion, key)) for key in _QUANTITIES} | {"status": status_name(motion.status)}
