"""The search itself: designs screened by the exact solution, then descents from the best of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Thread

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from tpd.analysis.compare_models import nonlinear
from tpd.analysis.steady_state import Steady, steady_state
from tpd.core.parameters import Parameters
from tpd.core.progress import Progress
from tpd.core.status import SETTLED, status_name
from tpd.core.threads import aside
from tpd.design.result import DesignSpace, StartStatus
from tpd.design.single_polish import polish
from tpd.design.single_search import (
    Evaluation,
    Trace,
    descend,
    evaluator,
    start_status,
    starting_points,
    trace,
    with_design,
)
from tpd.models.base import AbstractModel
from tpd.models.piecewise import Piecewise


@dataclass(frozen=True)
class Found:
    """What a search leaves behind, whole or interrupted."""

    evaluate: Callable[[Array], Evaluation] | None
    """The compiled evaluator; None if there was nothing to search, or Ctrl-C came before it was ready."""
    screened: Screened
    trace: Trace
    best: np.ndarray
    interrupted: bool

    def designs(self, limit: float) -> list[np.ndarray]:
        """The best design of every start, and the two best screened."""
        paths = [self.trace.designs[i, j] for i, j in enumerate(self.best) if j >= 0]
        return paths + list(self.screened.designs[self.screened.order(limit)[:2]])

    def statuses(self, space: DesignSpace) -> tuple[StartStatus, ...]:
        """How every start ended."""
        if self.interrupted:
            return tuple(StartStatus.interrupted for _ in self.best)
        return tuple(start_status(self.trace, space, i, int(j)) for i, j in enumerate(self.best))


class Screened:
    """Designs solved exactly before the search."""

    def __init__(self, planned: np.ndarray, results: list[Steady]) -> None:
        self.planned = planned
        self.designs = planned[: len(results)]
        self.amplitude = np.array([float(s.amplitude) for s in results])
        self.stroke = np.array([float(s.stroke) for s in results])
        self.status = np.array([status_name(s.status) for s in results], dtype=str)

    def order(self, limit: float) -> np.ndarray:
        """Indices of the designs that settle within the limit, best first."""
        settled = np.isin(self.status, SETTLED) & (self.stroke <= limit)
        order = np.argsort(np.where(settled, self.amplitude, np.inf), kind="stable")
        return order[: settled.sum()]


def search(
    p: Parameters,
    space: DesignSpace,
    model: AbstractModel,
    starts: int,
    steps: int,
    screening: int,
    seed: int,
    progress: Progress | None,
) -> Found:
    """Screen, descend and polish; Ctrl-C at any point keeps what there is."""
    evaluate = evaluator(p, model, len(space.names))
    compiling = _compile_aside(evaluate, np.tile(bare_design(p), (starts, 1))) if steps > 0 else None
    screened, interrupted = _screen(p, space, screening, seed, progress)
    chosen = choose(screened, space, starts)
    nothing = np.full(len(chosen), -1)
    if interrupted or compiling is None:
        return Found(None, screened, trace([], len(chosen)), nothing, interrupted)
    compiling.join()
    aside(lambda: nonlinear(p))
    path, interrupted = descend(evaluate, space, chosen, steps=steps, progress=progress)
    best = path.best(space.stroke)
    if not interrupted:
        near = np.stack([path.designs[i, j] if j >= 0 else chosen[i] for i, j in enumerate(best)])
        finish, interrupted = polish(evaluate, space, near, steps=(steps + 1) // 2, progress=progress)
        path = path.then(finish)
        best = path.best(space.stroke)
    return Found(evaluate, screened, path, best, interrupted)


def _screen(
    p: Parameters, space: DesignSpace, count: int, seed: int, progress: Progress | None
) -> tuple[Screened, bool]:
    designs = starting_points(p, space, count, seed)
    results: list[Steady] = []
    try:
        for i, design in enumerate(designs):
            results.append(exact(p, design))
            if progress is not None:
                progress("screening", i + 1, count)
    except KeyboardInterrupt:
        return Screened(designs, results), True
    return Screened(designs, results), False


def exact(p: Parameters, design: np.ndarray) -> Steady:
    """The exact solution from rest."""
    return jax.block_until_ready(steady_state(with_design(p, jnp.asarray(design)), model=Piecewise()))


def choose(screened: Screened, space: DesignSpace, starts: int) -> np.ndarray:
    """The best screened designs that lie apart from one another, then the rest in order."""
    order = list(screened.order(space.stroke))
    taken = set(order)
    order += [i for i in range(len(screened.planned)) if i not in taken]
    low, high = space.bounds
    unit = (screened.planned[:, : low.size] - low) / (high - low)
    chosen: list[int] = []
    for apart in (0.1, 0.0):
        for i in order:
            far = all(np.linalg.norm(unit[i] - unit[j]) > apart for j in chosen)
            if len(chosen) < starts and i not in chosen and far:
                chosen.append(i)
    return screened.planned[chosen]


def _compile_aside(evaluate: Callable[[Array], Evaluation], designs: np.ndarray) -> Thread:
    """Compile the search's function while the other core screens."""
    return aside(lambda: jax.block_until_ready(evaluate(jnp.asarray(designs)).merit))


def bare_design(p: Parameters) -> np.ndarray:
    """(mu, lam, zeta) of the bare block."""
    return np.array([0.0, float(p.lam), float(p.zeta)])
