"""The pendulum as it is built: loads, the pull test, and motions of a report."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.designs import SCENE
from tpd.answers.motion_history import motion_history
from tpd.design.as_built import (
    Loads,
    build_of,
    free_swing,
    loads_of,
    parts_of,
    pull_test,
    time_histories,
)
from tpd.scene.scene import Harmonic, Scene


def free_block(**losses):
    block = tpd.Block(width=0.1, height=0.4, mass=16.0, **losses)
    return Scene(block, Harmonic(amplitude=0.0, frequency=1.0))


def test_the_pull_test_counts_the_impacts_until_half_of_the_tilt():
    """e = 0.9 takes 1 - 0.81^n of the energy, which for a tenth of nu is nearly in proportion to the tilt."""
    found = pull_test(free_block(restitution=0.9))
    assert found.tilt == pytest.approx(0.025)
    assert found.sway == pytest.approx(0.01)
    assert found.force == pytest.approx(0.5 * 0.25 * 16.0 * 9.80665)
    assert found.impacts == 4
    for losses in ({"restitution": 1.0}, {"friction": 0.24, "restitution": 1.0}):
        none = pull_test(free_block(**losses))
        assert (none.impacts, np.isnan(none.seconds)) == (0, True)


def test_loads_are_the_largest_of_the_surviving_runs():
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.95)
    with_it = tpd.Pendulum(mass=900.0, length=0.7, damping_ratio=0.3)
    weak, strong, fatal = (
        Scene(block, tpd.Pulse.one_sine(acceleration=a, frequency=0.8)) for a in (1.0, 2.0, 40.0)
    )
    each = [motion_history(scene, with_it).loads(with_it) for scene in (weak, strong)]
    found = loads_of([weak, strong, fatal], with_it)
    assert found.motions == 2
    assert found[:3] == pytest.approx(np.max(each, axis=0))
    assert loads_of([fatal], with_it) is None


def test_parts_withstand_the_largest_loads(harmonic):
    """By hand, with 235/3 = 78.3 MPa: a rod of 42 mm has 7.2 + 68.7 MPa, one of 41 mm 7.6 + 73.9 MPa. The
    damper of 250 N m s/rad at 2 rad/s has 500 N m, over 0.3 m 1667 N; in a pin of 13.9 mm 13.7 kN have 45.2
    MPa."""
    loads = Loads(tension=1e4, hinge=1.2e4, rate=2.0, friction=0.1, motions=1)
    size = {"rod": 1.2, "bob_width": 0.3, "angle": 0.4, "damping": 250.0}
    build = dataclasses.replace(build_of(harmonic), loads=loads, wall=0.5, reach=0.45, **size)
    found = parts_of(build, 500.0)
    assert found._asdict() == pytest.approx(
        {
            "rod_diameter": 0.042,
            "rod_mass": 7850.0 * np.pi * 0.021**2 * 1.2,
            "pin_diameter": 0.014,
            "arm": 0.3,
            "coefficient": 250.0 / 0.09,
            "force": 500.0 / 0.3,
            "stroke": 0.24,
            "speed": 0.6,
            "stop": 0.45,
            "stop_way": 0.03,
            # Half of 500 kg m^2 at 2 rad/s are 1000 J: half of the largest force over the way.
            "stop_force": 2000.0 / 0.03,
        },
        rel=1e-12,
    )
    # Between axis and wall a damper has room that is as long as its stroke.
    narrow = parts_of(dataclasses.replace(build, wall=0.24), 500.0)
    assert (narrow.arm, narrow.stroke, narrow.stop) == pytest.approx((0.2, 0.16, 0.24))
    assert narrow.arm * 0.4 + narrow.stroke == pytest.approx(0.24)
    assert np.isnan(parts_of(dataclasses.replace(build, wall=0.15), 500.0).stop_force)
    unknown = parts_of(dataclasses.replace(build, wall=np.nan, reach=np.nan), 500.0)
    assert (unknown.arm, np.isnan(unknown.stop_force)) == (0.3, True)


def test_without_a_surviving_run_the_loads_come_from_a_free_swing():
    """From 60 degrees the bob falls by half of its rod: the tension is twice the weight."""
    found = free_swing(tpd.Pendulum(mass=100.0, length=2.0, damping_ratio=0.1), np.pi / 3.0, 10.0)
    assert found[:3] == pytest.approx((2000.0, 2000.0, np.sqrt(5.0)))
    assert (np.isnan(found.friction), found.motions) == (True, 0)


def test_a_design_as_built_has_the_rod_of_the_real_bob(harmonic, rejected, ground):
    found, with_it = build_of(harmonic), harmonic.pendulum
    g = float(SCENE.gravity)
    assert found.frequency == pytest.approx(np.sqrt(g / with_it.length) / (2.0 * np.pi))
    assert found.damping == pytest.approx(float(with_it.hinge_damping()))
    assert found.depth == pytest.approx(found.rod + 0.5 * found.bob_height)
    assert (found.mass, found.rod) == pytest.approx(found.bob.built(with_it.mass, with_it.length, g))
    assert found.mass_at_hinge == pytest.approx(found.mass * (1.0 + found.rod_share) - with_it.mass)
    assert found.loads.tension > found.weight == pytest.approx((with_it.mass + found.mass_at_hinge) * g)
    # (1 + mu) nu + k, over 1 + 2 mu for a pendulum that moves with the block.
    mu, nu, k = with_it.mass / SCENE.block.mass, float(SCENE.block.slenderness), 0.05
    most = (1.0 + mu) * nu + k
    assert found.uplift_slow_fast == pytest.approx((most / (1.0 + 2.0 * mu), most))
    assert found.uplift_harmonic[1] == pytest.approx(nu + k)
    assert found.breakaway == pytest.approx(0.05 * with_it.mass * g * with_it.length)
    # From the toppling tilt the rate is nu; half the base times the rates before and after the impact.
    jump = (1.0 + 1.0) * 0.05 * nu * np.sqrt(g * float(SCENE.block.inertia_ratio) / 0.2)
    assert found.impulse == pytest.approx(found.weight / g * jump)
    np.testing.assert_array_equal(found.parts, parts_of(found, with_it.mass * with_it.length**2))
    assert found.reach == pytest.approx(found.bob.reach(found.mass, found.rod, found.angle))
    assert build_of(rejected) is None
    assert build_of(ground).uplift_harmonic is None


def test_a_time_history_lasts_until_the_block_overturns():
    block = tpd.Block(width=1.3, height=10.0, mass=16280.0, radius_of_gyration=2.92)
    scene = tpd.Scene(block, tpd.Harmonic(amplitude=0.09, frequency=0.8))
    pendulum = tpd.Pendulum(mass=617.3, length=0.5329, damping_ratio=0.6)
    without, with_pendulum = time_histories(scene, pendulum)
    assert (without.overturned, with_pendulum.overturned) == (True, False)
    # 24 periods are 30 s.
    fall = without.times[np.isfinite(without.tilt)][-1]
    assert 35.0 < fall < without.times[-1] < 38.0
    # The tables and pictures have one axis of time for both cases.
    assert (without.times == with_pendulum.times).all()
    assert np.isfinite(with_pendulum.tilt).all()
    assert [h.swing for h in time_histories(SCENE, None)] == [None]
