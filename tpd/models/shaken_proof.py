"""Proof that a piece of a ground motion has no event, from the states at its two ends.

Between two ends a signal is near the cubic through its values and slopes there: a bound on its fourth
derivative says how near. Most pieces of a record are proved this way, at the cost of one step.
"""

from __future__ import annotations

import math

from tpd.exact.arc_kernel import compiled, moment, places
from tpd.exact.cubic_kernel import forcing_of
from tpd.exact.event_search import AWAY
from tpd.exact.mode_kinds import SLIP, STICK
from tpd.models.shaken_tally import BEST

_FOURTH, _FIFTH = places(2)
"""Derivatives that are bounded."""
_SWING, _RELATIVE = places(3, 1)
"""Places of angles in a tally."""


@compiled
def put_bounds(q, bounds):
    """Put bounds on the fourth and fifth derivatives of the pair's two solutions into `bounds`, shape
    (2, 2, 2), for the slipping block and the held one: the energy x^2 + x'^2/q only decreases."""
    for held in range(2):
        p, s = (q.held_p, q.held_q) if held else (q.p, q.q)
        for i in range(2):
            # Of the solution that begins at (1, 0), and of that which begins at (0, 1).
            u, v = (1.0, 0.0) if i == 0 else (0.0, 1.0)
            for power in range(5):
                u, v = v, -s * u - p * v
                if power > 2:
                    bounds[held, power - 3, i] = math.sqrt(u * u + v * v / s)


@compiled
def _rough(arc, x, growth, fifth, bounds, held):
    """Bound on the fourth or fifth derivative of a signal over a piece; that of the forcing is zero."""
    # The growing exponential is largest at the end of the piece, the falling one at its start.
    r1, r2 = arc.s1 * arc.s1, arc.s2 * arc.s2
    r1, r2 = r1 * r1, r2 * r2
    if fifth:
        r1, r2 = r1 * abs(arc.s1), r2 * abs(arc.s2)
    pair = bounds[held, fifth, 0] * abs(x.on_u) + bounds[held, fifth, 1] * abs(x.on_v)
    return pair + abs(x.on_s1) * r1 * growth + abs(x.on_s2) * r2


@compiled
def _clear(g0, v0, g1, v1, d, bound):
    """Whether a signal with these values and slopes at the ends of a window stays positive in it."""
    least = min(min(g0, g1), min(g0 + d * v0 / 3.0, g1 - d * v1 / 3.0))
    # A bob that hangs still does not turn.
    return least > bound * d * d * d * d * AWAY or (g0 == 0.0 and v0 == 0.0 and g1 == 0.0 and v1 == 0.0)


@compiled
def _stays(q, mode, e, h, a, b, bound):
    """Whether a held block stays where it is over a piece; `a` and `b` are the states at its ends, with their
    accelerations."""
    at, rate = forcing_of(e, 0.0)
    to, onward = forcing_of(e, h)
    stuck = mode[0] == STICK
    # Off its base the block has its weight to one side, on its base to both.
    level, hold = (mode[1] * q.weight if stuck else 0.0), q.k + (0.0 if stuck else q.weight)
    m, n = moment(q, a[0], a[1], a[3], at) - level, moment(q, b[0], b[1], b[3], to) - level
    u = (1.0 - q.up) * a[3] + q.bias * a[5] - q.f * rate
    v = (1.0 - q.up) * b[3] + q.bias * b[5] - q.f * onward
    return _clear(hold - m, -u, hold - n, -v, h, bound) and _clear(hold + m, u, hold + n, v, h, bound)


@compiled
def _no_record(tally, k, x0, x1, acceleration0, acceleration1, fourth, h):
    """Whether an angle, whose rate may change its sign in a piece, stays below the largest so far. Between
    its ends a signal is above both by h^2/8 of its largest second derivative at most."""
    # Second derivatives are known at the ends; between them the fourth bounds their growth.
    curved = max(abs(acceleration0), abs(acceleration1)) + h * h / 8.0 * fourth
    most = max(abs(x0), abs(x1)) + h * h / 8.0 * curved
    return most < max(tally[BEST + 2 * k], tally[BEST + 2 * k + 1])


@compiled
def _bob_is_clear(arc, held, h, a, b, growth, tally, bounds, tilt4, tilt5):
    """Whether the bob neither turns in a piece, nor turns against the block, unless below its largest angles
    so far: a strongly damped bob follows every sample of a record."""
    g0, v0, g1, v1 = a[3] - a[2], a[5] - a[4], b[3] - b[2], b[5] - b[4]
    bob, side = math.copysign(1.0, a[3]), math.copysign(1.0, g0)
    bob5, bob4 = (
        _rough(arc, arc.bob, growth, _FIFTH, bounds, held),
        _rough(arc, arc.bob, growth, _FOURTH, bounds, held),
    )
    clear = _clear(bob * a[3], bob * a[5], bob * b[3], bob * b[5], h, bob5)
    if not clear and not _no_record(tally, _SWING, a[1], b[1], a[5], b[5], bob4, h):
        return False
    if (held and clear) or _clear(side * g0, side * v0, side * g1, side * v1, h, tilt5 + bob5):
        return True
    return _no_record(tally, _RELATIVE, a[1] - a[0], b[1] - b[0], v0, v1, tilt4 + bob4, h)


@compiled
def without_event(q, arc, mode, e, h, a, b, growth, tally, bounds):
    """Whether a whole piece is proved to have no event; arguments as in `_stays`."""
    held, tilt, way = (0 if mode[0] == SLIP else 1), mode[1], mode[2]
    tilt5, tilt4 = (
        _rough(arc, arc.tilt, growth, _FIFTH, bounds, held),
        _rough(arc, arc.tilt, growth, _FOURTH, bounds, held),
    )
    if q.mu > 0.0 and not _bob_is_clear(arc, held, h, a, b, growth, tally, bounds, tilt4, tilt5):
        return False
    if held:
        bob5 = _rough(arc, arc.bob, growth, _FIFTH, bounds, held)
        bob4 = _rough(arc, arc.bob, growth, _FOURTH, bounds, held)
        return _stays(q, mode, e, h, a, b, abs(1.0 - q.up) * bob4 + abs(q.bias) * bob5)
    if not _clear(way * a[2], way * a[4], way * b[2], way * b[4], h, tilt5):
        return False
    # A block that tilts further lands nowhere before it turns.
    if tilt * way > 0.0:
        return True
    return _clear(tilt * a[0], tilt * a[2], tilt * b[0], tilt * b[2], h, tilt4)
