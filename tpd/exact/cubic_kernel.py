"""Arcs of the linear equations under a base acceleration that is a cubic in time, in compiled scalar code.

A ground motion is given piece by piece: on each piece eta, minus the base acceleration over that of gravity,
is a cubic in time. A record is linear between its samples, so that its pieces are exact. With
M u'' + C u' + K u = b eta and eta = sum e_j s^j the particular solution is a cubic too,

    K u_j = b e_j - (j + 1) C u_{j+1} - (j + 2)(j + 1) M u_{j+2},

because K = diag(-(1 + 2 mu), 1) is never singular. What is left of the state moves freely, as in
`tpd.exact.arc_kernel`. The sum is written as the Taylor polynomial of degree 3 at the start of an arc, whose
coefficients follow from the state by the equations themselves, and what is left of the free motion beyond it.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact.arc_kernel import Arc, Instant, Signal, compiled
from tpd.exact.mode_kinds import REST, SLIP

Cubic = namedtuple("Cubic", "e0 e1 e2 e3")
"""Forcing over its full size: e0 + e1 s + e2 s^2 + e3 s^3, with s from the start of the arc."""
START = Instant(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The functions of time at the start of an arc."""


@compiled
def cubic_at(c, n, i, h, s):
    """Forcing from the local time `s` of piece i on; zero after the last. Row i of `c` has the coefficients
    in the share of the piece, whose duration is `h`."""
    # After the motion nothing shakes the base.
    if i >= n:
        zero = 0.0 * h
        return Cubic(zero, zero, zero, zero)
    a, b, g = c[i, 1] / h, c[i, 2] / (h * h), c[i, 3] / (h * h * h)
    return Cubic(
        c[i, 0] + s * (a + s * (b + s * g)), a + s * (2.0 * b + 3.0 * s * g), b + 3.0 * s * g, g + 0.0 * s
    )


@compiled
def forcing_of(e, t):
    """Value and slope of a cubic."""
    return e.e0 + t * (e.e1 + t * (e.e2 + t * e.e3)), e.e1 + t * (2.0 * e.e2 + 3.0 * t * e.e3)


@compiled
def _held(q, e):
    """Particular solution of a bob under a held block."""
    # From the highest power down.
    p3 = q.f * e.e3
    p2 = q.f * e.e2 - 3.0 * q.c2 * p3
    p1 = q.f * e.e1 - 2.0 * q.c2 * p2 - 6.0 * q.m22 * p3
    return q.f * e.e0 - q.c2 * p1 - 2.0 * q.m22 * p2, p1, p2, p3


@compiled
def _onward(q, e, j, a1, b1, a2, b2):
    """Coefficients of tilt and bob at one power of time, from those at the two powers above."""
    r, m = q.f * e, (j + 1.0) * (j + 2.0)
    turn = (j + 1.0) * (a1 - b1)
    tilt = r + (q.c1 * turn + m * (q.m11 * a2 + q.m12 * b2)) / q.up
    return tilt, r + q.c2 * turn - m * (q.m21 * a2 + q.m22 * b2)


@compiled
def launch_cubic(q, kind, tilt, way, y0, y1, y2, y3, e):
    """The arc that leaves a state in a mode under the forcing `e`; compare `tpd.exact.arc_kernel.launch`."""
    zero = 0.0 * (q.f + e.e0 + y0)
    # Accelerations and their slopes at the start, by the equations and by their derivative in time.
    balance = (tilt * q.weight + way * q.k) / q.up
    up, swing = accelerations(q, kind, balance, y0, y1, y2, y3, e.e0)
    faster, swinging = accelerations(q, kind, 0.0 * balance, y2, y3, up, swing, e.e1)
    if kind != SLIP:
        b0, b1, _, _ = _held(q, e)
        leaning = zero if kind == REST else y0 + zero
        still = Signal(leaning, zero, zero, zero, zero, zero, zero, zero, zero)
        u, v = y1 - b0 + zero, y3 - b1 + zero
        bob = Signal(y1 + zero, zero, zero, u, v, y3 + zero, swing / 2.0 + zero, zero, swinging / 6.0 + zero)
        return Arc(still, bob, zero, zero, q.held_p + zero, q.held_q + zero, zero, zero)
    # Tilt and bob from the highest power down; the static answer to eta is eta for both.
    a3, b3 = _onward(q, e.e3, 3.0, zero, zero, zero, zero)
    a2, b2 = _onward(q, e.e2, 2.0, a3, b3, zero, zero)
    a1, b1 = _onward(q, e.e1, 1.0, a2, b2, a3, b3)
    a0, b0 = _onward(q, e.e0, 0.0, a1, b1, a2, b2)
    centre = balance + a0
    f0, f1, f2, f3 = y0 - centre, y1 - b0, y2 - a1, y3 - b1
    a = q.al0 * f0 + q.al1 * f1 + q.al2 * f2 + q.al3 * f3
    b = q.bl0 * f0 + q.bl1 * f1 + q.bl2 * f2 + q.bl3 * f3
    u0, u1 = f0 - a * q.a0 - b * q.b0, f1 - a * q.a1 - b * q.b1
    v0, v1 = f2 - a * q.a2 - b * q.b2, f3 - a * q.a3 - b * q.b3
    leaning = Signal(y0 + zero, a * q.a0, b * q.b0, u0, v0, y2 + zero, up / 2.0, zero, faster / 6.0)
    bob = Signal(y1 + zero, a * q.a1, b * q.b1, u1, v1, y3 + zero, swing / 2.0, zero, swinging / 6.0)
    return Arc(leaning, bob, q.s1 + zero, q.s2 + zero, q.p + zero, q.q + zero, zero, zero)


@compiled
def accelerations(q, kind, centre, y0, y1, y2, y3, eta):
    """phi'' and psi'' of a state whose tilt counts from `centre`; `eta` is the forcing over its full size."""
    slip = y2 - y3
    r2 = q.f * eta - y1 + q.c2 * slip
    if kind != SLIP:
        return 0.0 * r2, (q.f * eta - y1 - q.c2 * y3) / q.m22
    r1 = q.up * (y0 - centre - q.f * eta) - q.c1 * slip
    by = 1.0 / (q.m11 * q.m22 - q.m12 * q.m21)
    return by * (q.m22 * r1 - q.m12 * r2), by * (q.m11 * r2 - q.m21 * r1)


@compiled
def put_map(q, kind, h, out):
    """Put the map (state, coefficients of the forcing in the share of a piece) -> change of the state over a
    piece of duration h into `out`, shape (4, 8). The tilt counts from its centre.

    It is a part of the exponential, less the identity, of a matrix for the state and the derivatives of the
    forcing together: a low tilt, far from its centre, is not lost beside the distance from it. Unlike the
    closed form of an arc it has no particular solution, which is large where the forcing is quicker than the
    block and would cancel once in every piece.
    """
    n, x = np.zeros((8, 8)), np.zeros(5)
    for j in range(5):
        x[j] = 1.0
        a, b = accelerations(q, kind, 0.0, x[0], x[1], x[2], x[3], x[4])
        n[2, j], n[3, j], x[j] = h * a, h * b, 0.0
    n[1, 3], n[4, 5], n[5, 6], n[6, 7] = h, 1.0, 1.0, 1.0
    n[0, 2] = h if kind == SLIP else 0.0
    # Halved until the series converges quickly, and squared as often.
    halved = max(0, math.ceil(math.log2(max(np.max(np.abs(n)), 1e-3))) + 4)
    n /= 2.0**halved
    total, term = n.copy(), n.copy()
    for i in range(2, 16):
        term = term @ n / i
        total = total + term
    # (1 + E)^2 = 1 + 2 E + E^2.
    for _ in range(halved):
        total = 2.0 * total + total @ total
    for i in range(4):
        for j in range(8):
            out[i, j] = total[i, j] * (2.0 if j == 6 else (6.0 if j == 7 else 1.0))
