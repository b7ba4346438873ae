"""Compiled loop over the pieces of a ground motion, for the nonlinear equations."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from tpd.exact.arc_kernel import compiled
from tpd.exact.cubic_kernel import cubic_at
from tpd.exact.event_kernel import sign
from tpd.models.compiling import checksum
from tpd.models.nonlinear_kernel import ARRIVED, BROKEN, LOST, REST, SLIP, advance, decide, plant
from tpd.models.shaken_kernel import EVENT_BOUND, FAILED, OVERTURNED, ROCKED, STOOD

COLUMNS = 9
"""Numbers of a result: largest |phi| and |psi|, the state at the end, status, whether the block was lifted,
and the time from which it is beyond return."""
_TABLE, _COLUMN, _WHOLE = numba.float64[:, ::1], numba.float64[::1], numba.int64[::1]
_ROWS = (_TABLE, _TABLE, _TABLE, _WHOLE, _WHOLE, _COLUMN)
_SIGNATURE = numba.int64(*_ROWS, numba.int64, numba.int64, numba.float64, numba.int64, _TABLE)


@compiled
def _put_forcing(c, n, i, h, growth):
    """Put the coefficients of a piece into `growth`."""
    e = cubic_at(c, n, i, h, 0.0)
    growth[0], growth[1], growth[2], growth[3] = e.e0, e.e1, e.e2, e.e3


@compiled
def _shake(x, y0, c, n, free, rtol, max_events, out):
    """Follow one motion through the pieces of a ground motion and freely after it. Return its status."""
    h = x[6]
    # The longest step is a sixteenth of the period: of the bob's here, or of the block's.
    q = plant(x, 0.0, 2.0 * math.pi * min(1.0, math.sqrt(x[2] * x[7])))
    w, mode, growth, sizes, clock, scales = (
        np.zeros((9, 4)),
        np.zeros(4),
        np.zeros(4),
        np.zeros(3),
        np.zeros(2),
        np.empty(4),
    )
    rate = 1.0 / math.sqrt(x[2] * x[7])
    # Sizes against which the error of a step is judged.
    scales[0], scales[1], scales[2], scales[3] = q.nu, q.nu + q.f, q.nu, (q.nu + q.f) * max(1.0, rate)
    for i in range(4):
        w[0, i] = y0[i]
    sizes[0], sizes[1], sizes[2] = max(y0[0], 0.0), max(-y0[0], 0.0), abs(y0[1])
    _put_forcing(c, n, 0, h, growth)
    decide(q, y0[0], y0[1], y0[3], sign(y0[0]), sign(y0[2]), growth[0], mode)
    clock[1], ended, lifted, i = 0.1 * h, ARRIVED, mode[0] == SLIP, 0
    # The forcing has a kink at every sample, which a step must not cross.
    while i <= n and ended == ARRIVED:
        _put_forcing(c, n, i, h, growth)
        clock[0], y = 0.0, w[0]
        if mode[0] != SLIP:
            # The base acceleration may jump where a piece begins.
            decide(q, y[0], y[1], y[3], 0.0 if mode[0] == REST else mode[1], 0.0, growth[0], mode)
        ended = advance(q, growth, mode, clock, w, sizes, scales, h if i < n else free, rtol, max_events)
        lifted = lifted or mode[0] == SLIP or max(sizes[0], sizes[1]) > 0.0
        i += 1
    out[0], out[1], out[6] = max(sizes[0], sizes[1]), sizes[2], 1.0 if lifted else 0.0
    out[7] = (i - 1) * h + clock[0] if ended == LOST else math.inf
    for j in range(4):
        out[2 + j] = w[0, j]
    if ended == LOST:
        out[0] = out[1] = math.inf
        return OVERTURNED
    if ended == BROKEN or not math.isfinite(out[2] + out[3] + out[4] + out[5]):
        return FAILED
    if ended != ARRIVED:
        return EVENT_BOUND
    return ROCKED if lifted else STOOD


def _entry(version: int) -> Callable[..., Any]:
    def shake_rows(xs, y0s, pieces, firsts, counts, frees, first, last, rtol, max_events, out):
        """Follow the motions from `first` to before `last`, and return the version of the code."""
        for r in range(first, last):
            n, begin = counts[r], firsts[r]
            out[r, 8] = _shake(
                xs[r], y0s[r], pieces[begin : begin + n], n, frees[r], rtol, max_events, out[r]
            )
        return version

    plain = inspect.unwrap(shake_rows)
    try:
        return numba.njit(_SIGNATURE, cache=True, nogil=True, error_model="numpy")(plain)
    except RuntimeError:
        return numba.njit(_SIGNATURE, nogil=True, error_model="numpy")(plain)


# See `tpd.models.nonlinear_settling`.
shake_rows = _entry(checksum("nonlinear_", "shaken_kernel"))
