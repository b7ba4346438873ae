"""Section of a report about recorded ground motions."""

from __future__ import annotations

import math

import numpy as np

from tpd.core.formatting import number
from tpd.core.scene import STANDARD_GRAVITY
from tpd.design.earthquakes import Earthquakes
from tpd.report.blocks import Block, Cell, Note, Table, danger, information

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
    more = ("with the pendulum: tilt/ν", "rod against block (rad)") if hung else ()
    rows = [_row(found, int(i)) for i in _order(found)[:_ROWS]]
    note = information(
        f"Of {len(found.names)} records at their own size, {counts}. Linear equations, exact between the "
        f"samples; {_changed(found)}. The design was not sought for them."
    )
    return [note, Table((*head, *more), tuple(rows))]


def notes(found: Earthquakes | None) -> list[Note]:
    """Dangers that belong before anything else."""
    if found is None or found.hung is None:
        return []
    worse = np.isinf(found.hung) & ~np.isinf(found.bare)
    if not worse.any():
        return []
    names = ", ".join(name for name, bad in zip(found.names, worse, strict=True) if bad)
    return [
        danger(
            f"With the pendulum {worse.sum()} of the records overturn a block that stands without: {names}."
        )
    ]


def _order(found: Earthquakes) -> np.ndarray:
    """Indices of the records, the largest tilts first."""
    # An overturning is the largest tilt of all; what is not known comes last.
    tilts = found.bare if found.hung is None else np.fmax(found.bare, found.hung)
    return np.argsort(-np.nan_to_num(tilts, nan=-1.0), kind="stable")


def _row(found: Earthquakes, i: int) -> tuple[Cell, ...]:
    row: tuple[Cell, ...] = (found.names[i], number(found.pga[i] / STANDARD_GRAVITY), _tilt(found.bare[i]))
    if found.hung is None or found.relative is None:
        return row
    angle = found.relative[i]
    return *row, _tilt(found.hung[i]), number(float(angle)) if math.isfinite(angle) else "-"


def _tilt(value: float) -> str:
    if math.isnan(value):
        return "unknown (too many events)"
    return "overturns" if math.isinf(value) else number(float(value))


def _changed(found: Earthquakes) -> str:
    """Sentence on how many verdicts the nonlinear equations change."""
    tilts = [found.bare] if found.hung is None else [found.bare, found.hung]
    fallen = [x for x in found.nonlinear if x is not None]
    changed = sum(int(np.sum(np.isinf(t) != f)) for t, f in zip(tilts, fallen, strict=True))
    return f"the nonlinear equations change {changed} of {sum(map(len, fallen))} verdicts"
