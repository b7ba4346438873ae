"""Critical intensities of designs against `tpd.critical_scale` and differences, and searches on them."""

import numpy as np
import pytest

import tpd
from tests.design.ground.conftest import BLOCK
from tpd.core.intensity import intensity_of
from tpd.design.ground.crossing import crossings
from tpd.design.ground.demand import CriticalIntensity
from tpd.design.ground.objective import GroundObjective

SCAN, HIGHEST = 0.05, 20.0
DESIGN = np.array([[0.12, 0.4, 0.5]])
PULSES = [
    *(tpd.Pulse.ricker(acceleration=1.0, frequency=f) for f in (0.4, 0.7, 1.2)),
    tpd.Pulse.one_sine(acceleration=1.0, frequency=0.8),
]


@pytest.fixture(scope="module")
def objective() -> GroundObjective:
    return GroundObjective(BLOCK, tpd.Conditions.records(PULSES, (2.0, 3.0)), (tpd.limits.Stroke(),), 0.1)


def test_a_crossing_is_the_critical_scale_of_its_motion(objective):
    designs = np.array([[0.0, 1.0, 0.3], DESIGN[0]])
    found = crossings(objective, designs, SCAN, HIGHEST)[0]
    measure = intensity_of("pga_star", BLOCK, objective.gravity, None)
    hung = tpd.Pendulum(mass=0.12 * 8000.0, length=0.4 * 2.7, damping_ratio=0.5)
    for row, pendulum in zip(found, (None, hung), strict=True):
        for i, motion in enumerate(PULSES):
            one = tpd.critical_scale(tpd.Scene(BLOCK, motion), pendulum, scan=SCAN)
            assert row[2 * i] == row[2 * i + 1]
            assert row[2 * i] == pytest.approx(float(one.scale) * measure.value(motion), rel=1e-7)


def test_derivatives_of_crossings_are_those_of_differences(objective):
    step = 1e-4
    by = crossings(objective, DESIGN, SCAN, HIGHEST, slopes=True)[1]
    for j in range(3):
        shift = step * np.eye(3)[j]
        moved = np.concatenate([DESIGN + shift, DESIGN - shift])
        around, none = crossings(objective, moved, SCAN, HIGHEST)[:2]
        np.testing.assert_allclose(by[0, :, j], (around[0] - around[1]) / (2.0 * step), rtol=1e-3, atol=1e-4)
        assert np.isnan(none).all()


def test_what_a_scan_does_not_overturn_has_no_demand_and_no_slope(objective):
    _, found = CriticalIntensity(highest=1.3).follow(objective, DESIGN, slopes=True)
    assert (found.value[0] == 0.0).tolist() == 2 * [False] + 4 * [True] + 2 * [False]
    assert np.all(found.slope[found.value == 0.0] == 0.0)


def test_a_search_raises_the_least_critical_intensity():
    conditions = tpd.Conditions.records(PULSES, (1.2,))
    found = tpd.optimise(
        BLOCK,
        conditions=conditions,
        demand=tpd.demands.CriticalIntensity(),
        risk=tpd.Risk.worst(),
        limits=[tpd.limits.Stroke()],
        held_out={},
        method=tpd.GroundSearch(starts=12, steps=8),
    )
    assert found.value < found.bare
    objective = GroundObjective(BLOCK, found.conditions, found.limits, 0.1)
    critical = crossings(objective, found.best[None], SCAN, HIGHEST)[0]
    assert found.value == pytest.approx(1.0 / critical.min(), rel=1e-9)
