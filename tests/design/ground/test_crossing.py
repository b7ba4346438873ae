"""Critical intensities of designs against `tpd.critical_scale` and differences, and searches on them."""

import numpy as np
import pytest

import tpd
from tests.design.ground.conftest import BLOCK
from tests.unanswered import unanswered
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


def test_what_a_scan_does_not_overturn_has_no_demand(objective):
    _, found = CriticalIntensity(highest=1.3).follow(objective, DESIGN)
    assert (found[0] == 0.0).tolist() == 2 * [False] + 4 * [True] + 2 * [False]


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


@pytest.mark.mends("a scan began with a factor that overturned the block, and gave half of what lifts it")
def test_a_bob_in_resonance_is_followed_below_half_of_what_lifts_its_block():
    block = tpd.Block(width=1.0, height=4.0, mass=9000.0, friction=0.0, restitution="housner")
    frequency = np.sqrt(9.80665) / (2.0 * np.pi)
    train = tpd.Pulse.sine_train(acceleration=9.80665 / 4.0, frequency=frequency, cycles=10)
    objective = GroundObjective(block, tpd.Conditions.records([train], (1.0,)), (), 0.1)
    design = np.array([[0.1, 1.0 / 2.0, 0.02]])
    found = crossings(objective, design, SCAN, HIGHEST)
    hung = tpd.Pendulum(mass=900.0, length=1.0, damping_ratio=0.02)
    one = tpd.critical_scale(tpd.Scene(block, train), hung, scan=SCAN)
    # PGA over g tan alpha is the factor on this train.
    assert found[0][0, 0] == pytest.approx(float(one.scale), rel=1e-7)
    assert found[0][0, 0] < 0.34


@pytest.mark.mends("the last factor of a scan lay above its end")
def test_no_crossing_lies_above_the_end_of_the_scan(objective):
    bare = np.array([[0.0, 1.0, 0.3]])
    lift = float((objective.p.nu + objective.p.k) / objective.block.slenderness)
    known = crossings(objective, bare, 0.5, HIGHEST)[0][0]
    for i in range(0, len(known), 2):
        below, above = (crossings(objective, bare, 0.5, x * known[i] / lift)[0][0, i] for x in (0.999, 1.001))
        assert np.isinf(below)
        assert above == pytest.approx(known[i], rel=1e-7)


@pytest.mark.mends("designs without an answer at some intensity were taken to stand there")
def test_a_crossing_that_hangs_on_a_run_without_an_answer_is_named(objective, monkeypatch):
    known = crossings(objective, DESIGN, SCAN, HIGHEST)[0][0]
    lowest = known.min()
    size = objective.rows(DESIGN)[:, 5] / objective.conditions.column("amplitude")
    assert np.allclose(size, size[0])
    unanswered(monkeypatch, lambda rows: np.abs(rows[:, 5] / size[0] - 0.9 * lowest) < 0.05 * lowest)
    runs, found = CriticalIntensity(scan=SCAN, highest=HIGHEST).follow(objective, DESIGN)
    # The intensity up to which the block is known to stand: what is not known is no safety.
    assert np.all(found >= 1.0 / (0.85 * lowest))
    assert np.all(found < (1.0 + SCAN) / (0.85 * lowest))
    assert runs.undecided.all()
