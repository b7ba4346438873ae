"""Intensity measures against sizes that are known in closed form."""

import itertools
import math
from functools import partial

import mpmath
import numpy as np
import pytest

import tpd
from tpd import Block, Pulse, Record
from tpd.records import el_centro
from tpd.records.intensity import (
    INTENSITIES,
    base_motion,
    intensity_of,
    peak_velocity,
    significant_times,
    spectral_acceleration,
)
from tpd.scene.ground_motion import earthquakes_of, events_of

G = 9.81
BLOCK = Block(width=0.45, height=1.8, mass=900.0)
PULSE = Pulse.one_sine(acceleration=3.0, frequency=1.5)
RATE = math.sqrt(G * 0.75 / (1 + 0.25**2) / 0.9)
VELOCITY = 2 * 3.0 / (2 * math.pi * 1.5)
"""Of one sine: twice the amplitude of the velocity, since the base begins at rest."""


@pytest.mark.parametrize(
    ("name", "value", "unit"),
    [
        ("pgv", VELOCITY, "m/s"),
        ("pga", 3.0 / 9.80665, "g"),
        ("pga_star", 3.0 / (G * 0.25), "1 = the acceleration that lifts the block"),
        ("pgv_star", RATE * VELOCITY / (G * 0.25), "-"),
        ("scale", 1.0, "-"),
        ("sa", spectral_acceleration(PULSE, 1.0) / 9.80665, "g"),
    ],
)
def test_intensity_measures_of_a_sine_have_known_values(name, value, unit):
    found = intensity_of(name, BLOCK, G, 1.0 if name == "sa" else None)
    assert found.value(PULSE) == pytest.approx(value, rel=1e-9)
    assert found.unit == unit
    # All but the factor itself grow with the motion.
    assert found.value(PULSE.scaled(2.0)) == pytest.approx(value * (1 if name == "scale" else 2), rel=1e-9)


def spectral_acceleration_of_fifty_digits(motion, period, damping):
    """The closed form of every piece, in numbers of 50 digits: its largest value at the roots of the rate,
    between steps of a fortieth of a period, and of a piece."""
    with mpmath.workdps(50):
        h, omega, zeta = (mpmath.mpf(float(x)) for x in (motion.piece, 2.0 / period, damping))
        omega, x, v, largest = omega * mpmath.pi, mpmath.mpf(0), mpmath.mpf(0), mpmath.mpf(0)
        fast = omega * mpmath.sqrt(1 - zeta**2)
        exponent = mpmath.mpc(-zeta * omega, fast)
        pieces = np.asarray(motion.pieces(), dtype=float) * float(motion.pga)
        ends = [h] * len(pieces) + [2 * mpmath.pi / omega]
        for row, end in zip([*pieces, np.zeros(4)], ends, strict=True):
            a = [mpmath.mpf(float(c)) / end**k for k, c in enumerate(row)]
            p3 = -a[3] / omega**2
            p2 = -(a[2] + 6 * zeta * omega * p3) / omega**2
            p1 = -(a[1] + 4 * zeta * omega * p2 + 6 * p3) / omega**2
            p0 = -(a[0] + 2 * zeta * omega * p1 + 2 * p2) / omega**2
            size = mpmath.mpc(x - p0, -(v - p1 + zeta * omega * (x - p0)) / fast)

            def place(t, p=(p0, p1, p2, p3), size=size):
                return p[0] + t * (p[1] + t * (p[2] + t * p[3])) + (size * mpmath.exp(exponent * t)).real

            def rate(t, p=(p1, 2 * p2, 3 * p3), size=size):
                return p[0] + t * (p[1] + t * p[2]) + (size * exponent * mpmath.exp(exponent * t)).real

            n = max(4, int(20 * omega * end / mpmath.pi))
            times = [end * k / n for k in range(n + 1)]
            rates = [rate(t) for t in times]
            for (s, t), (u, w) in zip(itertools.pairwise(times), itertools.pairwise(rates), strict=True):
                turn = mpmath.findroot(rate, (s, t), solver="anderson", verify=False) if u * w < 0 else t
                largest = max(largest, abs(place(turn)))
            x, v = place(end), rate(end)
        return float(largest * omega**2)


NOISE = Record(np.random.default_rng(3).normal(size=16), 0.02)
JUMPS = Pulse.one_cosine(acceleration=3.0, frequency=1.0)


# Periods from much shorter than the step to much longer; a pulse of cubics that ends in a jump.
@pytest.mark.parametrize("damping", [0.05, 0.0, 0.6])
@pytest.mark.parametrize(
    ("motion", "period"), [*((NOISE, x) for x in (0.004, 0.05, 0.3, 30.0)), (JUMPS, 0.7), (JUMPS, 1e4)]
)
def test_the_spectral_acceleration_agrees_with_fifty_digits(motion, period, damping):
    found = spectral_acceleration(motion, period, damping)
    assert found == pytest.approx(spectral_acceleration_of_fifty_digits(motion, period, damping), rel=1e-9)


def test_the_spectral_accelerations_of_el_centro_are_known():
    # Independent: exact exponentials, 40 steps a sample.
    found = [spectral_acceleration(el_centro(), period) for period in (0.1, 0.2, 0.25, 0.3)]
    assert found == pytest.approx([6.3626, 8.0442, 8.2121, 7.4532], abs=2e-4)
    # A stiff oscillator moves with the ground.
    assert spectral_acceleration(el_centro(), 1e-6) == pytest.approx(float(el_centro().pga), rel=1e-5)


def test_invalid_periods_damping_and_intensities_are_rejected():
    spectral = partial(spectral_acceleration, PULSE)
    for call, said in (
        (lambda: spectral(-0.3), r"`period` must be positive and finite, but is -0\.3"),
        (lambda: spectral([0.1, 0.2]), r"`period` must be a number, but is \[0\.1, 0\.2\]"),
        (lambda: spectral(np.array([0.1, 0.2])), "`period` must be a single number, but is"),
        (lambda: spectral(0.3, 1.0), r"`damping` must be between 0 and 0\.99, but is 1"),
        (lambda: intensity_of("pgx", BLOCK, G, None), "`intensity` must be one of " + ", ".join(INTENSITIES)),
        (lambda: intensity_of("sa", BLOCK, G, None), "a spectral acceleration, needs `period`"),
        (lambda: intensity_of("pga", BLOCK, G, 1.0), "has an effect only with the intensity sa"),
    ):
        with pytest.raises(ValueError, match=said):
            call()


def test_ground_velocity_and_displacement_equal_the_exact_integrals():
    # Two triangles of an area of 0.1 m/s each, one up and one down.
    record = Record([0.0, 1.0, 0.0, -1.0, 0.0], 0.1, scale=2.0)
    times, *motion = base_motion(record)
    a, v, d = (np.interp(0.1 * np.arange(5), times, x) for x in motion)
    assert a == pytest.approx([0.0, 2.0, 0.0, -2.0, 0.0], abs=1e-12)
    assert v == pytest.approx([0.0, 0.1, 0.2, 0.1, 0.0], abs=1e-12)
    # The base moves 0.2 m/s times 0.2 s.
    assert d == pytest.approx([0.0, 1 / 300, 0.02, 11 / 300, 0.04], rel=1e-12)
    for wave in (record, Record(np.random.default_rng(3).standard_normal(40), 0.02, scale=-1.5), PULSE):
        _, *motion = base_motion(wave)
        peaks = [np.max(np.abs(x)) for x in motion[:2]]
        assert peaks == pytest.approx([wave.pga, peak_velocity(wave)], rel=1e-6)
    # Half of the energy in each triangle, so times are symmetric about the middle.
    constant = Record(np.ones(101), 0.1)
    assert significant_times(constant) == pytest.approx((0.5, 9.5), rel=1e-12)
    assert sum(significant_times(record)) == pytest.approx(0.4, rel=1e-12)


def test_a_motion_on_a_building_has_the_intensities_and_the_earthquake_of_the_ground():
    grounds = [tpd.records.el_centro(), tpd.records.loma_prieta()]
    roofs = [m.on_building(0.35) for m in grounds]
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0)
    for name in INTENSITIES:
        of = intensity_of(name, block, 9.80665, 0.3 if name == "sa" else None)
        assert [of.value(m) for m in roofs] == [of.value(m) for m in grounds]
    assert events_of(roofs) == events_of(grounds)
    np.testing.assert_array_equal(
        earthquakes_of([*roofs, *grounds])[:2], earthquakes_of([*roofs, *grounds])[2:]
    )
    assert roofs[0].notes[-1] == "on a building with a period of 0.35 s and 5 % damping"
    half = roofs[0].scaled(0.5)
    assert float(half.at_ground.pga) == pytest.approx(0.5 * float(grounds[0].pga))
    for wrong in ({"period": 0.0}, {"period": 1.0, "damping": 0.9}):
        with pytest.raises(ValueError, match="must be between"):
            grounds[0].on_building(**wrong)
