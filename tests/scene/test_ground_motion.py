"""Ground motions in pieces: pulses against their formulas, scales, and what belongs to one earthquake."""

import jax
import numpy as np
import pytest

from tpd import Pulse, Record
from tpd.scene.ground_motion import earthquakes_of, refuse_zeros

F, A = 1.3, 2.5
W = 2 * np.pi * F


def mavroeidis(t):
    """Time derivative of the velocity of 1 m/s, gamma = 2, nu = 0.4, from the middle of the pulse."""
    h = 1e-5
    v = [0.5 * (1 + np.cos(W * s / 2.0)) * np.cos(W * s + 0.4) for s in (t - 2 * h, t - h, t + h, t + 2 * h)]
    return (v[0] - 8 * v[1] + 8 * v[2] - v[3]) / (12 * h)


PULSES = {
    "one-sine": (Pulse.one_sine(acceleration=A, frequency=F), 1.0, lambda t: A * np.sin(W * t)),
    "one-cosine": (Pulse.one_cosine(acceleration=A, frequency=F), 1.0, lambda t: A * np.cos(W * t)),
    "sine-train": (Pulse.sine_train(acceleration=A, frequency=F, cycles=3), 3.0, lambda t: A * np.sin(W * t)),
    "ricker": (
        Pulse.ricker(acceleration=A, frequency=F),
        4.0,
        lambda t: (
            A * (1 - 2 * (np.pi * F * t - 2 * np.pi) ** 2) * np.exp(-((np.pi * F * t - 2 * np.pi) ** 2))
        ),
    ),
    "mavroeidis-papageorgiou": (
        Pulse.mavroeidis_papageorgiou(velocity=1.6, frequency=F, cycles=2.0, phase=0.4),
        2.0,
        lambda t: 1.6 * mavroeidis(t - 1.0 / F),
    ),
}
"""Pulse, its periods, and its acceleration at t from its beginning, m/s^2."""


@pytest.mark.parametrize("kind", PULSES)
def test_a_pulse_follows_its_formula(kind):
    pulse, periods, formula = PULSES[kind]
    assert pulse.kind == kind
    size = {"sine-train": 3 * 128, "ricker": 1024, "mavroeidis-papageorgiou": 1024}.get(kind, 256)
    assert np.shape(pulse.pieces()) == (size, 4)
    assert pulse.duration == pytest.approx(periods / F, rel=1e-12)
    t = np.linspace(0.0, periods / F, 20_001)
    np.testing.assert_allclose(pulse.acceleration_at(t), formula(t), atol=1e-6 if "-" in kind[4:] else 1e-7)
    assert pulse.pga == pytest.approx(np.max(np.abs(formula(t))), rel=1e-6)
    np.testing.assert_array_equal(pulse.acceleration_at([-0.01, periods / F + 0.01]), 0.0)


def test_a_scaled_pulse_has_the_scaled_peak_and_derivatives():
    pulse = PULSES["mavroeidis-papageorgiou"][0]
    assert pulse.scaled(2.0).pga == pytest.approx(2.0 * pulse.pga, rel=1e-14)
    assert pulse.scaled_to(pga_g=0.3).pga == pytest.approx(0.3 * 9.80665, rel=1e-14)
    with pytest.raises(ValueError, match="exactly one of `pga` and `pga_g` must be given"):
        pulse.scaled_to()
    with pytest.raises(ValueError, match="a motion of zeros cannot be scaled"):
        Record([0.0, 0.0], 0.1).scaled_to(pga=1.0)
    # As a pytree, with its kind apart.
    slope = jax.grad(lambda p: p.pga)(Pulse.one_sine(acceleration=A, frequency=F))
    assert (slope.acceleration, slope.frequency, slope.kind) == (1.0, 0.0, "one-sine")
    with pytest.raises(ValueError, match=r"a motion of zeros cannot be scaled .* but there is one: number 2"):
        refuse_zeros([pulse, Record([0.0, 0.0], 0.1)])


def test_pulse_numbers_out_of_range_are_rejected():
    for wrong, said in (
        ({"kind": "two-sine"}, "`kind` must be one of one-sine"),
        ({"acceleration": -1.0}, "`acceleration` must be zero or positive"),
        ({"frequency": 0.0}, "`frequency` must be positive"),
        ({"kind": "mavroeidis-papageorgiou", "cycles": 9.0}, "`cycles` must be between 1 and 8, but is 9"),
        ({"kind": "sine-train", "cycles": 2.5}, "a whole number from 1 to 1000, but is 2.5"),
        ({"phase": np.inf}, "`phase` must be"),
    ):
        with pytest.raises(ValueError, match=said):
            Pulse(**{"kind": "one-sine", "acceleration": 1.0, "frequency": 1.0, **wrong})


def test_scaled_copies_of_a_record_have_one_earthquake_number():
    a, b, c = (
        Record(np.random.default_rng(i).standard_normal(50), 0.02, name=f"r{i}", event=f"e{i}")
        for i in range(3)
    )
    motions = [a, b, c, a.scaled(2.0), Pulse.ricker(acceleration=A, frequency=F)]
    numbers = earthquakes_of(motions)
    assert numbers[0] == numbers[3]
    assert sorted(set(numbers)) == [0, 1, 2, 3]
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(5)
        np.testing.assert_array_equal(earthquakes_of([motions[i] for i in order]), numbers[order])
    renamed = Record(a.acceleration, a.dt, name="other", event="other", source="file")
    assert renamed.digest == a.digest != a.scaled(2.0).digest
