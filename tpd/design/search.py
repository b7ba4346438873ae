"""Search under harmonic excitation: screen designs in closed form, and descend from the best with optax.

Three quarters of the screened designs are spread over the space. One quarter are the designs with the largest
uplift margin, a closed form, out of thousands. Where a block rests the objective is flat, so that a descent
would rarely find such designs.

The descents minimise a risk measure of the objective over all conditions under limits and bounds, see
`tpd.design.newton`. Any gradient transformation of optax makes the steps, which are clipped to the bounds.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
import optax

from tpd.core.progress import Count, Progress, unreported
from tpd.design.newton import NARROW, PENALTY, WIDE, Linearisation, newton, smoothed, width_at
from tpd.design.orbits import BACK_OFF, Orbits, SmoothedOrbits
from tpd.design.power_law import PowerLaw
from tpd.design.settings import Descent
from tpd.design.sizes import NEAR, Evaluation
from tpd.models.smoothed import Smoothed

_CLOSED_FORMS = 4096
"""Number of designs whose uplift margin is computed in closed form."""
_DISTANCES = (0.1, 0.03, 0.0)
"""Distances, in shares of the bounds, that chosen designs keep from each other. The next smaller distance
applies if too few designs are left."""
_AT_LIMIT = 1e-3
"""Relative distance from a limit below which the limit counts as active."""
_GAIN = 1e-3
"""Change of the risk over the last quarter of a descent below which it has converged."""
_LEAST_STEPS = 5
"""Smallest number of steps of this quarter."""
_FIRST_STEP, _STEP_RATIO = 0.06, 0.02
"""First step of Adam in shares of the bounds, and the ratio of the last step to the first."""
_LARGEST_VALUE = 2.0
"""Largest value of an objective of order one. Designs without an attracting motion have larger values."""
AT_BOUND = 1e-4
"""Distance from a bound, in shares of the bounds, below which a design is at the bound."""

Evaluate = Callable[[np.ndarray], Linearisation]
"""Function that returns values and constraints at designs (k, d) in shares of the bounds."""
Measure = Callable[[np.ndarray], np.ndarray]
"""Function that returns the risk measure (k,) of values (k, n)."""


class SearchStatus(enum.Enum):
    """How one descent ended. The value is a sentence of the report."""

    rests = "found designs that settle at rest, and increased the uplift margin as far as possible"
    converged = "reached a minimum of the risk"
    at_bound = "reached the edge of the design space"
    at_limit = "reached a limit"
    steps_exhausted = "still improved when the steps ran out"
    infeasible = "found no design within the limits"


@dataclass(frozen=True, kw_only=True)
class Search:
    """History of the search, for later stages, reports and plots."""

    screened: np.ndarray
    """Designs (mu, lam, zeta) that were evaluated before the descents, (m, 3)."""
    paths: tuple[np.ndarray, ...]
    """Designs along each descent, each (steps, 3)."""
    ends: np.ndarray
    """Best design of each descent, (searches, 3)."""
    end_values: np.ndarray
    """Risk of each end by the exact orbits; infinite if a limit is broken."""
    order: np.ndarray
    """Indices of all ends, best first."""
    statuses: tuple[SearchStatus, ...]
    """How each descent ended."""
    evaluations: int
    """Number of designs that were evaluated, including the screening."""
    description: str
    """Words for the number of designs from which the search started."""
    factors: Mapping[str, PowerLaw] = field(default_factory=dict)
    """Factors on limited quantities of orbits, by name, after the last correction."""
    corrected: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    """Best designs before and after each correction of the limits by runs, (k, 3)."""


def search(
    orbits: Orbits,
    settings: Descent,
    seed: int,
    progress: Progress | None = None,
    guess: np.ndarray | None = None,
) -> Search:
    """Screen designs, and descend from the best of them.

    Args:
        orbits: the objective under all conditions, with limits and bounds.
        settings: number of designs of each stage, and the optimiser.
        seed: seed of the screened designs.
        progress: function of (stage, done, total).
        guess: design (3,) from which a descent starts in addition; None for none.

    Raises:
        ValueError: the values of a user's objective are not of order one.
    """
    report, risk, space = progress or unreported, orbits.risk, orbits.space
    # Closed forms are cheap, so hundreds of designs show where a descent is worth its steps.
    # Screening.
    designs = screened_designs(orbits, max(settings.screening, settings.searches), seed)
    if guess is not None:
        designs = np.concatenate([guess[None], designs])
    e = orbits.evaluate(designs, partial(report, "screening"))
    _check_size(orbits, e)
    local = orbits.linearised(e)
    # Designs slightly beyond a limit stay in the order, because a descent leads them back inside.
    screened_value = orbits.value(e) + np.maximum(local.limit, 0.0).sum(axis=1)
    # The first guess is always a start, because it is often near the best design.
    # The number of starts is smaller than `searches` if screened designs coincide.
    order = screened_value if guess is None else np.r_[-np.inf, screened_value[1:]]
    chosen = best_apart(space.scaled(designs), order, settings.searches)

    # Descents.
    starts, at_starts, evaluate = space.scaled(designs[chosen]), local.at(chosen), orbits.at
    if isinstance(settings.model, Smoothed):
        # The smoothed model follows an orbit from step to step, so that it needs the orbits of the starts.
        evaluate = SmoothedOrbits(orbits, settings.model, e.at(chosen)).at
    cap, total, steps = risk.cap(len(orbits.conditions)), settings.steps + settings.polish, settings.steps
    descents = descend(
        settings.optimiser,
        evaluate,
        starts,
        at_starts,
        cap,
        risk.of,
        steps=steps,
        after=lambda step, _: report("searching", step, total),
    )
    # Smoothing moves an active limit a little, so a design on it could exceed the exact one.
    # The exact orbits confirm the ends, and the last steps use their gradients.
    exact = orbits.at(descents.x)
    before, converged = descents.path, descents.converged
    descents = polish(
        orbits, descents.x, exact, settings.polish, lambda step, _: report("searching", steps + step, total)
    )
    x, exact, merit = descents.x, descents.local, descents.merit
    # Without further steps the descents on the model show whether they converged.
    converged = descents.converged if settings.polish else converged
    statuses = tuple(_status(x[i], exact.at(slice(i, i + 1)), bool(converged[i])) for i in range(len(x)))
    kept = (exact.limit.max(axis=1, initial=-1.0) <= BACK_OFF) & np.isfinite(merit)
    values = np.where(kept, risk.of(exact.value), np.inf)
    return Search(
        screened=designs,
        paths=tuple(np.moveaxis(space.unscaled(np.concatenate([before, descents.path[1:]])), 1, 0)),
        ends=space.unscaled(x),
        end_values=values,
        order=np.lexsort((merit, values)),
        statuses=statuses,
        evaluations=len(designs) + total * len(x),
        description=f"{settings.searches} designs",
    )


def screened_designs(orbits: Orbits, count: int, seed: int) -> np.ndarray:
    """Return designs (mu, lam, zeta) to be screened, shape (count, 3), drawn by a seed.

    Three quarters are spread over the space. One quarter have the largest uplift margin under all conditions.
    """
    space = orbits.space
    wide = space.sample(np.random.default_rng([seed, 2]), _CLOSED_FORMS)
    still = np.argsort(-orbits.margins(wide).min(axis=1), kind="stable")[: count // 4]
    return np.concatenate([space.sample(np.random.default_rng(seed), count - len(still)), wide[still]])


def _check_size(orbits: Orbits, e: Evaluation) -> None:
    """Raise `ValueError` if the values of an objective are not comparable with the values of rest."""
    value = e.merit[e.kind <= NEAR]
    # The factor of `Settling` is above 1 under some conditions, although the orbit attracts.
    if len(value) and not np.any((value >= 0.0) & (value <= _LARGEST_VALUE)):
        raise ValueError(
            f"`size` of the objective {orbits.objective.name} must be between 0 and 1 for most designs, "
            f"but are between {value.min():.3g} and {value.max():.3g}: divide them by a reference value"
        )


def _status(x: np.ndarray, at: Linearisation, converged: bool) -> SearchStatus:
    """Return how one search ended, from its best design `x` and the linearisation there."""
    most = at.limit.max(initial=-1.0) - BACK_OFF
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


def polish(orbits: Orbits, x: np.ndarray, at: Linearisation, steps: int, after: Count = unreported) -> Ends:
    """Continue descents from designs (m, d) with their exact linearisation, on the exact orbits."""
    cap, risk = orbits.risk.cap(len(orbits.conditions)), orbits.risk.of
    return descend("newton", orbits.at, x, at, cap, risk, steps=steps, widths=NARROW, after=after)


def best_apart(units: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Return indices of the best designs that lie apart from each other, shape (count,) or fewer."""
    chosen: list[int] = []
    order = np.argsort(values, kind="stable")
    # The first pass chooses designs of different valleys. Later passes fill the remaining places with
    # neighbours.
    for apart in _DISTANCES:
        for i in order[~np.isin(order, chosen)].tolist():
            nearest = np.linalg.norm(units[chosen] - units[i], axis=1).min(initial=np.inf)
            if len(chosen) < count and nearest > apart:
                chosen.append(i)
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
    merits: np.ndarray
    """Their merits, (steps + 1, m)."""

    @property
    def converged(self) -> np.ndarray:
        """Whether the merit of each descent hardly changed over the last quarter of the steps, (m,)."""
        # One step that was taken back is no sign of convergence, so a few steps are the least.
        last = max(_LEAST_STEPS, len(self.merits) // 4)
        before = self.merits[max(-1 - last, -len(self.merits))]
        return np.isfinite(before) & (before - self.merit <= _GAIN * np.maximum(np.abs(self.merit), _GAIN))

    def after(self, x: np.ndarray, local: Linearisation, risk: Measure) -> Ends:
        """Return the best designs after one more design (m, d) of each descent."""
        merit = merit_of(local, risk)
        better = merit < self.merit
        # The flags (m,) get further axes, because the slopes have more axes than the values.
        flags = (better.reshape(-1, *(1,) * (part.ndim - 1)) for part in local)
        local = Linearisation(*map(np.where, flags, local, self.local))
        x, merit = np.where(better[:, None], x, self.x), np.where(better, merit, self.merit)
        path = np.concatenate([self.path, x[None]])
        return Ends(x, local, merit, path, np.concatenate([self.merits, merit[None]]))


def merit_of(at: Linearisation, risk: Measure) -> np.ndarray:
    """Return the risk measure plus the penalty, (m,)."""
    return risk(at.value) + PENALTY * np.sum(np.maximum(at.limit, 0.0), axis=1)


def transformation(
    optimiser: Any, cap: float, steps: int, widths: tuple[float, float] = WIDE
) -> optax.GradientTransformationExtraArgs:
    """Return the transformation of optax for a name, or the transformation itself, for m designs at once."""
    if optimiser == "newton":
        return newton(cap, steps, widths)
    if optimiser == "adam":
        schedule = optax.cosine_decay_schedule(_FIRST_STEP, steps, alpha=_STEP_RATIO)
        optimiser = optax.adam(schedule, b1=0.8, b2=0.95)
    # An optimiser of optax acts on one design: here it gets an axis for the descents.
    init, update = (jax.jit(jax.vmap(part)) for part in optimiser)

    def from_gradients(updates: Any, state: Any, params: Any = None, **_: Any) -> Any:
        # The functions are not necessary.
        return update(updates, state, params)

    return optax.GradientTransformationExtraArgs(init, from_gradients)


# The optimisers of optax multiply integers and floats.
@jax.numpy_dtype_promotion("standard")
def descend(
    optimiser: Any,
    evaluate: Evaluate,
    starts: np.ndarray,
    local: Linearisation,
    cap: float,
    risk: Measure,
    *,
    steps: int,
    widths: tuple[float, float] = WIDE,
    after: Count = unreported,
) -> Ends:
    """Descend from all starts (m, d) by an optimiser of optax. Every step evaluates one design of each
    descent.

    Args:
        optimiser: name, or transformation of optax with steps in shares of the bounds.
        evaluate: function that returns values and constraints at the next designs, (m, d).
        starts: designs within the bounds 0 and 1.
        local: functions and constraints at the starts.
        cap: largest weight of one function; 1 for the maximum, 1/n for the mean.
        risk: the risk measure of values (m, n), without smoothing.
        steps: number of steps.
        widths: first and last width of the smoothing of the risk measure.
        after: function of (steps done, total).
    """
    # All descents make their steps together, because one evaluation serves all of them.
    method = transformation(optimiser, cap, steps, widths)
    u, state = starts, method.init(starts)
    merit = merit_of(local, risk)
    ends = Ends(starts, local, merit, starts[None], merit[None])
    for step in range(steps):
        here = smoothed(local, cap, width_at(step, steps, widths))
        updates, state = method.update(here.slope, state, u, at=local)
        # A descent whose value is infinite has no slope: it returns half the way to its best design.
        to = np.where(np.isfinite(here.value)[:, None], u + np.asarray(updates), 0.5 * (u + ends.x))
        u = np.clip(to, 0.0, 1.0)
        local = evaluate(u)
        ends = ends.after(u, local, risk)
        after(step + 1, steps)
    return ends
