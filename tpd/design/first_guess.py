"""First guess of a pendulum by rules of thumb, before any search, and its validation runs.

The guess is one of the candidates of every search. An answer compares the design with it in the same runs,
which shows whether the search was worth its time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.answers.run_table import Runs
from tpd.design.problem import Problem
from tpd.scene.scene import Pendulum

_DAMPING = 0.3
"""Damping ratio of the guess. Between 0.15 and 0.5 it hardly matters under earthquakes."""
_MASSES, _LENGTHS = 24, 24
"""Numbers of masses and lengths that are compared with the limits."""


class FirstGuess(NamedTuple):
    """Pendulum of a rule of thumb in the validation runs of a design."""

    pendulum: Pendulum
    """Pendulum of the guess."""
    runs: Runs
    """Validation runs that the report quotes, with the pendulum of the guess."""
    over_limit: float
    """Share of the runs in which the block stands that exceed a limit."""
    limit: str
    """Limit that most of these runs exceed; empty if there is none."""


def first_guess(problem: Problem) -> np.ndarray | None:
    """Return the design (mu, lam, zeta) of a rule of thumb, (3,).

    It is the pendulum with the largest mu^(1/2) lam^(1/3) among the lengths of the rule, see
    `Problem.rule_lengths`, that keeps the limits without any run. The reduction of the tilt under earthquakes
    grows with this product up to the longest rod (notebook 17). The result is None if no such design is in
    the space.
    """
    low, high = problem.space.ends
    longest, shortest = problem.rule_lengths
    # A length outside of the bounds is no guess: the space excludes what the rule needs.
    longest, shortest = min(longest, high[1]), max(shortest, low[1])
    if longest < shortest:
        return None
    masses, zeta = np.geomspace(high[0], low[0], _MASSES), np.clip(_DAMPING, low[2], high[2])
    lengths = np.geomspace(longest, shortest, _LENGTHS if longest > shortest else 1)
    designs = np.array([(mu, lam, zeta) for lam in lengths for mu in masses])
    keeps = problem.possible(designs, problem.rule_swing)
    # A cavity admits a light bob on a long rod, or a heavy bob on a shorter one, and the mass matters more.
    mu, lam, _ = designs.T
    return designs[np.argmax(keeps * np.sqrt(mu) * np.cbrt(lam))] if keeps.any() else None


def follow_guess(problem: Problem, quoted: PairedRuns) -> FirstGuess | None:
    """Return the guess in the validation runs that the report quotes; None if there is no guess."""
    guess = first_guess(problem)
    if guess is None:
        return None
    # Runs of the search records and runs without a result are not among those that the report quotes.
    runs = problem.validation_runs(guess, quoted.with_pendulum.seed).of(quoted.rows)
    return FirstGuess(problem.pendulum(guess), runs, *problem.over_limit(guess, runs))
