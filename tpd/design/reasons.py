"""Outcomes of a design problem, and the reasons against a pendulum, as data and as sentences."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable
from dataclasses import dataclass

from tpd.design.criteria import LABELS


class DesignStatus(enum.Enum):
    """Outcome of a design problem; the value is a sentence of the report."""

    def __new__(cls, sentence: str, remedy: str) -> DesignStatus:
        """Make a member of its sentence, with what to do about it."""
        made = object.__new__(cls)
        made._value_ = sentence
        made._remedy = remedy
        return made

    _remedy: str

    recommended = (
        "RECOMMENDED for the stated conditions: in validation runs of the nonlinear equations the pendulum "
        "has the required benefit, and under no condition does it do significant harm. This is not a "
        "safety assessment.",
        "Check it with earthquakes and with a contact engine before it is built.",
    )
    tuned_only = (
        "TUNED TO THESE MOTIONS ONLY: there is no other earthquake to validate the pendulum on, so "
        "nothing is claimed about the next earthquake.",
        "Give records of other earthquakes, or a share that is held out.",
    )
    too_few = (
        "TOO FEW EARTHQUAKES to validate a pendulum: nothing is claimed.",
        "Give records of more earthquakes.",
    )
    undecided = (
        "UNDECIDED: some runs have no answer, and the verdict depends on how they would have ended.",
        "Give more runs or records, or a weaker excitation.",
    )
    not_recommended = (
        "NOT RECOMMENDED: no pendulum that the search found passes the validation.",
        "Widen the design space, require less benefit, or give the bob more clearance.",
    )
    none_feasible = (
        "NOT RECOMMENDED: no pendulum that was evaluated keeps to the limits.",
        "Widen the design space, or loosen the limit that the nearest design exceeds.",
    )
    no_uplift = (
        "NOT NEEDED: under all conditions the block without a pendulum stays at rest. After a strong enough "
        "push it may still rock or overturn.",
        "Give a stronger excitation to see what the block can withstand.",
    )
    slides = (
        "NOT APPLICABLE: the block slides on its base before it lifts, and does not rock. A pendulum against "
        "rocking does not help it.",
        "Fix the base against sliding, or check the coefficient of friction of the base.",
    )

    @property
    def remedy(self) -> str:
        """Sentence on how to go on."""
        return self._remedy

    @property
    def is_sound(self) -> bool:
        """Whether the answer may be used: a validated pendulum, or none is needed."""
        return self in (DesignStatus.recommended, DesignStatus.no_uplift)


OFFERED = DesignStatus.recommended, DesignStatus.tuned_only
"""Statuses with a pendulum."""


CERTAIN = 0.5
"""Share of the required reduction that the lower end of its 95 % interval must exceed."""


class ReasonKind(enum.Enum):
    """Why a pendulum is not recommended; the value is the sentence, with the numbers of a `Reason`."""

    overturns_more = (
        "the block overturns in {value:.0f} of {total} runs{of} only with the pendulum, and in "
        "{reference:.0f} only without it"
    )
    touches_wall = (
        "the pendulum exceeds the limit on {limit} in {value:.1%} of the runs in which the block stands, and "
        "{reference:.1%} are allowed"
    )
    breaks_limit = "the design exceeds the limit on {limit}: {value:.3g} times the limit"
    worse_condition = (
        "the mean tilt is {value:.1%} of the slenderness with the pendulum, and {reference:.1%} without it, "
        "for {condition}{others}"
    )
    rests_less = (
        "the block ends at rest in {value:.0f} of {total} runs with the pendulum, and in {reference:.0f} "
        "without it; the loss of one tenth is allowed"
    )
    too_little_benefit = (
        "the {falls}, and a significant reduction of {reference:.1%} with an interval from at least "
        "{certain:.1%} is required"
    )
    slides = (
        "while the block rocks with the pendulum, its base needs a coefficient of friction of {value:.2g}, "
        "but has {reference:.2g}: the base would slide, and the equations have no sliding"
    )
    undecided = "{value:.0f} of {total} runs have no answer, and the verdict depends on them"


@dataclass(frozen=True, kw_only=True)
class Reason:
    """One reason against a pendulum, as data; `str` makes a sentence of it."""

    kind: ReasonKind
    condition: str = ""
    """Label of the condition, the group of motions or the kind of start, if the reason belongs to one."""
    limit: str = ""
    """Name of the limit that is exceeded."""
    value: float = math.nan
    """A tilt over the slenderness, a count, a share, or a limited quantity over its limit."""
    reference: float = math.nan
    """The number that the value is compared with."""
    low: float = math.nan
    """Lower end of the 95 % interval of the value, where it has one; of a count the least that is allowed."""
    total: int = 0
    """Number of the runs, or of the conditions."""
    measure: str = "tilt"
    """Measure that falls too little, "tilt" or "overturning"."""

    @property
    def shortfall(self) -> float:
        """By how much the requirement is missed: a share of the runs, of the tilt or of the limit."""
        match self.kind:
            case ReasonKind.overturns_more:
                return abs(self.value - self.reference) / max(self.total, 1)
            case ReasonKind.rests_less:
                return (self.low - self.value) / max(self.total, 1)
            case ReasonKind.touches_wall | ReasonKind.worse_condition | ReasonKind.slides:
                return self.value - self.reference
            case ReasonKind.too_little_benefit if math.isfinite(self.value):
                # A benefit above the least one may be refused because it is not significant.
                return max(self.reference - self.value, -max(self.low, -1.0), 0.0)
            case ReasonKind.breaks_limit:
                return self.value - 1.0
            case _:
                return 1.0

    @property
    def _fall_in_words(self) -> str:
        """The value as a fall of the measure, with its interval as far as it is known."""
        overturning = self.measure == "overturning"
        of = "share of runs that overturn" if overturning else "mean tilt"
        if math.isnan(self.value):
            why = " (no run overturns without the pendulum)" if overturning else ""
            return f"change of the {of} is unknown{why}"
        # Of a single earthquake nothing is known but the mean.
        low = f"from {self.low:.1%}" if math.isfinite(self.low) else "unknown"
        falls = f"falls by {self.value:.1%}" if self.value >= 0.0 else f"increases by {-self.value:.1%}"
        return f"{of} {falls} (95 % interval {low})"

    def __str__(self) -> str:
        return self.kind.value.format(
            **vars(self) | {"limit": LABELS.get(self.limit, self.limit)},
            falls=self._fall_in_words,
            certain=CERTAIN * self.reference,
            of=f" ({self.condition})" if self.condition else "",
            others=f", and higher under {self.total - 1} other conditions" if self.total > 1 else "",
        )


GRAVE = (ReasonKind.overturns_more, ReasonKind.touches_wall, ReasonKind.slides)
"""Reasons that are dangers: the block overturns or slides, or the bob touches a wall."""


def one_of_a_kind(reasons: Iterable[Reason]) -> list[Reason]:
    """Return the first reason of each kind and limit, the dangers first."""
    kinds: dict[tuple[ReasonKind, str], Reason] = {}
    for reason in reasons:
        kinds.setdefault((reason.kind, reason.limit), reason)
    return sorted(kinds.values(), key=lambda reason: reason.kind not in GRAVE)
