"""Compiled loop over the pieces of a ground motion, for the nonlinear equations."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from tpd.exact.contact_kernel import sign
from tpd.exact.follow import EVENT_BOUND, FAILED, OVERTURNED, ROCKED, STOOD
from tpd.exact.plant import compiled, stored
from tpd.models.compiling import checksum
from tpd.models.nonlinear_kernel import (
    ARRIVED,
    BROKEN,
    EVENTS,
    IMPACTS,
    LIFTED,
    LOST,
    ORIGIN,
    RELATIVE,
    REST,
    SLIP,
    TALLY,
    TIMES,
    advance,
    decide,
    plant,
)
from tpd.models.nonlinear_series import ORDERS, ROWS

COLUMNS = 14
"""Numbers of a result: largest |phi|, |psi| and |psi - phi|, their times, the state at the end, status,
impacts, and the times of the first uplift and from which the block is beyond return."""
_TABLE, _COLUMN, _WHOLE = numba.float64[:, ::1], numba.float64[::1], numba.int64[::1]
_ROWS = (_TABLE, _TABLE, _TABLE, _WHOLE, _WHOLE, _COLUMN)
_LIMITS = (numba.float64, numba.float64, numba.int64)
_SIGNATURE = numba.int64(*_ROWS, numba.int64, numba.int64, *_LIMITS, _TABLE)


@compiled
def _put_forcing(c, n, i, h, growth):
    """Put the coefficients of a piece into `growth`: after the last nothing shakes the base."""
    power = 1.0
    for j in range(4):
        growth[j] = c[i, j] / power if i < n else 0.0
        power *= h


@compiled
def _begun(q, y0, first, mode, y, sizes):
    """Put the start of a motion into mode, state and tally; `first` is the forcing there."""
    for i in range(4):
        y[i] = y0[i]
    sizes[0], sizes[1], sizes[2] = max(y0[0], 0.0), max(-y0[0], 0.0), abs(y0[1])
    sizes[RELATIVE] = abs(y0[1] - y0[0])
    decide(q, y0[0], y0[1], y0[3], sign(y0[0]), sign(y0[2]), first, mode)
    sizes[LIFTED] = 0.0 if mode[0] == SLIP or y0[0] != 0.0 else math.inf


@compiled
def _put_results(y, sizes, fell, out):
    """Put the results of a motion into `out`, but for the status."""
    side = 0 if sizes[0] >= sizes[1] else 1
    out[0], out[1], out[2] = sizes[side], sizes[2], sizes[RELATIVE]
    out[3], out[4], out[5] = sizes[TIMES + side], sizes[TIMES + 2], sizes[TIMES + RELATIVE]
    for j in range(4):
        out[6 + j] = y[j]
    out[11], out[12], out[13] = sizes[IMPACTS], sizes[LIFTED], fell
    if fell < math.inf:
        out[0] = out[1] = out[2] = math.inf


@compiled
def _shake(x, y0, c, n, free, rtol, rest_rate, max_events, out):
    """Follow one motion through the pieces of a ground motion and freely after it. Return its status."""
    h = x[6]
    # Without a forcing period, the shorter of the bob's and the block's says which times are but rounding.
    q = plant(x, 0.0, 2.0 * math.pi * min(1.0, math.sqrt(x[2] * x[7])), rest_rate)
    y, series, mode, growth, sizes, clock, scales = (
        np.zeros(4),
        np.zeros((ROWS, ORDERS)),
        np.zeros(4),
        np.zeros(4),
        np.zeros(TALLY),
        np.zeros(1),
        np.empty(4),
    )
    rate = 1.0 / math.sqrt(x[2] * x[7])
    # Sizes against which the error of a step is judged.
    scales[0], scales[1], scales[2], scales[3] = q.nu, q.nu + q.f, q.nu, (q.nu + q.f) * max(1.0, rate)
    _put_forcing(c, n, 0, h, growth)
    _begun(q, y0, growth[0], mode, y, sizes)
    ended, i = ARRIVED, 0
    # The forcing has a kink at every sample, which a step must not cross.
    while i <= n and ended == ARRIVED:
        _put_forcing(c, n, i, h, growth)
        clock[0], sizes[ORIGIN] = 0.0, i * h
        if mode[0] != SLIP:
            # The base acceleration may jump where a piece begins.
            decide(q, y[0], y[1], y[3], 0.0 if mode[0] == REST else mode[1], 0.0, growth[0], mode)
            if mode[0] == SLIP:
                sizes[LIFTED] = min(sizes[LIFTED], i * h)
        end, left = h if i < n else free, max_events - int(sizes[EVENTS])
        ended = advance(q, growth, mode, clock, y, series, sizes, scales, end, rtol, left)
        i += 1
    _put_results(y, sizes, (i - 1) * h + clock[0] if ended == LOST else math.inf, out)
    if ended == LOST:
        return OVERTURNED
    if ended == BROKEN or not math.isfinite(y[0] + y[1] + y[2] + y[3]):
        return FAILED
    if ended != ARRIVED:
        return EVENT_BOUND
    return STOOD if sizes[LIFTED] == math.inf else ROCKED


def _entry(version: int) -> Callable[..., Any]:
    def shake_rows(xs, y0s, pieces, firsts, counts, frees, first, last, rtol, rest_rate, max_events, out):
        """Follow the motions from `first` to before `last`, and return the version of the code."""
        for r in range(first, last):
            n, begin, limits = counts[r], firsts[r], (rtol, rest_rate, max_events)
            out[r, 10] = _shake(xs[r], y0s[r], pieces[begin : begin + n], n, frees[r], *limits, out[r])
        return version

    return stored(shake_rows, numba.njit, _SIGNATURE, nogil=True)


# See `tpd.models.nonlinear_settling`.
shake_rows = _entry(checksum("nonlinear_"))
