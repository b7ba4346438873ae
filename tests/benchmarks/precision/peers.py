"""SciPy's DOP853, SUNDIALS' CVODE and heyoka's Taylor series with events, arcs joined where they end.

Gradients are central differences; heyoka's own variational equations, with the saltation of every event, are
not used.
"""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from tests.benchmarks.precision import following
from tests.benchmarks.precision.following import GONE, Plant
from tests.benchmarks.precision.methods import Method, Unable
from tests.benchmarks.precision.scenes import Scene

try:
    from sksundae.cvode import CVODE
except ImportError:
    CVODE = None
try:
    import heyoka as hy
except ImportError:
    hy = None


def _terminal(signal: Any) -> Any:
    signal.terminal, signal.direction = True, -1
    return signal


class ScipyArcs(NamedTuple):
    """Compiled right-hand sides under `solve_ivp`, which stops at the events it locates itself."""

    p: Plant
    numbers: np.ndarray
    rtol: float

    def _solve(self, rates: Any, t: float, end: float, y: np.ndarray, events: list, step: float) -> Any:
        options = {"method": "DOP853", "rtol": self.rtol, "atol": 1e-3 * self.rtol, "max_step": step}
        return solve_ivp(rates, (t, end), y, events=events, **options)

    def slip(self, t, y, s, sigma, end):
        """The tilt is monotone on an arc, so it crosses zero at most once, and only on the way down: a
        turning point found beyond zero betrays a crossing that fell, with the return of the continued
        arc, into one step."""
        numbers = self.numbers
        p, down, load = self.p, s != sigma, s * self.p.weight + sigma * self.p.k
        turn = _terminal(lambda _, y: sigma * y[2])
        zero = _terminal(lambda _, y: s * y[0])
        gone = _terminal(lambda _, y: GONE - s * y[0])
        step = following.STEP * p.period

        def rates(t, y):
            return following.slip_rates(t, y, numbers, load)

        for _ in range(10):
            sol = self._solve(rates, t, end, y, [turn, zero if down else gone], step)
            if sol.t[-1] > t:
                break
            # It begins at one turning point and its first step held the next: the first of them is found.
            step *= 0.1
        at, state = sol.t[-1], sol.y[:, -1].copy()
        if sol.status != 1:
            return at, state, "end" if sol.status == 0 else "gone"
        if len(sol.t_events[1]):
            return at, state, "zero" if down else "gone"
        if down and s * state[0] < 0.0:
            sol = self._solve(rates, t, at, y, [zero], step)
            return sol.t[-1], sol.y[:, -1].copy(), "zero"
        return at, state, "turn"

    def held(self, t, y, s, end):
        """Until the moment leaves what weight and friction hold."""
        p, numbers = self.p, self.numbers
        hold, offset = p.k + (0.0 if s else p.weight), s * p.weight
        over = _terminal(lambda t, y: hold - following.moment(p, t, y) + offset)
        under = _terminal(lambda t, y: hold + following.moment(p, t, y) - offset)

        def rates(t, y):
            return following.held_rates(t, y, numbers)

        sol = self._solve(rates, t, end, y, [over, under], p.held_step())
        way = 0.0 if sol.status != 1 else 1.0 if len(sol.t_events[0]) else -1.0
        return sol.t[-1], sol.y[:, -1].copy(), way


ROOT = 2
"""CVODE's status where a root ended a run."""


class CvodeArcs:
    """One solver of a slipping block and one of a held one, started anew with every arc. The right-hand
    sides are compiled. Adams' formulas are the better ones here, for there is no stiffness."""

    def __init__(self, p: following.Plant, rtol: float) -> None:
        self.p, self.numbers = p, np.array(p)
        numbers = self.numbers
        self.sign = [1.0, 1.0, 0.0]
        self.level = [0.0, 0.0]
        sign, level = self.sign, self.level

        def slip(t, y, yp):
            following.fill_slip(t, y, yp, numbers, sign[2])

        def slip_signals(_, y, out):
            s, sigma, _ = sign
            out[0], out[1], out[2] = sigma * y[2], s * y[0], GONE - s * y[0]

        def held(t, y, yp):
            following.fill_held(t, y, yp, numbers)

        def held_signals(t, y, out):
            excess = following.moment(p, t, y) - level[1]
            out[0], out[1] = level[0] - excess, level[0] + excess

        options: Any = {"method": "Adams", "rtol": rtol, "atol": 1e-3 * rtol, "max_num_steps": 20_000}
        for signals, count in ((slip_signals, 3), (held_signals, 2)):
            signals.terminal, signals.direction = [True] * count, [-1] * count
        longest = following.STEP * p.period
        self.slipping = CVODE(slip, eventsfn=slip_signals, num_events=3, max_step=longest, **options)
        self.holding = CVODE(held, eventsfn=held_signals, num_events=2, max_step=p.held_step(), **options)

    def _run(
        self, solver: Any, t: float, y: np.ndarray, end: float, flight: float = 1.0
    ) -> tuple[float, np.ndarray, int]:
        """(time, state, event), the event -1 at `end`. Where an arc lasts a short time `flight`, the first
        steps must be shorter, lest a signal rises and falls within one."""
        if end - t <= 1e-13 * end:
            return end, y, -1
        solver.init_step(t, y)
        stops = [t + share * flight for share in (0.5, 2.0)] if flight < 0.1 * end else []
        for stop in (*(stop for stop in stops if t < stop < end), end):
            out = solver.step(stop, tstop=stop)
            if not out.success:
                raise Unable(f"CVODE stops with {out.status}")
            if out.status == ROOT:
                break
        event = int(np.argmax(out.i_events[-1] != 0)) if out.status == ROOT else -1
        return float(out.t), np.array(out.y).ravel(), event

    def slip(self, t, y, s, sigma, end):
        """Until the next event."""
        self.sign[:] = s, sigma, s * self.p.weight + sigma * self.p.k
        pull = abs(following.slip_rates(t, y, self.numbers, self.sign[2])[2]) or 1e-300
        flight = abs(y[2]) / pull if y[0] == 0.0 else math.sqrt(2.0 * abs(y[0]) / pull)
        t, y, event = self._run(self.slipping, t, y, end, flight)
        return t, y, ("turn", "zero", "gone", "end")[event]

    def held(self, t, y, s, end):
        """Until it is freed."""
        self.level[:] = self.p.k + (0.0 if s else self.p.weight), s * self.p.weight
        t, y, event = self._run(self.holding, t, y, end)
        return t, y, (1.0, -1.0, 0.0)[event]


@lru_cache(maxsize=8)
def taylor(tol: float) -> tuple[Any, Any]:
    """heyoka's integrators of a slipping and of a held block, compiled once; parameters are the numbers of a
    plant, s weight + sigma k, sigma and s. Events fall through zero."""
    phi, psi, dphi, dpsi = state = hy.make_vars("phi", "psi", "dphi", "dpsi")
    i11, i12, i21, i22, up, hinge, drag, f, xi, inertia, weight, k, mu, by_rate = (
        hy.par[i] for i in range(14)
    )
    load, sigma, s = (hy.par[i] for i in range(17, 20))
    push, slide, none = f * hy.sin(xi * hy.time), dphi - dpsi, hy.expression(0.0)
    block, bob = up * (phi - push) - load - drag * slide, push - psi + hinge * slide
    slip = [dphi, dpsi, i11 * block + i12 * bob, i21 * block + i22 * bob]
    held = [none, dpsi, none, (push - psi - hinge * dpsi) / inertia]
    # At rest, with s = 0, the weight holds as friction does.
    excess = up * phi - push - 2.0 * mu * psi + by_rate * dpsi - s * weight
    hold = k + (1.0 - s * s) * weight
    out = []
    for rates, signals in (
        (slip, [sigma * dphi, s * phi, GONE - s * phi]),
        (held, [hold - excess, hold + excess]),
    ):
        events = [hy.t_event(g, direction=hy.event_direction.negative) for g in signals]
        system = list(zip(state, rates, strict=True))
        out.append(hy.taylor_adaptive(system, [0.0] * 4, pars=[1.0] * 20, tol=tol, t_events=events))
    return out[0], out[1]


class TaylorArcs:
    """Arcs of one design by heyoka."""

    def __init__(self, p: Plant, tol: float) -> None:
        self.p, (self.slipping, self.holding) = p, taylor(tol)
        for integrator in (self.slipping, self.holding):
            integrator.pars[:17] = p

    def _run(self, integrator: Any, t: float, y: np.ndarray, end: float) -> tuple[float, np.ndarray, int]:
        integrator.time, integrator.state[:] = t, y
        integrator.reset_cooldowns()
        outcome = int(integrator.propagate_until(end)[0])
        if outcome == int(hy.taylor_outcome.time_limit):
            return end, integrator.state.copy(), -1
        if outcome >= 0 or outcome < -3:
            raise Unable(f"heyoka stops with {outcome}")
        return integrator.time, integrator.state.copy(), -outcome - 1

    def slip(self, t, y, s, sigma, end):
        """Until the next event."""
        self.slipping.pars[17:] = s * self.p.weight + sigma * self.p.k, sigma, s
        # What frees a held block does so with no acceleration: the sign of round-off is no event.
        y[2] = y[2] or sigma * 1e-16
        t, y, event = self._run(self.slipping, t, y, end)
        return t, y, ("turn", "zero", "gone", "end")[event]

    def held(self, t, y, s, end):
        """Until it is freed."""
        self.holding.pars[19] = s
        t, y, event = self._run(self.holding, t, y, end)
        return t, y, (1.0, -1.0, 0.0)[event]


def _method(name: str, arcs: Any, rtols: tuple[float, ...]) -> Method:
    def settled(scene: Scene, y0: Any, rtol: float) -> following.Settled:
        p = following.plant(scene.x)
        by, quiet = arcs(p, rtol), following.quiet(p, rtol)
        return following.settle(p, lambda y: following.one_period(p, by, y, quiet), y0, rtol)

    def value(scene: Scene, rtol: float):
        return lambda: following.amplitude(lambda: settled(scene, scene.y0, rtol))

    def gradient(scene: Scene, rtol: float):
        return lambda: following.differences(scene, settled, rtol)

    return Method(name, False, rtols, value, gradient)


METHODS = (
    _method("SciPy DOP853, events", lambda p, rtol: ScipyArcs(p, np.array(p), rtol), (1e-5, 1e-9)),
    # Finer ones end in round-off of the restarts, which never settles.
    *((_method("SUNDIALS CVODE, roots", CvodeArcs, (1e-5, 1e-8)),) if CVODE else ()),
    *((_method("heyoka, events", TaylorArcs, (1e-6, 1e-12)),) if hy else ()),
)
