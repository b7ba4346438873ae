"""Descents of optax on smoothed gradients, and their finish by SLSQP on exact gradients.

Both minimise a capped weighted worst of n functions (the maximum, the mean, or the mean of the worst share)
under inequality constraints and bounds. The descent smooths it,

    min over s of  s + cap width sum softplus((v - s)/width),

whose derivatives with respect to v are weights that sum to one; limits enter as a smoothed exact penalty. The
width falls from step to step, because the worst case has kinks that a fixed width would round off. Steps, by
any gradient transformation of optax, are clipped to the bounds.

A first-order method only comes near an optimum on a kink. So sequential quadratic programming on the exact
gradients finishes the best ends. With a level s and excesses v and t the problem is the smooth programme

    min  s + cap sum v + C t,    f_i(x) - s <= v_i,    c_j(x) <= t,    v, t >= 0

(R. T. Rockafellar and S. Uryasev, Journal of Risk 2, 2000), so that a kink where several conditions are
equally bad is reached as surely as a smooth minimum. It always has a feasible point."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array
from scipy.optimize import Bounds, minimize

from tpd.core.progress import Count, unreported
from tpd.design.orbits import Linearisation, Orbits
from tpd.design.settings import Descent

Evaluate = Callable[[np.ndarray], Linearisation]
"""Functions and constraints at designs (k, d) in shares of the bounds."""
Measure = Callable[[np.ndarray], np.ndarray]
"""Risk measure of values (k, n), (k,)."""

PENALTY = 10.0
"""Weight C of a violated constraint in the merit: exact as long as no multiplier exceeds it. SLSQP has one
excess for all constraints, which is exact as long as the sum of the multipliers does not exceed it."""
_OPTIMISERS: dict[str, Callable[[Any], optax.GradientTransformation]] = {
    "adam": partial(optax.adam, b1=0.8, b2=0.95),
    "rmsprop": partial(optax.rmsprop, decay=0.95),
}
"""Optimisers that have a name, functions of a schedule of steps."""
_FIRST, _LAST = 0.06, 0.02
"""First step of these, in shares of the bounds, and the last one over the first."""
_WIDTHS = (1e-1, 1e-4)
"""First and last width of the smoothing, in units of the merit."""
_SHARPER = 0.1
"""The width of the penalty over that of the measure: there may be hundreds of limits that are not active."""
_FAR = 10.0
"""Value of a function that is not finite, above the largest at the start."""
_ROUNDING = 1e-9
AT_BOUND = 1e-4
"""Distance from a bound, in shares of the bounds, that counts as none."""


class Ends(NamedTuple):
    """Best designs of m descents so far."""

    x: np.ndarray
    """Best designs in shares of the bounds, (m, d)."""
    local: Linearisation
    """Functions and constraints there."""
    merit: np.ndarray
    """Measure plus penalty, (m,)."""
    path: np.ndarray
    """Best designs before the first and after every step, (steps + 1, m, d)."""
    path_merit: np.ndarray
    """Their merits, (steps + 1, m)."""

    @staticmethod
    def begun(x: np.ndarray, local: Linearisation, risk: Measure) -> Ends:
        """The starts, which are the best designs before the first step."""
        merit = merit_of(local, risk)
        return Ends(x, local, merit, x[None], merit[None])

    def after(self, x: np.ndarray, local: Linearisation, risk: Measure) -> Ends:
        """These ends after one more design (m, d) of each descent."""
        merit = merit_of(local, risk)
        better = merit < self.merit
        parts = zip(local, self.local, strict=True)
        local = Linearisation(*(np.where(_rows(better, new), new, old) for new, old in parts))
        x, merit = np.where(better[:, None], x, self.x), np.where(better, merit, self.merit)
        path = np.concatenate([self.path, x[None]]), np.concatenate([self.path_merit, merit[None]])
        return Ends(x, local, merit, *path)


def merit_of(at: Linearisation, risk: Measure) -> np.ndarray:
    """Measure plus penalty, (m,)."""
    return risk(at.value) + PENALTY * np.sum(np.maximum(at.limit, 0.0), axis=1)


def transformation(settings: Descent) -> optax.GradientTransformation:
    """Return the optimiser of the settings; one with a name takes steps that become smaller."""
    if not isinstance(settings.optimiser, str):
        return cast(optax.GradientTransformation, settings.optimiser)
    schedule = optax.cosine_decay_schedule(_FIRST, settings.steps, alpha=_LAST)
    return _OPTIMISERS[settings.optimiser](schedule)


def descend(
    optimiser: optax.GradientTransformation,
    evaluate: Evaluate,
    starts: np.ndarray,
    local: Linearisation,
    cap: float,
    risk: Measure,
    *,
    steps: int,
    after: Count = unreported,
) -> Ends:
    """Descend from all starts (m, d) by an optimiser of optax; every step evaluates one design of each.

    Args:
        optimiser: its steps are in shares of the bounds.
        evaluate: functions and constraints at the next designs, (m, d).
        starts: within the bounds 0 and 1.
        local: functions and constraints at the starts.
        cap: largest weight of one function; 1 for the maximum, 1/n for the mean.
        risk: the risk measure itself, of values (m, n).
        steps: number of steps.
        after: called with (steps done, of how many).
    """

    @jax.jit
    @jax.vmap
    def onward(slope: Array, state: Any, u: Array) -> tuple[Array, Any]:
        updates, state = optimiser.update(slope, state, u)
        return jnp.clip(jnp.asarray(optax.apply_updates(u, updates)), 0.0, 1.0), state

    u, ends, state = starts, Ends.begun(starts, local, risk), jax.jit(jax.vmap(optimiser.init))(starts)
    # A wide kink first, which shows the way; a sharp one last, which shows the value.
    for step, width in enumerate(np.geomspace(*_WIDTHS, max(steps, 2))[:steps]):
        value, slope = smoothed_merit(local, cap, float(width))
        moved, state = onward(slope, state, u)
        # A descent whose value is infinite goes half way back to its best design.
        u = np.where(np.isfinite(value)[:, None], np.asarray(moved), 0.5 * (u + ends.x))
        local = evaluate(u)
        ends = ends.after(u, local, risk)
        after(step + 1, steps)
    return ends


def smoothed_merit(at: Linearisation, cap: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """The smoothed merit (m,) and its slopes (m, d); of a design with an infinite value not finite."""
    known = np.all(np.isfinite(at.value), axis=1)
    at = at._replace(value=np.where(known[:, None], at.value, 0.0))
    # The s of the smoothed measure, where the weights sum to one, by bisection.
    low = at.value.min(axis=1) - 40.0 * width
    high = at.value.max(axis=1) + width * np.log(at.value.shape[1] + 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        over = cap * np.sum(_sigmoid((at.value - middle[:, None]) / width), axis=1) < 1.0
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    level = 0.5 * (low + high)
    above = (at.value - level[:, None]) / width
    value = level + cap * width * np.sum(np.logaddexp(0.0, above), axis=1)
    over = at.limit / (_SHARPER * width)
    value = value + PENALTY * _SHARPER * width * np.sum(np.logaddexp(0.0, over), axis=1)
    slope = cap * np.einsum("mn,mnd->md", _sigmoid(above), at.slope)
    slope = slope + PENALTY * np.einsum("ml,mld->md", _sigmoid(over), at.limit_slope)
    return np.where(known, value, np.inf), np.where(known[:, None], slope, 0.0)


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return 0.5 * (1.0 + np.tanh(0.5 * x))


def _rows(chosen: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Flags (m,) in a shape that broadcasts with an array (m, ...)."""
    return chosen.reshape(-1, *(1,) * (like.ndim - 1))


class Finish(NamedTuple):
    """One end after SLSQP."""

    x: np.ndarray
    """Best design in shares of the bounds, (d,)."""
    local: Linearisation
    """Functions and constraints there, of one design."""
    evaluations: int
    """Designs evaluated."""
    converged: bool
    """Whether SLSQP reached its tolerance."""


def finish(
    evaluate: Evaluate,
    start: np.ndarray,
    local: Linearisation,
    cap: float,
    risk: Measure,
    *,
    steps: int = 40,
    tolerance: float = 1e-6,
) -> Finish:
    """Go from one design (d,) to the minimum next to it by SLSQP in the variables z = (x, s, t, v).

    Args:
        evaluate, cap, risk: as for `descend`.
        start: within the bounds 0 and 1.
        local: functions and constraints there, of one design.
        steps: bound on the steps.
        tolerance: of the merit; a smaller gain ends the finish.
    """
    ends = Ends.begun(start[None], local, risk)
    # From a start that is not finite no derivative leads on.
    if not np.isfinite(ends.merit[0]):
        return Finish(start, local, 0, False)

    def first(found: Linearisation) -> Linearisation:
        one = Linearisation(*(part[0] for part in found))
        if cap * len(one.value) > 1.0 + _ROUNDING:
            return one
        # The mean is one smooth function.
        return one._replace(value=one.value.mean(keepdims=True), slope=one.slope.mean(axis=0)[None])

    here = first(local)
    d, n = len(start), len(here.value)
    # The maximum needs no v.
    k = n if cap < 1.0 and n > 1 else 0
    far, last = here.value.max() + _FAR, (start, here)

    def at(z: np.ndarray) -> Linearisation:
        # SLSQP reads values and slopes one after the other, and may leave its bounds by rounding.
        nonlocal last, ends
        x = np.clip(z[:d], 0.0, 1.0)
        if not np.array_equal(x, last[0]):
            found = evaluate(x[None])
            last, ends = (x, first(found)), ends.after(x[None], found, risk)
        return last[1]

    def slack(z: np.ndarray) -> np.ndarray:
        now = at(z)
        value = np.where(np.isfinite(now.value), now.value, far)
        return np.r_[z[d] - value + (z[d + 2 :] if k else 0.0), z[d + 1] - now.limit]

    def slopes(z: np.ndarray) -> np.ndarray:
        now = at(z)
        rows = np.vstack([np.where(np.isfinite(now.slope), now.slope, 0.0), now.limit_slope])
        # The first n rows belong to the level s and to the v of their own, the others to the one excess t.
        level = (np.arange(len(rows)) < n).astype(float)[:, None]
        return np.hstack([-rows, level, 1.0 - level, np.eye(len(rows), k)])

    # The level above which the worst share lies, and the excesses over it.
    level = np.sort(here.value)[::-1][min(int(1.0 / cap), n - 1) if k else 0]
    over = np.maximum(here.value - level, 0.0)[:k]
    cost = np.r_[np.zeros(d), 1.0, PENALTY, np.full(k, cap)]
    low = np.r_[np.zeros(d), -np.inf, np.zeros(1 + k)]
    found = minimize(
        lambda z: float(cost @ z),
        np.r_[start, level, here.limit.max(initial=0.0), over],
        jac=lambda _: cost,
        bounds=Bounds(low, np.r_[np.ones(d), np.full(2 + k, np.inf)]),
        constraints={"type": "ineq", "fun": slack, "jac": slopes},
        method="SLSQP",
        options={"maxiter": steps, "ftol": tolerance},
    )
    return Finish(ends.x[0], ends.local, len(ends.path) - 1, bool(found.success))


class Active(NamedTuple):
    """A condition, a limit or a bound that holds a design."""

    kind: str
    """"condition", "limit", "lower bound" or "upper bound"."""
    name: str
    """Name of the objective, of the limit, or of the ratio at its bound: mass, length or damping."""
    condition: str
    """The condition in words; empty for a bound."""
    value: float
    """Merit under the condition, share of the limit that is used, or the bound."""

    def __str__(self) -> str:
        match self.kind:
            case "condition":
                return f"{self.name} at {self.condition}"
            case "limit":
                return f"limit on {self.name} at {self.condition}"
            case _:
                return f"{self.kind} of the {self.name} ratio, {self.value:.4g}"


def active_constraints(orbits: Orbits, design: np.ndarray, tolerance: float = 1e-3) -> tuple[Active, ...]:
    """Return the conditions, limits and bounds that hold a design (mu, lam, zeta).

    Conditions are those whose merit is within `tolerance` of the worst merit, the worst first, unless the
    risk is the mean over all conditions. A limit is active if the design uses at least 1 - tolerance of it.
    It comes with the condition of the largest use, the most used limit first.
    """
    e, label = orbits.evaluate(design[None]), orbits.conditions.label
    merit, out = e.merit[0], list[Active]()
    if orbits.risk.share < 1.0:
        near = [int(j) for j in np.argsort(-merit, kind="stable") if merit[j] >= merit.max() - tolerance]
        out += [Active("condition", orbits.objective.name, label(j), float(merit[j])) for j in near]
    used = [(size.name, int(np.argmax(size.value[0])), float(size.value.max())) for size in orbits.sizes(e)]
    used.sort(key=lambda row: -row[2])
    out += [Active("limit", name, label(j), value) for name, j, value in used if value >= 1.0 - tolerance]
    bounds = zip(design, orbits.space.bounds.T, ("mass", "length", "damping"), strict=False)
    for value, (least, most), name in bounds:
        for kind, bound in (("lower bound", least), ("upper bound", most)):
            if abs(value - bound) < AT_BOUND * (most - least):
                out.append(Active(kind, name, "", float(bound)))
    return tuple(out)
