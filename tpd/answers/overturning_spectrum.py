"""Overturning spectrum: what a pulse of each frequency and size does to a block, bare and with a pendulum."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.ground_batch import Outcomes, Progress, follow_scaled
from tpd.answers.transient import FREE
from tpd.cluster.cluster import Cluster
from tpd.core import checks
from tpd.core.formatting import Tabular, picture
from tpd.scene.ground_motion import STANDARD_GRAVITY, Pulse
from tpd.scene.scene import Block, Pendulum, Scene

UNDECIDED, STANDS, ROCKS, OVERTURNS = -1, 0, 1, 2
"""Outcomes of a cell; OVERTURNS + n is an overturning after n impacts."""


@dataclass(frozen=True)
class OverturningSpectrum(Tabular):
    """Outcomes over frequency and size of a pulse."""

    pulse: Pulse
    """Its kind, cycles and phase; frequency and size vary."""
    frequency_ratios: np.ndarray
    """omega_p/p, shape (frequencies,): p is the block's rate omega0 of the linear equations."""
    acceleration_ratios: np.ndarray
    """a_p/(g tan alpha), shape (accelerations,): the largest acceleration over that which lifts a bare block
    without friction."""
    bare: np.ndarray
    """Outcome of the bare block, shape (accelerations, frequencies)."""
    hung: np.ndarray | None
    """Outcome with the pendulum, same shape; None without one."""

    def plot(self, *, axes: Any = None) -> Any:
        """Draw what every pulse does, bare and with a pendulum side by side; returns the axes, an array."""
        return picture("maps:plot_overturning_spectrum")(self, axes)

    def columns(self) -> dict[str, Any]:
        """A row for every pulse: both ratios, and the outcomes by their numbers."""
        across, up = np.meshgrid(self.frequency_ratios, self.acceleration_ratios)
        cells = {name: c.ravel() for name, c in zip(("bare", "hung"), self._cells, strict=False)}
        return {"frequency_ratio": across.ravel(), "acceleration_ratio": up.ravel(), **cells}

    def safe(self) -> np.ndarray:
        """Share of the cells with an answer in which the bare block, and that with a pendulum, does not
        overturn; NaN where no cell has one."""
        known = [c[c != UNDECIDED] for c in self._cells]
        return np.array([np.mean(c < OVERTURNS) if c.size else np.nan for c in known])

    def undecided(self) -> np.ndarray:
        """Number of cells without an answer, bare and with a pendulum."""
        return np.array([np.sum(c == UNDECIDED) for c in self._cells])

    @property
    def _cells(self) -> list[np.ndarray]:
        return [c for c in (self.bare, self.hung) if c is not None]


def overturning_spectrum(
    block: Block,
    pulse: Pulse,
    pendulum: Pendulum | None = None,
    *,
    frequency_ratios: np.ndarray | None = None,
    acceleration_ratios: np.ndarray | None = None,
    gravity: float = STANDARD_GRAVITY,
    free: float = FREE,
    cluster: Cluster | None = None,
    progress: Progress | None = None,
) -> OverturningSpectrum:
    """Follow a block through a pulse of every frequency and every size.

    Args:
        block: its friction and its restitution hold.
        pulse: gives kind, cycles and phase.
        pendulum: compared with the bare block; None for the bare block alone.
        frequency_ratios: omega_p/p; by default 120 from 0.5 to 10.
        acceleration_ratios: a_p/(g tan alpha); by default 120 from 0.5 to 10.
        gravity: m/s^2.
        free: free motion after each pulse, s.
        cluster: processes or machines in place of threads.
        progress: called with the motions done and in all.

    Raises:
        ValueError: bad input.
    """
    checks.instance("block", block, Block)
    checks.instance("pulse", pulse, Pulse)
    checks.optional("pendulum", pendulum, Pendulum)
    for name, given in (("frequency_ratios", frequency_ratios), ("acceleration_ratios", acceleration_ratios)):
        if given is not None:
            checks.numbers(name, given, (-1,), "a vector of numbers")
    w = np.linspace(0.5, 10.0, 120) if frequency_ratios is None else np.asarray(frequency_ratios, dtype=float)
    a = np.linspace(0.5, 10.0, 120) if acceleration_ratios is None else np.asarray(acceleration_ratios, float)
    checks.positive("frequency_ratios", w)
    checks.positive("acceleration_ratios", a)
    rate = float(Scene(block, pulse, gravity).rate)
    unit = gravity * block.slenderness
    # A pulse of unit size for each frequency; sizes are factors on it.
    motions = [replace(pulse, frequency=float(x) * rate / (2.0 * np.pi), acceleration=1.0) for x in w]
    factors = np.array([a * unit / float(m.pga) for m in motions])
    total = w.size * a.size * (1 if pendulum is None else 2)
    cells = []
    for n, hung in enumerate((None,) if pendulum is None else (None, pendulum)):
        done = n * w.size * a.size
        found = follow_scaled(
            block,
            hung,
            motions,
            factors,
            gravity=gravity,
            free=free,
            brief=True,
            cluster=cluster,
            progress=None if progress is None else lambda i, _, done=done: progress(done + i, total),
        )
        cells.append(_classified(found).T)
    return OverturningSpectrum(pulse, w, a, cells[0], cells[1] if pendulum is not None else None)


def _classified(found: Outcomes) -> np.ndarray:
    """Outcome of every cell."""
    code = np.where(found.lifted, ROCKS, STANDS)
    code = np.where(found.overturned, OVERTURNS + found.impacts, code)
    return np.where(found.undecided, UNDECIDED, code)
