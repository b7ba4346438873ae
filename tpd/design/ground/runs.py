"""Motions of designs under ground motions, and how severe each is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


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

    @property
    def severity(self) -> np.ndarray:
        """Largest tilt over the slenderness, at most 1, and 1 where the block overturns, (m, n); NaN where
        nothing is known of a run. A search makes its risk small."""
        # Without a cap the few runs that come close to the edge would outweigh all others.
        return np.minimum(self.tilt, 1.0)

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
