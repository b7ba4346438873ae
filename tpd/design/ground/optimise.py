"""Find the pendulum for a block under ground motions, and judge it on motions that it never saw."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.core.conditions import Conditions
from tpd.core.ground_motion import GroundMotion
from tpd.core.progress import Progress, shown
from tpd.core.scene import STANDARD_GRAVITY, Block, Pendulum, Scene
from tpd.design.criteria import Limit, Mass, Risk, Room, Stroke, limit_of
from tpd.design.ground.demand import CappedTilt, Demand
from tpd.design.ground.design import GroundDesign, GroundStatus
from tpd.design.ground.groups import Group, grouped
from tpd.design.ground.judgement import Judged, benefit_of, judge, scatter_of
from tpd.design.ground.objective import GroundObjective
from tpd.design.ground.parts import Parts, parts_of
from tpd.design.ground.search import GroundSearch, Searcher
from tpd.design.ground.sizes import check_ground_limits
from tpd.design.ground.store import Store
from tpd.design.space import DesignSpace

DEFAULT_SPACE = DesignSpace(damping_ratio=(0.05, 1.0))
DEFAULT_LIMITS: tuple[Limit, ...] = (Stroke(), Room())
ALLOWED = 0.1
AT_LEAST = 0.1
HELD_OUT = 0.5
_SLIGHT = 1e-3
"""Improvement of the demand below which there is none."""


@dataclass(frozen=True, kw_only=True)
class GroundProblem:
    """Inputs of a design on ground motions, complete and checked."""

    objective: GroundObjective
    space: DesignSpace
    demand: Demand
    risk: Risk
    method: GroundSearch
    groups: tuple[Group, ...]
    scales: tuple[float, ...]
    scatter: Mapping[str, float]
    at_least: float
    seed: int

    @property
    def identity(self) -> str:
        """Fingerprint of everything that a followed design depends on."""
        o = self.objective
        how = self.space, self.demand, self.risk, self.method, self.seed, o.conditions.intensity
        words = o.block, o.gravity, o.limits, o.allowed, o.free, how
        digest = hashlib.sha256(repr(words).encode())
        for motion in o.conditions.motions:
            digest.update(np.asarray(motion.pieces(), dtype=float).tobytes())
            digest.update(repr((float(motion.pga), float(motion.piece))).encode())
        digest.update(o.conditions.factor_rows().tobytes())
        return digest.hexdigest()


def optimise_on_motions(
    subject: Scene | Block,
    conditions: Conditions,
    space: DesignSpace | None = None,
    *,
    held_out: float | Mapping[str, Sequence[GroundMotion]] = HELD_OUT,
    demand: Demand | None = None,
    risk: Risk | None = None,
    limits: Iterable[Limit] | None = None,
    allowed: float = ALLOWED,
    method: GroundSearch | None = None,
    scatter: Mapping[str, float] | None = None,
    at_least: float = AT_LEAST,
    seed: int = 0,
    checkpoint: Path | str | None = None,
    progress: Progress | bool | None = None,
) -> GroundDesign:
    """Pendulum of least demand under pulses and records, judged on motions that it was not tuned to.

    The linear equations are followed exactly through every motion. Designs over the whole space are followed
    first, then those that a response surface through all of them proposes; the best is that of least trend
    within the limits. It is judged, paired with the bare block on the same scattered blocks, by the linear
    and the nonlinear equations, on the motions that it is tuned to and on every group that is held out.

    Args:
        subject: the block, or a scene with its gravity, whose motion is not used.
        conditions: from `Conditions.records`.
        space: bounds of the search; default `DesignSpace(damping_ratio=(0.05, 1))`.
        held_out: share of the motions, whole earthquakes by a seeded choice, that the design is not tuned to;
            or groups of other motions by name.
        demand: what is made small on every run; default `demands.CappedTilt()`.
        risk: over all runs; default `Risk.expected()`.
        limits: default the stroke and the room between the walls, both on the way and not only settled.
        allowed: share of the runs in which the block stands that may break each limit.
        method: how the space is searched.
        scatter: relative half widths of what is uncertain in the judgement; default
            `tpd.design.ground.judgement.scatter_of(block)`.
        at_least: least share by which the mean tilt over all held-out motions must fall, an overturning
            counted as the slenderness.
        seed: of every random choice.
        checkpoint: file of the designs that have been followed; these are not followed again.
        progress: True for a bar on stderr, or called with (stage, done, of how many).

    Raises:
        ValueError: bad input, or a checkpoint of another problem.
        RuntimeError: JAX is in 32-bit mode.
    """
    problem = problem_of(
        subject, conditions, space, held_out, demand, risk, limits, allowed, method, scatter, at_least, seed
    )
    with shown(progress) as report:
        return solve(problem, Store.of(checkpoint, problem.identity), report)


def problem_of(
    subject: Scene | Block,
    conditions: Conditions,
    space: DesignSpace | None,
    held_out: float | Mapping[str, Sequence[GroundMotion]],
    demand: Demand | None,
    risk: Risk | None,
    limits: Iterable[Limit] | None,
    allowed: float,
    method: GroundSearch | None,
    scatter: Mapping[str, float] | None,
    at_least: float,
    seed: int,
) -> GroundProblem:
    """The problem, checked; None stands for the default everywhere."""
    checks.require_x64()
    checks.instance("subject", subject, (Scene, Block))
    checks.instance("conditions", conditions, Conditions)
    checks.within("allowed", allowed, 0.0, 0.5)
    checks.within("at_least", at_least, 0.0, 1.0)
    checks.count("seed", seed, least=0)
    for name, value, kind in (
        ("space", space, DesignSpace),
        ("demand", demand, Demand),
        ("risk", risk, Risk),
        ("method", method, GroundSearch),
    ):
        if value is not None:
            checks.instance(name, value, kind)
    if not conditions.motions:
        raise ValueError("`conditions` must have ground motions, from `Conditions.records`, but have none")
    block = subject if isinstance(subject, Block) else subject.block
    gravity = STANDARD_GRAVITY if isinstance(subject, Block) else float(subject.gravity)
    listed = check_ground_limits(DEFAULT_LIMITS if limits is None else tuple(limits))
    groups = grouped(conditions.motions, held_out, seed)
    inside = _restricted(conditions, groups[0])
    objective = GroundObjective(block, inside, listed, allowed, gravity)
    return GroundProblem(
        objective=objective,
        space=_within_mass(DEFAULT_SPACE if space is None else space, block, listed),
        demand=CappedTilt() if demand is None else demand,
        risk=Risk.expected() if risk is None else risk,
        method=GroundSearch() if method is None else method,
        groups=groups,
        scales=tuple(float(x) for x in np.unique(conditions.scales)),
        scatter=dict(scatter_of(block) if scatter is None else scatter),
        at_least=at_least,
        seed=seed,
    )


def _restricted(conditions: Conditions, group: Group) -> Conditions:
    """The conditions with the motions of one group."""
    # By identity: two records may be equal, and belong to both sides.
    kept = [i for i, m in enumerate(conditions.motions) if any(m is other for other in group.motions)]
    rows = np.isin(np.asarray(conditions.which), kept)
    which = np.searchsorted(kept, np.asarray(conditions.which)[rows])
    factors = {k: v[rows] for k, v in conditions.factors.items()}
    return Conditions(
        factors,
        conditions.description,
        conditions.units,
        tuple(conditions.motions[i] for i in kept),
        which,
        conditions.intensity,
        conditions.scales,
    )


def _within_mass(space: DesignSpace, block: Block, limits: tuple[Limit, ...]) -> DesignSpace:
    limit = limit_of(limits, Mass)
    if not isinstance(limit, Mass):
        return space
    from tpd.design.problem import narrowed_to

    return narrowed_to(space, float(block.mass), limit.kg)


def solve(problem: GroundProblem, store: Store, report: Progress | None) -> GroundDesign:
    """Search, and judge the best design; see `optimise_on_motions`."""
    objective, demand, risk = problem.objective, problem.demand, problem.risk
    bare, demands = demand.follow(objective, np.array([[0.0, 1.0, 0.3]]))
    demanded = float(risk.of(demands.value)[0])
    search = Searcher(
        objective,
        demand,
        risk,
        problem.space,
        problem.method,
        problem.seed,
        store,
        None if report is None else partial(report, "search"),
    )
    # The closed form of uplift answers first: there may be nothing to search.
    if not np.any(bare.tilt > 0.0):
        return _answer(problem, search, demanded, GroundStatus.no_uplift, None)
    search.run()
    best = search.best()
    if search.found is None or best is None:
        status = GroundStatus.interrupted if search.interrupted else GroundStatus.none_feasible
        return _answer(problem, search, demanded, status, None)
    if search.interrupted:
        return _answer(problem, search, demanded, GroundStatus.interrupted, best)
    if not search.found.value[best] < demanded - _SLIGHT:
        return _answer(problem, search, demanded, GroundStatus.no_improvement, best)
    judged = tuple(_judged(problem, search.found.designs[best], group, report) for group in problem.groups)
    return _answer(problem, search, demanded, _verdict(judged, problem.at_least), best, judged)


def _judged(problem: GroundProblem, design: np.ndarray, group: Group, report: Progress | None) -> Judged:
    count = None if report is None else partial(report, f"judging: {group.name}")
    return judge(
        problem.objective,
        design,
        group,
        problem.scales,
        scatter=problem.scatter,
        seed=problem.seed,
        progress=count,
    )


def _verdict(judged: tuple[Judged, ...], at_least: float) -> GroundStatus:
    """Status of a design that was judged on the group it is tuned to, and others."""
    # Harm on any group counts, also on motions that the design is tuned to.
    if any(g.harms for g in judged):
        return GroundStatus.harmful
    benefit = benefit_of(judged)
    if benefit is None:
        return GroundStatus.tuned_only
    helps = benefit.tilt.is_below or benefit.overturned.is_below
    harms = benefit.tilt.is_above or benefit.overturned.is_above
    # A benefit that is sure may still be too small for the work of hanging it.
    if harms or not helps:
        return GroundStatus.harmful if harms else GroundStatus.unproven
    return GroundStatus.found if benefit.saved >= at_least else GroundStatus.slight


def _answer(
    problem: GroundProblem,
    search: Searcher,
    bare: float,
    status: GroundStatus,
    best: int | None,
    judged: tuple[Judged, ...] = (),
) -> GroundDesign:
    objective, found = problem.objective, search.found
    design = None if best is None or found is None else found.designs[best]
    value, trend, parts = np.nan, (np.nan, np.nan), None
    # A design without a verdict is shown, but not offered.
    offered = status in (GroundStatus.found, GroundStatus.tuned_only)
    pendulum = None
    if design is not None and found is not None and best is not None and search.surface is not None:
        value = float(found.value[best])
        mean, deviation = search.surface.at(problem.space.scaled(design[None]))
        trend = float(mean[0]), float(deviation[0])
        hung = _pendulum(objective.block, design)
        pendulum = hung if offered else None
        parts = _parts(objective, hung, design) if offered else None
    return GroundDesign(
        block=objective.block,
        gravity=objective.gravity,
        space=problem.space,
        conditions=objective.conditions,
        demand=problem.demand,
        risk=problem.risk,
        limits=objective.limits,
        allowed=objective.allowed,
        at_least=problem.at_least,
        method=problem.method,
        seed=problem.seed,
        scatter=dict(problem.scatter),
        status=status,
        pendulum=pendulum,
        best=design,
        value=value,
        trend=trend,
        bare=bare,
        searched=found,
        surface=search.surface,
        names=search.names,
        judged=judged,
        parts=parts,
    )


def _pendulum(block: Block, design: np.ndarray) -> Pendulum:
    mu, lam, zeta = (float(x) for x in design)
    return Pendulum(mass=mu * float(block.mass), length=lam * float(block.half_height), damping_ratio=zeta)


def _parts(objective: GroundObjective, pendulum: Pendulum, design: np.ndarray) -> Parts | None:
    return parts_of(objective, pendulum, objective.evaluate(design[None]))


def settings(design: GroundDesign) -> dict[str, Any]:
    """Inputs of a design as plain values, for its JSON."""
    return {
        "space": asdict(design.space),
        "demand": {"kind": type(design.demand).__name__, **asdict(design.demand)},
        "risk": asdict(design.risk),
        "limits": {x.name: asdict(x) for x in design.limits},
        "allowed": design.allowed,
        "at_least": design.at_least,
        "method": asdict(design.method),
        "scatter": design.scatter,
        "seed": design.seed,
        "intensity": design.conditions.intensity,
        "scales": [float(x) for x in np.unique(design.conditions.scales)],
        "motions": [getattr(m, "name", "") for m in design.conditions.motions],
    }
