"""What a day with Numba gives: closed-form arcs and events in compiled scalar code.

It follows the linear equations with true signs and without the parametric term, for x = (nu, mu, lam, zeta,
k, f, xi, e), a uniform rectangle, lam > 0 and the forcing sin(xi tau), for a count of forcing periods that it
is told. The amplitude is the largest |phi| of the last period. It recognises no orbit, samples its signals 28
times a period and can miss two events between two samples, and has neither derivatives nor statuses.

On an arc, y = (phi, psi, phi', psi') = (centre, 0, 0, 0) + harmonic response + W z. The growing and
the decaying mode z0, z1 are scaled by exp(rate t); z2 and z3 are the other pair, two complex or two
real rates a +- sqrt(-d), with the real flow z2' = a z2 - d z3, z3' = z2 + a z3, regular at d = 0.
The state stays in these coordinates: a change of sign of s or sigma moves only the centre.
"""

import math
from collections import namedtuple

import numpy as np
from numba import njit, prange

from tests.benchmarks.precision.following import GONE
from tests.benchmarks.precision.methods import Method, Unable
from tests.benchmarks.precision.scenes import Scene

QUIET = 1e-8
"""An impact slower than this (phi' in units of nu) ends a rattle, if the block can be held."""
EVENTS = 2000
"""Bound on the events of a run, per forcing period."""
PERIODS = (15, 25, 50, 100, 200)
STEP, FLOOR = 3e-5, 0.1
"""Of a difference over the parameter, or over `FLOOR` if that is larger: arcs are exact to round-off."""

_Plant = namedtuple(
    "_Plant",
    "weight k e up lam quiet xi r0 r1 a d b fast phi rate pull psi swing l0 l1 l2 l3 hs hc ps pc "
    "step e0 e1 ec es sx cx of_psi of_swing f ha hd hb hec hes qs qc mu_ mv ms mc",
)
"""The constants of one design: parameters; rates; the rows of W for phi, phi', phi'', psi, psi';
the columns of its inverse; the harmonic responses; the flow over one sample step; the moment; the
same for the bob of a held block."""


@njit(forceinline=True)
def _dot(a, z):
    return a[0] * z[0] + a[1] * z[1] + a[2] * z[2] + a[3] * z[3]


@njit(forceinline=True)
def _add(z, a, x):
    return z[0] + a[0] * x, z[1] + a[1] * x, z[2] + a[2] * x, z[3] + a[3] * x


@njit(forceinline=True)
def _pair(d, b, t):
    """cos(b t) and sin(b t)/b with b^2 = d, also where d <= 0."""
    if d > 0.0:
        return math.cos(b * t), math.sin(b * t) / b
    if d < 0.0:
        return math.cosh(b * t), math.sinh(b * t) / b
    return 1.0, t


@njit
def _real_root(c4, c3, c2, c1, c0, far):
    """The root between 0 and `far` of a quartic that changes sign between them."""
    lo, hi, s = 0.0, far, 0.5 * far
    for _ in range(200):
        value = (((c4 * s + c3) * s + c2) * s + c1) * s + c0
        slope = ((4.0 * c4 * s + 3.0 * c3) * s + 2.0 * c2) * s + c1
        if value < 0.0:
            lo = s
        else:
            hi = s
        new = s - value / slope if slope != 0.0 else 0.5 * (lo + hi)
        if not min(lo, hi) < new < max(lo, hi):
            new = 0.5 * (lo + hi)
        if abs(new - s) <= 2e-16 * abs(s):
            break
        s = new
    return s


@njit
def _plant(x):
    nu, mu, lam, zeta, k, f, xi, e = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]
    rho = 3.0 / (4.0 * (1.0 + nu * nu))
    inertia, hinge, up = lam * rho, 2.0 * zeta * math.sqrt(lam * rho), 1.0 + 2.0 * mu
    big, weight = 1.0 + mu * rho * (4.0 + nu * nu), (1.0 + mu) * nu
    # det(M s^2 + C s + K): one positive root at least, one negative, by the sign of det K.
    drag = mu * lam * hinge
    c4 = inertia * (1.0 + mu * rho * nu * nu)
    c3 = big * hinge + drag * inertia - 2.0 * inertia * mu * hinge - 2.0 * rho * drag
    c2 = big - up * inertia
    c1 = drag - up * hinge
    c0 = -up
    far = 1.0 + max(abs(c3), abs(c2), abs(c1), abs(c0)) / c4
    r0, r1 = _real_root(c4, c3, c2, c1, c0, far), _real_root(c4, c3, c2, c1, c0, -far)
    # What is left over: s^2 - 2 a s + a^2 + d.
    a = -0.5 * (c3 / c4 + r0 + r1)
    d = c0 / c4 / (r0 * r1) - a * a
    if d < 0.0:
        # Three real roots beside r0: the pair is the closest two of them.
        far_, near = a - math.sqrt(-d), a + math.sqrt(-d)
        x0, x2 = min(r1, far_), max(r1, near)
        x1 = r1 + far_ + near - x0 - x2
        if x1 - x0 < x2 - x1:
            r1, far_, near = x2, x0, x1
        else:
            r1, far_, near = x0, x1, x2
        a, d = 0.5 * (far_ + near), -0.25 * (near - far_) ** 2
    b = math.sqrt(abs(d))
    w = np.empty((4, 4))
    for i in range(2):
        r = r0 if i == 0 else r1
        w[0, i], w[1, i] = (inertia * r + hinge) * r + 1.0, (2.0 * rho * r + hinge) * r
        w[2, i], w[3, i] = r * w[0, i], r * w[1, i]
    # The same polynomials at s = a + q with q^2 = -d: the part in q, and the part without.
    w[0, 2], w[0, 3] = 2.0 * inertia * a + hinge, inertia * (a * a - d) + hinge * a + 1.0
    w[1, 2], w[1, 3] = 4.0 * rho * a + hinge, 2.0 * rho * (a * a - d) + hinge * a
    for i in range(2):
        w[i + 2, 2], w[i + 2, 3] = a * w[i, 2] + w[i, 3], a * w[i, 3] - d * w[i, 2]
    inv = np.linalg.inv(w)
    phi, psi = (w[0, 0], w[0, 1], w[0, 2], w[0, 3]), (w[1, 0], w[1, 1], w[1, 2], w[1, 3])
    rate, swing = (w[2, 0], w[2, 1], w[2, 2], w[2, 3]), (w[3, 0], w[3, 1], w[3, 2], w[3, 3])
    pull = (r0 * w[2, 0], r1 * w[2, 1], a * w[2, 2] + w[2, 3], a * w[2, 3] - d * w[2, 2])
    # The response to f Im exp(i xi t).
    s2, s1 = -xi * xi, 1j * xi
    m11, m12 = big * s2 + drag * s1 - up, -2.0 * mu * inertia * s2 - drag * s1
    m21, m22 = -2.0 * rho * s2 - hinge * s1, inertia * s2 + hinge * s1 + 1.0
    det = m11 * m22 - m12 * m21
    hp, hb_ = f * (-up * m22 - m12) / det, f * (m11 + up * m21) / det
    # The bob of a held block, and the moment (up phi is added where it is used).
    q = f / m22
    ha, hd = -0.5 * hinge / inertia, 1.0 / inertia - (0.5 * hinge / inertia) ** 2
    hb = math.sqrt(abs(hd))
    of_psi, of_swing = -2.0 * mu, mu * hinge * (lam - 2.0)
    ms = -f + of_psi * q.real - of_swing * xi * q.imag
    mc = of_psi * q.imag + of_swing * xi * q.real
    # A sample step: 28 to a forcing period, and 16 to that of the bob, held or not.
    fast = max(xi, max(abs(r0), abs(r1), math.sqrt(a * a + abs(d))))
    step = 2.0 * math.pi / max(28.0 * xi, max(16.0 * b, 16.0 * hb))
    c, s = _pair(d, b, step)
    hcos, hsin = _pair(hd, hb, step)
    shrink, hshrink = math.exp(a * step), math.exp(ha * step)
    # fmt: off
    return _Plant(
        weight, k, e, up, lam, QUIET * nu, xi, r0, r1, a, d, b, fast, phi, rate, pull, psi, swing,
        (inv[0, 0], inv[1, 0], inv[2, 0], inv[3, 0]), (inv[0, 1], inv[1, 1], inv[2, 1], inv[3, 1]),
        (inv[0, 2], inv[1, 2], inv[2, 2], inv[3, 2]), (inv[0, 3], inv[1, 3], inv[2, 3], inv[3, 3]),
        hp.real, hp.imag, hb_.real, hb_.imag, step, math.exp(r0 * step), math.exp(r1 * step), shrink * c,
        shrink * s, math.sin(xi * step), math.cos(xi * step), of_psi, of_swing, f, ha, hd, hb,
        hshrink * hcos, hshrink * hsin, q.real, q.imag, of_psi + of_swing * ha, of_swing, ms, mc,
    )
    # fmt: on


@njit(forceinline=True)
def _modes(p, phi, psi, dphi, dpsi, sn, cs, centre):
    """The modal coordinates of a state."""
    z = (0.0, 0.0, 0.0, 0.0)
    z = _add(z, p.l0, phi - centre - (p.hs * sn + p.hc * cs))
    z = _add(z, p.l1, psi - (p.ps * sn + p.pc * cs))
    z = _add(z, p.l2, dphi - p.xi * (p.hs * cs - p.hc * sn))
    return _add(z, p.l3, dpsi - p.xi * (p.ps * cs - p.pc * sn))


@njit(forceinline=True)
def _look(p, z, sn, cs, centre):
    """phi, phi', phi''."""
    phi = _dot(p.phi, z) + p.hs * sn + p.hc * cs + centre
    rate = _dot(p.rate, z) + p.xi * (p.hs * cs - p.hc * sn)
    return phi, rate, _dot(p.pull, z) - p.xi * p.xi * (p.hs * sn + p.hc * cs)


@njit(forceinline=True)
def _bob(p, z, sn, cs):
    """psi, psi'."""
    return (
        _dot(p.psi, z) + p.ps * sn + p.pc * cs,
        _dot(p.swing, z) + p.xi * (p.ps * cs - p.pc * sn),
    )


@njit(forceinline=True)
def _flow(p, z, sn, cs, t):
    """The modal coordinates and the forcing's sine and cosine a time t later."""
    c, s = _pair(p.d, p.b, t)
    shrink = math.exp(p.a * t)
    c, s = shrink * c, shrink * s
    z = (z[0] * math.exp(p.r0 * t), z[1] * math.exp(p.r1 * t), c * z[2] - p.d * s * z[3], s * z[2] + c * z[3])
    c, s = math.cos(p.xi * t), math.sin(p.xi * t)
    return z, sn * c + cs * s, cs * c - sn * s


@njit(forceinline=True)
def _slope(p, z):
    """The modal coordinates of the rate of change."""
    return p.r0 * z[0], p.r1 * z[1], p.a * z[2] - p.d * z[3], z[2] + p.a * z[3]


@njit(forceinline=True)
def _cubic_root(width, g0, d0, g1, d1):
    """Where the cubic through two values (g0 > 0 >= g1) and slopes is about zero, in (0, width)."""
    rise = g1 - g0
    c1, c2, c3 = width * d0, 3.0 * rise - width * (2.0 * d0 + d1), width * (d0 + d1) - 2.0 * rise
    x = g0 / (g0 - g1)
    for _ in range(2):
        slope = (3.0 * c3 * x + 2.0 * c2) * x + c1
        if slope >= 0.0:
            break
        x -= (((c3 * x + c2) * x + c1) * x + g0) / slope
        x = min(max(x, 0.0), 1.0)
    return x * width


@njit(forceinline=True)
def _find(p, z, sn, cs, centre, turn, sign, lo, hi, g0, d0, g1, d1):
    """(t, coordinates, sine, cosine, phi, phi') at the t in (lo, hi] at which sign * phi' (`turn`) or
    sign * phi falls through zero. Newton from the Hermite cubic's root, kept in its bracket; once
    near, a fourth-order Taylor step in place of more exponentials."""
    t = lo + _cubic_root(hi - lo, g0, d0, g1, d1)
    zt, st, ct, phi, rate = z, sn, cs, 0.0, 0.0
    for _ in range(80):
        zt, st, ct = _flow(p, z, sn, cs, t)
        phi, rate, pull = _look(p, zt, st, ct, centre)
        g, slope = (sign * rate, sign * pull) if turn else (sign * phi, sign * rate)
        step = -g / slope if slope < 0.0 else math.inf
        if abs(step) * p.fast < 1e-3:
            y1 = _slope(p, zt)
            y2 = _slope(p, y1)
            y3 = _slope(p, y2)
            y4 = _slope(p, y3)
            w2 = p.xi * p.xi
            jerk = _dot(p.pull, y1) - w2 * p.xi * (p.hs * ct - p.hc * st)
            snap = _dot(p.pull, y2) + w2 * w2 * (p.hs * st + p.hc * ct)
            c2, c3 = (sign * jerk, sign * snap) if turn else (sign * pull, sign * jerk)
            c2, c3 = c2 / 2.0, c3 / 6.0
            for _ in range(4):
                rise = slope + step * (2.0 * c2 + 3.0 * step * c3)
                change = (g + step * (slope + step * (c2 + step * c3))) / rise
                step -= change
                if abs(change) < 1e-10:
                    break
            h2, h3, h4 = step / 2.0, step / 3.0, step / 4.0
            phi += step * (rate + h2 * (pull + h3 * (jerk + h4 * snap)))
            rate += step * (pull + h2 * (jerk + h3 * snap))
            y3 = _add(y3, y4, h4)
            y2 = _add(y2, y3, h3)
            y1 = _add(y1, y2, h2)
            zt = _add(zt, y1, step)
            turned = p.xi * step
            s = turned * (1.0 - turned * turned / 6.0)
            c = 1.0 - turned * turned / 2.0 * (1.0 - turned * turned / 12.0)
            return t + step, zt, st * c + ct * s, ct * c - st * s, phi, rate
        if g > 0.0:
            lo = t
        else:
            hi = t
        new = t + step
        if not lo < new < hi:
            new = 0.5 * (lo + hi)
        if hi - lo < 1e-15:
            break
        t = new
    return t, zt, st, ct, phi, rate


@njit(forceinline=True)
def _series(c, phi, dphi, t):
    """phi, phi', phi'' at t from Taylor coefficients, the first of which is phi''/2."""
    tilt = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * c[4])))
    rate = 2.0 * c[0] + t * (3.0 * c[1] + t * (4.0 * c[2] + t * (5.0 * c[3] + t * 6.0 * c[4])))
    pull = 2.0 * c[0] + t * (6.0 * c[1] + t * (12.0 * c[2] + t * (20.0 * c[3] + t * 30.0 * c[4])))
    return phi + t * (dphi + t * tilt), dphi + t * rate, pull


@njit
def _short(p, z, sn, cs, phi, dphi, pull, turn, sign, far):
    """The same by a Taylor series about the beginning of an arc, for one that ends before `far`, a
    hundredth of the shortest time scale: the flights that end a rattle are smaller than the round-off
    of phi. (time, phi, phi'), the time negative where the arc lasts longer."""
    w2 = p.xi * p.xi
    h, dh = p.hs * sn + p.hc * cs, p.xi * (p.hs * cs - p.hc * sn)
    z = _slope(p, z)
    c1 = (_dot(p.pull, z) - w2 * dh) / 6.0
    z = _slope(p, z)
    c2 = (_dot(p.pull, z) + w2 * w2 * h) / 24.0
    z = _slope(p, z)
    c3 = (_dot(p.pull, z) + w2 * w2 * dh) / 120.0
    z = _slope(p, z)
    c = (0.5 * pull, c1, c2, c3, (_dot(p.pull, z) - w2 * w2 * w2 * h) / 720.0)
    tilt, rate, _ = _series(c, phi, dphi, far)
    if sign * (rate if turn else tilt) > 0.0:
        return -1.0, tilt, rate
    lo, hi = 0.0, far
    t = -dphi / pull if turn else math.sqrt(abs(2.0 * phi / pull))
    if not 0.0 < t < far:
        t = far
    for _ in range(80):
        tilt, rate, pull = _series(c, phi, dphi, t)
        g, slope = (sign * rate, sign * pull) if turn else (sign * tilt, sign * rate)
        if g > 0.0:
            lo = t
        else:
            hi = t
        new = t - g / slope if slope < 0.0 else 0.5 * (lo + hi)
        if not lo <= new <= hi:
            new = 0.5 * (lo + hi)
        done = abs(new - t) <= 1e-9 * t
        t = new
        if done:
            break
    tilt, rate, _ = _series(c, phi, dphi, t)
    return t, tilt, rate


@njit(forceinline=True)
def _decide(p, s, phi, psi, dpsi, sn):
    """(held, s, sigma) of a block whose phi' is zero."""
    excess = p.up * phi - p.f * sn + p.of_psi * psi + p.of_swing * dpsi - s * p.weight
    if abs(excess) <= p.k + (p.weight if s == 0.0 else 0.0):
        return True, s, 0.0
    sigma = 1.0 if excess > 0.0 else -1.0
    return False, sigma if s == 0.0 else s, sigma


@njit
def _wait(p, s, phi, u, v, sn, cs, left):
    """How long a held block stays held, in which direction it goes then (0: not before `left` ends),
    and the bob (u, v: psi without its response, and its rate without decay), sine and cosine then."""
    hold = p.k + (p.weight if s == 0.0 else 0.0)
    base = p.up * phi - s * p.weight
    steady = abs(base) + math.hypot(p.ms, p.mc)
    t, count = 0.0, 0
    m0 = base + p.mu_ * u + p.mv * v + p.ms * sn + p.mc * cs
    d0 = p.ha * (p.mu_ * u + p.mv * v) + p.mu_ * v - p.mv * p.hd * u + p.xi * (p.ms * cs - p.mc * sn)
    while t < left:
        if count % 28 == 0 and p.hd > 0.0:
            # Neither the response nor what is left of the transient can free it any more.
            ringing = math.hypot(p.mu_ * u + p.mv * v, (p.mu_ * v - p.mv * p.hd * u) / p.hb)
            if steady + ringing <= hold:
                return left, 0.0, u, v, sn, cs
        count += 1
        un, vn = p.hec * u + p.hes * v, p.hec * v - p.hd * p.hes * u
        snn, csn = sn * p.cx + cs * p.sx, cs * p.cx - sn * p.sx
        part = p.mu_ * un + p.mv * vn
        m1 = base + part + p.ms * snn + p.mc * csn
        d1 = p.ha * part + p.mu_ * vn - p.mv * p.hd * un + p.xi * (p.ms * csn - p.mc * snn)
        hi, way = 0.0, 0.0
        if abs(m1) > hold:
            hi, way = p.step, 1.0 if m1 > 0.0 else -1.0
        elif d0 * d1 < 0.0 and max(abs(m0), abs(m1)) > 0.9 * hold and d0 * m0 > 0.0:
            # A peak between two samples: where the slope of its cubic is zero is near enough.
            way = 1.0 if m0 > 0.0 else -1.0
            hi = p.step * d0 / (d0 - d1)
            if way * _moment_after(p, base, u, v, sn, cs, hi)[0] <= hold:
                way = 0.0
        if way != 0.0:
            lo, x = 0.0, 0.5 * hi
            for _ in range(80):
                m, d, ut, vt, st, ct = _moment_after(p, base, u, v, sn, cs, x)
                g, slope = hold - way * m, -way * d
                if g > 0.0:
                    lo = x
                else:
                    hi = x
                new = x - g / slope if slope < 0.0 else -1.0
                if not lo <= new <= hi:
                    new = 0.5 * (lo + hi)
                if abs(new - x) <= 1e-14 or hi - lo < 1e-15:
                    break
                x = new
            return t + x, way, ut, vt, st, ct
        t += p.step
        u, v, sn, cs, m0, d0 = un, vn, snn, csn, m1, d1
    return left, 0.0, u, v, sn, cs


@njit
def _moment_after(p, base, u, v, sn, cs, t):
    c, s = _pair(p.hd, p.hb, t)
    shrink = math.exp(p.ha * t)
    u, v = shrink * (c * u + s * v), shrink * (c * v - p.hd * s * u)
    c, s = math.cos(p.xi * t), math.sin(p.xi * t)
    sn, cs = sn * c + cs * s, cs * c - sn * s
    part = p.mu_ * u + p.mv * v
    slope = p.ha * part + p.mu_ * v - p.mv * p.hd * u + p.xi * (p.ms * cs - p.mc * sn)
    return base + part + p.ms * sn + p.mc * cs, slope, u, v, sn, cs


@njit(forceinline=True)
def _arc(p, z, sn, cs, centre, s, sigma, phi, dphi, left):
    """A slipping arc: (event, duration, coordinates, sine, cosine, phi, phi'); the event is 0 where
    `left` ends, 1 a turning point, 2 phi = 0, 3 overturning."""
    down = s != sigma
    _, _, pull = _look(p, z, sn, cs, centre)
    brief = 0.01 / p.fast
    reach = 2.0 * brief * (abs(pull) + brief)
    if not down and phi == 0.0 and 0.0 < sigma * dphi < reach:
        t, tilt, _ = _short(p, z, sn, cs, phi, dphi, pull, True, sigma, brief)
        if t >= 0.0:
            z, sn, cs = _flow(p, z, sn, cs, t)
            return 1, t, z, sn, cs, tilt, 0.0
    elif down and dphi == 0.0 and abs(phi) < reach * brief:
        t, _, rate = _short(p, z, sn, cs, phi, dphi, pull, False, s, brief)
        if t >= 0.0:
            z, sn, cs = _flow(p, z, sn, cs, t)
            return 2, t, z, sn, cs, 0.0, rate
    t, f0, g0, a0 = 0.0, phi, dphi, pull
    while t < left:
        y2 = p.ec * z[2] - p.d * p.es * z[3]
        zn = (z[0] * p.e0, z[1] * p.e1, y2, p.es * z[2] + p.ec * z[3])
        snn, csn = sn * p.cx + cs * p.sx, cs * p.cx - sn * p.sx
        f1, g1, a1 = _look(p, zn, snn, csn, centre)
        hi, gh, ah = 0.0, sigma * g1, sigma * a1
        if gh <= 0.0:
            hi = p.step
        elif sigma * g0 > 0.0 and sigma * a0 < 0.0 and ah > 0.0:
            # phi' has a minimum between two samples: if it is below zero, the block turns before it.
            x = p.step * a0 / (a0 - a1)
            _, gx, ax = _look(p, *_flow(p, z, sn, cs, x), centre)
            if sigma * gx <= 0.0:
                hi, gh, ah = x, sigma * gx, sigma * ax
        if hi > 0.0:
            lo, gl, al = 0.0, sigma * g0, sigma * a0
            if gl <= 0.0:
                # The arc began at a turning point and ends within the step: look for its inside.
                lo = hi
                for _ in range(30):
                    lo *= 0.5
                    _, gl, al = _look(p, *_flow(p, z, sn, cs, lo), centre)
                    gl, al = sigma * gl, sigma * al
                    if gl > 0.0:
                        break
            if gl > 0.0:
                x, zt, st, ct, f1, g1 = _find(p, z, sn, cs, centre, True, sigma, lo, hi, gl, al, gh, ah)
            else:
                x, zt, st, ct, f1, g1 = 0.0, z, sn, cs, f0, g0
            if not down or s * f1 >= 0.0:
                return 1, t + x, zt, st, ct, f1, 0.0
        else:
            x = p.step
        if down and s * f1 <= 0.0:
            x, zn, snn, csn, _, g1 = _find(
                p, z, sn, cs, centre, False, s, 0.0, x, s * f0, s * g0, s * f1, s * g1
            )
            return 2, t + x, zn, snn, csn, 0.0, g1
        if abs(f1) > GONE:
            return 3, t, zn, snn, csn, f1, g1
        t += p.step
        z, sn, cs, f0, g0, a0 = zn, snn, csn, f1, g1, a1
    return 0, t, z, sn, cs, f0, g0


@njit
def settle_one(x, y0, periods):
    """Amplitude of one design; infinite for an overturning, NaN where the events are too many."""
    p = _plant(x)
    period = 2.0 * math.pi / p.xi
    end = periods * period
    late, last = end - period, 0.0
    t, sn, cs = 0.0, 0.0, 1.0
    phi, psi, dphi, dpsi = y0[0], y0[1], y0[2], y0[3]
    s, sigma, held = float(np.sign(phi)), float(np.sign(dphi)), False
    if sigma == 0.0:
        held, s, sigma = _decide(p, s, phi, psi, dpsi, sn)
    elif s == 0.0:
        s = sigma
    centre = (s * p.weight + sigma * p.k) / p.up
    z = _modes(p, phi, psi, dphi, dpsi, sn, cs, centre)
    for _ in range(EVENTS * periods):
        if held:
            u = psi - (p.qs * sn + p.qc * cs)
            v = dpsi - p.xi * (p.qs * cs - p.qc * sn) - p.ha * u
            wait, way, u, v, sn, cs = _wait(p, s, phi, u, v, sn, cs, end - t)
            if t + wait > late:
                last = max(last, abs(phi))
            t += wait
            if way == 0.0:
                break
            psi = u + p.qs * sn + p.qc * cs
            dpsi = v + p.ha * u + p.xi * (p.qs * cs - p.qc * sn)
            held, sigma, dphi = False, way, 0.0
            s = way if s == 0.0 else s
            centre = (s * p.weight + sigma * p.k) / p.up
            z = _modes(p, phi, psi, dphi, dpsi, sn, cs, centre)
        event, lasted, z, sn, cs, phi, dphi = _arc(p, z, sn, cs, centre, s, sigma, phi, dphi, end - t)
        t += lasted
        if event == 3:
            return math.inf
        if event == 0 or t > end:
            break
        norm = 1.5 - 0.5 * (sn * sn + cs * cs)
        sn, cs = norm * sn, norm * cs
        psi, dpsi = _bob(p, z, sn, cs)
        if event == 1:
            if t > late:
                last = max(last, abs(phi))
            dphi = 0.0
            held, s, sigma = _decide(p, s, phi, psi, dpsi, sn)
        else:
            speed, dphi = dphi, p.e * dphi
            moment = -p.f * sn + p.of_psi * psi + p.of_swing * dpsi
            if abs(speed) <= p.quiet and abs(moment) <= p.weight + p.k:
                dphi = 0.0
            lost = dphi - speed
            if lost != 0.0:
                # The rod pulls along itself only: the bob keeps lam psi' - 2 phi'.
                z, dpsi = _add(z, p.l2, lost), dpsi + 2.0 / p.lam * lost
                z = _add(z, p.l3, 2.0 / p.lam * lost)
            s = -s
            if dphi == 0.0:
                held, s, sigma = _decide(p, 0.0, phi, psi, dpsi, sn)
        moved = (s * p.weight + sigma * p.k) / p.up
        z, centre = _add(z, p.l0, centre - moved), moved
    else:
        return math.nan
    return last


@njit(parallel=True)
def settle_all(xs, y0s, periods):
    """Amplitudes of designs (n, 8) from the states (n, 4), on all cores."""
    out = np.empty(len(xs))
    for i in prange(len(xs)):
        out[i] = settle_one(xs[i], y0s[i], periods)
    return out


def gradients(xs: np.ndarray, y0s: np.ndarray, wrt: tuple[int, ...], periods: int, settle) -> np.ndarray:
    """Central differences of the amplitudes, (designs, parameters), by either of the functions above."""
    steps = STEP * np.maximum(np.abs(xs[:, list(wrt)]), FLOOR)
    sides = np.tile(xs[:, None, None, :], (1, len(wrt), 2, 1))
    for j, i in enumerate(wrt):
        sides[:, j, :, i] += steps[:, j, None] * np.array([1.0, -1.0])
    starts = np.repeat(y0s, 2 * len(wrt), axis=0)
    sizes = settle(sides.reshape(-1, 8), starts, periods).reshape(sides.shape[:3])
    return sizes @ np.array([0.5, -0.5]) / steps


def _value(scene: Scene, periods: float):
    x, y0 = np.array(scene.x), np.array(scene.y0)
    return lambda: settle_one(x, y0, int(periods))


def _gradient(scene: Scene, periods: float):
    xs, y0s = np.array([scene.x]), np.array([scene.y0])

    def each(xs, y0s, periods):
        # One design's six runs are too short for threads.
        return np.array([settle_one(x, y0, periods) for x, y0 in zip(xs, y0s, strict=True)])

    def work():
        slopes = gradients(xs, y0s, scene.wrt, int(periods), each)[0]
        if not np.all(np.isfinite(slopes)):
            raise Unable("event bound")
        return slopes

    return work


METHODS = (Method("Numba event loop", False, PERIODS, _value, _gradient),)
