"""The answer of `optimise`: what was found, how it was verified, and why a design was refused."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.analysis.ensemble import Ensemble
from tpd.analysis.outcomes import Outcomes
from tpd.analysis.paired import Verdict
from tpd.core.conditions import Conditions
from tpd.core.formatting import Printed
from tpd.core.scene import Pendulum, Scene
from tpd.design.criteria import Limit, Risk, stroke_limit
from tpd.design.space import DesignSpace

if TYPE_CHECKING:
    from tpd.design.methods import Method
    from tpd.design.objective import Evaluation


class DesignStatus(enum.Enum):
    """Worth of the answer; the value is the sentence that a report opens with."""

    found = (
        "A pendulum was found that lessens the settled rocking under the stated conditions; the exact "
        "solution of the linear equations confirms it, and neither shakings within 1 %, the nonlinear "
        "equations nor the ensemble speak against it. That is no verdict of safety: read the shares."
    )
    refused = "NO DESIGN TO OFFER: no design that the search found passes the verification."
    no_improvement = "NO PENDULUM in this design space rocks less than the bare block under these conditions."
    none_feasible = "NO DESIGN in this space keeps to the limits under all conditions."
    no_uplift = (
        "NO PENDULUM IS NEEDED FROM REST: under all conditions the bare block settles at rest. Pushed hard "
        "enough it may rock or overturn all the same."
    )
    interrupted = "INTERRUPTED: what follows is the best that had been found by then, if anything."

    @property
    def is_sound(self) -> bool:
        """Whether the answer may be used: a design found and verified, or none needed."""
        return self in (DesignStatus.found, DesignStatus.no_uplift)


class SearchStatus(enum.Enum):
    """How one search ended."""

    rests = "found designs that settle at rest; the uplift margin grew as far as it goes"
    converged = "reached a minimum of the risk"
    at_bound = "reached the edge of the design space"
    stroke_limited = "reached the stroke limit"
    steps_exhausted = "was still improving when the steps ran out"
    infeasible = "met no design within the limits"
    interrupted = "had not ended when the search was interrupted"


class Step(enum.Enum):
    """Steps of the verification, in order."""

    exact = "exact solution by events"
    cross_check = "cross-check of the two models"
    neighbours = "shakings within 1 %"
    nonlinear = "nonlinear equations"
    ensemble = "ensemble"


class ReasonKind(enum.Enum):
    """Why a design is refused."""

    overturns = enum.auto()
    """The block overturns with the design where it stands without."""
    overturns_more = enum.auto()
    """Significantly more conditions or runs overturn with the design than without."""
    breaks_limit = enum.auto()
    rocks_more = enum.auto()
    """The block rocks at least as much as without the design."""
    does_not_settle = enum.auto()
    models_disagree = enum.auto()


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
    """The size met: rad, a count, or a limited quantity over its limit."""
    reference: float = math.nan
    """The size it is compared with."""
    total: int = 0
    """Conditions, shakings or runs tried, where counts are compared."""
    outcome: str = ""
    """Name of the status in which the motion ends."""

    def __str__(self) -> str:
        at = f" at {self.condition}" if self.condition else ""
        by = f"by the {self.step.value}"
        match self.kind:
            case ReasonKind.overturns:
                return f"{by} the block overturns{at}, and stands without the pendulum"
            case ReasonKind.overturns_more if self.step is Step.neighbours:
                # Counted one by one, not pair by pair as in the other steps.
                return (
                    f"{by} the block overturns in {self.value:.0f} of {self.total} cases with the pendulum, "
                    f"and in {self.reference:.0f} without it{at}"
                )
            case ReasonKind.overturns_more:
                # Conditions and runs are counted in pairs, neighbouring shakings are not.
                only = "" if self.step is Step.neighbours else " only"
                return (
                    f"{by} the block overturns in {self.value:.0f} of {self.total} cases with the pendulum"
                    f"{only}, and in {self.reference:.0f} without it{only}{at}"
                )
            case ReasonKind.breaks_limit:
                return (
                    f"{by} the design exceeds the limit on {self.limit} by {self.value - 1.0:.2g} of it{at}"
                )
            case ReasonKind.rocks_more:
                return (
                    f"{by} the block rocks {self.value:.4g} rad, and {self.reference:.4g} rad without the "
                    f"pendulum{at}"
                )
            case ReasonKind.does_not_settle:
                return f"{by} the motion ends {self.outcome.replace('_', ' ')}{at}"
            case ReasonKind.models_disagree:
                return (
                    f"the search's model gives an amplitude of {self.value:.4g} rad, the exact solution "
                    f"{self.reference:.4g} rad{at}: the motion depends on details that neither can promise"
                )


@dataclass(frozen=True, kw_only=True)
class Motions:
    """Settled motions under every condition by one model, from the stated start; arrays of shape (n,)."""

    model: str
    status: np.ndarray
    """Names of statuses."""
    amplitude: np.ndarray
    """|phi|, rad; infinite where the block overturns."""
    stroke: np.ndarray
    """|psi|, rad."""
    peak: np.ndarray
    """Largest |phi| from the start on, rad; NaN where the model was not asked."""
    peak_stroke: np.ndarray
    """Largest |psi| from the start on, rad; NaN where the model was not asked."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers; NaN where unknown."""
    periods: np.ndarray
    """Forcing periods in one period of the motion."""


@dataclass(frozen=True, kw_only=True)
class Neighbours:
    """Shakings within 1 % in amplitude and frequency of one condition, from rest, by the exact solution."""

    condition: int
    tried: int
    overturned: int
    """Shakings that overturn the block with the pendulum."""
    overturned_bare: int


@dataclass(frozen=True, kw_only=True)
class Nonlinear:
    """A design under one condition by the nonlinear equations, from rest; angles in rad."""

    condition: int
    amplitude: float
    stroke: float
    status: str
    bare_amplitude: float
    bare_status: str


@dataclass(frozen=True, kw_only=True)
class Active:
    """A condition, limit or bound that holds a design, with its weight in the optimality condition."""

    kind: str
    """"tilt", "limit", "lower bound" or "upper bound"."""
    name: str
    """Name of the limit or of the ratio."""
    condition: str
    """Label of the condition; empty for a bound."""
    weight: float
    """Weight of the condition or limit; for a bound the ratio's value."""

    def __str__(self) -> str:
        match self.kind:
            case "tilt":
                return f"tilt at {self.condition} ({self.weight:.2f})"
            case "limit":
                return f"limit on {self.name} at {self.condition}"
            case _:
                return f"{self.kind} of the {self.name} ratio, {self.weight:.4g}"


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
    searched: Motions | None
    """By the model of the search; None where it searched over exact orbits."""
    margin: np.ndarray
    """Uplift margin under every condition, shape (n,)."""
    neighbours: Neighbours | None
    """None where the verification ended before that step, as of the two below."""
    nonlinear: tuple[Nonlinear, ...]
    verdict: Verdict | None
    """Ensemble of runs with and without the pendulum."""
    stationarity: float
    """Decrease of the risk that is left, to first order, per unit of a step in shares of the bounds."""
    active: tuple[Active, ...]
    source: str
    """"search", "path" (a search passed through the design) or "nonlinear search"."""
    reasons: tuple[Reason, ...]
    """Why it is refused; empty if it is offered."""

    @property
    def design(self) -> np.ndarray:
        """(mu, lam, zeta)."""
        return np.array([self.mass_ratio, self.length_ratio, self.damping_ratio])


@dataclass(frozen=True, kw_only=True)
class Bare:
    """The block without a pendulum under every condition."""

    value: float
    evaluation: Evaluation
    exact: Motions
    searched: Motions | None
    outcomes: Outcomes | None
    """Ensemble of runs; None where no design was put to it."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """The history of the search, for reports and pictures."""

    screened: np.ndarray
    """Designs (mu, lam, zeta) solved before the searches, (m, 3)."""
    screened_value: np.ndarray
    """Their risk, plus the excess over limits, (m,)."""
    screened_feasible: np.ndarray
    """Whether they keep to the limits, (m,)."""
    screened_overturned: np.ndarray
    """Whether they overturn, or reach no settled motion, under any condition, (m,)."""
    paths: tuple[np.ndarray, ...]
    """Designs on the way of each search, each (steps, 3)."""
    ends: np.ndarray
    """Best design of each search, (searches, 3)."""
    end_values: np.ndarray
    """Their risks, infinite where a limit is broken."""
    statuses: tuple[SearchStatus, ...]
    evaluations: int
    """Designs evaluated, screening included."""
    nonlinear_evaluations: int
    """Designs evaluated by the nonlinear equations, in the search on them."""
    description: str
    """From how many designs and in which stages, in words."""


@dataclass(frozen=True, kw_only=True)
class Nearest:
    """Where no design keeps to the limits: the design of least excess."""

    design: np.ndarray
    """(mu, lam, zeta)."""
    broken: tuple[Reason, ...]


@dataclass(frozen=True, kw_only=True, repr=False)
class Design(Printed):
    """The answer of `optimise`: angles in rad, lengths in m, masses in kg. `print` shows a summary."""

    scene: Scene
    space: DesignSpace
    conditions: Conditions
    starts: Starts
    risk: Risk
    limits: tuple[Limit, ...]
    method: Method
    ensemble: Ensemble
    seed: int
    status: DesignStatus
    pendulum: Pendulum | None
    """None where no design is offered."""
    verified: tuple[Verified, ...]
    """Designs that were verified, in order; the last one is offered if it has no reason against it."""
    bare: Bare
    nearest: Nearest | None
    search: Search
    elasticities: dict[str, float]
    """d ln(value)/d ln(x) at the design, x one of `conditions.FACTORS`."""
    settings: dict[str, object] = field(default_factory=dict)

    @property
    def winner(self) -> Verified | None:
        """The design offered, if any."""
        return self.verified[-1] if self.pendulum is not None else None

    @property
    def best(self) -> Verified | None:
        """The design offered or, where none is, the best that was verified."""
        # A refused design is no answer, but a picture of the best one shows what the refusal is about.
        return self.winner or min(self.verified, key=lambda v: v.value, default=None)

    @property
    def amplitude(self) -> float:
        """Largest exact settled |phi| of all conditions with the pendulum, or without where there is none."""
        return float(np.max((self.bare if self.winner is None else self.winner).exact.amplitude))

    @property
    def amplitude_without(self) -> float:
        """Largest exact settled |phi| of all conditions without a pendulum, rad."""
        return float(np.max(self.bare.exact.amplitude))

    @property
    def stroke(self) -> float:
        """Largest exact settled |psi| of all conditions, rad; 0 without a pendulum."""
        return 0.0 if self.winner is None else float(np.max(self.winner.exact.stroke))

    @property
    def stroke_limit(self) -> float:
        """Largest settled |psi| allowed, rad."""
        return stroke_limit(self.limits)

    def __str__(self) -> str:
        lines = [f"Design: {self.status.name}", self.status.value]
        if self.pendulum is None or self.winner is None:
            lines += [f"  refused: {reason}" for v in self.verified for reason in v.reasons]
            return "\n".join(lines)
        hung, amplitudes = self.pendulum, (self.amplitude, self.amplitude_without)
        with_it, without = (f"{x:.4g} rad" if math.isfinite(x) else "overturned" for x in amplitudes)
        if len(self.conditions) > 1:
            lines.append(
                f"  value       {self.winner.value:.4g}, {self.bare.value:.4g} without: {self.risk.name} "
                "tilt over slenderness, less than 0 at rest"
            )
        return "\n".join(
            [
                *lines,
                f"  pendulum    {hung.mass:.4g} kg on {hung.length:.4g} m, "
                f"damping ratio {hung.damping_ratio:.4g}",
                f"  amplitude   {with_it}, {without} without",
                f"  stroke      {self.stroke:.4g} rad, limit {self.stroke_limit:g} rad",
            ]
        )
