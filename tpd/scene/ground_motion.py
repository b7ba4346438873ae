"""Ground motions: excitations that are not harmonic, and pulses in closed form."""

from __future__ import annotations

import hashlib
import itertools
import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.core.checks import Real
from tpd.formats.channel import GREATEST_PEAK, STANDARD_GRAVITY
from tpd.scene.earthquakes import STATED, UNSTATED, is_one

LONGEST_FREE = 1e5
"""Longest free motion (s) that is simulated after a ground motion."""
LEAST_EARTHQUAKES = 5
"""Smallest number of earthquakes from which statements about other earthquakes are made. With fewer, the
variation between earthquakes cannot be estimated."""

FREQUENCIES = 1e-6, 1e6
"""Lowest and highest frequency of an excitation, Hz."""
_MOST_CYCLES = 8.0
_LONGEST_TRAIN = 1000
"""Largest number of periods of an envelope, and of a train of sines."""


class GroundMotion:
    """Horizontal motion of the base in pieces of equal duration, with a cubic acceleration on each piece.

    The base is at rest before the first piece, and its acceleration is zero after the last piece.
    """

    in_drawing: ClassVar[str] = "ground motions"
    """Label of the arrow that shows the excitation in a drawing, which is the same for several motions."""
    swing_in_drawing: ClassVar[str] = "largest swing"
    """Name of the bob angle in a drawing."""

    @property
    @abstractmethod
    def pga(self) -> Real:
        """Largest acceleration, m/s^2."""

    @property
    @abstractmethod
    def piece(self) -> Real:
        """Duration of a piece, s."""

    @abstractmethod
    def pieces(self) -> Any:
        """Return the acceleration over `pga`, shape (pieces, 4).

        The columns are the coefficients of the powers 0 to 3 of the elapsed share of each piece.
        """

    @abstractmethod
    def scaled(self, factor: Real) -> Any:
        """Return the motion with all accelerations multiplied by `factor`."""

    @property
    def at_ground(self) -> Any:
        """Motion of the ground, to which intensities and hazards belong. It is another one than that of the
        base of the block only on a building."""
        return self

    @property
    def quantities(self) -> dict[str, Real]:
        """Part of `Scene.quantities` that states the excitation. A piece of the motion is its period."""
        return {"peak": self.pga, "frequency": 1.0 / self.piece}

    @property
    def duration(self) -> Real:
        """Duration, s."""
        return len(self.pieces()) * self.piece

    @cached_property
    def digest(self) -> str:
        """Text that only motions of equal accelerations share, whatever their names are."""
        sizes = float(self.pga), float(self.piece)
        # The sum with zero removes the sign of a zero.
        return hashlib.sha256((np.append(self.pieces(), sizes) + 0.0).tobytes()).hexdigest()

    def scaled_to(self, *, pga: Real | None = None, pga_g: Real | None = None) -> Any:
        """Return the motion whose ground has the largest acceleration `pga` (m/s^2) or `pga_g` (in units of
        9.80665 m/s^2).

        Raises:
            ValueError: both or none are given, or the value is not positive.
        """
        if (pga is None) == (pga_g is None):
            both = f"they are {pga} and {pga_g}"
            raise ValueError(f"exactly one of `pga` and `pga_g` must be given, but {both}")
        if pga_g is not None:
            pga = checks.positive("pga_g", pga_g) * STANDARD_GRAVITY
        peak = checks.positive("pga", pga)
        checks.plausible("`pga`", peak / STANDARD_GRAVITY, "pga")
        own = self.at_ground.pga
        if checks.is_concrete(own) and float(own) == 0.0:
            raise ValueError("a motion of zeros cannot be scaled to a peak")
        return self.scaled(peak / own)

    def acceleration_at(self, times: Any) -> np.ndarray:
        """Return the acceleration (m/s^2) at `times` in s; zero before and after the motion."""
        at = np.clip(checks.each("times", times), -1e9, 1e9)
        # Evaluate the cubic of the piece that contains each time by Horner's scheme.
        c, share = np.asarray(self.pieces()), at / float(self.piece)
        i = np.clip(np.floor(share), 0, len(c) - 1).astype(int)
        x, (c0, c1, c2, c3) = share - i, np.moveaxis(c[i], -1, 0)
        values = c0 + x * (c1 + x * (c2 + x * c3))
        return np.where((share < 0.0) | (share > len(c)), 0.0, values) * float(self.pga)


def events_of(motions: Sequence[GroundMotion]) -> list[str]:
    """Return the earthquake of every motion.

    All records without an earthquake belong to one, and each pulse is another. Copies of one motion, and
    motions whose files name one earthquake differently, have the name of the first of them. Two different
    names that the user states are two earthquakes.
    """
    events = [getattr(m, "event", f"pulse {i + 1}") for i, m in enumerate(motions)]
    are_stated = [STATED in getattr(m, "notes", ()) for m in motions]
    names = [event or UNSTATED for event in events]
    for j, i in itertools.combinations(range(len(events)), 2):
        # If two motions are copies with different names, both names belong to one earthquake. Replace the
        # name everywhere.
        if names[i] == names[j]:
            continue
        is_named = not (are_stated[i] and are_stated[j]) and is_one(events[i], events[j])
        if is_named or copy_factor(motions[i], motions[j]):
            names = [names[j] if name == names[i] else name for name in names]
    return names


def earthquakes_of(motions: Sequence[GroundMotion]) -> np.ndarray:
    """Return the number of the earthquake of every motion, see `events_of`.

    The numbers depend on the accelerations of the motions, and not on their names or on their order.
    """
    first: dict[str, str] = {}
    for event, motion in zip(names := events_of(motions), motions, strict=True):
        first[event] = min(first.get(event, "g"), motion.digest)
    return np.unique([first[event] for event in names], return_inverse=True)[1]


def copy_factor(first: GroundMotion, second: GroundMotion) -> float:
    """Return the ratio of the samples of two records that are the same motion; 0 for two motions.

    They may differ by a factor, by the time step, by a part that was cut off, by zeros before or after the
    motion, and by the number of digits in a file.
    """
    pair: list[Any] = [m for m in (first, second) if np.ndim(getattr(m, "acceleration", 0.0)) == 1]
    if len(pair) < 2:
        return 0.0
    # Compare at the samples of the record with the larger step.
    (s, b), (h, a) = sorted(((float(m.piece), np.asarray(m.acceleration)) for m in pair), key=lambda x: x[0])
    times, at, has_steps = s * np.arange(len(b)), h * np.arange(len(a)), h - s > 1e-6 * h
    # Copies begin or end together, or have their peaks at one time. Another step shifts the peak.
    most = min(math.ceil(h / s), 50) if has_steps else 0
    peaks = s * np.argmax(np.abs(b)) - h * np.argmax(np.abs(a))
    shifts = np.array([0.0, times[-1] - at[-1], *(peaks + s * np.arange(-most, most + 1))])
    # A few samples exclude most pairs. The correlation of two components of one station is below 0.6. Another
    # step leaves 0.956, and rounding to three digits 0.9999.
    for stride, least in ((1 + len(a) // 100, 0.85), (1, 0.95 if has_steps else 0.9999)):
        when = at[::stride] + shifts[:, None]
        inside = (when >= -1e-6 * s) & (when <= times[-1] + 1e-6 * s)
        x, y = np.where(inside, a[::stride], 0.0), np.where(inside, np.interp(when, times, b), 0.0)
        xx, yy, xy = (np.sum(one * other, axis=1) for one, other in ((x, x), (y, y), (x, y)))
        fits = (np.abs(xy) > least * np.sqrt(xx * yy)) & (np.sum(inside, axis=1) >= min(len(x[0]), 20))
        if stride == 1:
            # The common part must have much of the energy of one of the records.
            fits &= (xx > 0.4 * np.sum(a * a)) | (yy * h > 0.4 * np.sum(b * b) * s)
        if not fits.any():
            return 0.0
        shifts = shifts[fits]
    return float((xy / xx)[fits][0])


def refuse_zeros(motions: Sequence[GroundMotion]) -> None:
    """Raise `ValueError` for motions whose acceleration is always zero, because no factor makes them move a
    block."""
    zeros = [i for i, m in enumerate(motions) if checks.is_concrete(m.pga) and not float(m.pga) > 0.0]
    if zeros:
        names = ", ".join(getattr(motions[i], "name", "") or f"number {i + 1}" for i in zeros)
        raise ValueError(f"a motion of zeros cannot be scaled to any intensity, but there is one: {names}")


_Shape = Callable[[Any, Any, Any, Any], Any]
"""Function that returns the acceleration over `Pulse.acceleration`. Its arguments are x = 2 pi frequency t,
with x = 0 in the middle of the pulse, the cycles, the phase, and the module `numpy`, or `jax.numpy` if one of
them is traced."""


class PulseKind(NamedTuple):
    """Definition of a kind of pulse."""

    shape: _Shape
    """Function that returns the acceleration."""
    cubics: int
    """Number of cubics that represent a pulse, or a period of a train. Their error is below 2e-9 (of a train
    4e-8). The error averages out, so motions are accurate to 1e-12 (`tests/answers/test_transient.py`
    doubles the number)."""
    periods: float | None = 1.0
    """Duration in periods. None means the duration of the envelope, `Pulse.cycles`."""
    is_train: bool = False
    """Whether the cycles are whole periods."""


def _mavroeidis(x: Any, cycles: Any, phase: Any, np_: Any) -> Any:
    carrier, slope = np_.cos(x + phase), np_.sin(x + phase)
    return -0.5 * (np_.sin(x / cycles) * carrier / cycles + (1.0 + np_.cos(x / cycles)) * slope)


PULSES = {
    "one-sine": PulseKind(lambda x, cycles, phase, np_: -np_.sin(x), 256),
    "one-cosine": PulseKind(lambda x, cycles, phase, np_: -np_.cos(x), 256),
    # After two periods from the middle the exponent is -pi^2 2^2, which leaves 6e-16 of the peak.
    "ricker": PulseKind(
        lambda x, cycles, phase, np_: (1.0 - 0.5 * x**2) * np_.exp(-0.25 * x**2), 1024, periods=4.0
    ),
    "mavroeidis-papageorgiou": PulseKind(_mavroeidis, 1024, periods=None),
    # The factor cos(pi cycles) makes the train begin with an increasing sine for any number of periods.
    "sine-train": PulseKind(
        lambda x, cycles, phase, np_: np_.cos(np_.pi * float(cycles)) * np_.sin(x),
        128,
        periods=None,
        is_train=True,
    ),
}
"""Kinds of pulses, by name."""


@dataclass(frozen=True, kw_only=True)
class Pulse(GroundMotion):
    """Pulse of the base acceleration.

    Create a pulse by `one_sine`, `one_cosine`, `ricker`, `mavroeidis_papageorgiou` or `sine_train`. The
    fields are its `kind`, the `acceleration` in m/s^2, the `frequency` in Hz, the number of `cycles`, and the
    `phase` in rad.

    Raises:
        ValueError: the kind does not exist, or a number is out of range.

    Example:
        >>> import tpd
        >>> pulse = tpd.Pulse.one_sine(acceleration=3.0, frequency=2.0)
        >>> pulse.pga, pulse.periods
        (3.0, 1.0)
    """

    kind: str
    """Kind of pulse: one-sine, one-cosine, ricker, mavroeidis-papageorgiou or sine-train."""
    acceleration: Real
    """Amplitude, m/s^2. This is the largest acceleration of all kinds except "mavroeidis-papageorgiou"."""
    frequency: Real
    """Frequency of the pulse, Hz."""
    cycles: Real = 1.0
    """Width of the envelope in periods, gamma of Mavroeidis and Papageorgiou; for a train the number of
    periods."""
    phase: Real = 0.0
    """Phase relative to the middle of the envelope, rad, as in Mavroeidis and Papageorgiou (2003)."""

    def __post_init__(self) -> None:
        checks.one_of("kind", self.kind, tuple(PULSES))
        checks.set_checked(self, checks.not_negative, "acceleration", 0.0, GREATEST_PEAK, " m/s^2")
        checks.set_checked(self, checks.positive, "frequency", *FREQUENCIES, " Hz")
        checks.set_checked(self, checks.number, "cycles")
        checks.set_checked(self, checks.within, "phase", -2.0 * math.pi, 2.0 * math.pi, " rad")
        if PULSES[self.kind].is_train:
            # The number of periods determines the shapes of arrays, so it must be a plain whole number.
            whole = checks.is_concrete(self.cycles) and self.cycles == round(self.cycles)
            if not (whole and 1.0 <= self.cycles <= _LONGEST_TRAIN):
                allowed = f"a whole number from 1 to {_LONGEST_TRAIN}"
                raise ValueError(f"`cycles` of a train must be {allowed}, but is {self.cycles}")
        else:
            checks.within("cycles", self.cycles, 1.0, _MOST_CYCLES)

    @classmethod
    def one_sine(cls, *, acceleration: Real, frequency: Real) -> Pulse:
        """Return one period of a sine: acceleration sin(2 pi frequency t)."""
        return cls(kind="one-sine", acceleration=acceleration, frequency=frequency)

    @classmethod
    def sine_train(cls, *, acceleration: Real, frequency: Real, cycles: int) -> Pulse:
        """Return whole periods of a sine from rest: a harmonic of finite duration."""
        return cls(kind="sine-train", acceleration=acceleration, frequency=frequency, cycles=cycles)

    @classmethod
    def one_cosine(cls, *, acceleration: Real, frequency: Real) -> Pulse:
        """Return one period of a cosine, which begins and ends with a jump."""
        return cls(kind="one-cosine", acceleration=acceleration, frequency=frequency)

    @classmethod
    def ricker(cls, *, acceleration: Real, frequency: Real) -> Pulse:
        """Return Ricker's symmetric wavelet: acceleration (1 - 2 x^2) exp(-x^2) with x = pi frequency t.

        It is cut off where it is 1e-15 of its peak (N. Ricker, Geophysics 8, 1943).
        """
        return cls(kind="ricker", acceleration=acceleration, frequency=frequency)

    @classmethod
    def mavroeidis_papageorgiou(
        cls, *, velocity: Real, frequency: Real, cycles: Real, phase: Real = 0.0
    ) -> Pulse:
        """Return the near-fault pulse of G. P. Mavroeidis and A. S. Papageorgiou (Bull. Seismol. Soc. Am. 93,
        2003).

        Its base velocity in m/s is

            velocity/2 [1 + cos(x/cycles)] cos(x + phase),   x = 2 pi frequency t, |x| <= pi cycles.

        The acceleration of the result is velocity times 2 pi frequency.
        """
        velocity = checks.not_negative("velocity", velocity)
        frequency = checks.positive("frequency", frequency)
        kind, peak = "mavroeidis-papageorgiou", 2.0 * math.pi * frequency * velocity
        return cls(kind=kind, acceleration=peak, frequency=frequency, cycles=cycles, phase=phase)

    @property
    def periods(self) -> Real:
        """Duration in periods."""
        periods = PULSES[self.kind].periods
        return self.cycles if periods is None else periods

    @property
    def _count(self) -> int:
        """Number of cubics that represent the pulse."""
        kind = PULSES[self.kind]
        return kind.cubics * (int(self.cycles) if kind.is_train else 1)

    @property
    def _namespace(self) -> Any:
        # The shape of a pulse without an envelope depends on plain numbers only, even if its amplitude is
        # traced.
        return np if PULSES[self.kind].periods else checks.namespace(self.cycles, self.phase)

    @property
    def pga(self) -> Real:
        """Largest acceleration, m/s^2."""
        kind = PULSES[self.kind]
        # Without an envelope the largest value of the shape is 1.
        if kind.periods or kind.is_train:
            return self.acceleration
        np_ = self._namespace
        # The peak of this pulse depends on cycles and phase, so sample the shape.
        x = np_.linspace(-1.0, 1.0, 20001) * math.pi * self.periods
        return self.acceleration * checks.largest(kind.shape(x, self.cycles, self.phase, np_))

    @property
    def piece(self) -> Real:
        """Duration of a piece, s."""
        return self.periods / self.frequency / self._count

    def scaled(self, factor: Real) -> Pulse:
        """Return the pulse with all accelerations multiplied by `factor`."""
        return replace(self, acceleration=self.acceleration * checks.number("factor", factor))

    def pieces(self) -> Any:
        """Return the acceleration over `pga` as cubics; see `GroundMotion.pieces`."""
        n = self._count
        # Each cubic interpolates the pulse at the four Gauss points of its piece. The error is then
        # orthogonal to cubics and has almost no effect on a block.
        share = 0.5 + 0.5 * np.polynomial.legendre.leggauss(4)[0]
        x = ((np.arange(n)[:, None] + share) / n - 0.5) * 2.0 * math.pi * self.periods
        # Divide by the peak of the shape, because the coefficients are relative to `pga`.
        unit = replace(self, acceleration=1.0).pga
        values = PULSES[self.kind].shape(x, self.cycles, self.phase, self._namespace) / unit
        return values @ np.linalg.inv(np.vander(share, increasing=True)).T
