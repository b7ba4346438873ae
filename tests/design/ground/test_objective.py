"""Designs under ground motions against single motions."""

import numpy as np
import pytest

import tpd
from tests.design.ground.conftest import BLOCK, LIMITS
from tpd.design.ground import objective as module
from tpd.design.ground.objective import GroundObjective, Runs
from tpd.records.intensity import intensity_of

DESIGN = np.array([[0.12, 0.4, 0.5]])


def test_runs_are_single_motions(objective):
    hung = tpd.Pendulum(mass=0.12 * 8000.0, length=0.4 * 2.7, damping_ratio=0.5)
    found = objective.evaluate(DESIGN)
    c, measure = objective.conditions, intensity_of("pga_star", BLOCK, objective.gravity, None)
    for i in range(len(c)):
        motion = c.motions[int(c.which[i])]
        scene = tpd.Scene(BLOCK, motion.scaled(c.column("amplitude")[i] / measure.value(motion)))
        one = tpd.transient(scene, hung)
        assert found.overturned[0, i] == (tpd.status_name(one.status) == "overturned")
        if not found.overturned[0, i]:
            assert found.tilt[0, i] * float(BLOCK.slenderness) == pytest.approx(float(one.tilt), rel=1e-12)
            assert found.relative[0, i] == pytest.approx(float(one.relative), rel=1e-12)


def test_a_scattered_run_is_that_of_the_scattered_block(records):
    scatter = {"slenderness": 0.02, "mass": 0.05, "length": 0.05, "damping": 0.2, "restitution": 0.02}
    conditions = tpd.Conditions.records(records[:2], (1.5,), scatter=scatter)
    one = GroundObjective(BLOCK, conditions, LIMITS, 0.1)
    x = one.rows(DESIGN)
    for i in range(2):
        factors = {name: conditions.column(name)[i] for name in scatter}
        assert x[i, 0] == pytest.approx(float(BLOCK.slenderness) * factors["slenderness"])
        assert x[i, 1:4] == pytest.approx(
            [0.12 * factors["mass"], 0.4 * factors["length"], 0.5 * factors["damping"]]
        )
        assert x[i, 8] == pytest.approx(min(1.0, 0.93 * factors["restitution"]))


def test_sizes_are_quantiles_of_the_standing_runs(objective):
    found = objective.evaluate(DESIGN)
    names, sizes = objective.sizes(found, DESIGN)
    assert names == ("stroke", "room", "thickness")
    stands = ~found.overturned[0]
    above = np.mean(found.swing[0, stands] / 0.5 > sizes[0, 0])
    assert above <= 0.1
    assert sizes[0, 2] == pytest.approx(tpd.limits.Bob().half_height(960.0) / (0.5 * 0.4 * 2.7))


@pytest.mark.mends("a run that met too many events was taken for an overturning")
def test_a_run_without_an_answer_is_neither_a_fall_nor_rest(objective, monkeypatch):
    whole = objective.evaluate(DESIGN), objective.check(DESIGN)
    monkeypatch.setattr(module, "MAX_EVENTS", 200)
    few = objective.evaluate(DESIGN), objective.check(DESIGN)
    assert few[0].undecided.any()
    for runs, known in zip(few, whole, strict=True):
        assert not np.any(runs.overturned & runs.undecided)
        assert np.all(np.isnan(runs.tilt) == runs.undecided)
        np.testing.assert_array_equal(runs.tilt[~runs.undecided], known.tilt[~runs.undecided])
    assert np.all(np.isnan(few[0].severity) == few[0].undecided)
    # Sizes are those of the runs that are known to stand.
    stands = np.isfinite(few[0].swing[0])
    _, sizes = objective.sizes(few[0], DESIGN)
    assert sizes[0, 0] in few[0].swing[0, stands] / 0.5


def test_an_overturning_counts_as_one_and_what_is_not_known_as_nothing():
    tilt = np.array([[0.4, 1.2, np.inf, np.nan]])
    np.testing.assert_array_equal(
        Runs(tilt, tilt, tilt, np.isinf(tilt), np.isnan(tilt)).severity, [[0.4, 1.0, 1.0, np.nan]]
    )
