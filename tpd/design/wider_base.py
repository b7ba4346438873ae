"""Block without a pendulum on a wider base, as the alternative with which a pendulum must be compared.

The wider blocks are followed in the validation runs of the design: the same excitation in SI units, the same
initial states and the same scatter. `tpd.Block.widened` says how a block becomes wider.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.answers.statistics import LEVEL, added_up
from tpd.core.progress import Progress, unreported
from tpd.design.problem import Problem
from tpd.scene.scene import Block

USUAL, _NARROWER, _WIDER = 0.2, (0.05, 0.1), (0.35, 0.5)
"""Relative widenings of the base. The wider bases are followed only if the usual one is not worth as much as
the pendulum, and otherwise the narrower ones."""
_SAMPLES = 1000
"""Number of bootstrap samples."""


class WiderBase(NamedTuple):
    """Block without a pendulum on a wider base, in the validation runs of a design."""

    widening: float
    """Relative increase of the width."""
    block: Block
    """Wider block."""
    runs: PairedRuns
    """Runs of the wider block as `with_pendulum`, and of the stated block as `without_pendulum`."""


class Worth(NamedTuple):
    """Widening of the base with which the block without a pendulum does as well as the stated block with
    it."""

    widening: float
    """Relative increase of the width; 0 if the pendulum does not help, and infinite if it is more than
    `most`."""
    low: float
    """Lower end of the 95 % interval, by a paired bootstrap."""
    high: float
    """Upper end of the interval."""
    most: float
    """Largest widening that was followed."""
    measure: str
    """Measure that is equal, "overturning" or "tilt"."""
    decided: bool = False
    """Whether the same runs decided that the pendulum is recommended. The interval does not allow for it."""


def wider_bases(
    problem: Problem, runs: PairedRuns, measure: str = "", progress: Progress = unreported
) -> tuple[WiderBase, ...]:
    """Follow the block without a pendulum on wider bases, in validation runs of a design.

    A base that would make the block too wide for the equations is left out.

    Args:
        problem: problem of the design.
        runs: validation runs that the report quotes.
        measure: measure by which the pendulum was chosen; empty if no pendulum is recommended.
        progress: function of (stage, bases done, total).
    """
    bases = list[WiderBase]()

    def add(widening: float) -> None:
        progress("wider bases", len(bases), 3)
        try:
            block = problem.scene.block.widened(1.0 + widening)
        except ValueError:
            # The equations do not hold for a block that is too wide.
            return
        # The seed is that of the quoted runs, which have the same initial states and the same scatter.
        alone = problem.with_block(block).validation_runs(None, runs.with_pendulum.seed)
        bases.append(WiderBase(widening, block, replace(runs, with_pendulum=alone, passed=None)))

    def is_short() -> bool:
        worth = worth_of(runs, measure, bases)
        return worth is not None and math.isinf(worth.widening)

    # Few widths are followed, because each takes as long as a part of the validation.
    add(USUAL)
    for widening in _WIDER if is_short() else _NARROWER:
        if widening < USUAL or is_short():
            add(widening)
    return tuple(sorted(bases, key=lambda base: base.widening))


def worth_of(runs: PairedRuns, measure: str, bases: Sequence[WiderBase]) -> Worth | None:
    """Return the widening of the base that is worth as much as the pendulum of paired runs.

    The measure is interpolated linearly between the bases. The narrowest base that is as good counts. The
    bootstrap draws the independent runs, or the earthquakes, again, for all bases and the pendulum together.
    The result is None without a measure, and without a base or a run that has an answer in all cases.
    """
    if not (measure and bases):
        return None
    # Columns: with the pendulum, as it is, and on each wider base.
    cases = [runs.with_pendulum, runs.without_pendulum, *(base.runs.with_pendulum for base in bases)]
    values = np.array([x.severity if measure == "tilt" else 1.0 * x.is_overturned for x in cases])
    # A run counts only if it has an answer in all cases.
    rows = ~np.any([x.is_unanswered for x in cases], axis=0)
    rows &= True if runs.counted is None else runs.counted
    sums = added_up(values.T[rows], None if runs.cluster is None else runs.cluster[rows])
    if not (n := len(sums)):
        return None
    rng, widths = np.random.default_rng(runs.with_pendulum.seed), [0.0, *(base.widening for base in bases)]
    # The first sample is that of the runs themselves.
    weights = np.concatenate([np.ones((1, n)), rng.multinomial(n, np.full(n, 1.0 / n), _SAMPLES)])
    # A wider base counts as at least as good as a narrower one. The slight slope makes the values increase
    # for the interpolation, and selects the first of equal ones.
    slope = 1e-9 * np.arange(len(widths))
    samples = [
        np.interp(-pendulum, slope - np.minimum.accumulate(others), widths, right=np.inf)
        for pendulum, *others in weights @ sums
    ]
    low, high = np.quantile(samples[1:], [0.5 * (1.0 - LEVEL), 0.5 * (1.0 + LEVEL)], method="nearest")
    return Worth(float(samples[0]), float(low), float(high), widths[-1], measure, runs.passed is not None)
