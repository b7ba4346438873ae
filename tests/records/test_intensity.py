"""Measures of the size of a ground motion: their definitions, and oscillators that are known."""

import math

import numpy as np
import pytest

import tpd
from tpd.records.intensity import intensity_of, peak_velocity, spectral_acceleration

GRAVITY = 9.80665
STATUE = tpd.Block(width=0.45, height=1.8, mass=900.0, friction=0.0, restitution="housner")


def test_intensities_are_their_definitions():
    pulse = tpd.Pulse.one_sine(acceleration=3.0, frequency=2.0)
    unit = GRAVITY * 0.25
    rate = float(tpd.Scene(STATUE, pulse).rate)
    known = {
        "pga": 3.0,
        "pga_star": 3.0 / unit,
        # The integral of a half sine.
        "pgv": 2.0 * 3.0 / (2.0 * math.pi * 2.0),
        "pgv_star": rate * 2.0 * 3.0 / (2.0 * math.pi * 2.0) / unit,
        "scale": 1.0,
    }
    for name, value in known.items():
        assert intensity_of(name, STATUE, GRAVITY, None).value(pulse) == pytest.approx(value, rel=1e-9)
    record = tpd.Record([0.0, 2.0, -1.0, 0.5], 0.1)
    # Triangles up to the zero between the second sample and the third.
    assert peak_velocity(record) == pytest.approx(0.1 * (1.0 + 2.0 / 3.0))


def test_a_stiff_oscillator_feels_the_ground_and_resonance_is_known():
    record = tpd.Record(np.sin(2.0 * np.pi * np.arange(401) / 40.0), 0.025)
    assert spectral_acceleration(record, 0.01) == pytest.approx(1.0, rel=2e-3)
    # Ten periods in resonance at 5 % damping: (1 - exp(-2 pi zeta n))/(2 zeta), nearly.
    steady = (1.0 - math.exp(-2.0 * math.pi * 0.05 * 10.0)) / 0.1
    assert spectral_acceleration(record, 1.0) == pytest.approx(steady, rel=0.01)
