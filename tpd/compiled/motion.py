"""The record of a motion during its simulation: its state, its counters and its legs.

A leg is a part of an arc that ends at an event, at the end of the simulation, or where the bob turns.
Derivatives, states at requested times and orbits are computed from legs alone (`tpd.compiled.legs`).
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled.columns import REST, SLIP, SWING, SWING_RATE, TILT, TILT_RATE
from tpd.compiled.contact_kernel import handle_event, transversality
from tpd.compiled.events import END, SECOND, SIGNALS
from tpd.compiled.plant import compiled

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
"""A leg: `kind`, `tilt` and `direction` of its mode; the index of its `piece`, the local time of its `start`
in the piece, and its `duration` (the number of pieces if the leg consists of whole pieces); the `event` at
its end, and whether the block came to rest there (`ends_at_rest`); the state `y` at its start."""
_ROUNDING = 1e-15
"""Share of a piece below which the remaining time is a rounding error."""
WHOLE = np.int64(4)
"""Event number at the end of a leg that consists of whole pieces without an event."""
MOTION = np.dtype(
    [
        ("y", np.float64, (4,)),
        *((name, np.float64) for name in ("kind", "tilt", "direction", "hold_level")),
        *((name, np.float64, (6,)) for name in ("peaks", "peak_times")),
        ("peak_legs", np.int64, (6,)),
        *((name, np.int64) for name in ("impacts", "n_legs", "events")),
        *((name, np.float64) for name in ("uplift_time", "overturn_time", "transversality", "bob_direction")),
    ],
    align=True,
)
"""A motion: its state `y`; the `kind` of its mode and the signs `tilt` of phi and `direction` of phi'; and
counters.

`hold_level` says for how long the block was held since the largest angles are recorded: 0 never, 1 part of
the time, 2 all the time. `peaks` are the largest phi, psi and psi - phi to either side, `peak_times` their
times, and `peak_legs` the legs at whose ends they occurred (-1 is the start). `impacts` and `n_legs` count
impacts and legs, and `events` is the number of events that are still allowed. `uplift_time` and
`overturn_time` are the times of the first uplift and of overturning, `transversality` is the smallest one of
all events, and `bob_direction` is the sign of psi'.
"""
GRID, TERMS, MOST, HOPS = map(np.int64, (32, 8, 11, 6))
"""Sizes in `tpd.compiled.march`: the number of points into which its longest step is divided (GRID); the
usual number of terms of its Taylor polynomials (TERMS) and the largest (MOST); the number of hops from which
the end of a rattle is extrapolated (HOPS)."""
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
"""Workspace of `tpd.compiled.march`.

- `flow`: table of the flow over GRID points: both exponentials, the two solutions of the oscillating pair for
  the slipping and for the held block, sine and cosine of the forcing's phase.
- `series`: Taylor polynomials of the tilt, of the swing, and of a signal.
- `tilt`, `swing`: the accelerations of both angles as factors of the tilt from its centre, the swing, phi' -
  psi' and the forcing.
- `orders`: factors of the parts of an angle in the bounds on its fourth and fifth derivatives.
- `scale`, `over_w`: K and 1/w of the pair, for the slipping and for the held block, see `tpd.compiled.march`.
- `hops`, `hop_count`, `limit`: the last hops from either side, their number, and the state to which they
  lead.
- `sure_time`: time for which the accelerations are sure to keep their signs, for each half of a hop.
- `terms`: number of terms of the Taylor polynomials.
- `step`, `jump`: the longest step, and the number of grid points of the next step.
- `sine`, `cosine`, `share`, `growth`: phase, size and growth of the forcing.
- `weight`, `quickest`: the weight of rates, and k, in the bounds of short flights.
"""
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
"""Workspace of the kernels of the exact model.

- `start`, `end`: states at the start and at the end of a leg.
- `signals`: for `tpd.compiled.events`, the signals of an arc, one in each row, and a last row for the search
  itself.
- `count`, `has_second`: number of signals, and whether the second signal of the block is watched.
- `budget`: number of windows that the search may still examine.
- `first_zero`: index of the first signal that the last event may have set to zero.
- `shortest`, `longest`, `window`: the shortest, the longest and the first window of the search (tau).
- `limit`: tilt beyond which the block does not return (rad).
- `maps`, `bounds`: for `tpd.compiled.whole_pieces`, the maps of whole pieces and bounds on derivatives.
- `trial`: another motion, for attempts that may be dropped.
- `march`: the workspace of `tpd.compiled.march`.
"""
LEGS = 256
"""Number of legs for which memory is allocated at first."""
NO, YES, FIRST_PIECE = np.bool_(False), np.bool_(True), np.int64(0)
"""NumPy scalars for constants. Numba treats a plain Python constant as a type of its own and would compile a
function once more for each of them."""


@compiled
def copy_to(source, target):
    """Copy the numbers of `source` to `target`."""
    # A slice would do the same, but its error messages take Numba a second to compile.
    for i in range(len(source)):
        target[i] = source[i]


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
    """Start to record the largest angles from the present state on."""
    for k in range(6):
        m.peaks[k], m.peak_legs[k], m.peak_times[k] = angle_of(m.y[TILT], m.y[SWING], k), -1, 0.0


@compiled
def update_angle(m, k, angle, tau):
    """Update the largest angle k with an angle at the end of the leg that is recorded next."""
    # Only a larger angle replaces the old one, so that the first leg counts. A block at rest adds none.
    if angle > m.peaks[k]:
        m.peaks[k], m.peak_legs[k], m.peak_times[k] = angle, m.n_legs, tau


@compiled
def update_angles(m, phi, psi, tau):
    """Update the largest angles with phi and psi at the time `tau`."""
    for k in range(3):
        angle = phi if k == TILT else (psi if k == SWING else psi - phi)
        # Only the side of the angle is updated: on the other side the angle is negative.
        update_angle(m, 2 * k if angle >= 0.0 else 2 * k + 1, abs(angle), tau)


@compiled
def larger_side(m, k):
    """Return the index of the larger of both sides of angle k, which is TILT, SWING or APART."""
    return 2 * k if m.peaks[2 * k] >= m.peaks[2 * k + 1] else 2 * k + 1


@compiled
def largest(m, k):
    """Return the largest absolute value of angle k, which is TILT, SWING or APART."""
    return m.peaks[larger_side(m, k)]


@compiled
def record_leg(m, legs, piece, start, duration, event, y):
    """Record a leg that started in the state `y`, if there is memory for it.

    Legs without memory are only counted.
    """
    n = m.n_legs
    if n < len(legs):
        leg = legs[n]
        leg.kind, leg.tilt, leg.direction, leg.piece = m.kind, m.tilt, m.direction, piece
        leg.start, leg.duration, leg.event, leg.ends_at_rest = start, duration, event, NO
        copy_to(y, leg.y)
    m.n_legs = n + 1


@compiled
def pass_event(q, m, legs, event, capture, usual_rate, now, eta, tau):
    """Take a motion past an event of the block at the time `tau`. Its last leg is recorded already.

    `now` is the state at the event with its accelerations, and `usual_rate` the usual rate of the motion.
    """
    # Only after the event is it clear whether the block rests, so that the last leg is completed here.
    y, before, n = m.y, m.kind, m.n_legs - 1
    rests = handle_event(q, event, capture, eta, y, m)
    if rests and n < len(legs):
        legs[n].ends_at_rest = rests
    # The second signal of a slipping block is its tilt: this event is an impact.
    if before == SLIP and event == SECOND:
        m.impacts += 1
    if before == REST and m.uplift_time == math.inf:
        m.uplift_time = tau
    m.transversality = min(m.transversality, transversality(q, usual_rate, event, before, m.kind, now, eta))
    # An impact may reverse the bob.
    if y[SWING_RATE] * now[SWING_RATE] < 0.0:
        m.bob_direction = -m.bob_direction
    m.hold_level = 1.0 if m.hold_level > 0.0 or m.kind != SLIP else 0.0


@compiled
def is_at_end(m, legs, i, s, end):
    """Whether the rest of piece i after its local time `s` is only a rounding error.

    If so, record it as a leg.
    """
    if end - s > _ROUNDING * end:
        return False
    # If parameters move the event, the motion moves at the end of the piece as well. The derivatives need
    # this last leg, though its length is zero.
    record_leg(m, legs, i, s, 0.0, END, m.y)
    return True


@compiled
def is_finite(y):
    """Whether all numbers of a state are finite."""
    return math.isfinite(y[TILT] + y[SWING] + y[TILT_RATE] + y[SWING_RATE])
