"""Assessment of the block without a pendulum: whether an excitation makes it slide, rock or overturn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.motion_history import sliding
from tpd.answers.run_table import Runs, follow_scaled
from tpd.answers.statistics import Share
from tpd.answers.transient import FREE
from tpd.core.formatting import Printed, ends, number, percent
from tpd.core.progress import Progress, shown, unreported
from tpd.design.first_guess import first_guess
from tpd.design.ground_motion import PERIODS
from tpd.design.optimise import problem_of
from tpd.design.problem import Problem
from tpd.design.validate import run_seed
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import events_of
from tpd.scene.scene import Block, Scene
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import SLIDES, AtRest

_WIDEST = 2.0
"""Largest width of a base that is an alternative, over the width of the block. A coefficient of friction
above 1 is no alternative either."""


class Alternatives(NamedTuple):
    """Estimates of what keeps the block on its base without a pendulum, from statics of a rigid block."""

    tie: float
    """Horizontal force (N) of a tie at the top of the block. The tie supplies the moment that the weight
    lacks: M g (f - nu - k)/2 for a block of height 2 b, from (5) with the largest acceleration f."""
    width: float
    """Width of the base (m) with which the excitation does not lift the block: (f - k) times the height."""
    friction: float
    """Coefficient of friction with which the wider base does not slide: f."""
    present: float
    """Width of the block (m)."""
    periods: np.ndarray
    """Smallest period (s) of a base isolation that transmits less acceleration than lifts the block, for each
    motion at its strongest level. Under ground motions it is the period from which on the response spectrum
    stays below the uplift acceleration; infinite if 8 s is not enough. Under a harmonic of period T it is
    T sqrt(1 + f/(nu + k)), for the lowest frequency only."""
    damping: float
    """Damping ratio of the isolation: 0.05 under ground motions, 0 under a harmonic."""
    acceleration: float
    """Acceleration (m/s^2) that lifts the block."""

    @property
    def isolation(self) -> float:
        """Largest of `periods`."""
        return float(np.max(self.periods))

    def displacement(self, period: float) -> float:
        """Return the displacement (m) of the isolated block relative to the ground, which is the spectral
        displacement at one of `periods`."""
        return self.acceleration * (period / (2.0 * math.pi)) ** 2

    def _isolation(self, period: float) -> str:
        if not math.isfinite(period):
            return f"more than {PERIODS[1]:g} s"
        return f"at least {_at_least(period)} s (displacement {_at_least(self.displacement(period))} m)"

    def __str__(self) -> str:
        force = f"{_at_least(self.tie / 1e3)} kN" if self.tie >= 1e3 else f"{_at_least(self.tie)} N"
        friction = f"with a coefficient of friction of at least {_at_least(self.friction)}"
        kind = f"a base isolation with {100.0 * self.damping:g} % damping and"
        kind = kind if self.damping else "an undamped base isolation with"
        isolation = f"{kind} a period of {self._isolation(self.isolation)}"
        if (n := len(self.periods)) > 1:
            isolation += (
                f" for all {n} motions, or {self._isolation(float(np.median(self.periods)))} for half"
            )
        tie = f"a tie at the top for at least {force}"
        if self.friction > 1.0 or self.width > _WIDEST * self.present:
            return f"{tie}, or {isolation} (static estimates); no wider base prevents uplift"
        width = f"a base at least {_at_least(self.width)} m wide {friction}"
        return f"{tie}, {width}, or {isolation} (static estimates)"


def _at_least(x: float) -> str:
    """Format a required value with two significant digits, rounded up."""
    place = 10.0 ** (math.floor(math.log10(x)) - 1) if x > 0.0 else 1.0
    # Rounding must not raise a value that already has two digits.
    return number(math.ceil(x / place - 1e-9) * place, 2)


def alternatives(problem: Problem) -> Alternatives:
    """Estimate what keeps the block of a problem on its base without a pendulum."""
    block, alone, gravity = problem.scene.block, problem.at_rest, float(problem.scene.gravity)
    lifts = alone.uplift * gravity
    periods, damping = problem.isolation()
    tie = 0.5 * float(block.mass) * gravity * max(alone.peak - alone.uplift, 0.0)
    # The block rocks on the same share of a wider base.
    width = float(block.height) * (alone.peak - float(block.friction)) * float(block.width / block.base_width)
    return Alternatives(tie, width, alone.peak, float(block.width), periods, damping, lifts)


@dataclass(frozen=True, kw_only=True, repr=False)
class Assessment(Printed):
    """Behaviour of the block without a pendulum under an excitation. `print` shows the verdict."""

    problem: Problem
    """Block, excitation and conditions."""
    stated: Runs | None
    """Runs of the nonlinear model of the stated block from rest, one under each excitation; None if no
    excitation lifts the block."""
    runs: Runs | None
    """Validation runs of the nonlinear model without a pendulum, in which the block varies; None if no
    excitation lifts the block."""

    @property
    def at_rest(self) -> AtRest:
        """Accelerations at which the resting block lifts and slides, compared with the excitation."""
        return self.problem.at_rest

    @property
    def overturned(self) -> Share | None:
        """Share of the validation runs in which the block overturns; None if there are no runs."""
        return None if self.runs is None else self.runs.share_overturned

    @property
    def alternatives(self) -> Alternatives:
        """Measures that keep the block on its base without a pendulum."""
        return alternatives(self.problem)

    @property
    def verdict(self) -> str:
        """Lines on whether the block stays at rest, slides, rocks or overturns: the stated block first, then
        the blocks that vary, at each level of the excitation, and the annual rate of overturning."""
        if self.runs is None or self.stated is None:
            return self.problem.needless
        problem = self.problem
        scatter = f"scatter ({problem.scatter_in_words(without_pendulum=True)})"
        varied = f"{problem.begin_of_runs} {scatter}"
        lines, levels = list[str](), {f" at {name}": rows for name, rows in problem.levels.items()}
        for name, runs in (("Stated block from rest", self.stated), (varied, self.runs)):
            # The conditions of a harmonic are no sample, so their share has no interval.
            is_sample = problem.has_earthquakes or runs is self.runs
            for at, rows in levels.items() or [("", slice(None))]:
                lines.append(f"{name}{at}: {_outcome(runs.of(rows), is_sample)}.")
        # The share depends much on the start, and a structure is at rest before it is shaken.
        starts = self.runs.starts if len(self.runs.starts) > 1 else {}
        for kind, rows in starts.items():
            lines.append(f"Of these runs, {kind}: {_outcome(self.runs.of(rows), True)}.")
        lines += [f"{text}." for text in problem.yearly(problem.annual_rates([self.runs]))]
        lines.append(sliding(problem.scene, problem.stated_motions))
        # If the base slides, the runs do not describe the block.
        return "\n".join(sorted(lines, key=lambda line: not line.startswith(SLIDES)))

    @property
    def measures(self) -> str:
        """Sentence with the alternatives to a pendulum; empty if the block needs none."""
        if self.runs is None:
            return ""
        return f"Each of these measures prevents uplift without a pendulum: {self.alternatives}."

    @property
    def guess(self) -> str:
        """Sentence with the pendulum of a rule of thumb; empty if the block needs none or none fits."""
        design = None if self.runs is None else first_guess(self.problem)
        if design is None:
            return ""
        pendulum = self.problem.pendulum(design)
        values = pendulum.mass, pendulum.length, pendulum.damping_ratio
        mass, length, zeta = (number(float(x), 2) for x in values)
        return (
            f"Rule of thumb for a pendulum, without a search: an equivalent point mass of {mass} kg on a rod "
            f"of {length} m with a damping ratio of {zeta}. Only `tpd optimise` and `tpd check` validate it."
        )

    def __str__(self) -> str:
        return "\n".join(filter(None, (str(self.at_rest), self.verdict, self.measures, self.guess)))


def _outcome(runs: Runs, is_sample: bool) -> str:
    """Return a clause on whether a block without a pendulum overturns, rocks or stays on its base."""
    answered = ~runs.is_unanswered
    share, count = runs.share_overturned, int(np.sum(answered))
    if not count:
        return "no run has a result"
    every = "the only run" if count == 1 else f"any of {count} runs"
    if share.value > 0.0:
        of = every if count == 1 else f"{percent(share.value, 1)} of {count} runs"
        events = 0 if runs.cluster is None else len(np.unique(runs.cluster))
        over = f" over {events} earthquake{'s' * (events != 1)}" if events else ""
        around = f" (95 % interval{over} {ends(share.low, share.high)})" if is_sample and count > 1 else ""
        return f"OVERTURNS in {of}{around}"
    if not runs.is_lifted.any():
        return f"STAYS ON ITS BASE in {every}"
    # The runs are nonlinear: the toppling angle is that of the geometry.
    tilt = percent(float(np.max(runs.tilt[answered] / np.arctan(runs.nu[answered]))))
    most = "" if count == 1 else "at most "
    return f"ROCKS, AND DOES NOT OVERTURN in {every}: its tilt is {most}{tilt} of the toppling angle"


def assess(
    scene: Scene | Block,
    *,
    conditions: Conditions | None = None,
    progress: Progress | bool | None = None,
    **settings: Any,
) -> Assessment:
    """Simulate the block without a pendulum under one or many conditions.

    Args:
        scene: block and excitation. Under ground motions a block alone is sufficient.
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
    inputs: dict[str, Any] = settings | {"conditions": conditions}
    # Without a cavity there is no clearance, and the rule of thumb has a bob without size.
    block = scene if isinstance(scene, Block) else scene.block
    if block.cavity_width is None:
        inputs["limits"] = ()
    # The groups of motions are those of `optimise`, which gives the same runs. A single earthquake cannot be
    # divided.
    motions = () if conditions is None else conditions.motions
    if (
        motions
        and len(set(events_of(motions))) == 1
        and not isinstance(settings.get("validation_share"), Mapping)
    ):
        inputs["validation_share"] = 0.0
    return problem_of(scene, **inputs)


def assessed(problem: Problem, progress: Progress = unreported) -> Assessment:
    """Simulate the block of a problem without a pendulum."""
    if problem.needs_none is not None:
        return Assessment(problem=problem, stated=None, runs=None)
    # These seeds are those of the first validation runs that `optimise` and `check` quote.
    seed = run_seed(problem, 0, int(problem.has_validation_runs))
    motions = problem.stated_motions
    stated = follow_scaled(
        problem.scene.block,
        [None],
        motions,
        np.ones((len(motions), 1)),
        gravity=float(problem.scene.gravity),
        free=FREE,
        equations=Terms.nonlinear,
        progress=partial(progress, "stated block"),
    ).reshape(len(motions))
    runs = problem.validation_runs(None, seed, partial(progress, "runs without a pendulum"))
    return Assessment(problem=problem, stated=replace(stated, cluster=problem.earthquakes), runs=runs)
