"""What comes out of a search over many conditions."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.analysis.ensemble import Outcomes, Verdict
from tpd.core.conditions import Conditions, Limits, Measure
from tpd.core.scene import Pendulum, Scene
from tpd.design.objective import Told
from tpd.design.result import DesignSpace, StartStatus


class OverStatus(enum.Enum):
    """What the answer is worth; the value is the sentence a report opens with."""

    found = (
        "A pendulum was found that lessens the steady rocking under the stated conditions, and with it the "
        "block overturns in no significantly larger share of runs. That is no verdict of safety: read the "
        "shares."
    )
    refused = (
        "NO DESIGN TO OFFER: what the search finds does not stand the events from rest, the nonlinear "
        "equations or the ensemble."
    )
    no_improvement = "NO PENDULUM in this design space rocks less than the bare block under these conditions."
    none_feasible = "NO DESIGN in this space keeps to the limits under all conditions."
    no_uplift = (
        "NO PENDULUM IS NEEDED FROM REST: under all conditions the bare block stays where it is. Pushed hard "
        "enough it may rock or overturn all the same."
    )
    interrupted = "INTERRUPTED: what follows is the best of the searches that had ended by then."


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A design that was looked at closely; angles in rad."""

    mass_ratio: float
    length_ratio: float
    damping_ratio: float
    value: float
    """The measure of the merits, tilts over nu; see `Told`."""
    told: Told
    """Under every condition, leading axis 1."""
    reached: np.ndarray
    """Names of what is settled into from rest, by events, under every condition."""
    reached_tilt: np.ndarray
    """Settled |phi| from rest, rad; infinite where the block overturns."""
    nonlinear: tuple[tuple[int, float, float, str], ...]
    """By the nonlinear equations, from rest: (condition, amplitude, stroke, status)."""
    nonlinear_bare: tuple[str, ...]
    """What becomes of the bare block by the same, where this one overturns; elsewhere empty."""
    verdict: Verdict | None
    stationarity: float
    """Decrease of the value that is left, to first order, per unit of a step in shares of the bounds."""
    active: tuple[str, ...]
    """What holds the design: conditions and limits with their weights, and bounds."""
    ended: bool
    """Whether a descent ended here; otherwise one came through."""
    objections: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class DesignOver:
    """The answer of `optimise_over`."""

    scene: Scene
    conditions: Conditions
    space: DesignSpace
    measure: Measure
    limits: Limits
    from_rest: bool
    reached: Starts | None
    """The starts whose motions count, or None: all symmetric orbits."""
    by_share: bool
    status: OverStatus
    pendulum: Pendulum | None
    judged: tuple[Judged, ...]
    """What was looked at, in order; the last one is offered if it has no objection."""
    nearest: str
    """Where no design keeps to the limits, the one that comes nearest to it; otherwise empty."""
    bare: Told
    """The bare block under every condition, leading axis 1."""
    bare_value: float
    bare_reached: np.ndarray
    bare_outcomes: Outcomes | None
    elasticities: dict[str, float]
    """d ln(value)/d ln(x) at the design, x a factor of `conditions.FACTORS`; of the pendulum's three as if
    the other two stayed."""
    screened: np.ndarray
    """Designs screened, (m, 3)."""
    screened_value: np.ndarray
    """Their values under the conditions that the starts were searched from under, and what they exceed limits
    by, in shares of these, added up."""
    starts: tuple[StartStatus, ...]
    paths: tuple[np.ndarray, ...]
    """Designs (mu, lam, zeta) on the way from each start, (steps, 3)."""
    ends: np.ndarray
    """Best designs of the starts, (starts, 3)."""
    end_values: np.ndarray
    """Their values, infinite where a limit is broken."""
    evaluations: int
    """Designs evaluated, each under all conditions or those that the starts were searched from under."""
    searched: str
    """From what and in which stages."""
    seed: int
    settings: dict[str, object]

    @property
    def winner(self) -> Judged | None:
        """The design offered, if any."""
        return self.judged[-1] if self.pendulum is not None else None
