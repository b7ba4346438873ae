"""The length of a pendulum relative to that of a pendulum with the period of the excitation."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from tpd import Harmonic, Nonlinear, Pendulum, Pulse, Record, Scene, transient
from tpd.scene.scene import Block
from tpd.theory import relative_length


def test_the_relative_length_is_the_squared_ratio_of_the_periods():
    length, frequency = 1.2, 0.8
    expected = (2 * np.pi * np.sqrt(length / 9.80665) * frequency) ** 2
    for excitation in (
        Harmonic(amplitude=0.05, frequency=frequency),
        Pulse.ricker(acceleration=2.0, frequency=frequency),
    ):
        assert relative_length(length, excitation) == pytest.approx(expected, rel=1e-14)
    # Of whole periods of a sine that begin with the velocity at its mean, PGA/PGV is omega.
    cycles = np.linspace(0.0, 1.0, 4001)
    sine = Record(acceleration=np.cos(2 * np.pi * cycles), dt=1 / frequency / 4000)
    assert relative_length(length, sine) == pytest.approx(4.0 * expected, rel=1e-5)
    on_moon = relative_length(length, sine, gravity=1.62)
    assert on_moon == pytest.approx(4.0 * expected * 9.80665 / 1.62, rel=1e-5)

    def of_step(dt):
        return relative_length(1.2, Record([0.0, 1.0, -1.0, 0.0], dt))

    assert jax.grad(of_step)(0.1) == pytest.approx(-20 * of_step(0.1), rel=1e-12)
    with pytest.raises(ValueError, match="`length` must be positive and finite, but is 0"):
        relative_length(0.0, sine)


def overturning_scale(block: Block, pulse: Pulse, pendulum: Pendulum | None) -> float:
    """Smallest acceleration, in units of g times the slenderness, that overturns the block (step 0.04)."""
    for size in np.arange(1.0, 12.0, 0.04):
        scaled = pulse.scaled_to(pga=size * 9.80665 * block.slenderness)
        if np.isinf(transient(Scene(block, scaled), pendulum, model=Nonlinear()).tilt):
            return float(size)
    return np.inf


@pytest.mark.parametrize("kind", ["one_sine", "ricker"])
def test_a_pendulum_of_longer_period_than_the_pulse_does_not_ease_overturning(kind):
    block = Block(width=0.8, height=4.0, mass=4000.0, restitution="housner")
    harm = {}
    for frequency in (0.4, 0.7):
        pulse = getattr(Pulse, kind)(acceleration=1.0, frequency=frequency)
        without = overturning_scale(block, pulse, None)
        for x in (0.3, 0.6, 1.5, 2.5):
            length = x * 9.80665 / (2 * np.pi * frequency) ** 2
            assert relative_length(length, pulse) == pytest.approx(x)
            pendulum = Pendulum(mass=400.0, length=length, damping_ratio=0.2)
            harm[frequency, x] = overturning_scale(block, pulse, pendulum) < without
    assert not any(harmful for (_, x), harmful in harm.items() if x >= 1.5)
    # A faster pendulum does so in at least half of the cases.
    assert sum(harmful for (_, x), harmful in harm.items() if x <= 0.7) >= 2
