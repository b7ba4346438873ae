"""Overturning spectra and rocking spectra, without and with a pendulum.

An overturning spectrum is the effect of pulses of each frequency and size on one block. A rocking spectrum is
the largest tilt of blocks of one slenderness and all sizes under one motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.run_table import (
    CASE_KEYS,
    Cases,
    Progress,
    cases_of,
    follow_runs,
    follow_scaled,
    forcing_of,
)
from tpd.answers.transient import FREE
from tpd.compiled.rows import ground_row_of
from tpd.core import checks
from tpd.scene.ground_motion import LONGEST_FREE, STANDARD_GRAVITY, GroundMotion, Pulse
from tpd.scene.pytrees import single
from tpd.scene.scene import Block, Pendulum, Scene
from tpd.theory.equations import Terms

UNDECIDED, STANDS, ROCKS, OVERTURNS = -1, 0, 1, 2
"""Outcomes of a cell. `OVERTURNS` + n is an overturning after n impacts."""


@dataclass(frozen=True)
class OverturningSpectrum(Cases):
    """Outcomes over frequency and size of a pulse.

    Attributes:
        pulse: kind, cycles and phase of the pulses.
        frequency_ratios: omega_p/p, shape (frequencies,).
        acceleration_ratios: a_p/(g tan alpha), shape (accelerations,).
        cases: outcomes, shape (cases, accelerations, frequencies).
    """

    pulse: Pulse
    """Pulse that gives kind, cycles and phase. Frequency and size vary."""
    frequency_ratios: np.ndarray
    """omega_p/p, shape (frequencies,), where p is the rate omega0 of the block in the linear model."""
    acceleration_ratios: np.ndarray
    """a_p/(g tan alpha), shape (accelerations,): largest acceleration divided by the acceleration that lifts
    a block without a pendulum and without friction."""
    cases: np.ndarray
    """Outcomes without the pendulum and, if there is one, with it, shape (cases, accelerations, frequencies).
    -1 has no result, 0 stands, 1 rocks, and 2 + n overturns after n impacts."""

    def columns(self) -> dict[str, Any]:
        """Columns of a table with a row for each pulse: both ratios, and the numbers of the outcomes."""
        across, up = np.meshgrid(self.frequency_ratios, self.acceleration_ratios)
        cells = {name: c.ravel() for name, c in zip(CASE_KEYS, self.cases, strict=False)}
        return {"frequency_ratio": across.ravel(), "acceleration_ratio": up.ravel(), **cells}

    def safe(self) -> np.ndarray:
        """Return the share of the cells with a result in which the block does not overturn, for each case.

        NaN if no cell has an answer.
        """
        # Cells without a result are neither safe nor overturned.
        answered = [c[c != UNDECIDED] for c in self.cases]
        return np.array([np.mean(c < OVERTURNS) if c.size else np.nan for c in answered])

    def undecided(self) -> np.ndarray:
        """Return the number of cells without a result, for each case."""
        return np.sum(self.cases == UNDECIDED, axis=(1, 2))


def _vector(name: str, values: Any, usual: np.ndarray) -> np.ndarray:
    """Return positive numbers as a checked array; `usual` if `values` is None."""
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
    progress: Progress | None = None,
) -> OverturningSpectrum:
    """Follow a block under pulses of all frequencies and sizes.

    Args:
        block: block with its friction and restitution.
        pulse: pulse that gives kind, cycles and phase.
        pendulum: pendulum that is compared with the block without one; None for no comparison.
        frequency_ratios: omega_p/p; by default 120 values from 0.5 to 10.
        acceleration_ratios: a_p/(g tan alpha); by default 120 values from 0.5 to 10.
        gravity: acceleration of gravity, m/s^2.
        free: duration of the free motion after each pulse, s.
        progress: function that is called with (number of finished motions, number of all motions).

    Raises:
        ValueError: bad input.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9)
        >>> pulse = tpd.Pulse.one_sine(frequency=1.0, acceleration=1.0)
        >>> axes = {"frequency_ratios": [2.0, 5.0], "acceleration_ratios": [0.5, 2.0, 8.0]}
        >>> tpd.overturning_spectrum(block, pulse, **axes).without_pendulum
        array([[0, 0],
               [3, 1],
               [2, 2]])
    """
    checks.instance("block", block, Block)
    checks.instance("pulse", pulse, Pulse)
    checks.optional("pendulum", pendulum, Pendulum)
    w = _vector("frequency_ratios", frequency_ratios, np.linspace(0.5, 10.0, 120))
    a = _vector("acceleration_ratios", acceleration_ratios, np.linspace(0.5, 10.0, 120))
    scene = Scene(block, pulse, gravity)
    # Both ratios are relative to the block: to its rate, and to the acceleration g tan alpha.
    rate, unit = single((scene.rate, scene.gravity * block.slenderness))
    # One pulse of unit size for each frequency. The sizes are factors on it.
    motions = [replace(pulse, frequency=float(x) * rate / (2.0 * np.pi), acceleration=1.0) for x in w]
    factors = np.array([a * unit / float(m.pga) for m in motions])
    cases = cases_of(pendulum)
    options: dict[str, Any] = {"progress": progress}
    runs = follow_scaled(block, cases, motions, factors, gravity=gravity, free=free, brief=True, **options)
    # The number of impacts distinguishes the modes of overturning.
    outcomes = np.where(runs.is_overturned, OVERTURNS + runs.impacts, np.where(runs.is_lifted, ROCKS, STANDS))
    # The axes of the runs are cases, frequencies and accelerations.
    cells = np.where(runs.is_unanswered, UNDECIDED, outcomes).astype(int).swapaxes(1, 2)
    return OverturningSpectrum(pulse, w, a, cells)


@dataclass(frozen=True)
class RockingSpectrum(Cases):
    """Largest tilt of blocks of all sizes, without a pendulum and with one of constant ratios.

    Attributes:
        periods: 2 pi/p in s, shape (periods,).
        cases: largest |phi|/nu, shape (cases, periods).
    """

    periods: np.ndarray
    """2 pi/p in s, shape (periods,), where p is the rate omega0 of the block in the linear model."""
    cases: np.ndarray
    """Largest |phi|/nu without the pendulum and, if there is one, with it, shape (cases, periods). Infinite
    if the block overturns, NaN without a result."""

    def columns(self) -> dict[str, Any]:
        """Columns of a table with a row for each block: 2 pi/p in s, and the largest tilts over nu."""
        return {"period_s": self.periods, **dict(zip(CASE_KEYS, self.cases, strict=False))}

    def undecided(self) -> np.ndarray:
        """Return the number of blocks without a result, for each case."""
        return np.sum(np.isnan(self.cases), axis=1)


def rocking_spectrum(
    block: Block,
    motion: GroundMotion,
    *,
    periods: checks.Vector | None = None,
    mass_ratio: checks.Real | None = None,
    length_ratio: checks.Real = 0.5,
    damping_ratio: checks.Real = 0.1,
    hinge_ratio: checks.Real | None = None,
    gravity: checks.Real = STANDARD_GRAVITY,
    free: checks.Real = FREE,
    progress: Progress | None = None,
) -> RockingSpectrum:
    """Follow blocks of all sizes under one ground motion.

    Args:
        block: block with its slenderness, friction, restitution and shape. Its size varies.
        motion: a pulse or a record.
        periods: 2 pi/p in s; by default 200 values from 1 to 12.
        mass_ratio: mass of the bob divided by that of the block; None for no pendulum.
        length_ratio: length of the rod divided by the height of the centroid of the block.
        damping_ratio: damping ratio of the pendulum.
        hinge_ratio: height of the hinge divided by that of the centroid; default the top of the block.
        gravity: acceleration of gravity, m/s^2.
        free: duration of the free motion after the ground motion, s.
        progress: function that is called with (number of finished motions, number of all motions).

    Raises:
        ValueError: bad input.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9)
        >>> pulse = tpd.Pulse.one_sine(frequency=1.0, acceleration=4.0)
        >>> spectrum = tpd.rocking_spectrum(block, pulse, periods=[2.0, 4.0, 6.0], mass_ratio=0.1)
        >>> [round(float(tilt), 2) for tilt in spectrum.without_pendulum]
        [inf, inf, 0.4]
    """
    checks.instance("block", block, Block)
    checks.instance("motion", motion, GroundMotion)
    length_ratio = checks.positive("length_ratio", length_ratio)
    times = _vector("periods", periods, np.linspace(1.0, 12.0, 200))
    free = checks.within("free", free, 0.0, LONGEST_FREE, " s")
    scene = Scene(block, motion, gravity)
    pendulum = None
    # The ratios are converted with the size of the given block. They are the same for every other size.
    if mass_ratio is not None:
        pendulum = scene.pendulum(
            mass_ratio=mass_ratio,
            length_ratio=length_ratio,
            damping_ratio=damping_ratio,
            # The ratio is that of all blocks, and the height that of the given one.
            hinge_height=None if hinge_ratio is None else hinge_ratio * block.centroid,
        )
    # Each period belongs to another size of the block, and all sizes have the same dimensionless parameters.
    rates = 2.0 * np.pi / times
    # Only the dimensionless duration of a piece depends on the size. With NumPy numbers JAX compiles no
    # program.
    rows = [
        ground_row_of(single(scene.ground_parameters(case)), piece=float(motion.piece) * rates)
        for case in cases_of(pendulum)
    ]
    # The free time is given in seconds, but compiled code needs it in dimensionless time.
    forcing = forcing_of([motion], free * np.tile(rates, len(rows)))
    where: dict[str, Any] = {"progress": progress}
    runs = follow_runs(Terms.linear, np.concatenate(rows), forcing, brief=True, **where)
    # The slenderness is the same for all sizes.
    return RockingSpectrum(times, runs.tilt.reshape(len(rows), -1) / float(block.slenderness))
