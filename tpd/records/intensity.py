"""Intensity measures of ground motions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tpd.core import checks
from tpd.formats.channel import STANDARD_GRAVITY
from tpd.scene.conditions import MEASURES
from tpd.scene.ground_motion import GroundMotion, Pulse
from tpd.scene.hazard import Measure
from tpd.scene.record import Record
from tpd.scene.scene import Block, Scene

INTENSITIES = (*MEASURES, "sa")
"""Names of the intensity measures."""
_LIFTING = "1 = the acceleration that lifts the block"
"""Note on PGA/(g tan alpha), instead of a unit."""
SPECTRAL_DAMPING, _MOST_DAMPING = 0.05, 0.99
"""Default damping ratio of a spectrum, and the largest one. A critically damped oscillator does not
oscillate."""
_FINE = 0.1
"""Longest interval (times omega) in which a quintic represents the motion of an oscillator."""


@dataclass(frozen=True)
class Intensity:
    """Intensity measure, proportional to the ground motion."""

    name: str
    """Name with its symbols."""
    unit: str
    """Unit of the value."""
    value: Callable[[GroundMotion], float]
    """Function that returns the value for a motion."""


def intensity_of(name: str, block: Block, gravity: checks.Real, period: checks.Real | None) -> Intensity:
    """Return the measure with this name for a block; see `tpd.fragility`.

    Raises:
        ValueError: the name does not exist, or a spectral acceleration has no period.
    """
    checks.one_of("intensity", name, INTENSITIES)
    if name == "sa" and period is None:
        raise ValueError("the intensity sa, a spectral acceleration, needs `period` (--period S)")
    if period is not None and name != "sa":
        raise ValueError(f"`period` (--period) has an effect only with the intensity sa, but it is {name}")
    unit = checks.positive("gravity", gravity) * checks.plain("block", block.slenderness, single=True)
    if period is not None:
        own = checks.positive("period", period, 1e-3, 1e3, " s")
        sa = f"Sa({own:g} s)"
        return Intensity(sa, "g", lambda m: spectral_acceleration(m.at_ground, own) / STANDARD_GRAVITY)

    # An intensity is that of the ground, also for a block on a building.
    def relative_velocity(motion: GroundMotion) -> float:
        return float(Scene(block, motion, gravity).rate) * peak_velocity(motion) / unit

    measures = {
        "pga_star": Intensity("PGA/(g tan alpha)", _LIFTING, lambda m: float(m.at_ground.pga) / unit),
        "pgv_star": Intensity("p PGV/(g tan alpha)", "-", relative_velocity),
        "pga": Intensity("PGA", "g", lambda m: float(m.at_ground.pga) / STANDARD_GRAVITY),
        "pgv": Intensity("PGV", "m/s", peak_velocity),
        "scale": Intensity("factor", "-", lambda m: 1.0),
    }
    return measures[name]


def measure_of(name: str, block: Block, gravity: checks.Real, period: checks.Real | None) -> Measure:
    """Return the quantity of an intensity measure, such as PGA, with an intensity of 1 in g or m/s."""
    # The measures of one quantity are proportional to each other, so any motion shows their ratio.
    motion = Pulse.one_sine(acceleration=1.0, frequency=1.0)
    own, plain = (intensity_of(x, block, gravity, period) for x in (name, name.partition("_")[0]))
    return Measure(plain.name, plain.value(motion) / own.value(motion))


def base_motion(motion: GroundMotion) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return times (s), and acceleration (m/s^2), velocity (m/s) and displacement (m) of the base.

    The times are the ends of the pieces, and those at which the velocity or the displacement has an extreme
    value. The base is at rest before the motion.
    """
    from scipy.interpolate import PPoly

    c, h = float(motion.pga) * np.asarray(motion.pieces(), dtype=float), float(motion.piece)
    ends = h * np.arange(len(c) + 1)
    acceleration = PPoly((c / h ** np.arange(4)).T[::-1], ends)
    velocity = acceleration.antiderivative()
    turns = [x.roots(discontinuity=False, extrapolate=False) for x in (acceleration, velocity)]
    times = np.unique(np.concatenate([ends, *turns]))
    times = times[np.isfinite(times)]
    return times, acceleration(times), velocity(times), velocity.antiderivative()(times)


def significant_times(record: Record) -> tuple[float, float]:
    """Return the times (s) at which the integral of the squared acceleration reaches 5 % and 95 % of its
    final value.

    The definition is that of M. D. Trifunac and A. G. Brady, Bull. Seismol. Soc. Am. 65, 1975.
    """
    a = np.asarray(record.acceleration, dtype=float)
    energy = np.cumsum([0.0, *(a[:-1] ** 2 + a[:-1] * a[1:] + a[1:] ** 2)])
    times = float(record.dt) * np.arange(len(a))
    first, last = np.interp([0.05 * energy[-1], 0.95 * energy[-1]], energy, times)
    return float(first), float(last)


def peak_velocity(motion: GroundMotion) -> float:
    """Return the largest velocity of the base (m/s), which is at rest before the motion."""
    ground = motion.at_ground
    return float(ground.pgv if isinstance(ground, Record) else np.max(np.abs(base_motion(ground)[2])))


def spectral_acceleration(
    motion: GroundMotion, period: checks.Real, damping: checks.Real = SPECTRAL_DAMPING
) -> float:
    """Return the largest |omega^2 x| (m/s^2) of an oscillator with this period and a damping ratio below 1.

    The motion is exact at the ends of the pieces and at any time within them: the matrix exponential advances
    the state and the derivatives of the acceleration, which is cubic, from one time to the next. (N. C. Nigam
    and P. C. Jennings, Bull. Seismol. Soc. Am. 59, 1969, did this at the samples of a record.) A piece is
    halved as long as a bound on the motion within it exceeds the largest value so far. In intervals of less
    than a tenth of a radian the largest value is that of the quintic through the values, rates and
    accelerations at both ends. It differs from the motion by less than 1e-10.

    Raises:
        ValueError: a number is out of range, or the motion is of another class.
    """
    from scipy.interpolate import BPoly, PPoly
    from scipy.special import factorial

    checks.instance("motion", motion, GroundMotion)
    period = checks.positive("period", period, 1e-6, 1e6, " s")
    damping = checks.within("damping", damping, 0.0, _MOST_DAMPING)
    c = np.asarray(motion.pieces(), dtype=float)
    # The unit of time is 1/omega. With a suitable unit of length, omega^2 x is then an acceleration.
    h, free = 2.0 * np.pi * float(motion.piece) / period, math.sqrt(1.0 - damping**2)
    rates = np.diag([1.0, 0.0, 1.0, 1.0, 1.0], 1)
    # Row of the second derivative of the displacement.
    second = rates[1]
    second[:3] = -1.0, -2.0 * damping, -1.0
    # Rows of the states: displacement, its rate, and the acceleration of the base with its three derivatives.
    derivatives = c.T * (factorial(np.arange(4)) / h ** np.arange(4))[:, None]
    states = np.concatenate([np.zeros((2, len(c))), derivatives])
    # Free motion is the real part of size exp(exponent t). The pushes of the pieces add up to the sizes after
    # each piece. Every round doubles the number of pieces whose pushes are included.
    exponent, (x, rate) = complex(-damping, free), _exponential(rates * h)[:2, 2:] @ states[2:]
    sizes, far = x - 1j * (rate + damping * x) / free, 1
    while far < len(c):
        sizes[far:] += np.exp(exponent * h * far) * sizes[:-far]
        far *= 2
    displacements, speeds, *_ = states
    displacements[1:], speeds[1:] = sizes[:-1].real, (exponent * sizes[:-1]).real
    # The first turning point after the motion is the largest.
    size = complex(sizes[-1])
    turn = (0.5 * np.pi - np.angle(size * exponent)) % np.pi / free
    largest = max(np.abs(sizes.real).max(), abs((size * np.exp(exponent * turn)).real))
    while h > _FINE:
        # Keep only the pieces that can still exceed the largest value, and halve them.
        states = states[:, _bound(states, h, damping) > largest]
        h *= 0.5
        states = np.hstack([states, _exponential(rates * h) @ states])
        largest = max(largest, np.abs(states[0]).max(initial=0.0))
    ends = _exponential(rates * h) @ states
    # Bernstein coefficients of the quintics. No quintic exceeds its largest coefficient.
    near, far = (
        (x[0], x[0] + dt * x[1] / 5.0, x[0] + dt * 0.4 * x[1] + h**2 / 20.0 * (second @ x))
        for x, dt in ((states, h), (ends, -h))
    )
    quintics = np.stack([*near, *far[::-1]])
    quintics = quintics[:, np.abs(quintics).max(axis=0) > largest]
    if quintics.size:
        curve = PPoly.from_bernstein_basis(BPoly(quintics, np.arange(quintics.shape[1] + 1.0)))
        turns = curve.derivative().roots(discontinuity=False, extrapolate=False)
        largest = max(largest, np.abs(curve(turns[np.isfinite(turns)])).max(initial=0.0))
    return float(largest * motion.pga)


def _exponential(x: np.ndarray) -> np.ndarray:
    """Return the exponential of a small matrix by its series and by squaring.

    `scipy.linalg.expm` starts the threads of LAPACK, which take ten times as long as all else here.
    """
    halvings = max(0, math.ceil(math.log2(np.abs(x).sum(axis=1).max()) + 1.0))
    out = one = np.eye(len(x))
    for n in range(16, 0, -1):
        out = one + x @ out / (n * 2.0**halvings)
    return np.linalg.matrix_power(out, 2**halvings)


def _bound(states: np.ndarray, h: float, damping: float) -> np.ndarray:
    """Return a bound on |x| during the time h after each state of an oscillator.

    It is the sum of a bound on the polynomial that solves the equation of the oscillator, and of the
    amplitude of the free motion around it, which only decreases.
    """
    x, rate, a0, a1, a2, a3 = states
    # Derivatives of the polynomial, beginning with the highest.
    p3 = -a3
    p2 = -a2 - 2.0 * damping * p3
    p1 = -a1 - 2.0 * damping * p2 - p3
    p0 = -a0 - 2.0 * damping * p1 - p2
    steady = abs(p0) + h * (abs(p1) + h * (abs(p2) / 2.0 + h * abs(p3) / 6.0))
    return steady + np.hypot(x - p0, (rate - p1 + damping * (x - p0)) / math.sqrt(1.0 - damping**2))
