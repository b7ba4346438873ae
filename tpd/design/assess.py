"""Assessment of the block without a pendulum: whether an excitation makes it slide, rock or overturn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.runs import Runs
from tpd.answers.statistics import Share
from tpd.core.formatting import Printed, compared, number
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
    """Estimates of what keeps the block on its base without a pendulum, from statics of a rigid block."""

    tie: float
    """Horizontal force (N) of a tie at the top of the block. The tie supplies the moment that the weight
    lacks: M g (f - nu - k)/2 for a block of height 2 b, from (5) with the largest acceleration f."""
    width: float
    """Width of the base (m) with which the excitation does not lift the block: (f - k) times the height."""
    friction: float
    """Coefficient of friction with which the wider base does not slide: f."""
    isolation: float
    """Smallest period (s) of a base isolation that transmits less acceleration than lifts the block. Under a
    harmonic of period T it is T sqrt(1 + f/(nu + k)), undamped. Under ground motions it is the period from
    which on the response spectrum with 5 % damping stays below the uplift acceleration. NaN if 8 s is not
    enough."""

    def __str__(self) -> str:
        force = f"{_at_least(self.tie / 1e3)} kN" if self.tie >= 1e3 else f"{_at_least(self.tie)} N"
        tie = f"a tie at the top for at least {force}"
        least = f"with a coefficient of friction of at least {_at_least(self.friction)}"
        width = f"a base at least {_at_least(self.width)} m wide {least}"
        if not math.isfinite(self.isolation):
            return f"{tie}, or {width}; no base isolation of up to 8 s is enough (static estimates)"
        period = f"a base isolation with a period of at least {_at_least(self.isolation)} s"
        return f"{tie}, {width}, or {period} (static estimates)"


def _at_least(x: float) -> str:
    """Format a required value with two significant digits, rounded up."""
    place = 10.0 ** (math.floor(math.log10(x)) - 1) if x > 0.0 else 1.0
    # Rounding must not raise a value that already has two digits.
    return number(math.ceil(x / place - 1e-9) * place, 2)


def alternatives(problem: Problem) -> Alternatives:
    """Estimate what keeps the block of a problem on its base without a pendulum."""
    block, alone, motions = problem.scene.block, problem.at_rest, problem.conditions.motions
    lacking = max(alone.peak - alone.uplift, 0.0)
    tie = 0.5 * float(block.mass * problem.scene.gravity) * lacking
    if not motions:
        lowest = float(problem.scene.motion.frequency * np.min(problem.conditions.column("frequency")))
        isolation = math.sqrt(1.0 + alone.peak / alone.uplift) / lowest
    else:
        # Each motion is divided by its own peak, so that the scale of a condition does not matter.
        strongest = alone.peak * float(problem.scene.gravity)
        passed = [
            max(spectral_acceleration(m, t) / float(m.pga) for m in motions) * strongest for t in _ISOLATION
        ]
        # A spectrum may fall and rise again: the period must lie behind the last one above the threshold.
        above = np.flatnonzero(np.array(passed) > alone.uplift * float(problem.scene.gravity))
        first = above[-1] + 1 if len(above) else 0
        isolation = float(_ISOLATION[first]) if first < len(_ISOLATION) else math.nan
    width = float(block.height) * (alone.peak - float(block.friction))
    return Alternatives(tie, width, alone.peak, isolation)


@dataclass(frozen=True, kw_only=True, repr=False)
class Assessment(Printed):
    """Behaviour of the block without a pendulum under an excitation. `print` shows the verdict."""

    problem: Problem
    """Block, excitation and conditions."""
    runs: Runs | None
    """Runs of the nonlinear equations without a pendulum; None if the excitation does not lift the block."""

    @property
    def at_rest(self) -> AtRest:
        """Accelerations at which the resting block lifts and slides, compared with the excitation."""
        return self.problem.at_rest

    @property
    def overturned(self) -> Share | None:
        """Share of the runs in which the block overturns; None if there are no runs."""
        return None if self.runs is None else self.runs.share_overturned

    @property
    def alternatives(self) -> Alternatives:
        """Measures that keep the block on its base without a pendulum."""
        return alternatives(self.problem)

    @property
    def verdict(self) -> str:
        """Sentence on whether the block stays at rest, slides, rocks or overturns."""
        share = self.overturned
        if self.runs is None or share is None:
            return needless(self.problem)
        count, tilt = int(np.sum(~self.runs.is_unanswered)), self.runs.severity
        if count == 1 and share.value > 0.0:
            return "OVERTURNS in the only run without a pendulum."
        if share.value > 0.0:
            interval = f"95 % interval {100 * share.low:.0f} to {100 * share.high:.0f} %"
            return f"OVERTURNS in {100 * share.value:.1f} % of {count} runs without a pendulum ({interval})."
        runs = "the only run" if count == 1 else f"any of {count} runs"
        most = f"at most {100 * float(np.nanmax(tilt)):.0f} % of the tilt at which it topples"
        return f"ROCKS, AND DOES NOT OVERTURN in {runs} without a pendulum: its tilt is {most}."

    def __str__(self) -> str:
        lines = [str(self.at_rest), self.verdict]
        if self.runs is not None:
            lines.append(f"Any one of these prevents uplift without a pendulum: {self.alternatives}.")
        return "\n".join(lines)


def needless(problem: Problem) -> str:
    """Return the sentence about a block that does not rock under the excitation, with its margin."""
    status, alone = problem.needs_none, problem.at_rest
    if status is DesignStatus.slides:
        at, uplift = compared(alone.base_friction or 0.0, alone.uplift)
        return f"{status.value} It slides at {at} g, and lifts at {uplift} g. {status.remedy}"
    # The margin belongs between the two sentences of the status.
    verdict, after_push = DesignStatus.no_uplift.value.split(". ", 1)
    times, _ = compared(alone.margin, 1.0)
    return f"{verdict}, and an excitation that is {times} times as strong would lift it. {after_push}"


def assess(
    scene: Scene | Block,
    *,
    conditions: Conditions | None = None,
    progress: Progress | bool | None = None,
    **settings: Any,
) -> Assessment:
    """Simulate the block without a pendulum under one or many conditions.

    Args:
        scene: block and base motion. Under ground motions a block alone is sufficient.
        conditions: default `Conditions.around(scene)`; for ground motions `Conditions.records`.
        progress: True for a progress bar on stderr, or a function of (stage, done, total).
        settings: further arguments of `tpd.optimise`, such as `ensemble` and `seed`. Limits have no effect.

    Raises:
        ValueError: an input is out of range, or does not fit the excitation.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> statue = tpd.Block(width=0.5, height=1.5, mass=900.0)
        >>> assessment = tpd.assess(tpd.Scene(statue, tpd.Harmonic(amplitude=0.003, frequency=2.0)))
        >>> round(assessment.at_rest.margin, 1)
        5.7
    """
    problem = problem_alone(scene, conditions=conditions, **settings)
    with shown(progress) as report:
        return assessed(problem, report)


def problem_alone(scene: Scene | Block, *, conditions: Conditions | None, **settings: Any) -> Problem:
    """Return the problem of a block without a pendulum; see `assess` for the arguments."""
    # Without a bob there is no clearance to check, and without a design no motion has to be kept for
    # validation.
    inputs: dict[str, Any] = settings | {"limits": (), "conditions": conditions}
    if (
        conditions is not None
        and conditions.motions
        and not isinstance(inputs.get("validation_share"), Mapping)
    ):
        inputs["validation_share"] = 0.0
    return problem_of(scene, **inputs)


def assessed(problem: Problem, progress: Progress = unreported) -> Assessment:
    """Simulate the block of a problem without a pendulum."""
    if problem.needs_none is not None:
        return Assessment(problem=problem, runs=None)
    seed, after = problem.run_seed(_STAGE), partial(progress, "runs without a pendulum")
    return Assessment(problem=problem, runs=problem.runs_alone(seed, after))


_STAGE = 21
"""Number that distinguishes the seeds of an assessment from those of other stages, see `Problem.run_seed`."""
