"""heyoka: Taylor series compiled just in time, events located on the series, variational equations.

Slopes go through the events by their saltation matrices: an arc's own time is a function of where it
began and of the parameters. With the slopes of one period's map the settled state's slopes follow
from one linear system, (1 - D) dy = dP, where no difference is taken anywhere.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from tests.benchmarks.precision import following
from tests.benchmarks.precision.following import GONE, Mode, Overturned, Settled
from tests.benchmarks.precision.methods import Method, Scene, Unable

TOLS = (1e-4, 1e-6, 1e-9, 1e-12, 1e-15)

NUDGE = 1e-16
"""A rate (rad per unit tau) to begin an arc with, in place of zero."""

ROUGH = 1e-4
"""What is left of a transient when Newton's method takes over."""

STATE = hy.make_vars("phi", "psi", "dphi", "dpsi")
NU, MU, LAM, ZETA, K, F, XI, S, SIGMA = (hy.par[i] for i in range(9))
"""What is not compiled in: the parameters in their usual order, and the signs of the arc."""


class Equations(NamedTuple):
    """Expressions of the equations (25): the rates while slipping and while held, the moment on a held
    block less the weight's share, and the weight."""

    slip: list
    held: list
    excess: Any
    weight: Any


def equations() -> Equations:
    """Written once more, in heyoka's expressions."""
    phi, psi, dphi, dpsi = STATE
    rho = 0.75 / (1.0 + NU * NU)
    inertia = LAM * rho
    hinge, up, weight = 2.0 * ZETA * hy.sqrt(inertia), 1.0 + 2.0 * MU, (1.0 + MU) * NU
    m11, m12, m21 = 1.0 + MU * rho * (4.0 + NU * NU), -2.0 * MU * inertia, -2.0 * rho
    det = m11 * inertia - m12 * m21
    push, slide = F * hy.sin(XI * hy.time), dphi - dpsi
    block = up * (phi - push) - S * weight - SIGMA * K - MU * LAM * hinge * slide
    bob = push - psi + hinge * slide
    slip = [dphi, dpsi, (inertia * block - m12 * bob) / det, (m11 * bob - m21 * block) / det]
    none = hy.expression(0.0)
    held = [none, dpsi, none, (push - psi - hinge * dpsi) / inertia]
    moment = up * phi - push - 2.0 * MU * psi + MU * hinge * (LAM - 2.0) * dpsi
    return Equations(slip, held, moment - S * weight, weight)


def _signals() -> tuple[list, list]:
    """What falls through zero where an arc ends: of a slipping block at a turning point, at zero and
    overturned; of a held one, upward and downward. For a held block SIGMA is 1 at rest, else 0."""
    phi, _, dphi, _ = STATE
    e = equations()
    hold = K + SIGMA * e.weight
    return [SIGMA * dphi, S * phi, GONE - S * phi], [hold - e.excess, hold + e.excess]


@lru_cache(maxsize=32)
def integrators(tol: float, wrt: tuple[int, ...] = ()) -> tuple[Any, Any]:
    """Compiled at the first call: of a slipping and of a held block; with places `wrt` of parameters,
    with the variational equations in state and parameters."""
    out = []
    for rates, signals in zip((equations().slip, equations().held), _signals(), strict=True):
        system: Any = list(zip(STATE, rates, strict=True))
        if wrt:
            system = hy.var_ode_sys(system, [*STATE, *(hy.par[i] for i in wrt)], 1)
        events = [hy.t_event(g, direction=hy.event_direction.negative) for g in signals]
        start, compact = [0.0] * 4, bool(wrt)
        out.append(
            hy.taylor_adaptive(system, start, pars=[1.0] * 9, tol=tol, t_events=events, compact_mode=compact)
        )
    return out[0], out[1]


def _run(integrator: Any, t: float, y: np.ndarray, end: float) -> tuple[float, int]:
    """(time, event) where it stops, the event -1 at `end`; state and slopes remain in the integrator."""
    integrator.time = t
    integrator.state[: len(y)] = y
    integrator.reset_cooldowns()
    outcome = int(integrator.propagate_until(end)[0])
    if outcome == int(hy.taylor_outcome.time_limit):
        return end, -1
    if outcome >= 0 or outcome < -3:
        raise Unable(f"heyoka stops with {outcome}")
    return integrator.time, -outcome - 1


class TaylorArcs:
    """Arcs of one design."""

    def __init__(self, x: tuple[float, ...], tol: float) -> None:
        self.slipping, self.holding = integrators(tol)
        for integrator in (self.slipping, self.holding):
            integrator.pars[:7] = x[:7]

    def slip(self, t, y, s, sigma, end):
        """Until the next event."""
        self.slipping.pars[7], self.slipping.pars[8] = s, sigma
        if y[2] == 0.0:
            # What frees a held block does so with no acceleration: the sign of round-off is no event.
            y[2] = sigma * NUDGE
        t, event = _run(self.slipping, t, y, end)
        return t, self.slipping.state.copy(), ("turn", "zero", "gone", "end")[event]

    def held(self, t, y, s, end):
        """Until it is freed."""
        self.holding.pars[7], self.holding.pars[8] = s, float(s == 0.0)
        t, event = _run(self.holding, t, y, end)
        return t, self.holding.state.copy(), (1.0, -1.0, 0.0)[event]


def settled(scene: Scene, y0: Any, tol: float) -> Settled:
    """The settled motion."""
    p, arcs = following.plant(scene.x), TaylorArcs(scene.x, tol)
    quiet = following.quiet(p, tol)
    return following.settle(p, lambda y: following.one_period(p, arcs, y, quiet), y0, max(tol, 1e-14))


@lru_cache(maxsize=8)
def _release_slopes(wrt: tuple[int, ...]) -> tuple[Any, Any]:
    """Of the two events of a held block, their slopes in state and parameters at a fixed time."""
    _, signals = _signals()
    inputs = [*STATE, *(hy.par[i] for i in wrt)]
    return tuple(hy.cfunc([hy.diff(g, v) for v in inputs], vars=STATE) for g in signals)  # type: ignore


class Period(NamedTuple):
    """The end of a forcing period, its largest |phi|, and the slopes of both in the state at its begin
    and in the parameters."""

    y: np.ndarray
    slopes: np.ndarray
    peak: float
    peak_slopes: np.ndarray


class SlopeArcs:
    """The arcs of one design with the slopes of the state, rows of which are the state's components and
    columns its begin and the parameters `wrt`."""

    def __init__(self, scene: Scene, tol: float) -> None:
        self.p, self.wrt = following.plant(scene.x), scene.wrt
        self.slipping, self.holding = integrators(tol, scene.wrt)
        self.numbers = np.array(self.p)
        self.releases, self.x = _release_slopes(scene.wrt), scene.x
        self.quiet = following.quiet(self.p, 1e-4 * tol)
        for integrator in (self.slipping, self.holding):
            integrator.pars[:7] = scene.x[:7]

    def rates(self, t: float, y: np.ndarray, mode: Mode) -> np.ndarray:
        """In a mode."""
        if mode.held:
            return following.held_rates(t, y, self.numbers)
        return following.slip_rates(t, y, self.numbers, mode.s * self.p.weight + mode.sigma * self.p.k)

    def period(self, y: np.ndarray) -> Period:
        """One forcing period from the state `y`."""
        p, t, end = self.p, 0.0, self.p.period
        size = 4 + len(self.wrt)
        y, slopes = np.array(y), np.eye(4, size)
        mode, peak, peak_slopes = following.mode(p, t, y), 0.0, np.zeros(size)
        for _ in range(following.EVENTS):
            if mode.held and abs(y[0]) > peak:
                peak, peak_slopes = abs(y[0]), math.copysign(1.0, y[0]) * slopes[0]
            t, y, slopes, event = self.arc(t, y, slopes, mode, end)
            rates = self.rates(t, y, mode)
            if event < 0:
                if 6 in self.wrt:
                    slopes[:, 4 + self.wrt.index(6)] -= rates * end / p.xi
                return Period(y, slopes, peak, peak_slopes)
            delay = self.delay(t, y, slopes, mode, event, rates)
            slopes += np.outer(rates, delay)
            if mode.held:
                way = 1.0 if event == 0 else -1.0
                mode = Mode(False, mode.s or way, way)
            else:
                if event == 0:
                    y[2], slopes[2] = 0.0, 0.0
                    if abs(y[0]) > peak:
                        peak, peak_slopes = abs(y[0]), math.copysign(1.0, y[0]) * slopes[0]
                else:
                    y = self.impact(t, y, slopes)
                mode = following.mode(p, t, y)
            slopes -= np.outer(self.rates(t, y, mode), delay)
        raise Unable("endless rattle")

    def arc(self, t: float, y: np.ndarray, slopes: np.ndarray, mode: Mode, end: float) -> tuple:
        """(time, state, slopes, event) where it ends."""
        if not mode.held and y[2] == 0.0:
            y[2] = mode.sigma * NUDGE
        integrator = self.holding if mode.held else self.slipping
        integrator.pars[7:] = mode.s, float(mode.s == 0.0) if mode.held else mode.sigma
        t, event = _run(integrator, t, np.concatenate([y, slopes.ravel()]), end)
        if not mode.held and event == 2:
            raise Overturned
        full = integrator.state.copy()
        return t, full[:4], full[4:].reshape(slopes.shape), event

    def delay(
        self, t: float, y: np.ndarray, slopes: np.ndarray, mode: Mode, event: int, rates: np.ndarray
    ) -> np.ndarray:
        """The slopes of the time of an event."""
        if not mode.held:
            i = 2 if event == 0 else 0
            return -slopes[i] / rates[i]
        pars = np.array([*self.x[:7], mode.s, float(mode.s == 0.0)])
        of = self.releases[event](y, pars=pars, time=t)
        rise = of[:4] @ slopes
        rise[4:] += of[4:]
        p, way = self.p, -1.0 if event == 0 else 1.0
        by_time = -p.f * p.xi * math.cos(p.xi * t)
        return -rise / (of[:4] @ rates + way * by_time)

    def impact(self, t: float, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """The state after one; the slopes are changed in place."""
        after, lam = following.impact(self.p, t, y, self.quiet), self.p.lam
        kept = after[2] / y[2]
        slopes[0] = 0.0
        slopes[3] += 2.0 / lam * (kept - 1.0) * slopes[2]
        if 2 in self.wrt:
            slopes[3, 4 + self.wrt.index(2)] -= 2.0 / lam**2 * (after[2] - y[2])
        slopes[2] *= kept
        return after


def gradient(period: Period) -> np.ndarray:
    """Of the amplitude of the orbit that repeats after the period."""
    y = np.linalg.solve(np.eye(4) - period.slopes[:, :4], period.slopes[:, 4:])
    return period.peak_slopes[:4] @ y + period.peak_slopes[4:]


def newton(scene: Scene, tol: float) -> Period:
    """The orbit's period: a rough settling, then Newton's method on the map of a period."""
    y, arcs = settled(scene, scene.y0, max(tol, ROUGH)).y, SlopeArcs(scene, tol)
    last = math.inf
    for _ in range(20):
        period = arcs.period(y)
        step = np.linalg.solve(np.eye(4) - period.slopes[:, :4], period.y - y)
        size = float(np.max(np.abs(step) / (np.abs(y) + np.abs(period.y).max())))
        if size <= 1e-15 or (size <= max(tol, 1e-13) and size > 0.1 * last):
            break
        if size > 1e3 * last:
            raise Unable("Newton's method diverges")
        y, last = y + step, size
    return period


def _settled_value(scene: Scene, tol: float):
    return lambda: following.amplitude(lambda: settled(scene, scene.y0, tol))


def _slopes(period: Callable[[], Period]) -> np.ndarray:
    try:
        return gradient(period())
    except Overturned:
        return np.full(3, math.nan)


def _settled_gradient(scene: Scene, tol: float):
    return lambda: _slopes(lambda: SlopeArcs(scene, tol).period(settled(scene, scene.y0, tol).y))


def _newton_value(scene: Scene, tol: float):
    return lambda: following.amplitude(lambda: _as_settled(newton(scene, tol)))


def _as_settled(period: Period) -> Settled:
    return Settled(period.y, period.peak, 1)


def _newton_gradient(scene: Scene, tol: float):
    return lambda: _slopes(lambda: newton(scene, tol))


METHODS = (
    Method("heyoka, settled", False, "tol", TOLS, _settled_value, _settled_gradient),
    Method("heyoka, Newton", False, "tol", TOLS, _newton_value, _newton_gradient),
)
