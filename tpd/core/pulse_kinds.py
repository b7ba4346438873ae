"""Shapes of pulses, each with all that makes it a kind of `tpd.Pulse`. Loads neither JAX nor NumPy: the help
of the command line lists them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

Shape = Callable[[Any, Any, Any, Any], Any]
"""Acceleration over `Pulse.acceleration`, of x = 2 pi frequency t with x = 0 in the middle of the pulse, the
cycles, the phase, and `numpy`, or `jax.numpy` where one of these is traced."""


class PulseKind(NamedTuple):
    """A kind of pulse."""

    shape: Shape
    cubics: int
    """Cubics that stand for a pulse, or for a period of a train: they are within 2e-9 of it (a train: 4e-8).
    Their error averages out: motions are within 1e-12 (`tests/analysis/test_transient.py` doubles them)."""
    periods: float | None = 1.0
    """Duration in periods; None is that of the envelope, `Pulse.cycles`."""
    is_train: bool = False
    """Whether the cycles are whole periods."""
    peaks_at_one: bool = True
    """Whether the largest value of `shape` is 1."""


def _mavroeidis(x: Any, cycles: Any, phase: Any, np_: Any) -> Any:
    carrier, slope = np_.cos(x + phase), np_.sin(x + phase)
    return -0.5 * (np_.sin(x / cycles) * carrier / cycles + (1.0 + np_.cos(x / cycles)) * slope)


KINDS = {
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
