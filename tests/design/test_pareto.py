"""The front of mass against rocking."""

import numpy as np
import pytest

import tpd
from tests.design.conftest import BAND, SCENE, WIDE

SMALL = {
    "method": tpd.Sequential(searches=4, screening=48, steps=12),
    "points": 4,
    "limits": tpd.limits.POINT_BOB,
}


@pytest.fixture(scope="module")
def front():
    return tpd.pareto(SCENE, WIDE, conditions=BAND, **SMALL)


def test_the_front_falls_with_the_mass(front):
    assert front.mass_ratio.shape == front.value.shape == (4,)
    assert front.design.shape == (4, 3)
    assert np.all(np.diff(front.mass_ratio) > 0)
    assert np.all(np.diff(front.value) <= 0)
    assert np.all(front.design[:, 0] <= front.mass_ratio * (1 + 1e-9))
    assert front.mass_ratio[-1] == pytest.approx(0.2)


def test_the_front_ends_where_the_optimiser_does(front, several):
    assert front.value[-1] == pytest.approx(several.search.end_values.min(), rel=0.02)
    assert front.value[-1] >= several.search.end_values.min() * (1 - 1e-6)
    assert front.evaluations > 48


def test_progress_and_one_condition():
    events = []
    front = tpd.pareto(
        SCENE,
        WIDE,
        conditions=tpd.Conditions.exactly(),
        points=2,
        method=tpd.Sequential(searches=2, screening=16, steps=3),
        limits=(),
        progress=lambda *e: events.append(e),
    )
    assert {stage for stage, _, _ in events} == {"screening", "front"}
    assert np.isfinite(front.value).all()


def test_what_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match="`points` must be a whole number, 2 or more"):
        tpd.pareto(SCENE, points=1)
    with pytest.raises(ValueError, match=r"`starts` of a front must be Starts.rest\(\) or Starts.any\(\)"):
        tpd.pareto(SCENE, conditions=BAND, starts=tpd.Starts(size=6))
