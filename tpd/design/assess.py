"""The block alone: whether an excitation lifts, slides or overturns it, and what helps without a pendulum."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.runs import Runs
from tpd.answers.statistics import Share
from tpd.core.formatting import Printed, number
from tpd.core.progress import Progress, shown, unreported
from tpd.design.optimise import problem_of
from tpd.design.problem import Problem
from tpd.design.reasons import DesignStatus
from tpd.records.intensity import spectral_acceleration
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Block, Scene
from tpd.theory.no_uplift import AtRest

_ISOLATION = np.geomspace(0.5, 8.0, 15)
"""Periods (s) of a base isolation that are compared under ground motions."""


class Alternatives(NamedTuple):
    """Estimates of what keeps the block on its base without a pendulum, by statics and for a rigid block."""

    tie: float
    """Horizontal force (N) that a tie at the top has to hold: it replaces the moment that the weight lacks,
    M g (f - nu - k)/2 for a height of 2 b, by (5) with the largest acceleration f."""
    width: float
    """Width of the base (m) with which the excitation does not lift the block, (f - k) times the height."""
    friction: float
    """Coefficient of friction with which the wider base does not slide, f."""
    isolation: float
    """Least period (s) of a base isolation that passes on less acceleration than lifts the block. Under a
    harmonic of the period T it is T sqrt(1 + f/(nu + k)), undamped. Under ground motions the response
    spectrum with 5 % damping stays below from this period on. NaN if 8 s is not enough."""

    def __str__(self) -> str:
        force = f"{number(self.tie / 1e3, 2)} kN" if self.tie >= 1e3 else f"{number(self.tie, 2)} N"
        tie = f"a tie at the top for {force}"
        least = f"with a coefficient of friction of at least {number(self.friction, 2)}"
        width = f"a base {number(self.width, 2)} m wide {least}"
        if not math.isfinite(self.isolation):
            return f"{tie}, or {width}; no base isolation of up to 8 s is enough (static estimates)"
        period = f"a base isolation with a period of at least {number(self.isolation, 2)} s"
        return f"{tie}, {width}, or {period} (static estimates)"


def alternatives(problem: Problem) -> Alternatives:
    """Estimate what keeps the block of a problem on its base without a pendulum."""
    block, alone, motions = problem.scene.block, problem.at_rest, problem.conditions.motions
    lacking = max(alone.peak - alone.uplift, 0.0)
    tie = 0.5 * float(block.mass * problem.scene.gravity) * lacking
    if not motions:
        lowest = float(problem.scene.motion.frequency * np.min(problem.conditions.column("frequency")))
        isolation = math.sqrt(1.0 + alone.peak / alone.uplift) / lowest
    else:
        # In units of each motion's own peak, so that the scale of a condition does not matter.
        strongest = alone.peak * float(problem.scene.gravity)
        passed = [
            max(spectral_acceleration(m, t) / float(m.pga) for m in motions) * strongest for t in _ISOLATION
        ]
        above = np.flatnonzero(np.array(passed) > alone.uplift * float(problem.scene.gravity))
        first = above[-1] + 1 if len(above) else 0
        isolation = float(_ISOLATION[first]) if first < len(_ISOLATION) else math.nan
    width = float(block.height) * (alone.peak - float(block.friction))
    return Alternatives(tie, width, alone.peak, isolation)


@dataclass(frozen=True, kw_only=True, repr=False)
class Assessment(Printed):
    """The block alone under an excitation."""

    problem: Problem
    runs: Runs | None
    """Runs of the nonlinear equations without a pendulum; None if the excitation does not lift the block."""

    @property
    def at_rest(self) -> AtRest:
        """When the resting block lifts, and whether it slides."""
        return self.problem.at_rest

    @property
    def overturned(self) -> Share | None:
        """Share of the runs in which the block overturns; None without runs."""
        return None if self.runs is None else self.runs.share_overturned

    @property
    def alternatives(self) -> Alternatives:
        """Measures that keep the block on its base without a pendulum."""
        return alternatives(self.problem)

    @property
    def verdict(self) -> str:
        """Whether the block stays at rest, slides, rocks or overturns, in a sentence."""
        share = self.overturned
        if self.runs is None or share is None:
            return needless(self.problem)
        known, tilt = int(np.sum(~self.runs.is_unanswered)), self.runs.severity
        if known == 1 and share.value > 0.0:
            return "OVERTURNS in the only run without a pendulum."
        if share.value > 0.0:
            interval = f"95 % interval {100 * share.low:.0f} to {100 * share.high:.0f} %"
            return f"OVERTURNS in {100 * share.value:.1f} % of {known} runs without a pendulum ({interval})."
        runs = "the only run" if known == 1 else f"any of {known} runs"
        most = f"at most {100 * float(np.nanmax(tilt)):.0f} % of the tilt at which it topples"
        return f"ROCKS, AND DOES NOT OVERTURN in {runs} without a pendulum: its tilt is {most}."

    def __str__(self) -> str:
        lines = [str(self.at_rest), self.verdict]
        if self.runs is not None:
            lines.append(f"Any one of these prevents uplift without a pendulum: {self.alternatives}.")
        return "\n".join(lines)


def needless(problem: Problem) -> str:
    """Return the sentence on a block that the excitation does not make rock, with its margin."""
    status, alone = problem.needs_none, problem.at_rest
    if status is DesignStatus.slides:
        at, uplift = number(alone.base_friction or 0.0, 2), number(alone.uplift, 2)
        return f"{status.value} It slides at {at} g, and lifts at {uplift} g. {status.remedy}"
    needed, push = DesignStatus.no_uplift.value.split(". ", 1)
    times = number(alone.margin, 2)
    return f"{needed}, and an excitation that is {times} times as strong would lift it. {push}"


def assess(
    scene: Scene | Block,
    *,
    conditions: Conditions | None = None,
    progress: Progress | bool | None = None,
    **settings: Any,
) -> Assessment:
    """Follow the block without a pendulum under one or many conditions.

    Args:
        scene: block and base motion; under ground motions a block alone is enough.
        conditions: default `Conditions.around(scene)`; ground motions by `Conditions.records`.
        progress: True for a bar on stderr, or called with (stage, done, of how many).
        settings: further arguments of `tpd.optimise`, such as ensemble and seed. Limits have no effect.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.

    Examples:
        >>> statue = tpd.Block(width=0.5, height=1.5, mass=900.0)
        >>> found = tpd.assess(tpd.Scene(statue, tpd.Harmonic(amplitude=0.003, frequency=2.0)))
        >>> round(found.at_rest.margin, 1)
        6.6
    """
    problem = problem_alone(scene, conditions=conditions, **settings)
    with shown(progress) as report:
        return assessed(problem, report)


def problem_alone(scene: Scene | Block, *, conditions: Conditions | None, **settings: Any) -> Problem:
    """Return the problem of a block without a pendulum; see `assess`."""
    # No bob needs any room, and no motion has to be held out for a validation.
    given: dict[str, Any] = settings | {"limits": (), "conditions": conditions}
    if (
        conditions is not None
        and conditions.motions
        and not isinstance(given.get("validation_share"), Mapping)
    ):
        given["validation_share"] = 0.0
    return problem_of(scene, **given)


def assessed(problem: Problem, progress: Progress = unreported) -> Assessment:
    """Follow the block of a problem without a pendulum."""
    if problem.needs_none is not None:
        return Assessment(problem=problem, runs=None)
    seed, after = problem.run_seed(_STAGE), partial(progress, "runs without a pendulum")
    return Assessment(problem=problem, runs=problem.runs_alone(seed, after))


_STAGE = 21
"""Number of the runs of an assessment, see `Problem.run_seed`."""
