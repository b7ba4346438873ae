"""Many searches: the front of mass against benefit, and many blocks."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.designs import SCENE
from tpd.design import pareto as module


@pytest.mark.parametrize("name", ["harmonic", "ground"])
def test_every_point_is_the_problem_with_a_lighter_bob(name, request, rejected, monkeypatch):
    design, asked, events = request.getfixturevalue(name), [], []
    monkeypatch.setattr(module, "optimise", lambda **given: asked.append(given) or rejected)
    lighter, last = tpd.front(design, (0.06,), progress=lambda *event: events.append(event))
    mass = float(design.scene.block.mass)
    assert events == [("front", 0, 1)]
    assert [lighter.most, last.most] == pytest.approx([0.06 * mass, 0.2 * mass])
    assert (last.status, last.pendulum) == (design.status.name, design.pendulum)
    assert last.saved[0] == design.benefit.mean
    assert (lighter.status, lighter.pendulum) == ("refused", None)
    assert np.isnan(lighter.saved[0])
    (given,) = asked
    space = given.pop("space")
    assert space == dataclasses.replace(design.space, mass_ratio=(0.01, 0.06))
    assert given.keys() == design.again().keys() - {"space"}
    assert all(given[key] is design.problem.inputs[key] for key in ("scene", "conditions", "limits"))
    for most in ((0.06, 0.03), (0.3,), (0.01,)):
        with pytest.raises(ValueError, match=r"`most` must be increasing masses between 0\.01 and 0\.2"):
            tpd.front(design, most)


def test_many_blocks_have_the_answer_of_each_and_statuses_by_name():
    calm, counts = tpd.Harmonic(amplitude=0.001, frequency=2.5), []
    scenes = [tpd.Scene(SCENE.block, calm)] * 2
    found = tpd.optimise_all(scenes, limits=(), progress=lambda *e: counts.append(e))
    assert found.status.tolist() == ["no_uplift"] * 2
    assert np.isnan(found.mass).all()
    assert counts == [(1, 2), (2, 2)]
    assert str(found).startswith("Designs for 2 blocks: ")
    with pytest.raises(ValueError, match="`scenes` must hold at least one scene"):
        tpd.optimise_all([])
