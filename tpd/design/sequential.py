"""Finishing a search over many conditions: sequential programming on exact gradients in a trust region.

What is minimised is a capped weighted worst of n smooth functions (the maximum, the mean, or what lies
between, the mean of the worst share), under inequality constraints and bounds. Each step minimises the
same measure of their linear models, with a quadratic term that learns the curvature (BFGS, damped), so
that a kink where several conditions balance is met as surely as a smooth bottom, and second-order
corrections, so that a curved kink is followed in long steps. The subproblem is convex and has as many
variables as the design: Newton's method on a smoothed form solves it to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core.batch import in_chunks

PENALTY = 10.0
"""Weight of a violated constraint in the merit: exact as long as no multiplier exceeds it."""
_SHARPEST = 1e-9
"""Last width of the smoothing in the subproblem."""
_LEVELS, _NEWTON = 12, 5
"""Widths of the smoothing on the way there, and Newton steps at each."""
_CORRECTIONS = 2
"""Most second-order corrections of a step that fails."""
_HALVINGS = 12
"""Most halvings of a Newton step."""
_FEW = 64
"""Constraints that a subproblem has, if no more can matter."""
_BATCH = 4
"""Subproblems solved at once, on each core."""
_SMALL = 1e-4
"""Step, in shares of the bounds, over which the linear decrease is measured that remains at the end."""


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
        """That of some of the designs."""
        return Linearisation(*(x[rows] for x in self))


class Ends(NamedTuple):
    """What became of m starts."""

    x: np.ndarray
    """Best designs, scaled, (m, d)."""
    local: Linearisation
    """There."""
    merit: np.ndarray
    """Measure plus penalty, (m,)."""
    stationarity: np.ndarray
    """Linear decrease of the merit that is left, per unit of scaled step: 0 at a stationary point."""
    weights: tuple[np.ndarray, np.ndarray]
    """There, of the functions (m, n) and of the constraints (m, l): which of them hold the design."""
    steps: np.ndarray
    """Steps tried."""
    open: np.ndarray
    """Whether a descent was still going on when the steps ran out."""
    path: np.ndarray
    """Designs before the first and after every step, (steps + 1, m, d)."""
    path_merit: np.ndarray
    """Their merits, (steps + 1, m)."""
    path_spent: np.ndarray
    """Designs evaluated by then, (steps + 1,)."""

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
    m, d = starts.shape
    x = np.clip(starts, low, high)
    here = evaluate(x) if known is None else Linearisation(*(np.array(part) for part in known))
    merit = merit_of(here, risk)
    reach, curve = np.full(m, radius), np.tile(1e-3 * np.eye(d), (m, 1, 1))
    alive, taken = np.isfinite(merit), np.zeros(m, int)
    evaluations = m if known is None else 0
    path = [(x.copy(), merit.copy(), evaluations)]
    for step in range(steps):
        rows = np.flatnonzero(alive)
        if not len(rows):
            break
        now = here.at(rows)
        box = (
            np.maximum(low[rows] - x[rows], -reach[rows, None]),
            np.minimum(high[rows] - x[rows], reach[rows, None]),
        )
        move, gain, weights = _subproblem(now, curve[rows], box, cap, merit[rows])
        done = gain < tolerance * np.maximum(1.0, np.abs(merit[rows]))
        alive[rows[done]] = False
        rows, move, gain = rows[~done], move[~done], gain[~done]
        if not len(rows):
            break
        weights = tuple(w[~done] for w in weights)
        now, box = now.at(~done), (box[0][~done], box[1][~done])
        trial = evaluate(x[rows] + move)
        curve[rows] = _learn(curve[rows], move, now, trial, weights)
        models = _Models(x[rows], now, curve[rows], *box, merit[rows])
        move, trial, more = _bent(evaluate, risk, cap, models, move, trial)
        new = merit_of(trial, risk)
        evaluations += len(rows) + more
        there = x[rows] + move
        ratio = (merit[rows] - new) / gain
        good = (ratio > 0.05) & np.isfinite(new)
        wide = np.abs(move).max(axis=1) > 0.9 * reach[rows]
        reach[rows] = np.where(
            good & (ratio > 0.6) & wide,
            2.0 * reach[rows],
            np.where(good & (ratio > 0.2), reach[rows], 0.35 * np.abs(move).max(axis=1)),
        )
        reach[rows] = np.minimum(reach[rows], 2.0 * radius)
        taken[rows] += 1
        kept = rows[good]
        x[kept], merit[kept] = there[good], new[good]
        for old, fresh in zip(here, trial, strict=True):
            old[kept] = fresh[good]
        alive[rows] &= reach[rows] > 1e-7
        path.append((x.copy(), merit.copy(), evaluations))
        if after is not None:
            after(step + 1, steps)
    small = np.maximum(low - x, -_SMALL), np.minimum(high - x, _SMALL)
    flat = np.tile(1e-9 * np.eye(d), (m, 1, 1))
    _, left, weights = _subproblem(here, flat, small, cap, merit)
    stationarity = np.maximum(left, 0.0) / _SMALL
    on_the_way = (np.stack(part) for part in zip(*path, strict=True))
    return Ends(x, here, merit, stationarity, weights, taken, alive, *on_the_way)


class _Models(NamedTuple):
    """Designs, what is known there, and the regions around them in which that is trusted."""

    x: np.ndarray
    local: Linearisation
    curve: np.ndarray
    low: np.ndarray
    high: np.ndarray
    merit: np.ndarray

    def at(self, rows: np.ndarray) -> _Models:
        """Those of some of the designs."""
        x, local, curve, low, high, merit = self
        return _Models(x[rows], local.at(rows), curve[rows], low[rows], high[rows], merit[rows])

    def through(self, trial: Linearisation, move: np.ndarray) -> Linearisation:
        """Linear models with the slopes here that give what was met after `move`."""
        here = self.local
        return Linearisation(
            trial.value - np.einsum("mnd,md->mn", here.slope, move),
            here.slope,
            trial.limit - np.einsum("mld,md->ml", here.limit_slope, move),
            here.limit_slope,
        )


def _bent(
    evaluate: Callable[[np.ndarray], Linearisation],
    risk: Callable[[np.ndarray], np.ndarray],
    cap: float,
    models: _Models,
    move: np.ndarray,
    trial: Linearisation,
) -> tuple[np.ndarray, Linearisation, int]:
    """Second-order corrections (Fletcher) of the steps that climb: a straight step along a curved kink or
    limit leaves it, the farther the longer it is, and is bent towards what it met. Steps, what is there, and
    how many designs were asked for."""
    move, trial, asked = move.copy(), Linearisation(*(part.copy() for part in trial)), 0
    for _ in range(_CORRECTIONS):
        new = merit_of(trial, risk)
        poor = np.flatnonzero((new > models.merit) & np.isfinite(new))
        if not len(poor):
            break
        of = models.at(poor)
        met = of.through(trial.at(poor), move[poor])
        again, _, _ = _subproblem(met, of.curve, (of.low, of.high), cap, of.merit)
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


def _subproblem(
    at: Linearisation, curve: np.ndarray, box: tuple[np.ndarray, np.ndarray], cap: float, merit: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Steps (k, d), the gains that the models promise, and the weights of functions and constraints."""
    rows = _within_reach(at, box)
    near = at._replace(
        limit=np.take_along_axis(at.limit, rows, axis=1),
        limit_slope=np.take_along_axis(at.limit_slope, rows[..., None], axis=1),
    )
    move, value, weights, others = in_chunks(_solved, (*near, curve, *box, cap), chunk=_BATCH)
    by = np.zeros_like(at.limit)
    np.put_along_axis(by, rows, others, axis=1)
    return move, merit - value, (weights, by)


def _within_reach(at: Linearisation, box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The constraints, (k, few), that a step within the box may break by their linear models, and others to
    fill up; all of them where more may."""
    ends = (at.limit_slope * side[:, None] for side in box)
    most = at.limit + np.sum(np.maximum(*ends), axis=2)
    count = most.shape[1]
    if np.sum(most > 0.0, axis=1).max(initial=0) <= _FEW < count:
        return np.argpartition(-most, _FEW, axis=1)[:, :_FEW]
    return np.tile(np.arange(count), (len(most), 1))


def _solved(args: tuple[Array, ...]) -> tuple[Array, Array, Array, Array]:
    return _one(*args)


def _one(
    value: Float[Array, "n"],
    slope: Float[Array, "n d"],
    limit: Float[Array, "l"],
    limit_slope: Float[Array, "l d"],
    curve: Float[Array, "d d"],
    low: Float[Array, "d"],
    high: Float[Array, "d"],
    cap: Float[Array, ""],
) -> tuple[Array, Array, Array, Array]:
    """min over d and s of s + cap sum softplus(v + G d - s) + C sum softplus(c + H d) + d B d/2 in a box."""
    n, k = value.shape[0], low.shape[0]
    span = jnp.maximum(high - low, 1e-12)
    # In shares of the box, so that Newton's matrix is well scaled however small the region.
    g, h = slope * span[None], limit_slope * span[None]
    b = curve * span[:, None] * span[None, :]
    value0, slope0 = value + slope @ low, b @ (low / span)
    limit0 = limit + limit_slope @ low

    def parts(z: Array) -> tuple[Array, Array]:
        return value0 + g @ z[:k] - z[k], limit0 + h @ z[:k]

    def total(z: Array, width: Array) -> Array:
        v, c = parts(z)
        soft = width * (
            cap * jnp.sum(jax.nn.softplus(v / width)) + PENALTY * jnp.sum(jax.nn.softplus(c / width))
        )
        u = z[:k]
        inside = jnp.all((u > 0) & (u < 1))
        wall = -width * jnp.sum(jnp.log(jnp.where(inside, u, 1.0)) + jnp.log(jnp.where(inside, 1.0 - u, 1.0)))
        bent = slope0 @ u + 0.5 * u @ b @ u
        return jnp.where(inside, z[k] + soft + wall + bent, jnp.inf)

    def newton(z: Array, width: Array) -> tuple[Array, Array]:
        v, c = parts(z)
        p, q = jax.nn.sigmoid(v / width), jax.nn.sigmoid(c / width)
        rows = jnp.concatenate([g, -jnp.ones((n, 1))], axis=1)
        more = jnp.concatenate([h, jnp.zeros((c.shape[0], 1))], axis=1)
        u = z[:k]
        gradient = cap * p @ rows + PENALTY * q @ more
        gradient = gradient.at[k].add(1.0).at[:k].add(slope0 + b @ u - width * (1.0 / u - 1.0 / (1.0 - u)))
        hessian = (rows * (cap * p * (1 - p) / width)[:, None]).T @ rows
        hessian = hessian + (more * (PENALTY * q * (1 - q) / width)[:, None]).T @ more
        hessian = hessian.at[:k, :k].add(b + jnp.diag(width * (1.0 / u**2 + 1.0 / (1.0 - u) ** 2)))
        hessian = hessian + jnp.diag(1e-12 + 1e-9 * jnp.diag(hessian))
        move = -jnp.linalg.solve(hessian, gradient)
        # As far as the box allows, then half of it and so on: the first that lowers the total.
        toward = jnp.where(move[:k] > 0, 1.0 - u, -u)
        room = jnp.min(jnp.where(move[:k] == 0, jnp.inf, toward / jnp.where(move[:k] == 0, 1.0, move[:k])))
        before, slope = total(z, width), gradient @ move
        rounding = 1e-14 * jnp.abs(before)

        def too_long(size: Array) -> Array:
            # A total that is no number fits nowhere.
            return ~(total(z + size * move, width) <= before + 1e-4 * size * slope + rounding)

        longest = jnp.minimum(1.0, 0.95 * room)
        _, size = jax.lax.while_loop(
            lambda c: (c[0] < _HALVINGS) & too_long(c[1]),
            lambda c: (c[0] + 1, 0.5 * c[1]),
            (jnp.zeros((), int), longest),
        )
        # What is left to gain, half of this slope, is small against the smoothing's own error, or rounding.
        onward = -slope > jnp.maximum(1e-6 * width, rounding)
        good = (size > 0.5**_HALVINGS * longest) & jnp.all(jnp.isfinite(move))
        return jnp.where(good, z + size * move, z), good & onward

    spread = jnp.maximum(jnp.max(value) - jnp.min(value) + jnp.max(jnp.abs(g)), 1e-6)
    widths = jnp.geomspace(1.0, _SHARPEST, _LEVELS) * spread

    def leveled(z: Array, width: Array) -> Array:
        """With the s that is best for its d: cap sum sigmoid = 1, by bisection."""
        v = parts(z.at[k].set(0.0))[0]

        def halve(_: Array, ends: tuple[Array, Array]) -> tuple[Array, Array]:
            middle = 0.5 * (ends[0] + ends[1])
            above = cap * jnp.sum(jax.nn.sigmoid((v - middle) / width)) < 1.0
            return jnp.where(above, ends[0], middle), jnp.where(above, middle, ends[1])

        ends = jnp.min(v) - 30.0 * width, jnp.max(v) + width * jnp.log(n + 1.0)
        low, high = jax.lax.fori_loop(0, 40, halve, ends)
        return z.at[k].set(0.5 * (low + high))

    def level(z: Array, width: Array) -> tuple[Array, None]:
        def step(carry: tuple) -> tuple:
            z, _, count = carry
            return *newton(z, width), count + 1

        first = leveled(z, width), jnp.ones((), bool), jnp.zeros((), int)
        return jax.lax.while_loop(lambda c: c[1] & (c[2] < _NEWTON), step, first)[0], None

    first = jnp.full(k + 1, 0.5).at[k].set(jnp.max(value))
    z, _ = jax.lax.scan(level, first, widths)
    z = leveled(z, widths[-1])
    move = low + span * z[:k]
    v, c = parts(z)
    p, q = jax.nn.sigmoid(v / widths[-1]), jax.nn.sigmoid(c / widths[-1])
    promised = (
        z[k] + cap * jnp.sum(jax.nn.relu(v)) + PENALTY * jnp.sum(jax.nn.relu(c)) + 0.5 * move @ curve @ move
    )
    return move, promised, cap * p, PENALTY * q


def _learn(
    curve: np.ndarray, move: np.ndarray, old: Linearisation, new: Linearisation, weights: tuple
) -> np.ndarray:
    """Damped BFGS on the gradient of the Lagrangian."""
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
        out[i] = fresh if size < 1e4 else fresh * (1e4 / size)
    return out
