"""What a builder is told: loads of the motions, the pull test, and how the benefit moves."""

import numpy as np
import pytest

import tpd
from tpd.answers.shaking_history import shaking_history
from tpd.design.build import loads_of, pull_test
from tpd.scene.parameters import as_arrays
from tpd.scene.scene import Harmonic, Scene
from tpd.theory import turning_tilts


def free_block(**losses):
    block = tpd.Block(width=0.1, height=0.4, mass=16.0, **losses)
    return Scene(block, Harmonic(amplitude=0.0, frequency=1.0))


@pytest.mark.parametrize(
    "losses", [{"restitution": 0.95}, {"friction": 0.02}, {"friction": 0.02, "restitution": 0.95}]
)
def test_turns_of_a_free_block_are_those_of_the_exact_solution(losses):
    """The exact solution of the linear equations from a tilt of a tenth of nu, without shaking."""
    scene = free_block(**losses)
    p = as_arrays(scene.parameters())
    nu, k, e = float(p.nu), float(p.k), float(p.velocity_ratio)
    turns, times = turning_tilts(nu, k, e, 0.1 * nu, 6)
    # Just before and after a turn the tilt is smaller, at the turn it is the closed form's.
    around = np.sort(np.concatenate([[0.0], times[1:5], times[1:5] - 0.01, times[1:5] + 0.01]))
    found = tpd.simulate(p, np.array([0.1 * nu, 0.0, 0.0, 0.0]), around, model=tpd.Piecewise())
    tilt = np.abs(np.asarray(found.ys)[1:, 0]).reshape(4, 3)
    np.testing.assert_allclose(tilt[:, 1], turns[1:5], rtol=1e-9)
    assert np.all(tilt[:, 1] >= tilt[:, [0, 2]].max(axis=1))


def test_friction_holds_a_block_beyond_its_reach():
    held = pull_test(free_block(friction=0.24))
    assert (held.impacts, np.isnan(held.seconds)) == (0, True)
    with pytest.raises(ValueError, match="`tilt`"):
        turning_tilts(0.25, 0.24, 1.0, 0.025, 3)


def test_the_pull_test_waits_for_half_of_the_tilt():
    """e = 0.9 takes 1 - 0.81^n of the energy, which for a tenth of nu is nearly in proportion to the tilt."""
    found = pull_test(free_block(restitution=0.9))
    assert found.tilt == pytest.approx(0.025)
    assert found.sway == pytest.approx(0.01)
    assert found.force == pytest.approx(0.5 * 0.25 * 16.0 * 9.80665)
    assert found.impacts == 4
    none = pull_test(free_block(friction=0.0))
    assert (none.impacts, np.isnan(none.seconds)) == (0, True)


def test_loads_are_the_largest_of_the_motions_in_which_the_block_stands():
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.95)
    hung = tpd.Pendulum(mass=900.0, length=0.7, damping_ratio=0.3)
    weak, strong, fatal = (
        Scene(block, tpd.Pulse.one_sine(acceleration=a, frequency=0.8)) for a in (1.0, 2.0, 40.0)
    )
    each = [shaking_history(scene, hung).loads(hung) for scene in (weak, strong)]
    found = loads_of([weak, strong, fatal], hung)
    assert found.motions == 2
    assert found[:3] == pytest.approx(np.max(each, axis=0))
    assert loads_of([fatal], hung) is None
