"""Derivatives of motions of the linear equations under a ground motion, along their recorded legs.

A leg between events has the closed form of its arc: complex numbers carry its derivatives, and one Newton
step on the time of its event the saltation (see `tpd.models.linear_derivatives`). Over pieces without an
event the state goes through an affine map; the map and its derivatives are computed once, so that a piece
costs a few products of small matrices.
"""

from __future__ import annotations

import numpy as np

from tpd.exact.arc_kernel import STEP, compiled, instant, places, plant_along, state_at, struck
from tpd.exact.cubic_kernel import Cubic, cubic_at, forcing_of, launch_cubic
from tpd.exact.event_kernel import reserve
from tpd.exact.event_search import BOB, END, FIRST, RELATIVE
from tpd.exact.mode_kinds import REST, SLIP, STICK
from tpd.models.shaken_kernel import BEST, LEGS, WHERE, WHOLE

INPUTS = 13
"""Directions of derivatives: nine parameters and four components of a state."""
PLANTS = 10
"""Complex plants: one for each parameter, and one for directions in which none changes."""
GROWING, TIMES = places(9, 7)
UPLIFT, ROWS = places(13, 11)
"""Quantities with derivatives: largest |phi|, |psi| and |psi - phi|, the state at the end, the growing
coordinate at the start of the last leg (row 7), the times of the three angles (from row 8 on), that of the
first uplift (row 11), and how many there are. A time without a derivative leaves its row as it is."""
_HELD = float(STICK)


@compiled
def _put_maps(plants, kind, inputs, a, by):
    """Put the map (state, coefficients of the forcing) -> state of a piece into `a`, shape (4, 8), and its
    derivatives into `by`, shape (4, 8, inputs). The tilt counts from the centre of its motion."""
    one, zero = complex(1.0, 0.0), complex(0.0, 0.0)
    for j in range(inputs):
        q = plants[min(j, PLANTS - 1)]
        h, u = q.xi, np.zeros(8, np.complex128)
        for k in range(8):
            # The forcing is given by its coefficients in the share of the piece.
            for i in range(8):
                u[i] = zero if i != k else one
            e = Cubic(u[4], u[5] / h, u[6] / (h * h), u[7] / (h * h * h))
            # One map serves both kinds of held blocks.
            held = kind if kind == SLIP else _HELD
            # No weight and no friction: both signs are zero.
            arc = launch_cubic(q, held, zero, zero, u[0], u[1], u[2], u[3], e)
            end = state_at(arc, instant(arc, h), h)
            for i in range(4):
                a[i, k], by[i, k, j] = end[i].real, end[i].imag / STEP


@compiled
def _through_pieces(c, first, count, a, by, centre, moved, y, dy, inputs):
    """Take a state and its derivatives through whole pieces. `centre` is that of the tilt's motion and
    `moved` its derivatives."""
    # A record has no square and no cube: half of the coefficients are left out.
    terms = 8
    while terms > 6 and not np.any(c[first : first + count, terms - 5 : terms - 4]):
        terms -= 1
    old, x = np.empty((4, inputs)), np.empty(8)
    for n in range(first, first + count):
        for k in range(4):
            x[k], x[4 + k] = y[k], c[n, k]
            for j in range(inputs):
                old[k, j] = dy[k, j]
        # The map is linear about the centre, which moves with weight and friction.
        x[0] -= centre
        for j in range(inputs):
            old[0, j] -= moved[j]
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
        y[0] += centre
        for j in range(inputs):
            dy[0, j] += moved[j]


@compiled
def _late(q, kind, tilt, which, a, eta, rate, left):
    """How much later a leg ends, in the direction of the derivative, over `STEP`; compare
    `tpd.models.linear_derivatives`. `left` is the time to its horizon."""
    if which == END:
        return left.imag
    if which >= BOB:
        return 0.0
    if kind != SLIP:
        value = reserve(q, kind, complex(tilt, 0.0), which, a[0], a[1], a[3], eta)
        side = 1.0 if which == FIRST else -1.0
        pull = (1.0 - q.up.real) * a[3].real + q.bias.real * a[5].real
        slope = -side * (pull - q.f.real * rate.real)
        return -value.imag / slope if slope != 0.0 else 0.0
    if which == FIRST:
        return -a[2].imag / a[4].real if a[4].real != 0.0 else 0.0
    return -a[0].imag / a[2].real if a[2].real != 0.0 else 0.0


@compiled
def _leg(q, c, n, leg, dy, j, shift):
    """Take direction j of the derivatives `dy` to the end of a recorded leg, before its event. `shift` is the
    derivative of its beginning in its piece; return that of its end."""
    kind, tilt, way, piece, began, lasted = leg[0], leg[1], leg[2], int(leg[3]), leg[4], leg[5]
    h, s, t = q.xi, complex(began, shift * STEP), complex(lasted, 0.0)
    e = cubic_at(c, n, piece, h, s)
    y0, y1 = complex(leg[8], dy[0, j] * STEP), complex(leg[9], dy[1, j] * STEP)
    y2, y3 = complex(leg[10], dy[2, j] * STEP), complex(leg[11], dy[3, j] * STEP)
    arc = launch_cubic(q, kind, complex(tilt, 0.0), complex(way, 0.0), y0, y1, y2, y3, e)
    a = state_at(arc, instant(arc, t), t)
    eta, rate = forcing_of(e, t)
    # The horizon of the free motion does not depend on anything.
    end = h if piece < n else complex(0.0, 0.0)
    late = _late(q, kind, tilt, leg[6], a, eta, rate, end - s)
    for i in range(4):
        dy[i, j] = (a[i].imag + a[i + 2].real * late) / STEP
    return shift + late / STEP


@compiled
def _after(q, leg, dy, j, y):
    """Change direction j at the end of a recorded leg to that after its event; `y` is the state there."""
    kind, which, rests = leg[0], leg[6], leg[7] != 0.0
    if kind != SLIP or which == END or which >= BOB:
        return
    # At a landing the tilt is zero whatever the parameters; a hop that ends in rest takes the turn there too.
    dy[0, j] = dy[0, j] if which == FIRST and not rests else 0.0
    if which == FIRST:
        dy[2, j] = 0.0
    else:
        y2, y3 = struck(q, rests, complex(y[2], dy[2, j] * STEP), complex(y[3], dy[3, j] * STEP))
        dy[2, j], dy[3, j] = y2.imag / STEP, y3.imag / STEP


@compiled
def _met_at(tally, k):
    """The leg at whose end largest angle k was met (-1 is the beginning), and to which side."""
    right, left = BEST + 2 * k, BEST + 2 * k + 1
    # The larger of both sides; where they are equal, the derivative is that to the right.
    best, side = (right, 1.0) if tally[right] >= tally[left] else (left, -1.0)
    return int(tally[WHERE + best - BEST]), side


@compiled
def _put_extremes(tally, leg, dy, by, inputs):
    """Put the derivatives of the largest angles that were met at the end of this leg into `by`."""
    for k in range(3):
        where, side = _met_at(tally, k)
        if where == leg:
            for j in range(inputs):
                psi = dy[1, j] - (dy[0, j] if k == 2 else 0.0)
                by[k, j] = side * (dy[0, j] if k == 0 else psi)


@compiled
def _put_times(tally, m, leg, end, plants, shift, dy, by, inputs):
    """Put the derivatives of the times at which largest angles were met at the end of this leg into `by`;
    `end` is the state there with its accelerations, and `shift` the derivatives of the time in its piece."""
    pieces = leg[3] + (leg[5] if leg[6] == WHOLE else 0.0)
    for k in range(3):
        where, _ = _met_at(tally, k)
        if where == m:
            # Where the bob turns the leg ends at a fixed time: the turn itself is a little earlier or later.
            turns = k > 0 and (leg[6] == BOB or leg[6] == RELATIVE)
            bend = end[5] - (end[4] if k == 2 else 0.0)
            for j in range(inputs):
                rate = dy[3, j] - (dy[2, j] if k == 2 else 0.0)
                late = -rate / bend if turns else 0.0
                by[TIMES + k, j] = pieces * plants[min(j, PLANTS - 1)].xi.imag / STEP + shift[j] + late


@compiled
def _lifts_at(legs, count):
    """The leg with which a block leaves its base for the first time; -1 if it never does, or has left it from
    the beginning."""
    if count > 0 and legs[0, 0] == REST:
        for m in range(1, count):
            if legs[m, 0] != REST:
                return m
    return -1


@compiled
def _last_extreme(tally):
    """The last leg at whose end one of the largest angles was met."""
    last = -1
    for k in range(3):
        where, _ = _met_at(tally, k)
        last = max(last, where)
    return last


@compiled
def _end_of(q, c, n, leg, end):
    """Put the state at the end of a recorded leg, before its event, and its accelerations into `end`."""
    e = cubic_at(c, n, int(leg[3]), q.xi, leg[4])
    arc = launch_cubic(q, leg[0], leg[1], leg[2], leg[8], leg[9], leg[10], leg[11], e)
    a = state_at(arc, instant(arc, leg[5]), leg[5])
    for i in range(6):
        end[i] = a[i]


@compiled
def _growing(q, c, n, leg, dy, j, shift):
    """Growing coordinate of the arc of a leg at its start, as a complex number with direction j."""
    e = cubic_at(c, n, int(leg[3]), q.xi, complex(leg[4], shift * STEP))
    y0, y1 = complex(leg[8], dy[0, j] * STEP), complex(leg[9], dy[1, j] * STEP)
    y2, y3 = complex(leg[10], dy[2, j] * STEP), complex(leg[11], dy[3, j] * STEP)
    arc = launch_cubic(q, leg[0], complex(leg[1], 0.0), complex(leg[2], 0.0), y0, y1, y2, y3, e)
    return arc.tilt.on_s1 / q.a0


@compiled
def differentiate(x, q, plants, c, n, legs, tally, inputs, angles_only, by):
    """Put the derivatives of a followed motion into `by`, shape (8, inputs), and return the growing
    coordinate of its last leg. `inputs` is 9 for the parameters alone, or 13. If `angles_only`, those of the
    largest angles, their times and the first uplift: what comes after the last of these is left out."""
    for j in range(PLANTS):
        plant_along(x, j, plants[j])
    a, slopes, known = np.empty((2, 4, 8)), np.empty((2, 4, 8, inputs)), np.zeros(2)
    dy, shift, moved, y = np.zeros((4, inputs)), np.zeros(inputs), np.zeros(inputs), np.zeros(6)
    for i in range(4):
        if inputs > 9:
            dy[i, 9 + i] = 1.0
    _put_extremes(tally, -1, dy, by, inputs)
    growing = 0.0
    count = min(int(tally[LEGS]), len(legs))
    lifts = _lifts_at(legs, count)
    if angles_only:
        count = min(count, 1 + max(lifts, _last_extreme(tally)))
    for m in range(count):
        leg = legs[m]
        slips = leg[0] == SLIP
        if m == lifts:
            for j in range(inputs):
                by[UPLIFT, j] = leg[3] * plants[min(j, PLANTS - 1)].xi.imag / STEP + shift[j]
        # The last leg decides between overturning and falling back.
        if m == int(tally[LEGS]) - 1:
            for j in range(inputs):
                coordinate = _growing(plants[min(j, PLANTS - 1)], c, n, leg, dy, j, shift[j])
                by[GROWING, j], growing = coordinate.imag / STEP, coordinate.real
        if leg[6] == WHOLE:
            kind = 0 if slips else 1
            if known[kind] == 0.0:
                _put_maps(plants, leg[0], inputs, a[kind], slopes[kind])
                known[kind] = 1.0
            for j in range(inputs):
                p = plants[min(j, PLANTS - 1)]
                centre = (leg[1] * p.weight + leg[2] * p.k) / p.up if slips else complex(0.0, 0.0)
                moved[j] = centre.imag / STEP
                shift[j] = 0.0
            centre = (leg[1] * q.weight + leg[2] * q.k) / q.up if slips else 0.0
            for i in range(4):
                y[i] = leg[8 + i]
            _through_pieces(c, int(leg[3]), int(leg[5]), a[kind], slopes[kind], centre, moved, y, dy, inputs)
            _put_extremes(tally, m, dy, by, inputs)
            _put_times(tally, m, leg, y, plants, shift, dy, by, inputs)
            continue
        # The real state begins anew with every leg, so that errors of it do not add up.
        _end_of(q, c, n, leg, y)
        for j in range(inputs):
            shift[j] = _leg(plants[min(j, PLANTS - 1)], c, n, leg, dy, j, shift[j])
        _put_extremes(tally, m, dy, by, inputs)
        _put_times(tally, m, leg, y, plants, shift, dy, by, inputs)
        for j in range(inputs):
            _after(plants[min(j, PLANTS - 1)], leg, dy, j, y)
            # The next piece begins at its own zero of time.
            if leg[6] == END:
                shift[j] = 0.0
    for i in range(4):
        for j in range(inputs):
            by[3 + i, j] = dy[i, j]
    return growing
