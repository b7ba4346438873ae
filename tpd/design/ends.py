"""Ends of searches: the best design of every start, its path, and how good it is.

At an end the linear models of functions and constraints in a small box tell how much is left to gain, and by
their dual variables which conditions and constraints hold the design."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

PENALTY = 10.0
"""Weight C of a violated constraint in the merit: exact as long as no multiplier exceeds it. SLSQP has one
excess for all constraints, which is exact as long as the sum of the multipliers does not exceed it."""
OPEN = 1e-2
"""First-order gain at which a search counts as not ended: merit per whole width of the bounds."""
_SMALL = 1e-4
"""Step, in shares of the bounds, over which this gain is measured."""


class Linearisation(NamedTuple):
    """n functions and l constraints (<= 0) at m designs, and their slopes along d scaled coordinates."""

    value: np.ndarray
    """(m, n)"""
    slope: np.ndarray
    """(m, n, d)"""
    limit: np.ndarray
    """(m, l)"""
    limit_slope: np.ndarray
    """(m, l, d)"""

    def at(self, rows: np.ndarray | slice) -> Linearisation:
        """Linearisation at some of the designs."""
        return Linearisation(*(x[rows] for x in self))


Evaluate = Callable[[np.ndarray], Linearisation]
"""Functions and constraints at designs (k, d) in shares of the bounds."""
Measure = Callable[[np.ndarray], np.ndarray]
"""Risk measure of values (k, n), (k,)."""


class Ends(NamedTuple):
    """Ends of m searches."""

    x: np.ndarray
    """Best designs, scaled, (m, d)."""
    local: Linearisation
    """Functions and constraints there."""
    merit: np.ndarray
    """Measure plus penalty, (m,)."""
    stationarity: np.ndarray
    """Linear decrease of the merit that is left, per unit of scaled step: 0 at a stationary point, NaN where
    it is not known."""
    weights: tuple[np.ndarray, np.ndarray]
    """Weights there of the functions (m, n) and of the constraints (m, l): which of them hold the design."""
    steps: np.ndarray
    """Designs that each search tried, (m,)."""
    open: np.ndarray
    """Whether there is more to gain."""
    path: np.ndarray
    """Best designs before the first and after every step, (steps + 1, m, d)."""
    path_merit: np.ndarray
    """Their merits, (steps + 1, m)."""
    path_spent: np.ndarray
    """Designs evaluated by then, (steps + 1,)."""
    mismatch: np.ndarray
    """Largest relative differences of tilts, and of their slopes, between the model of the search and the
    exact solution, (m, 2); zero where the search was on the exact solution."""
    lost: np.ndarray
    """Orbits that the model of the search lost on the way, (m,)."""

    @property
    def evaluations(self) -> int:
        """Designs evaluated."""
        return int(self.path_spent[-1])


class Book:
    """Best design of every search so far, its linearisation, and the path."""

    def __init__(
        self, evaluate: Evaluate, risk: Measure, starts: np.ndarray, known: Linearisation | None = None
    ) -> None:
        self.evaluate, self.risk = evaluate, risk
        self.evaluations = len(starts) if known is None else 0
        self.x = starts.copy()
        self.local = evaluate(starts) if known is None else Linearisation(*(np.array(part) for part in known))
        self.merit = merit_of(self.local, risk)
        self.path = [(self.x.copy(), self.merit.copy(), self.evaluations)]

    def tried(self, x: np.ndarray) -> Linearisation:
        """Linearisation at one design of each search; the best designs are recorded."""
        at = self.evaluate(x)
        self.evaluations += len(x)
        merit = merit_of(at, self.risk)
        better = merit < self.merit
        self.x[better], self.merit[better] = x[better], merit[better]
        for old, fresh in zip(self.local, at, strict=True):
            old[better] = fresh[better]
        self.path.append((self.x.copy(), self.merit.copy(), self.evaluations))
        return at

    def ends(self, cap: float) -> Ends:
        """The best designs as ends; `cap` is the largest weight of one function."""
        m = len(self.x)
        left = [_left(self.local.at(slice(i, i + 1)), self.merit[i], self.x[i], cap) for i in range(m)]
        gain, on, by = (np.array(part) for part in zip(*left, strict=True))
        path, merits, spent = (np.stack(part) for part in zip(*self.path, strict=True))
        return Ends(
            x=self.x,
            local=self.local,
            merit=self.merit,
            stationarity=gain,
            weights=(on, by),
            steps=np.full(m, len(self.path) - 1),
            open=~(gain <= OPEN),
            path=path,
            path_merit=merits,
            path_spent=spent,
            mismatch=np.zeros((m, 2)),
            lost=np.zeros(m, int),
        )


def merit_of(at: Linearisation, risk: Measure) -> np.ndarray:
    """Measure plus penalty, (m,)."""
    return risk(at.value) + PENALTY * np.sum(np.maximum(at.limit, 0.0), axis=1)


def joined(ends: list[Ends]) -> Ends:
    """Ends of searches that went one after the other, their paths side by side."""
    longest = max(len(e.path) for e in ends)

    def paths(name: str) -> list[np.ndarray]:
        every = [getattr(e, name) for e in ends]
        return [np.concatenate([x, np.repeat(x[-1:], longest - len(x), axis=0)]) for x in every]

    rest = ("x", "merit", "stationarity", "steps", "open", "mismatch", "lost")
    on, by = map(np.concatenate, zip(*(e.weights for e in ends), strict=True))
    return Ends(
        local=Linearisation(*map(np.concatenate, zip(*(e.local for e in ends), strict=True))),
        weights=(on, by),
        path=np.concatenate(paths("path"), axis=1),
        path_merit=np.concatenate(paths("path_merit"), axis=1),
        path_spent=np.sum(paths("path_spent"), axis=0),
        **{name: np.concatenate([getattr(e, name) for e in ends]) for name in rest},
    )


def _left(at: Linearisation, merit: float, x: np.ndarray, cap: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Gain of the linear models of one design in a small box, per unit of its size, and the weights of
    functions (n,) and constraints (l,): the dual variables of a linear programme in (step, s, v, t),

        min  s + cap sum v + C sum t,    f_i + f_i' step - s <= v_i,    c_j + c_j' step <= t_j,    v, t >= 0.
    """
    value, slope, limit, limit_slope = (part[0] for part in at)
    on, by = np.zeros(len(value)), np.zeros(len(limit))
    if not np.isfinite(merit):
        return np.nan, on, by
    # No derivative says which way leads on.
    slope, limit_slope = (np.where(np.isfinite(x), x, 0.0) for x in (slope, limit_slope))
    # Constraints that no step within the box can break have no weight.
    near = np.flatnonzero(limit + _SMALL * np.abs(limit_slope).sum(axis=1) > 0.0)
    d, n, k = len(x), len(value), len(near)
    functions = np.hstack([slope, -np.ones((n, 1)), -np.eye(n), np.zeros((n, k))])
    limits = np.hstack([limit_slope[near], np.zeros((k, 1 + n)), -np.eye(k)])
    box = [(max(-_SMALL, -u), min(_SMALL, 1.0 - u)) for u in x]
    # For the mean the level is free: rounding must not send it to infinity.
    level = value.min() - 1.0, value.max() + 1.0
    found = linprog(
        np.r_[np.zeros(d), 1.0, np.full(n, cap), np.full(k, PENALTY)],
        A_ub=np.vstack([functions, limits]),
        b_ub=-np.r_[value, limit[near]],
        bounds=[*box, level, *[(0.0, None)] * (n + k)],
    )
    if found.x is None:
        return np.nan, on, by
    on[:], by[near] = np.split(-found.ineqlin.marginals, [n])
    return max(float(merit - found.fun), 0.0) / _SMALL, on, by
