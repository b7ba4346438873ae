"""Validation: a design by the exact solution, then by paired nonlinear runs that nothing else has used.

Every design that is validated has new runs of its own. One half of them decides. The other half takes no
part in any decision, so that the benefit that is quoted is unbiased.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.paired import FEWER, PairedRuns
from tpd.answers.statistics import SIGNIFICANT, chance_of
from tpd.core.progress import Progress, unreported
from tpd.design.criteria import Requirements
from tpd.design.problem import Problem
from tpd.design.reasons import CERTAIN, GRAVE, DesignStatus, Reason, ReasonKind, one_of_a_kind
from tpd.scene.scene import Pendulum

_ROUNDING = 1e-9
"""Share by which rounding may exceed a limit."""


@dataclass(frozen=True, kw_only=True)
class Validated:
    """A design after its validation."""

    design: np.ndarray
    """(mu, lam, zeta)."""
    pendulum: Pendulum
    exact: Any
    """`ExactMotions` under harmonic excitation, else None."""
    decided: PairedRuns | None
    """Runs that decide; None where a limit that needs no run rejects the design."""
    quoted: PairedRuns | None
    """Runs that no decision has used; None where the design is rejected before, or where the motions are too
    few to hold some back."""
    measure: str
    """Measure that had to fall, "overturning" or "tilt"; empty without runs."""
    over_limit: float
    """Share of the runs in which the block stands that exceed a limit."""
    reasons: tuple[Reason, ...]
    """Why it is not recommended; empty if it is."""

    @property
    def runs(self) -> PairedRuns | None:
        """Runs that the report quotes."""
        return self.decided if self.quoted is None else self.quoted

    @property
    def refusals(self) -> tuple[str, ...]:
        """Sentences against the design, the dangers first."""
        return tuple(map(str, one_of_a_kind(self.reasons)))

    @property
    def is_harmful(self) -> bool:
        """Whether the block overturns more often, or the bob touches a wall too often."""
        return any(reason.kind in GRAVE for reason in self.reasons)

    @property
    def status(self) -> DesignStatus:
        """`undecided` if only runs without an answer speak against the design."""
        kinds = {reason.kind for reason in self.reasons}
        return DesignStatus.undecided if kinds == {ReasonKind.undecided} else DesignStatus.not_recommended


def validate(
    problem: Problem,
    design: np.ndarray,
    attempt: int = 0,
    *,
    thorough: bool = False,
    progress: Progress = unreported,
) -> Validated:
    """Validate one design.

    Args:
        problem: limits and requirements.
        design: (mu, lam, zeta), shape (3,).
        attempt: number of designs that were validated before, each by other runs.
        thorough: whether runs follow also where a limit that needs no run rejects the design.
        progress: called with (stage, runs done, of how many).
    """
    exact = problem.exact(design)
    reasons = [
        Reason(kind=ReasonKind.breaks_limit, limit=name, value=float(x[0]))
        for name, x in problem.fixed_sizes(design[None]).items()
        if not x[0] <= 1.0 + _ROUNDING
    ]
    reasons += [*_exact_harm(problem, exact), *_sliding(problem, design)]
    decided = quoted = None
    over, requirements = np.nan, problem.requirements
    if thorough or not reasons:
        decided = problem.paired_runs(design, run_seed(problem, attempt, 0), progress=progress)
        # All runs of a design are compared by one measure, also where the share that overturns is near 1 %.
        requirements = replace(requirements, measure=requirements.measure or decided.first_measure)
        over, by_runs = _by_runs(problem, design, decided, requirements)
        known = {reason.limit for reason in reasons if reason.limit}
        reasons += [r for r in by_runs if r.limit not in known or not r.limit]
    if decided is not None and not reasons and problem.has_validation_runs:
        quoted = problem.paired_runs(design, run_seed(problem, attempt, 1), progress=progress)
        over, by_runs = _by_runs(problem, design, quoted, replace(requirements, at_least=0.0))
        reasons += by_runs
    return Validated(
        design=design,
        pendulum=problem.pendulum(design),
        exact=exact,
        decided=decided,
        quoted=quoted,
        measure="" if decided is None else requirements.measure or "",
        over_limit=float(over),
        reasons=tuple(reasons),
    )


def run_seed(problem: Problem, attempt: int, part: int) -> int:
    """Return the seed of validation runs, which no other stage uses."""
    return problem.run_seed(2, attempt, part)


def _exact_harm(problem: Problem, exact: Any) -> list[Reason]:
    """Overturning from rest by the exact solution, under significantly more conditions (McNemar's test)."""
    if exact is None:
        return []
    lost, without = exact.status == "overturned", problem.without_pendulum.status == "overturned"
    worse, better, total = int(np.sum(lost & ~without)), int(np.sum(without & ~lost)), len(lost)
    if not worse > better or (total > 1 and chance_of(worse, better) >= SIGNIFICANT):
        return []
    kind = ReasonKind.overturns_more
    return [Reason(kind=kind, value=float(worse), reference=float(better), total=total)]


def _sliding(problem: Problem, design: np.ndarray) -> list[Reason]:
    """Sliding of the base while the block rocks, if its coefficient of friction is stated."""
    friction = problem.scene.block.base_friction
    if friction is None or not (needed := problem.needed_friction(design)) > friction:
        return []
    return [Reason(kind=ReasonKind.slides, value=needed, reference=friction)]


def _by_runs(
    problem: Problem, design: np.ndarray, runs: PairedRuns, requirements: Requirements
) -> tuple[float, list[Reason]]:
    """Share of the standing runs that exceed a limit, and the reasons against a design by paired runs; with
    one that depends on the runs without an answer, if it does."""
    over, limit = problem.over_limit(design, runs.with_pendulum)
    reasons = _reasons(problem, runs, over, limit, requirements)
    if runs.ends:
        stands = runs.with_pendulum.stands.sum()
        unknown = runs.with_pendulum.is_unanswered.sum()
        verdicts = {bool(reasons)}
        # A run that stands may exceed a limit, if there is one, which is against the pendulum as well.
        for end, more in zip(runs.ends, (unknown if limit else 0, 0), strict=True):
            share = float((over * stands + more) / max(stands + unknown, 1))
            verdicts.add(bool(_reasons(problem, end, share, limit, requirements)))
        if len(verdicts) > 1:
            kind, total = ReasonKind.undecided, len(runs.known)
            reasons = [Reason(kind=kind, value=float(runs.undecided), total=total)]
    return over, reasons


def _reasons(
    problem: Problem, runs: PairedRuns, over: float, limit: str, requirements: Requirements
) -> list[Reason]:
    """Reasons against a design by paired runs."""
    out = list[Reason]()

    def refuse(kind: ReasonKind, value: Any, reference: Any, **more: Any) -> None:
        out.append(Reason(kind=kind, value=float(value), reference=float(reference), **more))

    total, harm = int(runs.known.sum()), runs.overturns_more
    if harm is not None:
        where = {"condition": harm.label, "total": harm.total}
        refuse(ReasonKind.overturns_more, harm.only_with, harm.only_without, **where)
    if over > problem.allowed:
        refuse(ReasonKind.touches_wall, over, problem.allowed, limit=limit)
    if runs.rests_less:
        rests = (np.sum(o.is_at_rest[runs.known]) for o in (runs.with_pendulum, runs.without_pendulum))
        at_rest, without = rests
        refuse(ReasonKind.rests_less, at_rest, without, total=total, low=float((1.0 - FEWER) * without))
    if runs.worse_parts:
        first = runs.worse_parts[0]
        where = {"condition": first.label, "total": len(runs.worse_parts)}
        refuse(ReasonKind.worse_condition, first.with_pendulum, first.without_pendulum, **where)
    measure, required = requirements.measure or runs.first_measure, requirements.at_least
    gain, significant = runs.reduction(measure)
    if not (significant and gain.low > CERTAIN * required and gain.mean >= required):
        refuse(ReasonKind.too_little_benefit, gain.mean, required, low=gain.low, measure=measure)
    return out
