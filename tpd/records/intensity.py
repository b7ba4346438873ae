"""Intensity measures of ground motions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PPoly
from scipy.signal import lsim

from tpd.core import checks
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.scene import Block, Scene

INTENSITIES = ("pga_star", "pgv_star", "pga", "pgv", "sa", "scale")
_DAMPING = 0.05


@dataclass(frozen=True)
class Intensity:
    """A measure of the size of a ground motion, proportional to it."""

    name: str
    unit: str
    value: Callable[[GroundMotion], float]
    """Its value for a motion as it is."""


def intensity_of(name: str, block: Block, gravity: checks.Real, period: checks.Real | None) -> Intensity:
    """The measure of that name, for a block; see `tpd.fragility`.

    Raises:
        ValueError: a name that does not exist, or a spectral acceleration without a period.
    """
    checks.one_of("intensity", name, INTENSITIES)
    if (name == "sa") != (period is not None):
        raise ValueError(f'`period` belongs to `intensity="sa"`, but they are {period} and {name!r}')
    unit = checks.positive("gravity", gravity) * checks.plain("block", block.slenderness, single=True)
    if period is not None:
        own = checks.positive("period", period, 1e-3, 1e3, " s")
        return Intensity(f"Sa({own:g} s)", "m/s^2", lambda m: spectral_acceleration(m, own))

    def relative_velocity(motion: GroundMotion) -> float:
        return float(Scene(block, motion, gravity).rate) * peak_velocity(motion) / unit

    measures = {
        "pga_star": Intensity("PGA/(g tan alpha)", "-", lambda m: float(m.pga) / unit),
        "pgv_star": Intensity("p PGV/(g tan alpha)", "-", relative_velocity),
        "pga": Intensity("PGA", "m/s^2", lambda m: float(m.pga)),
        "pgv": Intensity("PGV", "m/s", peak_velocity),
        "scale": Intensity("factor", "-", lambda m: 1.0),
    }
    return measures[name]


def peak_velocity(motion: GroundMotion) -> float:
    """Largest velocity of the base (m/s), which is at rest before the motion: at ends and turns of pieces."""
    c, h = np.asarray(motion.pieces(), dtype=float), float(motion.piece)
    ends = h * np.arange(len(c) + 1)
    acceleration = PPoly((c / h ** np.arange(4)).T[::-1], ends)
    # Within a piece the velocity is largest where the acceleration vanishes: between samples of other signs.
    turns = acceleration.roots(discontinuity=False, extrapolate=False)
    velocities = acceleration.antiderivative()(np.concatenate([ends, turns[np.isfinite(turns)]]))
    return float(np.max(np.abs(velocities))) * float(motion.pga)


def spectral_acceleration(motion: GroundMotion, period: float, damping: float = _DAMPING) -> float:
    """Largest |omega^2 x| (m/s^2) of a damped oscillator of that period, exact for accelerations that are
    linear between samples (N. C. Nigam and P. C. Jennings, Bull. Seismol. Soc. Am. 59, 1969), and sampled ten
    times in its period at least."""
    h, omega = float(motion.piece), 2.0 * np.pi / period
    step = h / max(1, int(np.ceil(h / (0.1 * period))))
    # After the motion the oscillator may still swing out further: two of its periods are enough.
    times = step * np.arange(round((len(motion.pieces()) * h + 2.0 * period) / step))
    oscillator = [[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]], [[0.0], [-1.0]], [[1.0, 0.0]], [[0.0]]
    x = lsim(oscillator, motion.acceleration_at(times), times)[1]
    return float(omega**2 * np.max(np.abs(x)))
