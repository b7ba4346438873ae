"""Exact simulation of a run of the linear equations (25) from event to event.

A run passes through the pieces of its forcing (`tpd.compiled.arcs.Forcing`): forcing periods of a harmonic,
or cubics in time. Between two events the motion is an arc in closed form. `tpd.compiled.events` proves where
an arc has no event. Pieces of a record that are proved to have no event are taken in one step
(`tpd.compiled.whole_pieces`).
"""

from __future__ import annotations

import math
from collections import namedtuple

from tpd.compiled.arcs import (
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
from tpd.compiled.columns import (
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
from tpd.compiled.contact_kernel import beyond_return, decide, sign
from tpd.compiled.events import (
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
from tpd.compiled.march import march
from tpd.compiled.motion import (
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
from tpd.compiled.plant import compiled, plant
from tpd.compiled.whole_pieces import store_maps, whole_pieces

ARRIVED, BEYOND, EXHAUSTED = range(3)
"""Outcomes of a part of a run: it arrived at its end; the tilt is beyond return; or the bound on events was
reached."""
Rules = namedtuple("Rules", "capture bob relative brief")
"""Options of a simulation: `capture`, the largest speed |phi'| of an impact that may end in rest; `bob`,
whether turning points of the bob are events; `relative`, whether turning points of psi - phi are events;
`brief`, whether free motion may end as soon as it cannot tilt the block further."""
_REACH = 8.0
"""Longest arc under a cubic forcing, divided by the shortest time scale of the motion."""
_FOREVER = 1e6
"""Duration (tau) of the last arc, in which the block either meets an event or overturns."""
_SLACK = 4e-15
"""Relative excess over the holding moment at which a held block is released.

Smaller differences are rounding errors. Records often balance a block to the last digit. Without this
tolerance the block would be released and held again many times.
"""
_LOSSLESS = 1.0 - 1e-4
"""Velocity ratio above which a rattle has so many impacts that it may reach the bound on events."""
_LAST = 10
"""Factor on the bound on events in the last attempt."""
_COARSER, _QUICKEST = 20.0, 1e-4
"""Factor on the capture speed from one attempt to the next, and the largest capture speed divided by nu."""
_STILL = 1e-12
"""Rate |psi'| of the bob below which the sign of psi' is evaluated a short time later."""


@compiled
def allow_events(m, w, events):
    """Set the number of events that a motion may still have."""
    # The event search may also examine a limited number of windows, so that a proof that never succeeds ends
    # as well.
    m.events, w.budget = events, WINDOWS * events


@compiled
def forcing_now(q, f, s):
    """Return eta at the local time `s` of the first piece."""
    eta, _ = forcing_at(load_at(q, f, FIRST_PIECE, s), 0.0)
    return eta


@compiled
def start_angles(q, f, m, i, s):
    """Start to record the largest angles of a motion, from the local time `s` of piece i on.

    This also sets `m.hold_level` (2 for a held block, 0 otherwise) and `m.bob_direction`, see
    `motion.MOTION`.
    """
    y = m.y
    reset_angles(m)
    m.hold_level, rate = (2.0 if m.kind != SLIP else 0.0), y[SWING_RATE]
    if abs(rate) <= _STILL and f.harmonic:
        # In a start from rest psi' and psi'' are zero. Evaluate the sign of psi' a short time later.
        ahead = 1e-3 / q.xi
        arc = arc_from(q, m, y, load_at(q, f, i, s))
        rate = value_of(rate_of(arc, arc.bob), instant(arc, ahead), ahead)
    m.bob_direction = -1.0 if rate < 0.0 else 1.0


@compiled
def _watch(q, m, w, arc, e, rules):
    """Prepare all signals of an arc in the workspace."""
    w.has_second, w.count = watch_block(q, arc, m, forcing_signal(e), w), BOB
    if rules.bob:
        # Under a cubic forcing a signal is exact at its start, so its first nonzero coefficient gives the
        # sign of psi'.
        side = m.bob_direction if e.xi != 0.0 else side_of(rate_of(arc, arc.bob))
        watch_turns(w, BOB, side, arc.bob, arc)
        w.count = RELATIVE
        # Under a held block psi and psi - phi turn at the same time, so that one signal is enough.
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
    """Whether the energy of a freely moving block is too small for a larger tilt than before.

    The energy of block and bob

        [m11 phi'^2 + 2 m12 phi' psi' + mu lam m22 psi'^2]/2 + weight |phi| - up phi^2/2 + mu lam psi^2/2

    never grows without a forcing.
    """
    y, share = m.y, q.mu * q.lam
    tilting, swinging = y[TILT_RATE], y[SWING_RATE]
    moving = q.m11 * tilting * tilting + 2.0 * q.m12 * tilting * swinging
    moving += share * q.m22 * swinging * swinging
    level = q.weight - q.up * abs(y[TILT])
    # Difference to the energy of the unstable equilibrium, times 2 up. The weight cancels where phi is small.
    margin = level * level - q.up * (moving + share * y[SWING] * y[SWING])
    if level <= 0.0 or margin <= 0.0:
        return False
    # The largest tilt that the energy allows is the smaller root of a quadratic equation.
    return (q.weight - math.sqrt(margin)) / q.up <= largest(m, TILT) * (1.0 + 1e-12)


@compiled
def _decays(q, m, y, bob):
    """Whether the free motion of the bob can neither lift a resting block nor reach its largest angle again.

    The energy psi^2 + psi'^2/q of the bob never grows. The angle counts only if `bob` is set.
    """
    # This amplitude bounds psi and psi'/sqrt(q) at all later times, whatever their phase.
    max_angle = math.sqrt(y[SWING] * y[SWING] + y[SWING_RATE] * y[SWING_RATE] / q.held_q)
    pull = abs(q.up - 1.0) * max_angle + abs(q.bias) * max_angle * math.sqrt(q.held_q)
    return pull < q.k + q.weight and (not bob or max_angle < min(largest(m, SWING), largest(m, APART)))


@compiled
def _longest_window(q, f):
    """Return the longest window of the event search (tau)."""
    quickest = max(q.s1, math.sqrt(q.q))
    return LONGEST / (max(q.xi, quickest) if f.harmonic else quickest)


@compiled
def follow_piece(q, f, m, legs, w, i, s, end, rules):
    """Follow a motion through piece i from its local time `s` to `end`, event by event.

    This updates the state, the mode and the counters of `m`, and records its legs. Returns one of `ARRIVED`,
    `BEYOND` and `EXHAUSTED`.
    """
    y, start, allowed = m.y, w.start, m.events
    origin, is_free_motion = i * span_of(q, f), not f.harmonic and i >= f.pieces
    # Set the bounds of the event search for this piece.
    w.limit, w.longest = beyond_return(q), _longest_window(q, f)
    w.window = w.longest
    if f.harmonic:
        w.shortest, usual, reach = SMALL * end, q.xi, math.inf
    else:
        w.shortest = SMALL
        # The time scale of the block is 1 in tau. The Taylor polynomial of an arc grows with the third power
        # of time, and so does its rounding error. Arcs under a cubic are therefore restarted before they get
        # long.
        quickest = max(max(q.p, q.held_p), math.sqrt(max(q.q, q.held_q)))
        usual, reach = 1.0, _REACH / max(max(q.s1, -q.s2), quickest)
        if m.kind != SLIP:
            # The base acceleration may jump at the start of a piece, and the jump may release the block.
            decide(q, y, m.tilt if m.kind == STICK else 0.0, 0.0, load_at(q, f, i, s).e0, m)
            if m.kind == SLIP and m.uplift_time == math.inf:
                m.uplift_time = origin + s
    while m.events > 0 and w.budget > 0:
        if f.harmonic:
            # Under a harmonic the march handles most arcs. It returns where one of its proofs fails, and the
            # careful search below follows that arc.
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
            # Before the first event of a piece no signal has been zero. An event that rounding has moved from
            # the end of the last piece into this one is due now.
            w.first_zero = BOB
        copy_to(y, start)
        # An arc that would be too long is cut, and restarted from its state.
        whole = end - s <= reach
        remaining = end - s if whole else reach
        at, leg_start, here = 0.0, 0.0, beginning(arc)
        while True:
            if is_free_motion and m.kind == REST and _decays(q, m, start, rules.bob):
                # The bob would turn at ever smaller angles until the numbers underflow. None of these turns
                # matters.
                event, at = END, remaining
            else:
                event, at = next_event(arc, w, here, at, remaining)
            here = instant(arc, at)
            now = state_at(arc, here, at)
            # The hops of a rattle get shorter one after the other, and so do the first windows of the search.
            w.window = min(w.longest, 4.0 * (at - leg_start) + w.shortest)
            if event < BOB:
                break
            # A turning point of the bob changes nothing for the block: the same arc continues.
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
        # The angles of a block that overturns are not results.
        if event != OVERTURN:
            update_angles(m, y[TILT], y[SWING], tau)
        record_leg(m, legs, i, s + leg_start, at - leg_start, event if event != END or whole else CUT, start)
        if event == OVERTURN:
            m.overturn_time = tau
            return BEYOND
        # The arc has ended without an event: the piece is complete, or the arc was cut.
        if event == END:
            if whole:
                return ARRIVED if w.budget > 0 else EXHAUSTED
            s += at
            m.events += 1
            continue
        eta, _ = forcing_at(e, at)
        pass_event(q, m, legs, event, rules.capture, usual, now, eta, tau)
        s += at
        # Only a free motion may end early, because a forcing supplies energy.
        if is_free_motion and rules.brief and _cannot_tilt_further(q, m):
            return ARRIVED
        if is_at_end(m, legs, i, s, end):
            return ARRIVED
    return EXHAUSTED


@compiled
def _overturns(q, f, m, legs, w, free):
    """Whether the last arc of a run leads beyond return without another event.

    The arc follows a free motion of duration `free`.

    If so, this records the arc as a leg and sets the time of overturning.
    """
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
    """Follow a motion through all pieces once, see `follow_ground_motion`. Return the status."""
    y, i = m.y, FIRST_PIECE
    store_maps(q, w)
    reset_counts(m)
    # The end of each piece counts as an event in the search, but it is not an event of the block.
    allow_events(m, w, f.pieces + 1 + events)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, 0.0), m)
    start_angles(q, f, m, i, 0.0)
    # A block that does not start at rest on its base counts as lifted from the start.
    if m.kind == SLIP or y[TILT] != 0.0:
        m.uplift_time = 0.0
    ended = ARRIVED
    while i < f.pieces and ended == ARRIVED:
        # First take as many pieces as are proved to have no event, then one piece by the event search.
        i = whole_pieces(q, f, m, legs, w, i, rules.bob)
        if i < f.pieces:
            ended = follow_piece(q, f, m, legs, w, i, 0.0, q.xi, rules)
            i += 1
    # Such a motion cannot overturn the block either, so that the search for overturning is not needed.
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
    """Follow a motion through all pieces of a pulse or a record, then freely, and return its status.

    The free motion lasts for the time in the settings `s`. The last arc is followed until the next event, or
    until the tilt is beyond return. So an overturning that has begun is always detected.

    In the row `x`, f is the peak base acceleration over g, and the duration of a piece replaces the
    frequency. If the settings are `brief`, only tilt, uplift and overturning are valid: turning points of the
    bob are not computed, and the free motion ends as soon as it cannot tilt the block further.
    """
    plant(x, q)
    q.slack = _SLACK * (q.k + q.weight)
    # Keep the initial state: the run may have to be repeated.
    y0, y1, y2, y3 = m.y[TILT], m.y[SWING], m.y[TILT_RATE], m.y[SWING_RATE]
    brief, max_events = s.brief != 0.0, int(s.events)
    quick, bound, bob = s.rest_rate, max_events, q.mu > 0.0 and not brief
    while True:
        status = _follow_once(q, f, m, legs, w, s.free, bound, Rules(quick * q.nu, bob, bob, brief))
        # Hops without energy loss never end. If there are too many of them, the run is repeated with a larger
        # capture speed. This changes the tilt by about the square of that speed. The last attempt gets a
        # larger bound on events.
        if status != EVENT_BOUND or q.e < _LOSSLESS or quick * _COARSER > _QUICKEST:
            return status
        quick *= _COARSER
        bound = max_events if quick * _COARSER <= _QUICKEST else _LAST * max_events
        m.y[TILT], m.y[SWING], m.y[TILT_RATE], m.y[SWING_RATE] = y0, y1, y2, y3


@compiled
def store_results(m, status, out):
    """Write the results of a run under a ground motion into the record `out` (`tpd.compiled.columns.RUN`)."""
    out.tilt, out.swing, out.rod_angle = largest(m, TILT), largest(m, SWING), largest(m, APART)
    if status == OVERTURNED:
        out.tilt = out.swing = out.rod_angle = math.inf
    # The run has no steady state. Its largest angles take the place of the settled ones.
    out.settled_tilt, out.settled_swing, out.settled_rod_angle = out.tilt, out.swing, out.rod_angle
    for k in range(3):
        # Of the two sides of each angle only the larger one is a result.
        out.times[k] = m.peak_times[larger_side(m, k)]
    copy_to(m.y, out.state)
    out.status, out.periods, out.elapsed, out.growing = status, 1.0, 0.0, 0.0
    out.impacts, out.uplift_time, out.overturning_time = m.impacts, m.uplift_time, m.overturn_time
    out.transversality = m.transversality
    out.state[TILT_PULL] = out.state[SWING_PULL] = 0.0
