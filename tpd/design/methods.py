"""Methods of search: an optimiser, the model whose gradients it takes, and its budget."""

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
from tpd.design.descent import OPTIMISERS, descend, named
from tpd.design.ends import Ends, Linearisation
from tpd.design.objective import Orbits
from tpd.design.one_shot import OneShot
from tpd.design.sequential import minimise
from tpd.models.base import AbstractModel
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed
from tpd.theory.equations import Terms

SMOOTHED = Smoothed(rtol=1e-7)
"""Model of a descent by default: the error control ignores derivatives, so it is tighter than for motions."""


@dataclass(frozen=True)
class Method(ABC):
    """A way to search from many designs at once.

    Raises:
        ValueError: a count below one.
    """

    name: ClassVar[str]
    searches: int
    """Designs from which a search begins."""
    screening: int
    """Designs solved before the searches, to choose where they begin."""
    steps: int
    """Bound on the steps of each search."""

    def __post_init__(self) -> None:
        for name in ("searches", "screening", "steps"):
            checks.count(name, getattr(self, name))

    @abstractmethod
    def search(
        self,
        objective: Orbits,
        units: np.ndarray,
        *,
        known: Linearisation | None = None,
        after: Callable[[int, int], None] | None = None,
    ) -> Ends:
        """Search from all designs `units` (m, d), in shares of the bounds; `known` is what the objective
        gives there, if it has been asked before. See `minimise`."""


@dataclass(frozen=True)
class Sequential(Method):
    """Sequential quadratic programming by SciPy on exact derivatives, see `tpd.design.sequential`. It follows
    kinks, where several conditions are equally bad, as surely as smooth valleys, and needs the fewest
    designs."""

    name: ClassVar[str] = "sequential"
    searches: int = field(default=64, kw_only=True)
    screening: int = field(default=512, kw_only=True)
    steps: int = field(default=40, kw_only=True)

    def search(
        self,
        objective: Orbits,
        units: np.ndarray,
        *,
        known: Linearisation | None = None,
        after: Callable[[int, int], None] | None = None,
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
    searches: int = field(default=16, kw_only=True)
    screening: int = field(default=512, kw_only=True)
    steps: int = field(default=40, kw_only=True)
    tolerance: float = field(default=0.01, kw_only=True)
    """Largest relative difference between the amplitudes of the model and of the exact solution: an end
    beyond it is not offered."""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.positive("tolerance", self.tolerance)
        smooth = isinstance(self.model, Smoothed) and self.model.terms is Terms.linear
        if self.model is not None and not smooth and not isinstance(self.model, Piecewise):
            raise ValueError(
                "`model` must be Smoothed() with linear terms, or Piecewise(), whose symmetric orbits are "
                f"known, but is {self.model!r}"
            )
        if isinstance(self.optimiser, str):
            checks.one_of("optimiser", self.optimiser, tuple(OPTIMISERS))
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
                "search"
            ) from error
        return np.array(steps)

    def search(
        self,
        objective: Orbits,
        units: np.ndarray,
        *,
        known: Linearisation | None = None,
        after: Callable[[int, int], None] | None = None,
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
    settings: dict[str, object] = {
        "method": method.name,
        "searches": method.searches,
        "screening": method.screening,
        "steps": method.steps,
    }
    if isinstance(method, Descent):
        settings |= {"optimiser": method.optimiser_name, "tolerance": method.tolerance}
        settings |= {"model": repr(method.model)}
    return settings
