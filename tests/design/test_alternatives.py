"""Measures without a pendulum; `test_assess` compares them with the runs and the answer of a block."""

import pytest

import tpd
from tpd.design.alternatives import alternatives
from tpd.design.optimise import problem_of


def test_the_tie_carries_the_moment_that_lifts_the_block():
    scene = tpd.paper_scene()
    problem = problem_of(scene, limits=(), conditions=tpd.Conditions.exactly())
    found, alone = alternatives(problem), problem.at_rest
    # About the edge: the tie acts at the height of the block, the inertia force at half of it.
    moment = scene.block.mass * 9.80665 * (alone.peak - alone.uplift) * 0.5 * scene.block.height
    assert found.tie * scene.block.height == pytest.approx(moment, rel=1e-12)
