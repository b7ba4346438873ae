"""How many steps the ODE solvers of a model take, which it does not tell itself."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any
from unittest import mock

import diffrax
import jax


class Steps:
    """The steps of every solve, in no order."""

    def __init__(self) -> None:
        self.solves: list[int] = []

    def note(self, steps: Any) -> None:
        """One more solve."""
        self.solves.append(int(steps))

    def taken(self) -> list[int]:
        """All that were noted since this was last asked for."""
        jax.effects_barrier()
        solves, self.solves = self.solves, []
        return solves


@contextlib.contextmanager
def counted() -> Iterator[Steps]:
    """Counts the steps of what is traced meanwhile, whenever it runs. Not for functions that are
    differentiated, batched, or compiled already."""
    steps, solve = Steps(), diffrax.diffeqsolve

    def noted(*args: Any, **options: Any) -> diffrax.Solution:
        solution = solve(*args, **options)
        jax.debug.callback(steps.note, solution.stats["num_steps"])
        return solution

    with mock.patch.object(diffrax, "diffeqsolve", noted):
        yield steps
