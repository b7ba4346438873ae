"""The front of mass against benefit: answers with lighter bobs."""

import numpy as np
import pytest

import tpd
from tests.design.conftest import LIGHT, ONE, SCENE

SHARES = (0.03, 0.06)


def test_every_point_is_the_answer_to_the_question_with_a_lighter_bob(one):
    events = []
    points = tpd.front(one, SHARES, progress=lambda *event: events.append(event))
    assert events == [("front", 0, 2), ("front", 1, 2)]
    mass = SCENE.block.mass
    assert [p.most for p in points] == pytest.approx([0.03 * mass, 0.06 * mass, 0.1 * mass])
    assert (points[-1].status, points[-1].pendulum) == (one.status.name, one.pendulum)
    assert points[-1].saved[0] == one.winner.benefit.value
    light = tpd.DesignSpace(mass_ratio=(LIGHT.mass_ratio[0], SHARES[1]))
    again = tpd.optimise(SCENE, light, **ONE)
    assert points[1].pendulum == again.pendulum
    for p in points:
        assert (p.pendulum is None) == bool(np.isnan(p.saved[0]))
        assert p.pendulum is None or p.pendulum.mass <= p.most * (1.0 + 1e-9)


@pytest.mark.parametrize("most", [(0.06, 0.03), (0.2,), (0.01,)])
def test_masses_increase_within_the_space(one, most):
    with pytest.raises(ValueError, match=r"`most` must be increasing masses between 0\.01 and 0\.1"):
        tpd.front(one, most)
