"""Computations behind a report: the pendulum as it is built, how the benefit moves, motions, responses."""

import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests import designs
from tpd.answers.response import settled_response
from tpd.answers.steady_state import sampled
from tpd.design import study as module
from tpd.design.criteria import Offset, Stroke
from tpd.design.study import build_of, moved_of, study, time_histories, usage
from tpd.models.piecewise import Piecewise
from tpd.scene.conditions import Conditions


def interrupting(stage, done, of):
    raise KeyboardInterrupt


@pytest.mark.mends("Ctrl-C left one part of a report out, and the work went on")
def test_ctrl_c_ends_the_work():
    with pytest.raises(KeyboardInterrupt):
        study(designs.single(), progress=interrupting)


def test_over_uncertain_blocks_there_is_no_response_and_the_front_is_passed_on():
    uncertain = tpd.Conditions.scatter(len(designs.band().conditions), friction=0.1)
    front, bare = designs.front(), designs.band(pendulum=None, conditions=uncertain)
    found = study(bare, front=front, progress=interrupting)
    assert (found.responses, found.build) == (None, None)
    assert found.front is front
    assert {h.with_pendulum for h in found.histories} == {False}


def test_responses_are_those_around_the_scenes_frequency():
    stages = []

    def progress(stage, done, of):
        stages.append((stage, of))
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study(designs.single(pendulum=None), progress=progress)
    assert stages == [("responding", 61)] * 2
    found = study(designs.single(pendulum=None)).responses
    (bare,) = found
    assert bare.frequency[[0, 25, -1]] == pytest.approx([1.75, 2.5, 3.75])
    one = settled_response(designs.SCENE, "frequency", np.array([2.5]))
    assert bare.amplitude[25] == pytest.approx(float(one.amplitude[0]), rel=1e-9)


def test_time_histories_are_simulations_from_rest():
    (found,) = time_histories(designs.SCENE, None)
    p = designs.SCENE.parameters()
    ys = np.asarray(tpd.simulate(p, jnp.zeros(4), sampled(p), model=Piecewise()).ys)
    assert found.tilt == pytest.approx(ys[:, 0], abs=1e-12)
    assert found.bob == pytest.approx(ys[:, 1], abs=1e-12)
    assert found.time[-1] == pytest.approx(24.0 / 2.5)
    assert [h.with_pendulum for h in time_histories(designs.SCENE, designs.HUNG)] == [False, True]


def test_usage_is_the_largest_size_over_its_limit():
    design = designs.band(limits=(Stroke(0.5), Offset(0.1)))
    sizes = dict(usage(design))
    # The widest swing and the largest tilt are those of the lowest frequency.
    assert sizes["stroke"] == pytest.approx(0.9)
    assert sizes["offset"] == pytest.approx(0.12 * np.sin(0.45 + 0.3 * 0.25) / 0.1)
    assert usage(designs.single(pendulum=None, verified=())) == ()


@pytest.mark.mends(
    "of many motions the strongest were taken, and not those near the pendulum's own frequency"
)
def test_of_many_motions_those_are_followed_in_which_the_bob_swings_most(monkeypatch):
    monkeypatch.setattr(module, "_MOTIONS", 2)
    stroke = np.linspace(0.1, 0.4, 10)
    seen = designs.evaluation(np.full(10, 0.05), stroke)
    design = designs.around(verified=(designs.verified(evaluation=seen),))
    f = design.scene.motion.frequency * design.conditions.column("frequency")
    found = module._strongest(design)
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


def test_what_moves_the_benefit_is_asked_on_both_sides(real):
    found = {m.name: m for m in moved_of(real)}
    # The block has no friction, and e follows its shape: neither can scatter, and e is moved as a number.
    same = real.saved_under(real.scene, Conditions(), 256)
    assert (found[""].low, found[""].high) == (same, same)
    names = "restitution slenderness amplitude frequency mass length damping"
    assert set(found) == {"", *names.split()}
    more = real.saved_under(real.scene, Conditions({"amplitude": np.array([1.1])}), 256)
    assert found["amplitude"].high == more
    assert moved_of(designs.refused()) == ()
