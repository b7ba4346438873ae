"""A design that went through the verification, the bare block beside it, and what each step found."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tpd.answers.ensemble import Outcomes
from tpd.answers.paired import FEWER, Benefit, Verdict
from tpd.answers.statistics import Share
from tpd.design.criteria import Evaluation
from tpd.design.descend import Active
from tpd.design.survey import Survey


class DesignStatus(enum.Enum):
    """Outcome of a search for designs; the value is the sentence that a report opens with."""

    def __new__(cls, said: str, remedy: str) -> DesignStatus:
        """Make a member of its sentence, with what to do about it."""
        made = object.__new__(cls)
        made._value_ = said
        made._remedy = remedy
        return made

    _remedy: str

    found = (
        "A PENDULUM WAS FOUND: over runs by the nonlinear equations that no choice has seen the block rocks "
        "less with it, and no group of runs shows significant harm. That is no verdict of safety: read the "
        "shares.",
        "Check it by earthquakes and by an engine with contact before it is hung.",
    )
    tuned_only = (
        "A PENDULUM WAS TUNED TO THESE MOTIONS ALONE: there is no other earthquake to judge it on, so that "
        "nothing is claimed about the next.",
        "Give records of other earthquakes, or a share that is held out.",
    )
    too_few = ("TOO FEW EARTHQUAKES TO JUDGE: nothing is claimed.", "Give records of more earthquakes.")
    undecided = (
        "UNDECIDED: runs have no answer, and the verdict hangs on how they would have ended.",
        "Give more runs or records, or less shaking.",
    )
    refused = (
        "NO PENDULUM WORTH HANGING: no design that the search found passes the verification.",
        "Widen the design space, ask for less benefit, or give the bob more room.",
    )
    none_feasible = (
        "NO PENDULUM WORTH HANGING: no design that was tried in this space keeps to the limits.",
        "Widen the design space, or loosen the limit that the nearest design breaks.",
    )
    no_uplift = (
        "NO PENDULUM IS NEEDED FROM REST: under all conditions the bare block stays or settles at rest. "
        "Pushed hard enough it may rock or overturn all the same.",
        "Give a stronger shaking to see what the block stands.",
    )

    @property
    def remedy(self) -> str:
        """Sentence on how to go on."""
        return self._remedy

    @property
    def is_sound(self) -> bool:
        """Whether the answer may be used: a design found and judged, or none needed."""
        return self in (DesignStatus.found, DesignStatus.no_uplift)


ANSWERS = tuple(DesignStatus.__members__)
"""Names of the statuses that an answer may have."""


class Step(enum.Enum):
    """Steps of the verification, in order."""

    exact = "exact solution by events"
    nonlinear = "nonlinear equations"
    benefit = "paired runs of the nonlinear equations"
    judgement = "fresh paired runs of the nonlinear equations"


class ReasonKind(enum.Enum):
    """Why a design is refused; the value is the sentence, with the numbers of a `Reason`."""

    overturns = "the block overturns from rest, or has no answer, and stands without the pendulum"
    overturns_more = (
        "the block overturns in {value:.0f} of {total} cases with the pendulum only, and in {reference:.0f} "
        "without it only{at}"
    )
    breaks_limit = "the design exceeds the limit on {limit} by {excess:.2g} of it{at}"
    rocks_more = (
        "the block tilts from rest to {value:.1%} of the slenderness, and to {reference:.1%} without the "
        "pendulum"
    )
    too_little_benefit = (
        "the mean tilt {falls} (at least {sure} with 95 % confidence), and {reference:.1%} is asked for"
    )
    rests_less = (
        "the block ends at rest in {value:.0f} of {total} cases with the pendulum, and in {reference:.0f} "
        "without it; {fewer:.0%} fewer are allowed"
    )
    worse_condition = (
        "the mean tilt is {value:.1%} of the slenderness with the pendulum, and {reference:.1%} without "
        "it{at}{others}"
    )
    strikes = "the bob strikes a wall in {value:.1%} of the cases, and {reference:.1%} is allowed"
    as_built = "as built, the {limit} is {value:.4g}, and the limit is {reference:.4g}"
    undecided = "{value:.0f} of {total} cases have no answer, and the verdict hangs on it"


@dataclass(frozen=True, kw_only=True)
class Reason:
    """One reason why a design is refused, as data; `str` makes a sentence of it."""

    step: Step
    kind: ReasonKind
    condition: str = ""
    """Label of the condition, if the reason belongs to one."""
    limit: str = ""
    """Name of the limit that is broken."""
    value: float = math.nan
    """The size met: a tilt over the slenderness, a count, or a limited quantity over its limit."""
    reference: float = math.nan
    """The size it is compared with."""
    low: float = math.nan
    """Lower end of the 95 % interval of the size met, where it has one."""
    total: int = 0
    """Conditions or runs tried, where counts are compared."""

    @property
    def shortfall(self) -> float:
        """By how much the requirement is missed: a share of the runs, of the tilt or of the limit; 1 where
        the motion itself is refused."""
        match self.kind:
            case ReasonKind.overturns_more:
                return abs(self.value - self.reference) / max(self.total, 1)
            case ReasonKind.rests_less:
                return ((1.0 - FEWER) * self.reference - self.value) / max(self.total, 1)
            case ReasonKind.strikes | ReasonKind.worse_condition:
                return self.value - self.reference
            case ReasonKind.too_little_benefit:
                # A benefit above the least one is refused because it may be luck.
                return max(self.reference - self.value, -self.low, 0.0)
            case ReasonKind.breaks_limit:
                return self.value - 1.0
            case ReasonKind.as_built:
                return self.value / self.reference - 1.0
            case ReasonKind.rocks_more if self.reference > 0.0:
                return self.value / self.reference - 1.0
            case _:
                return 1.0

    def __str__(self) -> str:
        fall = self.value if self.kind is ReasonKind.too_little_benefit else 0.0
        said = self.kind.value.format(
            **vars(self),
            at=f" at {self.condition}" if self.condition else "",
            excess=self.value - 1.0,
            falls=f"falls by {fall:.1%}" if fall >= 0.0 else f"grows by {-fall:.1%}",
            sure="unknown" if math.isnan(self.low) else f"{self.low:.1%}",
            fewer=FEWER,
            others=f", and {self.total - 1} other conditions are worse" if self.total > 1 else "",
        )
        return said if self.kind is ReasonKind.as_built else f"by the {self.step.value} {said}"


GRAVE = (ReasonKind.overturns, ReasonKind.overturns_more, ReasonKind.strikes)
"""Reasons that are dangers: the block overturns, or the bob strikes it."""


def one_of_a_kind(reasons: Iterable[Reason]) -> list[Reason]:
    """The first of all reasons of a kind: several conditions may break one limit."""
    kinds: dict[tuple[ReasonKind, str], Reason] = {}
    for reason in reasons:
        kinds.setdefault((reason.kind, reason.limit), reason)
    return list(kinds.values())


@dataclass(frozen=True, kw_only=True)
class Nearest:
    """Where no design keeps to the limits: the design of least excess."""

    design: np.ndarray
    """(mu, lam, zeta)."""
    broken: tuple[Reason, ...]


@dataclass(frozen=True, kw_only=True)
class Motions:
    """Settled motions from rest under every condition by the exact solution; arrays of shape (n,)."""

    status: np.ndarray
    """Names of statuses."""
    amplitude: np.ndarray
    """|phi|, rad; infinite where the block overturns."""
    stroke: np.ndarray
    """|psi|, rad."""
    peak: np.ndarray
    """Largest |phi| from the start on, rad."""
    peak_stroke: np.ndarray
    """Largest |psi| from the start on, rad."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers; NaN where unknown."""
    periods: np.ndarray
    """Forcing periods in one period of the motion."""


@dataclass(frozen=True, kw_only=True)
class Verified:
    """A design that went through the verification; angles in rad."""

    mass_ratio: float
    length_ratio: float
    damping_ratio: float
    value: float
    """Risk of the merits, tilts over nu; see `Evaluation`."""
    evaluation: Evaluation
    """Under every condition by the search's objective, leading axis 1."""
    exact: Motions
    """By the exact solution of the linear equations."""
    margin: np.ndarray
    """Uplift margin under every condition, shape (n,)."""
    rest: Survey | None
    """Motions from rest by the nonlinear equations under the conditions, a choice of them where there are
    many; of this design alone. None where the verification ended before that step."""
    paired: Verdict | None
    """Paired runs of the nonlinear equations, which decide: of a design that was chosen the fresh ones that
    judge it."""
    benefit: Benefit | None
    """Benefit by these."""
    strikes: float
    """Share of these in which the bob strikes a wall; NaN where no room is asked for."""
    stationarity: float
    """Decrease of the risk that is left, to first order, per unit of a step in shares of the bounds."""
    active: tuple[Active, ...]
    source: str
    """`survey` or `check`."""
    reasons: tuple[Reason, ...]
    """Why it is refused; empty if it is offered."""
    chosen_by: Benefit | None = None
    """Benefit by the runs that chose it, where fresh ones have judged it; it is a little too good."""

    @property
    def design(self) -> np.ndarray:
        """(mu, lam, zeta)."""
        return np.array([self.mass_ratio, self.length_ratio, self.damping_ratio])


@dataclass(frozen=True, kw_only=True)
class LossCase:
    """The offered design by the nonlinear equations under one model of the block's losses."""

    name: str
    """"friction", "impacts" or "friction and impacts"."""
    friction: float
    velocity_ratio: float
    """e of the bare block."""
    benefit: Benefit
    overturned: Share
    overturned_bare: Share
    at_rest: Share
    at_rest_bare: Share


@dataclass(frozen=True, kw_only=True)
class Bare:
    """The block without a pendulum under every condition."""

    value: float
    evaluation: Evaluation
    exact: Motions
    paired: Outcomes | None = None
    """Runs of the nonlinear equations."""
