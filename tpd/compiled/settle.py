"""Simulation of a run under a harmonic until it repeats, rests or overturns, for the linear model.

The rules are those of `tpd.models.settling`. If a motion approaches its orbit slowly, Newton's method
computes the orbit (`tpd.compiled.near_orbits`).
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled import repetition
from tpd.compiled.arcs import span_of, steady
from tpd.compiled.columns import (
    AT_REST,
    EVENT_BOUND,
    FAILED,
    NOT_SETTLED,
    OVERTURNED,
    REST,
    ROCKING,
    STICK,
    SWING,
    SWING_RATE,
    TILT,
    TILT_RATE,
)
from tpd.compiled.contact_kernel import decide, sign
from tpd.compiled.follow import ARRIVED, BEYOND, Rules, allow_events, follow_piece, forcing_now, start_angles
from tpd.compiled.legs import INPUTS, STATE
from tpd.compiled.march import prepare_march
from tpd.compiled.motion import FIRST_PIECE, LEG, NO, YES, copy_to, is_finite, largest, reset_counts
from tpd.compiled.near_orbits import CONVERGED, NEARBY, Past, orbit_near
from tpd.compiled.period_map import BEST, Limits, records_of
from tpd.compiled.plant import compiled, plant

_NONE = np.int64(0)
"""Zero periods, as a NumPy scalar."""
_PERIODS_PER_SEARCH = 24
"""Number of forcing periods that can be simulated in the time of one search for an orbit of period one."""


@compiled
def _bob_under_held(q, y, phase):
    """Return bounds on the moment on a held block and on |psi| (rad), from now on.

    Both include the forcing, the decaying swing and the steady swing. The state `y` is at a phase of a steady
    forcing. The bob under a block that does not move is a damped oscillator.
    """
    s, c, sine, cosine = q.swing_sin, q.swing_cos, math.sin(phase), math.cos(phase)
    two_mu = q.up - 1.0
    along, across = -q.f - two_mu * s - q.bias * q.xi * c, -two_mu * c + q.bias * q.xi * s
    # The decaying part is the state minus the steady swing. Its energy never grows.
    psi = y[SWING] - s * sine - c * cosine
    rate = y[SWING_RATE] - q.xi * (s * cosine - c * sine)
    swing = math.sqrt(psi * psi + rate * rate / q.held_q)
    decaying = two_mu * swing + abs(q.bias) * swing * math.sqrt(q.held_q)
    return math.hypot(along, across) + decaying, math.hypot(s, c) + swing


@compiled
def _is_at_rest(q, m, peak, phase, tolerance):
    """Whether the block rests or sticks permanently under a steady excitation.

    `peak` is the largest tilt of the last period. If that tilt is negligible at the end of a rattle, this
    changes the mode and the state to rest.
    """
    y, mode = m.y, m
    pull, _ = _bob_under_held(q, y, phase)
    # Relative margin between the holding moment on the base and the largest moment.
    margin = 1.0 - pull / (q.weight + q.k)
    if mode.kind != STICK:
        return mode.kind == REST and margin >= 0.0
    # A rattle with e < 1 comes to rest within finite time, and a slow impact ends it at once. Hops under
    # strong friction do not end like this: friction holds the block a little above its base until the moment
    # has changed its sign. One hop then takes a large part of a period, and each hop is smaller than the
    # last. Hops below the tolerance of a repetition no longer matter. The block counts as at rest if the bob
    # cannot lift it.
    low = max(peak, abs(y[TILT])) < tolerance * q.nu
    if low and (q.k > 0.0 or q.e < 1.0) and margin > 0.0:
        mode.kind, y[TILT] = REST, 0.0
        return True
    # A block that sticks at a tilt stays there if friction alone exceeds the moment.
    return y[TILT] != 0.0 and pull + abs(q.up * y[TILT] - mode.tilt * q.weight) < q.k


@compiled
def _repeats_at_rest(q, m, tolerance):
    """Whether a motion that repeats with the block held all the time continues like this permanently."""
    # The decay of a damped bob that is still to come is smaller than the tolerance. But the steady swing may
    # exceed the holding moment by a small amount, and lift the block. An undamped bob continues as in these
    # periods.
    if q.zeta == 0.0:
        return True
    psi, rate = m.y[SWING], m.y[SWING_RATE]
    m.y[SWING], m.y[SWING_RATE] = q.swing_cos, q.xi * q.swing_sin
    is_resting = _is_at_rest(q, m, 0.0, 0.0, tolerance)
    # If the block may lift, restore the state.
    if not is_resting:
        m.y[SWING], m.y[SWING_RATE] = psi, rate
    return is_resting


@compiled
def _let_bob_settle(buffers, limits, s, tolerance, periods, whole, peaks):
    """Replace the state under a block that rests or sticks permanently by the one that it approaches.

    Returns the largest |psi| of the settled bob. If `whole`, the motion is followed from the local time `s`
    until the bob cannot exceed its largest angle so far, but not for more than a number of periods, to update
    `peaks`.
    """
    (q, m, w, _), legs = records_of(buffers), np.empty(0, LEG)
    y, f, kind, tilt, swing = m.y, steady(np.empty((0, 4))), m.kind, m.y[TILT], 0.0
    (_, reach), size, n = _bob_under_held(q, y, q.xi * s), math.hypot(q.swing_sin, q.swing_cos), 0
    repeats = 0
    if q.zeta == 0.0:
        # An undamped bob keeps its own swing, and its largest angle is the sum of both amplitudes. The
        # exception is a motion that repeats, of which all periods are followed.
        for j in range(periods, 0, -1):
            swings = j * math.sqrt(q.held_q) / q.xi
            # The second part is the rounding error, which counts next to resonance.
            change = 2.0 * math.pi * (abs(swings - np.rint(swings)) + 1e-15 * swings) * (reach - size)
            repeats = j if change < tolerance * (q.nu + q.f) else repeats
        periods, size = repeats + (1 if s > 0.0 else 0), reach
    while n < periods and m.kind == kind and (q.zeta == 0.0 or (whole and reach > peaks[SWING])):
        _one_period(q, f, m, legs, w, s, 0.0, limits)
        swing = max(swing, largest(m, SWING))
        peaks[SWING] = max(peaks[SWING], swing)
        (_, reach), s, n = _bob_under_held(q, y, 0.0), 0.0, n + 1
    if q.zeta > 0.0:
        y[SWING], y[SWING_RATE] = q.swing_cos, q.xi * q.swing_sin
    elif repeats > 0:
        size = swing
    # A moment that equals the limit except for rounding does not lift the block.
    m.kind, y[TILT], y[TILT_RATE], peaks[SWING] = kind, tilt, 0.0, max(peaks[SWING], size)
    return size


@compiled
def _slow_repetition(q, past, count, tolerance, gap, gap_periods):
    """Return the number of periods after which a slowly converging motion almost repeats, or 0.

    Slow means that the motion would take longer to repeat than a search for its orbit. The function also
    returns the distance between the motion and its repetition, and the number of periods for it. `gap` and
    `gap_periods` are these two values of the period before.
    """
    closest, periods, scales = NEARBY, 0, repetition.scales_of(q)
    for n in range(1, count // 2):
        error = repetition.distance(q, past[0].y, past[n].y, scales)
        # A larger number of periods must be much closer than a smaller one.
        if error < 0.1 * closest or (n == 1 and error < closest):
            closest, periods = error, n
    # The decay in one period follows from the last two distances, if both belong to the same number of
    # periods.
    decay = closest / gap if gap_periods == periods and gap > 0.0 else 0.0
    if periods == 0 or decay == 0.0:
        return 0, closest, periods
    # The sum of all further changes must be small, see `repeats_after`.
    remaining = closest / (1.0 - decay) / tolerance if decay < 1.0 else math.inf
    remaining = math.log(remaining) / -math.log(decay) if decay < 1.0 else math.inf
    return (periods if remaining > _PERIODS_PER_SEARCH * periods else 0), closest, periods


@compiled
def _one_period(q, f, m, legs, w, s, ramp_end, limits):
    """Follow a motion from the local time `s` to the end of the forcing period.

    Returns the outcome, see `follow_piece`. The excitation has its full size from the local time `ramp_end`
    on.
    """
    period, rules = span_of(q, f), Rules(limits.capture, YES, NO, NO)
    start_angles(q, f, m, FIRST_PIECE, s)
    if f.rate > 0.0 and ramp_end < (1.0 - 1e-12) * period:
        # The forcing has a kink at the end of the ramp. Follow the motion to it, and from there with the
        # steady forcing.
        allow_events(m, w, limits.events)
        ended = follow_piece(q, f, m, legs, w, FIRST_PIECE, s, ramp_end, rules)
        f, s = steady(f.cubics), ramp_end
        if ended != ARRIVED:
            return ended
    allow_events(m, w, limits.events)
    return follow_piece(q, f, m, legs, w, FIRST_PIECE, s, period, rules)


@compiled
def settle(x, buffers, s, since, ramp, whole, out):
    """Simulate a run until it repeats, rests or overturns, and write the result to `out`.

    The run starts from its state at tau = `since`.

    The run also ends after the number of periods in the settings `s`. The excitation grows linearly over
    `ramp` periods. `out` is a record `tpd.compiled.columns.RUN`. Its peaks are those of the whole run
    only if `whole`, because the bob of a block at rest may reach its largest angle later.
    """
    q, m, w, _ = records_of(buffers)
    plant(x, q)
    prepare_march(q, w.march)
    y, period, tolerance, capture = m.y, 2.0 * math.pi / q.xi, s.tolerance, s.rest_rate * q.nu
    events, scales, cubics, legs = int(s.events), repetition.scales_of(q), np.empty((0, 4)), np.empty(0, LEG)
    limits = Limits(capture, events, (STATE, INPUTS), NEARBY)
    past, gap, gap_periods = (
        Past(np.zeros(repetition.LONGEST + 1, repetition.PERIOD), np.zeros(2)),
        0.0,
        _NONE,
    )
    last, peaks = past.periods, past.peaks
    copy_to(y, last[0].y)
    reset_counts(m)
    buffers.cycles[BEST].periods = 0.0
    f, ramp_end = repetition.excitation_in(ramp, period, 0.0, since, cubics)
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), forcing_now(q, f, since), m)
    peaks[TILT], peaks[SWING] = abs(y[TILT]), abs(y[SWING])
    status = NOT_SETTLED
    # A block that starts at rest may rest permanently, which needs no simulation.
    if m.kind == REST and f.rate == 0.0 and _is_at_rest(q, m, peaks[TILT], q.xi * since, tolerance):
        status = AT_REST
    # A start within a period has another phase than the ends of periods, so that the two cannot be compared.
    count, repeats, elapsed, wait = (1 if since == 0.0 else 0), 0, 0, 0
    # If the square of an angle overflows, the proofs of the event search fail. Let such a run end as failed.
    if not math.isfinite(q.tilt_sin * q.tilt_sin + q.bob_sin * q.bob_sin):
        y[TILT] = math.nan
    while elapsed < s.periods and status == NOT_SETTLED and is_finite(y):
        if elapsed > 0:
            f, ramp_end = repetition.excitation_in(ramp, period, float(elapsed), 0.0, cubics)
        # The first period may start late.
        ended = _one_period(q, f, m, legs, w, since if elapsed == 0 else 0.0, ramp_end, limits)
        sound, elapsed = ended == ARRIVED and is_finite(y), elapsed + 1
        # Whether the excitation grew in this period, and whether it grows on in the next one.
        was_growing, is_growing = f.rate > 0.0, f.rate > 0.0 and ramp_end >= (1.0 - 1e-12) * period
        peak, swing = max(largest(m, TILT), abs(y[TILT])), largest(m, SWING)
        # Largest angles of this period, and of the whole run.
        peaks[TILT], peaks[SWING] = max(peaks[TILT], peak), max(peaks[SWING], swing)
        is_resting = sound and not is_growing and _is_at_rest(q, m, peak, 0.0, tolerance)
        # States before the excitation became steady do not count for a repetition.
        is_steady = sound and not was_growing
        repeats = repetition.repeats_after(q, y, last, count, scales, tolerance) if is_steady else 0
        count = repetition.store_period(last, 0 if was_growing else count, y, peak, swing, m.hold_level)
        if not sound:
            status = OVERTURNED if ended == BEYOND else EVENT_BOUND
        elif is_resting:
            status = AT_REST
        elif repeats > 0 and not repetition.was_held(last, repeats):
            status = ROCKING
        elif repeats > 0:
            status = AT_REST if _repeats_at_rest(q, m, tolerance) else NOT_SETTLED
            # A damped bob under a block at rest repeats after one period, whatever the number of periods was
            # before.
            repeats = 0 if q.zeta > 0.0 or status == NOT_SETTLED else repeats
        elif not is_growing and tolerance >= CONVERGED and elapsed >= wait:
            # The run converges slowly: search for its orbit. If that fails, wait until the run is twice as
            # long.
            candidate, gap, gap_periods = _slow_repetition(q, last, count, tolerance, gap, gap_periods)
            if candidate > 0:
                wait = 2 * elapsed
                if orbit_near(q, m, buffers, past, count, limits, candidate):
                    status, repeats = ROCKING, candidate
                    # A block that sticks at a tilt all the time does not rock.
                    if _is_at_rest(q, m, last[0].tilt, 0.0, tolerance):
                        status, repeats = AT_REST, 0
    if status == AT_REST:
        begin, remaining = (since if elapsed == 0 else 0.0), int(s.periods) - elapsed
        last[0].swing = _let_bob_settle(buffers, limits, begin, tolerance, remaining, whole, peaks)
    if status != OVERTURNED and not is_finite(y):
        status = FAILED
    repetition.store_settled(status, repeats, elapsed, m, last, peaks, out)
