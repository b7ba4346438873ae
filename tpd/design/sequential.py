"""Sequential programming on exact gradients in a trust region, from many designs at once.

It minimises a capped weighted worst of n smooth functions (the maximum, the mean, or what lies between, the
mean of the worst share), under inequality constraints and bounds. Each step minimises this measure of their
linear models in a box around the design, see `tpd.design.subproblem`. A quadratic term learns the curvature
(BFGS, damped), so that a kink where several conditions balance is met as surely as a smooth bottom, and
second-order corrections let a curved kink be followed in long steps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tpd.design.subproblem import PENALTY, Linearisation, solve_subproblem

_CORRECTIONS = 2
"""Most second-order corrections of a step that fails."""
_SMALL = 1e-4
"""Step, in shares of the bounds, over which the linear decrease is measured that remains at the end."""
_ACCEPTED, _FAIR, _GOOD = 0.05, 0.2, 0.6
"""Share of the promised gain from which a step is taken, the trust region kept, and widened."""
_SHRUNK = 0.35
"""Factor from a failed step's length to the next trust region."""
_LEAST = 1e-7
"""Trust region, in shares of the bounds, below which a search ends."""
_STEEPEST = 1e4
"""Largest norm of the learnt curvature."""


class Ends(NamedTuple):
    """Ends of m searches."""

    x: np.ndarray
    """Best designs, scaled, (m, d)."""
    local: Linearisation
    """Functions and constraints there."""
    merit: np.ndarray
    """Measure plus penalty, (m,)."""
    stationarity: np.ndarray
    """Linear decrease of the merit that is left, per unit of scaled step: 0 at a stationary point."""
    weights: tuple[np.ndarray, np.ndarray]
    """Weights there of the functions (m, n) and of the constraints (m, l): which of them hold the design."""
    steps: np.ndarray
    """Steps tried."""
    open: np.ndarray
    """Whether a search was still going on when the steps ran out."""
    path: np.ndarray
    """Designs before the first and after every step, (steps + 1, m, d)."""
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


def minimise(
    evaluate: Callable[[np.ndarray], Linearisation],
    starts: np.ndarray,
    cap: float,
    risk: Callable[[np.ndarray], np.ndarray],
    *,
    known: Linearisation | None = None,
    low: np.ndarray | None = None,
    high: np.ndarray | None = None,
    steps: int = 40,
    radius: float = 0.15,
    tolerance: float = 1e-6,
    after: Callable[[int, int], None] | None = None,
) -> Ends:
    """Descend from all starts (m, d) at once; coordinates are scaled to bounds of about [0, 1].

    Args:
        evaluate: functions and constraints at designs, (k, d).
        starts: shape (m, d).
        cap: largest weight of one function; 1 for the maximum, 1/n for the mean.
        risk: the risk measure itself, of values (k, n).
        known: what `evaluate` gives at the starts, if it has been asked before.
        low: bounds of each start, (m, d); default 0.
        high: default 1.
        steps: bound on the steps.
        radius: first trust region, a share of the bounds.
        tolerance: of the merit, below which a predicted gain ends a descent.
        after: called with (steps done, of how many).
    """
    low = np.zeros_like(starts) if low is None else low
    high = np.ones_like(starts) if high is None else high
    run = _Run(evaluate, np.clip(starts, low, high), low, high, cap, risk, known, radius)
    for step in range(steps):
        if not run.step(tolerance):
            break
        if after is not None:
            after(step + 1, steps)
    return run.ends()


class _Run:
    """State of all searches: designs, what is known there, trust regions and learnt curvatures."""

    def __init__(
        self,
        evaluate: Callable[[np.ndarray], Linearisation],
        x: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
        cap: float,
        risk: Callable[[np.ndarray], np.ndarray],
        known: Linearisation | None,
        radius: float,
    ) -> None:
        m, d = x.shape
        self.evaluate, self.low, self.high, self.cap, self.risk = evaluate, low, high, cap, risk
        self.x, self.widest = x, 2.0 * radius
        self.here = evaluate(x) if known is None else Linearisation(*(np.array(part) for part in known))
        self.merit = merit_of(self.here, risk)
        self.reach, self.curve = np.full(m, radius), np.tile(1e-3 * np.eye(d), (m, 1, 1))
        self.alive, self.taken = np.isfinite(self.merit), np.zeros(m, int)
        self.evaluations = m if known is None else 0
        self.path = [(x.copy(), self.merit.copy(), self.evaluations)]

    def step(self, tolerance: float) -> bool:
        """One step of every search that goes on; False where none does."""
        rows = np.flatnonzero(self.alive)
        if not len(rows):
            return False
        models = self._models(rows)
        box = models.low, models.high
        move, gain, weights = solve_subproblem(models.local, models.curve, box, self.cap, models.merit)
        # The subproblem is convex: a design that it promises no gain is stationary.
        done = gain < tolerance * np.maximum(1.0, np.abs(models.merit))
        self.alive[rows[done]] = False
        rows, move, gain = rows[~done], move[~done], gain[~done]
        if not len(rows):
            return False
        models, weights = models.at(~done), (weights[0][~done], weights[1][~done])
        trial = self.evaluate(models.x + move)
        # Even a step that fails has shown how the slopes change along it.
        self.curve[rows] = _learn(models.curve, move, models.local, trial, weights)
        models = models._replace(curve=self.curve[rows])
        move, trial, more = _corrected(self.evaluate, self.risk, self.cap, models, move, trial)
        self.evaluations += len(rows) + more
        self._take(rows, move, trial, gain)
        self.path.append((self.x.copy(), self.merit.copy(), self.evaluations))
        return True

    def _models(self, rows: np.ndarray) -> _Models:
        """Linear models of some searches, each trusted in a box within the bounds."""
        x, reach = self.x[rows], self.reach[rows, None]
        low, high = np.maximum(self.low[rows] - x, -reach), np.minimum(self.high[rows] - x, reach)
        return _Models(x, self.here.at(rows), self.curve[rows], low, high, self.merit[rows])

    def _take(self, rows: np.ndarray, move: np.ndarray, trial: Linearisation, gain: np.ndarray) -> None:
        """Take the steps that help, and set every trust region by how well its models foretold the merit: the
        models are linear, so that only a trial says how far they hold. A region grows only where the step met
        its edge; after a failure it shrinks to within the step, which would otherwise be repeated."""
        new = merit_of(trial, self.risk)
        there = self.x[rows] + move
        length = np.abs(move).max(axis=1)
        ratio = (self.merit[rows] - new) / gain
        good = (ratio > _ACCEPTED) & np.isfinite(new)
        at_edge = length > 0.9 * self.reach[rows]
        kept = np.where(good & (ratio > _FAIR), self.reach[rows], _SHRUNK * length)
        grown = np.where(good & (ratio > _GOOD) & at_edge, 2.0 * self.reach[rows], kept)
        self.reach[rows] = np.minimum(grown, self.widest)
        self.taken[rows] += 1
        better = rows[good]
        self.x[better], self.merit[better] = there[good], new[good]
        for old, fresh in zip(self.here, trial, strict=True):
            old[better] = fresh[good]
        self.alive[rows] &= self.reach[rows] > _LEAST

    def ends(self) -> Ends:
        """Ends, with the gain that is left to first order: the gain of linear models in a small box."""
        m, d = self.x.shape
        small = np.maximum(self.low - self.x, -_SMALL), np.minimum(self.high - self.x, _SMALL)
        flat = np.tile(1e-9 * np.eye(d), (m, 1, 1))
        _, left, weights = solve_subproblem(self.here, flat, small, self.cap, self.merit)
        path, merits, spent = (np.stack(part) for part in zip(*self.path, strict=True))
        return Ends(
            x=self.x,
            local=self.here,
            merit=self.merit,
            stationarity=np.maximum(left, 0.0) / _SMALL,
            weights=weights,
            steps=self.taken,
            open=self.alive,
            path=path,
            path_merit=merits,
            path_spent=spent,
            mismatch=np.zeros((len(self.x), 2)),
            lost=np.zeros(len(self.x), int),
        )


class _Models(NamedTuple):
    """Designs, functions and constraints there, learnt curvatures, and the boxes around them in which these
    models are trusted."""

    x: np.ndarray
    local: Linearisation
    curve: np.ndarray
    low: np.ndarray
    high: np.ndarray
    merit: np.ndarray

    def at(self, rows: np.ndarray) -> _Models:
        """Models at some of the designs."""
        x, local, curve, low, high, merit = self
        return _Models(x[rows], local.at(rows), curve[rows], low[rows], high[rows], merit[rows])

    def through(self, trial: Linearisation, move: np.ndarray) -> Linearisation:
        """Linear models with the slopes here whose values after `move` are those of the trial."""
        here = self.local
        return Linearisation(
            trial.value - np.einsum("mnd,md->mn", here.slope, move),
            here.slope,
            trial.limit - np.einsum("mld,md->ml", here.limit_slope, move),
            here.limit_slope,
        )


def _corrected(
    evaluate: Callable[[np.ndarray], Linearisation],
    risk: Callable[[np.ndarray], np.ndarray],
    cap: float,
    models: _Models,
    move: np.ndarray,
    trial: Linearisation,
) -> tuple[np.ndarray, Linearisation, int]:
    """Second-order corrections (Fletcher) of the steps that climb. A straight step along a curved kink or
    limit leaves it by the square of its length, and the merit, which has a kink there, rises by as much
    (Maratos' effect): without a correction only short steps would be taken. The values at the trial show
    the curvature: the subproblem is solved again with the slopes from here and the values from there.

    Returns:
        Steps, functions and constraints there, and the number of designs evaluated.
    """
    move, trial, asked = move.copy(), Linearisation(*(part.copy() for part in trial)), 0
    for _ in range(_CORRECTIONS):
        new = merit_of(trial, risk)
        poor = np.flatnonzero((new > models.merit) & np.isfinite(new))
        if not len(poor):
            break
        of = models.at(poor)
        met = of.through(trial.at(poor), move[poor])
        again, _, _ = solve_subproblem(met, of.curve, (of.low, of.high), cap, of.merit)
        bent = evaluate(of.x + again)
        asked += len(poor)
        better = merit_of(bent, risk) < new[poor]
        move[poor[better]] = again[better]
        for old, fresh in zip(trial, bent, strict=True):
            old[poor[better]] = fresh[better]
    return move, trial, asked


def merit_of(at: Linearisation, risk: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Measure plus penalty, (m,)."""
    return risk(at.value) + PENALTY * np.sum(np.maximum(at.limit, 0.0), axis=1)


def _learn(
    curve: np.ndarray, move: np.ndarray, old: Linearisation, new: Linearisation, weights: tuple
) -> np.ndarray:
    """Damped BFGS on the gradient of the Lagrangian, whose weights are those of the subproblem. Instead of
    the change of slope y, Powell's damping takes a mean of y and B s that keeps the curvature positive."""
    on, by = weights
    change = np.einsum("mn,mnd->md", on, new.slope - old.slope)
    change = change + np.einsum("ml,mld->md", by, new.limit_slope - old.limit_slope)
    out = curve.copy()
    for i, (s, y) in enumerate(zip(move, change, strict=True)):
        bs = curve[i] @ s
        sbs, sy = s @ bs, s @ y
        if not (np.isfinite(sy) and sbs > 1e-18):
            continue
        share = 1.0 if sy >= 0.2 * sbs else 0.8 * sbs / (sbs - sy)
        r = share * y + (1.0 - share) * bs
        fresh = curve[i] - np.outer(bs, bs) / sbs + np.outer(r, r) / (s @ r)
        size = np.linalg.norm(fresh)
        out[i] = fresh if size < _STEEPEST else fresh * (_STEEPEST / size)
    return out
