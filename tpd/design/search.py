"""Search under harmonic excitation: screen many designs, descend from the best with optax, finish with SLSQP.

Three quarters of the screened designs are spread over the space. One quarter are the designs with the largest
uplift margin, a closed form, out of thousands. Where a block rests its tilt is flat, so that a descent would
rarely find such designs.

Descent and finish minimise a capped weighted worst of n functions (the maximum, the mean, or the mean of the
worst share) under inequality constraints and bounds. The descent smooths this measure,

    min over s of  s + cap width sum softplus((v - s)/width).

Its derivatives with respect to v are weights that sum to one. Limits enter as a smoothed exact penalty. The
width decreases from step to step, because the worst case has kinks that a fixed width would round off. Any
gradient transformation of optax makes the steps, which are clipped to the bounds.

A first-order method only comes near an optimum that lies on a kink. Sequential quadratic programming on the
exact gradients therefore finishes the best results. With a level s and excesses v and t the problem is the
smooth programme

    min  s + cap sum v + C t,    f_i(x) - s <= v_i,    c_j(x) <= t,    v, t >= 0

(R. T. Rockafellar and S. Uryasev, Journal of Risk 2, 2000). A kink at which several conditions are equally
bad is then reached as reliably as a smooth minimum. The programme always has a feasible point.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array
from scipy.optimize import Bounds, minimize

from tpd.core.formatting import compared, percent
from tpd.core.progress import Count, Progress, unreported
from tpd.design.orbits import BACK_OFF, Linearisation, Orbits, SmoothedOrbits
from tpd.design.settings import Descent
from tpd.design.sizes import NEAR, Evaluation
from tpd.design.space import first_apart
from tpd.models.smoothed import Smoothed

_CLOSED = 4096
"""Number of designs whose uplift margin is computed in closed form."""
_APART = (0.1, 0.03, 0.0)
"""Distances, in shares of the bounds, that chosen designs keep from each other. The next smaller distance
applies if too few designs are left."""
_FINISHED_APART = 0.02
"""Smallest distance between the designs that SLSQP refines, in shares of the bounds."""
_AT_LIMIT = 1e-3
"""Relative distance from a limit below which the limit counts as active."""

Evaluate = Callable[[np.ndarray], Linearisation]
"""Function that returns values and constraints at designs (k, d) in shares of the bounds."""
Measure = Callable[[np.ndarray], np.ndarray]
"""Function that returns the risk measure (k,) of values (k, n)."""

PENALTY = 10.0
"""Weight C of a violated constraint in the merit. The penalty is exact as long as no multiplier exceeds C.
SLSQP has one excess for all constraints; there it is exact as long as the sum of the multipliers does not
exceed C."""
_OPTIMISERS: dict[str, Callable[[Any], optax.GradientTransformation]] = {
    "adam": partial(optax.adam, b1=0.8, b2=0.95),
    "rmsprop": partial(optax.rmsprop, decay=0.95),
}
"""Optimisers with a name, as functions of a schedule of step sizes."""
_FIRST, _LAST = 0.06, 0.02
"""First step of these optimisers in shares of the bounds, and the ratio of the last step to the first."""
_WIDTHS = (1e-1, 1e-4)
"""First and last width of the smoothing, in units of the merit."""
_SHARPER = 0.1
"""Ratio of the width of the penalty to the width of the measure. The penalty is sharper, because hundreds of
inactive limits could add up."""
_FAR = 10.0
"""Amount by which a function that is not finite exceeds the largest value at the start."""
_ROUNDING = 1e-9
AT_BOUND = 1e-4
"""Distance from a bound, in shares of the bounds, below which a design is at the bound."""


class SearchStatus(enum.Enum):
    """How one descent ended, including its finish. The value is a sentence of the report."""

    rests = "found designs that settle at rest, and increased the uplift margin as far as possible"
    converged = "reached a minimum of the risk"
    at_bound = "reached the edge of the design space"
    at_limit = "reached a limit"
    steps_exhausted = "still improved when the steps ran out"
    contradicted = "ended on an orbit that the exact solution does not confirm"
    infeasible = "found no design within the limits"


@dataclass(frozen=True, kw_only=True)
class Search:
    """History of the search, for later stages, reports and plots."""

    screened: np.ndarray
    """Designs (mu, lam, zeta) that were evaluated before the descents, (m, 3)."""
    screened_value: np.ndarray
    """Risk of these designs plus the excess over limits, (m,)."""
    screened_feasible: np.ndarray
    """Whether these designs keep the limits, (m,)."""
    paths: tuple[np.ndarray, ...]
    """Designs along each descent, each (steps, 3)."""
    ends: np.ndarray
    """Best design of each descent after the finish, (searches, 3)."""
    end_values: np.ndarray
    """Risk of each end; infinite if a limit is broken or the exact solution contradicts the descent."""
    order: np.ndarray
    """Indices of all ends, best first."""
    statuses: tuple[SearchStatus, ...]
    """How each descent ended."""
    mismatch: np.ndarray
    """Largest relative differences of merits (mostly tilts) and of slopes between the model of the descent
    and the exact solution at its end, (searches, 2). Zero if the descent used exact orbits."""
    stopped: np.ndarray
    """Number of orbits that the model could not follow along each descent, (searches,). The exact solution
    replaced them."""
    evaluations: int
    """Number of designs that were evaluated, including the screening."""
    descended: float
    """Smallest risk after the descents, plus the penalty of a broken limit."""
    finished: float
    """Smallest risk after the finish, plus the penalty of a broken limit."""
    description: str
    """Words for the number of designs from which the search started."""

    @property
    def confirmed(self) -> np.ndarray:
        """Ends that the exact solution does not contradict, best first, (k, 3)."""
        sound = np.array([status is not SearchStatus.contradicted for status in self.statuses], dtype=bool)
        return self.ends[self.order[sound[self.order]]]

    @property
    def message(self) -> str:
        """Sentence on the descents and the finish."""
        if not np.isfinite(self.descended):
            return "The descents found no design with a finite settled tilt."
        first, last = compared(self.descended, self.finished, 1, percent)
        tilt = (
            f"The settled tilt that the search minimises is {first} of the toppling tilt after the descents"
        )
        # A block that rests has no tilt. The search then minimises minus the margin against uplift.
        rests = "; a negative number is the margin of a block at rest" if self.finished <= 0.0 else ""
        if not self.finished < self.descended:
            return f"{tilt}, and the finish does not lower it{rests}."
        return f"{tilt}, and {last} after the finish{rests}."


def search(orbits: Orbits, settings: Descent, seed: int, progress: Progress | None = None) -> Search:
    """Screen designs, descend from the best of them, and finish the best results.

    Args:
        orbits: the objective under all conditions, with limits and bounds.
        settings: number of designs of each stage, and the optimiser.
        seed: seed of the screened designs.
        progress: function of (stage, done, total).

    Raises:
        ValueError: the values of a user's objective are not of order one.
    """
    report, risk, space = progress or unreported, orbits.risk, orbits.space
    cap = risk.cap(len(orbits.conditions))
    # Screening.
    designs = screened_designs(orbits, max(settings.screening, settings.searches), seed)
    e = orbits.evaluate(designs, partial(report, "screening"))
    _check_size(orbits, e)
    local = orbits.linearised(e)
    # Designs slightly beyond a limit stay in the order, because a descent leads them back inside.
    excess = np.maximum(local.limit, 0.0).sum(axis=1)
    screened_value = orbits.value(e) + excess
    # The number of starts is smaller than `searches` if screened designs coincide.
    chosen = best_apart(space.scaled(designs), screened_value, settings.searches)

    # Descents.
    starts, at_starts, evaluate, walk = space.scaled(designs[chosen]), local.at(chosen), orbits.at, None
    if isinstance(settings.model, Smoothed):
        # The smoothed model follows an orbit from step to step, so that it needs the orbits of the starts.
        walk = SmoothedOrbits(orbits, settings.model, e.at(chosen))
        evaluate = walk.at
    stages = settings.steps + settings.finish
    descents = descend(
        transformation(settings),
        evaluate,
        starts,
        at_starts,
        cap,
        risk.of,
        steps=settings.steps,
        after=lambda step, _: report("searching", step, stages),
    )
    exact = orbits.at(descents.x)
    mismatch = _mismatch(descents.local, exact)
    x, merit = descents.x.copy(), merit_of(exact, risk.of)
    descended = float(merit.min())

    # Finish. Two ends that lie close together would reach the same minimum, so only one of them is refined.
    best = first_apart(x, np.argsort(merit, kind="stable"), settings.finish, _FINISHED_APART)
    converged, spent = np.zeros(len(x), bool), 0
    for i, row in enumerate(best):
        refined = finish(orbits.at, x[row], exact.at(slice(row, row + 1)), cap, risk.of)
        x[row], converged[row], spent = refined.x, refined.converged, spent + refined.evaluations
        # The finish has evaluated its result already: store its functions and constraints.
        for part, new in zip(exact, refined.local, strict=True):
            part[row] = new[0]
        report("searching", settings.steps + i + 1, stages)
    merit = merit_of(exact, risk.of)
    # A descent may end on an orbit of the smoothed model that the exact equations do not have. The finish
    # uses exact orbits, so that its results cannot be contradicted.
    contradicted = mismatch[:, 0] > settings.tolerance
    contradicted[best] = False
    statuses = tuple(
        _status(x[i], exact.at(slice(i, i + 1)), bool(contradicted[i]), bool(converged[i]))
        for i in range(len(x))
    )
    kept = (exact.limit.max(axis=1, initial=-1.0) <= BACK_OFF) & np.isfinite(merit)
    # The values are exact: even if the exact solution contradicts all descents, these ends are the best
    # designs that the search has evaluated.
    values = np.where(kept & ~(contradicted & ~contradicted.all()), risk.of(exact.value), np.inf)
    return Search(
        screened=designs,
        screened_value=screened_value,
        screened_feasible=excess == 0.0,
        paths=tuple(space.unscaled(descents.path[:, i]) for i in range(len(x))),
        ends=space.unscaled(x),
        end_values=values,
        order=np.lexsort((merit, values)),
        statuses=statuses,
        mismatch=mismatch,
        stopped=np.zeros(len(x), int) if walk is None else walk.stopped,
        evaluations=len(designs) + settings.steps * len(x) + spent,
        descended=descended,
        finished=float(merit.min()),
        description=f"{settings.searches} designs",
    )


def screened_designs(orbits: Orbits, count: int, seed: int) -> np.ndarray:
    """Return designs (mu, lam, zeta) to be screened, shape (count, 3), drawn by a seed.

    Three quarters are spread over the space. One quarter have the largest uplift margin under all conditions.
    """
    space = orbits.space
    wide = space.sample(np.random.default_rng([seed, 2]), _CLOSED)
    still = np.argsort(-orbits.margins(wide).min(axis=1), kind="stable")[: count // 4]
    return np.concatenate([space.sample(np.random.default_rng(seed), count - len(still)), wide[still]])


def _check_size(orbits: Orbits, e: Evaluation) -> None:
    """Raise `ValueError` if the values of an objective are not comparable with the values of rest."""
    value = e.merit[e.kind <= NEAR]
    if len(value) and not np.any((value >= 0.0) & (value <= 1.0)):
        raise ValueError(
            f"`values` of the objective {orbits.objective.name} must be between 0 and 1 for most designs, "
            f"but are between {value.min():.3g} and {value.max():.3g}: divide them by a reference value"
        )


def _mismatch(model: Linearisation, exact: Linearisation) -> np.ndarray:
    """Return the largest relative differences of merits and of slopes between a model and the exact solution,
    (m, 2)."""
    apart = np.abs(model.value - exact.value) / np.maximum(np.abs(exact.value), 1e-12)
    steep = np.maximum(np.abs(exact.slope).max(axis=(1, 2), keepdims=True), 1e-12)
    change = np.abs(model.slope - exact.slope) / steep
    return np.stack([apart.max(axis=1), change.max(axis=(1, 2))], axis=1)


def _status(x: np.ndarray, at: Linearisation, contradicted: bool, converged: bool) -> SearchStatus:
    """Return how one search ended, from its best design `x` and the linearisation there."""
    most = at.limit.max(initial=-1.0) - BACK_OFF
    if contradicted:
        return SearchStatus.contradicted
    if not np.isfinite(at.value).all() or most > 0.0:
        return SearchStatus.infeasible
    if not converged:
        return SearchStatus.steps_exhausted
    # An active limit is reported before rest: both may hold at the same design.
    if most > -_AT_LIMIT:
        return SearchStatus.at_limit
    if at.value.max() <= 0.0:
        return SearchStatus.rests
    inside = (x > AT_BOUND) & (x < 1.0 - AT_BOUND)
    return SearchStatus.converged if inside.all() else SearchStatus.at_bound


def best_apart(units: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Return indices of the best designs that lie apart from each other, shape (count,) or fewer."""
    chosen: list[int] = []
    order = np.argsort(values, kind="stable")
    # The first pass chooses designs of different valleys. Later passes fill the remaining places with
    # neighbours.
    for apart in _APART:
        order = np.r_[chosen, order[~np.isin(order, chosen)]].astype(int)
        chosen = first_apart(units, order, count, apart, len(chosen))
    return np.array(chosen, dtype=int)


class Ends(NamedTuple):
    """Best designs so far of m descents."""

    x: np.ndarray
    """Best designs in shares of the bounds, (m, d)."""
    local: Linearisation
    """Functions and constraints at these designs."""
    merit: np.ndarray
    """Risk measure plus penalty, (m,)."""
    path: np.ndarray
    """Best designs before the first step and after every step, (steps + 1, m, d)."""

    @staticmethod
    def begun(x: np.ndarray, local: Linearisation, risk: Measure) -> Ends:
        """Return the starts as the best designs before the first step."""
        merit = merit_of(local, risk)
        return Ends(x, local, merit, x[None])

    def after(self, x: np.ndarray, local: Linearisation, risk: Measure) -> Ends:
        """Return the best designs after one more design (m, d) of each descent."""
        merit = merit_of(local, risk)
        better = merit < self.merit
        # The flags (m,) get further axes, because the slopes have more axes than the values.
        flags = (better.reshape(-1, *(1,) * (part.ndim - 1)) for part in local)
        local = Linearisation(*map(np.where, flags, local, self.local))
        x, merit = np.where(better[:, None], x, self.x), np.where(better, merit, self.merit)
        return Ends(x, local, merit, np.concatenate([self.path, x[None]]))


def merit_of(at: Linearisation, risk: Measure) -> np.ndarray:
    """Return the risk measure plus the penalty, (m,)."""
    return risk(at.value) + PENALTY * np.sum(np.maximum(at.limit, 0.0), axis=1)


def transformation(settings: Descent) -> optax.GradientTransformation:
    """Return the optimiser of the settings. An optimiser with a name gets a schedule of decreasing steps."""
    if not isinstance(settings.optimiser, str):
        return cast(optax.GradientTransformation, settings.optimiser)
    schedule = optax.cosine_decay_schedule(_FIRST, settings.steps, alpha=_LAST)
    return _OPTIMISERS[settings.optimiser](schedule)


# The optimisers of optax multiply integers and floats.
@jax.numpy_dtype_promotion("standard")
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
    """Descend from all starts (m, d) by an optimiser of optax. Every step evaluates one design of each
    descent.

    Args:
        optimiser: transformation of optax, with steps in shares of the bounds.
        evaluate: function that returns values and constraints at the next designs, (m, d).
        starts: designs within the bounds 0 and 1.
        local: functions and constraints at the starts.
        cap: largest weight of one function; 1 for the maximum, 1/n for the mean.
        risk: the risk measure of values (m, n), without smoothing.
        steps: number of steps.
        after: function of (steps done, total).
    """

    @jax.jit
    @jax.vmap
    def onward(slope: Array, state: Any, u: Array) -> tuple[Array, Any]:
        updates, state = optimiser.update(slope, state, u)
        return jnp.clip(jnp.asarray(optax.apply_updates(u, updates)), 0.0, 1.0), state

    u, ends, state = starts, Ends.begun(starts, local, risk), jax.jit(jax.vmap(optimiser.init))(starts)
    # A wide smoothing first gives a useful direction. A narrow one at the end gives the value itself.
    for step, width in enumerate(np.geomspace(*_WIDTHS, max(steps, 2))[:steps]):
        value, slope = smoothed_merit(local, cap, float(width))
        stepped, state = onward(slope, state, u)
        # A descent whose value is infinite has no slope: it returns half the way to its best design.
        u = np.where(np.isfinite(value)[:, None], np.asarray(stepped), 0.5 * (u + ends.x))
        local = evaluate(u)
        ends = ends.after(u, local, risk)
        after(step + 1, steps)
    return ends


def smoothed_merit(at: Linearisation, cap: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the smoothed merit (m,) and its slopes (m, d). A design with an infinite value has an infinite
    merit and slopes of zero."""
    is_finite = np.all(np.isfinite(at.value), axis=1)
    at = at._replace(value=np.where(is_finite[:, None], at.value, 0.0))
    # Find by bisection the level s of the smoothed measure at which the weights sum to one.
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
    return np.where(is_finite, value, np.inf), np.where(is_finite[:, None], slope, 0.0)


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return 0.5 * (1.0 + np.tanh(0.5 * x))


class Finish(NamedTuple):
    """Result of SLSQP from the end of one descent."""

    x: np.ndarray
    """Best design in shares of the bounds, (d,)."""
    local: Linearisation
    """Functions and constraints at this design."""
    evaluations: int
    """Number of designs that were evaluated."""
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
    """Find the local minimum next to one design (d,) by SLSQP in the variables z = (x, s, t, v).

    Args:
        evaluate, cap, risk: as for `descend`.
        start: design within the bounds 0 and 1.
        local: functions and constraints at this design.
        steps: largest number of steps.
        tolerance: smallest gain of the merit; a smaller gain ends the search.
    """
    ends = Ends.begun(start[None], local, risk)
    # A start that is not finite has no derivative that leads to a better design.
    if not np.isfinite(ends.merit[0]):
        return Finish(start, local, 0, False)

    def first(local: Linearisation) -> Linearisation:
        one = Linearisation(*(part[0] for part in local))
        if cap * len(one.value) > 1.0 + _ROUNDING:
            return one
        # The mean over all conditions is one smooth function, so that one row replaces n rows.
        return one._replace(value=one.value.mean(keepdims=True), slope=one.slope.mean(axis=0)[None])

    here = first(local)
    d, n = len(start), len(here.value)
    # The maximum needs no excesses v: no value may exceed the level.
    k = n if cap < 1.0 and n > 1 else 0
    far, last = here.value.max() + _FAR, (start, here)

    def at(z: np.ndarray) -> Linearisation:
        # SLSQP reads values and slopes of one design in separate calls, so keep the last evaluation. Rounding
        # may also take the design slightly out of its bounds.
        nonlocal last, ends
        x = np.clip(z[:d], 0.0, 1.0)
        if not np.array_equal(x, last[0]):
            evaluated = evaluate(x[None])
            last, ends = (x, first(evaluated)), ends.after(x[None], evaluated, risk)
        return last[1]

    def slack(z: np.ndarray) -> np.ndarray:
        now = at(z)
        # SLSQP cannot handle infinite values: a large finite value keeps the line search away from such
        # designs.
        value = np.where(np.isfinite(now.value), now.value, far)
        return np.r_[z[d] - value + (z[d + 2 :] if k else 0.0), z[d + 1] - now.limit]

    def slopes(z: np.ndarray) -> np.ndarray:
        now = at(z)
        rows = np.vstack([np.where(np.isfinite(now.slope), now.slope, 0.0), now.limit_slope])
        # The first n rows belong to the level s, each with its own excess v. The other rows belong to the
        # common excess t.
        level = (np.arange(len(rows)) < n).astype(float)[:, None]
        return np.hstack([-rows, level, 1.0 - level, np.eye(len(rows), k)])

    # Start with the level above which the worst share of the values lies, and with the excesses over this
    # level.
    level = np.sort(here.value)[::-1][min(int(1.0 / cap), n - 1) if k else 0]
    over = np.maximum(here.value - level, 0.0)[:k]
    cost = np.r_[np.zeros(d), 1.0, PENALTY, np.full(k, cap)]
    low = np.r_[np.zeros(d), -np.inf, np.zeros(1 + k)]
    # The cost s + C t + cap sum v is linear in z: only the constraints depend on the design.
    minimum = minimize(
        lambda z: float(cost @ z),
        np.r_[start, level, here.limit.max(initial=0.0), over],
        jac=lambda _: cost,
        bounds=Bounds(low, np.r_[np.ones(d), np.full(2 + k, np.inf)]),
        constraints={"type": "ineq", "fun": slack, "jac": slopes},
        method="SLSQP",
        options={"maxiter": steps, "ftol": tolerance},
    )
    return Finish(ends.x[0], ends.local, len(ends.path) - 1, bool(minimum.success))
