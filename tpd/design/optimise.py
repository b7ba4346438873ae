"""The main job: find the pendulum for a scene, and verify it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from tpd.analysis.attractors import StartKind, Starts
from tpd.analysis.ensemble import Ensemble
from tpd.core import checks
from tpd.core.conditions import FACTORS, Conditions, check_restitution
from tpd.core.progress import Progress, shown
from tpd.core.scene import Scene
from tpd.core.threads import aside
from tpd.design.active import nearest
from tpd.design.checkpoint import Checkpoint
from tpd.design.criteria import Limit, Risk
from tpd.design.followed import Followed
from tpd.design.methods import Method, Sequential, describe
from tpd.design.nonlinear_search import nonlinear_search, wanted
from tpd.design.objective import AbstractObjective, Orbits
from tpd.design.problem import Problem
from tpd.design.result import Design, DesignStatus, Search, Verified
from tpd.design.search import GROUP, Multistart, sampled_orbits
from tpd.design.space import DesignSpace
from tpd.design.verify import Verification, pendulum_of, prepare_verification

_FINISHING = Sequential(steps=12)
"""Searches over what sampled starts reach, at a thousand times the cost of orbits."""


def optimise(
    scene: Scene,
    space: DesignSpace | None = None,
    *,
    conditions: Conditions | None = None,
    starts: Starts | None = None,
    risk: Risk | None = None,
    limits: Iterable[Limit] | None = None,
    method: Method | None = None,
    ensemble: Ensemble | None = None,
    seed: int = 0,
    by_overturning: bool = False,
    checkpoint: Path | str | None = None,
    progress: Progress | bool | None = None,
) -> Design:
    """Pendulum of least rocking under one or many conditions, verified.

    With one condition the default method is the one that this package is named for: signs are smoothed,
    diffrax integrates the equations (25), and optax descends on the gradient of the steady amplitude. With
    several conditions it is sequential programming on exact orbits. Where a block rests, the merit is minus
    its uplift margin. The exact solution, shakings within 1 %, the nonlinear equations and an ensemble verify
    the best designs, one after the other, until one passes. If the nonlinear equations refuse, the search
    goes on with them.

    Args: scene: block and base motion, SI. space: bounds of the search; default `DesignSpace()`. conditions:
        default the scene's own shaking. starts: initial states whose motions count, and their weights;
        default `Starts.rest()` for a method with
            a model, else `Starts.any()`. Of sampled starts the mean merit counts, or the worst.
        risk: default `Risk.worst()`.
        limits: objects of `tpd.limits`; default a stroke of 0.5 rad and, over orbits, a reserve of 0.05.
        method: `Descent(...)` or `Sequential(...)`.
        ensemble: runs that verify; default `Ensemble(seed=seed)`, dealt out among the conditions.
        seed: of every random choice.
        by_overturning: verify first the designs that overturn under the fewest conditions from rest, rather
            than those of least risk.
        checkpoint: file for finished searches; searches of the same problem in it are not repeated.
        progress: True for a bar on stderr, or called with (stage, done, of how many).

    Returns:
        The design, with its status; `pendulum` is None where none is offered.

    Raises:
        ValueError: bad input, or a checkpoint of another problem.
        RuntimeError: JAX is in 32-bit mode.
    """
    problem = Problem.of(scene, space, conditions, starts, risk, limits, method, seed)
    ensemble = Ensemble(seed=seed) if ensemble is None else ensemble
    checks.instance("ensemble", ensemble, Ensemble)
    if ensemble.restitution > 0.0:
        check_restitution(scene)
    checks.flag("by_overturning", by_overturning)
    if checkpoint is not None:
        checks.instance("checkpoint", checkpoint, (Path, str))
        checkpoint = Path(checkpoint)
    with shown(progress) as report:
        return solve(problem, ensemble, by_overturning, checkpoint, report)


def solve(
    problem: Problem,
    ensemble: Ensemble,
    by_overturning: bool = False,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> Design:
    """Search and verify a problem whose inputs are complete; see `optimise`."""
    scene, objective = problem.scene, problem.objective
    store = Checkpoint.of(checkpoint, problem.identity)
    if isinstance(objective, Orbits):
        objective.prepare()
    ready = aside(lambda: prepare_verification(objective.p, len(objective.conditions), ensemble))
    verification = Verification(scene, objective, problem.method, ensemble, by_overturning, progress)
    search = Multistart(objective, problem.method, problem.seed, progress)
    status, second, elasticities = DesignStatus.interrupted, None, {}
    try:
        if verification.rests and verification.bare_rests_nonlinearly():
            status = DesignStatus.no_uplift
        else:
            search, verification = _searched(problem, search, verification, store)
            ready.join()
            status, verification, second = _verified(problem, search, verification, progress)
        if status is DesignStatus.found and not search.interrupted:
            elasticities = _elasticities(verification.objective, verification.verified[-1], progress)
    except KeyboardInterrupt:
        search.interrupted = True
    return _design(problem, ensemble, status, verification, search, second, elasticities)


def _verified(
    problem: Problem, search: Multistart, verification: Verification, progress: Progress | None
) -> tuple[DesignStatus, Verification, Multistart | None]:
    """Verify the best end; after a refusal the designs on the paths, or search on the nonlinear equations."""
    status, alone = verification.best_of(search), len(search.objective.conditions) == 1
    nonlinearly = not search.interrupted and wanted(status, verification.verified, search.objective)
    if status is DesignStatus.refused and not (alone and nonlinearly):
        # Under many conditions the nonlinear equations are costly: the linear search has more to offer first.
        status = verification.best_of_paths(search)
        nonlinearly = not search.interrupted and wanted(status, verification.verified, search.objective)
    if not nonlinearly:
        return status, verification, None
    second = nonlinear_search(search.objective, search, problem.seed, progress)
    other = verification.on(second.objective, "nonlinear search")
    after = other.best_of(second)
    if after is DesignStatus.refused:
        after = other.best_of_paths(second)
    passed = after is DesignStatus.found or not alone or status is not DesignStatus.refused
    if passed or verification.best_of_paths(search) is not DesignStatus.found:
        return after, other, second
    return DesignStatus.found, verification, second


def _searched(
    problem: Problem, search: Multistart, verification: Verification, store: Checkpoint
) -> tuple[Multistart, Verification]:
    """Run the search in its stages: under a sample of many conditions first, then under all of them, then
    over the motions that sampled starts reach."""
    objective, n = problem.objective, len(problem.objective.conditions)
    sampled = isinstance(objective, Orbits) and n >= problem.many
    if sampled and isinstance(objective, Orbits):
        fewer = sampled_orbits(objective, problem.sampled, problem.seed)
        search = Multistart(fewer, problem.method, problem.seed, search.progress)
    search.run(store)
    if sampled:
        search.description += f" under {problem.sampled} of the {n} conditions"
        search = search.carry_on(objective, store, "under all of them", problem.method, GROUP)
        if search.interrupted:
            search.evaluate_pending()
    finer = problem.over_basins
    if finer is not None and len(search.units) and not search.interrupted:
        on = search.carry_on(finer, store, "over what starts reach", _FINISHING, 1)
        interrupted = on.interrupted
        if on.groups:
            search, verification = on, verification.on(finer, "search")
        search.interrupted = interrupted
    return search, verification


def _design(
    problem: Problem,
    ensemble: Ensemble,
    status: DesignStatus,
    verification: Verification,
    search: Multistart,
    second: Multistart | None,
    elasticities: dict[str, float],
) -> Design:
    """The answer, from what was searched and verified."""
    verified, objective = tuple(verification.verified), verification.objective
    passed = status is DesignStatus.found
    offered = verified[-1] if passed else None
    status = DesignStatus.interrupted if search.interrupted else status
    return Design(
        scene=problem.scene,
        space=problem.space,
        conditions=objective.conditions,
        starts=problem.starts,
        risk=objective.risk,
        limits=objective.limits,
        method=problem.method,
        ensemble=ensemble,
        seed=problem.seed,
        status=status,
        pendulum=None if offered is None else pendulum_of(problem.scene, offered),
        verified=verified,
        bare=verification.bare,
        nearest=nearest(second or search) if status is DesignStatus.none_feasible else None,
        search=_history(search, second),
        elasticities=elasticities,
        settings=describe(problem.method),
    )


def _history(search: Multistart, second: Multistart | None) -> Search:
    """History of the search, with the ends and paths of a nonlinear search beside the others."""
    first = search.history
    if second is None:
        return first
    last = second.history
    return replace(
        first,
        paths=(*first.paths, *last.paths),
        ends=np.concatenate([first.ends, last.ends]),
        end_values=np.concatenate([first.end_values, last.end_values]),
        statuses=(*first.statuses, *last.statuses),
        nonlinear_evaluations=last.evaluations,
        description=f"{first.description}; then from {last.description}",
    )


def _elasticities(objective: AbstractObjective, of: Verified, progress: Progress | None) -> dict[str, float]:
    """d ln(value)/d ln(factor): by central differences of 0.1 %. For sampled starts from the exact
    derivatives, of the pendulum's three only, because a difference would be one of jumps of single starts
    between basins."""
    if isinstance(objective, Followed) and objective.starts.kind is StartKind.sampled:
        return _from_slopes(objective, of)
    step, out = 1e-3, {}
    # Above 1 there is no restitution, so that a difference to both sides needs room.
    names = [x for x in FACTORS if x != "restitution" or float(objective.p.e) * (1.0 + step) <= 1.0]
    for i, name in enumerate(names):
        if progress is not None:
            progress("elasticities", i + 1, len(names))
        sides = []
        for factor in (1.0 - step, 1.0 + step):
            changed = objective.over(objective.conditions * Conditions({name: np.array([factor])}))
            sides.append(float(changed.value(changed.evaluate(of.design[None]))[0]))
        out[name] = (sides[1] - sides[0]) / (2.0 * step * abs(of.value)) if of.value else math.nan
    return out


def _from_slopes(objective: Followed, of: Verified) -> dict[str, float]:
    """Elasticities in mass, length and damping ratio from the derivatives of the merits, weighted as the risk
    measure weights them; empty where a motion that counts has none."""
    e, n = of.evaluation, len(objective.conditions)
    left, weights = 1.0, np.zeros(n)
    for i in np.argsort(-e.merit[0], kind="stable"):
        weights[i] = min(objective.risk.cap(n), left)
        left -= weights[i]
    if np.any(np.broadcast_to(e.unsettled, e.kind.shape)[0][weights > 0.0]):
        return {}
    slopes = weights @ e.merit_slope[0]
    names = ("mass", "length", "damping")
    return {k: float(g * x / abs(of.value)) for k, g, x in zip(names, slopes, of.design, strict=True)}
