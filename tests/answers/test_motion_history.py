"""Histories under ground motions: the motion, its impacts, forces from momentum, loads of a rod."""

import dataclasses

import numpy as np
import pytest

import tpd
from tpd.answers.motion_history import motion_history

GRAVITY = 9.80665
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
PENDULUM = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
SINE = tpd.Scene(COLUMN, tpd.Pulse.one_sine(acceleration=2.0 * GRAVITY / 6.0, frequency=1.2375))


def test_a_history_agrees_with_the_transient():
    found, one = motion_history(SINE, PENDULUM, free=5.0), tpd.transient(SINE, PENDULUM, free=5.0)
    assert np.abs(found.tilt).max() == pytest.approx(float(one.tilt), rel=1e-3)
    assert found.status == one.status
    # The last time is the end of the motion.
    assert (found.tilt[-1], found.swing[-1]) == pytest.approx(tuple(one.state[:2]), abs=1e-9)
    np.testing.assert_allclose(found.base, SINE.excitation.acceleration_at(found.times))
    # The hinge rises with the axis of the block, to whichever side it leans.
    np.testing.assert_allclose(found.bob[:, 1] / 450.0, found.vertical / 9450.0, rtol=1e-12)
    assert np.ptp(np.sign(found.tilt)) == 2.0
    assert motion_history(SINE, free=5.0).swing is None


def test_a_positive_acceleration_gives_positive_tilt_and_negative_swing():
    found = motion_history(SINE, PENDULUM, times=np.linspace(0.0, 0.4, 100))
    assert (found.base[1:] > 0.0).all()
    assert found.tilt[-1] > 0.01
    assert found.swing.min() < -0.01
    assert found.swing.max() < 1e-9
    rocking = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.4, xi=3.0)
    times = np.linspace(0.0, 0.9, 50)
    harmonic = np.asarray(tpd.simulate(rocking, np.zeros(4), times).ys)
    # The acceleration is -f sin(xi tau).
    assert harmonic[-1, 0] < -0.001
    assert (harmonic[1:, 1] > 0.0).all()


def test_the_horizontal_force_is_the_rate_of_the_momentum_of_block_and_bob():
    t = np.linspace(0.15, 0.25, 2001)
    found = motion_history(SINE, PENDULUM, times=t)
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
    found = motion_history(SINE, free=20.0)
    assert len(found.impacts) == int(tpd.transient(SINE, free=20.0).impacts)
    times, rates = found.impacts.T
    assert np.all(np.diff(times) > 0.0)
    # In free rocking every impact takes the same share of the rate.
    free = rates[times > 1.0 / 1.2375]
    assert np.abs(free[1:] / free[:-1]) == pytest.approx(0.9595, rel=1e-9)
    assert np.abs(np.interp(times, found.times, found.tilt)).max() < 1e-3
    assert found.impacts_above(np.abs(rates[3])) == np.sum(np.abs(rates) > np.abs(rates[3])) > 0


def test_the_tension_of_a_vertical_rod_at_rest_is_the_weight_of_its_bob():
    weak = dataclasses.replace(SINE, excitation=SINE.excitation.scaled(1e-6))
    tension, whole, relative = motion_history(weak, PENDULUM, free=1.0).loads(PENDULUM)
    assert (tension, whole) == pytest.approx((450.0 * GRAVITY, 450.0 * GRAVITY), rel=1e-5)
    assert 0.0 < relative < 1e-5
    strong = motion_history(SINE, PENDULUM, free=1.0).loads(PENDULUM)
    assert min(strong[:2]) > tension
    with pytest.raises(ValueError, match="a history without a pendulum has no loads"):
        motion_history(weak, free=1.0).loads(PENDULUM)


def test_a_history_has_no_state_after_overturning():
    fallen = motion_history(dataclasses.replace(SINE, excitation=SINE.excitation.scaled(1.5)), free=20.0)
    assert tpd.status_name(fallen.status) == "overturned"
    gone = np.isnan(fallen.tilt)
    assert (gone[0], gone[-1]) == (False, True)
    assert np.all(np.diff(gone.astype(int)) >= 0)
    for times in (np.array([0.0]), np.array([1.0, 0.5]), np.array([-1.0, 1.0])):
        with pytest.raises(ValueError, match=r"must be (a vector of 2 or more increasing|zero or positive)"):
            motion_history(SINE, times=times)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (
            {"y0": np.ma.masked_array(np.zeros(4), [True, False, False, False])},
            "`y0` must have no masked elements",
        ),
        ({"y0": np.zeros(2)}, "`y0` must be \\(phi, psi, phi', psi'\\), all finite, but is"),
        ({"free": -1.0}, "`free` must be between 0 and 100000 s, but is -1"),
    ],
)
def test_invalid_times_are_rejected(wrong, said):
    with pytest.raises(ValueError, match=said):
        motion_history(SINE, **wrong)


@pytest.mark.parametrize("pendulum", [None, PENDULUM])
@pytest.mark.parametrize("free", [0.0, 0.3])
def test_every_row_of_a_surviving_motion_is_finite(pendulum, free):
    samples = np.random.default_rng(5).normal(size=37)
    steps = (0.01, 0.005, 0.02, 0.004, 1.0 / 128.0, 0.0123, 1.0 / 30.0, 0.1)
    # Slow ones would overturn the block.
    motions = [
        tpd.Record(x * min(1.0, 0.02 / dt) * samples[:n], dt)
        for dt in steps
        for n in (20, 37)
        for x in (0.5, 2.5)
    ]
    motions += [tpd.Pulse.ricker(acceleration=2.0, frequency=f) for f in (0.9, 1.7, 3.1)]
    seen = set()
    for motion in motions:
        scene = tpd.Scene(COLUMN, motion)
        found, one = motion_history(scene, pendulum, free=free), tpd.transient(scene, pendulum, free=free)
        seen.add(tpd.status_name(found.status))
        assert tpd.status_name(found.status) == tpd.status_name(one.status) != "overturned"
        columns = [found.tilt, found.horizontal, found.vertical, found.base]
        columns += [] if pendulum is None else [found.swing, *found.bob.T]
        assert np.isfinite(columns).all()
        assert found.tilt[-1] == pytest.approx(float(one.state[0]), abs=1e-10)
        assert found.times[-1] == pytest.approx(float(motion.duration) + free, rel=1e-12)
    assert seen == {"stood", "rocked"}


def test_overturning_after_the_last_time_leaves_every_row_finite():
    """The block passes its balance within the free time, and the last arc leads beyond return after it."""
    for free in (0.4, 0.5, 0.6):
        scene = dataclasses.replace(SINE, excitation=SINE.excitation.scaled(1.25))
        found, one = motion_history(scene, free=free), tpd.transient(scene, free=free)
        assert tpd.status_name(found.status) == "overturned"
        assert float(one.overturning_time) > found.times[-1]
        assert np.isfinite(found.tilt).all()
        # The last row goes on as those before it.
        onward = 3.0 * (found.tilt[-2] - found.tilt[-3]) + found.tilt[-4]
        assert found.tilt[-1] == pytest.approx(onward, abs=1e-4)


def test_the_needed_friction_of_an_overturning_block_ends_at_the_toppling_angle():
    scene = dataclasses.replace(SINE, excitation=SINE.excitation.scaled(3.0))
    found = motion_history(scene, free=5.0)
    assert found.overturned
    stands = np.abs(found.tilt) <= 1.0 / 6.0
    assert np.nanmax(np.abs(found.tilt)) > 0.5
    # The block may exceed the toppling angle and return.
    until = np.flatnonzero(stands)[-1] + 1
    forces = np.abs(found.horizontal / found.vertical)
    assert found.needed_friction == pytest.approx(np.max(forces[:until]), rel=1e-12)
    assert found.needed_friction < np.nanmax(forces)
    # A block that begins beyond its toppling angle never stands.
    beyond = motion_history(
        dataclasses.replace(SINE, excitation=SINE.excitation.scaled(1e-3)), y0=[0.3, 0.0, 0.0, 0.0]
    )
    assert np.isnan(beyond.needed_friction)


def test_the_free_motion_lasts_until_the_last_time():
    late = np.linspace(0.0, 12.0, 25)
    found, whole = (
        motion_history(SINE, PENDULUM, times=late, free=1.0),
        motion_history(SINE, PENDULUM, free=30.0),
    )
    assert np.isfinite(found.tilt).all()
    np.testing.assert_allclose(found.tilt, np.interp(late, whole.times, whole.tilt), atol=2e-3)
