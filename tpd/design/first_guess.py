"""First guess of a pendulum by rules of thumb, before any search, and its validation runs.

The guess is one of the candidates of every search. An answer compares the design with it in the same runs,
which shows whether the search was worth its time. Under ground motions the guess also has the largest mass
that keeps the limits in runs. The benefit of a design that is made in this way has no part in its choice, and
all earthquakes may validate it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.answers.run_table import Runs
from tpd.answers.statistics import quantile_of
from tpd.core.progress import Progress, unreported
from tpd.design.problem import Problem
from tpd.scene.scene import Pendulum

_DAMPING = 0.3
"""Damping ratio of the guess. Between 0.15 and 0.5 it hardly matters under earthquakes."""
_MASSES, _LENGTHS = 48, 24
"""Numbers of masses and lengths that are compared with the limits."""
_STEPS = 5
"""Number of bisections of the assumed bob angle, after which it is known within 2 degrees."""


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


def first_guess(problem: Problem, swing: float | None = None, damping: float = _DAMPING) -> np.ndarray | None:
    """Return the design (mu, lam, zeta) of a rule of thumb, (3,).

    It is the pendulum with the largest mu^(1/2) lam^(1/3) among the lengths of the rule, see
    `Problem.rule_sizes`, that keeps the limits without any run. The reduction of the tilt under earthquakes
    grows with this product up to the longest rod (notebook 17). The result is None if no such design is in
    the space.

    Args:
        problem: design space and limits.
        swing: bob angle (rad) at which the pendulum keeps the limits; default that of the problem.
        damping: damping ratio, as far as the space has it.
    """
    low, high = problem.space.ends
    longest, shortest, angle = problem.rule_sizes
    # A length outside of the bounds is no guess: the space excludes what the rule needs.
    longest, shortest = min(longest, high[1]), max(shortest, low[1])
    if longest < shortest:
        return None
    masses, zeta = np.geomspace(high[0], low[0], _MASSES), np.clip(damping, low[2], high[2])
    lengths = np.geomspace(longest, shortest, _LENGTHS if longest > shortest else 1)
    designs = np.array([(mu, lam, zeta) for lam in lengths for mu in masses])
    keeps = problem.possible(designs, angle if swing is None else swing)
    # A cavity admits a light bob on a long rod, or a heavy bob on a shorter one, and the mass matters more.
    mu, lam, _ = designs.T
    return designs[np.argmax(keeps * np.sqrt(mu) * np.cbrt(lam))] if keeps.any() else None


def rule_of_thumb(problem: Problem, progress: Progress = unreported) -> np.ndarray | None:
    """Return the first guess with the largest mass that keeps all limits in runs, (3,); None without a guess.

    The guess assumes a bob angle. If the limits depend on this angle, the damper is the strongest one of the
    space, because a heavier bob is worth more than a weaker damper, and bisection finds the smallest assumed
    angle for which the guess keeps the limits. Only the limited quantities count, in runs of the nonlinear
    equations that the validation does not use, with the distance from the limits that the number of runs
    requires.
    """
    guess, at_rest, runs = first_guess(problem), first_guess(problem, 0.0), 0

    def keeps(design: np.ndarray) -> bool:
        nonlocal runs
        progress("rule of thumb", runs := runs + 1, _STEPS + 2)
        of = problem.validation_runs(design, problem.run_seed(1, 1))
        sizes = problem.sizes_in_runs(design, of).values()
        # A quantity that is unknown is no limit that is kept.
        return all(len(x) and quantile_of(x, problem.safe_level) <= 1.0 for x in sizes)

    # A guess that is also the one for a bob at rest does not depend on the assumed angle.
    if at_rest is None or (guess is not None and np.array_equal(guess, at_rest) and keeps(guess)):
        return guess
    *_, damped = problem.space.ends[1].tolist()
    low, high = 0.0, 2.0 * problem.rule_sizes[-1]
    best = None
    for _ in range(_STEPS):
        # The angle of the rule comes first, because it is in the middle.
        middle = 0.5 * (low + high)
        design = first_guess(problem, middle, damped)
        if design is None:
            high = middle
        elif keeps(design):
            best, high = design, middle
        else:
            low = middle
    return guess if best is None else best


def follow_guess(problem: Problem, quoted: PairedRuns) -> FirstGuess | None:
    """Return the guess in the validation runs that the report quotes; None if there is no guess.

    Under ground motions `Design.rule` has these runs.
    """
    guess = first_guess(problem)
    if guess is None:
        return None
    # Runs of the search records and runs without a result are not among those that the report quotes.
    runs = problem.validation_runs(guess, quoted.with_pendulum.seed).of(quoted.rows)
    return FirstGuess(problem.pendulum(guess), runs, *problem.over_limit(guess, runs))
