"""Readings of the legs of a followed motion: its derivatives, its states at given times, its impacts.

Between events a leg has the closed form of its arc: complex numbers carry derivatives (see
`tpd.exact.plant.STEP`). At an event one Newton step on its time carries the saltation matrix. Over whole
pieces the state goes through an affine map; the map and its derivatives are computed once, so that a piece
costs a few products of small matrices.
"""

from __future__ import annotations

import numpy as np

from tpd.exact.arcs import Load, arc_from, beginning, forcing_at, instant, launch, load_at, span_of, state_at
from tpd.exact.contact_kernel import rates_after_impact, release_margin
from tpd.exact.events import BOB, CUT, END, FIRST, OVERTURN, RELATIVE, SECOND, STOP
from tpd.exact.motion import WHOLE, angle_of, larger_side
from tpd.exact.plant import COMPLEX_PLANT, STEP, compiled, part
from tpd.exact.terms import REST, SLIP, STICK, SWING, SWING_PULL, SWING_RATE, TILT, TILT_PULL, TILT_RATE

_KINDS = float(SLIP), float(STICK)
"""Modes of the maps of whole pieces: one serves both kinds of held blocks."""
INPUTS = np.int64(13)
"""Directions of derivatives: nine parameters and four components of the start."""
STATE, _BEGINNING = np.int64(9), np.int64(-1)
"""First direction of the start; and the leg before the first one."""
FORCING, KIND, SIDE, STATES = map(np.int64, (6, 7, 8, 9))
"""Columns of a history after those of the state with its accelerations, and how many there are."""
_WHEN, _RATE = 0, 1
"""Columns of impacts."""
_ROUNDING = 1e-12
"""Share of the last time by which rounding may put that time beyond the end of a motion."""
END_STATE, ANGLES, GROWING, TIMES, UPLIFT, ROWS = map(np.int64, (0, 4, 10, 11, 17, 18))
"""Rows of derivatives: of the state at the end; the six largest angles of a tally; under a pulse or a record
also the growing coordinate at the start of the last leg, the times of the six angles, and that of the first
uplift. A time without a derivative leaves its row as it is."""
READER = np.dtype(
    [
        ("plants", COMPLEX_PLANT, (10,)),
        ("dy", np.float64, (4, 14)),
        ("shift", np.float64, (14,)),
        ("now", np.float64, (6,)),
        ("maps", np.float64, (2, 4, 8)),
        ("slopes", np.float64, (2, 4, 8, 13)),
        ("has_map", np.int64, (2,)),
    ],
    align=True,
)
"""A reader of legs: complex plants (one for each parameter, and one for the other directions); derivatives of
the state, and of the local time, in all directions and that of the time of the start; the state where it is
with its accelerations; the maps of whole pieces for the slipping and for the held block, their derivatives,
and whether they are known."""


@part
def _plant(r, j):
    """The complex plant of direction j: all that move no parameter share the last one."""
    return r.plants[min(j, STATE)]


@compiled
def _event_delay(q, f, leg, a, s, eta, rate):
    """How much later a leg ends, in the direction of the derivative; `a` is its last state, and `s` the local
    time of its beginning."""
    # To first order: what is left of the event's signal, over its slope.
    event = leg.event
    if event == END:
        # The horizon of a free motion does not depend on anything.
        return (span_of(q, f) - s).imag if f.harmonic or leg.piece < f.pieces else -s.imag
    if event == STOP:
        return -(leg.piece * span_of(q, f) + s).imag
    if event >= BOB or event == CUT:
        return 0.0
    if leg.kind != SLIP:
        value = release_margin(
            q, leg.kind, complex(leg.tilt, 0.0), event, a[TILT], a[SWING], a[SWING_RATE], eta
        )
        side = 1.0 if event == FIRST else -1.0
        pull = (1.0 - q.up.real) * a[SWING_RATE].real + q.bias.real * a[SWING_PULL].real
        slope = -side * (pull - q.f.real * rate.real)
        return -value.imag / slope if slope != 0.0 else 0.0
    if event == FIRST:
        return -a[TILT_RATE].imag / a[TILT_PULL].real if a[TILT_PULL].real != 0.0 else 0.0
    return -a[TILT].imag / a[TILT_RATE].real if a[TILT_RATE].real != 0.0 else 0.0


@compiled
def _launch_along(q, f, leg, dy, j, s):
    """The arc of a leg in direction j, and its forcing; `s` is the local time of its beginning."""
    e = load_at(q, f, leg.piece, s)
    y0, y1 = complex(leg.y[TILT], dy[TILT, j] * STEP), complex(leg.y[SWING], dy[SWING, j] * STEP)
    y2 = complex(leg.y[TILT_RATE], dy[TILT_RATE, j] * STEP)
    y3 = complex(leg.y[SWING_RATE], dy[SWING_RATE, j] * STEP)
    return launch(q, leg.kind, complex(leg.tilt, 0.0), complex(leg.direction, 0.0), y0, y1, y2, y3, e), e


@compiled
def carry_through_leg(q, r, f, leg, first, last):
    """Take a reader, in the directions from `first` to before `last`, to the end of a leg, before its
    event; `q` is the plant."""
    # The real state begins anew with every leg, so that errors of it do not add up.
    e, duration, none = load_at(q, f, leg.piece, leg.start), leg.duration, 0.0 * leg.start
    arc, free = arc_from(q, leg, leg.y, e), Load(e.xi, none, none, none, none, none)
    start, here = state_at(arc, beginning(arc), 0.0), instant(arc, duration)
    end, (eta, rate) = state_at(arc, here, duration), forcing_at(e, duration)
    for j in range(first, last):
        p, s, t = _plant(r, j), complex(leg.start, r.shift[j] * STEP), complex(duration, 0.0)
        if j < STATE:
            moved, of = _launch_along(p, f, leg, r.dy, j, s)
            a = state_at(moved, instant(moved, t), t)
            delay = _event_delay(p, f, leg, a, s, *forcing_at(of, t))
        else:
            # No parameter moves: the change of the state goes on without a forcing. That of the time of the
            # start moves the whole arc.
            d, by = r.dy, r.shift[j]
            y0, y1 = d[TILT, j] - start[TILT_RATE] * by, d[SWING, j] - start[SWING_RATE] * by
            y2, y3 = d[TILT_RATE, j] - start[TILT_PULL] * by, d[SWING_RATE, j] - start[SWING_PULL] * by
            c = state_at(launch(q, leg.kind, none, none, y0, y1, y2, y3, free), here, duration)
            a = (
                complex(end[TILT], (c[TILT] + end[TILT_RATE] * by) * STEP),
                complex(end[SWING], (c[SWING] + end[SWING_RATE] * by) * STEP),
                complex(end[TILT_RATE], (c[TILT_RATE] + end[TILT_PULL] * by) * STEP),
                complex(end[SWING_RATE], (c[SWING_RATE] + end[SWING_PULL] * by) * STEP),
                complex(end[TILT_PULL], 0.0),
                complex(end[SWING_PULL], 0.0),
            )
            delay = _event_delay(p, f, leg, a, s, complex(eta, rate * by * STEP), complex(rate, 0.0))
        for i in range(4):
            r.dy[i, j] = (a[i].imag + a[i + 2].real * delay) / STEP
        r.shift[j] += delay / STEP
    for i in range(6):
        r.now[i] = end[i]


@compiled
def carry_past_event(r, leg, first, last):
    """Take a reader, in the same directions, from the end of a leg past its event."""
    # The next piece begins at its own zero of time.
    if leg.event == END:
        for j in range(first, last):
            r.shift[j] = 0.0
    # A held block does not move until it is let go. Let go a little later, it begins in the same state.
    if leg.kind != SLIP or (leg.event != FIRST and leg.event != SECOND):
        return
    for j in range(first, last):
        if leg.event == FIRST:
            # A hop that ends in rest takes its turn on the base.
            r.dy[TILT, j], r.dy[TILT_RATE, j] = (0.0 if leg.ends_at_rest else r.dy[TILT, j]), 0.0
            continue
        y2 = complex(r.now[TILT_RATE], r.dy[TILT_RATE, j] * STEP)
        y3 = complex(r.now[SWING_RATE], r.dy[SWING_RATE, j] * STEP)
        y2, y3 = rates_after_impact(_plant(r, j), leg.ends_at_rest, y2, y3)
        # At a landing the tilt is zero whatever the parameters.
        r.dy[TILT, j], r.dy[TILT_RATE, j], r.dy[SWING_RATE, j] = 0.0, y2.imag / STEP, y3.imag / STEP


@compiled
def _store_maps(r, is_held, inputs):
    """Put the map (state, coefficients of the forcing) -> state of a piece into a reader, with its
    derivatives. The tilt counts from the centre of its motion."""
    one, zero = complex(1.0, 0.0), complex(0.0, 0.0)
    u, kind = np.zeros(8, np.complex128), _KINDS[is_held]
    for j in range(inputs):
        q = _plant(r, j)
        h = q.xi
        for k in range(8):
            # The forcing is given by its coefficients in the share of the piece.
            for i in range(8):
                u[i] = zero if i != k else one
            e = Load(zero, zero, u[4], u[5] / h, u[6] / (h * h), u[7] / (h * h * h))
            # No weight and no friction: both signs are zero.
            arc = launch(q, kind, zero, zero, u[0], u[1], u[2], u[3], e)
            end = state_at(arc, instant(arc, h), h)
            for i in range(4):
                r.maps[is_held, i, k], r.slopes[is_held, i, k, j] = end[i].real, end[i].imag / STEP


@compiled
def _carry_through_pieces(q, r, c, leg, inputs):
    """Take a reader through whole pieces, the rows of `c`."""
    is_held = 1 if leg.kind != SLIP else 0
    if r.has_map[is_held] == 0:
        _store_maps(r, is_held, inputs)
        r.has_map[is_held] = 1
    a, by, y, dy = r.maps[is_held], r.slopes[is_held], r.now, r.dy
    old, x, moved = np.empty((4, inputs)), np.empty(8), np.zeros(inputs)
    # The map is linear about the centre, which moves with weight and friction.
    centre = 0.0 if is_held else (leg.tilt * q.weight + leg.direction * q.k) / q.up
    for j in range(inputs):
        p = _plant(r, j)
        r.shift[j] = 0.0
        if not is_held:
            moved[j] = ((leg.tilt * p.weight + leg.direction * p.k) / p.up).imag / STEP
    for i in range(4):
        y[i] = leg.y[i]
    first, last = leg.piece, leg.piece + int(leg.duration)
    # A record has no square and no cube: half of the coefficients are left out.
    terms = 6
    for n in range(first, last):
        terms = max(terms, 8 if c[n, 3] != 0.0 else (7 if c[n, 2] != 0.0 else 6))
    for n in range(first, last):
        for k in range(4):
            x[k], x[4 + k] = y[k], c[n, k]
            for j in range(inputs):
                old[k, j] = dy[k, j]
        x[0] -= centre
        for j in range(inputs):
            old[TILT, j] -= moved[j]
        for i in range(4):
            total = 0.0
            for j in range(inputs):
                dy[i, j] = 0.0
            for k in range(terms):
                size = x[k]
                total += a[i, k] * size
                for j in range(inputs):
                    dy[i, j] += by[i, k, j] * size
            for k in range(4):
                size = a[i, k]
                for j in range(inputs):
                    dy[i, j] += size * old[k, j]
            y[i] = total
        y[TILT] += centre
        for j in range(inputs):
            dy[TILT, j] += moved[j]


@compiled
def _store_angles(r, f, m, n, leg, first, last, by):
    """Put the derivatives of the largest angles that were met at the end of leg n, and of their times, into
    `by`."""
    for k in range(6):
        if m.extreme_legs[k] != n:
            continue
        for j in range(first, last):
            by[ANGLES + k, j] = angle_of(r.dy[TILT, j], r.dy[SWING, j], k)
        if n < 0 or f.harmonic:
            continue
        # Where the bob turns the leg ends at a fixed time: the turn itself is a little earlier or later.
        turns, apart = k > 1 and (leg.event == BOB or leg.event == RELATIVE), 1.0 if k > 3 else 0.0
        bend = r.now[SWING_PULL] - apart * r.now[TILT_PULL]
        pieces = leg.piece + (leg.duration if leg.event == WHOLE else 0.0)
        for j in range(first, last):
            delay = -(r.dy[SWING_RATE, j] - apart * r.dy[TILT_RATE, j]) / bend if turns else 0.0
            by[TIMES + k, j] = pieces * _plant(r, j).xi.imag / STEP + r.shift[j] + delay


@compiled
def _uplift_leg(legs, count):
    """The leg with which a block leaves its base for the first time; -1 if it never does, or has left it from
    the beginning."""
    if count > 0 and legs[0].kind == REST:
        for n in range(1, count):
            if legs[n].kind != REST:
                return n
    return -1


@compiled
def read_derivatives(q, f, m, legs, r, directions, angles_only, by):
    """Put the derivatives of a followed motion into `by`, of `ROWS` rows, in the `directions` from the first
    to before the last of two, and return the growing coordinate of its last leg. The reader has its plants.
    If `angles_only`, what comes after the last of the largest angles and the first uplift is left out."""
    count, (first, inputs) = min(m.leg_count, len(legs)), directions
    r.has_map[:] = 0
    for j in range(inputs):
        r.shift[j] = 0.0
        for i in range(4):
            r.dy[i, j] = 1.0 if j == STATE + i else 0.0
    if count > 0:
        _store_angles(r, f, m, _BEGINNING, legs[0], first, inputs, by)
    growing, uplift_leg, last = 0.0, -1 if f.harmonic else _uplift_leg(legs, count), count
    if angles_only:
        last = uplift_leg
        for k in range(3):
            last = max(last, m.extreme_legs[larger_side(m, k)])
        last = min(count, 1 + last)
    for n in range(last):
        leg = legs[n]
        if n == uplift_leg:
            for j in range(first, inputs):
                by[UPLIFT, j] = leg.piece * _plant(r, j).xi.imag / STEP + r.shift[j]
        if n == m.leg_count - 1 and not f.harmonic:
            # The last leg decides between overturning and falling back.
            for j in range(first, inputs):
                p = _plant(r, j)
                arc, _ = _launch_along(p, f, leg, r.dy, j, complex(leg.start, r.shift[j] * STEP))
                coordinate = arc.tilt.on_s1 / p.a0
                by[GROWING, j], growing = coordinate.imag / STEP, coordinate.real
        if leg.event == WHOLE:
            _carry_through_pieces(q, r, f.cubics, leg, inputs)
        else:
            carry_through_leg(q, r, f, leg, first, inputs)
        _store_angles(r, f, m, n, leg, first, inputs, by)
        if leg.event != WHOLE:
            carry_past_event(r, leg, first, inputs)
    for i in range(4):
        for j in range(first, inputs):
            by[END_STATE + i, j] = r.dy[i, j]
    return growing


@compiled
def store_impacts(q, legs, count, impacts):
    """Put times and rates after them of all impacts into `impacts`, shape (most, 2), NaN where there are
    fewer."""
    k = 0
    for n in range(count):
        leg = legs[n]
        if leg.kind == SLIP and leg.event == SECOND and k < len(impacts):
            impacts[k, _WHEN] = leg.piece * q.xi + leg.start + leg.duration
            # The next leg begins with the state after the impact; after the last one the block rests.
            impacts[k, _RATE] = legs[n + 1].y[TILT_RATE] if n + 1 < count else 0.0
            k += 1
    for i in range(k, len(impacts)):
        impacts[i, _WHEN] = impacts[i, _RATE] = np.nan


@compiled
def store_states(q, f, legs, count, times, out):
    """Put what a motion is at increasing `times` into rows of `out`, NaN beyond its end: the state with its
    accelerations (6), the forcing, the kind of the mode and the sign of the tilt."""
    at, y, h = 0, np.empty(4), span_of(q, f)
    for n in range(count):
        leg = legs[n]
        is_whole = leg.event == WHOLE
        length, delay = leg.duration, _ROUNDING * times[-1] if n == count - 1 else 0.0
        if leg.event == OVERTURN:
            # To the last time: the arc goes on.
            length = max(length, times[-1])
        for i in range(4):
            y[i] = leg.y[i]
        # Whole pieces are gone through one by one, since a time may lie in any of them.
        for k in range(int(length) if is_whole else 1):
            start, duration = (0.0 if is_whole else leg.start), (h if is_whole else length)
            e = load_at(q, f, leg.piece + k, start)
            arc = arc_from(q, leg, y, e)
            leg_start = (leg.piece + k) * h + start
            while at < len(times) and times[at] <= leg_start + duration + delay:
                t = times[at] - leg_start
                a = state_at(arc, instant(arc, t), t)
                for i in range(6):
                    out[at, i] = a[i]
                out[at, FORCING], out[at, KIND], out[at, SIDE] = q.f * forcing_at(e, t)[0], leg.kind, leg.tilt
                at += 1
            if is_whole:
                a = state_at(arc, instant(arc, h), h)
                for i in range(4):
                    y[i] = a[i]
    for k in range(at, len(times)):
        for i in range(out.shape[1]):
            out[k, i] = np.nan
