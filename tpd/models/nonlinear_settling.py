"""Compiled loop over forcing periods of the nonlinear equations: when a motion repeats, rests or is lost.

The rules are those of `tpd.models.settling`. Shaking may begin at any phase and grow; see
`tpd.models.batches.settle_all`.
"""

from __future__ import annotations

import inspect
import math
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from tpd.models import nonlinear_kernel
from tpd.models.nonlinear_kernel import (
    ARRIVED,
    BROKEN,
    LOST,
    REST,
    SLIP,
    STICK,
    advance,
    compiled,
    decide,
    plant,
    sine_at,
)

LONGEST = 8
"""Longest motion recognised as periodic, in forcing periods."""
TOLERANCE = 1e-6
"""Repetition error that counts as settled, in units of `_scales`."""
STILL = 1e-3
"""Share of its scale by which the bob's swing may change in a period under a block called at rest."""
STATUSES = (
    "rocking",
    "sticking",
    "rest",
    "held",
    "overturned",
    "not_settled",
    "event_bound",
    "failed",
)
"""Names of statuses in the order of their numbers."""
_ROCKING, _STICKING, _REST, _HELD, _OVERTURNED, _NOT_SETTLED, _EVENT_BOUND, _FAILED = range(8)
FLOATS, WHOLES = 11, 3
"""Columns of results: y, amplitude, stroke, peak, peak stroke, kind and signs of the mode; and status,
periods of the motion, periods elapsed."""

_TABLE, _COLUMN = numba.float64[:, ::1], numba.float64[::1]
_INPUT = (_TABLE, _TABLE, _COLUMN, _COLUMN, numba.int64, numba.int64)
_LIMITS = (numba.int64, numba.float64, numba.int64)
_SIGNATURE = numba.int64(*_INPUT, *_LIMITS, _TABLE, numba.int64[:, ::1])
# With its types given, the code is compiled once, when the module is loaded, and never by surprise again.


@compiled
def _scales(q):
    """Sizes of (phi, psi, phi', psi') against which a repetition is judged."""
    scales, rate, swing = np.zeros(4), max(q.xi, 1.0), q.nu + q.f
    scales[0], scales[1], scales[2], scales[3] = q.nu, swing, q.nu * rate, swing * rate
    return scales


@compiled
def _repeats(q, y, past, known, scales):
    """Periods after which a motion repeats itself; 0 if it does not."""
    # A massless bob cannot move the block, so that its state does not count.
    step = 1 if q.mu > 0.0 else 2
    close, shortest = False, 0
    for j in range(known):
        error = 0.0
        for i in range(0, 4, step):
            error = max(error, abs(y[i] - past[j, i]) / scales[i])
        close = close or error < TOLERANCE
        # On its way to period one a motion may alternate: the shortest period that is close as well counts.
        if shortest == 0 and error < 100.0 * TOLERANCE:
            shortest = j + 1
    return shortest if close else 0


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
def _share(growth, ramp, period, elapsed):
    """Put the share of its full size that the shaking has when a period begins, and its increase per unit
    tau, into `growth`; return the time from then at which it has its full size, 0 if it has."""
    grown = (ramp - elapsed) * period
    if grown <= 1e-12 * period:
        growth[0], growth[1] = 1.0, 0.0
        return 0.0
    growth[0], growth[1] = elapsed / ramp, 1.0 / (ramp * period)
    return grown


@compiled
def _one_period(q, growth, grown, mode, clock, w, sizes, scales, rtol, max_events):
    """Follow the motion to the end of the forcing period: how it ended, see `nonlinear_kernel.advance`."""
    sizes[0], sizes[1], sizes[2] = max(w[0, 0], 0.0), max(-w[0, 0], 0.0), abs(w[0, 1])
    mode[3] = 1.0 if mode[0] != SLIP else 0.0
    if clock[0] < grown < q.period:
        # The forcing has a kink where its growth ends, which a step must not cross.
        ended = advance(q, growth, mode, clock, w, sizes, scales, grown, rtol, max_events)
        if ended != ARRIVED:
            return ended
    return advance(q, growth, mode, clock, w, sizes, scales, q.period, rtol, max_events)


@compiled
def _remember(past, known, amplitudes, strokes, held, y, mode, sizes):
    """Put a period in front of the last ones; return how many states are known."""
    for j in range(LONGEST - 1, 0, -1):
        for i in range(4):
            past[j, i] = past[j - 1, i]
        amplitudes[j], strokes[j], held[j] = amplitudes[j - 1], strokes[j - 1], held[j - 1]
    for i in range(4):
        past[0, i] = y[i]
    amplitudes[0], strokes[0], held[0] = max(sizes[0], sizes[1]), sizes[2], mode[3]
    return min(known + 1, LONGEST)


@compiled
def _sign(x):
    """Sign of a number, 0 of zero."""
    return 0.0 if x == 0.0 else math.copysign(1.0, x)


@compiled
def _classified(q, growth, y, t):
    """Mode of a state, with a place for whether the block was held."""
    mode = np.zeros(4)
    decide(q, y[0], y[1], y[3], _sign(y[0]), _sign(y[2]), sine_at(q, growth, t), mode)
    return mode


@compiled
def _settled(status, repeats, y, amplitudes, strokes, held, peaks, mode, out):
    """Put the results of a motion into `out`; return its status and its periods."""
    own = repeats if repeats > 0 else LONGEST
    amplitude, stroke, stuck = 0.0, 0.0, 0.0
    for j in range(own):
        amplitude, stroke, stuck = max(amplitude, amplitudes[j]), max(stroke, strokes[j]), max(stuck, held[j])
    if status == _ROCKING and stuck > 0.0:
        status = _STICKING
    if status == _REST:
        amplitude, stroke = abs(y[0]), strokes[0]
        status = _HELD if y[0] != 0.0 else _REST
    if status == _OVERTURNED:
        peaks[0] = peaks[1] = math.inf
    out[4], out[5], out[6], out[7] = amplitude, stroke, peaks[0], peaks[1]
    for i in range(4):
        out[i] = y[i]
    for i in range(3):
        out[8 + i] = mode[i]
    return status, max(repeats, 1)


@compiled
def _settle(x, y0, begin, ramp, periods, rtol, max_events, out):
    """Follow one motion until it repeats, rests, is lost, or `periods` have elapsed: status, its periods and
    the periods elapsed."""
    q = plant(x)
    w, past, scales = np.zeros((9, 4)), np.zeros((LONGEST, 4)), _scales(q)
    amplitudes, strokes, held = np.zeros(LONGEST), np.zeros(LONGEST), np.zeros(LONGEST)
    growth, sizes, peaks, clock = np.zeros(2), np.zeros(3), np.zeros(2), np.zeros(2)
    clock[0], clock[1] = begin, 1e-3 * q.period
    for i in range(4):
        w[0, i] = past[0, i] = y0[i]
    _share(growth, ramp, q.period, 0.0)
    mode = _classified(q, growth, y0, begin)
    # A start within a period has another phase than the ends of periods, with which these are compared.
    known, status, repeats, elapsed = (1 if begin == 0.0 else 0), _NOT_SETTLED, 0, 0
    while elapsed < periods and status == _NOT_SETTLED:
        grown = _share(growth, ramp, q.period, float(elapsed))
        ended = _one_period(q, growth, grown, mode, clock, w, sizes, scales, rtol, max_events)
        y, elapsed = w[0], elapsed + 1
        peaks[0], peaks[1] = max(peaks[0], max(sizes[0], sizes[1])), max(peaks[1], sizes[2])
        # Nothing that was met before the shaking became steady counts as a repetition, or as rest.
        steady = grown == 0.0 and ended == ARRIVED
        repeats = _repeats(q, y, past, known, scales) if steady else 0
        rests = steady and known > 0 and _stays(q, y, past[0], mode, sizes)
        known = _remember(past, known if steady else 0, amplitudes, strokes, held, y, mode, sizes)
        clock[0] = 0.0
        if ended == BROKEN or not math.isfinite(y[0] + y[1] + y[2] + y[3]):
            status = _FAILED
        elif ended == LOST:
            status = _OVERTURNED
        elif ended != ARRIVED:
            status = _EVENT_BOUND
        elif rests:
            status = _REST
        elif repeats > 0:
            status = _ROCKING
    status, own = _settled(status, repeats, w[0], amplitudes, strokes, held, peaks, mode, out)
    return status, own, elapsed


def _entry(version: int) -> Callable[..., Any]:
    """Compiled `settle_rows`, stored on disk for later processes where a folder can be written to."""

    def settle_rows(xs, y0s, begins, ramps, first, last, periods, rtol, max_events, out, wholes):
        """Follow the motions from `first` to before `last`, and return the version of the code."""
        for n in range(first, last):
            found = _settle(xs[n], y0s[n], begins[n], ramps[n], periods, rtol, max_events, out[n])
            wholes[n, 0], wholes[n, 1], wholes[n, 2] = found
        return version

    plain = inspect.unwrap(settle_rows)
    try:
        return numba.njit(_SIGNATURE, cache=True, nogil=True, error_model="numpy")(plain)
    except RuntimeError:
        # Neither the package's folder nor the user's cache nor NUMBA_CACHE_DIR can be written to.
        return numba.njit(_SIGNATURE, nogil=True, error_model="numpy")(plain)


def _version() -> int:
    """Checksum of the compiled sources."""
    # Both files, because the code of one is compiled into the function of the other.
    sources = (Path(str(file)).read_bytes() for file in (nonlinear_kernel.__file__, __file__))
    return zlib.crc32(b"".join(sources))


# Numba's store looks at the file of the function alone, and would go on with machine code of another version
# of the kernel. A number from outside the function is part of its key.
settle_rows = _entry(_version())
