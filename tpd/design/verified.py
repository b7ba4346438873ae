"""A design that went through the verification, the bare block beside it, and what each step found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tpd.analysis.benefit import Benefit
from tpd.analysis.outcomes import Outcomes, Share
from tpd.analysis.paired import Verdict
from tpd.design.reasons import Reason

if TYPE_CHECKING:
    from tpd.design.objective import Evaluation
    from tpd.design.survey import Survey


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
    """"survey", "search" (the best end of a search that was interrupted) or "check"."""
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
