"""SciPy's integrators with events, arcs joined where they end."""

from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from tests.benchmarks.precision import following
from tests.benchmarks.precision.following import GONE, Plant, Settled
from tests.benchmarks.precision.methods import Method, Scene

RTOLS = {
    "DOP853": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
    "LSODA": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
    "Radau": (1e-3, 1e-4, 1e-5, 1e-6, 1e-7),
}
"""Radau's fifth order makes finer ones long."""


def _terminal(signal: Any) -> Any:
    signal.terminal, signal.direction = True, -1
    return signal


class ScipyArcs(NamedTuple):
    """Compiled right-hand sides under `solve_ivp`, which stops at the events it locates itself."""

    p: Plant
    numbers: np.ndarray
    solver: str
    rtol: float

    def _solve(self, rates: Any, t: float, end: float, y: np.ndarray, events: list, jac: Any, step: float):
        options: dict[str, Any] = {"method": self.solver, "rtol": self.rtol, "atol": 1e-3 * self.rtol}
        jacobian = jac(self.p)
        if self.solver == "Radau":
            options["jac"] = jacobian
        elif self.solver == "LSODA":
            options["jac"] = lambda t, y: jacobian
        return solve_ivp(rates, (t, end), y, events=events, max_step=step, **options)

    def slip(self, t, y, s, sigma, end):
        """The tilt is monotone on an arc, so it crosses zero at most once, and only on the way down: a
        turning point found beyond zero betrays a crossing that fell, with the return of the continued
        arc, into one step."""
        numbers = self.numbers
        p, down, load = self.p, s != sigma, s * self.p.weight + sigma * self.p.k
        turn = _terminal(lambda _, y: sigma * y[2])
        zero = _terminal(lambda _, y: s * y[0])
        gone = _terminal(lambda _, y: GONE - s * y[0])
        jac, step = following.slip_jacobian, following.STEP * p.period

        def rates(t, y):
            return following.slip_rates(t, y, numbers, load)

        for _ in range(10):
            sol = self._solve(rates, t, end, y, [turn, zero if down else gone], jac, step)
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
            sol = self._solve(rates, t, at, y, [zero], jac, step)
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

        jac = following.held_jacobian
        sol = self._solve(rates, t, end, y, [over, under], jac, p.held_step())
        way = 0.0 if sol.status != 1 else 1.0 if len(sol.t_events[0]) else -1.0
        return sol.t[-1], sol.y[:, -1].copy(), way


def settled(scene: Scene, y0: Any, solver: str, rtol: float) -> Settled:
    """The settled motion by one of SciPy's solvers."""
    p = following.plant(scene.x)
    arcs, quiet = ScipyArcs(p, np.array(p), solver, rtol), following.quiet(p, rtol)
    return following.settle(p, lambda y: following.one_period(p, arcs, y, quiet), y0, rtol)


def _method(solver: str) -> Method:
    def value(scene: Scene, rtol: float):
        return lambda: following.amplitude(lambda: settled(scene, scene.y0, solver, rtol))

    def gradient(scene: Scene, rtol: float):
        return lambda: following.differences(scene, lambda s, y, r: settled(s, y, solver, r), rtol)

    return Method(f"SciPy {solver}, events", False, "rtol", RTOLS[solver], value, gradient)


METHODS = tuple(map(_method, RTOLS))
