"""The main job: find the pendulum for a scene, in three stages.

*Search* yields candidates: under harmonic excitation from descents on the smoothed orbits, under ground
motions from a sample of the space. *Refine* evaluates them and others by trial runs. *Validate* decides by
paired runs that nothing else has used.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tpd.answers.attractors import Starts
from tpd.answers.ensemble import Ensemble
from tpd.core import checks
from tpd.core.progress import Progress, shown, unreported
from tpd.design.criteria import DesignSpace, Limit, Objective, Risk, Worth
from tpd.design.design import Design
from tpd.design.ground_motion import GroundMotionProblem
from tpd.design.harmonic import HarmonicProblem
from tpd.design.problem import Problem
from tpd.design.reasons import DesignStatus
from tpd.design.refine import apart, refine
from tpd.design.settings import Descent, GroundSearch
from tpd.design.validate import Validated, validate
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.scene import Block, Scene

_SURER = 0.6
"""Factor on what is uncertain about the limits of the next design, after one has been rejected."""
_PROMISING = 0.3
"""Share of the required benefit that the trend of a further design must promise."""


def optimise(
    scene: Scene | Block,
    space: DesignSpace | None = None,
    *,
    conditions: Conditions | None = None,
    starts: Starts | None = None,
    risk: Risk | None = None,
    limits: Iterable[Limit] | None = None,
    objective: Objective | None = None,
    method: Descent | GroundSearch | None = None,
    ensemble: Ensemble | None = None,
    worth: Worth | None = None,
    held_out: checks.Real | Mapping[str, Sequence[GroundMotion]] | None = None,
    seed: checks.Whole = 0,
    progress: Progress | bool | None = None,
) -> Design:
    """Find the pendulum of least rocking under one or many conditions, and validate it.

    By default the conditions are a neighbourhood of the scene's own excitation: ±5 % in frequency and +10 %
    in amplitude. Under ground motions, `conditions=Conditions.records(...)`, see
    `tpd.design.ground_motion.GroundMotionProblem`.

    The search smooths signs and impacts, diffrax integrates the equations (25), and optax descends on the
    gradients of the steady amplitudes; the exact gradients finish the best ends. Trial runs of the linear
    equations then compare these designs and others, and a Gaussian process proposes further ones. The best
    is validated by paired runs of the nonlinear equations: they must show the benefit that `worth` requires,
    and no harm. At most three designs are validated, each by runs of its own.

    Args:
        scene: block and base motion, SI; under ground motions a block alone is enough.
        space: bounds of the search; default `DesignSpace()`.
        conditions: default `Conditions.around(scene)`.
        starts: default `Starts.any()`, the largest motion that attracts; with `Starts.rest()` rest counts
            wherever it holds.
        risk: default `Risk.worst()`.
        limits: objects of `tpd.limits`; default `limits.DEFAULT_LIMITS`; `limits.POINT_BOB` has no walls.
        objective: what the descents make small under harmonic excitation; default the settled tilt,
            `limits.SteadyTilt()`.
        method: `Descent(...)`; under ground motions `GroundSearch(...)`.
        ensemble: validation runs, dealt out among the conditions; default `Ensemble(size=2048)`.
        worth: least benefit and largest harm of a pendulum that is recommended; default `Worth()`.
        held_out: ground motions that the design is not tuned to, a share or groups by name; default 0.5.
        seed: of every random choice, also of the runs of an ensemble without a seed of its own.
        progress: True for a bar on stderr, or called with (stage, done, of how many).

    Returns:
        The design, with its status, its trials and its validation runs.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    given: dict[str, Any] = {"risk": risk, "limits": limits, "method": method, "ensemble": ensemble}
    given |= {"worth": worth, "seed": seed, "held_out": held_out, "objective": objective}
    problem = problem_of(scene, space, conditions=conditions, starts=starts, **given)
    with shown(progress) as report:
        return solve(problem, report)


def problem_of(
    scene: Scene | Block,
    space: DesignSpace | None = None,
    *,
    conditions: Conditions | None = None,
    starts: Starts | None = None,
    held_out: checks.Real | Mapping[str, Sequence[GroundMotion]] | None = None,
    objective: Objective | None = None,
    **given: Any,
) -> Problem:
    """Return the problem that arguments of `optimise` pose.

    Raises:
        ValueError: bad input.
    """
    checks.optional("conditions", conditions, Conditions)
    if conditions is not None and conditions.motions:
        for name, value in (("starts", starts), ("objective", objective)):
            if value is not None:
                raise ValueError(f"`{name}` is for harmonics, but the conditions are ground motions")
        return GroundMotionProblem.of(scene, conditions, space, held_out=held_out, **given)
    if held_out is not None:
        raise ValueError("`held_out` is for ground motions, but the conditions are harmonics")
    if isinstance(scene, Block) or isinstance(given.get("method"), GroundSearch):
        raise ValueError("a block alone, and a `GroundSearch`, go with ground motions: `Conditions.records`")
    return HarmonicProblem.of(
        scene, space, conditions=conditions, starts=starts, objective=objective, **given
    )


def solve(problem: Problem, progress: Progress = unreported) -> Design:
    """Search, refine and validate; see `optimise`."""
    if problem.stays_at_rest():
        return Design(problem=problem, status=DesignStatus.no_uplift)
    candidates, search = problem.candidates(progress)
    refinement = refine(problem, candidates, progress)
    status, validated = DesignStatus.none_feasible, list[Validated]()
    for attempt in range(problem.attempts):
        trials = refinement.trials()
        pool = apart(problem, trials.designs[trials.feasible], [v.design for v in validated])
        if not len(pool):
            break
        if validated and refinement.process is not None:
            trend = float(refinement.process.at(problem.space.scaled(pool[:1]))[0][0])
            if trend > (1.0 - _PROMISING * problem.worth.at_least) * refinement.without:
                break
        found = validate(problem, pool[0], attempt, progress=progress)
        validated.append(found)
        if not found.reasons:
            status = problem.evidence
            break
        status = found.status
        if found.decided is not None:
            # These runs say more about the design than its trial, and something about its neighbours.
            refinement.add(found.design, found.decided.with_pendulum)
            refinement.likely = 1.0 - _SURER * (1.0 - refinement.likely)
            refinement.fit()
    best = validated[-1].design if validated and not validated[-1].reasons else None
    return Design(
        problem=problem,
        status=status,
        validated=tuple(validated),
        trials=refinement.trials(),
        search=search,
        equivalent=None if best is None else refinement.equivalent(best),
    )
