"""Small problems of two variables whose minimax is known, as linearisations."""

from collections.abc import Callable, Sequence

import numpy as np

import tpd
from tpd.design.newton import Linearisation


def linearisations(functions: Sequence[Callable], limits: Sequence[Callable] = ()) -> Callable:
    """`evaluate` of functions of (x, y), each of which gives its value and its gradient."""

    def evaluate(points):
        values = [f(*points.T) for f in functions]
        bounds = [c(*points.T) for c in limits]
        none = np.full((len(points), 1), -1.0), np.zeros((len(points), 1, 2))
        return Linearisation(
            np.stack([v for v, _ in values], axis=1),
            np.stack([np.stack(g, axis=1) for _, g in values], axis=1),
            np.stack([v for v, _ in bounds], axis=1) if bounds else none[0],
            np.stack([np.stack(g, axis=1) for _, g in bounds], axis=1) if bounds else none[1],
        )

    return evaluate


CB2 = (
    lambda x, y: (x**2 + y**4, (2 * x, 4 * y**3)),
    lambda x, y: ((2 - x) ** 2 + (2 - y) ** 2, (2 * x - 4, 2 * y - 4)),
    lambda x, y: (2 * np.exp(y - x), (-2 * np.exp(y - x), 2 * np.exp(y - x))),
)
"""Charalambous and Bandler's second problem: its minimax is 1.9522245 at (1.13904, 0.89956); with
x + y <= 1.5 it is 3.125 at (0.75, 0.75), as a fine grid says."""


def half_plane(x, y):
    """x + y <= 1.5."""
    return x + y - 1.5, (np.ones_like(x), np.ones_like(y))


WORST = tpd.Risk.worst().of
STARTS = np.array([[0.35, 0.8], [0.8, 0.5], [0.5, 0.5], [0.65, 0.45]])


def in_unit_square(problem):
    """A problem over [-3, 3]^2 in shares of these bounds."""

    def evaluate(unit):
        at = problem(6.0 * unit - 3.0)
        return at._replace(slope=6.0 * at.slope, limit_slope=6.0 * at.limit_slope)

    return evaluate


FREE, LIMITED = in_unit_square(linearisations(CB2)), in_unit_square(linearisations(CB2, [half_plane]))
