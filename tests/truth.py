"""Block and pendulum by equations (25), misprints corrected, to 50 digits; nothing here is the package's.

A motion is cut where the formula of its base changes: never under a harmonic, at every sample of a record, at
the ends of a pulse. Within a piece the state is summed as its Taylor series over short windows, and so is the
motion of the base: no step error, no eigenvalues, nothing special at critical damping or for a massless bob.
The first zero of an event function in a window is isolated by bisection: a part of the window is done with as
soon as the sum of the coefficients shows that there is no zero in it, or that the function is monotone there.

`python -m tests.truth` evaluates the motions of both tables anew, each from the inputs that stand in it; with
names of rows, only those. Angles are in rad, times of harmonics in tau, those of other motions in s.

- `truth.json`: harmonics. A transient is followed from `y0`; of what it settles into, `end` is the state at
  tau = 0. `orbits` are all symmetric orbits of a design, found by a scan of 2 000 crossing times (commit
  42b9f9c): their states and amplitudes.
- `ground_truth.json`: `cases` are motions under pulses and records. Samples times `scale` are in m/s²;
  `impacts` are those faster than 1e-6 nu. `boundaries` are peak accelerations over g nu of one sine of
  frequency ratio W at which the verdict on a bare block changes, `critical` the same of a column: both by
  bisection of such motions (commit dee8d11).
"""

from __future__ import annotations

import functools
import gzip
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, pairwise, repeat
from pathlib import Path
from typing import Any, NamedTuple

import mpmath

GRAVITY = 9.80665
DIGITS = 30
"""Of numbers in the table of harmonics; 20 in that of other motions, 15 of derivatives and borders."""
_QUIET, _GROUND_QUIET = 1e-22, 1e-12
"""Share of nu: an impact slower than this ends a rattle. What is left out is of its square."""
_COUNTED, _GONE = 1e-6, 100
"""Shares of nu: slower impacts are not counted; no motion brings a block back from this tilt."""

Number = Any
Poly = list
"""Taylor coefficients in u = (tau - tau0)/h, lowest first."""
Mode = tuple[str, int, int]
"""Slip, stick or rest, with the signs of the tilt and of its rate."""
Terms = Callable[[Number, Number], Iterator[Number]]
"""From the place in a piece and the length of a window to the Taylor coefficients of eta, without end."""


def digits(count: int = 60) -> Any:
    """Numbers of so many decimal digits."""
    context = mpmath.MPContext()
    context.dps = count
    return context


mp = digits()


class Piece(NamedTuple):
    """A part of a motion: its end in tau, and the Taylor coefficients of eta."""

    end: Number
    terms: Terms


class System:
    """The coefficients for some parameters; a `without` block has no bob to follow."""

    def __init__(self, x: Sequence[Any], mp: Any, *, without: bool = False, quiet: float = _QUIET) -> None:
        """`x` is (nu, mu, lam, zeta, k, e)."""
        nu, mu, lam, zeta, self.k, self.e = (mp.mpf(v) for v in x)
        self.mp, self.nu, self.lam, self.without, self.quiet = mp, nu, lam, without, quiet
        self.rho = rho = mp.mpf(3) / (4 * (1 + nu**2))
        self.tilt, self.weight, self.share = 1 + 2 * mu, (1 + mu) * nu, mu * lam
        self.damp, self.hang = (
            (mp.mpf(0), mp.mpf(0)) if without else (2 * zeta * mp.sqrt(lam * rho), 1 / (lam * rho))
        )
        a, b, c, d = 1 + mu * rho * (4 + nu**2), -2 * mu * rho * lam, -2 * rho, lam * rho
        det = a * d - b * c
        zero = mp.mpf(0)
        self.inverse = (mp.mpf(1), zero, zero, zero) if without else (d / det, -b / det, -c / det, a / det)
        i11, i12, i21, i22 = self.inverse
        stiff = abs(i11) * self.tilt + abs(i12) + abs(i21) * self.tilt + abs(i22)
        self.window = 1 / (2 * (1 + mp.sqrt(stiff) + self.damp * (abs(i22) + abs(i11) * self.share)))
        self.tiny, self.digits = 10.0 ** -(mp.dps + 2), mp.dps

    def forces(self, y: Sequence[Number], eta: Number) -> tuple[Number, Number]:
        """Right-hand sides in slip, without weight and friction."""
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
        s, sigma = int(self.mp.sign(y[0])), int(self.mp.sign(y[2]))
        if sigma:
            return "slip", s or sigma, sigma
        excess = self.holding(y, eta) - s * self.weight
        if abs(excess) <= self.hold(s):
            return ("stick", s, 0) if s else ("rest", 0, 0)
        way = int(self.mp.sign(excess))
        return "slip", s or way, way

    def series(self, y: Sequence[Number], terms: Iterator[Number], h: Number, mode: Mode) -> list[Poly]:
        """State and eta over a window of length h: five polynomials."""
        kind, s, sigma = mode
        i11, i12, i21, i22 = self.inverse
        load, zero = s * self.weight + sigma * self.k, self.mp.mpf(0)
        state, eta = list(y), next(terms)
        out: list[Poly] = [[v] for v in (*state, eta)]
        i, small = 0, 0
        while small < 4:
            i += 1
            step = h / i
            if kind == "slip":
                block, bob = self.forces(state, eta)
                block -= load if i == 1 else zero
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
        # The rod transmits no transverse force: the bob keeps its transverse speed, lam psi' - 2 phi', also
        # during the remaining hops of a rattle, after which phi' is zero.
        bob = zero if self.without else 2 / self.lam
        still = [zero, psi, zero, dpsi - bob * dphi]
        if abs(self.e * dphi) < self.quiet * self.nu and self.decided(still, eta)[0] == "rest":
            return "landing", still, ("rest", 0, 0)
        y = [zero, psi, self.e * dphi, dpsi + bob * (self.e - 1) * dphi]
        return "impact", y, self.decided(y, eta)

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
    left = [c / 2**i for i, c in enumerate(poly)]
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
        lo, hi = (u, hi) if (there < 0) == rising else (lo, u)
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


class Run:
    """A motion that is followed. Angles in rad, time in tau; the state is (phi, psi, phi', psi')."""

    def __init__(self, system: System, y0: Sequence[Any]) -> None:
        self.system, self.end = system, [system.mp.mpf(v) for v in y0]
        self.tau = self.begun = system.mp.mpf(0)
        self.amplitude, self.when = abs(self.end[0]), self.tau
        self.swing, self.relative = abs(self.end[1]), abs(self.end[1] - self.end[0])
        self.uplift: Number | None = None
        self.mode: Mode | None = None
        self.modes: set[str] = set()
        self.events = self.impacts = 0
        self.overturned = False
        self.kind = ""
        self.stop: Number | None = None
        """Nothing is followed beyond the window in which this time lies."""

    def through(self, plan: Sequence[Piece]) -> Run:
        """Follows all the pieces, no longer than until the block is overturned."""
        start = self.tau
        for piece in plan:
            self._piece(piece, start)
            start = piece.end
            if self._done(start):
                break
        return self

    def _done(self, tau: Number) -> bool:
        return self.overturned or (self.stop is not None and tau > self.stop)

    def _piece(self, piece: Piece, start: Number) -> None:
        system, length, s = self.system, piece.end - start, self.system.mp.mpf(0)
        if self.mode is None or self.mode[0] != "slip":
            self._enter(system.decided(self.end, next(piece.terms(s, length))), start)
        reach = system.window
        while s < length and not self._done(start + s):
            assert self.mode is not None
            whole = length - s <= min(reach, system.window)
            h = length - s if whole else min(reach, system.window)
            series = system.series(self.end, piece.terms(s, h), h, self.mode)
            if self.kind == "release":
                # What held the block gives way as it starts: phi'' = 0, but for rounding.
                series[0][2] = series[2][1] = system.mp.mpf(0)
            first = [next(roots(p, system.digits), None) for p in system.signals(series, self.mode)]
            met = [(u, which) for which, u in enumerate(first) if u is not None]
            u, which = min(met) if met else (system.mp.mpf(1), -1)
            self._swings(series, u)
            s = length if whole and not met else s + u * h
            self.tau, self.kind = start + s, ""
            self.end = [value(p, u) for p in series[:4]]
            self._record()
            reach = 8 * (self.tau - self.begun)
            if met:
                # The hops of a rattle shrink: the next arc lasts about as long as the last one.
                reach, self.begun = 2 * (self.tau - self.begun), self.tau
                self._event(value(series[4], u), which)
                if self.kind == "impact":
                    reach = system.reach(self.end, value(series[4], u), self.mode)

    def _event(self, eta: Number, which: int) -> None:
        assert self.mode is not None
        speed = abs(float(self.end[2] / self.system.nu))
        self.kind, self.end, mode = self.system.after(self.end, eta, self.mode, which)
        self.events += 1
        if self.kind in ("impact", "landing"):
            self.impacts += speed > _COUNTED
        self._enter(mode, self.tau)

    def _enter(self, mode: Mode, tau: Number) -> None:
        self.mode = mode
        self.modes.add(mode[0])
        if mode[0] == "slip" and self.uplift is None:
            self.uplift = tau

    def _record(self) -> None:
        phi, psi = self.end[:2]
        if abs(phi) > self.amplitude:
            self.amplitude, self.when = abs(phi), self.tau
        self.swing, self.relative = max(self.swing, abs(psi)), max(self.relative, abs(psi - phi))
        self.overturned = abs(phi) > _GONE * self.system.nu

    def _swings(self, series: list[Poly], end: Number) -> None:
        """The pendulum's turning points within a window; those of the block are events."""
        if self.system.without:
            return
        phi, psi, dphi, dpsi = series[:4]
        gap, slope = ([b - a for a, b in zip(p, q, strict=True)] for p, q in ((phi, psi), (dphi, dpsi)))
        for name, angle, rate in (("swing", psi, dpsi), ("relative", gap, slope)):
            if sum(abs(float(c)) for c in angle) > getattr(self, name):
                for u in roots(rate, self.system.digits):
                    if u < end:
                        setattr(self, name, max(getattr(self, name), abs(value(angle, u))))


# Motions of the base


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


def _mavroeidis(motion: Mapping[str, Any], system: System, unit: Number) -> Piece:
    """Acceleration of the velocity V/2 [1 + cos(w t/g)] cos(w t + p), w = 2 pi f, on |t| <= g/(2 f).

    A product of cosines is a sum of two."""
    mp, parts = system.mp, []
    size, f, gamma, phase = (mp.mpf(motion[name]) for name in ("velocity", "frequency", "gamma", "phase"))
    for share, ratio in ((1, mp.mpf(1)), (2, 1 + 1 / gamma), (2, 1 - 1 / gamma)):
        rate = 2 * mp.pi * f * ratio
        at_start = phase - rate * gamma / (2 * f)
        parts.append(_harmonic(-unit * size / 2 / share * rate, rate / system.omega, at_start, mp))
    return Piece(
        system.omega * gamma / f, lambda s, h: map(sum, zip(*(part(s, h) for part in parts), strict=False))
    )


def pieces(motion: Mapping[str, Any], system: System, x: Mapping[str, Any], free: float) -> list[Piece]:
    """A pulse or a record and the rest after it in tau. eta is minus the acceleration over g."""
    mp, kind = system.mp, motion["kind"]
    unit, zero = -mp.mpf(x["scale"]) / mp.mpf(x["gravity"]), mp.mpf(0)
    if kind == "samples":
        samples = el_centro() if motion.get("record") == "el_centro" else motion["acceleration"]
        eta, dtau = [unit * mp.mpf(a) for a in samples], system.omega * mp.mpf(motion["dt"])
        out = [
            Piece((i + 1) * dtau, _linear(a, (b - a) / dtau, zero)) for i, (a, b) in enumerate(pairwise(eta))
        ]
    elif kind == "mavroeidis":
        out = [_mavroeidis(motion, system, unit)]
    else:
        size, f = unit * mp.mpf(motion["peak"]), mp.mpf(motion["frequency"])
        turn, whole = 2 * mp.pi * f / system.omega, system.omega / f
        if kind == "ricker":
            out = [Piece(4 * whole, _ricker(size, turn / 2, -2 * mp.pi, mp))]
        else:
            phase = {"one_sine": zero, "one_cosine": mp.pi / 2}[kind]
            out = [Piece(whole, _harmonic(size, turn, phase, mp))]
    out.append(Piece(out[-1].end + system.omega * mp.mpf(free), _linear(zero, zero, zero)))
    return out


@functools.cache
def el_centro() -> tuple[float, ...]:
    """El Centro 1940 NS in m/s², 0.02 s apart."""
    path = Path(__file__).parents[1] / "tpd" / "records" / "data" / "elcentro_1940_ns.csv.gz"
    lines = gzip.decompress(path.read_bytes()).decode().split("\n")[1:]
    return tuple(float(line.split(",")[1]) * GRAVITY for line in lines if line)


def system_of(x: Mapping[str, Any], mp: Any) -> System:
    """The coefficients of a scene in SI. `x`: width, height, friction, restitution, gravity and, with a
    pendulum, bob (kg), mass of the block (kg), length (m) and damping (ratio)."""
    half, bob, without = mp.mpf(x["height"]) / 2, (0, 1, 0), not x.get("bob")
    if not without:
        bob = mp.mpf(x["bob"]) / mp.mpf(x["mass"]), mp.mpf(x["length"]) / half, x["damping"]
    numbers = (mp.mpf(x["width"]) / mp.mpf(x["height"]), *bob, x["friction"], x["restitution"])
    system = System(numbers, mp, without=without, quiet=_GROUND_QUIET)
    system.omega = mp.sqrt(mp.mpf(x["gravity"]) * system.rho / half)
    return system


def shaken(case: Mapping[str, Any], mp: Any, **changed: Any) -> Run:
    """The motion of a case under a pulse or a record, with `changed` quantities; `stop` (tau) as in `Run`."""
    stop, x = changed.pop("stop", None), {**case["scene"], **changed}
    system = system_of(x, mp)
    run = Run(system, case["y0"])
    run.stop = stop
    return run.through(pieces(case["motion"], system, x, case["free"]))


def follow(x: Sequence[Any], y0: Sequence[Any], periods: int) -> Run:
    """The motion from `y0` at tau = 0 over so many periods of a harmonic; `x` is (nu, mu, lam, zeta, k, f,
    xi, e), taken as the doubles they are."""
    f, xi = mp.mpf(x[5]), mp.mpf(x[6])
    system = System((*x[:5], x[7] if len(x) > 7 else 1), mp)
    system.window = min(system.window, 1 / xi)
    run = Run(system, y0).through([Piece(periods * 2 * mp.pi / xi, _harmonic(f, xi, mp.mpf(0), mp))])
    if run.overturned:
        raise ValueError(f"the block overturns at tau = {mp.nstr(run.tau, 5)}")
    return run


_FREE = {"slip": (0, 1, 2, 3), "stick": (0, 1, 3), "rest": (1, 3)}
"""Components of the state that a mode leaves free."""


def settled(x: Sequence[Any], y0: Sequence[Any], periods: int) -> Run:
    """The orbit that repeats after so many forcing periods, near the state `y0` at tau = 0: one run along it.
    `end` is its state at tau = 0."""
    run = follow(x, y0, periods)
    step, free = mp.mpf(10) ** -20, _FREE[run.mode[0]]
    y, last, jacobian = list(run.end), mp.inf, None
    for _ in range(30):
        run = follow(x, y, periods)
        if _FREE[run.mode[0]] != free:
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


# Rows of the tables


def harmonic_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row of the table of harmonics from its inputs."""
    x = row["parameters"]
    if row["what"] == "orbits":
        found = [settled(x, state, 1) for state in row["states"]]
        states = [[float(v) for v in o.end] for o in found]
        return {**row, "states": states, "amplitudes": [float(o.amplitude) for o in found]}
    # A settled row holds a state near its orbit: its own.
    at, method = (row["y0"], follow) if row["what"] == "transient" else (row["end"], settled)
    run = method(x, at, row["periods"])
    sizes = {"amplitude": mp.nstr(run.amplitude, DIGITS), "swing": mp.nstr(run.swing, DIGITS)}
    end = [mp.nstr(v, DIGITS) for v in run.end]
    return {**row, **sizes, "end": end, "modes": sorted(run.modes), "events": run.events}


def case_row(case: Mapping[str, Any]) -> dict[str, Any]:
    """A motion under a pulse or a record. Angles in rad, times in s, rates per unit of tau."""
    mp = digits()
    run = shaken(case, mp)
    seconds, without = 1 / run.system.omega, run.system.without

    def text(v: Any) -> str | None:
        return None if v is None else mp.nstr(v, 20, strip_zeros=False)

    out: dict[str, Any] = {"overturned": run.overturned, "modes": sorted(run.modes)}
    out["uplift_time"] = text(None if run.uplift is None else run.uplift * seconds)
    if not run.overturned:
        out |= {
            "tilt": text(run.amplitude),
            "tilt_time": text(run.when * seconds),
            "swing": None if without else text(run.swing),
            "relative_swing": None if without else text(run.relative),
            "end": [None if without and i % 2 else text(v) for i, v in enumerate(run.end)],
            "impacts": run.impacts,
        }
    if "derivatives" in case["results"]:
        out["derivatives"] = _derivatives(case, run)
    return {**case, "results": out}


def _derivatives(case: Mapping[str, Any], run: Run) -> dict[str, str]:
    """Of the largest tilt, one quantity of the scene at a time: the block's mass stays."""
    mp, out = run.system.mp, {}
    # The turn moves by far less than this.
    stop = run.when + mp.mpf(10) ** -9
    for name in ("bob", "length", "damping", "friction", "restitution", "scale"):
        x = mp.mpf(case["scene"][name])
        step = mp.mpf(1e-15) * (x or 1)

        def slope(h: Any, name: str = name, x: Any = x) -> Any:
            up, down = (shaken(case, mp, stop=stop, **{name: x + d}).amplitude for d in (h, -h))
            return (up - down) / (2 * h)

        out[name] = mp.nstr((4 * slope(step) - slope(2 * step)) / 3, 15, strip_zeros=False)
    return out


PATHS = {
    "harmonic": Path(__file__).with_name("truth.json"),
    "ground": Path(__file__).with_name("ground_truth.json"),
}


def load(table: str) -> Any:
    """The table of harmonics, or of ground motions."""
    return json.loads(PATHS[table].read_text())


def main() -> None:
    """Write the tables anew, a row per line; rows that were not asked for stay."""
    names = set(sys.argv[1:])

    def lines(rows: list[dict[str, Any]], evaluate: Callable[..., dict[str, Any]]) -> str:
        out = (evaluate(row) if not names or row["name"] in names else row for row in rows)
        return ",\n".join(json.dumps(row, sort_keys=True) for row in out)

    PATHS["harmonic"].write_text(f"[\n{lines(load('harmonic'), harmonic_row)}\n]\n")
    evaluators = {"cases": case_row}
    parts = [
        f'"{part}": [\n{lines(rows, evaluators.get(part, dict))}\n]' for part, rows in load("ground").items()
    ]
    PATHS["ground"].write_text("{" + ",\n".join(parts) + "}\n")


if __name__ == "__main__":
    main()
