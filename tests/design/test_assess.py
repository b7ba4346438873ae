"""The block alone: margins, sliding, runs without a pendulum, and what helps instead of one."""

import math

import numpy as np
import pytest

import tpd
from tests import designs
from tests.design.conftest import SCENE
from tpd.design.alternatives import alternatives
from tpd.design.assess import problem_alone
from tpd.design.optimise import problem_of
from tpd.records.intensity import spectral_acceleration

FEW = tpd.Ensemble(size=64, periods=30)


def test_a_statue_below_uplift_is_assessed_without_runs():
    # 0.058 g, and uplift at 0.326 g.
    statue = tpd.Block(width=0.5, height=1.5333, mass=900.0)
    motion = tpd.Harmonic(amplitude=0.058 * 9.80665 / (2 * math.pi * 2.0) ** 2, frequency=2.0)
    found = tpd.assess(tpd.Scene(statue, motion), conditions=tpd.Conditions.exactly())
    assert found.runs is None
    assert found.overturned is None
    assert found.at_rest.safety_factor == pytest.approx(0.3261 / 0.058, rel=1e-3)
    lifts, slides, verdict = str(found).splitlines()
    reaches = "the excitation reaches 0.058 g, 0.178 times as much: the block does not lift"
    assert lifts == f"  uplift      at 0.326 g; {reaches}"
    assert slides.endswith("the base is at least 0.058 (more may be needed during rocking)")
    assert verdict.startswith("NOT NEEDED: under all conditions the block without a pendulum stays at rest")
    assert "an excitation that is 5.6 times as strong would lift it" in verdict


def test_a_block_that_slides_before_uplift_is_not_simulated():
    found = tpd.assess(designs.with_block(SCENE, base_friction=0.1))
    assert found.runs is None
    assert found.sentences[0].startswith("NOT APPLICABLE: the block slides on its base before it lifts")
    assert "It slides at 0.1 g, and lifts at 0.3 g." in found.sentences[0]


def test_assess_simulates_the_validation_runs_without_a_pendulum():
    found = tpd.assess(SCENE, ensemble=FEW, seed=3)
    problem = found.problem
    assert problem.needs_none is None
    pair = problem.paired_runs(np.array([0.1, 0.3, 0.2]), found.runs.seed).without_pendulum
    np.testing.assert_array_equal(found.runs.outcome, pair.outcome)
    np.testing.assert_allclose(found.runs.tilt, pair.tilt, rtol=1e-12)
    assert found.overturned == pair.share_overturned
    assert (
        f"OVERTURNS in {100.0 * pair.share_overturned.value:.1f} % of 32 runs" in str(found).splitlines()[3]
    )
    weak = tpd.assess(SCENE, ensemble=FEW, conditions=tpd.Conditions.amplitudes(0.81), seed=3)
    assert "ROCKS, AND DOES NOT OVERTURN in any of 32 runs" in " ".join(weak.sentences)


def test_assess_and_optimise_report_equal_runs_without_pendulum():
    design = designs.harmonic_design()
    settings = {name: designs.SMALL[name] for name in ("conditions", "ensemble", "limits")}
    found, quoted = tpd.assess(SCENE, **settings).runs, design.runs.without_pendulum
    assert design.best.reported_runs is design.runs
    assert found.seed == quoted.seed
    np.testing.assert_array_equal(found.outcome, quoted.outcome)
    asked = {name: designs.GROUND[name] for name in ("conditions", "limits")}
    found, quoted = tpd.assess(designs.BLOCK, **asked).runs, designs.ground_design().runs.without_pendulum
    assert found.seed == quoted.seed
    np.testing.assert_array_equal(found.tilt, quoted.tilt)
    np.testing.assert_array_equal(found.cluster, quoted.cluster)


STATUE = tpd.Block(width=0.55, height=1.8, mass=700.0, cavity_width=0.3)
PAIR = {
    "conditions": tpd.Conditions.records(
        [tpd.records.el_centro(), tpd.records.loma_prieta()], [0.45], intensity="pga"
    )
}


def test_the_isolation_period_is_the_largest_of_all_records():
    """Independent: a sweep over 1200 periods gives 1.3 s for the pair."""
    found = alternatives(problem_of(STATUE, limits=(), **PAIR))
    assert sorted(found.periods) == pytest.approx([0.974, 1.295], abs=1e-3)
    assert found.isolation == max(found.periods)
    np.testing.assert_array_equal(
        sorted(found.periods), sorted(alternatives(problem_alone(STATUE, **PAIR)).periods)
    )
    # The displacement of an oscillator is its acceleration over the square of its rate.
    motion = problem_alone(STATUE, **PAIR).stated_motions[int(np.argmax(found.periods))]
    expected = spectral_acceleration(motion, found.isolation) * (found.isolation / (2.0 * math.pi)) ** 2
    assert found.displacement(found.isolation) == pytest.approx(expected, rel=1e-3)
    said = (
        "with 5 % damping and a period of at least 1.3 s (displacement 0.13 m) for all 2 motions, or at least"
    )
    assert said in str(found)


def test_the_uplift_check_includes_the_validation_records():
    strong, weak = tpd.records.el_centro(), tpd.records.loma_prieta().scaled(0.1)
    conditions = tpd.Conditions.records([weak], [1.5], intensity="scale")
    problem = problem_of(STATUE, conditions=conditions, limits=(), validation_share={"strong": [strong]})
    assert problem.at_rest.peak == pytest.approx(1.5 * float(strong.pga) / 9.80665)
    assert problem.needs_none is None


def test_the_isolation_period_depends_on_the_size_of_each_record():
    weak, strong = tpd.records.el_centro().scaled(1.2), tpd.records.el_centro().scaled(1.8)
    conditions = tpd.Conditions.records([weak, strong], [1.0], intensity="scale")
    periods = alternatives(problem_alone(STATUE, conditions=conditions)).periods
    level = problem_alone(STATUE, conditions=conditions).at_rest.uplift * 9.80665
    for period, motion in zip(periods, (weak, strong), strict=True):
        assert spectral_acceleration(motion, period) == pytest.approx(level, rel=1e-3)
    assert periods[0] < periods[1]
