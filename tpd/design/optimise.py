"""The main job: find the pendulum for a scene, in three stages.

*Search* yields candidates: under harmonic excitation from descents on the smoothed orbits, under ground
motions from a sample of the space. *Refine* evaluates them and others by trial runs. *Validate* decides by
paired runs that nothing else has used.

`front` solves a problem again with lighter bobs, and `optimise_all` finds pendulums for many blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tpd.answers.attractors import Starts
from tpd.answers.ensemble import Ensemble
from tpd.answers.statistics import Interval
from tpd.cluster.cluster import Cluster, check_where
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular, counted
from tpd.core.progress import Progress, shown, shown_count, unreported
from tpd.design.criteria import DesignSpace, Limit, Objective, Requirements, Risk
from tpd.design.design import Design, FrontPoint
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
    requirements: Requirements | None = None,
    validation_share: checks.Real | Mapping[str, Sequence[GroundMotion]] | None = None,
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
    is validated by paired runs of the nonlinear equations: they must show the benefit that `requirements`
    states, and no harm. At most three designs are validated, each by runs of its own.

    Args:
        scene: block and base motion, SI; under ground motions a block alone is enough.
        space: bounds and fixed values of the pendulum, as ratios or in kg and m; default `DesignSpace()`.
        conditions: default `Conditions.around(scene)`.
        starts: default `Starts.any()`, the largest motion that attracts; with `Starts.rest()` rest counts
            wherever it holds.
        risk: default `Risk.worst()`.
        limits: objects of `tpd.limits`; default `limits.DEFAULT_LIMITS`; `limits.POINT_BOB` has no walls.
        objective: what the descents make small under harmonic excitation; default the settled tilt,
            `limits.SteadyTilt()`.
        method: `Descent(...)`; under ground motions `GroundSearch(...)`.
        ensemble: validation runs, dealt out among the conditions; default `Ensemble(size=2048)`.
        requirements: least benefit and largest harm of a pendulum that is recommended; default
            `Requirements()`.
        validation_share: ground motions that the search does not use, a share or groups by name; default 0.5.
        seed: of every random choice, also of the runs of an ensemble without a seed of its own.
        progress: True for a bar on stderr, or called with (stage, done, of how many).

    Returns:
        The design, with its status, its trials and its validation runs.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    given: dict[str, Any] = {"risk": risk, "limits": limits, "method": method, "ensemble": ensemble}
    given |= {
        "requirements": requirements,
        "seed": seed,
        "validation_share": validation_share,
        "objective": objective,
        "starts": starts,
    }
    problem = problem_of(scene, space, conditions=conditions, **given)
    with shown(progress) as report:
        return solve(problem, report)


def problem_of(
    scene: Scene | Block,
    space: DesignSpace | None = None,
    *,
    conditions: Conditions | None = None,
    **given: Any,
) -> Problem:
    """Return the problem that arguments of `optimise` pose.

    Raises:
        ValueError: bad input.
    """
    checks.optional("conditions", conditions, Conditions)
    ground = conditions is not None and bool(conditions.motions)
    here, there = ("ground motions", "harmonics") if ground else ("harmonics", "ground motions")
    for name in ("starts", "objective") if ground else ("validation_share",):
        if given.pop(name, None) is not None:
            raise ValueError(f"`{name}` is for {there}, but the conditions are {here}")
    if conditions is not None and ground:
        return GroundMotionProblem.of(scene, conditions, space, **given)
    if isinstance(scene, Block) or isinstance(given.get("method"), GroundSearch):
        raise ValueError("a block alone, and a `GroundSearch`, go with ground motions: `Conditions.records`")
    return HarmonicProblem.of(scene, space, conditions=conditions, **given)


def solve(problem: Problem, progress: Progress = unreported) -> Design:
    """Search, refine and validate; see `optimise`."""
    if (status := problem.needs_none) is not None:
        return Design(problem=problem, status=status)
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
            if trend > (1.0 - _PROMISING * problem.requirements.at_least) * refinement.without:
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


_LEAST, _LIGHTER = 1.0 / 16.0, 3
"""Share of the largest mass at which a front begins, and how many lighter bobs it has by default."""


class Front(tuple[FrontPoint, ...]):
    """Answers with lighter bobs, the lightest first; the design itself comes last."""

    __slots__ = ()


def front(
    design: Design,
    most: Sequence[float] | None = None,
    *,
    method: Any = None,
    progress: Progress | None = None,
) -> Front:
    """Solve the problem of a design again with lighter bobs, each validated as the design itself.

    Args:
        design: an answer of `tpd.optimise`.
        most: largest masses over the block's, increasing; by default three in equal ratios from a sixteenth
            of the space's largest on. The design itself comes last.
        method: of each search; default that of the design.
        progress: called with ("front", bobs done, of how many).

    Raises:
        ValueError: masses that do not increase or are not within the design space, or a fixed mass.
    """
    checks.instance("design", design, Design)
    block = design.scene.block
    low, high = design.space.ends[:, 0].tolist()
    if low == high:
        raise ValueError("`design` has a bob of fixed mass, so that no lighter ones can be compared with it")
    shares = np.geomspace(max(low, high * _LEAST), high, _LIGHTER + 2)[1:-1] if most is None else most
    shares = checks.array("most", shares, (-1,), "a vector of increasing masses")
    if np.any(np.diff(shares) <= 0.0) or not np.all((shares > low) & (shares < high)):
        raise ValueError(
            f"`most` must be increasing masses between {low:g} and {high:g} of the block's, but is "
            f"{shares.tolist()}"
        )
    points = []
    for i, share in enumerate(shares):
        if progress is not None:
            progress("front", i, len(shares))
        space = replace(design.space, mass_ratio=(low, float(share)))
        answer = optimise(**design.again(space=space, **({} if method is None else {"method": method})))
        points.append(_point(float(share * block.mass), answer))
    return Front((*points, _point(float(high * block.mass), design)))


def _point(most: float, answer: Design) -> FrontPoint:
    saved = answer.benefit or Interval(np.nan, np.nan, np.nan)
    return FrontPoint(most, answer.status.name, answer.pendulum, (saved.mean, saved.low, saved.high))


_STATUSES = tuple(DesignStatus.__members__)
"""Names of statuses; their places stand for them in files."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Designs(Printed, Tabular):
    """Answers for n blocks, arrays of shape (n,); NaN where no pendulum is offered."""

    status: np.ndarray
    """Names of `DesignStatus`."""
    mass: np.ndarray
    """kg"""
    length: np.ndarray
    """m"""
    damping_ratio: np.ndarray
    value: np.ndarray
    """Risk measure of the design that is offered."""
    value_without: np.ndarray
    """Risk measure of the block without a pendulum."""

    def columns(self) -> dict[str, Any]:
        """A row for every block, with a column for every field."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def __str__(self) -> str:
        return f"Designs for {len(self.status)} blocks: {counted(self.status)}"


def optimise_all(
    scenes: Sequence[Scene] | Sequence[Block],
    *,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
    **settings: Any,
) -> Designs:
    """Find a pendulum for every scene, see `tpd.optimise`.

    Args:
        scenes: blocks with their base motion; blocks alone under ground motions.
        cluster: processes or machines; without it the searches run one after the other. A search has
            threads for all cores of its machine: one process a machine is the quickest.
        progress: True for a bar on stderr, or called with (scenes done, of how many).
        settings: of `tpd.optimise`, for every scene.

    Raises:
        ValueError: bad input, for instance no scene.
        RuntimeError: JAX is in 32-bit mode, or the cluster failed.
    """
    checks.require_x64()
    check_where(None, cluster)
    checks.instance("scenes", scenes, Sequence)
    if not scenes:
        raise ValueError("`scenes` must hold at least one scene, but is empty")
    for i, scene in enumerate(scenes):
        # All blocks or all scenes: one set of conditions serves all of them.
        checks.instance(f"scenes[{i}]", scene, Block if isinstance(scenes[0], Block) else Scene)
    if "progress" in settings:
        raise ValueError("`progress` is of one search, and cannot be given for many")
    # An iterator would be used up by the first search.
    if settings.get("limits") is not None:
        settings["limits"] = tuple(settings["limits"])
    shared, n = (tuple(scenes), settings), len(scenes)
    with shown_count(progress, "searching") as report:
        if cluster is None:
            parts = []
            for i in range(n):
                parts.append(_designed(np.array([i]), *shared))
                report(i + 1, n)
            found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        else:
            # A search takes seconds: each is a chunk of its own, so that none is lost with another one.
            found = cluster.map("designs", _designed, np.arange(n), shared, chunk=1, progress=report)
    status = np.array(_STATUSES)[found.pop("status")]
    return Designs(status=status, **found)


def _designed(which: np.ndarray, scenes: tuple[Any, ...], settings: dict[str, Any]) -> dict[str, np.ndarray]:
    """Answers for some of the scenes; statuses by their codes."""
    rows = []
    for i in map(int, which):
        try:
            found = optimise(scenes[i], **settings)
        except ValueError as error:
            raise ValueError(f"`scenes[{i}]`: {error}") from None
        with_it, (value, without) = found.pendulum, found.risks
        names = "mass", "length", "damping_ratio"
        sizes = {name: np.nan if with_it is None else float(getattr(with_it, name)) for name in names}
        rows.append(
            {
                "status": _STATUSES.index(found.status.name),
                **sizes,
                "value": value,
                "value_without": without,
            }
        )
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
