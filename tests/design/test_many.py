"""Many searches: the front of mass against benefit, and many blocks."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tests.design.conftest import SCENE
from tests.design.ground.conftest import BLOCK, noise
from tpd.design import many as module


def test_every_point_is_the_answer_to_the_question_with_a_lighter_bob(monkeypatch):
    design, refused, asked, events = designs.single(), designs.refused(), [], []

    def answered(scene, space=None, **named):
        asked.append((scene, named.pop("space", space), named))
        return refused

    monkeypatch.setattr(module, "optimise", answered)
    lighter, last = tpd.front(design, (0.06,), progress=lambda *event: events.append(event))
    assert events == [("front", 0, 1)]
    assert [lighter.most, last.most] == pytest.approx([0.06 * 16.224, 0.2 * 16.224])
    assert (last.status, last.pendulum) == (design.status.name, design.pendulum)
    assert last.saved[0] == design.winner.benefit.value
    assert (lighter.status, lighter.pendulum) == ("refused", None)
    assert np.isnan(lighter.saved[0])
    ((scene, space, named),) = asked
    assert (scene, space) == (design.scene, dataclasses.replace(design.space, mass_ratio=(0.01, 0.06)))
    for name in ("conditions", "starts", "risk", "limits", "method", "ensemble", "worth", "seed"):
        assert named[name] is getattr(design, name), name
    for most in ((0.06, 0.03), (0.3,), (0.01,)):
        with pytest.raises(ValueError, match=r"`most` must be increasing masses between 0\.01 and 0\.2"):
            tpd.front(design, most)


def test_under_ground_motions_the_groups_stay(monkeypatch):
    records = [noise(seed, f"event {seed // 2}") for seed in range(8)]
    settings = {"method": tpd.GroundSearch(starts=6, steps=2), "limits": (tpd.limits.Stroke(),)}
    conditions = tpd.Conditions.records(records, (2.0, 3.0))
    found = tpd.optimise(BLOCK, conditions=conditions, **settings)
    asked, ask = [], module.optimise
    monkeypatch.setattr(
        module, "optimise", lambda *given, **named: asked.append(named) or ask(*given, **named)
    )
    points = tpd.front(found, (0.05,))
    assert [p.most for p in points] == pytest.approx([0.05 * 8000.0, found.space.mass_ratio[1] * 8000.0])
    assert points[-1].status == found.status.name
    (named,) = asked
    tuned, held = found.groups
    assert named["conditions"].motions == tuned.motions
    assert named["held_out"] == {held.name: held.motions}
    assert named["space"].mass_ratio == (found.space.mass_ratio[0], 0.05)
    assert (named["limits"], named["method"], named["seed"]) == (found.limits, found.method, found.seed)


def test_many_blocks_have_the_answer_of_each_and_statuses_by_name():
    calm, few = (
        tpd.Harmonic(amplitude=0.001, frequency=2.5),
        tpd.Descent(searches=3, screening=16, steps=3, model=tpd.Piecewise()),
    )
    scenes, counts = [tpd.Scene(SCENE.block, calm), tpd.Scene(SCENE.block, calm)], []
    found = tpd.optimise_all(scenes, method=few, limits=(), progress=lambda *e: counts.append(e))
    assert found.status.tolist() == ["no_uplift"] * 2
    assert np.isnan(found.mass).all()
    assert counts == [(1, 2), (2, 2)]
    assert str(found).startswith("Designs for 2 blocks: ")
    with pytest.raises(ValueError, match="`scenes` must hold at least one scene"):
        tpd.optimise_all([])
