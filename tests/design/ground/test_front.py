"""The front on ground motions."""

import pytest

import tpd
from tests.design.ground.conftest import BLOCK
from tpd.design import many as module


def test_under_ground_motions_the_groups_stay(records, monkeypatch):
    settings = {"method": tpd.GroundSearch(starts=6, steps=2), "limits": (tpd.limits.Stroke(),)}
    conditions = tpd.Conditions.records(records[:8], (2.0, 3.0))
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
