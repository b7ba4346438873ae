"""Overturning spectrum: what a pulse of each frequency and size does to a block. Rocking spectrum: the
largest tilt of blocks of one slenderness and every size under one motion. Both bare and with a pendulum."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.runs import CASE_KEYS, Cases, Progress, follow_runs, follow_scaled, rows_of
from tpd.answers.transient import FREE
from tpd.cluster.cluster import Cluster
from tpd.core import checks
from tpd.exact.runs import GroundForcing
from tpd.scene.ground_motion import LONGEST_FREE, STANDARD_GRAVITY, GroundMotion, Pulse
from tpd.scene.pytrees import single
from tpd.scene.scene import Block, Pendulum, Scene
from tpd.theory.equations import Terms

UNDECIDED, STANDS, ROCKS, OVERTURNS = -1, 0, 1, 2
"""Outcomes of a cell; OVERTURNS + n is an overturning after n impacts."""


@dataclass(frozen=True)
class OverturningSpectrum(Cases):
    """Outcomes over frequency and size of a pulse."""

    pulse: Pulse
    """Its kind, cycles and phase; frequency and size vary."""
    frequency_ratios: np.ndarray
    """omega_p/p, shape (frequencies,): p is the block's rate omega0 of the linear equations."""
    acceleration_ratios: np.ndarray
    """a_p/(g tan alpha), shape (accelerations,): the largest acceleration over that which lifts a bare block
    without friction."""
    cases: np.ndarray
    """Outcomes without the pendulum and, if there is one, with it, (cases, accelerations, frequencies)."""

    def columns(self) -> dict[str, Any]:
        """A row for every pulse: both ratios, and the outcomes by their numbers."""
        across, up = np.meshgrid(self.frequency_ratios, self.acceleration_ratios)
        cells = {name: c.ravel() for name, c in zip(CASE_KEYS, self.cases, strict=False)}
        return {"frequency_ratio": across.ravel(), "acceleration_ratio": up.ravel(), **cells}

    def safe(self) -> np.ndarray:
        """Share of the cells with an answer in which the block does not overturn, of each case; NaN where no
        cell has one."""
        known = [c[c != UNDECIDED] for c in self.cases]
        return np.array([np.mean(c < OVERTURNS) if c.size else np.nan for c in known])

    def undecided(self) -> np.ndarray:
        """Number of cells without an answer, of each case."""
        return np.sum(self.cases == UNDECIDED, axis=(1, 2))


def _vector(name: str, values: Any, usual: np.ndarray) -> np.ndarray:
    """Positive numbers as an array, checked; the usual ones in place of None."""
    values = usual if values is None else values
    return checks.positive(name, checks.array(name, values, (-1,), "a vector of numbers"), every=True)


def overturning_spectrum(
    block: Block,
    pulse: Pulse,
    pendulum: Pendulum | None = None,
    *,
    frequency_ratios: checks.Vector | None = None,
    acceleration_ratios: checks.Vector | None = None,
    gravity: checks.Real = STANDARD_GRAVITY,
    free: checks.Real = FREE,
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
    w = _vector("frequency_ratios", frequency_ratios, np.linspace(0.5, 10.0, 120))
    a = _vector("acceleration_ratios", acceleration_ratios, np.linspace(0.5, 10.0, 120))
    scene = Scene(block, pulse, gravity)
    rate, unit = single((scene.rate, scene.gravity * block.slenderness))
    # A pulse of unit size for each frequency; sizes are factors on it.
    motions = [replace(pulse, frequency=float(x) * rate / (2.0 * np.pi), acceleration=1.0) for x in w]
    factors = np.array([a * unit / float(m.pga) for m in motions])
    cases = (None,) if pendulum is None else (None, pendulum)
    how = {"cluster": cluster, "progress": progress}
    found = follow_scaled(block, cases, motions, factors, gravity=gravity, free=free, brief=True, **how)
    known = np.where(found.is_overturned, OVERTURNS + found.impacts, np.where(found.is_lifted, ROCKS, STANDS))
    cells = np.where(found.is_unanswered, UNDECIDED, known).astype(int).swapaxes(1, 2)
    return OverturningSpectrum(pulse, w, a, cells)


@dataclass(frozen=True)
class RockingSpectrum(Cases):
    """Largest tilt over the slenderness, bare and with a pendulum of stated ratios."""

    periods: np.ndarray
    """2 pi/p in s, shape (periods,): p is the block's rate omega0 of the linear equations."""
    cases: np.ndarray
    """Largest |phi|/nu without the pendulum and, if there is one, with it, (cases, periods); infinite where
    the block overturns, NaN where nothing is known."""

    def columns(self) -> dict[str, Any]:
        """A row for every block: 2 pi/p in s, and the largest tilts over the slenderness."""
        return {"period_s": self.periods, **dict(zip(CASE_KEYS, self.cases, strict=False))}

    def undecided(self) -> np.ndarray:
        """Number of blocks without an answer, of each case."""
        return np.sum(np.isnan(self.cases), axis=1)


def rocking_spectrum(
    block: Block,
    motion: GroundMotion,
    *,
    periods: checks.Vector | None = None,
    mass_ratio: checks.Real | None = None,
    length_ratio: checks.Real = 0.5,
    damping_ratio: checks.Real = 0.1,
    gravity: checks.Real = STANDARD_GRAVITY,
    free: checks.Real = FREE,
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
    length_ratio = checks.positive("length_ratio", length_ratio)
    times = _vector("periods", periods, np.linspace(1.0, 12.0, 200))
    free = checks.within("free", free, 0.0, LONGEST_FREE, " s")
    scene = Scene(block, motion, gravity)
    with_it = None
    if mass_ratio is not None:
        with_it = scene.pendulum(
            mass_ratio=mass_ratio, length_ratio=length_ratio, damping_ratio=damping_ratio
        )
    # Each period is another size of the block, and the same numbers without dimension.
    rates = 2.0 * np.pi / times
    rows = [rows_of(block, h, [motion], gravity) for h in ((None,) if with_it is None else (None, with_it))]
    x = np.repeat(np.concatenate(rows), times.size, axis=0)
    # All numbers but the duration of a piece depend on shapes and ratios only.
    x[:, 6] = float(motion.piece) * np.tile(rates, len(rows))
    late = free * np.tile(rates, len(rows))
    pieces = np.asarray(motion.pieces(), dtype=float)
    forcing = GroundForcing([pieces], late)
    found = follow_runs(Terms.linear, x, forcing, brief=True, cluster=cluster, progress=progress)
    return RockingSpectrum(times, found.tilt.reshape(len(rows), -1) / float(block.slenderness))
