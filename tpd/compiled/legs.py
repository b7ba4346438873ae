"""Derivatives, states at requested times and impacts of a motion, computed from its legs.

Between events a leg has the closed form of its arc, and complex numbers carry the derivatives (see
`tpd.compiled.plant.STEP`). At an event, one Newton step on the event's time gives the saltation matrix. Over
whole pieces the state changes by an affine map. The map and its derivatives are computed once, so that a
piece costs a few products of small matrices.
"""

from __future__ import annotations

import numpy as np

from tpd.compiled.arcs import (
    Load,
    arc_from,
    beginning,
    cubic_load,
    forcing_at,
    instant,
    launch,
    load_at,
    span_of,
    state_at,
)
from tpd.compiled.columns import (
    REST,
    SLIP,
    STICK,
    SWING,
    SWING_PULL,
    SWING_RATE,
    TILT,
    TILT_PULL,
    TILT_RATE,
    WIDTH,
)
from tpd.compiled.contact_kernel import hold_margin, jump, moment, rates_after_impact, ratio
from tpd.compiled.events import BOB, CUT, END, FIRST, OVERTURN, RELATIVE, SECOND, STOP
from tpd.compiled.motion import WHOLE, angle_of, copy_to, larger_side
from tpd.compiled.plant import COMPLEX_PLANT, STEP, compiled, part, places

_KINDS = float(SLIP), float(STICK)
"""Modes of the maps of whole pieces, for the slipping and for the held block. A block that sticks and one at
rest have the same map."""
INPUTS = np.int64(WIDTH + 4)
"""Number of directions of the derivatives: the parameters and four components of the initial state."""
STATE, _BEGINNING = np.int64(WIDTH), np.int64(-1)
"""Index of the first direction of the initial state; and the index that stands for the start of the run in
`peak_legs`."""
OF_END, OF_GROWING, OF_TIMES, OF_UPLIFT, OUTPUTS = map(np.int64, (3, 7, 8, 11, 12))
"""Rows of the derivatives of a run under a ground motion, after those of the three angles: the state at the
end, the growing coordinate, the three times, and the time of the first uplift. The last number is the number
of rows."""
_TIME = np.int64(4)
"""Index of the local time at the start of a leg, after the state."""
_COEFFICIENTS, _ALL = np.int64(WIDTH + 5), np.int64(WIDTH + 9)
"""Index of the first direction of a coefficient of the forcing, and the number of all directions."""
FORCING, KIND, SIDE, STATES = map(np.int64, (6, 7, 8, 9))
"""Columns of a history after those of the state with its accelerations (forcing, kind of the mode, sign of
the tilt), and the number of columns."""
_BY_ONE, _BY_TIME, _BY_SQUARE, _BY_CUBE = places(8, 4)
"""Columns of the map of a piece for the coefficients of its forcing, after those of the state."""
_WHEN, _RATE = 0, 1
"""Columns of the table of impacts: time, and rate after the impact."""
_ROUNDING = 1e-12
"""Relative amount by which a requested time may exceed the end of the motion because of rounding."""
END_STATE, ANGLES, GROWING, TIMES, UPLIFT, ROWS = map(np.int64, (0, 4, 10, 11, 17, 18))
"""First rows of the derivatives, and the number of rows.

The rows are the state at the end (4), the six largest angles (6), and under a ground motion also the growing
coordinate at the start of the last leg (1), the times of the six angles (6), and that of the first uplift
(1). The row of a time that has no derivative is not written.
"""
READER = np.dtype(
    [
        ("plants", COMPLEX_PLANT, (WIDTH + 1,)),
        ("dy", np.float64, (4, int(_ALL))),
        ("shift", np.float64, (int(_ALL),)),
        ("now", np.float64, (6,)),
        ("maps", np.float64, (2, 4, 8)),
        ("slopes", np.float64, (2, 4, 8, int(INPUTS))),
        ("has_map", np.int64, (2,)),
    ],
    align=True,
)
"""A reader, which computes derivatives from legs: complex `plants`, one for each parameter and one for all
other directions; the derivatives `dy` of the state and `shift` of the local time, in all directions, in that
of the start time, and in the four coefficients of the forcing in the piece of a leg; the present state `now`
with its accelerations; the `maps` of whole pieces for the slipping and for the held block, their derivatives
`slopes`, and whether they are computed already (`has_map`)."""


@part
def _plant(r, j):
    """Return the complex plant of direction j. All directions that change no parameter share the last one."""
    return r.plants[min(j, STATE)]


@compiled
def _event_delay(q, f, leg, a, s, eta, rate):
    """Return the delay of the end of a leg, for a complex step in the direction of the derivative.

    `a` is the last state of the leg, `s` the local time of its start, and `eta` and `rate` are the forcing
    and its slope at the end.
    """
    # To first order the delay is the remaining value of the event's signal, divided by its slope.
    event = leg.event
    if event == END:
        # The duration of a free motion does not depend on anything.
        return (span_of(q, f) - s).imag if f.harmonic or leg.piece < f.pieces else -s.imag
    if event == STOP:
        return -(leg.piece * span_of(q, f) + s).imag
    # Turning points of the bob and cuts do not change the motion: such a leg keeps its length.
    if event >= BOB or event == CUT:
        return 0.0
    if leg.kind != SLIP:
        # A held block is released when its margin vanishes.
        value = hold_margin(q, leg.kind, complex(leg.tilt, 0.0), event, a[TILT], a[SWING], a[SWING_RATE], eta)
        side = 1.0 if event == FIRST else -1.0
        pull = (1.0 - q.up.real) * a[SWING_RATE].real + q.bias.real * a[SWING_PULL].real
        slope = -side * (pull - q.f.real * rate.real)
        return -value.imag / slope if slope != 0.0 else 0.0
    # The turning point of a slipping block: phi' vanishes. Otherwise it lands, and phi vanishes.
    if event == FIRST:
        return -a[TILT_RATE].imag / a[TILT_PULL].real if a[TILT_PULL].real != 0.0 else 0.0
    return -a[TILT].imag / a[TILT_RATE].real if a[TILT_RATE].real != 0.0 else 0.0


@compiled
def _launch_along(q, f, leg, dy, j, s):
    """Return the arc of a leg in direction j, and its forcing.

    `s` is the local time of the start of the leg.
    """
    e = load_at(q, f, leg.piece, s)
    y0, y1 = complex(leg.y[TILT], dy[TILT, j] * STEP), complex(leg.y[SWING], dy[SWING, j] * STEP)
    y2 = complex(leg.y[TILT_RATE], dy[TILT_RATE, j] * STEP)
    y3 = complex(leg.y[SWING_RATE], dy[SWING_RATE, j] * STEP)
    return launch(q, leg.kind, complex(leg.tilt, 0.0), complex(leg.direction, 0.0), y0, y1, y2, y3, e), e


@compiled
def _unit_load(q, j, s):
    """Return the forcing from the local time `s` on for the coefficient of direction j, with the value 1."""
    k, none = j - _COEFFICIENTS, 0.0 * s
    one = none + 1.0
    c0, c1 = (one if k == 0 else none), (one if k == 1 else none)
    return cubic_load(c0, c1, one if k == 2 else none, one if k == 3 else none, q.xi, s)


@compiled
def _free_motion(q, kind, now, y0, y1, y2, y3):
    """Return the state at an instant of a leg under a harmonic, if it starts from (y0, y1, y2, y3) and
    nothing acts on the block and the bob."""
    if kind != SLIP:
        still = 0.0 if kind == REST else y0
        return still, y1 * now.u + y3 * now.v, 0.0, y3 * now.u + (-q.held_q * y1 - q.held_p * y3) * now.v
    # The same sums as in `tpd.compiled.arcs.launch`, without the forcing.
    a = q.al0 * y0 + q.al1 * y1 + q.al2 * y2 + q.al3 * y3
    b = q.bl0 * y0 + q.bl1 * y1 + q.bl2 * y2 + q.bl3 * y3
    u0, u1 = y0 - a * q.a0 - b * q.b0, y1 - a * q.a1 - b * q.b1
    v0, v1 = y2 - a * q.a2 - b * q.b2, y3 - a * q.a3 - b * q.b3
    one, two, u, v = a * now.e1, b * now.e2, now.u, now.v
    tilt, swing = q.a0 * one + q.b0 * two + u0 * u + v0 * v, q.a1 * one + q.b1 * two + u1 * u + v1 * v
    one, two = q.s1 * one, q.s2 * two
    tilting = q.a0 * one + q.b0 * two + v0 * u + (-q.q * u0 - q.p * v0) * v
    return tilt, swing, tilting, q.a1 * one + q.b1 * two + v1 * u + (-q.q * u1 - q.p * v1) * v


@compiled
def _delay_of_change(q, leg, change, end, by, push, rate):
    """Return the derivative of the duration of a leg in a direction in which no parameter changes.

    `change` is the derivative of the last state at a fixed time, `end` that state with its accelerations, and
    `by` the derivative of the start time. `push` and `rate` are the derivative and the slope of the forcing
    at the end. The cases are those of `_event_delay`.
    """
    event = leg.event
    if event in (END, STOP):
        return -by
    if event >= BOB or event == CUT:
        return 0.0
    if leg.kind != SLIP:
        pull = (1.0 - q.up) * end[SWING_RATE] + q.bias * end[SWING_PULL] - q.f * rate
        value = moment(q, change[TILT], change[SWING], change[SWING_RATE], push)
        return -value / pull if pull != 0.0 else 0.0
    if event == FIRST:
        return -change[TILT_RATE] / end[TILT_PULL] if end[TILT_PULL] != 0.0 else 0.0
    return -change[TILT] / end[TILT_RATE] if end[TILT_RATE] != 0.0 else 0.0


@compiled
def carry_through_leg(q, r, f, leg, first, last):
    """Carry the derivatives of a reader to the end of a leg, before its event.

    `q` is the real plant. The directions are those from `first` to before `last`.
    """
    # The real state is read from every leg, so that its rounding errors do not add up.
    e, duration, none = load_at(q, f, leg.piece, leg.start), leg.duration, 0.0 * leg.start
    arc, free = arc_from(q, leg, leg.y, e), Load(e.xi, none, none, none, none, none)
    is_forced = not f.harmonic and leg.piece < f.pieces
    start, here = state_at(arc, beginning(arc), 0.0), instant(arc, duration)
    end, (_, rate) = state_at(arc, here, duration), forcing_at(e, duration)
    for j in range(first, min(last, STATE)):
        p, s, t = r.plants[j], complex(leg.start, r.shift[j] * STEP), complex(duration, 0.0)
        moved, of = _launch_along(p, f, leg, r.dy, j, s)
        a = state_at(moved, instant(moved, t), t)
        delay = _event_delay(p, f, leg, a, s, *forcing_at(of, t))
        # The leg ends later by the delay, during which the state moves with its rates.
        for i in range(4):
            r.dy[i, j] = (a[i].imag + a[i + 2].real * delay) / STEP
        r.shift[j] += delay / STEP
    for j in range(max(first, STATE), last):
        # No parameter changes in this direction, and real numbers are enough. The change of the state evolves
        # as a free motion without forcing, except for that of a coefficient of the forcing. A change of the
        # start time shifts the whole arc. Convert the change of the state to a fixed start time, let it
        # evolve along the leg, and convert it back at the end.
        d, by = r.dy, r.shift[j]
        y0, y1 = d[TILT, j] - start[TILT_RATE] * by, d[SWING, j] - start[SWING_RATE] * by
        y2, y3 = d[TILT_RATE, j] - start[TILT_PULL] * by, d[SWING_RATE, j] - start[SWING_PULL] * by
        push = 0.0
        if f.harmonic:
            c0, c1, c2, c3 = _free_motion(q, leg.kind, here, y0, y1, y2, y3)
        else:
            extra = _unit_load(q, j, leg.start) if j >= _COEFFICIENTS and is_forced else free
            arc_of_change = launch(q, leg.kind, none, none, y0, y1, y2, y3, extra)
            c0, c1, c2, c3, _, _ = state_at(arc_of_change, here, duration)
            push, _ = forcing_at(extra, duration)
        c0, c1 = c0 + end[TILT_RATE] * by, c1 + end[SWING_RATE] * by
        c2, c3 = c2 + end[TILT_PULL] * by, c3 + end[SWING_PULL] * by
        delay = _delay_of_change(q, leg, (c0, c1, c2, c3), end, by, rate * by + push, rate)
        d[TILT, j], d[SWING, j] = c0 + end[TILT_RATE] * delay, c1 + end[SWING_RATE] * delay
        d[TILT_RATE, j], d[SWING_RATE, j] = c2 + end[TILT_PULL] * delay, c3 + end[SWING_PULL] * delay
        r.shift[j] += delay
    for i in range(6):
        r.now[i] = end[i]


@compiled
def carry_past_event(q, r, leg, first, last):
    """Carry the derivatives of a reader from the end of a leg past its event, in the same directions."""
    # The local time starts again at zero in the next piece.
    if leg.event == END:
        for j in range(first, last):
            r.shift[j] = 0.0
    # A held block does not move until its release, and a later release leaves the same state.
    if leg.kind != SLIP or (leg.event != FIRST and leg.event != SECOND):
        return
    if leg.event == FIRST:
        for j in range(first, last):
            # A hop that ends in rest has its turning point on the base.
            r.dy[TILT, j], r.dy[TILT_RATE, j] = (0.0 if leg.ends_at_rest else r.dy[TILT, j]), 0.0
        return
    block, bob = jump(q, 0.0 if leg.ends_at_rest else ratio(q))
    for j in range(max(first, STATE), last):
        rate = r.dy[TILT_RATE, j]
        r.dy[TILT, j], r.dy[TILT_RATE, j] = 0.0, rate + block * rate
        r.dy[SWING_RATE, j] += bob * rate
    for j in range(first, min(last, STATE)):
        y2 = complex(r.now[TILT_RATE], r.dy[TILT_RATE, j] * STEP)
        y3 = complex(r.now[SWING_RATE], r.dy[SWING_RATE, j] * STEP)
        y2, y3 = rates_after_impact(r.plants[j], leg.ends_at_rest, y2, y3)
        # At a landing the tilt is zero for all parameters.
        r.dy[TILT, j], r.dy[TILT_RATE, j], r.dy[SWING_RATE, j] = 0.0, y2.imag / STEP, y3.imag / STEP


@compiled
def _store_maps(r, is_held, inputs):
    """Write the map of a piece and its derivatives into a reader.

    The map takes the state and the coefficients of the forcing to the state one piece later. The tilt is
    measured from the centre of its motion.
    """
    one, zero = complex(1.0, 0.0), complex(0.0, 0.0)
    u, kind = np.zeros(8, np.complex128), _KINDS[is_held]
    for j in range(inputs):
        q = _plant(r, j)
        h = q.xi
        for k in range(8):
            # The coefficients of the forcing belong to powers of the time divided by the duration of the
            # piece.
            for i in range(8):
                u[i] = zero if i != k else one
            cubic = u[_BY_SQUARE] / (h * h), u[_BY_CUBE] / (h * h * h)
            e = Load(zero, zero, u[_BY_ONE], u[_BY_TIME] / h, *cubic)
            # Both signs are zero, which switches weight and friction off.
            arc = launch(q, kind, zero, zero, u[TILT], u[SWING], u[TILT_RATE], u[SWING_RATE], e)
            end = state_at(arc, instant(arc, h), h)
            for i in range(4):
                r.maps[is_held, i, k], r.slopes[is_held, i, k, j] = end[i].real, end[i].imag / STEP


@compiled
def _carry_through_pieces(q, r, c, leg, inputs):
    """Carry the derivatives of a reader through whole pieces, which are rows of `c`."""
    is_held = 1 if leg.kind != SLIP else 0
    # All pieces have the same duration, so that one map serves them all.
    if r.has_map[is_held] == 0:
        _store_maps(r, is_held, inputs)
        r.has_map[is_held] = 1
    a, by, y, dy = r.maps[is_held], r.slopes[is_held], r.now, r.dy
    old, x, moved = np.empty((4, inputs)), np.empty(8), np.zeros(inputs)
    # The map is linear about the centre, which depends on weight and friction.
    centre = 0.0 if is_held else (leg.tilt * q.weight + leg.direction * q.k) / q.up
    for j in range(inputs):
        p = _plant(r, j)
        r.shift[j] = 0.0
        if not is_held:
            moved[j] = ((leg.tilt * p.weight + leg.direction * p.k) / p.up).imag / STEP
    copy_to(leg.y, y)
    first, last = leg.piece, leg.piece + int(leg.duration)
    # A record has no quadratic and no cubic term, so that the last two columns of the map are usually not
    # needed.
    terms = 6
    for n in range(first, last):
        terms = max(terms, 8 if c[n, 3] != 0.0 else (7 if c[n, 2] != 0.0 else 6))
    for n in range(first, last):
        for k in range(4):
            # Keep the old derivatives: the loop below overwrites them.
            x[k], x[4 + k] = y[k], c[n, k]
            for j in range(inputs):
                old[k, j] = dy[k, j]
        # Measure the tilt from the centre, and change back after the map.
        x[TILT] -= centre
        for j in range(inputs):
            old[TILT, j] -= moved[j]
        for i in range(4):
            # Product rule: the derivative of the map times the state, plus the map times the derivative of
            # the state.
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
    """Write the derivatives of the angles that are largest at the end of leg n into `by`.

    This includes the derivatives of their times.

    The derivatives of their times follow.
    """
    for k in range(6):
        if m.peak_legs[k] != n:
            continue
        for j in range(first, last):
            by[ANGLES + k, j] = angle_of(r.dy[TILT, j], r.dy[SWING, j], k)
        if n < 0 or f.harmonic:
            continue
        pieces = leg.piece + (leg.duration if leg.event == WHOLE else 0.0)
        for j in range(first, last):
            by[TIMES + k, j] = pieces * _plant(r, j).xi.imag / STEP + _shift_of_angle(r, leg, k, j)


@compiled
def _shift_of_angle(r, leg, k, j):
    """Return the derivative in direction j of the local time of the largest angle k, at the end of a leg."""
    if k < 2 or (leg.event != BOB and leg.event != RELATIVE):
        return r.shift[j]
    # A leg that ends where the bob turns keeps its length. The turning point itself is a little earlier or
    # later.
    apart = 1.0 if k > 3 else 0.0
    bend = r.now[SWING_PULL] - apart * r.now[TILT_PULL]
    return r.shift[j] - (r.dy[SWING_RATE, j] - apart * r.dy[TILT_RATE, j]) / bend


@compiled
def _uplift_leg(legs, count):
    """Return the index of the leg with which the block leaves its base for the first time.

    The result is -1 if the block never leaves its base, or if it does not start at rest.
    """
    if count > 0 and legs[0].kind == REST:
        for n in range(1, count):
            if legs[n].kind != REST:
                return n
    return -1


@compiled
def read_derivatives(q, f, m, legs, r, directions, angles_only, by):
    """Compute the derivatives of a motion from its legs, and return the growing coordinate of its last leg.

    `by` gets `ROWS` rows, and the columns from the first to before the last of `directions`. The reader must
    have its plants. If `angles_only`, the legs after the last of the largest angles and after the first
    uplift are not used.
    """
    count, (first, inputs) = min(m.n_legs, len(legs)), directions
    r.has_map[:] = 0
    for j in range(inputs):
        # At the start only the directions of the initial state change the state.
        r.shift[j] = 0.0
        for i in range(4):
            r.dy[i, j] = 1.0 if j == STATE + i else 0.0
    if count > 0:
        _store_angles(r, f, m, _BEGINNING, legs[0], first, inputs, by)
    growing, uplift_leg, last = 0.0, -1 if f.harmonic else _uplift_leg(legs, count), count
    if angles_only:
        last = uplift_leg
        for k in range(3):
            last = max(last, m.peak_legs[larger_side(m, k)])
        last = min(count, 1 + last)
    for n in range(last):
        leg = legs[n]
        if n == uplift_leg:
            for j in range(first, inputs):
                by[UPLIFT, j] = leg.piece * _plant(r, j).xi.imag / STEP + r.shift[j]
        if n == m.n_legs - 1 and not f.harmonic:
            # The last leg decides whether the block overturns or falls back.
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
            carry_past_event(q, r, leg, first, inputs)
    for i in range(4):
        for j in range(first, inputs):
            by[END_STATE + i, j] = r.dy[i, j]
    return growing


@compiled
def _carry_back_through_pieces(r, leg, back, out):
    """Carry derivatives from the end of a leg of whole pieces back to its start, see `read_forcing`."""
    is_held, old = (1 if leg.kind != SLIP else 0), np.empty(4)
    if r.has_map[is_held] == 0:
        _store_maps(r, is_held, 1)
        r.has_map[is_held] = 1
    a = r.maps[is_held]
    for n in range(leg.piece + int(leg.duration) - 1, leg.piece - 1, -1):
        for row in range(OUTPUTS):
            for i in range(4):
                old[i], back[row, i] = back[row, i], 0.0
            for i in range(4):
                for k in range(4):
                    back[row, k] += old[i] * a[i, k]
                    out[row, n, k] += old[i] * a[i, 4 + k]
    back[:, _TIME] = 0.0


@compiled
def read_forcing(q, f, m, legs, r, out):
    """Add the derivatives of a run's results in the coefficients of its forcing to `out`.

    The shape of `out` is (OUTPUTS, pieces, 4). The legs are read from the last to the first. `back` has the
    derivatives in the state and the local time at the start of a leg, and `through` those in all directions
    from `STATE` on. The reader must have its plants.
    """
    back, through, count = np.zeros((OUTPUTS, 5)), np.empty((OUTPUTS, _ALL)), min(m.n_legs, len(legs))
    uplift_leg = _uplift_leg(legs, count)
    r.has_map[:] = 0
    for i in range(4):
        back[OF_END + i, i] = 1.0
    for n in range(count - 1, -1, -1):
        leg = legs[n]
        through[:] = 0.0
        for j in range(STATE, _ALL):
            r.shift[j] = 1.0 if j == INPUTS else 0.0
            for i in range(4):
                r.dy[i, j] = 1.0 if j == STATE + i else 0.0
        if n == m.n_legs - 1 and leg.kind == SLIP:
            e, none = load_at(q, f, leg.piece, leg.start), 0.0 * leg.start
            for j in range(STATE, _ALL):
                extra = Load(none, none, none, none, none, none)
                if j == INPUTS:
                    extra = Load(none, none, e.e1, 2.0 * e.e2, 3.0 * e.e3, none)
                elif j >= _COEFFICIENTS and leg.piece < f.pieces:
                    extra = _unit_load(q, j, leg.start)
                y0, y1, y2, y3 = r.dy[TILT, j], r.dy[SWING, j], r.dy[TILT_RATE, j], r.dy[SWING_RATE, j]
                through[OF_GROWING, j] = (
                    launch(q, leg.kind, none, none, y0, y1, y2, y3, extra).tilt.on_s1 / q.a0
                )
        is_whole = leg.event == WHOLE
        if not is_whole:
            carry_through_leg(q, r, f, leg, STATE, _ALL)
        for k in range(3):
            best = larger_side(m, k)
            if m.peak_legs[best] == n and is_whole:
                back[k, TILT], back[k, SWING] = angle_of(1.0, 0.0, best), angle_of(0.0, 1.0, best)
            elif m.peak_legs[best] == n:
                for j in range(STATE, _ALL):
                    through[k, j] = angle_of(r.dy[TILT, j], r.dy[SWING, j], best)
                    through[OF_TIMES + k, j] = _shift_of_angle(r, leg, best, j)
        if is_whole:
            _carry_back_through_pieces(r, leg, back, out)
        else:
            carry_past_event(q, r, leg, STATE, _ALL)
        for row in range(OUTPUTS):
            for j in range(STATE, _ALL):
                through[row, j] += back[row, _TIME] * r.shift[j]
                for i in range(4):
                    through[row, j] += back[row, i] * r.dy[i, j]
            for i in range(5):
                back[row, i] = through[row, STATE + i]
            for k in range(4 if leg.piece < f.pieces else 0):
                out[row, leg.piece, k] += through[row, _COEFFICIENTS + k]
        if n == uplift_leg:
            back[OF_UPLIFT, _TIME] += 1.0


@compiled
def store_impacts(q, legs, count, impacts):
    """Write the times of all impacts and the rates after them into `impacts`, shape (n, 2).

    Unused rows are NaN.
    """
    k = 0
    for n in range(count):
        leg = legs[n]
        if leg.kind == SLIP and leg.event == SECOND and k < len(impacts):
            impacts[k, _WHEN] = leg.piece * q.xi + leg.start + leg.duration
            # The next leg starts with the state after the impact. After the last impact the block rests.
            impacts[k, _RATE] = legs[n + 1].y[TILT_RATE] if n + 1 < count else 0.0
            k += 1
    impacts[k:] = np.nan


@compiled
def store_states(q, f, legs, count, times, out):
    """Write the states of a motion at increasing `times` into rows of `out`.

    A row has the state with its accelerations (6), the forcing, the kind of the mode and the sign of the
    tilt. It is NaN for times after the end of the motion.
    """
    at, y, h = 0, np.empty(4), span_of(q, f)
    for n in range(count):
        leg = legs[n]
        is_whole = leg.event == WHOLE
        length, delay = leg.duration, _ROUNDING * times[-1] if n == count - 1 else 0.0
        if leg.event == OVERTURN:
            # The arc of a block that overturns continues until the last time.
            length = max(length, times[-1])
        copy_to(leg.y, y)
        # Whole pieces are treated one by one, because a time may lie in any of them.
        for k in range(int(length) if is_whole else 1):
            start, duration = (0.0 if is_whole else leg.start), (h if is_whole else length)
            e = load_at(q, f, leg.piece + k, start)
            arc = arc_from(q, leg, y, e)
            leg_start = (leg.piece + k) * h + start
            # All requested times that lie in this leg.
            while at < len(times) and times[at] <= leg_start + duration + delay:
                t = times[at] - leg_start
                a = state_at(arc, instant(arc, t), t)
                for i in range(6):
                    out[at, i] = a[i]
                eta, _ = forcing_at(e, t)
                out[at, FORCING], out[at, KIND], out[at, SIDE] = q.f * eta, leg.kind, leg.tilt
                at += 1
            if is_whole:
                a = state_at(arc, instant(arc, h), h)
                for i in range(4):
                    y[i] = a[i]
    out[at:] = np.nan
