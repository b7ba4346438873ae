"""Find the pendulum for a block under ground motions, and judge it on motions that it never saw."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from itertools import chain
from typing import Any

import numpy as np

from tpd.answers.ensemble import Ensemble
from tpd.core import checks
from tpd.core.progress import Progress, unreported
from tpd.design.criteria import DesignSpace, Limit, Risk, Room, Stroke, Worth, beyond_as_built
from tpd.design.ground.design import GroundDesign, GroundVerdict, objective_of, verdict_of
from tpd.design.ground.judgement import HELD_OUT, SCATTERED, Group, Judged, grouped, judge, scatter_of
from tpd.design.ground.objective import GroundObjective, check_ground_limits
from tpd.design.ground.search import DEFAULT_SPACE, Evaluated, GroundSearch, Searcher, risk_of_known
from tpd.design.problem import Question, check_cavity, check_given, within_mass
from tpd.design.result import DesignStatus
from tpd.design.verified import Reason, ReasonKind, Step
from tpd.scene.conditions import Conditions, check_restitution
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.scene import STANDARD_GRAVITY, Block, Pendulum, Scene

DEFAULT_LIMITS: tuple[Limit, ...] = (Stroke(), Room())
_SLIGHT = 1e-3
"""Improvement of the risk below which there is none."""


@dataclass(frozen=True, kw_only=True)
class GroundProblem(Question):
    """A question about ground motions, with those that are held out."""

    groups: tuple[Group, ...]

    @cached_property
    def objective(self) -> GroundObjective:
        """Designs under the motions of the group that they are tuned to."""
        return objective_of(self)


def ground_problem(
    subject: Scene | Block,
    conditions: Conditions,
    space: DesignSpace | None,
    *,
    held_out: float | Mapping[str, Sequence[GroundMotion]] | None,
    risk: Risk | None,
    limits: Iterable[Limit] | None,
    method: Any,
    worth: Worth | None,
    ensemble: Ensemble | None,
    seed: int,
) -> GroundProblem:
    """Problem of a pendulum of least rocking under pulses and records, judged on motions that it was not
    tuned to; None stands for the default everywhere.

    The linear equations are followed exactly through every motion. Designs over the whole space are followed
    first, then those that a response surface through all of them proposes; the best is that of least trend
    within the limits. It is judged, paired with the bare block on the same scattered blocks, by the linear
    and the nonlinear equations, on the motions that it is tuned to and on every group that is held out.

    Args:
        subject: the block, or a scene with its gravity, whose motion is not used.
        conditions: from `Conditions.records`.
        space: bounds of the search; default `DesignSpace(damping_ratio=(0.05, 1))`.
        held_out: share of the motions, whole earthquakes by a seeded choice, that the design is not tuned to;
            or groups of other motions by name; default 0.5.
        risk: of the severities of all runs, see `Runs`; default `Risk.expected()`.
        limits: default the stroke and the room between the walls, both on the way and not only settled.
        method: a `GroundSearch`.
        worth: `strikes` is the share of the runs in which the block stands that may break a limit; the
            search keeps to it for each limit, with some to spare, and the judgement for all limits together.
            `at_least` is the least share by which the mean tilt over all held-out motions must fall, an
            overturning counted as the slenderness.
        ensemble: its widths of block and installation are those of the judgement.
        seed: of every random choice.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    seed = check_given(seed, space=space, risk=risk, ensemble=ensemble, worth=worth)
    checks.instance("scene", subject, (Scene, Block))
    checks.optional("method", method, GroundSearch)
    block = subject if isinstance(subject, Block) else subject.block
    gravity = STANDARD_GRAVITY if isinstance(subject, Block) else float(subject.gravity)
    listed = check_ground_limits(DEFAULT_LIMITS if limits is None else tuple(limits))
    check_cavity(block, listed)
    groups = grouped(conditions.motions, HELD_OUT if held_out is None else held_out, seed)
    # By identity: two records may be equal, and belong to both sides.
    kept = [i for i, m in enumerate(conditions.motions) if any(m is own for own in groups[0].motions)]
    which = np.asarray(conditions.which)
    rows = np.isin(which, kept)
    inside = replace(
        conditions,
        factors={name: factor[rows] for name, factor in conditions.factors.items()},
        motions=tuple(conditions.motions[i] for i in kept),
        which=np.searchsorted(kept, which[rows]),
    )
    worth, ensemble = Worth() if worth is None else worth, Ensemble() if ensemble is None else ensemble
    # A setting without effect would let somebody believe in it.
    for given, usual, used in ((worth, Worth(), ("at_least", "strikes")), (ensemble, Ensemble(), SCATTERED)):
        for f in fields(given):
            if f.name not in used and getattr(given, f.name) != getattr(usual, f.name):
                name = type(given).__name__.lower()
                raise ValueError(f"`{name}.{f.name}` is for harmonics, but the conditions are ground motions")
    scene = Scene(block, inside.motions[0], gravity)
    if ensemble.restitution:
        check_restitution(scene)
    return GroundProblem(
        scene=scene,
        space=within_mass(DEFAULT_SPACE if space is None else space, block, listed),
        conditions=inside,
        risk=Risk.expected() if risk is None else risk,
        limits=listed,
        method=GroundSearch() if method is None else method,
        ensemble=ensemble,
        worth=worth,
        seed=seed,
        groups=groups,
    )


def solve(problem: GroundProblem, report: Progress) -> GroundDesign:
    """Search, and judge the best design; see `ground_problem`."""
    objective, risk = problem.objective, problem.risk
    bare = objective.evaluate(np.array([[0.0, 1.0, 0.3]]))
    without = float(risk_of_known(risk, bare.severity)[0])
    search = Searcher(
        objective,
        risk,
        problem.space,
        problem.method,
        problem.seed,
        partial(report, "search"),
    )
    # The closed form of uplift answers first: there may be nothing to search.
    if np.all(bare.tilt == 0.0):
        return _answer(problem, search, without, GroundVerdict(DesignStatus.no_uplift, ()), None)
    search.run()
    best, found = search.best(), search.found
    assert found is not None
    if best is None:
        return _answer(problem, search, without, _none_feasible(found, search.names), None)
    if not found.value[best] < without - _SLIGHT:
        again = objective.evaluate(found.designs[best][None]).severity[0]
        count = int(np.isnan(again).sum() + np.isnan(bare.severity[0]).sum())
        # At best its runs without an answer end at rest, and those of the bare block overturn.
        ends = (again, 0.0), (bare.severity[0], 1.0)
        least, most = (float(risk.of(np.nan_to_num(x, nan=end))) for x, end in ends)
        hangs = count > 0 and least < most - _SLIGHT
        verdict = _unknown(count) if hangs else _no_improvement(found, search.names, best, without)
        return _answer(problem, search, without, verdict, best)
    groups = tuple(_judged(problem, found.designs[best], group, report) for group in problem.groups)
    verdict = _with_body(problem, found.designs[best], verdict_of(groups, problem.worth))
    return _answer(problem, search, without, verdict, best, groups)


def _with_body(problem: GroundProblem, design: np.ndarray, verdict: GroundVerdict) -> GroundVerdict:
    """The verdict, which refuses a pendulum that exceeds a limit as it is built."""
    mu, lam, zeta = (float(x) for x in design)
    hung = problem.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
    turned = problem.objective.check(design[None]).relative[0]
    how = turned[np.isfinite(turned)], problem.worth.broken
    beyond = beyond_as_built(problem.limits, problem.scene, hung, *how)
    if not beyond:
        return verdict
    kind, step = ReasonKind.as_built, Step.judgement
    said = (str(Reason(step=step, kind=kind, limit=n, value=x, reference=most)) for n, x, most in beyond)
    # The first reason is the headline: what the motions say against it comes first.
    both = (verdict.reasons, said) if verdict.status is DesignStatus.refused else (said, verdict.reasons)
    return GroundVerdict(DesignStatus.refused, tuple(chain(*both)))


def _none_feasible(found: Evaluated, names: tuple[str, ...]) -> GroundVerdict:
    """Verdict where no design keeps to the limits: which limit stands against the nearest one."""
    known = np.isfinite(found.value)
    if not known.any():
        return _unknown(int(found.undecided.sum()))
    near = int(np.argmin(np.where(known, found.sizes.max(axis=1), np.inf)))
    reason = (
        f"of {len(known)} designs that were followed none keeps to the limits: {_over(found, names, near)}"
    )
    return GroundVerdict(DesignStatus.none_feasible, (reason + _left_out(found),))


def _no_improvement(found: Evaluated, names: tuple[str, ...], best: int, bare: float) -> GroundVerdict:
    """Verdict where the best design within the limits is no better than none."""
    reason = (
        f"of {int(found.feasible.sum())} designs that keep to the limits the best tilts the block by "
        f"{found.value[best]:.4g} of its slenderness, and without a pendulum it is {bare:.4g}"
    )
    # It would be false to say that none is better where the limits alone stand against some.
    better = ~found.feasible & (found.value < bare - _SLIGHT)
    if better.any():
        near = int(np.argmin(np.where(better, found.sizes.max(axis=1), np.inf)))
        reason += (
            f"; {int(better.sum())} designs that break a limit tilt it less: {_over(found, names, near)} "
            f"for {found.value[near]:.4g}"
        )
    return GroundVerdict(DesignStatus.refused, (reason + _left_out(found),))


def _over(found: Evaluated, names: tuple[str, ...], i: int) -> str:
    """Words for the limit that a design breaks by most."""
    j = int(np.argmax(found.sizes[i]))
    return f"the nearest needs {found.sizes[i, j]:.3g} times the limit on the {names[j]}"


def _left_out(found: Evaluated) -> str:
    """Words for the runs without an answer, if there are any."""
    count = int(found.undecided.sum())
    return f"; {count} runs without an answer are left out" if count else ""


def _unknown(count: int) -> GroundVerdict:
    """Verdict where the search itself hangs on runs without an answer."""
    reason = f"{count} runs have no answer, and it hangs on them whether any design is better than none"
    return GroundVerdict(DesignStatus.undecided, (reason,))


def judged(
    problem: GroundProblem, hung: Pendulum, report: Progress = unreported
) -> tuple[tuple[Judged, ...], GroundVerdict]:
    """Judge a pendulum of one's own on the groups of a problem, and return these and the verdict."""
    block = problem.scene.block
    design = np.array([hung.mass / block.mass, hung.length / block.half_height, hung.damping_ratio])
    found = tuple(_judged(problem, design, group, report) for group in problem.groups)
    return found, _with_body(problem, design, verdict_of(found, problem.worth))


def _judged(problem: GroundProblem, design: np.ndarray, group: Group, report: Progress) -> Judged:
    return judge(
        problem.objective,
        design,
        group,
        [float(x) for x in np.unique(problem.conditions.scales)],
        scatter=scatter_of(problem.scene.block, problem.ensemble),
        seed=problem.seed,
        progress=partial(report, f"judging: {group.name}"),
    )


def _answer(
    problem: GroundProblem,
    search: Searcher,
    bare: float,
    verdict: GroundVerdict,
    best: int | None,
    judged: tuple[Judged, ...] = (),
) -> GroundDesign:
    objective, found = problem.objective, search.found
    design = None if best is None or found is None else found.designs[best]
    value, trend, usage, swing, alike = np.nan, (np.nan, np.nan), None, np.nan, None
    # A design without a verdict is shown, but not offered.
    offered = verdict.status in (DesignStatus.found, DesignStatus.tuned_only)
    pendulum = None
    if design is not None and found is not None and best is not None and search.surface is not None:
        value = float(found.value[best])
        mean, deviation = search.surface.at(problem.space.scaled(design[None]))
        trend = float(mean[0]), float(deviation[0])
        mu, lam, zeta = (float(x) for x in design)
        hung = problem.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
        pendulum = hung if offered else None
        if offered:
            at = search.surface.at(problem.space.scaled(found.designs))[0]
            good = found.designs[found.feasible & (at <= trend[0] + 2.0 * trend[1])]
            both = np.concatenate([design[None], good])
            alike = np.stack([both.min(axis=0), both.max(axis=0)])
        if judged:
            # What sizes a room is of the nonlinear equations.
            nonlinear = objective.check(design[None])
            usage = objective.sizes(nonlinear, design[None])[1][0]
            swing = float(np.max(nonlinear.relative, where=np.isfinite(nonlinear.relative), initial=0.0))
    return GroundDesign(
        **problem.inputs,
        status=verdict.status,
        reasons=verdict.reasons,
        pendulum=pendulum,
        alike=alike,
        best=design,
        value=value,
        trend=trend,
        bare=bare,
        searched=found,
        surface=search.surface,
        names=search.names,
        usage=usage,
        judged=judged,
        swing_met=swing,
    )
