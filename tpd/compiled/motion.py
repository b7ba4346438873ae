"""The record of a motion during its simulation: its state, its counters and its legs.

A leg is a part of a motion that one Taylor series describes. It ends at an event, at the end of the
simulation, or where the series is no longer accurate. Derivatives, states at requested times and orbits are
computed from legs alone (`tpd.compiled.legs`).
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled.columns import SLIP, SWING, SWING_RATE, TILT, TILT_RATE
from tpd.compiled.plant import compiled, places

CONTINUES, LANDING, TURN, RELEASE_UP, RELEASE_DOWN, END, STOP = places(6, -1)
"""Ends of legs: none, so that the next leg continues the motion; the landing and the turning point of a
slipping block; the releases of a held block to either side; the end of a piece of the forcing; and a time
that does not depend on the parameters."""
LEG = np.dtype(
    [
        *((name, np.float64) for name in ("kind", "tilt", "direction")),
        ("piece", np.int64),
        *((name, np.float64) for name in ("start", "duration")),
        *((name, np.int64) for name in ("order", "event")),
        ("rests", np.bool_),
        ("y", np.float64, (4,)),
    ],
    align=True,
)
"""A leg: `kind`, `tilt` and `direction` of its mode; the index of its `piece`, the local time of its `start`
in the piece, and its `duration`; the `order` of its series; the `event` at its end, and whether the block
`rests` after it at the end of a rattle; the state `y` at its start."""
MOTION = np.dtype(
    [
        ("y", np.float64, (4,)),
        *((name, np.float64) for name in ("kind", "tilt", "direction", "hold_level")),
        *((name, np.float64, (6,)) for name in ("peaks", "peak_times", "peak_offsets")),
        ("peak_legs", np.int64, (6,)),
        *((name, np.int64) for name in ("impacts", "n_legs", "events")),
        *((name, np.float64) for name in ("uplift_time", "overturn_time", "transversality")),
    ],
    align=True,
)
"""A motion: its state `y`; the `kind` of its mode and the signs `tilt` of phi and `direction` of phi'; and
counters.

`hold_level` says for how long the block was held since the largest angles are recorded: 0 never, 1 part of
the time, 2 all the time. `peaks` are the largest phi, psi and psi - phi to either side, `peak_times` their
times, `peak_legs` the legs in which they occurred (-1 is the start), and `peak_offsets` the times since the
starts of these legs. `impacts` and `n_legs` count impacts and legs, and `events` is the number of events that
are still allowed. `uplift_time` and `overturn_time` are the times of the first uplift and of overturning, and
`transversality` is the smallest one of all events.
"""
LEGS = 512
"""Number of legs for which memory is allocated at first."""


@compiled
def copy_to(source, target):
    """Copy the numbers of `source` to `target`."""
    # A slice would do the same, but its error messages take Numba a second to compile.
    for i in range(len(source)):
        target[i] = source[i]


@compiled
def set_motion(y, mode, m):
    """Set the state and the mode of a motion."""
    copy_to(y, m.y)
    m.kind, m.tilt, m.direction = mode.kind, mode.tilt, mode.direction


@compiled
def angle_of(phi, psi, k):
    """Return angle k of six.

    The angles are phi, psi and psi - phi to the right (even k), and to the left with the opposite sign (odd
    k).
    """
    angle = phi if k < 2 else (psi if k < 4 else psi - phi)
    return angle if k % 2 == 0 else -angle


@compiled
def reset_counts(m):
    """Reset the counters of impacts, legs and times."""
    m.impacts, m.n_legs, m.uplift_time, m.overturn_time, m.transversality = 0, 0, math.inf, math.inf, math.inf


@compiled
def reset_angles(m):
    """Start to record the largest angles and the hold level from the present state on."""
    # Both sides are recorded: their difference shows whether a motion is symmetric.
    m.hold_level = 2.0 if m.kind != SLIP else 0.0
    for k in range(6):
        m.peaks[k], m.peak_legs[k] = angle_of(m.y[TILT], m.y[SWING], k), -1
        m.peak_times[k] = m.peak_offsets[k] = 0.0


@compiled
def update_angle(m, k, angle, tau, offset):
    """Update the largest angle k with an angle in the leg that is recorded next.

    The leg starts at the time `tau`, and reaches the angle after the time `offset`.
    """
    # Only a larger angle replaces the old one, so that the first leg counts. A block at rest adds none.
    if angle > m.peaks[k]:
        m.peaks[k], m.peak_legs[k], m.peak_times[k], m.peak_offsets[k] = angle, m.n_legs, tau + offset, offset


@compiled
def update_angles(m, phi, psi, tau, offset):
    """Update the largest angles with phi and psi, see `update_angle`."""
    # The third angle is that between rod and block, which limits the bob in a cavity.
    for k in range(3):
        angle = phi if k == TILT else (psi if k == SWING else psi - phi)
        # Only the side of the angle is updated: on the other side the angle is negative.
        update_angle(m, 2 * k if angle >= 0.0 else 2 * k + 1, abs(angle), tau, offset)


@compiled
def larger_side(m, k):
    """Return the index of the larger of both sides of angle k, which is TILT, SWING or APART."""
    return 2 * k if m.peaks[2 * k] >= m.peaks[2 * k + 1] else 2 * k + 1


@compiled
def largest(m, k):
    """Return the largest absolute value of angle k, which is TILT, SWING or APART."""
    return m.peaks[larger_side(m, k)]


@compiled
def record_leg(m, legs, piece, start, duration, order, event):
    """Record the next leg, which starts in the present state, if there is memory for it."""
    if m.n_legs < len(legs):
        leg = legs[m.n_legs]
        leg.kind, leg.tilt, leg.direction, leg.piece = m.kind, m.tilt, m.direction, piece
        leg.start, leg.duration, leg.order, leg.event, leg.rests = start, duration, order, event, False
        copy_to(m.y, leg.y)


@compiled
def is_finite(y):
    """Whether all numbers of a state are finite."""
    return math.isfinite(y[TILT] + y[SWING] + y[TILT_RATE] + y[SWING_RATE])
