"""Intensity measures against sizes that are known in closed form."""

import math

import numpy as np
import pytest

from tpd import Block, Pulse, Record
from tpd.records.intensity import INTENSITIES, intensity_of, peak_velocity, spectral_acceleration

G = 9.81
BLOCK = Block(width=0.45, height=1.8, mass=900.0)
PULSE = Pulse.one_sine(acceleration=3.0, frequency=1.5)
RATE = math.sqrt(G * 0.75 / (1 + 0.25**2) / 0.9)
VELOCITY = 2 * 3.0 / (2 * math.pi * 1.5)
"""Of one sine: twice the amplitude of the velocity, since the base begins at rest."""


@pytest.mark.parametrize(
    ("name", "value", "unit"),
    [
        ("pga", 3.0, "m/s^2"),
        ("pgv", VELOCITY, "m/s"),
        ("pga_star", 3.0 / (G * 0.25), "-"),
        ("pgv_star", RATE * VELOCITY / (G * 0.25), "-"),
        ("scale", 1.0, "-"),
    ],
)
def test_measures_of_a_sine(name, value, unit):
    found = intensity_of(name, BLOCK, G, None)
    assert found.value(PULSE) == pytest.approx(value, rel=1e-9)
    assert found.unit == unit
    # All but the factor itself grow with the motion.
    assert found.value(PULSE.scaled(2.0)) == pytest.approx(value * (1 if name == "scale" else 2), rel=1e-9)


def test_the_velocity_between_samples_counts():
    # Triangles up to the zero between the second sample and the third.
    assert peak_velocity(Record([0.0, 2.0, -1.0, 0.5], 0.1)) == pytest.approx(0.1 * (1.0 + 2.0 / 3.0))


def test_a_stiff_oscillator_feels_the_ground_and_resonance_is_known():
    record = Record(np.sin(2.0 * np.pi * np.arange(401) / 40.0), 0.025)
    assert spectral_acceleration(record, 0.01) == pytest.approx(1.0, rel=2e-3)
    # Ten periods in resonance at 5 % damping: (1 - exp(-2 pi zeta n))/(2 zeta), nearly.
    steady = (1.0 - math.exp(-2.0 * math.pi * 0.05 * 10.0)) / 0.1
    assert spectral_acceleration(record, 1.0) == pytest.approx(steady, rel=0.01)
    found = intensity_of("sa", BLOCK, G, 1.0)
    assert (found.name, found.value(record)) == ("Sa(1 s)", spectral_acceleration(record, 1.0))


def test_measures_that_do_not_exist():
    for wrong, said in (
        (("pgx", None), "`intensity` must be one of " + ", ".join(INTENSITIES)),
        (("sa", None), "`period` belongs to"),
        (("pga", 1.0), "`period` belongs to"),
        (("sa", -1.0), "`period` must be positive"),
    ):
        with pytest.raises(ValueError, match=said):
            intensity_of(wrong[0], BLOCK, G, wrong[1])
