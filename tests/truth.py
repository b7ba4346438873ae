"""Equations (25) of Collini et al. (2016), misprints corrected, to 50 digits; nothing here is the package's.

Within a mode the motion is z' = B z, and exp(B t) z is summed as its Taylor series over short
windows: no step error, no eigenvalues, nothing special at critical damping or for a massless bob.
Every window is a polynomial, whose roots are isolated by the signs of its Bernstein coefficients:
no sign change means no root, so no event is missed however close two of them lie.

`python -m tests.truth` writes the table `truth.json` anew.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import mpmath

mp = mpmath.MPContext()
mp.dps = 60

TABLE = Path(__file__).with_name("truth.json")
DIGITS = 30
"""Of each number in the table."""

_SMALL = mp.mpf(10) ** -62
"""The first terms of a series that are left out."""
_APART = mp.mpf(10) ** -48
"""Roots closer than this share of a window are refused."""
_QUIET = mp.mpf(10) ** -22
"""Share of nu: an impact slower than this ends a rattle. What is left out is of its square."""
_SHORT = mp.mpf(10) ** -10
"""Shortest window."""
_BITS = 260
"""Of the fixed-point numbers that roots are isolated with."""
_GONE = 2

Number = Any
Poly = list
"""Taylor coefficients in u = (t - t0)/h, lowest first."""
Mode = tuple[str, int, int]
"""Slip, stick or rest, with the signs of the tilt and of its rate."""


class Run(NamedTuple):
    """What `follow` saw: angles in rad, time in tau; the state is (phi, psi, phi', psi')."""

    end: list[Number]
    amplitude: Number
    """Largest |phi|."""
    stroke: Number
    """Largest |psi|."""
    events: list[tuple[str, Number]]
    modes: set[str]
    last: Mode


class Overturned(ValueError):
    """The block has gone beyond return."""


class System:
    """The coefficients for one set of parameters (nu, mu, lam, zeta, k, f, xi, e), taken as the
    doubles they are; e may be left out."""

    def __init__(self, x: Sequence[Any]) -> None:
        nu, mu, lam, zeta, self.k, self.f, self.xi = (mp.mpf(v) for v in x[:7])
        self.e = mp.mpf(x[7]) if len(x) > 7 else mp.one
        self.nu, self.lam = nu, lam
        rho = mp.mpf(3) / (4 * (1 + nu**2))
        hinge = 2 * zeta * mp.sqrt(lam * rho)
        self.tilt, self.weight = 1 + 2 * mu, (1 + mu) * nu
        mass = (1 + mu * rho * (4 + nu**2), -2 * mu * rho * lam, -2 * rho, lam * rho)
        (a, b, c, d), det = mass, mass[0] * mass[3] - mass[1] * mass[2]
        # Right-hand sides over (phi, psi, phi', psi', f sin), and the moment on a held block.
        block = (self.tilt, mp.zero, -mu * lam * hinge, mu * lam * hinge, -self.tilt)
        bob = (mp.zero, -mp.one, hinge, -hinge, mp.one)
        self.slip = (
            [(d * p - b * q) / det for p, q in zip(block, bob, strict=True)],
            [(a * q - c * p) / det for p, q in zip(block, bob, strict=True)],
        )
        self.push = (d / det, -c / det)
        self.held = [bob[i] / d for i in (1, 3, 4)]
        self.moment = (self.tilt, -2 * mu, mu * lam * hinge - 2 * mu * hinge, 2 * mu - self.tilt)
        fastest = max(1, self.xi, *(mp.sqrt(abs(v)) for v in (*self.slip[0][:2], *self.slip[1][:2])))
        fastest = max(fastest, *(abs(v) for v in (*self.slip[0][2:4], *self.slip[1][2:4])))
        self.window = 1 / fastest

    def holding(self, y: Sequence[Number], sine: Number) -> Number:
        """The moment R on a held block."""
        a, b, c, d = self.moment
        return a * y[0] + b * y[1] + c * y[3] + d * sine

    def mode(self, y: Sequence[Number], t: Number) -> Mode:
        """The mode that a state is in or goes over into."""
        s, sigma = int(mp.sign(y[0])), int(mp.sign(y[2]))
        if sigma:
            return "slip", s or sigma, sigma
        moment = self.holding(y, self.f * mp.sin(self.xi * t))
        excess = moment - s * self.weight
        if abs(excess) <= self._hold(s):
            return ("stick", s, 0) if s else ("rest", 0, 0)
        way = int(mp.sign(excess))
        return "slip", s or way, way

    def _hold(self, s: int) -> Number:
        return self.k if s else self.weight + self.k

    def series(self, y: Sequence[Number], t: Number, h: Number, mode: Mode) -> list[Poly]:
        """The state and f sin over the window [t, t + h]: five polynomials."""
        kind, s, sigma = mode
        angle = self.xi * t
        terms = [*y, self.f * mp.sin(angle)]
        cosine = self.f * mp.cos(angle)
        (p0, p1, p2, p3, p4), (q0, q1, q2, q3, q4) = self.slip
        g0, g1, g2 = self.held
        load = -(s * self.weight + sigma * self.k)
        out: list[Poly] = [[v] for v in terms]
        i, small = 0, 0
        while small < 4:
            phi, psi, dphi, dpsi, sine = terms
            i += 1
            step = h / i
            if kind == "slip":
                ddphi = p0 * phi + p1 * psi + p2 * dphi + p3 * dpsi + p4 * sine
                ddpsi = q0 * phi + q1 * psi + q2 * dphi + q3 * dpsi + q4 * sine
                if i == 1:
                    ddphi += self.push[0] * load
                    ddpsi += self.push[1] * load
            else:
                ddphi, ddpsi = mp.zero, g0 * psi + g1 * dpsi + g2 * sine
            turn = step * self.xi
            terms = [step * dphi, step * dpsi, step * ddphi, step * ddpsi, turn * cosine]
            cosine = -turn * sine
            for poly, term in zip(out, terms, strict=True):
                poly.append(term)
            small = small + 1 if max(map(abs, (*terms, cosine))) < _SMALL else 0
        return out

    def signals(self, series: list[Poly], mode: Mode) -> list[Poly]:
        """The two polynomials whose first zero ends an arc. Slip: tilt and rate; held: what is
        left of the hold upward and downward."""
        kind, s, _ = mode
        if kind == "slip":
            return [series[0], series[2]]
        a, b, c, d = self.moment
        phi, psi, _, dpsi, sine = series
        excess = [a * p + b * q + c * r + d * v for p, q, r, v in zip(phi, psi, dpsi, sine, strict=True)]
        excess[0] -= s * self.weight
        up, down = [-v for v in excess], excess
        up[0] += self._hold(s)
        down[0] += self._hold(s)
        return [up, down]

    def after(self, y: list[Number], t: Number, mode: Mode, which: int) -> tuple[str, list[Number], Mode]:
        """What the event was, and the state and mode after it."""
        kind, s, _ = mode
        phi, psi, dphi, dpsi = y
        if kind != "slip":
            way = 1 if which == 0 else -1
            return "release", y, ("slip", s or way, way)
        if which == 1:
            y = [phi, psi, mp.zero, dpsi]
            return "turn", y, self.mode(y, t)
        # The rod pulls along itself only: the bob keeps its speed across, lam psi' - 2 phi'. So it
        # does through all the remaining hops of a rattle, which take phi' to nothing.
        plastic = [mp.zero, psi, mp.zero, dpsi - 2 * dphi / self.lam]
        landed = self.mode(plastic, t)
        if abs(dphi) < _QUIET * self.nu and landed[0] == "rest":
            return "landing", plastic, landed
        rate = self.e * dphi
        y = [mp.zero, psi, rate, dpsi + 2 * (rate - dphi) / self.lam]
        return "impact", y, self.mode(y, t)


def _at(poly: Poly, u: Number) -> Number:
    value = mp.zero
    for c in reversed(poly):
        value = value * u + c
    return value


def _refine(poly: Poly, lo: Number, hi: Number) -> Number:
    """The one root in (lo, hi): Newton's method, or bisection where that leaves the bracket."""
    slope = [i * c for i, c in enumerate(poly)][1:]
    side = mp.sign(_at(poly, hi))
    u = lo
    for _ in range(400):
        value = _at(poly, u)
        if value == 0:
            return u
        if mp.sign(value) == side:
            hi = u
        else:
            lo = u
        rate = _at(slope, u)
        new = u - value / rate if rate else lo
        if not lo < new < hi:
            new = (lo + hi) / 2
        step, u = abs(new - u), new
        if step <= abs(u) * mp.mpf(10) ** -32:
            return u - _at(poly, u) / _at(slope, u)
    raise ArithmeticError("a root was not found")


def _zeros(poly: Poly) -> Iterator[Number]:
    """The roots in (0, 1), in order; a root at 0 itself, where an arc begins, is divided out."""
    while poly and poly[0] == 0:
        poly = poly[1:]
    if len(poly) < 2 or abs(poly[0]) > sum(map(abs, poly[1:])):
        return
    n, binomial, b = len(poly) - 1, 1, []
    for i, c in enumerate(poly):
        b.append(int(mp.ldexp(c, _BITS)) // binomial)
        binomial = binomial * (n - i) // (i + 1)
    for k in range(1, n + 1):
        for j in range(n, k - 1, -1):
            b[j] += b[j - 1]
    pieces = [(b, mp.zero, mp.one)]
    while pieces:
        b, lo, width = pieces.pop()
        signs = [v > 0 for v in b if v]
        changes = sum(p != q for p, q in pairwise(signs))
        if changes == 1:
            yield _refine(poly, lo, lo + width)
        elif changes:
            if width < _APART:
                raise ArithmeticError("two events at once")
            left, row = [b[0]], b
            right = [b[-1]]
            while len(row) > 1:
                row = [(p + q) >> 1 for p, q in pairwise(row)]
                left.append(row[0])
                right.append(row[-1])
            half = width / 2
            pieces.append((right[::-1], lo + half, half))
            pieces.append((left, lo, half))


def follow(x: Sequence[Any], y0: Sequence[Any], periods: int) -> Run:
    """The motion from `y0` at tau = 0 over so many forcing periods."""
    system = System(x)
    y, t = [mp.mpf(v) for v in y0], mp.zero
    horizon = periods * 2 * mp.pi / system.xi
    mode = system.mode(y, t)
    amplitude, stroke = abs(y[0]), abs(y[1])
    events: list[tuple[str, Number]] = []
    modes, kind = {mode[0]}, ""
    begun, reach = t, system.window
    while t < horizon:
        longest = min(system.window, max(reach, _SHORT))
        h = min(longest, horizon - t)
        series = system.series(y, t, h, mode)
        if kind == "release":
            # What held the block gives way as it starts: phi'' = 0, but for rounding.
            series[0][2] = series[2][1] = mp.zero
        first = [next(_zeros(signal), None) for signal in system.signals(series, mode)]
        met = [(u, which) for which, u in enumerate(first) if u is not None]
        u, which = min(met) if met else (mp.one, -1)
        for turn in _zeros(series[3]):
            if turn < u:
                stroke = max(stroke, abs(_at(series[1], turn)))
        y = [_at(poly, u) for poly in series[:4]]
        t = t + u * h if which >= 0 or h == longest else horizon
        reach, kind = 8 * (t - begun), ""
        if which >= 0:
            # The hops of a rattle shrink: the next arc lasts about as long as the last one.
            begun, reach = t, 2 * (t - begun)
            kind, y, mode = system.after(y, t, mode, which)
            events.append((kind, t))
            modes.add(mode[0])
        amplitude, stroke = max(amplitude, abs(y[0])), max(stroke, abs(y[1]))
        if amplitude > _GONE:
            raise Overturned(f"at tau = {mp.nstr(t, 5)}")
    return Run(y, amplitude, stroke, events, modes, mode)


_FREE = {"slip": (0, 1, 2, 3), "stick": (0, 1, 3), "rest": (1, 3)}
"""Components of the state that a mode leaves free."""


def settled(x: Sequence[Any], y0: Sequence[Any], periods: int) -> Run:
    """The orbit that repeats after so many forcing periods, near the state `y0` at tau = 0: one
    run along it. `end` is its state at tau = 0."""
    run = follow(x, y0, periods)
    step, free = mp.mpf(10) ** -20, _FREE[run.last[0]]
    y, last, jacobian = list(run.end), mp.inf, None
    for _ in range(30):
        run = follow(x, y, periods)
        if _FREE[run.last[0]] != free:
            raise ArithmeticError("the mode at tau = 0 changed")
        residual = mp.matrix([run.end[i] - y[i] for i in free])
        size = mp.norm(residual, mp.inf)
        if size < mp.mpf(10) ** -42:
            return run
        if jacobian is None or size > last * mp.mpf(10) ** -6:
            jacobian = mp.eye(len(free))
            for column, j in enumerate(free):
                moved = list(y)
                moved[j] += step
                end = follow(x, moved, periods).end
                for row, i in enumerate(free):
                    jacobian[row, column] -= (end[i] - run.end[i]) / step
        change, last = mp.lu_solve(jacobian, residual), size
        for row, i in enumerate(free):
            y[i] += change[row]
    raise ArithmeticError("no periodic orbit was found")


class Scene(NamedTuple):
    """A transient from `y0` over so many periods, or, where a state `near` an orbit is given, what
    the motion from `y0` settles into and repeats after so many."""

    name: str
    x: tuple[float, ...]
    y0: tuple[float, ...]
    periods: int
    near: tuple[float, ...] | None = None


REST = (0.0, 0.0, 0.0, 0.0)

TRANSIENT = (
    Scene("short light pendulum", (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 1.0), REST, 5),
    Scene("short damped pendulum", (0.25, 0.1, 0.15, 0.3, 0.05, 0.377, 2.67, 1.0), REST, 6),
    Scene("long light pendulum", (0.2, 0.05, 0.8, 0.1, 0.05, 0.3, 3.0, 1.0), REST, 6),
    Scene("long heavy pendulum", (0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5, 1.0), REST, 8),
    Scene("bare block, slow forcing", (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 1.5, 1.0), (0.16, 0.0, 0.0, 0.0), 4),
    Scene("bare block", (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0, 1.0), (0.16, 0.0, 0.0, 0.0), 6),
    Scene("bare block, fast forcing", (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 4.0, 1.0), (0.16, 0.0, 0.0, 0.0), 8),
    Scene("bare block, critical bob", (0.2, 0.0, 0.4, 1.0, 0.05, 0.1, 2.0, 1.0), (0.16, 0.1, -0.1, 0.2), 6),
    Scene("bare block, impacts", (0.2, 0.0, 0.4, 0.2, 0.05, 0.2, 3.0, 0.9), (0.12, 0.05, 0.1, 0.0), 6),
    Scene("massless to rounding", (0.2, 1e-09, 0.4, 0.2, 0.05, 0.1, 2.0, 1.0), (0.16, 0.0, 0.0, 0.0), 6),
    Scene("light bob, impacts", (0.2, 1e-06, 0.4, 0.2, 0.05, 0.25, 3.0, 0.8), (0.1, 0.2, 0.0, 0.0), 6),
    Scene("heavy bob", (0.25, 1.0, 1.0, 0.1, 0.05, 0.3, 3.5, 1.0), (0.03, 0.1, 0.0, 0.0), 6),
    Scene("heavy bob rattling to rest", (0.25, 1.0, 0.3, 0.3, 0.05, 0.3, 3.5, 0.9), (0.03, 0.1, 0.0, 0.0), 6),
    Scene("sticks off the base", (0.15, 0.38, 0.23, 0.2, 0.02, 0.19, 3.0, 1.0), REST, 6),
    Scene(
        "swings without crossing", (0.15, 0.38, 0.23, 0.2, 0.02, 0.19, 3.0, 1.0), (-0.07, 0.0, 0.0, 0.0), 3
    ),
    Scene("rough contact", (0.2, 0.1, 0.3, 0.2, 0.18, 0.45, 2.2, 0.9), (0.1, 0.1, 0.0, -0.3), 6),
    Scene("rattles to rest", (0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0, 1.0), REST, 8),
    Scene("rocks where it could rest", (0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0, 1.0), (0.1, 0.0, 0.0, 0.1), 8),
    Scene("stays at rest", (0.25, 0.2, 0.8, 0.1, 0.05, 0.2, 2.67, 1.0), REST, 6),
    Scene("plastic", (0.25, 0.1, 0.15, 0.3, 0.05, 0.45, 2.67, 0.0), REST, 6),
    Scene("plastic, generic start", (0.2, 0.1, 0.6, 0.2, 0.02, 0.4, 2.0, 0.0), (0.1, 0.1, -0.1, 0.2), 6),
    Scene(
        "plastic, small hops", (0.18, 0.06, 0.46, 0.96, 0.01, 0.19, 2.65, 0.0), (-0.08, -0.02, 0.14, -0.17), 4
    ),
    Scene("plastic, long pendulum", (0.1, 0.41, 1.71, 0.2, 0.06, 0.38, 3.82, 0.0), REST, 6),
    Scene("half lost", (0.1, 0.34, 1.25, 0.2, 0.1, 0.17, 4.2, 0.5), (-0.012, 0.0, 0.0, 0.0), 8),
    Scene(
        "half lost, large swings", (0.23, 0.46, 0.97, 1.52, 0.01, 0.5, 2.7, 0.5), (0.03, -0.09, 0.08, 0.26), 6
    ),
    Scene("a fifth lost", (0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5, 0.8), REST, 8),
    Scene("little lost", (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 0.95), REST, 6),
    Scene("little lost, no friction", (0.2, 0.1, 0.4, 0.2, 0.0, 0.2, 4.0, 0.95), (0.02, 0.0, 0.0, 0.0), 8),
    Scene("no friction", (0.2, 0.1, 0.4, 0.3, 0.0, 0.15, 3.0, 1.0), (0.12, 0.0, 0.0, 0.0), 5),
    Scene("no friction, impacts", (0.2, 0.1, 0.4, 0.2, 0.0, 0.25, 4.0, 0.9), (0.08, 0.1, 0.0, 0.0), 8),
    Scene("undamped hinge", (0.2, 0.05, 0.8, 0.0, 0.05, 0.3, 3.0, 1.0), REST, 6),
    Scene("undamped hinge, impacts", (0.2, 0.15, 0.5, 0.0, 0.02, 0.3, 3.0, 0.8), (0.05, -0.05, 0.1, 0.0), 6),
    Scene("overdamped hinge", (0.2, 0.3, 0.6, 1.4, 0.04, 0.3, 3.0, 1.0), (0.12, 0.0, 0.0, 0.0), 6),
    Scene("far overdamped hinge", (0.2, 0.2, 0.6, 2.5, 0.05, 0.35, 3.0, 1.0), (0.0, 0.1, 0.1, -0.2), 6),
    Scene(
        "pair at the critical point",
        (0.2, 0.3, 0.6, 0.8906568532905917, 0.04, 0.3, 3.0, 1.0),
        (0.12, 0.0, 0.0, 0.0),
        6,
    ),
    Scene(
        "pair near the critical point",
        (0.2, 0.1, 0.4, 0.934, 0.03, 0.25, 4.0, 1.0),
        (0.02, 0.05, -0.02, 0.05),
        6,
    ),
    Scene("free", (0.2, 0.1, 0.4, 0.1, 0.01, 0.0, 2.0, 1.0), (0.15, 0.1, 0.0, 0.0), 4),
    Scene("free, energy kept", (0.2, 0.3, 0.4, 0.0, 0.0, 0.0, 2.0, 1.0), (0.08, 0.1, 0.0, 0.0), 4),
    Scene("free, to rest", (0.2, 0.1, 0.4, 0.1, 0.01, 0.0, 2.0, 0.8), (0.15, 0.1, 0.0, 0.0), 6),
    Scene("very short pendulum", (0.25, 0.1, 0.05, 0.2, 0.05, 0.377, 2.67, 1.0), REST, 3),
    Scene("very long pendulum", (0.25, 0.1, 2.0, 0.2, 0.05, 0.45, 2.67, 1.0), REST, 5),
    Scene("very slow forcing", (0.2, 0.1, 0.4, 0.2, 0.05, 0.15, 0.7, 1.0), (0.0, 0.0, 0.05, 0.0), 4),
    Scene(
        "very slow forcing, impacts", (0.25, 0.1, 0.4, 0.2, 0.05, 0.1, 0.7, 0.7), (-0.1, 0.05, 0.02, 0.0), 3
    ),
    Scene("very fast forcing", (0.2, 0.1, 0.3, 0.2, 0.03, 0.6, 6.0, 1.0), (0.03, 0.0, 0.0, 0.0), 5),
    Scene("on the way to period three", (0.16, 0.11, 0.18, 0.1, 0.03, 0.32, 4.5, 1.0), REST, 5),
    Scene("generic start", (0.22, 0.15, 0.7, 0.15, 0.03, 0.35, 3.6, 1.0), (0.05, -0.2, 0.1, 0.3), 6),
    Scene("generic start, impacts", (0.3, 0.25, 0.3, 0.05, 0.06, 0.5, 4.2, 0.9), (-0.08, 0.3, 0.2, -0.4), 6),
    Scene("generic start, slender", (0.12, 0.02, 0.9, 0.3, 0.08, 0.3, 4.0, 1.0), (-0.03, 0.2, 0.1, 0.5), 8),
)

SETTLED = (
    Scene(
        "short light pendulum",
        (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 1.0),
        REST,
        1,
        near=(0.0368859592, 0.875780728, 0.135586804, -4.56582915),
    ),
    Scene(
        "short damped pendulum",
        (0.25, 0.1, 0.15, 0.3, 0.05, 0.377, 2.67, 1.0),
        REST,
        1,
        near=(0.0234150088, 0.373476161, 0.183027341, -1.33012249),
    ),
    Scene(
        "long light pendulum",
        (0.2, 0.05, 0.8, 0.1, 0.05, 0.3, 3.0, 1.0),
        REST,
        1,
        near=(0.0131643011, 0.0446851953, 0.172910307, 0.30586327),
    ),
    Scene(
        "long heavy pendulum",
        (0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5, 1.0),
        REST,
        1,
        near=(0.0106520573, 0.0344785154, 0.24508296, 0.407575188),
    ),
    Scene(
        "bare block, slow forcing",
        (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 1.5, 1.0),
        (0.16, 0.0, 0.0, 0.0),
        1,
        near=(0.0657070455, 0.00324293423, 0.111298677, -0.85042304),
    ),
    Scene(
        "bare block",
        (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0, 1.0),
        (0.16, 0.0, 0.0, 0.0),
        1,
        near=(0.0426636405, 0.613270291, 0.0971547824, -0.596154769),
    ),
    Scene(
        "bare block, fast forcing",
        (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 4.0, 1.0),
        (0.16, 0.0, 0.0, 0.0),
        1,
        near=(0.0125335681, 0.0880246775, 0.057557827, 0.18962822),
    ),
    Scene(
        "bare block, asymmetric",
        (0.11, 0.0, 0.99, 0.02, 0.06, 0.37, 2.34, 1.0),
        REST,
        1,
        near=(0.0484697311, 0.0459069441, 0.166531399, 0.162081853),
    ),
    Scene(
        "bare block, period three",
        (0.17, 0.0, 0.67, 0.03, 0.08, 0.58, 4.98, 1.0),
        REST,
        3,
        near=(0.0402115845, 0.32788526, 0.0464866576, -0.787266845),
    ),
    Scene(
        "bare block, rattles and rests",
        (0.19, 0.0, 0.73, 0.04, 0.05, 0.25, 4.89, 0.8),
        REST,
        1,
        near=(5.64035959e-07, -0.000518427361, 0.00023598014, -0.104400698),
    ),
    Scene(
        "massless to rounding",
        (0.2, 1e-09, 0.4, 0.2, 0.05, 0.1, 2.0, 1.0),
        (0.16, 0.0, 0.0, 0.0),
        1,
        near=(0.0426636412, 0.613270285, 0.0971547802, -0.596154797),
    ),
    Scene(
        "rattles in every period",
        (0.15, 0.38, 0.23, 0.2, 0.02, 0.19, 3.0, 1.0),
        REST,
        1,
        near=(3.00167987e-06, -0.183015138, 0.0, -0.577559449),
    ),
    Scene(
        "rattles and sticks",
        (0.15, 0.19, 0.62, 1.46, 0.05, 0.19, 2.17, 1.0),
        REST,
        1,
        near=(1.05610289e-06, -0.0416576758, 0.000156531407, -0.0230155789),
    ),
    Scene(
        "half lost, rattles and sticks",
        (0.21, 0.23, 1.81, 0.25, 0.06, 0.35, 4.32, 0.5),
        REST,
        1,
        near=(-4.22284925e-05, -0.00161650639, -0.000957540444, -0.0653795338),
    ),
    Scene(
        "rough contact",
        (0.2, 0.1, 0.3, 0.2, 0.18, 0.45, 2.2, 0.9),
        (0.1, 0.1, 0.0, -0.3),
        1,
        near=(0.0489681658, -0.0458014782, 0.112036242, -1.70054877),
    ),
    Scene(
        "rests for good",
        (0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0, 1.0),
        REST,
        1,
        near=(0.0, -0.0155570418, 0.0, -0.261804782),
    ),
    Scene(
        "rocks where it could rest",
        (0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0, 1.0),
        (0.1, 0.0, 0.0, 0.1),
        1,
        near=(0.00785725294, 0.068942497, 0.128173508, 0.476656327),
    ),
    Scene(
        "plastic",
        (0.11, 0.09, 0.74, 0.9, 0.03, 0.43, 4.69, 0.0),
        REST,
        1,
        near=(-0.0120464236, 0.0276359816, 0.137281398, 0.168598501),
    ),
    Scene(
        "plastic, generic start",
        (0.2, 0.1, 0.6, 0.2, 0.02, 0.4, 2.0, 0.0),
        (0.1, 0.1, -0.1, 0.2),
        1,
        near=(0.0290592259, -0.0973495013, 0.0260180553, -0.798381101),
    ),
    Scene(
        "plastic, small hops",
        (0.18, 0.06, 0.46, 0.96, 0.01, 0.19, 2.65, 0.0),
        (-0.08, -0.02, 0.14, -0.17),
        1,
        near=(0.0, -0.053405645, 0.0, -0.0647895354),
    ),
    Scene(
        "plastic, overdamped",
        (0.23, 0.46, 0.97, 1.52, 0.01, 0.5, 2.7, 0.0),
        (0.03, -0.09, 0.08, 0.26),
        1,
        near=(0.00520408107, 0.0182206746, 0.0218996327, -0.155026925),
    ),
    Scene(
        "half lost, asymmetric",
        (0.1, 0.44, 1.58, 0.2, 0.09, 0.53, 3.07, 0.5),
        (0.01, 0.11, 0.16, 0.08),
        1,
        near=(-0.0248161772, 0.0254088197, 0.186555793, 0.0921259149),
    ),
    Scene(
        "a fifth lost",
        (0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5, 0.8),
        REST,
        1,
        near=(0.0285071294, 0.0846565377, 0.184219809, 0.230308479),
    ),
    Scene(
        "little lost",
        (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 0.95),
        REST,
        1,
        near=(0.0378088137, 0.714481619, 0.124414113, -4.78170679),
    ),
    Scene(
        "asymmetric",
        (0.22, 0.33, 1.03, 1.01, 0.1, 0.28, 1.54, 0.9),
        (-0.07, -0.25, 0.01, 0.1),
        1,
        near=(0.144379307, 0.0830464093, 0.130305356, 0.00638106046),
    ),
    Scene(
        "period two",
        (0.22, 0.37, 1.72, 0.93, 0.03, 0.43, 2.25, 1.0),
        (0.12, 0.08, 0.2, -0.18),
        2,
        near=(-0.0407399676, 0.000633159907, 0.296233323, 0.246972668),
    ),
    Scene(
        "period three",
        (0.16, 0.11, 0.18, 0.1, 0.03, 0.32, 4.5, 1.0),
        REST,
        3,
        near=(0.0405211192, -0.110788239, 0.0318095833, 0.708138274),
    ),
    Scene(
        "no friction",
        (0.2, 0.1, 0.4, 0.3, 0.0, 0.15, 3.0, 1.0),
        (0.12, 0.0, 0.0, 0.0),
        1,
        near=(0.0147330515, 0.178867254, 0.126215575, 0.442053045),
    ),
    Scene(
        "no friction, impacts",
        (0.2, 0.1, 0.4, 0.2, 0.0, 0.25, 4.0, 0.9),
        (0.08, 0.1, 0.0, 0.0),
        1,
        near=(0.00877957681, 0.0739002289, 0.120062988, 0.430293136),
    ),
    Scene(
        "undamped hinge",
        (0.2, 0.05, 0.8, 0.0, 0.05, 0.3, 3.0, 1.0),
        REST,
        1,
        near=(0.0128348654, 0.0392866736, 0.173786359, 0.318606062),
    ),
    Scene(
        "overdamped hinge",
        (0.2, 0.3, 0.6, 1.4, 0.04, 0.3, 3.0, 1.0),
        (0.12, 0.0, 0.0, 0.0),
        1,
        near=(0.0166811183, 0.0604241719, 0.152725472, 0.125172394),
    ),
    Scene(
        "pair at the critical point",
        (0.2, 0.3, 0.6, 0.8906568532905917, 0.04, 0.3, 3.0, 1.0),
        (0.12, 0.0, 0.0, 0.0),
        1,
        near=(0.0209454485, 0.0850105295, 0.147562727, 0.120515804),
    ),
    Scene(
        "very short pendulum",
        (0.25, 0.1, 0.05, 0.2, 0.05, 0.377, 2.67, 1.0),
        REST,
        1,
        near=(0.012858665, 0.13387076, 0.213339627, -0.616382724),
    ),
    Scene(
        "very long pendulum",
        (0.25, 0.1, 2.0, 0.2, 0.05, 0.45, 2.67, 1.0),
        REST,
        1,
        near=(0.0144549096, 0.0105500334, 0.27299366, 0.170185772),
    ),
    Scene(
        "very fast forcing",
        (0.2, 0.1, 0.3, 0.2, 0.03, 0.6, 6.0, 1.0),
        (0.03, 0.0, 0.0, 0.0),
        1,
        near=(0.00228481602, 0.0282789284, 0.150762187, 0.590082419),
    ),
    Scene(
        "heavy bob",
        (0.25, 1.0, 1.0, 0.1, 0.05, 0.3, 3.5, 1.0),
        (0.03, 0.1, 0.0, 0.0),
        1,
        near=(0.0356688532, 0.0831252416, 0.219677732, 0.347933533),
    ),
)


def evaluated(scene: Scene) -> dict[str, Any]:
    """A row of the table. The end of a settled motion is its state at tau = 0."""
    if scene.near is None:
        run = follow(scene.x, scene.y0, scene.periods)
    else:
        run = settled(scene.x, scene.near, scene.periods)
    return {
        "name": scene.name,
        "what": "transient" if scene.near is None else "settled",
        "parameters": scene.x,
        "y0": scene.y0,
        "periods": scene.periods,
        "modes": sorted(run.modes),
        "events": len(run.events),
        "end": [mp.nstr(v, DIGITS) for v in run.end],
        "amplitude": mp.nstr(run.amplitude, DIGITS),
        "stroke": mp.nstr(run.stroke, DIGITS),
    }


def load() -> list[dict[str, Any]]:
    """The rows of the table."""
    return json.loads(TABLE.read_text())


def main() -> None:
    """Write the table anew, a row per line."""
    rows, scenes, begun = [], (*TRANSIENT, *SETTLED), time.perf_counter()
    for i, scene in enumerate(scenes, 1):
        rows.append(evaluated(scene))
        row = rows[-1]
        print(
            f"{i}/{len(scenes)} {time.perf_counter() - begun:6.1f} s  {row['what']}, {scene.name}: "
            f"{row['events']} events, amplitude {row['amplitude'][:14]}",
            file=sys.stderr,
        )
    rows.sort(key=lambda row: (row["what"], row["name"]))
    lines = ",\n".join(json.dumps(row, sort_keys=True) for row in rows)
    TABLE.write_text(f"[\n{lines}\n]\n")


if __name__ == "__main__":
    main()
