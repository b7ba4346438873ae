"""Outcomes of a design problem, and the reasons against a pendulum as data and as sentences."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tpd.core.formatting import ends, number, pair_of, per_cent, percent
from tpd.limits import LABELS, LIMIT_KINDS, MEASURED, Limit, Reserve, Worsening
from tpd.scene.ground_motion import LEAST_EARTHQUAKES

if TYPE_CHECKING:
    # This module loads JAX, and the commands read a design before they wait for that.
    from tpd.answers.paired import PairedRuns


STAYS = "under all conditions the block without a pendulum stays at rest"
AFTER_PUSH = "After a strong enough push it may still rock or overturn."
"""Sentence on a block that stays at rest."""


class DesignStatus(enum.Enum):
    """Outcome of a design problem. The value of a member is a sentence of the report."""

    def __new__(cls, head: str, explanation: str, remedy: str) -> DesignStatus:
        """Create a member from the parts of its sentence and from the advice on what to do next."""
        member = object.__new__(cls)
        member._value_ = f"{head}: {explanation}"
        member.head, member.remedy = head, remedy
        return member

    head: str
    """Beginning of the sentence."""
    remedy: str
    """Sentence with advice on what to do next."""

    recommended = (
        "RECOMMENDED",
        "in validation runs of the nonlinear model the pendulum "
        "has the required benefit, and under no condition does it do significant harm. This is not a "
        "safety assessment.",
        "Check it with earthquakes and with a contact engine before it is built.",
    )
    not_to_be_built = (
        "NOT TO BE BUILT AS IT IS",
        "the pendulum passes the validation, but the search considered only one "
        "excitation, or a bob without size and no walls.",
        "Give a band of frequencies, the width of the cavity, and the limit on clearance.",
    )
    tuned_only = (
        "TUNED TO THESE MOTIONS ONLY",
        "all of them were used for the search. The benefit in other earthquakes is unknown.",
        "Give records of other earthquakes, or a share of the records for the validation.",
    )
    too_few = (
        "TOO FEW EARTHQUAKES to validate a pendulum",
        f"at least {LEAST_EARTHQUAKES} earthquakes are needed, and with a validation share also "
        f"{LEAST_EARTHQUAKES} for the search.",
        "Give records of more earthquakes.",
    )
    undecided = (
        "UNDECIDED",
        "some runs have no result, and the verdict depends on how they would have ended.",
        "Give more runs or records, or a weaker excitation.",
    )
    not_recommended = (
        "NOT RECOMMENDED",
        "no pendulum that the search found passes the validation.",
        "Widen the design space, or change what can be built: the cavity, the bob or its damper.",
    )
    none_feasible = (
        "NOT RECOMMENDED",
        "every pendulum that was evaluated exceeds a limit.",
        "Widen the design space, or change what can be built: the cavity, the bob or its damper.",
    )
    no_uplift = (
        "NOT NEEDED",
        f"{STAYS}. {AFTER_PUSH}",
        "Give a stronger excitation to see what the block can withstand.",
    )
    slides = (
        "NOT APPLICABLE",
        "the block slides on its base before it lifts, and does not rock. A pendulum against "
        "rocking does not help it.",
        "Fix the base against sliding, or check the coefficient of friction of the base.",
    )

    @property
    def is_sound(self) -> bool:
        """Whether the design may be used: the pendulum is recommended, or no pendulum is needed."""
        return self in (DesignStatus.recommended, DesignStatus.no_uplift)

    def headline(self, reasons: Sequence[str]) -> str:
        """Return the sentence of the status, with the first reason if that is more informative."""
        if self in _REASONED and reasons:
            return f"{self.head}: {reasons[0]}."
        return self.value

    def other(self, reasons: Sequence[str]) -> Sequence[str]:
        """Return the reasons that `headline` does not contain."""
        return reasons[self in _REASONED :]


REJECTED = DesignStatus.not_recommended, DesignStatus.none_feasible, DesignStatus.undecided
"""Statuses of a design that does not pass the validation."""
_REASONED = *REJECTED, DesignStatus.not_to_be_built
"""Statuses for which the first reason is more informative than the sentence of the status."""
VALIDATED = DesignStatus.recommended, DesignStatus.not_to_be_built
"""Statuses of a design whose pendulum passes the validation."""
OFFERED = *VALIDATED, DesignStatus.tuned_only
"""Statuses of a design that has a pendulum."""


CERTAIN = 0.5
"""Share of the required reduction that the lower end of the 95 % interval of the reduction must exceed."""


_DANGER_RATIO = 2.0
"""Ratio of the runs beyond a limit to the allowed ones from which an excess is a danger."""


_UNKNOWN = {
    "overturning": " (no run overturns without the pendulum)",
    "rate": " (the runs with or without the pendulum determine no curve, which other levels may do)",
}
"""Why the change of a measure is unknown."""


class ReasonKind(enum.Enum):
    """Reason why a pendulum is not recommended. The value is a sentence with places for the fields of
    `Reason`."""

    overturns_more = (
        "of {total} paired runs{of}, the pendulum causes overturning in {value} and prevents it in "
        "{reference}"
    )
    touches_wall = "the bob touches a wall in {value} of the surviving runs; at most {reference} are allowed"
    exceeds_limit = (
        "the pendulum exceeds the limit on {limit} in {value} of the surviving runs; at most "
        "{reference} are allowed"
    )
    breaks_limit = "the design exceeds the limit on {limit}: {excess}"
    worse_condition = (
        "the mean tilt is {value} of the toppling tilt with the pendulum, and {reference} without it, "
        "for {condition}{others}"
    )
    no_benefit = (
        "the mean tilt is {value} of the toppling tilt with the pendulum, and {reference} without it, in the "
        "runs {condition}: this is no reduction"
    )
    rests_less = (
        "the block ends at rest in {value} of {total} runs with the pendulum, and in {reference} "
        "without it; this number may fall by at most 10 %"
    )
    too_little_benefit = "the {falls}; required: {required}"
    slides = (
        "while the block rocks with the pendulum, its base needs a coefficient of friction of {value}, "
        "but has {reference}: the base would slide, and the equations have no sliding"
    )
    undecided = "{value} of {total} runs have no result, and the verdict depends on them"


@dataclass(frozen=True, kw_only=True)
class Reason:
    """Reason against a pendulum, as data. `str` returns the sentence."""

    kind: ReasonKind
    condition: str = ""
    """Label of the condition, the group of motions or the kind of initial state; empty if the reason concerns
    all runs."""
    limit: str = ""
    """Name of the limit that is exceeded."""
    value: float = math.nan
    """Number that breaks the requirement: a tilt over the slenderness, a number of runs, a share, or a
    limited quantity."""
    reference: float = math.nan
    """The number that the value is compared with."""
    low: float = math.nan
    """Lower end of the 95 % interval of the value, if it has one. For a number of runs: the smallest number
    that is allowed."""
    high: float = math.nan
    """Upper end of the 95 % interval of the value, if it has one."""
    total: int = 0
    """Number of runs, or of conditions, that the value was counted in."""
    measure: str = "tilt"
    """Measure whose reduction is too small: "tilt" or "overturning"."""
    with_pendulum: float = math.nan
    """Measure with the pendulum, if its reduction is too small; NaN for a rate."""
    without_pendulum: float = math.nan
    """Measure without the pendulum."""

    @property
    def shortfall(self) -> float:
        """Amount by which the requirement is missed, as a share of the runs, of the tilt or of the limit."""
        kinds, excess = ReasonKind, self.value - self.reference
        match self.kind:
            case kinds.overturns_more:
                return excess / max(self.total, 1)
            case kinds.rests_less:
                return (self.low - self.value) / max(self.total, 1)
            case kinds.too_little_benefit if math.isfinite(self.value):
                # A benefit that is large enough may still be rejected because it is not significant. The
                # shortfall is then the distance of the interval from zero.
                return max(-excess, -max(self.low, -1.0), 0.0)
            case kinds.too_little_benefit | kinds.undecided:
                return 1.0
        # An increase is related to the whole quantity, and a lower bound is missed from above.
        if self.kind is kinds.breaks_limit:
            excess = abs(excess) / (self.reference + (self.limit == Worsening.name))
        # A quantity that is not known is no limit that is kept.
        return math.inf if math.isnan(excess) else excess

    @property
    def is_danger(self) -> bool:
        """Whether the block overturns more often or slides, or the bob touches a wall far too often."""
        # A share just above the allowed one may be chance: other runs of this design may keep the limit.
        far = not self.value <= _DANGER_RATIO * self.reference
        always = self.kind in (ReasonKind.overturns_more, ReasonKind.slides)
        return always or (self.kind is ReasonKind.touches_wall and far)

    @property
    def _numbers(self) -> dict[str, str]:
        """Numbers of the sentence, with the digits that show on which side of the limit each of them is."""
        kinds = ReasonKind
        counts = dict.fromkeys((kinds.overturns_more, kinds.rests_less, kinds.undecided), 9)
        digits = (counts | {kinds.slides: 2, kinds.breaks_limit: 3}).get(self.kind)
        # Shares of runs, tilts and their increases are in per cent.
        form, digits = (number, digits) if digits and self.limit != Worsening.name else (percent, 1)
        value, reference = pair_of(self.value, self.reference, digits, form)
        kind = next((x for x in LIMIT_KINDS if x.name == self.limit), Limit)
        excess = f"{value} times the limit"
        # A size without a unit is already divided by its limit.
        if kind.unit or self.reference != 1.0:
            bound = "at least" if kind is Reserve else "at most"
            excess = f"{' '.join([value, kind.unit]).rstrip()}, but {bound} {reference} is allowed"
        return {"value": value, "reference": reference, "excess": excess, **self._fall(value, reference)}

    def _fall(self, value: str, reference: str) -> dict[str, str]:
        """Return the texts on a reduction that is too small: what it is, and what is required."""
        # A negative reduction is described as an increase.
        rise = pair_of(-self.value, -self.reference, 1, percent)[0]
        certain, of = CERTAIN * self.reference, MEASURED.get(self.measure, MEASURED["tilt"])
        is_fall = not self.value < 0.0
        falls = f"{of} {'falls' if is_fall else 'increases'} by {value if is_fall else rise}"
        if math.isfinite(self.without_pendulum):
            falls += f", from {percent(self.without_pendulum, 1)} to {percent(self.with_pendulum, 1)}"
        # The lower end has the digits that show on which side of the required one it is.
        low, least = pair_of(self.low, certain, 1, per_cent)
        if math.isnan(self.value):
            falls = f"change of the {of} is unknown{_UNKNOWN.get(self.measure, '')}"
        elif math.isfinite(self.low):
            # The interval of an increase has the other sign, and begins at the other end.
            around = f"{low} to {percent(self.high, 1)}" if is_fall else ends(-self.high, -self.low, 1)
            falls += f" (95 % interval {around})"
        else:
            falls += " (too few earthquakes or overturned runs for an interval)"
        # Only what is missed is listed, so that the reason is clear.
        missed = [] if self.value >= self.reference else [f"a reduction of at least {reference}"]
        missed += [] if self.low >= certain else [f"an interval that begins above {least} %"]
        required = " and ".join(missed) if missed and self.reference > 0.0 else "a significant reduction"
        return {"falls": falls, "required": required}

    def __str__(self) -> str:
        return self.kind.value.format(
            **vars(self) | self._numbers | {"limit": LABELS.get(self.limit, self.limit)},
            of=f" ({self.condition})" if self.condition else "",
            others=f", and higher under {self.total - 1} other condition{'s' if self.total > 2 else ''}"
            if self.total > 1
            else "",
        )


def one_of_a_kind(reasons: Iterable[Reason]) -> list[Reason]:
    """Return the first reason of each kind and limit. Reasons that are dangers come first."""
    kinds: dict[tuple[ReasonKind, str], Reason] = {}
    for reason in reasons:
        kinds.setdefault((reason.kind, reason.limit), reason)
    return sorted(kinds.values(), key=lambda reason: not reason.is_danger)


def reduction(runs: PairedRuns, measure: str) -> str:
    """Return sentences with the share of the runs that still overturn, and then with the reductions of both
    measures and their intervals, without the final period.

    The required measure comes first. The reduction of overturning is left out if it is rare and was not
    required, or if no run overturns without the pendulum.
    """
    usual, other = runs.first_measure, "tilt" if measure == "overturning" else "overturning"
    falls = runs.change("overturned").without_pendulum > 0.0
    measures = [measure, *([] if other == "overturning" != usual else [other])] if falls else ["tilt"]
    others = [reduced(runs, m) for m in measures]
    if falls:
        # The mean may fall mainly because fewer runs overturn, which count as 100 %.
        tilt = runs.change("median tilt")
        pendulum, without = (percent(x) for x in (tilt.with_pendulum, tilt.without_pendulum))
        others.append(
            f"the mean counts a run that overturns as 100 % of the toppling tilt; the median is {pendulum} "
            f"({without} without it)"
        )
    return ". ".join([overturned(runs), *(text[0].upper() + text[1:] for text in others)])


def overturned(runs: PairedRuns) -> str:
    """Return a clause with the shares of the runs that overturn with and without the pendulum."""
    shares = runs.change("overturned")
    pendulum, without = (percent(x, 1) for x in (shares.with_pendulum, shares.without_pendulum))
    if shares.with_pendulum > 0.0:
        still = "still " if shares.without_pendulum > 0.0 else ""
        return f"with the pendulum {pendulum} of the runs {still}overturn ({without} without it)"
    if shares.without_pendulum > 0.0:
        return f"with the pendulum no run overturns ({without} without it)"
    return "no run overturns, with the pendulum or without it"


def reduced(runs: PairedRuns, measure: str) -> str:
    """Return a clause with the reduction of one measure of `tpd.limits.MEASURED`, and its interval."""
    size, significant = runs.reduction(measure)
    name = MEASURED[measure]
    if math.isnan(size.mean):
        return f"the reduction of the {name} is unknown"
    is_less, by, around = size.fall_in_words()
    doubt = ", which is not significant" if is_less and not significant else ""
    return f"the pendulum {'reduces' if is_less else 'increases'} the {name} by {by}{around}{doubt}"
