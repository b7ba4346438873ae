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

from tpd.analysis.ensemble import Ensemble, outcomes
from tpd.analysis.outcomes import Outcomes, Share
from tpd.core.conditions import Conditions
from tpd.core.formatting import Printed
from tpd.core.parameters import Parameters
from tpd.core.quantities import bare_parameters_of
from tpd.core.scene import Pendulum, Scene

SIGNIFICANT = 0.05
"""Chance below which a difference between two shares is not put down to luck."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Verdict(Printed):
    """An ensemble with a pendulum and without, run by run."""

    hung: Outcomes
    bare: Outcomes

    @property
    def worse(self) -> int:
        """Number of runs that overturn with the pendulum only."""
        return int(np.sum(self.hung.lost & ~self.bare.lost))

    @property
    def better(self) -> int:
        """Number of runs that overturn without the pendulum only."""
        return int(np.sum(self.bare.lost & ~self.hung.lost))

    @property
    def chance(self) -> float:
        """Chance of `worse` or more by luck; see `chance_of`."""
        return chance_of(self.worse, self.better)

    @property
    def harms(self) -> bool:
        """Whether significantly more runs overturn with the pendulum than without."""
        return self.worse > self.better and self.chance < SIGNIFICANT

    @property
    def objection(self) -> str:
        """Sentence about the runs that overturn with one of the two only."""
        return (
            f"{self.worse} of {len(self.hung.status)} runs of the ensemble overturn with the pendulum only, "
            f"{self.better} without it only (chance of that by luck: {self.chance:.2g})"
        )

    @property
    def worse_peaks(self) -> Share:
        """Share of the runs whose largest tilt is above the bare block's by more than a per cent."""
        # Both are infinite where both overturn, and the comparison of infinities warns.
        with np.errstate(invalid="ignore"):
            return Share.of(self.hung.peak > 1.01 * self.bare.peak)

    def summary(self) -> dict[str, Any]:
        """Both ensembles, and the numbers of runs that differ, for JSON."""
        pairs = {"worse": self.worse, "better": self.better, "chance": self.chance}
        return {**pairs, "with": self.hung.summary(), "without": self.bare.summary()}

    def table(self) -> str:
        """Shares and quantiles of both ensembles as text."""
        lines = [f"{'':36}{'with pendulum':>26}{'without':>26}"]
        for (name, hung), (_, bare) in zip(self.hung.rows(), self.bare.rows(), strict=True):
            lines.append(f"{name:36}{hung:>26}{'' if name.startswith('bob') else bare:>26}".rstrip())
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
    workers: int | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> Verdict:
    """Follow an ensemble of runs with the pendulum and without.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: in the scene.
        ensemble: default `Ensemble()`.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
        bare: outcomes without the pendulum, where they are known already.
        workers: threads; default the number of cores.
        progress: True for a bar on stderr, or called with (runs done, of how many), for one ensemble after
            the other.

    Raises:
        ValueError: bad input, or a pendulum beside parameters.
        RuntimeError: JAX is in 32-bit mode.
    """

    # Both use the seed of one ensemble, hence the same starts, phases and scatter.
    def follow(subject: Parameters | Scene, pendulum: Pendulum | None) -> Outcomes:
        runs: dict[str, Any] = {"ensemble": ensemble, "conditions": conditions}
        return outcomes(subject, pendulum, workers=workers, progress=progress, **runs)

    hung = follow(subject, pendulum)
    if bare is None:
        bare = follow(subject if isinstance(subject, Scene) else bare_parameters_of(subject), None)
    return Verdict(hung=hung, bare=bare)
