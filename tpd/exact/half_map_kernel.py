"""The derivative of the mirrored half-period map of a symmetric orbit, and its eigenvalues, in compiled code.

The orbit is its own mirror image, so that -(the map over half a period) has it as a fixed point, and with G
the derivative of that map, cut just after the turn, G G is that of the whole map: half the work, and twice
the resolution of multipliers near 1. G is the product of the flows of both arcs and of a saltation matrix for
each event: a neighbour meets the event a little earlier or later, and meanwhile moves by the rates of the
other side."""

from __future__ import annotations

import math

from tpd.exact.arcs import state_at
from tpd.exact.plant import compiled


@compiled
def _put_flow(q, f, matrix):
    """Put the flow until an instant into a matrix."""
    a, b = (q.a0, q.a1), (q.b0, q.b1)
    al, bl = (q.al0, q.al1, q.al2, q.al3), (q.bl0, q.bl1, q.bl2, q.bl3)
    for i in range(2):
        for j in range(4):
            # Component i of unit vector j: its shares of the real modes, and the rest with its rate.
            x, y = al[j] * a[i], bl[j] * b[i]
            u = (1.0 if j == i else 0.0) - x - y
            v = (1.0 if j == i + 2 else 0.0) - q.s1 * x - q.s2 * y
            matrix[i, j] = x * f.e1 + y * f.e2 + u * f.u + v * f.v
            matrix[i + 2, j] = q.s1 * x * f.e1 + q.s2 * y * f.e2 + v * f.u - (q.q * u + q.p * v) * f.v


@compiled
def put_half_map(q, m, t, way, matrices):
    """Put G into the last of three matrices."""
    early, late, g = matrices[0], matrices[1], matrices[2]
    _put_flow(q, way.before, early)
    _put_flow(q, way.end, late)
    before, after = state_at(way.first, way.before, t), state_at(way.second, way.after, 0.0 * t)
    end = state_at(way.second, way.end, m.span - t)
    # Crossing: the rates jump by these shares of phi', and so do the rates of a neighbour.
    lost, thrown = q.e - 1.0, 2.0 / q.lam * (q.e - 1.0)
    by0, by1 = (after[2] - before[2]) / before[2], (after[3] - before[3]) / before[2]
    by2 = (after[4] - (1.0 + lost) * before[4]) / before[2]
    by3 = (after[5] - before[5] - thrown * before[4]) / before[2]
    for j in range(4):
        tilt, rate = early[0, j], early[2, j]
        early[0, j] += by0 * tilt
        early[1, j] += by1 * tilt
        early[2, j] += by2 * tilt + lost * rate
        early[3, j] += by3 * tilt + thrown * rate
    # Turning: friction, 2 k in the first column of M^-1, changes its sign.
    pushed = 2.0 * q.k / ((q.m11 * q.m22 - q.m12 * q.m21) * end[4])
    for j in range(4):
        for i in range(4):
            g[i, j] = -(
                late[i, 0] * early[0, j]
                + late[i, 1] * early[1, j]
                + late[i, 2] * early[2, j]
                + late[i, 3] * early[3, j]
            )
        rate = g[2, j]
        g[2, j] -= pushed * q.m22 * rate
        g[3, j] += pushed * q.m21 * rate
    # A bob without mass cannot be felt: what is left are the multipliers of the block, and two zeros.
    if q.mu.real == 0.0:
        for i in range(4):
            for j in range(4):
                if i % 2 == 1 or j % 2 == 1:
                    g[i, j] = 0.0


@compiled
def _minors(a, b):
    """Determinants of two rows in two of their columns: 01, 02, 03, 12, 13, 23."""
    a0, a1, a2, a3, b0, b1, b2, b3 = a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]
    first = a0 * b1 - a1 * b0, a0 * b2 - a2 * b0, a0 * b3 - a3 * b0
    return *first, a1 * b2 - a2 * b1, a1 * b3 - a3 * b1, a2 * b3 - a3 * b2


@compiled
def characteristic(g):
    """Coefficients c1 to c4 of det(z - g) = z^4 + c1 z^3 + c2 z^2 + c3 z + c4, by the principal minors."""
    # Minors of the two upper rows, and of the two lower ones, by their columns.
    u01, u02, u03, u12, u13, u23 = _minors(g[0], g[1])
    l01, l02, l03, l12, l13, l23 = _minors(g[2], g[3])
    c2 = u01 + l23
    for i in range(2):
        for j in range(2, 4):
            c2 += g[i, i] * g[j, j] - g[i, j] * g[j, i]
    c3 = g[2, 0] * u12 - g[2, 1] * u02 + g[2, 2] * u01 + g[3, 0] * u13 - g[3, 1] * u03 + g[3, 3] * u01
    c3 += g[0, 0] * l23 - g[0, 2] * l03 + g[0, 3] * l02 + g[1, 1] * l23 - g[1, 2] * l13 + g[1, 3] * l12
    c4 = u01 * l23 - u02 * l13 + u03 * l12 + u12 * l03 - u13 * l02 + u23 * l01
    return -(g[0, 0] + g[1, 1] + g[2, 2] + g[3, 3]), c2, -c3, c4


@compiled
def determinants(c1, c2, c3, c4):
    """det(I - G), det(I + G) and the product of 1 - g_i g_j over all pairs of eigenvalues: they vanish at a
    fold, a loss of symmetry, and a torus; see `tpd.core.eigenvalues`."""
    y = 1.0 + c4
    torus = ((y - c2) * y + c1 * c3 - 4.0 * c4) * y - (c3 * c3 + c1 * c1 * c4 - 4.0 * c2 * c4)
    return 1.0 + c1 + c2 + c3 + c4, 1.0 - c1 + c2 - c3 + c4, torus


@compiled
def put_roots(c, re, im):
    """Put the roots of z^4 + c1 z^3 + c2 z^2 + c3 z + c4 into `re` and `im`, by Aberth's iteration; see
    `tpd.core.eigenvalues`."""
    c1, c2, c3, c4 = c
    radius = max(max(abs(c1), math.sqrt(abs(c2))), max(abs(c3) ** (1.0 / 3.0), math.sqrt(math.sqrt(abs(c4)))))
    # No symmetry about the real axis, which the iteration would preserve.
    angles, shares = (0.4, 1.97, 3.54, 5.11), (1.0, 0.8, 0.5, 0.25)
    for i in range(4):
        re[i], im[i] = shares[i] * radius * math.cos(angles[i]), shares[i] * radius * math.sin(angles[i])
    # Without coefficients all roots are zero, which the guesses are already.
    for _ in range(60 if radius > 0.0 else 0):
        moved = 0.0
        for i in range(4):
            z, value, slope, push = complex(re[i], im[i]), 1.0 + 0.0j, 0.0j, 0.0j
            for coefficient in c:
                slope, value = slope * z + value, value * z + coefficient
            for j in range(4):
                if j != i:
                    # Two guesses that coincide do not repel each other: 0 instead of 0/0.
                    a, b = re[i] - re[j], im[i] - im[j]
                    push += complex(a, -b) / max(a * a + b * b, 1e-300)
            below = slope - value * push
            step = value * below.conjugate() / max(below.real * below.real + below.imag * below.imag, 1e-300)
            re[i], im[i] = re[i] - step.real, im[i] - step.imag
            moved = max(moved, abs(step.real) + abs(step.imag))
        # The bound is for multiple roots, whose last digits may never settle.
        if moved <= 1e-15 * radius:
            break
