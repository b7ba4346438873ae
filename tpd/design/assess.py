"""Assessment of the block without a pendulum: whether an excitation makes it slide, rock or overturn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.motion_history import sliding
from tpd.answers.run_table import Runs
from tpd.answers.statistics import Share
from tpd.core.formatting import Printed, ends, number, percent
from tpd.core.progress import Progress, bar_for, unreported
from tpd.design.alternatives import Alternatives, alternatives
from tpd.design.first_guess import first_guess
from tpd.design.optimise import problem_of
from tpd.design.problem import Problem
from tpd.design.validate import run_seed
from tpd.scene.conditions import MEASURE_NAMES, Conditions
from tpd.scene.scene import Block, Scene
from tpd.theory.no_uplift import AtRest


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
    def sentences(self) -> list[str]:
        """Sentences on whether the block stays at rest, slides, rocks or overturns: the stated block first,
        then the blocks that vary, at each level of the excitation, and the annual rate of overturning."""
        if self.runs is None or self.stated is None:
            return [self.problem.needless]
        problem = self.problem
        scatter = f"scatter ({problem.scatter_in_words(without_pendulum=True)})"
        varied = f"{'Runs from rest' if problem.has_earthquakes else 'Validation runs'} with {scatter}"
        first, lines = problem.first_overturning(self.runs), list[str]()
        for name, runs in (("Stated block from rest", self.stated), (varied, self.runs)):
            # The conditions of a harmonic and pulses are no sample, so their share has no interval.
            is_sample = not first if problem.has_earthquakes else runs is self.runs
            lines.append(f"{name}: {_outcome(runs, is_sample)}.")
        # Pulses have few runs at each level.
        if problem.levels and not first:
            head = "share of the runs that overturn, stated block (block that varies)"
            lines.append(f"{MEASURE_NAMES[problem.conditions.intensity]}: {head}")
            for name, rows in problem.levels.items():
                shares = (percent(x.of(rows).share_overturned.value, 1) for x in (self.stated, self.runs))
                lines.append("  {}: {} ({})".format(name, *shares))
        # The share depends much on the start, and a structure is at rest before it is shaken.
        starts = self.runs.starts if len(self.runs.starts) > 1 else {}
        for kind, rows in starts.items():
            lines.append(f"Of these runs, {kind}: {_outcome(self.runs.of(rows), True)}.")
        more = [first[0].upper() + first[1:]] if first else []
        lines += [f"{text}." for text in (*more, *problem.yearly(problem.annual_rates([self.runs])))]
        friction = sliding(problem.scene, problem.stated_motions)
        # If the base slides, the runs do not describe the block.
        lines.insert(0 if friction.slides else len(lines), friction.sentence)
        return lines

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
        mass, length, zeta = (number(x, 2) for x in values)
        return (
            f"Rule of thumb for a pendulum, without a search: an equivalent point mass of {mass} kg on a rod "
            f"of {length} m with a damping ratio of {zeta}. Only `tpd optimise` and `tpd check` validate it."
        )

    def __str__(self) -> str:
        return "\n".join(filter(None, (str(self.at_rest), *self.sentences, self.measures, self.guess)))


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
        >>> round(assessment.at_rest.safety_factor, 1)
        5.7
    """
    problem = problem_alone(scene, conditions=conditions, **settings)
    with bar_for(progress) as report:
        return assessed(problem, report)


def problem_alone(scene: Scene | Block, *, conditions: Conditions | None, **settings: Any) -> Problem:
    """Return the problem of a block without a pendulum; see `assess` for the arguments."""
    inputs: dict[str, Any] = settings | {"conditions": conditions}
    # Without a cavity there is no clearance, and the rule of thumb has a bob without size.
    block = scene if isinstance(scene, Block) else scene.block
    if block.cavity_width is None and block.frame_width is None:
        inputs["limits"] = ()
    # No search uses the motions, so that none of them is held out.
    if not isinstance(settings.get("validation_share"), Mapping):
        inputs["validation_share"] = None
    return problem_of(scene, **inputs)


def assessed(problem: Problem, progress: Progress = unreported) -> Assessment:
    """Simulate the block of a problem without a pendulum."""
    if problem.needs_none is not None:
        return Assessment(problem=problem, stated=None, runs=None)
    # These seeds are those of the first validation runs that `optimise` and `check` quote.
    seed = run_seed(problem, 0, int(not problem.has_earthquakes))
    motions = problem.stated_motions
    how = {"factors": np.ones((len(motions), 1)), "progress": partial(progress, "stated block")}
    stated = problem.runs_under([None], motions, **how).reshape(len(motions))
    runs = problem.validation_runs(None, seed, progress=partial(progress, "runs without a pendulum"))
    return Assessment(problem=problem, stated=replace(stated, cluster=problem.earthquakes), runs=runs)
