"""Rocking spectrum: the largest tilt of blocks of one slenderness and every size under a ground motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tpd.answers.ground_batch import Progress, follow_rows, rows_of
from tpd.answers.transient import FREE
from tpd.cluster.cluster import Cluster
from tpd.core import checks
from tpd.core.formatting import Tabular, picture
from tpd.scene.ground_motion import LONGEST_FREE, STANDARD_GRAVITY, GroundMotion
from tpd.scene.scene import Block, Scene


@dataclass(frozen=True)
class RockingSpectrum(Tabular):
    """Largest tilt over the slenderness, bare and with a pendulum of stated ratios."""

    periods: np.ndarray
    """2 pi/p in s, shape (periods,): p is the block's rate omega0 of the linear equations."""
    bare: np.ndarray
    """Largest |phi|/nu of the bare block; infinite where it overturns, NaN where nothing is known."""
    hung: np.ndarray | None
    """Largest |phi|/nu with the pendulum; None without one."""

    def plot(self, *, ax: Any = None) -> Any:
        """Draw the largest tilts, with marks where blocks overturn, and return the axes."""
        return picture("maps:plot_rocking_spectrum")(self, ax)

    def columns(self) -> dict[str, Any]:
        """A row for every block: 2 pi/p in s, and the largest tilts over the slenderness."""
        hung = {} if self.hung is None else {"hung": self.hung}
        return {"period_s": self.periods, "bare": self.bare} | hung

    def undecided(self) -> np.ndarray:
        """Number of blocks without an answer, bare and with a pendulum."""
        return np.array([np.sum(np.isnan(t)) for t in (self.bare, self.hung) if t is not None])


def rocking_spectrum(
    block: Block,
    motion: GroundMotion,
    *,
    periods: np.ndarray | None = None,
    mass_ratio: float | None = None,
    length_ratio: float = 0.5,
    damping_ratio: float = 0.1,
    gravity: float = STANDARD_GRAVITY,
    free: float = FREE,
    cluster: Cluster | None = None,
    progress: Progress | None = None,
) -> RockingSpectrum:
    """Follow blocks of every size through a ground motion.

    Args:
        block: its slenderness, friction, restitution and shape hold; its size varies.
        motion: a pulse or a record.
        periods: 2 pi/p in s; by default 200 from 1 to 12.
        mass_ratio: bob over block; None for the bare block alone.
        length_ratio: rod over half height.
        damping_ratio: of the pendulum.
        gravity: m/s^2.
        free: free motion after the ground motion, s.
        cluster: processes or machines in place of threads.
        progress: called with the motions done and in all.

    Raises:
        ValueError: bad input.
    """
    checks.instance("block", block, Block)
    checks.instance("motion", motion, GroundMotion)
    checks.positive("length_ratio", length_ratio)
    if periods is not None:
        checks.numbers("periods", periods, (-1,), "a vector of numbers")
    times = np.linspace(1.0, 12.0, 200) if periods is None else np.asarray(periods, dtype=float)
    checks.positive("periods", times)
    checks.within("free", free, 0.0, LONGEST_FREE, " s")
    scene = Scene(block, motion, gravity)
    hung = None
    if mass_ratio is not None:
        hung = scene.pendulum(mass_ratio=mass_ratio, length_ratio=length_ratio, damping_ratio=damping_ratio)
    # Each period is another size of the block, and the same numbers without dimension.
    rates = 2.0 * np.pi / times
    rows = [rows_of(block, h, [motion], gravity) for h in ((None,) if hung is None else (None, hung))]
    x = np.repeat(np.concatenate(rows), times.size, axis=0)
    # All numbers but the duration of a piece depend on shapes and ratios only.
    x[:, 6] = float(motion.piece) * np.tile(rates, len(rows))
    late = free * np.tile(rates, len(rows))
    pieces = np.asarray(motion.pieces(), dtype=float)
    batch = {"x": x, "which": np.zeros(len(x), dtype=int), "free": late}
    found = follow_rows(batch, [pieces], False, True, cluster=cluster, progress=progress)
    # A motion that the bound on events ended has a largest tilt as well, but not that of the whole motion.
    tilt = np.where(found.undecided, np.nan, found.tilt).reshape(len(rows), -1) / float(block.slenderness)
    return RockingSpectrum(times, tilt[0], tilt[1] if hung is not None else None)
