"""Answers known from elsewhere, each with its source and tolerance, and ways to obtain more.

Symbols and equation numbers are those of Collini et al. (2016). Everything here is of the linear
equations (25) with their misprints corrected and without the parametric term s f nu phi sin, for
a block that is a uniform rectangle.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from tpd import (
    Parameters,
    Piecewise,
    Smoothed,
    simulate,
    status_name,
    steady_state,
    symmetric_orbits,
)
from tpd.answers.steady_state import Steady
from tpd.answers.symmetric_orbits import Orbits, all_symmetric_orbits
from tpd.models.base import AbstractModel

NAMES = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e")
"""The order of a vector of parameters; e may be left out, and rho is tied to nu."""

REST = (0.0, 0.0, 0.0, 0.0)


def parameters(x: Any) -> Parameters:
    """The parameters in a vector of seven or, with e, eight."""
    return Parameters(**dict(zip(NAMES, x, strict=False)))


class Case(NamedTuple):
    """The settled motion from `y0` at tau = 0: its amplitude, and the gradient in NAMES[:7] (NaN
    where no value is known), each with the error that its source allows."""

    name: str
    x: tuple[float, ...]
    amplitude: float
    gradient: tuple[float, ...]
    y0: tuple[float, ...] = REST
    amplitude_rtol: float = 1e-8
    amplitude_atol: float = 0.0
    gradient_rtol: float = 1e-6
    gradient_atol: float = 0.0


_UNKNOWN = np.nan

# Source: an event-driven integration, closed forms with events and unknown crossing times, which
# agree to the digits given. The gradients keep rho = 3/(4 (1 + nu^2)) tied to nu.
HUNG = (
    Case(
        "short light pendulum",
        (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67),
        0.061932440888,
        (0.088406446, -0.416603562, -0.00629347967, 0.216728437, -0.126660502, 0.133011479, -0.0446043796),
    ),
    Case(
        "short damped pendulum",
        (0.25, 0.1, 0.15, 0.3, 0.05, 0.377, 2.67),
        0.068304382745,
        (0.11694413, -0.109898993, -0.0211025654, 0.0278780786, -0.06251327, 0.11967109, -0.0490648849),
    ),
    Case(
        "long light pendulum",
        (0.2, 0.05, 0.8, 0.1, 0.05, 0.3, 3.0),
        0.055180823714,
        (
            0.131109459,
            0.0302113137,
            -0.00121120506,
            -0.00138255104,
            -0.0398039044,
            0.102565761,
            -0.0333273734,
        ),
    ),
    # d/dzeta here: Richardson differences of the exact amplitude give -0.00353529733(6), which the
    # derivative through the events confirms to the digits below. The source printed -.00353530284,
    # 1.6e-6 away and more than the rest of its row allows.
    Case(
        "long heavy pendulum",
        (0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5),
        0.065674637832,
        (
            0.111767725,
            0.0266639516,
            -0.00408825678,
            -0.0035352973364,
            -0.0225215209,
            0.0751276885,
            -0.0354141219,
        ),
    ),
)

STILL = Case("stays at rest", (0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0), 0.0, (0.0,) * 7)
"""Rattles and sticks after the start, then rests for good: flat, so the gradient is zero."""


def _bare(xi: float, amplitude: float, nu: float, k: float, f: float, dxi: float) -> Case:
    """A bare block (mu = 0), started at 0.8 nu; nothing about the bob matters but d/dmu."""
    return Case(
        f"bare block at xi = {xi:g}",
        (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, xi),
        amplitude,
        (nu, _UNKNOWN, 0.0, 0.0, k, f, dxi),
        y0=(0.16, 0.0, 0.0, 0.0),
        amplitude_rtol=0.0,
        amplitude_atol=5e-8,
        gradient_rtol=0.0,
        gradient_atol=5.1e-7,
    )


# Source: as above, to the digits printed there; lam and zeta do nothing when mu = 0.
BARE = (
    _bare(1.5, 0.0973880, 0.382245, -0.375897, 0.397339, -0.087944),
    _bare(2.0, 0.0637170, 0.248983, -0.237463, 0.257936, -0.050442),
    _bare(4.0, 0.0188571, _UNKNOWN, _UNKNOWN, _UNKNOWN, _UNKNOWN),
)

MOVING = (*HUNG, *BARE)
CASES = (*MOVING, STILL)

UNSTABLE = ((0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 1.0), 0.155239, 1.458)
"""A bare block whose symmetric orbit repels (same source): parameters, amplitude (six digits), and
the size of the largest multiplier of half a period."""

OVERTURNING = (0.25, 0.1, 0.2, 0.1, 0.05, 0.6, 2.67)

LEANING = ((0.1, 0.0, 1.0, 0.3, 0.05, 0.01, 2.0), (0.09, 0.0, 0.0, 0.0))
"""|(1 + 2 mu) phi - (1 + mu) nu| = 0.01, and the moment of the shaking at most 0.01: friction 0.05 holds."""

CONSERVING = (
    (0.2, 0.0, 0.4, 0.2, 0.0, 0.1, 2.0, 1.0),
    (0.2, 0.0, 0.4, 0.2, 0.0, 0.1, 4.0, 1.0),
    (0.2, 0.1, 0.4, 0.0, 0.0, 0.2, 3.0, 1.0),
    (0.25, 0.2, 0.8, 0.0, 0.0, 0.3, 3.5, 1.0),
    (0.15, 0.3, 0.3, 0.0, 0.0, 0.15, 4.2, 1.0),
)
"""Without friction, damping or loss at impacts."""

SLOW = (0.269, 0.445, 1.989, 0.098, 0.004, 0.387, 4.151)
"""Comes to its orbit so slowly that 500 periods of following alone are not enough."""


def named(case: Case) -> str:
    """What pytest calls a case."""
    return case.name


class Answer(NamedTuple):
    """What the package says, with d(amplitude, stroke, state)/d(parameters)."""

    amplitude: float
    stroke: float
    status: str
    slopes: np.ndarray
    steady: Steady


def solver(model: AbstractModel | Callable[..., AbstractModel], size: int) -> Callable[..., Answer]:
    """`steady_state` of one model, or of what gives one for the arguments after `y0`, as a function of a
    vector, compiled once for all tests."""

    @jax.jit
    def solve(x: jax.Array, y0: jax.Array, *settings: jax.Array) -> tuple[jax.Array, Steady]:
        chosen = model if isinstance(model, AbstractModel) else model(*settings)

        def sizes(x: jax.Array) -> tuple[jax.Array, Steady]:
            s = steady_state(parameters(x), model=chosen, y0=y0)
            return jnp.stack([s.amplitude, s.stroke, *s.state]), s

        return jax.jacrev(sizes, has_aux=True)(x)

    def answer(x: Any, y0: Any = REST, *settings: float) -> Answer:
        full = np.ones(size)
        full[: len(x)] = x
        slopes, s = solve(full, np.asarray(y0, dtype=float), *map(np.asarray, settings))
        slopes = np.asarray(slopes)[:, : len(x)]
        return Answer(float(s.amplitude), float(s.stroke), status_name(s.status), slopes, s)

    return answer


def orbits_of(p: Parameters) -> Orbits:
    """`symmetric_orbits` of one design, or of many along a leading axis."""
    many = any(jnp.ndim(x) for x in jax.tree.leaves(p))
    return all_symmetric_orbits(p) if many else symmetric_orbits(p)


MOST_TIMES = 361
"""Points in time of `along`, and its one compiled shape."""


@jax.jit
def _along(x: jax.Array, y0: jax.Array, times: jax.Array) -> tuple:
    def run(y0: jax.Array) -> tuple:
        motion = simulate(parameters(x), y0, times)
        return motion.ys, (motion.ys, motion.status)

    return jax.jacfwd(run, has_aux=True)(y0)


def along(x: Any, y0: Any, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    """States at the times, their derivatives with respect to the start, and the status; compiled once."""
    full, padded = np.ones(8), np.full(MOST_TIMES, times[-1], dtype=float)
    full[: len(x)], padded[: len(times)] = x, times
    slopes, (ys, status) = _along(full, np.asarray(y0, dtype=float), padded)
    return np.asarray(ys)[: len(times)], np.asarray(slopes)[: len(times)], status_name(status)


def assert_overturned(answer: Answer) -> None:
    """Check that the status is of an overturning, without sizes or a gradient."""
    assert answer.status == "overturned"
    assert answer.amplitude == answer.stroke == np.inf
    assert np.all(np.isnan(answer.slopes))
    assert np.isnan(answer.steady.multiplier)


exact = solver(Piecewise(), 8)
"""(parameters, y0) to the answer of `Piecewise()`; e = 1 unless given."""


class Coarser(Smoothed):
    """`Smoothed` whose widths are multiplied by a number that a compiled program takes."""

    times: jax.Array = eqx.field(kw_only=True)

    def widths(self, p: Parameters) -> tuple[jax.Array, jax.Array]:
        """See `Smoothed.widths`."""
        return tuple(self.times * width for width in super().widths(p))


_by_smoothed = solver(lambda times: Coarser(times=times), 8)


def smoothed(x: Any, y0: Any = REST, coarser: float = 1.0) -> Answer:
    """The same of `Smoothed()`, or with all its widths some times as large."""
    return _by_smoothed(x, y0, coarser)


def differences(function: Callable[[np.ndarray], Any], x: Any, i: int, *, share: float = 0.01) -> Any:
    """d function / d x[i]: central differences with steps of `share` of x[i], a half and a quarter
    of that, extrapolated twice (Richardson), so that the error is of the sixth power of the step."""
    x = np.asarray(x, dtype=float)
    step = share * max(abs(x[i]), 0.1)

    def central(h: float) -> Any:
        up, down = x.copy(), x.copy()
        up[i] += h
        down[i] -= h
        return (function(up) - function(down)) / (2.0 * h)

    d1, d2, d4 = (central(step / n) for n in (1, 2, 4))
    e2, e4 = (4.0 * d2 - d1) / 3.0, (4.0 * d4 - d2) / 3.0
    return (16.0 * e4 - e2) / 15.0


class EventDriven:
    """The equations integrated adaptively (SciPy's DOP853) from event to event: slow, obvious, and
    sharing nothing with the package. A trap of such codes: two events within one step go unseen,
    so the steps are short."""

    STEP = 0.02
    GONE = 2.0

    def __init__(self, x: Any, *, onset: float = 0.0, growth: float = 0.0) -> None:
        """Shaking of full size or, from `onset` on, growing linearly for the time `growth`."""
        self.nu, self.mu, self.lam, zeta, self.k, self.f, self.xi = x[:7]
        self.onset, self.growth = onset, growth
        self.e = x[7] if len(x) > 7 else 1.0
        rho = 3.0 / (4.0 * (1.0 + self.nu**2))
        self.spring = self.lam * rho
        self.hinge = 2.0 * zeta * np.sqrt(self.lam * rho)
        self.drag = 2.0 * self.mu * rho * self.lam
        mass = [[1.0 + self.mu * rho * (4.0 + self.nu**2), -self.drag], [-2.0 * rho, self.spring]]
        self.inverse = np.linalg.inv(mass)
        self.weight = (1.0 + self.mu) * self.nu
        self.kinds: list[str] = []

    def run(self, y0: Any, times: np.ndarray, *, quiet: float = 2e-8) -> np.ndarray:
        """The states at `times`, as many as there are before an overturning."""
        t, y, out = times[0], np.array(y0, dtype=float), [np.array(y0, dtype=float)]
        mode = self._mode(t, y)
        while len(out) < len(times):
            self.kinds.append(mode[0])
            end, state, which = self._arc(t, y, mode, times, out)
            if which is None or which == 2:
                break
            t, y, mode = self._event(end, state, mode, which, quiet * self.nu)
        return np.array(out)

    def _shaking(self, t: float) -> float:
        share = min((t - self.onset) / self.growth, 1.0) if self.growth else 1.0
        return share * self.f * np.sin(self.xi * t)

    def _slip(self, t: float, y: np.ndarray, s: float, sigma: float) -> np.ndarray:
        phi, psi, dphi, dpsi = y
        sine, slide = self._shaking(t), self.hinge * (dphi - dpsi)
        block = (1.0 + 2.0 * self.mu) * (phi - sine) - s * self.weight - sigma * self.k
        return np.array(
            [dphi, dpsi, *(self.inverse @ [block - self.mu * self.lam * slide, sine - psi + slide])]
        )

    def _held(self, t: float, y: np.ndarray) -> np.ndarray:
        swing = (self._shaking(t) - y[1] - self.hinge * y[3]) / self.spring
        return np.array([0.0, y[3], 0.0, swing])

    def _moment(self, t: float, y: np.ndarray) -> float:
        """What weight and friction must balance while the block is held."""
        swing = self._held(t, y)[3]
        block = (1.0 + 2.0 * self.mu) * (y[0] - self._shaking(t))
        return block + self.drag * swing + self.mu * self.lam * self.hinge * y[3]

    def _mode(self, t: float, y: np.ndarray) -> tuple[str, float, float]:
        s, sigma, moment = np.sign(y[0]), np.sign(y[2]), self._moment(t, y)
        if sigma:
            return "slip", s or sigma, sigma
        if s:
            excess = moment - s * self.weight
            return ("stick", s, 0.0) if abs(excess) <= self.k else ("slip", s, np.sign(excess))
        if abs(moment) <= self.weight + self.k:
            return "rest", 0.0, 0.0
        return "slip", np.sign(moment), np.sign(moment)

    def _arc(
        self, t: float, y: np.ndarray, mode: tuple[str, float, float], times: np.ndarray, out: list
    ) -> tuple[float, np.ndarray, int | None]:
        """Until the next event: when, where, and which (0, 1; 2 is overturning; None is the end)."""
        kind, s, sigma = mode
        step = self.STEP
        if kind == "slip":
            rates = functools.partial(self._slip, s=s, sigma=sigma)
            signals = [lambda t, y: s * y[0], lambda t, y: sigma * y[2]]
            pull = rates(t, y)[2]
            if y[0] == 0.0 and pull * y[2] < 0.0:
                step = min(step, 0.5 * abs(y[2] / pull))
        else:
            rates, hold = self._held, self.k + (self.weight if kind == "rest" else 0.0)
            signals = [
                lambda t, y: hold - (self._moment(t, y) - s * self.weight),
                lambda t, y: hold + (self._moment(t, y) - s * self.weight),
            ]
        signals.append(lambda t, y: self.GONE - abs(y[0]))
        for signal in signals:
            signal.terminal, signal.direction = True, -1  # type: ignore[attr-defined]
        options: Any = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-16, "max_step": step}
        sol = solve_ivp(rates, (t, times[-1]), y, events=signals, dense_output=True, **options)
        while len(out) < len(times) and times[len(out)] <= sol.t[-1]:
            out.append(sol.sol(times[len(out)]))
        met = [i for i, found in enumerate(sol.t_events) if len(found)]
        return sol.t[-1], sol.y[:, -1].copy(), met[0] if met else None

    def _event(
        self, t: float, y: np.ndarray, mode: tuple[str, float, float], which: int, quiet: float
    ) -> tuple[float, np.ndarray, tuple[str, float, float]]:
        kind, s, _ = mode
        if kind != "slip":
            way = 1.0 if which == 0 else -1.0
            return t, y, ("slip", s or way, way)
        if which == 1:
            y[2] = 0.0
            return t, y, self._mode(t, y)
        before, y[0] = y[2], 0.0
        y[2] *= self.e
        held = abs(self._moment(t, y)) <= self.weight + self.k
        if abs(before) <= quiet and held:
            y[2] = 0.0
        # The rod pulls along itself only: the bob keeps its speed across, lam psi' - 2 phi'.
        y[3] += 2.0 / self.lam * (y[2] - before)
        return t, y, self._mode(t, y)


class BareCrowd:
    """Many bare blocks without impact losses, each under shaking that grows linearly from `onset` on for
    the time `growth`: closed forms over short steps, events by bisection. Shares nothing with the package."""

    STEP, QUIET = 0.05, 2e-7

    def __init__(self, p: Parameters, onset: np.ndarray, growth: np.ndarray) -> None:
        self.nu, self.k, self.f, self.xi = (np.asarray(x, dtype=float) for x in (p.nu, p.k, p.f, p.xi))
        self.onset, self.growth = onset, growth

    def run(self, y0: np.ndarray, begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """phi and phi' at `end`, NaN where the block has overturned before."""
        self.t, self.phi, self.v = begin.copy(), y0[:, 0].copy(), y0[:, 2].copy()
        self.held, self.s, self.sigma = np.zeros(len(begin), bool), np.zeros(len(begin)), np.zeros(len(begin))
        self._decide(np.ones(len(begin), bool))
        knee = self.onset + self.growth
        while np.any(self.t < end):
            # The closed form holds to the end of the growth.
            onward = np.minimum(self.t + self.STEP, end)
            onward = np.where((self.t < knee) & (onward > knee), knee, onward)
            self._step(onward)
            gone = ~(np.abs(self.phi) < 10.0 * (self.nu + self.k + self.f))
            self.phi, self.t = np.where(gone, np.nan, self.phi), np.where(gone, end, self.t)
        return self.phi, self.v

    def _share(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        growing, span = t < self.onset + self.growth, np.where(self.growth > 0, self.growth, 1.0)
        return np.where(growing, (t - self.onset) / span, 1.0), np.where(growing, 1.0 / span, 0.0)

    def _excess(self, t: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The moment on a held block, and what friction and weight can balance."""
        moment = self.phi - self.f * share * np.sin(self.xi * t)
        on_base = self.phi == 0.0
        return moment - np.sign(self.phi) * self.nu, self.k + np.where(on_base, self.nu, 0.0)

    def _decide(self, which: np.ndarray) -> None:
        excess, hold = self._excess(self.t, self._share(self.t)[0])
        still = self.v == 0.0
        sigma = np.where(still, np.sign(excess), np.sign(self.v))
        self.held = np.where(which, still & (np.abs(excess) <= hold), self.held)
        self.s = np.where(which, np.where(self.phi == 0.0, sigma, np.sign(self.phi)), self.s)
        self.sigma = np.where(which, sigma, self.sigma)

    def _at(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """phi, phi', and whether the block has met an event before."""
        share, rate = self._share(self.t)
        size = self.f / (1.0 + self.xi**2)
        lag = 2.0 * size * rate * self.xi / (1.0 + self.xi**2)
        level, late = self.s * self.nu + self.sigma * self.k, t - self.t

        def forced(t: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            sine, cosine = np.sin(self.xi * t), np.cos(self.xi * t)
            slope = size * (rate * sine + share * self.xi * cosine) - lag * self.xi * sine
            return level + size * share * sine + lag * cosine, slope

        now, then = forced(self.t, share), forced(t, share + rate * late)
        q, r = self.phi - now[0], self.v - now[1]
        cosh, sinh = np.cosh(late), np.sinh(late)
        phi, v = q * cosh + r * sinh + then[0], q * sinh + r * cosh + then[1]
        excess, hold = self._excess(t, share + rate * late)
        over = (self.sigma * v < 0.0) | ((self.s * phi < 0.0) & (self.s * self.sigma < 0.0))
        met = np.where(self.held, np.abs(excess) > hold, over)
        return np.where(self.held, self.phi, phi), np.where(self.held, 0.0, v), met

    def _step(self, onward: np.ndarray) -> None:
        phi, v, met = self._at(onward)
        if np.any(met):
            low, high = self.t, onward
            for _ in range(50):
                middle = 0.5 * (low + high)
                before = self._at(middle)[2]
                low, high = np.where(before, low, middle), np.where(before, middle, high)
            onward = np.where(met, high, onward)
            phi, v, _ = self._at(onward)
        turned = met & ~self.held & (self.sigma * v <= 0.0)
        crossed = met & ~self.held & ~turned
        self.t, self.phi, self.v = onward, np.where(crossed, 0.0, phi), np.where(turned, 0.0, v)
        excess, hold = self._excess(self.t, self._share(self.t)[0])
        rests = crossed & (np.abs(v) <= self.QUIET * self.nu) & (np.abs(excess) <= hold)
        self.v = np.where(rests, 0.0, self.v)
        freed, sigma = met & self.held, np.sign(excess)
        self._decide(turned | crossed)
        self.s = np.where(freed & (self.phi == 0.0), sigma, self.s)
        self.sigma, self.held = np.where(freed, sigma, self.sigma), self.held & ~freed
