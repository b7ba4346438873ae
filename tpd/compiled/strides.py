"""Strides: a fast way through the linear equations (25), away from events.

The state after a time H is a linear function of the state and of the forcing at its start. The series gives
this function once for each run. The bounds of the second derivatives over H are linear functions of absolute
values, which the same series give. A signal is nowhere farther from the chord of its values than H^2/8 times
its bound, which proves that a stride has no event. Where the proof fails, the series takes over.
"""

from __future__ import annotations

import math

from tpd.compiled import series
from tpd.compiled.columns import APART, REST, SLIP, SWING, SWING_RATE, TILT, TILT_RATE
from tpd.compiled.contact import excess
from tpd.compiled.forcing import Load
from tpd.compiled.motion import larger_side, update_angles
from tpd.compiled.plant import compiled, places

_SHARE = 1.0 / 32.0
"""Length of a stride, as a share of the forcing period. Under a ground motion a stride is a piece."""
_FIRST, _SECOND, _THIRD, _FOURTH = places(8, 4)
"""Columns of the forcing, after those of the state: sine and cosine of its phase, or coefficients of a
cubic."""
_EXACT, _LATE = 1e-16, 1e-12
"""Largest share of the last term of a series that describes a stride; and the share of a stride by which the
end of a motion may be late because of rounding."""
_USELESS, _UNKNOWN, _READY = places(2, -1)
"""Whether the stride of a mode is known: its series do not converge; not yet; yes."""


@compiled
def _prepare(q, m, f, w, stride):
    """Compute the stride of the mode of `m`, if its series converge."""
    c, order, unit, trial, converges = w.series, w.order, w.z, w.trial, True
    w.stride = 2.0 * math.pi / q.xi * _SHARE if f.harmonic else q.xi
    # Without a side and a direction weight and friction do not act. The signal of a release downwards is then
    # the moment on the held block and a constant.
    trial.kind, trial.tilt, trial.direction = m.kind, 0.0, 0.0
    rows = series.PHI, series.PSI, series.V, series.R
    for k in range(8):
        for i in range(8):
            unit[i] = 1.0 if i == k else 0.0
        for i, row in enumerate(rows):
            c[row, series.VALUE] = unit[i]
        # The sine of the phase at the start is the factor of cos(xi t), and the cosine that of sin(xi t).
        e = Load(0.0, 0.0, unit[_FIRST], unit[_SECOND], unit[_THIRD], unit[_FOURTH])
        if f.harmonic:
            e = Load(q.xi, 0.5 * math.pi * unit[_FIRST], unit[_FIRST] + unit[_SECOND], 0.0, 0.0, 0.0)
        series.terms(q, trial, e, math.inf, order, w)
        for i, row in enumerate(rows):
            stride.map[i, k] = series.value_at(w, row, order, w.stride)
            # Of a held block the moment is watched instead of the tilt.
            watched = series.DOWN if row == series.PHI and m.kind != SLIP else row
            bend, power = 0.0, 1.0
            largest = max(abs(c[row, series.VALUE]), abs(c[row, series.SLOPE]) * w.stride)
            for n in range(2, order + 1):
                bend += n * (n - 1.0) * abs(c[watched, n]) * power
                power *= w.stride
                largest = max(largest, abs(c[row, n]) * power * w.stride)
            stride.bends[i, k] = 0.125 * w.stride * w.stride * bend
            converges = converges and abs(c[row, order]) * power * w.stride <= _EXACT * largest
    stride.ready = _READY
    if not converges:
        # The series alone follow such a motion.
        w.stride, w.of_strides[0].ready, w.of_strides[1].ready = 0.0, _USELESS, _USELESS


@compiled
def _turns(before, after, bound):
    """Whether a rate with these values at both ends may vanish in between."""
    return before * after <= 0.0 or min(abs(before), abs(after)) <= bound


@compiled
def _end_of(stride, y, z, columns, centre, out):
    """Write the state at the end of a stride into `out`, with the bounds of the four signals after it."""
    z[TILT], z[SWING], z[TILT_RATE], z[SWING_RATE] = y[TILT] - centre, y[SWING], y[TILT_RATE], y[SWING_RATE]
    # Maps and bounds are read together, because both need the same state.
    for i in range(4):
        value, bound = 0.0, 0.0
        for k in range(columns):
            value += stride.map[i, k] * z[k]
            bound += stride.bends[i, k] * abs(z[k])
        out[i], out[i + 4] = value, bound
    out[TILT] += centre


@compiled
def follow_strides(q, f, m, w, i, s, end, limit):
    """Follow a motion in strides from the local time `s` of piece i, and return the time that it reaches.

    The tilt stays below `limit`.
    """
    y, z, now, slips = m.y, w.z, w.now, m.kind == SLIP
    stride = w.of_strides[0 if slips else 1]
    if stride.ready == _UNKNOWN:
        _prepare(q, m, f, w, stride)
    # The remaining time may be shorter than a stride. The series then ends the piece.
    h = w.stride
    if stride.ready == _USELESS or end - s < h * (1.0 - _LATE):
        return s
    # The phase of the forcing turns by the same angle in each stride.
    sine, cosine, columns = math.sin(q.xi * h), math.cos(q.xi * h), (6 if f.harmonic else 8)
    z[_FIRST], z[_SECOND] = math.sin(q.xi * s), math.cos(q.xi * s)
    for k in range(0 if f.harmonic else 4):
        z[_FIRST + k] = f.cubics[i, k] / h**k if i < f.pieces else 0.0
    # The tilt of a slipping block is measured from the equilibrium of weight and friction.
    centre = (m.tilt * q.weight + m.direction * q.k) / q.up if slips else y[TILT]
    while end - s >= h * (1.0 - _LATE):
        _end_of(stride, y, z, columns, centre, now)
        phi, psi, v, r = now[TILT], now[SWING], now[TILT_RATE], now[SWING_RATE]
        of_phi, of_psi, of_v, of_r = now[TILT + 4], now[SWING + 4], now[TILT_RATE + 4], now[SWING_RATE + 4]
        first = z[_FIRST]
        if f.harmonic:
            z[_FIRST], z[_SECOND] = first * cosine + z[_SECOND] * sine, z[_SECOND] * cosine - first * sine
            last = z[_FIRST]
        else:
            last = first + h * (z[_SECOND] + h * (z[_THIRD] + h * z[_FOURTH]))
        if slips:
            # After a turning point the rate starts at zero. It keeps its sign if it ends above 8 bounds.
            before = m.direction * y[TILT_RATE] if y[TILT_RATE] != 0.0 else 0.125 * m.direction * v
            clear = abs(phi) < limit and min(before, m.direction * v) > of_v
            # A block that moves outwards cannot land.
            clear = clear and (m.tilt == m.direction or min(m.tilt * y[TILT], m.tilt * phi) > of_phi)
        else:
            # The moment on a held block must stay below friction, on the base also below the weight.
            hold, side = (q.k + q.weight, 0.0) if m.kind == REST else (q.k, m.tilt)
            one = abs(excess(q, y[TILT], y[SWING], y[SWING_RATE], side, first))
            clear = max(one, abs(excess(q, y[TILT], psi, r, side, last))) + of_phi < hold
            phi, v, of_phi, of_v = y[TILT], 0.0, 0.0, 0.0
        # The bob may not turn within a stride at an angle that counts.
        if _turns(y[SWING_RATE], r, of_r):
            far = max(abs(y[SWING]), abs(psi)) + of_psi
            clear = clear and far <= m.peaks[larger_side(m, SWING)]
        if w.relative and _turns(y[SWING_RATE] - y[TILT_RATE], r - v, of_r + of_v):
            far = max(abs(y[SWING] - y[TILT]), abs(psi - phi)) + of_psi + of_phi
            clear = clear and far <= m.peaks[larger_side(m, APART)]
        # Without a proof nothing of this stride is kept.
        if not clear:
            return s
        y[TILT], y[SWING], y[TILT_RATE], y[SWING_RATE] = phi, psi, v, r
        update_angles(m, phi, psi, (0.0 if f.harmonic else i * q.xi) + s, h)
        s += h
    return end if end - s <= _LATE * h else s
