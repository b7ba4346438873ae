"""Compiled loop over forcing periods of the nonlinear equations: when a motion repeats, rests or is lost.

The rules are those of `tpd.models.settling`. Shaking may begin at any phase and grow; see
`tpd.models.batches.settle_all`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from tpd.exact.contact_kernel import sign
from tpd.exact.plant import compiled, part, stored
from tpd.exact.repetition import (
    AT_REST,
    EVENT_BOUND,
    FAILED,
    FLOATS,
    LONGEST,
    NOT_SETTLED,
    OVERTURNED,
    ROCKING,
    STATUSES,
    WHOLES,
    growth_in,
    remember,
    repeats_after,
    scales_of,
    settled,
    stayed,
)
from tpd.models.compiling import checksum
from tpd.models.nonlinear_kernel import (
    ARRIVED,
    BROKEN,
    LOST,
    REST,
    REST_RATE,
    SIZES,
    SLIP,
    STICK,
    advance,
    decide,
    plant,
    sine_at,
)
from tpd.models.nonlinear_series import ORDERS, ROWS

__all__ = ["FLOATS", "STATUSES", "WHOLES", "settle_rows"]

TOLERANCE = 1e-6
"""Repetition error that counts as settled, in units of `scales_of`."""
STILL = 1e-3
"""Share of its scale by which the bob's swing may change in a period under a block called at rest."""
_TABLE, _COLUMN = numba.float64[:, ::1], numba.float64[::1]
_INPUT = (_TABLE, _TABLE, _COLUMN, _COLUMN, numba.int64, numba.int64)
_LIMITS = (numba.int64, numba.float64, numba.int64)
_SIGNATURE = numba.int64(*_INPUT, *_LIMITS, _TABLE, numba.int64[:, ::1])
# With its types given, the code is compiled once, when the module is loaded, and never by surprise again.


@compiled
def _stays(q, y, before, mode, sizes):
    """Whether the block has rested, or been held leaning, for a whole period in which the bob's swing hardly
    changed."""
    rests = mode[0] == REST and max(sizes[0], sizes[1]) == 0.0
    leans = mode[0] == STICK and y[0] == before[0]
    angles = max(abs(y[0] - before[0]), abs(y[1] - before[1]))
    rates = max(abs(y[2] - before[2]), abs(y[3] - before[3]))
    change = max(angles, rates / q.xi) / (q.nu + q.f)
    return (rests or leans) and (change < STILL or q.mu == 0.0)


@compiled
def _one_period(q, growth, grown, mode, clock, y, c, sizes, scales, rtol, max_events):
    """Follow the motion to the end of the forcing period: how it ended, see `nonlinear_kernel.advance`."""
    sizes[0], sizes[1], sizes[2] = max(y[0], 0.0), max(-y[0], 0.0), abs(y[1])
    mode[3] = 2.0 if mode[0] != SLIP else 0.0
    if clock[0] < grown < q.period:
        # The forcing has a kink where its growth ends, which a step must not cross.
        ended = advance(q, growth, mode, clock, y, c, sizes, scales, grown, rtol, max_events)
        if ended != ARRIVED:
            return ended
    return advance(q, growth, mode, clock, y, c, sizes, scales, q.period, rtol, max_events)


@compiled
def _classified(q, growth, y, t):
    """Mode of a state, with a place for whether the block was held."""
    mode = np.zeros(4)
    decide(q, y[0], y[1], y[3], sign(y[0]), sign(y[2]), sine_at(q, growth, t), mode)
    return mode


@part
def _settle(x, y0, begin, ramp, periods, rtol, max_events, out):
    """Follow one motion until it repeats, rests, is lost, or `periods` have elapsed: status, its periods and
    the periods elapsed."""
    q = plant(x, x[6], 2.0 * math.pi / x[6], REST_RATE)
    y, series, past, scales = np.zeros(4), np.zeros((ROWS, ORDERS)), np.zeros((LONGEST, 4)), scales_of(q)
    last = np.zeros((LONGEST, 3))
    growth, sizes, peaks, clock = np.zeros(4), np.zeros(SIZES), np.zeros(2), np.zeros(1)
    clock[0] = begin
    for i in range(4):
        y[i] = past[0, i] = y0[i]
    growth_in(growth, ramp, q.period, 0.0)
    mode = _classified(q, growth, y0, begin)
    # A start within a period has another phase than the ends of periods, with which these are compared.
    known, status, repeats, elapsed = (1 if begin == 0.0 else 0), NOT_SETTLED, 0, 0
    while elapsed < periods and status == NOT_SETTLED:
        grown = growth_in(growth, ramp, q.period, float(elapsed))
        ended = _one_period(q, growth, grown, mode, clock, y, series, sizes, scales, rtol, max_events)
        elapsed += 1
        peaks[0], peaks[1] = max(peaks[0], max(sizes[0], sizes[1])), max(peaks[1], sizes[2])
        # Nothing that was met before the shaking became steady counts as a repetition, or as rest.
        steady = grown == 0.0 and ended == ARRIVED
        repeats = repeats_after(q, y, past, known, scales, TOLERANCE) if steady else 0
        rests = steady and known > 0 and _stays(q, y, past[0], mode, sizes)
        peak = max(sizes[0], sizes[1])
        known = remember(past, known if steady else 0, last, y, peak, sizes[2], mode[3])
        clock[0] = 0.0
        if ended == BROKEN or not math.isfinite(y[0] + y[1] + y[2] + y[3]):
            status = FAILED
        elif ended == LOST:
            status = OVERTURNED
        elif ended != ARRIVED:
            status = EVENT_BOUND
        elif rests:
            status = AT_REST
        elif repeats > 0:
            # The bob of a block that never moved may repeat itself after several periods only.
            status = AT_REST if stayed(last, repeats) else ROCKING
    status, own = settled(status, repeats, y, last, peaks, out)
    out[8], out[9], out[10] = mode[0], mode[1], mode[2]
    return status, own, elapsed


def _entry(version: int) -> Callable[..., Any]:
    """Compiled `settle_rows`, stored on disk for later processes where a folder can be written to."""

    def settle_rows(xs, y0s, begins, ramps, first, last, periods, rtol, max_events, out, wholes):
        """Follow the motions from `first` to before `last`, and return the version of the code."""
        for n in range(first, last):
            found = _settle(xs[n], y0s[n], begins[n], ramps[n], periods, rtol, max_events, out[n])
            wholes[n, 0], wholes[n, 1], wholes[n, 2] = found
        return version

    return stored(settle_rows, numba.njit, _SIGNATURE, nogil=True)


# Numba's store looks at the file of the function alone, and would go on with machine code of another version
# of the kernel. A number from outside the function is part of its key.
settle_rows = _entry(checksum("nonlinear_"))
