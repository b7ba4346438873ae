"""The nonlinear equations (4) in compiled scalar code: event by event, period by period, and the entrance.

In a batch that is vectorised every motion waits for the one with the most events. Here each goes its own
way: a Taylor series carries it until its error would be too large, or to the first event, which is a root of
the series. Motion, forcing and coefficients are those of `tpd.exact`, the rules at events those of
`tpd.exact.contact_kernel`, and those of repetition those of `tpd.exact.repetition`.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from tpd.core.machine_code import stored
from tpd.exact import follow, repetition
from tpd.exact import nonlinear_series as series
from tpd.exact.arcs import forcing_at, load_at, span_of, steady
from tpd.exact.compiling import checksum
from tpd.exact.contact_kernel import bob_change, mode_of, sign, velocity_ratio
from tpd.exact.custom_call import (
    BEGIN,
    RAMP,
    SETTINGS,
    addresses_in,
    api_version,
    inputs_of,
    on_host,
    pieces,
    rows_of,
    view,
)
from tpd.exact.follow import ARRIVED, BEYOND, EXHAUSTED, FOLLOWED, forcing_now, store_results
from tpd.exact.motion import (
    FIRST_PIECE,
    MOTION,
    NO,
    YES,
    copy_to,
    is_finite,
    larger_side,
    largest,
    reset_angles,
    reset_counts,
    update_angle,
    update_angles,
)
from tpd.exact.plant import PLANT, compiled, part
from tpd.exact.repetition import LONGEST, NEWEST, SETTLED
from tpd.exact.steady import STEADY
from tpd.exact.terms import MANY, REST, SLIP, STICK, SWING, SWING_RATE, SYMMETRIC, TILT, TILT_RATE
from tpd.exact.trajectory import ROUNDING

__all__ = ["CALL", "FOLLOWED", "SETTINGS", "SETTLED", "STEADY", "run"]

SETTLE, GROUND, STEADY_STATE, TRAJECTORY = range(4)
"""Tasks; the first number of every row of settings. Operands and results are those of `linear_entry`, without
derivatives."""
STILL = 1e-3
"""Share of its scale by which the bob's swing may change in a period under a block called at rest."""
MAX_STEPS = 20_000
"""Bound on the series of one piece of the forcing."""
NOT_FINITE = 3
"""End of a part of a motion whose series is no number, besides those of `tpd.exact.follow`."""
_NONE, _LANDING, _TURN, _UP, _DOWN = -1, 0, 1, 2, 3
"""Events: of a slipping block the first two, of a held one its releases to either side."""


@compiled
def _excess(q, y, side, eta):
    """Moment on a held block minus the moment of its weight."""
    phi, psi, rate, pull, weight = y[TILT], y[SWING], y[SWING_RATE], -0.5 * q.m12, side * q.weight
    sp, cp, relative = math.sin(phi), math.cos(phi), phi - psi
    big_s = side * q.nu * math.sin(relative) + 2.0 * math.cos(relative)
    big_c = side * q.nu * math.cos(relative) - 2.0 * math.sin(relative)
    # Acceleration of the bob under a block that is held.
    swing = (q.f * math.cos(psi) * eta - math.sin(psi) - q.c2 * rate) / q.m22
    on_block = q.up * sp - weight * cp - q.f * eta * (weight * sp + q.up * cp)
    bob = q.c1 * rate - pull * big_c * rate * rate + pull * big_s * swing
    return on_block + bob


@compiled
def decide(q, y, tilt, direction, eta, m):
    """Put the mode of a state into `m`: `tilt` and `way` are the signs of phi and phi', zero included."""
    up = _excess(q, y, 1.0 if tilt == 0.0 else tilt, eta)
    down = _excess(q, y, -1.0, eta) if tilt == 0.0 else up
    m.kind, m.tilt, m.direction = mode_of(up, down, q.k + q.slack, tilt, direction)


@compiled
def _first_event(q, m, order, h, c):
    """First event within the time h, and its time; without one, how far it is proved that there is none."""
    if m.kind != SLIP:
        event, until = _NONE, h
        for release in (_UP, _DOWN):
            row = series.UP if release == _UP else series.DOWN
            t, vanishes = series.positive_until(c, row, 1.0, order, q.k + q.weight, until)
            if vanishes or t < until:
                event, until = (release if vanishes else _NONE), t
        return event, until
    # Its acceleration is a difference of moments, and more uncertain than those that let it go.
    until, turns = series.positive_until(c, series.V, m.direction, order, 10.0 * (q.k + q.weight) * h, h)
    # Until it turns, the block comes down monotonously: it lands where its tilt has another sign by then.
    if m.tilt != m.direction and m.tilt * series.value_at(c, series.PHI, order, until) <= 0.0:
        landing, vanishes = series.positive_until(c, series.PHI, m.tilt, order, 0.0, until)
        # Next to a graze the proof may end before the landing: the next series goes on from there.
        return (_LANDING if vanishes or landing == until else _NONE), landing
    return (_TURN if turns else _NONE), until


@compiled
def _land(q, m, capture, eta):
    """Change rates and mode at the impact of a block that has come down."""
    y, rho, before = m.y, -0.5 * q.m21, m.y[TILT_RATE]
    sine, cosine = math.sin(y[SWING]), math.cos(y[SWING])
    ratio = velocity_ratio(q.e, q.nu, q.mu, q.lam, rho, m.tilt, sine, cosine)
    if abs(ratio * before) <= capture:
        decide(q, y, 0.0, 0.0, eta, m)
        if m.kind == REST:
            ratio = 0.0
    y[SWING_RATE] += bob_change(ratio, q.e, q.nu, q.mu, q.lam, rho, m.tilt, sine, cosine) * before
    y[TILT_RATE] = after = ratio * before
    decide(q, y, 0.0, math.copysign(1.0, after) if after != 0.0 else 0.0, eta, m)


@compiled
def _handle_event(q, m, event, at_once, capture, eta):
    """Change the state and the mode at an event; a series may begin with it `at_once`."""
    if event == _LANDING:
        m.impacts += 1
        _land(q, m, capture, eta)
    elif event == _TURN:
        decide(q, m.y, m.tilt, 0.0, eta, m)
        if at_once and m.kind == SLIP:
            # It was let go at a moment that only touched the limit: it does not move.
            m.kind = STICK if m.y[TILT] != 0.0 else REST
    else:
        side = 1.0 if event == _UP else -1.0
        m.tilt = side if m.kind == REST else m.tilt
        m.kind, m.direction = SLIP, side


@compiled
def _note_turns(m, k, c, order, h, tau):
    """Take account of the angle k of a tally, which is row k of a series, where it turns within the time h
    from `tau` on. Of its two sides only the larger one holds."""
    angle, t = series.largest_turn(c, k, order, h, m.extremes[larger_side(m, k // 2)])
    update_angle(m, k if angle > 0.0 else k + 1, abs(angle), tau + t)


@compiled
def advance(q, f, m, w, i, s, end):
    """Follow a motion through piece i of its forcing from the local time `s` to `end`, event by event; change
    state, mode and tally. Return how it ended."""
    y, c, origin = m.y, w.series, i * span_of(q, f)
    for _ in range(MAX_STEPS):
        remaining, tau = end - s, origin + s
        if remaining <= 1e-14 * w.period:
            return ARRIVED
        order, h = series.expand(q, m, load_at(q, f, i, s), remaining, w)
        if not h >= min(remaining, 1e-13 * w.period):
            return NOT_FINITE
        # No step is repeated: the length of a step follows from its series.
        event, h = _first_event(q, m, order, h, c)
        series.store_state(c, order, h, y)
        overturned = not abs(y[TILT]) < 0.5 * math.pi
        if overturned:
            # A step ends where the block turns, so that the tilt has grown until its end.
            event, h = _NONE, series.time_at_limit(c, series.PHI, order, 0.5 * math.pi, h)
            series.store_state(c, order, h, y)
        # The block's tilt is largest at events, which are ends of steps. The bob turns within one.
        update_angles(m, y[TILT], y[SWING], tau + h)
        _note_turns(m, series.PSI, c, order, h, tau)
        if w.relative:
            _note_turns(m, series.APART, c, order, h, tau)
        # Exactly on the event.
        if event == _LANDING:
            y[TILT] = 0.0
        elif event == _TURN:
            y[TILT_RATE] = 0.0
        s = end if h == remaining else s + h
        if overturned:
            m.overturn_time = origin + s
            return BEYOND
        if event != _NONE:
            m.events -= 1
            _handle_event(q, m, event, h == 0.0, w.capture, forcing_at(load_at(q, f, i, s), 0.0)[0])
            m.hold_level = 1.0 if m.hold_level > 0.0 or m.kind != SLIP else 0.0
            if m.kind == SLIP:
                m.uplift_time = min(m.uplift_time, origin + s)
            if m.events <= 0:
                return EXHAUSTED
    return EXHAUSTED


@compiled
def _is_still(q, m, before):
    """Whether the block has rested, or been held leaning, for a whole period in which the bob's swing hardly
    changed."""
    y = m.y
    is_resting = m.kind == REST and largest(m, TILT) == 0.0
    is_sticking = m.kind == STICK and y[TILT] == before[TILT]
    angles = max(abs(y[TILT] - before[TILT]), abs(y[SWING] - before[SWING]))
    rates = max(abs(y[TILT_RATE] - before[TILT_RATE]), abs(y[SWING_RATE] - before[SWING_RATE]))
    change = max(angles, rates / q.xi) / (q.nu + q.f)
    return (is_resting or is_sticking) and (change < STILL or q.mu == 0.0)


@compiled
def _one_period(q, f, m, w, s, ramp_end, events):
    """Follow a motion from the local time `s` to the end of the forcing period; the shaking has its full size
    `grown` from the beginning of the period on. Return how it ended."""
    reset_angles(m)
    m.hold_level, m.events = (2.0 if m.kind != SLIP else 0.0), events
    if 0.0 < ramp_end < w.period:
        # The forcing has a kink where its growth ends, which a step must not cross.
        ended = advance(q, f, m, w, FIRST_PIECE, s, ramp_end)
        if ended != ARRIVED:
            return ended
        f, s, m.events = steady(f.cubics), ramp_end, events
    return advance(q, f, m, w, FIRST_PIECE, s, w.period)


@compiled
def _scaled(q, w):
    """Set the period and the usual rates of a motion under a harmonic; return the sizes of its state."""
    scales = repetition.scales_of(q)
    w.period, w.relative = 2.0 * math.pi / q.xi, NO
    w.rate, w.swing = scales[TILT_RATE], scales[SWING_RATE]
    return scales


@compiled
def _settle(q, m, w, s, since, ramp, out):
    """Follow one motion from its state at tau = `since` until it repeats, rests, is lost, or the periods of
    the settings `s` have elapsed; see `tpd.exact.settle.settle`."""
    y, cubics, scales, events = m.y, np.empty((0, 4)), _scaled(q, w), int(s.events)
    past, peaks = np.zeros(LONGEST, repetition.PERIOD), np.zeros(2)
    copy_to(y, past[NEWEST].y)
    reset_counts(m)
    f, ramp_end = repetition.excitation_in(ramp, w.period, 0.0, since, cubics)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, since), m)
    # A start within a period has another phase than the ends of periods, with which these are compared.
    count, status, repeats, elapsed = (1 if since == 0.0 else 0), repetition.NOT_SETTLED, 0, 0
    while elapsed < s.periods and status == repetition.NOT_SETTLED:
        if elapsed > 0:
            f, ramp_end = repetition.excitation_in(ramp, w.period, float(elapsed), 0.0, cubics)
        ended = _one_period(q, f, m, w, since if elapsed == 0 else 0.0, ramp_end, events)
        elapsed += 1
        peak, swing = largest(m, TILT), largest(m, SWING)
        peaks[TILT], peaks[SWING] = max(peaks[TILT], peak), max(peaks[SWING], swing)
        # Nothing that was met before the shaking became steady counts as a repetition, or as rest.
        is_steady = f.rate == 0.0 and ended == ARRIVED
        repeats = repetition.repeats_after(q, y, past, count, scales, s.tolerance) if is_steady else 0
        is_resting = is_steady and count > 0 and _is_still(q, m, past[NEWEST].y)
        count = repetition.store_period(past, count if is_steady else 0, y, peak, swing, m.hold_level)
        if ended == NOT_FINITE or not is_finite(y):
            status = repetition.FAILED
        elif ended != ARRIVED:
            status = repetition.OVERTURNED if ended == BEYOND else repetition.EVENT_BOUND
        elif is_resting:
            status = repetition.AT_REST
        elif repeats > 0:
            # The bob of a block that never moved may repeat itself after several periods only.
            status = repetition.AT_REST if repetition.was_held(past, repeats) else repetition.ROCKING
    repetition.store_settled(status, repeats, elapsed, m, past, peaks, out)


@compiled
def _is_symmetric(q, m, w, s, y):
    """Whether the periodic motion with the state `y` at tau = 0 is its own mirror image half a period
    later."""
    f, half, past = steady(np.empty((0, 4))), math.pi / q.xi, np.zeros(1, repetition.PERIOD)
    copy_to(y, past[NEWEST].y)
    # The mirror image of a motion, half a period later, is a motion as well. It is the same one if it comes
    # to the same state.
    for i in range(4):
        m.y[i] = -y[i]
    reset_counts(m)
    decide(q, m.y, sign(m.y[TILT]), sign(m.y[TILT_RATE]), forcing_now(q, f, half), m)
    arrived = _one_period(q, f, m, w, half, 0.0, int(s.events)) == ARRIVED
    reach = max(s.tolerance, SYMMETRIC)
    return arrived and repetition.repeats_after(q, m.y, past, 1, repetition.scales_of(q), reach) == 1


@compiled
def _steady_state(q, m, w, s, settled, out):
    """Follow a motion from its state at tau = 0 until it settles, and put its steady state into `out`.
    Multipliers, exponents and derivatives are no numbers: nobody computes them."""
    _settle(q, m, w, s, 0.0, 0.0, settled)
    status = int(settled.status)
    copy_to(settled.y, out.y)
    out.amplitude, out.swing = settled.amplitude, settled.swing
    out.multiplier = out.lyapunov = math.nan
    out.status, out.periods, out.elapsed = status, settled.periods, settled.elapsed
    for i in range(6):
        for j in range(MANY):
            out.by[i, j] = math.nan
    if status in (repetition.OVERTURNED, repetition.FAILED):
        out.amplitude = out.swing = math.inf if status == repetition.OVERTURNED else math.nan
    rocks = status in (repetition.ROCKING, repetition.STICKING) and int(settled.periods) % 2 == 1
    out.symmetric = 1.0 if rocks and _is_symmetric(q, m, w, s, out.y) else 0.0


@compiled
def _trajectory(q, m, w, s, times, out):
    """Follow a motion from its state at times[0] on, and put the states at all times into `out`, no numbers
    beyond its end. Return its status."""
    y, f, status = m.y, steady(np.empty((0, 4))), repetition.ROCKING
    _scaled(q, w)
    reset_counts(m)
    reset_angles(m)
    # Times count from the beginning of their forcing period, see `tpd.exact.trajectory`.
    period = math.floor(times[0] / w.period + ROUNDING)
    t = times[0] - period * w.period
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, t), m)
    m.events = int(s.events)
    for n in range(len(times)):
        last = math.floor(times[n] / w.period + ROUNDING)
        while status == repetition.ROCKING and (period < last or t < times[n] - last * w.period):
            end = w.period if period < last else times[n] - last * w.period
            ended = advance(q, f, m, w, FIRST_PIECE, t, end)
            t = end
            if period < last:
                period, t, m.events = period + 1, 0.0, int(s.events)
            if ended == NOT_FINITE or not is_finite(y):
                status = repetition.FAILED
            elif ended != ARRIVED:
                status = repetition.OVERTURNED if ended == BEYOND else repetition.EVENT_BOUND
        for i in range(4):
            out[n, i] = y[i] if status == repetition.ROCKING else math.nan
    return status


@compiled
def _follow_once(q, f, m, w, s):
    """Follow one motion through all pieces of a ground motion, and freely for the time that the settings `s`
    say. Return its status."""
    y, i, ended = m.y, FIRST_PIECE, ARRIVED
    # Without a forcing period, the shorter of the bob's and the block's says which times are but rounding.
    w.period, w.relative = 2.0 * math.pi * min(1.0, math.sqrt(q.m22)), YES
    w.rate, w.swing = q.nu, (q.nu + q.f) * max(1.0, 1.0 / math.sqrt(q.m22))
    reset_counts(m)
    reset_angles(m)
    m.events = int(s.events)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, 0.0), m)
    if m.kind == SLIP or y[TILT] != 0.0:
        m.uplift_time = 0.0
    # The forcing has a kink at every sample, which a step must not cross.
    while i <= f.pieces and ended == ARRIVED:
        if m.kind != SLIP:
            # The base acceleration may jump where a piece begins.
            decide(q, y, 0.0 if m.kind == REST else m.tilt, 0.0, load_at(q, f, i, 0.0).e0, m)
            if m.kind == SLIP:
                m.uplift_time = min(m.uplift_time, i * span_of(q, f))
        ended = advance(q, f, m, w, i, 0.0, span_of(q, f) if i < f.pieces else s.free)
        i += 1
    if ended == NOT_FINITE or not is_finite(y):
        return follow.FAILED
    if ended != ARRIVED:
        return follow.OVERTURNED if ended == BEYOND else follow.EVENT_BOUND
    return follow.STOOD if m.uplift_time == math.inf else follow.ROCKED


@part
def _run(a, first, last):
    """Rows of settings, parameters and starts. To settle: also beginnings and ramps; what they settle to. For
    steady states: these. For a trajectory: also times; states and statuses. Through a ground motion: also
    pieces; results, in which what is not computed is no number."""
    (s, x, start), (_, _, _, operand, results, ends, _, _) = inputs_of(a, last), addresses_in(a)
    plants, motions, works = np.empty(1, PLANT), np.zeros(1, MOTION), np.zeros(1, series.WORK)
    spare, count = np.empty(1, SETTLED), int(s[first].periods)
    q, m, w = plants[0], motions[0], works[0]
    for n in range(first, last):
        series.prepare(x[n], s[n], q, w)
        copy_to(start[n], m.y)
        if s[n].task == SETTLE:
            t, settled = view(operand, (last, 2), np.float64), view(results, (last,), SETTLED)
            _settle(q, m, w, s[n], t[n, BEGIN], t[n, RAMP], settled[n])
        elif s[n].task == STEADY_STATE:
            _steady_state(q, m, w, s[n], spare[FIRST_PIECE], view(operand, (last,), STEADY)[n])
        elif s[n].task == TRAJECTORY:
            times = view(operand, (last, count), np.float64)
            states = view(results, (last, count, 4), np.float64)
            view(ends, (last,), np.float64)[n] = _trajectory(q, m, w, s[n], times[n], states[n])
        else:
            out = view(results, (last,), FOLLOWED)[n]
            store_results(m, _follow_once(q, pieces(operand, s[n], n), m, w, s[n]), out)
            out.growing = out.transversality = math.nan
    # Records do not keep their memory, and Numba frees an array after its last use.
    return len(plants) + len(motions) + len(works) + len(spare)


def _entrance(version: int, api: int) -> Any:
    def call(address):
        """Answer a frame: 0 for success."""
        a = np.zeros(8, np.int64)
        first, last, by_host = rows_of(address, a, api)
        if last > first:
            _run(a, first, last)
        return version if by_host else 0

    # Numbers from outside the function are part of the key of Numba's store, see `linear_entry`.
    return stored(call, numba.cfunc, "int64(int64)")


CALL = _entrance(checksum(), api_version())
"""The entrance, an FFI handler of XLA's."""
run = on_host(CALL)
"""Function that answers the host: first and last row, then the operands and results of a task."""
