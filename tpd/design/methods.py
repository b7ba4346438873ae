"""Methods of search: an optimiser, the model whose gradients it takes, and its budget.

Both minimise a capped weighted worst of n smooth functions (the maximum, the mean, or what lies between, the
mean of the worst share), under inequality constraints and bounds. `Descent` smooths it,

    min over s of  s + cap width sum softplus((v - s)/width),

whose derivatives with respect to v are weights that sum to one; limits enter as a smoothed exact penalty. The
width falls from step to step, because the worst case has kinks that a fixed width would round off. Steps, by
any gradient transformation of optax, are clipped to the bounds.

`Sequential` goes from one design after the other by sequential quadratic programming on exact gradients. With
a level s and excesses v and t the problem is the smooth programme

    min  s + cap sum v + C t,    f_i(x) - s <= v_i,    c_j(x) <= t,    v, t >= 0

(R. T. Rockafellar and S. Uryasev, Journal of Risk 2, 2000), so that a kink where several conditions are
equally bad is met as surely as a smooth bottom. It always has a feasible point."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array
from scipy.optimize import Bounds, minimize

from tpd.core import checks
from tpd.core.progress import Count, unreported
from tpd.design.ends import PENALTY, Book, Ends, Evaluate, Linearisation, Measure, joined
from tpd.design.objective import Orbits
from tpd.design.one_shot import OneShot
from tpd.models.base import AbstractModel
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed
from tpd.theory.equations import Terms

Known = Linearisation | None
"""Values at the designs that a search begins with, if they have been computed before."""
OPTIMISERS: dict[str, Callable[[Any], optax.GradientTransformation]] = {
    "adam": partial(optax.adam, b1=0.8, b2=0.95),
    "rmsprop": partial(optax.rmsprop, decay=0.95),
}
"""Optimisers of optax that have a name, functions of a schedule of steps."""
_WIDTHS = (1e-1, 1e-4)
"""First and last width of the smoothing, in units of the merit."""
_SHARPER = 0.1
"""The width of the penalty over that of the measure: there may be hundreds of limits with room to spare."""


def descend(
    optimiser: optax.GradientTransformation,
    evaluate: Evaluate,
    starts: np.ndarray,
    cap: float,
    risk: Measure,
    *,
    known: Known = None,
    steps: int = 40,
    after: Count = unreported,
) -> Ends:
    """Descend from all starts (m, d) by an optimiser of optax; every step evaluates every start once.

    Args:
        optimiser: its steps are in shares of the bounds.
        evaluate, starts, cap, risk, known: as for `minimise`.
        steps: number of steps.
        after: called with (steps done, of how many).
    """
    book = Book(evaluate, risk, np.clip(starts, 0.0, 1.0), known)

    @jax.jit
    @jax.vmap
    def onward(slope: Array, state: Any, u: Array) -> tuple[Array, Any]:
        updates, state = optimiser.update(slope, state, u)
        return jnp.clip(jnp.asarray(optax.apply_updates(u, updates)), 0.0, 1.0), state

    u, at, state = book.x.copy(), book.local, jax.jit(jax.vmap(optimiser.init))(book.x)
    # A wide kink first, which shows the way; a sharp one last, which shows the value.
    for step, width in enumerate(np.geomspace(*_WIDTHS, max(steps, 2))[:steps]):
        value, slope = smoothed_merit(at, cap, float(width))
        moved, state = onward(slope, state, u)
        # A start whose value is infinite goes half way back to its best design.
        u = np.where(np.isfinite(value)[:, None], np.asarray(moved), 0.5 * (u + book.x))
        at = book.tried(u)
        after(step + 1, steps)
    return book.ends(cap)


def named(name: str, steps: int) -> optax.GradientTransformation:
    """The optimiser of a name in `OPTIMISERS`, with a step that falls from 6 % of the bounds to a fiftieth of
    that."""
    schedule = optax.cosine_decay_schedule(0.06, max(steps, 1), alpha=0.02)
    return OPTIMISERS[name](schedule)


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


_FAR = 10.0
"""Value of a function that is not finite, above the largest at the start."""
_ROUNDING = 1e-9


def minimise(
    evaluate: Evaluate,
    starts: np.ndarray,
    cap: float,
    risk: Measure,
    *,
    known: Known = None,
    steps: int = 40,
    tolerance: float = 1e-6,
    after: Count = unreported,
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


SMOOTHED = Smoothed(rtol=1e-7)
"""Model of a descent by default: the error control ignores derivatives, so it is tighter than for motions."""


@dataclass(frozen=True)
class Method(ABC):
    """A way to search from many designs at once.

    Raises:
        ValueError: a count below one.
    """

    name: ClassVar[str]
    searches: checks.Whole
    """Designs from which a search begins."""
    screening: checks.Whole
    """Designs solved before the searches, to choose where they begin."""
    steps: checks.Whole
    """Bound on the steps of each search."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "searches screening steps")

    @abstractmethod
    def search(
        self, objective: Orbits, units: np.ndarray, *, known: Known = None, after: Count = unreported
    ) -> Ends:
        """Search from all designs `units` (m, d), in shares of the bounds; `known` is what the objective
        gives there, if it has been asked before. See `minimise`."""


@dataclass(frozen=True)
class Sequential(Method):
    """Sequential quadratic programming by SciPy on exact derivatives. It follows
    kinks, where several conditions are equally bad, as surely as smooth valleys, and needs the fewest
    designs."""

    name: ClassVar[str] = "sequential"
    searches: checks.Whole = field(default=64, kw_only=True)
    screening: checks.Whole = field(default=512, kw_only=True)
    steps: checks.Whole = field(default=40, kw_only=True)

    def search(
        self, objective: Orbits, units: np.ndarray, *, known: Known = None, after: Count = unreported
    ) -> Ends:
        """See `Method.search`."""
        risk = objective.risk
        cap = risk.cap(len(objective.conditions))
        return minimise(objective.at, units, cap, risk.of, known=known, steps=self.steps, after=after)


@dataclass(frozen=True)
class Descent(Method):
    """Descent by an optimiser of optax on the gradients of a model. By default signs and impacts are smoothed
    and diffrax integrates the equations (25): design and orbit converge together, see `tpd.design.one_shot`,
    and the exact solution validates every end. A first-order method comes near an optimum; what the runs say
    of the designs there decides."""

    name: ClassVar[str] = "descent"
    optimiser: str | optax.GradientTransformation = "adam"
    """Optimiser: adam, rmsprop, or in Python a transformation of optax with steps in shares of the bounds."""
    model: AbstractModel | None = field(default=None, kw_only=True)
    """`Smoothed()` follows the symmetric orbits with smoothed signs and impacts, the default; `Piecewise()`
    is these orbits themselves, with exact gradients."""
    searches: checks.Whole = field(default=16, kw_only=True)
    screening: checks.Whole = field(default=512, kw_only=True)
    steps: checks.Whole = field(default=40, kw_only=True)
    tolerance: checks.Real = field(default=0.01, kw_only=True)
    """Largest relative difference between the amplitudes of the model and of the exact solution: an end
    beyond it is not offered."""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.set_checked(self, checks.tolerance, "tolerance")
        smooth = isinstance(self.model, Smoothed) and self.model.terms is Terms.linear
        if self.model is not None and not smooth and not isinstance(self.model, Piecewise):
            raise ValueError(
                "`model` must be Smoothed() with linear terms, or Piecewise(), whose symmetric orbits are "
                f"known, but is {checks.shown(self.model)}"
            )
        if isinstance(self.optimiser, str):
            checks.one_of("optimiser", self.optimiser, tuple(OPTIMISERS))
        elif not isinstance(self.optimiser, optax.GradientTransformation):
            raise ValueError(
                f"`optimiser` must be a transformation of optax, or one of {', '.join(OPTIMISERS)}, but is "
                f"{checks.shown(self.optimiser)}"
            )
        else:
            self._check_steps()

    @property
    def optimiser_name(self) -> str:
        """Name of the optimiser; "custom" for a transformation that the user gave."""
        return self.optimiser if isinstance(self.optimiser, str) else "custom"

    def _check_steps(self) -> None:
        """Raise `ValueError` for an optimiser without a name that needs more than gradients."""
        x, optimiser = jnp.array([0.3, 0.6]), self.optimiser
        assert not isinstance(optimiser, str)
        try:
            optimiser.update(jnp.array([1.0, -0.5]), optimiser.init(x), x)
        except TypeError as error:
            raise ValueError(
                "`optimiser` must make its steps from gradients alone: give an optimiser without a line "
                "search"
            ) from error

    def search(
        self, objective: Orbits, units: np.ndarray, *, known: Known = None, after: Count = unreported
    ) -> Ends:
        """See `Method.search`. Where orbits are followed by smoothed signs, the ends are those of the exact
        solution, with the differences between both."""
        optimiser = named(self.optimiser, self.steps) if isinstance(self.optimiser, str) else self.optimiser
        risk, walk, evaluate = objective.risk, None, objective.at
        if isinstance(self.model, Smoothed):
            walk = OneShot(objective, self.model)
            known, evaluate = objective.linearised(walk.begin(objective.space.unscaled(units))), walk.at
        cap = risk.cap(len(objective.conditions))
        found = descend(optimiser, evaluate, units, cap, risk.of, known=known, steps=self.steps, after=after)
        return found if walk is None else walk.validated(found)


def describe(method: Method) -> dict[str, object]:
    """Settings of a method as plain values, enough to repeat it."""
    settings: dict[str, object] = {"method": method.name}
    settings |= {name: getattr(method, name) for name in ("searches", "screening", "steps")}
    if isinstance(method, Descent):
        settings |= {"optimiser": method.optimiser_name, "tolerance": method.tolerance}
        settings |= {"model": repr(method.model)}
    return settings
