"""Histories under ground motions: the motion, its impacts, forces from momentum, loads of a rod."""

import dataclasses

import numpy as np
import pytest

import tpd
from tpd.answers.shaking_history import shaking_history

GRAVITY = 9.80665
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
HUNG = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
SINE = tpd.Scene(COLUMN, tpd.Pulse.one_sine(acceleration=2.0 * GRAVITY / 6.0, frequency=1.2375))


def test_the_history_is_that_of_the_motion():
    found, one = shaking_history(SINE, HUNG, free=5.0), tpd.transient(SINE, HUNG, free=5.0)
    assert np.abs(found.tilt).max() == pytest.approx(float(one.tilt), rel=1e-3)
    assert found.status == one.status
    # The last time is the end of the motion.
    assert (found.tilt[-1], found.swing[-1]) == pytest.approx(tuple(one.state[:2]), abs=1e-9)
    np.testing.assert_allclose(found.base, SINE.motion.acceleration_at(found.times))
    # The hinge rises with the axis of the block, to whichever side it leans.
    np.testing.assert_allclose(found.bob[:, 1] / 450.0, found.vertical / 9450.0, rtol=1e-12)
    assert np.ptp(np.sign(found.tilt)) == 2.0
    assert shaking_history(SINE, free=5.0).swing is None


def test_the_horizontal_force_is_the_rate_of_the_momentum_of_block_and_bob():
    t = np.linspace(0.15, 0.25, 2001)
    found = shaking_history(SINE, HUNG, times=t)
    momentum = 9000.0 * -3.0 * found.tilt + 450.0 * (-6.0 * found.tilt + 0.9 * found.swing)
    second = np.gradient(np.gradient(momentum, t), t)[5:-5]
    force = (found.horizontal - 9450.0 * found.base)[5:-5]
    assert force == pytest.approx(second, abs=2e-4 * np.abs(force).max())
    # The axis rises with the tilt: half a width times its acceleration.
    tilting = np.gradient(np.gradient(found.tilt, t), t)[5:-5]
    lifted = (found.vertical / 9450.0 - GRAVITY)[5:-5]
    assert np.abs(lifted) == pytest.approx(0.5 * np.abs(tilting), abs=2e-4 * np.abs(tilting).max())
    assert found.rocking.all()
    assert 0.1 < found.needed_friction < 1.0


def test_impacts_have_their_times_and_rates():
    found = shaking_history(SINE, free=20.0)
    assert len(found.impacts) == int(tpd.transient(SINE, free=20.0).impacts)
    times, rates = found.impacts.T
    assert np.all(np.diff(times) > 0.0)
    # In free rocking every impact takes the same share of the rate.
    free = rates[times > 1.0 / 1.2375]
    assert np.abs(free[1:] / free[:-1]) == pytest.approx(0.9595, rel=1e-9)
    assert np.abs(np.interp(times, found.times, found.tilt)).max() < 1e-3
    assert found.impacts_above(np.abs(rates[3])) == np.sum(np.abs(rates) > np.abs(rates[3])) > 0


def test_a_hanging_rod_carries_the_weight_of_its_bob():
    weak = dataclasses.replace(SINE, motion=SINE.motion.scaled(1e-6))
    tension, whole, relative = shaking_history(weak, HUNG, free=1.0).loads(HUNG)
    assert (tension, whole) == pytest.approx((450.0 * GRAVITY, 450.0 * GRAVITY), rel=1e-5)
    assert 0.0 < relative < 1e-5
    strong = shaking_history(SINE, HUNG, free=1.0).loads(HUNG)
    assert min(strong[:2]) > tension
    with pytest.raises(ValueError, match="a history without a pendulum has no loads"):
        shaking_history(weak, free=1.0).loads(HUNG)


def test_nothing_is_said_once_the_block_lies_and_bad_times_are_refused():
    fallen = shaking_history(dataclasses.replace(SINE, motion=SINE.motion.scaled(1.5)), free=20.0)
    assert tpd.status_name(fallen.status) == "overturned"
    gone = np.isnan(fallen.tilt)
    assert (gone[0], gone[-1]) == (False, True)
    assert np.all(np.diff(gone.astype(int)) >= 0)
    for times in (np.array([0.0]), np.array([1.0, 0.5]), np.array([-1.0, 1.0])):
        with pytest.raises(ValueError, match="`times` must be a vector of increasing numbers from 0 on"):
            shaking_history(SINE, times=times)
