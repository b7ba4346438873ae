"""A followed motion in compiled scalar code: its state, what is counted, and its legs.

A leg is a part of an arc that ends in an event, at its horizon or where the bob turns. Legs are all that
derivatives, states at given times and orbits are read from (`tpd.exact.legs`).
"""

from __future__ import annotations

import math

import numpy as np

from tpd.exact.contact_kernel import handle_event, transversality
from tpd.exact.events import END, SECOND, SIGNALS
from tpd.exact.plant import compiled
from tpd.exact.terms import REST, SLIP, SWING, SWING_RATE, TILT, TILT_RATE

LEG = np.dtype(
    [
        *((name, np.float64) for name in ("kind", "tilt", "direction")),
        ("piece", np.int64),
        *((name, np.float64) for name in ("start", "duration")),
        ("event", np.int64),
        ("ends_at_rest", np.bool_),
        ("y", np.float64, (4,)),
    ],
    align=True,
)
"""A leg: the mode's kind and signs; its piece, its beginning there and its duration (the number of pieces if
they are whole); what ended it, and whether that ended in rest; the state at its start."""
_ROUNDING = 1e-15
"""Share of a piece below which a remaining time is rounding."""
WHOLE = np.int64(4)
"""End of a leg that consists of whole pieces without an event."""
MOTION = np.dtype(
    [
        ("y", np.float64, (4,)),
        *((name, np.float64) for name in ("kind", "tilt", "direction", "hold_level")),
        *((name, np.float64, (6,)) for name in ("extremes", "extreme_times")),
        ("extreme_legs", np.int64, (6,)),
        *((name, np.int64) for name in ("impacts", "leg_count", "events")),
        *((name, np.float64) for name in ("uplift_time", "overturn_time", "transversality", "bob_direction")),
    ],
    align=True,
)
"""A motion that is followed: its state; the kind of its mode, the signs of phi and phi', and for how long the
block was held since the count began (0 never, 1 for a part of the motion, 2 throughout); and what is counted:
the largest phi, psi and psi - phi to either side, their times, and the legs at whose ends they were met (-1
is the beginning); impacts, legs and events that are left; the times of the first uplift and of the
overturning; the least transversality; and the sign of psi'."""
GRID, TERMS, MOST, HOPS = map(np.int64, (32, 8, 11, 6))
"""Sizes of `tpd.exact.march`: shares into which its longest step is divided; usual terms of its Taylor
polynomials, and most; hops that tell how a rattle ends."""
_FLOW = np.dtype(
    [(name, np.float64) for name in ("rising", "decaying", "u", "v", "held_u", "held_v", "sine", "cosine")]
)
_PUSH = np.dtype([(name, np.float64) for name in ("by_tilt", "by_swing", "by_slip", "by_forcing")])
_ORDER = np.dtype([(name, np.float64) for name in ("forced", "growth", "decaying", "rising")])
_NUMBERS = "step", "jump", "sine", "cosine", "share", "growth", "weight", "quickest"
MARCH = np.dtype(
    [
        ("flow", _FLOW, (GRID + 1,)),
        ("series", np.float64, (3, MOST)),
        *((name, _PUSH) for name in ("tilt", "swing")),
        ("orders", _ORDER, (2,)),
        ("hops", np.float64, (2, HOPS, 4)),
        ("limit", np.float64, (4,)),
        *((name, np.float64, (2,)) for name in ("scale", "over_w", "sure_time")),
        ("hop_count", np.int64, (2,)),
        ("terms", np.int64),
        *((name, np.float64) for name in _NUMBERS),
    ],
    align=True,
)
"""Working memory of `tpd.exact.march`. The table of the flow: both exponentials, the pair's solutions for the
slipping block and the held one, sine and cosine of the forcing's phase. Taylor polynomials of tilt, swing and
a signal. The accelerations of both angles by the tilt from its centre, swing, phi' - psi' and the forcing.
What multiplies the parts of an angle in bounds on its derivatives, and K and 1/w of the pair for the slipping
block and the held one. The last hops from either side, how many are known, where they lead, and for how long
the accelerations are sure to keep their signs. The terms of the Taylor polynomials. The longest step, and the
shares that the next one has; the phase, share and growth of the forcing; the weight of rates, and k."""
WORKSPACE = np.dtype(
    [
        *((name, np.float64, (4,)) for name in ("start", "end")),
        ("signals", np.float64, (SIGNALS + 1, 4, 9)),
        *((name, np.int64) for name in ("count", "has_second", "budget", "first_zero")),
        *((name, np.float64) for name in ("shortest", "longest", "window", "limit")),
        ("maps", np.float64, (2, 4, 8)),
        ("bounds", np.float64, (2, 2, 2)),
        ("trial", MOTION),
        ("march", MARCH),
    ],
    align=True,
)
"""Working memory: the states at the start and at the end of a leg; for `tpd.exact.events` the signals, how
many there are and whether the second is one, looks that are left, the first signal that the last event may
have made zero, the shortest window, the longest and the first one, and the tilt beyond which a block does not
return; for `tpd.exact.whole_pieces` maps and bounds;
another motion; and what the march needs."""
LEGS = 256
"""Legs of a motion for which room is made at first."""
NO, YES, FIRST_PIECE = np.bool_(False), np.bool_(True), np.int64(0)
"""Numbers of NumPy: Numba would compile a function once more for each plain one."""


@compiled
def copy_to(source, target):
    """Put numbers in place of others."""
    # A slice does the same, with messages of errors that take Numba a second to compile.
    for i in range(len(source)):
        target[i] = source[i]


@compiled
def angle_of(phi, psi, k):
    """Angle k of a tally, with its sign: phi, psi and psi - phi to the right (k even) and to the left."""
    angle = phi if k < 2 else (psi if k < 4 else psi - phi)
    return angle if k % 2 == 0 else -angle


@compiled
def reset_counts(m):
    """Begin to count anew."""
    m.impacts = 0
    m.leg_count, m.uplift_time, m.overturn_time, m.transversality = 0, math.inf, math.inf, math.inf


@compiled
def reset_angles(m):
    """Count the largest angles of a motion from its state on."""
    for k in range(6):
        m.extremes[k], m.extreme_legs[k], m.extreme_times[k] = angle_of(m.y[TILT], m.y[SWING], k), -1, 0.0


@compiled
def update_angle(m, k, angle, tau):
    """Take account of angle k at the end of the leg that is recorded next."""
    # The first leg of several with the same angle counts: a block that rests adds none.
    if angle > m.extremes[k]:
        m.extremes[k], m.extreme_legs[k], m.extreme_times[k] = angle, m.leg_count, tau


@compiled
def update_angles(m, phi, psi, tau):
    """Take account of all angles there."""
    for k in range(3):
        angle = phi if k == TILT else (psi if k == SWING else psi - phi)
        # To the other side it is below zero, where there is no largest angle.
        update_angle(m, 2 * k if angle >= 0.0 else 2 * k + 1, abs(angle), tau)


@compiled
def larger_side(m, k):
    """Place of the larger of both sides of angle k: TILT, SWING or APART."""
    return 2 * k if m.extremes[2 * k] >= m.extremes[2 * k + 1] else 2 * k + 1


@compiled
def largest(m, k):
    """Largest size of angle k."""
    return m.extremes[larger_side(m, k)]


@compiled
def record_leg(m, legs, piece, start, duration, event, y):
    """Write down a leg that began in the state `y`, where there is room for it."""
    n = m.leg_count
    if n < len(legs):
        leg = legs[n]
        leg.kind, leg.tilt, leg.direction, leg.piece = m.kind, m.tilt, m.direction, piece
        leg.start, leg.duration, leg.event, leg.ends_at_rest = start, duration, event, NO
        for i in range(4):
            leg.y[i] = y[i]
    m.leg_count = n + 1


@compiled
def pass_event(q, m, legs, event, capture, usual_rate, now, eta, tau):
    """Take a motion, whose last leg is recorded, past an event of the block at the time `tau`; `now` is the
    state with its accelerations, and `usual` the usual rate of the motion."""
    # Whether the block rests is known after the event only.
    y, before, n = m.y, m.kind, m.leg_count - 1
    rests = handle_event(q, event, capture, eta, y, m)
    if rests and n < len(legs):
        legs[n].ends_at_rest = rests
    if before == SLIP and event == SECOND:
        m.impacts += 1
    if before == REST and m.uplift_time == math.inf:
        m.uplift_time = tau
    m.transversality = min(m.transversality, transversality(q, usual_rate, event, before, m.kind, now, eta))
    if y[SWING_RATE] * now[SWING_RATE] < 0.0:
        m.bob_direction = -m.bob_direction
    m.hold_level = 1.0 if m.hold_level > 0.0 or m.kind != SLIP else 0.0


@compiled
def is_at_end(m, legs, i, s, end):
    """Whether what is left of piece i after its local time `s` is rounding. If so, record it as a leg."""
    if end - s > _ROUNDING * end:
        return False
    # With the event earlier or later, the motion is a little further or not as far at the end: the
    # derivatives need a last leg, though it has no length.
    record_leg(m, legs, i, s, 0.0, END, m.y)
    return True


@compiled
def is_finite(y):
    """Whether a state has only finite numbers."""
    return math.isfinite(y[TILT] + y[SWING] + y[TILT_RATE] + y[SWING_RATE])
