"""heyoka: Taylor series compiled just in time, events located on the series, variational equations.

Slopes go through the events by their saltation matrices: an arc's own time is a function of where it
began and of the parameters. With the slopes of one period's map the settled state's slopes follow
from one linear system, (1 - D) dy = dP, where no difference is taken anywhere.
"""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from tests.benchmarks.precision import following
from tests.benchmarks.precision.following import GONE, Mode, Overturned, Plant, Settled
from tests.benchmarks.precision.methods import Method, Scene, Unable

TOLS = (1e-4, 1e-6, 1e-9, 1e-12, 1e-15)

NUDGE = 1e-16
"""A rate (rad per unit tau) to begin an arc with, in place of zero."""

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
