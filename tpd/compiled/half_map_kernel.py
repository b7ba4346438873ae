"""The derivative of the mirrored half-period map of a symmetric orbit, and its eigenvalues.

A symmetric orbit is its own mirror image, so that it is a fixed point of minus the map over half a period.
Let G be the derivative of that map, from one turning point to the next. Then G G is the derivative of the map
over a whole period. So G takes half the work and separates multipliers near 1 twice as well. G is the product
of the flows of both arcs and of a saltation matrix for each event: a neighbouring motion reaches the event a
little earlier or later, and meanwhile it moves with the rates of the other side.
"""

from __future__ import annotations

import math

from tpd.compiled import columns
from tpd.compiled.columns import SWING, SWING_PULL, SWING_RATE, TILT, TILT_PULL, TILT_RATE
from tpd.compiled.contact import impact
from tpd.compiled.half_period_kernel import Instant, state_at
from tpd.compiled.plant import compiled, shared

is_neutral = shared(columns.is_neutral)
"""`columns.is_neutral`, which compiled code can call."""


@compiled
def _after_flow(q, f, y0, y1, y2, y3):
    """Return a small difference of states after a flow."""
    a = q.al0 * y0 + q.al1 * y1 + q.al2 * y2 + q.al3 * y3
    b = q.bl0 * y0 + q.bl1 * y1 + q.bl2 * y2 + q.bl3 * y3
    # The pair has the rest of the difference, and the rest of its rate.
    u0, u1 = y0 - a * q.a0 - b * q.b0, y1 - a * q.a1 - b * q.b1
    v0, v1 = y2 - a * q.a2 - b * q.b2, y3 - a * q.a3 - b * q.b3
    a, b = a * f.e1, b * f.e2
    tilt, bob = a * q.a0 + b * q.b0 + u0 * f.u + v0 * f.v, a * q.a1 + b * q.b1 + u1 * f.u + v1 * f.v
    rate = a * q.a2 + b * q.b2 + v0 * f.u - (q.q * u0 + q.p * v0) * f.v
    return tilt, bob, rate, a * q.a3 + b * q.b3 + v1 * f.u - (q.q * u1 + q.p * v1) * f.v


@compiled
def store_half_map(q, m, t, path, g):
    """Write the matrix G of a path with its crossing at `t` into `g`."""
    zero, until = 0.0 * t, path.crossing
    # The instant at the start of the second arc, with the phase of the forcing at the crossing.
    again = Instant(1.0 + zero, 1.0 + zero, 1.0 + zero, zero, until.sine, until.cosine)
    before, after = state_at(path.first, until), state_at(path.second, again)
    end = state_at(path.second, path.end)
    # Saltation at the crossing: a neighbour jumps by the same shares of its own phi'.
    (block_jump, bob_jump), rate0 = impact(q, False, 1.0, zero), before[TILT_RATE]
    by0, by1 = (after[TILT_RATE] - rate0) / rate0, (after[SWING_RATE] - before[SWING_RATE]) / rate0
    by2 = (after[TILT_PULL] - (1.0 + block_jump) * before[TILT_PULL]) / rate0
    by3 = (after[SWING_PULL] - before[SWING_PULL] - bob_jump * before[TILT_PULL]) / rate0
    # Saltation at the turning point: friction changes its sign, which is 2 k in the first column of M^-1.
    pushed = 2.0 * q.k / ((q.m11 * q.m22 - q.m12 * q.m21) * end[TILT_PULL])
    # A massless bob does not act on the block. The block has two multipliers then, and the other two are
    # zero.
    column_step = 2 if q.mu.real == 0.0 else 1
    g[:] = 0.0
    for j in range(0, 4, column_step):
        # Column j of G: a unit difference, carried through the first arc, the crossing, the second arc and
        # the turning point.
        y0, y1, y2, y3 = zero + (j == 0), zero + (j == 1), zero + (j == 2), zero + (j == 3)
        y0, y1, y2, y3 = _after_flow(q, until, y0, y1, y2, y3)
        y1, y2, y3 = y1 + by1 * y0, y2 + by2 * y0 + block_jump * y2, y3 + by3 * y0 + bob_jump * y2
        y0, y1, y2, y3 = _after_flow(q, path.end, y0 + by0 * y0, y1, y2, y3)
        g[TILT, j], g[TILT_RATE, j] = -y0, pushed * q.m22 * y2 - y2
        if column_step == 1:
            g[SWING, j], g[SWING_RATE, j] = -y1, -pushed * q.m21 * y2 - y3


@compiled
def _minors(a, b):
    """Return the 2 x 2 determinants of two rows, in the columns 01, 02, 03, 12, 13 and 23."""
    a0, a1, a2, a3 = a[TILT], a[SWING], a[TILT_RATE], a[SWING_RATE]
    b0, b1, b2, b3 = b[TILT], b[SWING], b[TILT_RATE], b[SWING_RATE]
    first = a0 * b1 - a1 * b0, a0 * b2 - a2 * b0, a0 * b3 - a3 * b0
    return *first, a1 * b2 - a2 * b1, a1 * b3 - a3 * b1, a2 * b3 - a3 * b2


@compiled
def characteristic(g):
    """Return the coefficients of the characteristic polynomial of a 4 x 4 matrix.

    det(z - g) = z^4 + c1 z^3 + c2 z^2 + c3 z + c4. The coefficients follow from the principal minors.
    """
    # Minors of the two upper rows (u) and of the two lower rows (l), by their columns.
    u01, u02, u03, u12, u13, u23 = _minors(g[TILT], g[SWING])
    l01, l02, l03, l12, l13, l23 = _minors(g[TILT_RATE], g[SWING_RATE])
    c2 = u01 + l23
    for i in range(2):
        for j in range(2, 4):
            c2 += g[i, i] * g[j, j] - g[i, j] * g[j, i]
    c3 = g[2, 0] * u12 - g[2, 1] * u02 + g[2, 2] * u01 + g[3, 0] * u13 - g[3, 1] * u03 + g[3, 3] * u01
    c3 += g[0, 0] * l23 - g[0, 2] * l03 + g[0, 3] * l02 + g[1, 1] * l23 - g[1, 2] * l13 + g[1, 3] * l12
    c4 = u01 * l23 - u02 * l13 + u03 * l12 + u12 * l03 - u13 * l02 + u23 * l01
    return -(g[0, 0] + g[1, 1] + g[2, 2] + g[3, 3]), c2, -c3, c4


@compiled
def determinants(c):
    """Return det(I - G), det(I + G), and the product of 1 - g_i g_j over all pairs of eigenvalues.

    They vanish at a fold, at a loss of symmetry, and at a torus bifurcation. `c` has the coefficients of the
    characteristic polynomial of G.
    """
    c1, c2, c3, c4 = c
    # The sums y = g_i g_j + g_k g_l are the roots of the quartic's resolvent cubic, which is evaluated at 1 +
    # c4.
    y = 1.0 + c4
    torus = ((y - c2) * y + c1 * c3 - 4.0 * c4) * y - (c3 * c3 + c1 * c1 * c4 - 4.0 * c2 * c4)
    return 1.0 + c1 + c2 + c3 + c4, 1.0 - c1 + c2 - c3 + c4, torus


@compiled
def _store_square(a, out):
    """Write the square of a 4 x 4 matrix into `out`."""
    for i in range(4):
        for j in range(4):
            total = 0.0 * a[i, j]
            for k in range(4):
                total += a[i, k] * a[k, j]
            out[i, j] = total


@compiled
def remaining(g, xi, power):
    """Return the factor per forcing period by which a disturbance of the block falls, from the half map `g`.

    Let D_n be the derivative of the map over n forcing periods, in the rows and columns of the block, with
    rates over xi. The result is the geometric mean of |D_2|^(1/2) and |D_4|^(1/4) (Frobenius norms). Powers
    of a matrix are smooth functions, and a sum of squares of complex entries has no conjugates, so that
    complex steps give derivatives.
    """
    # G^2 is the map over a period. Three more squarings give the maps over two and four periods.
    odd, even = power
    _store_square(g, odd)
    _store_square(odd, even)
    two = _of_block(even, xi)
    _store_square(even, odd)
    return two**0.125 * _of_block(odd, xi) ** 0.0625


@compiled
def _of_block(d, xi):
    """Return the mean square factor of a disturbance of the block of any direction, with rates over xi."""
    a, b, c = d[TILT, TILT], d[TILT, TILT_RATE] * xi, d[TILT_RATE, TILT] / xi
    return 0.5 * (a * a + b * b + c * c + d[TILT_RATE, TILT_RATE] * d[TILT_RATE, TILT_RATE])


@compiled
def store_roots(c, z):
    """Compute the roots of z^4 + c1 z^3 + c2 z^2 + c3 z + c4, and write them into `z`.

    Aberth's iteration is Newton's method for all roots at once, in which the roots repel each other: z_i
    changes by p/(p' - p sum_j 1/(z_i - z_j)). So no two iterates converge to the same simple root, and no
    error of a root affects the next one. At a double root the convergence is linear, and the root has half of
    the digits. Rounding errors of the coefficients cost most digits of roots that are far smaller than the
    largest one. This does no harm, because only multipliers near or above 1 matter.
    """
    c1, c2, c3, c4 = c
    # All roots lie within twice max |c_k|^(1/k) (Fujiwara's bound).
    radius = max(max(abs(c1), math.sqrt(abs(c2))), max(abs(c3) ** (1.0 / 3.0), math.sqrt(math.sqrt(abs(c4)))))
    # The initial guesses are not symmetric about the real axis, because the iteration would preserve such a
    # symmetry.
    angles, shares = (0.4, 1.97, 3.54, 5.11), (1.0, 0.8, 0.5, 0.25)
    for i in range(4):
        z[i] = shares[i] * radius * complex(math.cos(angles[i]), math.sin(angles[i]))
    # If all coefficients are zero, so are the roots and the guesses.
    for _ in range(60 if radius > 0.0 else 0):
        moved = 0.0
        for i in range(4):
            value, slope, push = 1.0 + 0.0j, 0.0j, 0.0j
            for coefficient in c:
                # Horner's scheme for the polynomial and its derivative.
                slope, value = slope * z[i] + value, value * z[i] + coefficient
            for j in range(4):
                if j != i:
                    push += _inverse(z[i] - z[j])
            step = value * _inverse(slope - value * push)
            z[i] -= step
            moved = max(moved, abs(step.real) + abs(step.imag))
        # The bound on the steps is for multiple roots, whose last digits may never settle.
        if moved <= 1e-15 * radius:
            break


@compiled
def _inverse(z):
    """Return 1/z, but 0 for z = 0, so that two equal guesses do not repel each other."""
    return z.conjugate() / max(z.real * z.real + z.imag * z.imag, 1e-300)
