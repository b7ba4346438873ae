"""Strides: a fast `advance` for the linear equations (25), away from events.

The state after a time H is a linear function of the state and of the forcing at its start. The series gives
this function once for each run. The bounds of the second derivatives over H are linear functions of absolute
values, summed from the same series. A signal is nowhere further from the chord of its values than H^2/8 times
this bound, which proves that a stride has no event. Where it does not, the series takes over.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled import series
from tpd.compiled.columns import APART, REST, SLIP, SWING, SWING_RATE, TILT, TILT_RATE
from tpd.compiled.contact import excess
from tpd.compiled.forcing import Load
from tpd.compiled.motion import larger_side, update_angles
from tpd.compiled.plant import compiled

_SHARE = 1.0 / 32.0
"""Length of a stride, as a share of the forcing period. Under a ground motion a stride is a piece."""
_EXACT = 1e-16
"""Largest share of the last terms of a series that describes a stride."""


@compiled
def _prepare(q, m, f, w, kind):
    """Compute the strides of a block that slips (`kind` is SLIP) or is held, if its series converge."""
    stride, trial = w.strides[kind], w.trial
    w.stride = 2.0 * math.pi / q.xi * _SHARE if f.harmonic else q.xi
    # Without a side and a direction weight and friction do not act. The moment on a held block has its sign
    # reversed.
    trial.kind, trial.tilt, trial.direction, stride.ready = m.kind, 0.0, 0.0, 1
    c, order, converges = w.series, w.order, True
    for k in range(8):
        unit = w.z
        for i in range(8):
            unit[i] = 1.0 if i == k else 0.0
        for i, row in enumerate((series.PHI, series.PSI, series.V, series.R)):
            c[row, series.VALUE] = unit[i]
        if f.harmonic:
            # Columns 4 and 5 belong to the sine and to the cosine of the phase at the start.
            e = Load(q.xi, 0.5 * math.pi * unit[4], unit[4] + unit[5], 0.0, 0.0, 0.0)
        else:
            e = Load(0.0, 0.0, unit[4], unit[5], unit[6], unit[7])
        w.inverse[:2] = 0.0
        series.terms(q, trial, e, math.inf, order, w)
        for i, row in enumerate((series.PHI, series.PSI, series.V, series.R)):
            signal = series.DOWN if i == 0 and kind != SLIP else row
            total, bend, power = max(abs(c[row, 0]), abs(c[row, 1]) * w.stride), 0.0, 1.0
            for n in range(2, order + 1):
                bend += n * (n - 1.0) * abs(c[signal, n]) * power
                power *= w.stride
                total = max(total, abs(c[row, n]) * power * w.stride)
            last = abs(c[row, order]) * power * w.stride
            converges = converges and last <= _EXACT * total
            stride.map[i, k] = series.value_at(w, row, order, w.stride)
            stride.bends[i, k] = 0.125 * w.stride * w.stride * bend
    if not converges:
        w.stride, w.strides[0].ready, w.strides[1].ready = 0.0, -1, -1


@compiled
def stride(q, f, m, w, i, s, end, limit):
    """Follow a motion in strides from the local time `s` of piece i, and return the time that it reaches.

    The tilt stays below `limit`.
    """
    y, kind = m.y, (0 if m.kind == SLIP else 1)
    if w.strides[kind].ready == 0:
        _prepare(q, m, f, w, kind)
    a, b, h, z = w.strides[kind].map, w.strides[kind].bends, w.stride, w.z
    if w.strides[kind].ready < 0 or end - s < h:
        return s
    centre = (m.tilt * q.weight + m.direction * q.k) / q.up if m.kind == SLIP else y[TILT]
    if f.harmonic:
        z[4], z[5], z[6], z[7] = math.sin(q.xi * s), math.cos(q.xi * s), 0.0, 0.0
        turn_sine, turn_cosine, columns = math.sin(q.xi * h), math.cos(q.xi * h), 6
    else:
        turn_sine, turn_cosine, columns = 0.0, 1.0, 8
        for k in range(4):
            z[4 + k] = f.cubics[i, k] / h**k if i < f.pieces else 0.0
    while end - s >= h * (1.0 - 1e-12):
        z[0], z[1], z[2], z[3] = y[TILT] - centre, y[SWING], y[TILT_RATE], y[SWING_RATE]
        phi, psi, v, r, of_phi, of_psi, of_v, of_r = centre, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(columns):
            x, size = z[k], abs(z[k])
            phi, psi, v, r = phi + a[0, k] * x, psi + a[1, k] * x, v + a[2, k] * x, r + a[3, k] * x
            of_phi, of_psi = of_phi + b[0, k] * size, of_psi + b[1, k] * size
            of_v, of_r = of_v + b[2, k] * size, of_r + b[3, k] * size
        if f.harmonic:
            sine, cosine = z[4] * turn_cosine + z[5] * turn_sine, z[5] * turn_cosine - z[4] * turn_sine
            eta, last = z[4], sine
        else:
            sine, cosine = z[4], z[5]
            eta, last = z[4], z[4] + h * (z[5] + h * (z[6] + h * z[7]))
        if kind == 0:
            # After a turning point the rate starts at zero. It is 8 bounds at the end only if it always grows.
            before = m.direction * y[TILT_RATE] if y[TILT_RATE] != 0.0 else 0.125 * m.direction * v
            clear = abs(phi) < limit and min(before, m.direction * v) > of_v
            clear = clear and (m.tilt == m.direction or min(m.tilt * y[TILT], m.tilt * phi) > of_phi)
        else:
            phi, v, side = y[TILT], 0.0, (0.0 if m.kind == REST else m.tilt)
            hold = q.k + (q.weight if m.kind == REST else 0.0)
            one = excess(q, y[TILT], y[SWING], y[SWING_RATE], side, eta)
            two = excess(q, y[TILT], psi, r, side, last)
            clear = max(abs(one), abs(two)) + of_phi < hold
            of_phi, of_v = 0.0, 0.0
        # The bob may not turn within the stride at an angle that counts.
        turns = min(y[SWING_RATE] * r, 0.0) < 0.0 or min(abs(y[SWING_RATE]), abs(r)) <= of_r
        clear = clear and (
            not turns or max(abs(y[SWING]), abs(psi)) + of_psi <= m.peaks[larger_side(m, SWING)]
        )
        if w.relative:
            one, two = y[SWING_RATE] - y[TILT_RATE], r - v
            turns = one * two < 0.0 or min(abs(one), abs(two)) <= of_r + of_v
            far = max(abs(y[SWING] - y[TILT]), abs(psi - phi)) + of_psi + of_phi
            clear = clear and (not turns or far <= m.peaks[larger_side(m, APART)])
        if not clear:
            break
        y[TILT], y[SWING], y[TILT_RATE], y[SWING_RATE] = phi, psi, v, r
        update_angles(m, phi, psi, i * (q.xi if not f.harmonic else 0.0) + s, h)
        z[4], z[5] = sine, cosine
        s += h
    return end if abs(end - s) <= 1e-12 * h else s
