"""Sequential quadratic programming by SciPy on exact gradients, from one design after the other.

It minimises a capped weighted worst of n smooth functions (the maximum, the mean, or what lies between, the
mean of the worst share), under inequality constraints and bounds. With a level s and excesses v and t that is
the smooth programme

    min  s + cap sum v + C t,    f_i(x) - s <= v_i,    c_j(x) <= t,    v, t >= 0

(R. T. Rockafellar and S. Uryasev, Journal of Risk 2, 2000), so that a kink where several conditions are
equally bad is met as surely as a smooth bottom. It always has a feasible point."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import Bounds, minimize

from tpd.design.ends import PENALTY, Book, Ends, Evaluate, Linearisation, Measure, joined

_FAR = 10.0
"""Value of a function that is not finite, above the largest at the start."""
_ROUNDING = 1e-9


def minimise(
    evaluate: Evaluate,
    starts: np.ndarray,
    cap: float,
    risk: Measure,
    *,
    known: Linearisation | None = None,
    steps: int = 40,
    tolerance: float = 1e-6,
    after: Callable[[int, int], None] | None = None,
) -> Ends:
    """Descend from every start (m, d); coordinates are scaled to bounds of 0 and 1.

    Args:
        evaluate: functions and constraints at designs, (k, d).
        starts: shape (m, d).
        cap: largest weight of one function; 1 for the maximum, 1/n for the mean.
        risk: the risk measure itself, of values (k, n).
        known: what `evaluate` gives at the starts, if it has been asked before.
        steps: bound on the steps, each of one design or, where it fails to descend, a few.
        tolerance: of the merit, below which a gain ends a descent.
        after: called with (starts done, of how many).
    """
    ends = []
    for i, start in enumerate(np.clip(starts, 0.0, 1.0)):
        book = Book(evaluate, risk, start[None], None if known is None else known.at(slice(i, i + 1)))
        # From a start that is not finite nothing leads on.
        ended = np.isfinite(book.merit[0]) and _descend(book, cap, steps, tolerance)
        found = book.ends(cap)
        ends.append(found._replace(open=found.open & (not ended)))
        if after is not None:
            after(i + 1, len(starts))
    return joined(ends)


def _descend(book: Book, cap: float, steps: int, tolerance: float) -> bool:
    """One descent, of which the book holds what it met; whether it converged. The variables are
    z = (x, s, t, v)."""

    def one(found: Linearisation) -> Linearisation:
        only = Linearisation(*(part[0].copy() for part in found))
        if cap * len(only.value) > 1.0 + _ROUNDING:
            return only
        # The mean is one smooth function.
        return only._replace(value=only.value.mean(keepdims=True), slope=only.slope.mean(axis=0)[None])

    first, here = book.x[0].copy(), one(book.local)
    d, n = len(first), len(here.value)
    # The maximum needs no v.
    k = n if cap < 1.0 and n > 1 else 0
    far, met = here.value.max() + _FAR, (first, here)

    def at(z: np.ndarray) -> Linearisation:
        # SLSQP asks for values and slopes one after the other, and may leave its bounds by rounding.
        nonlocal met
        x = np.clip(z[:d], 0.0, 1.0)
        if not np.array_equal(x, met[0]):
            met = x, one(book.tried(x[None]))
        return met[1]

    def room(z: np.ndarray) -> np.ndarray:
        now = at(z)
        value = np.where(np.isfinite(now.value), now.value, far)
        return np.r_[z[d] - value + (z[d + 2 :] if k else 0.0), z[d + 1] - now.limit]

    def slopes(z: np.ndarray) -> np.ndarray:
        now = at(z)
        rows = np.vstack([np.where(np.isfinite(now.slope), now.slope, 0.0), now.limit_slope])
        # The first n rows belong to the level s and to the v of their own, the others to the one excess t.
        level = (np.arange(len(rows)) < n).astype(float)[:, None]
        return np.hstack([-rows, level, 1.0 - level, np.eye(len(rows), k)])

    # The level above which the worst share lies, and what exceeds it.
    level = np.sort(here.value)[::-1][min(int(1.0 / cap), n - 1) if k else 0]
    over = np.maximum(here.value - level, 0.0)[:k]
    cost = np.r_[np.zeros(d), 1.0, PENALTY, np.full(k, cap)]
    low = np.r_[np.zeros(d), -np.inf, np.zeros(1 + k)]
    found = minimize(
        lambda z: float(cost @ z),
        np.r_[first, level, here.limit.max(initial=0.0), over],
        jac=lambda _: cost,
        bounds=Bounds(low, np.r_[np.ones(d), np.full(2 + k, np.inf)]),
        constraints={"type": "ineq", "fun": room, "jac": slopes},
        method="SLSQP",
        options={"maxiter": steps, "ftol": tolerance},
    )
    return bool(found.success)
