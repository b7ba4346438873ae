"""The follower: a motion of the linear equations (25) from event to event, exact and with no event missed.

A motion goes through the pieces of its forcing (`tpd.exact.arcs.Forcing`): forcing periods of a harmonic, or
cubics in time. Between two events it is an arc in closed form. `tpd.exact.events` proves where an arc has no
event; pieces of a record that are proved to have none are taken in one step.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact.arcs import (
    Signal,
    arc_from,
    beginning,
    forcing_at,
    forcing_signal,
    instant,
    load_at,
    rate_of,
    span_of,
    state_at,
    value_of,
)
from tpd.exact.contact_kernel import beyond_return, decide, sign
from tpd.exact.events import (
    BOB,
    CUT,
    END,
    LONGEST,
    OVERTURN,
    RELATIVE,
    SMALL,
    WINDOWS,
    next_event,
    side_of,
    turn_over,
    watch_block,
    watch_turns,
)
from tpd.exact.march import march
from tpd.exact.motion import (
    FIRST_PIECE,
    copy_to,
    is_at_end,
    is_finite,
    larger_side,
    largest,
    pass_event,
    record_leg,
    reset_angles,
    reset_counts,
    update_angles,
)
from tpd.exact.plant import compiled, plant
from tpd.exact.terms import (
    APART,
    EVENT_BOUND,
    FAILED,
    OVERTURNED,
    REST,
    ROCKED,
    SLIP,
    STICK,
    STOOD,
    SWING,
    SWING_PULL,
    SWING_RATE,
    TILT,
    TILT_PULL,
    TILT_RATE,
)
from tpd.exact.whole_pieces import store_maps, whole_pieces

ARRIVED, BEYOND, EXHAUSTED = range(3)
"""Ends of a part of a motion."""
_COUNTED = "growing", "status", "impacts", "uplift_time", "overturn_time", "transversality", "legs"
FOLLOWED = np.dtype(
    [
        *((name, np.float64, (3,)) for name in ("sizes", "times")),
        ("state", np.float64, (6,)),
        *((name, np.float64) for name in _COUNTED),
    ]
)
"""A motion through all pieces: largest |phi|, |psi| and |psi - phi|, and their times; the state at the end
with its accelerations; the growing coordinate of the last leg (with derivatives only); status; impacts; times
of the first uplift and of the overturning; transversality; and legs."""
Rules = namedtuple("Rules", "capture bob relative brief")
"""Largest speed phi' of an impact that may end in rest; whether turns of the bob count, and its turns against
the block; and whether a free motion may end as soon as it cannot tilt the block further."""
_REACH = 8.0
"""Longest arc under a cubic, over the quickest time scale of the motion."""
_FOREVER = 1e6
_SLACK = 4e-15
"""Share of what holds a block by which the moment on it must exceed that: less is rounding, and records often
balance a block to the last digit, so that it would be let go and held again and again."""
_LOSSLESS = 1.0 - 1e-4
"""Velocity ratio from which on a rattle takes so many impacts that it may exhaust the bound on events."""
_LAST = 10
"""Times the bound on events that the last try may take."""
_COARSER, _QUICKEST = 20.0, 1e-4
"""Factor of the speed that counts as rest from one try to the next, and its largest value over nu."""
_STILL = 1e-12
"""Rate of the bob below which the sign of its way is found a little ahead."""


@compiled
def allow_events(m, w, events):
    """Allow a motion so many events."""
    m.events, w.budget = events, WINDOWS * events


@compiled
def forcing_now(q, f, s):
    """eta at the local time `s` of the first piece."""
    return forcing_at(load_at(q, f, FIRST_PIECE, s), 0.0)[0]


@compiled
def start_angles(q, f, m, i, s):
    """Count the largest angles of a motion from the local time `s` of piece i on; see `Mode` for `held`."""
    y = m.y
    reset_angles(m)
    m.hold_level, rate = (2.0 if m.kind != SLIP else 0.0), y[SWING_RATE]
    if abs(rate) <= _STILL and f.harmonic:
        # From rest the bob's first and second derivatives vanish: look a little ahead instead.
        ahead = 1e-3 / q.xi
        arc = arc_from(q, m, y, load_at(q, f, i, s))
        rate = value_of(rate_of(arc, arc.bob), instant(arc, ahead), ahead)
    m.bob_direction = -1.0 if rate < 0.0 else 1.0


@compiled
def _watch(q, m, w, arc, e, rules):
    """Prepare all signals of an arc for the room."""
    w.has_second, w.count = watch_block(q, arc, m, forcing_signal(e), w), BOB
    if rules.bob:
        # Under a cubic a signal is exact at its start: the bob goes where the arc takes it.
        side = m.bob_direction if e.xi != 0.0 else side_of(rate_of(arc, arc.bob))
        watch_turns(w, BOB, side, arc.bob, arc)
        w.count = RELATIVE
        # Under a held block both angles of the bob turn at once.
        if rules.relative and m.kind == SLIP:
            a, b = arc.bob, arc.tilt
            free = a.on_s1 - b.on_s1, a.on_s2 - b.on_s2, a.on_u - b.on_u, a.on_v - b.on_v
            forced = a.along - b.along, a.across - b.across
            gains = a.gain_along - b.gain_along, a.gain_across - b.gain_across
            relative = Signal(a.constant - b.constant, *free, *forced, *gains)
            watch_turns(w, RELATIVE, side_of(rate_of(arc, relative)), relative, arc)
            w.count = RELATIVE + 1


@compiled
def _cannot_tilt_further(q, m):
    """Whether a block that moves freely has too little energy to tilt further than it has. The energy

        [m11 phi'^2 + 2 m12 phi' psi' + mu lam m22 psi'^2]/2 + weight |phi| - up phi^2/2 + mu lam psi^2/2

    of block and bob never grows without a forcing."""
    y, share = m.y, q.mu * q.lam
    tilting, swinging = y[TILT_RATE], y[SWING_RATE]
    moving = q.m11 * tilting * tilting + 2.0 * q.m12 * tilting * swinging
    moving += share * q.m22 * swinging * swinging
    level = q.weight - q.up * abs(y[TILT])
    # Distance from the energy of the unstable equilibrium, times 2 up; the weight cancels where phi is small.
    margin = level * level - q.up * (moving + share * y[SWING] * y[SWING])
    if level <= 0.0 or margin <= 0.0:
        return False
    return (q.weight - math.sqrt(margin)) / q.up <= largest(m, TILT) * (1.0 + 1e-12)


@compiled
def _decays(q, m, y, bob):
    """Whether the bob of a resting block, left to itself, neither lifts it nor, if its turns count, swings as
    far as before: the energy psi^2 + psi'^2/q never grows."""
    # Angle and rate are bounded at once, whatever their phase.
    max_angle = math.sqrt(y[SWING] * y[SWING] + y[SWING_RATE] * y[SWING_RATE] / q.held_q)
    pull = abs(q.up - 1.0) * max_angle + abs(q.bias) * max_angle * math.sqrt(q.held_q)
    return pull < q.k + q.weight and (not bob or max_angle < min(largest(m, SWING), largest(m, APART)))


@compiled
def _longest_window(q, f):
    """Longest window of a room."""
    quickest = max(q.s1, math.sqrt(q.q))
    return LONGEST / (max(q.xi, quickest) if f.harmonic else quickest)


@compiled
def follow_piece(q, f, m, legs, w, i, s, end, rules):
    """Follow a motion through piece i from its local time `s` to `end`, event by event; change state, mode
    and tally, and record the legs. Return how it ended."""
    y, start, allowed = m.y, w.start, m.events
    origin, is_free_motion = i * span_of(q, f), not f.harmonic and i >= f.pieces
    w.limit, w.longest = beyond_return(q), _longest_window(q, f)
    w.window = w.longest
    if f.harmonic:
        w.shortest, usual, reach = SMALL * end, q.xi, math.inf
    else:
        w.shortest = SMALL
        # The block's own time scale is 1 in tau. The Taylor polynomial of an arc grows with the third power
        # of time, and its rounding with it.
        slowest = max(max(q.p, q.held_p), math.sqrt(max(q.q, q.held_q)))
        usual, reach = 1.0, _REACH / max(max(q.s1, -q.s2), slowest)
        if m.kind != SLIP:
            # The base acceleration may jump where a piece begins.
            decide(q, y, m.tilt if m.kind == STICK else 0.0, 0.0, load_at(q, f, i, s).e0, m)
            if m.kind == SLIP and m.uplift_time == math.inf:
                m.uplift_time = origin + s
    while m.events > 0 and w.budget > 0:
        if f.harmonic:
            arrived, s = march(q, f, m, legs, w, i, s, end, rules.capture)
            if arrived:
                return ARRIVED
            if m.events <= 0:
                break
        m.events -= 1
        e = load_at(q, f, i, s)
        arc = arc_from(q, m, y, e)
        _watch(q, m, w, arc, e, rules)
        if m.events == allowed - 1:
            # The block has met no event yet: one that rounding has put beyond the last piece is due.
            w.first_zero = BOB
        for j in range(4):
            start[j] = y[j]
        whole = end - s <= reach
        remaining = end - s if whole else reach
        at, leg_start, here = 0.0, 0.0, beginning(arc)
        while True:
            if is_free_motion and m.kind == REST and _decays(q, m, start, rules.bob):
                # Damping that dies out needs no look at every turn down to the smallest number.
                event, at = END, remaining
            else:
                event, at = next_event(arc, w, here, at, remaining)
            here = instant(arc, at)
            now = state_at(arc, here, at)
            # Hops get shorter one after the other.
            w.window = min(w.longest, 4.0 * (at - leg_start) + w.shortest)
            if event < BOB:
                break
            # The bob turns, which changes nothing: the same arc goes on.
            update_angles(m, now[TILT], now[SWING], origin + s + at)
            record_leg(m, legs, i, s + leg_start, at - leg_start, event, start)
            if event == BOB:
                m.bob_direction = -m.bob_direction
            turn_over(w, event)
            leg_start = at
            for j in range(4):
                start[j] = now[j]
        for j in range(4):
            y[j] = now[j]
        tau = origin + s + at
        if event != OVERTURN:
            update_angles(m, y[TILT], y[SWING], tau)
        record_leg(m, legs, i, s + leg_start, at - leg_start, event if event != END or whole else CUT, start)
        if event == OVERTURN:
            m.overturn_time = tau
            return BEYOND
        if event == END:
            if whole:
                return ARRIVED if w.budget > 0 else EXHAUSTED
            s += at
            m.events += 1
            continue
        pass_event(q, m, legs, event, rules.capture, usual, now, forcing_at(e, at)[0], tau)
        s += at
        # Only a free motion may end early: a forcing brings energy.
        if is_free_motion and rules.brief and _cannot_tilt_further(q, m):
            return ARRIVED
        if is_at_end(m, legs, i, s, end):
            return ARRIVED
    return EXHAUSTED


@compiled
def _overturns(q, f, m, legs, w, free):
    """Whether the arc on which a motion ends, after the time `free`, leads beyond return without another
    event; record it if so."""
    y = m.y
    if m.kind != SLIP:
        return False
    e = load_at(q, f, f.pieces, 0.0)
    arc = arc_from(q, m, y, e)
    w.has_second, w.count = watch_block(q, arc, m, forcing_signal(e), w), BOB
    w.shortest, w.longest, w.limit, w.budget = SMALL, _longest_window(q, f), beyond_return(q), 64 * WINDOWS
    w.window = w.longest
    event, at = next_event(arc, w, beginning(arc), 0.0, _FOREVER)
    if event == OVERTURN:
        m.overturn_time = f.pieces * q.xi + free + at
        record_leg(m, legs, f.pieces, free, at, event, y)
    return event == OVERTURN


@compiled
def _follow_once(q, f, m, legs, w, free, events, rules):
    """Follow a motion as `through` does, once."""
    y, i = m.y, FIRST_PIECE
    store_maps(q, w)
    reset_counts(m)
    # One event for each piece is none of the block's: its end.
    allow_events(m, w, f.pieces + 1 + events)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, 0.0), m)
    start_angles(q, f, m, i, 0.0)
    if m.kind == SLIP or y[TILT] != 0.0:
        m.uplift_time = 0.0
    ended = ARRIVED
    while i < f.pieces and ended == ARRIVED:
        i = whole_pieces(q, f, m, legs, w, i, rules.bob)
        if i < f.pieces:
            ended = follow_piece(q, f, m, legs, w, i, 0.0, q.xi, rules)
            i += 1
    # A motion that cannot tilt the block further overturns it neither.
    quiet = rules.brief and _cannot_tilt_further(q, m)
    if ended == ARRIVED and free > 0.0 and not quiet:
        ended = follow_piece(q, f, m, legs, w, f.pieces, 0.0, free, rules)
    if ended == ARRIVED and not quiet and _overturns(q, f, m, legs, w, free):
        ended = BEYOND
    if not is_finite(y):
        return FAILED
    if ended != ARRIVED:
        return OVERTURNED if ended == BEYOND else EVENT_BOUND
    return STOOD if m.uplift_time == math.inf else ROCKED


@compiled
def follow_ground_motion(x, q, f, m, legs, w, s):
    """Follow a motion through all pieces of a pulse or a record, freely for the time that the settings `s`
    say, and along its last arc until it meets an event or is beyond return: an overturning that has begun is
    never missed.

    `x` is a row with f the size of the base acceleration over that of gravity, and the duration of a piece in
    the place of the frequency. If the settings say `brief`, only the tilt, the uplift and the overturning
    hold: turns of the bob are not looked for, and the free motion ends as soon as it cannot tilt the block
    further. Return the status."""
    plant(x, q)
    q.slack = _SLACK * (q.k + q.weight)
    y0, y1, y2, y3 = m.y[TILT], m.y[SWING], m.y[TILT_RATE], m.y[SWING_RATE]
    brief, max_events = s.brief != 0.0, int(s.events)
    quick, max_angle, bob = s.rest_rate, max_events, q.mu > 0.0 and not brief
    while True:
        status = _follow_once(q, f, m, legs, w, s.free, max_angle, Rules(quick * q.nu, bob, bob, brief))
        # Hops that lose nothing never end. Where there are too many of them, quicker ones count as rest: they
        # tilt the block by about the square of their speed. The last try has the events that it may take.
        if status != EVENT_BOUND or q.e < _LOSSLESS or quick * _COARSER > _QUICKEST:
            return status
        quick *= _COARSER
        max_angle = max_events if quick * _COARSER <= _QUICKEST else _LAST * max_events
        m.y[TILT], m.y[SWING], m.y[TILT_RATE], m.y[SWING_RATE] = y0, y1, y2, y3


@compiled
def store_results(m, status, out):
    """Put what was counted of a motion through all pieces, with its state and status, into `out`."""
    for k in range(3):
        best = larger_side(m, k)
        out.sizes[k], out.times[k] = (m.extremes[best] if status != OVERTURNED else math.inf), m.when[best]
    copy_to(m.y, out.state)
    out.growing, out.status = 0.0, status
    out.impacts, out.uplift_time, out.overturn_time = m.impacts, m.uplift_time, m.overturn_time
    out.transversality, out.legs = m.transversality, m.leg_count
    out.state[TILT_PULL] = out.state[SWING_PULL] = 0.0
