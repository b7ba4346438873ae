"""Answers known from elsewhere, each with its source and tolerance, and ways to obtain more.

Symbols are those of Collini et al. (2016); equation numbers are the paper's. Every case is of the
linear equations (25) with their misprints corrected, without the parametric term s f nu phi sin,
for a block that is a uniform rectangle.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from scipy.integrate import solve_ivp

from tpd import Parameters, Piecewise, Smoothed, Status, steady_state

NAMES = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e")
"""The order of a vector of parameters; e may be left out, and rho is tied to nu."""


def parameters(x: Any) -> Parameters:
    """The parameters in a vector of seven or, with e, eight."""
    return Parameters(**dict(zip(NAMES, x, strict=False)))


class Case(NamedTuple):
    """Settled motion from `y0` at tau = 0: amplitude, and its gradient in NAMES[:7].

    `digits` is the absolute error that the printed amplitude may have, `slopes` the relative one
    of the gradient.
    """

    name: str
    x: tuple[float, ...]
    amplitude: float
    digits: float
    gradient: tuple[float, ...]
    y0: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    slopes: float = 1e-6


# Source: an event-driven integration of (25) in another language, unknown crossing times and
# closed forms agreeing to all printed digits; gradients with rho = 3/(4 (1 + nu^2)) tied to nu.
HUNG = (
    Case(
        "short light pendulum",
        (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67),
        0.061932440888,
        5e-13,
        (0.088406446, -0.416603562, -0.00629347967, 0.216728437, -0.126660502, 0.133011479, -0.0446043796),
    ),
    Case(
        "short damped pendulum",
        (0.25, 0.1, 0.15, 0.3, 0.05, 0.377, 2.67),
        0.068304382745,
        5e-13,
        (0.11694413, -0.109898993, -0.0211025654, 0.0278780786, -0.06251327, 0.11967109, -0.0490648849),
    ),
    Case(
        "long light pendulum",
        (0.2, 0.05, 0.8, 0.1, 0.05, 0.3, 3.0),
        0.055180823714,
        5e-13,
        (0.131109459, 0.0302113137, -0.00121120506, -0.00138255104, -0.0398039044, 0.102565761, -0.0333273734),
    ),
    # d/dzeta: Richardson differences of the amplitude give -0.00353529733(6), which the derivative
    # of the exact solution confirms; the printed source has -.00353530284, 1.6e-6 away.
    Case(
        "long heavy pendulum",
        (0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5),
        0.065674637832,
        5e-13,
        (0.111767725, 0.0266639516, -0.00408825678, -0.0035352973364, -0.0225215209, 0.0751276885, -0.0354141219),
    ),
)
