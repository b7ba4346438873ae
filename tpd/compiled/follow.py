"""Simulation of a run from event to event, for the linear equations (25) and the nonlinear equations (4).

A Taylor series carries a run until its error would be too large, or to the first event, which is a root of
the series. A run passes through the pieces of its forcing: forcing periods of a harmonic, or cubics in time.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled import series
from tpd.compiled.columns import (
    APART,
    EVENT_BOUND,
    FAILED,
    OVERTURNED,
    REST,
    ROCKED,
    SLIP,
    STOOD,
    SWING,
    SWING_PULL,
    SWING_RATE,
    TILT,
    TILT_PULL,
    TILT_RATE,
)
from tpd.compiled.contact import beyond_return, decide, land, start_mode, turn
from tpd.compiled.forcing import FIRST_PIECE, NO, YES, forcing_now, harmonic, load_at, span_of
from tpd.compiled.motion import (
    CONTINUES,
    END,
    LANDING,
    RELEASE_DOWN,
    RELEASE_UP,
    TURN,
    copy_to,
    is_finite,
    larger_side,
    largest,
    record_leg,
    reset_angles,
    reset_counts,
    set_motion,
    update_angle,
    update_angles,
)
from tpd.compiled.plant import compiled
from tpd.compiled.repetition import scales_of
from tpd.compiled.strides import follow_strides

ARRIVED, BEYOND, EXHAUSTED, NOT_FINITE = range(4)
"""Outcomes of a part of a run: it arrived at its end; the tilt is beyond return; the bound on events was
reached; or the series is not finite."""
MAX_STEPS = 20_000
"""Bound on the number of series from one event to the next."""
_LONGEST = 5.0
"""Longest leg with derivatives, in units of the shortest time scale."""
_LOWEST = np.int64(4)
"""Order of the series of a leg of zero length."""
_UNDECIDED = 64
"""Bound on the periods after the free motion of a run in which the block can overturn. A motion without
losses can rock permanently with enough energy to overturn."""
_LOSSLESS = 1.0 - 1e-4
"""Velocity ratio above which a rattle has so many impacts that it may reach the bound on events."""
_LAST = 10
"""Factor on the bound on events in the last attempt."""
_COARSER, _QUICKEST = 20.0, 1e-4
"""Factor on the capture speed from one attempt to the next, and the largest capture speed divided by nu."""


@compiled
def first_event(q, m, order, h, w):
    """Return the first event within the time h, and its time.

    Without an event, return the time until which this is proved.
    """
    if m.kind != SLIP:
        # A held block: the first of both releases counts.
        event, until = CONTINUES, h
        for side in (RELEASE_UP, RELEASE_DOWN):
            row = series.UP if side == RELEASE_UP else series.DOWN
            t, vanishes = series.positive_until(w, row, 1.0, order, q.k + q.weight, until)
            if vanishes or t < until:
                event, until = (side if vanishes else CONTINUES), t
        return event, until
    # The acceleration is a difference of moments, and less accurate than the moments that release the block.
    until, turns = series.positive_until(w, series.V, m.direction, order, 10.0 * (q.k + q.weight) * h, h)
    # Until its turning point the block moves in one direction. It has landed if its tilt has changed its sign
    # by then.
    if m.tilt != m.direction and m.tilt * series.value_at(w, series.PHI, order, until) <= 0.0:
        landing, vanishes = series.positive_until(w, series.PHI, m.tilt, order, 0.0, until)
        # If the landing almost grazes the base, the proof may end before the landing. The next series
        # continues from there.
        return (LANDING if vanishes or landing == until else CONTINUES), landing
    return (TURN if turns else CONTINUES), until


@compiled
def _pass_event(q, m, legs, event, at_once, pull, w, eta):
    """Change the state and the mode at an event. Its leg is recorded already.

    `at_once` is true if the series started with the event, and `pull` is phi'' before it.
    """
    y, crossing, n = m.y, math.inf, m.n_legs - 1
    # The derivative of an event's time has in its denominator the rate at which the motion crosses the event,
    # here divided by its usual value. Where the rate vanishes, the motion grazes the event. Impacts after
    # which the block could be held are excluded. They belong to the hops of a rattle, which occur at
    # arbitrarily small rates on every orbit that comes to rest, and do not indicate grazing.
    usual = 2.0 * math.pi / w.period
    if event == LANDING:
        m.impacts += 1
        # The rate is that before the impact, which may end in rest.
        speed = abs(y[TILT_RATE])
        rests, can_rest = land(q, y, w.capture, eta, m)
        crossing = math.inf if can_rest else speed / (usual * q.weight)
        if rests and n < len(legs):
            legs[n].rests = True
    elif event == TURN:
        turn(q, y, at_once, eta, m)
        crossing = abs(pull) / (usual * usual * q.weight)
    else:
        # The release of a held block to a side.
        m.direction = 1.0 if event == RELEASE_UP else -1.0
        m.tilt, m.kind = m.direction if m.kind == REST else m.tilt, SLIP
    if m.kind == SLIP:
        m.transversality = min(m.transversality, crossing)
    m.hold_level = 1.0 if m.hold_level > 0.0 or m.kind != SLIP else 0.0


@compiled
def _update_at_turns(m, k, w, order, h, tau):
    """Update the largest angle k where the angle turns within the time h from `tau` on.

    `k` is an index of angles in both `MOTION` and the series. Of both sides only the larger one is valid.
    """
    angle, t = series.largest_turn(w, k, order, h, m.peaks[larger_side(m, k // 2)])
    update_angle(m, k if angle > 0.0 else k + 1, abs(angle), tau, t)


@compiled
def advance(q, f, m, legs, w, i, s, end):
    """Follow a motion through piece i of its forcing from the local time `s` to `end`, event by event.

    This updates the state, the mode and the counters of `m`, and records its legs. Returns one of `ARRIVED`,
    `BEYOND`, `EXHAUSTED` and `NOT_FINITE`.
    """
    y, origin, limit = m.y, i * span_of(q, f), beyond_return(q)
    # Strides record no legs.
    strides = q.linear != 0.0 and len(legs) == 0 and f.rate == 0.0 and (f.harmonic or s == 0.0)
    # The hops of a rattle get shorter one after the other, and so do the series that follow them.
    pace, passed, steps = math.inf, s, 0
    # The series of derivatives need short legs, also where the motion itself has died out.
    longest = _LONGEST / q.quick if len(legs) > 0 else math.inf
    while steps < MAX_STEPS:
        steps += 1
        if strides and pace > w.stride:
            s = follow_strides(q, f, m, w, i, s, end, limit)
            strides = f.harmonic and w.stride > 0.0
            if s == end:
                return ARRIVED
        remaining, tau = end - s, origin + s
        if remaining <= 1e-14 * w.period:
            # If parameters move the last event, the motion moves at the end of the piece as well. The
            # derivatives need this last leg, though its length is zero.
            record_leg(m, legs, i, s, 0.0, _LOWEST, END)
            m.n_legs += 1
            return ARRIVED
        reach = min(remaining, min(pace, 1.5 * w.stride if strides else longest))
        # With a bounded reach the series has fewer orders, and finds an event that is near.
        order, h = series.expand(q, m, y, load_at(q, f, i, s), reach, w)
        # A step that is too short, or NaN, means that the series does not converge.
        if not h >= min(reach, 1e-13 * w.period):
            return NOT_FINITE
        # No step is ever repeated, because the length of a step follows from its series.
        event, h = first_event(q, m, order, h, w)
        arrives = event == CONTINUES and h == remaining
        # A leg is recorded before the state changes, and counted below: the largest angles refer to it.
        record_leg(m, legs, i, s, h, order, END if arrives else event)
        series.store_state(w, order, h, y)
        overturned = not abs(y[TILT]) < limit
        if overturned:
            # Steps end at turning points of the block, so that the tilt has increased up to the end of this
            # step. Locate the time at which it reaches the limit.
            h = series.time_at_limit(w, series.PHI, order, limit, h)
            if m.n_legs < len(legs):
                legs[m.n_legs].duration, legs[m.n_legs].event = h, CONTINUES
            series.store_state(w, order, h, y)
        # The tilt is largest at events, which are ends of steps. The bob may turn within a step.
        update_angles(m, y[TILT], y[SWING], tau, h)
        _update_at_turns(m, series.PSI, w, order, h, tau)
        if w.relative:
            _update_at_turns(m, series.APART, w, order, h, tau)
        m.n_legs += 1
        s = end if h == remaining else s + h
        if overturned:
            m.overturn_time = origin + s
            return BEYOND
        if arrives:
            return ARRIVED
        if event == CONTINUES:
            pace = max(8.0 * h, 1e-16 * w.period)
        else:
            steps = 0
            pace, passed, m.events = max(2.0 * (s - passed), 1e-8 * w.period), s, m.events - 1
            # Set the variable that vanishes at the event to exactly zero.
            y[TILT] = 0.0 if event == LANDING else y[TILT]
            y[TILT_RATE] = 0.0 if event == TURN else y[TILT_RATE]
            # The acceleration before the event shows whether the motion grazes it.
            _, pull = series.value_and_slope(w, series.V, order, h)
            _pass_event(q, m, legs, event, h == 0.0, pull, w, forcing_now(q, f, i, s))
            if m.kind == SLIP:
                m.uplift_time = min(m.uplift_time, origin + s)
            if m.events <= 0:
                return EXHAUSTED
    return EXHAUSTED


@compiled
def set_scales(q, w):
    """Set the period and the usual rates of a run under a harmonic. Return the scales of its state."""
    scales = scales_of(q)
    w.period, w.relative, w.rate, w.swing = 2.0 * math.pi / q.xi, NO, scales[TILT_RATE], scales[SWING_RATE]
    return scales


@compiled
def one_period(q, f, m, legs, w, s, ramp_end, events):
    """Follow a motion from the local time `s` to the end of the forcing period.

    Returns the outcome, see `advance`. The excitation has its full size from the local time `ramp_end` on.
    """
    reset_angles(m)
    m.events = events
    if s < ramp_end < (1.0 - 1e-12) * w.period:
        # The forcing has a kink at the end of the ramp, and no series may cross it.
        ended = advance(q, f, m, legs, w, FIRST_PIECE, s, ramp_end)
        if ended != ARRIVED:
            return ended
        f, s, m.events = harmonic(), ramp_end, events
    return advance(q, f, m, legs, w, FIRST_PIECE, s, w.period)


@compiled
def _height(q, tilt):
    """Return the potential energy of a block at the tilt |phi| with a hanging bob, over M g b.

    It is relative to that of the unstable equilibrium.
    """
    if q.linear != 0.0:
        return -0.5 * (q.weight - q.up * tilt) ** 2 / q.up
    return q.weight * math.sin(tilt) + q.up * math.cos(tilt) - math.hypot(q.weight, q.up)


@compiled
def _stays_below(q, y, tilt):
    """Whether the energy of a free motion is too small for the tilt |phi|, at most that of the unstable
    equilibrium, and for all larger ones."""
    # The bob's potential energy and the lever arm of its mass, first those of the linear equations.
    rate, swing, lever, bob = y[TILT_RATE], y[SWING_RATE], q.kappa, 0.5 * y[SWING] * y[SWING]
    unstable = q.weight / q.up
    if q.linear == 0.0:
        relative, bob, unstable = y[TILT] - y[SWING], 1.0 - math.cos(y[SWING]), math.atan2(q.weight, q.up)
        lever = math.copysign(q.nu, y[TILT]) * math.sin(relative) + q.kappa * math.cos(relative)
    # Without a forcing the energy of block and bob never grows.
    bob = q.mu * q.lam * (bob + 0.5 * q.m22 * swing * swing)
    energy = _height(q, abs(y[TILT])) + bob + rate * (0.5 * q.m11 * rate - q.pull * lever * swing)
    return energy < _height(q, min(tilt, unstable)) and abs(y[TILT]) < unstable


@compiled
def _follow_once(q, f, m, legs, w, s, events, trial):
    """Simulate a run through all pieces of a ground motion and then freely, and return its status.

    The free motion lasts for the time in the settings `s`. If the block can still overturn after it, `trial`
    continues the run until the outcome is certain.
    """
    y, i, ended, begin = m.y, FIRST_PIECE, ARRIVED, 0.0
    # There is no forcing period. The shorter time scale of bob and block defines which times are rounding
    # errors.
    w.period, w.relative = 2.0 * math.pi * min(1.0, math.sqrt(q.m22)), YES if s.brief == 0.0 else NO
    w.rate, w.swing = q.nu, (q.nu + q.f) * max(1.0, 1.0 / math.sqrt(q.m22))
    reset_counts(m)
    start_mode(q, y, forcing_now(q, f, FIRST_PIECE, 0.0), m)
    reset_angles(m)
    m.events = events
    # A block that does not start at rest on its base counts as lifted from the start.
    if m.kind == SLIP or y[TILT] != 0.0:
        m.uplift_time = 0.0
    # The forcing has a kink at every sample, and no series may cross it.
    while i <= f.pieces and ended == ARRIVED:
        if m.kind != SLIP:
            # The base acceleration may jump at the start of a piece, and the jump may release the block.
            decide(q, y, 0.0 if m.kind == REST else m.tilt, 0.0, load_at(q, f, i, 0.0).e0, m)
            if m.kind == SLIP:
                m.uplift_time = min(m.uplift_time, i * span_of(q, f))
        if i < f.pieces:
            ended = advance(q, f, m, legs, w, i, 0.0, span_of(q, f))
        i += 1
    # A brief run may end as soon as the free motion cannot tilt the block further.
    brief, end = s.brief != 0.0, 0.0
    while ended == ARRIVED and not (
        begin > 0.0 and (begin >= s.free or (brief and _stays_below(q, y, largest(m, TILT))))
    ):
        end = min(begin + 2.0 * math.pi, s.free) if brief else s.free
        ended = advance(q, f, m, legs, w, f.pieces, begin, end)
        # A run without free motion ends here as well.
        begin = end if end > 0.0 else math.inf
    # The outcome of the run does not depend on when its free motion ends. The state and the angles do.
    set_motion(y, m, trial)
    reset_counts(trial)
    trial.events, n = m.events, 0
    while ended == ARRIVED and n < _UNDECIDED and not _stays_below(q, trial.y, math.inf):
        begin = s.free + n * w.period
        if advance(q, f, trial, legs[:0], w, f.pieces, begin, begin + w.period) == BEYOND:
            ended, m.overturn_time = BEYOND, trial.overturn_time
        n += 1
    if ended == NOT_FINITE or not is_finite(y):
        return FAILED
    if ended != ARRIVED:
        return OVERTURNED if ended == BEYOND else EVENT_BOUND
    return STOOD if m.uplift_time == math.inf else ROCKED


@compiled
def follow_ground_motion(q, f, m, legs, w, s, trial):
    """Follow a motion through all pieces of a pulse or a record, then freely, and return its status.

    In the plant, f is the peak base acceleration over g, and the duration of a piece replaces the frequency.
    """
    # Keep the initial state: the run may have to be repeated.
    y0, y1, y2, y3 = m.y[TILT], m.y[SWING], m.y[TILT_RATE], m.y[SWING_RATE]
    quick, bound = s.rest_rate, int(s.events)
    while True:
        w.capture = quick * q.nu
        status = _follow_once(q, f, m, legs, w, s, bound, trial)
        # Hops without energy loss never end. If there are too many of them, the run is repeated with a larger
        # capture speed. This changes the tilt by about the square of that speed. The last attempt gets a
        # larger bound on events.
        if status != EVENT_BOUND or q.e < _LOSSLESS or quick * _COARSER > _QUICKEST:
            return status
        quick *= _COARSER
        bound = int(s.events) * (1 if quick * _COARSER <= _QUICKEST else _LAST)
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
