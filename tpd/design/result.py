"""What is searched and what comes out: the design space, its candidates, and the design."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import numpy as np

from tpd.analysis.ensemble import Verdict
from tpd.core import checks
from tpd.core.scene import Pendulum, Scene

LONGEST_RATIO = 2.0
"""A pendulum longer than the whole block, l/b = 2, would swing through the floor."""


@dataclass(frozen=True, kw_only=True)
class DesignSpace:
    """Bounds of the search, and the limit on the bob's stroke.

    Raises:
        ValueError: a bound out of range, reversed or empty.
    """

    mass_ratio: tuple[float, float] = (0.01, 0.2)
    """mu = m/M, from and to."""
    length_ratio: tuple[float, float] = (0.1, 1.5)
    """lam = l/b, from and to."""
    damping_ratio: float | tuple[float, float] = 0.1
    """zeta of the hinge: a number, or from and to if it is searched as well."""
    stroke: float = 0.5
    """Largest allowed |psi|, rad. The linear equations lose their meaning beyond about this."""

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "mass_ratio", checks.interval("mass_ratio", self.mass_ratio, 0.0, 10.0))
        set_(self, "length_ratio", checks.interval("length_ratio", self.length_ratio, 1e-3, LONGEST_RATIO))
        if isinstance(self.damping_ratio, (int, float)):
            checks.within("damping_ratio", self.damping_ratio, 0.0, 2.0)
            set_(self, "damping_ratio", float(self.damping_ratio))
        else:
            set_(self, "damping_ratio", checks.interval("damping_ratio", self.damping_ratio, 0.0, 2.0))
        checks.positive("stroke", self.stroke)

    @property
    def names(self) -> tuple[str, ...]:
        """The searched parameters, by their symbols."""
        return ("mu", "lam", "zeta") if isinstance(self.damping_ratio, tuple) else ("mu", "lam")

    @property
    def bounds(self) -> np.ndarray:
        """Lower and upper bounds of the searched parameters, shape (2, len(names))."""
        pairs = [self.mass_ratio, self.length_ratio]
        if isinstance(self.damping_ratio, tuple):
            pairs.append(self.damping_ratio)
        return np.array(pairs).T

    def full(self, x: np.ndarray) -> np.ndarray:
        """(mu, lam, zeta) of searched values `x`, shape (..., 2 or 3) to (..., 3)."""
        if isinstance(self.damping_ratio, tuple):
            return np.asarray(x)
        return np.concatenate([x, np.full((*np.shape(x)[:-1], 1), self.damping_ratio)], axis=-1)


class StartStatus(enum.Enum):
    """How the search from one start ended."""

    rests = "found designs that settle at rest; the uplift margin grew as far as it goes"
    converged = "reached a minimum of the amplitude"
    at_bound = "reached the edge of the design space"
    stroke_limited = "reached the stroke limit"
    steps_exhausted = "was still improving when the steps ran out"
    infeasible = "met no design within the limits"
    lost = "met no design with a settled motion"
    interrupted = "had not ended when the search was interrupted"


class DesignStatus(enum.Enum):
    """What the answer is worth; the value is the sentence a report opens with."""

    found = (
        "A pendulum was found that lessens the settled rocking under this one shaking, from rest; the exact "
        "solution of the linear equations confirms it, and the nonlinear equations have nothing against it."
    )
    models_disagree = (
        "DO NOT USE AS IT IS: the model searched with and the exact solution disagree on this design by "
        "more than the tolerance, so its motion depends on details that neither can promise."
    )
    nonlinear_objects = (
        "NO DESIGN TO OFFER: what the linear equations find does not hold by the nonlinear ones, also "
        "under limits corrected for that."
    )
    fragile = (
        "DO NOT RELY ON IT: with this pendulum the block settles at the design's own shaking, but overturns "
        "at one within 1 % of it."
    )
    interrupted = "INTERRUPTED: what follows is what had been found by then, if anything."
    no_improvement = "NO PENDULUM in this design space rocks less than the bare block from this start."
    no_uplift = "NO PENDULUM IS NEEDED: the bare block settles at rest."
    none_feasible = "NO DESIGN in this space settles within the stroke limit."

    @property
    def is_sound(self) -> bool:
        """Whether the answer may be used: a design found and confirmed, or none needed."""
        return self in (DesignStatus.found, DesignStatus.no_uplift)


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One design, or the bare block, solved by both models from the same start."""

    mass_ratio: float
    length_ratio: float
    damping_ratio: float
    amplitude: float
    """Exact settled |phi|, rad."""
    stroke: float
    """Exact settled |psi|, rad."""
    status: str
    """Exact status, by name."""
    periods: int
    """Forcing periods in one period of the exact motion."""
    multiplier: float
    """Largest Floquet multiplier of the exact motion."""
    margin: float
    """Uplift margin; positive: a block at rest under the settled pendulum stays at rest."""
    smoothed_amplitude: float
    """By the model searched with, as the two below; see `Design.searched_with`."""
    smoothed_stroke: float
    smoothed_status: str
    agree: bool
    """Whether both models settle alike, with amplitudes within the tolerance."""

    @property
    def difference(self) -> float:
        """Amplitude by the model searched with minus the exact one, over the exact one; 0 where both rest."""
        if not np.isfinite(self.amplitude):
            return float("nan")
        if self.amplitude == 0.0:
            return 0.0 if self.smoothed_amplitude == 0.0 else float("inf")
        return self.smoothed_amplitude / self.amplitude - 1.0


@dataclass(frozen=True, kw_only=True)
class Round:
    """A best design under the linear equations, and what the nonlinear ones say of it; angles in rad."""

    limit: float
    """Stroke limit it was searched under: corrected from the second round on."""
    mass_ratio: float
    length_ratio: float
    damping_ratio: float
    amplitude: float
    """Settled |phi| by the nonlinear equations."""
    stroke: float
    status: str
    objections: tuple[str, ...]
    """Why it is not offered, a sentence each; none if it is."""


@dataclass(frozen=True, kw_only=True)
class History:
    """The search's path: arrays of shape (starts, steps), and (starts, steps, 3) for `designs`."""

    designs: np.ndarray
    """(mu, lam, zeta)."""
    amplitude: np.ndarray
    stroke: np.ndarray
    margin: np.ndarray
    status: np.ndarray
    """Names of the steady state's status."""
    screened: np.ndarray
    """The designs screened before the search by the exact solution, shape (n, 3)."""
    screened_amplitude: np.ndarray
    screened_stroke: np.ndarray
    screened_status: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Design:
    """The answer of `optimise`: angles in rad, lengths in m, masses in kg."""

    scene: Scene
    space: DesignSpace
    pendulum: Pendulum | None
    """None where no design settles within the limits and rocks less than the bare block."""
    amplitude: float
    """Exact settled |phi| with the pendulum, rad; that of the bare block where there is none."""
    amplitude_without: float
    """Exact settled |phi| of the bare block, rad."""
    stroke: float
    """Exact settled |psi|, rad."""
    status: DesignStatus
    winner: Candidate | None
    runner_up: Candidate | None
    bare: Candidate
    starts: tuple[StartStatus, ...]
    history: History
    peak: tuple[float, float]
    """Largest |phi| and |psi| (rad) in the first 24 periods from rest, with the pendulum if there is one."""
    overturned_nearby: tuple[int, int, int]
    """How many shakings within 1 % of the design's were tried, and how many of them overturn the
    block with the pendulum and without."""
    verdict: Verdict | None
    """An ensemble of runs with the pendulum and without; None where there is no pendulum."""
    rounds: tuple[Round, ...]
    """The designs put to the nonlinear equations in turn; the last one is offered if it has no objection."""
    tolerance: float
    """Largest relative difference of the two models' amplitudes that counts as agreement."""
    seed: int
    searched_with: str = "smoothed"
    """Name of the model that the search ran on."""
    interrupted: bool = False
    settings: dict[str, object] = field(default_factory=dict)
