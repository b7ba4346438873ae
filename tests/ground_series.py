"""Block and pendulum under ground motions, to 50 digits; nothing here is the package's.

A motion is cut where its formula changes: at every sample of a record, at the ends of a pulse. Within a piece
the state is summed as its Taylor series over short windows, and so is the motion itself. The first zero of an
event function in a window is isolated by bisection: a part of the window is done with as soon as the sum of
the coefficients shows that there is no zero in it, or that the function is monotone there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, pairwise, repeat
from typing import Any, NamedTuple

import mpmath

DIGITS = 60
"""Of the numbers that are worked with."""

Number = Any
Poly = list
"""Taylor coefficients in u = (tau - tau0)/h, lowest first."""
Mode = tuple[str, int, int]
"""Slip, stick or rest, with the signs of the tilt and of its rate."""
Terms = Callable[[Number, Number], Iterator[Number]]
"""From the place in a piece and the length of a window to the Taylor coefficients of eta, without end."""

_QUIET = 1e-12
"""Share of nu: an impact slower than this ends a rattle. What is left out is of its square."""
_COUNTED = 1e-6
"""Share of nu: slower impacts are not counted."""
_GONE = 100
"""Tilt over nu beyond which no motion brings the block back."""


def digits(count: int = DIGITS) -> Any:
    """Numbers of so many decimal digits."""
    mp = mpmath.MPContext()
    mp.dps = count
    return mp


class System:
    """The coefficients of a scene. `x`: width, height, friction, restitution, gravity in SI and, with a
    pendulum, bob (kg), mass of the block (kg), length (m) and damping (ratio)."""

    def __init__(self, x: Mapping[str, Any], mp: Any) -> None:
        self.mp = mp
        width, height, self.k, self.e, g = (
            mp.mpf(x[name]) for name in ("width", "height", "friction", "restitution", "gravity")
        )
        self.nu = nu = width / height
        self.rho = rho = mp.mpf(3) / (4 * (1 + nu**2))
        self.omega = mp.sqrt(g * rho / (height / 2))
        self.bare = not x.get("bob")
        mu = mp.mpf(0) if self.bare else mp.mpf(x["bob"]) / mp.mpf(x["mass"])
        self.tilt, self.weight = 1 + 2 * mu, (1 + mu) * nu
        if self.bare:
            self.damp = self.share = self.hang = mp.mpf(0)
            self.lam = mp.mpf(1)
            self.inverse = (mp.mpf(1), mp.mpf(0), mp.mpf(0), mp.mpf(0))
        else:
            self.lam = lam = mp.mpf(x["length"]) / (height / 2)
            self.damp = 2 * mp.mpf(x["damping"]) * mp.sqrt(lam * rho)
            self.share, self.hang = mu * lam, 1 / (lam * rho)
            a, b, c, d = 1 + mu * rho * (4 + nu**2), -2 * mu * rho * lam, -2 * rho, lam * rho
            det = a * d - b * c
            self.inverse = (d / det, -b / det, -c / det, a / det)
        i11, i12, i21, i22 = self.inverse
        stiff = abs(i11) * self.tilt + abs(i12) + abs(i21) * self.tilt + abs(i22)
        rate = mp.sqrt(stiff) + self.damp * (abs(i22) + abs(i11) * self.share)
        self.window = mp.mpf(1) / (2 * (1 + rate))
        self.tiny = 10.0 ** -(mp.dps + 2)
        self.digits = mp.dps

    def forces(self, y: Sequence[Number], eta: Number) -> tuple[Number, Number]:
        """Right-hand sides of section 3 in slip, without weight and friction."""
        phi, psi, dphi, dpsi = y
        pull = self.damp * (dphi - dpsi)
        return self.tilt * (phi - eta) - self.share * pull, eta - psi + pull

    def holding(self, y: Sequence[Number], eta: Number) -> Number:
        """The moment on a held block."""
        phi, psi, _, dpsi = y
        pull = self.damp * dpsi
        # 2 mu rho lam psi'' with lam rho psi'' = eta - psi - pull; mu = share/lam.
        return self.tilt * (phi - eta) + 2 * self.share / self.lam * (eta - psi - pull) + self.share * pull

    def hold(self, s: int) -> Number:
        """Greatest moment, beyond the weight's at s != 0, that is held."""
        return self.k if s else self.weight + self.k

    def decided(self, y: Sequence[Number], eta: Number) -> Mode:
        """The mode that a state goes on in."""
        mp = self.mp
        s, sigma = int(mp.sign(y[0])), int(mp.sign(y[2]))
        if sigma:
            return "slip", s or sigma, sigma
        excess = self.holding(y, eta) - s * self.weight
        if abs(excess) <= self.hold(s):
            return ("stick", s, 0) if s else ("rest", 0, 0)
        way = int(mp.sign(excess))
        return "slip", s or way, way

    def series(self, y: Sequence[Number], terms: Iterator[Number], h: Number, mode: Mode) -> list[Poly]:
        """State and eta over a window of length h: five polynomials."""
        kind, s, sigma = mode
        i11, i12, i21, i22 = self.inverse
        load = s * self.weight + sigma * self.k
        zero = self.mp.mpf(0)
        state, eta = list(y), next(terms)
        out: list[Poly] = [[v] for v in (*state, eta)]
        i, small = 0, 0
        while small < 4:
            i += 1
            step = h / i
            if kind == "slip":
                block, bob = self.forces(state, eta)
                if i == 1:
                    block -= load
                ddphi, ddpsi = i11 * block + i12 * bob, i21 * block + i22 * bob
            else:
                ddphi, ddpsi = zero, self.hang * (eta - state[1] - self.damp * state[3])
            state = [step * state[2], step * state[3], step * ddphi, step * ddpsi]
            eta = next(terms)
            for poly, term in zip(out, (*state, eta), strict=True):
                poly.append(term)
            small = small + 1 if max(map(abs, (*state, eta))) < self.tiny else 0
        return out

    def signals(self, series: list[Poly], mode: Mode) -> list[Poly]:
        """Two polynomials whose first zero ends an arc. Slip: tilt and rate; held: what is left of the hold
        upward and downward."""
        kind, s, _ = mode
        if kind == "slip":
            return [series[0], series[2]]
        excess = [self.holding(column[:4], column[4]) for column in zip(*series, strict=True)]
        excess[0] -= s * self.weight
        up, down = [-v for v in excess], excess
        up[0] += self.hold(s)
        down[0] += self.hold(s)
        return [up, down]

    def after(self, y: list[Number], eta: Number, mode: Mode, which: int) -> tuple[str, list[Number], Mode]:
        """What the event was, and the state and mode after it."""
        kind, s, _ = mode
        phi, psi, dphi, dpsi = y
        zero = self.mp.mpf(0)
        if kind != "slip":
            way = 1 if which == 0 else -1
            return "release", y, ("slip", s or way, way)
        if which == 1:
            y = [phi, psi, zero, dpsi]
            return "turn", y, self.decided(y, eta)
        bob = zero if self.bare else 2 / self.lam
        still = [zero, psi, zero, dpsi - bob * dphi]
        if abs(self.e * dphi) < _QUIET * self.nu and self.decided(still, eta)[0] == "rest":
            return "landing", still, ("rest", 0, 0)
        y = [zero, psi, self.e * dphi, dpsi + bob * (self.e - 1) * dphi]
        return "impact", y, self.decided(y, eta)

    def safe(self, y: Sequence[Number]) -> bool:
        """Whether without motion a state is this side of the saddle, with less energy than there: losses
        leave it no way across."""
        phi, psi, dphi, dpsi = y
        mu = self.share / self.lam
        # With the impact's invariant 2 phi' - lam psi' the kinetic energy is a sum of squares.
        rho, gap = self.rho, 2 * dphi - self.lam * dpsi
        moving = (1 + mu * rho * self.nu**2) * dphi**2 + mu * rho * gap**2
        lifted = 2 * self.weight * abs(phi) - self.tilt * phi**2 + self.share * psi**2
        return moving + lifted < self.weight**2 / self.tilt and abs(phi) < self.weight / self.tilt

    def reach(self, y: Sequence[Number], eta: Number, mode: Mode) -> Number:
        """A window that is likely to hold the whole of a hop that begins here."""
        block, bob = self.forces(y, eta)
        i11, i12, *_ = self.inverse
        rate = i11 * (block - mode[1] * self.weight - mode[2] * self.k) + i12 * bob
        return 4 * abs(y[2] / rate) if rate * y[2] < 0 else self.window


def value(poly: Poly, u: Number) -> Number:
    """The polynomial at u."""
    total = poly[-1]
    for c in poly[-2::-1]:
        total = total * u + c
    return total


def _halves(poly: Poly) -> tuple[Poly, Poly]:
    """The polynomial over the two halves of its window, each on [0, 1]."""
    left, share = [], 1
    for c in poly:
        left.append(c / share)
        share *= 2
    right = list(left)
    for i in range(len(right) - 1):
        for j in range(len(right) - 2, i - 1, -1):
            right[j] += right[j + 1]
    return left, right


def _refined(poly: Poly, depth: int) -> Number:
    """The root in (0, 1] of a monotone polynomial: Newton's method, or bisection where that leaves the
    bracket."""
    slope = [i * c for i, c in enumerate(poly)][1:]
    lo, hi, rising = 0 * poly[0], 0 * poly[0] + 1, poly[0] < 0
    u = -poly[0] / poly[1]
    for _ in range(8 * depth):
        if not lo < u < hi:
            u = (lo + hi) / 2
        there = value(poly, u)
        if (there < 0) == rising:
            lo = u
        else:
            hi = u
        new = u - there / value(slope, u)
        if abs(new - u) <= 10.0 ** -(depth // 2 + 2) * abs(u):
            return new - value(poly, new) / value(slope, new)
        u = new
    raise ArithmeticError("a root was not found")


def roots(poly: Poly, depth: int) -> Iterator[Number]:
    """The roots in (0, 1] in order; one at 0 itself, where an arc begins, is divided out."""
    start = next((i for i, c in enumerate(poly) if c != 0), len(poly))
    parts = [(poly[start:], 0 * poly[0], 0 * poly[0] + 1)] if start < len(poly) - 1 else []
    while parts:
        part, lo, width = parts.pop()
        sizes = [abs(float(c)) for c in part]
        if sizes[0] > 1.000001 * sum(sizes[1:]):
            continue
        slopes = [i * c for i, c in enumerate(sizes)]
        if slopes[1] > 1.000001 * sum(slopes[2:]):
            end = value(part, 1)
            if part[0] != 0 and (end == 0 or (end > 0) != (part[0] > 0)):
                yield lo + width * _refined(part, depth)
        elif width < 10.0 ** (2 - depth):
            raise ArithmeticError("two events at once")
        else:
            left, right = _halves(part)
            parts += [(right, lo + width / 2, width / 2), (left, lo, width / 2)]


class Piece(NamedTuple):
    """A part of a motion: its end in tau, and the Taylor coefficients of eta."""

    end: Number
    terms: Terms


def _linear(start: Number, slope: Number, zero: Number) -> Terms:
    return lambda s, h: chain((start + slope * s, slope * h), repeat(zero))


def _harmonic(size: Number, rate: Number, phase: Number, mp: Any) -> Terms:
    def terms(s: Number, h: Number) -> Iterator[Number]:
        sine, cosine = size * mp.sin(rate * s + phase), size * mp.cos(rate * s + phase)
        i, turn = 0, rate * h
        while True:
            yield sine
            i += 1
            sine, cosine = cosine * turn / i, -sine * turn / i

    return terms


def _ricker(size: Number, rate: Number, x0: Number, mp: Any) -> Terms:
    """size (1 - 2 x²) exp(-x²), x = x0 + rate s. E = exp(-x²) follows E' = -2 x x' E."""

    def terms(s: Number, h: Number) -> Iterator[Number]:
        x, d = x0 + rate * s, rate * h
        bell, last, before, i = size * mp.exp(-x * x), mp.mpf(0), mp.mpf(0), 0
        while True:
            yield bell - 2 * (x * x * bell + 2 * x * d * last + d * d * before)
            i += 1
            bell, last, before = -2 * d * (x * bell + d * last) / i, bell, last

    return terms


def _sum(parts: Sequence[Terms]) -> Terms:
    return lambda s, h: map(sum, zip(*(part(s, h) for part in parts), strict=False))


def pieces(motion: Mapping[str, Any], system: System, x: Mapping[str, Any], free: float) -> list[Piece]:
    """The motion and the rest after it in tau. eta is minus the acceleration over g."""
    mp, kind = system.mp, motion["kind"]
    unit, zero = -mp.mpf(x["scale"]) / mp.mpf(x["gravity"]), mp.mpf(0)
    if kind == "samples":
        eta = [unit * mp.mpf(a) for a in motion["acceleration"]]
        dtau = system.omega * mp.mpf(motion["dt"])
        out = [
            Piece((i + 1) * dtau, _linear(a, (b - a) / dtau, zero)) for i, (a, b) in enumerate(pairwise(eta))
        ]
    else:
        size, f = unit * mp.mpf(motion.get("peak", 0)), mp.mpf(motion["frequency"])
        turn = 2 * mp.pi * f / system.omega
        if kind == "one_sine":
            out = [Piece(system.omega / f, _harmonic(size, turn, zero, mp))]
        elif kind == "one_cosine":
            out = [Piece(system.omega / f, _harmonic(size, turn, mp.pi / 2, mp))]
        elif kind == "ricker":
            out = [Piece(4 * system.omega / f, _ricker(size, turn / 2, -2 * mp.pi, mp))]
        else:
            out = [_mavroeidis(motion, system, unit)]
    out.append(Piece(out[-1].end + system.omega * mp.mpf(free), _linear(zero, zero, zero)))
    return out


def _mavroeidis(motion: Mapping[str, Any], system: System, unit: Number) -> Piece:
    """Acceleration of the velocity V/2 [1 + cos(w t/g)] cos(w t + p), w = 2 pi f, on |t| <= g/(2 f).

    A product of cosines is a sum of two."""
    mp = system.mp
    size, f, gamma, phase = (mp.mpf(motion[name]) for name in ("velocity", "frequency", "gamma", "phase"))
    w, out = 2 * mp.pi * f, []
    for share, ratio in ((1, mp.mpf(1)), (2, 1 + 1 / gamma), (2, 1 - 1 / gamma)):
        rate = w * ratio
        at_start = phase - rate * gamma / (2 * f)
        out.append(_harmonic(-unit * size / 2 / share * rate, rate / system.omega, at_start, mp))
    return Piece(system.omega * gamma / f, _sum(out))


class Run:
    """A motion that is followed. Angles in rad, time in tau; the state is (phi, psi, phi', psi')."""

    def __init__(self, system: System, y0: Sequence[Any]) -> None:
        self.system, self.y = system, [system.mp.mpf(v) for v in y0]
        self.tau = system.mp.mpf(0)
        self.amplitude, self.when = abs(self.y[0]), self.tau
        self.stroke, self.relative = abs(self.y[1]), abs(self.y[1] - self.y[0])
        self.uplift: Number | None = None
        self.mode: Mode | None = None
        self.modes: set[str] = set()
        self.impacts = 0
        self.speeds = [0.0, float("inf")]
        """Over nu, of the fastest impact that is not counted and the slowest that is."""
        self.overturned = self.safe = self.free = False
        """Safe: the motion is over and what is left of the energy cannot overturn the block."""
        self.kind = ""
        self.nudge: tuple[Number, Sequence[Number]] | None = None
        """A change of the state, made in the first window of a slip after the given time."""
        self.stop: Number | None = None
        """Nothing is followed beyond the window in which this time lies."""

    def through(self, plan: Sequence[Piece], verdict: bool = False) -> Run:
        """Follows all the pieces; for a `verdict` no longer than until the block is overturned or safe."""
        start = self.tau
        for piece in plan:
            self.free = verdict and piece is plan[-1]
            self._piece(piece, start)
            start = piece.end
            if self._done(start):
                break
        return self

    def _done(self, tau: Number) -> bool:
        return self.overturned or self.safe or (self.stop is not None and tau > self.stop)

    def _piece(self, piece: Piece, start: Number) -> None:
        system, length, s = self.system, piece.end - start, self.system.mp.mpf(0)
        if self.mode is None or self.mode[0] != "slip":
            self._enter(system.decided(self.y, next(piece.terms(s, length))), start)
        reach = system.window
        while s < length and not self._done(start + s):
            assert self.mode is not None
            if self.nudge and start + s >= self.nudge[0] and self.mode[0] == "slip" and self.y[2] != 0:
                self.y = [a + b for a, b in zip(self.y, self.nudge[1], strict=True)]
                self.nudge = None
            whole = length - s <= min(reach, system.window)
            h = length - s if whole else min(reach, system.window)
            series = system.series(self.y, piece.terms(s, h), h, self.mode)
            if self.kind == "release":
                # What held the block gives way as it starts: phi'' = 0, but for rounding.
                series[0][2] = series[2][1] = system.mp.mpf(0)
            first = [next(roots(p, system.digits), None) for p in system.signals(series, self.mode)]
            met = [(u, which) for which, u in enumerate(first) if u is not None]
            u, which = min(met) if met else (system.mp.mpf(1), -1)
            self._swings(series, u)
            s = length if whole and not met else s + u * h
            self.tau, self.kind, reach = start + s, "", system.window
            self.y = [value(p, u) for p in series[:4]]
            if met:
                self._event(value(series[4], u), which)
                if self.kind == "impact":
                    reach = system.reach(self.y, value(series[4], u), self.mode)
            self._record()

    def _event(self, eta: Number, which: int) -> None:
        assert self.mode is not None
        speed = abs(float(self.y[2] / self.system.nu))
        self._record()
        self.kind, self.y, mode = self.system.after(self.y, eta, self.mode, which)
        if self.kind in ("impact", "landing"):
            if speed > _COUNTED:
                self.impacts += 1
                self.speeds[1] = min(self.speeds[1], speed)
            else:
                self.speeds[0] = max(self.speeds[0], speed)
            self.safe = self.free and self.system.safe(self.y)
        self._enter(mode, self.tau)

    def _enter(self, mode: Mode, tau: Number) -> None:
        self.mode = mode
        self.modes.add(mode[0])
        if mode[0] == "slip" and self.uplift is None:
            self.uplift = tau

    def _record(self) -> None:
        phi, psi = self.y[:2]
        if abs(phi) > self.amplitude:
            self.amplitude, self.when = abs(phi), self.tau
        self.stroke, self.relative = max(self.stroke, abs(psi)), max(self.relative, abs(psi - phi))
        self.overturned = abs(phi) > _GONE * self.system.nu

    def _swings(self, series: list[Poly], end: Number) -> None:
        """The pendulum's turning points within a window; those of the block are events."""
        if self.system.bare:
            return
        phi, psi, dphi, dpsi = series[:4]
        if sum(abs(float(c)) for c in psi) > self.stroke:
            for u in roots(dpsi, self.system.digits):
                if u < end:
                    self.stroke = max(self.stroke, abs(value(psi, u)))
        gap = [b - a for a, b in zip(phi, psi, strict=True)]
        if sum(abs(float(c)) for c in gap) > self.relative:
            for u in roots([b - a for a, b in zip(dphi, dpsi, strict=True)], self.system.digits):
                if u < end:
                    self.relative = max(self.relative, abs(value(gap, u)))


def follow(case: Mapping[str, Any], mp: Any, **changed: Any) -> Run:
    """The motion of a case, with `changed` quantities; `stop` (tau), `verdict` and `nudge` as in `Run`."""
    stop, nudge, verdict = (changed.pop(name, None) for name in ("stop", "nudge", "verdict"))
    x = {**case["scene"], **changed}
    system = System(x, mp)
    run = Run(system, case["y0"])
    run.nudge, run.stop = nudge, stop
    return run.through(pieces(case["motion"], system, x, case["free"]), bool(verdict))
