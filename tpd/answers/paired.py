"""Comparison of an ensemble with a pendulum and without, run by run.

Both are put to the same runs (common random numbers), so that the scatter that they share cancels: a
difference shows with far fewer runs than two independent shares would need.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tpd.answers.ensemble import Ensemble, outcomes
from tpd.answers.outcomes import UNDECIDED_ROW, Outcomes
from tpd.cluster.cluster import Cluster
from tpd.core import checks
from tpd.core.formatting import Printed
from tpd.scene.conditions import Conditions
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import bare_parameters_of
from tpd.scene.scene import Pendulum, Scene
from tpd.theory.equations import Terms

SIGNIFICANT = 0.05
"""Chance below which a difference between two shares is not put down to luck."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Verdict(Printed):
    """An ensemble with a pendulum and without, run by run."""

    hung: Outcomes
    bare: Outcomes

    @property
    def equations(self) -> str:
        """Equations by which the runs were followed, "linear" or "nonlinear"."""
        return self.hung.equations

    @property
    def worse(self) -> int:
        """Number of runs that overturn with the pendulum only, of those with both answers."""
        return int(np.sum((self.hung.lost & ~self.bare.lost)[self.known]))

    @property
    def better(self) -> int:
        """Number of runs that overturn without the pendulum only, of those with both answers."""
        return int(np.sum((self.bare.lost & ~self.hung.lost)[self.known]))

    @property
    def known(self) -> np.ndarray:
        """Whether a run has an answer with the pendulum and without, shape (runs,)."""
        return ~(self.hung.undecided | self.bare.undecided)

    @property
    def ends(self) -> tuple[Verdict, Verdict]:
        """The runs with each that has no answer ended against the pendulum, and with each ended for it."""
        against, favour = (
            Verdict(hung=self.hung.ended(falls), bare=self.bare.ended(not falls)) for falls in (True, False)
        )
        return against, favour

    @property
    def chance(self) -> float:
        """Chance of `worse` or more by luck; see `chance_of`."""
        return chance_of(self.worse, self.better)

    @property
    def harms(self) -> bool:
        """Whether significantly more runs overturn with the pendulum than without."""
        return self.worse > self.better and self.chance < SIGNIFICANT

    @property
    def undecided(self) -> tuple[int, int]:
        """Numbers of runs without an answer, with the pendulum and without."""
        return int(self.hung.undecided.sum()), int(self.bare.undecided.sum())

    @property
    def objection(self) -> str:
        """Sentence about the runs that overturn with one of the two only, and those without an answer."""
        hung, bare = self.undecided
        unknown = f"; {hung} with the pendulum and {bare} without it have no answer" if hung or bare else ""
        return (
            f"{self.worse} of {len(self.hung.status)} runs of the ensemble overturn with the pendulum only, "
            f"{self.better} without it only (chance of that by luck: {self.chance:.2g}){unknown}"
        )

    @property
    def chance_in_words(self) -> str:
        """Runs that overturn with one of the two only, and whether chance alone would do this."""
        worse, better = self.worse, self.better
        if worse == better:
            return f"As many runs overturn with the pendulum only as without it only ({worse})."
        # Either side might have been the larger one.
        chance = min(1.0, 2.0 * chance_of(max(worse, better), min(worse, better)))
        size = "p < 1e-6" if chance < 1e-6 else f"p = {chance:.2g}"
        said = "hardly" if chance < SIGNIFICANT else "it may"
        return (
            f"{worse} runs overturn with the pendulum only and {better} without it only. Would chance alone "
            f"do this? {said.capitalize()}: {size}."
        )

    def summary(self) -> dict[str, Any]:
        """Both ensembles, and the numbers of runs that differ, for JSON."""
        pairs = {"worse": self.worse, "better": self.better, "chance": self.chance}
        return {**pairs, "with": self.hung.summary(), "without": self.bare.summary()}

    def table(self) -> str:
        """Shares and quantiles of both ensembles as text."""
        lines = [f"{self.equations + ' equations':36}{'with pendulum':>26}{'without':>26}"]
        for (name, hung), (_, bare) in zip(self.hung.rows(), self.bare.rows(), strict=True):
            lines.append(f"{name:36}{hung:>26}{'' if name.startswith('bob') else bare:>26}".rstrip())
        if any(self.undecided):
            lines.append(f"{UNDECIDED_ROW:36}{self.undecided[0]:>26}{self.undecided[1]:>26}")
        return "\n".join(lines)

    def __str__(self) -> str:
        return f"{self.table()}\n{self.objection}"


def chance_of(worse: int, better: int) -> float:
    """Chance that of all runs that differ at least `worse` would go against the pendulum, were either way
    equally likely (McNemar's test, exact and one-sided)."""
    # Runs that end alike with and without say nothing about the difference, so that only the others count.
    n = worse + better
    return sum(math.comb(n, i) for i in range(worse, n + 1)) / 2**n


def verdict(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    ensemble: Ensemble | None = None,
    conditions: Conditions | None = None,
    bare: Outcomes | None = None,
    equations: Terms | str = Terms.linear,
    workers: int | None = None,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> Verdict:
    """Follow an ensemble of runs with the pendulum and without.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: in the scene.
        ensemble: default `Ensemble()`.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
        bare: outcomes without the pendulum, where they are known already, by the same equations.
        equations: linear or nonlinear, see `outcomes`.
        workers: threads; default the number of cores.
        cluster: processes or machines in place of threads.
        progress: True for a bar on stderr, or called with (runs done, of how many), for one ensemble after
            the other.

    Raises:
        ValueError: bad input, a pendulum beside parameters, or `bare` by other equations.
        RuntimeError: JAX is in 32-bit mode.
    """
    if bare is not None:
        checks.instance("bare", bare, Outcomes)
    if isinstance(subject, Scene):
        checks.instance("pendulum", pendulum, Pendulum)
    elif isinstance(subject, Parameters):
        checks.positive("mu", subject.mu)
    if bare is not None and bare.equations != str(equations):
        raise ValueError(f"`bare` must be by the {equations} equations, but is by the {bare.equations} ones")

    # Both use the seed of one ensemble, hence the same starts, phases and scatter.
    def follow(subject: Parameters | Scene, pendulum: Pendulum | None) -> Outcomes:
        runs: dict[str, Any] = {"ensemble": ensemble, "conditions": conditions, "equations": equations}
        where: dict[str, Any] = {"workers": workers, "cluster": cluster, "progress": progress}
        return outcomes(subject, pendulum, **where, **runs)

    hung = follow(subject, pendulum)
    if bare is None:
        bare = follow(subject if isinstance(subject, Scene) else bare_parameters_of(subject), None)
    return Verdict(hung=hung, bare=bare)
