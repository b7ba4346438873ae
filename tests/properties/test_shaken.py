"""What holds for a block with its pendulum under any record: laws of the equations, and of their data."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.properties.bounded import bounded
from tpd import Block, Pendulum, Pulse, Record, Scene, status_name, transient

SAMPLES = 60
FREE = 4.0
DECIDED = ("stood", "rocked")


def ground(seed, dt, size):
    """A smooth random record whose first and last sample are zero, m/s^2."""
    noise = np.random.default_rng(seed).normal(size=SAMPLES - 2 + 8)
    inner = np.convolve(noise, np.hanning(11)[1:-1], "valid")
    return Record(acceleration=np.array([0.0, *(size * inner / np.max(np.abs(inner))), 0.0]), dt=dt)


shaken = st.builds(
    SimpleNamespace,
    width=st.floats(0.2, 1.5),
    ratio=st.floats(3.0, 8.0),
    restitution=st.one_of(st.just(1.0), st.floats(0.6, 1.0)),
    friction=st.floats(0.0, 0.05),
    seed=st.integers(0, 999),
    dt=st.floats(0.01, 0.05),
    size=st.floats(0.8, 4.0),
    mass=st.floats(0.01, 0.3),
    length=st.floats(0.1, 1.5),
    damping=st.floats(0.0, 1.0),
)


def made(x):
    """The scene and its pendulum: outside of the strategy, whose draws must not depend on anything else."""
    block = Block(
        width=x.width,
        height=x.width * x.ratio,
        mass=1000.0 * x.width**3 * x.ratio,
        restitution=x.restitution,
        friction=x.friction,
    )
    scene = Scene(block, ground(x.seed, x.dt, x.size * 9.81 / x.ratio))
    length = x.length * block.centroid
    return scene, Pendulum(mass=x.mass * block.mass, length=length, damping_ratio=x.damping)


def with_samples(scene, samples, **changes):
    return replace(scene, excitation=replace(scene.excitation, acceleration=np.asarray(samples), **changes))


def angles(motion):
    return np.array([motion.tilt, motion.swing, motion.rod_angle])


def assert_same(one, other, later=0.0, tolerance=1e-8):
    """Up to rounding: of motions that are told apart by it, only the status."""
    assert status_name(one.status) == status_name(other.status)
    assume(status_name(one.status) in DECIDED)
    np.testing.assert_allclose(angles(other), angles(one), rtol=tolerance, atol=1e-12)
    assert other.tilt_time - one.tilt_time == pytest.approx(later, abs=1e-6) or one.tilt == 0.0


@bounded(40)
@given(shaken, st.integers(1, 80), st.integers(2, 5))
def test_zeros_around_a_record_and_interpolated_samples_do_not_change_the_motion(case, zeros, times):
    scene, pendulum = made(case)
    a, dt, none = scene.excitation.acceleration, scene.excitation.dt, np.zeros(zeros)
    one = transient(scene, pendulum, free=FREE)
    before, after = (with_samples(scene, np.concatenate(parts)) for parts in ((none, a), (a, none)))
    assert_same(one, transient(before, pendulum, free=FREE), later=zeros * dt)
    # Zeros after the record are free motion.
    assert_same(one, transient(after, pendulum, free=FREE - zeros * dt))
    fine = np.interp(np.arange((len(a) - 1) * times + 1) / times, np.arange(len(a)), a)
    assert_same(one, transient(with_samples(scene, fine, dt=dt / times), pendulum, free=FREE))
    mirrored = transient(replace(scene, excitation=scene.excitation.scaled(-1.0)), pendulum, free=FREE)
    assert_same(one, mirrored, tolerance=1e-12)
    np.testing.assert_allclose(mirrored.state, -one.state, rtol=1e-9, atol=1e-12)


@bounded(40)
@given(shaken, st.integers(5, SAMPLES - 5))
def test_a_record_simulated_in_two_parts_equals_the_whole(case, cut):
    scene, pendulum = made(case)
    a = scene.excitation.acceleration
    whole = transient(scene, pendulum, free=FREE)
    first = transient(with_samples(scene, a[: cut + 1]), pendulum, free=0.0)
    assume(status_name(first.status) in DECIDED and status_name(whole.status) in DECIDED)
    second = transient(with_samples(scene, a[cut:]), pendulum, y0=first.state, free=FREE)
    largest = np.maximum(angles(first), angles(second))
    np.testing.assert_allclose(largest, angles(whole), rtol=1e-7, atol=1e-10)
    assert first.impacts + second.impacts == whole.impacts


@bounded(40)
@given(shaken, st.floats(0.3, 10.0), st.floats(0.2, 3.0))
def test_a_scale_model_under_another_gravity_has_equal_angles(case, length, gravity):
    # Lengths, gravity and accelerations by factors: times follow by the root of length over gravity. Masses
    # only count as ratios.
    scene, pendulum = made(case)
    block, time = scene.block, np.sqrt(length / gravity)
    other = Scene(
        replace(block, width=block.width * length, height=block.height * length, mass=block.mass * length**3),
        replace(scene.excitation.scaled(gravity), dt=scene.excitation.dt * time),
        gravity=scene.gravity * gravity,
    )
    with_it = replace(pendulum, mass=pendulum.mass * length**3, length=pendulum.length * length)
    one, two = transient(scene, pendulum, free=FREE), transient(other, with_it, free=FREE * time)
    assert status_name(one.status) == status_name(two.status)
    assume(status_name(one.status) in DECIDED)
    np.testing.assert_allclose(angles(two), angles(one), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(two.state[2:] * time, one.state[2:], rtol=1e-6, atol=1e-9)


@bounded(40)
@given(shaken)
def test_a_block_lifts_at_its_threshold_and_a_bob_without_mass_does_not_move_it(case):
    # Without a pendulum the block lifts at an acceleration of nu g, with friction at (nu + k) g.
    scene, pendulum = made(case)
    without, light = (transient(scene, x, free=FREE) for x in (None, replace(pendulum, mass=0.0)))
    assert status_name(light.status) == status_name(without.status)
    assert light.tilt == pytest.approx(without.tilt, rel=1e-12)
    assert without.swing == without.rod_angle == 0.0
    threshold = (scene.block.slenderness + scene.ground_parameters().k) * scene.gravity
    assume(abs(scene.excitation.pga / threshold - 1.0) > 1e-6)
    assert np.isfinite(without.uplift_time) == (scene.excitation.pga > threshold)
    if np.isfinite(without.uplift_time):
        there = scene.excitation.acceleration_at(np.array([without.uplift_time]))[0]
        assert abs(there) == pytest.approx(threshold, rel=1e-6)


@pytest.mark.parametrize(("share", "mass"), [(1.2, 0.1), (2.0, 0.0)])
def test_the_error_of_a_sampled_sine_falls_with_the_square_of_the_step(share, mass):
    block = Block(width=0.6, height=3.0, mass=2000.0, friction=0.05, restitution=1.0)
    pendulum = Pendulum(mass=mass * block.mass, length=0.6, damping_ratio=0.2)
    sine = Pulse.sine_train(
        acceleration=share * (block.slenderness + 0.05) * 9.80665, frequency=2.0, cycles=2
    )
    exact = transient(Scene(block, sine), pendulum, free=2.0)
    apart = []
    for n in (64, 128, 256):
        times = np.arange(2 * n + 1) / (2.0 * n)
        record = Record(acceleration=sine.acceleration_at(times * 1.0), dt=times[1])
        sampled = transient(Scene(block, record), pendulum, free=2.0)
        apart.append(abs(sampled.tilt - exact.tilt))
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.06)
    assert apart[1] / apart[2] == pytest.approx(4.0, rel=0.06)
