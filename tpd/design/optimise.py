"""The main function: find a pendulum for a scene, in three stages.

*Search*: under harmonic excitation descents on smoothed orbits minimise what remains of a disturbance, and
runs correct their limits (`tpd.design.corrections`). Under ground motions trial runs and a smoothing spline
lead to the best design (`tpd.design.refine`). *Validate* decides by paired runs that no other stage has used.

Under ground motions the answer begins with the rule of thumb, which needs no search: all earthquakes validate
it. The search is cross-fitted. Its pendulum replaces that of the rule only if the rule does not pass, or if
the cross-fitted benefit is significantly larger in the same runs.

`optimise_all` finds pendulums for many blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.attractors import Starts
from tpd.answers.ensemble import Ensemble
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular, counted
from tpd.core.progress import Progress, bar_for, count_for, unreported
from tpd.design.design import Design
from tpd.design.first_guess import first_guess, rule_of_thumb
from tpd.design.ground_motion import GroundMotionProblem
from tpd.design.harmonic import HarmonicProblem
from tpd.design.job import Job
from tpd.design.problem import Problem
from tpd.design.reasons import OFFERED, VALIDATED, DesignStatus
from tpd.design.risk import Risk
from tpd.design.settings import Descent, GroundSearch
from tpd.design.space import DesignSpace
from tpd.design.validate import Validation, validate
from tpd.limits import Limit, Objective, Requirements
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.scene import Block, Scene


@checks.keywords
def optimise(
    scene: Scene | Block | Job,
    space: DesignSpace | None = None,
    *,
    conditions: Conditions | None = None,
    starts: Starts | None = None,
    risk: Risk | None = None,
    limits: Iterable[Limit] | None = None,
    objective: Objective | None = None,
    method: Descent | GroundSearch | None = None,
    ensemble: Ensemble | None = None,
    requirements: Requirements | None = None,
    validation_share: checks.Real | Mapping[str, Sequence[GroundMotion]] | None = None,
    seed: checks.Whole | None = None,
    progress: Progress | bool | None = None,
) -> Design:
    """Find the pendulum that reduces rocking most under one or many conditions, and validate it.

    By default the conditions are a neighbourhood of the excitation of the scene: ±5 % in frequency and +10 %
    in amplitude. For ground motions pass `conditions=Conditions.records(...)`, see
    `tpd.design.ground_motion.GroundMotionProblem`.

    The search smooths signs and impacts. Diffrax integrates the equations (25) and their variational
    equations, and optax descends on the gradients of what remains of a small disturbance
    (`limits.Settling`). The last steps use exact orbits. Runs of the best design show how far the bob swings
    during transients, and the descents continue with limits that allow for it. Paired runs validate the
    design. They must show the benefit that `requirements` states, and no harm. At most three designs are
    validated, each by new runs, and a further one only if limits are the only reason against the last. Under
    ground motions all earthquakes first validate the pendulum of a rule of thumb. Then trial runs and a
    smoothing spline choose a design, which replaces it only if it is significantly better.

    Args:
        scene: block and excitation in SI units. Under ground motions a block alone is sufficient. A `Job`
            states all arguments, and its report contains the job file that repeats the search.
        space: bounds and fixed values of the pendulum, as ratios or in kg and m; default `DesignSpace()`.
        conditions: excitations for which the design must work; default `Conditions.around(scene)`.
        starts: initial states of the search. The default `Starts.any()` counts the largest motion that
            attracts. With `Starts.rest()` rest counts wherever the block can stay at rest.
        risk: measure over the conditions that the descents reduce; default `Risk.cvar()`. Under ground
            motions there are no descents, and the trial runs use it, by default `Risk.expected()`.
        limits: objects of `tpd.limits`; default `limits.DEFAULT_LIMITS`. `limits.POINT_BOB` has no walls.
        objective: quantity that the descents reduce under harmonic excitation; default what remains of a
            disturbance, `limits.Settling()`.
        method: settings of the search, `Descent(...)` or under ground motions `GroundSearch(...)`.
        ensemble: validation runs, which are distributed over the conditions; default `Ensemble(size=2048)`.
        requirements: smallest benefit and largest harm of a recommended pendulum; default `Requirements()`.
        validation_share: ground motions that the search does not use, as a share or as groups by name. By
            default all of them count, with cross-fitting.
        seed: seed of all random choices, also of the runs of an ensemble without a seed; default 0.
        progress: True for a progress bar on stderr, or a function of (stage, done, total).

    Returns:
        The design with its status, its trials and its validation runs.

    Raises:
        ValueError: an input is out of range, or does not fit the excitation.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=0.5, height=1.5, mass=900.0, cavity_width=0.4)
        >>> design = tpd.optimise(tpd.Scene(block, tpd.Harmonic(amplitude=0.003, frequency=2.0)))
        >>> print(design)
        NOT NEEDED: under all conditions the block without a pendulum stays at rest, and an excitation that is
            5.7 times as strong would lift it. After a strong enough push it may still rock or overturn.
    """
    inputs: dict[str, Any] = {"risk": risk, "limits": limits, "method": method, "ensemble": ensemble}
    inputs |= {"requirements": requirements, "seed": seed, "objective": objective, "starts": starts}
    problem = problem_of(scene, space, conditions=conditions, validation_share=validation_share, **inputs)
    with bar_for(progress) as report:
        return solve_problem(problem, report)


def problem_of(
    scene: Scene | Block | Job,
    space: DesignSpace | None = None,
    *,
    conditions: Conditions | None = None,
    **inputs: Any,
) -> Problem:
    """Return the problem that the arguments of `optimise` state.

    Raises:
        ValueError: an input is out of range, does not fit the excitation, or is stated beside a job.
    """
    if isinstance(scene, Job):
        stated = {"space": space, "conditions": conditions, **inputs}
        if more := [name for name, value in stated.items() if value is not None]:
            remedy = "pass `job.scene` and `**job.settings` to change some of them"
            raise ValueError(f"a job states all arguments, but `{more[0]}` is given as well: {remedy}")
        return replace(problem_of(scene.scene, **scene.settings), job=scene)
    checks.optional("conditions", conditions, Conditions)
    # Each kind of excitation has arguments of its own. A value for the other kind is an error, and None is
    # dropped, because the other class does not have the argument.
    kinds = {"harmonics": HarmonicProblem, "ground motions": GroundMotionProblem}
    here, there = kinds if conditions is None or not conditions.motions else reversed(kinds)
    for name in kinds[there].defaults:
        if name not in kinds[here].defaults and inputs.pop(name, None) is not None:
            raise ValueError(f"`{name}` is allowed only with {there}, but the conditions are {here}")
    return kinds[here].of(scene, space=space, conditions=conditions, **inputs)


def solve_problem(problem: Problem, progress: Progress = unreported) -> Design:
    """Search, refine and validate a design for a problem; see `optimise`."""
    if (status := problem.needs_none) is not None:
        return Design(problem=problem, status=status)
    rule, every = None, problem.of_all
    if problem.has_earthquakes and (guess := rule_of_thumb(every, progress)) is not None:
        rule = validate(every, guess, progress=progress)
    if getattr(problem.method, "method", "") == "rule":
        status = DesignStatus.none_feasible if rule is None else rule.status
        return Design(problem=problem, status=status, validated=() if rule is None else (rule,), rule=rule)
    how: dict[str, Any] = {"progress": progress, "crossed": _cross_fit(problem, progress)}
    if rule is not None and rule.deciding_runs is not None:
        how["without_pendulum"] = rule.deciding_runs.without_pendulum
    refinement = problem.improver(first_guess(problem), progress)
    status, validated = DesignStatus.none_feasible, list[Validation]()
    for attempt in range(problem.attempts):
        # A design next to a rejected one would most likely be rejected as well.
        design = refinement.best([v.design for v in validated])
        if design is None:
            break
        confirmed = sum(v.reported_runs is not None for v in validated)
        result = validate(problem, design, 0 if problem.has_earthquakes else attempt, confirmed, **how)
        validated.append(result)
        status = result.status
        if not result.reasons or not {reason.kind for reason in result.reasons} <= problem.retries:
            break
        if (runs := result.runs) is not None:
            refinement.learn(result.design, runs.with_pendulum)
    if rule is not None:
        replaces, last = rule.status not in OFFERED, validated[-1] if validated else None
        # A design of the search that passes must have a significantly larger reduction in the same runs.
        if last is not None and last.status in VALIDATED and last.runs is not None and rule.runs is not None:
            replaces |= last.runs.reduction_minus(rule.runs, rule.measure_of_runs).low > 0.0
        validated.insert(0 if replaces else len(validated), rule)
        status = status if replaces and len(validated) > 1 else rule.status
    best = validated[-1].design if validated and not validated[-1].reasons else None
    return Design(
        problem=problem,
        status=status,
        validated=tuple(validated),
        trials=refinement.trials(),
        search=refinement.search,
        equivalent=None if best is None else refinement.equivalent(best),
        rule=rule,
    )


_FEWEST = {"designs": 4, "steps": 0}
"""Smallest numbers of trials of a search of cross-fitting."""


def _cross_fit(problem: Problem, progress: Progress) -> np.ndarray | None:
    """Return the best design of the search for each group of earthquakes, without the group, as an array
    (groups, 3); None without cross-fitting.

    The searches have half of the trials. Their designs can only be worse for it, and the verdict is cautious.
    If no design keeps the limits, it is the first guess, and without one the smallest design of the space.
    """
    designs = []
    for whole, _ in problem.crossed:
        half = {name: max(least, getattr(whole.method, name) // 2) for name, least in _FEWEST.items()}
        other = replace(whole, method=replace(whole.method, **half))
        guess = first_guess(other)
        best = other.improver(guess, progress).best([])
        designs.append(best if best is not None else other.space.ends[0] if guess is None else guess)
    return np.array(designs) if designs else None


_SIZES = "mass", "length", "damping_ratio"
"""Numbers of a pendulum in the table of several designs."""


@dataclass(frozen=True, repr=False)
class Designs(Printed, Tabular):
    """Designs for n blocks, as arrays of shape (n,). Values are NaN where no pendulum is offered."""

    status: np.ndarray
    """Names of `DesignStatus`."""
    mass: np.ndarray
    """Mass of the bob, kg."""
    length: np.ndarray
    """Length of the pendulum, m."""
    damping_ratio: np.ndarray
    """Damping ratio of the hinge."""
    value: np.ndarray
    """Mean severity with the pendulum."""
    value_without: np.ndarray
    """Mean severity without a pendulum."""

    def __str__(self) -> str:
        return f"Designs for {len(self.status)} blocks: {counted(self.status)}"


def optimise_all(
    scenes: Sequence[Scene] | Sequence[Block],
    *,
    progress: Callable[[int, int], None] | bool | None = None,
    **settings: Any,
) -> Designs:
    """Find a pendulum for every scene; see `tpd.optimise`.

    Args:
        scenes: blocks with their excitation; under ground motions blocks alone.
        progress: True for a progress bar on stderr, or a function of (scenes done, total).
        settings: further arguments of `tpd.optimise`, the same for every scene.

    Raises:
        ValueError: an input is out of range, for instance an empty sequence of scenes.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> blocks = [tpd.Block(width=w, height=1.5, mass=900.0, cavity_width=0.4) for w in (0.5, 0.6)]
        >>> motion = tpd.Harmonic(amplitude=0.003, frequency=2.0)
        >>> print(tpd.optimise_all([tpd.Scene(block, motion) for block in blocks]))
        Designs for 2 blocks: 2 no uplift
    """
    checks.instance("scenes", scenes, Sequence)
    if not scenes:
        raise ValueError("`scenes` must hold at least one scene, but is empty")
    for i, scene in enumerate(scenes):
        # Blocks and scenes must not be mixed, because the same conditions apply to all of them.
        checks.instance(f"scenes[{i}]", scene, Block if isinstance(scenes[0], Block) else Scene)
    # The first search would exhaust an iterator, so make a tuple of it.
    if settings.get("limits") is not None:
        settings["limits"] = tuple(settings["limits"])
    rows = []
    with count_for(progress, "searching") as report:
        for i, scene in enumerate(scenes):
            try:
                design = optimise(scene, **settings)
            except ValueError as error:
                raise ValueError(f"`scenes[{i}]`: {error}") from None
            # Without a pendulum its sizes are NaN.
            sizes = (float(getattr(design.pendulum, name, np.nan)) for name in _SIZES)
            rows.append((design.status.name, *sizes, *design.risks))
            report(i + 1, len(scenes))
    status, *numbers = map(np.array, zip(*rows, strict=True))
    return Designs(status, *numbers)
