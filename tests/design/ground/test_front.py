"""The front on ground motions."""

import pytest

import tpd
from tests.design.ground.conftest import BLOCK
from tpd.design.result import DesignStatus


def test_under_ground_motions_the_groups_stay(records):
    settings = {"method": tpd.GroundSearch(starts=6, steps=2), "limits": (tpd.limits.Stroke(),)}
    conditions = tpd.Conditions.records(records[:8], (2.0, 3.0))
    found = tpd.optimise(BLOCK, conditions=conditions, **settings)
    points = tpd.front(found, (0.05,))
    assert [p.most for p in points] == pytest.approx([0.05 * 8000.0, found.space.mass_ratio[1] * 8000.0])
    assert points[0].status in DesignStatus.__members__
    assert points[-1].status == found.status.name
