"""Methods of search: an optimiser, the model whose motions it compares, and its budget."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import optax

from tpd.core import checks
from tpd.design.descent import descend
from tpd.design.sequential import Ends, minimise
from tpd.design.subproblem import Linearisation
from tpd.models.base import AbstractModel

OPTIMISERS = ("adam", "lbfgs")
"""Optimisers of optax that have a name."""


@dataclass(frozen=True)
class Method(ABC):
    """A way to search from many designs at once.

    Raises:
        ValueError: a count below one, or a model that is not an instance of a model.
    """

    name: ClassVar[str]
    model: AbstractModel | None
    """Model whose motions are compared; None is every symmetric orbit, in closed form."""
    searches: int
    """Designs from which a search begins."""
    screening: int
    """Designs solved before the searches, to choose where they begin."""
    steps: int
    """Bound on the steps of each search."""

    def __post_init__(self) -> None:
        for name in ("searches", "screening", "steps"):
            checks.count(name, getattr(self, name))
        if self.model is not None and not isinstance(self.model, AbstractModel):
            raise ValueError(f"`model` must be a model such as Smoothed(), but is {self.model!r}")

    @abstractmethod
    def search(
        self,
        evaluate: Callable[[np.ndarray], Linearisation],
        units: np.ndarray,
        cap: float,
        risk: Callable[[np.ndarray], np.ndarray],
        *,
        known: Linearisation | None = None,
        after: Callable[[int, int], None] | None = None,
    ) -> Ends:
        """Search from all designs `units` (m, d), in shares of the bounds; see `minimise`."""


@dataclass(frozen=True)
class Sequential(Method):
    """Sequential programming on exact derivatives in a trust region, see `tpd.design.sequential`. It follows
    kinks, where several conditions are equally bad, as surely as smooth valleys, and needs the fewest
    designs."""

    name: ClassVar[str] = "sequential"
    model: AbstractModel | None = field(default=None, kw_only=True)
    searches: int = field(default=64, kw_only=True)
    screening: int = field(default=512, kw_only=True)
    steps: int = field(default=40, kw_only=True)

    def search(
        self,
        evaluate: Callable[[np.ndarray], Linearisation],
        units: np.ndarray,
        cap: float,
        risk: Callable[[np.ndarray], np.ndarray],
        *,
        known: Linearisation | None = None,
        after: Callable[[int, int], None] | None = None,
    ) -> Ends:
        """See `Method.search`."""
        return minimise(evaluate, units, cap, risk, known=known, steps=self.steps, after=after)


@dataclass(frozen=True)
class Descent(Method):
    """Descent by an optimiser of optax on the gradients of a model, and a few steps of sequential programming
    at the end: a first-order method comes near an optimum but rattles at an active limit."""

    name: ClassVar[str] = "descent"
    optimiser: str | optax.GradientTransformation = "adam"
    """"adam", "lbfgs", or any transformation of optax, whose steps are in shares of the bounds."""
    model: AbstractModel | None = field(default=None, kw_only=True)
    """None: smoothed signs by diffrax with one condition (the exact model where impacts lose energy), and
    every symmetric orbit with several."""
    searches: int = field(default=8, kw_only=True)
    screening: int = field(default=192, kw_only=True)
    steps: int = field(default=30, kw_only=True)
    tolerance: float = field(default=0.01, kw_only=True)
    """Largest relative difference between the amplitudes of the model and of the exact solution."""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.positive("tolerance", self.tolerance)
        if isinstance(self.optimiser, str):
            checks.one_of("optimiser", self.optimiser, OPTIMISERS)
        elif not isinstance(self.optimiser, optax.GradientTransformation):
            raise ValueError(
                f"`optimiser` must be a transformation of optax, or one of {', '.join(OPTIMISERS)}, but is "
                f"{self.optimiser!r}"
            )
        else:
            self.taken(1)

    @property
    def optimiser_name(self) -> str:
        """Name of the optimiser; "custom" for a transformation that the user gave."""
        return self.optimiser if isinstance(self.optimiser, str) else "custom"

    def taken(self, count: int) -> np.ndarray:
        """First steps of an optimiser without a name on a fixed sequence of gradients, (count, 2); empty for
        one with a name. They tell such optimisers apart.

        Raises:
            ValueError: an optimiser that needs more than gradients.
        """
        if isinstance(self.optimiser, str):
            return np.zeros((0, 2))
        x, steps = jnp.array([0.3, 0.6]), []
        update = jax.jit(self.optimiser.update)
        try:
            state = self.optimiser.init(x)
            for i in range(count):
                step, state = update(jnp.array([1.0, -0.5 + 0.1 * i]), state, x)
                steps.append(np.asarray(step))
        except TypeError as error:
            raise ValueError(
                "`optimiser` must make its steps from gradients alone: give an optimiser without a line "
                'search, or "lbfgs"'
            ) from error
        return np.array(steps)

    def search(
        self,
        evaluate: Callable[[np.ndarray], Linearisation],
        units: np.ndarray,
        cap: float,
        risk: Callable[[np.ndarray], np.ndarray],
        *,
        known: Linearisation | None = None,
        after: Callable[[int, int], None] | None = None,
    ) -> Ends:
        """See `Method.search`."""
        # Half as many steps again: a first-order method is near, and Newton-like steps converge at once.
        finish = (self.steps + 1) // 2
        total = self.steps + finish
        first = descend(
            self.optimiser,
            evaluate,
            units,
            cap,
            risk,
            known=known,
            steps=self.steps,
            after=None if after is None else lambda done, _: after(done, total),
        )
        last = minimise(
            evaluate,
            first.x,
            cap,
            risk,
            known=first.local,
            steps=finish,
            radius=0.04,
            after=None if after is None else lambda done, _: after(self.steps + done, total),
        )
        return joined(first, last)


def joined(first: Ends, last: Ends) -> Ends:
    """A search that went on from where another had ended."""
    # The last design of the first part is the first of the second: it is counted once.
    spent = np.concatenate([first.path_spent, first.evaluations + last.path_spent[1:]])
    return last._replace(
        steps=first.steps + last.steps,
        path=np.concatenate([first.path, last.path[1:]]),
        path_merit=np.concatenate([first.path_merit, last.path_merit[1:]]),
        path_spent=spent,
    )


def describe(method: Method) -> dict[str, object]:
    """Settings of a method as plain values, enough to repeat it."""
    model = method.model
    settings: dict[str, object] = {
        "method": method.name,
        "model": "orbits" if model is None else repr(model),
        "searches": method.searches,
        "screening": method.screening,
        "steps": method.steps,
    }
    if isinstance(method, Descent):
        settings |= {"optimiser": method.optimiser_name, "tolerance": method.tolerance}
    return settings
