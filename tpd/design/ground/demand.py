"""Demands of ground motions on a block: one number for every motion, which a search makes small."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import ndtr

from tpd.core import checks

if TYPE_CHECKING:
    from tpd.design.ground.objective import GroundObjective


class Runs(NamedTuple):
    """Motions of m designs under n conditions: arrays (m, n). All sizes of an undecided run are NaN."""

    tilt: np.ndarray
    """Largest |phi| over the slenderness; infinite where the block overturns."""
    swing: np.ndarray
    """Largest |psi|, rad; infinite where the block overturns."""
    relative: np.ndarray
    """Largest |psi - phi|, rad; infinite where the block overturns."""
    overturned: np.ndarray
    undecided: np.ndarray
    """Whether the bound on events or a failure of numbers ended the motion: it is neither a fall nor rest."""
    growing: np.ndarray
    """Size of the growing coordinate over the slenderness as the last arc begins: 0 on the border between
    falling back and overturning."""

    def at(self, rows: slice) -> Runs:
        """Runs of some of the designs."""
        return Runs(*(x[rows] for x in self))

    def ended(self, bare: bool, hung: bool) -> Runs:
        """Runs of a bare block, in the first row, and of a hung one, with an end for each that has none: an
        overturning where the argument of its row is true, else rest."""
        falls = self.undecided & np.array([[bare], [hung]])
        size = np.where(falls, np.inf, 0.0)
        tilt, swing, relative = (
            np.where(self.undecided, size, x) for x in (self.tilt, self.swing, self.relative)
        )
        none, fell = np.zeros_like(self.undecided), self.overturned | falls
        return self._replace(tilt=tilt, swing=swing, relative=relative, overturned=fell, undecided=none)


@dataclass(frozen=True)
class Demand(ABC):
    """Number for every condition, from 0 on, that a search makes small."""

    @abstractmethod
    def follow(self, objective: GroundObjective, designs: np.ndarray) -> tuple[Runs, np.ndarray]:
        """Follow designs (mu, lam, zeta), shape (m, 3): the runs under all n conditions, and the demand on
        each, (m, n), NaN where nothing is known of a run."""


@dataclass(frozen=True)
class RunDemand(Demand):
    """Demand that every run has by itself."""

    @abstractmethod
    def of(self, runs: Runs) -> np.ndarray:
        """The demand on every run, (m, n); NaN where nothing is known of it."""

    def follow(self, objective: GroundObjective, designs: np.ndarray) -> tuple[Runs, np.ndarray]:
        """See `Demand`."""
        runs = objective.evaluate(designs)
        return runs, self.of(runs)


@dataclass(frozen=True)
class CappedTilt(RunDemand):
    """Largest tilt over the slenderness, and 1 where the block overturns. With `beyond` an overturning counts
    up to so much more, the more the further it is from falling back."""

    beyond: float = 0.0

    def __post_init__(self) -> None:
        checks.within("beyond", self.beyond, 0.0, 1.0)

    def of(self, runs: Runs) -> np.ndarray:
        """See `RunDemand`."""
        inside, unknown = np.isfinite(runs.tilt), np.isnan(runs.tilt)
        # Without a cap the few runs that come close to the edge would outweigh all others.
        value = np.where(inside, np.minimum(runs.tilt, 1.0), 1.0)
        if self.beyond > 0.0:
            # The coordinate grows exponentially while the motion goes on: its logarithm is a measure of time.
            far = np.log1p(np.where(inside, 0.0, runs.growing))
            value = value + self.beyond * far / (1.0 + far)
        return np.where(unknown, np.nan, value)


@dataclass(frozen=True)
class Exceedance(RunDemand):
    """Whether the tilt exceeds a share of the slenderness, smoothed: Phi(ln(tilt/level)/width), and 1 where
    the block overturns. The mean is the share of the motions beyond the level."""

    level: float = 0.9
    width: float = 0.3
    """Half width of the smoothing, in the logarithm of the tilt."""

    def __post_init__(self) -> None:
        checks.positive("level", self.level)
        checks.positive("width", self.width)

    def of(self, runs: Runs) -> np.ndarray:
        """See `RunDemand`."""
        # A block that never lifts has no logarithm of its tilt, and is below any level.
        inside = np.isfinite(runs.tilt) & (runs.tilt > 0.0)
        tilt = np.where(inside, runs.tilt, 1.0)
        # In the logarithm, because tilts of single motions range over decades.
        x = np.log(tilt / self.level) / self.width
        value = np.where(inside, ndtr(x), np.where(np.isfinite(runs.tilt), 0.0, 1.0))
        return np.where(np.isnan(runs.tilt), np.nan, value)


@dataclass(frozen=True)
class CriticalIntensity(Demand):
    """Reciprocal of the intensity from which a motion overturns the block, 0 if none of a scan does. With
    `Risk.worst()` a search makes the least critical intensity of all motions large.

    The crossing is the first that the scan sees: above it there may be intensities that do not overturn the
    block, and the runs of the judgement show these. Where another crossing becomes the first, the demand
    jumps. Where a run below the crossing has no answer, the intensity is that up to which the block is known
    to stand, and `Runs.undecided` says so.
    """

    scan: float = 0.05
    """Relative step: narrower tongues are not seen."""
    highest: float = 20.0
    """End of the scan, over the intensity that lifts the bare block."""

    def __post_init__(self) -> None:
        checks.within("scan", self.scan, 1e-4, 0.5)
        checks.within("highest", self.highest, 1.0, 1e3)

    def follow(self, objective: GroundObjective, designs: np.ndarray) -> tuple[Runs, np.ndarray]:
        """See `Demand`."""
        from tpd.design.ground.crossing import crossings

        # The runs at the intensities of the conditions are for the limits.
        runs = objective.evaluate(designs)
        found = crossings(objective, designs, self.scan, self.highest)
        # What is known to stand up to a factor only counts as overturning there, and is named.
        return runs._replace(undecided=runs.undecided | found.undecided), 1.0 / found.intensity
