"""SciPy's integrators on the equations with sgn(x) replaced by tanh(x/width): no events, no modes.

The widths are `eps` times the tilt of free rocking at the forcing's frequency, and xi times that for
its rate, as in `tpd.Smoothed`. The error has a share of the smoothing, which falls with eps, and one
of the integrator, kept below it by a tolerance that follows eps.
"""

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tests.benchmarks.precision import following
from tests.benchmarks.precision.following import GONE, Overturned, Plant, Settled, njit
from tests.benchmarks.precision.methods import Method, Scene

SHARE = 5e-3
"""What may be left of the transient, relatively, over eps."""
FINER = 0.1
"""Relative tolerance of the integrator over what may be left."""


def widths(p: Plant) -> tuple[float, float]:
    """Of the tilt and its rate for eps = 1."""
    rho = 3.0 / (4.0 * (1.0 + p.nu**2))
    m11 = 1.0 + p.mu * rho * (4.0 + p.nu**2)
    scale = (4.0 / math.pi) * p.weight / (m11 * p.xi**2 + p.up)
    return scale, p.xi * scale


@njit
def rates(t: float, y: np.ndarray, c: np.ndarray, of_tilt: float, of_rate: float) -> np.ndarray:
    """The smoothed equations."""
    out = np.empty(4)
    load = c[10] * math.tanh(y[0] / of_tilt) + c[11] * math.tanh(y[2] / of_rate)
    following.fill_slip(t, y, out, c, load)
    return out


def settled(scene: Scene, y0: Any, eps: float, solver: str) -> Settled:
    """The settled motion; its largest |phi| is that of the turning points that SciPy locates."""
    p = following.plant(scene.x)
    numbers, rtol = np.array(p), FINER * SHARE * eps
    of_tilt, of_rate = (eps * width for width in widths(p))
    linear, push = following.slip_jacobian(p), np.array([0.0, 0.0, p.i11, p.i21])

    def jacobian(t, y):
        out = linear.copy()
        out[:, 0] -= push * p.weight / of_tilt / math.cosh(min(abs(y[0]) / of_tilt, 300.0)) ** 2
        out[:, 2] -= push * p.k / of_rate / math.cosh(min(abs(y[2]) / of_rate, 300.0)) ** 2
        return out

    def function(t, y):
        return rates(t, y, numbers, of_tilt, of_rate)

    def turn(t, y):
        return y[2]

    def gone(t, y):
        return GONE - abs(y[0])

    gone.terminal = True
    options: dict[str, Any] = {} if solver == "DOP853" else {"jac": jacobian}
    options |= {"method": solver, "rtol": rtol, "atol": 1e-3 * rtol, "max_step": following.STEP * p.period}

    def period(y):
        sol = solve_ivp(function, (0.0, p.period), y, events=[turn, gone], **options)
        if sol.status:
            raise Overturned
        peaks = np.abs(sol.y_events[0][:, 0]) if len(sol.t_events[0]) else np.abs(sol.y[0])
        return sol.y[:, -1].copy(), float(np.max(peaks))

    return following.settle(p, period, y0, SHARE * eps)


def _method(solver: str, settings: tuple[float, ...]) -> Method:
    def value(scene: Scene, eps: float):
        return lambda: following.amplitude(lambda: settled(scene, scene.y0, eps, solver))

    def gradient(scene: Scene, eps: float):
        def of_tolerance(scene: Scene, y0: Any, left: float) -> Settled:
            return settled(scene, y0, left / SHARE, solver)

        return lambda: following.differences(scene, of_tolerance, SHARE * eps)

    return Method(f"SciPy {solver}, smoothed signs", False, "eps", settings, value, gradient)


METHODS = (
    _method("DOP853", (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)),
    _method("LSODA", (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)),
    _method("Radau", (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)),
)
