"""Elasticities of a resting block; those of a rocking one are tested with the gradients of its motion."""

import dataclasses

import pytest

from tpd import Pendulum, paper_scene
from tpd.analysis.sensitivity import elasticities
from tpd.closed_form.no_uplift import uplift

HUNG = Pendulum(mass=3.2448, length=0.2, damping_ratio=0.1)


def test_where_the_block_rests_the_margin_is_differentiated_for_a_scene_and_its_parameters():
    p = paper_scene().parameters(HUNG)
    found = elasticities(paper_scene(), HUNG)
    assert found == elasticities(p)
    assert found.of == "margin"
    assert found.value == float(uplift(p).margin) > 0.0
    assert set(found.slopes) == {"mu", "lam", "zeta", "nu", "k", "f", "xi"}
    up, down = (float(uplift(dataclasses.replace(p, f=p.f * (1.0 + h))).margin) for h in (1e-5, -1e-5))
    assert found.slopes["f"] == pytest.approx(0.01 * (up - down) / 2e-5, rel=1e-6)
