"""Motions of the base that are not harmonic: what they have in common, and pulses in closed form."""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.core.checks import Real
from tpd.formats.channel import STANDARD_GRAVITY
from tpd.scene.earthquakes import is_one

LONGEST_FREE = 1e5
"""Longest free motion (s) that is followed after a ground motion."""

GREATEST_PULSE = 1e4
"""Largest acceleration of a pulse, m/s^2."""
FREQUENCIES = 1e-6, 1e6
"""Lowest and highest frequency of a motion of the base, Hz."""
_MOST_CYCLES = 8.0
_LONGEST_TRAIN = 1000
"""Largest numbers of periods of an envelope, and of a train of sines."""


class GroundMotion:
    """A horizontal motion of the base in pieces of equal duration, its acceleration a cubic on each.

    The base is at rest before the first piece and unaccelerated after the last.
    """

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
        """Acceleration over `pga`, shape (pieces, 4): coefficients of the powers 0 to 3 of the share of each
        piece that has passed."""

    @abstractmethod
    def scaled(self, factor: Real) -> Any:
        """The motion with all accelerations times `factor`."""

    @property
    def duration(self) -> Real:
        """s"""
        return len(self.pieces()) * self.piece

    def scaled_to(self, *, pga: Real | None = None, pga_g: Real | None = None) -> Any:
        """The motion with this largest acceleration: `pga` in m/s^2, or `pga_g` in units of 9.80665 m/s^2.

        Raises:
            ValueError: both or none of them, or one that is not positive.
        """
        if (pga is None) == (pga_g is None):
            raise ValueError(
                f"exactly one of `pga` and `pga_g` must be given, but they are {pga} and {pga_g}"
            )
        if pga_g is not None:
            pga = checks.positive("pga_g", pga_g) * STANDARD_GRAVITY
        wanted = checks.positive("pga", pga)
        if checks.is_concrete(self.pga) and float(self.pga) == 0.0:
            raise ValueError("a record of zeros cannot be scaled to a peak")
        return self.scaled(wanted / self.pga)

    def acceleration_at(self, times: Any) -> np.ndarray:
        """Acceleration (m/s^2) at `times` in s; zero before and after the motion."""
        at = np.clip(checks.each("times", times), -1e9, 1e9)
        c, share = np.asarray(self.pieces()), at / float(self.piece)
        i = np.clip(np.floor(share), 0, len(c) - 1).astype(int)
        x = share - i
        values = c[i, 0] + x * (c[i, 1] + x * (c[i, 2] + x * c[i, 3]))
        return np.where((share < 0.0) | (share > len(c)), 0.0, values) * float(self.pga)


def events_of(motions: Sequence[GroundMotion]) -> list[str]:
    """Earthquake of every motion. A motion without one has its own; copies of one motion, and motions whose
    files write one earthquake differently, have the name of the first."""
    events = [getattr(m, "event", "") for m in motions]
    names = [event or f"motion {i + 1}" for i, event in enumerate(events)]
    for j, i in itertools.combinations(range(len(events)), 2):
        # A copy may carry another name: then both names are of one earthquake.
        named = bool(events[i] and events[j])
        if names[i] != names[j] and (
            (named and is_one(events[i], events[j])) or are_copies(motions[i], motions[j])
        ):
            names = [names[j] if name == names[i] else name for name in names]
    return names


def are_copies(first: GroundMotion, second: GroundMotion) -> bool:
    """Return whether two records are one motion, up to a factor, the digits of a file, and zeros before it or
    after it."""
    a: Any = getattr(first, "acceleration", 0.0)
    b: Any = getattr(second, "acceleration", 0.0)
    if np.ndim(a) != 1 or np.ndim(b) != 1:
        return False
    if abs(float(first.piece) - float(second.piece)) > 1e-6 * float(first.piece):
        return False
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    energies, peaks = (a @ a, b @ b), (np.max(np.abs(a)) ** 2, np.max(np.abs(b)) ** 2)
    # Quick for most pairs: zeros and a factor change no energy over the square of the peak.
    if abs(energies[0] * peaks[1] - energies[1] * peaks[0]) > 1e-3 * energies[0] * peaks[1]:
        return False
    size = float(np.sqrt(energies[0] * energies[1]))
    # Two components of one place are below 0.9; rounding to three digits leaves 0.99999.
    n = len(a) + len(b)
    correlation = np.fft.irfft(np.fft.rfft(a, n) * np.conj(np.fft.rfft(b, n)), n)
    return size == 0.0 or float(np.max(np.abs(correlation))) > 0.9999 * size


def refuse_zeros(motions: Sequence[GroundMotion]) -> None:
    """Refuse motions whose acceleration is zero throughout: no factor makes them move a block.

    Raises:
        ValueError: such a motion.
    """
    still = [i for i, m in enumerate(motions) if checks.is_concrete(m.pga) and not float(m.pga) > 0.0]
    if still:
        names = ", ".join(getattr(motions[i], "name", "") or f"number {i + 1}" for i in still)
        raise ValueError(f"a motion of zeros cannot be scaled to any intensity, but there is one: {names}")


_Shape = Callable[[Any, Any, Any, Any], Any]
"""Acceleration over `Pulse.acceleration`, of x = 2 pi frequency t with x = 0 in the middle of the pulse, the
cycles, the phase, and `numpy`, or `jax.numpy` where one of these is traced."""


class PulseKind(NamedTuple):
    """All that makes a kind of pulse."""

    shape: _Shape
    cubics: int
    """Cubics that stand for a pulse, or for a period of a train: they are within 2e-9 of it (a train: 4e-8).
    Their error averages out: motions are within 1e-12 (`tests/answers/test_transient.py` doubles them)."""
    periods: float | None = 1.0
    """Duration in periods; None is that of the envelope, `Pulse.cycles`."""
    is_train: bool = False
    """Whether the cycles are whole periods."""
    peaks_at_one: bool = True
    """Whether the largest value of `shape` is 1."""


def _mavroeidis(x: Any, cycles: Any, phase: Any, np_: Any) -> Any:
    carrier, slope = np_.cos(x + phase), np_.sin(x + phase)
    return -0.5 * (np_.sin(x / cycles) * carrier / cycles + (1.0 + np_.cos(x / cycles)) * slope)


PULSES = {
    "one-sine": PulseKind(lambda x, cycles, phase, np_: -np_.sin(x), 256),
    "one-cosine": PulseKind(lambda x, cycles, phase, np_: -np_.cos(x), 256),
    # With four periods pi^2 2^2 in the exponent leaves 6e-16 of the peak.
    "ricker": PulseKind(
        lambda x, cycles, phase, np_: (1.0 - 0.5 * x**2) * np_.exp(-0.25 * x**2), 1024, periods=4.0
    ),
    "mavroeidis-papageorgiou": PulseKind(_mavroeidis, 1024, periods=None, peaks_at_one=False),
    # A train begins at zero whatever the number of its periods.
    "sine-train": PulseKind(
        lambda x, cycles, phase, np_: np_.cos(np_.pi * float(cycles)) * np_.sin(x),
        128,
        periods=None,
        is_train=True,
    ),
}
"""Kinds of pulses by their names."""


@dataclass(frozen=True, kw_only=True)
class Pulse(GroundMotion):
    """A pulse of base acceleration; made by `one_sine`, `one_cosine`, `ricker` and `mavroeidis_papageorgiou`.

    Raises:
        ValueError: a kind that does not exist, or a number out of range.
    """

    kind: str
    """Kind of pulse: one-sine, one-cosine, ricker, mavroeidis-papageorgiou or sine-train."""
    acceleration: Real
    """Amplitude, m/s^2; of all kinds but "mavroeidis-papageorgiou" the largest acceleration."""
    frequency: Real
    """Frequency of the pulse, Hz."""
    cycles: Real = 1.0
    """Width of the envelope in periods: gamma of Mavroeidis and Papageorgiou; periods of a train."""
    phase: Real = 0.0
    """Phase against the envelope's middle, rad: nu of Mavroeidis and Papageorgiou."""

    def __post_init__(self) -> None:
        checks.one_of("kind", self.kind, tuple(PULSES))
        checks.set_checked(self, checks.not_negative, "acceleration", 0.0, GREATEST_PULSE, " m/s^2")
        checks.set_checked(self, checks.positive, "frequency", *FREQUENCIES, " Hz")
        checks.set_checked(self, checks.number, "cycles phase")
        if PULSES[self.kind].is_train:
            # The number of periods shapes the arrays.
            whole = checks.is_concrete(self.cycles) and self.cycles == round(self.cycles)
            if not (whole and 1.0 <= self.cycles <= _LONGEST_TRAIN):
                wanted = f"a whole number from 1 to {_LONGEST_TRAIN}"
                raise ValueError(f"`cycles` of a train must be {wanted}, but is {self.cycles}")
        elif checks.is_concrete(self.cycles) and not 1.0 <= self.cycles <= _MOST_CYCLES:
            raise ValueError(f"`cycles` must lie within 1 and 8, but is {self.cycles:g}")

    @classmethod
    def one_sine(cls, *, acceleration: Real, frequency: Real) -> Pulse:
        """One period of a sine: acceleration sin(2 pi frequency t)."""
        return cls(kind="one-sine", acceleration=acceleration, frequency=frequency)

    @classmethod
    def sine_train(cls, *, acceleration: Real, frequency: Real, cycles: int) -> Pulse:
        """Whole periods of a sine from rest: a harmonic of finite duration."""
        return cls(kind="sine-train", acceleration=acceleration, frequency=frequency, cycles=cycles)

    @classmethod
    def one_cosine(cls, *, acceleration: Real, frequency: Real) -> Pulse:
        """One period of a cosine; it begins and ends with a jump."""
        return cls(kind="one-cosine", acceleration=acceleration, frequency=frequency)

    @classmethod
    def ricker(cls, *, acceleration: Real, frequency: Real) -> Pulse:
        """Ricker's symmetric wavelet: acceleration (1 - 2 x^2) exp(-x^2) with x = pi frequency t, cut off
        where it is 1e-15 of its peak (N. Ricker, Geophysics 8, 1943)."""
        return cls(kind="ricker", acceleration=acceleration, frequency=frequency)

    @classmethod
    def mavroeidis_papageorgiou(
        cls, *, velocity: Real, frequency: Real, cycles: Real, phase: Real = 0.0
    ) -> Pulse:
        """Near-fault pulse with the base velocity (G. P. Mavroeidis and A. S. Papageorgiou, Bull. Seismol.
        Soc. Am. 93, 2003)

            velocity/2 [1 + cos(x/cycles)] cos(x + phase),   x = 2 pi frequency t, |x| <= pi cycles,

        in m/s. The acceleration of the result is velocity times 2 pi frequency.
        """
        velocity = checks.not_negative("velocity", velocity)
        frequency = checks.positive("frequency", frequency)
        return cls(
            kind="mavroeidis-papageorgiou",
            acceleration=2.0 * math.pi * frequency * velocity,
            frequency=frequency,
            cycles=cycles,
            phase=phase,
        )

    @property
    def periods(self) -> Real:
        """Duration in periods."""
        periods = PULSES[self.kind].periods
        return self.cycles if periods is None else periods

    @property
    def _count(self) -> int:
        """Cubics that stand for the pulse."""
        kind = PULSES[self.kind]
        return kind.cubics * (int(self.cycles) if kind.is_train else 1)

    @property
    def _namespace(self) -> Any:
        # A pulse without an envelope is made of known numbers also where its size is traced.
        return np if PULSES[self.kind].periods else checks.namespace(self.cycles, self.phase)

    @property
    def pga(self) -> Real:
        """Largest acceleration, m/s^2."""
        kind = PULSES[self.kind]
        if kind.peaks_at_one:
            return self.acceleration
        np_ = self._namespace
        x = np_.linspace(-1.0, 1.0, 20001) * math.pi * self.periods
        return self.acceleration * np_.max(np_.abs(kind.shape(x, self.cycles, self.phase, np_)))

    @property
    def piece(self) -> Real:
        """Duration of a piece, s."""
        return self.periods / self.frequency / self._count

    def scaled(self, factor: Real) -> Pulse:
        """The pulse with all accelerations times `factor`."""
        return replace(self, acceleration=self.acceleration * checks.number("factor", factor))

    def pieces(self) -> Any:
        """Acceleration over `pga`, as cubics; see `GroundMotion.pieces`."""
        n = self._count
        # Through Gauss's points of every piece: the error is orthogonal to cubics and hardly moves a block.
        share = 0.5 + 0.5 * np.polynomial.legendre.leggauss(4)[0]
        x = ((np.arange(n)[:, None] + share) / n - 0.5) * 2.0 * math.pi * self.periods
        unit = replace(self, acceleration=1.0).pga
        values = PULSES[self.kind].shape(x, self.cycles, self.phase, self._namespace) / unit
        return values @ np.linalg.inv(np.vander(share, increasing=True)).T
