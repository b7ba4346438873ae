"""Whole pieces of a pulse or a record, which are taken in one step if they are proved to have no event.

Between two ends a signal is close to the cubic through its values and slopes there, and a bound on its fourth
derivative says how close (see `tpd.compiled.events`). Most pieces of a record are proved in this way.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled.arcs import accelerations, arc_from, forcing_at, load_at
from tpd.compiled.columns import (
    APART,
    REST,
    SLIP,
    STICK,
    SWING,
    SWING_PULL,
    SWING_RATE,
    TILT,
    TILT_PULL,
    TILT_RATE,
)
from tpd.compiled.contact_kernel import beyond_return, moment
from tpd.compiled.events import AWAY
from tpd.compiled.motion import WHOLE, copy_to, largest, record_leg, update_angles
from tpd.compiled.plant import compiled, places

_FOURTH, _FIFTH = places(2)
"""Indices of the derivatives that have bounds."""
_C0, _C1, _C2, _C3 = places(8, 4)
"""Columns of a map for the coefficients of the forcing, after those of the state."""
_CONSTANT, _LINEAR, _SQUARE, _CUBE = places(4)
"""Columns of these coefficients in a row of pieces."""
_U, _V = places(2)
"""Solutions of the pair that start at (1, 0) and at (0, 1)."""
_KINDS = float(SLIP), float(REST)
"""Kinds of the modes of both maps. A block that sticks and one at rest have the same map."""


@compiled
def store_map(q, kind, h, out):
    """Write the map of a piece of duration h into `out`, shape (4, 8).

    The map takes the state and the coefficients of the forcing to the change of the state over the piece. The
    coefficients are for powers of the time divided by h, and the tilt is measured from its centre.

    The map is a part of the matrix exponential, minus the identity, of a system for the state and the
    derivatives of the forcing. A low tilt far from its centre keeps its digits. Unlike the closed form of an
    arc, the map contains no particular solution. That solution is large where the forcing is faster than the
    block, and would cancel in every piece.
    """
    # The columns of the generator are the rates of change for unit states.
    n, x = np.zeros((8, 8)), np.zeros(5)
    for j in range(5):
        x[j] = 1.0
        a, b = accelerations(q, kind, 0.0, x[TILT], x[SWING], x[TILT_RATE], x[SWING_RATE], x[_C0])
        n[TILT_RATE, j], n[SWING_RATE, j], x[j] = h * a, h * b, 0.0
    n[SWING, SWING_RATE], n[_C0, _C1], n[_C1, _C2], n[_C2, _C3] = h, 1.0, 1.0, 1.0
    n[TILT, TILT_RATE] = h if kind == SLIP else 0.0
    # Scaling and squaring: the matrix is halved until its series converges quickly, and the result is squared
    # as often.
    largest = 1e-3
    for i in range(8):
        for j in range(8):
            largest = max(largest, abs(n[i, j]))
    halved = max(0, math.ceil(math.log2(largest)) + 4)
    total, term, spare = np.zeros((8, 8)), np.empty((8, 8)), np.empty((8, 8))
    for i in range(8):
        for j in range(8):
            n[i, j] /= 2.0**halved
            total[i, j] = term[i, j] = n[i, j]
    for i in range(2, 16):
        _store_product(term, n, 1.0 / i, spare)
        term, spare = spare, term
        _add(total, term)
    # (1 + E)^2 = 1 + 2 E + E^2, so that E keeps its small values.
    for _ in range(halved):
        _store_product(total, total, 1.0, spare)
        _add(total, total)
        _add(total, spare)
    for i in range(4):
        for j in range(8):
            # The system has the derivatives of the forcing, which are 2! and 3! times the coefficients.
            out[i, j] = total[i, j] * (2.0 if j == _C2 else (6.0 if j == _C3 else 1.0))


@compiled
def _store_product(a, b, factor, out):
    """Write the product of two matrices times a factor into a third one."""
    for i in range(8):
        for j in range(8):
            total = 0.0
            for k in range(8):
                total += a[i, k] * b[k, j]
            out[i, j] = factor * total


@compiled
def _add(a, b):
    """Add the second matrix to the first one."""
    for i in range(8):
        for j in range(8):
            a[i, j] += b[i, j]


@compiled
def store_bounds(q, bounds):
    """Write bounds on the fourth and fifth derivatives of the pair's two solutions into `bounds`.

    `bounds` has shape (2, 2, 2).

    The axes are: slipping or held block, order of the derivative, solution. The energy x^2 + x'^2/q never
    grows.
    """
    for is_held in range(2):
        p, s = (q.held_p, q.held_q) if is_held else (q.p, q.q)
        for i in range(2):
            # The initial values of the two solutions. Each pass below differentiates once.
            u, v = (1.0, 0.0) if i == 0 else (0.0, 1.0)
            for power in range(5):
                u, v = v, -s * u - p * v
                if power > 2:
                    bounds[is_held, power - 3, i] = math.sqrt(u * u + v * v / s)


@compiled
def _bound(arc, x, growth, order, bounds):
    """Return a bound on the fourth or fifth derivative of a signal over a piece.

    The derivatives of the forcing of these orders are zero.
    """
    # The rising exponential is largest at the end of the piece, and the decaying one at its start.
    r1, r2 = arc.s1 * arc.s1, arc.s2 * arc.s2
    r1, r2 = r1 * r1, r2 * r2
    if order == _FIFTH:
        r1, r2 = r1 * abs(arc.s1), r2 * abs(arc.s2)
    pair = bounds[order, _U] * abs(x.on_u) + bounds[order, _V] * abs(x.on_v)
    return pair + abs(x.on_s1) * r1 * growth + abs(x.on_s2) * r2


@compiled
def _positive(g0, v0, g1, v1, d, bound):
    """Whether a signal stays positive within a window of length d.

    The arguments are its values (g0, g1) and slopes (v0, v1) at both ends, and a bound on its fourth
    derivative.
    """
    smallest = min(min(g0, g1), min(g0 + d * v0 / 3.0, g1 - d * v1 / 3.0))
    # A bob that hangs still has no turning point.
    return smallest > bound * d * d * d * d * AWAY or (g0 == 0.0 and v0 == 0.0 and g1 == 0.0 and v1 == 0.0)


@compiled
def _remains_held(q, m, e, h, a, b, bound):
    """Whether a held block stays held over a piece.

    `a` and `b` are the states at both ends, with their accelerations.
    """
    at, rate = forcing_at(e, 0.0)
    to, onward = forcing_at(e, h)
    stuck = m.kind == STICK
    # Off its base the block has its weight on one side, and on its base on both.
    level, hold = (m.tilt * q.weight if stuck else 0.0), q.k + (0.0 if stuck else q.weight)
    m = moment(q, a[TILT], a[SWING], a[SWING_RATE], at) - level
    n = moment(q, b[TILT], b[SWING], b[SWING_RATE], to) - level
    u = (1.0 - q.up) * a[SWING_RATE] + q.bias * a[SWING_PULL] - q.f * rate
    v = (1.0 - q.up) * b[SWING_RATE] + q.bias * b[SWING_PULL] - q.f * onward
    return _positive(hold - m, -u, hold - n, -v, h, bound) and _positive(hold + m, u, hold + n, v, h, bound)


@compiled
def _is_below_largest(m, k, x0, x1, bend, fourth, h):
    """Whether angle k stays below its largest value so far, even if it turns within the piece.

    `bend` is the larger absolute value of its second derivatives at both ends, and `fourth` bounds the fourth
    derivative.
    """
    # Between its ends an angle exceeds the larger end value by at most h^2/8 times its largest second
    # derivative. The fourth derivative bounds how much larger that is than at the ends.
    upper = max(abs(x0), abs(x1)) + h * h / 8.0 * (bend + h * h / 8.0 * fourth)
    return upper < largest(m, k)


@compiled
def _bob_is_clear(m, is_held, h, a, b, fourths, fifths):
    """Whether psi and psi - phi have no turning point in a piece, or none above their largest values so far.

    The second case is common: a strongly damped bob follows every sample of a record. `fourths` and `fifths`
    are the bounds for tilt and bob.
    """
    (tilt4, bob4), (tilt5, bob5) = fourths, fifths
    r0, u0, r1, u1 = a[SWING_RATE], a[SWING_PULL], b[SWING_RATE], b[SWING_PULL]
    g0, v0, g1, v1 = r0 - a[TILT_RATE], u0 - a[TILT_PULL], r1 - b[TILT_RATE], u1 - b[TILT_PULL]
    bob, side = math.copysign(1.0, r0), math.copysign(1.0, g0)
    clear = _positive(bob * r0, bob * u0, bob * r1, bob * u1, h, bob5)
    if not clear and not _is_below_largest(m, SWING, a[SWING], b[SWING], max(abs(u0), abs(u1)), bob4, h):
        return False
    if (is_held and clear) or _positive(side * g0, side * v0, side * g1, side * v1, h, tilt5 + bob5):
        return True
    bend = max(abs(v0), abs(v1))
    return _is_below_largest(m, APART, a[SWING] - a[TILT], b[SWING] - b[TILT], bend, tilt4 + bob4, h)


@compiled
def _has_no_event(q, m, arc, e, a, b, growth, bounds, bob):
    """Whether a whole piece is proved to have no event.

    `a` and `b` are the states at both ends, with their accelerations. `bob` says whether its turning points
    count.
    """
    h, is_held = q.xi, m.kind != SLIP
    rows = bounds[1 if is_held else 0]
    tilt4, tilt5 = _bound(arc, arc.tilt, growth, _FOURTH, rows), _bound(arc, arc.tilt, growth, _FIFTH, rows)
    if bob or is_held:
        bob4, bob5 = _bound(arc, arc.bob, growth, _FOURTH, rows), _bound(arc, arc.bob, growth, _FIFTH, rows)
        if bob and not _bob_is_clear(m, is_held, h, a, b, (tilt4, bob4), (tilt5, bob5)):
            return False
        if is_held:
            return _remains_held(q, m, e, h, a, b, abs(1.0 - q.up) * bob4 + abs(q.bias) * bob5)
    tilt, sign = m.tilt, m.direction
    v, u, w, x = sign * a[TILT_RATE], sign * a[TILT_PULL], sign * b[TILT_RATE], sign * b[TILT_PULL]
    if not _positive(v, u, w, x, h, tilt5):
        return False
    # A block that moves away from its base must turn before it can land.
    if tilt * sign > 0.0:
        return True
    return _positive(tilt * a[TILT], tilt * a[TILT_RATE], tilt * b[TILT], tilt * b[TILT_RATE], h, tilt4)


@compiled
def store_maps(q, w):
    """Fill the workspace with the maps and bounds of a plant.

    All pieces have the same duration, so that two maps are enough.
    """
    store_bounds(q, w.bounds)
    for is_held in range(2):
        store_map(q, _KINDS[is_held], q.xi, w.maps[is_held])


@compiled
def whole_pieces(q, f, m, legs, w, i, turns):
    """Follow a motion from the start of piece i while whole pieces are proved to have no event.

    Returns the index of the next piece.

    `turns` says whether turning points of the bob count.
    """
    h, first, limit, kind, y = q.xi, i, beyond_return(q), m.kind, m.y
    start, end, is_held = w.start, w.end, kind != SLIP
    copy_to(y, start)
    # A held block keeps its tilt, which needs no centre.
    centre = 0.0 if is_held else (m.tilt * q.weight + m.direction * q.k) / q.up
    growth, by, c = math.exp(q.s1 * h), w.maps[1 if is_held else 0], f.cubics
    while i < f.pieces:
        # The arc is needed for the bounds only. The state is advanced by the map, which loses fewer digits.
        e = load_at(q, f, i, 0.0)
        arc = arc_from(q, m, y, e)
        tilt, bob, tilting, swinging = y[TILT], y[SWING], y[TILT_RATE], y[SWING_RATE]
        c0, c1, c2, c3 = c[i, _CONSTANT], c[i, _LINEAR], c[i, _SQUARE], c[i, _CUBE]
        for k in range(4):
            change = by[k, TILT] * (tilt - centre) + by[k, SWING] * bob
            change = change + by[k, TILT_RATE] * tilting + by[k, SWING_RATE] * swinging
            change += by[k, _C0] * c0 + by[k, _C1] * c1 + by[k, _C2] * c2 + by[k, _C3] * c3
            end[k] = y[k] + change
        # States at both ends, with their accelerations.
        up, swing = accelerations(q, kind, centre, tilt, bob, tilting, swinging, e.e0)
        a = tilt, bob, tilting, swinging, up, swing
        tilt, bob, tilting, swinging = end[TILT], end[SWING], end[TILT_RATE], end[SWING_RATE]
        up, swing = accelerations(q, kind, centre, tilt, bob, tilting, swinging, c0 + c1 + c2 + c3)
        b = tilt, bob, tilting, swinging, up, swing
        if not (abs(tilt) < limit and _has_no_event(q, m, arc, e, a, b, growth, w.bounds, turns)):
            break
        copy_to(end, y)
        i += 1
    # All pieces together are one leg.
    if i > first:
        update_angles(m, y[TILT], y[SWING], i * h)
        record_leg(m, legs, first, 0.0, float(i - first), WHOLE, start)
    return i
