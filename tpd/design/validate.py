"""Validation: check a design with the exact solution, then with paired nonlinear runs.

Under harmonic excitation every design that is validated has new runs, which no other stage has used. One half
of the runs decides. The other half is simulated only if the design passes. It must confirm a significant
benefit without harm, and the report quotes it. Its benefit is not used to choose between designs, so that the
choice changes it very little.

Earthquakes are too few for two halves, and are the same for all designs. A validation share, or
cross-fitting, separates them from the choice of the design. With cross-fitting each group of earthquakes
validates the design that was found on the others, and the runs of all groups are pooled. They validate the
procedure that found the design (V. Chernozhukov and others, Econometrics Journal 21, 2018). The limits are
those of the design.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.motion_history import needed_friction
from tpd.answers.paired import REST_LOSS, PairedRuns
from tpd.answers.run_table import Runs
from tpd.answers.statistics import SIGNIFICANT, chance_of
from tpd.core.progress import Progress, unreported
from tpd.design.problem import STATED, Problem
from tpd.design.reasons import CERTAIN, DesignStatus, Reason, ReasonKind, one_of_a_kind
from tpd.limits import Clearance, Requirements
from tpd.scene.scene import Pendulum

_ROUNDING = 1e-9
"""Relative excess over a limit that is attributed to rounding."""


@dataclass(frozen=True, kw_only=True)
class Validation:
    """Design with the results of its validation."""

    design: np.ndarray
    """(mu, lam, zeta)."""
    pendulum: Pendulum
    """Pendulum of the design, in SI units."""
    exact: Any
    """`ExactMotions` under harmonic excitation, else None."""
    deciding_runs: PairedRuns | None
    """Runs that decide; None if a limit that needs no run, the exact model from rest, or sliding rejects the
    design."""
    reported_runs: PairedRuns | None
    """Runs that the report quotes: runs that confirm the decision or, under earthquakes, the runs that
    decided. None if the design was rejected before."""
    measure: str
    """Measure that had to fall, "overturning" or "tilt"; empty if there are no runs."""
    over_limit: float
    """Share of the runs that exceed a limit, among those in which the block stands."""
    reasons: tuple[Reason, ...]
    """Reasons against the design; empty if it is recommended."""
    status: DesignStatus
    """Status of the design: `undecided` if the only reason against it is runs without a result. With too few
    earthquakes the status says so, whatever the runs show."""
    own_runs: Runs | None = None
    """Runs with the pendulum of the design. Only with cross-fitting they are not those of `runs`, which have
    the designs of the groups."""
    crossed: np.ndarray | None = None
    """Designs (mu, lam, zeta) of the groups of cross-fitting, shape (groups, 3); None without it."""

    @property
    def runs(self) -> PairedRuns | None:
        """Runs that the report quotes."""
        return self.deciding_runs if self.reported_runs is None else self.reported_runs

    @property
    def measure_of_runs(self) -> str:
        """Measure by which other runs are compared with these. A rate is compared by the share of the runs
        that overturn, because these runs have one level each."""
        return "tilt" if self.measure == "tilt" else "overturning"

    @property
    def refusals(self) -> tuple[str, ...]:
        """Sentences against the design, dangers first."""
        return tuple(map(str, one_of_a_kind(self.reasons)))

    @property
    def is_harmful(self) -> bool:
        """Whether a reason against the design is a danger."""
        return any(reason.is_danger for reason in self.reasons)


def validate(
    problem: Problem,
    design: np.ndarray,
    attempt: int = 0,
    confirmed: int = 0,
    *,
    crossed: np.ndarray | None = None,
    without_pendulum: Runs | None = None,
    thorough: bool = False,
    progress: Progress = unreported,
) -> Validation:
    """Validate one design.

    Args:
        problem: limits and requirements.
        design: (mu, lam, zeta), shape (3,).
        attempt: number of designs that were validated before by other runs.
        confirmed: number of these designs whose second half of the runs was simulated. The runs that are
            quoted for the first such design are those of `tpd.assess`.
        crossed: designs (mu, lam, zeta) of the groups of cross-fitting, each of a search without the group,
            (groups, 3); None if none of the runs that count chose the design.
        without_pendulum: these runs without a pendulum, if they exist.
        thorough: whether to simulate runs also if a limit that needs no run rejects the design.
        progress: function of (stage, runs done, total).
    """
    exact = problem.exact(design)
    reasons = [
        problem.excess(name, float(x[0]))
        for name, x in problem.fixed_sizes(design[None]).items()
        if not x[0] <= 1.0 + _ROUNDING
    ]
    reasons += [] if exact is None else _harm_from_rest(problem, exact)
    friction, pendulum = problem.scene.block.base_friction, problem.pendulum(design)
    if friction is not None:
        needed = needed_friction(problem.scene, problem.stated_motions, pendulum)
        if not needed <= friction:
            reasons.append(Reason(kind=ReasonKind.slides, value=needed, reference=friction))
    decided = quoted = own = None
    over, requirements = np.nan, problem.requirements
    if thorough or not reasons:
        seed, varied = run_seed(problem, attempt, 0), STATED._replace(without_pendulum=without_pendulum)
        which = design
        if crossed is not None:
            # Each run has the design that was found without its earthquake.
            parts = zip(problem.crossed, crossed, strict=True)
            which = np.sum([rows[:, None] * x for (_, rows), x in parts], axis=0)
        decided = problem.paired_runs(which, seed, varied=varied, progress=progress)
        own = decided.with_pendulum if crossed is None else problem.validation_runs(design, seed)
        # The runs that decide also select the measure. The other half must be compared by the same measure,
        # even if the share that overturns is close to 1 %.
        requirements = replace(requirements, reduce=requirements.reduce or decided.first_measure)
        over, by_runs = _by_runs(problem, design, decided, requirements, own)
        # A limit that the design breaks at rest is not reported a second time for the runs.
        exceeded = {reason.limit for reason in reasons if reason.limit}
        reasons += [r for r in by_runs if r.limit not in exceeded or not r.limit]
    if decided is not None and not reasons and not problem.has_earthquakes:
        # The benefit of these runs is reported and must not be selected by its size: it only has to be
        # significant.
        quoted = problem.paired_runs(design, run_seed(problem, confirmed, 1), progress=progress)
        own = quoted.with_pendulum
        over, by_runs = _by_runs(problem, design, quoted, replace(requirements, at_least=0.0), own)
        reasons += by_runs
    elif not reasons:
        quoted = decided
    status = problem.passing_status
    if status is DesignStatus.recommended and problem.missing:
        status = DesignStatus.not_to_be_built
    if reasons and status is not DesignStatus.too_few:
        unknown = {reason.kind for reason in reasons} == {ReasonKind.undecided}
        status = DesignStatus.undecided if unknown else DesignStatus.not_recommended
    return Validation(
        design=design,
        pendulum=pendulum,
        exact=exact,
        deciding_runs=decided,
        reported_runs=quoted,
        own_runs=own,
        crossed=crossed,
        measure="" if decided is None else requirements.reduce or "",
        over_limit=float(over),
        reasons=tuple(reasons),
        status=status,
    )


def _harm_from_rest(problem: Problem, exact: Any) -> list[Reason]:
    """Return a reason if the block overturns from rest under significantly more conditions.

    The significance is that of McNemar's test on the conditions in which only one of the two cases overturns.
    """
    overturned, without = exact.status == "overturned", problem.without_pendulum.status == "overturned"
    worse, better = int(np.sum(overturned & ~without)), int(np.sum(without & ~overturned))
    total = len(overturned)
    # With a single condition no test is possible: every additional overturning counts.
    if not worse > better or (total > 1 and chance_of(worse, better) >= SIGNIFICANT):
        return []
    kind = ReasonKind.overturns_more
    return [Reason(kind=kind, value=float(worse), reference=float(better), total=total)]


def run_seed(problem: Problem, attempt: int, part: int) -> int:
    """Return the seed of the validation runs of one attempt. No other stage uses this seed."""
    return problem.run_seed(2, attempt, part)


def _by_runs(
    problem: Problem, design: np.ndarray, runs: PairedRuns, requirements: Requirements, own: Runs
) -> tuple[float, list[Reason]]:
    """Return the share of the standing runs that exceed a limit, and the reasons against a design by paired
    runs.

    If runs without a result could change the verdict, the only reason is `undecided`. The limits are those of
    the runs `own` of the design.
    """
    over, limit = problem.over_limit(design, own)
    reasons = _reasons(problem, runs, over, limit, requirements)
    if runs.ends:
        stands, unknown = own.stands.sum(), own.is_unanswered.sum()
        verdicts = {bool(reasons)}
        # Repeat the verdict for both extreme outcomes of the runs without a result: all of them stand, or all
        # of them overturn. A run that stands might also exceed a limit, which counts against the pendulum.
        for end, more in zip(runs.ends, (unknown if limit else 0, 0), strict=True):
            share = float((over * stands + more) / max(stands + unknown, 1))
            verdicts.add(bool(_reasons(problem, end, share, limit, requirements)))
        if len(verdicts) > 1:
            kind, total = ReasonKind.undecided, len(runs.is_answered)
            reasons = [Reason(kind=kind, value=float(runs.undecided), total=total)]
    return over, reasons


def _reasons(
    problem: Problem, runs: PairedRuns, over: float, limit: str, requirements: Requirements
) -> list[Reason]:
    """Return the reasons against a design by paired runs."""
    out = list[Reason]()

    def add_reason(kind: ReasonKind, value: Any, reference: Any, **more: Any) -> None:
        out.append(Reason(kind=kind, value=float(value), reference=float(reference), **more))

    total, harm = int(runs.is_answered.sum()), runs.overturns_more
    if harm is not None:
        where = {"condition": harm.label, "total": harm.total}
        add_reason(ReasonKind.overturns_more, harm.only_with, harm.only_without, **where)
    if over > problem.allowed:
        is_wall = limit == Clearance.name
        kind = ReasonKind.touches_wall if is_wall else ReasonKind.exceeds_limit
        add_reason(kind, over, problem.allowed, limit=limit)
    if runs.rests_less:
        rests = (np.sum(o.is_at_rest[runs.is_answered]) for o in (runs.with_pendulum, runs.without_pendulum))
        # The loss of one tenth of the runs that end at rest is tolerated, because single runs are chaotic.
        at_rest, without = rests
        add_reason(ReasonKind.rests_less, at_rest, without, total=total, low=(1.0 - REST_LOSS) * without)
    # The first part is the worst one. The reason mentions how many others there are.
    if runs.worse_parts:
        first = runs.worse_parts[0]
        where = {"condition": first.label, "total": len(runs.worse_parts)}
        add_reason(ReasonKind.worse_condition, first.with_pendulum, first.without_pendulum, **where)
    # The mean over all runs may hide a kind of start after which the pendulum does not help.
    if runs.starts_without_benefit:
        first = runs.starts_without_benefit[0]
        where = {"condition": first.label}
        add_reason(ReasonKind.no_benefit, first.with_pendulum, first.without_pendulum, **where)
    measure, required = requirements.reduce or runs.first_measure, requirements.at_least
    if not runs.excess_reduction(measure, required, CERTAIN * required) >= 0.0:
        gain = runs.reduction(measure)[0]
        more: dict[str, Any] = {"low": gain.low, "high": gain.high, "measure": measure}
        # An annual rate is no share of the runs.
        if measure != "rate":
            change = runs.change("overturned" if measure == "overturning" else "mean tilt")
            more |= {n: getattr(change, n) for n in ("with_pendulum", "without_pendulum")}
        add_reason(ReasonKind.too_little_benefit, gain.mean, required, **more)
    return out
