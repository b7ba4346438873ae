"""Outcomes of a design problem, and the reasons against a pendulum as data and as sentences."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable
from dataclasses import dataclass

from tpd.core.formatting import compared, number, percent
from tpd.limits import LABELS, MEASURED
from tpd.scene.ground_motion import LEAST_EARTHQUAKES


class DesignStatus(enum.Enum):
    """Outcome of a design problem. The value of a member is a sentence of the report."""

    def __new__(cls, sentence: str, remedy: str) -> DesignStatus:
        """Create a member from its sentence and from the advice on what to do next."""
        member = object.__new__(cls)
        member._value_ = sentence
        member._remedy = remedy
        return member

    _remedy: str

    recommended = (
        "RECOMMENDED for the stated conditions: in validation runs of the nonlinear equations the pendulum "
        "has the required benefit, and under no condition does it do significant harm. This is not a "
        "safety assessment.",
        "Check it with earthquakes and with a contact engine before it is built.",
    )
    tuned_only = (
        "TUNED TO THESE MOTIONS ONLY: all of them were used for the search. The benefit in other "
        "earthquakes is unknown.",
        "Give records of other earthquakes, or a share of the records for the validation.",
    )
    too_few = (
        f"TOO FEW EARTHQUAKES to validate a pendulum: at least {LEAST_EARTHQUAKES} earthquakes for the "
        f"search and {LEAST_EARTHQUAKES} others for the validation are needed.",
        "Give records of more earthquakes.",
    )
    undecided = (
        "UNDECIDED: some runs have no result, and the verdict depends on how they would have ended.",
        "Give more runs or records, or a weaker excitation.",
    )
    not_recommended = (
        "NOT RECOMMENDED: no pendulum that the search found passes the validation.",
        "Widen the design space, require less benefit, or give the bob more clearance.",
    )
    none_feasible = (
        "NOT RECOMMENDED: every pendulum that was evaluated exceeds a limit.",
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
        """Sentence with advice on what to do next."""
        return self._remedy

    @property
    def is_sound(self) -> bool:
        """Whether the design may be used: the pendulum is validated, or no pendulum is needed."""
        return self in (DesignStatus.recommended, DesignStatus.no_uplift)


OFFERED = DesignStatus.recommended, DesignStatus.tuned_only
"""Statuses of a design that has a pendulum."""


CERTAIN = 0.5
"""Share of the required reduction that the lower end of the 95 % interval of the reduction must exceed."""


_FAR = 2.0
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
    touches_wall = (
        "the pendulum exceeds the limit on {limit} in {value} of the surviving runs; at most "
        "{reference} are allowed"
    )
    breaks_limit = "the design exceeds the limit on {limit}: {value} times the limit"
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
    limited quantity over its limit."""
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

    @property
    def shortfall(self) -> float:
        """Amount by which the requirement is missed, as a share of the runs, of the tilt or of the limit."""
        match self.kind:
            case ReasonKind.breaks_limit | ReasonKind.touches_wall | ReasonKind.slides if math.isnan(
                self.value
            ):
                # A quantity that is not known is no limit that is kept.
                return math.inf
            case ReasonKind.overturns_more:
                return abs(self.value - self.reference) / max(self.total, 1)
            case ReasonKind.rests_less:
                return (self.low - self.value) / max(self.total, 1)
            case ReasonKind.no_benefit:
                return max(self.value - self.reference, 0.0)
            case ReasonKind.touches_wall | ReasonKind.worse_condition | ReasonKind.slides:
                return self.value - self.reference
            case ReasonKind.too_little_benefit if math.isfinite(self.value):
                # A benefit that is large enough may still be rejected because it is not significant. The
                # shortfall is then the distance of the interval from zero.
                return max(self.reference - self.value, -max(self.low, -1.0), 0.0)
            case ReasonKind.breaks_limit:
                return self.value - 1.0
            case _:
                return 1.0

    @property
    def is_danger(self) -> bool:
        """Whether the block overturns more often or slides, or the bob touches a wall far too often."""
        # A share just above the allowed one may be chance: other runs of this design may keep the limit.
        far = not self.value <= _FAR * self.reference
        always = self.kind in (ReasonKind.overturns_more, ReasonKind.slides)
        return always or (self.kind is ReasonKind.touches_wall and far)

    @property
    def _numbers(self) -> dict[str, str]:
        """Numbers of the sentence, with the digits that show on which side of the limit each of them is."""
        counts = ReasonKind.overturns_more, ReasonKind.rests_less, ReasonKind.undecided
        ratios = ReasonKind.slides, ReasonKind.breaks_limit
        form, digits = (number, 9) if self.kind in (*counts, *ratios) else (percent, 1)
        digits = {ReasonKind.slides: 2, ReasonKind.breaks_limit: 3}.get(self.kind, digits)
        # A limited quantity is over its limit.
        limit = 1.0 if self.kind is ReasonKind.breaks_limit else self.reference
        value, reference = compared(self.value, limit, digits, form)
        low, certain = compared(self.low, CERTAIN * self.reference, 1, percent)
        of = MEASURED.get(self.measure, MEASURED["tilt"])
        falls = f"{of} {'increases' if value.startswith('-') else 'falls'} by {value.lstrip('-')}"
        if math.isnan(self.value):
            why = _UNKNOWN.get(self.measure, "")
            falls = f"change of the {of} is unknown{why}"
        elif math.isfinite(self.low):
            # The lower end has the digits that show on which side of the required one it is.
            falls += f" (95 % interval {low.removesuffix(' %')} to {percent(self.high, 1)})"
        else:
            falls += " (too few earthquakes or overturned runs for an interval)"
        required = "a significant reduction"
        if self.reference > 0.0:
            required = f"a reduction of at least {reference}, and an interval that begins above {certain}"
        return {"value": value, "reference": reference, "falls": falls, "required": required}

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
