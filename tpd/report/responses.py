"""Responses over frequency and motions over time as CSV; tilts at which the block topples, for pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tpd.answers.response import Response
from tpd.core import files
from tpd.design.study import TimeHistory
from tpd.scene.quantities import UNITS


def response_csv(responses: Sequence[Response]) -> str:
    """CSV with a row for every frequency: status and amplitude without, and with, the pendulum.

    Args:
        responses: of the bare block and, if there is one, with the pendulum, over the same values. An
            amplitude is infinite where the block overturns.
    """
    first = responses[0]
    name = f"{first.name}_{UNITS[first.name]}" if first.name in UNITS else first.name
    header, columns = [name], [first.frequency]
    for label, r in zip(("without", "with"), responses, strict=False):
        header += [f"{label}_status", f"{label}_amplitude_rad"]
        columns += [r.status, r.amplitude]
    if len(responses) > 1:
        # The bare block's stroke is that of a bob too light to be felt, and means nothing.
        header.append("with_stroke_rad")
        columns.append(responses[1].stroke)
    return files.as_csv(header, zip(*(column.tolist() for column in columns), strict=True))


def motion_csv(histories: Sequence[TimeHistory]) -> str:
    """CSV with a row for every time: tilt without the pendulum and, if there is one, tilt and bob angle with
    it, by the exact solution. Cells are empty after the block has overturned.

    Args:
        histories: over the same times.
    """
    header, columns = ["time_s"], [histories[0].time]
    for h in histories:
        label = "with" if h.with_pendulum else "without"
        header.append(f"{label}_tilt_rad")
        columns.append(h.tilt)
        # Without a pendulum the bob is one too light to be felt, and means nothing.
        if h.with_pendulum:
            header.append("with_bob_rad")
            columns.append(h.bob)
    # An empty cell is read as missing by every program; a word such as "nan" is not.
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return files.as_csv(header, ([x if math.isfinite(x) else "" for x in row] for row in rows))
