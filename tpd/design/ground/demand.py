"""Demands of ground motions on a block: one number for every motion, which a search makes small.

A demand that every run has by itself has a derivative also where a motion overturns the block, as far as
something there tells how far it is from standing.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr

from tpd.core import checks

if TYPE_CHECKING:
    from tpd.design.ground.objective import GroundObjective


class Runs(NamedTuple):
    """Motions of m designs under n conditions: arrays (m, n), derivatives (m, n, 3) in (mu, lam, zeta). All
    sizes of an undecided run are NaN."""

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
    tilt_slope: np.ndarray
    """NaN where the block overturns, where nothing is known, or where derivatives were not asked for."""
    growing_slope: np.ndarray
    """NaN where the block does not overturn, or where derivatives were not asked for."""

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


class Demands(NamedTuple):
    """A demand on every run, and its derivatives; lower is better."""

    value: np.ndarray
    """(m, n), NaN where nothing is known of a run."""
    slope: np.ndarray
    """(m, n, 3)"""


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
    def of(self, runs: Runs) -> Demands:
        """The demand on every run."""

    def follow(self, objective: GroundObjective, designs: np.ndarray) -> tuple[Runs, np.ndarray]:
        """See `Demand`."""
        runs = objective.evaluate(designs)
        return runs, self.of(runs).value


@dataclass(frozen=True)
class CappedTilt(RunDemand):
    """Largest tilt over the slenderness, and 1 where the block overturns. With `beyond` an overturning counts
    up to so much more, the more the further it is from falling back."""

    beyond: float = 0.0

    def __post_init__(self) -> None:
        checks.within("beyond", self.beyond, 0.0, 1.0)

    def of(self, runs: Runs) -> Demands:
        """See `RunDemand`."""
        inside, unknown = np.isfinite(runs.tilt), np.isnan(runs.tilt)
        # Without a cap the few runs that come close to the edge would outweigh all others.
        value = np.where(inside, np.minimum(runs.tilt, 1.0), 1.0)
        slope = np.where((inside & (runs.tilt < 1.0))[..., None], runs.tilt_slope, 0.0)
        if self.beyond > 0.0:
            # The coordinate grows exponentially while the motion goes on: its logarithm is a measure of time.
            far = np.log1p(np.where(inside, 0.0, runs.growing))
            rate = self.beyond / (1.0 + far) ** 2 / (1.0 + np.where(inside, 0.0, runs.growing))
            value = value + self.beyond * far / (1.0 + far)
            slope = np.where(inside[..., None], slope, rate[..., None] * runs.growing_slope)
        return Demands(np.where(unknown, np.nan, value), np.where(unknown[..., None], np.nan, slope))


@dataclass(frozen=True)
class Exceedance(RunDemand):
    """Whether the tilt exceeds a share of the slenderness, smoothed: Phi(ln(tilt/level)/width), and 1 where
    the block overturns. The mean is the share of the motions beyond the level; see `share_beyond`."""

    level: float = 0.9
    width: float = 0.3
    """Half width of the smoothing, in the logarithm of the tilt."""

    def __post_init__(self) -> None:
        checks.positive("level", self.level)
        checks.positive("width", self.width)

    def of(self, runs: Runs) -> Demands:
        """See `RunDemand`."""
        # A block that never lifts has no logarithm of its tilt, and is below any level.
        inside = np.isfinite(runs.tilt) & (runs.tilt > 0.0)
        tilt = np.where(inside, runs.tilt, 1.0)
        # In the logarithm, because tilts of single motions range over decades.
        x = np.log(tilt / self.level) / self.width
        density = np.exp(-0.5 * x**2) / math.sqrt(2.0 * math.pi)
        value = np.where(inside, ndtr(x), np.where(np.isfinite(runs.tilt), 0.0, 1.0))
        by_tilt = np.where(inside, density / (self.width * tilt), 0.0)
        slope = np.where(inside[..., None], by_tilt[..., None] * runs.tilt_slope, 0.0)
        unknown = np.isnan(runs.tilt)
        return Demands(np.where(unknown, np.nan, value), np.where(unknown[..., None], np.nan, slope))


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


class Share(NamedTuple):
    """Share of runs beyond a level, and its derivatives, with standard errors."""

    value: float
    slope: np.ndarray
    value_error: float
    slope_error: np.ndarray


def share_beyond(
    tilt: Float[np.ndarray, " n"],
    slope: Float[np.ndarray, "n d"],
    level: float,
    *,
    width: float | None = None,
    weights: Float[np.ndarray, " n"] | None = None,
) -> Share:
    """Share of n independent runs whose tilt exceeds a level, and its derivatives.

    The derivative of a share is dP(Y > b)/dx = f_Y(b) E[dY/dx | Y = b] (S.-K. Au and Z. Cao, arXiv
    2510.09315): it needs the derivatives of the runs near the level alone. Density and conditional mean are
    estimated by a normal kernel in Y = ln(tilt).

    Args:
        tilt: of every run, infinite after an overturning.
        slope: derivatives of the tilts.
        level: of the tilt.
        width: of the kernel in the logarithm; default 1.06 s n^(-1/5) with s the standard deviation of the
            finite logarithms (B. W. Silverman, Density Estimation, 1986).
        weights: of the runs; default 1/n each.
    """
    n = len(tilt)
    w = np.full(n, 1.0 / n) if weights is None else weights
    beyond = (tilt > level).astype(float)
    # Runs that overturn, or never lift, are far from every level: the kernel does not see them.
    near = np.isfinite(tilt) & (tilt > 0.0)
    y = np.log(np.where(near, tilt, 1.0) / level)
    spread = float(np.std(y[near])) if near.any() else 1.0
    h = 1.06 * spread * n**-0.2 if width is None else width
    kernel = np.where(near, np.exp(-0.5 * (y / h) ** 2) / (h * math.sqrt(2.0 * math.pi)), 0.0)
    moved = np.where(near[:, None], slope / np.where(near, tilt, 1.0)[:, None], 0.0)
    # The contribution of every run to the derivative; their spread gives its standard error.
    each = n * w[:, None] * kernel[:, None] * moved
    value = float(np.sum(w * beyond))
    errors = np.std(each, axis=0, ddof=1) / math.sqrt(n), math.sqrt(value * (1.0 - value) / n)
    return Share(value, each.mean(axis=0), errors[1], errors[0])
