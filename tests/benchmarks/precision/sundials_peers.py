"""SUNDIALS' CVODE with its root finding, through scikit-sundae, arcs joined where they end."""

import math
from typing import Any

import numpy as np
from sksundae.cvode import CVODE

from tests.benchmarks.precision import following
from tests.benchmarks.precision.following import GONE, Settled
from tests.benchmarks.precision.methods import Method, Scene, Unable

RTOLS = (1e-4, 1e-5, 1e-6, 1e-8, 1e-10)
"""Finer ones end in round-off of the restarts, which never settles."""

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
        slip_jacobian, held_jacobian = following.slip_jacobian(p), following.held_jacobian(p)

        def slip(t, y, yp):
            following.fill_slip(t, y, yp, numbers, sign[2])

        def slip_signals(_, y, out):
            s, sigma, _ = sign
            out[0], out[1], out[2] = sigma * y[2], s * y[0], GONE - s * y[0]

        def slip_slopes(t, y, yp, out):
            out[:] = slip_jacobian

        def held(t, y, yp):
            following.fill_held(t, y, yp, numbers)

        def held_signals(t, y, out):
            excess = following.moment(p, t, y) - level[1]
            out[0], out[1] = level[0] - excess, level[0] + excess

        def held_slopes(t, y, yp, out):
            out[:] = held_jacobian

        options: Any = {"method": "Adams", "rtol": rtol, "atol": 1e-3 * rtol, "max_num_steps": 20_000}
        for signals, count in ((slip_signals, 3), (held_signals, 2)):
            signals.terminal, signals.direction = [True] * count, [-1] * count
        longest = following.STEP * p.period
        self.slipping = CVODE(
            slip, eventsfn=slip_signals, num_events=3, jacfn=slip_slopes, max_step=longest, **options
        )
        self.holding = CVODE(
            held, eventsfn=held_signals, num_events=2, jacfn=held_slopes, max_step=p.held_step(), **options
        )

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


def settled(scene: Scene, y0: Any, rtol: float) -> Settled:
    """The settled motion."""
    p = following.plant(scene.x)
    arcs, quiet = CvodeArcs(p, rtol), following.quiet(p, rtol)
    return following.settle(p, lambda y: following.one_period(p, arcs, y, quiet), y0, rtol)


def _value(scene: Scene, rtol: float):
    return lambda: following.amplitude(lambda: settled(scene, scene.y0, rtol))


def _gradient(scene: Scene, rtol: float):
    return lambda: following.differences(scene, settled, rtol)


METHODS = (Method("SUNDIALS CVODE, roots", False, "rtol", RTOLS, _value, _gradient),)
