"""Section of a report about recorded ground motions."""

from __future__ import annotations

import math

import numpy as np

from tpd.core.formatting import number
from tpd.core.scene import STANDARD_GRAVITY
from tpd.design.earthquakes import Earthquakes
from tpd.report.blocks import Block, Cell, Note, Table, danger, information, warning

_ROWS = 40
"""Most records in the table: those with the largest tilts."""


def section(found: Earthquakes | None) -> list[Block]:
    """Blocks of the section; empty where no records were asked for."""
    if found is None:
        return []
    hung = found.hung is not None
    bare_falls, hung_falls = found.overturned
    counts = f"{bare_falls} overturn the bare block" + (f", {hung_falls} with the pendulum" if hung else "")
    head = ("record", "largest acceleration (g)", "bare: tilt/ν")
    angle = "rod against block (rad), nonlinear equations (linear)"
    more = ("with the pendulum: tilt/ν", angle) if hung else ()
    rows = [_row(found, int(i)) for i in _order(found)[:_ROWS]]
    note = information(
        f"Of {len(found.names)} records at their own size, {counts}. Linear equations, exact between the "
        f"samples; {_changed(found)}.{_undecided(found)} The design was not sought for them."
    )
    return [note, Table((*head, *more), tuple(rows))]


def notes(found: Earthquakes | None) -> list[Note]:
    """Notes that belong before anything else: a pendulum that overturns, and what is not known of it."""
    if found is None or found.hung is None:
        return []
    out = []
    # Of a run without an answer nobody knows that the block stands.
    worse = np.isinf(found.hung) & np.isfinite(found.bare)
    if worse.any():
        which = f"overturn a block that stands without: {_listed(found, worse)}"
        out.append(danger(f"With the pendulum {worse.sum()} of the records {which}."))
    open_runs = np.isnan(found.hung)
    if open_runs.any():
        which = f"overturn the block with the pendulum: {_listed(found, open_runs)}"
        out.append(warning(f"It is not known whether {open_runs.sum()} of the records {which}."))
    return out


def _listed(found: Earthquakes, rows: np.ndarray) -> str:
    """Names of some of the records."""
    return ", ".join(name for name, row in zip(found.names, rows, strict=True) if row)


def _order(found: Earthquakes) -> np.ndarray:
    """Indices of the records, the largest tilts first."""
    # An overturning is the largest tilt of all; what is not known comes last.
    tilts = found.bare if found.hung is None else np.fmax(found.bare, found.hung)
    return np.argsort(-np.nan_to_num(tilts, nan=-1.0), kind="stable")


def _row(found: Earthquakes, i: int) -> tuple[Cell, ...]:
    row: tuple[Cell, ...] = (found.names[i], number(found.pga[i] / STANDARD_GRAVITY), _tilt(found.bare[i]))
    if found.hung is None or found.relative is None:
        return row
    # What sizes a room is of the nonlinear equations, with the linear ones beside it.
    angles = found.relative[i], np.nan if found.linear_relative is None else found.linear_relative[i]
    nonlinear, linear = (number(float(x)) if math.isfinite(x) else "-" for x in angles)
    return *row, _tilt(found.hung[i]), f"{nonlinear} ({linear})"


def _tilt(value: float) -> str:
    if math.isnan(value):
        return "unknown (too many events)"
    return "overturns" if math.isinf(value) else number(float(value))


def _changed(found: Earthquakes) -> str:
    """Sentence on how many verdicts the nonlinear equations change."""
    tilts = [found.bare] if found.hung is None else [found.bare, found.hung]
    fallen = [x for x in found.nonlinear if x is not None]
    unknown = [x for x in found.unknown if x is not None]
    # A verdict is changed where both sets of equations have one.
    known = [~(np.isnan(t) | u) for t, u in zip(tilts, unknown, strict=True)]
    pairs = zip(tilts, fallen, known, strict=True)
    changed = sum(int(np.sum((np.isinf(t) != f)[k])) for t, f, k in pairs)
    return f"the nonlinear equations change {changed} of {sum(int(k.sum()) for k in known)} verdicts"


def _undecided(found: Earthquakes) -> str:
    """Sentence on the runs without an answer; empty if there are none."""
    linear, nonlinear = found.undecided
    if not linear + nonlinear:
        return ""
    return (
        f" Without an answer, and in no count: {linear} runs of the linear equations and {nonlinear} of the "
        "nonlinear ones, bare and hung."
    )
