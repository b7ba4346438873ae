"""Intensity measures of ground motions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

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


def intensity_of(name: str, block: Block, gravity: float, period: float | None) -> Intensity:
    """The measure of that name, for a block; see `tpd.fragility`.

    Raises:
        ValueError: a name that does not exist, or a spectral acceleration without a period.
    """
    checks.one_of("intensity", name, INTENSITIES)
    if (name == "sa") != (period is not None):
        raise ValueError(f'`period` belongs to `intensity="sa"`, but they are {period} and {name!r}')
    checks.positive("gravity", gravity)
    unit = gravity * float(block.slenderness)
    if period is not None:
        checks.positive("period", period)
        own = float(period)
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
    gained = h * c @ np.array([1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0])
    start = np.concatenate([[0.0], np.cumsum(gained)])
    largest = np.max(np.abs(start))
    # Within a piece the velocity is largest where the acceleration vanishes: between samples of other signs.
    # A cubic may vanish twice within a piece; a record's lines cannot.
    crossing = np.flatnonzero(c[:, 0] * c.sum(axis=1) < 0.0)
    for i in crossing:
        roots = np.roots(c[i, ::-1])
        x = np.real(roots[(np.abs(np.imag(roots)) < 1e-12) & (np.real(roots) > 0.0) & (np.real(roots) < 1.0)])
        inside = start[i] + h * x * (c[i, 0] + x * (c[i, 1] / 2.0 + x * (c[i, 2] / 3.0 + x * c[i, 3] / 4.0)))
        largest = max(largest, np.max(np.abs(inside), initial=0.0))
    return float(largest) * float(motion.pga)


def spectral_acceleration(motion: GroundMotion, period: float, damping: float = _DAMPING) -> float:
    """Largest |omega^2 x| (m/s^2) of a damped oscillator of that period, exact for accelerations that are
    linear between samples (N. C. Nigam and P. C. Jennings, Bull. Seismol. Soc. Am. 59, 1969), and sampled ten
    times in its period at least."""
    h, omega = float(motion.piece), 2.0 * np.pi / period
    parts = max(1, int(np.ceil(h / (0.1 * period))))
    step = h / parts
    times = np.arange(0.0, len(motion.pieces()) * h + 2.0 * period, step)
    a = motion.acceleration_at(times)
    root, decay = omega * np.sqrt(1.0 - damping**2), np.exp(-damping * omega * step)
    s, c = np.sin(root * step), np.cos(root * step)
    # After the motion the oscillator may still swing out further: two of its periods are enough.
    # Free motion over a step, and the particular solution -(a0 + a1 t)/omega^2 + 2 damping a1/omega^3.
    g = damping * omega / root
    move = decay * np.array([[c + g * s, s / root], [-(omega**2) / root * s, c - g * s]])
    y, largest = np.zeros(2), 0.0
    for a0, a1 in zip(a[:-1], np.diff(a) / step, strict=True):
        shift = 2.0 * damping * a1 / omega**3
        start = np.array([-a0 / omega**2 + shift, -a1 / omega**2])
        stop = start + np.array([-a1 * step / omega**2, 0.0])
        y = move @ (y - start) + stop
        largest = max(largest, abs(y[0]))
    return float(omega**2 * largest)
