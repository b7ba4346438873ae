"""The main job: find the pendulum for a scene, and verify it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.attractors import Starts
from tpd.answers.ensemble import Ensemble
from tpd.core import checks
from tpd.core.batch import aside
from tpd.core.progress import Progress, shown, unreported
from tpd.design.criteria import DesignSpace, Limit, Risk, Worth
from tpd.design.ground.optimise import ground_problem
from tpd.design.ground.optimise import solve as solve_on_motions
from tpd.design.ground.search import GroundSearch
from tpd.design.orbits import margins
from tpd.design.problem import Problem
from tpd.design.result import Design, DesignStatus, HarmonicDesign
from tpd.design.search import Search, search
from tpd.design.settings import Descent
from tpd.design.smoothed_orbits import prepare_step
from tpd.design.survey import Survey, survey
from tpd.design.verified import LossCase
from tpd.design.verify import JUDGED, Verification, nearest_of, pendulum_of
from tpd.models.compiled_linear import load_compiled
from tpd.models.smoothed import Smoothed
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.scene import Block, Scene

SEARCHED = 64
"""Most conditions under which the searches descend: their ends are followed and verified under others."""


@dataclass
class Found:
    """Search, verification and all that they add to the answer, as it grows."""

    verification: Verification
    search: Search = field(default_factory=Search)
    status: DesignStatus = DesignStatus.no_uplift
    surveys: tuple[Survey, ...] = ()
    losses: tuple[LossCase, ...] = ()


def optimise(
    scene: Scene | Block,
    space: DesignSpace | None = None,
    *,
    conditions: Conditions | None = None,
    starts: Starts | None = None,
    risk: Risk | None = None,
    limits: Iterable[Limit] | None = None,
    method: Descent | GroundSearch | None = None,
    ensemble: Ensemble | None = None,
    worth: Worth | None = None,
    held_out: checks.Real | Mapping[str, Sequence[GroundMotion]] | None = None,
    seed: checks.Whole = 0,
    progress: Progress | bool | None = None,
) -> Design:
    """Pendulum of least rocking under one or many conditions, verified.

    Under ground motions, `conditions=Conditions.records(...)`, see
    `tpd.design.ground.optimise.ground_problem`; what follows is about harmonics. By default their conditions
    are a neighbourhood of the scene's own shaking: ±5 % in frequency and +10 % in amplitude. Signs
    and impacts are smoothed, diffrax integrates the equations (25), and optax descends on the gradients of
    the steady amplitudes under all conditions, from the best of many screened designs; the exact solution
    validates every end. Designs that the descents met, and others, are followed from rest by the linear and
    the nonlinear equations, and the best are verified one after the other until one passes: paired runs of
    the nonlinear equations must show the least benefit that `worth` asks for, and no harm. The one that
    passes is judged by fresh runs, of another seed, which the answer quotes; the next is judged if they
    refuse it, three at most.

    Args:
        scene: block and base motion, SI; under ground motions a block alone will do.
        space: bounds of the search; default `DesignSpace()`.
        conditions: default `Conditions.around(scene)`.
        starts: default `Starts.any()`, the largest motion that attracts; with `Starts.rest()` rest counts
            wherever it holds.
        risk: default `Risk.worst()`.
        limits: objects of `tpd.limits`; default `limits.DEFAULT_LIMITS`; `limits.POINT_BOB` has no walls.
        method: settings of the search, `Descent(...)`.
        worth: least benefit and largest harm of a design that is offered; default `Worth()`.
        ensemble: runs that verify; default `Ensemble()`, dealt out among the conditions.
        held_out: ground motions that the design is not tuned to, a share or groups by name; default 0.5.
        seed: of every random choice, also of the runs of an ensemble without a seed of its own.
        progress: True for a bar on stderr, or called with (stage, done, of how many).

    Returns:
        A `HarmonicDesign`; under ground motions a `GroundDesign`.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    asked: dict[str, Any] = {"risk": risk, "limits": limits, "method": method, "ensemble": ensemble}
    asked |= {"worth": worth, "seed": seed}
    if isinstance(conditions, Conditions) and conditions.motions:
        if starts is not None:
            raise ValueError("`starts` is for harmonics, but the conditions are ground motions")
        shaken = ground_problem(scene, conditions, space, held_out=held_out, **asked)
        with shown(progress) as report:
            return solve_on_motions(shaken, report)
    if held_out is not None:
        raise ValueError("`held_out` is for ground motions, but the conditions are harmonics")
    if isinstance(scene, Block) or isinstance(method, GroundSearch):
        raise ValueError("a block alone, and a `GroundSearch`, go with ground motions: `Conditions.records`")
    problem = Problem.of(scene, space, conditions=conditions, starts=starts, **asked)
    with shown(progress) as report:
        return solve(problem, report)


def solve(problem: Problem, progress: Progress | None = None) -> HarmonicDesign:
    """Search and verify a problem; see `optimise`."""
    # If the bare block lifts under no condition there may be nothing to search.
    p = problem.orbits.p
    if not np.all(margins(problem.orbits, np.array([[0.0, float(p.lam), float(p.zeta)]])) > 0.0):
        # Compiled while the bare block is followed; not at once, since only one thread at a time can trace.
        if isinstance(problem.method.model, Smoothed):
            prepare_step(problem.orbits, problem.method.model)
        aside(load_compiled)
    objective, verification = problem.objective, Verification(problem, progress)
    few = objective.over(objective.conditions.subset(SEARCHED, problem.seed))
    found = Found(verification)
    if not verification.bare_rests:
        found.search = search(few, problem.method, problem.seed, progress)
        if len(few.conditions) < len(objective.conditions):
            part = f" under {len(few.conditions)} of the {len(objective.conditions)} conditions"
            found.search = replace(found.search, description=found.search.description + part)
        _verify(problem, found, progress)
    verified = tuple(verification.verified)
    offered = verified[-1] if found.status is DesignStatus.found else None
    alike = None
    if offered is not None and verification.refinement is not None:
        alike = verification.refinement.alike(offered.design)
    none = found.status is DesignStatus.none_feasible
    return HarmonicDesign(
        **problem.inputs,
        status=found.status,
        pendulum=None if offered is None else pendulum_of(problem.scene, offered),
        verified=verified,
        bare=verification.bare,
        nearest=nearest_of(found.surveys[-1]) if none else None,
        search=found.search,
        surveys=found.surveys,
        losses=found.losses,
        alike=alike,
        settings=problem.method.described,
    )


def _verify(problem: Problem, found: Found, progress: Progress | None) -> None:
    """Follow many designs from rest, verify the best of them, and add what belongs to an offered one."""
    verification = found.verification
    # Ends that the exact solution confirms, and the best designs on the paths.
    met = [found.search.confirmed, found.search.passed]
    after = partial(progress or unreported, "survey")
    found.surveys = wide, fine = survey(
        verification.few, np.concatenate(met), problem.ensemble.periods, problem.seed, after
    )
    found.surveys = wide, fine = wide, verification.refined(fine)
    for _ in range(JUDGED):
        found.status = verification.best_of_survey(fine)
        if found.status is DesignStatus.found:
            found.status = verification.judge()
        if found.status is not DesignStatus.refused or not verification.verified[-1].chosen_by:
            break
    if found.status is DesignStatus.found:
        winner = verification.verified[-1]
        found.losses = verification.fresh.under_other_losses(pendulum_of(problem.scene, winner))
