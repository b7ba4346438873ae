"""What a builder is told: loads of the motions, the pull test, and how the benefit moves."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.answers.shaking_history import shaking_history
from tpd.design import study
from tpd.design.build import loads_of, pull_test
from tpd.design.study import build_of, moved_of
from tpd.scene.conditions import Conditions
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


def test_turns_become_smaller_and_without_losses_do_not():
    turns, times = turning_tilts(0.25, 0.2, 1.0, 0.01, 40)
    assert np.all(np.diff(turns) <= 0.0)
    assert np.isfinite(times).all()
    lossless, _ = turning_tilts(0.25, 0.0, 1.0, 0.1, 10)
    np.testing.assert_allclose(lossless, 0.1, rtol=1e-12)


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


@pytest.mark.mends(
    "of many motions the strongest were taken, and not those near the pendulum's own frequency"
)
def test_of_many_motions_those_are_followed_in_which_the_bob_swings_most(monkeypatch):
    monkeypatch.setattr(study, "_MOTIONS", 2)
    stroke = np.linspace(0.1, 0.4, 10)
    seen = designs.evaluation(np.full(10, 0.05), stroke)
    design = designs.around(verified=(designs.verified(evaluation=seen),))
    f = design.scene.motion.frequency * design.conditions.column("frequency")
    found = study._strongest(design)
    assert [float(m.frequency) for m in found] == pytest.approx([f[9], f[8]])


def test_a_design_is_built_with_the_rod_of_the_body():
    found = build_of(designs.single())
    assert found.frequency == pytest.approx(np.sqrt(9.80665 / 0.12) / (2.0 * np.pi))
    assert found.damping == pytest.approx(float(designs.HUNG.hinge_damping()))
    assert found.depth == pytest.approx(found.rod + 0.5 * found.bob_height)
    assert (found.mass, found.rod) == pytest.approx(found.bob.built(1.6224, 0.12, 9.80665))
    assert found.dead == pytest.approx(found.mass * (1.0 + found.rod_share) - 1.6224)
    assert found.loads.tension > found.weight == pytest.approx((1.6224 + found.dead) * 9.80665)
    # (1 + mu) nu + k, over 1 + 2 mu for a pendulum that moves with the block.
    assert found.lifts_slow_fast == pytest.approx((0.325 / 1.2, 0.325))
    assert found.lifts[1] == pytest.approx(0.3)
    assert build_of(designs.refused()) is None


def test_a_quantity_that_is_not_moved_leaves_the_benefit():
    design = real()
    same = design.saved_under(design.scene, Conditions({"mass": np.array([1.0])}), 10**6)
    assert (same.mean, same.low) == pytest.approx((design.comparison.saved.mean, design.comparison.saved.low))


def test_what_moves_the_benefit_is_asked_on_both_sides():
    found = {m.name: m for m in moved_of(real())}
    # The block has no friction, and e follows its shape: neither can scatter, and e is moved as a number.
    same = real().saved_under(real().scene, Conditions(), 256)
    assert (found[""].low, found[""].high) == (same, same)
    assert set(found) == {
        "",
        "restitution",
        "slenderness",
        "amplitude",
        "frequency",
        "mass",
        "length",
        "damping",
    }
    more = real().saved_under(real().scene, Conditions({"amplitude": np.array([1.1])}), 256)
    assert found["amplitude"].high == more
    assert moved_of(designs.refused()) == ()


def real():
    """A design whose runs can be followed again: the bob of a chimney, judged by 64 runs."""
    from tpd.design.by_runs import PairedRuns

    block = tpd.Block(
        width=1.3, height=10.0, mass=16280.0, radius_of_gyration=2.92, restitution="housner", cavity_width=0.9
    )
    scene = Scene(block, Harmonic(amplitude=0.081, frequency=0.85))
    ratios = {"mass_ratio": 0.03, "length_ratio": 0.1, "damping_ratio": 0.6}
    hung, conditions = scene.pendulum(**ratios), Conditions.around(scene)
    ensemble = tpd.Ensemble(size=64, seed=2)
    verdict, gain = PairedRuns(scene, conditions, ensemble, tpd.limits.Worth(), None).of(hung)
    winner = designs.verified(**ratios, paired=verdict, benefit=gain)
    return dataclasses.replace(
        designs.around(worth=tpd.limits.Worth()),
        scene=scene,
        conditions=conditions,
        pendulum=hung,
        verified=(winner,),
    )
